//! From words to a request.

use std::str::FromStr;

use runtime::{AgentPlan, FaultKind, OnDeath, Overload, QueuePlan, Refusal, Request, WirePlan};
use types::header::LeastPriority;
use types::value::Table;
use types::{Category, Duration, Priority};

use super::{AND, CHANGES, MOST_PAIRS, QUEUE, WIRE_KEYS, read_value};
use crate::protocol::{CALL_WAITS, LONGEST_CALL};

/// Longer than anything that robots do. Several such times can be added and each taken four times without an overflow.
const LONGEST: Duration = Duration::secs(10 * 365 * 24 * 3600);

type Read<T> = Result<T, Refusal>;

/// Reads a request.
///
/// ```
/// use runtime::Request;
///
/// let words = control::words::split("fault wall panic").unwrap();
/// assert!(matches!(control::words::parse(&words), Ok(Request::Fault { .. })));
/// let refused = control::words::parse(&["falt".into()]).unwrap_err();
/// assert_eq!(refused.to_string(), "there is no request \"falt\"; did you mean \"fault\"?");
/// ```
///
/// # Errors
/// When the words are no request: what is wrong, and the nearest right word or the right form.
pub fn parse(words: &[String]) -> Result<Request, Refusal> {
    let mut requests = Vec::new();
    for words in words.split(|word| word == AND) {
        match read_one(words)? {
            Request::All(several) => requests.extend(several),
            one => requests.push(one),
        }
    }
    if requests.len() > 1 {
        return Ok(Request::All(requests));
    }
    requests.pop().ok_or_else(nothing)
}

fn nothing() -> Refusal {
    let known: Vec<&str> = CHANGES.iter().map(|usage| usage.verb).collect();
    Refusal::new("nothing is asked").help(format!("a request begins with one of: {}", known.join(", ")))
}

fn read_one(words: &[String]) -> Read<Request> {
    let Some((verb, rest)) = words.split_first() else { return Err(nothing()) };
    match verb.as_str() {
        "add" if rest.get(2).is_some_and(|kind| kind == QUEUE) => read_queue(rest).map(Request::Queue),
        "add" => read_add(rest).map(Request::Add),
        "force" => read_one(rest).map(|request| Request::Forced(Box::new(request))),
        "remove" => only(verb, rest).map(|[agent]| Request::Remove(agent)),
        "restart" => only(verb, rest).map(|[agent]| Request::Restart(agent)),
        "replace" => {
            let (agent, kind, pairs) = name_is_kind(verb, rest)?;
            Ok(Request::Replace { agent, kind, params: pairs.into_params()? })
        }
        "wire" => read_wire(rest).map(Request::Wire),
        "unwire" => only(verb, rest).map(|[from, to]| Request::Unwire { from, to }),
        "set" => read_set(rest),
        "fault" => {
            let [target, kind] = only(verb, rest)?;
            let known = || FaultKind::ALL.map(FaultKind::name);
            let fault = FaultKind::named(&kind).ok_or_else(|| Refusal::unknown("fault", &kind, known()))?;
            Ok(Request::Fault { target, fault })
        }
        "send" => read_send(rest),
        "call" => read_call(rest),
        "quit" => only(verb, rest).map(|[]| Request::Quit),
        other => Err(Refusal::unknown("request", other, CHANGES.map(|usage| usage.verb))),
    }
}

/// The refusal of words that do not have the form of the request `verb`.
fn wrong_form(verb: &str, what: impl Into<String>) -> Refusal {
    let form = CHANGES.iter().find(|usage| usage.verb == verb).map_or(verb, |usage| usage.form);
    Refusal::new(what).help(format!("write: {form}"))
}

/// The first N words, which are no pairs, and those behind them.
fn begin<'a, const N: usize>(verb: &str, words: &'a [String]) -> Read<([String; N], &'a [String])> {
    let names = words.iter().take_while(|word| !word.contains('=')).count();
    if names < N {
        return Err(wrong_form(verb, format!("\"{verb}\" needs {N} words behind it, not {names}")));
    }
    Ok((core::array::from_fn(|i| words[i].clone()), &words[N..]))
}

/// N words and nothing behind them.
fn only<const N: usize>(verb: &str, words: &[String]) -> Read<[String; N]> {
    let (names, rest) = begin(verb, words)?;
    match rest.first() {
        None => Ok(names),
        Some(word) => Err(wrong_form(verb, format!("\"{word}\" is one word too many for \"{verb}\""))),
    }
}

fn name_is_kind<'a>(verb: &str, words: &'a [String]) -> Read<(String, String, Pairs<'a>)> {
    let ([name, is, kind], rest) = begin(verb, words)?;
    if is != "is" {
        return Err(wrong_form(verb, format!("between a name and its type stands \"is\", not \"{is}\"")));
    }
    Ok((name, kind, Pairs::read(verb, rest)?))
}

fn read_add(words: &[String]) -> Read<AgentPlan> {
    let (name, kind, mut pairs) = name_is_kind("add", words)?;
    let mut plan = AgentPlan { name, kind, ..AgentPlan::default() };
    plan.robot = pairs.take("robot").map(str::to_owned);
    plan.executor = pairs.take("executor").map(str::to_owned);
    plan.period = pairs.span("period")?;
    plan.period_range = pairs.take("period_range").map(read_range).transpose()?;
    plan.cost = pairs.span("cost")?;
    plan.deadline = pairs.span("deadline")?;
    plan.hang_after = pairs.span("hang_after")?;
    plan.min_gap = pairs.span("min_gap")?.unwrap_or_default();
    plan.wake_gap = pairs.span("wake_gap")?.unwrap_or_default();
    read_means(&mut pairs, &mut plan)?;
    if let Some(inputs) = pairs.take("on") {
        plan.on = inputs
            .split(',')
            .map(|input| input.trim().to_owned())
            .filter(|input| !input.is_empty())
            .collect();
    }
    if let Some(word) = pairs.take("on_death") {
        plan.on_death = match word {
            "restart" => OnDeath::Restart,
            "leave" => OnDeath::Leave,
            other => return Err(Refusal::unknown("policy on death", other, ["restart", "leave"])),
        };
    }
    plan.params = pairs.into_params()?;
    Ok(plan)
}

/// How it may do its step, and what a resource manager may take from it.
fn read_means(pairs: &mut Pairs<'_>, plan: &mut AgentPlan) -> Read<()> {
    if let Some(methods) = pairs.take("methods") {
        plan.methods = methods.split(',').map(read_method).collect::<Read<_>>()?;
    }
    plan.method = pairs.take("method").map(str::to_owned);
    plan.refinement = pairs.span("refinement")?;
    plan.budget = pairs.span("budget")?;
    let giving = &mut plan.giving;
    giving.importance = pairs.parsed("importance", "a number")?;
    giving.elasticity = pairs.parsed("elasticity", "a number")?;
    giving.gap_max = pairs.span("gap_max")?;
    giving.may_suspend = pairs.parsed("may_suspend", "true or false")?.unwrap_or(false);
    giving.is_rigid = pairs.parsed("rigid", "true or false")?.unwrap_or(false);
    giving.is_suspended = pairs.parsed("suspended", "true or false")?.unwrap_or(false);
    Ok(())
}

fn read_method(text: &str) -> Read<(String, Duration)> {
    let (name, cost) = text.split_once(':').ok_or_else(|| {
        Refusal::new(format!("methods has \"{text}\"")).help("write it as in exact:12ms,rough:3ms")
    })?;
    Ok((name.trim().to_owned(), read_span("methods", cost)?))
}

/// A queue is added as an agent is.
fn read_queue(words: &[String]) -> Read<QueuePlan> {
    let (name, _, mut pairs) = name_is_kind("add", words)?;
    let mut plan = QueuePlan::new(name);
    plan.depth = pairs.number("depth")?;
    let policies = [Overload::NewestWins, Overload::OldestWins, Overload::Refuse].map(Overload::name);
    plan.overload = pairs.named("overload", Overload::named, &policies)?;
    pairs.finish("a queue", &["depth", "overload"])?;
    Ok(plan)
}

fn read_range(text: &str) -> Read<(Duration, Duration)> {
    let (least, most) = text.split_once("..").ok_or_else(|| {
        Refusal::new(format!("period_range is \"{text}\"")).help("write it as in \"50ms..1s\"")
    })?;
    Ok((read_span("period_range", least)?, read_span("period_range", most)?))
}

fn read_span(key: &str, text: &str) -> Read<Duration> {
    let span: Duration =
        text.parse().map_err(|error| Refusal::new(format!("{key} is \"{text}\": {error}")))?;
    if span > LONGEST || span < -LONGEST {
        return Err(Refusal::new(format!("{key} is \"{text}\", which is longer than ten years")));
    }
    Ok(span)
}

fn read_wire(words: &[String]) -> Read<WirePlan> {
    let ([from, to], rest) = begin("wire", words)?;
    let mut pairs = Pairs::read("wire", rest)?;
    let mut plan = WirePlan::new(from, to);
    plan.depth = pairs.number("depth")?;
    plan.serving = pairs.number("serving")?;
    plan.filter.every = pairs.number("every")?.unwrap_or_default();
    plan.filter.marker = pairs.number("marker")?;
    plan.filter.recipient = pairs.take("recipient").map(str::to_owned);
    let policies = [Overload::NewestWins, Overload::OldestWins, Overload::Refuse].map(Overload::name);
    plan.overload = pairs.named("overload", Overload::named, &policies)?;
    plan.filter.category = pairs.named("category", Category::named, &Category::ALL.map(Category::name))?;
    let least = pairs.named("priority", Priority::named, &Priority::ALL.map(Priority::name))?;
    plan.filter.least_priority = least.map(LeastPriority).unwrap_or_default();
    pairs.finish("wire", &WIRE_KEYS)?;
    Ok(plan)
}

fn read_set(words: &[String]) -> Read<Request> {
    let ([agent], rest) = begin("set", words)?;
    let params = Pairs::read("set", rest)?.into_params()?;
    let mut sets: Vec<Request> = params
        .rows()
        .iter()
        .map(|row| Request::Set {
            agent: agent.clone(),
            key: row.key.clone(),
            value: row.entry.value.clone(),
        })
        .collect();
    match sets.len() {
        0 => Err(wrong_form("set", format!("nothing is said of what to set in {agent}"))),
        1 => Ok(sets.remove(0)),
        _ => Ok(Request::All(sets)),
    }
}

fn read_send(words: &[String]) -> Read<Request> {
    let ([port], rest) = begin("send", words)?;
    let mut pairs = Pairs::read("send", rest)?;
    let digits = pairs
        .take("cdr")
        .ok_or_else(|| wrong_form("send", format!("nothing is said of what to send out of {port}")))?;
    pairs.finish("send", &["cdr"])?;
    Ok(Request::Send { port, cdr: cdr_of(digits)? })
}

fn read_call(words: &[String]) -> Read<Request> {
    let ([service], rest) = begin("call", words)?;
    let mut pairs = Pairs::read("call", rest)?;
    let within = pairs.span("within")?.unwrap_or(CALL_WAITS).min(LONGEST_CALL);
    let digits = pairs
        .take("cdr")
        .ok_or_else(|| wrong_form("call", format!("nothing is said of what to ask {service}")))?;
    pairs.finish("call", &["cdr", "within"])?;
    Ok(Request::Call { service, cdr: cdr_of(digits)?, within })
}

fn cdr_of(digits: &str) -> Read<Vec<u8>> {
    read_hex(digits).ok_or_else(|| Refusal::new("cdr must be hexadecimal digits, two a byte"))
}

fn read_hex(digits: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| char::from(byte).to_digit(16).map(|n| n as u8);
    let (pairs, rest) = digits.as_bytes().as_chunks::<2>();
    let bytes = pairs.iter().map(|[high, low]| Some(digit(*high)? << 4 | digit(*low)?)).collect();
    if rest.is_empty() { bytes } else { None }
}

/// The words of the form `KEY=VALUE`, each key once.
pub(crate) struct Pairs<'a> {
    pairs: Vec<(&'a str, &'a str)>,
}

impl<'a> Pairs<'a> {
    pub(crate) fn read(verb: &str, words: &'a [String]) -> Read<Pairs<'a>> {
        if words.len() > MOST_PAIRS {
            let what = format!("there are {} pairs of KEY=VALUE, at most {MOST_PAIRS} are read", words.len());
            return Err(Refusal::new(what));
        }
        let mut pairs: Vec<(&str, &str)> = Vec::new();
        for word in words {
            let pair = word.split_once('=').filter(|(key, _)| !key.is_empty());
            let pair = pair.ok_or_else(|| wrong_form(verb, format!("\"{word}\" is no KEY=VALUE")))?;
            if pairs.iter().any(|(key, _)| *key == pair.0) {
                return Err(Refusal::new(format!("\"{}\" is said twice", pair.0)));
            }
            pairs.push(pair);
        }
        Ok(Pairs { pairs })
    }

    pub(crate) fn take(&mut self, key: &str) -> Option<&'a str> {
        let at = self.pairs.iter().position(|(known, _)| *known == key)?;
        Some(self.pairs.remove(at).1)
    }

    pub(crate) fn span(&mut self, key: &str) -> Read<Option<Duration>> {
        self.take(key).map(|text| read_span(key, text)).transpose()
    }

    pub(crate) fn number<N: FromStr>(&mut self, key: &str) -> Read<Option<N>> {
        self.parsed(key, "a whole number that is not negative")
    }

    fn parsed<N: FromStr>(&mut self, key: &str, wanted: &str) -> Read<Option<N>> {
        let Some(text) = self.take(key) else { return Ok(None) };
        let wrong = |_| Refusal::new(format!("{key} must be {wanted}, not \"{text}\""));
        text.parse().map(Some).map_err(wrong)
    }

    fn named<T>(&mut self, key: &str, named: fn(&str) -> Option<T>, known: &[&str]) -> Read<Option<T>> {
        let Some(word) = self.take(key) else { return Ok(None) };
        named(word).map(Some).ok_or_else(|| Refusal::unknown(key, word, known.iter().copied()))
    }

    /// Refuses what was not taken.
    pub(crate) fn finish(self, verb: &str, known: &[&str]) -> Read<()> {
        match self.pairs.first() {
            None => Ok(()),
            Some((key, _)) => Err(Refusal::unknown(&format!("option of {verb}"), key, known.iter().copied())),
        }
    }

    /// What was not taken, as parameters.
    pub(crate) fn into_params(self) -> Read<Table> {
        let mut table = Table::new();
        for (key, text) in self.pairs {
            table.set(key, read_value(text)?);
        }
        Ok(table)
    }
}
