//! Columns that begin anew: an angle after its turn, a counter after its last count.
//!
//! Such a column stays within a span, and from time to time leaps by nearly all of it, against its own motion. The span
//! is the size that makes the values go on evenly over the leaps. A counter may have any span: 2^16 of a register of 16
//! bits, 32 767 of one that a program sets back to zero at its largest value. Whoever reads a file finds columns that
//! begin anew with [`begins_anew`]; [`unwrap`] makes the angles of a log continuous.

use std::f64::consts::TAU;
use std::ops::Range;

use super::columns::{MappedColumn, Quantity, Unit};
use super::log::Log;
use crate::least_squares::Normal;
use flexspline_base::robust::{least_and_most, median_of, quantile_of};

/// Bits of registers.
const BITS: std::ops::RangeInclusive<i32> = 8..=32;
/// A column that begins anew covers at least this share of its span. *Guess*: a step over the border leaves out two
/// steps of the span at most.
const COVERED: f64 = 0.75;
/// Steps up to this share of the span are distinguishable from a leap. *Guess*.
const UNAMBIGUOUS: f64 = 0.4;
/// A step longer than this share of the span is a leap: 1 less what is unambiguous. *Guess*.
const LEAPS: f64 = 0.6;
/// A known span is that of the leaps within this share, or within their scatter. *Guess*: it is for motion that bends
/// near a leap.
const NEARLY: f64 = 0.005;
/// Rows on each side of a leap that show how the values go on. *Guess*: few, as motion bends.
const ROWS_AROUND: usize = 8;
/// Standard deviation of a value that is rounded to whole counts. *Source*: derived, 1/√12, exact to its digits.
const ROUNDED: f64 = 0.288_675;
/// A span is excluded beyond this number of standard deviations. *Source*: by convention.
const EXCLUDED: f64 = 3.0;
/// Whole counts are distinguishable if the standard deviation of the span is below this: half a count is two of them.
/// *Source*: derived.
const RESOLVES_COUNTS: f64 = 0.25;
/// The whole count nearest to the span is taken if the standard deviation of the span is below this, counts; above it,
/// nothing is known of single counts. *Guess*: then two or three numbers of counts are likely.
const NEAR_A_COUNT: f64 = 1.0;
/// This share of the leaps must have one size. *Guess*: the others are gaps and counts that were lost.
const AGREE: f64 = 0.8;
/// A span that no register has is believed from this number of leaps on: one leap may be anything. *Guess*: two that
/// agree are rarely chance.
const FEWEST_LEAPS: usize = 2;

/// The columns are exchanged if this share of what an exchange gives is there. *Guess*: clearance takes the rest of a
/// small motion.
const EXCHANGED: f64 = 0.75;
/// A step that differs from the one before by less than this share of a turn goes on as it did; where files are joined
/// without a time between them, it does not. *Guess*: half of what leaves the turn open.
const GOES_ON: f64 = 0.25;
/// Teeth do not skip by more than this number of motor turns in a row. *Guess*: two pitches are one turn, so that these
/// are seven pitches.
const MOST_SKIPPED: f64 = 3.5;

/// How a column begins anew.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Anew {
    /// The span after which it begins anew, in the unit of the values.
    pub span: f64,
    /// Times.
    pub times: usize,
    /// Whether some rows are so far apart that the way between them is not certain.
    pub ambiguous: bool,
}

impl Anew {
    /// A sentence on it: "begins anew after 32767 (8 times)".
    pub fn text(&self, unit: &str) -> String {
        // A turn in degrees is 360 to the last digit but one.
        format!("begins anew after {}{unit} ({} times)", (1e9 * self.span).round() / 1e9, self.times)
    }
}

/// Spans of the registers of n bits, counts.
pub(crate) fn registers() -> impl Iterator<Item = f64> {
    BITS.map(|bits| 2f64.powi(bits))
}

/// Whether values of this `range` stay within `span` and cover this share of it.
fn stays_within(range: f64, span: f64, covered: f64) -> bool {
    range <= span * (1.0 + 1e-6) && range >= covered * span
}

/// How `values` begin anew, if they do: after one of the known `spans`, in rising order, or, if they are `counts`,
/// after any number of them. `along` is the other angle, row by row: where the motion is uneven in time, it shows how
/// the values go on.
pub(crate) fn begins_anew(values: &[f64], spans: &[f64], counts: bool, along: Option<&[f64]>) -> Option<Anew> {
    let rows: Vec<usize> = (0..values.len()).filter(|row| values[*row].is_finite()).collect();
    let (least, most) = least_and_most(rows.iter().map(|row| values[*row]));
    let range = most - least;
    // A counter that is set to zero at either of its ends goes through twice its span.
    let leaps: Vec<usize> =
        (1..rows.len()).filter(|k| (values[rows[*k]] - values[rows[*k - 1]]).abs() > UNAMBIGUOUS * range).collect();
    if leaps.is_empty() || range <= 0.0 {
        return None;
    }
    let steps = || rows.windows(2).map(|pair| values[pair[1]] - values[pair[0]]);
    let found = |span: f64| {
        let times = steps().filter(|step| step.abs() > LEAPS * span).count();
        let ambiguous = steps().any(|step| (step - span * (step / span).round()).abs() > UNAMBIGUOUS * span);
        (times > 0).then_some(Anew { span, times, ambiguous })
    };
    let whole = counts && steps().all(|step| (step - step.round()).abs() <= 1e-6 * (1.0 + step.abs()));
    let measured = MeasuredSpan::of(values, &rows, &leaps, whole, along);
    let near =
        |span: f64| measured.is_none_or(|seen| (seen.span - span).abs() <= (NEARLY * span).max(EXCLUDED * seen.std));
    let known = spans.iter().copied().find(|span| stays_within(range, *span, COVERED) && near(*span));
    let Some(seen) = measured.filter(|seen| whole && seen.agree) else { return known.and_then(found) };
    // The register that the values fill is believed until the leaps exclude it.
    let believed = |span: &f64| seen.std >= RESOLVES_COUNTS || (seen.span - span).abs() <= EXCLUDED * seen.std;
    let nearest = Some(seen.span.round()).filter(|_| seen.std < NEAR_A_COUNT);
    known.filter(believed).or(nearest).and_then(found)
}

/// The span as the leaps show it.
#[derive(Debug, Clone, Copy)]
struct MeasuredSpan {
    /// In the unit of the values.
    span: f64,
    /// Its standard deviation.
    std: f64,
    /// Whether leaps enough agree, go against the motion, and begin at one place of the span: then it can speak against
    /// what registers have.
    agree: bool,
}

impl MeasuredSpan {
    /// The mean over the leaps of the step that makes the values around it go on in one straight line.
    fn of(values: &[f64], rows: &[usize], leaps: &[usize], whole: bool, along: Option<&[f64]>) -> Option<MeasuredSpan> {
        let rounded = if whole { ROUNDED } else { 0.0 };
        let mut seen: Vec<Leap> = Vec::new();
        for (k, at) in leaps.iter().enumerate() {
            let from = if k > 0 { leaps[k - 1] } else { 0 }.max(at.saturating_sub(ROWS_AROUND));
            let to = leaps.get(k + 1).copied().unwrap_or(rows.len()).min(at + ROWS_AROUND);
            let y = |k: usize| values[rows[k]];
            let by_row = Leap::into(*at, from..to, |k| k as f64, y, rounded);
            let by_other = along.and_then(|other| Leap::into(*at, from..to, |k| other[rows[k]], y, rounded));
            // A noisy angle flattens the slope: it is asked only if it is clearly the better one.
            let best = match (by_row, by_other) {
                (Some(row), Some(other)) if other.std < 0.7 * row.std => Some(other),
                (row, other) => row.or(other),
            };
            seen.extend(best);
        }
        let mut sizes: Vec<f64> = seen.iter().map(|leap| leap.size).collect();
        if sizes.is_empty() {
            return None;
        }
        let middle = median_of(&mut sizes);
        let kept: Vec<&Leap> =
            seen.iter().filter(|leap| (leap.size - middle).abs() <= 2.0 * EXCLUDED * leap.std.max(rounded)).collect();
        let weight = |leap: &Leap| 1.0 / leap.std.max(1e-9 * middle).powi(2);
        let sum: f64 = kept.iter().map(|leap| weight(leap)).sum();
        let span = kept.iter().map(|leap| weight(leap) * leap.size).sum::<f64>() / sum;
        let scatter = kept.iter().map(|leap| weight(leap) * (leap.size - span).powi(2)).sum::<f64>();
        let scatter = if kept.len() > 1 { (scatter / (kept.len() - 1) as f64).max(1.0) } else { 1.0 };
        // Where they begin, as a share of the span from the first: all over one border.
        let place = |leap: &Leap| (leap.border - kept[0].border) / span;
        let at_one_place = kept.iter().all(|leap| {
            let off = place(leap) - place(leap).round();
            off.abs() * span <= leap.step.abs().max(kept[0].step.abs()) + 1.0
        });
        let enough = kept.len() >= FEWEST_LEAPS && kept.len() as f64 >= AGREE * leaps.len() as f64;
        let agree = enough && kept.iter().all(|leap| leap.against) && at_one_place;
        Some(MeasuredSpan { span, std: (scatter / sum).sqrt(), agree })
    }
}

/// A leap between two rows.
#[derive(Debug, Clone, Copy)]
struct Leap {
    /// Size without the motion, positive.
    size: f64,
    std: f64,
    /// The value at which it begins or ends: the upper border of the span that is left, in the way of the motion.
    border: f64,
    /// Motion from row to row.
    step: f64,
    /// Whether it goes against the motion.
    against: bool,
}

impl Leap {
    /// Fits `y` by one slope in `x` and a step into the row `at`, over the rows `around` it.
    fn into(
        at: usize,
        around: Range<usize>,
        x: impl Fn(usize) -> f64,
        y: impl Fn(usize) -> f64,
        rounded: f64,
    ) -> Option<Leap> {
        let count = around.len();
        if at == around.start || count < 4 {
            return None;
        }
        let fit = Normal::of(3, count, |k, row| {
            let k = around.start + k;
            row.copy_from_slice(&[1.0, f64::from(u8::from(k >= at)), x(k) - x(at)]);
            (y(k) - y(at), 1.0)
        })?;
        let [_, step, slope] = fit.values()[..] else { return None };
        let variance = (fit.misfit() / (count as f64 - 3.0)).max(rounded * rounded);
        let (std, moved) = ((variance * fit.inverse[(1, 1)]).sqrt(), slope * (x(at) - x(at - 1)));
        let leap =
            Leap { size: step.abs(), std, border: y(at - 1) + 0.5 * moved, step: moved, against: step * slope < 0.0 };
        (std.is_finite() && slope.is_finite()).then_some(leap)
    }
}

/// Values made continuous where they begin anew after `span`; what is missing stays so.
pub(crate) fn continued(values: &mut [f64], span: f64) {
    let mut last = f64::NAN;
    for value in values.iter_mut().filter(|value| value.is_finite()) {
        if last.is_finite() {
            *value -= span * ((*value - last) / span).round();
        }
        last = *value;
    }
}

/// Makes angles continuous that begin anew: counters where the steps between leave no doubt, and what stays within a
/// turn.
pub(super) fn unwrap(log: &mut Log, columns: &[MappedColumn], ratio: f64, notes: &mut Vec<String>) {
    // The output first: it is slow, and shows how far a fast generator has turned.
    for channel in [Quantity::Output, Quantity::Orientation, Quantity::Generator] {
        let Some(column) = columns.iter().find(|column| column.quantity == channel) else { continue };
        let Some(mut values) = log.take(channel) else { continue };
        let follower = if channel == Quantity::Generator { log.output_or_error() } else { Quantity::Generator };
        if let Some((span, what)) = counter(&values, column, log.get(follower)) {
            continued(&mut values, span);
            notes.push(format!("{} {what}: it was made continuous", column.name));
        } else if within_a_turn(&values, channel, ratio, log) {
            let output = log.get(Quantity::Output).filter(|_| channel == Quantity::Generator);
            let helped = "turns are counted by the output angle";
            let count = output.map_or("the count of its turns is not certain", |_| helped);
            let ambiguous = along(&mut values, log, ratio, output);
            notes.push(format!("{} is within one turn: it was made continuous", column.name));
            if ambiguous {
                let name = &column.name;
                notes.push(format!("{name} moves by more than {UNAMBIGUOUS} turns from row to row: {count}"));
            }
        }
        log.put(channel, values);
    }
}

/// The span after which a counter begins anew, rad, and a sentence on it; none for a single turn, which the other angle
/// helps.
fn counter(values: &[f64], column: &MappedColumn, other: Option<&[f64]>) -> Option<(f64, String)> {
    let count_rad = (column.reading.gain * column.reading.unit.factor()).abs();
    let counts: Vec<f64> =
        Some(values).filter(|_| column.reading.unit == Unit::Count)?.iter().map(|value| value / count_rad).collect();
    let anew = begins_anew(&counts, &registers().collect::<Vec<_>>(), true, other).filter(|anew| !anew.ambiguous)?;
    let span = anew.span * count_rad;
    ((span / TAU - 1.0).abs() >= 1e-9).then(|| (span, anew.text(" counts")))
}

/// Whether an angle stays within one turn and begins anew, by its steps or as the output has travelled farther.
fn within_a_turn(values: &[f64], channel: Quantity, ratio: f64, log: &Log) -> bool {
    let span_of = |values: &[f64]| {
        let (least, most) = least_and_most(values.iter().copied());
        most - least
    };
    let output = log.get(Quantity::Output).filter(|_| channel == Quantity::Generator);
    let travel = output.map_or(0.0, |output| span_of(output) * ratio.abs());
    // An output that turns by the ratio times as much is the generator: columns taken for each other, and not an angle
    // that began anew.
    let leaps = values.windows(2).any(|pair| (pair[1] - pair[0]).abs() > 0.5 * TAU);
    let exchanged = !leaps && travel > EXCHANGED * ratio.powi(2) * span_of(values);
    let again = |row: usize| (values[row] - values[row - 1]).abs() > LEAPS * TAU && log.continues(row);
    !exchanged && stays_within(span_of(values), TAU, COVERED) && (travel > 1.5 * TAU || (1..values.len()).any(again))
}

/// Makes `values` continuous. `output`, if given, is continuous and turns `ratio` times slower; it counts turns where
/// one row is too far from the next, where a session begins, and at the very first row. Returns whether rows are too
/// far apart.
fn along(values: &mut [f64], log: &Log, ratio: f64, output: Option<&[f64]>) -> bool {
    let nearest = |d: f64| d - TAU * (d / TAU).round();
    let mut steps: Vec<f64> = match output {
        Some(output) => output.windows(2).map(|o| ((o[1] - o[0]) * ratio).abs()).collect(),
        None => values.windows(2).map(|v| nearest(v[1] - v[0]).abs()).collect(),
    };
    let fast = quantile_of(&mut steps, 0.99) > UNAMBIGUOUS * TAU;
    if let Some(output) = output {
        values[0] += TAU * ((output[0] * ratio - values[0]) / TAU).round();
    }
    let mut last = 0.0;
    for row in 1..values.len() {
        let plain = nearest(values[row] - values[row - 1]);
        let expected = output.map_or(plain, |output| (output[row] - output[row - 1]) * ratio);
        let far = (expected - plain).abs() > MOST_SKIPPED * TAU;
        let step = match output {
            // What goes on as it did needs no help: there it is the output that may skip, by some teeth.
            Some(_) if fast || far || !log.continues(row) || (plain - last).abs() > GOES_ON * TAU => {
                expected + nearest(values[row] - values[row - 1] - expected)
            }
            _ => plain,
        };
        values[row] = values[row - 1] + step;
        last = step;
    }
    fast
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counters(values: &[f64]) -> Option<Anew> {
        begins_anew(values, &registers().collect::<Vec<_>>(), true, None)
    }

    /// An angle in counts that goes to and fro at several paces.
    fn motion(rows: i32) -> Vec<f64> {
        let mut at = 300.0;
        (0..rows)
            .map(|k| {
                at += [23.4, -23.4, 34.1, 34.1, -34.1, 19.3, -19.3, 27.7][(k / (rows / 8)).min(7) as usize];
                at
            })
            .collect()
    }

    fn span(values: &[f64]) -> Option<f64> {
        counters(values).filter(|anew| !anew.ambiguous).map(|anew| anew.span)
    }

    #[test]
    fn an_overflow_is_told_from_a_jump() {
        let sweep =
            |step: i64| -> Vec<f64> { (0..2000i64).map(|k| ((k * step + 40_000) % 65_536 - 32_768) as f64).collect() };
        assert_eq!(counters(&sweep(1000)).map(|anew| (anew.span, anew.times)), Some((65_536.0, 31)));
        // Too fast to see which way.
        assert!(counters(&sweep(30_000)).is_none_or(|anew| anew.ambiguous));
        // A jump is no overflow, whatever its size.
        for size in [33_000.0, 50_000.0, 65_000.0] {
            let jump: Vec<f64> = (0..2000).map(|k| if k < 1000 { f64::from(k % 7) } else { size }).collect();
            assert_eq!(counters(&jump), None, "{size}");
        }
        let steady: Vec<f64> = (0..2000).map(|k| 32.0 * f64::from(k)).collect();
        assert_eq!(counters(&steady), None);
    }

    #[test]
    fn a_counter_may_have_any_number_of_states() {
        for states in [65_536.0, 32_768.0, 32_767.0, 32_766.0, 65_535.0, 10_000.0, 14_400.0] {
            let values: Vec<f64> = motion(32_000).iter().map(|at| at.round().rem_euclid(states)).collect();
            assert_eq!(span(&values), Some(states), "{states}");
            // From minus half to plus half.
            let half = (states / 2.0).floor();
            let values: Vec<f64> =
                motion(32_000).iter().map(|at| (at.round() + half).rem_euclid(states) - half).collect();
            assert_eq!(span(&values), Some(states), "{states}, about zero");
        }
    }

    #[test]
    fn a_counter_that_is_set_to_zero_at_both_ends_is_continued() {
        // A pulse counter with the limits ±32 767: it is set to zero where it reaches either.
        let limit = 32_767.0;
        let mut motion = motion(32_000);
        motion.iter_mut().for_each(|at| *at = (*at - 60_000.0).round());
        let values: Vec<f64> = motion.iter().map(|at| at % limit).collect();
        assert!(values.iter().any(|at| *at < -32_000.0) && values.iter().any(|at| *at > 10_000.0));
        assert_eq!(span(&values), Some(limit));
        let mut made = values;
        continued(&mut made, limit);
        let off = made[0] - motion[0];
        assert!(made.iter().zip(&motion).all(|(made, at)| made - at == off));
    }

    #[test]
    fn equal_leaps_at_other_places_are_no_counter() {
        // An encoder that loses 9000 counts five times, each time elsewhere.
        let mut lost = 0.0;
        let values: Vec<f64> = (0..4000)
            .map(|k| {
                lost += if k % 750 == 700 { 9000.0 } else { 0.0 };
                (23.4 * f64::from(k) % 9973.0).round() - lost + 0.1 * lost
            })
            .collect();
        assert_eq!(span(&values), None);
    }

    #[test]
    fn where_a_motion_is_uneven_the_other_angle_tells_the_last_count() {
        let mut random = fastrand::Rng::with_seed(9);
        let mut at = 20_000.0;
        let motion: Vec<f64> = (0..3000)
            .map(|_| {
                at += 20.0 + 12.0 * (random.f64() - 0.5);
                at
            })
            .collect();
        let values: Vec<f64> = motion.iter().map(|at| at.round().rem_euclid(32_767.0)).collect();
        let other: Vec<f64> = motion.iter().map(|at| at / 101.0 / 4096.0).collect();
        let helped = begins_anew(&values, &registers().collect::<Vec<_>>(), true, Some(&other)).unwrap();
        assert_eq!(helped.span, 32_767.0);
    }

    #[test]
    fn two_files_joined_without_a_time_are_made_continuous_without_a_jump_of_a_turn() {
        let ratio = 100.0;
        // The drive went on by 0.7 output turns between the two.
        let psi: Vec<f64> = (0..2000).map(|k| 0.11 * f64::from(k) + if k < 1000 { 0.0 } else { 70.3 * TAU }).collect();
        let output: Vec<f64> = psi.iter().map(|psi| psi / ratio).collect();
        let mut log = Log::default();
        log.line = (0..2000).collect();
        let mut wrapped: Vec<f64> = psi.iter().map(|psi| psi.rem_euclid(TAU)).collect();
        along(&mut wrapped, &log, ratio, Some(&output));
        let apart = wrapped.iter().zip(&psi).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-6, "{apart}");
        // Teeth that skip by two pitches, which is a turn of the motor, stay where they are: in the output.
        let skipped: Vec<f64> =
            (0..2000).map(|k| 0.0011 * f64::from(k) + if k < 1000 { 0.0 } else { TAU / ratio }).collect();
        let mut wrapped: Vec<f64> = (0..2000).map(|k| (0.11 * f64::from(k)).rem_euclid(TAU)).collect();
        along(&mut wrapped, &log, ratio, Some(&skipped));
        assert!((wrapped[1999] - wrapped[0] - 0.11 * 1999.0).abs() < 1e-6);
    }
}
