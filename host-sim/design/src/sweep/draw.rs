//! Random drives within tolerances, as assignments of fields of the drive.

use std::fmt::Write as _;

use fastrand::Rng;

use super::tolerance::{DistributionForm, FieldTolerance, TeethError, ToleranceActs, teeth};
use super::vary::latin;
use flexspline_base::statistics::mean;
use flexspline_mechanics::drive::Drive;

/// One tolerance of one drive, as drawn.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Drawn {
    /// Value of the field.
    pub value: f64,
    /// Direction or phase, degrees; 0 where there is none.
    pub phase_deg: f64,
    /// Errors of the teeth, µm; empty where the tolerance is none of them.
    pub teeth_um: Vec<f64>,
}

impl Drawn {
    /// The middle of every tolerance: 0 for a size or an error of teeth.
    pub(super) fn middle(tolerances: &[FieldTolerance]) -> Vec<Drawn> {
        let of = |tolerance: &FieldTolerance| match (tolerance.acts, tolerance.distribution.law) {
            (ToleranceActs::Alike, DistributionForm::Normal { mean, .. }) => mean,
            (ToleranceActs::Alike, _) => tolerance.distribution.quantile(0.5),
            _ => 0.0,
        };
        tolerances.iter().map(|tolerance| Drawn { value: of(tolerance), ..Drawn::default() }).collect()
    }
}

/// `count` drives: sizes and phases are a Latin hypercube, errors of single teeth are independent.
pub(super) fn draw(tolerances: &[FieldTolerance], drive: &Drive, count: usize, seed: u64) -> Vec<Vec<Drawn>> {
    let mut random = Rng::with_seed(seed);
    let points = latin(count, 2 * tolerances.len(), &mut random);
    let mut one = |tolerance: &FieldTolerance, place: &[f64]| {
        let of = &tolerance.distribution;
        let (mut value, mut phase_deg, mut teeth_um) = (of.quantile(place[0]), 0.0, Vec::new());
        match tolerance.acts {
            ToleranceActs::Alike => {}
            ToleranceActs::Directed => phase_deg = 360.0 * place[1],
            ToleranceActs::Harmonic { order, .. } => phase_deg = 360.0 * place[1] / f64::from(order),
            ToleranceActs::Teeth { wheel, errors } => {
                let mut error = || of.quantile(random.f64().max(f64::MIN_POSITIVE));
                teeth_um = (0..teeth(drive, wheel)).map(|_| error()).collect();
                if errors == TeethError::Pitch {
                    teeth_um = added_up(&teeth_um);
                }
                value = 0.0;
            }
        }
        Drawn { value, phase_deg, teeth_um }
    };
    points
        .iter()
        .map(|point| tolerances.iter().zip(point.chunks(2)).map(|(t, place)| one(t, place)).collect())
        .collect()
}

/// Positions from single pitch errors: their sum, closed around the wheel, about its mean.
fn added_up(pitches: &[f64]) -> Vec<f64> {
    let over = mean(pitches);
    let mut sum = 0.0;
    let mut positions: Vec<f64> = pitches
        .iter()
        .map(|pitch| {
            let here = sum;
            sum += pitch - over;
            here
        })
        .collect();
    let middle = mean(&positions);
    positions.iter_mut().for_each(|x| *x -= middle);
    positions
}

/// A drawn drive as assignments PATH=VALUE, each path once.
pub(super) fn sets(tolerances: &[FieldTolerance], drawn: &[Drawn]) -> Vec<String> {
    let mut sets: Vec<String> = Vec::new();
    for (tolerance, Drawn { value, phase_deg, teeth_um }) in tolerances.iter().zip(drawn) {
        let field = &tolerance.field;
        match tolerance.acts {
            ToleranceActs::Alike => sets.push(format!("{field}={value}")),
            ToleranceActs::Directed => {
                let part = field.trim_end_matches("_um");
                let angle = if part.ends_with("_offset") { "direction" } else { "phase" };
                sets.extend([format!("{field}={value}"), format!("{part}_{angle}_deg={phase_deg}")]);
            }
            ToleranceActs::Harmonic { order, .. } => {
                let one = format!("{{order = {order}, amplitude_um = {value}, phase_deg = {phase_deg}}}]");
                match sets.iter_mut().find(|set| set.starts_with(&format!("{field}="))) {
                    Some(others) => {
                        others.pop();
                        let _ = write!(others, ", {one}");
                    }
                    None => sets.push(format!("{field}=[{one}")),
                }
            }
            ToleranceActs::Teeth { .. } => sets.push(format!("{field}={teeth_um:?}")),
        }
    }
    sets
}
