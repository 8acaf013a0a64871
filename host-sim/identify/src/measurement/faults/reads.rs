//! The two angles are not read at one instant.
//!
//! Between two readings the drive moves on: an instant that is off by τ puts the error off by τ times the speed. Where
//! τ scatters, the scatter of neighbouring rows grows with the speed, its square by (τ · speed)²; at rest nothing
//! shows. Some loggers read single rows late, by far more than the others and always to the same side.
//!
//! The scatter of a row is its residual when a cubic goes through the rows around it. Rows then weigh what
//! noise and scatter together leave of them; rows that were read late are left out.
//!
//! Where it is the generator that is read at scattered instants, or in coarse counts, its angle shows it: what it is
//! off by is in the error, over the ratio, with the sign turned, at any pace. An output that follows a generator which
//! really moves so has no such error.

use std::borrow::Cow;

use super::outliers::repeat_with_position;
use super::resolution::seen;
use super::state::StateModel;
use super::{ARCSEC, Findings, farthest, leave_out_rows, rows_of, throughout};
use crate::least_squares::Normal;
use crate::measurement::Session;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{Fault, FaultName, Measures, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log;
use flexspline_base::robust::{MAD_TO_STD, median_of, quantile_of};

/// Classes of speed, of equally many rows. *Guess*: enough for a line over the square of the speed.
const CLASSES: usize = 14;
/// Fewest rows of a class. *Guess*: they give a standard deviation to 8 %.
const CLASS_ROWS: usize = 80;
/// Largest speed of a class over its least one, … *Guess*: the scatter within a class then grows by no more.
const WIDEST: f64 = 1.3;
/// … and the share of the largest speed of all that is added to it. *Guess*: classes about rest are of no ratio.
const NARROWEST: f64 = 0.05;
/// Scatter that grows with the speed is reported from this on, rad at the output, at the speed that a twentieth of the
/// rows exceed: below, encoders of common loops scatter by themselves. *Chosen* so that loops polled within 20 µs are
/// not named.
const LEAST_RAD: f64 = 1.0 * ARCSEC;
/// And from this share of the noise at rest on. *Guess*.
const LEAST_OF_NOISE: f64 = 0.3;
/// Fall of χ² by the scatter that grows with the speed: five standard deviations. *Source*: by definition.
const CERTAIN: f64 = 25.0;
/// Classes are no better known than this share of their variance: steps and teeth are in it, too. *Guess*.
const CLASS_DOUBT: f64 = 0.05;
/// Ripple of the teeth is smooth in slow rows and scatter in fast ones: half of it where a tooth passes in this many
/// rows. *Guess*.
const TOOTH_ROWS: f64 = 6.0;
/// A row is read late if it is off by this multiple of what its speed lets expect. *Guess*: lowered from 5, which
/// normal rows exceed in one case of two million, to one of sixteen thousand.
const LATE: f64 = 4.0;
/// Late rows are reported from this share of the rows in motion on… *Guess*: sixty times what normal rows beyond
/// [`LATE`] make.
const LATE_SHARE: f64 = 0.004;
/// …and from this number on. *Guess*: enough to see that they are off to one side.
const LATE_ROWS: usize = 30;
/// Of them this share is off to the same side, seen in the direction of motion. *Guess*: thirty rows at random are so
/// in one case of seven hundred.
const ONE_SIDED: f64 = 0.8;
/// They are rarer at rest than in motion, by this factor… *Guess*: at rest none shows but noise.
const RARER_AT_REST: f64 = 0.3;
/// …and in motion is above this share of the speed that a twentieth of the rows exceed, … *Guess*: slower, a late row
/// hardly shows.
const IN_MOTION: f64 = 0.3;
/// …at rest below this one. *Guess*: a tenth of what counts as motion.
const AT_REST: f64 = 0.03;
/// More late rows than this are no late rows. *Guess*: more than a third are no exceptions.
const MOST_LATE: f64 = 0.35;
/// Late rows that cannot be distinguished from others are up to this many times those that can. *Guess*.
const UNSEEN: f64 = 2.0;
/// Rows in which the generator turns by more do not follow the waves of a drive, rad. *Guess*.
const FOLLOWED_RAD: f64 = 0.25;
/// A step of the time by more than this many usual ones is a pause: rows on both sides of it, as of a bench that goes
/// from stop to stop, do not show how they are read. *Guess*: a missing row is a step of two.
const PAUSE: f64 = 2.5;
/// Readings that scatter independently: neighbouring values of the scatter of a row correlate by −56/70, within this. A
/// swing has more or less. *Guess* for the width; −56/70 is derived from the weights 1, −4, 6, −4, 1.
const WHITE: f64 = 0.08;
/// Rows that are late one after another, at most. *Guess*: a third one would be a stall.
const LONGEST_RUN: usize = 2;
/// Scatter of the error against that of the generator's angle over the ratio is −1 within this, where it is that angle
/// that is misread: what other noise of the angle and motion that is real leave of it. *Guess*.
const MISREAD: f64 = 0.15;
/// Share of the rows that decide it: those that are farthest off are something else. *Guess*.
const NEAR: f64 = 0.99;
/// Quantile of absolute values that a third of them, being far off, hardly moves, and its value for the standard normal
/// distribution. *Guess* for the quantile; the value is exact to its digits.
const LOW: (f64, f64) = (0.15, 0.1891);

/// Speeds (rad of the output in a row), and the scatter that they come with.
struct Class {
    speed: f64,
    /// Of the error of one row, rad².
    variance: f64,
    rows: f64,
}

/// Shorter sessions show nothing. *Guess*: a scatter takes five rows, and the first and last rows have none.
const SHORTEST: usize = 9;

/// The rows of a session that are not late, and how fast each row is; none of a short session.
struct Reads<'a> {
    error: Cow<'a, [f64]>,
    /// The generator's angle over the ratio, rad.
    turned: Vec<f64>,
    /// Change of the output from row to row, rad.
    speed: Vec<f64>,
    /// Faster rows are too far apart to separate their scatter from waves of the drive.
    fastest: f64,
    /// Pauses before each row.
    pauses: Vec<usize>,
    /// Rows, in order.
    good: Vec<usize>,
}

impl<'a> Reads<'a> {
    fn new(session: &'a Session, gear: &Gear) -> Self {
        let rows = if session.len() < SHORTEST { 0 } else { session.len() };
        let psi = &session.generator_rad[..rows];
        let speed = (0..rows)
            .map(|k| {
                let (a, b) = (k.saturating_sub(2), (k + 2).min(rows - 1));
                (psi[b] - psi[a]) / ((b - a).max(1) as f64 * gear.ratio)
            })
            .collect();
        let fastest = FOLLOWED_RAD / gear.ratio.abs();
        let turned = psi.iter().map(|psi| psi / gear.ratio).collect();
        let error = Cow::Borrowed(&session.error_rad[..rows]);
        Reads { error, turned, speed, fastest, pauses: pauses(session), good: (0..rows).collect() }
    }

    /// Whether there is no pause from one row to another.
    fn goes_on(&self, from: usize, to: usize) -> bool {
        self.pauses[from] == self.pauses[to]
    }

    /// By how much some good rows (a run from place `from` among them) are off the cubic through the two good rows
    /// before and after, and by how much these two pairs differ; nothing near the ends.
    fn off(&self, from: usize, run: usize) -> Option<(Vec<f64>, f64)> {
        let at = |place: usize| self.good.get(place).copied();
        let around = [at(from.checked_sub(2)?)?, at(from - 1)?, at(from + run)?, at(from + run + 1)?];
        // Neighbours in time, not across what was left out.
        if around[3] - around[0] > 2 * (run + 4) || !self.goes_on(around[0], around[3]) {
            return None;
        }
        let x: [f64; 4] = std::array::from_fn(|k| (around[k] - around[0]) as f64);
        let cubic = |at: f64| -> f64 {
            (0..4)
                .map(|j| {
                    let weight: f64 = (0..4).filter(|k| *k != j).map(|k| (at - x[k]) / (x[j] - x[k])).product();
                    weight * self.error[around[j]]
                })
                .sum()
        };
        let off =
            (from..from + run).map(|place| self.error[self.good[place]] - cubic((self.good[place] - around[0]) as f64));
        let apart =
            0.5 * (self.error[around[2]] + self.error[around[3]] - self.error[around[1]] - self.error[around[0]]);
        Some((off.collect(), apart))
    }

    /// Row and scatter of each good row whose four neighbours are good, but for those that are too fast.
    fn scatter(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let slow = |row: usize| self.speed[row].abs() <= self.fastest;
        self.fives().filter(move |rows| slow(rows[2])).map(|rows| (rows[2], off_cubic(&self.error, rows)))
    }

    /// Scatter of the error and of the generator's angle over the ratio, and speed, of each row at any speed.
    fn both(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.fives().map(|rows| [off_cubic(&self.error, rows), off_cubic(&self.turned, rows), self.speed[rows[2]]])
    }

    /// Five good rows one after another.
    fn fives(&self) -> impl Iterator<Item = &[usize]> + '_ {
        self.good.windows(5).filter(|rows| rows[4] - rows[0] == 4 && self.goes_on(rows[0], rows[4]))
    }
}

/// Distance of the middle one of five rows from the cubic through the others: (-1, 4, -6, 4, -1) / 6 of the values.
fn off_cubic(values: &[f64], rows: &[usize]) -> f64 {
    let e = |k: usize| values[rows[k]];
    (6.0 * e(2) - 4.0 * (e(1) + e(3)) + e(0) + e(4)) / 6.0
}

/// The generator's angle is misread.
struct Misread {
    /// Noise in addition to it, rad.
    noise: f64,
    /// Scatter of the instants at which it is read, rows.
    jitter_rows: f64,
    /// Standard deviation of what it is off by, rad at the output.
    off: f64,
}

impl Misread {
    /// By the scatter of both angles. Few rows that are far off decide nothing.
    fn of(reads: &[Reads<'_>], fast: f64) -> Option<Misread> {
        let rows: Vec<[f64; 3]> = reads.iter().flat_map(Reads::both).collect();
        let most = |of: usize| quantile_of(&mut rows.iter().map(|row| row[of].abs()).collect::<Vec<f64>>(), NEAR);
        let [of_error, of_turned] = [most(0), most(1)];
        let near = || rows.iter().filter(|[error, turned, _]| error.abs() <= of_error && turned.abs() <= of_turned);
        let [mut xx, mut xy, mut yy, mut vv, mut count] = [0.0; 5];
        for [error, turned, speed] in near() {
            xx += turned * turned;
            xy += turned * error;
            yy += error * error;
            vv += speed * speed;
            count += 1.0;
        }
        if xx <= 0.0 || vv <= 0.0 || count < CLASS_ROWS as f64 {
            return None;
        }
        let (slope, left) = (xy / xx, (yy - xy * xy / xx).max(0.0));
        let noise = (left / count / SCATTER_GAIN).sqrt();
        let jitter_rows = (xx / vv / SCATTER_GAIN).sqrt();
        let scatter = jitter_rows * fast;
        // Neighbouring scatters share rows: they are worth about a third.
        let certain = count / 3.0 * (xy * xy / xx) / left.max(f64::MIN_POSITIVE) > CERTAIN;
        let is_misread = (slope + 1.0).abs() < MISREAD && certain && scatter > LEAST_RAD.max(LEAST_OF_NOISE * noise);
        is_misread.then_some(Misread { noise, jitter_rows, off: (xx / count / SCATTER_GAIN).sqrt() })
    }
}

/// How many pauses there are before each row; none without time.
fn pauses(session: &Session) -> Vec<usize> {
    let Some(time) = &session.time_s else { return vec![0; session.len()] };
    let steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let longest = PAUSE * median_of(&mut steps.clone());
    let mut pauses = 0;
    let after = steps.iter().map(|step| {
        pauses += usize::from(*step > longest);
        pauses
    });
    [0].into_iter().chain(after).take(time.len()).collect()
}

/// Variance of the scatter of a row over that of its error. *Source*: derived, the sum of the squares of 1, −4, 6, −4,
/// 1 over that of the middle one.
const SCATTER_GAIN: f64 = 70.0 / 36.0;

/// Scatter by speed, of classes with equally many rows. `spread` makes a standard deviation of numbers, which it may
/// overwrite.
fn classes(reads: &[Reads<'_>], spread: impl Fn(&mut [f64]) -> f64) -> Vec<Class> {
    let mut rows: Vec<(f64, f64)> =
        reads.iter().flat_map(|of| of.scatter().map(|(row, off)| (of.speed[row].abs(), off))).collect();
    rows.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let size = rows.len().div_ceil(CLASSES).max(CLASS_ROWS);
    let fastest = rows.last().map_or(0.0, |(speed, _)| *speed);
    // A bench that turns at one pace passes the others on its ramps alone: few rows, and they count.
    let mut begun = (0, 0.0);
    rows.chunk_by(|_, (speed, _)| {
        begun.0 += 1;
        let full = begun.0 >= size || begun.0 >= CLASS_ROWS && *speed > WIDEST * begun.1 + NARROWEST * fastest;
        if full {
            begun = (0, *speed);
        }
        !full
    })
    .filter(|class| class.len() >= CLASS_ROWS / 2)
    .map(|class| {
        let mut off: Vec<f64> = class.iter().map(|(_, off)| off.abs()).collect();
        let square = class.iter().map(|(speed, _)| speed * speed).sum::<f64>() / class.len() as f64;
        let variance = spread(&mut off).powi(2) / SCATTER_GAIN;
        Class { speed: square.sqrt(), variance, rows: class.len() as f64 }
    })
    .collect()
}

/// Noise at rest, rad, and scatter of the time between the readings, in rows: what `classes` show of both; and the fall
/// of χ² by the latter.
fn fit(classes: &[Class], tooth_speed: f64) -> (f64, f64, f64) {
    let floor = classes.iter().map(|class| class.variance).fold(f64::INFINITY, f64::min).max(1e-30);
    let least_speed = classes.iter().map(|class| class.speed).fold(0.0, f64::max).max(1e-30);
    // Noise, what grows with the square of the speed, and ripple of teeth that the rows are too far apart to follow.
    let columns = |class: &Class| {
        let fast = (class.speed / tooth_speed).powi(2);
        [1.0, (class.speed / least_speed).powi(2), fast / (1.0 + fast)]
    };
    // Neighbouring scatters share rows: a class is worth about a third of its rows. A median deviation is known to 1.17
    // / sqrt(n).
    let weight = |class: &Class| {
        let doubt = (2.0 * 1.17f64).powi(2) * 3.0 / class.rows + CLASS_DOUBT * CLASS_DOUBT;
        1.0 / (doubt * class.variance.max(floor).powi(2))
    };
    let solve = |kept: [bool; 3]| -> Option<([f64; 3], f64)> {
        let of: Vec<usize> = (0..3).filter(|k| kept[*k]).collect();
        let fit = Normal::of(of.len(), classes.len(), |k, row| {
            let x = columns(&classes[k]);
            row.iter_mut().zip(&of).for_each(|(to, k)| *to = x[*k]);
            (classes[k].variance, weight(&classes[k]))
        })?;
        let mut values = [0.0; 3];
        of.iter().zip(fit.values()).for_each(|(k, value)| values[*k] = value);
        values.iter().all(|value| *value >= 0.0).then(|| (values, fit.misfit()))
    };
    let best = |all: &[[bool; 3]]| {
        all.iter()
            .filter_map(|kept| solve(*kept))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or(([floor, 0.0, 0.0], 0.0))
    };
    let (values, misfit) = best(&[[true, true, false], [true, false, false], [true, true, true], [true, false, true]]);
    let (_, without) = best(&[[true, false, false], [true, false, true]]);
    (values[0].max(0.0).sqrt(), values[1].max(0.0).sqrt() / least_speed, without - misfit)
}

/// How the rows are read.
struct HowRead {
    /// Rows that are off by far, with how far, session by session.
    late: Vec<Vec<(usize, f64)>>,
    /// Whether these were read late.
    some_are_late: bool,
    /// Whether the time between the readings scatters.
    jitters: bool,
    /// Noise at rest, rad.
    noise: f64,
    /// Scatter of the time between the readings, rows.
    jitter_rows: f64,
}

impl HowRead {
    /// Where the generator is known to be misread, that is the scatter.
    fn of(
        reads: &mut [Reads<'_>],
        misread: Option<&Misread>,
        (fast, tooth_speed): (f64, f64),
        sessions: &[Session],
        gear: &Gear,
    ) -> HowRead {
        let mut late: Vec<Vec<(usize, f64)>> = vec![Vec::new(); reads.len()];
        // Few rows that stand out at all are no late rows: most logs end here.
        let low = |off: &mut [f64]| quantile_of(off, LOW.0) / LOW.1;
        let mut known = classes(reads, low);
        let stand_out =
            |of: &Reads<'_>| of.scatter().filter(|(row, off)| off.abs() > LATE * expected(&known, of, *row)).count();
        let standing_out = reads.iter().map(stand_out).sum::<usize>();
        let rows: usize = reads.iter().map(|of| of.error.len()).sum();
        if standing_out >= LATE_ROWS && standing_out as f64 > LATE_SHARE * rows as f64 {
            for run in [1, 1, 1, LONGEST_RUN, 1] {
                for (of, late) in reads.iter_mut().zip(&mut late) {
                    late.extend(read_late(of, &known, run));
                }
                known = classes(reads, low);
            }
        }
        late.iter_mut().for_each(|late| late.sort_unstable_by_key(|(row, _)| *row));
        let some_are_late = are_late(reads, &late, fast.min(FOLLOWED_RAD / gear.ratio.abs()), sessions, gear);
        if !some_are_late {
            reads.iter_mut().for_each(|of| of.good = (0..of.error.len()).collect());
        }
        if let Some(&Misread { noise, jitter_rows, .. }) = misread {
            return HowRead { late, some_are_late, jitters: true, noise, jitter_rows };
        }
        let (noise, jitter_rows, certain) = fit(&classes(reads, |off| MAD_TO_STD * median_of(off)), tooth_speed);
        let scatter = jitter_rows * fast;
        let jitters = certain > CERTAIN && scatter > LEAST_RAD.max(LEAST_OF_NOISE * noise) && is_white(reads, fast);
        HowRead { late, some_are_late, jitters, noise, jitter_rows }
    }
}

/// Finds angles that are not read at one instant: rows weigh what their speed leaves of them, and rows that were read
/// late are left out.
pub(in crate::measurement) fn check(sessions: &mut [Session], gear: &Gear, findings: &mut Findings) {
    let rows = rows_of(sessions);
    if rows < CLASSES * CLASS_ROWS {
        return;
    }
    let mut reads: Vec<Reads<'_>> = sessions.iter().map(|session| Reads::new(session, gear)).collect();
    let mut speeds: Vec<f64> = reads.iter().flat_map(|of| of.speed.iter().map(|speed| speed.abs())).collect();
    let full = quantile_of(&mut speeds, 0.95);
    if full == 0.0 {
        return;
    }
    // By what was measured alone: waves of a fast drive, once they are fitted, follow what its angle is misread by.
    let misread = Misread::of(&reads, full);
    if misread.as_ref().is_some_and(|misread| is_of_counts(sessions, gear, misread.off)) {
        drop(reads);
        sessions.iter_mut().for_each(|session| session.loudness = Some(vec![1.0; session.len()]));
        return;
    }
    // Nothing else shows at a speed that rows do not follow.
    let fast = if misread.is_some() { full } else { full.min(FOLLOWED_RAD / gear.ratio.abs()) };
    let pitch = gear.tooth_pitch_rad.unwrap_or(std::f64::consts::PI / gear.ratio.abs());
    // A tooth of either wheel passes in a turn of the generator over its number: in a pitch of the output over the
    // ratio.
    let speeds = (fast, pitch / gear.ratio.abs() / TOOTH_ROWS);
    let mut found = HowRead::of(&mut reads, misread.as_ref(), speeds, sessions, gear);
    if !found.some_are_late && !found.jitters {
        return;
    }
    // Waves of the drive that fast rows are too far apart to follow scatter as well: once more without what its state
    // explains.
    let state = StateModel::new(sessions, gear);
    if let Some(fit) = state.fit(&[]) {
        for (session, of) in reads.iter_mut().enumerate().filter(|(_, of)| !of.speed.is_empty()) {
            of.error = Cow::Owned(state.left(&fit, session, &[]));
            of.good = (0..of.speed.len()).collect();
        }
        found = HowRead::of(&mut reads, misread.as_ref(), speeds, sessions, gear);
    }
    let HowRead { late, some_are_late, jitters, noise, jitter_rows } = found;
    if !some_are_late && !jitters {
        return;
    }
    let scatter = jitter_rows * fast;
    // Rows that are late by less than can be detected stay: as many again, and as late, on the mean.
    let mut late_s: Vec<f64> = reads
        .iter()
        .zip(&late)
        .flat_map(|(of, late)| late.iter().map(|(row, off)| (off / of.speed[*row].abs().max(0.3 * fast)).abs()))
        .collect();
    let late_rows_each = median_of(&mut late_s);
    let speed: Vec<Vec<f64>> = reads.into_iter().map(|of| of.speed).collect();
    let late_rows: usize = if some_are_late { late.iter().map(Vec::len).sum() } else { 0 };
    let late_share = late_rows as f64 / rows as f64;
    let period_s = period_s(sessions);
    let jitter_ms = period_s.map(|period_s| 1e3 * period_s * jitter_rows).filter(|_| jitters);
    let mut said = Vec::new();
    if jitters {
        let of_time = jitter_ms.map_or(format!("{jitter_rows:.4} rows"), |ms| format!("{ms:.3} ms"));
        said.push(format!(
            "the time between them scatters by {of_time}, {:.1} arcsec at full speed beside {:.1} of noise: fast rows \
             are weighted down, to {:.2} of the worth of a row at rest",
            scatter / ARCSEC,
            noise / ARCSEC,
            noise * noise / (noise * noise + scatter * scatter)
        ));
    }
    let latest = farthest(late.iter().flatten().map(|(_, off)| *off)).abs();
    if some_are_late {
        said.push(format!(
            "{late_rows} rows ({:.1} %) are read late, by up to {:.0} arcsec: they are left out",
            100.0 * late_share,
            latest / ARCSEC
        ));
    }
    let late_said = Some(late_rows as u64).filter(|_| some_are_late);
    let fault = throughout(sessions, FaultName::ReadJitter).map(|fault| Fault {
        measures: Measures { jitter_ms, late_rows: late_said, ..Measures::default() },
        size_arcsec: Some(if jitters { scatter } else { latest } / ARCSEC),
        ..fault
    });
    findings.add(fault, None::<Quantity>, Treatment::Masked, |_| {
        format!("the two angles are not read at one instant: {}", said.join("; "))
    });
    let jitter_rows = if jitters { jitter_rows } else { 0.0 };
    let unsure_s = (jitter_rows + UNSEEN * late_share * late_rows_each) * period_s.unwrap_or(1.0);
    sessions.iter_mut().for_each(|session| session.unsure_s = unsure_s);
    weigh(sessions, &speed, noise.max(1e-3 * scatter), jitter_rows);
    if some_are_late {
        leave_out_rows(sessions, late.iter().map(|late| late.iter().map(|late| late.0)));
    }
}

/// Whether what the generator's angle is off by, rad at the output, is mostly that it is read in counts: that is its
/// resolution, and known as such.
fn is_of_counts(sessions: &[Session], gear: &Gear, off: f64) -> bool {
    let counts = seen(sessions, gear, false).into_iter().filter(|(channel, _)| *channel == Quantity::Generator);
    counts.into_iter().any(|(_, step)| step * step / 12.0 > 0.5 * off * off)
}

/// Whether the scatter of rows in motion is that of readings which know nothing of each other.
fn is_white(reads: &[Reads<'_>], fast: f64) -> bool {
    let pairs = || {
        reads.iter().flat_map(|of| {
            let off: Vec<(usize, f64)> = of.scatter().filter(|(row, _)| of.speed[*row].abs() > 0.5 * fast).collect();
            let next = |pair: &[(usize, f64)]| (pair[1].0 == pair[0].0 + 1).then(|| [pair[0].1, pair[1].1]);
            off.windows(2).filter_map(next).collect::<Vec<[f64; 2]>>()
        })
    };
    let spread = MAD_TO_STD * median_of(&mut pairs().map(|[off, _]| off.abs()).collect::<Vec<f64>>());
    let cut = |off: f64| off.clamp(-4.0 * spread, 4.0 * spread);
    let (own, common) = pairs()
        .fold((0.0, 0.0), |sum, [a, b]| (sum.0 + 0.5 * (cut(a).powi(2) + cut(b).powi(2)), sum.1 + cut(a) * cut(b)));
    (common / f64::max(own, 1e-300) + 56.0 / 70.0).abs() < WHITE
}

/// Scatter of a row of this speed, rad.
fn expected(known: &[Class], of: &Reads<'_>, row: usize) -> f64 {
    let speed = of.speed[row].abs();
    let class = known.iter().min_by(|a, b| (a.speed - speed).abs().total_cmp(&(b.speed - speed).abs()));
    class.map_or(f64::INFINITY, |class| (class.variance * SCATTER_GAIN).sqrt())
}

/// Rows off by far more than their speed lets expect while their neighbours agree, `run` of them one after another:
/// taken out of the good ones, and given with how far they are off.
fn read_late(of: &mut Reads<'_>, known: &[Class], run: usize) -> Vec<(usize, f64)> {
    let places = of.good.len().saturating_sub(run + 1);
    let off: Vec<Option<(Vec<f64>, f64)>> = (0..places).map(|from| of.off(from, run)).collect();
    let least = |from: usize| -> f64 {
        let Some(Some((off, apart))) = off.get(from) else { return 0.0 };
        let least = off.iter().fold(f64::INFINITY, |least: f64, off| least.min(off.abs()));
        let one_side = off.iter().all(|one| one * off[0] > 0.0);
        if one_side && apart.abs() < 0.5 * least { least } else { 0.0 }
    };
    let sizes: Vec<f64> = (0..places).map(least).collect();
    let mut taken: Vec<(usize, f64)> = Vec::new();
    let mut gone = vec![false; of.good.len()];
    for from in 2..places {
        let near = from.saturating_sub(2)..(from + 3).min(places);
        let largest = near.map(|other| sizes[other]).fold(0.0, f64::max);
        let stands_out = sizes[from] > 0.0 && sizes[from] >= largest;
        if stands_out
            && sizes[from] > LATE * expected(known, of, of.good[from])
            && let Some((off, _)) = &off[from]
        {
            for (k, off) in off.iter().enumerate().filter(|(k, _)| !gone[from + k]).collect::<Vec<_>>() {
                taken.push((of.good[from + k], *off));
                gone[from + k] = true;
            }
        }
    }
    log::leave_out(&mut of.good, &gone);
    taken
}

/// Whether rows that are off are rows that were read late: enough of them, in motion, to one side of it, at no one
/// place of the drive.
fn are_late(reads: &[Reads<'_>], late: &[Vec<(usize, f64)>], fast: f64, sessions: &[Session], gear: &Gear) -> bool {
    let moves = |speed: f64| speed.abs() > IN_MOTION * fast;
    let rests = |speed: f64| speed.abs() < AT_REST * fast;
    // Speed of each, and how far it is off.
    let late_rows: Vec<[f64; 2]> =
        (reads.iter().zip(late)).flat_map(|(of, late)| late.iter().map(|(row, off)| [of.speed[*row], *off])).collect();
    // Share of the rows of such a speed that are late.
    let share = |such: &dyn Fn(f64) -> bool| -> f64 {
        let all = reads.iter().flat_map(|of| &of.speed).filter(|speed| such(**speed)).count();
        late_rows.iter().filter(|[speed, _]| such(*speed)).count() as f64 / all.max(1) as f64
    };
    let (moving, at_rest) = (share(&moves), share(&rests));
    let in_motion: Vec<&[f64; 2]> = late_rows.iter().filter(|[speed, _]| moves(*speed)).collect();
    let ahead = in_motion.iter().filter(|[speed, off]| off * speed > 0.0).count() as f64;
    let ahead = ahead / in_motion.len().max(1) as f64;
    late_rows.len() >= LATE_ROWS
        && (LATE_SHARE..=MOST_LATE).contains(&moving)
        && at_rest <= RARER_AT_REST * moving
        && ahead.max(1.0 - ahead) >= ONE_SIDED
        && !repeat_with_position(sessions, late, gear)
}

/// Median period of the rows, s.
fn period_s(sessions: &[Session]) -> Option<f64> {
    let steps = |session: &Session| -> Vec<f64> {
        session.time_s.as_ref().map_or_else(Vec::new, |time| time.windows(2).map(|t| t[1] - t[0]).collect())
    };
    let mut steps: Vec<f64> = sessions.iter().flat_map(steps).collect();
    (!steps.is_empty()).then(|| median_of(&mut steps))
}

/// Gives each row its noise against that of a row of mean worth.
fn weigh(sessions: &mut [Session], speed: &[Vec<f64>], noise: f64, jitter_rows: f64) {
    let loud = |(session, speed): (&Session, &Vec<f64>)| -> Vec<f64> {
        let of = |row: usize| noise.hypot(jitter_rows * speed.get(row).unwrap_or(&0.0));
        (0..session.len()).map(of).collect()
    };
    let all: Vec<Vec<f64>> = sessions.iter().zip(speed).map(loud).collect();
    let worth = all.iter().flatten().map(|loud| loud.powi(-2)).sum::<f64>() / rows_of(sessions) as f64;
    for (session, mut loud) in sessions.iter_mut().zip(all) {
        loud.iter_mut().for_each(|loud| *loud *= worth.sqrt());
        session.loudness = Some(loud);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ratio of the made-up drive. *Guess*: a round one; any would do.
    const RATIO: f64 = 100.0;

    /// Normal deviates of unit variance.
    fn normal(random: &mut fastrand::Rng) -> f64 {
        (0..12).map(|_| random.f64()).sum::<f64>() - 6.0
    }

    /// A drive that swings at up to 12 rad/s of the motor, 100 rows a second, with 2 arcsec of noise; its output is
    /// read off by `jitter_s` (one standard deviation), and by 0.5 ms and more in a share `late` of the rows.
    fn session(jitter_s: f64, late: f64) -> Session {
        let mut random = fastrand::Rng::with_seed(7);
        let (mut psi, mut session) = (0.0, Session { time_s: Some(Vec::new()), ..Session::default() });
        for k in 0..20_000 {
            let t = 0.01 * f64::from(k);
            let speed = 12.0 * (0.4 * t).sin();
            psi += 0.01 * speed;
            let is_late = random.f64() < late;
            let off = jitter_s * normal(&mut random) + if is_late { 5e-4 * random.f64().powf(-0.5) } else { 0.0 };
            let error = 12.0 * (2.0 * psi).sin() + 3.0 * (4.0 * psi).sin() + 2.0 * normal(&mut random);
            session.push([t, psi, error * ARCSEC + off * speed / RATIO, f64::NAN]);
        }
        session
    }

    fn checked(jitter_s: f64, late: f64) -> (Session, Option<Measures>) {
        let mut sessions = vec![session(jitter_s, late)];
        let mut findings = Findings::default();
        check(
            &mut sessions,
            &Gear { tooth_pitch_rad: Some(std::f64::consts::TAU / 200.0), ..Gear::of_ratio(RATIO) },
            &mut findings,
        );
        let measures = findings.faults.first().map(|fault| fault.measures);
        (sessions.remove(0), measures)
    }

    #[test]
    fn jitter_is_measured_and_rows_weigh_what_their_speed_leaves_of_them() {
        for jitter_s in [1e-4, 3e-4] {
            let (session, measures) = checked(jitter_s, 0.0);
            let found = measures.unwrap();
            let jitter_ms = found.jitter_ms.unwrap();
            assert!((jitter_ms / (1e3 * jitter_s) - 1.0).abs() < 0.1, "{jitter_ms} of {jitter_s}");
            assert_eq!(found.late_rows, None);
            let loud = session.loudness.unwrap();
            let worth = loud.iter().map(|loud| loud.powi(-2)).sum::<f64>() / loud.len() as f64;
            assert!((worth - 1.0).abs() < 1e-9, "{worth}");
            // Row 393 is at full speed, row 785 at rest.
            let louder = f64::hypot(1.0, jitter_s * 0.12 / (2.0 * ARCSEC));
            assert!((loud[393] / loud[785] / louder - 1.0).abs() < 0.1, "{} of {louder}", loud[393] / loud[785]);
        }
    }

    #[test]
    fn a_misread_generator_is_told_at_one_pace_however_fast_and_a_real_motion_is_none() {
        let mut random = fastrand::Rng::with_seed(9);
        for (step_rad, misread, real) in [(0.35, 0.025, 0.0), (0.05, 0.025, 0.0), (0.05, 0.0, 0.025)] {
            let mut session = Session { time_s: Some(Vec::new()), ..Session::default() };
            for k in 0..6000u32 {
                let (off, moved) = (misread * normal(&mut random), real * normal(&mut random));
                let psi = step_rad * f64::from(k) + moved;
                session.push([
                    0.004 * f64::from(k),
                    psi + off,
                    (12.0 * (2.0 * psi).sin() + 2.0 * normal(&mut random)) * ARCSEC - off / RATIO,
                    f64::NAN,
                ]);
            }
            let mut findings = Findings::default();
            check(std::slice::from_mut(&mut session), &Gear::of_ratio(RATIO), &mut findings);
            let found = findings.faults.first().and_then(|fault| fault.measures.jitter_ms);
            assert_eq!(found.is_some(), misread > 0.0, "{step_rad} {misread} {real}: {found:?}");
            if let Some(jitter_ms) = found {
                let was = misread / step_rad * 4.0;
                assert!((jitter_ms / was - 1.0).abs() < 0.1, "{jitter_ms} of {was}");
            }
        }
    }

    #[test]
    fn late_rows_are_left_out_and_a_good_logger_is_left_alone() {
        let (session, measures) = checked(0.0, 0.12);
        let late = measures.unwrap().late_rows.unwrap();
        // A third of the time the drive is too slow for a row that is late by 0.7 ms to be seen.
        assert!((800..2600).contains(&late), "{late} of about 2400");
        assert_eq!(session.len(), 20_000 - late as usize);
        for jitter_s in [0.0, 1e-5] {
            let (session, measures) = checked(jitter_s, 0.0);
            assert!(measures.is_none() && session.loudness.is_none(), "{jitter_s}: {measures:?}");
        }
    }

    #[test]
    fn a_bench_that_goes_from_stop_to_stop_tells_nothing_of_its_reads_while_it_moves_on() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut session = Session { time_s: Some(Vec::new()), ..Session::default() };
        for k in 0..20_000u32 {
            let (stop, read) = (f64::from(k / 7), f64::from(k % 7));
            let psi = 0.9 * stop;
            let error = 12.0 * (2.0 * psi).sin() + 2.0 * normal(&mut random);
            session.push([1.625 * stop + 0.125 * read, psi, error * ARCSEC, f64::NAN]);
        }
        let mut findings = Findings::default();
        check(std::slice::from_mut(&mut session), &Gear::of_ratio(RATIO), &mut findings);
        assert!(findings.faults.is_empty() && session.loudness.is_none(), "{:?}", findings.faults);
    }
}
