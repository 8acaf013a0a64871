//! Measured data: rows of a drive at work, in sessions.
//!
//! Angles are radians, torque N·m, temperature °C, time s; `error` is output less generator over ratio, rad at the
//! output. All columns of a session have the same length; what was not recorded is `None`.
//!
//! [`parse`] takes a CSV file to sessions: columns and units by a [`ColumnMap`], wrapped angles made continuous, gaps
//! in time as the borders of sessions, and the faults of the data found, named and dealt with ([`Fault`]) before
//! anything is asked of the drive.

mod averages;
mod columns;
mod fault;
mod faults;
mod gear;
mod log;
mod phd2;
pub mod reader;
mod rollover;
mod unit;

use std::ops::Range;
use std::path::Path;

pub(crate) use columns::MappedColumn;
pub use columns::{ColumnMap, MappingError, Quantity, Reading, Unit};
pub use fault::{Fault, FaultName, Measures, Treatment};
use faults::clock::SESSION_GAP_PERIODS;
pub(crate) use faults::units::other_reading;
pub(crate) use faults::{HELD, LineFit, throughout, whole_pitches};
pub use flexspline_base::robust::{
    MAD_TO_STD, least_and_most, median_and_std, median_of, quantile_of, rms, sampled, white_noise,
};
pub use gear::Gear;
pub use log::{FEWEST_ROWS, MeasuredError};
pub use reader::{Layout, Separator, Sheet, raw};
pub(crate) use rollover::{Anew, begins_anew, continued, registers};
pub(crate) use unit::Family;

use crate::least_squares::FreeSpan;
use crate::misfit::correlation;
use faults::Findings;
use log::Log;
use raw::RawFile;

/// What is left of a load is noise, and no rounding, where it is this share of the load, … *Guesses*.
const NOISE: Range<f64> = 1e-5..0.05;
/// … and the error shows it by fewer than this many standard deviations. *Source*: by convention.
const CERTAIN: f64 = 5.0;
/// A torque is noise about no load where its white noise is this share of all of it. *Guess*.
const NOTHING_ELSE: f64 = 0.9;
/// Note on such a torque.
const SILENT: &str = "the torque is noise about zero in all rows, and the error shows nothing of it: it counts as not \
                      recorded; where there was no load, put 0 in its column";
/// More sessions than a person makes. *Guess*.
const MANY_SESSIONS: usize = 50;

/// The remedy for a file of which each channel has rows of its own.
pub(crate) const APART: &str = ": they are never recorded in one row; allowed: both in a row, in pandas: df[OUTPUT] = \
                                df.set_index(TIME)[OUTPUT].interpolate(\"index\").values";

/// Why rows, or a unit, are refused: what was found and what is allowed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Refusal(pub(crate) String);

/// Rows without a gap, in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Session {
    /// Line of the file that each row came from.
    pub line: Vec<u64>,
    /// Time, s.
    pub time_s: Option<Vec<f64>>,
    /// Generator angle, rad, unwrapped.
    pub generator_rad: Vec<f64>,
    /// Output angle less generator over ratio, rad.
    pub error_rad: Vec<f64>,
    /// Load torque at the output, N·m.
    pub torque_n_m: Option<Vec<f64>>,
    /// Temperature, °C.
    pub temperature_c: Option<Vec<f64>>,
    /// Angle of the drive against gravity about its axis, rad.
    pub orientation_rad: Option<Vec<f64>>,
    /// Noise of each row against that of a row of mean worth, where rows differ: the mean of its inverse square is 1.
    pub loudness: Option<Vec<f64>>,
    /// Whether the zero of the error is not that of the session before.
    pub own_zero: bool,
    /// Taken off the error, as its zero is that much off the zero of the first session, rad.
    pub zero_off_rad: f64,
    /// Time by which one angle may be read before the other on the mean, for all that is known of how they are read, s.
    pub unsure_s: f64,
    /// Step of the resolution at the output where no noise blurs it, rad; else 0.
    pub coarse_rad: f64,
}

impl Session {
    /// Rows that nobody has measured, without an error: their instants, angles of the generator, and torques,
    /// temperatures and orientations.
    pub(crate) fn imagined(time_s: Vec<f64>, generator_rad: Vec<f64>, others: [Vec<f64>; 3]) -> Session {
        let [torque_n_m, temperature_c, orientation_rad] = others.map(Some);
        Session {
            line: (2..).take(time_s.len()).collect(),
            error_rad: vec![0.0; time_s.len()],
            time_s: Some(time_s),
            generator_rad,
            torque_n_m,
            temperature_c,
            orientation_rad,
            ..Session::default()
        }
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.generator_rad.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.generator_rad.is_empty()
    }

    /// Output angle, rad.
    pub fn output_rad(&self, ratio: f64) -> Vec<f64> {
        self.generator_rad.iter().zip(&self.error_rad).map(|(generator, error)| generator / ratio + error).collect()
    }

    /// Counts the generator's angle from another zero; the output stays as it was read.
    pub(crate) fn turn_generator(&mut self, zero_rad: f64, ratio: f64) {
        self.generator_rad.iter_mut().for_each(|psi| *psi -= zero_rad);
        self.error_rad.iter_mut().for_each(|error| *error += zero_rad / ratio);
    }

    /// Generator angle (rad), torque (N·m; 0 if not recorded) and temperature (°C; `temperature_c` if not) row by row.
    pub(crate) fn states(&self, temperature_c: f64) -> impl Iterator<Item = [f64; 3]> {
        let at = |column: &Option<Vec<f64>>, k: usize, usual: f64| column.as_ref().map_or(usual, |values| values[k]);
        let state = move |(k, generator): (usize, &f64)| {
            [*generator, at(&self.torque_n_m, k, 0.0), at(&self.temperature_c, k, temperature_c)]
        };
        self.generator_rad.iter().enumerate().map(state)
    }

    /// With these lines, and each of its columns of numbers changed by `of`.
    fn each(&self, line: Vec<u64>, of: impl Fn(&[f64]) -> Vec<f64>) -> Session {
        let recorded = |values: &Option<Vec<f64>>| values.as_deref().map(&of);
        Session {
            line,
            generator_rad: of(&self.generator_rad),
            error_rad: of(&self.error_rad),
            time_s: recorded(&self.time_s),
            torque_n_m: recorded(&self.torque_n_m),
            temperature_c: recorded(&self.temperature_c),
            orientation_rad: recorded(&self.orientation_rad),
            loudness: recorded(&self.loudness),
            ..*self
        }
    }

    /// Some of its rows as a session.
    pub(crate) fn part(&self, rows: Range<usize>) -> Session {
        self.each(self.line[rows.clone()].to_vec(), |values| values[rows.clone()].to_vec())
    }
}

/// The generator must turn back by this angle, rad, before the flank is taken to have changed: its noise does not.
/// *Guess*: 1.1°, of which an output behind a ratio of 100 sees 41 arcsec.
pub(crate) const TURNED_BACK_RAD: f64 = 0.02;

/// Which way an angle last moved by more than `back`, 0 before it first did, and where it turned that way; row by row.
pub(crate) fn turns(angle: &[f64], back: f64) -> Vec<(f64, f64)> {
    let Some(&first) = angle.first() else { return Vec::new() };
    let (mut way, mut farthest, mut turned_at) = (0.0_f64, first, first);
    let turn = |angle: &f64| {
        let beyond = (angle - farthest) * if way == 0.0 { 1.0 } else { way };
        if way == 0.0 && beyond.abs() > back {
            (way, farthest) = (beyond.signum(), *angle);
        } else if way != 0.0 && beyond > 0.0 {
            farthest = *angle;
        } else if way != 0.0 && -beyond > back {
            (way, turned_at, farthest) = (-way, farthest, *angle);
        }
        (way, turned_at)
    };
    angle.iter().map(turn).collect()
}

/// +1 from where an angle last moved forward by more than its noise, -1 backward.
pub fn directions(angle: &[f64]) -> Vec<f64> {
    let turns = turns(angle, TURNED_BACK_RAD);
    // The first clear motion also holds for what comes before it.
    let first = turns.iter().map(|(way, _)| *way).find(|way| *way != 0.0).unwrap_or(1.0);
    turns.into_iter().map(|(way, _)| if way == 0.0 { first } else { way }).collect()
}

/// Where the cubic through four points has the abscissa 0.
pub(crate) fn cubic_at_zero(points: [(f64, f64); 4]) -> f64 {
    let weight = |x: f64| points.iter().filter(|(at, _)| *at != x).map(|(at, _)| at / (at - x)).product::<f64>();
    points.iter().map(|(x, value)| value * weight(*x)).sum()
}

/// The rows before and after row `k` of a session, or that row at its ends.
pub(crate) fn neighbours(session: &Range<usize>, k: usize) -> [usize; 2] {
    [k.max(session.start + 1) - 1, (k + 1).min(session.end - 1)]
}

/// Change of values per second, row by row, from the neighbours in a session; 0 where time stands.
pub(crate) fn rates(sessions: &[Range<usize>], time: &[f64], values: &[f64]) -> Vec<f64> {
    let mut rates = vec![0.0; values.len()];
    for session in sessions {
        for k in session.clone() {
            let [a, b] = neighbours(session, k);
            let passed = time[b] - time[a];
            rates[k] = if passed > 0.0 { (values[b] - values[a]) / passed } else { 0.0 };
        }
    }
    rates
}

/// A file of measured data, ready for use.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recording {
    /// Which file.
    pub file: String,
    /// Rows of the file, those left out among them.
    pub rows: usize,
    /// Sessions, none of them empty.
    pub sessions: Vec<Session>,
    /// Faults of the data.
    pub faults: Vec<Fault>,
    /// Notes that are no faults, one sentence each.
    pub notes: Vec<String>,
    /// Why nothing can be said of the drive from these rows, if so.
    pub unusable: Option<String>,
}

impl Recording {
    /// The same file with these sessions, none of its faults reported again.
    pub(crate) fn with_sessions(&self, sessions: Vec<Session>) -> Recording {
        let (file, unusable) = (self.file.clone(), self.unusable.clone());
        Recording { file, rows: self.rows, sessions, unusable, ..Recording::default() }
    }
}

/// The name of a file in messages, and its bytes.
///
/// # Errors
/// It cannot be read.
pub fn bytes_of(path: &Path) -> Result<(String, Vec<u8>), MeasuredError> {
    let file = path.display().to_string();
    match std::fs::read(path) {
        Ok(bytes) => Ok((file, bytes)),
        Err(_) if path.is_dir() => Err(MeasuredError::of_file(&file, &"found a folder; allowed: a file")),
        Err(error) => Err(MeasuredError::of_file(&file, &error)),
    }
}

/// Reads measured data of a drive with this `gear`: `bytes` of a file called `file`.
///
/// # Errors
/// They cannot be read.
pub fn parse(
    file: &str,
    bytes: impl Into<Vec<u8>>,
    columns: &ColumnMap,
    gear: &Gear,
) -> Result<Recording, MeasuredError> {
    parse_at_least(FEWEST_ROWS, file, bytes, columns, gear)
}

/// [`parse`] of a file of at least `fewest` rows.
pub(crate) fn parse_at_least(
    fewest: usize,
    file: &str,
    bytes: impl Into<Vec<u8>>,
    columns: &ColumnMap,
    gear: &Gear,
) -> Result<Recording, MeasuredError> {
    let refuse = |why: Refusal| MeasuredError::of_file(file, &why);
    if gear.ratio == 0.0 || !gear.ratio.is_finite() {
        let what = format!("ratio: found {}, allowed: a finite number other than zero", gear.ratio);
        return Err(refuse(Refusal(what)));
    }
    let mut findings = Findings::default();
    let (mut log, columns) = log::read(file, bytes.into(), columns, gear.ratio, fewest, &mut findings)?;
    let rows = log.len();
    let recorded = in_order(&mut log, &columns, &mut findings).map_err(refuse)?;
    enough(&log, &recorded, fewest).map_err(refuse)?;
    rollover::unwrap(&mut log, &columns, gear.ratio, &mut findings.notes);
    faults::leaps::check(&mut log, gear, &mut findings);
    faults::units::check(&mut log, &columns, gear, &mut findings).map_err(refuse)?;
    faults::leaps::between_sessions(&mut log, gear, &mut findings);
    faults::stalls::check(&mut log, gear, &mut findings);
    let mut log = log.with_error(gear.ratio);
    findings.notes.extend(many_sessions(&log));
    faults::held::check(&mut log, gear, &mut findings);
    faults::frozen::check(&mut log, gear, &mut findings).map_err(refuse)?;
    faults::held::check_coarse_torque(&mut log, &mut findings);
    faults::outliers::check(&mut log, gear, &mut findings);
    faults::reads::check(&mut log, gear, &mut findings);
    faults::resolution::check(&mut log, gear, &mut findings);
    let mut sessions = log.into_sessions();
    let silent = sessions.iter_mut().map(|session| load_without_noise(session, gear.ratio)).collect::<Vec<bool>>();
    if !silent.contains(&false) {
        sessions.iter_mut().for_each(|session| session.torque_n_m = None);
        findings.notes.push(SILENT.to_owned());
    }
    // Each session of a guide log, whose columns nobody maps, has its own zero.
    sessions.iter_mut().skip(1).for_each(|session| session.own_zero |= columns.is_empty());
    let Findings { mut faults, notes, .. } = findings;
    faults.sort_by_key(|fault| (fault.first_line, fault.name));
    Ok(Recording { file: file.to_owned(), rows, sessions, faults, notes, unusable: None })
}

/// A load that the angle of the output and the way of a motion make, as a weight does, is theirs alone where all else
/// of it is noise that the error does not show: a fit would take it for what tells a wind-up from waves of the output.
/// Gives whether it is nothing but noise.
fn load_without_noise(session: &mut Session, ratio: f64) -> bool {
    let Some(torque) = &mut session.torque_n_m else { return false };
    let wave = |of: fn(f64) -> f64| session.generator_rad.iter().map(|psi| of(psi / ratio)).collect();
    let of_angle = [vec![1.0; torque.len()], wave(f64::sin), wave(f64::cos), directions(&session.generator_rad)];
    let span = FreeSpan::default().beyond(of_angle);
    let noise = span.freed(torque.clone());
    let error = span.freed(session.error_rad.clone());
    let shown = correlation(&error, std::slice::from_ref(&noise)) * (noise.len() as f64).sqrt();
    let silent = shown < CERTAIN && white_noise([torque.as_slice()]) > NOTHING_ELSE * rms(torque);
    if shown < CERTAIN && NOISE.contains(&(rms(&noise) / rms(torque))) {
        torque.iter_mut().zip(noise).for_each(|(torque, noise)| *torque -= noise);
    }
    silent
}

/// Mends clock and holes of a log and leaves out the rows without an angle; how many had which angle.
///
/// # Errors
/// The time looks as if it were in another unit.
fn in_order(log: &mut Log, columns: &[MappedColumn], findings: &mut Findings) -> Result<String, Refusal> {
    faults::missing::fill(log, findings);
    faults::clock::check(log, columns, findings)?;
    let recorded = recorded(log);
    faults::missing::leave_out(log, findings);
    Ok(recorded)
}

/// The rows of a file as they are before anything is asked of the drive.
pub(crate) struct ReadRows {
    pub(crate) log: Log,
    /// Times as they are written, s; none without a time.
    pub(crate) stamps_s: Vec<f64>,
    /// Sentences on what was converted, mended or left out.
    pub(crate) notes: Vec<String>,
    /// Whether they are refused because their times, read as seconds, are milliseconds.
    pub(crate) milliseconds: bool,
}

impl ReadRows {
    /// The rows of a file by these columns, and why the reader refuses them, if it does: then what is no number is
    /// missing. `ratio` as far as it is known.
    pub(crate) fn of_raw(
        file: &RawFile,
        columns: &[MappedColumn],
        ratio: Option<f64>,
    ) -> (ReadRows, Option<MeasuredError>) {
        let cells = |column: &MappedColumn| file.columns.cells[column.place].clone();
        let read = file.columns.with_cells(columns.iter().map(cells).collect());
        let mut findings = Findings::default();
        let (mut log, refused) = log::of_columns(&file.sheet.layout, read, columns, None, 0, &mut findings);
        let stamps_s = log.get(Quantity::Time).map_or_else(Vec::new, <[f64]>::to_vec);
        let ordered = in_order(&mut log, columns, &mut findings);
        if log.len() > 1 {
            rollover::unwrap(&mut log, columns, ratio.unwrap_or(1.0), &mut findings.notes);
        }
        let Findings { faults, mut notes, milliseconds, .. } = findings;
        notes.extend(faults.into_iter().map(|fault| fault.what));
        let refused = refused.map(|problem| MeasuredError::at(&file.file, problem));
        let refused = refused.or(ordered.err().map(|why| MeasuredError::of_file(&file.file, &why)));
        (ReadRows { log, stamps_s, notes, milliseconds }, refused)
    }
}

/// How many rows have the angles, for whoever finds none that has both.
fn recorded(log: &Log) -> String {
    let follower = log.output_or_error();
    let has = |channel: Quantity, row: usize| log.get(channel).is_some_and(|values| values[row].is_finite());
    let count = |of: &dyn Fn(usize) -> bool| (0..log.len()).filter(|row| of(*row)).count();
    let (ours, theirs) = (count(&|row| has(Quantity::Generator, row)), count(&|row| has(follower, row)));
    let both = count(&|row| has(Quantity::Generator, row) && has(follower, row));
    let apart = if both == 0 && ours > 0 && theirs > 0 { APART } else { "" };
    format!("of {} rows {ours} have the generator, {theirs} the {follower}, {both} both{apart}", log.len())
}

/// Whether enough rows are left, and anything moves in them.
fn enough(log: &Log, recorded: &str, fewest: usize) -> Result<(), Refusal> {
    if log.len() < fewest {
        let rows = log.len();
        return Err(Refusal(format!("{rows} rows have all that is needed; at least {fewest} must ({recorded})")));
    }
    let constant = |channel| log.get(channel).is_some_and(|values| values.iter().all(|value| *value == values[0]));
    let follower = log.output_or_error();
    if constant(Quantity::Generator) && constant(follower) {
        return Err(Refusal(format!(
            "generator and {follower} keep one value throughout; at least one of them must change"
        )));
    }
    Ok(())
}

/// Note where the stamps part the rows into sessions of hardly any rows.
fn many_sessions(log: &Log) -> Option<String> {
    let (rows, sessions) = (log.len(), log.sessions().count());
    (sessions > MANY_SESSIONS && rows < FEWEST_ROWS * sessions).then(|| {
        format!(
            "{sessions} sessions of {} rows on the mean: time that steps by more than {SESSION_GAP_PERIODS} of its \
             usual steps, or back, begins one; are the stamps those of the rows?",
            rows / sessions
        )
    })
}

#[cfg(test)]
impl Recording {
    /// Made-up sessions, without a fault.
    pub(crate) fn made(file: &str, sessions: Vec<Session>) -> Recording {
        let rows = sessions.iter().map(Session::len).sum();
        let (faults, notes) = (Vec::new(), Vec::new());
        Recording { file: file.to_owned(), rows, sessions, faults, notes, unusable: None }
    }
}

#[cfg(test)]
impl Session {
    /// A row more: time (s), generator and error (rad), torque (N·m); a column that is not there gets none.
    pub(crate) fn push(&mut self, [time_s, generator_rad, error_rad, torque_n_m]: [f64; 4]) {
        self.line.push(self.len() as u64 + 2);
        self.generator_rad.push(generator_rad);
        self.error_rad.push(error_rad);
        self.time_s.iter_mut().for_each(|all| all.push(time_s));
        self.torque_n_m.iter_mut().for_each(|all| all.push(torque_n_m));
    }

    /// Leaves out the rows for which `drop` is true.
    pub(crate) fn leave_out(&mut self, drop: &[bool]) {
        *self = self.each(log::kept(&self.line, drop), |values| log::kept(values, drop));
    }
}

#[cfg(test)]
impl Log {
    /// Does something with made-up sessions as one log.
    pub(crate) fn on<T>(sessions: &mut [Session], check: impl FnOnce(&mut Log) -> T) -> T {
        let mut log = Log::default();
        for (number, session) in (0..).zip(&*sessions) {
            log.line.extend(&session.line);
            log.session.extend(vec![number; session.len()]);
        }
        let flat = |of: fn(&Session) -> Option<&Vec<f64>>| {
            Some(sessions.iter().filter_map(of).flatten().copied().collect()).filter(|all: &Vec<f64>| !all.is_empty())
        };
        for (channel, values) in [
            (Quantity::Time, flat(|s| s.time_s.as_ref())),
            (Quantity::Generator, flat(|s| Some(&s.generator_rad))),
            (Quantity::Error, flat(|s| Some(&s.error_rad))),
            (Quantity::Torque, flat(|s| s.torque_n_m.as_ref())),
        ] {
            values.into_iter().for_each(|values| log.put(channel, values));
        }
        let done = check(&mut log);
        sessions.iter_mut().zip(log.into_sessions()).for_each(|(session, after)| *session = after);
        done
    }
}
