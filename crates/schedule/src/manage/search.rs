//! The least concessions with which deadlines are met.

use std::cell::Cell;

use crate::Exact;
use crate::elastic::{Spring, compress};
use crate::exact::near;
use crate::manage::apply::{apply, cost};
use crate::manage::concerned::{Reach, concerned};
use crate::manage::room::{Room, rounded_down, rounded_up};
use crate::manage::{Found, Managed, Setting, Stage};
use crate::system::{System, Unsound};

/// A range is halved so often: to a 4096th of what may be given.
const HALVINGS: u32 = 12;

/// A system, whose deadlines must be met, and how often that was tested.
pub(super) struct Search<'a> {
    system: &'a System,
    managed: &'a [Managed],
    /// Whose deadline is to be met.
    must: Vec<bool>,
    tests: Cell<usize>,
}

/// One concession.
#[derive(Clone, Copy)]
enum Step {
    Method(usize, usize),
    Suspend(usize),
}

impl<'a> Search<'a> {
    pub(super) fn new(system: &'a System, managed: &'a [Managed]) -> Search<'a> {
        let managed = &managed[..managed.len().min(system.agents.len())];
        let must = (0..managed.len()).map(|at| system.is_in_real_time(at)).collect();
        Search { system, managed, must, tests: Cell::new(0) }
    }

    /// The same when of those in real time only these must meet their deadlines.
    pub(super) fn only(mut self, asked_for: &[bool]) -> Search<'a> {
        let asked_for = asked_for.iter().copied().chain(std::iter::repeat(false));
        self.must.iter_mut().zip(asked_for).for_each(|(must, asked_for)| *must &= asked_for);
        self
    }

    /// The same when these need not meet their deadlines.
    pub(super) fn without(mut self, given_up: &[usize]) -> Search<'a> {
        given_up.iter().for_each(|at| self.must[*at] = false);
        self
    }

    /// Those that have agents.
    pub(super) fn managed(&self) -> &'a [Managed] {
        self.managed
    }

    /// Whether all that must meet their deadlines do, when they run like this.
    pub(super) fn fits(&self, settings: &[Setting]) -> Result<bool, Unsound> {
        self.tests.set(self.tests.get() + 1);
        let must = |at: usize| self.must.get(at).is_some_and(|must| *must);
        apply(self.system, self.managed, settings).do_meet(must)
    }

    /// Who of them does not.
    pub(super) fn late(&self, settings: &[Setting]) -> Result<Vec<usize>, Unsound> {
        self.tests.set(self.tests.get() + 1);
        let found = apply(self.system, self.managed, settings).analyse()?;
        Ok((0..self.must.len()).filter(|at| self.must[*at] && !found[*at].meets).collect())
    }

    /// What was found, to be told.
    pub(super) fn found(self, settings: Vec<Setting>, stage: Stage, missing: Vec<usize>) -> Found {
        Found { settings, feasible: missing.is_empty(), stage, missing, tests: self.tests.get() }
    }

    /// The least concessions of those who can help the late ones. Who is farther away is asked where longer periods of
    /// the near ones are not enough, so that the least important of all come first.
    pub(super) fn with_help(&self, rooms: &[Room], late: &[usize]) -> Result<(Vec<Setting>, Stage), Unsound> {
        let near = concerned(self.system, late, Reach::Near);
        let far = concerned(self.system, late, Reach::Far);
        let helping = |helps: &[bool]| -> Vec<Room> {
            let room = |(room, helps): (&Room, &bool)| if *helps { room.clone() } else { room.at_most() };
            rooms.iter().zip(helps).map(room).collect()
        };
        let close = self.settle(&helping(&near))?;
        if near == far || close.as_ref().is_some_and(|(_, stage)| *stage <= Stage::Periods) {
            return Ok(close.unwrap_or_else(|| all_given(rooms)));
        }
        let wide = self.settle(&helping(&far))?;
        let best = match (close, wide) {
            (Some(close), Some(wide)) if close.1 < wide.1 => Some(close),
            (close, wide) => wide.or(close),
        };
        Ok(best.unwrap_or_else(|| all_given(rooms)))
    }

    /// The least concessions within these rooms, and the last kind that was needed; nothing where all of them are not enough.
    fn settle(&self, rooms: &[Room]) -> Result<Option<(Vec<Setting>, Stage)>, Unsound> {
        let mut settings: Vec<Setting> = rooms.iter().map(Room::most).collect();
        for (setting, room) in settings.iter_mut().zip(rooms) {
            setting.period = room.longest();
        }
        if self.fits(&settings)? {
            return Ok(Some((self.recovered(rooms, settings)?, Stage::Periods)));
        }
        let methods = methods(rooms);
        let lowered = after(&settings, &methods);
        if !methods.is_empty() && self.fits(&lowered)? {
            let settings = self.first_that_fits(&settings, &methods)?;
            return Ok(Some((self.recovered(rooms, settings)?, Stage::Methods)));
        }
        let mut settings = lowered;
        settings.iter_mut().zip(rooms).for_each(|(setting, room)| setting.budget = room.least().budget);
        if self.fits(&settings)? {
            return Ok(Some((self.recovered(rooms, settings)?, Stage::Budgets)));
        }
        let lives = lives(rooms);
        if lives.is_empty() || !self.fits(&after(&settings, &lives))? {
            return Ok(None);
        }
        let settings = self.first_that_fits(&settings, &lives)?;
        Ok(Some((self.recovered(rooms, settings)?, Stage::Lives)))
    }

    /// The settings after as few of these steps as are enough, when all of them are.
    fn first_that_fits(&self, settings: &[Setting], steps: &[Step]) -> Result<Vec<Setting>, Unsound> {
        let (mut too_few, mut enough) = (0, steps.len());
        while enough - too_few > 1 {
            let middle = (too_few + enough) / 2;
            if self.fits(&after(settings, &steps[..middle]))? {
                enough = middle;
            } else {
                too_few = middle;
            }
        }
        Ok(after(settings, &steps[..enough]))
    }

    /// Settings that fit, when all that need not be given is given back: the last concession first, to the most important first.
    fn recovered(&self, rooms: &[Room], settings: Vec<Setting>) -> Result<Vec<Setting>, Unsound> {
        let settings = self.revived(rooms, settings)?;
        let settings = self.granted(rooms, settings)?;
        let settings = self.bettered(rooms, settings)?;
        self.shortened(rooms, settings)
    }

    /// Lives given back.
    fn revived(&self, rooms: &[Room], mut settings: Vec<Setting>) -> Result<Vec<Setting>, Unsound> {
        for at in by_importance(rooms).into_iter().rev() {
            if rooms[at].active && !settings[at].active {
                settings[at].active = true;
                settings[at].active = self.fits(&settings)?;
            }
        }
        Ok(settings)
    }

    /// Budgets given back: each as large a part of what it lacks as its share times its importance says, with the largest common share that fits.
    pub(super) fn granted(&self, rooms: &[Room], settings: Vec<Setting>) -> Result<Vec<Setting>, Unsound> {
        let lacks = |at: &usize| {
            settings[*at].active
                && rooms[*at].budget.is_some_and(|(most, _)| settings[*at].budget < Some(most))
        };
        let lacking: Vec<usize> = (0..rooms.len()).filter(lacks).collect();
        let least = lacking.iter().map(|at| rooms[*at].importance).fold(f64::INFINITY, f64::min);
        let with = |share: f64| {
            let mut settings = settings.clone();
            for at in &lacking {
                settings[*at].budget =
                    rooms[*at].budget.map(|room| part(room, share * rooms[*at].importance));
            }
            settings
        };
        if lacking.is_empty() {
            return Ok(settings);
        }
        let all = with(1.0 / least);
        if self.fits(&all)? {
            return Ok(all);
        }
        self.largest(0.0, 1.0 / least, settings.clone(), with)
    }

    /// Methods given back.
    fn bettered(&self, rooms: &[Room], mut settings: Vec<Setting>) -> Result<Vec<Setting>, Unsound> {
        for at in by_importance(rooms).into_iter().rev() {
            let present = settings[at].method;
            for way in rooms[at].ways.iter().take_while(|way| **way != present) {
                settings[at].method = *way;
                if self.fits(&settings)? {
                    break;
                }
                settings[at].method = present;
            }
        }
        Ok(settings)
    }

    /// Periods given back: those of the largest utilisation that fits, shared by elasticity.
    ///
    /// Those who wait for different things need not give way as much as each other: who could not have half of what it gave back stays as it is,
    /// and what is left is shared among the others again. Where each of these could have it, but not all of them together, the most important have it first.
    fn shortened(&self, rooms: &[Room], settings: Vec<Setting>) -> Result<Vec<Setting>, Unsound> {
        let mut free = vec![true; rooms.len()];
        let mut settings = self.compressed(rooms, settings, &free)?;
        loop {
            let is_left = |at: &usize| free[*at] && half_back(&rooms[*at], &settings[*at]).is_some();
            let left: Vec<usize> = by_importance(rooms).into_iter().rev().filter(is_left).collect();
            for at in &left {
                free[*at] = self.fits(&with_half_back(rooms, &settings, *at))?;
            }
            if !left.iter().any(|at| free[*at]) {
                return Ok(settings);
            }
            if !left.iter().all(|at| free[*at]) {
                settings = self.compressed(rooms, settings, &free)?;
                continue;
            }
            for at in left {
                let back = with_half_back(rooms, &settings, at);
                free[at] = self.fits(&back)?;
                if free[at] {
                    settings = back;
                }
            }
        }
    }

    /// The periods of those that are free, as short as fits, each in its measure; no longer than they are. The others stay as they are.
    fn compressed(
        &self,
        rooms: &[Room],
        mut settings: Vec<Setting>,
        free: &[bool],
    ) -> Result<Vec<Setting>, Unsound> {
        for (setting, room) in settings.iter_mut().zip(rooms).filter(|(setting, _)| !setting.active) {
            setting.period = room.most().period;
        }
        let (places, springs) = self.springs(rooms, &settings, free);
        let with = |target: f64| {
            let mut settings = settings.clone();
            // A target below what is least is that, rounded.
            let periods = compress(&springs, target).unwrap_or_default();
            for (at, period) in places.iter().zip(periods) {
                let period = rooms[*at].period.map(|(from, to)| whole_between(from, to, period));
                settings[*at].period = period.min(settings[*at].period);
            }
            settings
        };
        let nominal = springs.iter().map(|it| it.cost / it.nominal).sum();
        let present =
            |(at, spring): (&usize, &Spring)| spring.cost / settings[*at].period.map_or(spring.longest, near);
        let present = places.iter().zip(&springs).map(present).sum();
        let all = with(nominal);
        if self.fits(&all)? {
            return Ok(all);
        }
        self.largest(present, nominal, settings.clone(), with)
    }

    /// Those whose periods give way, with their places.
    fn springs(&self, rooms: &[Room], settings: &[Setting], free: &[bool]) -> (Vec<usize>, Vec<Spring>) {
        let spring = |at: usize| {
            let room = &rooms[at];
            let (from, to) = room
                .period
                .filter(|(from, to)| to > from && room.give > 0.0 && settings[at].active && free[at])?;
            let cost = near(cost(&self.managed[at], &settings[at], self.system.agents[at].cost));
            // Who costs nothing may make others run that do.
            let cost = cost.max(1.0);
            Some((at, Spring { cost, nominal: near(from), longest: near(to), elasticity: room.give }))
        };
        (0..rooms.len()).filter_map(spring).unzip()
    }

    /// The settings for the largest number between these that fits, when those of the lower one do.
    fn largest(
        &self,
        mut low: f64,
        mut high: f64,
        mut best: Vec<Setting>,
        with: impl Fn(f64) -> Vec<Setting>,
    ) -> Result<Vec<Setting>, Unsound> {
        for _ in 0..HALVINGS {
            let middle = (low + high) / 2.0;
            let settings = with(middle);
            if self.fits(&settings)? {
                (low, best) = (middle, settings);
            } else {
                high = middle;
            }
        }
        Ok(best)
    }
}

/// The period of one that has half of what it lengthened it by; nothing for one that gives so little that it is not worth to give back of it.
fn half_back(room: &Room, setting: &Setting) -> Option<Exact> {
    let ((from, _), period) = (room.period?, setting.period?);
    let half = whole_between(from, period, near(from + (period - from) / Exact::from_integer(2)));
    (period > from * Exact::new(1001, 1000) && half < period).then_some(half)
}

/// The same settings with that period.
fn with_half_back(rooms: &[Room], settings: &[Setting], at: usize) -> Vec<Setting> {
    let mut back = settings.to_vec();
    back[at].period = half_back(&rooms[at], &settings[at]).or(back[at].period);
    back
}

/// A period as it is set: no rounding leads out of the limits.
fn whole_between(from: Exact, to: Exact, period: f64) -> Exact {
    if period >= near(to) { to } else { rounded_up(period).clamp(from, to) }
}

/// Between the least budget and the most.
fn part((most, least): (Exact, Exact), part: f64) -> Exact {
    if part >= 1.0 {
        return most;
    }
    let (low, high) = (near(least), near(most));
    rounded_down(low + (high - low) * part).clamp(least, most)
}

/// The least important first; of equals the last one.
fn by_importance(rooms: &[Room]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..rooms.len()).rev().collect();
    order.sort_by(|a, b| rooms[*a].importance.total_cmp(&rooms[*b].importance));
    order
}

/// Cheaper methods, one step after the other: the least important goes down all its ways before the next one begins.
fn methods(rooms: &[Room]) -> Vec<Step> {
    let ways = |at: usize| rooms[at].ways.iter().skip(1).map(move |way| Step::Method(at, *way));
    by_importance(rooms).into_iter().flat_map(ways).collect()
}

/// Those that may be suspended, in the order in which they are.
fn lives(rooms: &[Room]) -> Vec<Step> {
    by_importance(rooms).into_iter().filter(|at| rooms[*at].may_suspend).map(Step::Suspend).collect()
}

fn after(settings: &[Setting], steps: &[Step]) -> Vec<Setting> {
    let mut settings = settings.to_vec();
    for step in steps {
        match *step {
            Step::Method(at, way) => settings[at].method = way,
            Step::Suspend(at) => settings[at].active = false,
        }
    }
    settings
}

/// Everything is given.
fn all_given(rooms: &[Room]) -> (Vec<Setting>, Stage) {
    (rooms.iter().map(Room::least).collect(), Stage::Lives)
}
