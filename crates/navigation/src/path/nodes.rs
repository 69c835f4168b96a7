//! What a search knows of each cell. A new search forgets it all at no cost.

use super::cost::{Cost, NEVER};

/// Leads nowhere.
pub(super) const HERE: u32 = u32::MAX;

/// What is known of one cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Of the least way known between it and where the search began.
    pub(super) cost: Cost,
    /// Where that way comes from.
    pub(super) from: u32,
    /// The search in which it was met.
    round: u32,
}

/// One for each cell.
#[derive(Clone, Debug)]
pub(super) struct Nodes {
    nodes: Box<[Node]>,
    round: u32,
}

impl Nodes {
    /// For so many cells.
    pub(super) fn new(cells: usize) -> Nodes {
        let node = Node { cost: NEVER, from: HERE, round: 0 };
        Nodes { nodes: vec![node; cells].into_boxed_slice(), round: 1 }
    }

    /// Begins a new search.
    pub(super) fn forget(&mut self) {
        self.round = self.round.wrapping_add(1);
        if self.round == 0 {
            // Once in four thousand million searches.
            self.nodes.iter_mut().for_each(|node| node.round = 0);
            self.round = 1;
        }
    }

    /// What the least way known to a cell costs; [`NEVER`] where none is.
    #[inline]
    pub(super) fn cost(&self, cell: u32) -> Cost {
        let node = &self.nodes[cell as usize];
        if node.round == self.round { node.cost } else { NEVER }
    }

    /// Where that way comes from.
    #[inline]
    pub(super) fn from(&self, cell: u32) -> u32 {
        let node = &self.nodes[cell as usize];
        if node.round == self.round { node.from } else { HERE }
    }

    /// Takes a way to a cell, if it costs less than what is known.
    #[inline]
    pub(super) fn improve(&mut self, cell: u32, cost: Cost, from: u32) -> bool {
        let node = &mut self.nodes[cell as usize];
        if node.round == self.round && node.cost <= cost {
            return false;
        }
        *node = Node { cost, from, round: self.round };
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_search_knows_nothing_even_after_four_thousand_million_others() {
        let mut nodes = Nodes::new(2);
        assert!(nodes.improve(1, 5, 0) && !nodes.improve(1, 5, HERE) && nodes.improve(1, 4, 0));
        assert_eq!((nodes.cost(1), nodes.from(1), nodes.cost(0)), (4, 0, NEVER));
        nodes.round = u32::MAX;
        assert!(nodes.improve(1, 3, 0));
        nodes.forget();
        assert_eq!((nodes.round, nodes.cost(1), nodes.from(1)), (1, NEVER, HERE));
    }
}
