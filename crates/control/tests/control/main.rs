//! A running system and its control socket: every command, refusals, and clients that do not behave.

#![allow(clippy::unwrap_used)] // clippy takes only what bears #[test] for a test

mod lab;

use std::fs;
use std::io::{BufReader, Read, Write};
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::thread::JoinHandle;
use std::time::Duration as HostDuration;

use control::protocol::LONGEST_LINE;
use control::sockets::{socket_of, sockets_in};
use control::{Client, ClientError, Event, Limits, Server, shapes, words};
use serde_json::{Value as Json, json};

use lab::{Lab, Scratch, next};

fn refusal(result: Result<Json, ClientError>) -> String {
    match result {
        Err(ClientError::Refused(refusal)) => refusal.to_string(),
        other => panic!("not refused: {other:?}"),
    }
}

fn agent<'a>(shape: &'a Json, name: &str) -> &'a Json {
    shape["agents"].as_array().unwrap().iter().find(|agent| agent["name"] == name).unwrap_or(&Json::Null)
}

/// Whether `found` is what the documentation shows: `"…"` stands for anything, and at the end of a row for the rest of it.
fn matches(shown: &Json, found: &Json) -> bool {
    match (shown, found) {
        (Json::String(any), _) if any == "…" => true,
        (Json::Array(shown), Json::Array(found)) => {
            let open = shown.last().is_some_and(|last| last == "…");
            let fixed = shown.len() - usize::from(open);
            (found.len() == fixed || open && found.len() > fixed)
                && shown[..fixed].iter().zip(found).all(|(shown, found)| matches(shown, found))
        }
        (Json::Object(shown), Json::Object(found)) => {
            shown.len() == found.len()
                && shown.iter().all(|(key, shown)| found.get(key).is_some_and(|found| matches(shown, found)))
        }
        _ => shown == found,
    }
}

#[test]
fn the_conversation_of_the_documentation_takes_place() {
    let lab = Lab::start();
    let path = lab.server.as_ref().unwrap().path();
    let mut stream = UnixStream::connect(path).unwrap();
    let mut lines = BufReader::new(stream.try_clone().unwrap());
    let text = include_str!("../../src/protocol.md");
    // Everything is said in the order of the page, but that the end of the run comes last.
    let (before, rest) = text.split_once("> {\"id\": 32").unwrap();
    let (quit, after) = rest.split_once("```").unwrap();
    let page = format!("{before}{after}> {{\"id\": 32{quit}");
    let mut said = 0;
    for line in page.lines() {
        if let Some(question) = line.strip_prefix("> ") {
            writeln!(stream, "{question}").unwrap();
        } else if let Some(shown) = line.strip_prefix("< ") {
            let shown: Json = serde_json::from_str(shown).unwrap();
            let mut found = next(&mut lines);
            // Events come when they come.
            while found.get("event").is_some() != shown.get("event").is_some() {
                found = next(&mut lines);
            }
            assert!(matches(&shown, &found), "the page shows\n{shown}\nand there was\n{found}");
            said += 1;
        }
    }
    assert!(said >= 30, "{said}");
    assert_eq!(*lab.program.stops.lock().unwrap(), ["a person in the way"]);
}

#[test]
fn what_is_asked_is_done() {
    let mut lab = Lab::start();
    let mut client = lab.client();
    assert_eq!((client.system(), client.process()), ("lab", std::process::id()));
    client.call(&["set", "source", "by=3", "period=10ms"]).unwrap();
    client.call(&["add", "more", "is", "sink", "on=count"]).unwrap();
    client.call(&["wire", "source.out", "more.count", "depth=2", "overload=newest-wins"]).unwrap();
    let ls = client.call(&["ls"]).unwrap();
    assert_eq!(agent(&ls, "source")["params"]["by"], 3.0);
    assert_eq!(agent(&ls, "source")["period_s"], 0.01);
    client.call(&["add", "work", "is", "queue", "depth=3"]).unwrap();
    client.call(&["wire", "source.out", "work"]).unwrap();
    client.call(&["wire", "work", "more.count", "serving=7"]).unwrap();
    let parts = shapes::read_plan(&client.call(&["plan"]).unwrap()).unwrap();
    assert_eq!(parts, lab.control.plan().unwrap());
    assert_eq!(client.call(&["ls"]).unwrap()["queues"][0]["receivers"][0]["serving"], 7);
    assert_eq!(
        client.call(&["latch"]).unwrap(),
        json!({"asked": ["latch"]}),
        "a command of the program's own"
    );
    client.call(&["remove", "more"]).unwrap();
    assert!(agent(&client.call(&["graph"]).unwrap(), "more").is_null());
    client.call(&["fault", "sink", "panic"]).unwrap();
    // The next message makes it step, and die.
    while agent(&client.call(&["top"]).unwrap(), "sink")["panics"] == 0 {}
    client.call(&["quit"]).unwrap();
    let report = lab.end().unwrap();
    assert_eq!(report.ended, "asked to quit");
}

#[test]
fn a_request_of_several_is_done_whole_or_not_at_all() {
    let lab = Lab::start();
    let mut client = lab.client();
    let words = words::split("add more is sink on=count ; wire source.out more.cuont").unwrap();
    assert_eq!(refusal(client.call(&words)), "there is no port of more \"cuont\"; did you mean \"count\"?");
    assert!(agent(&client.call(&["ls"]).unwrap(), "more").is_null());
}

#[test]
fn refusals_say_what_would_be_right() {
    let lab = Lab::start();
    let mut client = lab.client();
    for (line, said) in [
        ("tapp source.out", "there is no command \"tapp\"; did you mean \"tap\"?"),
        ("lach", "there is no command \"lach\"; did you mean \"latch\"?"),
        ("tap source.uot", "there is no port of source \"uot\"; did you mean \"out\"?"),
        ("tap", "\"tap\" needs the name of a port; write: tap OUTPUT [every=N]"),
        ("tap source.out evry=2", "there is no option of tap \"evry\"; did you mean \"every\"?"),
        ("untap source.out", "source.out is not listened to by this client"),
        ("send source.out linar.x=1", "geometry_msgs/msg/Twist has no field \"linar\""),
        ("call adder.trun", "there is no service of adder \"trun\"; did you mean \"turn\"?"),
        ("set source by=-1", "\"by\" must be at least 0, not -1"),
        ("why often", "\"often\" is no number; write: why [N]"),
        ("reset all", "\"all\" is one word too many for \"reset\"; write: reset"),
    ] {
        assert_eq!(refusal(client.call(&words::split(line).unwrap())), said, "{line}");
    }
    let twice = client.call_with(&["send", "source.out", "linear.x=1"], Some(json!({})));
    assert!(refusal(twice).starts_with("the message is given twice"));
    assert!(
        refusal(client.call_with(&["send", "source.out"], Some(json!(3)))).contains("not a whole number")
    );
}

#[test]
fn messages_are_heard_with_their_headers_and_can_be_sent() {
    let lab = Lab::start();
    let (mut one, mut two) = (lab.client(), lab.client());
    one.call(&["tap", "source.out"]).unwrap();
    two.call(&["tap", "source.out", "every=3"]).unwrap();
    assert!(refusal(one.call(&["tap", "source.out"])).contains("already"));
    let sequences = |client: &mut Client| -> Vec<u64> {
        let heard = (0..4).map(|_| client.next_event(None).unwrap().unwrap());
        heard
            .map(|event| match event {
                Event::Message { port, header, message } => {
                    assert_eq!((port.as_str(), &header["sender"]), ("source.out", &json!("source")));
                    assert_eq!(message["linear"]["x"], (header["sequence"].as_u64().unwrap() + 1) as f64);
                    header["sequence"].as_u64().unwrap()
                }
                Event::Lost { .. } => panic!("nothing is lost here"),
            })
            .collect()
    };
    for (client, step) in [(&mut one, 1), (&mut two, 3)] {
        let heard = sequences(client);
        assert!(heard.windows(2).all(|pair| pair[1] - pair[0] == step), "{heard:?}");
    }
    // One client leaves, the other still hears.
    one.call(&["untap", "source.out"]).unwrap();
    drop(one);
    sequences(&mut two);
    two.call(&["untap", "source.out"]).unwrap();
    two.call(&["tap", "source.out"]).unwrap();
    two.call(&["send", "source.out", "angular.z=0.5"]).unwrap();
    while !matches!(two.next_event(None).unwrap(), Some(Event::Message { message, .. }) if message["angular"]["z"] == 0.5)
    {
    }
}

#[test]
fn an_agent_that_comes_again_is_heard_again() {
    let lab = Lab::start();
    let mut client = lab.client();
    client.call(&["tap", "source.out"]).unwrap();
    client.next_event(None).unwrap();
    client.call(&["remove", "source"]).unwrap();
    client.call(&["add", "source", "is", "source", "period=5ms", "by=1000"]).unwrap();
    while !matches!(client.next_event(None).unwrap(), Some(Event::Message { message, .. }) if message["linear"]["x"].as_f64() >= Some(1000.0))
    {
    }
    client.call(&["untap", "source.out"]).unwrap();
}

#[test]
fn a_service_is_called_without_a_wire_and_a_late_answer_is_nobody_elses() {
    let lab = Lab::start();
    let mut client = lab.client();
    client.call(&["unwire", "asker.turn", "adder.turn"]).unwrap();
    let wires = lab.control.plan().unwrap().1;
    let answer = client.call(&["call", "adder.turn", "linear.x=2", "angular.z=4"]).unwrap();
    assert_eq!((&answer["linear"]["x"], &answer["angular"]["z"]), (&json!(2.0), &json!(5.0)));
    client.call(&["set", "adder", "answers=false"]).unwrap();
    let late = client.call(&["call", "adder.turn", "angular.z=10", "within=50ms"]);
    assert!(refusal(late).starts_with("adder.turn did not answer within 50ms; "));
    client.call(&["set", "adder", "answers=true"]).unwrap();
    let answer = client.call(&["call", "adder.turn", "angular.z=20"]).unwrap();
    assert_eq!(answer["angular"]["z"], 21.0, "the answer to the call that was given up is passed over");
    assert_eq!(lab.control.plan().unwrap().1, wires, "no wire was made or cut");
}

#[test]
fn garbage_is_answered_and_a_line_without_end_is_cut() {
    let lab = Lab::start();
    let (mut stream, mut lines) = lab.raw();
    for garbage in [&b"\xff\x00\xfe\n"[..], b"{\"id\":1\n", b"[[[[\n", b"\n\n{}\n"] {
        stream.write_all(garbage).unwrap();
        assert!(next(&mut lines)["error"]["what"].is_string());
    }
    let deep = format!("{{\"do\":[\"set\",\"source\",\"by={}\"]}}\n", "[".repeat(500_000));
    stream.write_all(deep.as_bytes()).unwrap();
    assert!(next(&mut lines)["error"]["what"].as_str().unwrap().contains("nested"));
    stream.write_all(b"{\"id\":2,\"do\":\"ls\"}\n").unwrap();
    assert_eq!(next(&mut lines)["id"], 2, "the client stays");

    // It may be cut before all is written.
    let _ = stream.write_all(&vec![b'x'; LONGEST_LINE + 100_000]);
    assert!(next(&mut lines)["error"]["what"].as_str().unwrap().contains("longer than"));
    let mut rest = Vec::new();
    // Cut in the middle of what it wrote, it may find a reset instead of an end.
    let _ = lines.read_to_end(&mut rest);
    assert!(rest.is_empty());
    lab.client().call(&["ls"]).unwrap();
}

#[test]
fn a_client_that_never_reads_is_cut_and_slows_nobody() {
    let limits = Limits { waiting: 100_000, patience: HostDuration::from_millis(200), ..Limits::default() };
    let lab = Lab::with(limits);
    let (mut mute, _lines) = lab.raw();
    mute.write_all(b"{\"do\":\"tap source.out\"}\n").unwrap();
    let mut other = lab.client();
    other.call(&["tap", "source.out"]).unwrap();
    // It asks and asks, until nobody listens to it any more.
    let question = b"{\"do\":\"graph\"}\n".repeat(100);
    let mut asked = 0;
    while mute.write_all(&question).is_ok() {
        asked += 1;
        assert!(asked < 100_000, "it is never cut");
    }
    other.call(&["ls"]).unwrap();
    assert!(matches!(other.next_event(None).unwrap(), Some(Event::Message { .. })));
}

#[test]
fn a_slow_reader_is_told_how_much_it_lost() {
    let lab = Lab::with(Limits { waiting: 4000, ..Limits::default() });
    let (mut slow, mut lines) = lab.raw();
    lab.client().call(&["set", "source", "period=100us"]).unwrap();
    slow.write_all(b"{\"id\":1,\"do\":\"tap source.out\"}\n").unwrap();
    let sent = |lab: &Lab| lab.control.view().unwrap().agents[0].ports[0].sent;
    let begun = sent(&lab);
    // It reads nothing while far more is said than the socket and its outbox hold.
    while sent(&lab) < begun + 5000 {}
    let mut expected = None;
    loop {
        let line = next(&mut lines);
        if line["event"] == "lost" {
            let lost = line["count"].as_u64().unwrap();
            assert!(lost > 0);
            let header = &next(&mut lines)["header"];
            assert_eq!(header["sequence"].as_u64(), expected.map(|sequence: u64| sequence + lost));
            break;
        }
        expected = line["header"]["sequence"].as_u64().map(|sequence| sequence + 1);
    }
}

#[test]
fn there_are_not_more_clients_than_may_be() {
    let lab = Lab::with(Limits { clients: 1, ..Limits::default() });
    let mut first = lab.client();
    first.call(&["ls"]).unwrap();
    let (_, mut lines) = lab.raw();
    assert_eq!(next(&mut lines)["error"]["what"], "the system has 1 clients already");
    drop(first);
    // The place is free as soon as the end of the first was seen.
    while Client::at(lab.server.as_ref().unwrap().path()).unwrap().call(&["ls"]).is_err() {}
}

#[test]
fn two_clients_at_once_get_their_own_answers() {
    let lab = Lab::start();
    let path = lab.server.as_ref().unwrap().path().to_owned();
    let threads: Vec<JoinHandle<()>> = ["1", "2"]
        .map(|n| {
            let path = path.clone();
            let work = move || {
                let mut client = Client::at(&path).unwrap();
                for _ in 0..50 {
                    assert_eq!(
                        client.call(&["why", n]).unwrap().as_array().unwrap().len(),
                        n.parse::<usize>().unwrap()
                    );
                    client.call(&["set", "source", &format!("by={n}")]).unwrap();
                }
            };
            std::thread::Builder::new().spawn(work).unwrap()
        })
        .into();
    threads.into_iter().for_each(|thread| thread.join().unwrap());
}

#[test]
fn sockets_of_the_dead_are_cleared_away_and_the_living_keep_their_names() {
    let lab = Lab::start();
    let folder = lab.scratch.folder();
    let path = lab.server.as_ref().unwrap().path().to_owned();
    assert_eq!(path, socket_of(&folder, "lab"));
    assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
    drop(UnixListener::bind(socket_of(&folder, "dead")).unwrap());

    let start = |name: &str| Server::start(&folder, name, lab.control.clone(), lab.program.clone()).unwrap();
    let (second, dead) = (start("lab"), start("dead"));
    assert_eq!((second.name(), dead.name()), ("lab-2", "dead"));
    let mut named = Client::connect_in(&folder, Some("lab-2")).unwrap();
    assert_eq!(named.call(&["ls"]).unwrap()["system"], "lab");
    match Client::connect_in(&folder, None) {
        Err(ClientError::Several(names)) => assert_eq!(names, ["dead", "lab", "lab-2"]),
        other => panic!("{:?}", other.map(|client| client.system().to_owned())),
    }
    drop((second, dead));
    assert_eq!(sockets_in(&folder).unwrap(), [path], "each took its socket with it");
    assert!(matches!(named.call(&["ls"]), Err(ClientError::Ended)));
    let said = |name| Client::connect_in(&folder, name).map(drop).unwrap_err().to_string();
    assert_eq!(said(Some("lob")), "no system \"lob\" is running; did you mean \"lab\"?");

    drop(UnixListener::bind(socket_of(&folder, "other")).unwrap());
    assert_eq!(Client::connect_in(&folder, None).unwrap().system(), "lab", "a dead socket is passed over");
    drop(lab);
}

#[test]
fn where_nothing_runs_one_clear_sentence_says_so() {
    let scratch = Scratch::new();
    let said = Client::connect_in(&scratch.folder(), None).map(drop).unwrap_err().to_string();
    assert_eq!(said, "no system is running; start one with \"sinew run FILE\"");
}

#[test]
fn who_asks_for_the_end_still_gets_the_answer() {
    for _ in 0..20 {
        let mut lab = Lab::start();
        let mut client = lab.client();
        let run = lab.run.take().unwrap();
        let server = lab.server.take().unwrap();
        let program = std::thread::Builder::new()
            .spawn(move || {
                let report = run.join().unwrap();
                drop(server);
                report
            })
            .unwrap();
        assert_eq!(client.call(&["quit"]).unwrap(), true);
        assert_eq!(program.join().unwrap().ended, "asked to quit");
        assert!(matches!(client.call(&["ls"]), Err(ClientError::Ended)));
    }
}
