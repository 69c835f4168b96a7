//! Requests in words: what is read, what is refused, and that writing and reading are inverse.

use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use runtime::{AgentPlan, FaultKind, Giving, OnDeath, Overload, QueuePlan, Request, WireFilter, WirePlan};
use types::header::LeastPriority;
use types::value::{Table, Value};
use types::{Category, Duration, Priority};

use super::*;

/// The keys of `add` that are no parameters of the agent.
const AGENT_KEYS: [&str; 21] = [
    "methods",
    "method",
    "refinement",
    "budget",
    "importance",
    "elasticity",
    "gap_max",
    "may_suspend",
    "rigid",
    "suspended",
    "robot",
    "period",
    "period_range",
    "cost",
    "deadline",
    "on",
    "min_gap",
    "wake_gap",
    "executor",
    "on_death",
    "hang_after",
];

fn read(line: &str) -> Result<Request, runtime::Refusal> {
    parse(&split(line).unwrap())
}

fn shown(line: &str) -> String {
    format!("{:?}", read(line).unwrap())
}

#[test]
fn blanks_between_commas_are_no_input() {
    let Ok(Request::Add(plan)) = parse(&["add", "a", "is", "b", "on= ,x, "].map(str::to_owned)) else {
        panic!("no agent")
    };
    assert_eq!(plan.on, ["x"]);
}

#[test]
fn times_that_overflow_when_they_are_taken_four_times_are_refused() {
    for span in ["2500000h", "-2500000h"] {
        let refused = read(&format!("add a is b period={span}")).unwrap_err();
        assert!(refused.what.contains("longer than ten years"), "{refused}");
    }
}

#[test]
fn more_pairs_than_anybody_types_are_refused() {
    let pairs: String = (0..5000).map(|n| format!(" k{n}=1")).collect();
    assert!(read(&format!("set a{pairs}")).unwrap_err().what.contains("5000"));
    let rows: Vec<String> = (0..5000).map(|n| format!("k{n}=1")).collect();
    let refused = read_value(&format!("{{{}}}", rows.join(","))).unwrap_err();
    assert!(refused.what.contains("at most 4096"), "{refused}");
    assert!(read_value(&format!("{{{}}}", rows[..4096].join(","))).is_ok());
}

#[test]
fn every_request_can_be_said() {
    let Ok(Request::Add(plan)) = read(
        "add sonar is sonar robot=h1 period=250ms period_range=100ms..1s on=echoes,ticks near=0.25 side=left",
    ) else {
        panic!("no agent")
    };
    assert_eq!(
        (plan.name.as_str(), plan.kind.as_str(), plan.robot.as_deref()),
        ("sonar", "sonar", Some("h1"))
    );
    assert_eq!(plan.period, Some(Duration::millis(250)));
    assert_eq!(plan.period_range, Some((Duration::millis(100), Duration::secs(1))));
    assert_eq!(plan.on, ["echoes", "ticks"]);
    assert_eq!(plan.params.get("near").unwrap().value, Value::Float(0.25));
    assert_eq!(plan.params.len(), 2);

    let Ok(Request::Wire(wire)) = read(
        "wire a.out b.in depth=8 overload=refuse every=2 priority=high marker=7 category=event recipient=b",
    ) else {
        panic!("no wire")
    };
    assert_eq!((wire.depth, wire.overload), (Some(8), Some(Overload::Refuse)));
    let filter = WireFilter {
        category: Some(Category::Event),
        least_priority: LeastPriority(Priority::High),
        marker: Some(7),
        recipient: Some("b".to_owned()),
        every: 2,
    };
    assert_eq!(wire.filter, filter);

    assert_eq!(shown("set a period=100ms"), shown("set a 'period=100ms'"));
    let Ok(Request::All(both)) = read("set a x=1 y=2 ; unwire a.out b.in") else { panic!("no three") };
    assert_eq!(both.len(), 3);
    assert!(
        matches!(read("send a.out cdr=0001ff").unwrap(), Request::Send { cdr, .. } if cdr == [0, 1, 255])
    );
    assert!(matches!(read("quit").unwrap(), Request::Quit));
}

#[test]
fn what_is_refused_says_how_to_mend_it() {
    for (line, said) in [
        ("falt wall panic", "there is no request \"falt\"; did you mean \"fault\"?"),
        ("fault wall panick", "there is no fault \"panick\"; did you mean \"panic\"?"),
        ("fault wall", "\"fault\" needs 2 words behind it, not 1; write: fault AGENT|OUTPUT KIND"),
        ("remove a b", "\"b\" is one word too many for \"remove\"; write: remove NAME"),
        ("quit now", "\"now\" is one word too many for \"quit\"; write: quit"),
        ("wire a.b c.d dept=3", "there is no option of wire \"dept\"; did you mean \"depth\"?"),
        ("wire a.b c.d depth=-3", "depth must be a whole number that is not negative, not \"-3\""),
        (
            "wire a.b c.d overload=newest",
            "there is no overload \"newest\"; it can be: newest-wins, oldest-wins, refuse",
        ),
        ("add work is queue dept=3", "there is no option of a queue \"dept\"; did you mean \"depth\"?"),
        ("wire work c.d serving=256", "serving must be a whole number that is not negative, not \"256\""),
        ("wire a.b c.d depth=3 depth=4", "\"depth\" is said twice"),
        ("add a is b on_death=leavee", "there is no policy on death \"leavee\"; did you mean \"leave\"?"),
        ("add a is b period_range=1s", "period_range is \"1s\"; write it as in \"50ms..1s\""),
        ("set a", "nothing is said of what to set in a; write: set NAME KEY=VALUE…"),
        ("set a period", "\"period\" is no KEY=VALUE; write: set NAME KEY=VALUE…"),
        ("send a.out cdr=0", "cdr must be hexadecimal digits, two a byte"),
        ("call a.half cdr=xy", "cdr must be hexadecimal digits, two a byte"),
        ("call a.half", "nothing is said of what to ask a.half; write: call SERVICE cdr=HEX [within=2s]"),
    ] {
        assert_eq!(read(line).unwrap_err().to_string(), said, "{line}");
    }
    assert!(read("add a is b period=3").unwrap_err().what.starts_with("period is \"3\": a time needs"));
    assert!(read("add a as b").unwrap_err().what.contains("stands \"is\", not \"as\""));
    assert!(parse(&[]).is_err() && read("quit ;").is_err());
}

fn name() -> impl Strategy<Value = String> {
    "[a-z][a-z0-9_-]{0,8}"
}

fn port() -> impl Strategy<Value = String> {
    (name(), name()).prop_map(|(agent, port)| format!("{agent}.{port}"))
}

fn span() -> impl Strategy<Value = Duration> {
    prop_oneof![-2i64..3, -1_000_000_000_000i64..1_000_000_000_000].prop_map(Duration)
}

fn table(
    value: impl Strategy<Value = Value>,
    key: impl Strategy<Value = String>,
) -> impl Strategy<Value = Table> {
    vec((key, value), 0..4).prop_map(|rows| {
        let mut table = Table::new();
        rows.into_iter().for_each(|(key, value)| table.set(&key, value));
        table
    })
}

fn value() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        any::<bool>().prop_map(Value::Bool),
        any::<i64>().prop_map(Value::Int),
        proptest::num::f64::ANY.prop_filter("is no number", |x| !x.is_nan()).prop_map(Value::Float),
        any::<String>().prop_map(Value::Text),
        "[0-9.einftrua-]{0,5}".prop_map(Value::Text),
        "[\\[{\"].{0,5}".prop_map(Value::Text),
    ];
    leaf.prop_recursive(3, 12, 4, |inner| {
        prop_oneof![
            vec(inner.clone(), 0..4).prop_map(|row| Value::List(row.into_iter().map(Into::into).collect())),
            table(inner, any::<String>()).prop_map(Value::Table),
        ]
    })
}

fn params() -> impl Strategy<Value = Table> {
    let key = "[a-z_]{1,8}".prop_filter("a key of add", |key| !AGENT_KEYS.contains(&key.as_str()));
    table(value(), key)
}

prop_compose! {
    fn giving()(
        (importance, elasticity, gap_max) in (option::of(-9.0..9.0), option::of(0.0..1e9), option::of(span())),
        (may_suspend, is_rigid, is_suspended) in any::<(bool, bool, bool)>(),
    ) -> Giving {
        Giving { importance, elasticity, gap_max, may_suspend, is_rigid, is_suspended }
    }
}

prop_compose! {
    fn agent()(
        (name, kind, robot, executor) in (name(), name(), option::of(name()), option::of(name())),
        (period, period_range) in (option::of(span()), option::of((span(), span()))),
        (cost, deadline, hang_after) in (option::of(span()), option::of(span()), option::of(span())),
        (min_gap, wake_gap) in (span(), span()),
        (on, leaves, params) in (vec(name(), 0..3), any::<bool>(), params()),
        (methods, method, refinement, budget) in
            (vec((name(), span()), 0..3), option::of(name()), option::of(span()), option::of(span())),
        giving in giving(),
    ) -> AgentPlan {
        let on_death = if leaves { OnDeath::Leave } else { OnDeath::Restart };
        AgentPlan { name, kind, robot, executor, period, period_range, cost, deadline, hang_after, min_gap, wake_gap, on, on_death, params, methods, method, refinement, budget, giving, ..AgentPlan::default() }
    }
}

prop_compose! {
    fn a_queue()(
        (name, depth) in (name(), option::of(any::<usize>())),
        overload in option::of(prop::sample::select(vec![Overload::NewestWins, Overload::OldestWins, Overload::Refuse])),
    ) -> QueuePlan {
        QueuePlan { depth, overload, ..QueuePlan::new(name) }
    }
}

prop_compose! {
    fn a_wire()(
        (from, to, depth) in (port(), port(), option::of(any::<usize>())),
        overload in option::of(prop::sample::select(vec![Overload::NewestWins, Overload::OldestWins, Overload::Refuse])),
        (category, priority) in (option::of(prop::sample::select(&Category::ALL[..])), prop::sample::select(&Priority::ALL[..])),
        (marker, recipient, every) in (option::of(any::<u32>()), option::of(name()), prop_oneof![0..3u32, any::<u32>()]),
        serving in option::of(any::<u8>()),
    ) -> WirePlan {
        let filter = WireFilter { category, least_priority: LeastPriority(priority), marker, recipient, every };
        WirePlan { depth, overload, filter, serving, ..WirePlan::new(from, to) }
    }
}

fn single() -> impl Strategy<Value = Request> {
    (plain(), any::<bool>())
        .prop_map(|(request, forced)| if forced { Request::Forced(Box::new(request)) } else { request })
}

fn plain() -> impl Strategy<Value = Request> {
    prop_oneof![
        agent().prop_map(Request::Add),
        a_queue().prop_map(Request::Queue),
        name().prop_map(Request::Remove),
        name().prop_map(Request::Restart),
        (name(), name(), params()).prop_map(|(agent, kind, params)| Request::Replace { agent, kind, params }),
        a_wire().prop_map(Request::Wire),
        (port(), port()).prop_map(|(from, to)| Request::Unwire { from, to }),
        (name(), "[a-z_]{1,8}", value()).prop_map(|(agent, key, value)| Request::Set { agent, key, value }),
        (port(), prop::sample::select(&FaultKind::ALL[..]))
            .prop_map(|(target, fault)| Request::Fault { target, fault }),
        (port(), vec(any::<u8>(), 0..20)).prop_map(|(port, cdr)| Request::Send { port, cdr }),
        (port(), vec(any::<u8>(), 0..20), 0i64..=60_000_000_000).prop_map(|(service, cdr, within)| {
            Request::Call { service, cdr, within: Duration::nanos(within) }
        }),
        Just(Request::Quit),
    ]
}

proptest! {
    #[test]
    fn what_is_written_is_read_back(mut requests in vec(single(), 1..4)) {
        let request = if requests.len() == 1 { requests.remove(0) } else { Request::All(requests) };
        let words = words_of(&request);
        prop_assert_eq!(format!("{:?}", parse(&words).unwrap()), format!("{request:?}"));
        prop_assert_eq!(split(&join(&words)).unwrap(), words);
    }
}
