//! Drives as built, by contact FEM, logged for a planned hour with sensors as benches have them, and calibrated: what the table takes off in other
//! motions, under other loads, on other days, beside what simpler tables take.
//!
//! ```text
//!   drawn drive --FEM--> error in each state of the plan + sensors --> log --> calibrate --> table, intervals
//!                 \---------------------> error in other states, without sensors <---- judged against it
//! ```
//!
//! HHD-95 with the cam, coarse mesh. A unit is the ideal drive's table and the influence kernels of the contact FEM, evaluated in each state: pitch
//! errors of both wheels, an oval ring, displaced axes (not linear, and the stronger the lighter the load), a damaged tooth, wear, a softer
//! spring. Kernels are held against the FEM of finite deviations in `fem_causes`. The unit's own error is what the flight encoder on the motor,
//! eccentric as it is, sees of it.

use std::f64::consts::TAU;

use flexspline::{Direction, GeneratorAngle, Table};
use flexspline_sim::calibrate::{Bench, Planned, Prior, State, calibrate, plan};
use flexspline_sim::drive::{DamagedFlank, GeneratorKind, Wheel};
use flexspline_sim::kernels::Kernels;
use flexspline_sim::measurement::{ColumnMap, Gear, Recording, parse};
use flexspline_sim::units::ARCSEC_PER_RAD;
use flexspline_tests::command::Desk;
use rayon::prelude::*;

const RATIO: f64 = 95.0;
/// Load of the plan and of the judging, N·m.
const LOAD: f64 = 50.0;
/// Friction of bearings and seals at the output, N·m: it turns the flank where there is no load.
const FRICTION: f64 = 0.4;
/// The bench: noise of the output's encoder, its wander and eccentricity; the jitter of polling, s; eccentricity of the motor's encoder.
const NOISE_ARCSEC: f64 = 1.0;
const WANDER_ARCSEC: f64 = 0.5;
const WANDER_S: f64 = 20.0;
const ECCENTRIC_ARCSEC: f64 = 0.5;
const JITTER_S: f64 = 5e-5;
const MOTOR_ECCENTRIC_RAD: f64 = 8e-4;
/// Base radius of the circular spline's teeth, mm.
const BASE_RADIUS_MM: f64 = 44.6354;
/// Rows in a second.
const RATE_HZ: f64 = 20.0;
/// States that a table is judged in, for each of three days.
const JUDGED: usize = 1500;

fn gauss(random: &mut fastrand::Rng) -> f64 {
    let (u, v) = (random.f64().max(1e-12), random.f64());
    (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
}

/// A wave of a wheel's teeth, µm and rad on its body.
struct Wave {
    wheel: Wheel,
    order: u32,
    amplitude_um: f64,
    phase_rad: f64,
}

/// A unit: what its drive has beside the drawing, and the encoder on its motor.
struct Unit<'a> {
    ideal: &'a Table<'a>,
    kernels: &'a Kernels,
    pitch: Vec<Wave>,
    oval: Wave,
    /// Displacement of either toothing, µm, on its body.
    circular_spline_um: [f64; 2],
    flexspline_um: [f64; 2],
    /// Worn off every flank, µm.
    wear_um: f64,
    damaged: (Wheel, f64, f64),
    /// More wind-up than the drawing, relative.
    softer: f64,
    motor_phase: f64,
}

impl<'a> Unit<'a> {
    /// Draws a unit with errors of all kinds, of sizes that gears of a good maker have.
    fn draw(random: &mut fastrand::Rng, ideal: &'a Table<'a>, kernels: &'a Kernels) -> Unit<'a> {
        let mut size = |low: f64, high: f64| low + (high - low) * random.f64();
        let mut wave = |wheel: Wheel, order: u32, most: f64| Wave {
            wheel,
            order,
            amplitude_um: size(0.2 * most, most),
            phase_rad: size(0.0, TAU),
        };
        let wheels = [Wheel::Flexspline, Wheel::CircularSpline];
        let pitch = wheels
            .into_iter()
            .flat_map(|wheel| [(2, 3.0), (4, 1.0), (1, 3.0), (6, 0.5)].map(|(k, most)| (wheel, k, most)));
        let pitch = pitch.map(|(wheel, k, most)| wave(wheel, k, most)).collect();
        let oval = wave(Wheel::CircularSpline, 2, 3.0);
        let mut vector = |most: f64| {
            let (size, angle) = (size(0.0, most), size(0.0, TAU));
            [size * angle.cos(), size * angle.sin()]
        };
        let (circular_spline_um, flexspline_um) = (vector(5.0), vector(3.0));
        Unit {
            ideal,
            kernels,
            pitch,
            oval,
            circular_spline_um,
            flexspline_um,
            wear_um: size(0.0, 3.0),
            damaged: (Wheel::CircularSpline, size(0.0, TAU), size(0.0, 5.0)),
            softer: size(-0.1, 0.1),
            motor_phase: size(0.0, TAU),
        }
    }

    /// Error (arcsec) that the encoder on the motor sees of the output, in steady motion.
    fn error(&self, at: &State) -> f64 {
        // The encoder reads generator_rad; the generator stands elsewhere.
        let off = MOTOR_ECCENTRIC_RAD * (at.generator_rad + self.motor_phase).sin();
        let psi = at.generator_rad + off;
        let output = psi / RATIO;
        let torque = at.torque_n_m - FRICTION * at.way;
        let flank = torque.signum();
        let stands = |load: f64| by_table(self.ideal, &State { generator_rad: psi, torque_n_m: load, ..*at });
        let mut error = stands(torque) + off / RATIO * ARCSEC_PER_RAD;
        error += self.softer * (stands(torque) - stands(flank * FRICTION));
        let of = |gain: [f64; 2], wave: &Wave| {
            let seen = if wave.wheel == Wheel::Flexspline { psi } else { psi - output };
            let phase = f64::from(wave.order) * (seen - wave.phase_rad);
            wave.amplitude_um * (gain[0] * phase.cos() - gain[1] * phase.sin())
        };
        for wave in &self.pitch {
            error += of(self.kernels.pitch_error(wave.wheel, wave.order, torque), wave);
        }
        error += of(self.kernels.ovality(torque), &self.oval);
        let (sine, cosine) = output.sin_cos();
        let [x, y] = self.circular_spline_um;
        let axis = [cosine * x - sine * y - self.flexspline_um[0], sine * x + cosine * y - self.flexspline_um[1]];
        error += self.kernels.eccentricity(axis[0].hypot(axis[1]), axis[1].atan2(axis[0]) - psi, torque);
        // Both flanks give way along the pitch: a wider play, the same for any load.
        error += flank * self.wear_um * 1e-3 / BASE_RADIUS_MM * ARCSEC_PER_RAD;
        let (wheel, tooth, depth) = self.damaged;
        error + depth * self.kernels.missing(wheel, DamagedFlank::Both, tooth + output - psi, torque)
    }

    fn errors(&self, states: &[State]) -> Vec<f64> {
        states.par_iter().map(|at| self.error(at)).collect()
    }
}

/// The rows of a planned log, once in `period_s`.
fn played(planned: &Planned, period_s: f64, random: &mut fastrand::Rng) -> Vec<Vec<(f64, State)>> {
    let logs = planned.passes.iter().map(|pass| pass.log).max().unwrap();
    let mut rows = vec![Vec::new(); logs];
    for pass in &planned.passes {
        let there = 0.5 * pass.duration_s - 1.0;
        let count = (2.0 * there / period_s) as usize;
        for k in 0..count {
            let t = (k as f64 + 0.3 + 0.4 * random.f64()) * period_s;
            let (share, way) = if t < there { (t / there, 1.0) } else { (2.0 - t / there, -1.0) };
            let turns = pass.from_generator_turn + (pass.to_generator_turn - pass.from_generator_turn) * share;
            let generator_rad = TAU * turns;
            rows[pass.log - 1].push((
                pass.begin_s + t,
                State {
                    generator_rad,
                    output_rad: generator_rad / RATIO,
                    torque_n_m: pass.torque_n_m,
                    temperature_c: pass.temperature_c,
                    way,
                },
            ));
        }
    }
    rows
}

/// A log as the bench writes it.
fn log(
    unit: &Unit<'_>,
    rows: &[(f64, State)],
    number: usize,
    speed_rad_s: f64,
    random: &mut fastrand::Rng,
) -> Recording {
    let states: Vec<State> = rows.iter().map(|(_, at)| *at).collect();
    let errors = unit.errors(&states);
    let (mut wander, mut last) = (0.0, 0.0);
    let mut text = "t;motor;joint;load;T\n".to_owned();
    let phase = TAU * 0.3;
    let counts = 65536.0;
    for ((t, at), error) in rows.iter().zip(errors) {
        let keep = (-(t - last) / WANDER_S).exp();
        wander = wander * keep + WANDER_ARCSEC * (1.0 - keep * keep).sqrt() * gauss(random);
        last = *t;
        let sensors = NOISE_ARCSEC * gauss(random)
            + wander
            + 1.0 * t / 3600.0
            + ECCENTRIC_ARCSEC * (at.output_rad + phase).sin()
            + at.way * speed_rad_s / RATIO * JITTER_S * gauss(random) * ARCSEC_PER_RAD;
        let joint = (at.output_rad + (error + sensors) / ARCSEC_PER_RAD).to_degrees();
        let motor = (at.generator_rad / TAU * counts).round();
        text +=
            &format!("{t:.3};{motor};{joint:.7};{:.2};{:.1}\n", at.torque_n_m + 0.02 * gauss(random), at.temperature_c);
    }
    let map = ColumnMap::parse("time=t:s,generator=motor:count/65536,output=joint:deg,torque=load:N.m,temperature=T:C")
        .unwrap();
    let gear = Gear::of_teeth(188, 190, true);
    parse(&format!("log{number}.csv"), text.as_bytes(), &map, &gear).unwrap()
}

/// Waves of generator and output by least squares, of one direction or both: what periodic-error tools fit.
struct Fourier {
    coefficients: Vec<Vec<f64>>,
    by_direction: bool,
}

impl Fourier {
    fn columns(at: &State) -> Vec<f64> {
        let mut x = vec![1.0];
        x.extend((1..=8).flat_map(|k| <[f64; 2]>::from((f64::from(k) * at.generator_rad).sin_cos())));
        x.extend((1..=6).flat_map(|k| <[f64; 2]>::from((f64::from(k) * at.output_rad).sin_cos())));
        x
    }

    fn fit(rows: &[(State, f64)], by_direction: bool) -> Fourier {
        let of = |way: Option<f64>| {
            let size = 29;
            let mut gram = vec![vec![0.0; size + 1]; size];
            for (at, error) in rows.iter().filter(|(at, _)| way.is_none_or(|way| at.way == way)) {
                let x = Fourier::columns(at);
                for i in 0..size {
                    for j in 0..size {
                        gram[i][j] += x[i] * x[j];
                    }
                    gram[i][size] += x[i] * error;
                }
            }
            // Gauss, without pivots: the matrix is positive definite.
            for i in 0..size {
                let pivot = gram[i].clone();
                for (k, row) in gram.iter_mut().enumerate().filter(|(k, _)| *k != i) {
                    let factor = row[i] / pivot[i];
                    let _ = k;
                    row.iter_mut().zip(&pivot).for_each(|(a, b)| *a -= factor * b);
                }
            }
            (0..size).map(|i| gram[i][size] / gram[i][i]).collect::<Vec<f64>>()
        };
        let coefficients = if by_direction { vec![of(Some(1.0)), of(Some(-1.0))] } else { vec![of(None)] };
        Fourier { coefficients, by_direction }
    }

    fn at(&self, at: &State) -> f64 {
        let which = usize::from(self.by_direction && at.way < 0.0);
        Fourier::columns(at).iter().zip(&self.coefficients[which]).map(|(x, c)| x * c).sum()
    }
}

fn by_table(table: &Table<'_>, at: &State) -> f64 {
    let direction = if at.way < 0.0 { Direction::Backward } else { Direction::Forward };
    let generator = GeneratorAngle::from_rad(at.generator_rad).unwrap();
    let error = table.steady_error_rad(generator, at.torque_n_m as f32, at.temperature_c as f32, direction);
    f64::from(error.unwrap()) * ARCSEC_PER_RAD
}

/// What is left of the error of a unit, arcsec rms.
#[derive(Debug, Default, Clone, Copy)]
struct Left {
    without: f64,
    nominal: f64,
    by_angle: f64,
    by_angle_and_direction: f64,
    calibrated: f64,
    from_ratio: f64,
    /// Share of the states inside the interval.
    covered: f64,
    /// What the plan expected of its parts, rms.
    expected: f64,
}

/// One drive, from drawing it to judging its table.
fn judged(seed: u64, nominal: &Table<'_>, kernels: &Kernels) -> Left {
    let mut random = fastrand::Rng::with_seed(seed);
    let bench = Bench {
        minutes: 60.0,
        rate_hz: RATE_HZ,
        speed_rpm: 90.0,
        torque_n_m: [-LOAD, LOAD],
        temperature_c: [10.0, 30.0],
        noise_arcsec: NOISE_ARCSEC,
        wander_arcsec: WANDER_ARCSEC,
        ..Bench::default()
    };
    let prior = Prior::of_table(nominal, GeneratorKind::Cam);
    let planned = plan(&prior, &bench, None).unwrap();
    let unit = Unit::draw(&mut random, nominal, kernels);
    let speed = bench.speed_rpm / 60.0 * TAU;
    let rows = played(&planned, 1.0 / RATE_HZ, &mut random);
    let logs: Vec<Recording> =
        rows.iter().enumerate().map(|(k, rows)| log(&unit, rows, k + 1, speed, &mut random)).collect();
    let made = calibrate(&logs, &prior).unwrap();
    let from_ratio = calibrate(&logs, &Prior::of_ratio(RATIO, GeneratorKind::Cam)).unwrap();
    let (image, other_image) = (&made.table.image, &from_ratio.table.image);
    let (table, other) = (Table::check(image).unwrap(), Table::check(other_image).unwrap());
    for part in &made.calibration.parts {
        println!("   {:<16} {} {:?} {}", part.name, part.kept, part.size_arcsec, part.why);
    }
    println!(
        "   {:?} +-{:.2} {:?}",
        made.calibration.noise, made.calibration.half_width_arcsec, made.calibration.held_out
    );

    // Rows of the log as a plain tool sees them.
    let seen: Vec<(State, f64)> = logs
        .iter()
        .zip(&rows)
        .flat_map(|(log, rows)| log.sessions.iter().flat_map(|s| s.error_rad.iter()).zip(rows))
        .map(|(error, (_, at))| (*at, error * ARCSEC_PER_RAD))
        .collect();
    let plain = Fourier::fit(&seen, false);
    let directed = Fourier::fit(&seen, true);

    // Three other days: other motions, loads between those recorded, a temperature that was not recorded, zeros of their own.
    let (mut squares, mut inside) = ([0.0; 6], 0.0);
    for temperature_c in [10.0, 20.0, 25.0] {
        let states: Vec<State> = (0..JUDGED)
            .map(|_| {
                let generator_rad = TAU * RATIO * random.f64();
                let torque = LOAD * (2.0 * random.f64() - 1.0);
                // Inside the friction the flank is that of the reversal before, which a steady state does not say.
                let torque_n_m = if torque.abs() < 2.0 * FRICTION { 2.0 * FRICTION * torque.signum() } else { torque };
                let way = if random.bool() { 1.0 } else { -1.0 };
                State { generator_rad, output_rad: generator_rad / RATIO, torque_n_m, temperature_c, way }
            })
            .collect();
        let truth = unit.errors(&states);
        let tables: [&dyn Fn(&State) -> f64; 6] = [
            &|_| 0.0,
            &|at| by_table(nominal, at),
            &|at| plain.at(at),
            &|at| directed.at(at),
            &|at| by_table(&table, at),
            &|at| by_table(&other, at),
        ];
        for (k, says) in tables.iter().enumerate() {
            let mut left: Vec<f64> = states.iter().zip(&truth).map(|(at, truth)| truth - says(at)).collect();
            let mean = left.iter().sum::<f64>() / left.len() as f64;
            left.iter_mut().for_each(|left| *left -= mean);
            squares[k] += left.iter().map(|left| left * left).sum::<f64>();
            if k == 4 {
                let within = |(at, left): (&State, &f64)| f64::from(left.abs() <= made.known.half_width_arcsec(at));
                inside += states.iter().zip(&left).map(within).sum::<f64>();
            }
        }
    }
    let count = 3.0 * JUDGED as f64;
    let [without, nominal, by_angle, by_angle_and_direction, calibrated, from_ratio] =
        squares.map(|squares| (squares / count).sqrt());
    Left {
        without,
        nominal,
        by_angle,
        by_angle_and_direction,
        calibrated,
        from_ratio,
        covered: inside / count,
        expected: planned.expected_rms_arcsec,
    }
}

fn ideal_table() -> Vec<u8> {
    let desk = Desk::new();
    desk.line("tables --generator cam --mesh coarse --temperatures-c=5,35 --no-report --out t").done();
    std::fs::read(desk.path("t/cam.fxt")).unwrap()
}

fn run(seeds: std::ops::Range<u64>) -> Vec<Left> {
    let image = ideal_table();
    let nominal = Table::check(&image).unwrap();
    let cached = std::env::var("FS_K").ok().map(|f| Kernels::from_json(&std::fs::read_to_string(f).unwrap()).unwrap());
    let kernels = match &cached {
        Some(k) => k,
        None => &crate::fem_causes::known().1,
    };
    let all: Vec<Left> = seeds
        .map(|seed| {
            let left = judged(seed, &nominal, kernels);
            println!("drive {seed}: {left:.2?}");
            left
        })
        .collect();
    let rms = |of: fn(&Left) -> f64| (all.iter().map(|l| of(l).powi(2)).sum::<f64>() / all.len() as f64).sqrt();
    let without = rms(|l| l.without);
    for (name, left) in [
        ("no table", without),
        ("nominal table", rms(|l| l.nominal)),
        ("waves by angle", rms(|l| l.by_angle)),
        ("waves by angle and direction", rms(|l| l.by_angle_and_direction)),
        ("calibrated, from the ratio", rms(|l| l.from_ratio)),
        ("calibrated, from the nominal table", rms(|l| l.calibrated)),
    ] {
        println!("{name:<36} {left:>7.2} arcsec rms, {:>5.1} % removed", 100.0 * (1.0 - left / without));
    }
    println!("expected by the plan of what the parts hold: {:.2} arcsec rms", rms(|l| l.expected));
    println!("inside the intervals: {:.3}", all.iter().map(|l| l.covered).sum::<f64>() / all.len() as f64);
    all
}

#[test]
fn two_units_are_calibrated_better_than_by_simpler_tables() {
    let start = std::time::Instant::now();
    let all = run(1..3);
    println!("{:.0} s", start.elapsed().as_secs_f64());
    for left in &all {
        assert!(left.calibrated < left.by_angle_and_direction && left.calibrated < left.nominal, "{left:?}");
    }
}

#[test]
#[ignore = "minutes"]
fn ten_units_are_calibrated_better_than_by_simpler_tables() {
    let all = run(1..11);
    for left in &all {
        assert!(left.calibrated < left.by_angle_and_direction && left.calibrated < left.nominal, "{left:?}");
    }
}
