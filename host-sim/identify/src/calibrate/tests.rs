//! Units made up here, with parts that are known, by laws of their own.

use flexspline::Table;

use super::folds::Row;
use super::interval::OF_95;
use super::*;
use crate::extension::left_by_core;
use crate::measurement::Session;
use crate::misfit::about_mean;
use crate::nominal::Harmonic;
use crate::replay::{ReplayedRow, measured_rows, replay};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::was_recorded;
use flexspline_mechanics::drive::GeneratorKind;

const RATIO: f64 = 101.0;

/// Noise of two arc-seconds, normal enough.
fn noise(random: &mut fastrand::Rng) -> f64 {
    2.0 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0)
}

/// A recording of one session: to and fro through 1.2 output turns under a load that swings, with an error by `law`
/// (arcsec) of generator angle, output angle, torque and direction.
fn recording(seed: u64, law: impl Fn(f64, f64, f64, f64) -> f64) -> Recording {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut session = Session { torque_n_m: Some(Vec::new()), ..Session::default() };
    let rows = 4000;
    for k in 0..rows {
        let (from_end, way) = if k < rows / 2 { (k, 1.0) } else { (rows - 1 - k, -1.0) };
        let psi = 0.38 * from_end as f64;
        let torque = 30.0 * (k as f64 / 61.0 + seed as f64).sin();
        let error = law(psi, psi / RATIO, torque, way) + noise(&mut random);
        session.line.push(k as u64);
        session.generator_rad.push(psi);
        session.error_rad.push((error + 5000.0) / ARCSEC_PER_RAD);
        session.torque_n_m.as_mut().unwrap().push(torque);
    }
    Recording::made(&format!("{seed}.log"), vec![session])
}

fn by_ratio() -> Prior<'static> {
    Prior::of_ratio(RATIO, GeneratorKind::Cam)
}

/// As long as the output's angle is no larger.
fn up_to(mut log: Recording, output_rad: f64) -> Recording {
    let beyond: Vec<bool> = log.sessions[0].generator_rad.iter().map(|psi| psi / RATIO > output_rad).collect();
    log.sessions[0].leave_out(&beyond);
    log
}

fn kept(calibration: &Calibration) -> Vec<&'static str> {
    calibration.parts.iter().filter(|part| part.kept).map(|part| part.name).collect()
}

/// Recorded over a quarter of a turn, an eccentric encoder and an oval one at six places of the turn: there the table
/// takes their waves out; over the rest it leaves no more than there is without it.
#[test]
fn where_nothing_was_recorded_a_table_adds_no_error() {
    const RECORDED_RAD: f64 = 1.6;
    for [first, second] in [[100.0, 40.0], [0.0, 60.0]] {
        let mut all = [[0.0; 2]; 2];
        for phase in 0..6 {
            let law = |psi: f64, out: f64, _: f64, _: f64| {
                let [once, twice] = [(out + f64::from(phase)).cos(), (2.0 * out + f64::from(phase)).cos()];
                4.0 * (2.0 * psi).sin() + first * once + second * twice
            };
            let mut whole = recording(1, law);
            let session = &mut whole.sessions[0];
            session.torque_n_m = None;
            let beyond: Vec<bool> = session.generator_rad.iter().map(|psi| psi / RATIO > RECORDED_RAD).collect();
            let made = calibrate(&[up_to(whole.clone(), RECORDED_RAD)], &by_ratio()).unwrap();
            assert!(kept(&made.calibration).contains(&"output_angle"), "{:#?}", made.calibration.parts);
            let held = |note: &String| note.contains("elsewhere the curve over the output angle");
            assert!(made.calibration.notes.iter().any(held), "{:?}", made.calibration.notes);
            // Mean squares by the core, less the zero of what was recorded: there, and in the rest.
            let angles = whole.sessions[0].generator_rad.iter();
            let once: Vec<bool> = angles.map(|psi| psi / RATIO < std::f64::consts::TAU).collect();
            let squares = |values: &[f64]| -> [f64; 2] {
                let in_turn = values.iter().zip(&beyond).zip(&once).filter(|of| *of.1).map(|of| of.0);
                let of = |rest: bool| in_turn.clone().filter(move |of| *of.1 == rest).map(|of| *of.0);
                let count = |rest: bool| of(rest).count() as f64;
                let zero = of(false).sum::<f64>() / count(false);
                [false, true].map(|rest| of(rest).map(|value| (value - zero).powi(2)).sum::<f64>() / count(rest))
            };
            let table = Table::check(&made.table.image).unwrap();
            let in_parts = |psi: &f64| (psi / RATIO).to_degrees().rem_euclid(360.0) < 90.0;
            assert!(whole.sessions[0].generator_rad.iter().all(|psi| was_recorded(&table, *psi) == in_parts(psi)));
            let left = left_by_core(&table, &whole.sessions[0], 20.0);
            let measured: Vec<f64> = whole.sessions[0].error_rad.iter().map(|rad| rad * ARCSEC_PER_RAD).collect();
            for (sum, of) in all.iter_mut().flatten().zip([&measured, &left].into_iter().flat_map(|of| squares(of))) {
                *sum += of / 6.0;
            }
        }
        let [measured, left] = all.map(|squares| squares.map(f64::sqrt));
        println!("{first} {second}: {measured:.1?} arcsec as measured, recorded and beyond; {left:.1?} with the table");
        assert!(left[0] < 0.06 * measured[0], "{measured:?}, {left:?}");
        assert!(left[1] < measured[1], "{measured:?}, {left:?}");
    }
}

#[test]
fn parts_that_a_unit_has_are_found_and_the_core_takes_them_out() {
    let law = |psi: f64, out: f64, torque: f64, way: f64| {
        25.0 * (2.0 * psi + 0.3).sin() + 120.0 * (out - 0.7).cos() + 1.5 * torque + 4e-4 * torque.powi(3) - 12.0 * way
    };
    let made = calibrate(&[recording(1, law)], &by_ratio()).unwrap();
    let c = &made.calibration;
    assert_eq!(kept(c), ["wind_up", "play", "generator_angle", "output_angle"], "{:#?}", c.parts);
    // The noise is 2 arcsec.
    assert!(c.held_out.rms_after_arcsec < 2.2 && c.held_out.rms_before_arcsec > 90.0, "{:?}", c.held_out);
    assert!(c.core.rms_after_arcsec < 2.6, "{:?}", c.core);
    assert!(c.projection_rms_arcsec < 0.1, "{}", c.projection_rms_arcsec);
    // Another log of the same unit, which nobody has fitted, through the image.
    let other = recording(5, law);
    let table = Table::check(&made.table.image).unwrap();
    let rms = about_mean(&left_by_core(&table, &other.sessions[0], 20.0));
    assert!(rms < 2.7, "{rms}");
    // With what is true known before, little is left to fit.
    let mut known = by_ratio();
    known.nominal.harmonics.push(Harmonic { order_per_generator_turn: 2.0, amplitude_arcsec: 25.0, phase_rad: 0.3 });
    let made = calibrate(&[recording(1, law)], &known).unwrap();
    assert_eq!(kept(&made.calibration), ["wind_up", "play", "output_angle"]);
    assert!(made.calibration.core.rms_after_arcsec < 2.6, "{:?}", made.calibration.core);
}

/// The same rows at paces of the motor of 2, 3.5, 5 and 2.8 rad/s, leg by leg, the output read `delay_s` late.
fn at_paces(mut recording: Recording, delay_s: f64) -> Recording {
    let session = &mut recording.sessions[0];
    let (mut t, mut time) = (0.0, Vec::new());
    for k in 0..session.len() {
        time.push(t);
        let pace = [2.0, 3.5, 5.0, 2.8][k / 500 % 4];
        t += 0.38 / pace;
        let way = if k < session.len() / 2 { 1.0 } else { -1.0 };
        session.error_rad[k] -= delay_s * way * pace / RATIO;
    }
    session.time_s = Some(time);
    recording
}

#[test]
fn a_delay_is_no_play_and_play_is_no_delay() {
    // With the last, which oppose each other, neither gains alone.
    for (delay_s, play) in [(0.005, 0.0), (0.0, 18.0), (0.005, 18.0), (-0.003, 18.0)] {
        let law = |psi: f64, _: f64, _: f64, way: f64| 25.0 * (2.0 * psi).sin() - play * way;
        let made = calibrate(&[at_paces(recording(3, law), delay_s)], &by_ratio()).unwrap();
        let c = &made.calibration;
        let old = if delay_s > 0.0 { "the output is" } else { "the generator is" };
        let told = c.notes.iter().find(|note| note.contains(old) && note.contains("older than"));
        assert_eq!(told.is_some(), delay_s != 0.0, "{delay_s} {play}: {:?}", c.notes);
        assert_eq!(c.has_delay(), delay_s != 0.0);
        if c.has_delay() {
            let Reading { value, std, .. } = c.readings[0];
            assert!((value - delay_s).abs() < OF_95 * std && OF_95 * std < 3e-4, "{:?}", c.readings);
        }
        assert_eq!((c.readings.last().unwrap().name, c.play_of_a_millisecond_arcsec), ("offset", None));
        assert_eq!(kept(c).contains(&"play"), play > 0.0, "{delay_s} {play}: {:?}", c.parts);
        assert!(c.core.rms_after_arcsec < 3.0, "{:?}", c.core);
    }
    // Each log has its own.
    let of_logs = [(3, 0.004), (4, 0.0)].map(|(seed, delay_s)| {
        at_paces(recording(seed, |psi, _, _, way| 25.0 * (2.0 * psi).sin() - 18.0 * way), delay_s)
    });
    let c = calibrate(&of_logs, &by_ratio()).unwrap().calibration;
    let delays: Vec<&Reading> = c.readings.iter().filter(|reading| reading.name == "delay").collect();
    assert!(delays.len() == 1 && delays[0].file == of_logs[0].file, "{delays:?}");
    assert!((delays[0].value - 0.004).abs() < OF_95 * delays[0].std && delays[0].std < 2e-4, "{delays:?}");
    // Of several logs it is told once.
    let files = [3, 4].map(|seed| at_paces(recording(seed, |psi, _, _, _| 25.0 * (2.0 * psi).sin()), 0.005));
    let notes = calibrate(&files, &by_ratio()).unwrap().calibration.notes;
    assert_eq!(notes.iter().filter(|note| note.contains("older than")).count(), 1, "{notes:?}");
}

/// At one pace nothing tells a delay from play; a plan has paces that do.
#[test]
fn one_pace_is_said_to_hide_a_delay_and_a_plan_has_others() {
    let bench = Bench { minutes: 40.0, rate_hz: 5.0, torque_n_m: [-30.0, 30.0], ..Bench::default() };
    let planned = plan(&by_ratio(), &bench).unwrap();
    let law = |psi: f64, out: f64, torque: f64, _: f64| 18.0 * (2.0 * psi).sin() + 40.0 * out.cos() + 1.2 * torque;
    let late = |planned: &Planned| {
        let mut log = played(planned, 4, law);
        let session = &mut log.sessions[0];
        let speeds = rows::speeds_rad_s(session, RATIO);
        session.error_rad.iter_mut().zip(speeds).for_each(|(error, speed)| *error -= 0.005 * speed);
        calibrate(&[log], &by_ratio()).unwrap().calibration
    };
    let c = late(&planned);
    assert!(c.has_delay() && (c.readings[0].value - 0.005).abs() < OF_95 * c.readings[0].std, "{:?}", c.notes);
    assert!(!kept(&c).contains(&"play") && c.core.rms_after_arcsec < 1.5, "{:?}", c.core);
    // The same passes at one speed.
    let fastest = planned.passes.iter().map(|pass| pass.speed_rpm).fold(0.0, f64::max);
    let mut at_one = planned;
    for pass in &mut at_one.passes {
        pass.duration_s *= pass.speed_rpm / fastest;
        pass.speed_rpm = fastest;
    }
    let c = late(&at_one);
    let of_a_millisecond = 2e-3 * fastest / 60.0 * std::f64::consts::TAU / RATIO * ARCSEC_PER_RAD;
    let said = c.play_of_a_millisecond_arcsec.unwrap();
    assert!((said / of_a_millisecond - 1.0).abs() < 0.05, "{said} of {of_a_millisecond}");
    assert!(kept(&c).contains(&"play") && !c.has_delay(), "{:?}", c.parts);
    assert!(c.notes.iter().any(|note| note.contains("one pace") && note.contains("a millisecond")), "{:?}", c.notes);
    // The delay of 5 ms is in the table as play, and its interval at another pace has that.
    let widths = [c.half_width_as_recorded_arcsec, c.half_width_at_another_pace_arcsec];
    assert!(widths[0] < said && widths[1] > 2.5 * said, "{widths:?}, {said} of a millisecond");
    // A plan that has time for one pace says so.
    let short = plan(&by_ratio(), &Bench { minutes: 8.0, ..bench }).unwrap();
    assert!(short.cannot.iter().any(|why| why.starts_with("reading_delay")), "{:?}", short.cannot);
}

/// Back at three times the pace of the way out: each direction has one pace, and a delay is play there, too.
#[test]
fn another_pace_back_is_no_second_pace_and_play_is_found() {
    let mut log = recording(6, |psi, _, _, way| 18.0 * (2.0 * psi).sin() - 20.0 * way);
    let all = std::mem::take(&mut log.sessions[0]);
    let session = &mut log.sessions[0];
    session.time_s = Some(Vec::new());
    for k in (0..all.len()).filter(|k| *k < all.len() / 2 || k % 3 == 0) {
        session.time_s.as_mut().unwrap().push(0.05 * session.line.len() as f64);
        session.line.push(all.line[k]);
        session.generator_rad.push(all.generator_rad[k]);
        session.error_rad.push(all.error_rad[k]);
    }
    let c = calibrate(&[log], &by_ratio()).unwrap().calibration;
    assert!(kept(&c).contains(&"play") && !c.has_delay(), "{:?}", c.parts);
    let unloaded = c.nodes.iter().find(|node| node.part == "play" && node.at == 0.0).unwrap();
    assert!((unloaded.value_arcsec.unwrap() + 20.0).abs() < 0.5, "{unloaded:?}");
}

/// A bench that sets the output to zero anew before each session of a log, and not: zeros of their own, and one; also
/// where springs slip under the load, or nobody read what it was.
#[test]
fn sessions_that_were_set_to_zero_anew_have_zeros_of_their_own() {
    let some: &[f64] = &[0.0, 80.0, -60.0, 130.0];
    let all = [some, &[0.0; 4], &[0.0, 35.0, 25.0, -70.0, -105.0, -80.0], some];
    for (zeros, (loop_arcsec, load)) in all.into_iter().zip([(0.0, 1.5), (0.0, 1.5), (15.0, 1.5), (0.0, 0.0)]) {
        let law = |psi: f64, _: f64, torque: f64, way: f64| 20.0 * (2.0 * psi).sin() + load * torque - 12.0 * way;
        let mut log = recording(1, law);
        let session = |(seed, zero): (u64, &f64)| {
            let mut session = recording(seed, law).sessions.remove(0);
            let mut held = 0.0_f64;
            for (torque, error) in session.torque_n_m.iter().flatten().zip(&mut session.error_rad) {
                held = held.clamp(torque - 8.0, torque + 8.0);
                *error += (zero + loop_arcsec * (held - torque) / 8.0) / ARCSEC_PER_RAD;
            }
            session.torque_n_m = session.torque_n_m.filter(|_| load > 0.0);
            session
        };
        log.sessions = (1..).zip(zeros).map(session).collect();
        let made = calibrate(std::slice::from_ref(&log), &by_ratio()).unwrap();
        let c = &made.calibration;
        let found = c.readings.iter().filter(|reading| reading.name == OFFSET).map(|reading| reading.value);
        let found: Vec<f64> = found.collect();
        let (anew, first) = (zeros[1] != 0.0, found[0]);
        assert_eq!((found.len(), c.files.len()), (if anew { zeros.len() } else { 1 }, 1), "{:?}", c.notes);
        let most = 0.5 + 0.2 * loop_arcsec;
        assert!(found.iter().zip(zeros).all(|(found, zero)| (found - first - zero).abs() < most), "{found:?}");
        assert_eq!(c.notes.iter().any(|note| note == SET_ANEW), anew, "{:?}", c.notes);
        let torque = c.torque_from_wind_up.as_ref();
        assert!(c.held_out.rms_after_arcsec < 2.5 + loop_arcsec, "{:?}", c.held_out);
        assert!(torque.map_or(load == 0.0, |torque| torque.rms_n_m < 1.6 + loop_arcsec), "{torque:?}");
        let table = Table::check(&made.table.image).unwrap();
        let on_one = crate::replay::on_own_zeros(&table, on_zero_of(&table, log), 20.0);
        let means = on_one.sessions.iter().map(|session| session.error_rad.iter().sum::<f64>() / session.len() as f64);
        let means: Vec<f64> = means.map(|mean| mean * ARCSEC_PER_RAD).collect();
        assert!(means.iter().all(|mean| (mean - means[0]).abs() < 5.0), "{means:?}");
        assert_eq!(on_one.notes.iter().any(|note| note == SET_ANEW), anew, "{:?}", on_one.notes);
    }
}

/// Set to its mark again before the next session.
#[test]
fn an_index_that_is_lost_to_the_end_of_a_session_costs_a_table_nothing() {
    let law = |psi: f64, _: f64, torque: f64, way: f64| 20.0 * (2.0 * psi).sin() + 1.5 * torque - 12.0 * way;
    let mut log = recording(1, law);
    let session = |seed: u64| {
        let mut session = recording(seed, law).sessions.remove(0);
        session.line.iter_mut().for_each(|line| *line += 10_000 * seed);
        session
    };
    log.sessions = (1..5).map(session).collect();
    log.sessions[1].error_rad[1500..].iter_mut().for_each(|error| *error += 60.0 / ARCSEC_PER_RAD);
    let calibration = calibrate(&[log], &by_ratio()).unwrap().calibration;
    let [lost] = &calibration.data_faults[..] else { panic!("{:?}", calibration.data_faults) };
    assert_eq!((lost.name, lost.first_line), (FaultName::EncoderIndexJump, 21_500));
    assert!(calibration.held_out.rms_after_arcsec < 2.5, "{:?}", calibration.held_out);
}

/// Logs at one load each, and each with a zero that is free, say nothing of the wind-up.
#[test]
fn logs_of_one_load_each_make_no_wind_up() {
    let law = |psi: f64, _: f64, torque: f64, _: f64| 25.0 * (2.0 * psi).sin() + 1.5 * torque;
    let files: Vec<Recording> = [-20.0, 0.0, 20.0]
        .map(|load: f64| {
            let mut log = recording((load + 30.0) as u64, |psi, out, _, way| law(psi, out, load, way));
            log.sessions[0].torque_n_m.as_mut().unwrap().fill(load);
            log
        })
        .to_vec();
    let c = calibrate(&files, &by_ratio()).unwrap().calibration;
    let wind_up = c.parts.iter().find(|part| part.name == "wind_up").unwrap();
    assert!(!wind_up.kept && wind_up.why.contains("one load"), "{wind_up:?}");
    assert!(c.notes.iter().any(|note| note.contains("several loads in one log")), "{:?}", c.notes);
    assert_eq!(c.torque_n_m, [0.0; 2], "a table at one load");
}

#[test]
fn logs_that_do_not_agree_are_told_and_the_odd_one_named() {
    let law = |psi: f64, _: f64, torque: f64, _: f64| 25.0 * (2.0 * psi).sin() + 1.5 * torque;
    let said = |files: &[Recording], what: &str| {
        let notes =
            calibrate(files, &by_ratio()).map_or_else(|error| vec![error.to_string()], |made| made.calibration.notes);
        notes.into_iter().find(|note| note.contains(what))
    };
    let whatever = |files: &[Recording]| said(files, "the same in all logs").or(said(files, "do not agree"));
    let agree: Vec<Recording> = (1..4).map(|seed| recording(seed, law)).collect();
    assert_eq!((whatever(&agree), whatever(&agree[..2])), (None, None));
    let sign = recording(6, |psi, out, torque, way| law(psi, out, -torque, way));
    assert!(said(&[agree[0].clone(), sign.clone()], "the logs do not agree").is_some());
    let said_of_sign = said(&[&agree[..], &[sign]].concat(), "the logs do not agree").unwrap();
    assert!(said_of_sign.contains(" in 6.log, "), "{said_of_sign}");
    // A zero of the generator is told with its angle, the curve of which goes twice a turn here.
    for turned_deg in [10.0_f64, -40.0] {
        let by = turned_deg.to_radians();
        let turned = recording(5, |psi, out, torque, way| law(psi - by, out, torque, way));
        let said = said(&[agree[0].clone(), turned], "is not the same in all logs").unwrap();
        let angle = said.split("it reads ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
        assert!((angle.parse::<f64>().unwrap() - turned_deg).abs() < 1.0, "{said}");
    }
    // With a curve over the output the turns are named, too.
    let turns = 30.0 * std::f64::consts::TAU;
    let eccentric = |psi: f64, out: f64, torque: f64, way: f64| law(psi, out, torque, way) + 60.0 * out.cos();
    let turned = recording(5, |psi, out, torque, way| eccentric(psi - turns, out - turns / RATIO, torque, way));
    let turned = said(&[recording(1, eccentric), turned], "is not the same in all logs").unwrap();
    assert!(turned.contains("(+30.00 turns)"), "{turned}");
}

/// A fit is not judged at loads that it has not seen: each log at others is no fold.
#[test]
fn logs_at_loads_of_their_own_are_judged_in_blocks_of_all() {
    let files: Vec<Recording> = [[0.0, 1.0], [20.0, 10.0], [-20.0, -10.0]]
        .into_iter()
        .zip(1..)
        .map(|(loads, seed)| {
            let mut log = recording(seed, |_, _, _, _| 0.0);
            let session = &mut log.sessions[0];
            for (row, error) in session.error_rad.iter_mut().enumerate() {
                let torque = loads[row / 500 % 2];
                session.torque_n_m.as_mut().unwrap()[row] = torque;
                let shape = 25.0 * (2.0 * session.generator_rad[row]).sin();
                *error += (shape + 1.5 * torque + 2e-3 * torque.powi(3)) / ARCSEC_PER_RAD;
            }
            log
        })
        .collect();
    let c = calibrate(&files, &by_ratio()).unwrap().calibration;
    assert_eq!(c.left_out, "blocks");
    assert!(c.held_out.rms_after_arcsec < 2.2, "{:?}", c.held_out);
}

#[test]
fn a_torque_of_the_wrong_sign_is_refused_and_a_wind_up_that_falls_is_no_part() {
    let wrong = calibrate(&[recording(1, |psi, _, torque, _| 25.0 * (2.0 * psi).sin() - 1.5 * torque)], &by_ratio());
    let wrong = wrong.err().unwrap();
    assert!(wrong.is_bad_input() && wrong.to_string().contains("torque=NAME:-N.m"), "{wrong}");
    // It grows from end to end, and falls between.
    let bent = |psi: f64, _: f64, torque: f64, _: f64| 25.0 * (2.0 * psi).sin() + 40.0 * (torque / 8.0).sin() + torque;
    let c = calibrate(&[recording(1, bent)], &by_ratio()).unwrap().calibration;
    let wind_up = c.parts.iter().find(|part| part.name == "wind_up").unwrap();
    assert!(!wind_up.kept && wind_up.why.contains("fall"), "{wind_up:?}");
    assert!(kept(&c).contains(&"generator_angle"));
}

#[test]
fn noise_makes_no_table_and_lone_parts_no_others() {
    for seed in 0..6 {
        let nothing = calibrate(&[recording(seed, |_, _, _, _| 0.0)], &by_ratio());
        assert!(matches!(nothing, Err(CalibrationError::NothingGained(_))), "seed {seed}");
        let one = calibrate(&[recording(seed, |psi, _, _, _| 8.0 * (2.0 * psi).sin())], &by_ratio()).unwrap();
        assert_eq!(kept(&one.calibration), ["generator_angle"], "seed {seed}");
    }
}

#[test]
fn files_are_left_out_whole_each_with_its_zero() {
    let law = |_: f64, out: f64, torque: f64, _: f64| 60.0 * out.cos() + 2.0 * torque;
    let mut files: Vec<Recording> = (0..4).map(|seed| recording(seed, law)).collect();
    files[2].sessions[0].error_rad.iter_mut().for_each(|error| *error += 0.3);
    let made = calibrate(&files, &by_ratio()).unwrap();
    let c = &made.calibration;
    assert_eq!((c.left_out, c.folds), ("files", 4));
    assert!(c.held_out.rms_after_arcsec < 2.2, "{:?}", c.held_out);
    assert!(c.core.rms_after_arcsec < 2.2, "{:?}", c.core);
}

/// A model of another drive has a wave that no part can take out: with a part that gains it still leaves more than no
/// table.
#[test]
fn a_table_that_loses_to_none_is_not_made() {
    let files: Vec<Recording> = (0..4).map(|seed| recording(seed, |_, out, _, _| 60.0 * out.cos())).collect();
    let mut prior = by_ratio();
    let other = Harmonic { order_per_generator_turn: 13.37, amplitude_arcsec: 300.0, phase_rad: 0.4 };
    prior.nominal.harmonics.push(other);
    let refused = calibrate(&files, &prior).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(refused.starts_with("what was known before is further off"), "{refused}");
    prior.nominal.harmonics[0].amplitude_arcsec = 10.0;
    let made = calibrate(&files, &prior).unwrap();
    assert!(kept(&made.calibration).contains(&"output_angle"), "{:?}", made.calibration.parts);
}

#[test]
fn what_was_not_recorded_is_not_fitted() {
    let mut short = recording(3, |psi, _, _, _| 20.0 * (2.0 * psi).sin());
    short.sessions[0] = Session { torque_n_m: None, ..short.sessions[0].part(0..200) };
    let made = calibrate(&[short], &by_ratio()).unwrap();
    let says = |name: &str| made.calibration.parts.iter().find(|part| part.name == name).unwrap().clone();
    for (name, why) in [
        ("wind_up", "no torque"),
        ("play", "one direction"),
        ("material_angle", "generator turns"),
        ("tooth_pitch", "teeth are not known"),
        ("output_angle", "of an output turn"),
        ("temperature", "no temperature"),
    ] {
        let part = says(name);
        assert!(!part.kept && part.held_out_gain.is_none() && part.why.contains(why), "{part:?}");
    }
    assert!(says("generator_angle").kept);
    let table = Table::check(&made.table.image).unwrap();
    assert_eq!(table.torque_range_n_m(), [0.0, 0.0]);
    // No thermometer keeps to the one number of a log without a temperature.
    assert_eq!(table.temperature_range_c(), [15.0, 25.0]);
}

#[test]
fn a_sum_over_folds_is_the_fit_to_the_rows() {
    let scales = Scales { temperature_c: [20.0; 2], teeth: 200.0, late_s: 1e-3, ..Scales::default() };
    let rows: Vec<Row> = (0..200)
        .map(|k| {
            let psi = 0.1 * k as f64;
            let angles = State { generator_rad: psi, output_rad: psi / 101.0, ..State::default() };
            let at = State { temperature_c: 20.0, way: 1.0, ..angles };
            Row { at, measured_arcsec: 0.0, left_arcsec: 7.0 * psi.sin() + 3.0, fold: k / 50, number: k, line: 0 }
        })
        .collect();
    let folds = Folds::new(&rows, &[PartName::GeneratorAngle], &scales, 1, false);
    assert_eq!(folds.path(&folds.all())[1][0].part, PartName::GeneratorAngle);
    let chosen = [Chosen { part: PartName::GeneratorAngle, penalty: 1e-9 }];
    let fitted = folds.fit(&folds.all(), &chosen, &[]).unwrap();
    assert!((fitted[0] - 3.0).abs() < 1e-4 && (fitted[1] - 7.0).abs() < 1e-4, "{fitted:?}");
    assert!(folds.left_out(&folds.all(), &chosen) < 1e-4);
    // Without the part its sine is left, about a zero that others found.
    let alone = folds.left_out(&folds.all(), &[]);
    assert!(alone > 200.0 * 20.0 && alone < 200.0 * 35.0, "{alone}");
}

/// The rows of a plan, with noise and without, of a unit by `law`.
fn played(planned: &Planned, seed: u64, law: impl Fn(f64, f64, f64, f64) -> f64) -> Recording {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut session = Session { torque_n_m: Some(Vec::new()), time_s: Some(Vec::new()), ..Session::default() };
    for pass in &planned.passes {
        let there = 0.5 * pass.duration_s;
        let count = (pass.duration_s * 5.0) as usize;
        for k in 0..count {
            let t = (k as f64 + 0.5) / 5.0;
            let (share, way) = if t < there { (t / there, 1.0) } else { (2.0 - t / there, -1.0) };
            let turns = pass.from_generator_turn + (pass.to_generator_turn - pass.from_generator_turn) * share;
            let psi = std::f64::consts::TAU * turns;
            let error = law(psi, psi / RATIO, pass.torque_n_m, way) + 0.5 * noise(&mut random);
            session.line.push(session.line.len() as u64);
            session.time_s.as_mut().unwrap().push(pass.begin_s + t);
            session.generator_rad.push(psi);
            session.error_rad.push(error / ARCSEC_PER_RAD);
            session.torque_n_m.as_mut().unwrap().push(pass.torque_n_m);
        }
    }
    Recording::made("planned.log", vec![session])
}

/// A unit of parts alone, and a bench without wander, so that the information matrix says all there is to say.
#[test]
fn a_plan_says_what_noise_leaves_and_its_intervals_hold() {
    let law = |psi: f64, out: f64, torque: f64, way: f64| {
        let flank = if torque.abs() > 0.6 { torque.signum() } else { -way };
        18.0 * (2.0 * psi + 0.3).sin() + 40.0 * (out - 0.7).cos() + 1.2 * torque + 3e-4 * torque.powi(3) - 4.0 * way
            + 9.0 * flank
    };
    let bench =
        Bench { minutes: 40.0, rate_hz: 5.0, torque_n_m: [-30.0, 30.0], wander_arcsec: 0.0, ..Bench::default() };
    let planned = plan(&by_ratio(), &bench).unwrap();
    assert!(planned.minutes <= 40.0 && planned.passes.len() >= 8, "{} passes", planned.passes.len());
    assert!(planned.passes.iter().any(|pass| pass.torque_n_m == 0.0), "no pass without load");
    let (mut squares, mut inside, mut count) = (0.0, 0.0, 0.0);
    for seed in 0..6 {
        let log = [played(&planned, seed, law)];
        let made = calibrate(&log, &by_ratio()).unwrap();
        let states =
            interval::spread(&Recorded::of(&log, &by_ratio()).scales, RATIO, [0.0, std::f64::consts::TAU], 2000);
        let states: Vec<State> = states.into_iter().filter(|at| at.torque_n_m.abs() > 1.0).collect();
        let table = Table::check(&made.table.image).unwrap();
        let by_table = Prior { table: Some(&table), ..by_ratio() };
        let mut left: Vec<f64> = states
            .iter()
            .map(|at| {
                let psi = at.output_rad * RATIO;
                law(psi, at.output_rad, at.torque_n_m, at.way)
                    - by_table.steady_arcsec(&State { generator_rad: psi, ..*at })
            })
            .collect();
        let mean = left.iter().sum::<f64>() / left.len() as f64;
        left.iter_mut().for_each(|left| *left -= mean);
        squares += left.iter().map(|e| e * e).sum::<f64>();
        count += left.len() as f64;
        inside += states.iter().zip(&left).filter(|(at, e)| e.abs() <= made.known.half_width_arcsec(at)).count() as f64;
    }
    let (expected, rms) = (planned.expected_rms_arcsec, (squares / count).sqrt());
    println!("expected {expected:.3}, found {rms:.3} arcsec rms, inside {:.3}", inside / count);
    // A plan knows the noise alone. The step of this unit's wind-up at no load is no polynomial, and leaves as much
    // again.
    assert!(rms < 3.0 * expected && rms > 0.5 * expected, "{rms} of {expected}");
    assert!(inside / count > 0.9, "{}", inside / count);
}

/// Few loads leave a wind-up open between them: the plan takes the ends first and says so, and the interval has it.
#[test]
fn few_loads_leave_their_doubt_in_the_interval() {
    let bench = Bench { minutes: 14.0, rate_hz: 5.0, torque_n_m: [-30.0, 30.0], ..Bench::default() };
    let planned = plan(&by_ratio(), &bench).unwrap();
    let mut first: Vec<f64> = planned.passes[..2].iter().map(|pass| pass.torque_n_m).collect();
    first.sort_by(f64::total_cmp);
    assert_eq!(first, [-30.0, 30.0]);
    assert!(planned.cannot.iter().any(|why| why.starts_with("wind_up")), "{:?}", planned.cannot);
    for (seed, bend) in [(1, 0.0), (2, 20.0), (3, -0.1), (4, 10.0)] {
        let law = |psi: f64, out: f64, torque: f64, _: f64| {
            let bent =
                if bend < 0.0 { bend * torque * torque.abs() / 3.0 } else { bend * torque / (torque.abs() + 3.0) };
            18.0 * (2.0 * psi).sin() + 40.0 * out.cos() + 8.0 * torque + bent
        };
        let made = calibrate(&[played(&planned, seed, law)], &by_ratio()).unwrap();
        let nodes = made.calibration.nodes.iter().filter(|node| node.part == "wind_up" && node.at != 0.0);
        let holds = |node: &&Node| {
            let off = law(0.0, 0.0, node.at, 1.0) - law(0.0, 0.0, 0.0, 1.0) - node.value_arcsec.unwrap();
            off.abs() < node.half_width_arcsec
        };
        let (inside, all) = (nodes.clone().filter(holds).count(), nodes.clone().count());
        assert!(inside == all, "bend {bend}: {inside} of {all}: {:?}", nodes.collect::<Vec<_>>());
    }
}

#[test]
fn a_ratio_that_the_rows_contradict_is_refused() {
    let law = |psi: f64, out: f64, torque: f64, _: f64| 20.0 * (2.0 * psi).sin() + 60.0 * out.cos() + 2.0 * torque;

    // The rows are made with a ratio of 101; a drive of 100 sees the output run away.
    let mut other = recording(0, law);
    let at_ratio = |log: &mut Recording, from: f64, to: f64| {
        let session = &mut log.sessions[0];
        session
            .error_rad
            .iter_mut()
            .zip(&session.generator_rad)
            .for_each(|(error, psi)| *error += psi / from - psi / to);
    };
    at_ratio(&mut other, RATIO, 100.0);
    let refused = calibrate(std::slice::from_ref(&other), &Prior::of_ratio(100.0, GeneratorKind::Cam)).err().unwrap();
    assert!(matches!(refused, CalibrationError::Measured(_)) && refused.to_string().contains("allowed: 101"));
    // A short log alone as well.
    let short = other.with_sessions(vec![other.sessions[0].part(0..200)]);
    let refused = calibrate(&[short], &Prior::of_ratio(100.0, GeneratorKind::Cam)).err().unwrap();
    assert!(matches!(refused, CalibrationError::Measured(_)), "{refused}");
    // One of two logs, which together turn by no ratio, is named.
    other.file = "other.csv".to_owned();
    at_ratio(&mut other, 100.0, RATIO);
    at_ratio(&mut other, 99.0, RATIO);
    let said = calibrate(&[recording(1, law), other], &by_ratio()).err();
    let said = said.unwrap().to_string();
    assert!(said.starts_with("other.csv: ratio: found 101,") && said.contains("allowed: 99,"), "{said}");
}

/// A table made of one log is laid against another log of the same unit whose generator reads otherwise.
#[test]
fn the_phase_of_a_table_is_found_from_a_log() {
    let law = |psi: f64, out: f64, torque: f64, _: f64| {
        25.0 * (2.0 * psi + 0.3).sin() + 12.0 * (psi - 1.0).cos() + 90.0 * (out - 0.7).cos() + 1.5 * torque
    };
    let made = calibrate(&[recording(1, law)], &by_ratio()).unwrap();
    let table = Table::check(&made.table.image).unwrap();
    let mut log = recording(7, law);
    let moved = 40.0_f64 * std::f64::consts::TAU + 1.1;
    log.sessions[0].generator_rad.iter_mut().for_each(|psi| *psi += moved);
    let again = calibrate(&[log.clone()], &Prior::of_table(&table, GeneratorKind::Cam)).unwrap();
    let found = again.calibration.alignment.clone().unwrap();
    let turn = found.repeats_deg;
    let off = (found.generator_zero_deg - moved.to_degrees() + 0.5 * turn).rem_euclid(turn) - 0.5 * turn;
    assert!(found.told && found.generator_half_width_deg < 2.0, "{found:?}");
    assert!(off.abs() <= found.generator_half_width_deg, "{found:?}: off by {off}");
    assert!(found.left_before_arcsec > 10.0 * found.left_after_arcsec, "{found:?}");
    assert!(again.calibration.core.rms_after_arcsec < 2.6, "{:?}", again.calibration.core);
    // Noise alone tells no phase.
    let flat = recording(3, |_, _, torque, _| 1.5 * torque);
    let only_load = calibrate(std::slice::from_ref(&flat), &by_ratio()).unwrap();
    let smooth = Table::check(&only_load.table.image).unwrap();
    let by_ratio = Recorded::of(std::slice::from_ref(&flat), &by_ratio());
    let rows = settled(&[flat], &Prior::of_table(&smooth, GeneratorKind::Cam), &by_ratio);
    let told = zero::align(&smooth, &rows, 0.6);
    assert!(!told.told, "{told:?}");
}

/// Through a fifth of the output's turn waves on the wheel that turns gain on those of the generator.
#[test]
fn a_part_of_the_turn_tells_the_wheel_that_turns_from_the_generator() {
    let law = |psi: f64, out: f64, _: f64, _: f64| 12.0 * (2.0 * psi).sin() + 25.0 * (2.0 * (psi - out) + 0.4).sin();
    let made = calibrate(&[up_to(recording(1, law), 1.26)], &by_ratio()).unwrap().calibration;
    assert!(kept(&made).contains(&"material_angle") && made.held_out.rms_after_arcsec < 3.5, "{:?}", made.parts);
}

/// Rows at loads that a table was not made of are told as that.
#[test]
fn rows_beyond_the_loads_of_a_table_are_told() {
    let law = |psi: f64, _: f64, torque: f64, _: f64| 12.0 * (2.0 * psi).sin() + 3.0 * torque + 0.002 * torque.powi(3);
    let [mut light, loaded] = [1, 2].map(|seed| recording(seed, law));
    let heavy: Vec<bool> = light.sessions[0].torque_n_m.iter().flatten().map(|torque| torque.abs() > 10.0).collect();
    light.sessions[0].leave_out(&heavy);
    let made = calibrate(&[light], &by_ratio()).unwrap();
    let rows: Vec<_> = measured_rows(&loaded.sessions, 20.0).collect();
    let summary = replay(&Table::check(&made.table.image).unwrap(), &rows, None).1;
    let beyond = rows.iter().filter(|row| row.torque_n_m.abs() > 10.0).count() as f64;
    let [said] = summary.remarks.as_slice() else { panic!("{:?}", summary.remarks) };
    assert!(said.contains("of 4000 rows are at loads that the table does not hold, -"), "{said}");
    let told: f64 = said.split("; ").nth(1).and_then(|said| said.split(' ').next()).unwrap().parse().unwrap();
    assert!((told / beyond - 1.0).abs() < 0.02, "{told} of {beyond}");
}

/// Torques by a table of a quarter of the output's turn: there most intervals hold them, in the rest none has an end
/// and no row counts as in range.
#[test]
fn torques_are_not_known_where_a_part_of_the_turn_was_not_recorded() {
    let law =
        |psi: f64, out: f64, torque: f64, _: f64| 10.0 * (2.0 * psi).sin() + 60.0 * (out - 0.7).cos() + 3.0 * torque;
    let [log, whole] = [1, 2].map(|seed| recording(seed, law));
    let made = calibrate(&[up_to(log, 1.6)], &by_ratio()).unwrap();
    let table = Table::check(&made.table.image).unwrap();
    let rows: Vec<_> = measured_rows(&whole.sessions, 20.0).collect();
    let torque_from_wind_up = made.calibration.torque_from_wind_up;
    let calibrated = CalibrationFile { torque_from_wind_up, ..CalibrationFile::default() };
    let (replayed, summary) = replay(&table, &rows, Some(calibrated));
    let ends = |row: &ReplayedRow| [row.torque_from_wind_up_low_n_m, row.torque_from_wind_up_high_n_m];
    let (there, elsewhere): (Vec<_>, Vec<_>) = replayed.iter().partition(|row| was_recorded(&table, row.generator_rad));
    let holds = |row: &&&ReplayedRow| ends(row)[0] <= row.torque_n_m && row.torque_n_m <= ends(row)[1];
    let share = there.iter().filter(holds).count() as f64 / there.len() as f64;
    let finite = there.iter().filter(|row| ends(row)[1].is_finite()).count();
    assert!(share > 0.9 && finite > there.len() / 2, "{share} of {}, {finite}", there.len());
    let open = |row: &&ReplayedRow| row.quality == "extrapolated" && ends(row) == [f64::NEG_INFINITY, f64::INFINITY];
    assert!(elsewhere.len() > 2000 && elsewhere.iter().all(open) && summary.status == "extrapolated");
}

/// An arm in one posture, whose load is a wave of the output, with the error that an output angle and a load make,
/// arcsec.
fn arm(error_arcsec: impl Fn(f64, f64) -> f64) -> Recording {
    let mut log = recording(1, |_, _, _, _| 0.0);
    let session = &mut log.sessions[0];
    for k in 0..session.len() {
        let out = session.generator_rad[k] / RATIO;
        let torque = 25.0 * (out + 0.2).sin();
        session.torque_n_m.as_mut().unwrap()[k] = torque;
        session.error_rad[k] += error_arcsec(out, torque) / ARCSEC_PER_RAD;
    }
    log
}

/// An arm in one posture: its load is a wave of the output. Whichever of the two is kept, the interval holds what the
/// other may be, and a note says so; over the states recorded the table is known.
#[test]
fn an_arm_in_one_posture_leaves_its_spring_in_the_interval() {
    for (wind_up, eccentric) in [(3.0, 0.0), (0.0, 60.0), (3.0, 60.0)] {
        let log =
            arm(|out, torque| 15.0 * (2.0 * RATIO * out).sin() + eccentric * (out - 0.7).cos() + wind_up * torque);
        let c = calibrate(&[up_to(log, 3.0)], &by_ratio()).unwrap().calibration;
        assert!(c.notes.iter().any(|note| note.contains("the load goes with the angle")), "{:?}", c.notes);
        let [all, recorded] = [c.half_width_arcsec, c.half_width_as_recorded_arcsec];
        assert!(all > 20.0 && recorded < 5.0, "{wind_up} {eccentric}: {all} {recorded} {:?}", kept(&c));
    }
}

/// What a weight does is no mark on the output: without it, or in another posture, the generator's zero stays.
#[test]
fn an_arm_in_another_posture_did_not_start_elsewhere() {
    let log = |load: f64, turned: f64| {
        let mut log = arm(|out, _| 15.0 * (2.0 * RATIO * out).sin() + 12.0 * load * (out + turned).sin());
        log.sessions[0].torque_n_m = None;
        up_to(log, 3.0)
    };
    let made = calibrate(&[log(25.0, 0.2)], &by_ratio()).unwrap();
    let table = Table::check(&made.table.image).unwrap();
    for (load, turned) in [(0.0, 0.0), (12.0, 1.9), (25.0, 1.9), (25.0, 2.5), (25.0, -0.6), (25.0, 3.3)] {
        let other = log(load, turned);
        let on_one = on_zero_of(&table, other.clone());
        assert_eq!(on_one.sessions[0].generator_rad, other.sessions[0].generator_rad, "{load}: {:?}", on_one.notes);
    }
}

/// A spring of the model that is 2.75 times too soft for an arm: the curve of the output takes it back, and there is a
/// table.
#[test]
fn a_model_that_is_far_too_soft_makes_a_table() {
    let log = arm(|out, torque| 60.0 * (out + 0.9).cos() + 3.0 * torque);
    let mut prior = by_ratio();
    prior.nominal.stiffness = vec![[0.0, 25_000.0]];
    let c = calibrate(&[log], &prior).map_err(|error| error.to_string()).unwrap().calibration;
    assert!(c.core.rms_after_arcsec < 3.0, "{:?}", c.core);
}

/// Of a spring that hardens and play: under loads of both signs, mostly of one, of one alone, and of play without any.
#[test]
fn what_a_table_knows_of_its_spring_and_play_does_not_ask_for_loads_of_both_signs() {
    let spring = |torque: f64| 170.0 * (torque / 20.0).asinh();
    for [low, high] in [[-30.0, 30.0], [-6.0, 30.0], [5.0, 30.0], [-30.0, -5.0], [0.0, 0.0]] {
        let mut log = recording(1, |_, _, _, _| 0.0);
        let session = &mut log.sessions[0];
        let (torque, rows) = (session.torque_n_m.as_mut().unwrap(), session.error_rad.len());
        for (k, (torque, error)) in torque.iter_mut().zip(&mut session.error_rad).enumerate() {
            *torque = low + (high - low) * (0.5 + *torque / 60.0);
            let way = if k < rows / 2 { 1.0 } else { -1.0 };
            let flank = if torque.abs() > 0.5 { torque.signum() } else { -way };
            *error += (spring(*torque) + 20.0 * flank) / ARCSEC_PER_RAD;
        }
        let mut recorded = log.clone();
        recorded.sessions[0].torque_n_m = recorded.sessions[0].torque_n_m.take().filter(|_| low < high);
        let made = calibrate(&[recorded], &by_ratio()).unwrap();
        let known = crate::nominal::Nominal::of_table_by_ratio(&Table::check(&made.table.image).unwrap(), RATIO);
        let winds_up = |from: f64, to: f64| known.wind_up_arcsec(to) - known.wind_up_arcsec(from);
        let ends = [[low.abs().min(high.abs()), low.abs().max(high.abs())], [10.0, 25.0]];
        for [from, to] in ends.into_iter().filter(|[from, to]| low < high && low * high != 0.0 && from < to) {
            let [found, due] = [winds_up(from, to), spring(to) - spring(from)];
            assert!((found / due - 1.0).abs() < 0.06, "{low} to {high}: {found} from {from} to {to}, {due} is due");
        }
        if low == high {
            assert!((known.backlash_arcsec - 40.0).abs() < 2.0, "{}", known.backlash_arcsec);
        }
    }
}

#[test]
fn friction_of_the_motors_side_in_the_torque_is_told_from_play() {
    // The last is a load that goes on at one rate where the motion turns.
    for (friction_n_m, ramp_n_m) in [(0.0, 0.0), (4.0, 0.0), (0.0, 60.0)] {
        let mut log = recording(1, |_, _, _, _| 0.0);
        let session = &mut log.sessions[0];
        let rows = session.len();
        session.generator_rad = (0..rows).map(|k| 60.0 * (k as f64 / 130.0).sin()).collect();
        let torque = session.torque_n_m.as_mut().unwrap();
        for (k, (torque, error)) in torque.iter_mut().zip(&mut session.error_rad).enumerate() {
            let way = (k as f64 / 130.0).cos().signum();
            let play = if friction_n_m > 0.0 { 0.0 } else { -32.0 * way };
            *torque += ramp_n_m * (k as f64 / 130.0).cos();
            *error += (8.0 * *torque + play) / ARCSEC_PER_RAD;
            *torque += friction_n_m * way;
        }
        let made = calibrate(&[log], &by_ratio()).unwrap().calibration;
        assert!(kept(&made).contains(&"play"), "{:#?}", made.parts);
        let told: Vec<&String> =
            made.notes.iter().filter(|note| note.contains("friction of the motor's side")).collect();
        assert_eq!(told.len(), usize::from(friction_n_m > 0.0), "{:?}", made.notes);
        assert!(told.iter().all(|note| note.contains("by 8.") || note.contains("by 7.9")), "{told:?}");
    }
}
