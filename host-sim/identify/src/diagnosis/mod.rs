//! Diagnosis: what the nominal model gets wrong in measured data, which physical cause explains it, and what the
//! extension gains.
//!
//! The order of work:
//! 1. `rows`, `base`: the nominal prediction on the data's own excitation, its parameters floating within the
//!    unit-to-unit spread.
//! 2. `prepare`, `noise`: white noise and wander, found with everything explainable taken out; data and columns made
//!    white.
//! 3. `candidate`: causes as laws, re-simulated; deviations without a name beside them.
//! 4. `select`: forward, backward; evidence, size, sessions left out.
//! 5. `rivals`: every rival refitted; look-alikes.
//! 6. `remainder`: lines and steps left; abstention.
//! 7. `verdict`: which causes may be named, with parameters, uncertainty, and the gain on sessions left out (`report`).
//!
//! Every decision on the way is in the `trace`; `explain` says from it why a cause was named or not.

pub mod base;
pub(crate) mod candidate;
pub(crate) mod channels;
mod experiment;
pub mod explain;
mod extended;
mod hanging;
mod held_out;
pub(crate) mod model;
pub(crate) mod noise;
pub mod pipeline;
pub(crate) mod prepare;
mod products;
pub(crate) mod remainder;
pub mod report;
mod resolution;
pub(crate) mod rivals;
pub mod rows;
pub(crate) mod select;
#[cfg(test)]
mod tests;
mod thinned;
pub(crate) mod thresholds;
pub mod trace;
mod uncertainty;
mod verdict;
mod with_speed;
mod zeros;

use flexspline::Table;
use thiserror::Error;

use crate::causes::CauseName;
use crate::measurement::Session;
use crate::nominal::Nominal;
use candidate::{Excitation, Label, Law, LawUnits, index_step, library, line, unnamed};
pub use explain::Explanation;
pub(crate) use extended::nominal_arcsec;
pub use extended::{Extended, FittedCause, FittedLaw, Series, added_by};
use model::{Problem, Term, among_each_other, terms_at};
use noise::Noise;
pub use pipeline::{
    Diagnosed, DiagnosisFile, Extension, Made, PipelineError, Subject, WrittenTable, diagnose_rows, parse_rows,
};
use prepare::FreeColumns;

pub use report::{Cause, Compensation, Diagnosis, HeldOut, Parameter, Residual, Unexplained, Verdict};
use resolution::hidden_by_averages;
use rows::Rows;
use select::{Bests, Chooser, Scope, Selected};
use thinned::Thinned;
pub(crate) use trace::{Gate, Judged, Stage, Trace};

/// Why data cannot be diagnosed.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum DiagnosisError {
    /// Too few rows.
    #[error("{found} rows, allowed: at least {needed}")]
    TooFewRows {
        /// Rows.
        found: usize,
        /// Least number.
        needed: usize,
    },
    /// The numbers do not allow a fit.
    #[error("the data allow no fit: angles, errors, torques and temperatures have to be finite")]
    NotFinite,
}

/// Settings of a diagnosis.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// Radius of the pitch circle of the output, mm: turns arc-seconds into micrometres.
    pub pitch_radius_mm: f64,
    /// A cause that is asked about: if it is not named, what to record to tell it from those that are is looked for.
    pub asked: Option<CauseName>,
    /// Causes that are not considered: somebody knows that they are not there, or wants to see what the rows say then.
    pub without: &'a [CauseName],
}

/// How finely rows are looked at, and the noise in them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Rows to an average.
    pub stride: usize,
    /// Noise of a row.
    pub noise: Noise,
    /// Worth of the information, at most 1.
    pub worth: f64,
}

impl Default for Settings<'_> {
    fn default() -> Self {
        Settings { pitch_radius_mm: 48.7, asked: None, without: &[] }
    }
}

/// Rows needed at least. *Guess*: several for each of some dozen columns.
pub(crate) const LEAST_ROWS: usize = 200;
/// Averages of rows that fits are made on, about.
const AVERAGES: usize = 12_000;
/// Times that causes are chosen again, at most.
const MOST_ROUNDS: usize = 2;
/// Diagnoses sessions against a nominal model, or against a table of the FEM that takes its place in the prediction;
/// gives the model that was found as well, to predict other rows with.
///
/// `progress(done, of, what)` is told how far it is.
///
/// # Errors
/// Too few rows; numbers that are not finite.
pub fn diagnose(
    sessions: &[Session],
    nominal: &Nominal,
    table: Option<&Table<'_>>,
    settings: &Settings<'_>,
    mut progress: impl FnMut(usize, usize, &str),
) -> Result<(Diagnosis, Extended), DiagnosisError> {
    let rows = Rows::new(sessions, nominal);
    check(&rows)?;
    progress(0, 4, "nominal model");
    let (base, jumps) = prepare::base(&rows, nominal, table);
    let scales = LawUnits::new(&rows, settings.pitch_radius_mm, jumps);
    let on = Excitation::new(&rows, nominal, &base, &scales);
    progress(1, 4, "causes");
    let (search, trace) = Search::new(&on, settings)?;
    progress(2, 4, "rivals");
    let problem = &search.problem;
    let noise = problem.fineness.noise;
    let terms = terms_at(problem, &search.laws, &search.start);
    let selected = Selected::of(problem, terms).ok_or(DiagnosisError::NotFinite)?;
    let maps = candidate::maps(&on);
    let mut left = remainder::of_maps(problem, &selected, &maps, noise.white);
    let fast = search.fast.iter();
    let fast = fast.map(|(label, size)| Unexplained { looks_like: label.to_string(), size_arcsec: *size });
    left.extend(fast.filter(|line| line.size_arcsec > select::least_size(noise.white)));
    left.extend(remainder::beyond_noise(problem, &selected, noise));
    let on_sample = search
        .thinned
        .as_ref()
        .map(|thinned| (thinned.problem(&on, &problem.uncertain, problem.fineness), thinned.share));
    let mut diagnosis = verdict::conclude(&search, &selected, &on_sample, left, settings, trace);
    diagnosis.set_aside = prepare::too_few_left(problem, diagnosis.finding);
    let is_named = |cause: CauseName| diagnosis.causes.iter().any(|named| named.name == cause);
    let kept = selected.terms.into_iter().filter(|term| term.law.cause().is_none_or(is_named)).collect();
    let selected = Selected::of(problem, among_each_other(problem, kept)).ok_or(DiagnosisError::NotFinite)?;
    let extended = Extended::of(problem, &selected).ok_or(DiagnosisError::NotFinite)?;
    Ok((diagnosis, extended))
}

/// Whether rows can be diagnosed at all.
fn check(rows: &Rows) -> Result<(), DiagnosisError> {
    if rows.count_used() < LEAST_ROWS {
        return Err(DiagnosisError::TooFewRows { found: rows.count_used(), needed: LEAST_ROWS });
    }
    let finite = |column: &[f64]| column.iter().all(|v| v.is_finite());
    if ![&rows.generator, &rows.error, &rows.torque, &rows.temperature, &rows.time].into_iter().all(|c| finite(c)) {
        return Err(DiagnosisError::NotFinite);
    }
    Ok(())
}

/// Laws chosen, the noise they leave, and what they were chosen on.
struct Search<'a> {
    laws: Vec<Law>,
    problem: Problem<'a>,
    /// A sample of the rows, where they are many.
    thinned: Option<Thinned>,
    /// Index and places of each law chosen.
    start: Places,
    /// Where each law was at its best.
    bests: Bests,
    /// Lines too fast for averages, with their sizes, arcsec.
    fast: Vec<(Label, f64)>,
}

impl<'a> Search<'a> {
    /// Searches, with every decision on the way.
    fn new(on: &Excitation<'a>, settings: &Settings<'_>) -> Result<(Search<'a>, Trace), DiagnosisError> {
        let mut laws = library(on);
        laws.extend(unnamed(on));
        laws.retain(|law| law.cause().is_none_or(|cause| !settings.without.contains(&cause)));
        let mut trace = Trace::default();
        for cause in CauseName::ALL {
            if let Some(need) = on.lacks(cause) {
                trace.decided(Stage::Data, cause.into(), None, vec![Judged::plain(Gate::Needs(need), false)]);
            }
        }
        // Rows to an average that leave about as many averages as asked for, unless they hide something.
        let usual = (on.rows.count_used() / AVERAGES).max(1);
        let (mut stride, mut free): (usize, Option<FreeColumns>) = (usual, None);
        let (mut hung, mut explained) = (vec![false; on.rows.len()], vec![0.0; on.rows.len()]);
        let mut uncertain = prepare::uncertain(on, &[], &hung);
        let (mut fast, mut start, mut bests) = (Vec::new(), Places::new(), Bests::default());
        let mut last: Option<(Problem<'a>, Option<Thinned>)> = None;
        let (mut new_line, mut other_rows) = (false, false);
        // Again where a line was found that no law has, or where what was taken for noise turned out to be a cause.
        for round in 0..=MOST_ROUNDS {
            // What was large may have hidden what is fast.
            let hidden = hidden_by_averages(on, &laws, &uncertain, usual, &explained);
            let closer_look = hidden.is_some() && stride > 1;
            if closer_look {
                (stride, free) = (1, None);
            }
            let free_now = free.get_or_insert_with(|| FreeColumns::of(on, &laws, stride));
            explained.iter_mut().zip(hidden.iter().flatten()).for_each(|(sum, fast)| *sum += fast);
            let before = last.as_ref().map(|(problem, _)| problem.fineness.noise);
            let explained_now: &[f64] = if new_line { &[] } else { &explained };
            let (noise, worth) = prepare::noise(on, free_now, explained_now, &uncertain);
            let as_before = |before: Noise| (0.85..1.18).contains(&(noise.floor() / before.floor()));
            if !new_line && !other_rows && !closer_look && before.is_some_and(as_before) {
                break;
            }
            if new_line {
                start.clear();
            }
            let problem = Problem::new(*on, &uncertain, Fineness { stride, noise, worth });
            let thinned = Thinned::of(on, stride);
            let mut scope = Scope::Everything;
            if let Some(thinned) = &thinned {
                let sample = thinned.problem(on, &uncertain, problem.fineness);
                choose(&sample, &laws, &mut start, (&mut bests, scope, &mut trace))?;
                scope = Scope::CameClose;
            }
            let selected = choose(&problem, &laws, &mut start, (&mut bests, scope, &mut trace))?;
            fast.clear();
            if round < MOST_ROUNDS {
                let mut slow = Vec::new();
                for line in remainder::lines(&problem, &selected, noise) {
                    let (label, size_arcsec) = (Label::Line { per: line.per, order: line.order }, line.size_arcsec);
                    if remainder::averaged_away(&problem, &line) {
                        fast.push((label, size_arcsec));
                    } else if laws.iter().all(|law| law.label != label) {
                        slow.push(line);
                    }
                }
                explained = remainder::explained(&problem, &selected);
                // What hung once hung, whatever is taken for it later.
                for (hung, hangs) in hung.iter_mut().zip(hanging::hanging(on, &explained, noise.white)) {
                    *hung |= hangs;
                }
                let doubtful = prepare::uncertain(on, &selected.terms, &hung);
                let step = remainder::step(&problem, &selected, (&explained, &doubtful), noise.white);
                drop(selected);
                let pairs = || doubtful.iter().zip(&uncertain);
                let hangs = pairs().zip(&hung).any(|((after, before), hung)| *hung && *after && !before);
                other_rows = hangs || pairs().filter(|(a, b)| a != b).count() > on.rows.len() / 200;
                uncertain = doubtful;
                let step = step.map(|(session, at)| index_step(session, at));
                let step = step.filter(|step| laws.iter().all(|law| law.label != step.label));
                let more: Vec<Law> = slow.iter().map(|found| line(found.per, found.order)).chain(step).collect();
                new_line = !more.is_empty();
                if new_line {
                    laws.extend(more);
                    free = None;
                }
            }
            last = Some((problem, thinned));
        }
        let (problem, thinned) = last.ok_or(DiagnosisError::NotFinite)?;
        Ok((Search { laws, problem, thinned, start, bests, fast }, trace))
    }
}

/// Index and places of laws.
type Places = Vec<(usize, Vec<f64>)>;

/// Chooses causes among laws, beginning at `start`, which is then where those chosen are.
fn choose<'l>(
    problem: &Problem<'_>,
    laws: &'l [Law],
    start: &mut Places,
    (bests, scope, trace): (&mut Bests, Scope, &mut Trace),
) -> Result<Selected<'l>, DiagnosisError> {
    let least = select::least_size(problem.fineness.noise.white);
    let chooser = Chooser { problem, laws, least, bests, scope, trace };
    let selected = chooser.select(terms_at(problem, laws, start)).ok_or(DiagnosisError::NotFinite)?;
    *start = remembered(laws, &selected.terms);
    Ok(selected)
}

/// Which laws were selected, and where.
fn remembered(laws: &[Law], terms: &[Term<'_>]) -> Places {
    terms
        .iter()
        .filter_map(|t| Some((laws.iter().position(|law| std::ptr::eq(law, t.law))?, t.places.clone())))
        .collect()
}
