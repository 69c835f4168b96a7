//! Tests that look at utilisations only: sufficient for rate-monotonic priorities, deadlines equal to the periods, no jitter and no
//! blocking. A set that fails them may still meet its deadlines: [`response`](crate::response) says.

use num_rational::BigRational;
use num_traits::{One, Zero};

use crate::TaskSet;
use crate::exact::{at_most, big, more_than_one};
use crate::task::Row;

/// What a test measured and what it allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// What is measured, rounded.
    pub value: f64,
    /// What it may be at most, rounded.
    pub bound: f64,
    /// Whether it is no more than that: exactly.
    pub pass: bool,
}

/// n (2^(1/n) − 1): so much may n tasks need together. 1 for one task, 0.693 for very many.
pub fn liu_layland_bound(n: usize) -> f64 {
    if n == 0 {
        return 1.0;
    }
    let n = n as f64;
    n * libm::expm1(std::f64::consts::LN_2 / n)
}

/// Liu and Layland 1973: Σ U ≤ n (2^(1/n) − 1).
pub fn liu_layland(set: &TaskSet) -> Verdict {
    let (value, bound) = (set.utilization(), liu_layland_bound(set.len()));
    let exactly = || {
        // Σ U ≤ n (2^(1/n) − 1) when (Σ U / n + 1)^n ≤ 2.
        let n = set.len().max(1);
        let base = more_than_one(exact_utilization(set.rows()) / big(n as i128, 1));
        num_traits::pow(base, n) <= big(2, 1)
    };
    Verdict { value, bound, pass: set.is_empty() || at_most(value, bound, exactly) }
}

/// Bini, Buttazzo and Buttazzo 2003: Π (U + 1) ≤ 2.
pub fn hyperbolic(set: &TaskSet) -> Verdict {
    let value = set.rows().iter().map(|row| row.share() + 1.0).product();
    let exactly = || {
        let factors = set.rows().iter().map(|row| more_than_one(big(row.cost, row.period)));
        factors.fold(BigRational::one(), |product, factor| product * factor) <= big(2, 1)
    };
    Verdict { value, bound: 2.0, pass: at_most(value, 2.0, exactly) }
}

/// Whether the tasks need no more than a whole processor.
pub fn fits_at_all(set: &TaskSet) -> Verdict {
    let value = set.utilization();
    Verdict { value, bound: 1.0, pass: rows_fit(set.rows()) }
}

/// Whether Σ U ≤ 1.
pub(crate) fn rows_fit(rows: &[Row]) -> bool {
    let value = rows.iter().map(Row::share).sum();
    at_most(value, 1.0, || exact_utilization(rows) <= BigRational::one())
}

/// Whether Σ U = 1.
pub(crate) fn rows_fill(rows: &[Row]) -> bool {
    let value: f64 = rows.iter().map(Row::share).sum();
    (value - 1.0).abs() < 1e-6 && exact_utilization(rows) == BigRational::one()
}

fn exact_utilization(rows: &[Row]) -> BigRational {
    rows.iter().fold(BigRational::zero(), |sum, row| sum + big(row.cost, row.period))
}
