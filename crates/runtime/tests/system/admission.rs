//! What makes somebody miss its deadline is refused, with the numbers.

use super::*;
use runtime::{Admission, CannotRun, Report};

/// Does nothing.
#[derive(Agent)]
struct Idle {
    /// Nothing.
    out: Output<Twist>,
    /// Nothing.
    from: Input<Twist>,
}

impl Agent for Idle {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.out.send(Twist::default());
        while self.from.take().is_some() {}
        Ok(())
    }
}

fn idle(name: &str, executor: &str, period: i64, cost: i64) -> AgentPlan {
    AgentPlan {
        name: name.to_owned(),
        kind: "idle".to_owned(),
        period: Some(Duration::millis(period)),
        cost: Some(Duration::millis(cost)),
        executor: Some(executor.to_owned()),
        ..AgentPlan::default()
    }
}

/// 3 of 10 above 10 of 40: by hand 3 and 16 on one processor.
fn two() -> Plan {
    let mut plan = Plan::new("two");
    plan.agents = vec![idle("high", "reflex", 10, 3), idle("low", "control", 40, 10)];
    plan
}

fn words(words: &[String]) -> Result<Request, Refusal> {
    if words.iter().any(|word| word == ";") {
        return words.split(|word| word == ";").map(self::words).collect::<Result<_, _>>().map(Request::All);
    }
    let cost = |text: &str| text.parse::<i64>().map_err(|_| Refusal::new("no number"));
    match &words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["add", name, executor, period, millis] => {
            Ok(Request::Add(idle(name, executor, cost(period)?, cost(millis)?)))
        }
        ["set", agent, key, value] => Ok(Request::Set {
            agent: (*agent).into(),
            key: (*key).into(),
            value: Value::Text((*value).into()),
        }),
        ["set", agent, pair] => {
            let (key, value) = pair.split_once('=').ok_or_else(|| Refusal::new("no pair"))?;
            Ok(Request::Set { agent: (*agent).into(), key: key.into(), value: Value::Text(value.into()) })
        }
        ["force", rest @ ..] => {
            let rest: Vec<String> = rest.iter().map(|word| (*word).to_owned()).collect();
            self::words(&rest).map(|request| Request::Forced(Box::new(request)))
        }
        other => Err(Refusal::new(format!("{other:?}"))),
    }
}

/// What becomes of requests that are asked one after another.
fn asked(plan: &mut Plan, processors: usize, requests: &[&str]) -> Result<Report, CannotRun> {
    for (at, request) in requests.iter().enumerate() {
        let words = request.split(' ').map(str::to_owned).collect();
        plan.requests.push(TimedRequest {
            at: Duration::millis(at as i64 + 1),
            words,
            place: Span::default(),
        });
    }
    let admission = Some(Admission { processors, ..Admission::default() });
    let options =
        Options { limit: Some(Duration::millis(50)), admission, parse: words, ..Options::default() };
    Simulation::new(plan, &registry![Idle], options)?.run()
}

fn said(report: &Report) -> Vec<String> {
    report.incidents.iter().map(|incident| incident.what.clone()).collect()
}

#[test]
fn who_does_not_fit_is_refused_with_the_numbers_and_the_period_that_fits() {
    // A third of 12 every 40 above both: 12 + 3 + 3, and the low one has 10 + 12 + 3 * 4 at 34, 10 + 12 + 3 * 4.
    let report = asked(&mut two(), 1, &["add third reflex 40 12", "add fourth reflex 40 12"]).unwrap();
    let said = said(&report);
    // The high one waits for a step of the third, which it shares its thread with: 3 + 12 + 12.
    assert!(said[0].contains("refused: the deadlines would not be met: high would be done after 27.000 ms at worst, and has 10.000 ms"), "{said:?}");
    assert!(said[1].contains("refused"), "{said:?}");
    let names: Vec<&str> = report.view.agents.iter().map(|agent| agent.name.as_str()).collect();
    assert_eq!(names, ["high", "low"]);
}

#[test]
fn a_period_that_fits_is_named_and_does_fit() {
    // Above the high one, on a thread of its own: 4 of 8 leave 3 of 10 in time (4 + 3 = 7, 11 is too late), and nothing for the low one.
    let report = asked(&mut two(), 1, &["add third receive 8 4", "add third receive 12 4"]).unwrap();
    let first = &said(&report)[0];
    let help = first.split("third fits with a period of ").nth(1).unwrap_or_else(|| panic!("{first}"));
    let millis: f64 = help.split("ms").next().unwrap().parse().unwrap();
    // By hand: within 40 ms the low one has 10, four times 3, and up to 18 of the third: k steps of 4 with 22 + 4 k done by k periods.
    // k = 4: 38 ≤ 4 T, T = 9.5; and the high one asks for 7 only.
    assert_eq!(millis, 9.5);
    assert!(!said(&report)[1].contains("refused"), "{:?}", said(&report));
    let again = asked(&mut two(), 1, &[&format!("add third receive {} 4", millis.ceil())]).unwrap();
    assert!(!said(&again)[0].contains("refused"));
}

#[test]
fn a_second_processor_takes_what_one_cannot() {
    let requests = ["add third receive 8 4"];
    assert!(said(&asked(&mut two(), 1, &requests).unwrap())[0].contains("refused"));
    assert!(!said(&asked(&mut two(), 2, &requests).unwrap())[0].contains("refused"));
}

#[test]
fn what_is_set_is_checked_and_what_is_forced_is_told() {
    let requests = [
        "set high period 5ms",
        "set low cost 25ms",
        "force set low cost 25ms",
        "set high cost 4ms",
        "set low cost 10ms",
    ];
    let report = asked(&mut two(), 1, &requests).unwrap();
    let said = said(&report);
    // 3 of 5: the low one has 10 + 3 * 5 at 25.
    assert!(!said[0].contains("refused"), "{said:?}");
    // 3 of 5 and 25 of 40 are more than one processor.
    assert!(said[1].contains("refused: the deadlines would not be met: low might"), "{said:?}");
    assert!(said[2].starts_with("admitted by force: the deadlines would not be met: low"), "{said:?}");
    // Who is late already is no reason to refuse what makes nobody else late.
    assert!(!said[4].contains("refused"), "{said:?}");
    assert!(!said[5].contains("refused"), "{said:?}");
}

#[test]
fn a_cost_below_nothing_is_refused() {
    let said = said(&asked(&mut two(), 1, &["set high cost -1ms", "add third reflex 40 -1"]).unwrap());
    assert!(said.iter().all(|said| said.contains("no step gives time back")), "{said:?}");
    assert_eq!(said.len(), 2);
}

#[test]
fn a_plan_that_does_not_fit_does_not_begin() {
    let mut plan = two();
    plan.agents.push(idle("third", "receive", 9, 4));
    let Err(CannotRun::Refused(refusal)) = asked(&mut plan, 1, &[]) else { panic!("it began") };
    assert!(refusal.what.contains("low would be done after"), "{refusal}");
    let mut circle = two();
    for (from, to) in [("high", "low"), ("low", "high")] {
        circle.wires.push(WirePlan::new(format!("{from}.out"), format!("{to}.from")));
        circle.agent_mut(to).unwrap().on.push("from".to_owned());
    }
    let Err(CannotRun::Refused(refusal)) = asked(&mut circle, 1, &[]) else { panic!("it began") };
    assert!(refusal.what.starts_with("agents make each other run in a circle: "), "{refusal}");
}

/// What somebody types who does what a refusal proposes.
fn proposed(refusal: &str) -> String {
    let (_, command) =
        refusal.split_once(": sinew ").unwrap_or_else(|| panic!("nothing proposed: {refusal}"));
    command.replace("';'", ";")
}

/// The same two, of which one gives way in its period.
fn giving(high: Option<i64>, low: Option<i64>) -> Plan {
    let mut plan = two();
    for (agent, longest) in plan.agents.iter_mut().zip([high, low]) {
        agent.period_range = longest.map(|longest| (agent.period.unwrap(), Duration::millis(longest)));
    }
    plan
}

#[test]
fn others_that_could_make_room_are_named_with_what_can_be_typed_and_then_it_fits() {
    // 4 of 8 above 3 of 10 and 10 of 40, of which the high one may run every 30 ms. By hand: 10 + 4 * 5 + 3 m within 40 ms, so m is 3, and these 39 ms
    // have no more than three releases of the high one where it runs every 13 ms.
    let request = "add third receive 8 4";
    let refused = &said(&asked(&mut giving(Some(30), None), 1, &[request]).unwrap())[0];
    let help = refused.split("; --force").nth(1).unwrap();
    assert!(help.starts_with(" does it all the same; or make room first, with high every "), "{refused}");
    let command = proposed(refused);
    assert_eq!(command, "set high period=13ms", "{refused}");
    // Typed, or together with what was asked for.
    let then = said(&asked(&mut giving(Some(30), None), 1, &[&command, request]).unwrap());
    assert!(!then.iter().any(|said| said.contains("refused")), "{then:?}");
    let whole = format!("{command} ; {request}");
    assert!(!said(&asked(&mut giving(Some(30), None), 1, &[&whole]).unwrap())[0].contains("refused"));
    // It is the nearest.
    let shorter = format!("set high period=12999us ; {request}");
    assert!(said(&asked(&mut giving(Some(30), None), 1, &[&shorter]).unwrap())[0].contains("refused"));
}

#[test]
fn the_one_that_is_late_may_give_way_itself_and_all_that_give_are_in_one_command() {
    let request = "add third receive 8 4";
    let refused = &said(&asked(&mut giving(Some(30), Some(90)), 1, &[request]).unwrap())[0];
    let command = proposed(refused);
    assert!(refused.contains(" and low every ") && command.contains("; set low period="), "{refused}");
    let whole = format!("{command} ; {request}");
    assert!(!said(&asked(&mut giving(Some(30), Some(90)), 1, &[&whole]).unwrap())[0].contains("refused"));
}

#[test]
fn who_is_rigid_or_may_not_give_enough_or_is_asked_for_is_not_proposed() {
    let nothing = |plan: &mut Plan, request: &str| {
        let said = said(&asked(plan, 1, &[request]).unwrap());
        assert!(said[0].contains("refused: the deadlines would not be met"), "{said:?}");
        assert!(!said[0].contains("make room"), "{said:?}");
    };
    let request = "add third receive 8 4";
    nothing(&mut giving(None, None), request);
    nothing(&mut giving(Some(12), None), request);
    let mut rigid = giving(Some(30), None);
    rigid.agent_mut("high").unwrap().giving.is_rigid = true;
    nothing(&mut rigid, request);
    let mut stiff = giving(Some(30), None);
    stiff.agent_mut("high").unwrap().giving.elasticity = Some(0.0);
    nothing(&mut stiff, request);
    // It says its own period: only others could make room for that.
    nothing(&mut giving(Some(30), None), "set high cost 9ms");
    // A deadline that is said stays where it is, though the period that is as long grows.
    let mut said = giving(None, Some(90));
    said.agent_mut("low").unwrap().deadline = Some(Duration::millis(40));
    nothing(&mut said, request);
    // Then others give what is needed.
    let mut said = giving(Some(30), Some(90));
    said.agent_mut("low").unwrap().deadline = Some(Duration::millis(40));
    let refused = &self::said(&asked(&mut said, 1, &[request]).unwrap())[0];
    assert_eq!(proposed(refused), "set high period=13ms");
}

#[test]
fn who_was_late_before_gets_no_room_by_what_others_are_asked_for() {
    let mut plan = giving(Some(30), None);
    plan.agent_mut("low").unwrap().executor = Some("vision".into());
    // The low one is forced to be late. Above it 15 of 20 and 3 of 10 are too much; they have 15 + 3 where the high one leaves them alone for 18 ms.
    let force = "force set low cost 39ms";
    let report = asked(&mut plan.clone(), 1, &[force, "add third control 20 15"]).unwrap();
    let said = said(&report);
    assert!(said[0].starts_with("admitted by force"), "{said:?}");
    assert!(said[2].contains("not be met: third might never be done"), "{said:?}");
    assert_eq!(proposed(&said[2]), "set high period=18ms", "though the low one goes on to be late");
    let all = [force, "set high period=18ms", "add third control 20 15"];
    assert!(!self::said(&asked(&mut plan, 1, &all).unwrap()).iter().any(|said| said.contains("refused")));
}

#[test]
fn messages_that_make_somebody_run_less_often_make_room_too() {
    let mut plan = two();
    plan.agents.push(AgentPlan { on: vec!["from".into()], period: None, ..idle("echo", "receive", 0, 2) });
    plan.agents[2].deadline = Some(Duration::millis(40));
    plan.agents[2].giving.gap_max = Some(Duration::millis(40));
    plan.wires.push(WirePlan::new("high.out", "echo.from"));
    let request = "set low cost 20ms";
    let refused = said(&asked(&mut plan.clone(), 1, &[request]).unwrap());
    let refused = refused.iter().find(|said| said.contains("refused")).unwrap();
    assert!(
        refused.contains("with steps of echo ") && refused.contains(" apart: sinew set echo min_gap="),
        "{refused}"
    );
    let whole = format!("{} ; {request}", proposed(refused));
    let then = said(&asked(&mut plan, 1, &[&whole]).unwrap());
    assert!(!then.iter().any(|said| said.contains("refused")), "{then:?}");
}

#[test]
fn a_plan_that_does_not_fit_is_told_what_could_be_set_at_its_start() {
    let mut plan = giving(Some(30), None);
    plan.agents.push(idle("third", "receive", 8, 4));
    let Err(CannotRun::Refused(refusal)) = asked(&mut plan.clone(), 1, &[]) else { panic!("it began") };
    let help = refusal.help.unwrap();
    let (_, set) = help.split_once(": --set agent.high.period=").unwrap_or_else(|| panic!("{help}"));
    plan.agent_mut("high").unwrap().period = Some(set.parse().unwrap());
    assert!(asked(&mut plan, 1, &[]).is_ok());
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(200))]

    /// Whatever is refused with a proposal is admitted once that was done, and nobody is set beyond what it allows.
    #[test]
    fn what_is_proposed_is_admitted_and_then_the_request_is(
        agents in proptest::collection::vec((0..3_usize, 1..12_i64, 1..6_i64, 1..5_i64, proptest::bool::weighted(0.2)), 1..6),
        guest in (0..3_usize, 1..12_i64, 1..10_i64),
    ) {
        let executor = |at: usize| ["reflex", "control", "vision"][at];
        let mut plan = Plan::new("drawn");
        for (at, (level, tens, cost, times, said)) in agents.into_iter().enumerate() {
            let mut agent = idle(&format!("a{at}"), executor(level), tens * 10, cost);
            agent.period_range = Some((Duration::millis(tens * 10), Duration::millis(tens * 10 * times)));
            agent.deadline = said.then_some(Duration::millis(tens * 10));
            plan.agents.push(agent);
        }
        let request = format!("add guest {} {} {}", executor(guest.0), guest.1 * 10, guest.2 * 2);
        let Ok(report) = asked(&mut plan.clone(), 1, &[&request]) else { return Ok(()) };
        let said = said(&report);
        let Some((_, command)) = said[0].split_once(": sinew ") else { return Ok(()) };
        let command = command.replace("';'", ";");
        let then = asked(&mut plan, 1, &[&command, &request]).unwrap();
        proptest::prop_assert!(!self::said(&then).iter().any(|said| said.contains("refused")), "{:?}", self::said(&then));
    }
}
