//! What each command does.

use std::sync::Arc;

use runtime::{Control, Refusal, Request};
use serde_json::{Value as Json, json};
use types::value::{Table, Value};

use crate::json::{from_json, table_to_json};
use crate::outbox::Outbox;
use crate::protocol::{CALL_WAITS, COMMANDS, LONGEST_CALL, Question};
use crate::server::Hooks;
use crate::shapes;
use crate::taps::{Ear, Taps};
use crate::words::{self, CHANGES, Pairs};

/// How many decisions are shown when nobody says.
const DECISIONS: usize = 10;
type Answer = Result<Json, Refusal>;

/// Does what clients ask.
pub(crate) struct Commands {
    control: Control,
    hooks: Arc<dyn Hooks>,
    taps: Arc<Taps>,
}

/// Who asks.
pub(crate) struct Asker {
    pub client: u64,
    pub outbox: Arc<Outbox>,
}

impl Commands {
    pub(crate) fn new(control: Control, hooks: Arc<dyn Hooks>, taps: Arc<Taps>) -> Commands {
        Commands { control, hooks, taps }
    }

    /// Does what is asked, and says what came of it.
    pub(crate) fn answer(&self, asker: &Asker, question: &Question) -> Answer {
        let words = &question.words;
        let Some((verb, rest)) = words.split_first() else {
            return Err(Refusal::new("nothing is asked").help("\"help\" tells all commands"));
        };
        if question.message.is_some() && !matches!(verb.as_str(), "send" | "call") {
            return Err(Refusal::new(format!("\"{verb}\" takes no message")));
        }
        match verb.as_str() {
            "ls" => alone(words).and_then(|()| Ok(shapes::ls(&self.control.view()?))),
            "graph" => alone(words).and_then(|()| Ok(shapes::graph(&self.control.view()?))),
            "top" => alone(words).and_then(|()| Ok(shapes::top(&self.control.view()?))),
            "plan" => alone(words).and_then(|()| self.plan()),
            "tap" => self.tap(asker, rest),
            "untap" => self.untap(asker, rest),
            "send" => self.send(rest, question.message.as_ref()),
            "call" => self.call(rest, question.message.as_ref()),
            "stop" => self.hooks.stop(&rest.join(" ")).map(|()| true.into()),
            "reset" => alone(words).and_then(|()| self.hooks.reset()).map(|()| true.into()),
            "why" => self.why(rest),
            "help" => alone(words).map(|()| self.help()),
            _ => self.other(verb, words),
        }
    }

    fn plan(&self) -> Answer {
        let (agents, queues, wires) = self.control.plan()?;
        Ok(shapes::plan(&self.control.view()?.name, &agents, &queues, &wires))
    }

    fn why(&self, rest: &[String]) -> Answer {
        let number =
            |word: &String| word.parse().map_err(|_| wrong_form("why", format!("\"{word}\" is no number")));
        match rest {
            [] => self.hooks.why(DECISIONS),
            [word] => self.hooks.why(number(word)?),
            _ => Err(wrong_form("why", "there are too many words")),
        }
    }

    fn help(&self) -> Json {
        let own = COMMANDS.iter().chain(CHANGES.iter().filter(|usage| usage.verb != "send"));
        let more = self.hooks.more();
        own.chain(more)
            .map(|usage| json!({"verb": usage.verb, "form": usage.form, "does": usage.does}))
            .collect::<Vec<_>>()
            .into()
    }

    /// A change of the system, or a command of the program's own.
    fn other(&self, verb: &str, words: &[String]) -> Answer {
        if self.hooks.more().iter().any(|usage| usage.verb == verb) {
            return self.hooks.command(words);
        }
        if !CHANGES.iter().any(|usage| usage.verb == verb) {
            let known = COMMANDS.iter().chain(&CHANGES).chain(self.hooks.more()).map(|usage| usage.verb);
            return Err(Refusal::unknown("command", verb, known));
        }
        let request = words::parse(words)?;
        let changes_agents = changes_agents(&request);
        self.request(request)?;
        if changes_agents {
            self.taps.renew();
        }
        Ok(true.into())
    }

    fn request(&self, request: Request) -> Result<(), Refusal> {
        self.hooks.asks(&request)?;
        self.control.request(request)
    }

    fn tap(&self, asker: &Asker, rest: &[String]) -> Answer {
        let (port, rest) = port("tap", rest)?;
        let mut pairs = Pairs::read("tap", rest)?;
        let every = pairs.number::<u64>("every")?.unwrap_or(1).max(1);
        pairs.finish("tap", &["every"])?;
        let ear = Ear { client: asker.client, outbox: asker.outbox.clone(), every, heard: 0, lost: 0 };
        let definition = self.taps.listen(port, ear)?;
        Ok(json!({"port": port, "message": definition.name, "definition": definition.text()}))
    }

    fn untap(&self, asker: &Asker, rest: &[String]) -> Answer {
        let (port, rest) = port("untap", rest)?;
        match rest {
            [] if self.taps.leave(port, asker.client) => Ok(true.into()),
            [] => Err(Refusal::new(format!("{port} is not listened to by this client"))),
            _ => Err(wrong_form("untap", "there are too many words")),
        }
    }

    fn send(&self, rest: &[String], message: Option<&Json>) -> Answer {
        let (port, pairs) = port("send", rest)?;
        if message.is_none() && pairs.first().is_some_and(|word| word.starts_with("cdr=")) {
            let words: Vec<String> = ["send".to_owned()].into_iter().chain(rest.iter().cloned()).collect();
            return self.request(words::parse(&words)?).map(|()| true.into());
        }
        let message = message_of("send", pairs, message)?;
        let cdr = self.encode(port, &message)?;
        self.request(Request::Send { port: port.to_owned(), cdr })?;
        Ok(true.into())
    }

    fn encode(&self, port: &str, message: &Json) -> Result<Vec<u8>, Refusal> {
        self.hooks.encode(&self.taps.definition(port)?, message).map_err(Refusal::new)
    }

    /// Calls a service, and waits for the answer on the thread of the client who asked.
    fn call(&self, rest: &[String], message: Option<&Json>) -> Answer {
        let (service, rest) = port("call", rest)?;
        let (within, rest): (Vec<String>, Vec<String>) =
            rest.iter().cloned().partition(|word| word.starts_with("within="));
        let within = Pairs::read("call", &within)?.span("within")?.unwrap_or(CALL_WAITS).min(LONGEST_CALL);
        let shape = self.control.service(service)?;
        let question = message_of("call", &rest, message)?;
        let question = self.hooks.encode(&shape.question, &question).map_err(Refusal::new)?;
        let service = service.to_owned();
        self.hooks.asks(&Request::Call { service: service.clone(), cdr: question.clone(), within })?;
        let answer = self.control.call(&service, question, within)?;
        self.hooks.decode(&shape.answer, &answer).map_err(Refusal::new)
    }
}

fn changes_agents(request: &Request) -> bool {
    match request {
        Request::Add(_) | Request::Remove(_) | Request::Replace { .. } => true,
        Request::All(several) => several.iter().any(changes_agents),
        _ => false,
    }
}

fn wrong_form(verb: &str, what: impl Into<String>) -> Refusal {
    let form = COMMANDS.iter().find(|usage| usage.verb == verb).map_or(verb, |usage| usage.form);
    Refusal::new(what).help(format!("write: {form}"))
}

fn alone(words: &[String]) -> Result<(), Refusal> {
    match words {
        [verb, word, ..] => Err(wrong_form(verb, format!("\"{word}\" is one word too many for \"{verb}\""))),
        _ => Ok(()),
    }
}

/// The port that a command names, and the words behind it.
fn port<'a>(verb: &str, rest: &'a [String]) -> Result<(&'a str, &'a [String]), Refusal> {
    match rest.split_first() {
        Some((port, rest)) if !port.contains('=') => Ok((port, rest)),
        _ => Err(wrong_form(verb, format!("\"{verb}\" needs the name of a port"))),
    }
}

/// The message that words or the question itself give.
fn message_of(verb: &str, pairs: &[String], message: Option<&Json>) -> Result<Json, Refusal> {
    let Some(message) = message else {
        let mut table = Table::new();
        for row in Pairs::read(verb, pairs)?.into_params()?.rows() {
            table.set_path(&row.key, row.entry.clone())?;
        }
        return Ok(table_to_json(&table));
    };
    if let Some(word) = pairs.first() {
        return Err(Refusal::new(format!("the message is given twice: by \"{word}\" and as \"message\"")));
    }
    match from_json(message) {
        Value::Table(_) => Ok(message.clone()),
        other => Err(Refusal::new(format!("a message is an object of its fields, not {}", other.kind()))),
    }
}
