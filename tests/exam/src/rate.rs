//! A share of counts with its 95 % interval (Wilson 1927).

use serde::Serialize;

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Rate {
    pub right: usize,
    pub of: usize,
}

impl Rate {
    pub fn over(answers: impl IntoIterator<Item = bool>) -> Self {
        answers
            .into_iter()
            .fold(Self::default(), |rate, yes| Self { right: rate.right + usize::from(yes), of: rate.of + 1 })
    }

    /// The share; zero of none is zero.
    pub fn share(self) -> f64 {
        if self.of == 0 { 0.0 } else { self.right as f64 / self.of as f64 }
    }

    pub fn interval(self) -> (f64, f64) {
        if self.of == 0 {
            return (0.0, 1.0);
        }
        let (n, p, z) = (self.of as f64, self.share(), 1.959_963_985);
        let z2 = z * z;
        let middle = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
        let half = z / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
        ((middle - half).max(0.0), (middle + half).min(1.0))
    }
}

impl std::fmt::Display for Rate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.of == 0 {
            return f.write_str("        -");
        }
        let (low, high) = self.interval();
        write!(f, "{:5.1} %  {:>4}/{:<4} [{:.3}, {:.3}]", 100.0 * self.share(), self.right, self.of, low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_of_the_literature() {
        // DIAGNOSIS §2: 26/42, 42/42, 1/56.
        let near = |rate: Rate, low: f64, high: f64| {
            let (l, h) = rate.interval();
            assert!((l - low).abs() < 0.006 && (h - high).abs() < 0.006, "{l} {h}");
        };
        near(Rate { right: 26, of: 42 }, 0.47, 0.75);
        near(Rate { right: 42, of: 42 }, 0.92, 1.00);
        near(Rate { right: 1, of: 56 }, 0.00, 0.09);
    }
}
