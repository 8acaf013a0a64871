//! Summary of a run: the metrics of `summary.json`.
//!
//! Each is taken where it means what its name says, and is `null` where the path cannot give it.

use serde::Serialize;
use std::ops::Range;

use super::places::PlaceStress;
use super::row::Row;
use super::stress::PeakStress;
use super::zones::{TipContact, Zone};
use crate::cautions::Caution;
use crate::data_sheet::WindUpPart;
use crate::pitch_wave::peak_to_peak;
use crate::stated::SheetBeside;
use flexspline_base::figures::NamedFigure;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::mesh::WheelKind;

/// Version of the layout of `summary.json`; grows when a field changes its meaning or goes.
pub(crate) const SUMMARY_SCHEMA: u32 = 1;

/// Output travel, arc-seconds, within which the output counts as standing still at a reversal.
const STANDING_ARCSEC: f64 = 0.05;
/// Rows that a peak-to-peak value needs at least.
const ROWS_OF_A_RIPPLE: usize = 8;

/// The content of `summary.json`.
///
/// Means are taken over the last whole number of flexspline tooth pitches (`2 pi / z_f` of generator angle) of the
/// settled rows of a one-way stretch: a perfect drive repeats with that period, so its ripple drops out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Layout of this object.
    pub schema_version: u32,
    /// Version of the program.
    pub tool_version: &'static str,
    /// The command that made it; empty when made by a program.
    pub command: String,
    /// `converged`: every increment of the path reached equilibrium. A run that does not is an error and leaves no
    /// summary.
    pub status: &'static str,
    /// Name of the drive.
    pub drive: String,
    /// BLAKE3 of the drive's physics at reference temperature, hexadecimal.
    pub drive_hash: String,
    /// Wave generator.
    pub generator: String,
    /// Path: `paper`, `pitch`, `turn` or `points`.
    pub path: String,
    /// Mesh level.
    pub mesh: String,
    /// Solver.
    pub solver: String,
    /// Contact penalty on the flanks, N/mm³.
    pub flank_penalty_n_per_mm3: f64,
    /// Contact penalty on the bore, N/mm³.
    pub bore_penalty_n_per_mm3: f64,
    /// Unknowns of the system.
    pub degrees_of_freedom: usize,
    /// Load torque, N m; `null` when it changes along the path.
    pub torque_n_m: Option<f64>,
    /// Temperature, °C; `null` when it changes along the path.
    pub temperature_c: Option<f64>,
    /// Rows of the results.
    pub rows: usize,

    /// Ripple: largest minus smallest error of a settled one-way stretch at constant load and temperature; the largest
    /// if there are several. Needs a whole tooth pitch and eight rows. Where these are equal parts of a pitch and the
    /// drive repeats with it, it is that of the wave through the rows of the last pitch ([`crate::pitch_wave`]), whose
    /// ends lie between rows.
    pub kinematic_error_pp_arcsec: Option<f64>,
    /// The same of the rows alone.
    pub kinematic_error_pp_of_rows_arcsec: Option<f64>,
    /// Mean error while the generator turns forward (the first such stretch).
    pub mean_error_forward_arcsec: Option<f64>,
    /// Mean error while it turns backward.
    pub mean_error_backward_arcsec: Option<f64>,
    /// Lost motion of the output between turning forward and turning backward, at the first reversal and the same load:
    /// mean error backward minus mean error forward. Without load it is the clearance of the mesh, pushed to either
    /// side by the drag on the output, so `null` when the load exceeds the drag.
    pub backlash_arcsec: Option<f64>,
    /// Lost motion of the output at the first reversal under a load that exceeds the drag and keeps the flanks of one
    /// side together: what friction and the drag leave. `null` when the load does not exceed the drag.
    pub reversal_lost_motion_arcsec: Option<f64>,
    /// Generator travel from the first reversal during which the output stays within 0.05″ of where it stood. Between
    /// two rows, the output is taken to go at its nominal rate once it goes.
    pub dwell_generator_rad: Option<f64>,
    /// Error under load relative to the middle of the backlash at zero load: what a joint that was zeroed in the middle
    /// of its play turns when it is loaded, the usual reading of a torsion curve. It includes half the backlash. The
    /// error under load is the mean of both directions where both are known, so that the drag drops out, else of the
    /// one. The middle is that of two light touches either way on the freshly deformed drive: twice the drag, more
    /// where that is less than 2e-5 of the load, less where the load is not some times the drag. `null` when the load
    /// changes or does not exceed the drag.
    pub wind_up_arcsec: Option<f64>,
    /// The elastic part: the same error relative to the light touch on the side that the load pushes to. The touch is
    /// at one place of the tooth pitch and the error a mean over it, so that it is known to about the ripple, which
    /// counts where the wind-up is no more than that.
    pub wind_up_elastic_arcsec: Option<f64>,
    /// What the wind-up is made of, of a drive with `output.contact_compliance`; left out of any other.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wind_up_parts: Vec<WindUpPart>,
    /// Middle of the backlash at zero load on which `wind_up_arcsec` rests.
    pub backlash_middle_arcsec: Option<f64>,

    /// Largest von Mises stress of all rows at a node of the mesh, MPa. It grows with the mesh where stress is steep;
    /// `stress` is what it tends to.
    pub max_von_mises_mpa: f64,
    /// Where: `flexspline` or `circular_spline`.
    pub max_von_mises_wheel: &'static str,
    /// Where: global position, mm.
    pub max_von_mises_position_mm: [f64; 2],
    /// When: step of the results.
    pub max_von_mises_step: usize,
    /// The largest in the root fillets of the flexspline, of all rows, MPa: by the strain of their surface, which needs
    /// no such fine mesh.
    pub root_fillet_mpa: f64,
    /// The largest at a node on its bore.
    pub nodal_bore_mpa: f64,
    /// On its flanks.
    pub nodal_flank_mpa: f64,
    /// Stress of the flexspline at these places where and under what the nodal one is largest, over three meshes, with
    /// its interval; left out where it was not asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stress: Vec<PlaceStress>,
    /// Largest pressure between flanks, by their force and the shape of their gap
    /// ([`flexspline_mechanics::contact::FlankContact::peak_pressure_mpa`]); where they do not bear evenly along the
    /// face, under the largest load there.
    pub peak_flank_pressure_mpa: f64,
    /// Where the teeth bear at the row of that pressure, the zones with the largest force first.
    pub zones: Vec<Zone>,
    /// Contact of tips outside the main zones at the worst row; `null` where there is none.
    pub tip_contact: Option<TipContact>,
    /// Largest force of the generator along its major axis on one half of the rim, outward, N.
    pub lobe_force_n: f64,
    /// Largest tilt of a tooth along its face, outward, mrad: the coning of the rim. 0 in a plane model.
    pub tilt_mrad: f64,
    /// Largest skew of a tooth along its face, around, mrad.
    pub skew_mrad: f64,
    /// How the load lies along the face of the flank that bears most anywhere, at the row of the largest: peak over
    /// mean. 1 is even.
    pub load_across_face_peak_over_mean: f64,
    /// Share of the face of that flank that bears, at that row.
    pub face_in_contact: f64,
    /// Largest pressure between generator and bore.
    pub peak_generator_pressure_mpa: f64,
    /// Mean torque of the generator over the first settled stretch.
    pub generator_torque_mean_n_m: Option<f64>,
    /// That mean without friction, by virtual work: minus load and drag, over the ratio. Of a drive without
    /// friction it is the better number: the mean of rows has what the rows miss between them.
    pub generator_torque_virtual_work_n_m: Option<f64>,
    /// Whether the flanks have no friction.
    #[serde(skip)]
    pub without_friction: bool,
    /// Largest sum of load, drag and flank torques on the output of all rows: what equilibrium leaves.
    pub torque_balance_worst_n_m: f64,
    /// Largest residual of all rows, relative to the largest contact force.
    pub residual_worst: f64,

    /// Free rotation of the output with rigid teeth as built, at the tightest place of its turn, arcsec; `null` of a
    /// drive as drawn.
    pub room_as_built_arcsec: Option<f64>,
    /// Cautions on these figures; empty for a sound drive.
    pub cautions: Vec<Caution>,
    /// Values of the data sheet in the drive's file, next to the computed ones; left out where the file has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data_sheet: Option<SheetBeside>,

    /// Increments solved, all of them: deforming, loading, settling, light touches, path.
    pub increments: usize,
    /// Newton iterations of all increments.
    pub iterations: usize,
    /// Time on the clock from the beginning of the path to its end, s; as the command writes it, of the whole command
    /// until its results are there.
    pub wall_s: f64,
    /// Time that all threads of the process took of the processor in it, s; `null` where the system does not say.
    pub processor_s: Option<f64>,
}

impl Summary {
    /// Its figures in words, in their order; those that the path cannot give are left out.
    pub fn figures(&self) -> Vec<NamedFigure> {
        let mut all = Vec::new();
        let mut put =
            |name: &str, value: Option<f64>, (unit, decimals): (&'static str, usize), caveat: &str, what: &str| {
                let [name, caveat, what] = [name, caveat, what].map(str::to_owned);
                all.extend(value.map(|value| NamedFigure { name, value, unit, decimals, caveat, what }));
            };
        let (arcsec, mpa) = (("arcsec", 3), ("MPa", 1));
        put("load torque", self.torque_n_m, ("N·m", 3), "", "on the output, positive turns it forward");
        let ripple = "largest less smallest error of a settled stretch one way under one load";
        let of_tips =
            self.tip_contact.filter(TipContact::counts).map(|_| "of tips that bear outside the mesh".to_owned());
        let between = self.kinematic_error_pp_arcsec.zip(self.kinematic_error_pp_of_rows_arcsec);
        let of_rows = between
            .filter(|(wave, rows)| wave != rows)
            .map_or_else(String::new, |(_, rows)| format!("of the wave through the rows; of the rows alone {rows:.3}"));
        let caveat = of_tips.unwrap_or(of_rows);
        put("kinematic error, peak to peak", self.kinematic_error_pp_arcsec, arcsec, &caveat, ripple);
        let mean = "output less generator over the ratio, over whole tooth pitches";
        put("mean error forward", self.mean_error_forward_arcsec, arcsec, "", mean);
        put("mean error backward", self.mean_error_backward_arcsec, arcsec, "", mean);
        put("backlash", self.backlash_arcsec, arcsec, "", "mean error backward less forward, without load");
        let lost = "mean error backward less forward, under a load that holds the flanks together";
        put("lost motion at the reversal", self.reversal_lost_motion_arcsec, arcsec, "", lost);
        let dwell = "what the generator turns before the output follows";
        put("dwell of the output at the reversal", self.dwell_generator_rad, ("rad of generator", 6), "", dwell);
        let wind_up = "mean error under load from the middle of the backlash, half of which is part of it";
        put("wind-up from mid-backlash", self.wind_up_arcsec, arcsec, "", wind_up);
        let elastic = "the same from a light touch on the side that the load pushes to";
        put("wind-up, elastic part", self.wind_up_elastic_arcsec, arcsec, "", elastic);
        for WindUpPart { part, arcsec: of_it, percent } in &self.wind_up_parts {
            let (name, caveat) = (format!("wind-up by {part}"), format!("{percent:.0} %"));
            put(&name, Some(*of_it), arcsec, &caveat, "of the drive at rest, from first contact to the load");
        }
        let place = self.max_von_mises_wheel.replace('_', " ");
        let place = format!("of the {place}, at step {}", self.max_von_mises_step);
        let grows = "which grows with the mesh";
        put("largest von Mises stress at a node", Some(self.max_von_mises_mpa), mpa, grows, &place);
        if self.stress.is_empty() {
            let (caveat, surface) =
                ("on this mesh; --stress takes three", "of the flexspline, by the strain of their surface");
            put("stress in the root fillets", Some(self.root_fillet_mpa), mpa, caveat, surface);
            put("stress on the bore, at a node", Some(self.nodal_bore_mpa), mpa, "", "of the flexspline");
        }
        for stress in &self.stress {
            let [low, high] = stress.interval_mpa;
            let (name, caveat) =
                (format!("stress, {}", stress.place.in_words()), format!("{low:.0} to {high:.0}, over three meshes"));
            let tooth = format!("of the flexspline, at tooth {}", stress.tooth);
            put(&name, Some(stress.von_mises_mpa), mpa, &caveat, &tooth);
            let Some(fatigue) = stress.fatigue else { continue };
            let name = format!("safety against fatigue, {}", stress.place.in_words());
            let (caveat, cycle) = fatigue.in_words();
            put(&name, Some(fatigue.safety), ("", 2), &caveat, &cycle);
        }
        put("largest flank pressure", Some(self.peak_flank_pressure_mpa), mpa, "", "of any tooth, of all rows");
        let bore = "of generator on bore, of all rows";
        put("largest generator pressure", Some(self.peak_generator_pressure_mpa), mpa, "", bore);
        let lobe = "of the generator along its major axis on one half of the rim";
        put("largest force of a lobe", Some(self.lobe_force_n), ("N", 1), "", lobe);
        let virtual_work = self.generator_torque_virtual_work_n_m;
        let without = virtual_work.map_or_else(String::new, |torque| {
            if self.without_friction {
                format!("by virtual work {torque:.4}; the rest is what rows miss between them")
            } else {
                format!("without friction it would be {torque:.4}")
            }
        });
        let mean = "on the flexspline, positive turns it forward; over whole tooth pitches";
        put("mean torque of the generator", self.generator_torque_mean_n_m, ("N·m", 4), &without, mean);
        let leans = self.tilt_mrad != 0.0 || self.load_across_face_peak_over_mean != 1.0;
        let of_leaning = |value: f64| leans.then_some(value);
        put("largest tilt of the teeth", of_leaning(self.tilt_mrad), ("mrad", 3), "", "along their face, outward");
        let peak = "of the flank that bears most anywhere; 1 is even";
        put("load along the face, peak over mean", of_leaning(self.load_across_face_peak_over_mean), ("", 2), "", peak);
        put("share of that face that bears", of_leaning(self.face_in_contact), ("", 3), "", "1 is all of it");
        let room = "what rigid teeth leave the output to turn; below 0 rim and bearing have to give way";
        put("room of rigid teeth as built", self.room_as_built_arcsec, ("arcsec", 1), "least of a turn", room);
        let processor = self.processor_s.map_or_else(String::new, |s| format!("on the clock; {s:.2} s of processor"));
        let until = "of the whole command, until its results are there";
        put("time", Some(self.wall_s), ("s", 2), &processor, until);
        all
    }
}

/// Light touches on the freshly deformed drive, error in arc-seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Touches {
    pub forward: f64,
    pub backward: f64,
}

/// Metrics that come from the rows alone.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Metrics {
    pub kinematic_error_pp: Option<f64>,
    pub kinematic_error_pp_of_rows: Option<f64>,
    pub mean_forward: Option<f64>,
    pub mean_backward: Option<f64>,
    /// Error backward minus forward at the first reversal.
    pub reversal: Option<f64>,
    pub dwell_rad: Option<f64>,
    pub generator_torque: Option<f64>,
    pub generator_torque_expected: Option<f64>,
}

/// Settled rows of a one-way stretch at one load and temperature.
struct SteadyStretch<'a> {
    range: Range<usize>,
    rows: &'a [Row],
    /// Those of them that cover the last whole number of pitches; empty when there is not one.
    whole: &'a [Row],
}

impl<'a> SteadyStretch<'a> {
    fn new(all: &'a [Row], range: Range<usize>, pitch: f64) -> Self {
        let rows = &all[range.clone()];
        let (first, last) = (&rows[0], &rows[rows.len() - 1]);
        let covered = (last.generator_rad - first.generator_rad).abs() + first.turn_rad.abs();
        let window = (covered / pitch + 1e-6).floor() * pitch;
        let begin = rows
            .iter()
            .position(|row| (last.generator_rad - row.generator_rad).abs() < window - 1e-6 * pitch)
            .unwrap_or(rows.len());
        SteadyStretch { range, rows, whole: &rows[begin..] }
    }

    fn forward(&self) -> bool {
        self.rows[0].turn_rad > 0.0
    }

    /// Mean by generator travel.
    fn mean(&self, value: impl Fn(&Row) -> f64) -> Option<f64> {
        let travel: f64 = self.whole.iter().map(|row| row.turn_rad.abs()).sum();
        let sum: f64 = self.whole.iter().map(|row| row.turn_rad.abs() * value(row)).sum();
        (travel > 0.0).then(|| sum / travel)
    }

    fn ripple(&self) -> Option<f64> {
        let errors = || self.rows.iter().map(|row| row.error_arcsec);
        let enough = !self.whole.is_empty() && self.rows.len() >= ROWS_OF_A_RIPPLE;
        enough.then(|| errors().fold(f64::MIN, f64::max) - errors().fold(f64::MAX, f64::min))
    }

    /// Ripple of the wave through the rows of the last pitch, where they are equal parts of it.
    fn ripple_of_wave(&self, pitch: f64) -> Option<f64> {
        let of_rows = self.ripple()?;
        let turn = self.rows.last()?.turn_rad.abs();
        let count = (pitch / turn).round() as usize;
        let last = &self.rows[self.rows.len().checked_sub(count)?..];
        let equal = |row: &Row| (row.turn_rad.abs() * count as f64 / pitch - 1.0).abs() < 1e-6;
        if count < ROWS_OF_A_RIPPLE || !last.iter().all(equal) {
            return None;
        }
        let errors: Vec<f64> = last.iter().map(|row| row.error_arcsec).collect();
        Some(peak_to_peak(&errors).max(of_rows))
    }
}

/// Settled one-way stretches, in order.
fn stretches(rows: &[Row], pitch: f64) -> Vec<SteadyStretch<'_>> {
    let goes_on =
        |a: &Row, b: &Row| a.settled && b.settled && a.turn_rad.signum() == b.turn_rad.signum() && a.has_load_of(b);
    let mut begin = 0;
    let stretch = |part: &[Row]| {
        let range = begin..begin + part.len();
        begin = range.end;
        part[0].settled.then(|| SteadyStretch::new(rows, range, pitch))
    };
    rows.chunk_by(goes_on).filter_map(stretch).collect()
}

/// The row at which the generator first reverses under a constant load and temperature.
fn first_reversal(rows: &[Row]) -> Option<usize> {
    (1..rows.len()).map(|next| next - 1).find(|&at| {
        let (here, next) = (&rows[at], &rows[at + 1]);
        here.turn_rad * next.turn_rad < 0.0 && here.has_load_of(next)
    })
}

/// Generator travel from row `at` until the output leaves.
fn dwell(rows: &[Row], at: usize, ratio: f64) -> Option<f64> {
    let here = &rows[at];
    let way = rows[at + 1].turn_rad.signum();
    let onward = rows[at + 1..].iter().take_while(|row| row.turn_rad * way > 0.0);
    let mut stood = 0.0;
    for row in onward {
        let travelled = (row.generator_rad - here.generator_rad).abs();
        let moved = row.output_rad - here.output_rad;
        if moved.abs() * ARCSEC_PER_RAD > STANDING_ARCSEC {
            return Some((travelled - (moved * way * ratio)).clamp(stood, travelled));
        }
        stood = travelled;
    }
    None
}

impl Metrics {
    /// Work that is lost between the flanks over the work of load and drag, by the torque of the generator: above 1 a
    /// load does not turn the generator, whichever way it acts.
    pub fn friction_over_load(&self) -> Option<f64> {
        let without = self.generator_torque_expected?;
        Some(((self.generator_torque? - without) / without).abs())
    }

    /// `repeats`: the drive passes through the same states after every pitch.
    pub(super) fn new(rows: &[Row], pitch: f64, ratio: f64, repeats: bool) -> Metrics {
        let stretches = stretches(rows, pitch);
        let error = |stretch: &SteadyStretch| stretch.mean(|row| row.error_arcsec);
        let mean_of = |forward: bool| stretches.iter().filter(|stretch| stretch.forward() == forward).find_map(error);
        let reversed_at = first_reversal(rows);
        let reversal = reversed_at.and_then(|at| {
            let before = stretches.iter().rfind(|stretch| stretch.range.contains(&at))?;
            let after = stretches.iter().find(|stretch| stretch.range.start > at)?;
            // The stretch after it must not lie beyond another reversal or another load.
            let back = |row: &Row| row.turn_rad * before.rows[0].turn_rad < 0.0 && row.has_load_of(&rows[at]);
            let undisturbed = rows[at + 1..after.range.end].iter().all(back);
            let (before_mean, after_mean) = (error(before)?, error(after)?);
            let (forward, backward) =
                if before.forward() { (before_mean, after_mean) } else { (after_mean, before_mean) };
            undisturbed.then_some(backward - forward)
        });
        let measured = stretches.iter().find(|stretch| !stretch.whole.is_empty());
        Metrics {
            kinematic_error_pp: stretches
                .iter()
                .filter_map(|stretch| stretch.ripple_of_wave(pitch).filter(|_| repeats).or(stretch.ripple()))
                .reduce(f64::max),
            kinematic_error_pp_of_rows: stretches.iter().filter_map(SteadyStretch::ripple).reduce(f64::max),
            mean_forward: mean_of(true),
            mean_backward: mean_of(false),
            reversal,
            dwell_rad: reversed_at.and_then(|at| dwell(rows, at, ratio)),
            generator_torque: measured.and_then(|s| s.mean(|row| row.generator_torque_n_m)),
            generator_torque_expected: measured
                .and_then(|s| s.mean(|row| -(row.torque_n_m + row.drag_torque_n_m) / ratio)),
        }
    }

    /// Mean of the directions that are known.
    pub(super) fn mean_error(&self) -> Option<f64> {
        match (self.mean_forward, self.mean_backward) {
            (Some(a), Some(b)) => Some(0.5 * (a + b)),
            (a, b) => a.or(b),
        }
    }
}

/// The value that all rows share, if they do.
pub(super) fn shared(rows: &[Row], value: impl Fn(&Row) -> f64) -> Option<f64> {
    let first = value(rows.first()?);
    rows.iter().all(|row| value(row) == first).then_some(first)
}

/// The largest of a value over all rows.
pub(super) fn largest(rows: &[Row], value: impl Fn(&Row) -> f64) -> f64 {
    rows.iter().map(value).fold(0.0, f64::max)
}

pub(super) fn wheel_name(peak: &PeakStress) -> &'static str {
    match peak.wheel {
        WheelKind::Flexspline => "flexspline",
        WheelKind::CircularSpline => "circular_spline",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::motion::Travel;
    use std::f64::consts::TAU;

    const PITCH: f64 = TAU / 188.0;
    const RATIO: f64 = 95.0;

    /// A drive with play, ripple and wind-up, without any mechanics.
    struct Toy {
        backlash: f64,
        ripple: f64,
        wind_up: f64,
        drag: f64,
    }

    impl Toy {
        /// Rows along generator angles and torques; the first is the start, in the middle of the play.
        fn walk(&self, path: &[(f64, f64)]) -> Vec<Row> {
            let mut travel = Travel::default();
            let mut output = path[0].0 / RATIO;
            let mut rows: Vec<Row> = Vec::new();
            for (step, &(generator, torque)) in path.iter().enumerate() {
                let nominal = generator / RATIO;
                let wave = 0.5 * self.ripple * (188.0 * generator).sin() / ARCSEC_PER_RAD;
                let half = 0.5 * self.backlash / ARCSEC_PER_RAD;
                let loaded = torque.abs() > self.drag;
                let before = output;
                output = if loaded {
                    nominal + wave + torque.signum() * half + self.wind_up * torque / ARCSEC_PER_RAD
                } else {
                    output.clamp(nominal + wave - half, nominal + wave + half)
                };
                let from = rows.last().map_or(generator, |row| row.generator_rad);
                let torque_before = rows.last().map_or(torque, |row| row.torque_n_m);
                travel = travel.on([generator - from, output - before], torque == torque_before, RATIO);
                rows.push(Row {
                    step,
                    generator_rad: generator,
                    output_rad: output,
                    error_arcsec: (output - nominal) * ARCSEC_PER_RAD,
                    torque_n_m: torque,
                    temperature_c: 20.0,
                    generator_torque_n_m: -torque / RATIO,
                    settled: travel.settled(0.0),
                    turn_rad: generator - from,
                    ..Row::default()
                });
            }
            rows
        }
    }

    const TOY: Toy = Toy { backlash: 60.0, ripple: 0.8, wind_up: 0.3, drag: 0.02 };

    /// The paper's path in increments.
    fn paper(increment: f64, torque: f64) -> Vec<(f64, f64)> {
        let n = (1.0 / increment).round() as i32;
        let there = (0..=n).map(|i| f64::from(i) / f64::from(n));
        let back = (1..=2 * n).map(|i| 1.0 - f64::from(i) / f64::from(n));
        there.chain(back).map(|generator| (generator, torque)).collect()
    }

    #[test]
    fn backlash_dwell_and_ripple_of_a_drive_that_has_them() {
        let rows = TOY.walk(&paper(0.01, 0.0));
        let metrics = Metrics::new(&rows, PITCH, RATIO, true);
        // 0.01 rad is a third of a pitch: means over whole pitches leave a few hundredths.
        assert!((metrics.mean_forward.unwrap() + 30.0).abs() < 0.02, "{metrics:?}");
        assert!((metrics.mean_backward.unwrap() - 30.0).abs() < 0.02);
        assert!((metrics.reversal.unwrap() - 60.0).abs() < 0.04);
        assert!((metrics.kinematic_error_pp.unwrap() - 0.8).abs() < 0.01);
        // The clearance, and up to the ripple before and after, at the ratio.
        let dwell = metrics.dwell_rad.unwrap() * ARCSEC_PER_RAD / RATIO;
        assert!((dwell - 60.0).abs() < 0.8, "{dwell}");
        // Much finer than the increment of 0.01 rad, which is 21.7″.
        let fine = Metrics::new(&TOY.walk(&paper(0.001, 0.0)), PITCH, RATIO, true).dwell_rad.unwrap();
        assert!((fine * ARCSEC_PER_RAD / RATIO - dwell).abs() < 0.8);
    }

    #[test]
    fn a_reversal_the_other_way_gives_the_same_backlash() {
        let mirrored: Vec<_> = paper(0.01, 0.0).iter().map(|(g, t)| (-g, *t)).collect();
        let metrics = Metrics::new(&TOY.walk(&mirrored), PITCH, RATIO, true);
        assert!((metrics.reversal.unwrap() - 60.0).abs() < 0.04);
    }

    #[test]
    fn under_load_nothing_is_lost_at_the_reversal_and_the_error_is_wound_up() {
        let rows = TOY.walk(&paper(0.01, 50.0));
        let metrics = Metrics::new(&rows, PITCH, RATIO, true);
        assert!(metrics.reversal.unwrap().abs() < 0.04);
        assert!(metrics.dwell_rad.unwrap() < 1e-3);
        assert!((metrics.mean_error().unwrap() - (30.0 + 15.0)).abs() < 0.02);
        let expected = metrics.generator_torque_expected.unwrap();
        assert!((metrics.generator_torque.unwrap() - expected).abs() < 1e-12);
        assert!((expected + 50.0 / 95.0).abs() < 1e-12);
        // Driven instead of driving: friction takes twice what the load gives.
        let driven = Metrics { generator_torque: Some(-expected), ..metrics };
        assert_eq!((driven.friction_over_load(), Metrics::default().friction_over_load()), (Some(2.0), None));
    }

    #[test]
    fn eight_rows_of_one_pitch_give_ripple_and_an_exact_mean_but_no_backlash() {
        let path: Vec<_> = (0..=24).map(|i| (PITCH * f64::from(i) / 8.0, 0.0)).collect();
        let rows = TOY.walk(&path);
        let last_pitch = &rows[17..];
        assert_eq!(last_pitch.len(), 8);
        let metrics = Metrics::new(last_pitch, PITCH, RATIO, true);
        assert!((metrics.mean_forward.unwrap() + 30.0).abs() < 1e-9);
        assert!((metrics.kinematic_error_pp.unwrap() - 0.8).abs() < 1e-9);
        assert_eq!((metrics.reversal, metrics.dwell_rad, metrics.mean_backward), (None, None, None));
        let short = Metrics::new(&rows[18..], PITCH, RATIO, true);
        assert_eq!((short.mean_forward, short.kinematic_error_pp), (None, None));
    }

    #[test]
    fn start_up_and_clearance_are_not_settled() {
        // A wide clearance: the output stands for more than two pitches.
        let wide = Toy { backlash: 300.0, ..TOY };
        let rows = wide.walk(&paper(0.01, 0.0));
        let first = rows.iter().find(|row| row.settled).unwrap();
        assert!((first.error_arcsec + 150.0).abs() < 0.5, "{}", first.error_arcsec);
        let metrics = Metrics::new(&rows, PITCH, RATIO, true);
        assert!((metrics.reversal.unwrap() - 300.0).abs() < 0.04);
        assert!(metrics.kinematic_error_pp.unwrap() < 0.81);
        // Where the load changes in every row nothing settles.
        let changing: Vec<_> = (0..200).map(|i| (0.01 * f64::from(i), f64::from(i))).collect();
        let metrics = Metrics::new(&TOY.walk(&changing), PITCH, RATIO, true);
        assert_eq!(metrics, Metrics::default());
    }

    #[test]
    fn a_load_that_changes_at_the_reversal_gives_no_backlash() {
        let mut path = paper(0.01, 0.0);
        path.iter_mut().skip(101).for_each(|point| point.1 = 5.0);
        let metrics = Metrics::new(&TOY.walk(&path), PITCH, RATIO, true);
        assert_eq!((metrics.reversal, metrics.dwell_rad), (None, None));
    }
}
