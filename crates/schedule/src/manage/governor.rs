//! Settings that do not flutter: tighter at once, looser with patience.

use crate::Exact;
use crate::exact::near;
use crate::manage::apply::apply;
use crate::manage::change::shifts;
use crate::manage::room::Room;
use crate::manage::{Cause, Change, Found, Late, Managed, Setting, Stage, Way, manage};
use crate::system::{System, Unsound};

/// How reluctantly what was taken is given back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patience {
    /// How long the load must have been low, in nanoseconds. A second: some periods of the slow agents, so that what they need was seen.
    pub back_after: i64,
    /// By what share all costs may grow before something must be changed again. A twentieth: more than measured costs tremble from look to look.
    pub margin: f64,
}

impl Default for Patience {
    fn default() -> Patience {
        Patience { back_after: 1_000_000_000, margin: 0.05 }
    }
}

/// Watches a system from look to look, and says when agents have to run otherwise.
///
/// ```text
///            somebody would miss who need not            lower for so long
///   in force ──────────────────────────────▶ tighter     in force ──────────────────▶ looser
///        at once: what manage() finds with all                 what manage() finds with all costs `margin` larger,
///        costs `margin` larger, and nothing looser             when that is looser even with costs `margin` larger again
/// ```
///
/// Where it acts it keeps the margin in hand, as far as nobody is lost by that; so costs that tremble by less change nothing. What is ordered
/// otherwise is done at once. A governor is for one set of agents: where some are added or removed it begins anew.
#[derive(Clone, Debug)]
pub struct Governor {
    patience: Patience,
    managed: Vec<Managed>,
    settings: Vec<Setting>,
    /// Who misses as things are, and cannot be helped.
    given_up: Vec<usize>,
    /// Since when every look has found that less would do, in nanoseconds.
    low_since: Option<i64>,
}

/// What there is at a look.
struct Look<'a> {
    system: &'a System,
    managed: &'a [Managed],
    margin: f64,
    found: Found,
}

impl Governor {
    /// Nothing is known yet.
    pub fn new(patience: Patience) -> Governor {
        Governor {
            patience,
            managed: Vec::new(),
            settings: Vec::new(),
            given_up: Vec::new(),
            low_since: None,
        }
    }

    /// How the agents run, as far as they were looked at.
    pub fn settings(&self) -> &[Setting] {
        &self.settings
    }

    /// Who misses deadlines and cannot be helped, as was found when something was changed last.
    pub fn missing(&self) -> &[usize] {
        &self.given_up
    }

    /// Looks at the system, as [`manage`] takes it, and says what is to be otherwise from now on; it takes for granted that this is done. `now` in
    /// nanoseconds of any clock.
    ///
    /// # Errors
    /// As [`System::analyse`]; then nothing is changed.
    pub fn decide(
        &mut self,
        now: i64,
        system: &System,
        managed: &[Managed],
    ) -> Result<Option<Change>, Unsound> {
        let managed = &managed[..managed.len().min(system.agents.len())];
        if self.managed.len() != managed.len() {
            *self = Governor::new(self.patience);
            // They run as their designers wish until somebody says otherwise.
            self.managed = managed.iter().map(as_designed).collect();
            self.settings = self.managed.iter().map(|managed| Room::of(managed).most()).collect();
        }
        let found = manage(system, managed)?;
        let look = Look { system, managed, margin: self.patience.margin.max(0.0), found };
        let is_other = |at: &usize| is_ordered_otherwise(&self.managed[*at], &managed[*at]);
        let ordered: Vec<usize> = (0..managed.len()).filter(is_other).collect();
        let mut held = self.settings.clone();
        ordered.iter().for_each(|at| held[*at] = look.found.settings[*at]);
        let change = match self.tighter(&look, &held)? {
            Some(change) => Some(change),
            None if !ordered.is_empty() => Some((held, Cause::Ordered(ordered), look.found.stage)),
            None => self.looser(&look, now)?,
        };
        let Some((settings, cause, stage)) = change else { return Ok(None) };
        self.given_up = look.late(&settings)?.iter().map(|late| late.agent).collect();
        self.managed = managed.to_vec();
        self.low_since = None;
        let shifts = shifts(&self.settings, &settings);
        self.settings = settings;
        let missing = self.given_up.clone();
        Ok((!shifts.is_empty()).then_some(Change { shifts, cause, stage: Some(stage), missing }))
    }

    /// What must be, where somebody misses who need not.
    fn tighter(
        &self,
        look: &Look<'_>,
        held: &[Setting],
    ) -> Result<Option<(Vec<Setting>, Cause, Stage)>, Unsound> {
        let mut late = look.late(held)?;
        late.retain(|late| !look.found.missing.contains(&late.agent));
        if late.is_empty() {
            return Ok(None);
        }
        let roomy = look.with_costs_larger(1)?;
        // Who was given up is taken back when it can be helped for good.
        let is_lost = |at: &usize| self.given_up.contains(at) && roomy.missing.contains(at);
        late.retain(|late| !is_lost(&late.agent));
        if late.is_empty() {
            return Ok(None);
        }
        let may_miss = |at: &usize| look.found.missing.contains(at) || is_lost(at);
        let wish = if roomy.missing.iter().all(may_miss) { &roomy } else { &look.found };
        let pairs = held.iter().zip(&wish.settings);
        let both: Vec<Setting> = pairs.map(|(held, wish)| tighter_of(held, wish)).collect();
        let is_enough = look.late(&both)?.iter().all(|late| may_miss(&late.agent));
        let settings = if is_enough { both } else { wish.settings.clone() };
        Ok(Some((settings, Cause::Late(late), wish.stage)))
    }

    /// What may be, where less has been enough for long.
    fn looser(&mut self, look: &Look<'_>, now: i64) -> Result<Option<(Vec<Setting>, Cause, Stage)>, Unsound> {
        let rooms: Vec<Room> = look.managed.iter().map(Room::of).collect();
        let ordered: Vec<Setting> = rooms.iter().map(Room::most).collect();
        if self.settings == ordered {
            self.low_since = None;
            return Ok(None);
        }
        let saves_all = |found: &Found| found.missing.iter().all(|at| look.found.missing.contains(at));
        let is_looser = |found: &Found| {
            saves_all(found)
                && (found.settings == ordered
                    || gives_less(&rooms, &found.settings, &self.settings, look.margin))
        };
        if !is_looser(&look.with_costs_larger(2)?) {
            self.low_since = None;
            return Ok(None);
        }
        let since = *self.low_since.get_or_insert(now);
        if now.saturating_sub(since) < self.patience.back_after {
            return Ok(None);
        }
        let roomy = look.with_costs_larger(1)?;
        Ok(is_looser(&roomy).then_some((roomy.settings, Cause::Fallen, roomy.stage)))
    }
}

impl Look<'_> {
    /// Who would miss its deadline with these settings.
    fn late(&self, settings: &[Setting]) -> Result<Vec<Late>, Unsound> {
        let system = apply(self.system, self.managed, settings);
        let found = system.analyse()?;
        let late = |agent: usize| {
            let deadline = system.agents[agent].deadline;
            let misses = system.is_in_real_time(agent) && !found[agent].meets;
            misses.then_some(Late { agent, response: found[agent].response, deadline })
        };
        Ok((0..self.managed.len()).filter_map(late).collect())
    }

    /// What is found when all costs are larger by the margin, so many times.
    fn with_costs_larger(&self, times: u32) -> Result<Found, Unsound> {
        const PARTS: f64 = 1e6;
        let factor = Exact::new(((1.0 + self.margin) * PARTS).round() as i128, PARTS as i128);
        // In whole nanoseconds: fractions of fractions are soon too fine.
        let larger = |cost: Exact| (0..times).fold(cost, |cost, _| (cost * factor).ceil());
        let mut system = self.system.clone();
        system.agents.iter_mut().for_each(|agent| agent.cost = larger(agent.cost));
        let way = |way: &Way| Way { cost: larger(way.cost), ..*way };
        let managed = self
            .managed
            .iter()
            .map(|it| Managed { methods: it.methods.iter().map(way).collect(), ..it.clone() });
        manage(&system, &managed.collect::<Vec<Managed>>())
    }
}

fn as_designed(managed: &Managed) -> Managed {
    Managed { orders: Default::default(), ..managed.clone() }
}

/// Whether something else than the load is other than before. What methods cost is measured, and trembles.
fn is_ordered_otherwise(before: &Managed, after: &Managed) -> bool {
    let without_costs = |managed: &Managed| Managed { methods: Vec::new(), ..managed.clone() };
    before.methods.len() != after.methods.len() || without_costs(before) != without_costs(after)
}

/// What gives way as far as both.
fn tighter_of(one: &Setting, other: &Setting) -> Setting {
    Setting {
        period: one.period.max(other.period),
        // Behind the better ones come the cheaper ones.
        method: one.method.max(other.method),
        budget: one.budget.into_iter().chain(other.budget).min(),
        active: one.active && other.active,
    }
}

/// How much of what it could give of a kind an agent has given, in 0..=1.
type Given = fn(&Room, &Setting) -> f64;

/// Whether less is given away: less of what is given last, or as much of it and less of what is given before that. In periods and budgets
/// somebody must gain at least so large a share of what it is to have, for less is not worth a change.
fn gives_less(rooms: &[Room], new: &[Setting], old: &[Setting], worth: f64) -> bool {
    let kinds: [(Given, f64); 4] =
        [(life_given, 0.5), (budget_given, worth), (method_given, 1e-6), (rate_given, worth)];
    for (given, worth) in kinds {
        let gains: Vec<f64> = rooms
            .iter()
            .zip(old.iter().zip(new))
            .map(|(room, (old, new))| given(room, old) - given(room, new))
            .collect();
        let sum: f64 = rooms.iter().zip(&gains).map(|(room, gain)| room.importance * gain).sum();
        let largest = gains.iter().map(|gain| gain.abs()).fold(0.0, f64::max);
        if largest >= worth && sum != 0.0 {
            return sum > 0.0 && gains.iter().any(|gain| *gain >= worth);
        }
    }
    false
}

fn life_given(room: &Room, setting: &Setting) -> f64 {
    if room.active && !setting.active { 1.0 } else { 0.0 }
}

fn budget_given(room: &Room, setting: &Setting) -> f64 {
    let given = room.budget.zip(setting.budget).filter(|((most, least), _)| most > least);
    given.map_or(0.0, |((most, least), budget)| near((most - budget) / (most - least)))
}

fn method_given(room: &Room, setting: &Setting) -> f64 {
    let place = room.ways.iter().position(|way| *way >= setting.method).unwrap_or(room.ways.len());
    place as f64 / room.ways.len() as f64
}

fn rate_given(room: &Room, setting: &Setting) -> f64 {
    room.period.zip(setting.period).map_or(0.0, |((from, _), period)| 1.0 - near(from) / near(period))
}
