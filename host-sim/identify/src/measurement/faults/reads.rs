//! The two angles are not read at one instant.
//!
//! Between two readings the drive moves on: an instant that is off by τ puts the error off by τ times the speed. Where
//! τ scatters, the scatter of neighbouring rows grows with the speed, its square by (τ · speed)²; at rest nothing
//! shows. Waves of the drive scatter, too, where fast rows are too far apart to follow them, but by no such law.
//!
//! The scatter of a row is its residual when a cubic goes through the rows around it. Rows then weigh what
//! noise and scatter together leave of them.
//!
//! Where it is the generator that is read at scattered instants, or in coarse counts, its angle shows it: what it is
//! off by is in the error, over the ratio, with the sign turned, at any pace. An output that follows a generator which
//! really moves so has no such error.

use std::ops::Range;

use super::resolution::seen;
use super::{ARCSEC, Findings};
use crate::least_squares::Normal;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
use flexspline_base::robust::{MAD_TO_STD, median_of, quantile_of};

/// Classes of speed, of equally many rows. *Guess*: enough for a line over the square of the speed.
const CLASSES: usize = 14;
/// Fewest rows of a class. *Guess*: they give a standard deviation to 8 %.
const CLASS_ROWS: usize = 80;
/// Scatter that grows with the speed is reported from this on, rad at the output, at the speed that a twentieth of the
/// rows exceed: below, encoders of common loops scatter by themselves. *Chosen* so that loops polled within 20 µs are
/// not named.
const LEAST_RAD: f64 = 1.0 * ARCSEC;
/// And from this share of the noise at rest on. *Guess*.
const LEAST_OF_NOISE: f64 = 0.3;
/// Fall of χ² by the scatter that grows with the speed: five standard deviations. *Source*: by definition.
const CERTAIN: f64 = 25.0;
/// The drive moves evenly where the scatter of the generator's angle is below this share of what it turns by in a fast
/// row. *Guess*: between rows from stop to stop it is 0.7 and more.
const EVEN: f64 = 0.5;
/// Share of the scatters by which the variance of a class is measured once more. *Guess*: beyond what a tooth hits.
const MOST: f64 = 0.9;
/// That share of what scatters normally is within so many standard deviations. *Source*: derived, (1 + 0.9) / 2 of the
/// normal distribution lie below it.
const OF_MOST: f64 = 1.645;
/// The line fits within this χ² a class: waves of the drive miss it. *Source*: χ² has the mean of its degrees of
/// freedom.
const MISFIT: f64 = 1.0;
/// Scatter of the error against that of the generator's angle over the ratio is −1 within this, where it is that angle
/// that is misread: what other noise of the angle and motion that is real leave of it. *Guess*.
const MISREAD: f64 = 0.15;
/// Share of the rows that decide it: those that are farthest off are something else. *Guess*.
const NEAR: f64 = 0.99;
/// Variance of the scatter of a row over that of its error. *Source*: derived, the sum of the squares of 1, −4, 6, −4,
/// 1 over that of the middle one.
const SCATTER_GAIN: f64 = 70.0 / 36.0;

/// Speed (rad of the output in a row) of many rows, and the variance of their error, rad², by half of them and by most.
struct Class {
    speed: f64,
    variance: f64,
    of_most: f64,
    rows: f64,
}

/// Rows as they were read.
struct Reads<'a> {
    log: &'a Log,
    error: &'a [f64],
    /// The generator's angle over the ratio, rad.
    turned: Vec<f64>,
    /// Change of the output from row to row, rad.
    speed: Vec<f64>,
}

impl<'a> Reads<'a> {
    fn new(log: &'a Log, gear: &Gear) -> Self {
        let turned: Vec<f64> = log.of(Quantity::Generator).iter().map(|psi| psi / gear.ratio).collect();
        let of_session = |rows: Range<usize>| {
            rows.clone().map(move |k| (k.saturating_sub(2).max(rows.start), (k + 2).min(rows.end - 1)))
        };
        let speed = |(a, b): (usize, usize)| (turned[b] - turned[a]) / (b - a).max(1) as f64;
        let speed = log.sessions().flat_map(of_session).map(speed).collect();
        Reads { log, error: log.of(Quantity::Error), speed, turned }
    }

    /// Scatter of the error and of the generator's angle over the ratio, and row, where five rows follow one another
    /// and none was left out: how far the middle one is off the cubic through the others, (-1, 4, -6, 4, -1) / 6 of the
    /// values.
    fn scatter(&self) -> impl Iterator<Item = (f64, f64, usize)> + '_ {
        let off = |e: &[f64]| (6.0 * e[2] - 4.0 * (e[1] + e[3]) + e[0] + e[4]) / 6.0;
        let middles = self.log.sessions().flat_map(|rows| rows.start + 2..rows.end.saturating_sub(2));
        let follow = |k: &usize| self.log.line[k + 2] == self.log.line[k - 2] + 4;
        let of_row = move |k: usize| (off(&self.error[k - 2..k + 3]), off(&self.turned[k - 2..k + 3]), k);
        middles.filter(follow).map(of_row)
    }
}

/// How the instants scatter.
struct Jitter {
    /// Noise in addition to it, rad.
    noise: f64,
    /// Scatter of the time between the readings, rows.
    rows: f64,
}

impl Jitter {
    /// Whether it matters at a speed.
    fn matters(&self, fast: f64) -> bool {
        self.rows * fast > LEAST_RAD.max(LEAST_OF_NOISE * self.noise)
    }

    /// Of a generator whose angle is misread, by the scatter of both angles, and by how much it is off, rad at the
    /// output. Few rows that are far off decide nothing.
    fn of_generator(reads: &Reads<'_>, fast: f64) -> Option<(Jitter, f64)> {
        let of_row = |(error, turned, row): (f64, f64, usize)| (error, turned, reads.speed[row]);
        let rows: Vec<(f64, f64, f64)> = reads.scatter().map(of_row).collect();
        let most = |of: fn(&(f64, f64, f64)) -> f64| quantile_of(&mut rows.iter().map(of).collect::<Vec<f64>>(), NEAR);
        let (of_error, of_turned) = (most(|row| row.0.abs()), most(|row| row.1.abs()));
        let [mut xx, mut xy, mut yy, mut vv, mut count] = [0.0; 5];
        for (error, turned, speed) in &rows {
            if error.abs() <= of_error && turned.abs() <= of_turned {
                xx += turned * turned;
                xy += turned * error;
                yy += error * error;
                vv += speed * speed;
                count += 1.0;
            }
        }
        if xx <= 0.0 || vv <= 0.0 || count < CLASS_ROWS as f64 {
            return None;
        }
        let left = (yy - xy * xy / xx).max(0.0);
        let jitter = Jitter { noise: (left / count / SCATTER_GAIN).sqrt(), rows: (xx / vv / SCATTER_GAIN).sqrt() };
        // Neighbouring scatters share rows: they are worth about a third.
        let certain = count / 3.0 * (xy * xy / xx) / left.max(f64::MIN_POSITIVE) > CERTAIN;
        let is_one = (xy / xx + 1.0).abs() < MISREAD && certain && jitter.matters(fast);
        is_one.then(|| (jitter, (xx / count / SCATTER_GAIN).sqrt()))
    }

    /// By scatter that grows with the speed.
    fn by_speed(reads: &Reads<'_>, fast: f64) -> Option<Jitter> {
        let classes = classes(reads, fast);
        let floor = classes.iter().map(|class| class.variance).fold(f64::INFINITY, f64::min).max(1e-30);
        // Neighbouring scatters share rows: a class is worth about a third of its rows. A median deviation is known to
        // 1.17 / sqrt(n). Instants scatter in all rows alike; teeth and steps in some, of which most know more than
        // half do.
        let weight = |class: &Class| {
            let of_rows = (2.0 * 1.17f64).powi(2) * 3.0 / class.rows * class.variance.max(floor).powi(2);
            1.0 / (of_rows + (class.of_most - class.variance).powi(2))
        };
        let fit = |columns: usize| {
            Normal::of(columns, classes.len(), |k, row| {
                row.copy_from_slice(&[1.0, (classes[k].speed / fast).powi(2)][..columns]);
                (classes[k].variance, weight(&classes[k]))
            })
        };
        let (noise, both) = (fit(1)?, fit(2)?);
        // A variance below zero at rest is of something else that grows with the speed.
        let [at_rest, at_speed] = [0, 1].map(|k| both.values()[k].sqrt());
        let jitter = Jitter { noise: at_rest, rows: at_speed / fast };
        let certain = at_rest >= 0.0 && noise.misfit() - both.misfit() > CERTAIN;
        let fits = both.misfit() <= MISFIT * classes.len() as f64;
        (certain && fits && jitter.matters(fast)).then_some(jitter)
    }
}

/// Scatter by speed, of classes with equally many rows. Between rows from stop to stop there is no speed.
fn classes(reads: &Reads<'_>, fast: f64) -> Vec<Class> {
    let even = reads.scatter().filter(|(_, turned, _)| turned.abs() < EVEN * fast);
    let mut rows: Vec<(f64, f64)> = even.map(|(off, _, row)| (reads.speed[row].abs(), off.abs())).collect();
    rows.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let of = |class: &[(f64, f64)]| {
        let (mut off, rows): (Vec<f64>, f64) = (class.iter().map(|(_, off)| *off).collect(), class.len() as f64);
        let square = class.iter().map(|(speed, _)| speed * speed).sum::<f64>() / rows;
        let [variance, of_most] = [MAD_TO_STD * median_of(&mut off), quantile_of(&mut off, MOST) / OF_MOST]
            .map(|std| std * std / SCATTER_GAIN);
        Class { speed: square.sqrt(), variance, of_most, rows }
    };
    rows.chunks(rows.len().div_ceil(CLASSES).max(CLASS_ROWS))
        .filter(|class| class.len() >= CLASS_ROWS / 2)
        .map(of)
        .collect()
}

/// Finds angles that are not read at one instant: rows weigh what their speed leaves of them.
pub(in crate::measurement) fn check(log: &mut Log, gear: &Gear, findings: &mut Findings) {
    let rows = log.len();
    if rows < CLASSES * CLASS_ROWS {
        return;
    }
    let reads = Reads::new(log, gear);
    let fast = quantile_of(&mut reads.speed.iter().map(|speed| speed.abs()).collect::<Vec<f64>>(), 0.95);
    if fast == 0.0 {
        return;
    }
    // By what was measured alone: waves of a fast drive, once they are fitted, follow what its angle is misread by.
    let misread = Jitter::of_generator(&reads, fast);
    // Where it is read in counts, within half of one, that is its resolution, and known as such.
    let in_counts = |off: f64| seen(log, gear).iter().any(|(of, step)| *of == Quantity::Generator && off < 0.5 * step);
    if misread.as_ref().is_some_and(|(_, off)| in_counts(*off)) {
        log.loudness = Some(vec![1.0; rows]);
        return;
    }
    let by_speed = || Jitter::by_speed(&reads, fast);
    let Some(Jitter { noise, rows: jitter_rows }) = misread.map(|(jitter, _)| jitter).or_else(by_speed) else { return };
    let speed = reads.speed;
    let period_s = period_s(log);
    let jitter_ms = period_s.map(|period_s| 1e3 * period_s * jitter_rows);
    let size_rad = jitter_rows * fast;
    findings.add(log.fault(FaultName::ReadJitter, 0..rows), None::<Quantity>, Treatment::Masked, |fault| {
        fault.size_arcsec = Some(size_rad / ARCSEC);
        fault.measures.jitter_ms = jitter_ms;
        let of_time = jitter_ms.map_or(format!("{jitter_rows:.4} rows"), |ms| format!("{ms:.3} ms"));
        format!(
            "the two angles are not read at one instant: the time between them scatters by {of_time}, {:.1} arcsec at \
             full speed and {:.1} of noise: a fast row is worth {:.2} of one at rest",
            size_rad / ARCSEC,
            noise / ARCSEC,
            noise * noise / (noise * noise + size_rad * size_rad)
        )
    });
    log.unsure_s = log.unsure_s.max(jitter_rows * period_s.unwrap_or(1.0));
    // Each row has its noise against that of a row of mean worth.
    let noise = noise.max(1e-3 * jitter_rows * fast);
    let loud: Vec<f64> = speed.iter().map(|speed| noise.hypot(jitter_rows * speed)).collect();
    let worth = loud.iter().map(|loud| loud.powi(-2)).sum::<f64>() / rows as f64;
    log.loudness = Some(loud.iter().map(|loud| loud * worth.sqrt()).collect());
}

/// Median period of the rows, s.
pub(super) fn period_s(log: &Log) -> Option<f64> {
    let time = log.get(Quantity::Time)?;
    let mut steps: Vec<f64> = log.continued().map(|row| time[row] - time[row - 1]).collect();
    (!steps.is_empty()).then(|| median_of(&mut steps))
}

#[cfg(test)]
mod tests {
    use super::super::outliers;
    use super::*;
    use crate::measurement::Session;
    use crate::measurement::fault::Measures;

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
        let gear = Gear::of_ratio(RATIO);
        Log::on(&mut sessions, |log| {
            outliers::check(log, &gear, &mut findings);
            check(log, &gear, &mut findings);
        });
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
    fn a_damaged_tooth_is_no_jitter_and_jitter_beside_one_is() {
        for (jitter_s, told) in [(0.0, false), (2e-4, true)] {
            let mut random = fastrand::Rng::with_seed(8);
            let (mut psi, mut session) = (0.0, Session { time_s: Some(Vec::new()), ..Session::default() });
            for k in 0..20_000u32 {
                // Legs at up to 15 rad/s, and rests, 50 rows a second; a lobe meets the tooth twice a turn.
                let speed = [15.0, 0.0, 7.5, 3.75][k as usize / 500 % 4];
                psi += 0.02 * speed;
                let tooth = 40.0 * (-((psi % std::f64::consts::PI - 1.5) / 0.12).powi(2)).exp();
                let error = 12.0 * (2.0 * psi).sin() + 0.7 * normal(&mut random) + tooth;
                let off = jitter_s * normal(&mut random) * speed / RATIO;
                session.push([0.02 * f64::from(k), psi, error * ARCSEC + off, f64::NAN]);
            }
            let mut findings = Findings::default();
            Log::on(std::slice::from_mut(&mut session), |log| check(log, &Gear::of_ratio(RATIO), &mut findings));
            let names: Vec<FaultName> = findings.faults.iter().map(|fault| fault.name).collect();
            assert_eq!(names, if told { vec![FaultName::ReadJitter] } else { vec![] }, "{jitter_s}");
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
            Log::on(std::slice::from_mut(&mut session), |log| check(log, &Gear::of_ratio(RATIO), &mut findings));
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
        Log::on(std::slice::from_mut(&mut session), |log| check(log, &Gear::of_ratio(RATIO), &mut findings));
        assert!(findings.faults.is_empty() && session.loudness.is_none(), "{:?}", findings.faults);
    }
}
