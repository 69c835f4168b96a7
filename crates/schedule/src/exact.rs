//! Numbers that are not rounded.

use num_bigint::BigInt;
use num_integer::Integer;
use num_rational::{BigRational, Ratio};
use num_traits::{One, ToPrimitive};

/// A fraction; as a time, of a nanosecond.
pub type Exact = Ratio<i128>;

/// The least number by which all of these must be multiplied to become whole; nothing when it is beyond reckoning.
pub(crate) fn common_denominator(numbers: impl Iterator<Item = Exact>) -> Option<i128> {
    numbers.into_iter().try_fold(1i128, |common, number| {
        let factor = number.denom() / common.gcd(number.denom());
        common.checked_mul(factor).filter(|common| *common <= i128::from(i64::MAX))
    })
}

/// A fraction of whole numbers of any size.
pub(crate) fn big(numerator: i128, denominator: i128) -> BigRational {
    BigRational::new(BigInt::from(numerator), BigInt::from(denominator))
}

/// The nearest floating-point number.
pub(crate) fn near(number: Exact) -> f64 {
    number.to_f64().unwrap_or(f64::NAN)
}

/// How far the sum of some thousands of rounded numbers about 1 may be from the true one.
const ROUNDING: f64 = 1e-9;

/// Whether what is about `value` is at most `bound`: reckoned exactly only where the rounded numbers leave it open.
pub(crate) fn at_most(value: f64, bound: f64, exactly: impl FnOnce() -> bool) -> bool {
    if (value - bound).abs() > ROUNDING * bound.abs().max(1.0) { value < bound } else { exactly() }
}

/// 1 + `number`.
pub(crate) fn more_than_one(number: BigRational) -> BigRational {
    BigRational::one() + number
}
