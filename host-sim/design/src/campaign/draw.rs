//! Drive i: a pure function of the plan's hash and i.
//!
//! Sizes and phases are points of a Sobol sequence with Owen's scrambling (Burley 2020), two dimensions to a tolerance;
//! errors of teeth are noise by a counter, so that tooth k of drive i needs no other tooth and no other drive.

use super::tolerance::{Law, TeethError, Tolerance, ToleranceActs};
use flexspline_base::statistics::mean;
use flexspline_mechanics::drive::{AsBuilt, Drive, DriveError, Harmonic, Wheel};

/// Longest sequence of the crate `sobol_burley`.
pub(crate) const MOST_DRIVES: u32 = 1 << 16;
/// Half the spacing of its numbers, which are 0 to 1 − 2⁻²⁴: added, none of them is 0 or 1.
const HALF_STEP: f64 = 1.0 / (1 << 25) as f64;

/// A source of drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Draw {
    seed: u32,
    key: u64,
}

/// What was drawn, in the order of the tolerances.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Drawn {
    /// Value of the field; of errors of teeth their root mean square.
    pub values: Vec<f64>,
    /// Direction or phase, degrees; 0 where there is none.
    pub phases_deg: Vec<f64>,
    /// Errors of the teeth, µm; empty where the tolerance is none of them.
    pub teeth_um: Vec<Vec<f64>>,
}

/// A point that a drive is made of: two numbers of 0 to 1, neither, and a key of noise for each tolerance.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DrawnPoint {
    pub uniform: Vec<[f64; 2]>,
    pub keys: Vec<u64>,
}

impl DrawnPoint {
    /// This point with one tolerance taken from another.
    pub fn with(&self, tolerance: usize, from: &DrawnPoint) -> DrawnPoint {
        let mut mixed = self.clone();
        mixed.uniform[tolerance] = from.uniform[tolerance];
        mixed.keys[tolerance] = from.keys[tolerance];
        mixed
    }
}

impl Draw {
    /// The drives of a plan.
    pub(crate) fn of_plan(hash: &[u8; 32]) -> Draw {
        Draw::stream(hash, 0)
    }

    /// An independent sequence of the same plan.
    pub(super) fn stream(hash: &[u8; 32], stream: u32) -> Draw {
        let mut hasher = blake3::Hasher::new_keyed(hash);
        hasher.update(&stream.to_le_bytes());
        let bytes = hasher.finalize();
        let (seed, key) = bytes.as_bytes().split_at(4);
        let word = |bytes: &[u8]| bytes.iter().rev().fold(0_u64, |word, byte| word << 8 | u64::from(*byte));
        Draw { seed: word(seed) as u32, key: word(&key[..8]) }
    }

    /// The point of drive `i`.
    pub(super) fn point(&self, tolerances: usize, i: u32) -> DrawnPoint {
        self.point_from(tolerances, i, 0)
    }

    /// A point whose first dimension is `first` of the sequence.
    pub(super) fn point_from(&self, tolerances: usize, i: u32, first: u32) -> DrawnPoint {
        let at = |dimension: u32| f64::from(sobol_burley::sample(i, dimension, self.seed)) + HALF_STEP;
        let counter = |t: usize| u64::from(i) << 16 | u64::from(first) << 8 | t as u64;
        DrawnPoint {
            uniform: (0..tolerances as u32).map(|t| [at(first + 2 * t), at(first + 2 * t + 1)]).collect(),
            keys: (0..tolerances).map(|t| mixed(self.key ^ mixed(counter(t)))).collect(),
        }
    }

    /// Drive `i`.
    pub fn drive(&self, tolerances: &[Tolerance], teeth: [u32; 2], i: u32) -> Drawn {
        drawn(tolerances, teeth, &self.point(tolerances.len(), i))
    }
}

/// SplitMix64 (Steele, Lea and Flood 2014): a counter to a word.
fn mixed(counter: u64) -> u64 {
    let z = counter.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Number `k` of the noise of a key, between 0 and 1, neither.
fn noise(key: u64, k: u64) -> f64 {
    ((mixed(key.wrapping_add(k.wrapping_mul(0x9e37_79b9_7f4a_7c15))) >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
}

/// The drive of a point; `teeth` are those of flexspline and circular spline.
pub(super) fn drawn(tolerances: &[Tolerance], teeth: [u32; 2], point: &DrawnPoint) -> Drawn {
    let mut all = Drawn { values: Vec::new(), phases_deg: Vec::new(), teeth_um: Vec::new() };
    for ((tolerance, [size, place]), key) in tolerances.iter().zip(&point.uniform).zip(&point.keys) {
        let distribution = &tolerance.distribution;
        let mut errors = Vec::new();
        let (value, phase_deg) = match tolerance.acts {
            ToleranceActs::Alike => (distribution.quantile(*size), 0.0),
            ToleranceActs::Directed => (distribution.quantile(*size), 360.0 * place),
            ToleranceActs::Harmonic { order, .. } => (distribution.quantile(*size), 360.0 * place / f64::from(order)),
            ToleranceActs::Teeth { wheel, errors: of } => {
                let count = teeth[usize::from(wheel == Wheel::CircularSpline)];
                errors = (0..u64::from(count)).map(|k| distribution.quantile(noise(*key, k))).collect();
                if of == TeethError::Pitch {
                    errors = added_up(&errors);
                }
                (mean(&errors.iter().map(|x| x * x).collect::<Vec<f64>>()).sqrt(), 0.0)
            }
        };
        all.values.push(value);
        all.phases_deg.push(phase_deg);
        all.teeth_um.push(errors);
    }
    all
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

impl Drawn {
    /// Puts what places of the drive have into its imperfections.
    pub(crate) fn deviate(&self, tolerances: &[Tolerance], built: &mut AsBuilt) {
        for (t, tolerance) in tolerances.iter().enumerate() {
            let (value, phase) = (self.values[t], self.phases_deg[t]);
            match tolerance.acts {
                ToleranceActs::Alike => {}
                ToleranceActs::Directed => {
                    let (size, direction) = match tolerance.field.as_str() {
                        "as_built.circular_spline_eccentricity_um" => (
                            &mut built.circular_spline_eccentricity_um,
                            &mut built.circular_spline_eccentricity_phase_deg,
                        ),
                        "as_built.circular_spline_ovality_um" => {
                            (&mut built.circular_spline_ovality_um, &mut built.circular_spline_ovality_phase_deg)
                        }
                        "as_built.circular_spline_offset_um" => {
                            (&mut built.circular_spline_offset_um, &mut built.circular_spline_offset_direction_deg)
                        }
                        "as_built.flexspline_runout_um" => {
                            (&mut built.flexspline_runout_um, &mut built.flexspline_runout_phase_deg)
                        }
                        _ => (&mut built.generator_eccentricity_um, &mut built.generator_eccentricity_phase_deg),
                    };
                    (*size, *direction) = (value, phase);
                }
                ToleranceActs::Harmonic { wheel, order } => {
                    let list = match wheel {
                        Wheel::Flexspline => &mut built.flexspline_pitch_harmonics,
                        Wheel::CircularSpline => &mut built.circular_spline_pitch_harmonics,
                    };
                    list.push(Harmonic { order, amplitude_um: value, phase_deg: phase });
                }
                ToleranceActs::Teeth { wheel, .. } => {
                    let list = match wheel {
                        Wheel::Flexspline => &mut built.flexspline_pitch_error_um,
                        Wheel::CircularSpline => &mut built.circular_spline_pitch_error_um,
                    };
                    list.clone_from(&self.teeth_um[t]);
                }
            }
        }
    }

    /// The drive, as a file would have it.
    ///
    /// # Errors
    /// What was drawn makes no drive.
    pub fn drive(&self, drawn_as: &Drive, tolerances: &[Tolerance]) -> Result<Drive, DriveError> {
        let alike = tolerances.iter().zip(&self.values).filter(|(tolerance, _)| tolerance.acts == ToleranceActs::Alike);
        let sets: Vec<String> = alike.map(|(tolerance, value)| format!("{}={value}", tolerance.field)).collect();
        let mut drive = drawn_as.with_sets(sets.iter().map(String::as_str))?;
        self.deviate(tolerances, &mut drive.as_built);
        // Checked again, with what was put into it.
        drive.with_sets([])
    }

    /// The drive whose every tolerance has its middle value: nothing, of a size or an error of teeth.
    pub fn middle(tolerances: &[Tolerance]) -> Drawn {
        let of = |tolerance: &Tolerance| match (tolerance.acts, tolerance.distribution.law) {
            (ToleranceActs::Alike, Law::Normal { mean, .. }) => mean,
            (ToleranceActs::Alike, _) => tolerance.distribution.quantile(0.5),
            _ => 0.0,
        };
        Drawn {
            values: tolerances.iter().map(of).collect(),
            phases_deg: vec![0.0; tolerances.len()],
            teeth_um: vec![Vec::new(); tolerances.len()],
        }
    }
}
