//! Units of angles that a file does not say: counts of a turn by another column, else open.

use std::f64::consts::TAU;

use super::relation::{RATIOS, counts_of_a_turn, slope};
use super::{Guess, Role};
use crate::measurement::{Unit, registers};

/// A ratio this close to a half is taken for one: a guess.
const CLOSE_TO_HALF: f64 = 0.1;
/// Two columns show one shaft if a straight line leaves less than this share of the range.
const SAME_SHAFT: f64 = 1e-4;

/// The ratio that wheels can have: a whole number, or a half that the rows are close to.
pub(super) fn proposed_ratio(found: f64) -> f64 {
    let half = found.floor() + 0.5;
    if (found - half).abs() < CLOSE_TO_HALF { half } else { found.round() }
}

/// Counts of a turn, where another column shows the same shaft in a unit of angle.
pub(super) fn units_of_counts(guesses: &mut [Guess]) {
    for k in 0..guesses.len() {
        let counted = &guesses[k];
        if counted.unit != Some(Unit::Count) || !counted.moves() {
            continue;
        }
        let readings = guesses.iter().enumerate().flat_map(|(j, other)| {
            let angle = !matches!(other.column.role, Role::Time | Role::Speed | Role::Torque | Role::Current)
                && other.unit != Some(Unit::Count)
                && !other.facts.whole;
            let slope = (j != k && angle && other.moves()).then(|| on_one_shaft(counted, other)).flatten();
            let units = other.unit.map_or(vec![Unit::Radian, Unit::Degree, Unit::Turn], |unit| vec![unit]);
            units.into_iter().filter_map(move |unit| {
                let (counts, off) = counts_of_a_turn(slope? / unit.factor())?;
                Some((off, j, unit, counts))
            })
        });
        let best = readings.min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, j, unit, counts)) = best {
            guesses[k].column.counts_per_turn = Some(counts);
            let why = format!("{counts} counts a turn by column {}, which shows the same shaft in {unit}", j + 1);
            guesses[k].column.why.push(why);
            guesses[j].unit = Some(unit);
            let why = format!("{unit} by column {}: then a turn has {counts} counts", k + 1);
            guesses[j].column.why.push(why);
        }
    }
}

/// The change of a column for one of another that shows the same shaft; names of motor and output, or of two joints, do
/// not.
pub(super) fn on_one_shaft(a: &Guess, b: &Guess) -> Option<f64> {
    let shafts = [a.column.role, b.column.role];
    let two_shafts = shafts.contains(&Role::Generator) && shafts.contains(&Role::Output);
    let two_joints = a.said.joint.zip(b.said.joint).is_some_and(|(a, b)| a != b);
    let line = || slope(&a.values, &b.values, &a.of_file);
    let (slope, left) = (!two_shafts && !two_joints).then(line).flatten()?;
    (left < SAME_SHAFT).then_some(slope)
}

/// Size of one of a unit of angle, rad; nothing for counts of which none knows how many make a turn.
pub(super) fn rad(unit: Unit, counts: Option<f64>) -> Option<f64> {
    if unit == Unit::Count { counts.map(|counts| TAU / counts) } else { Some(unit.factor()) }
}

/// A unit as a mapping takes it.
pub(super) fn written(unit: Unit, counts: Option<f64>) -> Option<String> {
    match unit {
        Unit::Count => counts.map(|counts| format!("count/{counts}")),
        Unit::Ampere | Unit::Milliampere | Unit::Volt => Some(format!("{unit}*GAIN")),
        _ => Some(unit.to_string()),
    }
}

/// The unit of an angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AngleUnit {
    /// Unit; `None` if it has to be asked.
    pub unit: Option<Unit>,
    /// Counts of a turn, where it is counts and their number is known.
    pub counts: Option<f64>,
    /// Why, where it was not known before.
    why: &'static str,
}

impl AngleUnit {
    /// As a mapping takes it.
    pub fn written(&self) -> Option<String> {
        written(self.unit?, self.counts)
    }
}

/// The units of two columns as generator and output, and the ratio that they give, where they are known; `raw` is the
/// change of the generator's number for one of the output's. None if the ratio is not one of a strain wave gear.
pub(super) fn units_of_pair(generator: &Guess, output: &Guess, raw: f64) -> Option<([AngleUnit; 2], Option<f64>)> {
    // Counts of the other encoder are taken if they make such a ratio, else they are asked.
    let found = [true, false].map(|alike| {
        let units = [unit_of(generator, output, alike), unit_of(output, generator, alike)];
        let ratio = match units.map(|of| rad(of.unit?, of.counts)) {
            [Some(g), Some(o)] => Some(raw * g / o),
            // Both are counts, of encoders that are taken to be alike.
            [None, None] => Some(raw),
            _ => None,
        };
        (units, ratio)
    });
    let fits = |ratio: f64| (RATIOS[0]..=RATIOS[1]).contains(&ratio.abs());
    found.into_iter().find(|(_, ratio)| ratio.is_none_or(fits))
}

/// The unit of a column together with another one: radians, or the same counts if they are `alike`, where the file does
/// not say it.
fn unit_of(guess: &Guess, other: &Guess, alike: bool) -> AngleUnit {
    let known = |guess: &Guess| guess.column.counts_per_turn.map(|counts| (counts, ""));
    let anew = |guess: &Guess| {
        let span = guess.facts.anew.map(|anew| anew.span).filter(|_| guess.unit == Some(Unit::Count))?;
        registers().any(|register| register == span).then_some((span, "after which it begins anew"))
    };
    let of_other = || known(other).or_else(|| anew(other)).filter(|_| alike);
    let same = || of_other().map(|(counts, _)| (counts, "as the other encoder has"));
    match guess.unit {
        Some(Unit::Count) => {
            let counts = known(guess).or_else(|| anew(guess)).or_else(same);
            AngleUnit { unit: guess.unit, counts: counts.map(|of| of.0), why: counts.map_or("", |of| of.1) }
        }
        None if other.unit.is_none_or(|unit| unit == Unit::Count) => {
            AngleUnit { unit: Some(Unit::Radian), counts: None, why: "for want of a unit" }
        }
        unit => AngleUnit { unit, counts: None, why: "" },
    }
}

/// Gives a column of a pair its unit, with why; `place` is its place in the file, from 0.
pub(super) fn settle(guess: &mut Guess, place: usize, found: &AngleUnit, notes: &mut Vec<String>) {
    (guess.unit, guess.column.counts_per_turn) = (found.unit, found.counts);
    match (found.unit, found.counts) {
        (Some(Unit::Count), None) => {
            notes.push(format!("how many counts make a turn of column {} is not in the file", place + 1));
        }
        (Some(Unit::Count), Some(counts)) if !found.why.is_empty() => {
            let why = format!("{counts} counts a turn, {}", found.why);
            notes.push(format!("column {}: {why}: check it", place + 1));
            guess.column.why.push(why);
        }
        (Some(unit), None) if !found.why.is_empty() => guess.column.why.push(format!("{unit}, {}", found.why)),
        _ => {}
    }
}
