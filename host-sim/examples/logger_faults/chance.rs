//! Numbers drawn by a seed.

use std::f64::consts::TAU;

pub struct Chance(fastrand::Rng);

impl Chance {
    /// A stream of its own for each seed, name and number.
    pub fn new(seed: u64, name: &str, number: u64) -> Chance {
        let mut mixed = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ number.wrapping_mul(0xD1B5_4A32_D192_ED03);
        for byte in name.bytes() {
            mixed = (mixed ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3);
        }
        Chance(fastrand::Rng::with_seed(mixed))
    }

    pub fn between(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.0.f64()
    }

    /// As many from 1 to 2 as from 2 to 4.
    pub fn by_ratio(&mut self, [low, high]: [f64; 2]) -> f64 {
        low * (high / low).powf(self.0.f64())
    }

    pub fn is(&mut self, share: f64) -> bool {
        self.0.f64() < share
    }

    pub fn sign(&mut self) -> f64 {
        if self.is(0.5) { 1.0 } else { -1.0 }
    }

    pub fn below(&mut self, count: usize) -> usize {
        self.0.usize(..count.max(1))
    }

    pub fn of<'a, T>(&mut self, values: &'a [T]) -> &'a T {
        &values[self.below(values.len())]
    }

    /// A number of the normal distribution.
    pub fn gauss(&mut self) -> f64 {
        let (u, v) = (self.0.f64().max(1e-12), self.0.f64());
        (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
    }

    /// A number of the exponential distribution with mean 1.
    pub fn waiting(&mut self) -> f64 {
        -self.0.f64().max(1e-12).ln()
    }
}
