//! Logs of one unit to its table, whatever the cause of its error.
//!
//! ```text
//! logs -> measurement -> rows in steady motion, less the prior -> parts, chosen by folds left out
//!      -> samples -> table (.fxt) -> the core over the logs
//! ```
//!
//! Physics first: the nominal model, or a table, is the prior, and is taken from what was measured. What remains is
//! fitted by smooth
//! [parts](PartName), each with a penalty against wrinkles. Which parts are kept, and how smooth they are, is decided
//! by what fits leave in files or blocks that they did not see; the figure given for the whole is nested:
//! choice, penalties and fit are all made without the fold that they are judged in. No part is fitted where nothing was
//! recorded that could show it, and no table is made that leaves more than a simpler one.

mod at_rest;
mod folds;
mod interval;
mod plan;
mod prior;
mod reading;
mod rows;
mod split;
mod table;
mod together;
mod torque;
mod zero;

use flexspline::{ImageError, Table};
use flexspline_make::{ProjectError, WriteError};
use serde::Serialize;

use crate::measurement::{
    Fault, FaultName, MeasuredError, Recording, Session, least_and_most, median_of, whole_pitches,
};
use crate::misfit::LEAVES;
use crate::parts::{self, usual_arcsec};
pub use crate::parts::{PartName, Scales, State};
pub use at_rest::{LoopFigure, TorqueLoop};
use flexspline_base::robust::{dot, rms};
use flexspline_base::statistics::mean;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::{MadeTable, TableError, dead_zone_n_m};
use flexspline_mechanics::drive::GeneratorKind;
pub(crate) use folds::LEAST_GAIN;
use folds::{Chosen, Folds, PENALTIES};
pub(crate) use interval::OF_95;
pub use interval::{ModelUncertainty, Node, RowNoise};

pub use plan::{Bench, Pass, Planned, plan};
pub use prior::Prior;
pub use reading::{ByCore, Reading};
use reading::{DELAY, Delays, OFFSET, delay_note, play_of_a_millisecond};
pub use rows::one_in;
use rows::{Recorded, Rows, settled, torque_by_way};
use split::SplitWaves;
pub use split::{EncoderEntry, Split, SplitPart, WaveShare};
pub(crate) use table::{APART, JUMP_HALF_WIDTH, RIPPLE_NODES};

use together::{Agreement, Starts, ZERO};
pub(crate) use torque::INSIDE;
pub use torque::{CalibrationFile, WindUpTorque};
pub(crate) use zero::{Alignment, steady};

/// The golden section: its multiples spread places over a turn and fold no order onto another.
pub(crate) const GOLDEN: f64 = 0.618_033_988_749_895;
/// Fewest rows in steady motion that make a table.
const FEWEST_ROWS: usize = 64;
/// Load that decides the flank where no model says a friction, of the largest recorded: a guess, small beside any load
/// of interest.
const LEAST_FRICTION: f64 = 0.02;
/// Frictions that are tried where none is known, of that: from 1 to 20 % of the largest load. *Source*: what starts a
/// drive of the catalogue (CSG-14 to 25, 100), through the ratio, is 7 to 21 % of its rated torque.
const FRICTIONS: [f64; 10] = [0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 10.0];
/// And to either side of the best of them: half a step of these, of which each is about 1.4 times the one before.
const HALF_A_STEP: [f64; 2] = [0.84, 1.19];
/// Rows that tell a friction, about. *Guess*: hundreds of them lie at loads around it.
const FRICTION_WITH: usize = 6000;
/// Rows between two dead zones tell them apart if their load is clear of both by this multiple of the torque's noise…
/// *Guess*.
const CLEAR_OF_NOISE: f64 = 6.0;
/// …and if the other leaves less than this share of their squares. *Guess*: where it is right, half of them lie on the
/// wrong flank.
const OTHER_DEAD_ZONE: f64 = 0.8;
/// Torques within this share of the largest are one.
pub(crate) const SAME_TORQUE: f64 = 1e-3;
/// Share of the motion that the rarer direction must have for the play to be seen.
const BOTH_WAYS: f64 = 0.1;
/// Shares of a turn that must have been recorded for a curve over it: of the generator, and of the output, whose curve
/// is smooth over a period of its highest wave, and zero farther from all rows. *Guess*.
const MOST_OF_A_TURN: f64 = 0.75;
const PERIOD_OF_THE_OUTPUT: f64 = 1.0 / parts::OUTPUT_ORDERS as f64;
/// Rows that a tooth pitch needs for its curve.
const ROWS_OF_A_PITCH: f64 = 6.0;
/// Rows that the usual half width is taken of.
const ROWS_OF_A_WIDTH: usize = 2000;
/// Generator turns in steps that are short beside a pitch, at least.
const FINE_TURNS: f64 = 1.0;
/// A ratio is refused if another leaves less than this share of the squares. A guess: of what a wrong whole number
/// does, nothing is left.
const OTHER_RATIO: f64 = 0.25;
/// Error by a wrong ratio in one of several logs that move little, at least, rad rms. A guess: 15 arc-minutes, where
/// wind-up and clearance are a few.
const LEAST_OF_OTHER_RATIO_RAD: f64 = 0.0044;
/// An error about its mean that is none of a gear, rad rms. A guess: one degree, where drives err by arc-minutes.
pub(crate) const MOST_ERROR_RAD: f64 = 0.0175;
/// A change of the error between two rows is a leap from this on, rad… *Guess*: fifteen arc-minutes, half a pitch of
/// fine teeth, where clearance and wind-up are a few.
const LEAP_RAD: f64 = 0.0044;
/// …and from this multiple of the usual one. *Guess*: a wrong ratio changes the error evenly.
const FAR_LARGER: f64 = 10.0;
/// Arcsec that are taken for rounding.
const ROUNDING_ARCSEC: f64 = 1e-6;
/// Coefficients of the play, and so the times that one of them is put on its bound and the others fitted anew.
const PLAY_COEFFICIENTS: usize = 3;
/// Paces that tell a delay from play: the fastest is this multiple of the slowest. *Guess*.
const OTHER_PACE: f64 = 1.25;
/// Correlation of the load with waves of the output from which on they cannot be told apart well: half of the load's
/// squares. *Guess*.
pub(crate) const TURNS_WITH_THE_OUTPUT: f64 = 0.7;
/// A step is whole tooth pitches within this share of one. *Guess*: noise and ripple are a third of that.
const WHOLE_PITCH: f64 = 0.02;
/// Indices that an encoder loses in some logs, at most. *Guess*: a few in a recording.
const MOST_LOST: usize = 8;
/// Temperatures closer than this, K, are one.
pub(crate) const ONE_TEMPERATURE_K: f64 = 2.0;

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The logs cannot be read, or turn by another ratio.
    #[error(transparent)]
    Measured(#[from] MeasuredError),
    /// The knowledge of the drive makes no table.
    #[error("{0}")]
    Known(String),
    /// Too few rows in steady motion.
    #[error(
        "{0} rows in steady motion; at least {FEWEST_ROWS} are needed: record a longer way in one direction, as rows \
         after a reversal count only when the play is crossed"
    )]
    TooFew(usize),
    /// Nothing gains.
    #[error("{0}")]
    NothingGained(String),
    /// The samples make no table.
    #[error(transparent)]
    Table(#[from] TableError),
}

impl CalibrationError {
    /// Whether the error falls somewhere while the load grows, or the output leads somewhere.
    fn is_of_a_fall(&self) -> bool {
        use ProjectError::{NegativeHalfWidth, Write};
        use WriteError::Refused;
        let CalibrationError::Table(TableError::Project(error)) = self else { return false };
        matches!(error, NegativeHalfWidth { .. } | Write(Refused(ImageError::Falls { .. })))
    }

    /// The error, with the files that it is of.
    pub fn of_files(&self, files: &[String]) -> String {
        match self {
            CalibrationError::Measured(_) | CalibrationError::Known(_) => self.to_string(),
            _ => format!("{}: {self}", files.join(", ")),
        }
    }

    /// Whether the input is to blame.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, CalibrationError::NothingGained(_) | CalibrationError::Table(_))
    }
}

/// Model fitted in addition to the prior.
#[derive(Debug, Clone)]
struct Model {
    chosen: Vec<Chosen>,
    coefficients: Vec<f64>,
    scales: Scales,
}

impl Model {
    /// Sum of the parts, arcsec.
    fn adds_arcsec(&self, at: &State) -> f64 {
        self.columns(at).iter().zip(&self.coefficients).map(|(column, coefficient)| column * coefficient).sum()
    }

    /// The columns of its parts.
    fn columns(&self, at: &State) -> Vec<f64> {
        let mut columns = Vec::with_capacity(self.coefficients.len());
        self.chosen.iter().for_each(|chosen| parts::columns(chosen.part, at, &self.scales, &mut columns));
        columns
    }

    /// The coefficients that say the same where the generator's angle is larger by this, and the output's with it.
    fn turned(&self, by_rad: f64, ratio: f64) -> Vec<f64> {
        let mut turned = self.coefficients.clone();
        for part in self.chosen.iter().map(|chosen| chosen.part) {
            let angles = parts::wave_angles(part, by_rad, by_rad / ratio, &self.scales);
            let orders = angles.flat_map(|(angle, orders)| (1..=orders).map(move |k| f64::from(k) * angle));
            for (pair, by) in turned[self.of(part).unwrap_or(0..0)].chunks_exact_mut(2).zip(orders) {
                let ((sin, cos), [of_sine, of_cosine]) = (by.sin_cos(), [pair[0], pair[1]]);
                pair.copy_from_slice(&[of_sine * cos + of_cosine * sin, of_cosine * cos - of_sine * sin]);
            }
        }
        turned
    }

    /// Sum of the prior and the parts, arcsec.
    fn says_arcsec(&self, at: &State, prior: &Prior<'_>) -> f64 {
        prior.steady_arcsec(at) + self.adds_arcsec(at)
    }

    /// Where the coefficients of a part stand.
    fn of(&self, part: PartName) -> Option<std::ops::Range<usize>> {
        parts::place(self.chosen.iter().map(|chosen| chosen.part), part)
    }

    /// Error at rest in one place under a load, arcsec.
    fn under_arcsec(&self, torque_n_m: f64, prior: &Prior<'_>) -> f64 {
        let at = State { torque_n_m, temperature_c: prior.nominal.temperature_c, way: 1.0, ..State::default() };
        self.says_arcsec(&at, prior)
    }

    /// Refuses a torque by which the output gives way the wrong way: its sign is another.
    fn gives_way_with_the_load(&self, prior: &Prior<'_>) -> Result<(), CalibrationError> {
        let [low, high] = self.scales.torque_n_m;
        let by = self.under_arcsec(high, prior) - self.under_arcsec(low, prior);
        if by >= 0.0 {
            return Ok(());
        }
        Err(CalibrationError::Known(format!(
            "torque: found {by:.1} arcsec of the output from {low:.2} to {high:.2} N·m; allowed: a torque that is \
             positive where it turns the output forward, so that the error grows with it. --columns torque=NAME:-N.m \
             turns its sign; an error that counts the other way does the same"
        )))
    }

    /// The first coefficient of the play that stands where none can, with the nearest that it may have: the output does
    /// not lead (a delay between the readings does), and the error of neither direction falls where the load changes
    /// the flank. `prior_half_arcsec` is half the play that the prior has.
    fn out_of_bounds(&self, prior_half_arcsec: f64) -> Option<(usize, f64)> {
        let least = [0.0, 0.0, -prior_half_arcsec];
        let mut play = self.of(PartName::Play)?.zip(least);
        play.find(|(place, least)| self.coefficients[*place] < least - ROUNDING_ARCSEC)
    }

    /// Takes no more of the lag by temperature than there is.
    fn bound_warmth(&mut self) {
        let lags = self.of(PartName::Play).map(|play| [0, 1].map(|k| self.coefficients[play.start + k]));
        let least_lag = lags.map_or(0.0, |[idle, loaded]| idle.min(loaded).max(0.0));
        if let Some(temperature) = self.of(PartName::Temperature)
            && let [_, _, by_warmth] = &mut self.coefficients[temperature]
        {
            *by_warmth = by_warmth.clamp(-least_lag, least_lag);
        }
    }
}

/// Report on a part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PartSays {
    /// Its name.
    pub name: &'static str,
    /// Whether it is in the table.
    pub kept: bool,
    /// Share of the squares before that it takes in folds left out; of one that was refused, that it would take beside
    /// the others. Absent where nothing was recorded that shows it.
    pub held_out_gain: Option<f64>,
    /// Penalty of its coefficients, of a column's mean square.
    pub penalty: Option<f64>,
    /// Half of peak to peak over the rows, arcsec.
    pub size_arcsec: Option<f64>,
    /// Why it was kept or refused.
    pub why: String,
}

/// Errors in folds that took no part, rows in steady motion with both angles at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HeldOut {
    /// As measured, each file's zero taken out, and a delay between the [readings](Reading).
    pub rms_before_arcsec: f64,
    /// With the nominal model or table alone.
    pub rms_prior_arcsec: f64,
    /// With the table made without them.
    pub rms_after_arcsec: f64,
}

/// Wind-up and waves of the output, where the load goes with the output's angle, with the size that they may have,
/// whichever a model has, arcsec: what was fitted may be the other's, all of it.
fn collinear(rows: &Rows, model: &Model, correlation: f64) -> Vec<(PartName, f64)> {
    let both = [PartName::WindUp, PartName::OutputAngle];
    let fitted = model.chosen.iter().filter(|chosen| both.contains(&chosen.part));
    let largest = fitted.map(|chosen| size(rows, model, *chosen)).fold(0.0, f64::max);
    let open = both.into_iter().filter(|_| correlation > TURNS_WITH_THE_OUTPUT);
    open.map(|part| (part, usual_arcsec(part, &model.scales).max(largest))).collect()
}

/// `calibration.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Calibration {
    /// Version of this object.
    pub schema_version: u32,
    /// The logs.
    pub files: Vec<String>,
    /// Rows of all, and rows fitted.
    pub rows: usize,
    /// See above.
    pub rows_fitted: usize,
    /// Folds left out in turn: `files` or `blocks`.
    pub left_out: &'static str,
    /// How many of them.
    pub folds: usize,
    /// Errors where nothing was fitted.
    pub held_out: HeldOut,
    /// The core over all rows, both angles at one instant.
    pub core: ByCore,
    /// Play that a delay of a millisecond would look like, arcsec, where the logs keep to one pace and cannot tell
    /// the two apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub play_of_a_millisecond_arcsec: Option<f64>,
    /// How good a torque from the wind-up would be, where one was recorded and the table gives way to it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_from_wind_up: Option<WindUpTorque>,
    /// All that belongs to the reading. Generator angle zero of the table is where the first log reads zero.
    pub readings: Vec<Reading>,
    /// The parts.
    pub parts: Vec<PartSays>,
    /// Every node of every part, with an interval.
    pub nodes: Vec<Node>,
    /// Noise of the rows.
    pub noise: RowNoise,
    /// Half width of the interval that holds the table's error in a state with 95 %, mean square root over all loads,
    /// angles and temperatures between the least and the largest recorded, evenly, at the paces recorded; arcsec.
    pub half_width_arcsec: f64,
    /// The same over the rows: in the states that were recorded.
    pub half_width_as_recorded_arcsec: f64,
    /// As the first, at any other pace and at rest: with all that a delay which these logs do not show may have done.
    pub half_width_at_another_pace_arcsec: f64,
    /// Correlation of the load with the output's angle, where that makes the first wide: rows under other loads make
    /// it narrower, more of the same do not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_with_output_angle: Option<f64>,
    /// Phase of the table that was known before, if one was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alignment: Option<Alignment>,
    /// What the encoders and the gear have of it, if that was asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split: Option<Split>,
    /// Generator turns for one of the output.
    pub ratio: f64,
    /// Identity of the table.
    pub table_id: String,
    /// Its size, bytes.
    pub image_bytes: usize,
    /// Difference of the table from the model, arcsec rms.
    pub projection_rms_arcsec: f64,
    /// Torques that it holds for, N·m.
    pub torque_n_m: [f32; 2],
    /// Temperatures that it holds for, °C.
    pub temperature_c: [f32; 2],
    /// Faults of the logs.
    pub data_faults: Vec<Fault>,
    /// Notes.
    pub notes: Vec<String>,
    /// Command line, once known.
    pub command: String,
}

impl Calibration {
    /// Whether a log has a delay between the readings of the two angles, which is taken out of all errors.
    pub fn has_delay(&self) -> bool {
        self.readings.iter().any(|reading| reading.name == DELAY)
    }
}

/// A table with what is said of it.
pub struct Calibrated {
    /// The report.
    pub calibration: Calibration,
    /// The table.
    pub table: MadeTable,
    /// That of the gear alone, if the error was split.
    pub gear: Option<MadeTable>,
    /// How well it is known.
    pub known: ModelUncertainty,
    /// Rows for a picture: output angle (rad), measured and left by the model (arcsec).
    pub shown: Vec<[f64; 3]>,
}

/// The error of a session about its mean, without changes between two rows that are far larger than all others: teeth
/// that skip, an index that is lost.
fn without_leaps(error_rad: &[f64]) -> Vec<f64> {
    let change = |k: usize| error_rad[k] - error_rad[k.saturating_sub(1)];
    let usual = median_of(&mut (0..error_rad.len()).map(|k| change(k).abs()).collect::<Vec<f64>>());
    let is_leap = |change: &f64| change.abs() > LEAP_RAD.max(FAR_LARGER * usual);
    let leapt = |leapt: &mut f64, k: usize| {
        *leapt += Some(change(k)).filter(is_leap).unwrap_or(0.0);
        Some(error_rad[k] - *leapt)
    };
    let left: Vec<f64> = (0..error_rad.len()).scan(0.0, leapt).collect();
    let middle = mean(&left);
    left.into_iter().map(|error| error - middle).collect()
}

/// Refuses a ratio that the rows of a log contradict; says so alone where it may be rounded, or the output moves little
/// and errs by less than `by_a_load_rad`, rms: a load that grows over a few rows looks the same.
pub(crate) fn check_ratio_of(log: &Recording, ratio: f64, by_a_load_rad: f64) -> Result<Option<String>, MeasuredError> {
    let (mut output, mut error) = (Vec::new(), Vec::new());
    for session in &log.sessions {
        let angles: Vec<f64> = session.generator_rad.iter().map(|psi| psi / ratio).collect();
        let middle = mean(&angles);
        output.extend(angles.iter().map(|angle| angle - middle));
        error.extend(without_leaps(&session.error_rad));
    }
    let [xx, xe, ee] = [(&output, &output), (&output, &error), (&error, &error)].map(|(a, b)| dot(a, b));
    let found = ratio / (1.0 + xe / xx);
    // Wheels whose teeth differ by two have whole ratios and halves.
    let near = (2.0 * found).round() / 2.0;
    let slope = ratio / near - 1.0;
    let left = (ee - 2.0 * slope * xe + slope * slope * xx) / ee;
    if xx <= 0.0 || ee <= 0.0 || near == ratio || near.abs() < 2.0 || left >= OTHER_RATIO {
        return Ok(None);
    }
    let what = format!(
        "ratio: found {ratio}, but the generator turns {found:.2} times for one turn of the output in these rows; \
         allowed: {near}, or other units or signs of the columns"
    );
    let (from, to) = least_and_most(log.sessions.iter().flat_map(|session| session.generator_rad.iter().copied()));
    let moves_little = (to - from) / ratio.abs() < PERIOD_OF_THE_OUTPUT * std::f64::consts::TAU;
    let may_be_load = moves_little && rms(&error) < by_a_load_rad;
    if (near - ratio).abs() >= 1.0 && !may_be_load {
        return Err(MeasuredError { file: log.file.clone(), line: None, what });
    }
    Ok(Some(what))
}

/// The first two files that hold the same rows: one log that was given twice would be left out by what was fitted to
/// it.
fn given_twice(files: &[Recording]) -> Option<[&str; 2]> {
    fn angles(file: &Recording) -> impl Iterator<Item = [&[f64]; 2]> {
        file.sessions.iter().map(|session| [session.generator_rad.as_slice(), &session.error_rad])
    }
    let pairs = (0..files.len()).flat_map(|k| (0..k).map(move |j| (j, k)));
    let mut same = pairs.filter(|(j, k)| files[*j].rows == files[*k].rows && angles(&files[*j]).eq(angles(&files[*k])));
    same.next().map(|(j, k)| [files[j].file.as_str(), files[k].file.as_str()])
}

/// Makes the table of a unit from its logs, and says how well it is known.
///
/// # Errors
/// Too few rows in steady motion, nothing that gains, or a drive that no table can be of.
pub fn calibrate(files: &[Recording], prior: &Prior<'_>) -> Result<Calibrated, CalibrationError> {
    calibrated(files, prior, |fit| report(fit, false))
}

/// The table alone, nothing said of it.
///
/// # Errors
/// As [`calibrate`].
pub(crate) fn calibrated_table(files: &[Recording], prior: &Prior<'_>) -> Result<MadeTable, CalibrationError> {
    calibrated(files, prior, |fit| Ok(fit.made))
}

/// The same with its error [split](Split) into what the encoders and the gear have of it.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_and_split(files: &[Recording], prior: &Prior<'_>) -> Result<Calibrated, CalibrationError> {
    calibrated(files, prior, |fit| report(fit, true))
}

/// A fit whose table can be made, and that table.
struct FitOfLogs<'f> {
    /// The logs, zeros and delays taken out.
    files: &'f [Recording],
    delays: Option<Delays>,
    zeros: Vec<Reading>,
    prior: &'f Prior<'f>,
    alignment: Option<Alignment>,
    recorded: &'f Recorded,
    fitted: Fitted,
    made: MadeTable,
    /// Noted of zeros and ratio.
    said: Vec<String>,
}

/// What is said of the fit to logs.
fn calibrated<T>(
    given: &[Recording],
    known: &Prior<'_>,
    say: impl FnOnce(FitOfLogs<'_>) -> Result<T, CalibrationError>,
) -> Result<T, CalibrationError> {
    if let Some([one, other]) = given_twice(given) {
        return Err(CalibrationError::Known(format!("{one} and {other} hold the same rows: give each log once")));
    }
    known.core_drive()?;
    let by_a_load_rad = if given.len() > 1 { LEAST_OF_OTHER_RATIO_RAD } else { 0.0 };
    let said = given.iter().map(|file| check_ratio_of(file, known.nominal.ratio, by_a_load_rad));
    let mut said: Vec<String> = said.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    let mut files = in_pieces(given);
    if let Some(anew) = set_anew(&files, known) {
        // Sessions before a lost index and behind it have other zeros, too: without it they have one.
        let recorded = Recorded::of(&files, known);
        let rows = settled(&files, known, &recorded).sure(recorded.scales.friction_n_m, &recorded);
        let plain = fit(rows, known, &recorded, &[]);
        let parted = at_lost_index(given, &files, &plain, known);
        if let Some(parted) = parted.filter(|parted| set_anew(&in_pieces(parted), known).is_none()) {
            return calibrated(&parted, known, say);
        }
        files = anew;
        said.push(SET_ANEW.to_owned());
    }
    let mut recorded = Recorded::of(&files, known);
    let mut rows = settled(&files, known, &recorded);
    let mut zeros = Vec::new();
    if let Some(starts) = Starts::of(&rows, &recorded, known, &files) {
        zeros = starts.readings(&files);
        said.extend(starts.notes(&files));
        files = starts.on_one(files, known.nominal.ratio);
        recorded = Recorded::of(&files, known);
        rows = settled(&files, known, &recorded);
    }
    let delays = Delays::of(rows.clone(), known, &recorded);
    if let Some(delays) = &delays {
        delays.take_out(&mut files, known.nominal.ratio);
        rows = settled(&files, known, &recorded);
    }
    recorded.scales.friction_n_m = match known.table {
        Some(table) => dead_zone(&rows, known, table, &recorded),
        None => friction_of(&rows, known, &recorded),
    };
    rows = rows.sure(recorded.scales.friction_n_m, &recorded);
    let pace = play_of_a_millisecond(&rows.rows, &recorded, known).map(note_of_one_pace);
    let notes: Vec<String> = said.iter().cloned().chain(pace).collect();
    let friction_n_m = recorded.scales.friction_n_m;
    let alignment = known.table.map(|table| zero::align(table, &rows, friction_n_m));
    let told = alignment.as_ref().filter(|found| found.told);
    let zero_rad = told.map_or(0.0, |found| found.generator_zero_deg.to_radians());
    let prior = &Prior { least_friction_n_m: friction_n_m, zero_rad, ..known.clone() };
    let (files, recorded) = (&files, &recorded);
    let fitted = fit(rows.clone().less(prior), prior, recorded, &[]);
    if let Some(parted) = at_lost_index(given, files, &fitted, prior) {
        return calibrated(&parted, known, say);
    }
    fitted
        .and_then(|fitted| with_table(fitted, files, prior, (&rows, recorded)))
        .and_then(|(fitted, made)| {
            say(FitOfLogs { files, delays, zeros, prior, alignment, recorded, fitted, made, said })
        })
        .map_err(|error| with_faults(error, files, &notes))
}

/// Note on sessions of one log that have other zeros.
const SET_ANEW: &str = "the zero of the output is another one in each session of a log, as where an encoder is set to \
                        zero anew: each is put on its own";

/// A file in pieces, each with one zero: where a session begins another.
fn by_zeros(file: &Recording, begins: impl Fn(&Session) -> bool) -> Vec<Recording> {
    let pieces = file.sessions.chunk_by(|_, next| !begins(next));
    let mut pieces: Vec<Recording> = pieces.map(|piece| file.with_sessions(piece.to_vec())).collect();
    if let Some(first) = pieces.first_mut() {
        (first.faults, first.notes) = (file.faults.clone(), file.notes.clone());
    }
    pieces
}

/// Logs in pieces of one zero each, as far as it is known where another begins.
fn in_pieces(files: &[Recording]) -> Vec<Recording> {
    files.iter().flat_map(|file| by_zeros(file, |session| session.own_zero)).collect()
}

/// The logs `given` with another zero from where an encoder lost its index, in what a fit leaves of `files`, made of
/// them; none where it lost none, or there is no fit.
fn at_lost_index(
    given: &[Recording],
    files: &[Recording],
    fitted: &Result<Fitted, CalibrationError>,
    prior: &Prior<'_>,
) -> Option<Vec<Recording>> {
    let lost = |file: &Recording| file.faults.iter().filter(|of| of.name == FaultName::EncoderIndexJump).count();
    if given.iter().map(lost).sum::<usize>() >= MOST_LOST {
        return None;
    }
    let Fitted { rows, folds, model, .. } = fitted.as_ref().ok()?;
    let (log, lost) = rows.lost_index(model, folds.parts.clone())?;
    let mut parted = given.to_vec();
    let file = parted.iter_mut().find(|file| file.file == files[log].file)?;
    part(file, lost, prior)?;
    Some(parted)
}

/// Gives a log another zero from a line on, where an encoder lost its index, to the end or to that of the session.
fn part(log: &mut Recording, (line, size_arcsec, again): (u64, f64, bool), prior: &Prior<'_>) -> Option<()> {
    let at = |session: &Session| session.line.iter().position(|of| *of == line);
    let (place, row) = log.sessions.iter().enumerate().find_map(|(k, session)| Some((k, at(session)?)))?;
    let whole = &log.sessions[place];
    let behind = Session { own_zero: true, ..whole.part(row..whole.len()) };
    let pitches = whole_pitches(size_arcsec / ARCSEC_PER_RAD, &prior.nominal.gear(), WHOLE_PITCH, 0.0);
    let or = pitches.map_or_else(String::new, |pitches| format!(", or teeth have skipped by {pitches}"));
    let then = format!("{or}; the zero behind it is fitted on its own");
    log.faults.push(Fault::lost_index(whole, row, size_arcsec, &then));
    let before = whole.part(0..row);
    log.sessions.splice(place..=place, [before, behind]);
    log.sessions.get_mut(place + 2).into_iter().for_each(|next| next.own_zero |= again);
    Some(())
}

/// Logs in pieces of a session each, if sessions have zeros of their own: these leave far less than
/// one zero for each log, whatever load and direction do in addition.
fn set_anew(files: &[Recording], prior: &Prior<'_>) -> Option<Vec<Recording>> {
    if files.iter().all(|file| file.sessions.len() < 2) {
        return None;
    }
    let anew: Vec<Recording> = files.iter().flat_map(|file| by_zeros(file, |_| true)).collect();
    let recorded = Recorded::of(&anew, prior);
    if recorded.each_keeps_to_one_load {
        return None;
    }
    let rows = settled(&anew, prior, &recorded);
    let counts = (0..anew.len()).map(|log| rows.rows.iter().filter(|row| row.at.log == log).count());
    // One that a lost index cuts short is no reason against the others.
    let long = counts.filter(|count| *count < FEWEST_ROWS).sum::<usize>() as f64 <= BOTH_WAYS * rows.rows.len() as f64;
    let left = |rows: &Rows| zero::left_beside_load(rows, recorded.scales.friction_n_m);
    (long && left(&rows) < LEAVES * left(&settled(files, prior, &recorded))).then_some(anew)
}

/// A generator that started elsewhere is off by more than this beyond the interval, deg. *Guess*: a degree moves a
/// table by little.
const LEAST_START_DEG: f64 = 1.0;

/// A log with each piece that has a zero of its own on the generator's zero of a table, where its waves tell that, and
/// with what is known of zeros of its sessions. Whole turns stay, unless the output says them: a motor that was homed
/// in another turn did not start anew.
pub(crate) fn on_zero_of(table: &Table<'_>, mut log: Recording) -> Recording {
    let prior = Prior::of_table(table, GeneratorKind::Cam);
    let mut sessions = Vec::new();
    for mut piece in by_zeros(&log, |session| session.own_zero) {
        let recorded = Recorded::of(std::slice::from_ref(&piece), &prior);
        let rows = settled(std::slice::from_ref(&piece), &prior, &recorded);
        let found = (rows.rows.len() >= FEWEST_ROWS).then(|| zero::align(table, &rows, recorded.scales.friction_n_m));
        let starts_elsewhere = |found: &Alignment| {
            let deg = found.generator_zero_deg;
            let (off_deg, most_left) = if found.by_output {
                (deg, found.left_before_arcsec)
            } else {
                (zero::within(deg, 360.0), LEAVES * found.left_before_arcsec.min(found.left_by_turns_arcsec))
            };
            let other = off_deg.abs() > found.generator_half_width_deg + LEAST_START_DEG;
            found.told && other && found.left_after_arcsec < most_left
        };
        if let Some(found) = found.filter(starts_elsewhere) {
            let zero_rad = found.generator_zero_deg.to_radians();
            piece.sessions.iter_mut().for_each(|session| session.turn_generator(zero_rad, prior.nominal.ratio));
            log.notes.push(format!(
                "line {}: from here the generator reads {:+.2} ± {:.2} deg where that of the table is zero: the rows \
                 are put on the zero of the table",
                piece.sessions[0].line[0], found.generator_zero_deg, found.generator_half_width_deg
            ));
        }
        sessions.extend(piece.sessions);
    }
    log.sessions = sessions;
    // Behind a lost index the output has another zero.
    for _ in 0..MOST_LOST {
        let files = in_pieces(std::slice::from_ref(&log));
        let recorded = Recorded::of(&files, &prior);
        let rows = settled(&files, &prior, &recorded).sure(recorded.scales.friction_n_m, &recorded);
        let none = Model { chosen: Vec::new(), coefficients: Vec::new(), scales: recorded.scales };
        let Some((_, lost)) = rows.lost_index(&none, recorded.shown(PartName::ALL, &prior)) else { break };
        part(&mut log, lost, &prior);
    }
    if set_anew(std::slice::from_ref(&log), &prior).is_some() {
        log.sessions.iter_mut().for_each(|session| session.own_zero = true);
        log.notes.push(SET_ANEW.to_owned());
    }
    log
}

/// The fit whose table can be made, and that table: this one, or one with fewer parts.
fn with_table(
    fitted: Fitted,
    files: &[Recording],
    prior: &Prior<'_>,
    (rows, recorded): (&Rows, &Recorded),
) -> Result<(Fitted, MadeTable), CalibrationError> {
    let worth_it = |fitted: Fitted| fitted.is_worth_a_table(recorded, prior, files).map(|()| fitted);
    let fitted_without =
        |without: &[Without]| fit(rows.clone().less(prior), prior, recorded, without).and_then(worth_it);
    let fitted = worth_it(fitted)?;
    Ok(match table::make(prior, &fitted.model, recorded) {
        // A table has no wind-up that falls with the load, none that the lag outruns, and no lag that leads.
        Err(error) if error.is_of_a_fall() => {
            if fitted.model.of(PartName::WindUp).is_some() {
                fitted.model.gives_way_with_the_load(prior)?;
            }
            const FALLS: &str = "with it the table would fall with the load, or the output lead, somewhere";
            let (wind_up, play) = ((PartName::WindUp, FALLS), (PartName::Play, FALLS));
            let tried = [vec![wind_up], vec![play], vec![wind_up, play]].into_iter().filter_map(|without| {
                let fitted = fitted_without(&without).ok()?;
                table::make(prior, &fitted.model, recorded).ok().map(|made| (fitted, made))
            });
            let left = |(fitted, _): &(Fitted, MadeTable)| fitted.held_out.rms_after_arcsec;
            tried.min_by(|a, b| left(a).total_cmp(&left(b))).ok_or(error)?
        }
        made => (fitted, made?),
    })
}

/// Report on a table and the fit that it is of; the error is split if that was asked.
fn report(fit: FitOfLogs<'_>, split: bool) -> Result<Calibrated, CalibrationError> {
    let FitOfLogs { files, delays, zeros, prior, alignment, recorded, fitted, made, said } = fit;
    let parts = fitted.judged(recorded, prior);
    let agreement = fitted.agreement();
    let Fitted { rows, folds, model, held_out, .. } = fitted;
    let torque_from_wind_up = WindUpTorque::of(&rows, &folds, &model, prior).filter(|_| recorded.has_torque);
    let image = Table::check(&made.image).map_err(|error| TableError::Project(error.into()))?;
    let core = ByCore::of(files, &image, recorded);
    let mut readings = delays.as_ref().map_or_else(Vec::new, |delays| delays.readings(files));
    let delay = delay_note(&readings, files.len());
    readings.extend(zeros);
    let play_of_a_millisecond_arcsec = play_of_a_millisecond(&rows.rows, recorded, prior);
    let mut notes: Vec<String> = files.iter().flat_map(|file| file.notes.iter().cloned()).collect();
    notes.extend(said);
    notes.extend(delay);
    notes.extend(agreement.and_then(|agreement| agreement.note(files)));
    notes.extend(remarks(prior, recorded, files, &model, play_of_a_millisecond_arcsec));
    let zero = |row: &folds::Row| row.left_arcsec - model.adds_arcsec(&row.at);
    let mean = rows.rows.iter().map(zero).sum::<f64>() / rows.rows.len() as f64;
    let shown = rows.rows.iter().map(|row| [row.at.output_rad, row.measured_arcsec, zero(row) - mean]).collect();
    let of_columns = delays.as_ref().map_or(vec![0.0; files.len()], |delays| delays.of_columns(&recorded.scales));
    let left_out_arcsec = held_out.rms_after_arcsec;
    let correlation = rows.load_with_output_angle();
    let beside = collinear(&rows, &model, correlation);
    let known_with = |beside: &[(PartName, f64)]| {
        ModelUncertainty::of(&rows.rows, (&model, beside), &of_columns, recorded.coarse_rad, left_out_arcsec)
            .ok_or_else(|| CalibrationError::Known("the information matrix of these rows is singular".to_owned()))
    };
    let known = known_with(&beside)?;
    // Where delays were found the table is fitted to both angles at one instant, as at rest; where none was, to the
    // paces that were recorded.
    let at_rest = |at: State| State { speed_rad_s: 0.0, ..at };
    let as_fitted = |at: State| if delays.is_some() { at_rest(at) } else { at };
    let every = rows.rows.len().div_ceil(ROWS_OF_A_WIDTH).max(1);
    let some_rows = || rows.rows.iter().step_by(every).map(|row| row.at);
    // Over what the table is to hold.
    let (from, to) = least_and_most(rows.rows.iter().map(|row| row.at.output_rad));
    let pace = rows.rows.iter().map(|row| row.at.speed_rad_s.abs()).sum::<f64>() / rows.rows.len().max(1) as f64;
    let mut anywhere = interval::spread(&recorded.scales, prior.nominal.ratio, [from, to], ROWS_OF_A_WIDTH);
    anywhere.iter_mut().for_each(|at| at.speed_rad_s = at.way * pace);
    let half_width_arcsec = known.mean_half_width_arcsec(anywhere.iter().copied().map(as_fitted));
    let half_width_as_recorded_arcsec = known.mean_half_width_arcsec(some_rows().map(as_fitted));
    let half_width_at_another_pace_arcsec = known.mean_half_width_arcsec(anywhere.iter().copied().map(at_rest));
    let beyond = (half_width_arcsec.powi(2) - half_width_as_recorded_arcsec.powi(2)).max(0.0).sqrt();
    let decides = !beside.is_empty() && beyond > half_width_as_recorded_arcsec;
    let load_with_output_angle = decides.then_some(correlation);
    notes.extend(load_with_output_angle.map(|correlation| {
        format!(
            "the load goes with the angle of the output (correlation {correlation:.2}), as the weight of an arm does: \
             wind-up and waves of the output are one there, and under another load at the same angles the table, and \
             a torque from the wind-up, are off by ±{half_width_arcsec:.0} arcsec; record them under other loads"
        )
    }));
    let torque_from_wind_up =
        torque_from_wind_up.map(|of| of.over_all(files, (&image, recorded.temperature_c), beyond));
    let offset = |(log, middle): (usize, &f64)| {
        let left: Vec<f64> = rows.rows.iter().filter(|row| row.at.log == log).map(zero).collect();
        let count = left.len().max(1) as f64;
        // The output is known no better than the generator.
        let by_zero = readings.iter().find(|zero| zero.name == ZERO && zero.file == files[log].file);
        let by_zero = by_zero.map_or(0.0, |zero| zero.std.to_radians() / prior.nominal.ratio * ARCSEC_PER_RAD);
        Some([middle + left.iter().sum::<f64>() / count, (known.noise.of_a_row() / count).sqrt().hypot(by_zero)])
    };
    let offsets = Reading::of_logs(OFFSET, files, rows.means_arcsec.iter().enumerate().map(offset));
    readings.extend(offsets);
    let of_encoder = model.of(PartName::OutputAngle).map(|_| WITH_ENCODER);
    notes.extend(if split { Some(SPLIT_BY) } else { of_encoder }.map(str::to_owned));
    let of_whom = |changes: Vec<(PartName, f64)>| {
        let changing = &known_with(&[&beside[..], &changes].concat())?;
        let (model, known, changes, has_torque) = (&model, &known, &changes, recorded.has_torque);
        let states: Vec<State> = some_rows().map(as_fitted).collect();
        let lacking = PartName::ALL.into_iter().filter_map(|part| Some((part, recorded.lacks(part, prior)?)));
        let lacking = lacking.collect();
        let (split, gear) = SplitWaves { model, known, changing, changes, has_torque, lacking }.split(&states, prior);
        Ok::<_, CalibrationError>((split, table::make(prior, &gear, recorded)?))
    };
    let changes = split.then(|| split::recorded_changes(&rows, &model, prior, known.noise.rms_arcsec));
    let (split, gear) = changes.map(of_whom).transpose()?.unzip();
    let mut of_files: Vec<String> = files.iter().map(|file| file.file.clone()).collect();
    of_files.dedup();
    let calibration = Calibration {
        schema_version: 1,
        files: of_files,
        rows: core.rows,
        rows_fitted: rows.rows.len(),
        left_out: if rows.by_file { "files" } else { "blocks" },
        folds: folds.all().len(),
        held_out,
        core,
        play_of_a_millisecond_arcsec,
        torque_from_wind_up,
        readings,
        parts,
        nodes: known.nodes(),
        noise: known.noise,
        half_width_arcsec,
        half_width_as_recorded_arcsec,
        half_width_at_another_pace_arcsec,
        load_with_output_angle,
        alignment,
        split,
        ratio: prior.nominal.ratio,
        table_id: made.info.table_id.clone(),
        image_bytes: made.image.len(),
        projection_rms_arcsec: made.info.projection_rms_arcsec,
        torque_n_m: image.torque_range_n_m(),
        temperature_c: image.temperature_range_c(),
        data_faults: files.iter().flat_map(|file| file.faults.iter().cloned()).collect(),
        notes,
        command: String::new(),
    };
    Ok(Calibrated { calibration, table: made, gear, known, shown })
}

/// What keeps a table from being made, with what was noticed of the units and signs of the logs: before what it may be
/// the cause of, a torque of another sign, and after all else.
fn with_faults(error: CalibrationError, files: &[Recording], said: &[String]) -> CalibrationError {
    let faults = files.iter().flat_map(|file| &file.faults).filter(|fault| fault.name == FaultName::UnitMismatch);
    let faults = faults.map(|fault| format!("{}: see its unit and sign, and the sign of the ratio", fault.what));
    let mut faults: Vec<String> = faults.collect();
    faults.sort();
    faults.dedup();
    let after =
        |error: String, notes: &[String]| notes.iter().fold(error, |text, note| format!("{text}\n  note: {note}"));
    match error {
        CalibrationError::Known(error) if !faults.is_empty() => {
            CalibrationError::Known(after(format!("{}\n  then {error}", faults.join("\n  ")), said))
        }
        CalibrationError::Table(error) => CalibrationError::Known(after(error.to_string(), &[&faults, said].concat())),
        CalibrationError::NothingGained(error) => {
            CalibrationError::NothingGained(after(error, &[&faults, said].concat()))
        }
        other => other,
    }
}

/// Load below which the direction decides the flank without a table, N·m: that of the prior, or of those tried the one
/// beside which all parts together leave least in rows left out.
fn friction_of(rows: &Rows, prior: &Prior<'_>, recorded: &Recorded) -> f64 {
    let (usual, parts) = (recorded.scales.friction_n_m, recorded.shown(PartName::ALL, prior));
    if prior.friction_n_m() > 0.0 || [PartName::WindUp, PartName::Play].iter().any(|part| !parts.contains(part)) {
        return usual;
    }
    let mut some = rows.clone().less(prior);
    some.rows = zero::thinned(some.rows.iter(), FRICTION_WITH).into_iter().copied().collect();
    let chosen: Vec<Chosen> = parts.iter().map(|part| Chosen { part: *part, penalty: PENALTIES[1] }).collect();
    let left = |friction_n_m: f64| {
        let folds = some.folds_of(&parts, &Scales { friction_n_m, ..recorded.scales });
        (friction_n_m, folds.left_out(&folds.all(), &chosen))
    };
    let least = |tried: &[(f64, f64)]| tried.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(usual, |best| best.0);
    let tried = FRICTIONS.map(|times| left(times * usual));
    let best = least(&tried);
    // At the end of them something else goes on as far as one lets it: a load that was not recorded.
    if best >= tried[tried.len() - 1].0 {
        return usual;
    }
    let [below, above] = HALF_A_STEP.map(|times| left(times * best));
    least(&[&[below], &tried[..], &[above]].concat())
}

/// Load below which the direction decides the flank beside a table, N·m: its own dead zone, unless rows with loads
/// between it and that of a drive with the usual friction say otherwise.
fn dead_zone(rows: &Rows, prior: &Prior<'_>, table: &Table<'_>, recorded: &Recorded) -> f64 {
    let (own, usual) = (dead_zone_n_m(table), recorded.scales.friction_n_m);
    if own <= 0.0 || own >= usual {
        return own.max(usual);
    }
    // A row on a flank that the noise of its torque has drawn would move the mean of its file, and with it all others.
    let sure = rows.clone().sure(own, recorded).sure(usual, recorded);
    let noise = CLEAR_OF_NOISE * recorded.torque_noise_n_m;
    let between = own + noise..usual - noise;
    let left = |least_friction_n_m: f64| -> Vec<f64> {
        let rows = sure.clone().less(&Prior { least_friction_n_m, ..prior.clone() }).rows.into_iter();
        rows.filter(|row| between.contains(&row.at.torque_n_m.abs())).map(|row| row.left_arcsec.powi(2)).collect()
    };
    let (by_own, by_usual) = (left(own), left(usual));
    let other =
        by_own.len() >= FEWEST_ROWS && by_usual.iter().sum::<f64>() < OTHER_DEAD_ZONE * by_own.iter().sum::<f64>();
    if other { usual } else { own }
}

/// How an error is split.
const SPLIT_BY: &str = "the split takes for an encoder's what changes neither with the load nor with the flank: of \
                        waves of displaced wheels at least half does; an error of a gear that does not counts as the \
                        encoder's";

/// What a table holds that was not split.
const WITH_ENCODER: &str = "the curve over the output angle holds the error of the output's encoder, as the readings \
                            do: --split also makes gear.fxt, without what is the encoder's";

/// A part that is not fitted, and why.
type Without = (PartName, &'static str);

struct Fitted {
    rows: Rows,
    folds: Folds,
    /// Parts that were not to be chosen.
    without: Vec<Without>,
    model: Model,
    held_out: HeldOut,
}

impl Fitted {
    /// Whether several logs agree.
    fn agreement(&self) -> Option<Agreement> {
        Agreement::of(&self.rows, &self.folds.parts, &self.model.scales)
    }

    /// No table is the simplest of all; a prior that is wrong may leave more than that even with parts beside it.
    fn is_worth_a_table(
        &self,
        recorded: &Recorded,
        prior: &Prior<'_>,
        files: &[Recording],
    ) -> Result<(), CalibrationError> {
        let HeldOut { rms_before_arcsec, rms_after_arcsec, .. } = self.held_out;
        let no_part = self.model.chosen.is_empty();
        if rms_after_arcsec < rms_before_arcsec && !(no_part && prior.is_empty()) {
            return Ok(());
        }
        let what = if no_part {
            "no part gains in what was left out"
        } else {
            "what was known before is further off than the parts mend in what was left out"
        };
        let apart = self.agreement().and_then(|agreement| agreement.note(files));
        let torque = (!recorded.has_torque).then(|| {
            "no torque was recorded: under loads that change, record it, as the wind-up is the largest part".to_owned()
        });
        let mut text = format!(
            "{what}, so no table is better than none ({rms_before_arcsec:.2} arcsec rms as measured, \
             {rms_after_arcsec:.2} with the table)"
        );
        apart.into_iter().chain(torque).for_each(|said| text += &format!("\n  {said}"));
        let parts = self.judged(recorded, prior);
        parts.iter().for_each(|part| text += &format!("\n  {}: {}", part.name, part.why));
        Err(CalibrationError::NothingGained(text))
    }

    /// Report on each part.
    fn judged(&self, recorded: &Recorded, prior: &Prior<'_>) -> Vec<PartSays> {
        let Fitted { rows, folds, model, .. } = self;
        let all = folds.all();
        let before = folds.left_out(&all, &[]);
        let with = folds.left_out(&all, &model.chosen);
        let says = |part: PartName| {
            let chosen = model.chosen.iter().find(|chosen| chosen.part == part);
            let refused = recorded.lacks(part, prior).or_else(|| {
                let without = self.without.iter().find(|(other, _)| *other == part);
                without.map(|(_, why)| (*why).to_owned())
            });
            let explained = || {
                let others: Vec<Chosen> = model.chosen.iter().copied().filter(|other| other.part != part).collect();
                let without = folds.left_out(&all, &others);
                let with = chosen.map_or_else(|| folds.best_penalty(&all, &others, part).1, |_| with);
                let share = (without - with) / without;
                let explain =
                    format!("{:.1} % of the remaining variance (threshold {:.0} %)", 100.0 * share, 100.0 * LEAST_GAIN);
                let why = if chosen.is_some() && share <= 0.0 {
                    "the parts chosen after it explain what it does: these rows do not tell them apart".to_owned()
                } else if chosen.is_some() {
                    let times = (without / with).sqrt();
                    format!("explains {explain}; without it the held-out error is {times:.2} times as large")
                } else if share > LEAST_GAIN {
                    "reduces the error in the rows it was chosen on, not in those held out".to_owned()
                } else {
                    format!("would explain {explain}")
                };
                (Some((without - with) / before), why)
            };
            let (held_out_gain, why) = refused.map_or_else(explained, |why| (None, why));
            PartSays {
                name: part.as_str(),
                kept: chosen.is_some(),
                held_out_gain,
                penalty: chosen.map(|chosen| chosen.penalty),
                size_arcsec: chosen.map(|chosen| size(rows, model, *chosen)),
                why,
            }
        };
        PartName::ALL.into_iter().map(says).collect()
    }
}

/// Chooses and fits parts to the rows that are outside of a play.
fn fit(rows: Rows, prior: &Prior<'_>, recorded: &Recorded, without: &[Without]) -> Result<Fitted, CalibrationError> {
    if rows.rows.len() < FEWEST_ROWS {
        return Err(CalibrationError::TooFew(rows.rows.len()));
    }
    let mut without = without.to_vec();
    // Once more where the play has to go: without it the flanks are sound.
    loop {
        let mut open = recorded.shown(PartName::ALL, prior);
        open.retain(|part| without.iter().all(|(other, _)| other != part));
        let folds = rows.folds_of(&open, &recorded.scales);
        let all = folds.all();
        let left = folds.nested();
        let path = folds.path(&all);
        // The fewest parts that leave least where neither choice nor fit was made.
        let most = (0..path.len()).min_by(|a, b| left[*a].total_cmp(&left[*b])).unwrap_or(0);
        let chosen = path[most].clone();
        let coefficients = folds.coefficients(&chosen, &[]).unwrap_or_default();
        let mut model = Model { chosen, coefficients, scales: recorded.scales };
        let prior_half_arcsec = 0.5 * prior.nominal.backlash_arcsec;
        let mut held: Vec<(usize, f64)> = Vec::new();
        while let Some(bound) = model.out_of_bounds(prior_half_arcsec).filter(|_| held.len() < PLAY_COEFFICIENTS) {
            held.push(bound);
            model.coefficients = folds.coefficients(&model.chosen, &held).unwrap_or_default();
        }
        if held.len() == PLAY_COEFFICIENTS && prior_half_arcsec == 0.0 {
            without.push((PartName::Play, "the output would lead, or a flank bear on the wrong side"));
            continue;
        }
        model.bound_warmth();
        let count = rows.rows.len() as f64;
        let rms = |squares: f64| (squares / count).sqrt();
        let held_out = HeldOut {
            rms_before_arcsec: rms(rows.rows.iter().map(|row| row.measured_arcsec * row.measured_arcsec).sum()),
            rms_prior_arcsec: rms(folds.left_out(&all, &[])),
            rms_after_arcsec: rms(left[most]),
        };
        return Ok(Fitted { rows, folds, without, model, held_out });
    }
}

/// Half of peak to peak of a part over the rows, arcsec.
fn size(rows: &Rows, model: &Model, chosen: Chosen) -> f64 {
    let coefficients = model.of(chosen.part).map_or_else(Vec::new, |of| model.coefficients[of].to_vec());
    let alone = Model { chosen: vec![chosen], coefficients, scales: model.scales };
    let (least, most) = least_and_most(rows.rows.iter().map(|row| alone.adds_arcsec(&row.at)));
    0.5 * (most - least)
}

/// Note on logs at one pace.
fn note_of_one_pace(play_of_a_millisecond_arcsec: f64) -> String {
    format!(
        "the generator keeps to one pace: an output a millisecond older than the generator looks like \
         {play_of_a_millisecond_arcsec:.1} arcsec of play, and one as much newer takes them off it; other paces tell, \
         half as fast for one pass in five"
    )
}

/// What a change of the torque winds up, of a lag that undoes it. *Guess*.
const ALIKE: std::ops::Range<f64> = 0.5..2.0;
/// Notes for the user of the table.
fn remarks(
    prior: &Prior<'_>,
    recorded: &Recorded,
    files: &[Recording],
    model: &Model,
    play_of_a_millisecond_arcsec: Option<f64>,
) -> Vec<String> {
    let said = |there: bool, what: &str| there.then(|| what.to_owned());
    let by_ratio = prior.nominal.teeth.is_none() && prior.table.is_none();
    let teeth = prior.nominal.teeth_or_of_two_waves();
    let by_way_n_m = torque_by_way(files, prior.nominal.ratio);
    let wound_arcsec = 0.5 * (model.under_arcsec(by_way_n_m, prior) - model.under_arcsec(-by_way_n_m, prior));
    let lag_arcsec = model.of(PartName::Play).map_or(0.0, |play| model.coefficients[play.start]);
    let remarks = [
        (lag_arcsec > 0.0 && ALIKE.contains(&(wound_arcsec / lag_arcsec))).then(|| {
            format!(
                "where the motion turns round the torque changes by {:.2} N·m, and the error does not: friction of the \
                 motor's side is in the column, and in the play of ±{lag_arcsec:.0} arcsec here; the table is for a \
                 torque that is measured so",
                2.0 * by_way_n_m
            )
        }),
        by_ratio.then(|| {
            format!(
                "the ratio alone was given: the table is marked with {} and {} teeth, two waves",
                teeth.flexspline, teeth.circular_spline
            )
        }),
        said(
            model.chosen.is_empty(),
            "no part gains in what was left out: the table is what was known before, its zeros aside; are the logs of \
             this unit, and of one?",
        ),
        (recorded.output_share < 1.0 && model.of(PartName::OutputAngle).is_some()).then(|| {
            format!(
                "{:.0} % of an output turn was recorded: elsewhere the curve over the output angle is not measured",
                100.0 * recorded.output_share
            )
        }),
        said(
            recorded.each_keeps_to_one_load,
            "each log keeps to one load: its wind-up is in the zero of the output, and the table has none; record \
             several loads in one log",
        ),
        said(
            recorded.sessions_keep_to_one_load && model.of(PartName::WindUp).is_some(),
            "each session keeps to one load: its wind-up is told from the zero of the output only if that was the same \
             in all of them, which these rows do not show; give each session as a log of its own if it was not",
        ),
        said(
            recorded.lacks(PartName::Play, prior).is_some(),
            "one direction was recorded: after a reversal the table says nothing new of the play",
        ),
        play_of_a_millisecond_arcsec.map(note_of_one_pace),
        said(
            !recorded.has_torque,
            "no torque was recorded: the table holds under the loads of these rows alone, whose wind-up, an arm's too, \
             stands in it as 0 N·m; at any other the core says that it is outside of the table",
        ),
    ];
    remarks.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests;
