//! A zero that moves with time, the same in every state of the drive.
//!
//! Wear, heat and a falling stiffness move the error too, but not on both flanks alike; a wrong ratio and an eccentric
//! encoder move it with the angle. Drift is named only where the data distinguish it from them.

use std::ops::Range;

use super::state::{Extra, StateModel};
use super::steps::largest_torque;
use super::{ARCSEC, Findings, WIDEST_CLEARANCE_RAD, level};
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
use flexspline_base::robust::median_of;

/// Drift of less than this over the whole recording is not looked for, rad. *Guess*: below what most causes do, and
/// raised from 3 arcsec.
const LEAST_RAD: f64 = 10.0 * ARCSEC;
/// A trend is this many standard deviations. *Guess*: one more than the five by which causes are separated, as a repair
/// changes the rows.
const CERTAIN: f64 = 6.0;
/// Fewest gaps between sessions that separate a drift from offsets that are set anew. *Guess*: two gaps agree to a
/// twentieth by chance in one recording of twenty.
const FEWEST_GAPS: usize = 2;
/// A session may lie off the line by this share of all the drift. *Guess*: that twentieth.
const OFF_THE_LINE: f64 = 0.05;
/// Within sessions the offset moves as it does over all of them: the slope there is off by this share at most, …
/// *Guess*: a drift is not quite even.
const WITHIN: f64 = 0.5;
/// … and this number of its standard deviations. *Guess*: the usual three.
const WITHIN_STDS: f64 = 3.0;
/// Session offsets that are free at once, at most. *Guess*: it bounds the columns of the fit.
const MOST_ZEROS: usize = 64;
/// Sessions in which a drift of this share would not show by [`WITHIN_STDS`] have to lie on its line, by
/// [`OFF_THE_LINE`]. *Guess*: as [`WITHIN`].
const SHOWS: f64 = 0.5;
/// A drift is the same on both flanks: the part that differs is below this share. *Guess*: wear and heat differ by all
/// of it.
const ALIKE: f64 = 0.35;
/// A trend may be one of position, load and temperature if considering them multiplies its standard deviation by more
/// than this. *Guess*: then they hold 15/16 of the information.
const CONFUSED: f64 = 4.0;
/// It is none of them from this number of standard deviations on. *Guess*: ten times what separates causes.
const BEYOND_CONFUSION: f64 = 50.0;
/// Share of rows that each flank must have. *Guess*: fewer rows do not say how it moves there.
const BOTH_FLANKS: f64 = 0.1;

/// If the error moves by this and by [`LEAP_SHARE`] of the drift within [`LEAP_S`], it does not drift, rad. *Guess*:
/// beyond the clearance and as much of wind-up.
const LEAST_LEAP_RAD: f64 = 2.0 * WIDEST_CLEARANCE_RAD;
/// Time within which a leap happens, s. *Guess*: drift takes hours, teeth that skip a second.
const LEAP_S: f64 = 2.0;
/// Share of the drift that a leap has at least. *Guess*: no drift makes a third of its way in seconds.
const LEAP_SHARE: f64 = 0.3;
/// Rows of which the median is a level. *Guess*: it has a third of the noise of a row.
const LEVEL_ROWS: usize = 12;

/// Finds a linear drift over the whole recording, names it and takes it out.
pub(in crate::measurement) fn check(log: &mut Log, gear: &Gear, findings: &mut Findings) {
    let Some(([total, std], [begin, end])) = slope(log, gear) else { return };
    let per_s = total / (end - begin);
    let per_hour = 3600.0 * per_s / ARCSEC;
    findings.add(log.fault(FaultName::Drift, 0..log.len()), Quantity::Error, Treatment::Repaired, |fault| {
        fault.size_arcsec = Some(total / ARCSEC);
        fault.measures.arcsec_per_hour = Some(per_hour);
        format!(
            "the zero of the error drifts by {:.2} arcsec in all, {per_hour:.1} an hour (standard deviation of all \
             {:.2}), alike on both flanks, and not with temperature or position: a straight line in time is taken out",
            total / ARCSEC,
            std / ARCSEC
        )
    });
    if let Some(mut error) = log.take(Quantity::Error) {
        let time = log.of(Quantity::Time);
        error.iter_mut().zip(time).for_each(|(error, t)| *error -= per_s * (t - 0.5 * (begin + end)));
        log.put(Quantity::Error, error);
    }
}

/// Drift over the whole recording and its standard deviation, rad; when it begins and ends, s.
pub(in crate::measurement) fn slope(log: &Log, gear: &Gear) -> Option<([f64; 2], [f64; 2])> {
    let time = log.get(Quantity::Time)?;
    let (begin, end) = (*time.first()?, *time.last()?);
    let sessions: Vec<Range<usize>> = log.sessions().collect();
    // A clock that was set back gives no common time.
    let ordered = sessions.windows(2).all(|pair| time[pair[1].start] >= time[pair[0].end - 1]);
    if sessions.iter().any(|rows| rows.len() < 2) || end <= begin || !ordered {
        return None;
    }
    let state = StateModel::new(log, gear);
    let forward = state.flank.iter().filter(|flank| **flank > 0.0).count() as f64 / log.len() as f64;
    if !(BOTH_FLANKS..=1.0 - BOTH_FLANKS).contains(&forward) {
        return None;
    }
    let tau = |row: usize| 2.0 * (time[row] - begin) / (end - begin) - 1.0;
    let by_flank = |row: usize| tau(row) * state.flank[row];
    let load = |row: usize| log.get(Quantity::Torque).map_or(0.0, |torque| torque[row]);
    let sign = |load: f64| if load == 0.0 { 0.0 } else { load.signum() };
    let by_load = |row: usize| tau(row) * sign(load(row));
    let by_load_size = |row: usize| load(row) * tau(row);
    let all: [Extra; 4] = [&tau, &by_flank, &by_load, &by_load_size];
    let fit = state.fit(&all)?;
    let place = fit.value.len() - 4;
    let value = |k: usize| fit.value[place + k];
    let (drift, formal) = (value(0), fit.std[place]);
    // The part that goes with the flank, at the largest torque for the last.
    let unlike = value(1).abs().max(value(2).abs()).max(value(3).abs() * largest_torque(log));
    if drift.abs() * 2.0 < LEAST_RAD || unlike > ALIKE * drift.abs() {
        return None;
    }
    // Teeth that slip have a trend, too.
    if largest_leap(log) > LEAST_LEAP_RAD.max(LEAP_SHARE * 2.0 * drift.abs()) {
        return None;
    }
    // Time over the recording, alone, has the size 1/√3. Few sessions look like many a state of a drive: then
    // the sessions have to say it with one voice.
    let confused = formal > CONFUSED * 3.0_f64.sqrt() * fit.unit_std;
    if confused && drift.abs() < BEYOND_CONFUSION * formal {
        return None;
    }
    // Whether the middles of sessions lie on the line: what is left there.
    let on_the_line = || {
        let left = state.left(&fit, &all);
        let lefts: Vec<f64> = sessions.iter().map(|rows| level(&left, rows.clone())).collect();
        let zero = median_of(&mut lefts.clone());
        lefts.iter().all(|left| (left - zero).abs() < OFF_THE_LINE * 2.0 * drift.abs())
    };
    if confused && (sessions.len() <= FEWEST_GAPS || !on_the_line()) {
        return None;
    }
    // A zero that is set anew in each session may lie anywhere, also about a line; within the sessions it stands then.
    let zeros: Vec<_> = sessions[1..].iter().map(|of| |row: usize| f64::from(u8::from(of.contains(&row)))).collect();
    let columns: Vec<Extra> = all.into_iter().chain(zeros.iter().map(|zero| zero as Extra)).collect();
    if (2..=MOST_ZEROS).contains(&sessions.len())
        && let Some(fit) = state.fit(&columns)
    {
        let (within, std) = (fit.value[place], fit.std[place]);
        let unlike = (within - drift).abs() > WITHIN * drift.abs() + WITHIN_STDS * std;
        if unlike || WITHIN_STDS * std >= SHOWS * drift.abs() && !on_the_line() {
            return None;
        }
    }
    ((drift / formal).abs() > CERTAIN).then_some(([2.0 * drift, 2.0 * formal], [begin, end]))
}

/// The largest change within [`LEAP_S`], rad, between medians of a few rows.
fn largest_leap(log: &Log) -> f64 {
    let (time, mut largest) = (log.of(Quantity::Time), 0.0f64);
    for Range { start, end } in log.sessions() {
        let from = |row: usize| level(log.of(Quantity::Error), row..(row + LEVEL_ROWS).min(end));
        let mut later = start;
        for row in (start..end).step_by(LEVEL_ROWS / 2) {
            while later + 1 < end && time[later] < time[row] + LEAP_S {
                later += 1;
            }
            largest = largest.max((from(later) - from(row)).abs());
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;

    /// Sessions of 15 s at 100 Hz, minutes apart, on a drive with clearance and wind-up whose zero moves; `zeros` are
    /// those of the sessions.
    fn sessions(per_hour_arcsec: f64, zeros: &[f64]) -> Vec<Session> {
        sessions_apart(300.0, per_hour_arcsec, zeros)
    }

    /// The same, once to twice this many seconds apart.
    fn sessions_apart(apart_s: f64, per_hour_arcsec: f64, zeros: &[f64]) -> Vec<Session> {
        let mut random = fastrand::Rng::with_seed(8);
        let mut begin = 0.0;
        let one = |(number, zero): (usize, &f64)| {
            let time: Vec<f64> = (0..1500).map(|k| begin + 0.01 * f64::from(k)).collect();
            let since: Vec<f64> = time.iter().map(|t| t - begin).collect();
            begin += 15.0 + apart_s * (1.0 + random.f64());
            let torque: Vec<f64> = since.iter().map(|t| 20.0 * (0.9 * t + number as f64).sin()).collect();
            let noise = |random: &mut fastrand::Rng| 2.0 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
            let error = time.iter().zip(&torque).map(|(t, torque)| {
                let drive = 7.0 * torque + 30.0 * torque.signum() + noise(&mut random);
                ARCSEC * (drive + zero + per_hour_arcsec * t / 3600.0)
            });
            Session {
                error_rad: error.collect(),
                line: (2..1502).collect(),
                generator_rad: since.iter().map(|t| 30.0 * (0.6 * t).sin()).collect(),
                torque_n_m: Some(torque),
                time_s: Some(time),
                ..Session::default()
            }
        };
        zeros.iter().enumerate().map(one).collect()
    }

    #[test]
    fn zeros_that_are_set_anew_are_no_drift_as_they_stand_within_the_sessions() {
        for zeros in [[0.0, 130.0, 180.0, 370.0], [0.0, -150.0, -120.0, -400.0], [0.0, 60.0, 140.0, 190.0]] {
            assert_eq!(found(sessions_apart(5.0, 0.0, &zeros)), None, "{zeros:?}");
        }
        for per_hour in [-9000.0, 3000.0] {
            let rate = found(sessions_apart(5.0, per_hour, &[0.0; 4])).expect("a drift");
            assert!((rate / per_hour - 1.0).abs() < 0.1, "{rate} for {per_hour}");
        }
    }

    fn found(mut sessions: Vec<Session>) -> Option<f64> {
        let mut findings = Findings::default();
        Log::on(&mut sessions, |log| check(log, &Gear::of_ratio(100.0), &mut findings));
        findings.faults.first().and_then(|fault| fault.measures.arcsec_per_hour)
    }

    #[test]
    fn a_drift_over_sessions_that_are_shorter_than_their_breaks_is_distinguished_from_zeros_that_are_set_anew() {
        for per_hour in [-2000.0, 600.0, 5000.0] {
            let rate = found(sessions(per_hour, &[0.0; 4])).expect("a drift");
            assert!((rate / per_hour - 1.0).abs() < 0.05, "{rate} for {per_hour}");
        }
        // Two breaks are enough where the zeros of both agree.
        let rate = found(sessions(2600.0, &[0.0; 3])).expect("a drift");
        assert!((rate / 2600.0 - 1.0).abs() < 0.05, "{rate}");
        assert_eq!(found(sessions(0.0, &[0.0, 260.0, -340.0])), None);
        assert_eq!(found(sessions(0.0, &[0.0; 4])), None);
        assert_eq!(found(sessions(0.0, &[0.0, 210.0, 340.0, 690.0])), None);
    }
}
