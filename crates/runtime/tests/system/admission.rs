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
