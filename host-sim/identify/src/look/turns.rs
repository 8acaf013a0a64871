//! Units of angles that a file does not say: counts of a turn by another column, else open.

use std::f64::consts::TAU;

use super::relation::{RATIOS, Slope, counts_of_a_turn, slope};
use super::{Guess, Role};
use crate::measurement::{Unit, registers};

/// A ratio this close to a half is taken for one: a guess.
const CLOSE_TO_HALF: f64 = 0.1;
/// A ratio is whole to this: clearance and the error of the ratio that few turns leave. *Guess*.
const WHOLE: f64 = 0.005;
/// Counts of a turn that are tried, powers of two.
const POWERS: std::ops::RangeInclusive<i32> = 6..=28;
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
        if counted.unit != Some(Unit::Count) || counted.counts.is_some() || !counted.moves() {
            continue;
        }
        let readings = (0..guesses.len()).flat_map(|j| {
            let other = &guesses[j];
            let angle = !matches!(other.role, Role::Time | Role::Speed | Role::Torque | Role::Current)
                && other.unit != Some(Unit::Count)
                && !other.facts.whole;
            let line = (j != k && angle && other.moves()).then(|| on_one_shaft(counted, other)).flatten();
            let units = other.unit.map_or(vec![Unit::Radian, Unit::Degree, Unit::Turn], |unit| vec![unit]);
            let forms = units.into_iter().flat_map(|unit| [(unit, false), (unit, true)]);
            forms.filter_map(move |(unit, round)| {
                let (counts, off) = counts_of_a_turn(line?.slope / unit.factor(), round)?;
                Some((round, off, j, unit, counts))
            })
        });
        // A power of two before a round number, then what fits better.
        let best = readings.min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        if let Some((_, _, j, unit, counts)) = best {
            guesses[k].counts = Some(counts);
            guesses[k]
                .why
                .push(format!("{counts} counts a turn by column {}, which shows the same shaft in {unit}", j + 1));
            guesses[j].unit = Some(unit);
            guesses[j].why.push(format!("{unit} by column {}: then a turn has {counts} counts", k + 1));
        }
    }
}

/// The line between two columns that show one shaft; names of motor and output, or of two joints, do not.
pub(super) fn on_one_shaft(a: &Guess, b: &Guess) -> Option<Slope> {
    let shafts = [a.role, b.role];
    let two_shafts = shafts.contains(&Role::Generator) && shafts.contains(&Role::Output);
    let two_joints = a.said.joint.zip(b.said.joint).is_some_and(|(a, b)| a != b);
    let line = || slope(&a.values, &b.values, &a.of_file);
    (!two_shafts && !two_joints).then(line).flatten().filter(|line| line.left < SAME_SHAFT)
}

/// The unit of an angle as it may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct UnitReading {
    /// Unit.
    pub unit: Unit,
    /// Counts of a turn, where it is counts and their number is known.
    pub counts: Option<f64>,
    /// Where it comes from.
    pub by: UnitFrom,
}

/// Where a unit comes from, the surest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum UnitFrom {
    /// It was known before.
    Known,
    /// The number after which the column begins anew.
    Anew,
    /// The other encoder has these counts.
    Other,
    /// Nothing: radians, or counts that nobody says.
    Nothing,
    /// It makes the ratio one of a strain wave gear, and for counts nearly whole: to be asked where several do.
    Ratio,
}

impl UnitReading {
    fn rad(&self) -> f64 {
        rad(self.unit, self.counts).unwrap_or(TAU)
    }

    /// As a mapping takes it.
    pub fn written(&self) -> Option<String> {
        written(self.unit, self.counts)
    }
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

/// Units of generator and output, and the ratio that they give.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Units {
    pub generator: UnitReading,
    pub output: UnitReading,
    pub ratio: f64,
}

impl Units {
    /// How sure the less sure of the two units is.
    fn by(&self) -> UnitFrom {
        self.generator.by.max(self.output.by)
    }
}

/// The units that two columns may have as generator and output, as sure as any; `raw` is the change of the generator's
/// number for one of the output's. None if no unit makes it the ratio of a strain wave gear.
pub(super) fn units_of_pair(generator: &Guess, output: &Guess, raw: f64) -> Vec<Units> {
    let mut all: Vec<Units> = Vec::new();
    for g in readings(generator, output) {
        for o in readings(output, generator) {
            let ratio = raw * g.rad() / o.rad();
            let whole = (ratio - ratio.round()).abs() < WHOLE * ratio.abs();
            let by_ratio = |reading: &UnitReading| {
                reading.unit == Unit::Count && matches!(reading.by, UnitFrom::Ratio | UnitFrom::Other)
            };
            let within = (RATIOS[0]..=RATIOS[1]).contains(&ratio.abs());
            if within && (whole || !(by_ratio(&g) || by_ratio(&o))) {
                all.push(Units { generator: g, output: o, ratio });
            }
        }
    }
    let surest = all.iter().map(Units::by).min();
    all.retain(|units| Some(units.by()) == surest);
    all
}

/// Counts of a turn as those after which a register begins anew.
fn anew(guess: &Guess) -> Option<UnitReading> {
    let span = guess.facts.anew.map(|anew| anew.span).filter(|_| guess.unit == Some(Unit::Count))?;
    let reading = UnitReading { unit: Unit::Count, counts: Some(span), by: UnitFrom::Anew };
    registers().any(|register| register == span).then_some(reading)
}

/// The units that a column may have together with another one; the same unit, where nothing is known of either.
fn readings(guess: &Guess, other: &Guess) -> Vec<UnitReading> {
    let open = |guess: &Guess| guess.rad().is_none() && anew(guess).is_none();
    let unit = guess.unit.unwrap_or(Unit::Radian);
    match (guess.unit, guess.counts) {
        _ if open(guess) && open(other) && guess.unit == other.unit => {
            vec![UnitReading { unit, counts: None, by: UnitFrom::Nothing }]
        }
        (Some(Unit::Count), None) => {
            let same = other.counts.or_else(|| anew(other).and_then(|reading| reading.counts));
            let same = same.map(|counts| UnitReading { unit, counts: Some(counts), by: UnitFrom::Other });
            let powers = POWERS.map(|bits| UnitReading { unit, counts: Some(2f64.powi(bits)), by: UnitFrom::Ratio });
            anew(guess).into_iter().chain(same).chain(powers).collect()
        }
        (None, _) if other.unit == Some(Unit::Count) && other.counts.is_none() => {
            vec![UnitReading { unit, counts: None, by: UnitFrom::Nothing }]
        }
        (None, _) => Unit::ANGLES.map(|unit| UnitReading { unit, counts: None, by: UnitFrom::Ratio }).to_vec(),
        (Some(unit), counts) => vec![UnitReading { unit, counts, by: UnitFrom::Known }],
    }
}

/// Gives a column of a pair its unit, with why; `place` is its place in the file, from 0.
pub(super) fn settle(guess: &mut Guess, place: usize, reading: &UnitReading, ratio: f64, notes: &mut Vec<String>) {
    let open = guess.rad().is_none();
    (guess.unit, guess.counts) = (Some(reading.unit), reading.counts);
    if !open {
        return;
    }
    let why = match (reading.unit, reading.counts, reading.by) {
        (Unit::Count, Some(counts), by) => {
            let why = match by {
                UnitFrom::Anew => "after which it begins anew",
                UnitFrom::Other => "as the other encoder has",
                _ => "which makes the ratio nearly whole",
            };
            notes.push(format!("column {}: {counts} counts a turn, {why}: check it", place + 1));
            format!("{counts} counts a turn, {why}")
        }
        (Unit::Count, None, _) => {
            notes.push(format!("how many counts make a turn of column {} is not in the file", place + 1));
            return;
        }
        (unit, _, UnitFrom::Nothing) => format!("{unit}, for want of a unit"),
        (unit, ..) => format!("{unit} makes the ratio {ratio:.2}"),
    };
    guess.why.push(why);
}
