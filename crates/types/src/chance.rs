//! Chance as a pure function: every draw comes from a seed, a stream and a number, and none from the draws before it.

/// Sixty-four bits that look drawn by chance: the finaliser of SplitMix64 (Steele, Lea, Flood 2014) over the three numbers.
pub fn bits(seed: u64, stream: u64, number: u64) -> u64 {
    mix(mix(mix(seed ^ 0x9e37_79b9_7f4a_7c15) ^ stream) ^ number)
}

fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A number from 0 (included) to 1 (excluded), all alike likely.
pub fn uniform(seed: u64, stream: u64, number: u64) -> f64 {
    (bits(seed, stream, number) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// A normally distributed number of mean 0 and deviation 1 (Box and Muller).
pub fn normal(seed: u64, stream: u64, number: u64) -> f64 {
    let radius = libm::sqrt(-2.0 * libm::log(1.0 - uniform(seed, stream, number)));
    radius * libm::cos(core::f64::consts::TAU * uniform(seed, stream ^ 0x5bd1_e995_0000_0001, number))
}

/// The number of a stream with this name (FNV-1a).
pub const fn stream(name: &str) -> u64 {
    let bytes = name.as_bytes();
    let (mut hash, mut i) = (0xcbf2_9ce4_8422_2325u64, 0);
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        i += 1;
    }
    hash
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SplitMix64 seeded with 0 gives this number first (Vigna's reference code, as quoted in its test vectors).
    #[test]
    fn the_mixer_is_splitmix64() {
        assert_eq!(mix(0), 0xe220_a839_7b1d_cdaf);
    }

    /// FNV-1a of "a" from the authors' list of vectors.
    #[test]
    fn a_stream_is_named_by_fnv() {
        assert_eq!(stream("a"), 0xaf63_dc4c_8601_ec8c);
    }

    #[test]
    fn draws_have_the_moments_of_their_distributions() {
        let n = 100_000;
        let mean = |draw: fn(u64, u64, u64) -> f64| (0..n).map(|i| draw(1, 2, i)).sum::<f64>() / n as f64;
        assert!(libm::fabs(mean(uniform) - 0.5) < 4.0 * 0.289 / 316.0);
        assert!(libm::fabs(mean(normal)) < 4.0 / 316.0);
        let square = (0..n).map(|i| normal(1, 2, i)).map(|x| x * x).sum::<f64>() / n as f64;
        assert!(libm::fabs(square - 1.0) < 4.0 * 1.414 / 316.0, "{square}");
    }
}
