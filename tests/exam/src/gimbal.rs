//! Family G: the gimbal of a spacecraft's antenna in a thermal vacuum chamber. A stepper motor in microsteps turns the
//! generator through passes, slews, rasters and a scan of the resonance; a brake and the harness load a dummy of the
//! antenna behind the torque sensor; the chamber cycles the temperature.
//!
//! Each law has a form of the textbook and one of a real part; `shape[3]` is the distance between the two, 0 to 1.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::ARCSEC;
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Unit};
use crate::hides::{Hides, Stranger, Thing};
use crate::record::Record;
use crate::train::{self, Adds, Laws, Memory, Now, Pace, Session, ease, eased, near_zero, place, stairs};

/// Effects outside the library that such a gimbal shows.
pub const STRANGERS: &[Stranger] =
    &[Stranger::HarnessSnap, Stranger::SunOnMount, Stranger::WheelHum, Stranger::MountSettles, Stranger::LooseBolts];

const STEP_S: f64 = 1e-3;
/// Microsteps in a turn of the motor: 200 steps, 16 each.
const MICROSTEPS: f64 = 3200.0;
const POLES: f64 = 50.0;
const PRESSURE_RAD: f64 = 0.38;
/// Generator speed at which the size is the drag of the grease, rad/s.
const DRAG_AT_RAD_S: f64 = 4.0;

#[derive(Debug, Clone)]
pub struct Gimbal {
    pub pace: Pace,
    /// Of all sessions.
    pub rows: usize,
    sessions: usize,
    drive: Drive,
    /// Natural frequency of the rotor in its magnetic spring, rad/s, and its damping ratio.
    rotor: (f64, f64),
    /// Of the antenna's dummy on the spring, Hz.
    load_hz: f64,
    turned: bool,
}

impl Gimbal {
    pub fn draw(drive: &Drive, chance: &mut Chance) -> Self {
        let stride = *chance.of(&[20, 25]);
        let orientation = chance.below(4);
        Self {
            pace: Pace {
                step_s: STEP_S,
                stride,
                jitter_s: chance.log_uniform(5e-6, 5e-5),
                damping_rad_s: chance.uniform(8.0, 16.0),
                lags_s: [chance.log_uniform(30.0, 90.0), chance.log_uniform(150.0, 400.0)],
                seed: chance.number(),
                orientation_known: orientation != 0,
            },
            rows: 28_000 + chance.below(14_000),
            sessions: 4 + chance.below(3),
            drive: drive.clone(),
            rotor: (chance.uniform(140.0, 220.0), chance.uniform(0.15, 0.35)),
            load_hz: chance.uniform(11.0, 20.0),
            turned: orientation > 1,
        }
    }

    pub fn run(&self, drive: &Drive, unit: &Unit, hidden: &[Hides]) -> Record {
        train::run(self, drive, unit, hidden, &self.plan(), &self.pace)
    }

    /// Commands and surroundings of each session.
    fn plan(&self) -> Vec<Session> {
        let mut chance = Chance::new(self.pace.seed, "gimbal", 0);
        let count = self.rows / self.sessions * self.pace.stride;
        let seconds = count as f64 * STEP_S;
        let rated = self.drive.rated_n_m;
        let mut kinds = [0, 1, 2, 3, 4, 2];
        chance.shuffle(&mut kinds);
        let mut bases: Vec<f64> = (0..self.sessions)
            .map(|at| -38.0 + 88.0 * (at as f64 + chance.uniform(0.1, 0.9)) / self.sessions as f64)
            .collect();
        chance.shuffle(&mut bases);
        let stiffness = self.drive.first_stiffness();
        let (start, turn) = (chance.below(4), 1 + chance.below(2));
        let senses = [1.0, 1.0, -1.0, 1.0, -1.0, -1.0];
        let first = chance.sign();
        (0..self.sessions)
            .map(|session| {
                let at_s = |at: usize| at as f64 * STEP_S;
                let swing = chance.uniform(0.6, 0.9) * rated;
                let (period_s, phase) = (chance.uniform(14.0, 45.0), chance.phase());
                let steps = stairs(count, STEP_S, (4.0, 12.0), 0.25, &mut chance);
                let sign = chance.sign();
                let load_n_m = (0..count).map(|at| {
                    let x = at_s(at) / period_s + phase / TAU;
                    swing
                        * match kinds[session] {
                            0 => (TAU * x).sin(),
                            1 => 1.0 - 4.0 * ((x.fract()) - 0.5).abs(),
                            2 => steps[at],
                            // Two brakes of unlike pace.
                            3 => 0.6 * (TAU * x).sin() + 0.4 * (TAU * 3.7 * x).sin(),
                            _ => sign * (0.45 + 0.55 * (TAU * 0.31 * x).sin()),
                        }
                });
                let load_n_m = load_n_m.collect();
                let (ramp_c, ripple_s) = (chance.sign() * chance.uniform(4.0, 16.0), chance.uniform(50.0, 110.0));
                let column_c = (0..count).map(|at| {
                    let t = at_s(at);
                    let cycle = 2.0 * (TAU * t / ripple_s).sin();
                    (bases[session] + ramp_c * ease(t / seconds) + cycle).clamp(-42.0, 62.0)
                });
                let column_c = column_c.collect();
                let orientation = if self.turned { start + turn * (session % 3) } else { start };
                Session {
                    pause_s: if session == 0 { 0.0 } else { chance.log_uniform(300.0, 9000.0).round() },
                    away_rad: if session == 0 { chance.uniform(-150.0, 150.0) } else { chance.uniform(-6.0, 6.0) },
                    speed_rad_s: self.speeds(count, first * senses[session], &mut chance),
                    load_n_m,
                    column_c,
                    orientation_rad: FRAC_PI_2 * (orientation % 4) as f64,
                    hung: (chance.uniform(0.02, 0.12) * rated, chance.uniform(-1.0, 1.0)),
                    inertia_kg_m2: stiffness / (TAU * self.load_hz).powi(2),
                }
            })
            .collect()
    }

    /// A slew, a pass of a ground station, a raster, a scan of the resonance, a slow star, rest.
    fn speeds(&self, count: usize, sense: f64, chance: &mut Chance) -> Vec<f64> {
        let seconds = count as f64 * STEP_S;
        let shares = [0.42, 0.2, 0.13, 0.1, 0.1, 0.05];
        let mut order = [0, 1, 2, 3, 4, 5];
        chance.shuffle(&mut order);
        // Two slews pass more than half a turn of the output.
        let slew = f64::max(chance.uniform(2.5, 5.0), 0.65 * PI * self.drive.ratio().abs() / (0.42 * seconds));
        let pass = chance.sign() * chance.uniform(2.0, 5.0);
        let (step, scan) = (chance.uniform(1.5, 5.0), chance.uniform(0.7, 1.4));
        let star = chance.sign() * chance.uniform(0.03, 0.25);
        let mut wishes = Vec::with_capacity(count);
        for kind in order {
            let lasts = shares[kind] * seconds;
            for at in 0..(lasts / STEP_S) as usize {
                let t = at as f64 * STEP_S;
                wishes.push(match kind {
                    0 => sense * slew,
                    // The azimuth of what flies past: arc tangent of time.
                    1 => pass / (1.0 + ((t / lasts - 0.5) / 0.16).powi(2)),
                    // Two steps on, one back.
                    2 if (t / 1.6).fract() < 0.5 => [step, step, -step][(t / 1.6) as usize % 3],
                    3 => scan * (TAU * t * (0.4 + 0.5 * 7.6 * t / lasts)).sin(),
                    4 => star,
                    _ => 0.0,
                });
            }
        }
        wishes.resize(count, 0.0);
        eased(wishes.into_iter(), 30.0, 0.02, STEP_S)
    }
}

impl Laws for Gimbal {
    /// Two equal springs, one of which bears later.
    fn alone(&self, over: f64) -> f64 {
        (1.0 - over).max(0.0)
    }

    fn turn(&self, wanted: [f64; 2], state: &mut [f64; 2], load: f64, step_s: f64) {
        let step = TAU / MICROSTEPS;
        let (frequency, damping) = self.rotor;
        let behind = (wanted[0] / step).round() * step - state[0];
        // The rated load draws the rotor by a quarter of what its magnets hold.
        let drawn = 0.25 * load * self.drive.ratio().signum();
        let pull = ((POLES * behind).sin() + drawn) / POLES;
        state[1] += step_s * (frequency * frequency * pull + 2.0 * damping * frequency * (wanted[1] - state[1]));
        state[0] += step_s * state[1];
    }

    /// The brake, and the harness as a spring about its middle.
    fn load_n_m(&self, session: &Session, at: usize, now: &Now) -> f64 {
        let (most, middle) = session.hung;
        session.load_n_m[at] - most * (0.4 * (now.output_rad - middle)).tanh()
    }

    fn wind_up(&self, one: &Hides, own: f64, torque_n_m: f64, now: &Now, memory: &mut Memory) -> f64 {
        let (size, d) = (one.size, one.shape[3]);
        let load = torque_n_m / self.drive.rated_n_m;
        match one.thing {
            // Stiffer in one sense than in the other.
            Thing::Cause(Cause::StiffnessError) => {
                own * (1.0 / (1.0 + size * (1.0 + 0.5 * d * (8.0 * load).tanh())) - 1.0)
            }
            Thing::Cause(Cause::StiffnessHardening) => {
                let rated = self.drive.wind_up_arcsec(self.drive.rated_n_m);
                hardened(own, rated, |q| {
                    let knee = (-(q / 0.35).powi(2)).exp();
                    let factor = 1.0 + size * ((1.0 - d) * q * q + d * (1.0 - knee));
                    (factor, size * 2.0 * q * (1.0 - d + d * knee / 0.1225))
                })
            }
            Thing::Cause(Cause::ThermalStiffness) => {
                let warmer = now.gear_c - 20.0;
                let soft = 1.0 + size * (warmer + d * warmer * warmer.abs() / 40.0);
                own * (1.0 / soft.max(0.35) - 1.0)
            }
            // Bouc and Wen, from nearly Jenkins (n = 10) to round and quicker to let go.
            Thing::Cause(Cause::TorsionalHysteresis) => {
                let slip = f64::max(0.18 * self.drive.rated_n_m, 2.0 * size * self.drive.first_stiffness() / ARCSEC);
                let change = (torque_n_m - memory[1]) / slip;
                let (power, beta) = (1.0 + 9.0 * (1.0 - d), 0.5 + 0.4 * d);
                let sense = (memory[0] * change).signum();
                memory[0] += change * (1.0 - memory[0].abs().powf(power) * (beta * sense + 1.0 - beta));
                memory[0] = memory[0].clamp(-1.0, 1.0);
                memory[1] = torque_n_m;
                -size * memory[0]
            }
            Thing::Stranger(Stranger::LooseBolts) => size * load * (3.0 * now.output_rad + one.phase(0)).cos(),
            _ => 0.0,
        }
    }

    fn add(&self, one: &Hides, now: &Now, memory: &mut Memory, to: &mut Adds) {
        let (size, d) = (one.size, one.shape[3]);
        let (p, q, r) = (one.phase(0), one.phase(1), one.phase(2));
        let load = now.load.abs().min(1.5);
        let [flexspline, circular] = now.wheel_rad;
        let dt = now.step_s;
        match one.thing {
            Thing::Cause(cause) => match cause {
                // Under load the flexspline floats to where both lobes bear.
                Cause::CircularSplineEccentricity => {
                    for zone in 0..2 {
                        let a = place(circular, zone) - p;
                        let sized = size / (1.0 + 0.8 * d * load);
                        to.displaced(zone, sized, a, PRESSURE_RAD);
                        to.both(zone, 0.25 * d * size * (2.0 * a + q).sin());
                    }
                }
                // The wall is uneven where the rim runs out.
                Cause::FlexsplineRunout => {
                    for zone in 0..2 {
                        let a = place(flexspline, zone) - p;
                        to.displaced(zone, size, a, PRESSURE_RAD);
                        to.both(zone, d * size * (0.45 * (2.0 * a + q).sin() + 0.2 * (3.0 * a + r).sin()));
                    }
                }
                // Clamping bolts press the ring oval: radial as well, a fourth order, and the load rounds it.
                Cause::CircularSplineOvality => {
                    for zone in 0..2 {
                        let a = 2.0 * place(circular, zone) + p;
                        let sized = size * (1.0 - 0.3 * d * load);
                        to.both(zone, sized * (a.sin() + 0.3 * d * (2.0 * a + q).sin()));
                        to.zones[zone][0] -= 0.35 * d * sized * a.cos();
                        to.zones[zone][1] += 0.35 * d * sized * a.cos();
                    }
                }
                Cause::FlexsplinePitchError | Cause::CircularSplinePitchError => {
                    let wheel = if cause == Cause::FlexsplinePitchError { flexspline } else { circular };
                    for zone in 0..2 {
                        let a = place(wheel, zone);
                        to.both(zone, size * pitch(a, one));
                        // The other flank was cut in another pass.
                        to.zones[zone][1] += 0.4 * d * size * (2.0 * a + r).sin();
                    }
                }
                // One lobe is deeper, so it bears alone at light load, and the wheels' first orders show.
                Cause::GeneratorEccentricity => {
                    let deep = 0.8 * size * (1.0 - 0.35 * d);
                    for zone in 0..2 {
                        let side = if zone == 0 { 1.0 } else { -1.0 };
                        to.zones[zone][0] -= side * deep;
                        to.zones[zone][1] += side * deep;
                        let (f, c) = (place(flexspline, zone), place(circular, zone));
                        to.both(zone, size * (0.6 * (f + p).sin() + 0.5 * (c + q).sin()));
                        // The rim leans to the deeper lobe at any load.
                        to.both(zone, 0.3 * d * size * (flexspline + r).sin());
                    }
                }
                Cause::CamFormError => {
                    let a = self.drive.mesh_order() * now.generator_rad;
                    let sized = size * (1.0 + 0.6 * d * load);
                    let second = 0.45 * d * (2.0 * a + q).sin();
                    to.flanks[0] += sized * ((a + p).sin() + second);
                    to.flanks[1] += sized * ((1.0 - 0.4 * d) * (a + p + 0.8).sin() + second);
                }
                // A tooth that broke gives way under load, as the others carry what was its part.
                Cause::DamagedTooth => {
                    let wheel = if one.shape[1] < 0.5 { flexspline } else { circular };
                    for zone in 0..2 {
                        let a = near_zero(place(wheel, zone) - p);
                        let width = 0.26 * (1.0 + 0.5 * d * load);
                        let plain = if a.abs() < width { (FRAC_PI_2 * a / width).cos().powi(2) } else { 0.0 };
                        let torn = if a < 0.0 { (1.0 + a / 0.1).max(0.0) } else { (-a / (0.8 * width)).exp() };
                        let burr = 0.25 * (-((a + 0.35) / 0.1).powi(2)).exp();
                        let given = size * (((1.0 - d) * plain + d * torn) * load - d * burr);
                        if one.shape[2] < 0.67 {
                            to.flanks[0] += given;
                        }
                        if one.shape[2] > 0.33 {
                            to.flanks[1] -= given;
                        }
                    }
                }
                Cause::BacklashGrowth => {
                    let sector = 1.0 + 0.4 * d * (2.0 * circular + p).sin() - 0.3 * d * load;
                    to.wider(size * (0.5 + 0.25 * d) * sector, size * (0.5 - 0.25 * d) * sector);
                }
                // From even to late: a dry film that fails.
                Cause::Wear => {
                    let late = ease((now.path - 0.35) / 0.65);
                    let grown = size * ((1.0 - d) * now.path + d * late) * (1.0 + 0.4 * d * (2.0 * circular + p).sin());
                    to.wider(grown * (0.5 + 0.2 * d), grown * (0.5 - 0.2 * d));
                }
                // From the gear's own temperature to its gradient against the housing, and bent.
                Cause::ThermalClearance => {
                    let warmer = now.gear_c - 20.0;
                    let bent = warmer + 1.5 * (now.gear_c - now.housing_c) + warmer * warmer / 90.0;
                    let more = size * ((1.0 - d) * warmer + d * bent);
                    to.wider(more * (0.5 + 0.15 * d), more * (0.5 - 0.15 * d));
                }
                // Newton with an exponential, to Palmgren's power with a steeper one.
                Cause::LubricantViscosity => {
                    let speed = now.output_rad_s * self.drive.ratio().abs() / DRAG_AT_RAD_S;
                    let thick = (-(0.03 + 0.015 * d) * (now.gear_c - 20.0)).exp().min(5.0);
                    let power = 1.0 - d / 3.0;
                    let flow = speed * speed.hypot(0.08).powf(power - 1.0);
                    to.unseen_n_m -= size * thick.powf(power) * flow.clamp(-2.0, 2.0);
                }
                // A boom that sags: half of its torque comes again at twice the angle.
                Cause::GravityTorque => {
                    let a = now.output_rad + now.orientation_rad + p;
                    to.unseen_n_m += size * (a.sin() + 0.4 * d * (2.0 * a + q).sin());
                }
                Cause::GravitySideLoad => {
                    for zone in 0..2 {
                        let a = place(now.generator_rad + now.orientation_rad, zone) - p;
                        let sized = size * (1.0 - 0.4 * d * load);
                        to.displaced(zone, sized, a, PRESSURE_RAD);
                        to.both(zone, 0.3 * d * size * (2.0 * a + q).sin());
                    }
                }
                // A waveguide on its bracket before the sensor; further off a second mode, damped more as it swings.
                Cause::TorsionalResonance => {
                    let frequency = TAU * 2.5 * 2.6_f64.powf(one.shape[0]);
                    let damping = 0.01 + 0.04 * one.shape[1];
                    for (mode, share) in [(0, 1.0), (1, 0.5 * d)] {
                        let w = frequency * if mode == 0 { 1.0 } else { 1.8 };
                        let (at, speed) = (memory[2 * mode], memory[2 * mode + 1]);
                        let damped = 2.0 * damping * (1.0 + 2.0 * d * (at / 20.0).abs().min(3.0)) * w * speed;
                        let back = w * w * at + damped;
                        memory[2 * mode + 1] -= dt * (now.output_arcsec_s2 + back);
                        memory[2 * mode] += dt * memory[2 * mode + 1];
                        to.unseen_n_m += share * size * now.inertia_kg_m2 * back / ARCSEC;
                    }
                }
                Cause::OutputEncoderEccentricity => {
                    let a = now.output_rad;
                    let higher = 0.35 * (2.0 * a + q).sin() + 0.15 * (3.0 * a + r).sin();
                    to.output_arcsec += size * ((a + p).sin() + d * higher);
                }
                Cause::GeneratorEncoderEccentricity => {
                    let a = now.generator_rad;
                    let higher = 0.35 * (2.0 * a + q).sin() + 0.15 * (3.0 * a + r).sin();
                    to.generator_arcsec += size * ((a + p).sin() + d * higher);
                }
                // Two free clocks: the age of a reading runs up and falls back.
                Cause::SensorLatency => {
                    let beat = (now.time_s / (8.0 + 10.0 * one.shape[0])).fract() - 0.5;
                    to.delay_s += size * (1.0 + 1.2 * d * beat);
                }
                // A belt after the motor's encoder, which creeps under load.
                Cause::RatioError => {
                    memory[0] += size * (1.0 + 0.6 * d * now.load) * now.moved_rad / self.drive.ratio() * ARCSEC;
                    to.wider(memory[0], -memory[0]);
                }
                Cause::Ratcheting => {
                    let slipped = slip(one, d, 0.35, now, memory);
                    let pitch = TAU / self.drive.output_teeth() * ARCSEC;
                    to.wider(slipped * pitch, -slipped * pitch);
                }
                Cause::StiffnessError
                | Cause::StiffnessHardening
                | Cause::TorsionalHysteresis
                | Cause::ThermalStiffness => {}
            },
            Thing::Stranger(stranger) => match stranger {
                // A bundle of cables that snaps over, and back at another angle.
                Stranger::HarnessSnap => {
                    let s = (2.5 * now.output_rad + p).sin();
                    if s.abs() > 0.5 {
                        memory[0] = s.signum();
                    }
                    memory[1] += (memory[0] - memory[1]) * dt / 0.15;
                    to.unseen_n_m += size * memory[1] * self.drive.first_stiffness() / ARCSEC;
                }
                // A lamp behind a shutter warms one side of the encoder's mount.
                Stranger::SunOnMount => {
                    let lit = (TAU * now.time_s / (90.0 + 110.0 * one.shape[1]) + p).sin() > -0.2;
                    memory[0] += (f64::from(u8::from(lit)) - memory[0]) * dt / 25.0;
                    to.output_arcsec += 2.0 * size * memory[0];
                }
                // A reaction wheel that runs up and down.
                Stranger::WheelHum => {
                    memory[0] += TAU * dt * (5.0 + 3.0 * (TAU * now.time_s / 97.0 + p).sin());
                    to.output_arcsec += 1.4 * size * memory[0].sin();
                }
                // The mount creeps after each pause.
                Stranger::MountSettles => {
                    let way = ((now.time_s - now.since_s) * 0.731 + p).sin();
                    to.output_arcsec += 3.0 * size * way * (-now.since_s.max(0.0) / (15.0 + 30.0 * one.shape[1])).exp();
                }
                _ => {}
            },
        }
    }
}

/// Wind-up that a spring of this factor of stiffness takes off `own`; the factor and its slope are functions of the
/// wind-up over that at the rated load.
pub(super) fn hardened(own: f64, rated: f64, stiffer: impl Fn(f64) -> (f64, f64)) -> f64 {
    let mut at = own.abs() / stiffer(own.abs() / rated).0.sqrt();
    for _ in 0..8 {
        let (factor, slope) = stiffer(at / rated);
        at -= (at * factor - own.abs()) / (factor + at / rated * slope);
    }
    (at - own.abs()).copysign(own)
}

/// Cumulative pitch error of size one: from a second order that leads to all orders as 1/k.
fn pitch(a: f64, one: &Hides) -> f64 {
    let d = one.shape[3];
    let led = (2.0 * a + one.phase(0)).sin() + 0.3 * (a + one.phase(1)).sin() + 0.15 * (4.0 * a + one.phase(2)).sin();
    if d == 0.0 {
        return led;
    }
    let every = |k: f64| (k * a + one.phase(0) + k * k * one.phase(1)).sin() / k;
    (1.0 - d) * led + d * 1.3 * (1..=5).map(|k| every(f64::from(k))).sum::<f64>()
}

/// Teeth slipped with the load, one in all: in one event, or the second lobe some seconds after the first.
pub(super) fn slip(one: &Hides, d: f64, least_load: f64, now: &Now, memory: &mut Memory) -> f64 {
    let events = if d < 0.5 { 1.0 } else { 2.0 };
    let pause_s = 4.0 + 16.0 * one.shape[1];
    let waited = memory[0] < 0.5 || now.time_s > memory[1] + pause_s;
    let due = memory[0] < events && waited && now.done > 0.25 + 0.5 * one.shape[0];
    // The second lobe follows the first.
    let same = memory[0] < 0.5 || now.load * memory[2] > 0.0;
    if due && same && now.load.abs() > least_load {
        memory[0] += 1.0;
        memory[1] = now.time_s;
        memory[2] = now.load.signum();
    }
    let whole = (memory[0] - 1.0).max(0.0);
    let part = if memory[0] > 0.5 { ease((now.time_s - memory[1]) / 0.3) } else { 0.0 };
    memory[2] * (whole + part) / events
}
