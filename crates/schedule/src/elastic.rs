//! Periods that give way under load, each as much as its elasticity says, within its limits.
//!
//! Buttazzo, Lipari and Abeni 1998; Buttazzo, Lipari, Caccamo and Abeni 2002. Tasks are springs in a row: their lengths are the
//! utilisations, and what is too long is taken from each in proportion to its elasticity; who has reached its longest period gives no more, and
//! the others share what is left. Always reckoned from the nominal periods, so the same load gives the same periods, whatever was before.

use crate::Exact;
use crate::exact::near;
use crate::response::feasible;
use crate::task::{Task, TaskSet};

/// A task whose period may be changed. Times in nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// Processor time of one job at worst.
    pub cost: f64,
    /// The period that its designer wishes.
    pub nominal: f64,
    /// The longest that he allows, no less than the nominal one.
    pub longest: f64,
    /// How readily it gives way, relative to others; 0 for not at all.
    pub elasticity: f64,
}

/// Why the periods cannot be made to fit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("at their longest periods the tasks still need {least:.6} of the {target:.6} that there is")]
pub struct TooMuch {
    /// What they need at the longest periods of those that may give way.
    pub least: f64,
    /// What they should need at most.
    pub target: f64,
}

/// The periods with which the utilisation is at most `target`, each in its place. The nominal ones where these fit.
pub fn compress(springs: &[Spring], target: f64) -> Result<Vec<f64>, TooMuch> {
    let used = |spring: &Spring| spring.cost / spring.nominal;
    let is_rigid = |spring: &Spring| spring.elasticity <= 0.0 || spring.longest <= spring.nominal;
    let least: f64 = springs
        .iter()
        .map(|spring| if is_rigid(spring) { used(spring) } else { spring.cost / spring.longest })
        .sum();
    let slack = 1e-12 * target.abs().max(1.0);
    if least > target + slack {
        return Err(TooMuch { least, target });
    }
    let mut periods: Vec<f64> = springs.iter().map(|spring| spring.nominal).collect();
    if springs.iter().map(used).sum::<f64>() <= target + slack {
        return Ok(periods);
    }
    let mut gives: Vec<bool> = springs.iter().map(|spring| !is_rigid(spring)).collect();
    loop {
        let (giving, fixed): (Vec<usize>, Vec<usize>) = (0..springs.len()).partition(|at| gives[*at]);
        let fixed: f64 = fixed.iter().map(|at| springs[*at].cost / periods[*at]).sum();
        let nominal: f64 = giving.iter().map(|at| used(&springs[*at])).sum();
        let elasticity: f64 = giving.iter().map(|at| springs[*at].elasticity).sum();
        let too_much = nominal + fixed - target;
        let mut stuck = false;
        for at in giving {
            let spring = &springs[at];
            let left = used(spring) - too_much * spring.elasticity / elasticity;
            let period = if left > 0.0 { spring.cost / left } else { f64::INFINITY };
            periods[at] = period.min(spring.longest);
            if period > spring.longest {
                gives[at] = false;
                stuck = true;
            }
        }
        if !stuck {
            return Ok(periods);
        }
    }
}

/// The periods with which all meet their deadlines under fixed priorities, exactly tested: those of the largest utilisation for which
/// they do, to a millionth. `tasks` in the order of their priorities, with their nominal periods; deadlines that are the period go with it.
/// Periods are whole nanoseconds.
pub fn compress_to_deadlines(tasks: &[Task], give: &[(f64, f64)]) -> Option<Vec<Exact>> {
    let springs: Vec<Spring> = tasks
        .iter()
        .zip(give)
        .map(|(task, (longest, elasticity))| Spring {
            cost: near(task.cost),
            nominal: near(task.period),
            longest: longest.max(near(task.period)),
            elasticity: *elasticity,
        })
        .collect();
    let at = |target: f64| -> Option<Vec<Exact>> {
        let periods = compress(&springs, target).ok()?;
        let whole = |(task, period): (&Task, f64)| {
            let rounded = Exact::from_integer((period - 1e-6).ceil() as i128);
            rounded.max(task.period)
        };
        let periods: Vec<Exact> = tasks.iter().zip(periods).map(whole).collect();
        let changed =
            tasks.iter().zip(&periods).map(|(task, period)| Task { period: *period, ..task.clone() });
        let set = TaskSet::new(changed.collect()).ok()?;
        feasible(&set).then_some(periods)
    };
    let whole: f64 = springs.iter().map(|spring| spring.cost / spring.nominal).sum();
    if let Some(nominal) = at(whole) {
        return Some(nominal);
    }
    let least: f64 =
        springs.iter().map(|it| it.cost / if it.elasticity > 0.0 { it.longest } else { it.nominal }).sum();
    let (mut low, mut high) = (least, whole.min(1.0).max(least));
    let mut best = at(low)?;
    while high - low > 1e-6 {
        let middle = (low + high) / 2.0;
        match at(middle) {
            Some(periods) => (low, best) = (middle, periods),
            None => high = middle,
        }
    }
    Some(best)
}
