//! Which columns are generator and output.
//!
//! Names and units come first, then the joint that a name numbers, then what turns on before what swings about zero,
//! and last of all how straight a line two columns make: a motor torque that a robot computes from that of the joint
//! makes a straighter one than two encoders.

use std::f64::consts::TAU;

use super::relation::{TOGETHER, slope};
use super::turns::{AngleUnit, on_one_shaft, settle, units_of_pair};
use super::{Guess, Role};
use crate::measurement::{Family, Unit, least_and_most};

/// Rows in which a column is followed, at most.
const FOLLOWED: usize = 4000;
/// A column swings about zero if the middle of its range is off zero by less than this share of the range. *Guess*.
const ABOUT_ZERO: f64 = 0.1;
/// And if it goes through its range more often than this. *Guess*: a bench goes to and fro a few times.
const OFTEN: f64 = 4.0;
/// Rivals that are written out in notes.
const SAID: usize = 3;

/// Two columns that may be generator and output.
struct Pair {
    generator: usize,
    output: usize,
    units: [AngleUnit; 2],
    ratio: Option<f64>,
    /// In the order of [`WHY`]: of two pairs the first reason that differs decides. The last is the share of the range
    /// that a straight line leaves, negative.
    reasons: [f64; WHY.len()],
}

/// Why a pair goes before another: neither is a command; names say a shaft (2) or an angle (1) of each; both are of one
/// joint (2), that is open (1), or their numbers differ; the generator turns on.
const WHY: [&str; 6] = [
    "they are measured, no command",
    "their names say so",
    "they are of one joint by their numbers",
    "they turn on, and do not swing about zero",
    "they have one unit",
    "they make the straighter line, which need not say much",
];

impl Pair {
    /// Why this one goes before another.
    fn before(&self, other: &Pair) -> &'static str {
        let differs = self.reasons.iter().zip(&other.reasons).position(|(a, b)| a != b);
        WHY[differs.unwrap_or(WHY.len() - 1)]
    }
}

/// The ratio of a pair in words, if it is known.
fn to_one(ratio: Option<f64>, decimals: usize) -> String {
    ratio.map_or(String::new(), |ratio| format!(", {ratio:.decimals$} to 1"))
}

/// The ratio between generator and output, with the role and unit of each settled; notes say what they may be, too.
pub(super) fn pair(guesses: &mut [Guess], notes: &mut Vec<String>) -> Option<f64> {
    let mut pairs = pairs(guesses);
    pairs.sort_by(|a, b| b.reasons.partial_cmp(&a.reasons).unwrap_or(std::cmp::Ordering::Equal));
    let (best, others) = pairs.split_first()?;
    let Pair { generator: g, output: o, units, ratio, .. } = *best;
    // What shows the same two shafts once more is no rival.
    let same = |a: usize, b: usize| a == b || on_one_shaft(&guesses[a], &guesses[b]).is_some();
    let level = others.iter().filter(|other| other.reasons[..2] == best.reasons[..2]);
    let rivals: Vec<&Pair> = level.filter(|other| !(same(other.generator, g) && same(other.output, o))).collect();
    let names = |pair: &Pair| [pair.generator, pair.output].map(|k| guesses[k].name.clone());
    let names: Vec<[String; 2]> = rivals.iter().map(|rival| names(rival)).collect();
    for (k, role, other, unit) in [(g, Role::Generator, o, units[0]), (o, Role::Output, g, units[1])] {
        let guess = &mut guesses[k];
        if guess.column.role == Role::Command {
            notes.push(format!("column {} is a command, which stands for the angle of the generator", k + 1));
        }
        let sure = match names.first() {
            Some(_) => 0.5,
            None if guess.column.role == role && unit.written().is_some() => 0.9,
            None => 0.6,
        };
        (guess.column.role, guess.column.used) = (role, true);
        settle(guess, k, &unit, notes);
        guess.because(format!("turns with column {}{}", other + 1, to_one(ratio, 3)), sure);
        if let Some([generator, output]) = names.first() {
            guess.column.why.push(format!("{generator} and {output} may be meant as well"));
        }
    }
    for (rival, [generator, output]) in rivals.into_iter().zip(names).take(SAID) {
        let (to_one, why) = (to_one(rival.ratio, 2), best.before(rival));
        let pass_on = match rival.units.map(|unit| unit.written()) {
            [Some(g), Some(o)] => format!(", --columns generator={generator}:{g},output={output}:{o}"),
            _ => String::new(),
        };
        notes.push(format!(
            "columns {generator} and {output} may be generator and output as well{to_one}{pass_on}; columns {} and {} \
             are proposed because {why}",
            g + 1,
            o + 1
        ));
    }
    ratio
}

/// The numbers of the joints whose generator and output are used.
pub(super) fn joints(guesses: &[Guess]) -> Vec<u32> {
    let shafts = guesses.iter().filter(|guess| guess.serves_as(Role::Generator) || guess.serves_as(Role::Output));
    let mut joints: Vec<u32> = shafts.filter_map(|guess| guess.said.joint).collect();
    joints.dedup();
    joints
}

/// All pairs of columns that may be generator and output.
fn pairs(guesses: &[Guess]) -> Vec<Pair> {
    let angle = |guess: &Guess| {
        let role = matches!(guess.column.role, Role::Generator | Role::Output | Role::Unknown | Role::Command);
        let unit = guess.unit.is_none_or(|unit| unit.family() == Family::Angle);
        role && unit && !guess.said.aside && guess.moves()
    };
    let angles: Vec<usize> = (0..guesses.len()).filter(|k| angle(&guesses[*k])).collect();
    let mut pairs = Vec::new();
    for &generator in &angles {
        for &output in &angles {
            let (g, o) = (&guesses[generator], &guesses[output]);
            let shafts = |guess: &Guess| matches!(guess.column.role, Role::Generator | Role::Output);
            let one_joint = g.said.joint.zip(o.said.joint).map(|(g, o)| g == o);
            let against = g.column.role == Role::Output || matches!(o.column.role, Role::Generator | Role::Command);
            if generator == output || against || one_joint == Some(false) && shafts(g) && shafts(o) {
                continue;
            }
            let line = slope(&o.values, &g.values, &g.of_file).filter(|(_, left)| *left < TOGETHER);
            let Some((slope, left)) = line else { continue };
            let Some((units, ratio)) = units_of_pair(g, o, 1.0 / slope) else { continue };
            let yes = |is: bool| f64::from(u8::from(is));
            let named = |guess: &Guess| 2.0 * yes(shafts(guess)) + yes(guess.said.angle);
            let reasons = [
                yes(g.column.role != Role::Command),
                named(g) + named(o),
                one_joint.map_or(1.0, |one| 2.0 * yes(one)),
                yes(turns_on(g)),
                yes(g.unit == o.unit),
                -left,
            ];
            pairs.push(Pair { generator, output, units, ratio, reasons });
        }
    }
    pairs
}

/// Whether a column goes over a turn and more, and does not swing about zero all the time.
fn turns_on(guess: &Guess) -> bool {
    let finite = guess.values.iter().copied().filter(|value| value.is_finite());
    let some: Vec<f64> = finite.step_by(guess.values.len().div_ceil(FOLLOWED).max(1)).collect();
    let (least, most) = least_and_most(some.iter().copied());
    let range = most - least;
    // Counts without a number are more than an encoder of a few bits has in a turn.
    let far = match guess.rad() {
        None if guess.unit == Some(Unit::Count) => true,
        rad => range * rad.unwrap_or(1.0) >= TAU,
    };
    let way: f64 = some.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
    let swings = (0.5 * (least + most)).abs() < ABOUT_ZERO * range && way > OFTEN * range;
    far && !swings
}
