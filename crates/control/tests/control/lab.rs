//! A small system with a control socket.

use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use control::words::{self, Usage};
use control::{Client, Hooks, Limits, Server};
use runtime::{
    Agent, Control, Fault, Input, Options, Output, Params, Plan, Refusal, Registry, Report, Request,
    RunFolder, Service, Simulation, Step, registry,
};
use serde_json::{Value as Json, json};
use types::Duration;
use types::cdr::{Reader, Writer};
use types::definition::{Definition, Kind};
use types::messages::Twist;

/// Counts up.
#[derive(Agent)]
struct Source {
    /// The count, as a speed.
    out: Output<Twist>,
    params: SourceParams,
    n: f64,
}

/// How it counts.
#[derive(Clone, Debug, Params)]
struct SourceParams {
    /// By how much.
    #[param(default = 1.0, min = 0.0)]
    by: f64,
}

impl Agent for Source {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.n += self.params.by;
        self.out.send(Twist::new(self.n, 0.0));
        Ok(())
    }
}

/// Takes what comes.
#[derive(Agent)]
struct Sink {
    /// What comes.
    count: Input<Twist>,
}

impl Agent for Sink {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while self.count.take().is_some() {}
        Ok(())
    }
}

/// Answers with what it gets, turned by one.
#[derive(Agent)]
struct Adder {
    /// Turns by one.
    turn: Service<Twist, Twist>,
    params: AdderParams,
}

/// Whether it answers.
#[derive(Clone, Debug, Params)]
struct AdderParams {
    /// It does.
    #[param(default = true)]
    answers: bool,
}

impl Agent for Adder {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if self.params.answers {
            self.turn.serve(|twist| Twist::new(twist.linear, twist.angular + 1.0));
        }
        Ok(())
    }
}

/// Could call, and hears what is answered to others.
#[derive(Agent)]
struct Asker {
    /// Turns by one.
    turn: runtime::Client<Twist, Twist>,
}

impl Agent for Asker {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while self.turn.reply().is_some() {}
        Ok(())
    }
}

fn agents() -> Registry {
    registry![Source, Sink, Adder, Asker]
}

fn plan() -> Plan {
    let mut plan = Plan::new("lab");
    let source = plan.add::<Source>("source", Default::default());
    let sink = plan.add::<Sink>("sink", Default::default());
    let asker = plan.add::<Asker>("asker", Default::default());
    let adder = plan.add::<Adder>("adder", Default::default());
    plan.wire(&source.out, &sink.count);
    plan.wire(&asker.turn, &adder.turn);
    plan.every("source", Duration::millis(20));
    plan.on("sink", "count");
    plan.on("asker", "turn");
    plan.every("adder", Duration::millis(20));
    plan
}

/// Stops nothing, but remembers that it was asked to; knows messages that are made of floating-point numbers.
#[derive(Default)]
pub(crate) struct Program {
    pub(crate) stops: Mutex<Vec<String>>,
}

fn decode(definition: &Definition, input: &mut Reader<'_>) -> Result<Json, String> {
    let mut rows = serde_json::Map::new();
    for field in &definition.fields {
        let value = match &field.kind {
            Kind::F64 => input.get::<f64>().map_err(|error| error.to_string())?.into(),
            Kind::Struct(definition) => decode(definition, input)?,
            other => return Err(format!("{other:?} is not known here")),
        };
        rows.insert(field.name.to_owned(), value);
    }
    Ok(rows.into())
}

fn encode(definition: &Definition, message: &Json, out: &mut Writer) -> Result<(), String> {
    let known = |key: &String| definition.fields.iter().any(|field| field.name == key);
    if let Some(wrong) = message.as_object().and_then(|rows| rows.keys().find(|key| !known(key))) {
        return Err(format!("{} has no field \"{wrong}\"", definition.name));
    }
    for field in &definition.fields {
        match &field.kind {
            Kind::Struct(definition) => encode(definition, &message[field.name], out)?,
            _ => {
                out.put(message[field.name].as_f64().unwrap_or(0.0));
            }
        }
    }
    Ok(())
}

impl Hooks for Program {
    fn stop(&self, why: &str) -> Result<(), Refusal> {
        self.stops.lock().unwrap().push(why.to_owned());
        Ok(())
    }
    fn reset(&self) -> Result<(), Refusal> {
        Ok(())
    }
    fn why(&self, n: usize) -> Result<Json, Refusal> {
        Ok(json!(vec!["the wall is near"; n]))
    }
    fn decode(&self, definition: &Definition, cdr: &[u8]) -> Result<Json, String> {
        decode(definition, &mut Reader::new(cdr).map_err(|error| error.to_string())?)
    }
    fn encode(&self, definition: &Definition, message: &Json) -> Result<Vec<u8>, String> {
        let mut out = Writer::new();
        encode(definition, message, &mut out)?;
        Ok(out.bytes().to_vec())
    }
    fn more(&self) -> &[Usage] {
        &[Usage { verb: "latch", form: "latch", does: "shows the latch" }]
    }
    fn command(&self, words: &[String]) -> Result<Json, Refusal> {
        Ok(json!({"asked": words}))
    }
}

/// A folder of a test's own.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    pub(crate) fn new() -> Scratch {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("sinew-control-{}-{number}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Scratch(path)
    }

    pub(crate) fn folder(&self) -> RunFolder {
        RunFolder::at(&self.0.join("sinew")).unwrap()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A system that runs at the speed of the wall until it is dropped.
pub(crate) struct Lab {
    pub(crate) server: Option<Server>,
    pub(crate) control: Control,
    pub(crate) program: Arc<Program>,
    pub(crate) run: Option<JoinHandle<Report>>,
    pub(crate) scratch: Scratch,
}

impl Lab {
    pub(crate) fn start() -> Lab {
        Lab::with(Limits::default())
    }

    pub(crate) fn with(limits: Limits) -> Lab {
        let options = Options {
            limit: Some(Duration::secs(100)),
            speed: Some(1.0),
            parse: words::parse,
            ..Options::default()
        };
        let simulation = Simulation::new(&plan(), &agents(), options).unwrap();
        let (control, program, scratch) =
            (simulation.control(), Arc::new(Program::default()), Scratch::new());
        let run = std::thread::Builder::new().spawn(|| simulation.run().unwrap()).unwrap();
        let server =
            Server::start_with(&scratch.folder(), "lab", control.clone(), program.clone(), limits).unwrap();
        Lab { server: Some(server), control, program, run: Some(run), scratch }
    }

    pub(crate) fn client(&self) -> Client {
        Client::connect_in(&self.scratch.folder(), None).unwrap()
    }

    /// A connection without a client, past its greeting.
    pub(crate) fn raw(&self) -> (UnixStream, BufReader<UnixStream>) {
        let stream = UnixStream::connect(self.server.as_ref().unwrap().path()).unwrap();
        let mut lines = BufReader::new(stream.try_clone().unwrap());
        assert!(next(&mut lines)["hello"]["sinew"] == 1);
        (stream, lines)
    }

    pub(crate) fn end(&mut self) -> Option<Report> {
        self.server = None;
        let _ = self.control.request(Request::Quit);
        self.run.take().map(|run| run.join().unwrap())
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        self.end();
    }
}

/// The next line.
pub(crate) fn next(lines: &mut BufReader<UnixStream>) -> Json {
    let mut line = String::new();
    lines.read_line(&mut line).unwrap();
    assert!(!line.is_empty(), "the connection was cut");
    serde_json::from_str(&line).unwrap()
}
