//! Why it was decided as it was: the changes of the decision, from what was recorded of them and nothing else.

use std::collections::VecDeque;
use std::path::Path;

use agents::decision_maker::is_truth;
use record::log::{Message as Logged, ReadError, Reader};
use serde_json::{Map, Value as Json, json};
use types::message::Message;
use types::messages::{Decision, Order, Orders, Reasons};
use types::{Header, Name, Time, cdr};

/// A decision that differs from the one before.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Change {
    time: Time,
    /// Decisions and reasons of one step have one number: at one instant there can be two steps.
    number: u64,
    decision: Decision,
    reasons: Option<Reasons>,
    orders: Option<Orders>,
}

/// The last changes of a decision.
#[derive(Clone, Debug, Default)]
pub(crate) struct Changes {
    /// The oldest is there for what changed after it.
    kept: VecDeque<Change>,
    most: usize,
    /// The last decision, whether it was a change or not.
    last: Option<Decision>,
    /// Those whose decision was not heard yet.
    reasons: VecDeque<(Header, Reasons)>,
    orders: Option<(Time, Orders)>,
}

/// Reasons that wait for their decision: as many as an output keeps.
const WAITING: usize = 256;

impl Changes {
    /// Keeps the last `most` changes.
    pub(crate) fn new(most: usize) -> Changes {
        Changes { most, ..Changes::default() }
    }

    /// Takes a message of a decision maker, of whatever output.
    pub(crate) fn hear(&mut self, definition: &str, header: &Header, bytes: &[u8]) {
        match definition {
            Decision::NAME => self.decided(header, decoded(bytes)),
            Reasons::NAME => self.explained(header, decoded(bytes)),
            Orders::NAME => self.ordered(header.stamp, decoded(bytes)),
            _ => {}
        }
    }

    fn decided(&mut self, header: &Header, decision: Option<Decision>) {
        let Some(decision) = decision else { return };
        let (time, number) = (header.stamp, header.sequence);
        self.reasons.retain(|(known, _)| known.stamp >= time);
        let of_step = |known: &Header| known.stamp == time && known.sequence == number;
        let own = self.reasons.iter().position(|(known, _)| of_step(known));
        let reasons = own.and_then(|own| self.reasons.remove(own)).map(|(_, reasons)| reasons);
        let moved = reasons.is_some_and(|reasons| reasons.situations.iter().any(|held| held.was != held.is));
        let said = |decision: &Decision| Decision { danger: 0.0, desire: 0.0, ..*decision };
        if moved || self.last.as_ref().map(said) != Some(said(&decision)) {
            if self.kept.len() > self.most {
                self.kept.pop_front();
            }
            let orders = self.orders.filter(|(at, _)| *at <= time).map(|(_, orders)| orders);
            self.kept.push_back(Change { time, number, decision, reasons, orders });
        }
        self.last = Some(decision);
    }

    fn explained(&mut self, header: &Header, reasons: Option<Reasons>) {
        let Some(reasons) = reasons else { return };
        let of_step = |change: &&mut Change| change.time == header.stamp && change.number == header.sequence;
        match self.kept.iter_mut().rev().find(of_step) {
            Some(change) => change.reasons = Some(reasons),
            None => {
                if self.reasons.len() == WAITING {
                    self.reasons.pop_front();
                }
                self.reasons.push_back((*header, reasons));
            }
        }
    }

    fn ordered(&mut self, time: Time, orders: Option<Orders>) {
        let Some(orders) = orders else { return };
        // They are sent behind the decision of their step, and may be heard behind later ones.
        for change in self.kept.iter_mut().rev().take_while(|change| change.time >= time) {
            change.orders = Some(orders);
            if change.time == time {
                break;
            }
        }
        self.orders = Some((time, orders));
    }

    /// The last `n` changes, the newest last.
    pub(crate) fn last(&self, n: usize) -> Vec<Json> {
        let from = self.kept.len().saturating_sub(n.min(self.most));
        let before = |i: usize| i.checked_sub(1).and_then(|before| self.kept.get(before));
        self.kept.iter().enumerate().skip(from).map(|(i, change)| change.to_json(before(i))).collect()
    }
}

impl Change {
    fn to_json(self, before: Option<&Change>) -> Json {
        let Change { time, decision, reasons, orders, .. } = self;
        let active = reasons.map(|reasons| {
            let active = reasons.situations.iter().filter(|held| held.is);
            active.map(|held| held.situation.as_str().to_owned()).collect::<Vec<_>>()
        });
        json!({
            "time_s": time.seconds(),
            "situation": decision.situation.as_str(),
            "before": decision.before.as_str(),
            "active": decision.active.as_str(),
            "danger": decision.danger,
            "desire": decision.desire,
            "goal": word(decision.goal.as_str()),
            "situations": active,
            "values": reasons.map(|reasons| values(&reasons)),
            "weights": weights(&decision),
            "rows": decision.rows.iter().map(|row| {
                json!({"agent": row.agent.as_str(), "weight": row.weight, "by": row.by.as_str()})
            }).collect::<Vec<_>>(),
            "orders": orders.map(|orders| orders_of(&orders)),
            "changed": self.against(before),
        })
    }

    /// What is other than in the change before.
    fn against(&self, before: Option<&Change>) -> Json {
        let mut changed = Map::new();
        if let Some(reasons) = &self.reasons {
            let named = |which: fn(bool, bool) -> bool| {
                let held = reasons.situations.iter().filter(|held| which(held.was, held.is));
                held.map(|held| held.situation.as_str()).collect::<Vec<_>>()
            };
            changed.insert("began".into(), json!(named(|was, is| is && !was)));
            changed.insert("ended".into(), json!(named(|was, is| was && !is)));
        }
        if before.is_none_or(|before| before.decision.situation != self.decision.situation) {
            let named = [self.decision.before, self.decision.situation];
            changed.insert("situation".into(), json!(named.each_ref().map(Name::as_str)));
        }
        let Some(before) = before else { return changed.into() };
        let goals = [&before.decision, &self.decision].map(|decision| word(decision.goal.as_str()));
        if goals[0] != goals[1] {
            changed.insert("goal".into(), json!(goals));
        }
        let of = |change: &Change| {
            let values = change.reasons.as_ref().map(values).unwrap_or_default();
            let orders = change.orders.as_ref().map(orders_of).unwrap_or_default();
            [("weights", weights(&change.decision)), ("values", values), ("orders", orders)]
        };
        for ((key, was), (_, is)) in of(before).into_iter().zip(of(self)) {
            let differing = differing(&was, &is);
            if !differing.is_empty() {
                changed.insert(key.into(), differing.into());
            }
        }
        changed.into()
    }
}

/// From each key that differs to what it was and what it is.
fn differing(was: &Map<String, Json>, is: &Map<String, Json>) -> Map<String, Json> {
    let gone = was.keys().filter(|key| !is.contains_key(*key));
    let pair = |key: &String| {
        (was.get(key) != is.get(key)).then(|| (key.clone(), json!([was.get(key), is.get(key)])))
    };
    is.keys().chain(gone).filter_map(pair).collect()
}

fn word(word: &str) -> Option<&str> {
    Some(word).filter(|word| !word.is_empty())
}

fn weights(decision: &Decision) -> Map<String, Json> {
    decision.rows.iter().map(|row| (row.agent.as_str().to_owned(), row.weight.into())).collect()
}

fn values(reasons: &Reasons) -> Map<String, Json> {
    let value =
        |signal: &str, value: f64| if is_truth(signal) { Json::from(value >= 0.5) } else { value.into() };
    let rows = reasons.values.iter();
    rows.map(|row| (row.signal.as_str().to_owned(), value(row.signal.as_str(), row.value))).collect()
}

/// What is said of each agent of which anything is said.
fn orders_of(orders: &Orders) -> Map<String, Json> {
    let said = |order: &Order| {
        let settings = [
            ("importance", order.importance().map(Json::from)),
            ("rate", order.rate().map(Json::from)),
            ("active", order.active().map(Json::from)),
            ("method", order.method().map(Json::from)),
        ];
        let said = settings.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
        said.collect::<Map<_, _>>()
    };
    let rows = orders.orders.iter().map(|order| (order.agent.as_str().to_owned(), said(order)));
    rows.filter(|(_, said)| !said.is_empty()).map(|(agent, said)| (agent, said.into())).collect()
}

/// A message from its bytes.
pub(crate) fn decoded<T: Message>(bytes: &[u8]) -> Option<T> {
    T::decode(&mut cdr::Reader::new(bytes).ok()?, &mut Vec::new()).ok()
}

/// The last `n` changes of a log, of all its decision makers; each says whose it is where there are several.
///
/// # Errors
/// When the file is no log.
pub(crate) fn of_log(path: &Path, n: usize) -> Result<Json, ReadError> {
    let mut reader = Reader::open(path)?;
    let mut makers: Vec<(String, Changes)> = Vec::new();
    while let Some(message) = reader.next_message()? {
        let Some(agent) = decides(&message) else { continue };
        let known = makers.iter().position(|(known, _)| known == agent);
        let at = known.unwrap_or_else(|| {
            makers.push((agent.to_owned(), Changes::new(n)));
            makers.len() - 1
        });
        let header = message.header.unwrap_or(Header { stamp: message.time, ..Header::default() });
        makers[at].1.hear(&message.channel.definition, &header, &message.cdr);
    }
    let several = makers.len() > 1;
    let mut all = Vec::new();
    for (agent, changes) in &makers {
        all.extend(changes.last(n).into_iter().map(|mut change| {
            if several {
                change["agent"] = json!(agent);
            }
            change
        }));
    }
    let time = |change: &Json| change["time_s"].as_f64().unwrap_or(0.0);
    all.sort_by(|a, b| time(a).total_cmp(&time(b)));
    Ok(all.split_off(all.len().saturating_sub(n)).into())
}

/// Whose message it is, where it belongs to a decision.
fn decides(message: &Logged) -> Option<&str> {
    let belongs = [Decision::NAME, Reasons::NAME, Orders::NAME].contains(&&*message.channel.definition);
    let topic = message.channel.topic.strip_prefix('/')?;
    belongs.then(|| topic.rsplit_once('/').map(|(agent, _)| agent)).flatten()
}

#[cfg(test)]
mod tests;
