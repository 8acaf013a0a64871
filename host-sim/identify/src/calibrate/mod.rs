//! Logs of one unit to its table, whatever the cause of its error.
//!
//! ```text
//! logs -> measurement -> rows in steady motion, less the prior -> parts, chosen by folds left out -> samples -> table (.fxt) -> the core over the logs
//! ```
//!
//! Physics first: the nominal model, or a table, is the prior, and is taken from what was measured. What remains is
//! fitted by smooth
//! [parts](PartName), each with a penalty against wrinkles. Which parts are kept, and how smooth they are, is decided
//! by what fits leave in files, sessions or blocks that they did not see; the figure given for the whole is nested:
//! choice, penalties and fit are all made without the fold that they are judged in. No part is fitted where nothing was
//! recorded that could show it, and no table is made that leaves more than a simpler one.

mod choose;
mod folds;
mod interval;
mod parts;
mod plan;
mod prior;
mod rows;
mod table;
mod zero;

use flexspline::Table;
use serde::Serialize;

use crate::extension::left_by_core;
use crate::measurement::{Fault, FaultName, MeasuredError, Recording, least_and_most};
use choose::{LEAST_GAIN, PENALTIES, best_penalty, nested, path, pruned};
use flexspline_design::tables::{MadeTable, TableError, dead_zone_n_m};
use folds::{Chosen, Folds};
pub use interval::{Known, Node, Noise};
pub use parts::{PartName, Scales, State};
pub use plan::{Bench, First, Pass, Planned, Wide, plan};
pub use prior::Prior;
use rows::{FoldKind, Recorded, Rows, settled};
pub use zero::{Alignment, OutputZero, ZeroCost, cost};

/// The golden section: its multiples spread places over a turn and fold no order onto another.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Fewest rows in steady motion that make a table.
const FEWEST_ROWS: usize = 64;
/// Load that decides the flank where no model says a friction, of the largest recorded: a guess, small beside any load
/// of interest.
const LEAST_FRICTION: f64 = 0.02;
/// Rows between two dead zones tell them apart if their load is clear of both by so many times the torque's noise…
const CLEAR_OF_NOISE: f64 = 6.0;
/// …and if the other leaves less than this share of their squares: where it is right, half of them lie on the wrong
/// flank.
const OTHER_DEAD_ZONE: f64 = 0.8;
/// Torques within this share of the largest are one.
const SAME_TORQUE: f64 = 1e-3;
/// Share of the motion that the rarer direction must have for the play to be seen.
const BOTH_WAYS: f64 = 0.1;
/// Shares of a turn that must have been recorded for a curve over it: of the generator, and of the output.
const MOST_OF_A_TURN: f64 = 0.75;
const HALF_A_TURN: f64 = 0.5;
/// Rows that a tooth pitch needs for its curve.
const ROWS_OF_A_PITCH: f64 = 6.0;
/// Files do not share their zeros if fits to each alone leave less than this share of what the others leave in it. A
/// guess.
const ALONE: f64 = 0.3;
/// Rows that the usual half width is taken of.
const ROWS_OF_A_WIDTH: usize = 2000;
/// Generator turns in steps that are short beside a pitch, at least.
const FINE_TURNS: f64 = 1.0;
/// The penalty that a plan counts with: the least that a fit takes.
const PENALTY_OF_PLANS: f64 = PENALTIES[0];
/// A ratio is refused if another leaves less than this share of the squares. A guess: of what a wrong whole number
/// does, nothing is left.
const OTHER_RATIO: f64 = 0.25;
/// A lag that is negative by no more than this, and this share of the largest number of the play, is noise: guesses.
const NO_LAG_ARCSEC: f64 = 0.5;
const NO_LAG_SHARE: f64 = 0.1;
/// Paces that tell a delay from play: the fastest is so many times the slowest. *Guess*.
const OTHER_PACE: f64 = 1.25;
/// Temperatures closer than this, K, are one.
const ONE_TEMPERATURE_K: f64 = 2.0;

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The logs cannot be read.
    #[error(transparent)]
    Measured(#[from] MeasuredError),
    /// What is known of the drive makes no table.
    #[error("{0}")]
    Known(String),
    /// The rows turn by another ratio.
    #[error("{0}")]
    Ratio(String),
    /// Too few rows in steady motion.
    #[error("{0} rows in steady motion; at least {FEWEST_ROWS} are needed")]
    TooFew(usize),
    /// Nothing gains.
    #[error("{0}")]
    NothingGained(String),
    /// The samples make no table.
    #[error(transparent)]
    Table(#[from] TableError),
}

impl CalibrationError {
    /// Whether the input is to blame.
    #[must_use]
    pub fn is_bad_input(&self) -> bool {
        matches!(
            self,
            CalibrationError::Measured(_)
                | CalibrationError::Known(_)
                | CalibrationError::Ratio(_)
                | CalibrationError::TooFew(_)
        )
    }
}

/// What was fitted beside the prior.
#[derive(Debug, Clone)]
struct Model {
    chosen: Vec<Chosen>,
    coefficients: Vec<f64>,
    scales: Scales,
}

impl Model {
    /// What the parts add, arcsec.
    fn adds_arcsec(&self, at: &State) -> f64 {
        let mut columns = Vec::with_capacity(self.coefficients.len());
        self.chosen.iter().for_each(|chosen| parts::columns(chosen.part, at, &self.scales, &mut columns));
        columns.iter().zip(&self.coefficients).map(|(column, coefficient)| column * coefficient).sum()
    }

    /// Where the coefficients of a part stand.
    fn of(&self, part: PartName) -> Option<std::ops::Range<usize>> {
        let mut begin = 0;
        for chosen in &self.chosen {
            let width = parts::weights(chosen.part).len();
            if chosen.part == part {
                return Some(begin..begin + width);
            }
            begin += width;
        }
        None
    }

    /// The whole play that it has at most beside the prior's, arcsec.
    fn play_arcsec(&self) -> f64 {
        let Some(play) = self.of(PartName::Play).map(|play| &self.coefficients[play]) else { return 0.0 };
        // Without load both the lag and the flank go by direction; under load the lag alone.
        2.0 * [play[0] + play[2], play[0], play[0] + play[1]].into_iter().fold(0.0, f64::max)
    }

    /// Whether the flanks keep their sides, with half the prior's play where no load decides. A lag that is negative by
    /// no more than noise is none.
    fn has_sound_flanks(&mut self, prior_half_arcsec: f64) -> bool {
        let mut least_lag = 0.0;
        if let Some(play) = self.of(PartName::Play)
            && let [lag, by_load, flank] = &mut self.coefficients[play]
        {
            let size = lag.abs().max(by_load.abs()).max(flank.abs());
            let none = -(NO_LAG_ARCSEC + NO_LAG_SHARE * size);
            if *lag < none || *lag + *by_load < none || *lag + *flank + prior_half_arcsec < none {
                return false;
            }
            *lag = lag.max(0.0);
            *by_load = by_load.max(-*lag);
            *flank = flank.max(-*lag - prior_half_arcsec);
            least_lag = lag.min(*lag + *by_load);
        }
        if let Some(temperature) = self.of(PartName::Temperature)
            && let [_, _, by_warmth] = &mut self.coefficients[temperature]
        {
            // Nor does a temperature take more of the lag than there is.
            *by_warmth = by_warmth.clamp(-least_lag, least_lag);
        }
        true
    }
}

/// What is said of a part.
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

/// Errors in folds that took no part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HeldOut {
    /// As measured, each file's zero taken out.
    pub rms_before_arcsec: f64,
    /// With the nominal model or table alone.
    pub rms_prior_arcsec: f64,
    /// With the table made without them.
    pub rms_after_arcsec: f64,
}

/// The core with the finished table over the whole logs, reversals among them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ByCore {
    /// As measured, each file's zero taken out.
    pub rms_before_arcsec: f64,
    /// What the core leaves.
    pub rms_after_arcsec: f64,
    /// Rows.
    pub rows: usize,
}

/// `calibration.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Calibration {
    /// Version of this object.
    pub schema_version: u32,
    /// The logs.
    pub files: Vec<String>,
    /// Rows of all, rows fitted, and rows left out because the output had not settled.
    pub rows: usize,
    /// See above.
    pub rows_fitted: usize,
    /// See above.
    pub rows_unsettled: usize,
    /// What was left out in turn: `files`, `sessions` or `blocks`.
    pub left_out: &'static str,
    /// How many of them.
    pub folds: usize,
    /// Errors where nothing was fitted.
    pub held_out: HeldOut,
    /// The core over all rows.
    pub core: ByCore,
    /// The parts.
    pub parts: Vec<PartSays>,
    /// Every node of every part, with an interval.
    pub nodes: Vec<Node>,
    /// What the rows show of noise.
    pub noise: Noise,
    /// Half width of the interval that holds the table's error in a state with 95 %, mean square root over the rows,
    /// arcsec.
    pub half_width_arcsec: f64,
    /// Phase of the table that was known before, if one was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alignment: Option<Alignment>,
    /// Zero of the output in each file. Generator angle zero of the table is where the logs read zero.
    pub output_zeros: Vec<OutputZero>,
    /// What an error in the zeros of the table costs.
    pub zero_cost: ZeroCost,
    /// Generator turns for one of the output.
    pub ratio: f64,
    /// Identity of the table.
    pub table_id: String,
    /// Its size, bytes.
    pub image_bytes: usize,
    /// What the table misses of the model, arcsec rms.
    pub projection_rms_arcsec: f64,
    /// Torques that it holds for, N·m.
    pub torque_n_m: [f32; 2],
    /// Temperatures that it holds for, °C.
    pub temperature_c: [f32; 2],
    /// Faults of the logs.
    pub data_faults: Vec<Fault>,
    /// What was noticed.
    pub notes: Vec<String>,
    /// Command line, once known.
    pub command: String,
}

/// A table with what is said of it.
pub struct Calibrated {
    /// What is said.
    pub calibration: Calibration,
    /// The table.
    pub table: MadeTable,
    /// How well it is known.
    pub known: Known,
    rows: Rows,
    recorded: Recorded,
    /// Rows for a picture: output angle (rad), measured and left by the model (arcsec).
    pub shown: Vec<[f64; 3]>,
}

impl Calibrated {
    /// What these logs have shown, for a plan of what to add.
    #[must_use]
    pub fn first(&self) -> First<'_> {
        First {
            rows: &self.rows.rows,
            files: self.calibration.files.len(),
            noise: self.known.noise,
            scales: self.recorded.scales,
        }
    }
}

/// Refuses a ratio that the rows contradict; says where they doubt it.
fn check_ratio(files: &[Recording], prior: &Prior<'_>) -> Result<Option<String>, CalibrationError> {
    let ratio = prior.nominal.ratio;
    let (mut xx, mut xe, mut ee) = (0.0, 0.0, 0.0);
    for session in files.iter().flat_map(|file| &file.sessions) {
        let count = session.len().max(1) as f64;
        let output = || session.generator_rad.iter().map(|psi| psi / ratio);
        let (x, e) = (output().sum::<f64>() / count, session.error_rad.iter().sum::<f64>() / count);
        for (at, error) in output().zip(&session.error_rad) {
            xx += (at - x) * (at - x);
            xe += (at - x) * (error - e);
            ee += (error - e) * (error - e);
        }
    }
    if xx <= 0.0 || ee <= 0.0 {
        return Ok(None);
    }
    let found = ratio / (1.0 + xe / xx);
    let left = |other: f64| {
        let slope = ratio / other - 1.0;
        (ee - 2.0 * slope * xe + slope * slope * xx) / ee
    };
    let whole = found.round();
    if (whole - ratio).abs() >= 1.0 && whole.abs() >= 2.0 && left(whole) < OTHER_RATIO {
        return Err(CalibrationError::Ratio(format!(
            "ratio: found {ratio}, but the generator turns {found:.2} times for one turn of the output in these rows; \
             allowed: {whole}, or other units or signs of the columns"
        )));
    }
    let half = found.floor() + 0.5;
    let doubt = half != ratio && left(half) < OTHER_RATIO;
    Ok(doubt.then(|| {
        format!("the generator turns {found:.2} times for one turn of the output in these rows: is the ratio {half}?")
    }))
}

/// Generator turns that tell two waves in a turn from two in a turn against the output: half a turn of the output, in
/// which the one gains a wave on the other.
fn turns_to_tell_wheels(ratio: f64) -> f64 {
    0.5 * ratio.abs()
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

/// Makes the table of a unit from its logs.
///
/// # Errors
/// Too few rows in steady motion, nothing that gains, or a drive that no table can be of.
pub fn calibrate(files: &[Recording], prior: &Prior<'_>) -> Result<Calibrated, CalibrationError> {
    if let Some([one, other]) = given_twice(files) {
        return Err(CalibrationError::Known(format!("{one} and {other} hold the same rows: give each log once")));
    }
    let parted: Vec<Recording>;
    let files = if files.iter().flat_map(|file| &file.sessions).any(|session| session.own_zero) {
        parted = files.iter().flat_map(by_zeros).collect();
        &parted
    } else {
        files
    };
    prior.core_drive().map_err(CalibrationError::Known)?;
    let mut said: Vec<String> = check_ratio(files, prior)?.into_iter().collect();
    let mut recorded = Recorded::of(files, prior);
    let play_rad = prior.nominal.backlash_arcsec / flexspline_base::units::ARCSEC_PER_RAD;
    let mut rows = settled(files, prior, &recorded, play_rad);
    let at_one_instant: Vec<Recording>;
    let delay_s = reading_delay_s(&rows, prior, &recorded)?;
    let files = if delay_s == 0.0 {
        files
    } else {
        at_one_instant = files.iter().map(|file| without_delay(file, delay_s, prior.nominal.ratio)).collect();
        rows = settled(&at_one_instant, prior, &recorded, play_rad);
        said.push(delayed(delay_s));
        &at_one_instant
    };
    if let Some(table) = prior.table {
        (rows, recorded.scales.friction_n_m) = dead_zone(rows, prior, table, &recorded);
    }
    with_dead_zone(files, prior, (rows, recorded), said).map_err(|error| with_faults(error, files))
}

/// By how much the output is read after the generator, s, where that tells what was left out better than play and all
/// other parts do; 0 where it does not.
fn reading_delay_s(rows: &Rows, prior: &Prior<'_>, recorded: &Recorded) -> Result<f64, CalibrationError> {
    if recorded.lacks(PartName::ReadingDelay, prior).is_some() {
        return Ok(0.0);
    }
    let rows = rows.clone().sure(recorded.scales.friction_n_m, recorded).less(prior);
    let fitted = fit(rows, prior, recorded, PartName::ALL.into_iter().chain([PartName::ReadingDelay]))?;
    let arcsec = fitted.model.of(PartName::ReadingDelay).map_or(0.0, |of| fitted.model.coefficients[of.start]);
    Ok(-arcsec / flexspline_base::units::ARCSEC_PER_RAD / recorded.scales.speed_rad_s)
}

/// A file with both angles as they are at one instant.
fn without_delay(file: &Recording, delay_s: f64, ratio: f64) -> Recording {
    let mut file = file.clone();
    for session in &mut file.sessions {
        let speeds: Vec<f64> = (0..session.len()).map(|k| rows::speed_rad_s(session, k, ratio)).collect();
        session.error_rad.iter_mut().zip(speeds).for_each(|(error, speed)| *error += delay_s * speed);
    }
    file
}

/// What is said of a delay.
fn delayed(delay_s: f64) -> String {
    let (late, early) = if delay_s > 0.0 { ("output", "generator") } else { ("generator", "output") };
    format!(
        "the {late} is read {:.2} ms after the {early}: what that does goes with the speed, which no table knows; it \
         was taken out of the rows. Read both at one instant, or tell the controller of the delay",
        1e3 * delay_s.abs()
    )
}

/// A file in pieces, each with one zero.
fn by_zeros(file: &Recording) -> Vec<Recording> {
    let mut pieces: Vec<Recording> = Vec::new();
    for session in &file.sessions {
        if pieces.is_empty() || session.own_zero {
            let whole = if pieces.is_empty() { Some(file) } else { None };
            pieces.push(Recording {
                file: file.file.clone(),
                rows: file.rows,
                sessions: Vec::new(),
                faults: whole.map_or_else(Vec::new, |file| file.faults.clone()),
                tooth_steps: whole.map_or_else(Vec::new, |file| file.tooth_steps.clone()),
                notes: whole.map_or_else(Vec::new, |file| file.notes.clone()),
                unusable: file.unusable.clone(),
            });
        }
        if let Some(piece) = pieces.last_mut() {
            piece.sessions.push(session.clone());
        }
    }
    pieces
}

/// Calibrates from `rows` with the load that decides the flank as it stands in `recorded`; `said` is what is noted of
/// the ratio and of a delay.
fn with_dead_zone(
    files: &[Recording],
    prior: &Prior<'_>,
    (rows, recorded): (Rows, Recorded),
    said: Vec<String>,
) -> Result<Calibrated, CalibrationError> {
    let prior = &Prior { least_friction_n_m: recorded.scales.friction_n_m, ..prior.clone() };
    let alignment = prior.table.map(|table| zero::align(table, &rows, recorded.scales.friction_n_m));
    let aligned = Prior {
        zero_rad: alignment
            .as_ref()
            .filter(|found| found.told)
            .map_or(0.0, |found| found.generator_zero_deg.to_radians()),
        ..prior.clone()
    };
    let prior = &aligned;
    let mut fitted =
        fit(rows.sure(recorded.scales.friction_n_m, &recorded).less(prior), prior, &recorded, PartName::ALL)?;
    let found = fitted.model.play_arcsec() / flexspline_base::units::ARCSEC_PER_RAD;
    if found > 0.0 {
        // Now that the play is known, without the rows inside it.
        let play_rad = prior.nominal.backlash_arcsec / flexspline_base::units::ARCSEC_PER_RAD + found;
        fitted = fit(
            settled(files, prior, &recorded, play_rad).sure(recorded.scales.friction_n_m, &recorded).less(prior),
            prior,
            &recorded,
            PartName::ALL,
        )?;
    }
    let Fitted { rows, folds, model, held_out, mut parts } = fitted;
    // No table is the simplest of all; a prior that is wrong may leave more than that even with parts beside it.
    let worthless = held_out.rms_after_arcsec >= held_out.rms_before_arcsec;
    if worthless || (model.chosen.is_empty() && prior.is_empty()) {
        let reasons: Vec<String> = parts.iter().map(|part| format!("{}: {}", part.name, part.why)).collect();
        let what = if model.chosen.is_empty() {
            "no part gains in what was left out"
        } else {
            "what was known before is further off than the parts mend in what was left out"
        };
        let alone = fitted_alone(&rows, &folds, &every_part(&folds));
        let zeros = (alone < ALONE * held_out.rms_after_arcsec).then(|| {
            format!(
                "; each log alone is fitted to {alone:.2}: do they share their zeros? Home the encoders in the same \
                 place before each log, or give one log alone"
            )
        });
        return Err(CalibrationError::NothingGained(format!(
            "{what}, so no table is better than none ({:.2} arcsec rms as measured, {:.2} with the table): {}{}",
            held_out.rms_before_arcsec,
            held_out.rms_after_arcsec,
            reasons.join("; "),
            zeros.unwrap_or_default()
        )));
    }
    let made = table::make(prior, &model, &recorded)?;
    let image = Table::check(&made.image).map_err(|error| TableError::Project(error.into()))?;
    let core = by_core(files, &image, &recorded);
    let fitted_alone = fitted_alone(&rows, &folds, &model.chosen);
    let mut notes: Vec<String> = files.iter().flat_map(|file| file.notes.iter().cloned()).collect();
    notes.extend(said);
    notes.extend(remarks(prior, &recorded, (&model, &parts), (held_out, fitted_alone)));
    sizes(&rows, &model, &mut parts);
    let zero = |row: &folds::Row| row.left_arcsec - model.adds_arcsec(&row.at);
    let mean = rows.rows.iter().map(zero).sum::<f64>() / rows.rows.len() as f64;
    let shown = rows
        .rows
        .iter()
        .zip(&rows.measured_arcsec)
        .map(|(row, measured)| [row.at.output_rad, *measured, zero(row) - mean])
        .collect();
    let known = Known::of(&rows.rows, &model, files.len())
        .ok_or_else(|| CalibrationError::Known("the information matrix of these rows is singular".to_owned()))?;
    let half_widths = rows.rows.iter().step_by(rows.rows.len().div_ceil(ROWS_OF_A_WIDTH).max(1));
    let (count, squares) = half_widths
        .fold((0.0, 0.0), |(count, squares), row| (count + 1.0, squares + known.half_width_arcsec(&row.at).powi(2)));
    let output_zeros = output_zeros(files, &rows, &model, known.noise);
    let calibration = Calibration {
        schema_version: 1,
        files: files.iter().map(|file| file.file.clone()).collect(),
        rows: rows.of,
        rows_fitted: rows.rows.len(),
        rows_unsettled: rows.unsettled,
        left_out: match rows.folds {
            FoldKind::Files => "files",
            FoldKind::Sessions => "sessions",
            FoldKind::Blocks => "blocks",
        },
        folds: folds.all().len(),
        held_out,
        core,
        parts,
        nodes: known.nodes(),
        noise: known.noise,
        half_width_arcsec: (squares / count).sqrt(),
        alignment,
        output_zeros,
        zero_cost: cost(&image),
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
    Ok(Calibrated { calibration, table: made, known, rows, recorded, shown })
}

/// All parts that may be fitted.
fn every_part(folds: &Folds) -> Vec<Chosen> {
    folds.parts().iter().map(|part| Chosen { part: *part, penalty: PENALTIES[0] }).collect()
}

/// What fits of some parts to each file alone leave in it, arcsec rms; infinite where files are not what is left out.
fn fitted_alone(rows: &Rows, folds: &Folds, chosen: &[Chosen]) -> f64 {
    if rows.folds != FoldKind::Files {
        return f64::INFINITY;
    }
    let squares: f64 = folds.all().into_iter().map(|fold| folds.left_in(fold, &[fold], chosen)).sum();
    (squares / rows.rows.len() as f64).sqrt()
}

/// What keeps a table from being made, with what was noticed of the units and signs of the logs.
fn with_faults(error: CalibrationError, files: &[Recording]) -> CalibrationError {
    let faults = files.iter().flat_map(|file| &file.faults).filter(|fault| fault.name == FaultName::UnitMismatch);
    let faults: Vec<&str> = faults.map(|fault| fault.what.as_str()).collect();
    match error {
        CalibrationError::Table(error) if !faults.is_empty() => {
            CalibrationError::Known(format!("{error}; of the logs: {}", faults.join("; ")))
        }
        other => other,
    }
}

/// Load below which the direction decides the flank beside a table, N·m: its own dead zone, unless rows with loads
/// between it and that of a drive with the usual friction say otherwise; with the rows less what the table says so.
fn dead_zone(rows: Rows, prior: &Prior<'_>, table: &Table<'_>, recorded: &Recorded) -> (Rows, f64) {
    let (own, usual) = (dead_zone_n_m(table), recorded.scales.friction_n_m);
    let less = |rows: Rows, least_friction_n_m: f64| rows.less(&Prior { least_friction_n_m, ..prior.clone() });
    if own <= 0.0 || own >= usual {
        let larger = own.max(usual);
        return (less(rows, larger), larger);
    }
    // A row on a flank that the noise of its torque has drawn would move the mean of its file, and with it all others.
    let sure = rows.clone().sure(own, recorded).sure(usual, recorded);
    let noise = CLEAR_OF_NOISE * recorded.torque_noise_n_m;
    let between = own + noise..usual - noise;
    let left = |friction_n_m: f64| -> Vec<f64> {
        let rows = less(sure.clone(), friction_n_m).rows.into_iter();
        rows.filter(|row| between.contains(&row.at.torque_n_m.abs())).map(|row| row.left_arcsec.powi(2)).collect()
    };
    let (by_own, by_usual) = (left(own), left(usual));
    let other =
        by_own.len() >= FEWEST_ROWS && by_usual.iter().sum::<f64>() < OTHER_DEAD_ZONE * by_own.iter().sum::<f64>();
    let chosen = if other { usual } else { own };
    (less(rows, chosen), chosen)
}

/// The zero of the output in each file.
fn output_zeros(files: &[Recording], rows: &Rows, model: &Model, noise: Noise) -> Vec<OutputZero> {
    let mut sums = vec![(0.0, 0.0); files.len()];
    for row in &rows.rows {
        sums[row.zero].0 += row.left_arcsec - model.adds_arcsec(&row.at);
        sums[row.zero].1 += 1.0;
    }
    let zero = |((file, (sum, count)), mean): ((&Recording, (f64, f64)), &f64)| OutputZero {
        file: file.file.clone(),
        arcsec: mean + sum / f64::max(count, 1.0),
        half_width_arcsec: interval::OF_95 * (noise.of_a_row() / f64::max(count, 1.0)).sqrt(),
    };
    files.iter().zip(sums).zip(&rows.means_arcsec).map(zero).collect()
}

struct Fitted {
    rows: Rows,
    folds: Folds,
    model: Model,
    held_out: HeldOut,
    parts: Vec<PartSays>,
}

/// Chooses and fits parts to the rows that are outside of a play.
fn fit(
    rows: Rows,
    prior: &Prior<'_>,
    recorded: &Recorded,
    parts: impl IntoIterator<Item = PartName>,
) -> Result<Fitted, CalibrationError> {
    if rows.rows.len() < FEWEST_ROWS {
        return Err(CalibrationError::TooFew(rows.rows.len()));
    }
    let may = |part: &PartName| recorded.lacks(*part, prior).is_none();
    let mut open: Vec<PartName> = parts.into_iter().filter(may).collect();
    let own_zero = rows.folds == FoldKind::Files;
    let mut backwards = false;
    // Once more where the play has to go: without it the flanks are sound.
    loop {
        let folds = Folds::new(&rows.rows, &open, &recorded.scales, rows.means_arcsec.len(), own_zero);
        let all = folds.all();
        let left = nested(&folds);
        let path = path(&folds, &all);
        // The fewest parts that leave least where neither choice nor fit was made.
        let most = (0..path.len()).min_by(|a, b| left[*a].total_cmp(&left[*b])).unwrap_or(0);
        let chosen = pruned(&folds, &all, path[most].clone());
        let zeros = if own_zero { 0 } else { rows.means_arcsec.len() };
        let coefficients = folds.fit(&all, &chosen).unwrap_or_default().split_off(zeros);
        let mut model = Model { chosen, coefficients, scales: recorded.scales };
        if !model.has_sound_flanks(0.5 * prior.nominal.backlash_arcsec) && !backwards {
            open.retain(|part| *part != PartName::Play);
            backwards = true;
            continue;
        }
        let count = rows.rows.len() as f64;
        let rms = |squares: f64| (squares / count).sqrt();
        let held_out = HeldOut {
            rms_before_arcsec: rms(rows.measured_arcsec.iter().map(|e| e * e).sum()),
            rms_prior_arcsec: rms(folds.left_out(&all, &[])),
            rms_after_arcsec: rms(left[most]),
        };
        let parts = judged(&folds, &model, recorded, prior, backwards);
        return Ok(Fitted { rows, folds, model, held_out, parts });
    }
}

/// What is said of each part.
fn judged(folds: &Folds, model: &Model, recorded: &Recorded, prior: &Prior<'_>, backwards: bool) -> Vec<PartSays> {
    let all = folds.all();
    let before = folds.left_out(&all, &[]);
    let with = folds.left_out(&all, &model.chosen);
    let says = |part: PartName| {
        let refused = |gain: Option<f64>, why: String| PartSays {
            name: part.as_str(),
            kept: false,
            held_out_gain: gain,
            penalty: None,
            size_arcsec: None,
            why,
        };
        if let Some(why) = recorded.lacks(part, prior) {
            return refused(None, why);
        }
        if part == PartName::Play && backwards {
            return refused(None, "it would put the flanks on the wrong sides".to_owned());
        }
        if let Some(chosen) = model.chosen.iter().find(|chosen| chosen.part == part) {
            let others: Vec<Chosen> = model.chosen.iter().copied().filter(|other| other.part != part).collect();
            let gain = (folds.left_out(&all, &others) - with) / before;
            return PartSays {
                name: part.as_str(),
                kept: true,
                held_out_gain: Some(gain),
                penalty: Some(chosen.penalty),
                size_arcsec: None,
                why: format!(
                    "without it the error where nothing was fitted is {:.2} times as large",
                    ((gain * before + with) / with).sqrt()
                ),
            };
        }
        let (_, left) = best_penalty(folds, &all, &model.chosen, Chosen { part, penalty: 0.0 });
        let gain = (with - left) / before;
        let share = (with - left) / with;
        let why = if share > LEAST_GAIN {
            "it gains in the rows it was chosen on, not where it was not".to_owned()
        } else {
            format!(
                "it would take {:.1} % of the squares that the others leave; {:.0} % are asked for",
                100.0 * share,
                100.0 * LEAST_GAIN
            )
        };
        refused(Some(gain), why)
    };
    PartName::ALL.into_iter().map(says).collect()
}

/// Half of peak to peak of each part over the rows.
fn sizes(rows: &Rows, model: &Model, parts: &mut [PartSays]) {
    for chosen in &model.chosen {
        let alone = Model {
            chosen: vec![*chosen],
            coefficients: model.of(chosen.part).map_or_else(Vec::new, |of| model.coefficients[of].to_vec()),
            scales: model.scales,
        };
        let (least, most) = least_and_most(rows.rows.iter().map(|row| alone.adds_arcsec(&row.at)));
        if let Some(part) = parts.iter_mut().find(|part| part.name == chosen.part.as_str()) {
            part.size_arcsec = Some(0.5 * (most - least));
        }
    }
}

/// The core over all rows of the logs.
fn by_core(files: &[Recording], table: &Table<'_>, recorded: &Recorded) -> ByCore {
    let (mut before, mut after, mut rows) = (0.0, 0.0, 0);
    for file in files {
        let about = |values: Vec<f64>| {
            let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
            values.iter().map(|value| (value - mean).powi(2)).sum::<f64>()
        };
        let measured: Vec<f64> = file
            .sessions
            .iter()
            .flat_map(|session| session.error_rad.iter().map(|rad| rad * flexspline_base::units::ARCSEC_PER_RAD))
            .collect();
        let left = file.sessions.iter().flat_map(|session| left_by_core(table, session, recorded.temperature_c));
        rows += measured.len();
        before += about(measured);
        after += about(left.collect());
    }
    let rms = |squares: f64| (squares / rows.max(1) as f64).sqrt();
    ByCore { rms_before_arcsec: rms(before), rms_after_arcsec: rms(after), rows }
}

/// What whoever uses the table has to know.
fn remarks(
    prior: &Prior<'_>,
    recorded: &Recorded,
    (model, parts): (&Model, &[PartSays]),
    (held_out, fitted_alone): (HeldOut, f64),
) -> Vec<String> {
    let mut remarks = Vec::new();
    let has = |part: PartName| model.chosen.iter().any(|chosen| chosen.part == part);
    if prior.nominal.teeth.is_none() && prior.table.is_none() {
        let teeth = prior.nominal.teeth_or_of_two_waves();
        remarks.push(format!(
            "the ratio alone was given: the table is marked with {} and {} teeth, two waves",
            teeth.flexspline, teeth.circular_spline
        ));
    }
    if model.chosen.is_empty() {
        remarks.push(
            "no part gains in what was left out: the table is what was known before, its zeros aside; are the logs of \
             this unit, and of one?"
                .to_owned(),
        );
    }
    if recorded.output_share < 1.0 && has(PartName::OutputAngle) {
        remarks.push(format!(
            "{:.0} % of an output turn was recorded: in the rest the curve over the output angle is the smoothest \
             that joins its ends, and not measured",
            100.0 * recorded.output_share
        ));
    }
    if recorded.lacks(PartName::Play, prior).is_some() {
        remarks.push("one direction was recorded: after a reversal the table says nothing new of the play".to_owned());
    }
    if fitted_alone < ALONE * held_out.rms_after_arcsec {
        remarks.push(format!(
            "each log alone is fitted to {fitted_alone:.2} arcsec, and left with {:.2} by the others: they do not \
             seem to share their zeros; home the encoders in the same place before each log, or give one log alone",
            held_out.rms_after_arcsec
        ));
    }
    if has(PartName::OutputAngle) && parts.iter().any(|part| part.name == "wind_up" && part.held_out_gain.is_some()) {
        remarks.push(
            "a load that turns with the output (the weight of an arm) and an eccentric encoder look alike here: the \
             table holds for the loads of these logs"
                .to_owned(),
        );
    }
    remarks
}

#[cfg(test)]
mod tests;
