//! Residual with the causes in the model: spectral lines and slow motion that noise does not make.

use std::borrow::Cow;
use std::f64::consts::TAU;

use super::base::WIDER;
use super::candidate::{Acting, Law, Per, together};
use super::model::{Problem, Scaffold, Term};
use super::noise::{Noise, Whitener};
use super::report::Unexplained;
use super::rows::{Rows, combined, rms};
use super::select::{self, Selected, less};
use super::thresholds::remainder::*;
use crate::residual::{is_no_noise, lasting_step, strongest};

/// Highest order per generator turn up to which lines are looked for. *Guess*: above what bearings make, below the
/// tooth mesh of ratios above 75, which has models of its own.
const HIGHEST_ORDER: f64 = 150.0;
/// A line is looked at from this share of the least size that counts on. *Guess*.
const LEAST_OF_A_SIZE: f64 = 0.25;

/// A line in the spectrum of the residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SpectralLine {
    /// Turn or second in which its periods are counted.
    pub per: Per,
    /// Periods in one.
    pub order: f64,
    /// Root mean square, arcsec.
    pub size_arcsec: f64,
}

/// Columns of base and terms, row by row.
fn columns(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<Vec<f64>> {
    let on = &problem.on;
    let causes: Vec<Acting<'_>> =
        selected.terms.iter().enumerate().map(|(k, term)| term.acting(selected.fit.of(k))).collect();
    let floating = on.base.floating.iter().map(|floating| floating.values.clone());
    floating.chain(together(on, &causes).into_iter().flatten().map(|column| column.values)).collect()
}

/// The part of the error that base and terms explain in addition to the nominal prediction, row by row, arcsec.
pub(crate) fn explained(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<f64> {
    let columns = columns(problem, selected);
    combined(problem.on.rows.len(), columns.iter().map(Vec::as_slice), &selected.fit.solution.coefficients)
}

/// Innovations of every row, in units of their standard deviation; 0 where the flank is uncertain.
fn every_row(problem: &Problem<'_>, selected: &Selected<'_>, noise: Noise) -> Vec<f64> {
    let on = &problem.on;
    let left = on.left(&explained(problem, selected));
    let whitener = Whitener::new(on.rows, &problem.uncertain, 1, noise);
    let mut white = whitener.in_rows(&whitener.whiten_averaged(&whitener.average(&left)), on.rows.len());
    for (value, uncertain) in white.iter_mut().zip(&problem.uncertain) {
        *value = if *uncertain { 0.0 } else { value.clamp(-6.0, 6.0) };
    }
    white
}

/// The strongest lines of the residual by generator angle and by time that are no noise, in every row: averages would
/// hide the fast ones.
pub(crate) fn lines(problem: &Problem<'_>, selected: &Selected<'_>, noise: Noise) -> Vec<SpectralLine> {
    let (rows, every) = (problem.on.rows, every_row(problem, selected, noise));
    let count = every.len() as f64;
    // Rounding of a steady motion makes lines, of no more than all of it.
    let least = (LEAST_OF_A_SIZE * select::least_size(noise.white)).max(rows.rounding);
    let line = |per: Per, lowest: f64, highest: f64| {
        let (order, power) = strongest(&places(rows, per), &every, lowest, highest)?;
        // In innovations of variance v a line of amplitude a has the power n a² / 4 v.
        let size_arcsec = noise.white * rms(&every) * (2.0 * power / count).sqrt();
        let is_there = is_no_noise(power, every.len()) && size_arcsec > least;
        is_there.then_some(SpectralLine { per, order, size_arcsec })
    };
    let by_angle = || line(Per::GeneratorTurn, 0.0, HIGHEST_ORDER.min(rows.highest_order()));
    let in_time = || line(Per::Second, SLOWEST_LINE_HZ, 0.5 / rows.period);
    let (by_angle, in_time) = rayon::join(by_angle, || rows.recorded.time.then(in_time).flatten());
    by_angle.into_iter().chain(in_time).collect()
}

/// Where an encoder lost its index, in what is left beside what is `explained`, of rows that are not `uncertain`: the
/// session, and when in it, s.
pub(crate) fn step(
    problem: &Problem<'_>,
    selected: &Selected<'_>,
    (explained, uncertain): (&[f64], &[bool]),
    white: f64,
) -> Option<(usize, f64)> {
    let (on, rows) = (&problem.on, problem.on.rows);
    // Where no load says which flank carries, one as wide as the clearance may be a change of flank.
    let unknown =
        if on.scales.load > on.nominal.friction_torque_n_m { 0.0 } else { 2.0 * WIDER * on.base.half_backlash };
    let mut counts = vec![false; rows.len()];
    rows.sessions_used().for_each(|session| session.for_each(|k| counts[k] = !uncertain[k]));
    let left = on.left(explained);
    let left: Vec<Option<f64>> = left.iter().zip(counts).map(|(left, counts)| counts.then_some(*left)).collect();
    // Where rows between do not count, the flank is none of the step.
    let follows = |k: &usize| {
        let before = left[..*k].iter().rposition(Option::is_some);
        before.is_some_and(|before| on.base.flank[before].signum() == on.base.flank[*k].signum())
    };
    let inside = rows.sessions_used().flat_map(|session| {
        let of = session.clone();
        session.skip(1).filter(|k| left[*k].is_some()).filter(follows).map(move |k| (k..rows.len(), of.clone()))
    });
    let row = lasting_step(&left, || columns(problem, selected), inside, (white, unknown))?.0.start;
    let number = rows.sessions.iter().position(|session| session.contains(&row))?;
    Some((number, rows.since[row]))
}

/// The angle of each row in which a line repeats, rad; a second is a turn.
fn places(rows: &Rows, per: Per) -> Cow<'_, [f64]> {
    match per {
        Per::Second => Cow::Owned(time_without_gaps(rows)),
        Per::GeneratorTurn => Cow::Borrowed(&rows.generator),
        Per::OutputTurn => Cow::Borrowed(&rows.output),
    }
}

/// Time of all sessions one after the other, 2π to a second: gaps would only make a transform long.
fn time_without_gaps(rows: &Rows) -> Vec<f64> {
    let (mut time, mut begin) = (rows.since.clone(), 0.0);
    for session in rows.sessions.iter().filter(|session| !session.is_empty()) {
        time[session.clone()].iter_mut().for_each(|since| *since += begin);
        begin = time[session.end - 1] + 1.0;
    }
    time.iter_mut().for_each(|time| *time *= TAU);
    time
}

/// Whether averaging the rows takes most of a line away.
pub(crate) fn averaged_away(problem: &Problem<'_>, line: &SpectralLine) -> bool {
    let places = places(problem.on.rows, line.per);
    let wave: Vec<f64> = places.iter().map(|angle| (line.order * angle).cos()).collect();
    problem.whitener.hides(&wave)
}

/// Residual that goes as a free function of a measured quantity, largest first.
pub(crate) fn of_maps(problem: &Problem<'_>, selected: &Selected<'_>, maps: &[Law], white: f64) -> Vec<Unexplained> {
    use rayon::prelude::*;
    let scaffold = Scaffold::new(problem, &selected.terms);
    let mut found: Vec<Unexplained> = maps
        .par_iter()
        .filter_map(|law| {
            let term = Term::new(problem, law, Vec::new());
            let fit = scaffold.fit(Some(&term))?;
            if fit.solution.evidence - selected.fit.solution.evidence <= LEAST_EVIDENCE {
                return None;
            }
            let mut terms = selected.terms.clone();
            terms.push(term);
            let standing = select::standing(problem, &Selected { terms, fit }, selected.terms.len());
            let there = standing.evidence > LEAST_EVIDENCE
                && standing.left_out > LEAST_EVIDENCE
                && standing.size > select::least_size(white);
            there.then(|| Unexplained { looks_like: law.label.to_string(), size_arcsec: standing.size })
        })
        .collect();
    found.sort_by(|a, b| b.size_arcsec.total_cmp(&a.size_arcsec));
    found.truncate(1);
    found
}

/// Slow motion that is too large for noise, or too orderly.
pub(crate) fn beyond_noise(problem: &Problem<'_>, selected: &Selected<'_>, noise: Noise) -> Vec<Unexplained> {
    let left = left(problem, selected);
    let wander = problem.whitener.followed(&left);
    let size = problem.certain_rms(&wander);
    let restless = problem.fineness.worth < LEAST_WORTH && noise.wander > noise.white;
    // The largest and fastest wander that is tried: what is there is larger or faster still.
    let restless = restless || noise.wander >= super::prepare::MOST_WANDER * noise.white;
    if restless || size > MOST_WANDER_ARCSEC.max(MOST_WANDER_OF_WHITE * noise.white) {
        vec![Unexplained { looks_like: "slow motion".into(), size_arcsec: size }]
    } else {
        Vec::new()
    }
}

/// Data less everything explained, averaged, arcsec.
pub fn left(problem: &Problem<'_>, selected: &Selected<'_>) -> Vec<f64> {
    less(&problem.data, &selected.predicted(problem))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_at_uneven_places_is_found_where_it_is() {
        let places: Vec<f64> = (0..4000).map(|k| 0.05 * f64::from(k) + 0.02 * f64::from(k % 7)).collect();
        let angles: Vec<f64> = places.iter().map(|x| TAU * x).collect();
        let values: Vec<f64> = angles.iter().map(|angle| (0.731 * angle).cos()).collect();
        let (order, power) = strongest(&angles, &values, 0.0, 2.0).unwrap();
        assert!((order - 0.731).abs() < 1e-4, "{order}");
        assert!(power > 1000.0, "{power}");
    }
}
