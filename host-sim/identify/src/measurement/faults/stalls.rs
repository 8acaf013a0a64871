//! A logger that stands still now and then while its time counts on: the angles leap over several rows' worth of
//! motion, both of them, and the column of time does not show it.

use super::leaps::{AROUND, moved, moves_around};
use super::{Findings, add_steps, clock, rhythm};
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
use flexspline_base::robust::{least_and_most, median_of, sampled};

/// The rows around agree on the pace within this share. *Guess*: a leap by a row more is four times that.
const STEADY: f64 = 0.25;
/// A leap exceeds what time gives by the motion of this many rows, at least… *Guess*: one, less what the pace may
/// change by.
const EXTRA_ROWS: f64 = 0.8;
/// …and the output takes part in it, within this share. *Guess*: clearance and wind-up take a part of it.
const TOGETHER: f64 = 0.3;
/// In one row the generator moves by this many times its own scatter. *Guess*: then the pace of a row is known to an
/// eighth.
const OVER_NOISE: f64 = 8.0;
/// From this number of leaps on they are stalls… *Guess*: a few may be something else.
const FEWEST: usize = 8;
/// …up to this share of the rows that show them. *Guess*: more are an uneven motion.
const MOST_SHARE: f64 = 0.2;
/// They come after each block of this many rows if this share of them does. *Guess*: others are missed where the motion
/// is slow.
const REGULAR: f64 = 0.7;

/// A row, and the time that is missing before it, s.
type Leap = (usize, f64);

/// Finds stalls that the time does not show, and makes time anew where they are.
pub(in crate::measurement) fn check(log: &mut Log, gear: &Gear, findings: &mut Findings) {
    let Some((leaps, tested, period_s)) = leaps(log, gear) else { return };
    if leaps.len() < FEWEST || leaps.len() as f64 > MOST_SHARE * tested as f64 {
        return;
    }
    let size_s = median_of(&mut leaps.iter().map(|(_, extra_s)| *extra_s).collect::<Vec<f64>>());
    // Some are not seen: the rhythm is the distance of neighbours in lines, others are whole multiples of it.
    let distances = leaps.windows(2).map(|pair| (log.line[pair[1].0] - log.line[pair[0].0]) as f64).collect();
    let every =
        rhythm(distances, REGULAR, |lines, every| (lines / every - (lines / every).round()).abs() * every < 1.5);
    let fault = log.fault(FaultName::Stalls, leaps.iter().map(|(row, _)| *row));
    let all = match every {
        // Where the motion does not show it, as long as elsewhere.
        Some(every) => by_rhythm(log, &leaps, every, size_s),
        None => leaps,
    };
    let lost_s: f64 = all.iter().map(|(_, extra_s)| extra_s).sum();
    findings.add(fault, Quantity::Time, Treatment::Repaired, |fault| {
        fault.rows = all.len() as u64;
        fault.measures.every_rows = every.map(|every| every as u64);
        fault.measures.size_ms = Some(1e3 * size_s);
        format!(
            "the logger stands still for {:.0} ms {}, {} times, while its time counts {:.2} ms from row to row: both \
             angles leap there; time is made anew from the motion ({lost_s:.1} s more)",
            1e3 * size_s,
            every.map_or("now and then".to_owned(), |every| format!("after every {every} rows")),
            all.len(),
            1e3 * period_s
        )
    });
    log.get_mut(Quantity::Time).into_iter().for_each(|time| add_steps(time, &all, 1.0));
}

/// Rows into which both angles leap, with the time that is missing there (s); the number of rows that would show it;
/// and the period, s.
fn leaps(log: &Log, gear: &Gear) -> Option<(Vec<Leap>, usize, f64)> {
    let (time, generator, output) =
        (log.get(Quantity::Time)?, log.get(Quantity::Generator)?, log.get(Quantity::Output)?);
    let period_s = clock::period(log)?;
    // Scatter of the generator's motion, from third differences that few leaps do not move.
    let third = generator.windows(4).map(|v| (v[3] - 3.0 * v[2] + 3.0 * v[1] - v[0]).abs()).collect::<Vec<f64>>();
    let least = OVER_NOISE * median_of(&mut sampled(&third));
    let (mut found, mut tested) = (Vec::new(), 0);
    for row in log.continued() {
        let mut moves = moves_around(log, generator, row);
        let (low, high) = least_and_most(moves.iter().copied());
        let usual = median_of(&mut moves);
        if moves.len() < 2 * AROUND || usual.abs() < least || high - low > STEADY * usual.abs() {
            continue;
        }
        tested += 1;
        // Time beyond that of the clock, at the usual pace.
        let beyond = |motion: f64| motion / usual * period_s - (time[row] - time[row - 1]);
        let (extra_s, by_output) = (beyond(moved(generator, row)), beyond(moved(output, row) * gear.ratio));
        if extra_s > EXTRA_ROWS * period_s && (by_output - extra_s).abs() < TOGETHER * extra_s {
            found.push((row, extra_s));
        }
    }
    Some((found, tested, period_s))
}

/// The same leaps, and one of the usual size in each row where the rhythm of its session asks for it and the motion
/// does not show it.
fn by_rhythm(log: &Log, leaps: &[Leap], every: usize, size_s: f64) -> Vec<Leap> {
    let mut all = Vec::new();
    // A session counts anew; before its first leap its rhythm is the one of that leap.
    for rows in log.sessions() {
        let at = |row: usize| leaps.partition_point(|(leap, _)| *leap < row);
        let of_session = &leaps[at(rows.start)..at(rows.end)];
        let mut phases = vec![0usize; every];
        of_session.iter().for_each(|(row, _)| phases[(log.line[*row] as usize) % every] += 1);
        let Some(phase) = (0..every).max_by_key(|k| phases[*k]).filter(|_| !of_session.is_empty()) else { continue };
        let in_phase = |row: usize| (log.line[row] as usize % every == phase).then_some((row, size_s));
        let seen = |row: usize| of_session.binary_search_by_key(&row, |(leap, _)| *leap).ok().map(|k| of_session[k]);
        all.extend((rows.start + 1..rows.end).filter_map(|row| seen(row).or_else(|| in_phase(row))));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of a drive at an even pace with a stop; the logger stands still for `stall_s` after every 50 rows, and
    /// counts `counted`.
    fn log(stall_s: f64, counted: bool, noise_rad: f64) -> Log {
        let mut log = Log::default();
        log.line = (2..3002).collect();
        let (mut stamps, mut time, mut psi) = (Vec::new(), 0.0, 0.0);
        let (mut generator, mut output) = (Vec::new(), Vec::new());
        for k in 0..3000 {
            let dt = if k % 50 == 0 { 0.01 + stall_s } else { 0.01 };
            time += dt;
            psi += dt * if (1000..1200).contains(&k) { 0.0 } else { 8.0 };
            stamps.push(if counted { 0.01 * f64::from(k) } else { time });
            generator.push(psi);
            output.push(psi / 100.0 + noise_rad * f64::from(k % 3));
        }
        log.put(Quantity::Time, stamps);
        log.put(Quantity::Generator, generator);
        log.put(Quantity::Output, output);
        log
    }

    #[test]
    fn rows_may_be_so_close_that_one_moves_the_output_by_less_than_its_noise() {
        let (mut log, mut findings) = (log(0.04, true, 1e-4), Findings::default());
        check(&mut log, &Gear::of_ratio(100.0), &mut findings);
        assert_eq!(findings.faults.first().map(|fault| fault.measures.every_rows), Some(Some(50)));
    }

    #[test]
    fn stalls_are_told_with_rhythm_and_size_and_time_is_made_anew() {
        let (mut log, mut findings) = (log(0.04, true, 5e-6), Findings::default());
        check(&mut log, &Gear::of_ratio(100.0), &mut findings);
        let fault = &findings.faults[0];
        assert_eq!((fault.name, fault.measures.every_rows), (FaultName::Stalls, Some(50)));
        assert!((fault.measures.size_ms.unwrap() - 40.0).abs() < 1.0, "{fault:?}");
        let time = log.get(Quantity::Time).unwrap();
        // 59 leaps after the first row.
        assert!((time[2999] - time[0] - 29.99 - 59.0 * 0.04).abs() < 0.05, "{}", time[2999]);
    }

    #[test]
    fn a_clock_that_shows_them_and_a_logger_without_any_are_left_alone() {
        for mut log in [log(0.04, false, 5e-6), log(0.0, true, 5e-6)] {
            let mut findings = Findings::default();
            check(&mut log, &Gear::of_ratio(100.0), &mut findings);
            assert!(findings.faults.is_empty(), "{:?}", findings.faults);
        }
    }
}
