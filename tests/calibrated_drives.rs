//! An hour on the bench, planned by `calibrate --plan`, makes a table that removes the error of an as-built drive in
//! other motions, under other loads, on other days; its intervals hold.
//!
//! ```text
//!   errors of all kinds --contact FEM kernels--> as-built drive --sensors--> planned hour --> calibrate --> table
//!   dense FEM map, its law of play ---------------------^      |                                                    |
//!                                                              +--> other days: true output less what the core says +
//! ```
//!
//! HHD-95 with the cam. The plant is the map of contact FEM that `fly` flies, at points that made no
//! table, with its own law of play over the flank torque, and on top the influence kernels, which know load, flank and
//! place: pitch errors of both wheels, an oval, three axes beside one another (one vector, as the contact sees it),
//! damaged teeth, a malformed cam, wear, another stiffness. Nothing of it has the form of a table or of a part. Each
//! drive is drawn anew within twice the tolerances of the built-in typical drive. Wrong if this fails: a part that fits
//! what is not there, an interval that is too narrow, a plan that leaves a hole, a table that does not hold what was
//! fitted.

use std::f64::consts::{PI, TAU};

use flexspline::{Direction, GeneratorAngle, PlayState, Table};
use flexspline_base::statistics::std_dev;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::kernels::Kernels;
use flexspline_fly::plant_map::{GearMap, WindUp};
use flexspline_identify::calibrate::{Bench, Calibrated, Planned, Prior, State, calibrate, plan};
use flexspline_identify::measurement::{ColumnMap, Recording, parse};
use flexspline_mechanics::drive::{DamagedFlank, GeneratorKind, Wheel};

use crate::fem_causes::known;
use crate::plant_maps::image;

const RATIO: f64 = 95.0;
const DRAG_N_M: f64 = 0.02;
/// Bench: loads, temperatures, rows in a second.
const LOADS_N_M: [f64; 2] = [-60.0, 60.0];
const TEMPERATURES_C: [f64; 2] = [12.0, 28.0];
const RATE_HZ: f64 = 5.0;

fn gauss(random: &mut fastrand::Rng) -> f64 {
    (-2.0 * random.f64().max(1e-12).ln()).sqrt() * (TAU * random.f64()).cos()
}

/// A wave of a deviation: order, amplitude (µm), phase on its body.
type Wave = (u32, f64, f64);

/// Errors of one drive.
struct Errors {
    /// Pitch of flexspline and circular spline.
    pitch: [Vec<Wave>; 2],
    oval: (f64, f64),
    /// Circular spline beside its axis; flexspline beside its bore; housing.
    eccentric: [(f64, f64); 3],
    /// Tooth and depth, µm, on either wheel.
    damaged: [(u32, f64); 2],
    /// Waves of the cam.
    cam: Vec<Wave>,
    /// Half the play that wear adds, arcsec, and load over that which winds the nominal drive up alike.
    wear_arcsec: f64,
    compliance: f64,
}

impl Errors {
    fn draw(random: &mut fastrand::Rng) -> Errors {
        let angle = |random: &mut fastrand::Rng| TAU * random.f64();
        let mut wave = |order: u32, most: f64| (order, most * (0.3 + 0.7 * random.f64()), angle(random));
        // ISO 1328-1: cumulative errors fall with their order.
        let pitch = [8.0, 9.0].map(|most| (1..=8).map(|k| wave(2 * k, most / f64::from(k).powf(1.5))).collect());
        let cam = vec![wave(3, 3.0), wave(4, 2.0), wave(5, 1.0)];
        let mut size = |most: f64| (most * (0.3 + 0.7 * random.f64()), TAU * random.f64());
        let (oval, eccentric) = (size(6.0), [size(3.0), size(3.0), size(3.0)]);
        Errors {
            pitch,
            oval,
            eccentric,
            damaged: [(random.u32(0..188), 6.0 * random.f64()), (random.u32(0..190), 6.0 * random.f64())],
            cam,
            // 2 w / (r cos a) for each micrometre: tests/as_built.rs.
            wear_arcsec: 4.62 * 2.0 * random.f64(),
            compliance: 1.0 + 0.04 * gauss(random).clamp(-2.0, 2.0),
        }
    }
}

/// Gains of a response by the root of the load, for either sign.
struct ByLoad(Vec<[[f64; 2]; 2]>);

const LOAD_NODES: usize = 48;
const MOST_LOAD_N_M: f64 = 80.0;

impl ByLoad {
    fn of(gain: impl Fn(f64) -> [f64; 2]) -> ByLoad {
        let load = |k: usize| MOST_LOAD_N_M * (k as f64 / (LOAD_NODES - 1) as f64).powi(2);
        ByLoad((0..LOAD_NODES).map(|k| [1.0, -1.0].map(|sign| gain(sign * load(k).max(1e-6)))).collect())
    }

    fn at(&self, load: f64) -> [f64; 2] {
        let place = (load.abs() / MOST_LOAD_N_M).sqrt() * (LOAD_NODES - 1) as f64;
        let k = (place as usize).min(LOAD_NODES - 2);
        let (x, side) = (place - k as f64, usize::from(load < 0.0));
        [0, 1].map(|i| (1.0 - x) * self.0[k][side][i] + x * self.0[k + 1][side][i])
    }
}

/// An as-built drive.
struct Unit<'a> {
    errors: &'a Errors,
    kernels: &'a Kernels,
    map: &'a GearMap,
    waves: Vec<(Wheel, Wave, ByLoad)>,
    cam: ByLoad,
}

impl<'a> Unit<'a> {
    fn new(errors: &'a Errors, kernels: &'a Kernels, map: &'a GearMap) -> Unit<'a> {
        let mut waves = Vec::new();
        for (wheel, of) in [Wheel::Flexspline, Wheel::CircularSpline].into_iter().zip(&errors.pitch) {
            for wave in of {
                waves.push((wheel, *wave, ByLoad::of(|load| kernels.pitch_error(wheel, wave.0, load))));
            }
        }
        let oval = (2, errors.oval.0, errors.oval.1);
        waves.push((Wheel::CircularSpline, oval, ByLoad::of(|load| kernels.ovality(load))));
        // The cam's form stands still as the generator sees it.
        let form = |place: f64| errors.cam.iter().map(|(k, a, p)| a * (f64::from(*k) * (place - p)).cos()).sum::<f64>();
        let cam = |load: f64| {
            (0..188).map(|k| TAU * f64::from(k) / 188.0).map(|at| form(at) * kernels.generator(at, load)).sum::<f64>()
        };
        Unit { errors, kernels, map, waves, cam: ByLoad::of(|load| [cam(load), 0.0]) }
    }

    /// Error with a flank torque, its sign that of the flank that bears, arcsec.
    fn elastic(&self, gear: &WindUp, generator: f64, flank_n_m: f64, sign: f64) -> f64 {
        let output = generator / RATIO;
        let load = sign * flank_n_m.abs().max(1e-4);
        let seen_from = |wheel: Wheel| if wheel == Wheel::Flexspline { generator } else { generator - output };
        let mut error = ARCSEC_PER_RAD * gear.elastic_error_rad(generator, self.errors.compliance * flank_n_m, sign);
        for (wheel, (order, um, phase), gains) in &self.waves {
            let [c, s] = gains.at(load);
            let (sin, cos) = (f64::from(*order) * (seen_from(*wheel) - phase)).sin_cos();
            error += um * (c * cos - s * sin);
        }
        // Where the axis of the circular spline stands beside that of the generator: it turns with the output; the
        // others stand.
        let [turning, runout, housing] = self.errors.eccentric;
        let vectors = [(turning.0, turning.1 + output), (runout.0, runout.1 + PI), housing];
        let sum = |part: fn(f64) -> f64| vectors.iter().map(|(um, at)| um * part(*at)).sum::<f64>();
        let (x, y) = (sum(f64::cos), sum(f64::sin));
        error += self.kernels.eccentricity(x.hypot(y), y.atan2(x) - generator, load);
        for (wheel, (tooth, um)) in [Wheel::Flexspline, Wheel::CircularSpline].into_iter().zip(self.errors.damaged) {
            let teeth = if wheel == Wheel::Flexspline { 188.0 } else { 190.0 };
            let place = TAU * f64::from(tooth) / teeth - seen_from(wheel);
            error += um * self.kernels.missing(wheel, DamagedFlank::Minus, place, load);
        }
        error + self.cam.at(load)[0] + sign * self.errors.wear_arcsec
    }
}

/// True values and sensor readings of a run, row by row.
#[derive(Default)]
struct Run {
    time: Vec<f64>,
    generator: Vec<f64>,
    torque: Vec<f64>,
    temperature: Vec<f64>,
    /// True error, arcsec.
    error: Vec<f64>,
}

impl Run {
    /// The drive goes through motion, loads and temperatures; the output rests where the drag holds it.
    fn drive(mut self, unit: &Unit<'_>) -> Run {
        let mut gear = unit.map.at(self.temperature[0]);
        let (mut error, mut last) = (0.0_f64, self.generator[0]);
        for k in 0..self.generator.len() {
            if k % 50 == 0 {
                gear = unit.map.at(self.temperature[k]);
            }
            let (psi, torque) = (self.generator[k], self.torque[k]);
            let behind = if torque - DRAG_N_M > 0.0 { 1.0 } else { -1.0 };
            let ahead = if torque + DRAG_N_M < 0.0 { -1.0 } else { 1.0 };
            let lowest = unit.elastic(&gear, psi, torque - DRAG_N_M, behind);
            let highest = unit.elastic(&gear, psi, torque + DRAG_N_M, ahead);
            let stays = error - (psi - last) / RATIO * ARCSEC_PER_RAD;
            error = stays.min(highest).max(lowest);
            last = psi;
            self.error.push(error);
        }
        self
    }
}

/// The sensors of a bench.
struct Sensors {
    /// Eccentric encoders: at the output (order 1 and 2, arcsec of the output), at the motor (arcsec of the motor).
    output_arcsec: [(f64, f64); 2],
    motor_arcsec: (f64, f64),
    /// Zero of the output, rad.
    zero_rad: f64,
    torque: [f64; 2],
}

const OUTPUT_NOISE_ARCSEC: f64 = 0.5;
const WANDER_ARCSEC: f64 = 0.5;
const WANDER_S: f64 = 20.0;
const JITTER_S: f64 = 30e-6;
const TORQUE_NOISE_N_M: f64 = 0.03;
const TEMPERATURE_NOISE_K: f64 = 0.05;

impl Sensors {
    fn draw(random: &mut fastrand::Rng) -> Sensors {
        Sensors {
            // Two heads, or one that was set up with care.
            output_arcsec: [(0.8, TAU * random.f64()), (0.3, TAU * random.f64())],
            motor_arcsec: (40.0, TAU * random.f64()),
            zero_rad: 1e-3 * gauss(random),
            torque: [1.0 + 0.002 * gauss(random), 0.02 * gauss(random)],
        }
    }

    /// Error of the encoder at the output at an angle, arcsec.
    fn adds(&self, output_rad: f64) -> f64 {
        let [(once, a), (twice, b)] = self.output_arcsec;
        once * (output_rad - a).sin() + twice * (2.0 * output_rad - b).sin()
    }

    /// The motor's encoder, rad.
    fn motor(&self, generator_rad: f64) -> f64 {
        let (size, phase) = self.motor_arcsec;
        let read = generator_rad + size / ARCSEC_PER_RAD * (generator_rad - phase).sin();
        (read / TAU * 65536.0).round() / 65536.0 * TAU
    }

    /// Log of a run.
    fn log(&self, run: &Run, random: &mut fastrand::Rng) -> String {
        let mut text = "t;motor;joint;load;temp\n".to_owned();
        let mut wander = WANDER_ARCSEC * gauss(random);
        for k in 0..run.time.len() {
            let dt = if k > 0 { run.time[k] - run.time[k - 1] } else { 0.0 };
            let stays = (-dt / WANDER_S).exp();
            wander = stays * wander + (1.0 - stays * stays).sqrt() * WANDER_ARCSEC * gauss(random);
            let speed = if k > 0 && dt > 0.0 { (run.generator[k] - run.generator[k - 1]) / dt } else { 0.0 };
            // Both encoders are polled; the output is read a little later or earlier.
            let late = JITTER_S * gauss(random) * speed / RATIO * ARCSEC_PER_RAD;
            let nominal = run.generator[k] / RATIO;
            let output = nominal
                + self.zero_rad
                + (run.error[k] + self.adds(nominal) + wander + late + OUTPUT_NOISE_ARCSEC * gauss(random))
                    / ARCSEC_PER_RAD;
            let counts = (output / TAU * f64::from(1 << 26)).round();
            let motor = self.motor(run.generator[k]) / TAU * 65536.0;
            let torque = self.torque[0] * run.torque[k] + self.torque[1] + TORQUE_NOISE_N_M * gauss(random);
            let temperature = run.temperature[k] + TEMPERATURE_NOISE_K * gauss(random);
            text += &format!("{:.3};{motor:.0};{counts:.0};{torque:.3};{temperature:.2}\n", run.time[k]);
        }
        text
    }
}

const COLUMNS: &str =
    "time=t:s,generator=motor:count/65536,output=joint:count/67108864,torque=load:N.m,temperature=temp:C";

/// One log of the plan: its passes there and back, with a rest at either end.
fn planned_run(planned: &Planned, log: usize) -> Run {
    let mut run = Run::default();
    for pass in planned.passes.iter().filter(|pass| pass.log == log) {
        let (from, to) = (pass.from_generator_turn, pass.to_generator_turn);
        let there = 0.5 * pass.duration_s;
        for k in 0..(pass.duration_s * RATE_HZ) as usize {
            let t = k as f64 / RATE_HZ;
            let half = if t < there { t } else { t - there };
            let share = (half / (there - 1.0)).min(1.0);
            let share = if t < there { share } else { 1.0 - share };
            run.time.push(pass.begin_s + t);
            run.generator.push(TAU * (from + (to - from) * share));
            run.torque.push(pass.torque_n_m);
            run.temperature.push(pass.temperature_c + (run.time.len() as f64 / 2000.0).sin());
        }
    }
    run
}

/// Another day: targets here and there, loads that swing or stand, another temperature.
fn another_day(random: &mut fastrand::Rng) -> Run {
    const ROWS: usize = 4000;
    let mut run = Run::default();
    let mut generator = TAU * RATIO * random.f64();
    let (mut target, mut speed) = (generator, 0.0);
    let [swing, period, steady] = [45.0 * random.f64(), 5.0 + 40.0 * random.f64(), 40.0 * (random.f64() - 0.5)];
    let warm = TEMPERATURES_C[0] + (TEMPERATURES_C[1] - TEMPERATURES_C[0]) * random.f64();
    for k in 0..ROWS {
        let t = k as f64 / RATE_HZ;
        if f64::abs(target - generator) < 0.5 {
            target = TAU * RATIO * random.f64();
            speed = 2.0 + 8.0 * random.f64();
        }
        generator += (speed / RATE_HZ).min(f64::abs(target - generator)) * (target - generator).signum();
        run.time.push(t);
        run.generator.push(generator);
        run.torque.push(steady + swing * (TAU * t / period).sin());
        run.temperature.push(warm + 2.0 * (t / 300.0).sin());
    }
    run
}

/// A table of waves as any program fits them: orders of the generator and of the output, if wanted for each direction
/// alone.
struct Fourier {
    by_direction: bool,
    coefficients: [Vec<f64>; 2],
}

impl Fourier {
    fn columns(generator: f64) -> Vec<f64> {
        let of =
            |angle: f64, most: u32| (1..=most).flat_map(move |k| <[f64; 2]>::from((f64::from(k) * angle).sin_cos()));
        std::iter::once(1.0).chain(of(generator, 8)).chain(of(generator / RATIO, 6)).collect()
    }

    fn of(rows: &[(f64, f64, f64)], by_direction: bool) -> Fourier {
        let coefficients = [1.0, -1.0].map(|way| {
            let of_way = rows.iter().filter(|(_, _, of_way)| !by_direction || *of_way == way);
            least_squares(of_way.map(|(generator, error, _)| (Self::columns(*generator), *error)))
        });
        Fourier { by_direction, coefficients }
    }

    fn at(&self, generator: f64, way: f64) -> f64 {
        let side = usize::from(self.by_direction && way < 0.0);
        Self::columns(generator).iter().zip(&self.coefficients[side]).map(|(x, c)| x * c).sum()
    }
}

/// Error that no table can hold: the nominal one with all that a table has room for (curves over three angles, wind-up,
/// play, temperature), fitted without sensors to the truth everywhere in the range of the bench.
struct Best(Vec<f64>);

impl Best {
    fn columns(generator: f64, torque: f64, temperature: f64, way: f64) -> Vec<f64> {
        let (share, warm) = (torque / MOST_LOAD_N_M, temperature / 20.0 - 1.0);
        let against = generator - generator / RATIO;
        let flank = if torque.abs() > DRAG_N_M { torque.signum() } else { -way };
        let mut x = Fourier::columns(generator);
        x.extend((1..=8).flat_map(|order| <[f64; 2]>::from((f64::from(order) * against).sin_cos())));
        x.extend((1..=9).map(|power| share.powi(power)));
        x.extend([flank, flank * share, flank * share * share, way, warm * share, warm]);
        x
    }

    fn of(states: &[(State, f64)]) -> Best {
        let row = |(at, left): &(State, f64)| {
            (Self::columns(at.generator_rad, at.torque_n_m, at.temperature_c, at.way), *left)
        };
        Best(least_squares(states.iter().map(row)))
    }

    fn at(&self, day: &Run, k: usize, way: f64) -> f64 {
        let x = Self::columns(day.generator[k], day.torque[k], day.temperature[k], way);
        x.iter().zip(&self.0).map(|(x, c)| x * c).sum()
    }
}

/// Coefficients of rows with the least squares; a column that says nothing gets none.
pub fn least_squares(rows: impl Iterator<Item = (Vec<f64>, f64)>) -> Vec<f64> {
    let mut system: Vec<Vec<f64>> = Vec::new();
    for (x, value) in rows {
        let width = x.len();
        system.resize(width, vec![0.0; width + 1]);
        for i in 0..width {
            (0..width).for_each(|j| system[i][j] += x[i] * x[j]);
            system[i][width] += x[i] * value;
        }
    }
    (0..system.len()).for_each(|i| system[i][i] *= 1.0 + 1e-9);
    solve(system)
}

/// Gauss elimination of a definite system, right side last.
fn solve(mut system: Vec<Vec<f64>>) -> Vec<f64> {
    let width = system.len();
    for i in 0..width {
        for k in 0..width {
            if k != i {
                let factor = system[k][i] / system[i][i];
                for j in i..=width {
                    system[k][j] -= factor * system[i][j];
                }
            }
        }
    }
    (0..width).map(|i| system[i][width] / system[i][i]).collect()
}

fn ways(generator: &[f64]) -> Vec<f64> {
    let mut way = 1.0;
    let step = |k: usize| if k > 0 { generator[k] - generator[k - 1] } else { generator[1] - generator[0] };
    (0..generator.len())
        .map(|k| {
            if step(k) != 0.0 {
                way = step(k).signum();
            }
            way
        })
        .collect()
}

/// Share of what a table can take out that is taken out at least, and what is left, of what the best of the other
/// tables leaves, at most: below and above what ten drives gave when this was written.
const LEAST_REMOVED: f64 = 0.9;
const LARGEST_OF_OTHERS: f64 = 0.5;

/// Figures of one drive, arcsec rms over other days.
#[derive(Debug, Default, Clone, Copy)]
struct Figures {
    before: f64,
    fourier: f64,
    fourier_by_direction: f64,
    nominal: f64,
    calibrated: f64,
    /// With [`Best`].
    best: f64,
    /// Share of states within their interval.
    covered: f64,
    half_width: f64,
    expected: f64,
}

impl Figures {
    /// Share of what a table can take out that was taken out.
    fn removed(&self, left: f64) -> f64 {
        let part = |left: f64| (left * left - self.best * self.best).max(0.0).sqrt();
        1.0 - part(left) / part(self.before)
    }
}

fn recording(name: &str, text: &str, prior: &Prior<'_>) -> Recording {
    parse(name, text.as_bytes(), &ColumnMap::parse(COLUMNS).unwrap(), &prior.nominal.gear()).unwrap()
}

/// Error that the core leaves in a run, from the readings of the sensors at the motor, at the load and at the drive.
fn left_by(image: &[u8], run: &Run, sensors: &Sensors) -> Vec<f64> {
    let table = Table::check(image).unwrap();
    let mut play = PlayState::unknown();
    (0..run.time.len())
        .map(|k| {
            let generator = GeneratorAngle::from_rad(sensors.motor(run.generator[k])).unwrap();
            let said = table.forward(&mut play, generator, run.torque[k] as f32, run.temperature[k] as f32);
            run.error[k] - f64::from(said.transmission_error_rad) * ARCSEC_PER_RAD
        })
        .collect()
}

/// Draws a drive, records a planned hour of it, calibrates, and asks on other days.
fn of_drive(seed: u64) -> Figures {
    let mut random = fastrand::Rng::with_seed(seed);
    let (errors, sensors) = (Errors::draw(&mut random), Sensors::draw(&mut random));
    let (kernels, map, nominal) = (&known().1, GearMap::of(GeneratorKind::Cam), image(GeneratorKind::Cam));
    let unit = Unit::new(&errors, kernels, &map);
    let table = Table::check(&nominal).unwrap();
    let prior = Prior::of_table(&table, GeneratorKind::Cam);
    let bench = Bench { rate_hz: RATE_HZ, torque_n_m: LOADS_N_M, temperature_c: TEMPERATURES_C, ..Bench::default() };
    let planned = plan(&prior, &bench).unwrap();
    let runs: Vec<Run> = (1..=3).map(|log| planned_run(&planned, log).drive(&unit)).collect();
    let logs: Vec<Recording> = runs
        .iter()
        .enumerate()
        .map(|(k, run)| recording(&format!("{k}.csv"), &sensors.log(run, &mut random), &prior))
        .collect();
    let made = calibrate(&logs, &prior).unwrap();
    let days: Vec<Run> = (0..4).map(|_| another_day(&mut random).drive(&unit)).collect();
    let rows: Vec<(f64, f64, f64)> = runs
        .iter()
        .flat_map(|run| {
            let ways = ways(&run.generator);
            (0..run.time.len()).map(move |k| (run.generator[k], run.error[k], ways[k])).collect::<Vec<_>>()
        })
        .collect();
    let over = |left: &dyn Fn(&Run) -> Vec<f64>| {
        (days.iter().map(|day| std_dev(&left(day)).powi(2)).sum::<f64>() / days.len() as f64).sqrt()
    };
    let by_waves = |by_direction: bool| {
        let fitted = Fourier::of(&rows, by_direction);
        over(&|day: &Run| {
            let ways = ways(&day.generator);
            (0..day.time.len()).map(|k| day.error[k] - fitted.at(day.generator[k], ways[k])).collect()
        })
    };
    let states = states(&unit, &mut random);
    let less_nominal = |(at, error): &(State, f64)| (*at, error - steady(&table, at));
    let best = Best::of(&states.iter().map(less_nominal).collect::<Vec<_>>());
    let best = over(&|day: &Run| {
        let ways = ways(&day.generator);
        let left = left_by(&nominal, day, &sensors);
        (0..day.time.len()).map(|k| left[k] - best.at(day, k, ways[k])).collect()
    });
    Figures {
        before: over(&|day: &Run| day.error.clone()),
        fourier: by_waves(false),
        fourier_by_direction: by_waves(true),
        nominal: over(&|day: &Run| left_by(&nominal, day, &sensors)),
        calibrated: over(&|day: &Run| left_by(&made.table.image, day, &sensors)),
        best,
        covered: covered(&made, &states, &sensors),
        half_width: made.calibration.half_width_arcsec,
        expected: planned.expected_rms_arcsec,
    }
}

/// States in steady motion spread over all that was planned, with the true error, arcsec.
fn states(unit: &Unit<'_>, random: &mut fastrand::Rng) -> Vec<(State, f64)> {
    const STATES: usize = 4000;
    let between = |[low, high]: [f64; 2], random: &mut fastrand::Rng| low + (high - low) * random.f64();
    let gears = [12.0, 16.0, 20.0, 24.0, 28.0].map(|at| (at, unit.map.at(at)));
    (0..STATES)
        .map(|_| {
            let generator_rad = TAU * RATIO * random.f64();
            let torque_n_m = between(LOADS_N_M, random);
            let (temperature_c, gear) = &gears[random.usize(0..gears.len())];
            let way = if random.bool() { 1.0 } else { -1.0 };
            let flank = torque_n_m - DRAG_N_M * way;
            let error = unit.elastic(gear, generator_rad, flank, flank.signum());
            let output_rad = generator_rad / RATIO;
            (
                State { generator_rad, output_rad, torque_n_m, temperature_c: *temperature_c, way, ..State::default() },
                error,
            )
        })
        .collect()
}

/// Error of a table in steady motion, arcsec.
fn steady(table: &Table<'_>, at: &State) -> f64 {
    let direction = if at.way > 0.0 { Direction::Forward } else { Direction::Backward };
    let generator = GeneratorAngle::from_rad(at.generator_rad).unwrap();
    let said = table.steady_error_rad(generator, at.torque_n_m as f32, at.temperature_c as f32, direction).unwrap();
    f64::from(said) * ARCSEC_PER_RAD
}

/// Share of states whose error the interval holds: of what a perfect reader of these encoders would see, since no log
/// can distinguish an eccentric encoder from the drive.
fn covered(made: &Calibrated, states: &[(State, f64)], sensors: &Sensors) -> f64 {
    let table = Table::check(&made.table.image).unwrap();
    let off: Vec<(f64, f64)> = states
        .iter()
        .map(|(at, error)| {
            let read = State { generator_rad: sensors.motor(at.generator_rad), ..*at };
            let seen = error + sensors.adds(at.output_rad);
            (seen - steady(&table, &read), made.known.half_width_arcsec(&read))
        })
        .collect();
    let mean = off.iter().map(|(off, _)| off).sum::<f64>() / off.len() as f64;
    off.iter().filter(|(off, half)| (off - mean).abs() <= *half).count() as f64 / off.len() as f64
}

/// One table of figures, and what is asked of every drive.
fn judged(seeds: impl Iterator<Item = u64>) {
    println!(
        "drive  as measured  nominal table  Fourier  by direction  calibrated  best  removed %  covered %  \
         half width  plan"
    );
    for seed in seeds {
        let f = of_drive(seed);
        println!(
            "{seed:>5} {:>12.2} {:>14.2} {:>8.2} {:>13.2} {:>11.2} {:>5.2} {:>10.1} {:>10.1} {:>11.2} {:>5.2}",
            f.before,
            f.nominal,
            f.fourier,
            f.fourier_by_direction,
            f.calibrated,
            f.best,
            100.0 * f.removed(f.calibrated),
            100.0 * f.covered,
            f.half_width,
            f.expected
        );
        assert!((0.90..=0.98).contains(&f.covered), "drive {seed}: {f:?}");
        assert!(f.removed(f.calibrated) >= LEAST_REMOVED, "drive {seed}: {f:?}");
        let others = f.nominal.min(f.fourier).min(f.fourier_by_direction);
        assert!(f.calibrated < LARGEST_OF_OTHERS * others, "drive {seed}: {f:?}");
    }
}

#[test]
#[ignore = "long: tests/run slow"]
fn a_planned_hour_corrects_an_as_built_drive_on_other_days() {
    judged(1..=1);
}

#[test]
#[ignore = "nine more drives: minutes"]
fn ten_as_built_drives_are_corrected_on_other_days() {
    judged(2..=10);
}
