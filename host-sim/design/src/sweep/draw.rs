//! Random drives within tolerances, as assignments of fields of the drive.

use fastrand::Rng;

use super::tolerance::{FieldTolerance, TeethError, ToleranceActs};
use super::vary::latin;
use flexspline_base::statistics::mean;

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
        let of = |FieldTolerance { acts, distribution, .. }: &FieldTolerance| Drawn {
            value: if *acts == ToleranceActs::Alike { distribution.middle() } else { 0.0 },
            ..Drawn::default()
        };
        tolerances.iter().map(of).collect()
    }
}

/// `count` drives: sizes and phases are a Latin hypercube, errors of single teeth are independent.
pub(super) fn draw(tolerances: &[FieldTolerance], count: usize, seed: u64) -> Vec<Vec<Drawn>> {
    let mut random = Rng::with_seed(seed);
    let points = latin(count, 2 * tolerances.len(), &mut random);
    let mut one = |tolerance: &FieldTolerance, place: &[f64]| {
        let of = &tolerance.distribution;
        let phased = |waves: u32| Drawn {
            value: of.quantile(place[0]),
            phase_deg: 360.0 * place[1] / f64::from(waves),
            ..Drawn::default()
        };
        match tolerance.acts {
            ToleranceActs::Alike => Drawn { value: of.quantile(place[0]), ..Drawn::default() },
            ToleranceActs::Directed => phased(1),
            ToleranceActs::Harmonic { order } => phased(order),
            ToleranceActs::Teeth { count, errors } => {
                let error = |_| of.quantile(random.f64().max(f64::MIN_POSITIVE));
                let teeth_um: Vec<f64> = (0..count).map(error).collect();
                let teeth_um = if errors == TeethError::Pitch { added_up(&teeth_um) } else { teeth_um };
                Drawn { teeth_um, ..Drawn::default() }
            }
        }
    };
    let of = |point: &Vec<f64>| tolerances.iter().zip(point.chunks(2)).map(|(of, place)| one(of, place)).collect();
    points.iter().map(of).collect()
}

/// Positions from single pitch errors: their sum, closed around the wheel, about its mean.
fn added_up(pitches: &[f64]) -> Vec<f64> {
    let over = mean(pitches);
    let up_to = |sum: &mut f64, pitch: &f64| Some(std::mem::replace(sum, *sum + (pitch - over)));
    let sums: Vec<f64> = pitches.iter().scan(0.0, up_to).collect();
    let middle = mean(&sums);
    sums.iter().map(|sum| sum - middle).collect()
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
            ToleranceActs::Harmonic { order } => {
                let one = format!("{{order = {order}, amplitude_um = {value}, phase_deg = {phase_deg}}}]");
                match sets.iter_mut().find(|set| set.starts_with(&format!("{field}="))) {
                    Some(others) => *others = format!("{}, {one}", others.trim_end_matches(']')),
                    None => sets.push(format!("{field}=[{one}")),
                }
            }
            ToleranceActs::Teeth { .. } => sets.push(format!("{field}={teeth_um:?}")),
        }
    }
    sets
}
