//! Time that does not run as it should, and the gaps that part sessions.

use std::f64::consts::TAU;
use std::ops::Range;

use super::{Findings, marked};
use crate::measurement::Refusal;
use crate::measurement::columns::{MappedColumn, Quantity};
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::log::Log;
use flexspline_base::robust::{median_and_std, median_of, quantile_of, sampled};

/// A gap longer than this number of sample periods starts a new session. *Source*: by definition
/// (`docs/how-to/diagnosis.md`).
pub(crate) const SESSION_GAP_PERIODS: f64 = 10.0;
/// A step of time above this number of periods, jitter aside, has a row missing in it. *Source*: derived, half way
/// between one lost row and none.
const LOST_ROW_PERIODS: f64 = 1.5;
/// Standard deviation of the median of many values over that of their mean: √(π/2) for normal ones. *Source*: derived.
const MEDIAN_TO_MEAN_STD: f64 = 1.253;
/// The median step is known to this number of its standard deviations. *Guess*: two hold in 95 % of the cases.
const MEDIAN_STDS: f64 = 2.0;
/// Where more steps than this are that long, rows are not evenly spaced by intent, and none is missing. *Guess*: a
/// logger loses fewer than one row in twenty.
const UNEVEN_SHARE: f64 = 0.05;
/// Where more steps than this are zero, the clock is coarse, or rows are written twice; where fewer, some are repeated.
/// *Guess*: a sound clock stands in no row, and one that is coarse in every other one or more.
const COARSE_SHARE: f64 = 0.1;
/// A clock jitters if the second differences of its stamps exceed this share of a period at the median… *Guess*: less
/// does not matter to any model.
const JITTER_SHARE: f64 = 0.1;
/// …and, relative to the pace, exceed those of the motion by this factor. *Guess*: a motion that really is uneven
/// scatters with the stamps.
const JITTER_OVER_MOTION: f64 = 5.0;
/// Sample periods that exist, s. *Guess*: from 10 MHz to one row in an hour.
const PERIODS_S: [f64; 2] = [1e-7, 3600.0];
/// Rows farther apart than this (s), for longer than this altogether (s), in which a motor that goes to and fro stays
/// slower than this (rad/s), may be milliseconds read as seconds: a telescope creeps for nights, but one way. *Guess*.
const CREEPS_TO_AND_FRO: (f64, f64, f64) = (0.9, 3600.0, 0.15);
/// It goes to and fro where each direction has this share of the way, and this way at least, rad. *Guess*: one motor
/// turn.
const EACH_WAY: (f64, f64) = (0.1, 6.0);
/// And never changes its pace by more than this share of its fastest one from row to row. *Guess*.
const SMOOTHLY: f64 = 0.35;
/// Rows on either side of a step by which rows are missing in it. *Guess*: few, so that a lost row stays where it is.
const AROUND_ROWS: usize = 5;

/// Finds faults of the clock, repairs or leaves out what they touch, and parts the rows into sessions.
///
/// # Errors
/// The time looks like milliseconds, and nobody said that it is in seconds.
pub(in crate::measurement) fn check(
    log: &mut Log,
    columns: &[MappedColumn],
    findings: &mut Findings,
) -> Result<(), Refusal> {
    if log.get(Quantity::Time).is_none() {
        return Ok(());
    }
    let strays = order(log, findings);
    standing(log, findings);
    let Some(period) = period(log) else {
        let all = log.fault(FaultName::ClockError, 0..log.len());
        findings.add(all, Quantity::Time, Treatment::Masked, |fault| {
            (fault.time_s, fault.until_s) = (None, None);
            "time does not advance: it is not used".to_owned()
        });
        log.take(Quantity::Time);
        return Ok(());
    };
    gaps(log, period, &strays, findings);
    jitter(log, period, findings);
    scale(log, period, columns, findings)
}

/// Median of the positive steps of time, s.
pub(super) fn period(log: &Log) -> Option<f64> {
    let time = log.get(Quantity::Time)?;
    let steps: Vec<f64> = time.windows(2).map(|t| t[1] - t[0]).filter(|dt| *dt > 0.0).collect();
    (!steps.is_empty()).then(|| median_of(&mut sampled(&steps)))
}

/// Time that runs back: a row out of order is left out, a clock that was set back starts a session. Gives the lines
/// left out.
fn order(log: &mut Log, findings: &mut Findings) -> Vec<u64> {
    let Some(period) = period(log) else { return Vec::new() };
    let Some(time) = log.get(Quantity::Time) else { return Vec::new() };
    let far = SESSION_GAP_PERIODS * period;
    let (mut latest, mut back) = (f64::NEG_INFINITY, 0.0);
    let (mut strays, mut resets) = (Vec::new(), Vec::new());
    for (row, t) in time.iter().copied().enumerate().filter(|(_, t)| t.is_finite()) {
        // A stamp that is far from both its neighbours, which are close to each other, is wrong by itself.
        let next = time.get(row + 1).copied().unwrap_or(f64::NAN);
        let alone = next >= latest && next - latest <= far && !(latest..=next).contains(&t) && latest.is_finite();
        if alone || (t < latest && latest - t <= far) {
            strays.push(row);
            continue;
        }
        if t < latest {
            back = if resets.is_empty() { latest - t } else { back };
            resets.push(row);
        }
        latest = t;
    }
    let stray = log.fault(FaultName::ClockError, strays.iter().copied());
    findings.add(stray, Quantity::Time, Treatment::Masked, |fault| {
        format!("time runs back or is far off in {} rows: they are left out", fault.rows)
    });
    let reset = log.fault(FaultName::ClockError, resets.iter().copied());
    findings.add(reset, Quantity::Time, Treatment::Kept, |fault| {
        format!("time is set back {} times, first by {back:.4} s: a new session is begun there", fault.rows)
    });
    let lines = strays.iter().map(|row| log.line[*row]).collect();
    log.begin_sessions(&resets);
    log.leave_out(&marked(log.len(), strays));
    lines
}

/// Time that stands: rows that are repeated are left out, a coarse clock is spread.
fn standing(log: &mut Log, findings: &mut Findings) {
    if period(log).is_none() {
        return;
    }
    let Some(time) = log.get(Quantity::Time) else { return };
    let (rows, mut spread) = (time.len(), time.to_vec());
    let stands: Vec<usize> = log.continued().filter(|row| time[*row] == time[*row - 1]).collect();
    let twice: Vec<usize> = stands.iter().copied().filter(|row| log.repeats(*row)).collect();
    if twice.len() as f64 > COARSE_SHARE * rows as f64 {
        let fault = log.fault(FaultName::ClockError, twice.iter().copied());
        findings.add(fault, Quantity::Time, Treatment::Repaired, |fault| {
            let count = fault.rows;
            format!("{count} of {rows} rows repeat the row before in every column, its time too: they are left out")
        });
        log.leave_out(&marked(rows, twice));
        return standing(log, findings);
    }
    let fault = log.fault(FaultName::ClockError, stands.iter().copied());
    if stands.len() as f64 <= COARSE_SHARE * rows as f64 {
        findings.add(fault, Quantity::Time, Treatment::Masked, |fault| {
            format!("{} rows repeat the time of the row before: they are left out", fault.rows)
        });
        log.leave_out(&marked(rows, stands));
        return;
    }
    findings.add(fault, Quantity::Time, Treatment::Repaired, |fault| {
        format!("time does not advance in {} of {rows} rows: rows of the same time are spread evenly", fault.rows)
    });
    // At the end of a session: as fast as on the whole.
    let whole = (time[rows - 1] - time[0]).abs() / rows as f64;
    let mut begin = 0;
    while begin < rows {
        let end = (begin + 1..rows).find(|row| time[*row] != time[begin] || !log.continues(*row)).unwrap_or(rows);
        let next = time.get(end).filter(|next| **next > time[begin] && log.continues(end));
        let step = next.map_or(whole, |next| (next - time[begin]) / (end - begin) as f64);
        (begin + 1..end).for_each(|row| spread[row] = time[begin] + step * (row - begin) as f64);
        begin = end;
    }
    log.put(Quantity::Time, spread);
}

/// Change of an angle over one row, the shorter way round.
fn turned(values: &[f64], row: usize) -> f64 {
    let d = values[row] - values[row - 1];
    d - TAU * (d / TAU).round()
}

/// Gaps in time: sessions, and rows that were lost. Near `strays`, lines left out for their time, none is counted as
/// lost.
fn gaps(log: &mut Log, period: f64, strays: &[u64], findings: &mut Findings) {
    let Some(time) = log.get(Quantity::Time) else { return };
    let rows = time.len();
    let mut steps = sampled(&time.windows(2).map(|t| t[1] - t[0]).filter(|dt| *dt > 0.0).collect::<Vec<_>>());
    let jitter = median_and_std(&mut steps).1;
    let lost_from = (LOST_ROW_PERIODS * period).max(period + 6.0 * jitter);
    let long: Vec<usize> =
        (1..rows).filter(|row| log.continues(*row) && time[*row] - time[*row - 1] > lost_from).collect();
    let parts: Vec<usize> =
        long.iter().copied().filter(|row| time[*row] - time[*row - 1] > SESSION_GAP_PERIODS * period).collect();
    log.begin_sessions(&parts);
    let Some(time) = log.get(Quantity::Time) else { return };
    // The median step may be shorter than the period that a clock keeps on the mean: no more rows are missing than the
    // time of a session leaves room for, as well as the median is known.
    let unsure = MEDIAN_STDS * MEDIAN_TO_MEAN_STD * jitter / period / (rows as f64).sqrt();
    let room = |rows: Range<usize>| {
        let n = rows.len() as f64;
        ((time[rows.end - 1] - time[rows.start]) / period - (n - 1.0) + unsure * n).max(0.0).round()
    };
    let room: f64 = log.sessions().map(room).sum();
    // Rows that are in the file, but were left out, are not lost.
    let lost = missing(log, period).into_iter().filter_map(|(row, periods)| {
        let beyond = periods.checked_sub(log.line[row] - log.line[row - 1] - 1).filter(|beyond| *beyond > 0)?;
        (!strays.iter().any(|line| line.abs_diff(log.line[row]) <= 2)).then_some((row, beyond))
    });
    let lost: Vec<(usize, u64)> = lost.collect();
    let total = lost.iter().map(|(_, rows)| *rows).sum::<u64>().min(room as u64);
    let places = lost.len().min(total as usize);
    if total > 0 && long.len() as f64 > UNEVEN_SHARE * rows as f64 {
        let uneven = format!("rows are not evenly spaced in time: {} steps exceed {lost_from:.6} s", long.len());
        findings.notes.push(uneven);
    } else if total > 0 {
        let fault = log.fault(FaultName::MissingSamples, lost.iter().map(|(row, _)| *row));
        findings.add(fault, Quantity::Time, Treatment::Kept, |fault| {
            fault.rows = total;
            format!(
                "{total} rows are missing, in up to {places} places: time goes on by more than the usual {period:.6} s"
            )
        });
    }
}

/// Rows before which rows are missing, each with how many, by the stamps of the rows around: so a stamp that scatters
/// into the period of its neighbour shows none.
fn missing(log: &Log, period_s: f64) -> Vec<(usize, u64)> {
    let time = log.get(Quantity::Time).unwrap_or_default();
    let of_session = |rows: Range<usize>| {
        let late = |of: Range<usize>| median_of(&mut of.map(|k| time[k] / period_s - k as f64).collect::<Vec<f64>>());
        let (start, end) = (rows.start, rows.end);
        rows.skip(1).filter_map(move |row| {
            if time[row] - time[row - 1] <= LOST_ROW_PERIODS * period_s {
                return None;
            }
            let (before, after) = (row.saturating_sub(AROUND_ROWS).max(start)..row, row..(row + AROUND_ROWS).min(end));
            let periods = late(after) - late(before);
            (periods > 0.5).then_some((row, periods.round() as u64))
        })
    };
    log.sessions().flat_map(of_session).collect()
}

/// Stamps that scatter while the motion from row to row does not.
fn jitter(log: &mut Log, period: f64, findings: &mut Findings) {
    let (Some(time), Some(generator)) = (log.get(Quantity::Time), log.get(Quantity::Generator)) else { return };
    let (mut of_time, mut of_motion) = (Vec::new(), Vec::new());
    for row in 2..time.len() {
        if !log.continues(row) || !log.continues(row - 1) {
            continue;
        }
        let (a, b) = (turned(generator, row - 1), turned(generator, row));
        let pace = 0.5 * (a.abs() + b.abs());
        if pace > 0.0 && pace < 1.0 {
            of_motion.push((b - a).abs() / pace);
            of_time.push((time[row] - 2.0 * time[row - 1] + time[row - 2]).abs() / period);
        }
    }
    if of_time.len() < 100 {
        return;
    }
    let (time_scatter, motion_scatter) = (median_of(&mut sampled(&of_time)), median_of(&mut sampled(&of_motion)));
    if time_scatter <= JITTER_SHARE || time_scatter <= JITTER_OVER_MOTION * motion_scatter {
        return;
    }
    findings.add(log.fault(FaultName::ClockError, 0..log.len()), Quantity::Time, Treatment::Repaired, |_| {
        format!(
            "stamps scatter by {:.0} % of a period while the motion from row to row scatters by {:.1} %: rows are \
             spaced evenly",
            100.0 * time_scatter,
            100.0 * motion_scatter
        )
    });
    let (sessions, missing): (Vec<Range<usize>>, _) = (log.sessions().collect(), missing(log, period));
    let mut place: Vec<f64> = (0..log.len()).map(|row| row as f64).collect();
    for (from, periods) in missing {
        place[from..].iter_mut().for_each(|place| *place += periods as f64);
    }
    let Some(time) = log.get_mut(Quantity::Time) else { return };
    for rows in sessions {
        let (from, to, last) = (time[rows.start], time[rows.end - 1], rows.end - 1);
        let step = (to - from) / (place[last] - place[rows.start]).max(1.0);
        rows.clone().for_each(|row| time[row] = from + step * (place[row] - place[rows.start]));
    }
}

/// A period that does not exist, or a creep to and fro: a unit of time taken for another.
fn scale(log: &Log, period: f64, columns: &[MappedColumn], findings: &mut Findings) -> Result<(), Refusal> {
    let (Some(time), Some(generator)) = (log.get(Quantity::Time), log.get(Quantity::Generator)) else { return Ok(()) };
    let moves: Vec<(usize, f64)> = log.continued().map(|row| (row, turned(generator, row))).collect();
    let speed = |(row, by): &(usize, f64)| (by / (time[*row] - time[row - 1])).abs();
    let mut speeds: Vec<f64> = moves.iter().map(speed).filter(|speed| *speed > 0.0 && speed.is_finite()).collect();
    let fastest = quantile_of(&mut speeds, 0.95);
    let lasts_s = period * time.len() as f64;
    let column = columns.iter().find(|column| column.quantity == Quantity::Time && !column.said);
    let (apart, long, slow) = CREEPS_TO_AND_FRO;
    let creeps = period > apart && lasts_s > long && fastest < slow;
    let way = |sign: f64| moves.iter().map(|(_, by)| (sign * by).max(0.0)).sum::<f64>();
    let (there, back) = (way(1.0), way(-1.0));
    let to_and_fro = there.min(back) > EACH_WAY.1.max(EACH_WAY.0 * (there + back));
    // A motor that creeps starts and turns round within a row; one that takes many rows to do so is a fast one.
    let changes = moves.windows(2).filter(|pair| pair[1].0 == pair[0].0 + 1);
    let change = changes.map(|pair| (pair[1].1 - pair[0].1).abs()).fold(0.0, f64::max);
    let smoothly = change < SMOOTHLY * fastest * period;
    if let Some(column) = column.filter(|_| to_and_fro && smoothly && creeps) {
        let (column, rows, hours) = (&column.name, time.len(), lasts_s / 3600.0);
        findings.milliseconds = true;
        return Err(Refusal(format!(
            "{column}: {rows} rows {period:.3} s apart, {hours:.1} hours in which the generator hardly exceeds \
             {fastest:.3} rad/s and turns round over many rows: milliseconds rather than seconds; allowed: --columns \
             time={column}:ms, or time={column}:s if the motor creeps"
        )));
    }
    let exists = (PERIODS_S[0]..=PERIODS_S[1]).contains(&period);
    let all = log.fault(FaultName::ClockError, 0..log.len()).filter(|_| !exists);
    findings.add(all, Quantity::Time, Treatment::Kept, |_| {
        format!("a sample period of {period:e} s is not plausible: is the unit of time right?")
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::columns::{Reading, Unit};

    /// A motor that goes to and fro, read every 2 ms; rows of `stamp(row)`, which gives none where the row is missing.
    fn log(rows: usize, mut stamp: impl FnMut(usize) -> Option<f64>) -> Log {
        let (mut time, mut generator) = (Vec::new(), Vec::new());
        for row in 0..rows {
            if let Some(stamp) = stamp(row) {
                time.push(stamp);
                generator.push(20.0 * (0.5 * 0.002 * row as f64).sin());
            }
        }
        let mut log = Log::default();
        log.line = (2..2 + time.len() as u64).collect();
        log.session = vec![0; time.len()];
        log.put(Quantity::Output, generator.iter().map(|psi| psi / 100.0).collect());
        log.put(Quantity::Time, time);
        log.put(Quantity::Generator, generator);
        log
    }

    fn missing(mut log: Log) -> u64 {
        let mut findings = Findings::default();
        check(&mut log, &[], &mut findings).unwrap();
        findings.faults.iter().filter(|fault| fault.name == FaultName::MissingSamples).map(|fault| fault.rows).sum()
    }

    #[test]
    fn rows_written_twice_are_left_out_and_those_of_a_coarse_clock_stay() {
        let left = |of: fn(usize) -> usize| {
            let mut log = log(400, |row| Some(0.002 * (row / 2) as f64));
            let angle = (0..400).map(|row| 0.1 * of(row) as f64).collect();
            log.put(Quantity::Output, vec![0.0; 400]);
            log.put(Quantity::Generator, angle);
            let mut findings = Findings::default();
            check(&mut log, &[], &mut findings).unwrap();
            (log.len(), findings.faults.len())
        };
        assert_eq!(left(|row| row / 2), (200, 1));
        assert_eq!(left(|row| row), (400, 1));
    }

    #[test]
    fn no_more_rows_are_missing_than_stamps_that_jitter_leave_room_for() {
        for seed in 0..20 {
            for lost in [0usize, 7] {
                let mut random = fastrand::Rng::with_seed(seed);
                // One stamp in 250 is taken when the system came to it.
                let found = missing(log(10_000, |row| {
                    let late = if row % 250 == 100 { 0.55 + 0.4 * random.f64() } else { 0.0 };
                    let stamp = 0.002 * (row as f64 + 0.2 * (random.f64() - 0.5) + late);
                    (row % 1400 != 1000 || lost == 0).then_some(stamp)
                }));
                assert!(found <= lost as u64 && found + 2 >= lost as u64, "seed {seed}: {found} of {lost}");
            }
        }
    }

    #[test]
    fn rows_lost_within_a_session_are_counted_and_sessions_are_none() {
        // Holes of 3 and 8 rows; one of 40 begins a session, as a minute does.
        let found = log(12_000, |row| {
            let lost = [(1500, 3), (2500, 40), (4000, 8)].iter().any(|(at, n)| (*at..at + n).contains(&row));
            (!lost).then_some(0.002 * row as f64 + if row >= 7000 { 60.0 } else { 0.0 })
        });
        assert_eq!(missing(found), 11);
    }

    #[test]
    fn no_more_rows_are_missing_than_the_median_step_leaves_room_for() {
        // Stamps of a clock that takes most steps a little short and makes up for it.
        let mut random = fastrand::Rng::with_seed(7);
        let mut t = 0.0;
        let stamped = log(20_000, |row| {
            let drawn = random.f64();
            t += 0.002 * if drawn < 0.04 { 1.62 } else { 0.985 + 0.01 * drawn };
            (row % 1000 != 500).then_some(t)
        });
        let time = stamped.get(Quantity::Time).unwrap();
        let room = (time[time.len() - 1] - time[0]) / period(&stamped).unwrap() - (time.len() as f64 - 1.0);
        assert!(missing(stamped.clone()) as f64 <= room.max(0.0) + 3.0, "{room}");
    }

    #[test]
    fn rows_keep_their_places_beside_those_that_are_missing() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut log = log(8000, |row| {
            let stamp = 0.002 * (row as f64 + 0.6 * (random.f64() - 0.5));
            (row % 40 != 20).then_some(stamp)
        });
        let mut findings = Findings::default();
        check(&mut log, &[], &mut findings).unwrap();
        assert!(findings.faults.iter().any(|fault| fault.name == FaultName::ClockError), "{:?}", findings.faults);
        let (time, generator) = (log.get(Quantity::Time).unwrap(), log.get(Quantity::Generator).unwrap());
        let off = |row: usize| (20.0 * (0.5 * time[row]).sin() - generator[row]).abs() / 10.0;
        let worst = (0..time.len()).map(off).fold(0.0, f64::max);
        assert!(worst < 0.004, "a row is {worst} s off");
    }

    #[test]
    fn milliseconds_read_as_seconds_are_refused_where_a_motor_turns_round_slowly_and_nobody_says_seconds() {
        let time = |said: bool| {
            let (quantity, name, unit) = (Quantity::Time, "t".to_owned(), Unit::Second);
            [MappedColumn { quantity, name, place: 0, reading: Reading::of(unit), said }]
        };
        let mut fast = log(9000, |row| Some(2.0 * row as f64));
        let refused = check(&mut fast, &time(false), &mut Findings::default()).unwrap_err().to_string();
        assert!(refused.ends_with("--columns time=t:ms, or time=t:s if the motor creeps"), "{refused}");
        let mut findings = Findings::default();
        check(&mut fast, &time(true), &mut findings).unwrap();
        assert!(findings.faults.is_empty() && fast.get(Quantity::Time).unwrap()[500] == 1000.0, "{findings:?}");
        // A bench that creeps turns round within a row, and is what it is.
        let mut slow = log(9000, |row| Some(2.0 * row as f64));
        let to_and_fro = |row: usize| 0.1 * if row % 4000 < 2000 { row % 4000 } else { 4000 - row % 4000 } as f64;
        slow.put(Quantity::Generator, (0..9000).map(to_and_fro).collect());
        let mut findings = Findings::default();
        check(&mut slow, &time(false), &mut findings).unwrap();
        assert!(findings.faults.is_empty(), "{findings:?}");
    }
}
