//! Diagnosis: what the nominal model gets wrong in measured data, which physical cause explains it, and what the
//! extension gains.
//!
//! The order of work:
//! 1. `rows`, `base`: the nominal prediction on the data's own excitation, its parameters floating within the
//!    unit-to-unit spread.
//! 2. `prepare`, `noise`: white noise and wander, found with everything explainable taken out; data and columns made
//!    white.
//! 3. `candidate`: causes as laws, re-simulated; deviations without a name beside them.
//! 4. `select`: forward, backward, exchange; evidence, size, sessions left out.
//! 5. `rivals`: every rival refitted; look-alikes.
//! 6. `remainder`: lines and steps left; abstention.
//! 7. `verdict`: which causes may be named, with parameters, uncertainty, and the gain on sessions left out (`report`).
//!
//! Every decision on the way is in the `trace`; `explain` says from it why a cause was named or not.

mod averaged;
pub mod base;
pub(crate) mod candidate;
pub(crate) mod channels;
mod experiment;
pub mod explain;
mod extended;
mod flank_lag;
mod hanging;
mod held_out;
pub(crate) mod model;
pub(crate) mod noise;
pub mod pipeline;
pub(crate) mod prepare;
mod products;
mod quieted;
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
mod torque_zero;
pub mod trace;
mod uncertainty;
mod verdict;
mod with_speed;
mod zeros;

use std::collections::HashSet;
use std::sync::Arc;

use flexspline::Table;
use thiserror::Error;

use crate::causes::CauseName;
use crate::measurement::Session;
use crate::nominal::Nominal;
use averaged::Averaged;
use candidate::{Excitation, Label, Law, LawUnits, library, line, unnamed};
pub use explain::Explanation;
pub(crate) use extended::nominal_arcsec;
pub use extended::{Extended, FittedCause, FittedLaw, Series, added_by};
use model::{Problem, Term, terms_at};
use noise::Noise;
pub use pipeline::{
    Diagnosed, DiagnosisFile, Extension, Made, MakeTable, Options, PipelineError, Subject, WrittenTable, diagnose_rows,
    parse_rows, read_rows,
};
use prepare::FreeColumns;
pub use report::{Cause, Compensation, Diagnosis, HeldOut, Parameter, Residual, Unexplained, Verdict};
use remainder::SpectralLine;
use resolution::hidden_by_averages;
use rows::Rows;
use select::{Bests, Chooser, Scope, Selected};
use thinned::{SampleToFit, Thinned};
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
    /// Averages of rows that fits are made on, about.
    pub averages: usize,
    /// Says on stderr what is tried.
    pub verbose: bool,
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
        Settings { pitch_radius_mm: 48.7, averages: 12_000, verbose: false, asked: None, without: &[] }
    }
}

/// Rows needed at least. *Guess*: several for each of some dozen columns.
pub(crate) const LEAST_ROWS: usize = 200;
/// Times that causes are chosen again, at most.
const MOST_ROUNDS: usize = 2;
/// Diagnoses sessions against a nominal model, or against a table of the FEM that takes its place in the prediction.
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
    progress: impl FnMut(usize, usize, &str),
) -> Result<Diagnosis, DiagnosisError> {
    diagnose_extended(sessions, nominal, table, settings, progress).map(|(diagnosis, _)| diagnosis)
}

/// Diagnoses, and gives the model that was found, to predict other rows with.
///
/// # Errors
/// As [`diagnose`].
pub(crate) fn diagnose_extended(
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
    let Problem { noise, worth, whitener, .. } = &search.problem;
    let (problem, fineness) = (&search.problem, Fineness { stride: whitener.stride, noise: *noise, worth: *worth });
    let terms = terms_at(problem, &search.laws, &search.start);
    let selected = Selected::of(problem, terms).ok_or(DiagnosisError::NotFinite)?;
    let mut start = remembered(&search.laws, &selected.terms);
    let maps = candidate::maps(&on);
    let mut left = remainder::of_maps(problem, &selected, &maps, noise.white);
    let fast = search.fast.iter();
    let fast = fast.map(|(label, size)| Unexplained { looks_like: label.to_string(), size_arcsec: *size });
    left.extend(fast.filter(|line| line.size_arcsec > select::least_size(noise.white)));
    left.extend(remainder::beyond_noise(problem, &selected, *noise));
    for (k, term) in selected.terms.iter().enumerate() {
        let (label, [main, nuisance, beside]) = (term.law.label, select::parts(term, selected.fit.of(k)));
        trace.say(&format_args!("{label}: law {main:.2}, deviations {nuisance:.2}, beside {beside:.2} arcsec"));
    }
    for something in &left {
        trace.say(&format_args!("left: {}, {:.2} arcsec", something.looks_like, something.size_arcsec));
    }
    let sample = search.thinned.as_ref();
    let sample =
        sample.map(|thinned| (SampleToFit::new(&on, thinned, &problem.uncertain, fineness.stride), thinned.share));
    let on_sample = sample.as_ref().map(|(sample, share)| (sample.problem(*noise, *worth), *share));
    let on_sample = on_sample.as_ref().map(|(sample, share)| (sample, *share));
    let mut diagnosis = verdict::conclude(&search, &selected, on_sample, left, settings, trace);
    diagnosis.set_aside = prepare::too_few_left(problem, diagnosis.finding);
    drop(selected);
    let is_named = |cause: CauseName| diagnosis.causes.iter().any(|named| named.name == cause);
    start.retain(|(law, _)| search.laws[*law].cause().is_none_or(is_named));
    let Search { problem, laws, .. } = search;
    let extended = Extended::of(&problem, laws, &start, fineness).ok_or(DiagnosisError::NotFinite)?;
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
    fn new(on: &'a Excitation<'a>, settings: &Settings<'_>) -> Result<(Search<'a>, Trace), DiagnosisError> {
        let mut laws = library(on);
        laws.extend(unnamed(on));
        laws.retain(|law| law.cause().is_none_or(|cause| !settings.without.contains(&cause)));
        let mut trace = Trace::new(settings.verbose);
        for cause in CauseName::ALL {
            if let Some(need) = on.lacks(*cause) {
                trace.decided(Stage::Data, (*cause).into(), None, vec![Judged::plain(Gate::Needs(need), false)]);
            }
        }
        let mut hung = vec![false; on.rows.len()];
        let mut uncertain = prepare::uncertain(on, &[], &hung);
        // Rows to an average that leave about as many averages as asked for, unless they hide something.
        let usual = (on.rows.count_used() / settings.averages).max(1);
        let at_first = hidden_by_averages(on, &laws, &uncertain, usual, &[]);
        let mut stride = if at_first.is_some() { 1 } else { usual };
        let mut averaged = Averaged::of(on, stride).map(Arc::new);
        let mut free = FreeColumns::of(on, &laws, averaged.clone());
        let (mut noise, mut worth) = prepare::noise(on, &free, at_first.as_deref().unwrap_or(&[]), &uncertain, None);
        say_noise(&trace, noise, worth);
        let mut problem = Problem::new(on, &uncertain, Fineness { stride, noise, worth }, averaged.clone());
        let mut fast: Vec<(Label, f64)> = Vec::new();
        let mut start = Places::new();
        let mut bests = Bests::default();
        let mut thinned = Thinned::of(on, stride);
        // Again where a line was found that no law has, or where what was taken for noise turned out to be a cause.
        for round in 0..=MOST_ROUNDS {
            fast.clear();
            let mut scope = Scope::Everything;
            if let Some(thinned) = &thinned {
                let sample = SampleToFit::new(on, thinned, &uncertain, stride);
                choose(&sample.problem(noise, worth), &laws, &mut start, (&mut bests, scope, &mut trace))?;
                scope = Scope::CameClose;
            }
            let selected = choose(&problem, &laws, &mut start, (&mut bests, scope, &mut trace))?;
            if round == MOST_ROUNDS {
                break;
            }
            let (hidden, slow): (Vec<SpectralLine>, Vec<SpectralLine>) = remainder::lines(&problem, &selected, noise)
                .into_iter()
                .partition(|line| remainder::averaged_away(&problem, line));
            for line in hidden {
                let label = Label::Line { per: line.per, order: line.order };
                if fast.iter().all(|(known, _)| known.to_string() != label.to_string()) {
                    trace.say(&format_args!("{label}: {:.2} arcsec, too fast for averages", line.size_arcsec));
                    fast.push((label, line.size_arcsec));
                }
            }
            let mut explained = remainder::explained(&problem, &selected);
            // What hung once hung, whatever is taken for it later.
            for (hung, hangs) in hung.iter_mut().zip(hanging::hanging(on, &explained, noise.white)) {
                *hung |= hangs;
            }
            let doubtful = prepare::uncertain(on, &selected.terms, &hung);
            let hangs =
                doubtful.iter().zip(&uncertain).zip(&hung).any(|((after, before), hung)| *hung && *after && !before);
            drop(selected);
            let known = laws.len();
            for found in slow {
                let law = line(found.per, found.order);
                if laws.iter().all(|l| l.label != law.label) {
                    trace.say(&format_args!("{}: {:.2} arcsec", law.label, found.size_arcsec));
                    laws.push(law);
                }
            }
            let new_line = laws.len() > known;
            let changed = doubtful.iter().zip(&uncertain).filter(|(a, b)| a != b).count();
            let other_rows = changed > on.rows.len() / 200 || hangs;
            uncertain = doubtful;
            // What was large may have hidden what is fast.
            let hidden = hidden_by_averages(on, &laws, &uncertain, usual, &explained);
            let closer_look = hidden.is_some() && stride > 1;
            if closer_look {
                stride = 1;
                averaged = Averaged::of(on, stride).map(Arc::new);
                thinned = Thinned::of(on, stride);
            }
            if closer_look || !free.are_of(&laws) {
                free = FreeColumns::of(on, &laws, averaged.clone());
            }
            explained.iter_mut().zip(hidden.iter().flatten()).for_each(|(sum, fast)| *sum += fast);
            let (again, worth_again) = {
                let explained: &[f64] = if new_line { &[] } else { &explained };
                prepare::noise(on, &free, explained, &uncertain, Some(noise))
            };
            let change = again.floor() / noise.floor();
            if !new_line && !other_rows && !closer_look && (0.85..1.18).contains(&change) {
                break;
            }
            if new_line {
                start.clear();
            }
            (noise, worth) = (again, worth_again);
            say_noise(&trace, noise, worth);
            problem = Problem::new(on, &uncertain, Fineness { stride, noise, worth }, averaged.clone());
        }
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
    let least = select::least_size(problem.noise.white);
    let chooser = Chooser { problem, laws, least, bests, scope, trace, given: HashSet::new() };
    let selected = chooser.select(terms_at(problem, laws, start)).ok_or(DiagnosisError::NotFinite)?;
    *start = remembered(laws, &selected.terms);
    Ok(selected)
}

/// Says which noise was found, and the information weight of the rows under it.
fn say_noise(trace: &Trace, Noise { white, wander, correlation_s }: Noise, weight: f64) {
    trace.say(&format_args!(
        "noise: white {white:.3}, drift {wander:.3} arcsec over {correlation_s:.1} s; information weight {weight:.2}"
    ));
}

/// Which laws were selected, and where.
fn remembered(laws: &[Law], terms: &[Term<'_>]) -> Places {
    terms
        .iter()
        .filter_map(|t| Some((laws.iter().position(|law| std::ptr::eq(law, t.law))?, t.places.clone())))
        .collect()
}
