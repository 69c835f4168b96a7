//! A table that is put while a run goes.

use super::*;

/// Ends the run as soon as something is told that has these words.
fn until(words: &'static str) -> (Arc<AtomicBool>, Told, impl Fn(&str) + Send + Sync + 'static) {
    let (end, told) = (Arc::new(AtomicBool::new(false)), Told::default());
    let (ends, tells) = (end.clone(), told.clone());
    let tell = move |text: &str| {
        tells.lock().unwrap().push(text.to_owned());
        if text.contains(words) {
            ends.store(true, Ordering::Relaxed);
        }
    };
    (end, told, tell)
}

#[test]
fn a_table_that_is_put_while_a_run_goes_is_taken_and_the_run_can_be_repeated() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    let (end, told, tell) = until("version 2 since");
    let scenario = options::scenario(&home.args(&[]), registry()).unwrap();
    let (scenario, knowing) = begin(scenario, None, tell).unwrap();
    let knowing = knowing.unwrap();
    home.put(table(0.25));
    let limit = ["--for", "10000h"];
    let summary = home.run("first", &limit, None, (&scenario, &knowing), end);
    let told = told.lock().unwrap().join("\n");
    assert!(told.contains("decision: table \"home\" version 2 since "), "{told}");
    let took = summary.incidents.iter().find(|incident| incident.what == "took table \"home\" version 2");
    assert_eq!(took.unwrap().agent, "decision");
    let table =
        summary.agents.iter().find(|agent| agent.name == "decision").unwrap().params.get("table").unwrap();
    assert_eq!(table.value.to_string(), "{ free = { wall = 0.25 } }");

    // Whatever is in the store by then.
    home.put(super::table(0.75));
    let repeat = Repeat::read(&home.log("first"), "small").unwrap();
    assert!(
        repeat.asked.iter().any(|(_, words)| words.starts_with(&["set".into(), "decision".into()])),
        "{:?}",
        repeat.asked
    );
    let scenario = options::scenario(&home.args(&[]), registry()).unwrap();
    let (scenario, knowing) = begin(scenario, Some(&repeat), |_| {}).unwrap();
    assert_eq!(weight_in(&scenario.file.plan), 1.0, "as it was at its start");
    let again = home.run("again", &limit, Some(repeat), (&scenario, &knowing.unwrap()), Arc::default());
    assert_eq!(again.repeat.unwrap().differs, None);
    assert!(fs::read(home.log("first")).unwrap() == fs::read(home.log("again")).unwrap());
}

#[test]
fn a_table_that_is_refused_is_told_once_and_the_old_one_stays() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    let (scenario, knowing, told) = home.begun(&[]).unwrap();
    with_watch((&scenario, &knowing), ClockChoice::Sim, |watch, asked| {
        watch.look(Duration::ZERO).unwrap();
        let mut bad = table(0.5);
        bad.weights.set("freee", bad.weights.get("free").unwrap().clone());
        home.put(bad);
        watch.look(Duration::ZERO).unwrap();
        home.put(schedule("bell", every(0, 1), "restart wall"));
        watch.look(Duration::ZERO).unwrap();
        assert_eq!(
            *told.lock().unwrap(),
            [
                knowing_first(&home),
                "decision: table \"home\" version 1 stays, for version 2 is refused (there is no situation \"freee\"; did you mean \"free\"?)".into(),
                "the schedules have changed; in simulated time that counts from the next run on".into(),
            ]
        );
        let kept = asked.deeds();
        assert_eq!(kept.len(), 1);
        assert!(
            kept[0].what.starts_with("kept table \"home\" version 1, for version 2 is refused ("),
            "{kept:?}"
        );
        home.put(table(0.75));
        watch.look(Duration::ZERO).unwrap();
        assert_eq!(asked.deeds()[1].what, "took table \"home\" version 3");
        home.store().remove(knowledge::Kind::Table, "home").unwrap();
        watch.look(Duration::ZERO).unwrap();
        let last = told.lock().unwrap().last().unwrap().clone();
        assert_eq!(last, "decision: there is no table \"home\" any more; version 3 stays");
    });
}

fn knowing_first(home: &Home) -> String {
    format!("[decide] is now table \"home\", version 1, in {}", home.0.join("home.db").display())
}

#[test]
fn a_table_may_name_agents_that_this_run_leaves_out() {
    let eye = "[agent.eye]\nis = \"eye\"\nperiod = \"1s\"\n";
    let home = Home::new(&[SYSTEM, DECIDE, eye, KNOWS]);
    home.put(table(0.5));
    let only = ["--only", "decision,eye"];
    let (scenario, knowing, told) = home.begun(&only).unwrap();
    let scenario = options::only(&home.args(&only), scenario).unwrap();
    assert!(scenario.file.plan.agent("wall").is_none());
    with_watch((&scenario, &knowing), ClockChoice::Sim, |watch, asked| {
        home.put(table(0.75));
        watch.look(Duration::ZERO).unwrap();
        assert_eq!(asked.deeds()[0].what, "took table \"home\" version 2", "{told:?}");
    });
}

#[test]
fn a_run_that_has_ended_is_not_asked() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    let (scenario, knowing, told) = home.begun(&[]).unwrap();
    let before = told.lock().unwrap().len();
    let ready = scenario.prepare(1).unwrap();
    let simulation = Simulation::new(&ready.plan, &ready.registry, Options::default()).unwrap();
    let mut watch = Watch::of(&knowing, &simulation.control(), &Asked::default(), ClockChoice::Sim).unwrap();
    drop(simulation);
    home.put(table(0.5));
    assert_eq!(watch.look(Duration::ZERO), Err(Ended));
    assert_eq!(told.lock().unwrap().len(), before, "its end is no refusal");
}
