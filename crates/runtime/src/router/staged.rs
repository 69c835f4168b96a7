//! A change of the registry that can still be taken back.

use super::Router;
use super::script::{Cut, Step, What};

/// What a request has done to the registry, how to undo it, and what executors will have to do when it is decided.
#[derive(Default)]
pub(crate) struct Staged {
    pub(super) steps: Vec<Step>,
    /// Executors in which agents are in another order then.
    orders: Vec<usize>,
    /// Whether queues have other receivers then.
    ranks: bool,
    undo: Vec<Later>,
    decided: Vec<Later>,
}

type Later = Box<dyn FnOnce(&mut Router)>;

impl Staged {
    pub(super) fn step(&mut self, step: Step) {
        self.steps.push(step);
    }

    /// The end of a ring: a receiver leaves when it has taken what is there.
    pub(super) fn cut(&mut self, executor: usize, cut: Cut) {
        self.steps.push(Step { executor, of: cut.to.0, ring: None, what: What::Cut(cut) });
    }

    pub(super) fn reorder(&mut self, executor: usize) {
        if !self.orders.contains(&executor) {
            self.orders.push(executor);
        }
    }

    /// Who takes messages out of queues has changed.
    pub(super) fn rank(&mut self) {
        self.ranks = true;
    }

    /// How to take back what was just done to the registry.
    pub(super) fn undo(&mut self, undo: impl FnOnce(&mut Router) + 'static) {
        self.undo.push(Box::new(undo));
    }

    /// What cannot be taken back, and so is done only when all is decided.
    pub(super) fn when_decided(&mut self, then: impl FnOnce(&mut Router) + 'static) {
        self.decided.push(Box::new(then));
    }
}

impl Router {
    /// The registry as it was before.
    pub(super) fn take_back(&mut self, staged: Staged) {
        for undo in staged.undo.into_iter().rev() {
            undo(self);
        }
    }

    /// From here on it will be done. Gives the number of the script that says what is left to do.
    pub(super) fn decide(&mut self, staged: Staged) -> u64 {
        self.asking.changes();
        staged.decided.into_iter().for_each(|then| then(self));
        if staged.ranks || !staged.orders.is_empty() {
            self.rank_receivers();
        }
        // The order first: a seat that is due must have its place.
        let mut steps: Vec<Step> =
            staged.orders.into_iter().map(|executor| self.order_step(executor)).collect();
        steps.extend(staged.steps);
        self.begin(steps)
    }
}
