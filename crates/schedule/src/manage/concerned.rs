//! Whose giving way can help somebody who is late.

use crate::system::System;

/// How far one looks for helpers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// Those who go before the late ones, who makes all these run, and whoever makes those late. On one processor nobody else counts.
    Near,
    /// Those who go before the helpers, too, and so on: on several processors the bounds for one agent depend on how late the others are.
    Far,
}

/// Of each agent, whether its giving way can help those who are late: they themselves are among them.
pub(super) fn concerned(system: &System, late: &[usize], reach: Reach) -> Vec<bool> {
    let mut targets = vec![false; system.agents.len()];
    late.iter().for_each(|at| targets[*at] = true);
    loop {
        makers(system, &mut targets);
        let helps: Vec<bool> = (0..targets.len()).map(|at| keeps_waiting(system, at, &targets)).collect();
        let mut next = helps.clone();
        if reach == Reach::Near {
            // Of those who only go before others it counts how late they come, which those make who make them run.
            let direct = (0..helps.len()).filter(|at| helps[*at]).flat_map(|at| &system.agents[at].sources);
            next.clone_from(&targets);
            direct.filter_map(|source| source.agent()).for_each(|from| next[from] = true);
        }
        if next == targets {
            return helps;
        }
        targets = next;
    }
}

/// Whether an agent is one of these or keeps one of them waiting.
fn keeps_waiting(system: &System, at: usize, targets: &[bool]) -> bool {
    let own = system.agents[at].executor;
    let waits = |target: usize| {
        system.is_in_real_time(target) && system.goes_before(own, system.agents[target].executor)
    };
    targets[at] || (0..targets.len()).any(|target| targets[target] && waits(target))
}

/// Takes in those that make these run.
fn makers(system: &System, helps: &mut [bool]) {
    let mut open: Vec<usize> = (0..helps.len()).filter(|at| helps[*at]).collect();
    while let Some(at) = open.pop() {
        for from in system.agents[at].sources.iter().filter_map(|source| source.agent()) {
            if !helps[from] {
                helps[from] = true;
                open.push(from);
            }
        }
    }
}
