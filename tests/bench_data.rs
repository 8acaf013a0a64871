//! A drive on a bench, for tests of what is made of measured data: many effects, drawn at random, that are physics.
//!
//! It shares no code with the library: its own laws, its own noise.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;

/// One arc-second in radians.
pub const ARCSEC: f64 = PI / 648_000.0;
/// Ratio of the drive.
pub const RATIO: f64 = 95.0;

/// A recording.
#[derive(Clone, Default)]
#[allow(dead_code, reason = "each test file uses a part")]
pub struct Bench {
    pub time_s: Vec<f64>,
    pub generator_rad: Vec<f64>,
    pub output_rad: Vec<f64>,
    pub torque_n_m: Option<Vec<f64>>,
    pub temperature_c: Option<Vec<f64>>,
}

/// Normal deviate.
pub fn normal(random: &mut fastrand::Rng) -> f64 {
    (-2.0 * (1.0 - random.f64()).ln()).sqrt() * (TAU * random.f64()).cos()
}

pub fn shifted(values: &mut [f64], by: f64) {
    values.iter_mut().for_each(|value| *value += by);
}

pub fn scaled(values: &mut [f64], by: f64) {
    values.iter_mut().for_each(|value| *value *= by);
}

#[allow(dead_code, reason = "each test file uses a part")]
impl Bench {
    pub fn rows(&self) -> usize {
        self.time_s.len()
    }

    /// Recorded torques, N·m; a bench without them has no place in the test that asks.
    pub fn torque(&mut self) -> &mut [f64] {
        self.torque_n_m.as_mut().expect("torques")
    }

    /// Recorded temperatures, °C, as [`Self::torque`].
    pub fn temperature(&mut self) -> &mut [f64] {
        self.temperature_c.as_mut().expect("temperatures")
    }

    /// As a file; rows go through `change`, which may leave fields empty or drop the row.
    pub fn csv(&self) -> String {
        let mut text = "time_s,generator_rad,output_rad".to_owned();
        for (there, name) in
            [(self.torque_n_m.is_some(), ",torque_n_m"), (self.temperature_c.is_some(), ",temperature_c")]
        {
            text.push_str(if there { name } else { "" });
        }
        text.push('\n');
        for k in 0..self.rows() {
            write!(text, "{:.6},{:.9},{:.11}", self.time_s[k], self.generator_rad[k], self.output_rad[k]).unwrap();
            for values in [&self.torque_n_m, &self.temperature_c].into_iter().flatten() {
                write!(text, ",{:.5}", values[k]).unwrap();
            }
            text.push('\n');
        }
        text
    }

    /// A plain drive: two orders, clearance, wind-up, white noise of `noise_arcsec`; to and fro, load that changes
    /// sign.
    pub fn plain(rows: usize, noise_arcsec: f64, seed: u64) -> Bench {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut bench = Bench { torque_n_m: Some(Vec::new()), temperature_c: Some(Vec::new()), ..Bench::default() };
        let (mut psi, mut play) = (0.0, 0.0_f64);
        for k in 0..rows {
            let part = k as f64 / rows as f64;
            psi += if part % 0.25 < 0.125 { 0.05 } else { -0.0437 };
            let torque = 30.0 * (TAU * 7.3 * part).sin();
            play = play.clamp(psi / RATIO - 15.0 * ARCSEC, psi / RATIO + 15.0 * ARCSEC);
            let error = 20.0 * (2.0 * psi + 0.4).sin() + 8.0 * (2.0 * psi * 94.0 / 95.0).sin() + torque / 1.5 * 0.7;
            bench.time_s.push(k as f64 * 0.01);
            bench.generator_rad.push(psi);
            bench.output_rad.push(play + (error + noise_arcsec * normal(&mut random)) * ARCSEC);
            bench.torque_n_m.as_mut().unwrap().push(torque + 0.05 * normal(&mut random));
            bench
                .temperature_c
                .as_mut()
                .unwrap()
                .push(20.0 + 10.0 * (TAU * 0.8 * part).sin() + 0.02 * normal(&mut random));
        }
        bench
    }

    /// A drive with a random choice of real effects, some of them large, and random excitation. Nothing in it is wrong
    /// with the data.
    pub fn drawn(rows: usize, seed: u64) -> (Bench, Vec<&'static str>) {
        let mut random = fastrand::Rng::with_seed(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x51);
        let has = |name: &'static str, chance: f64, said: &mut Vec<&'static str>, random: &mut fastrand::Rng| {
            let yes = random.f64() < chance;
            if yes {
                said.push(name);
            }
            yes
        };
        let mut said = Vec::new();
        let within = |random: &mut fastrand::Rng, low: f64, high: f64| low * (high / low).powf(random.f64());
        let lines: Vec<(f64, f64, f64)> = [1.0, 2.0, 4.0, 94.0 / 95.0, 188.0 / 95.0, 376.0 / 95.0, 1.0 / 95.0, 188.0]
            .into_iter()
            .map(|order| {
                (order, if random.f64() < 0.5 { within(&mut random, 0.3, 40.0) } else { 0.0 }, TAU * random.f64())
            })
            .collect();
        let noise = within(&mut random, 0.3, 5.0);
        let wander = if has("wander", 0.5, &mut said, &mut random) { within(&mut random, 0.3, 4.0) } else { 0.0 };
        let memory = within(&mut random, 20.0, 500.0);
        let clearance = within(&mut random, 5.0, 200.0);
        let stiffness = within(&mut random, 1e4, 1e5);
        let hardening = if has("hardening", 0.3, &mut said, &mut random) { 3e-5 } else { 0.0 };
        let hysteresis =
            if has("hysteresis", 0.4, &mut said, &mut random) { within(&mut random, 3.0, 60.0) } else { 0.0 };
        let tooth =
            if has("damaged tooth", 0.3, &mut said, &mut random) { within(&mut random, 10.0, 100.0) } else { 0.0 };
        let tooth_at = TAU * random.f64();
        let tooth_on_circular_spline = random.bool();
        let resonance = has("resonance", 0.3, &mut said, &mut random);
        let latency_s = if has("latency", 0.3, &mut said, &mut random) { within(&mut random, 1e-4, 1e-2) } else { 0.0 };
        let wear = if has("wear", 0.2, &mut said, &mut random) { within(&mut random, 10.0, 60.0) } else { 0.0 };
        let thermal = if has("thermal clearance", 0.3, &mut said, &mut random) { 1.5 } else { 0.0 };
        let gravity =
            if has("gravity torque", 0.25, &mut said, &mut random) { within(&mut random, 2.0, 30.0) } else { 0.0 };
        let step = if has("fine encoder", 0.5, &mut said, &mut random) { within(&mut random, 0.05, 1.24) } else { 0.0 };
        let ratio_error = if has("ratio error", 0.15, &mut said, &mut random) { 1.0 + 1.0 / 95.0 } else { 1.0 };
        let load = random.usize(0..5);
        said.push(["no load", "constant load", "sine load", "load in steps", "load without a column"][load]);
        let temperature = random.usize(0..4);
        said.push(["no temperature", "soak", "ramp", "cycle"][temperature]);
        let motion = random.usize(0..4);
        said.push(["to and fro", "one way", "many speeds", "short strokes"][motion]);
        let sessions = random.usize(1..5);
        let dt = [0.001, 0.01, 0.1][random.usize(0..3)];
        let pace = within(&mut random, 0.004, 0.25);

        let mut b = Bench { torque_n_m: Some(Vec::new()), temperature_c: Some(Vec::new()), ..Bench::default() };
        let (mut psi, mut slow, mut play, mut slip) = (TAU * random.f64(), 0.0, f64::NAN, 0.0_f64);
        let (mut ring, mut ring_rate) = (0.0, 0.0);
        let (mut time, mut before) = (100.0 * random.f64(), 0.0);
        let mut pace_now = pace;
        for k in 0..rows {
            let part = k as f64 / rows as f64;
            if k > 0 && (k * sessions / rows) != ((k - 1) * sessions / rows) {
                time += 60.0 + 500.0 * random.f64();
            }
            time += dt;
            let phase = (part * 8.0).fract();
            let aim = match motion {
                0 => pace * if phase < 0.5 { 1.0 } else { -0.93 },
                1 => pace,
                2 => pace * [1.0, -0.5, 2.0, -2.1, 0.3, 0.7, -1.0, -0.2][(part * 8.0) as usize],
                _ => pace * (TAU * 25.0 * part).cos(),
            };
            pace_now += (aim - pace_now) * 0.2;
            psi += pace_now;
            let torque = match load {
                0 => 0.0,
                1 => 25.0,
                2 => 40.0 * (TAU * 5.7 * part).sin(),
                3 => [0.0, 20.0, -20.0, 40.0, 0.0, -40.0, 10.0, -5.0][(part * 16.0) as usize % 8],
                _ => 30.0 * (TAU * 3.1 * part).sin(),
            };
            let warm = match temperature {
                0 | 1 => 0.0,
                2 => 40.0 * part,
                _ => 25.0 * (TAU * 1.3 * part).sin(),
            };
            let delta = psi / RATIO;
            let felt = torque + gravity * (delta + 0.3).sin();
            // The load holds one flank; without one the output lags behind the generator.
            let half = 0.5 * (clearance + wear * part - thermal * warm).max(0.0) * ARCSEC;
            let nominal = psi / RATIO * ratio_error;
            if play.is_nan() {
                play = nominal;
            }
            if felt.abs() > 1.0 {
                play += (nominal + half * felt.signum() - play).clamp(-0.7 * half - 1e-9, 0.7 * half + 1e-9);
            }
            play = play.clamp(nominal - half, nominal + half);
            let wound = felt / stiffness * (1.0 - hardening * felt * felt).max(0.5);
            slip = (slip + hysteresis * (felt - before) / 20.0).clamp(-0.5 * hysteresis, 0.5 * hysteresis);
            let kick = (felt - before) / stiffness;
            before = felt;
            if resonance {
                // A mode of some rows a period, excited by load and by motion that changes.
                ring_rate = 0.97 * (ring_rate + 4.0 * kick + 2e-6 * (aim - pace_now) / pace.max(1e-9)) - 0.4 * ring;
                ring += ring_rate;
            }
            let mut error: f64 = lines.iter().map(|(order, a, phase)| a * (order * psi + phase).sin()).sum();
            let at = if tooth_on_circular_spline { psi - delta } else { psi } - tooth_at;
            let off = (at / PI - (at / PI).round()) * PI;
            error += tooth * (-(off / 0.12).powi(2)).exp();
            slow += -slow / memory + wander * (2.0 / memory).sqrt() * normal(&mut random);
            error += slip + slow + noise * normal(&mut random);
            let mut output = play + wound + ring + error * ARCSEC - latency_s * pace_now / dt / RATIO;
            if step > 0.0 {
                output = (output / (step * ARCSEC)).round() * step * ARCSEC;
            }
            b.time_s.push(time);
            b.generator_rad.push(psi);
            b.output_rad.push(output);
            b.torque_n_m.as_mut().unwrap().push(torque + if torque == 0.0 { 0.0 } else { 0.1 * normal(&mut random) });
            b.temperature_c.as_mut().unwrap().push(((20.0 + warm + 0.05 * normal(&mut random)) * 10.0).round() / 10.0);
        }
        if load == 4 {
            b.torque_n_m = None;
        }
        if temperature == 0 {
            b.temperature_c = None;
        }
        (b, said)
    }
}
