//! Ranks with their discretisation spread: which generator has more of something is only said where the gap exceeds
//! three times what mesh, increment and penalty move that gap by.

use serde::Serialize;

/// How many times the spread a gap must exceed.
pub(crate) const SPREADS: f64 = 3.0;

/// A number with what the discretisation does to it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// The value of the standard run.
    pub value: f64,
    /// Largest less smallest value of all variants, the standard one among them.
    pub spread: f64,
    /// The variants by name.
    pub variants: Vec<(String, f64)>,
}

impl Measured {
    /// From the standard value and those of the variants.
    pub fn new(value: f64, variants: Vec<(String, f64)>) -> Measured {
        let all = || variants.iter().map(|(_, v)| *v).chain([value]);
        let spread = all().fold(f64::MIN, f64::max) - all().fold(f64::MAX, f64::min);
        Measured { value, spread, variants }
    }

    /// The gap to another over the spread of that gap, signed: above [`SPREADS`] this one is larger, below −[`SPREADS`]
    /// smaller. The spread is that of the difference in each variant, both being discretised alike: what moves both
    /// does not count.
    pub(crate) fn gap_in_spreads(&self, other: &Measured) -> f64 {
        let gap = self.value - other.value;
        let paired = self.variants.iter().filter_map(|(name, value)| {
            let (_, theirs) = other.variants.iter().find(|(same, _)| same == name)?;
            Some(value - theirs)
        });
        let (low, high) = paired.fold((gap, gap), |(low, high), d| (low.min(d), high.max(d)));
        // A spread below a thousandth of the value says nothing about what else is uncertain.
        let floor = 1e-3 * self.value.abs().max(other.value.abs()).max(f64::MIN_POSITIVE);
        gap / (high - low).max(floor)
    }
}

/// Kendall's rank correlation of two rankings over the pairs that the first one orders: concordant less discordant over
/// all; a pair whose `ours` is closer than the spread allows counts as neither.
pub(crate) fn kendall_tau(paper_ranks: &[u32], ours: &[Measured]) -> Agreement {
    let mut agreement = Agreement { concordant: 0, discordant: 0, undecided: 0, tau: f64::NAN };
    for i in 0..ours.len() {
        for j in 0..i {
            if paper_ranks[i] == paper_ranks[j] {
                continue;
            }
            let expected = f64::from(paper_ranks[i]) - f64::from(paper_ranks[j]);
            let gap = ours[i].gap_in_spreads(&ours[j]) * expected.signum();
            match gap {
                gap if gap > SPREADS => agreement.concordant += 1,
                gap if gap < -SPREADS => agreement.discordant += 1,
                _ => agreement.undecided += 1,
            }
        }
    }
    let pairs = f64::from(agreement.concordant + agreement.discordant + agreement.undecided);
    agreement.tau = (f64::from(agreement.concordant) - f64::from(agreement.discordant)) / pairs;
    agreement
}

/// How two rankings agree.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Agreement {
    /// Pairs in the paper's order.
    pub concordant: u32,
    /// Pairs in the opposite order.
    pub discordant: u32,
    /// Pairs that the discretisation does not decide.
    pub undecided: u32,
    /// Kendall's tau, from −1 to 1.
    pub tau: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exact(value: f64) -> Measured {
        Measured::new(value, vec![("fine".into(), value), ("soft".into(), value)])
    }

    #[test]
    fn a_gap_must_exceed_three_spreads() {
        let a = Measured::new(10.0, vec![("fine".into(), 10.4), ("soft".into(), 9.9)]);
        assert!((a.spread - 0.5).abs() < 1e-12);
        assert!(exact(12.0).gap_in_spreads(&a) > SPREADS);
        assert!(exact(11.4).gap_in_spreads(&a) < SPREADS);
        assert!(exact(8.0).gap_in_spreads(&a) < -SPREADS);
    }

    /// A notch that every mesh sees larger moves both generators, and not their order.
    #[test]
    fn what_moves_both_alike_does_not_count() {
        let of = |value: f64| Measured::new(value, vec![("fine".into(), value + 40.0)]);
        assert!(of(200.0).spread > 39.0 && of(200.0).gap_in_spreads(&of(160.0)) > SPREADS);
    }

    #[test]
    fn kendall_counts_pairs_that_are_decided() {
        let ranks = [2, 2, 1, 0];
        let of = |values: [f64; 4]| kendall_tau(&ranks, &values.map(exact));
        assert_eq!(of([21.0, 20.0, 14.0, 10.0]).tau, 1.0);
        assert_eq!(of([1.0, 2.0, 14.0, 20.0]).tau, -1.0);
        // The pair that the paper ties is left out: five remain.
        let same = of([5.0; 4]);
        assert_eq!((same.tau, same.undecided), (0.0, 5));
        let mut values = [21.0, 20.0, 14.0, 10.0].map(exact);
        values[3] = Measured::new(10.0, vec![("fine".into(), 12.5)]);
        let agreement = kendall_tau(&ranks, &values);
        assert_eq!((agreement.concordant, agreement.undecided), (4, 1));
    }
}
