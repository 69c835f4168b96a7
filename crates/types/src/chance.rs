//! Chance without a generator: every draw is a pure function of (seed, stream name, sample number).
//!
//! No draw depends on another, so leaving out a sensor, or listening to one more, changes nothing else.
//! The mixer is the finaliser of SplitMix64 (Steele, Lea, Flood 2014); normal numbers are by Box and Muller.

use crate::geometry::TAU;
use libm::{log, sincos, sqrt};

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A named source of draws, numbered from zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream(u64);

/// The finaliser of SplitMix64: a bijection in which every bit of the input moves every bit of the output.
const fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Stream {
    /// The stream called `name` of a run with this seed.
    pub fn new(seed: u64, name: &str) -> Stream {
        // FNV-1a spreads the name, the mixer the seed.
        let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        });
        Stream(mix(mix(seed.wrapping_add(GOLDEN)) ^ hash))
    }

    /// The draws of one sample: a stream of its own.
    #[inline]
    pub const fn sample(self, number: u64) -> Stream {
        Stream(self.bits(number))
    }

    /// 64 even bits.
    #[inline]
    pub const fn bits(self, number: u64) -> u64 {
        mix(self.0.wrapping_add(number.wrapping_add(1).wrapping_mul(GOLDEN)))
    }

    /// Even in [0, 1).
    #[inline]
    pub fn uniform(self, number: u64) -> f64 {
        (self.bits(number) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Even in [low, high).
    pub fn between(self, number: u64, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform(number)
    }

    /// A whole number in 0..count; zero when `count` is zero.
    pub fn index(self, number: u64, count: usize) -> usize {
        ((u128::from(self.bits(number)) * count as u128) >> 64) as usize
    }

    /// Two independent normal numbers of mean 0 and deviation 1.
    #[inline]
    pub fn normals(self, number: u64) -> (f64, f64) {
        // One minus the draw lies in (0, 1], so the logarithm is finite.
        let radius = sqrt(-2.0 * log(1.0 - self.uniform(number.wrapping_mul(2))));
        let angle = TAU * self.uniform(number.wrapping_mul(2).wrapping_add(1));
        let (s, c) = sincos(angle);
        (radius * c, radius * s)
    }

    /// A normal number of mean 0 and deviation 1.
    #[inline]
    pub fn normal(self, number: u64) -> f64 {
        self.normals(number).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mixer_is_that_of_splitmix64() {
        // Published reference output of SplitMix64 for the seed 1234567.
        let state = 1_234_567u64;
        assert_eq!(mix(state.wrapping_add(GOLDEN)), 6_457_827_717_110_365_317);
        assert_eq!(mix(state.wrapping_add(GOLDEN.wrapping_mul(2))), 3_203_168_211_198_807_973);
    }

    #[test]
    fn normal_numbers_have_the_moments_of_the_normal_law() {
        let stream = Stream::new(1, "test");
        let n = 200_000u64;
        let (mut sum, mut square, mut fourth) = (0.0, 0.0, 0.0);
        for k in 0..n {
            let x = stream.normal(k);
            sum += x;
            square += x * x;
            fourth += x * x * x * x;
        }
        let n = n as f64;
        assert!((sum / n).abs() < 0.01, "mean {}", sum / n);
        assert!((square / n - 1.0).abs() < 0.015, "variance {}", square / n);
        assert!((fourth / n - 3.0).abs() < 0.1, "kurtosis {}", fourth / n);
    }

    #[test]
    fn streams_differ_by_seed_by_name_and_by_sample() {
        let a = Stream::new(1, "sonar");
        assert_ne!(a, Stream::new(2, "sonar"));
        assert_ne!(a, Stream::new(1, "laser"));
        assert_ne!(a.sample(0), a.sample(1));
        assert_eq!(a.sample(9).uniform(3), Stream::new(1, "sonar").sample(9).uniform(3));
    }

    #[test]
    fn an_index_covers_its_range_evenly() {
        let stream = Stream::new(5, "dice");
        let mut counts = [0u32; 6];
        for k in 0..60_000 {
            counts[stream.index(k, 6)] += 1;
        }
        assert!(counts.iter().all(|&c| (9_500..10_500).contains(&c)), "{counts:?}");
    }
}
