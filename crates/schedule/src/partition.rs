//! Which processor runs which task, when none moves from one to another.

use crate::response::meets;
use crate::task::{Row, Task, TaskSet, Wrong};
use crate::utilization::rows_fit;

/// A set on several processors.
#[derive(Clone, Debug)]
pub struct Partition {
    /// Of each processor its tasks, the one of highest priority first, and the places that they had in what was given.
    pub processors: Vec<(TaskSet, Vec<usize>)>,
    /// Those that fit on no processor are on the one that has most room, where they miss their deadlines or make others miss them.
    pub homeless: Vec<usize>,
}

impl Partition {
    /// The processor of each task, by the places in what was given.
    pub fn processor_of(&self, task: usize) -> Option<usize> {
        self.processors.iter().position(|(_, places)| places.contains(&task))
    }
}

/// Tasks in the order of their priorities on so many processors: each where it says, else on the first on which it and all that are
/// there meet their deadlines. With priorities by deadline this is the FBB-FFD of Fisher, Baruah and Baker 2006, with exact response times.
pub fn first_fit(tasks: Vec<Task>, processors: usize) -> Result<Partition, Vec<Wrong>> {
    let set = TaskSet::new(tasks)?;
    let needed = set.tasks().iter().filter_map(|task| task.processor).max().map_or(1, |last| last + 1);
    let mut places: Vec<Vec<usize>> = vec![Vec::new(); processors.max(needed)];
    let mut homeless = Vec::new();
    // Those that have a place of their own are there before the others come.
    for (at, task) in set.tasks().iter().enumerate() {
        if let Some(processor) = task.processor {
            places[processor].push(at);
        }
    }
    for (at, _) in set.tasks().iter().enumerate().filter(|(_, task)| task.processor.is_none()) {
        let fits = |there: &Vec<usize>| {
            let mut with = there.clone();
            with.insert(there.partition_point(|other| *other < at), at);
            rows_meet(set.rows(), &with)
        };
        let least = || {
            let share = |there: &Vec<usize>| there.iter().map(|at| set.rows()[*at].share()).sum::<f64>();
            (0..places.len()).min_by(|a, b| share(&places[*a]).total_cmp(&share(&places[*b])))
        };
        let chosen = places.iter().position(fits).or_else(|| {
            homeless.push(at);
            least()
        });
        if let Some(there) = chosen.map(|chosen| &mut places[chosen]) {
            there.insert(there.partition_point(|other| *other < at), at);
        }
    }
    let sets = places.into_iter().map(|there| {
        let tasks = there.iter().map(|at| set.tasks()[*at].clone()).collect();
        TaskSet::new(tasks).map(|set| (set, there))
    });
    Ok(Partition { processors: sets.collect::<Result<_, _>>()?, homeless })
}

/// Whether these of the tasks, in this order, all meet their deadlines.
fn rows_meet(rows: &[Row], order: &[usize]) -> bool {
    let chosen: Vec<Row> = order.iter().map(|at| rows[*at]).collect();
    rows_fit(&chosen) && (0..chosen.len()).all(|at| meets(&chosen[at], chosen[..at].iter().copied()))
}
