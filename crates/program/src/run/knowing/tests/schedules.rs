//! Schedules that fire, on both clocks.

use super::*;

#[test]
fn schedules_fire_in_simulated_time_the_same_each_time() {
    let begins = "begins = \"2026-03-02 07:59\"\n";
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS, begins]);
    home.put(schedule("bell", every(10, 30), "set wall keep=0.6"));
    home.put(schedule("eight", When::Cron("0 8 * * mon".parse().unwrap()), "set wall keep=0.7"));
    home.put(schedule("once", When::Once(Time::ZERO + Duration::secs(50)), "restart nobody"));
    home.put(schedule("halt", When::Once(Time::ZERO + Duration::secs(20)), "stop"));
    home.put(schedule("wrong", every(0, 1), "falt wall panic"));
    let run = |out: &str| {
        let (scenario, knowing, told) = home.begun(&[]).unwrap();
        let told = told.lock().unwrap().last().cloned();
        (home.run(out, &["--for", "100s"], None, (&scenario, &knowing), Arc::default()), told)
    };
    let (summary, told) = run("first");
    let wrong =
        "warning: schedule \"wrong\" does not fire: there is no request \"falt\"; did you mean \"fault\"?";
    assert_eq!(told.as_deref(), Some(wrong));
    let fired: Vec<_> = summary
        .incidents
        .iter()
        .map(|incident| (incident.time.seconds(), incident.agent.as_str(), incident.what.as_str()))
        .collect();
    let (bell, keep) = ("schedule \"bell\"", "asked: set wall keep=0.6");
    assert_eq!(
        fired,
        [
            (10.0, bell, keep),
            (20.0, "schedule \"halt\"", "asked: stop"),
            (40.0, bell, keep),
            (
                50.0,
                "schedule \"once\"",
                "asked: restart nobody; refused: there is no agent \"nobody\"; it can be: decision, wall"
            ),
            (60.0, "schedule \"eight\"", "asked: set wall keep=0.7"),
            (70.0, bell, keep),
        ]
    );
    let text = summary.to_text(false);
    for line in [
        "schedule \"bell\" asked for \"set wall keep=0.6\" at 10 s, and 2 more times until 70 s\n",
        "schedule \"halt\" asked for \"stop\" at 20 s\n",
        "schedule \"eight\" asked for \"set wall keep=0.7\" at 60 s\n",
        "schedule \"once\" asked for \"restart nobody\"; refused: there is no agent \"nobody\"; it can be: decision, wall at 50 s\n",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
    run("second");
    let first = fs::read(home.log("first")).unwrap();
    assert!(first == fs::read(home.log("second")).unwrap(), "the same store, the same log");
    // The schedules of the log are asked again, and not those of the store.
    home.store().remove(knowledge::Kind::Schedule, "bell").unwrap();
    let repeat = Repeat::read(&home.log("first"), "small").unwrap();
    let scenario = options::scenario(&home.args(&[]), registry()).unwrap();
    let (scenario, knowing) = begin(scenario, Some(&repeat), |_| {}).unwrap();
    let limit = ["--for", "100s"];
    let again = home.run("again", &limit, Some(repeat), (&scenario, &knowing.unwrap()), Arc::default());
    assert_eq!(again.repeat.unwrap().differs, None);
    run("without");
    assert!(first != fs::read(home.log("without")).unwrap());
}

#[test]
fn schedules_fire_on_the_wall_clock_as_they_become_due_and_new_ones_too() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    home.put(schedule("bell", every(10, 30), "set wall keep=0.6"));
    home.put(schedule("late", When::Once(Time::ZERO + Duration::secs(45)), "stop"));
    let (scenario, knowing, told) = home.begun(&[]).unwrap();
    with_watch((&scenario, &knowing), ClockChoice::Wall, |watch, asked| {
        let mut fired = |seconds: i64| {
            let before = asked.deeds().len();
            watch.look(Duration::secs(seconds)).unwrap();
            let deeds = asked.deeds().split_off(before);
            deeds.into_iter().map(|deed| format!("{}: {}", deed.agent, deed.what)).collect::<Vec<_>>()
        };
        let bell = "schedule \"bell\": asked: set wall keep=0.6";
        assert_eq!(fired(10), [] as [&str; 0], "a time is due when it is over");
        assert_eq!(fired(11), [bell]);
        assert_eq!(fired(39), [] as [&str; 0]);
        home.put(schedule("new", every(0, 20), "set wall keep=0.7"));
        home.put(schedule("wrong", every(0, 20), "falt wall"));
        let new = "schedule \"new\": asked: set wall keep=0.7";
        assert_eq!(fired(41), [bell, new]);
        assert_eq!(fired(50), ["schedule \"late\": asked: stop"]);
        home.store().remove(knowledge::Kind::Schedule, "bell").unwrap();
        assert_eq!(fired(101), [new, new, new]);
        let told = told.lock().unwrap();
        assert!(
            told.iter().filter(|text| text.contains("schedule \"wrong\" does not fire")).count() == 1,
            "{told:?}"
        );
    });
}

#[test]
fn a_schedule_that_never_ends_asks_for_no_more_than_can_be() {
    let bell = [schedule("bell", every(0, 1), "restart wall")];
    let (firings, until) = firing::firings(&bell, Duration::ZERO, Some(Duration(i64::MAX)));
    assert_eq!((firings.len(), until), (100_000, Some(Duration::secs(100_000))));
    let (firings, until) = firing::firings(&bell, Duration::ZERO, None);
    assert_eq!((firings.len(), until), (86_400, None));
    let (firings, _) = firing::firings(&[], Duration::ZERO, Some(Duration(i64::MAX)));
    assert!(firings.is_empty());
}
