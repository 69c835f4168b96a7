//! The decision maker: what it hears makes situations, and a table says what the situations give to whom.
//!
//! ```text
//!  safety, risk ──▶ danger ─┐
//!  target ────────▶ desire ─┤             ┌ the six below ┐   rows of the    ┌▶ decision: situation, goal, weights
//!  battery, odometry, load ─┼─▶ signals ─▶┤               ├─▶ table, by    ──┼▶ orders: importance, rate, activity, method
//!  what agents tell ────────┘             └ "when" in the ┘   priority       └▶ reasons: signals, situations
//!                                            table
//! ```
//!
//! | built in | active when | priority |
//! |---|---|---|
//! | `blind` | the safety monitor is silent or sees nothing | 100 |
//! | `target.near` | danger, and what is near is what is followed | 90 |
//! | `danger.near` | danger, and what is near is something else | 80 |
//! | `target.seen` | desire | 70 |
//! | those of the table | their `when` is true; once active, until their `until` is | 50 |
//! | `narrow` | little room on both sides | 20 |
//! | `free` | always | 0 |
//!
//! Danger and desire each have a level at which they begin and a lower one at which they end, so that a reading that trembles does not
//! make the robot tremble; `when` and `until` do the same for a situation of one's own.
//!
//! Several situations are active together. For each agent, and for each kind of setting, the one of the highest priority counts that says
//! something; so it is with the goal. Among equal priorities the order of the table decides. `blind` and `danger.near` silence everybody
//! where the table has no weights for them. What the table's language is stands at [`DecisionParams::table`].

mod condition;
mod hearing;
mod judgement;
mod signal;
mod situation;
mod table;
#[cfg(test)]
mod tests;

use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{Battery, Decision, Load, Odometry, Orders, Reasons, Risk, Safety, Signal, Target};
use types::params::{ParamValue as _, Params};
use types::value::{Mistake, Table};
use types::{Duration, Time};

pub use judgement::{Judgement, Verdict};
pub use situation::Situation;
pub use table::{DecisionTable, RESERVED, SETTINGS};

use crate::shared::Dated;
use hearing::Hearing;
use signal::{Kind, Known, MOST_TOLD};

/// The levels, and the table of the decisions.
#[derive(Clone, Debug, Params)]
#[params(check = whole)]
pub struct DecisionParams {
    /// For each situation what it gives to whom; the section `[decide]` of a system file is this table. A number is the weight of an agent's offers, from 0 to 1, as in "danger.near" = { safety = 1.0, wall = 0.0 }; a table can say more of an agent: weight and importance from 0 to 1, rate (the share of its nominal rate, above 0, to 1), active (true or false) and method (a word that it knows), as in track = { weight = 1.0, rate = 0.5, method = "exact" }.
    /// Built in are the situations blind (priority 100), target.near (90), danger.near (80), target.seen (70), narrow (20) and free (0, always active). Any other row needs a condition: "battery.low" = { when = "battery < 0.2", until = "battery > 0.3", priority = 60, goal = "charge", track = 0.0 } begins when `when` is true and lasts until `until` is, or where there is none, until `when` is false. The priority is a whole number from 0 to 1000, 50 where the row says none, and can be said of built-in situations too. Several situations are active together: for each agent and each setting, and for the goal, the one of the highest priority counts that says something; the order in the table breaks ties. Where the table has no weights for blind or danger.near, these silence everybody.
    /// A condition is made of numbers, true, false, signals, + - * /, the comparisons < <= > >= == !=, && (and), || (or), ! (not), brackets, min(a, b), max(a, b), abs(a) and known(signal). What nobody has sent, or what is too old, is unknown: a comparison with it is false, and known(...) tells.
    /// Signals: danger and desire (0 to 1), risk (the greatest in front, 0 to 1), blind (yes or no), narrow (yes or no), nearest (m from the rim), nearest_bearing (rad), linear_max (m/s that are safe), safety_age (s since the last verdict), target_share (of the picture, 0 to 1), target_bearing (rad), target_visible (yes or no), target_age (s), battery (charge, 0 to 1), battery_age (s), speed (m/s ahead), turn (rad/s, counter-clockwise), load (mean share of the processors that is at work, 0 to 1), pressure (share of time in which somebody waited for a processor or for memory, the greater of the two), and the names of the parameter `signals`.
    pub table: DecisionTable,
    /// Names that agents tell by the input `signals`, for conditions to use, as in ["faces"]: at most 16. They are declared so that a misspelt word in a condition is found.
    pub signals: Vec<String>,
    /// Danger from which on it is near (0 to 1). 0.95: a door is 0.85 and a slow approach to a wall stays below.
    #[param(default = 0.95, min = 0.0, max = 1.0)]
    pub danger_from: f64,
    /// Danger below which it is over (0 to 1). 0.85: the way ahead is then a fifth longer than it must be.
    #[param(default = 0.85, min = 0.0, max = 1.0)]
    pub danger_until: f64,
    /// Desire from which on the target is followed (0 to 1). 0.5 is a target that was seen for a while, not once.
    #[param(default = 0.5, min = 0.0, max = 1.0)]
    pub desire_from: f64,
    /// Desire below which it is given up (0 to 1). 0.1 lets the tracker look for it.
    #[param(default = 0.1, min = 0.0, max = 1.0)]
    pub desire_until: f64,
    /// Half the width of the front in which risk counts as danger (rad). 0.3 is the front beam of a ring of twelve: at the sides a wall that is followed is always near.
    #[param(default = 0.3, min = 0.0, max = 3.2)]
    pub front: f64,
    /// How much of the risk in front counts as danger (0 to 1). 0.9: it shows and delays the end of a danger, but a noisy pair of samples begins none.
    #[param(default = 0.9, min = 0.0, max = 1.0)]
    pub risk_share: f64,
    /// What is near within this angle of the target is taken for the target (rad). 0.6 is a person's width at arm's length.
    #[param(default = 0.6, min = 0.0, max = 3.2)]
    pub target_width: f64,
    /// Share of the picture from which on the target can be what is near. 0.02 is a ball of 28 cm at 1.8 m.
    #[param(default = 0.02, min = 0.0, max = 1.0)]
    pub target_share: f64,
    /// A verdict of the safety monitor older than this is none (time). 700 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(700), min = 0.01, max = 60.0)]
    pub safety_age: Duration,
    /// A target older than this is none (time). 500 ms is seven pictures.
    #[param(default = Duration::millis(500), min = 0.01, max = 60.0)]
    pub target_age: Duration,
    /// A reading of the battery older than this is none (time). 10 s: it changes within minutes, and drivers tell it every second or so.
    #[param(default = Duration::secs(10), min = 0.01, max = 3600.0)]
    pub battery_age: Duration,
    /// An odometry older than this is none (time). 500 ms is ten readings at 20 Hz.
    #[param(default = Duration::millis(500), min = 0.01, max = 60.0)]
    pub motion_age: Duration,
    /// A reading of the machine's load older than this is none (time). 5 s is a few readings at 1 Hz.
    #[param(default = Duration::secs(5), min = 0.01, max = 3600.0)]
    pub load_age: Duration,
}

/// What is wrong with table and signals together, as they were read.
fn whole(params: &DecisionParams, read: &Table) -> Vec<Mistake> {
    let mut mistakes = Vec::new();
    let signals = read.get("signals");
    let of_texts = signals.is_none_or(|entry| Vec::<String>::from_value(&entry.value).is_some());
    for entry in signals.and_then(|entry| entry.value.as_list()).unwrap_or_default() {
        let Some(name) = entry.value.as_text() else { continue };
        mistakes.extend(signal_mistake(name).map(|what| Mistake::new(entry.at, what)));
    }
    if let Some(entry) = signals.filter(|_| params.signals.len() > MOST_TOLD) {
        let count = params.signals.len();
        mistakes.push(Mistake::new(entry.at, format!("{count} signals are too many: {MOST_TOLD} have room")));
    }
    if let Some(table) = read.get("table").and_then(|entry| entry.value.as_table()) {
        // Where the names could not be read, no word is said to be unknown for it.
        mistakes.extend(DecisionTable::mistakes(table, of_texts.then_some(&params.signals)));
    }
    mistakes
}

/// Why a name cannot be that of a signal.
fn signal_mistake(name: &str) -> Option<String> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let is_word = name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(is_part);
    if Known::ALL.iter().any(|known| known.name() == name) {
        return Some(format!("\"{name}\" is a signal that every decision maker knows"));
    }
    if !is_word || name.len() > 23 {
        return Some(format!("\"{name}\" is no name for a signal: it has letters, digits and _, 23 at most"));
    }
    None
}

/// Whether a signal is yes or no, and no number.
pub fn is_truth(signal: &str) -> bool {
    Known::ALL.iter().any(|known| known.name() == signal && known.kind() == Kind::Truth)
}

/// Recognises situations from what it hears, and gives every agent what the table has for it.
#[derive(Agent)]
pub struct DecisionMaker {
    /// What the safety monitor says.
    safety: Input<Safety>,
    /// What the tracker sees.
    target: Input<Target>,
    /// The risk in each direction.
    risk: Input<Risk>,
    /// What is left in the battery.
    battery: Input<Battery>,
    /// How the robot moves.
    odometry: Input<Odometry>,
    /// How much the machine has to do.
    load: Input<Load>,
    /// Numbers that agents tell, for conditions of the table; of each name the newest counts, while it holds.
    signals: Input<Signal>,
    /// Situation, goal and weights, in every step.
    #[port(history = 256)]
    decision: Output<Decision>,
    /// What agents are to do besides, when it changes and once a second.
    orders: Output<Orders>,
    /// What the decision of the same time was made from, in every step.
    #[port(history = 256)]
    reasons: Output<Reasons>,
    params: DecisionParams,
    hearing: Hearing,
    judgement: Judgement,
    /// The last orders, and when they were sent.
    told: Option<(Orders, Time)>,
}

/// Orders that stay the same are sent so often.
const TELL_AGAIN: Duration = Duration::secs(1);

impl Agent for DecisionMaker {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        self.listen();
        let values = self.hearing.values(&self.params, step.now);
        let before = self.judgement.situation();
        let Verdict { decision, orders, reasons } = self.judgement.judge(&self.params, &values);
        if decision.situation != before {
            runtime::note!("another situation: danger {}, desire {}", decision.danger, decision.desire);
        }
        self.reasons.send(reasons);
        self.decision.send(decision);
        let is_news = |(told, at): &(Orders, Time)| *told != orders || step.now - *at >= TELL_AGAIN;
        if self.told.as_ref().is_none_or(is_news) {
            self.told = Some((orders, step.now));
            self.orders.send(orders);
        }
        Ok(())
    }
}

impl DecisionMaker {
    fn listen(&mut self) {
        newest(&mut self.safety, &mut self.hearing.safety);
        newest(&mut self.target, &mut self.hearing.target);
        newest(&mut self.risk, &mut self.hearing.risk);
        newest(&mut self.battery, &mut self.hearing.battery);
        newest(&mut self.odometry, &mut self.hearing.odometry);
        newest(&mut self.load, &mut self.hearing.load);
        while let Some(received) = self.signals.take() {
            self.hearing.told(&self.params.signals, *received, received.header().stamp);
        }
    }
}

fn newest<T: types::Message>(input: &mut Input<T>, heard: &mut Option<Dated<T>>) {
    if let Some(received) = input.newest() {
        *heard = Some(Dated { value: *received, stamp: received.header().stamp });
    }
}
