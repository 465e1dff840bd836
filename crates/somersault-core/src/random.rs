//! Uniform numbers from a seed.

/// SplitMix64 of Steele, Lea and Flood (OOPSLA 2014): every seed gives a sequence of its own.
///
/// For starts and samples that must be the same on every machine and with every version of a crate, which generators made
/// elsewhere do not promise. Not for secrets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// The sequence of this seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1), a multiple of 2⁻⁵³.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_that_of_the_reference_implementation() {
        // S. Vigna, splitmix64.c, with the seed 1234567; the numbers that Rosetta Code lists
        let mut random = SplitMix64::new(1_234_567);
        let found = [(); 5].map(|()| random.bits());
        assert_eq!(
            found,
            [
                6_457_827_717_110_365_317,
                3_203_168_211_198_807_973,
                9_817_491_932_198_370_423,
                4_593_380_528_125_082_431,
                16_408_922_859_458_223_821,
            ]
        );
    }

    #[test]
    fn numbers_fill_the_unit_interval_evenly() {
        let mut random = SplitMix64::new(0);
        let numbers: Vec<f64> = (0..10_000).map(|_| random.unit()).collect();
        assert!(numbers.iter().all(|x| (0.0..1.0).contains(x)));
        for part in 0..10 {
            let count = numbers.iter().filter(|x| (**x * 10.0) as usize == part).count();
            // five standard deviations of a binomial count
            assert!(count.abs_diff(1000) < 150, "{part}: {count}");
        }
    }
}
