//! Symmetric matrices of three rows: what is known of a pose.

use libm::{fabs, sqrt};

/// Rows of (x, y, heading).
pub(crate) type Matrix = [[f64; 3]; 3];
pub(crate) type Vector = [f64; 3];

pub(crate) const ZERO: Matrix = [[0.0; 3]; 3];

/// A matrix with these numbers on its diagonal.
pub(crate) fn diagonal([a, b, c]: Vector) -> Matrix {
    [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]
}

pub(crate) fn sum(a: &Matrix, b: &Matrix) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| a[i][j] + b[i][j]))
}

pub(crate) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

pub(crate) fn transposed(a: &Matrix) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| a[j][i]))
}

pub(crate) fn times(a: &Matrix, v: &Vector) -> Vector {
    core::array::from_fn(|i| dot(&a[i], v))
}

pub(crate) fn dot(a: &Vector, b: &Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a` seen through `j`: `j a jᵀ`. The same on both sides of the diagonal to the last bit.
pub(crate) fn through(j: &Matrix, a: &Matrix) -> Matrix {
    let full = product(&product(j, a), &transposed(j));
    core::array::from_fn(|i| core::array::from_fn(|k| (full[i][k] + full[k][i]) / 2.0))
}

/// The inverse of a symmetric matrix that is positive: by the factors of Cholesky. None of one that is not.
pub(crate) fn inverse(a: &Matrix) -> Option<Matrix> {
    let mut low = ZERO;
    for i in 0..3 {
        for j in 0..=i {
            let rest = a[i][j] - (0..j).map(|k| low[i][k] * low[j][k]).sum::<f64>();
            if i == j {
                if !(rest > 0.0 && rest.is_finite()) {
                    return None;
                }
                low[i][i] = sqrt(rest);
            } else {
                low[i][j] = rest / low[j][j];
            }
        }
    }
    let mut back = ZERO;
    for i in 0..3 {
        back[i][i] = 1.0 / low[i][i];
        for j in 0..i {
            back[i][j] = -(j..i).map(|k| low[i][k] * back[k][j]).sum::<f64>() / low[i][i];
        }
    }
    Some(product(&transposed(&back), &back))
}

/// Of the covariance of a pose: deviations of the place along the axis in which it is larger (m), and of the heading (rad).
pub(crate) fn deviations([[a, b, _], [_, c, _], [_, _, heading]]: &Matrix) -> (f64, f64) {
    let half = (a - c) / 2.0;
    let largest = (a + c) / 2.0 + sqrt(half * half + b * b);
    (sqrt(largest.max(0.0)), sqrt(heading.max(0.0)))
}

/// The eigenvalues of a symmetric matrix and their directions (rows of length one), by Jacobi's rotations.
pub(crate) fn directions(a: &Matrix) -> ([f64; 3], Matrix) {
    let (mut a, mut rows) = (*a, diagonal([1.0; 3]));
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            rotate(&mut a, &mut rows, p, q);
        }
    }
    ([a[0][0], a[1][1], a[2][2]], rows)
}

/// Turns the plane of two axes so that nothing is left between them.
fn rotate(a: &mut Matrix, rows: &mut Matrix, p: usize, q: usize) {
    if fabs(a[p][q]) <= 1e-300 {
        return;
    }
    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let t = 1.0 / (fabs(theta) + sqrt(theta * theta + 1.0));
    let t = if theta < 0.0 { -t } else { t };
    let c = 1.0 / sqrt(t * t + 1.0);
    let s = t * c;
    let mut turn = diagonal([1.0; 3]);
    (turn[p][p], turn[q][q], turn[p][q], turn[q][p]) = (c, c, -s, s);
    *a = through(&turn, a);
    *rows = product(&turn, rows);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn near(a: &Matrix, b: &Matrix, by: f64) -> bool {
        (0..3).all(|i| (0..3).all(|j| (a[i][j] - b[i][j]).abs() <= by))
    }

    proptest! {
        #[test]
        fn inverse_and_directions_give_the_matrix_again(n in proptest::array::uniform9(-3.0..3.0f64)) {
            let root = [[n[0], n[1], n[2]], [n[3], n[4], n[5]], [n[6], n[7], n[8]]];
            let a = sum(&product(&transposed(&root), &root), &diagonal([0.1; 3]));
            let inverse = inverse(&a).unwrap();
            prop_assert!(near(&product(&a, &inverse), &diagonal([1.0; 3]), 1e-8));
            let (values, rows) = directions(&a);
            prop_assert!(near(&through(&rows, &a), &diagonal(values), 1e-8), "{values:?} {rows:?}");
            prop_assert!(near(&product(&rows, &transposed(&rows)), &diagonal([1.0; 3]), 1e-9));
        }
    }

    #[test]
    fn what_says_nothing_in_some_direction_has_no_inverse() {
        assert_eq!(inverse(&diagonal([1.0, 0.0, 1.0])), None);
        assert_eq!(inverse(&diagonal([1.0, f64::NAN, 1.0])), None);
    }
}
