//! The commands that ask or change a system that runs in another process.

mod because;
mod shown;
pub(crate) mod why;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration as HostDuration;

use clap::{Args, Subcommand};
use control::{Client, ClientError, Event};
use serde_json::{Value as Json, json};

use crate::error::Failure;
use crate::terminal;

/// Which system is meant.
#[derive(Args, Clone, Debug)]
pub(crate) struct Which {
    /// The system, where several run.
    #[arg(long, value_name = "NAME")]
    system: Option<String>,
}

/// What can be asked of a running system.
#[derive(Debug, Subcommand)]
pub(crate) enum LiveCommand {
    /// Lists the agents that run, and how they are.
    Ls(Which),
    /// Shows agents, ports and wires.
    Graph {
        /// For Graphviz: sinew graph --dot | dot -Tsvg
        #[arg(long, conflicts_with = "toml")]
        dot: bool,
        /// As a system file.
        #[arg(long)]
        toml: bool,
        #[command(flatten)]
        which: Which,
    },
    /// Shows timing and counts, again and again on a terminal.
    Top(Which),
    /// Shows the last changes of the decision: situations, what they were recognised by, whose rows count, and what is new.
    Why {
        /// How many.
        #[arg(value_name = "N", default_value_t = 10)]
        count: usize,
        /// Of a run that was recorded.
        #[arg(long, value_name = "F.mcap", conflicts_with = "system")]
        log: Option<PathBuf>,
        #[command(flatten)]
        which: Which,
    },
    /// Adds an agent: sinew add NAME is KIND [robot=h1] [period=50ms] [on=ranges] [KEY=VALUE…]
    Add(Words),
    /// Removes an agent and its wires.
    Remove(Words),
    /// Starts an agent anew.
    Restart(Words),
    /// Puts another agent in the place of one: sinew replace NAME is KIND [KEY=VALUE…]
    Replace(Words),
    /// Makes a wire: sinew wire FROM.PORT TO.PORT [depth=N] [overload=…] [every=N]
    Wire(Words),
    /// Cuts a wire, when what is on it has arrived.
    Unwire(Words),
    /// Sets parameters, or period, deadline, min_gap, wake_gap, cost, method, budget, importance, suspended: sinew set NAME KEY=VALUE…
    Set(Words),
    /// The emergency stop: all robots stand until "sinew reset".
    Stop(Words),
    /// Ends the emergency stop; nothing moves by it.
    Reset(Which),
    /// Ends the run.
    Quit(Which),
    /// Shows the messages of an output as they come.
    Tap {
        /// The output, as in sonar.filtered.
        #[arg(value_name = "AGENT.PORT")]
        port: String,
        /// Only every n-th message.
        #[arg(long, value_name = "N", default_value_t = 1)]
        every: u64,
        /// Ends after so many messages.
        #[arg(long, value_name = "N")]
        count: Option<u64>,
        #[command(flatten)]
        which: Which,
    },
    /// Calls a service and shows the answer: sinew call AGENT.SERVICE [FIELD=VALUE…]
    Call(Words),
    /// Sends a message out of a port: sinew send AGENT.PORT linear.x=0.2
    Send(Words),
    /// Makes an agent or a sensor misbehave: off, stuck, garbage, wrong, slow, heavy, delayed, intermittent, panic, hang; ok ends it.
    Fault(Words),
}

/// What is said to a system in words.
#[derive(Args, Clone, Debug)]
pub(crate) struct Words {
    /// Names and KEY=VALUE.
    #[arg(value_name = "WORDS", allow_hyphen_values = false)]
    words: Vec<String>,
    /// Of add, set and wire: does it also where deadlines would be missed by it. The summary tells.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    which: Which,
}

impl LiveCommand {
    fn is_forced(&self) -> bool {
        matches!(self, LiveCommand::Add(said) | LiveCommand::Set(said) | LiveCommand::Wire(said) if said.force)
    }

    /// The words of a command that is only that, and which system it is for.
    fn plain(&self) -> Option<(&'static str, &[String], &Which)> {
        Some(match self {
            LiveCommand::Add(said) => ("add", &said.words, &said.which),
            LiveCommand::Remove(said) => ("remove", &said.words, &said.which),
            LiveCommand::Restart(said) => ("restart", &said.words, &said.which),
            LiveCommand::Replace(said) => ("replace", &said.words, &said.which),
            LiveCommand::Wire(said) => ("wire", &said.words, &said.which),
            LiveCommand::Unwire(said) => ("unwire", &said.words, &said.which),
            LiveCommand::Set(said) => ("set", &said.words, &said.which),
            LiveCommand::Stop(said) => ("stop", &said.words, &said.which),
            LiveCommand::Fault(said) => ("fault", &said.words, &said.which),
            LiveCommand::Send(said) => ("send", &said.words, &said.which),
            LiveCommand::Call(said) => ("call", &said.words, &said.which),
            LiveCommand::Reset(which) => ("reset", &[], which),
            LiveCommand::Quit(which) => ("quit", &[], which),
            _ => return None,
        })
    }
}

/// Does a command.
pub(crate) fn live(command: LiveCommand, json: bool) -> Result<ExitCode, Failure> {
    if let Some((verb, words, which)) = command.plain() {
        return said(verb, words, which, command.is_forced(), json);
    }
    match command {
        LiveCommand::Ls(which) => show(&which, "ls", shown::ls, json),
        LiveCommand::Graph { dot, toml, which } => graph(&which, dot, toml, json),
        LiveCommand::Top(which) => top(&which, json),
        LiveCommand::Why { count, log: Some(log), .. } => why_of_log(&log, count, json),
        LiveCommand::Why { count, log: None, which } => {
            let answer = ask(&mut connect(&which)?, &["why".to_owned(), count.to_string()])?;
            show_answer(&answer, because::why, json);
            Ok(ExitCode::SUCCESS)
        }
        LiveCommand::Tap { port, every, count, which } => tap(&which, &port, every, count, json),
        _ => Ok(ExitCode::SUCCESS),
    }
}

fn why_of_log(log: &Path, count: usize, json: bool) -> Result<ExitCode, Failure> {
    let answer = why::of_log(log, count).map_err(|error| Failure::new(error.to_string()))?;
    if count > 0 && answer.as_array().is_some_and(Vec::is_empty) {
        return Err(Failure::new(format!("{} holds no decision", log.display())).code(1));
    }
    show_answer(&answer, because::why, json);
    Ok(ExitCode::SUCCESS)
}

fn connect(which: &Which) -> Result<Client, Failure> {
    Client::connect(which.system.as_deref()).map_err(failure)
}

fn ask(client: &mut Client, words: &[String]) -> Result<Json, Failure> {
    client.call(words).map_err(failure)
}

/// A system that refuses, or is not there, is no wrong usage; a word that it does not know is.
fn failure(error: ClientError) -> Failure {
    match error {
        ClientError::Refused(refusal) => refusal.into(),
        other => Failure::new(other.to_string()),
    }
}

/// A little longer than the system lets a call wait.
const LONGEST_CALL_WAITS: HostDuration = HostDuration::from_nanos(control::protocol::LONGEST_CALL.0 as u64)
    .saturating_add(HostDuration::from_secs(5));

/// Whether the words of a command say all, without a system: those that carry a message need the type of its port.
fn is_whole(verb: &str) -> bool {
    let changes = control::words::CHANGES.iter().any(|usage| usage.verb == verb);
    changes && !crate::file::calls::VERBS.contains(&verb)
}

fn said(verb: &str, words: &[String], which: &Which, forced: bool, json: bool) -> Result<ExitCode, Failure> {
    let first = forced.then_some("force").into_iter().chain([verb]).map(str::to_owned);
    let all: Vec<String> = first.chain(words.iter().cloned()).collect();
    if is_whole(verb) {
        // What is wrong in the words alone is told without a system.
        control::words::parse(&all)?;
    }
    let mut client = connect(which)?;
    if verb == "call" {
        // The system says itself when no answer comes in time.
        client.set_time_out(LONGEST_CALL_WAITS);
    }
    let answer = ask(&mut client, &all)?;
    if json {
        terminal::say_json(&json!({"system": client.system(), "answer": answer}));
    } else if verb == "call" {
        terminal::say(&shown::message(&answer));
    } else {
        terminal::say(&format!("{}: done: {}", client.system(), control::words::join(&all)));
    }
    Ok(ExitCode::SUCCESS)
}

fn show(which: &Which, verb: &str, text: fn(&Json) -> String, json: bool) -> Result<ExitCode, Failure> {
    let answer = ask(&mut connect(which)?, &[verb.to_owned()])?;
    show_answer(&answer, text, json);
    Ok(ExitCode::SUCCESS)
}

fn show_answer(answer: &Json, text: fn(&Json) -> String, json: bool) {
    if json { terminal::say_json(answer) } else { terminal::say(&text(answer)) }
}

fn graph(which: &Which, dot: bool, toml: bool, json: bool) -> Result<ExitCode, Failure> {
    let mut client = connect(which)?;
    if toml {
        let answer = ask(&mut client, &["file".to_owned()])?;
        let text = answer.as_str().unwrap_or_default();
        if json {
            terminal::say_json(&json!({"toml": text}))
        } else {
            terminal::say(text)
        }
        return Ok(ExitCode::SUCCESS);
    }
    let answer = ask(&mut client, &["graph".to_owned()])?;
    match dot {
        true if json => terminal::say_json(&json!({"dot": shown::dot(&answer)})),
        true => terminal::say(&shown::dot(&answer)),
        false => show_answer(&answer, shown::graph, json),
    }
    Ok(ExitCode::SUCCESS)
}

/// How often `top` looks.
const LOOK: HostDuration = HostDuration::from_millis(500);

fn top(which: &Which, json: bool) -> Result<ExitCode, Failure> {
    let mut client = connect(which)?;
    let words = ["top".to_owned()];
    let answer = ask(&mut client, &words)?;
    if json || !terminal::watched() {
        show_answer(&answer, shown::top, json);
        return Ok(ExitCode::SUCCESS);
    }
    let mut answer = answer;
    loop {
        // From the upper left corner over what stood there, so that nothing flickers.
        terminal::say(&format!("\u{1b}[H{}\u{1b}[J", shown::top(&answer).replace('\n', "\u{1b}[K\n")));
        terminal::pause(LOOK);
        answer = match client.call(&words) {
            Ok(answer) => answer,
            Err(ClientError::Ended) => return Ok(ExitCode::SUCCESS),
            Err(error) => return Err(failure(error)),
        };
    }
}

fn tap(which: &Which, port: &str, every: u64, count: Option<u64>, json: bool) -> Result<ExitCode, Failure> {
    let mut client = connect(which)?;
    let told = ask(&mut client, &["tap".to_owned(), port.to_owned(), format!("every={every}")])?;
    let names = shown::Names::of(told["definition"].as_str().unwrap_or_default());
    let mut left = count.unwrap_or(u64::MAX);
    let mut documents = Vec::new();
    while left > 0 {
        let event = match client.next_event(None) {
            Ok(Some(event)) => event,
            Ok(None) => continue,
            Err(ClientError::Ended) => break,
            Err(error) => return Err(failure(error)),
        };
        match event {
            Event::Message { header, message, .. } if json => {
                left -= 1;
                let document = json!({"header": header, "message": message});
                // A document with an end can be one; without one each message is a line of its own.
                if count.is_some() { documents.push(document) } else { terminal::say_json(&document) }
            }
            Event::Message { header, message, .. } => {
                left -= 1;
                terminal::say(&shown::heard(&header, &names.put_into(message)));
            }
            Event::Lost { count, .. } => {
                terminal::tell(&format!("{count} messages were lost: this reader was too slow"))
            }
        }
    }
    if json && count.is_some() {
        terminal::say_json(&Json::Array(documents));
    }
    Ok(ExitCode::SUCCESS)
}
