//! Diagnosis: what the nominal model gets wrong in measured data, which physical cause explains it, and what the extension gains.
//!
//! The order of work:
//! 1. [`rows`], [`base`]: the nominal prediction on the data's own excitation, its parameters floating within the unit-to-unit spread.
//! 2. [`prepare`], [`noise`]: white noise and wander, found with everything explainable taken out; data and columns made white.
//! 3. [`candidate`]: causes as laws, re-simulated; deviations without a name beside them.
//! 4. [`mod@select`]: forward, backward, exchange; evidence, size, sessions left out.
//! 5. [`rivals`]: every rival refitted; look-alikes.
//! 6. [`remainder`]: lines and steps left; abstention.
//! 7. [`report`]: parameters with uncertainty, gain on sessions left out.

pub mod base;
pub mod candidate;
mod experiment;
mod extended;
mod held_out;
pub mod linear;
pub mod model;
pub mod noise;
pub mod prepare;
pub mod remainder;
pub mod report;
mod resolution;
pub mod rivals;
pub mod rows;
pub mod select;
#[cfg(test)]
mod tests;
mod uncertainty;

use std::collections::BTreeMap;
use std::io::Write as _;

use flexspline::Table;
use thiserror::Error;

use crate::measurement::Session;
use crate::nominal::Nominal;
use candidate::{Excitation, Law, Scales, library, line, unnamed};
use extended::Found;
pub use extended::{Extended, FittedCause, Series};
use model::{Fit, Problem, Term, terms_at};
use noise::{Noise, Whitener};
use report::{Cause, Compensation, Diagnosis, Parameter, Residual, Unexplained, Verdict};
use resolution::{Resolution, resolution};
use rows::Rows;
use select::{Selected, fit, predicted, select, standings};

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
pub struct Settings {
    /// Radius of the pitch circle of the output, mm: turns arc-seconds into micrometres.
    pub pitch_radius_mm: f64,
    /// Averages of rows that fits are made on, about.
    pub averages: usize,
    /// Says on stderr what is tried.
    pub verbose: bool,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { pitch_radius_mm: 48.7, averages: 12_000, verbose: false }
    }
}

/// Rows needed at least.
const LEAST_ROWS: usize = 200;
/// Orders per generator turn up to which lines are looked for.
const HIGHEST_ORDER: f64 = 150.0;
/// Times that causes are chosen again, at most.
const MOST_ROUNDS: usize = 2;
/// Sessions left out are predicted no worse up to this: the least that counts is a small part of what noise leaves.
const NO_WORSE: f64 = 1.001;
/// What is left as a free function counts if it is larger than this against the strongest cause.
const LEAST_LEFT_OF_STRONGEST: f64 = 0.25;
/// Named causes that explain less than this share of what is explained at all are not named.
const LEAST_NAMED_SHARE: f64 = 0.6;
/// Share of the square of what is beyond noise that may stay without any description where causes are named.
const MOST_UNEXPLAINED: f64 = 0.5;
/// What a cause adds has to be this many times the uncertainty of that.
const KNOWN: f64 = 1.0;
/// The same beside something without a name that is larger than this against it: what that is may reach into it.
const KNOWN_BESIDE: f64 = 5.0;
const LARGE_BESIDE: f64 = 0.7;
/// The same beside a deviation that is described well though it has no name.
const LEAST_BESIDE_DESCRIBED: f64 = 0.05;

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
    settings: &Settings,
    progress: impl FnMut(usize, usize, &str),
) -> Result<Diagnosis, DiagnosisError> {
    diagnose_extended(sessions, nominal, table, settings, progress).map(|(diagnosis, _)| diagnosis)
}

/// The same, with the model that was found, to predict other rows with.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_extended(
    sessions: &[Session],
    nominal: &Nominal,
    table: Option<&Table<'_>>,
    settings: &Settings,
    mut progress: impl FnMut(usize, usize, &str),
) -> Result<(Diagnosis, Extended), DiagnosisError> {
    let rows = Rows::new(sessions, nominal);
    check(&rows)?;
    progress(0, 4, "nominal model");
    let (base, jumps) = prepare::base(&rows, nominal, table);
    let scales = Scales::new(&rows, settings.pitch_radius_mm, jumps);
    let on = Excitation::new(&rows, nominal, &base, &scales);
    progress(1, 4, "causes");
    let search = Search::new(&on, settings)?;
    progress(2, 4, "rivals");
    let Search { laws, problem, noise, start, fast } = search;
    let terms = terms_at(&problem, &laws, &start);
    let selected = Selected { fit: fit(&problem, &terms).ok_or(DiagnosisError::NotFinite)?, terms };
    let (selected, mut unproved) = held_out::proved(&problem, selected);
    let start = remembered(&laws, &selected);
    let maps = candidate::maps(&on);
    let mut left = remainder::of_maps(&problem, &selected, &maps, noise.white);
    left.extend(fast.into_iter().filter(|f| f.size_arcsec > select::least_size(noise.white)));
    left.extend(remainder::beyond_noise(&problem, &selected, noise));
    if settings.verbose {
        for (k, term) in selected.terms.iter().enumerate() {
            let [main, nuisance, beside] = select::parts(term, selected.fit.of(k));
            tell(&format!("  {}: law {main:.2}, deviations {nuisance:.2}, beside {beside:.2}", term.law.cause));
        }
        for something in &left {
            tell(&format!("  left: {} {:.2}", something.looks_like, something.size_arcsec));
        }
    }
    left.append(&mut unproved);
    let diagnosis = conclude(&problem, &laws, selected, left, noise, settings);
    let found = Found::of(&problem, &laws, &start).ok_or(DiagnosisError::NotFinite)?;
    drop(problem);
    Ok((diagnosis, found.extended(laws, &base, &scales)))
}

/// Says on stderr what is tried; a reader that has gone is no reason to fail.
fn tell(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
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
    noise: Noise,
    /// Index and places of each law chosen.
    start: Vec<(usize, Vec<f64>)>,
    /// Lines too fast for averages.
    fast: Vec<Unexplained>,
}

impl<'a> Search<'a> {
    fn new(on: &'a Excitation<'a>, settings: &Settings) -> Result<Search<'a>, DiagnosisError> {
        let mut laws = library(on);
        laws.extend(unnamed(on));
        let say = |text: String| {
            if settings.verbose {
                tell(&text);
            }
        };
        let mut uncertain = prepare::uncertain(on, &[]);
        let Resolution { mut stride, fast: at_first } = resolution(on, &laws, &uncertain, settings.averages, &[]);
        let whiten = |noise, uncertain: &[bool], stride| Whitener::new(on.rows, uncertain, stride, noise);
        let (mut noise, mut worth) = prepare::noise(on, &laws, &at_first, &uncertain);
        say(format!("play {:?}, {noise:?}, worth {worth:.2}, {} rows", on.base.law, on.rows.count_used()));
        let mut problem = Problem::new(on, &uncertain, whiten(noise, &uncertain, stride), worth);
        let mut fast: Vec<Unexplained> = Vec::new();
        let mut start: Vec<(usize, Vec<f64>)> = Vec::new();
        // Again where a line was found that no law has, or where what was taken for noise turned out to be a cause.
        for round in 0.. {
            fast.clear();
            let terms = terms_at(&problem, &laws, &start);
            let selected = select(&problem, &laws, noise.white, terms, say).ok_or(DiagnosisError::NotFinite)?;
            start = remembered(&laws, &selected);
            if round == MOST_ROUNDS {
                break;
            }
            let lines = lines_left(&problem, &selected, noise);
            let (slow, found): (Vec<_>, Vec<_>) =
                lines.into_iter().partition(|(line, _)| !remainder::averaged_away(&problem, line));
            for (line, size) in found {
                let looks_like = format!("line of {:.4} per {}", line.order, line.unit);
                if fast.iter().all(|f| f.looks_like != looks_like) {
                    say(format!("  {looks_like}: {size:.2} arcsec, too fast for averages"));
                    fast.push(Unexplained { looks_like, size_arcsec: size });
                }
            }
            let mut explained = remainder::explained(&problem, &selected);
            let doubtful = prepare::uncertain(on, &selected.terms);
            drop(selected);
            let known = laws.len();
            for (found, size) in slow {
                let law = line(found.unit, found.order);
                if laws.iter().all(|l| l.cause != law.cause) {
                    say(format!("  {}: {size:.2} arcsec", law.cause));
                    laws.push(law);
                }
            }
            let new_line = laws.len() > known;
            let changed = doubtful.iter().zip(&uncertain).filter(|(a, b)| a != b).count();
            let other_rows = changed > on.rows.len() / 200;
            uncertain = doubtful;
            // What was large may have hidden what is fast.
            let finer = resolution(on, &laws, &uncertain, settings.averages, &explained);
            let closer_look = finer.stride < stride;
            stride = stride.min(finer.stride);
            explained.iter_mut().zip(&finer.fast).for_each(|(sum, fast)| *sum += fast);
            let (again, worth_again) = prepare::noise(on, &laws, if new_line { &[] } else { &explained }, &uncertain);
            let change = again.floor() / noise.floor();
            if !new_line && !other_rows && !closer_look && (0.85..1.18).contains(&change) {
                break;
            }
            if new_line {
                start.clear();
            }
            (noise, worth) = (again, worth_again);
            say(format!("once more: {noise:?}, worth {worth:.2}"));
            problem = Problem::new(on, &uncertain, whiten(noise, &uncertain, stride), worth);
        }
        Ok(Search { laws, problem, noise, start, fast })
    }
}

/// Which laws were selected, and where.
fn remembered(laws: &[Law], selected: &Selected<'_>) -> Vec<(usize, Vec<f64>)> {
    selected
        .terms
        .iter()
        .filter_map(|t| Some((laws.iter().position(|law| std::ptr::eq(law, t.law))?, t.places.clone())))
        .collect()
}

/// Lines in every row, as averages would hide the fast ones, with their size in arcsec.
fn lines_left(problem: &Problem<'_>, selected: &Selected<'_>, noise: Noise) -> Vec<(remainder::Line, f64)> {
    let every = remainder::every_row(problem, selected, noise);
    let rows = every.len();
    remainder::lines(problem, &every, HIGHEST_ORDER)
        .into_iter()
        .filter(|line| line.power > remainder::line_limit(rows))
        .map(|line| {
            // In innovations of variance v a line of amplitude a has the power n a² / 4 v.
            let size = noise.white * rows::rms(&every) * (2.0 * line.power / rows as f64).sqrt();
            (line, size)
        })
        .filter(|(_, size)| *size > 0.25 * select::least_size(noise.white))
        .collect()
}

fn conclude(
    problem: &Problem<'_>,
    laws: &[Law],
    selected: Selected<'_>,
    mut left_over: Vec<Unexplained>,
    noise: Noise,
    settings: &Settings,
) -> Diagnosis {
    let standings = standings(problem, &selected);
    let all: Vec<&Term<'_>> = selected.terms.iter().collect();
    let none = fit(problem, &[]);
    let left = |terms: &[&Term<'_>], fit: &Fit| -> Vec<f64> {
        problem.data.iter().zip(predicted(problem, terms, fit)).map(|(d, p)| d - p).collect()
    };
    let before = none.as_ref().map_or(Vec::new(), |fit| left(&[], fit));
    let after = left(&all, &selected.fit);
    let stride_floor = noise.white / (problem.on.rows.count_used() as f64 / problem.data.len() as f64).sqrt();
    let floor = stride_floor.hypot(noise.wander);
    let (rms_before, rms_after) = (problem.certain_rms(&before), problem.certain_rms(&after));
    let explainable = (rms_before * rms_before - floor * floor).max(0.0);
    let unexplained = (rms_after * rms_after - floor * floor).max(0.0);

    let known = uncertainty::known(problem, &selected);
    if settings.verbose {
        for (term, known) in selected.terms.iter().zip(&known) {
            tell(&format!("  {}: {:.1} times its doubt", term.law.cause, known.times_its_doubt));
        }
    }
    let largest = |sizes: &mut dyn Iterator<Item = f64>| sizes.fold(0.0, f64::max);
    let unnamed = (0..selected.terms.len()).filter(|k| !selected.terms[*k].law.named).map(|k| standings[k].size);
    let not_understood = largest(&mut unnamed.chain(left_over.iter().map(|l| l.size_arcsec)));
    let counts = |k: &usize| {
        let beside = not_understood > LARGE_BESIDE * standings[*k].size;
        selected.terms[*k].law.named
            && standings[*k].size > select::least_named(noise.white)
            && known[*k].times_its_doubt > if beside { KNOWN_BESIDE } else { KNOWN }
    };
    let named: Vec<usize> = (0..selected.terms.len()).filter(counts).collect();
    let size = |k: &usize| standings[*k].size.powi(2);
    let (by_name, without_name) = (
        named.iter().map(size).sum::<f64>(),
        (0..selected.terms.len()).filter(|k| !named.contains(k)).map(|k| size(&k)).sum::<f64>(),
    );
    let strongest = named.iter().map(|k| standings[*k].size).fold(0.0, f64::max);
    left_over.retain(|l| l.size_arcsec > LEAST_LEFT_OF_STRONGEST * strongest);
    let described = without_name;
    let without_name = without_name + left_over.iter().map(|l| l.size_arcsec.powi(2)).fold(0.0, f64::max);
    let significant_left = without_name > 0.0;
    let verdict = match (named.is_empty(), significant_left) {
        (true, false) => Verdict::None,
        (true, true) => Verdict::Unknown,
        (false, false) => Verdict::Explained,
        // What is left without even a description may be what the cause was named for.
        (false, true)
            if by_name < LEAST_NAMED_SHARE * (by_name + without_name - described)
                || by_name < LEAST_BESIDE_DESCRIBED * (by_name + described) =>
        {
            Verdict::Unknown
        }
        (false, true) => Verdict::PartlyExplained,
    };
    // Names for a small part of what is there, with the rest in the dark, are no understanding.
    let in_the_dark =
        unexplained.sqrt() > select::least_size(noise.white) && unexplained > MOST_UNEXPLAINED * explainable;
    let verdict = if named.is_empty() || !in_the_dark { verdict } else { Verdict::Unknown };
    let held = held_out::evaluate(problem, &all);
    // What does not predict sessions it was not fitted to is no explanation.
    let verdict = if !named.is_empty() && held.total.rms_after_arcsec > NO_WORSE * held.total.rms_before_arcsec {
        Verdict::Unknown
    } else {
        verdict
    };
    let mut causes = Vec::new();
    let mut next_experiment = None;
    let mut told_better = Vec::new();
    if verdict != Verdict::Unknown {
        for k in named.iter().copied() {
            let rivals = rivals::rivals(problem, laws, &selected, &standings, k);
            if settings.verbose {
                for rival in rivals.iter().take(4) {
                    tell(&format!(
                        "  rival of {}: {} misfit +{:.0}, apart {:.2}",
                        selected.terms[k].law.cause, rival.cause, rival.misfit, rival.apart_arcsec
                    ));
                }
            }
            let size = standings[k].size;
            if rivals.iter().any(|r| r.tells_better(size)) {
                // A rival that no other test lets through tells it better: neither is known.
                told_better.push(k);
                continue;
            }
            let alike: Vec<String> = rivals
                .iter()
                .filter(|r| r.looks_alike(standings[k].size, selected.terms[k].law.tolerance_of.is_some()))
                .map(|r| r.cause.clone())
                .take(3)
                .collect();
            let closest = rivals.first().map_or(50.0, |r| r.misfit);
            if !alike.is_empty() && next_experiment.is_none() {
                let named: Vec<&Law> = alike.iter().filter_map(|a| laws.iter().find(|law| law.cause == *a)).collect();
                next_experiment = experiment::next(problem.on, &selected.terms[k], selected.fit.of(k), &named, noise)
                    .map(|(text, apart)| {
                        format!("{text}; expected to tell them apart by {apart:.0} standard deviations")
                    });
            }
            causes.push(Cause {
                name: selected.terms[k].law.cause.clone(),
                confidence: confidence(closest, alike.len()),
                parameters: known[k].parameters.clone(),
                held_out_gain: held.gains.get(k).copied().unwrap_or(0.0),
                size_arcsec: standings[k].size,
                look_alikes: alike,
            });
        }
        causes.sort_by(|a, b| b.size_arcsec.total_cmp(&a.size_arcsec));
    }
    let verdict = match verdict {
        Verdict::Explained | Verdict::PartlyExplained if causes.is_empty() => Verdict::Unknown,
        Verdict::Explained if !told_better.is_empty() => Verdict::PartlyExplained,
        other => other,
    };
    // Nothing named, nothing extended: what has no name helps to see what is there, and predicts nothing for anybody.
    let mut held_out = held.total;
    if causes.is_empty() {
        held_out.rms_after_arcsec = held_out.rms_before_arcsec;
    }
    let mut unexplained_list: Vec<Unexplained> = (0..selected.terms.len())
        .filter(|k| !named.contains(k) || told_better.contains(k) || verdict == Verdict::Unknown)
        .map(|k| Unexplained { looks_like: selected.terms[k].law.cause.clone(), size_arcsec: standings[k].size })
        .collect();
    unexplained_list.extend(left_over);
    Diagnosis {
        schema_version: 1,
        verdict,
        causes,
        residual: Residual {
            rms_before_arcsec: rms_before,
            rms_after_arcsec: rms_after,
            noise_floor_arcsec: floor,
            unexplained_fraction: if explainable > 0.0 { (unexplained / explainable).min(1.0) } else { 0.0 },
        },
        held_out,
        compensation: compensation(problem, held_out.rms_after_arcsec),
        unexplained: unexplained_list,
        recalibrated: recalibrated(problem, &selected),
        noise_arcsec: [noise.white, noise.wander],
        wander_correlation_s: noise.correlation_s,
        next_experiment,
    }
}

/// Probability of a cause against its closest rival, whose misfit is higher by this; halved by each look-alike.
fn confidence(misfit: f64, alike: usize) -> f64 {
    if alike > 0 { 1.0 / (1.0 + alike as f64) } else { 1.0 / (1.0 + (-0.5 * misfit.clamp(0.0, 40.0)).exp()) - 0.01 }
}

fn compensation(problem: &Problem<'_>, rms_extended: f64) -> Compensation {
    let about_mean = |values: Vec<f64>| {
        let certain = values.iter().zip(&problem.certain).filter(|(_, c)| **c);
        let mean = certain.clone().map(|(v, _)| v).sum::<f64>() / certain.count().max(1) as f64;
        problem.certain_rms(&values.iter().map(|v| v - mean).collect::<Vec<f64>>())
    };
    Compensation {
        rms_uncompensated_arcsec: about_mean(problem.whitener.average(&problem.on.rows.error)),
        rms_nominal_tables_arcsec: about_mean(problem.data.clone()),
        rms_extended_tables_arcsec: rms_extended,
    }
}

fn recalibrated(problem: &Problem<'_>, selected: &Selected<'_>) -> BTreeMap<String, Parameter> {
    let n = selected.fit.priors.len();
    let mut named = BTreeMap::new();
    let covariance = selected.fit.solution.covariance();
    for (k, floating) in problem.on.base.floating.iter().enumerate() {
        let name =
            if named.contains_key(&floating.name) { format!("{} {k}", floating.name) } else { floating.name.clone() };
        named.insert(
            name,
            Parameter { value: selected.fit.solution.coefficients[k], std: covariance[k * n + k].max(0.0).sqrt() },
        );
    }
    named
}
