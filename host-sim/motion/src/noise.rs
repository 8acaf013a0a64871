//! Numbers that look random, the same in every run and on every machine.

/// Starts at a seed.
#[derive(Clone, Debug)]
pub struct NoiseSource(pub(crate) u32);

impl NoiseSource {
    /// From a seed.
    pub fn new(seed: u32) -> Self {
        Self(seed)
    }

    /// 32 bits.
    pub fn number(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        let mut x = self.0;
        x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
        x = (x ^ (x >> 13)).wrapping_mul(0xc2b2_ae35);
        x ^ (x >> 16)
    }

    /// Evenly between −1 and 1.
    pub fn part(&mut self) -> f64 {
        f64::from(self.number()) * (2.0 / 4_294_967_296.0) - 1.0
    }

    /// Nearly normal, of standard deviation 1: the sum of four.
    pub fn normal(&mut self) -> f64 {
        let sum = self.part() + self.part() + self.part() + self.part();
        sum * libm::sqrt(0.75)
    }
}
