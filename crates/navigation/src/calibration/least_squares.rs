//! Linear least squares by singular values.

use nalgebra::{DMatrix, DVector};

/// Columns of which one is the others' sum to so many digits tell nothing apart.
const WORST_CONDITION: f64 = 1e10;

/// The x for which A x is nearest to b.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub(super) x: DVector<f64>,
    /// b − A x.
    pub(super) residuals: DVector<f64>,
    /// The largest singular value over the least, of columns scaled to a greatest entry of one.
    pub(super) condition: f64,
}

/// Solves; nothing when the columns cannot be told apart, or there are fewer rows than columns.
pub(super) fn solve(a: &DMatrix<f64>, b: &DVector<f64>) -> Option<Solution> {
    if a.nrows() < a.ncols() || a.ncols() == 0 {
        return None;
    }
    let scales = DVector::from_fn(a.ncols(), |j, _| a.column(j).amax());
    if !scales.iter().all(|scale| scale.is_finite() && *scale > 0.0) || !b.iter().all(|y| y.is_finite()) {
        return None;
    }
    let scaled = DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] / scales[j]);
    let svd = scaled.svd(true, true);
    let condition = svd.singular_values.max() / svd.singular_values.min();
    if condition.is_nan() || condition >= WORST_CONDITION {
        return None;
    }
    let x = svd.solve(b, 0.0).ok()?.component_div(&scales);
    let residuals = b - a * &x;
    Some(Solution { x, residuals, condition })
}

/// Root of the mean of squares.
pub(super) fn rms(residuals: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for residual in residuals {
        sum += residual * residual;
        count += 1;
    }
    libm::sqrt(sum / f64::from(count.max(1)))
}
