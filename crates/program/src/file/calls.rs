//! `do = "call SERVICE FIELD=VALUE…"` and `do = "send OUTPUT FIELD=VALUE…"` in `[[at]]` and in schedules: the message in words becomes the
//! bytes that the runtime takes.

use hardware::simulated;
use record::dynamic;
use record::schema::Schema;
use runtime::{Direction, Plan, Refusal, Registry};
use types::value::{Entry, Table, Value, nearest};

use crate::run::WORLD_AGENT;

/// The requests that carry a message.
pub(crate) const VERBS: [&str; 2] = ["call", "send"];

/// A call with its question as bytes, a sending with its message; every other request as it is.
///
/// # Errors
/// When there is no such port, or its message has no such fields.
pub(crate) fn in_bytes(words: &[String], plan: &Plan, registry: &Registry) -> Result<Vec<String>, Refusal> {
    if let [verb] = words
        && VERBS.contains(&verb.as_str())
    {
        let refusal = Refusal::new(format!("\"{verb}\" needs the name of a port"));
        return Err(refusal.help(format!("as in \"{verb} AGENT.PORT FIELD=VALUE\"")));
    }
    let [verb, port, fields @ ..] = words else { return Ok(words.to_vec()) };
    if !VERBS.contains(&verb.as_str()) || fields.iter().any(|word| word.starts_with("cdr=")) {
        return Ok(words.to_vec());
    }
    let (within, fields): (Vec<&String>, Vec<&String>) =
        fields.iter().partition(|word| verb == "call" && word.starts_with("within="));
    let cdr = dynamic::encode(&message(verb, port, plan, registry)?, &Value::Table(read(&fields)?).into())
        .map_err(|mistakes| {
            Refusal::new(mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
        })?;
    let digits: String = cdr.iter().map(|byte| format!("{byte:02x}")).collect();
    let head = [verb.clone(), port.clone(), format!("cdr={digits}")];
    Ok(head.into_iter().chain(within.into_iter().cloned()).collect())
}

/// Makes the requests of a plan, and others, ready to be asked; gives each that has changed as it is asked and as it was said. What cannot be
/// made ready is left as it is: the runtime refuses it in its time.
pub(crate) fn ready<'w>(
    plan: &mut Plan,
    others: impl Iterator<Item = &'w mut Vec<String>>,
    registry: &Registry,
) -> Vec<(String, String)> {
    let (whole, mut said) = (plan.clone(), Vec::new());
    let mut make_ready = |words: &mut Vec<String>| {
        if let Ok(bytes) = in_bytes(words, &whole, registry).map_err(drop)
            && bytes != *words
        {
            said.push((bytes.join(" "), words.join(" ")));
            *words = bytes;
        }
    };
    plan.requests.iter_mut().for_each(|request| make_ready(&mut request.words));
    others.for_each(make_ready);
    said
}

fn read(fields: &[&String]) -> Result<Table, Refusal> {
    let mut table = Table::new();
    for word in fields {
        let pair = word.split_once('=').filter(|(key, _)| !key.is_empty());
        let (key, value) = pair.ok_or_else(|| {
            Refusal::new(format!("\"{word}\" is no FIELD=VALUE"))
                .help("as in \"call world.push robot=h1 left=0.3\"")
        })?;
        let value: Entry = control::words::read_value(value)?.into();
        table.set_path(key, value).map_err(|mistake| Refusal::new(mistake.what))?;
    }
    Ok(table)
}

/// What a service takes, or an output gives.
fn message(verb: &str, name: &str, plan: &Plan, registry: &Registry) -> Result<Schema, Refusal> {
    let (wanted, what) = match verb {
        "call" => (Direction::Service, "service"),
        _ => (Direction::Output, "output"),
    };
    let none =
        |told: String| Refusal::new(told).help(format!("to {verb} it takes AGENT.{}", what.to_uppercase()));
    let (agent, port) = name.rsplit_once('.').ok_or_else(|| none(format!("\"{name}\" names no {what}")))?;
    let kind = match plan.agent(agent) {
        Some(known) => registry.get(&known.kind).cloned(),
        // In a simulated world this agent comes by itself.
        None if agent == WORLD_AGENT => Some(simulated::services()),
        None => {
            let refusal = Refusal::new(format!("there is no agent \"{agent}\" to {verb}"));
            let near = nearest(agent, plan.agents.iter().map(|agent| agent.name.as_str()));
            return Err(match near {
                Some(near) => refusal.help(format!("did you mean \"{near}\"?")),
                None => refusal,
            });
        }
    };
    // An unknown type has been said already.
    let Some(kind) = kind else { return Err(none(format!("nobody knows the ports of \"{agent}\""))) };
    let ports = || kind.ports.iter().filter(|known| known.shape.direction == wanted);
    let shape = ports().find(|known| known.name == port).map(|known| known.shape);
    let message = shape.and_then(|shape| if verb == "call" { shape.input } else { shape.output });
    let Some(message) = message else {
        let refusal = Refusal::new(format!("{agent} has no {what} \"{port}\""));
        return Err(match nearest(port, ports().map(|known| known.name)) {
            Some(near) => refusal.help(format!("did you mean \"{near}\"?")),
            None => refusal,
        });
    };
    Ok(Schema::from(&(message.definition)()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::Message as _;
    use types::messages::WorldPush;

    fn words(text: &str) -> Vec<String> {
        text.split_whitespace().map(str::to_owned).collect()
    }

    fn said(text: &str) -> String {
        in_bytes(&words(text), &Plan::new("p"), &Registry::default()).unwrap_err().to_string()
    }

    #[test]
    fn a_call_in_words_becomes_the_message_that_they_describe() {
        let call = words("call world.push robot=h1 left=0.3 turn=-0.5 within=1s");
        let call = in_bytes(&call, &Plan::new("p"), &Registry::default()).unwrap();
        assert_eq!(
            (call[0].as_str(), call[1].as_str(), call[3].as_str()),
            ("call", "world.push", "within=1s")
        );
        let push = WorldPush { robot: "h1".into(), left: 0.3, turn: -0.5, ..WorldPush::default() };
        let mut out = types::cdr::Writer::new();
        push.encode(&[], types::Time::ZERO, &mut out);
        let digits: String = out.bytes().iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(call[2], format!("cdr={digits}"));
        assert!(control::words::parse(&call).is_ok());
        let other = words("fault wall panic");
        assert_eq!(in_bytes(&other, &Plan::new("p"), &Registry::default()).unwrap(), other);
    }

    /// Five seconds of the exploration with this asked at three seconds: its log, and the truth at its end.
    fn run(name: &str, asked: &str) -> (Vec<u8>, hardware::simulated::Truth) {
        use crate::run::{Asked, Facts, Judge, LogFile, Scenario, choice, with_robots};
        let path = std::env::temp_dir().join(format!("sinew-hands-{}-{name}.mcap", std::process::id()));
        let registry = with_robots(agents::registry());
        let mut file = crate::file::load("exploration", &[], &registry).unwrap();
        let at = types::Duration::secs(3);
        file.plan.requests =
            vec![runtime::TimedRequest { at, words: words(asked), place: Default::default() }];
        let mut ready = Scenario { file, registry }.prepare(1).unwrap();
        let said = super::ready(&mut ready.plan, std::iter::empty(), &ready.registry);
        assert!(said.iter().all(|(bytes, words)| bytes.contains(" cdr=") && !words.contains(" cdr=")));
        let (facts, seen) = (Facts::default(), record::log::RunInfo::default());
        let (log, _) = LogFile::create(&path, &seen, 1.0, facts.clone(), Asked::default()).unwrap();
        let options = runtime::Options {
            limit: Some(types::Duration::secs(5)),
            log: choice(&ready, 1.0),
            recorder: Some(Box::new(log)),
            observer: Box::new(Judge::new(&ready, Default::default(), Asked::default(), Some(facts))),
            parse: control::words::parse,
            ..runtime::Options::default()
        };
        runtime::Simulation::new(&ready.plan, &ready.registry, options).unwrap().run().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        (bytes, ready.truth.unwrap())
    }

    #[test]
    fn a_plan_pushes_and_adds_and_the_same_plan_gives_the_same_bytes() {
        let (_, plain) = run("plain", "call world.slip robot=h1");
        let way = |truth: &hardware::simulated::Truth| truth.robot("h1").unwrap().truth;
        let (bytes, pushed) = run("pushed", "call world.push robot=h1 left=0.1 turn=1.0");
        assert!((way(&pushed).turned - way(&plain).turned).abs() > 0.2, "{:?}", way(&pushed));
        assert_eq!(bytes, run("again", "call world.push robot=h1 left=0.1 turn=1.0").0);
        let at = way(&plain).pose;
        let add = format!("call world.add name=bin x={} y={} radius=0.2", at.x + 0.5, at.y + 0.5);
        let (bytes, added) = run("added", &add);
        assert_eq!(added.added().len(), 1, "{:?}", way(&added));
        let noted = b"stands: bin ";
        assert!(bytes.windows(noted.len()).any(|piece| piece == noted), "figures know where it stands");
    }

    #[test]
    fn a_wrong_call_is_refused_with_the_right_word() {
        assert!(said("call world.push rob=h1").contains("robot"), "{}", said("call world.push rob=h1"));
        assert!(said("call world.shove robot=h1").contains("no service \"shove\""));
        assert!(said("call nobody.push robot=h1").contains("no agent \"nobody\""));
        assert!(said("call world.push robot").contains("FIELD=VALUE"));
    }
}
