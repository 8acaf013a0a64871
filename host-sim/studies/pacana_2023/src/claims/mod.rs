//! The paper's results one by one, in its order.
//!
//! Sizes are reproduced where ours is within [`SHARE`] of the paper's: it gives no tooth sizes, so nothing finer can be
//! asked. Ranks hold where the gap exceeds three times what the discretisation moves it by ([`super::rank`]).

mod kinematics;
mod load;
mod reversal;
mod stress;
mod travel;

use super::claim::Claim;
use super::rank::Measured;
use super::runs::{Runs, Solved};
use flexspline_mechanics::drive::{Drive, GeneratorKind};

/// How near a size must be to count as the paper's.
pub const SHARE: f64 = 0.25;

/// What claims are judged by.
pub(super) struct Evidence<'a> {
    pub drive: &'a Drive,
    pub runs: &'a Runs,
}

impl Evidence<'_> {
    /// The unloaded run of a generator.
    fn unloaded(&self, kind: GeneratorKind) -> Option<&Solved> {
        self.runs.get(kind, 0.0)
    }

    /// A metric of the unloaded run in arc-minutes, from one in arc-seconds.
    fn arcmin(&self, kind: GeneratorKind, of: impl Fn(&super::metrics::ProtocolMetrics) -> Option<f64>) -> f64 {
        self.runs.value(kind, 0.0, of) / 60.0
    }

    /// Largest error of the whole unloaded path.
    fn largest(&self, kind: GeneratorKind) -> Measured {
        self.runs.measure(kind, 0.0, |m| Some(m.largest_out_arcsec.max(m.largest_back_arcsec)))
    }

    /// Backlash at no load: what is lost between forward and backward.
    fn backlash(&self, kind: GeneratorKind) -> Measured {
        self.runs.measure(kind, 0.0, |m| Some(2.0 * m.half_width_arcsec?))
    }
}

/// All claims, judged.
pub(super) fn all(evidence: &Evidence<'_>) -> Vec<Claim> {
    [
        ("Path of the teeth (Fig. 6)", kinematics::claims(evidence)),
        ("Stress (Figs. 10, 11)", stress::claims(evidence)),
        ("Error of four generators (Figs. 12, 13)", travel::claims(evidence)),
        ("Load (Figs. 14, 15)", load::claims(evidence)),
        ("Reversal (Figs. 16, 17)", reversal::claims(evidence)),
    ]
    .into_iter()
    .flat_map(|(part, claims)| claims.into_iter().map(move |claim| Claim { part, ..claim }))
    .collect()
}

/// The larger of values, NaN if one of them is.
fn most(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::NEG_INFINITY, |m, v| if m.is_nan() || v.is_nan() { f64::NAN } else { m.max(v) })
}

/// The smaller of values, NaN if one of them is.
fn least(values: impl IntoIterator<Item = f64>) -> f64 {
    -most(values.into_iter().map(|v| -v))
}
