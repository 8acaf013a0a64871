//! Which columns are generator and output.
//!
//! Names and units come first, then the joint that a name numbers, then what turns on before what swings about zero,
//! and last of all how straight a line two columns make: a motor torque that a robot computes from that of the joint
//! makes a straighter one than two encoders.

use std::cmp::Ordering;
use std::f64::consts::TAU;

use super::relation::{Slope, slope};
use super::turns::{Units, on_one_shaft, settle, units_of_pair};
use super::{Guess, Rival, Role};
use crate::measurement::{Family, Unit, least_and_most};

/// Rows in which a column is followed, at most.
const FOLLOWED: usize = 4000;
/// A column swings about zero if the middle of its range is off zero by less than this share of the range. *Guess*.
const ABOUT_ZERO: f64 = 0.1;
/// And if it goes through its range more often than this. *Guess*: a bench goes to and fro a few times.
const OFTEN: f64 = 4.0;
/// Rivals that are written out in notes; all are in `rivals`.
const SAID: usize = 3;

/// Two columns that may be generator and output.
struct Pair {
    generator: usize,
    output: usize,
    /// As they may be, the likeliest first; at least one.
    units: Vec<Units>,
    rank: PairRank,
}

/// The reasons for a pair: of two pairs the first reason that differs decides.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PairRank {
    /// In the order of [`WHY`], but for the last.
    reasons: [u8; WHY.len() - 1],
    /// How straight a line they make.
    straight: f64,
}

/// Why a pair goes before another: neither is a command; names say a shaft (2) or an angle (1) of each; both are of one
/// joint (2), that is open (1), or their numbers differ; the generator turns on; neither is computed from the other.
const WHY: [&str; 7] = [
    "they are measured, no command",
    "their names say so",
    "they are of one joint by their numbers",
    "they turn on, and do not swing about zero",
    "the others are one column times a number to the last digit, as what is computed is",
    "they have one unit",
    "they make the straighter line, which need not say much",
];

impl PairRank {
    fn cmp(&self, other: &PairRank) -> Ordering {
        self.reasons.cmp(&other.reasons).then(self.straight.total_cmp(&other.straight))
    }

    /// Why this one goes before another.
    fn before(&self, other: &PairRank) -> &'static str {
        let differs = self.reasons.iter().zip(&other.reasons).position(|(a, b)| a != b);
        WHY[differs.unwrap_or(WHY.len() - 1)]
    }
}

/// Generator and output, with their units; the ratio between them, and what they may be, too. `names` are those of a
/// mapping.
pub(super) fn pair(guesses: &mut [Guess], names: &[String], notes: &mut Vec<String>) -> (Option<f64>, Vec<Rival>) {
    let mut pairs = pairs(guesses);
    pairs.sort_by(|a, b| b.rank.cmp(&a.rank));
    let Some((best, others)) = pairs.split_first() else { return (None, Vec::new()) };
    let (g, o) = (best.generator, best.output);
    let units = best.units[0];
    // Where the file does not say the unit and several fit, it is asked.
    let asked = best.units.len() > 1;
    let mut rivals: Vec<Rival> = Vec::new();
    if asked {
        let why = "the file does not say in which units they are, or how many counts make a turn".to_owned();
        rivals.extend(best.units.iter().map(|units| rival(best, units, names, why.clone())));
        let options = rivals.iter().map(|rival| {
            let columns = rival.columns_option.clone().unwrap_or_default();
            format!("--columns {columns} makes the ratio {:.2}", rival.ratio)
        });
        let options: Vec<String> = options.collect();
        notes.push(format!(
            "columns {} and {} turn together, but {}: {}",
            g + 1,
            o + 1,
            rivals[0].why,
            options.join("; ")
        ));
    }
    let counts = rivals.len();
    for other in others {
        let level = other.rank.reasons[..2] == best.rank.reasons[..2];
        let same = |a: usize, b: usize| a == b || on_one_shaft(&guesses[a], &guesses[b]).is_some();
        // What shows the same two shafts once more is no rival.
        if level && !(same(other.generator, g) && same(other.output, o)) {
            rivals.push(rival(other, &other.units[0], names, best.rank.before(&other.rank).to_owned()));
        }
    }
    let unsure = rivals.len() > counts;
    let each = [(g, Role::Generator, o, units.generator), (o, Role::Output, g, units.output)];
    for (k, role, other, reading) in each {
        let by_name = guesses[k].role == role;
        if guesses[k].role == Role::Command {
            notes.push(format!("column {} is a command, which stands for the angle of the generator", k + 1));
        }
        guesses[k].role = role;
        guesses[k].used = true;
        let sure = match (unsure, by_name, asked) {
            (true, ..) => 0.5,
            (_, true, false) => 0.9,
            _ => 0.6,
        };
        let together = if asked {
            format!("turns with column {}", other + 1)
        } else {
            settle(&mut guesses[k], k, &reading, units.ratio, notes);
            format!("turns with column {}, {:.3} to 1", other + 1, units.ratio)
        };
        guesses[k].because(together, sure);
        if let Some(first) = rivals.get(counts) {
            guesses[k].why.push(format!("{} and {} may be meant as well", first.generator, first.output));
        }
    }
    for rival in rivals.iter().skip(counts).take(SAID) {
        let pass_on = rival.columns_option.as_ref().map_or(String::new(), |columns| format!(", --columns {columns}"));
        notes.push(format!(
            "columns {} and {} may be generator and output as well, {:.2} to 1{pass_on}; columns {} and {} are \
             proposed because {}",
            rival.generator,
            rival.output,
            rival.ratio,
            g + 1,
            o + 1,
            rival.why
        ));
    }
    if let Some(more) = rivals.len().checked_sub(counts + SAID).filter(|more| *more > 0) {
        notes.push(format!("{more} more pairs of columns may be generator and output: --json lists them"));
    }
    (Some(units.ratio).filter(|_| !asked), rivals)
}

fn rival(pair: &Pair, units: &Units, names: &[String], why: String) -> Rival {
    let (generator, output) = (names[pair.generator].clone(), names[pair.output].clone());
    let written = units.generator.written().zip(units.output.written());
    let columns_option = written.map(|(g, o)| format!("generator={generator}:{g},output={output}:{o}"));
    Rival { generator, output, ratio: units.ratio, columns_option, why }
}

/// The numbers of the joints whose generator and output are used.
pub(super) fn joints(guesses: &[Guess]) -> Vec<u32> {
    let used = guesses.iter().filter(|guess| guess.used && matches!(guess.role, Role::Generator | Role::Output));
    let mut joints: Vec<u32> = used.filter_map(|guess| guess.said.joint).collect();
    joints.dedup();
    joints
}

/// All pairs of columns that may be generator and output.
fn pairs(guesses: &[Guess]) -> Vec<Pair> {
    let angle = |guess: &Guess| {
        let role = matches!(guess.role, Role::Generator | Role::Output | Role::Unknown | Role::Command);
        let unit = guess.unit.is_none_or(|unit| unit.family() == Family::Angle);
        role && unit && !guess.said.aside && guess.moves() && guess.facts.every <= 1
    };
    let angles: Vec<usize> = (0..guesses.len()).filter(|k| angle(&guesses[*k])).collect();
    let mut pairs = Vec::new();
    for &generator in &angles {
        for &output in &angles {
            let (g, o) = (&guesses[generator], &guesses[output]);
            let shafts = |guess: &Guess| matches!(guess.role, Role::Generator | Role::Output);
            let joints = g.said.joint.zip(o.said.joint);
            let two_joints = joints.is_some_and(|(g, o)| g != o);
            let against = g.role == Role::Output || matches!(o.role, Role::Generator | Role::Command);
            if generator == output || against || two_joints && shafts(g) && shafts(o) {
                continue;
            }
            let Some(line) = slope(&o.values, &g.values, &g.of_file).filter(Slope::holds) else { continue };
            let units = units_of_pair(g, o, 1.0 / line.slope);
            if units.is_empty() {
                continue;
            }
            let named = |guess: &Guess| 2 * u8::from(shafts(guess)) + u8::from(guess.said.angle);
            let rank = PairRank {
                reasons: [
                    u8::from(g.role != Role::Command),
                    named(g) + named(o),
                    joints.map_or(1, |_| 2 * u8::from(!two_joints)),
                    u8::from(turns_on(g)),
                    u8::from(!is_computed(g, o, &line)),
                    u8::from(g.unit == o.unit),
                ],
                straight: -line.left,
            };
            pairs.push(Pair { generator, output, units, rank });
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
    let far = match (guess.unit, guess.rad()) {
        // Counts without a number: more of them than an encoder of a few bits has in a turn.
        (Some(Unit::Count), None) => true,
        (_, rad) => range * rad.unwrap_or(1.0) >= TAU,
    };
    let way: f64 = some.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
    let swings = (0.5 * (least + most)).abs() < ABOUT_ZERO * range && way > OFTEN * range;
    far && !swings
}

/// Whether one column is the other times a number, to the last digit that the file has.
fn is_computed(generator: &Guess, output: &Guess, line: &Slope) -> bool {
    let range = output.facts.most - output.facts.least;
    line.left * range <= output.facts.step.max(line.slope.abs() * generator.facts.step)
}
