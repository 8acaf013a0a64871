//! The picture of a residual: signals that are known come back with amplitude and phase, and noise shows nothing.

use std::f64::consts::TAU;

use crate::bench_data::{ARCSEC, Bench, RATIO, normal};
use flexspline_identify::diagnosis::rows::Rows;
use flexspline_identify::measurement::Session;
use flexspline_identify::nominal::Nominal;
use flexspline_identify::residual::{Axis, OrderSpectrum, Picture, SizeMismatch, harmonics, order_spectrum};
use flexspline_identify::synthesize::catalogue_drive;
use flexspline_tests::seeds;

const CIRCULAR_SPLINE: f64 = 94.0 / 95.0;

/// Processor time of this thread so far, s; zero where the system is no Unix.
fn thread_s() -> f64 {
    #[cfg(unix)]
    {
        use rustix::time::{ClockId, clock_gettime};

        let now = clock_gettime(ClockId::ThreadCPUTime);
        now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
    }
    #[cfg(not(unix))]
    0.0
}

/// A session of one direction over some turns, not evenly spaced.
fn angles(rows: usize, turns: f64, random: &mut fastrand::Rng) -> Vec<f64> {
    (0..rows).map(|k| (k as f64 + 0.8 * (random.f64() - 0.5)) / rows as f64 * turns * TAU).collect()
}

fn spectrum(angle: &[f64], value: &[f64]) -> OrderSpectrum {
    order_spectrum(Axis::Generator, angle, value, RATIO)
}

#[test]
fn amplitude_phase_and_order_come_back_within_their_uncertainty() {
    let (mut amplitude, mut phase, mut order, mut count) = (0.0, 0.0, 0.0, 0.0);
    for seed in 0..60 {
        let mut random = fastrand::Rng::with_seed(seed);
        let angle = angles(4000, 23.0, &mut random);
        let due = [(2.0, 6.0, 0.4), (4.0, 1.5, -2.0), (1.0, 0.7, 2.9), (7.3, 2.5, 1.0)];
        let value: Vec<f64> = angle
            .iter()
            .map(|x| due.iter().map(|(o, a, p)| a * (o * x + p).sin()).sum::<f64>() + 2.0 * normal(&mut random))
            .collect();
        let found = spectrum(&angle, &value);
        assert_eq!(found.peaks.len(), 4, "seed {seed}: {:?}", found.peaks);
        for (o, a, p) in due {
            let peak = found.peaks.iter().min_by(|x, y| (x.order - o).abs().total_cmp(&(y.order - o).abs())).unwrap();
            assert!((peak.order - o).abs() < found.resolution, "seed {seed}: {peak:?}");
            amplitude += ((peak.amplitude_arcsec - a) / peak.amplitude_std_arcsec).powi(2);
            order += ((peak.order - o) / peak.order_std).powi(2);
            // The phase at the middle of the record, where it does not depend on the order.
            let middle = 23.0 * TAU / 2.0;
            let off = (peak.order * middle + peak.phase_rad - o * middle - p).rem_euclid(TAU);
            phase += (off.min(TAU - off) / peak.phase_std_rad).powi(2);
            count += 1.0;
        }
    }
    let [amplitude, phase, order] = [amplitude, phase, order].map(|sum: f64| (sum / count).sqrt());
    println!("errors over their standard deviations: amplitude {amplitude:.2}, phase {phase:.2}, order {order:.2}");
    for ratio in [amplitude, phase, order] {
        assert!((0.75..1.3).contains(&ratio), "amplitude {amplitude}, phase {phase}, order {order}");
    }
}

#[test]
fn flexspline_and_circular_spline_are_told_apart_beyond_half_an_output_turn() {
    let lines = |turns: f64, seed: u64| {
        let mut random = fastrand::Rng::with_seed(seed);
        let angle = angles(8000, turns, &mut random);
        let value: Vec<f64> = angle
            .iter()
            .map(|x| 10.0 * (2.0 * x + 0.3).sin() + 6.0 * (2.0 * CIRCULAR_SPLINE * x + 1.2).sin() + normal(&mut random))
            .collect();
        spectrum(&angle, &value)
    };
    for seed in 0..10 {
        for turns in [70.0, 95.0, 190.0] {
            let found = lines(turns, seed);
            for (order, amplitude, axis) in
                [(2.0, 10.0, Axis::Generator), (2.0 * CIRCULAR_SPLINE, 6.0, Axis::GeneratorLessOutput)]
            {
                let peak = found.peaks.iter().find(|peak| (peak.order - order).abs() < 0.3 / turns);
                let peak =
                    peak.unwrap_or_else(|| panic!("{turns} turns, seed {seed}, order {order}: {:#?}", found.peaks));
                assert!(
                    (peak.amplitude_arcsec - amplitude).abs() < 5.0 * peak.amplitude_std_arcsec,
                    "{turns}: {peak:?}"
                );
                assert!(peak.named.len() == 1 && peak.named[0].axis == axis && peak.named[0].harmonic == 2, "{peak:?}");
            }
        }
        for turns in [10.0, 30.0, 44.0] {
            let found = lines(turns, seed);
            let strongest = &found.peaks[0];
            assert!((strongest.order - 2.0).abs() < 1.0 / turns, "{turns}: {strongest:?}");
            assert!(strongest.named.len() > 1, "{turns}: {strongest:?}");
        }
    }
}

#[test]
fn noise_shows_no_line_white_or_wandering() {
    let seeds = seeds(200, 600);
    let mut alarms = Vec::new();
    for seed in 0..seeds {
        let mut random = fastrand::Rng::with_seed(seed);
        // At most 200 of the 3000 rows: noise with a memory of a third of its record is not distinguishable from a slow
        // wave.
        let memory = [0.0_f64, 0.9, 0.97, 0.99][seed as usize % 4];
        let turns = [2.5, 12.0, 60.0, 150.0][(seed / 4) as usize % 4];
        let back = seed % 3 == 0;
        let mut angle = angles(3000, turns, &mut random);
        if back {
            angle.iter_mut().for_each(|x| *x = (*x - turns * TAU * 0.4).abs());
        }
        let mut wander = 0.0;
        let value: Vec<f64> = angle
            .iter()
            .map(|_| {
                wander = memory * wander + (1.0 - memory * memory).sqrt() * normal(&mut random);
                2.0 * wander + normal(&mut random)
            })
            .collect();
        let found = spectrum(&angle, &value);
        if !found.peaks.is_empty() {
            alarms.push(format!("seed {seed}, memory {memory}, {turns} turns, {back}: {:?}", found.peaks));
        }
    }
    println!("{} of {seeds} noises show a line", alarms.len());
    assert!(alarms.len() as f64 <= 0.01 * seeds as f64, "{} of {seeds}\n{}", alarms.len(), alarms.join("\n"));
}

/// The picture of a residual, rad, one value for each row of the sessions.
fn picture(sessions: &[Session], residual_rad: &[f64]) -> Result<Picture, SizeMismatch> {
    let nominal = Nominal { ratio: RATIO, teeth: None, ..catalogue_drive() };
    let residual_arcsec: Vec<f64> = residual_rad.iter().map(|value| value / ARCSEC).collect();
    Picture::of(&Rows::new(sessions, &nominal), &residual_arcsec, RATIO)
}

fn session(angle: Vec<f64>) -> Session {
    let rows = angle.len();
    Session {
        line: (2..rows as u64 + 2).collect(),
        time_s: Some((0..rows).map(|k| k as f64 * 0.01).collect()),
        error_rad: vec![0.0; rows],
        generator_rad: angle,
        ..Session::default()
    }
}

#[test]
fn the_whole_picture_of_a_long_recording_takes_about_a_second() {
    let bench = Bench::plain(40_000, 1.0, 1);
    let sessions: Vec<Session> = (0..4)
        .map(|k| {
            let rows = k * 10_000..(k + 1) * 10_000;
            let error: Vec<f64> = rows.clone().map(|r| bench.output_rad[r] - bench.generator_rad[r] / RATIO).collect();
            Session {
                line: rows.clone().map(|r| r as u64 + 2).collect(),
                time_s: Some(bench.time_s[rows.clone()].to_vec()),
                generator_rad: bench.generator_rad[rows.clone()].to_vec(),
                error_rad: error,
                torque_n_m: Some(bench.torque_n_m.as_ref().unwrap()[rows.clone()].to_vec()),
                temperature_c: Some(bench.temperature_c.as_ref().unwrap()[rows].to_vec()),
                ..Session::default()
            }
        })
        .collect();
    let residual: Vec<f64> = sessions.iter().flat_map(|session| session.error_rad.clone()).collect();
    // Of the processor, all of it on one thread: other programs and other claims do not count.
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let (picture, seconds) = alone.install(|| {
        let begun = thread_s();
        let picture = picture(&sessions, &residual).unwrap();
        (picture, thread_s() - begun)
    });
    println!("40 000 rows: {seconds:.2} s of processor");
    assert!(seconds < if cfg!(debug_assertions) { 8.0 } else { 4.0 }, "{seconds} s");
    let json = serde_json::to_value(&picture).unwrap();
    assert!(json["spectra"][0]["peaks"][0]["amplitude_arcsec"].is_number());
    assert!(!json.to_string().contains("null,null"));
}

#[test]
fn little_data_gives_an_empty_picture_and_no_nonsense() {
    for rows in [0, 1, 2, 17] {
        let sessions = [session((0..rows).map(|k| k as f64 * 0.1).collect())];
        let picture = picture(&sessions, &vec![1e-5; rows]).unwrap();
        assert_eq!(picture.rows, rows);
        assert!(picture.spectra.iter().all(|spectrum| spectrum.peaks.is_empty()));
    }
    let still = [session(vec![1.0; 100])];
    assert!(picture(&still, &[0.0; 100]).is_ok());
    let error = picture(&still, &[0.0; 99]).unwrap_err();
    assert_eq!(error.to_string(), "99 values of the residual for 100 rows");
    assert_eq!(harmonics(&[], &[], &[2.0]), None);
}
