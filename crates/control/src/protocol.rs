#![doc = include_str!("protocol.md")]

use runtime::{Heard, Refusal};
use serde_json::{Value as Json, json};
use types::{AgentId, Duration, Time};

use crate::words;

/// The version of the protocol. It grows when a client that knows the one before would misunderstand something.
pub const VERSION: u64 = 1;

/// The longest line in bytes, in both directions.
pub const LONGEST_LINE: usize = 1 << 20;

/// How long a call of a service waits at most: a client that calls can ask nothing else meanwhile.
pub const LONGEST_CALL: Duration = Duration::secs(60);

/// How long it waits when nobody says.
pub(crate) const CALL_WAITS: Duration = Duration::secs(2);

/// The commands that ask or do something besides changing agents and wires.
pub const COMMANDS: [words::Usage; 12] = [
    usage("ls", "ls", "the agents and how they are"),
    usage("graph", "graph", "agents, ports and wires"),
    usage("top", "top", "timing and counts"),
    usage("plan", "plan", "the running system as requests that would build it"),
    usage("tap", "tap OUTPUT [every=N]", "sends the messages of an output as events"),
    usage("untap", "untap OUTPUT", "ends that"),
    usage("call", "call SERVICE [FIELD=VALUE…] [within=2s]", "calls a service and waits for the answer"),
    usage("send", "send OUTPUT [FIELD=VALUE…]", "sends a message out of an output"),
    usage("stop", "stop [WHY…]", "the emergency stop"),
    usage("reset", "reset", "ends the emergency stop; nothing moves by it"),
    usage("why", "why [N]", "the last decisions with their reasons"),
    usage("help", "help", "all commands"),
];

const fn usage(verb: &'static str, form: &'static str, does: &'static str) -> words::Usage {
    words::Usage { verb, form, does }
}

/// What a client asks.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// Its number, given back with the answer.
    pub id: Json,
    /// What to do, in words.
    pub words: Vec<String>,
    /// The message of `send` and `call`, when it is not given in words.
    pub message: Option<Json>,
}

impl Question {
    /// Reads a line. A refusal comes with the number of the question, if that could be read.
    pub fn read(line: &[u8]) -> Result<Question, (Json, Refusal)> {
        let mut id = Json::Null;
        Question::read_with(line, &mut id).map_err(|refusal| (id, refusal))
    }

    fn read_with(line: &[u8], id: &mut Json) -> Result<Question, Refusal> {
        let example = "write a line such as {\"id\":1,\"do\":[\"ls\"]}";
        let json: Json = serde_json::from_slice(line)
            .map_err(|error| Refusal::new(format!("this is no JSON: {error}")).help(example))?;
        let Json::Object(mut rows) = json else {
            return Err(Refusal::new("a question is an object").help(example));
        };
        let given = rows.remove("id").unwrap_or_default();
        if !matches!(given, Json::Null | Json::Number(_) | Json::String(_)) {
            return Err(Refusal::new("the id must be a number or a text"));
        }
        *id = given;
        let words = match rows.remove("do") {
            Some(Json::String(line)) => words::split(&line)?,
            Some(Json::Array(row)) => row.iter().map(word).collect::<Result<_, _>>()?,
            Some(_) => return Err(Refusal::new("\"do\" must be a row of words, or a text").help(example)),
            None => return Err(Refusal::new("\"do\" is missing").help(example)),
        };
        let message = rows.remove("message");
        match rows.keys().next() {
            Some(key) => Err(Refusal::unknown("key of a question", key, ["id", "do", "message"])),
            None => Ok(Question { id: id.clone(), words, message }),
        }
    }

    /// Writes it as a line.
    pub fn line(&self) -> String {
        let mut json = json!({"id": self.id, "do": self.words});
        if let Some(message) = &self.message {
            json["message"] = message.clone();
        }
        json.to_string()
    }
}

fn word(json: &Json) -> Result<String, Refusal> {
    match json {
        Json::String(word) => Ok(word.clone()),
        Json::Number(_) | Json::Bool(_) => Ok(json.to_string()),
        _ => Err(Refusal::new(format!("{json} is no word")).help("words are texts")),
    }
}

/// The first line that a client gets.
pub(crate) fn hello(system: &str) -> String {
    json!({"hello": {"sinew": VERSION, "system": system, "pid": std::process::id()}}).to_string()
}

/// The answer to the question with this number.
pub(crate) fn answer(id: &Json, answer: &Result<Json, Refusal>) -> String {
    match answer {
        Ok(ok) => json!({"id": id, "ok": ok}),
        Err(refusal) => json!({"id": id, "error": error(refusal)}),
    }
    .to_string()
}

fn error(refusal: &Refusal) -> Json {
    json!({"what": refusal.what, "help": refusal.help})
}

/// A message that was heard. `name` tells the names of agents.
pub(crate) fn message_event(
    port: &str,
    heard: &Heard,
    message: Result<Json, String>,
    mut name: impl FnMut(AgentId) -> String,
) -> String {
    let header = &heard.header;
    let mut agent = |id: AgentId| if id == AgentId::NONE { Json::Null } else { Json::from(name(id)) };
    let header = json!({
        "stamp_ns": header.stamp.0, "sequence": header.sequence,
        "deadline_ns": (header.deadline != Time::NEVER).then_some(header.deadline.0),
        "sender": agent(header.sender), "recipient": agent(header.recipient), "marker": header.marker,
        "category": header.category.name(), "priority": header.priority.name(),
        "quality": header.quality.share(),
    });
    let unreadable = |what: &str| json!({"unreadable": what, "bytes": heard.cdr.len()});
    let event = |message: Json| {
        json!({"event": "message", "port": port, "header": header, "message": message}).to_string()
    };
    let line = event(message.unwrap_or_else(|what| unreadable(&what)));
    if line.len() <= LONGEST_LINE { line } else { event(unreadable("longer than a line may be")) }
}

/// Messages that a slow reader lost.
pub(crate) fn lost_event(port: &str, count: u64) -> String {
    json!({"event": "lost", "port": port, "count": count}).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_question_is_read_as_it_was_written() {
        let words = ["set", "a", "b=c d"].map(str::to_owned).to_vec();
        // Of this number the last digit was lost on the way.
        let long = serde_json::from_str("{\"n\": 18446748446744073709550}").unwrap();
        for message in [None, Some(json!({"linear": {"x": 0.4}})), Some(long)] {
            let question = Question { id: json!(7), words: words.clone(), message };
            assert_eq!(Question::read(question.line().as_bytes()), Ok(question));
        }
        let one_text = br#"{"id":7,"do":"set a 'b=c d'"}"#;
        assert_eq!(Question::read(one_text).unwrap().words, words);
    }

    #[test]
    fn the_page_shows_the_news_of_what_was_lost() {
        assert!(include_str!("protocol.md").contains(&lost_event("source.out", 12)));
    }

    #[test]
    fn what_is_no_question_is_refused_with_its_number_where_there_is_one() {
        for (line, id, said) in [
            (&b"\xff\xfe"[..], json!(null), "this is no JSON"),
            (b"[1]", json!(null), "a question is an object"),
            (br#"{"id":[1],"do":["ls"]}"#, json!(null), "the id must be"),
            (br#"{"id":4}"#, json!(4), "\"do\" is missing"),
            (br#"{"id":"x","do":3}"#, json!("x"), "\"do\" must be a row of words"),
            (br#"{"id":5,"do":[["ls"]]}"#, json!(5), "[\"ls\"] is no word"),
            (br#"{"id":6,"do":["ls"],"mesage":{}}"#, json!(6), "there is no key of a question \"mesage\""),
        ] {
            let (number, refusal) = Question::read(line).unwrap_err();
            assert_eq!(number, id);
            assert!(refusal.what.starts_with(said), "{refusal}");
        }
    }
}
