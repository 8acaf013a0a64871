//! Family F: an acceptance rig. A motor with its servo turns the generator, a load motor behind a torque sensor turns
//! against the output, and a bus polls counts of both encoders. It runs what such rigs run: once around and back under
//! a small load, torque ramps at rest, speeds up and down, moves from point to point.
//!
//! Nothing of the gear is taken from the other families. Two zones of teeth, half a turn of the generator apart, each
//! with limits of its own; the torque of a zone is `c (y + y² / d)` of what its teeth are pressed in by `y`, as more of
//! them meet under load, so the two share in closed form. What is not told by the limits is the wind-up of the
//! catalogue. With ψ generator, θ output, T torque of the gear: `J_m ψ'' = τ + T dp/dψ - friction(ψ')`,
//! `J_l θ'' = load - T - friction(θ')`, `θ = R(T, ψ) + wind-up(T)`; below the friction of the hub R stays where it is
//! within the limits. Both frictions are Stribeck's. Semi-implicit Euler for the inertias, a secant for T.

use std::f64::consts::{PI, TAU};

use super::hides::{Hides, Stranger, Thing};
use crate::ARCSEC;
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::{Drive, Fixed, Unit};
use crate::motion::Motion;
use crate::plant::Readings;
use crate::teeth::wrapped;

/// Step of the integration, s.
pub const STEP_S: f64 = 2.5e-4;
/// Angle between flank and radius, rad: 25°.
const FLANK_RAD: f64 = 0.436;

/// What one session runs.
#[derive(Debug, Clone)]
enum Test {
    /// Once on and once back at a speed (rad/s of the generator) under one load, as a share of the rated one.
    Accuracy { speed: f64, load: f64 },
    /// Stops at places and ramps of the load, up and down within so many seconds, to this share.
    Torsion { ramp_s: f64, load: f64, step_rad: f64 },
    /// Speeds on and back, and steps of the load drawn from this stream.
    Speeds { speeds: [f64; 3], stream: u64 },
    /// Moves on and back with stops between; the load swings.
    Points { speed: f64, move_s: f64, stop_s: f64, load: f64, swing_s: f64 },
}

#[derive(Debug, Clone)]
struct Session {
    test: Test,
    seconds: f64,
    gap_s: f64,
    /// Room, and what the losses warm the drive by.
    room_c: f64,
    rise_c: f64,
    orientation_rad: f64,
}

/// A drive on its rig.
#[derive(Debug, Clone)]
pub struct Rig {
    sessions: Vec<Session>,
    row_s: f64,
    /// Scatter of the instants at which the bus reads, rms, s.
    pub jitter_s: f64,
    /// How late a row is, rms, s; its stamp tells.
    late_s: f64,
    motor: f64,
    load: f64,
    /// Dry friction and its extra at rest, N m, and viscous friction, N m s.
    motor_friction: [f64; 3],
    load_friction: [f64; 3],
    band: f64,
    /// Share of the teeth in the wind-up, and the torque at which they are twice as stiff, as a share of the rated one.
    teeth: (f64, f64),
    warms_s: f64,
    orientation_known: bool,
    polls: u64,
}

impl Rig {
    /// Draws one for this drive.
    pub fn draw(drive: &Drive, chance: &mut Chance) -> Self {
        let rate_hz = *chance.of(&[125.0, 160.0, 200.0]);
        let count = 4 + chance.below(2);
        let ratio = drive.ratio().abs();
        let climate = chance.one_in(0.6);
        let mut rooms: Vec<f64> = (0..count)
            .map(|at| if climate { -10.0 + 50.0 * (at as f64 + 0.5) / count as f64 } else { 21.0 })
            .map(|c| c + chance.uniform(-2.0, 2.0))
            .collect();
        chance.shuffle(&mut rooms);
        let turned = chance.one_in(0.4);
        let mut kinds = [0, 1, 2, 3, 0];
        chance.shuffle(&mut kinds[..4]);
        let sessions = (0..count)
            .map(|at| {
                let seconds = chance.uniform(34.0, 44.0);
                // Six tenths of an output turn in each way.
                let around = 0.6 * TAU * ratio / (0.5 * seconds);
                let test = match kinds[at] {
                    0 => Test::Accuracy { speed: around, load: chance.sign() * chance.uniform(0.1, 0.35) },
                    1 => Test::Torsion {
                        ramp_s: chance.uniform(2.5, 5.0),
                        load: chance.uniform(0.7, 1.0),
                        step_rad: chance.uniform(0.6, 9.0),
                    },
                    2 => Test::Speeds {
                        speeds: [chance.uniform(0.5, 2.0), chance.uniform(4.0, 9.0), chance.uniform(14.0, 24.0)],
                        stream: chance.number(),
                    },
                    _ => Test::Points {
                        speed: chance.uniform(6.0, 18.0),
                        move_s: chance.uniform(0.6, 1.5),
                        stop_s: chance.uniform(0.3, 0.8),
                        load: chance.uniform(0.4, 0.8),
                        swing_s: chance.uniform(6.0, 14.0),
                    },
                };
                Session {
                    test,
                    seconds,
                    gap_s: chance.log_uniform(60.0, 3000.0).round(),
                    room_c: rooms[at],
                    rise_c: chance.uniform(2.0, 9.0),
                    orientation_rad: if turned { 0.5 * PI * (at % 4) as f64 } else { 0.0 },
                }
            })
            .collect();
        let mode = TAU * chance.log_uniform(16.0, 34.0);
        let stiffness = drive.first_stiffness();
        let load = stiffness / (mode * mode);
        let dry = chance.uniform(0.02, 0.05) * drive.rated_n_m / ratio;
        let bearing = chance.uniform(0.004, 0.012) * drive.rated_n_m;
        Self {
            sessions,
            row_s: 1.0 / rate_hz,
            jitter_s: chance.log_uniform(2e-6, 2e-5),
            late_s: chance.log_uniform(1e-5, 2e-4),
            motor: chance.uniform(0.5, 2.0) * load / (ratio * ratio),
            load,
            motor_friction: [dry, 0.4 * dry, dry / chance.uniform(15.0, 50.0)],
            load_friction: [bearing, 0.3 * bearing, 0.06 * stiffness / mode],
            band: TAU * chance.uniform(10.0, 22.0),
            teeth: (chance.uniform(0.15, 0.3), chance.uniform(0.3, 1.0)),
            warms_s: chance.uniform(15.0, 60.0),
            orientation_known: turned || chance.one_in(0.5),
            polls: chance.number(),
        }
    }

    /// What the encoders read, without noise, and what the torque sensor and the thermometer tell.
    pub fn run(&self, drive: &Drive, unit: &Unit, hidden: &[Hides]) -> (Motion, Readings) {
        let mut train = Train::new(self, drive, unit, hidden);
        let mut log = Log::new(self);
        let mut state = State::default();
        let mut command_rad = 0.0;
        let all_s: f64 = self.sessions.iter().map(|session| session.seconds).sum();
        let (mut start_s, mut before_s) = (0.0, 0.0);
        // Work of the load on the teeth that such a run does: what wear is told by.
        let usual = 0.3 * drive.rated_n_m * self.sessions.iter().map(Session::path).sum::<f64>();
        let total = self.motor + self.load / drive.ratio().powi(2);
        for session in &self.sessions {
            let mut loads = Loads::new(session);
            let (mut speed, mut wanted_n_m, mut integral) = (0.0, 0.0, 0.0);
            log.begin(start_s);
            for at in 0..(session.seconds / STEP_S) as usize {
                let t = at as f64 * STEP_S;
                // Setpoints as a controller limits them: 60 rad/s², and the load within 80 ms.
                speed += (session.speed(t) - speed).clamp(-60.0 * STEP_S, 60.0 * STEP_S);
                command_rad += speed * STEP_S;
                wanted_n_m += (loads.share(t) * drive.rated_n_m - wanted_n_m) * STEP_S / 0.08;
                train.now.done = (before_s + t) / all_s;
                train.now.temperature_c = session.room_c + session.rise_c * (1.0 - (-t / self.warms_s).exp());
                train.now.metal_c = session.room_c + session.rise_c * (1.0 - (-t / (2.5 * self.warms_s)).exp());
                train.now.worn = state.work / usual;
                train.now.orientation_rad = session.orientation_rad;

                let spring = train.spring(&mut state);
                let sensor = spring - train.unseen(&mut state);
                log.trace.push(train.seen(&mut state, sensor));
                let speed_off = 0.25 * self.band * (command_rad - state.generator_rad) + speed - state.motor_speed;
                integral += 0.25 * self.band * speed_off * STEP_S;
                let motor_n_m = total * self.band * (speed_off + integral);
                let back = if state.on_flank { spring * train.slope(state.generator_rad) } else { 0.0 };
                let motor_friction = stribeck(self.motor_friction, state.motor_speed, 0.05, 1.0);
                state.motor_speed += (motor_n_m + back - motor_friction) / self.motor * STEP_S;
                state.generator_rad += state.motor_speed * STEP_S;
                let before = state.output_speed;
                let load_friction = stribeck(self.load_friction, before, 2e-4, 5e-3);
                state.output_speed += (wanted_n_m - sensor - load_friction) / self.load * STEP_S;
                state.output_rad += state.output_speed * STEP_S;
                state.acceleration = (state.output_speed - before) / STEP_S;
                state.work += spring.abs() * state.motor_speed.abs() * STEP_S;
            }
            log.poll(&train, session, self);
            start_s += session.seconds + session.gap_s;
            before_s += session.seconds;
        }
        log.finish(self.orientation_known, drive.ratio())
    }
}

/// Dry friction, higher at rest, and viscous; smooth over `smooth` rad/s.
fn stribeck(friction: [f64; 3], speed: f64, smooth: f64, fades: f64) -> f64 {
    let [dry, at_rest, viscous] = friction;
    (dry + at_rest * (-(speed / fades).powi(2)).exp()) * (speed / smooth).tanh() + viscous * speed
}

impl Session {
    /// Speed of the generator that is asked for, rad/s.
    fn speed(&self, t: f64) -> f64 {
        match self.test {
            Test::Accuracy { speed, .. } => {
                if t < 0.5 * self.seconds {
                    speed
                } else {
                    -speed
                }
            }
            Test::Torsion { ramp_s, step_rad, .. } => {
                // Two ramps at a place, then on within half a second.
                let since = t % (2.0 * ramp_s + 0.5);
                if since < 2.0 * ramp_s { 0.0 } else { step_rad / 0.5 }
            }
            Test::Speeds { speeds, .. } => {
                let part = ((t / self.seconds * 6.0) as usize).min(5);
                speeds[part / 2] * [1.0, -1.0][part % 2]
            }
            Test::Points { speed, move_s, stop_s, .. } => {
                let cycle = t / (move_s + stop_s);
                let sense = if cycle as usize % 5 < 3 { 1.0 } else { -1.0 };
                if cycle.fract() * (move_s + stop_s) < move_s { sense * speed } else { 0.0 }
            }
        }
    }

    /// Path of the generator, rad.
    fn path(&self) -> f64 {
        (0..400).map(|at| self.speed(f64::from(at) / 400.0 * self.seconds).abs() * self.seconds / 400.0).sum()
    }
}

/// The load as a share of the rated one.
struct Loads<'a> {
    session: &'a Session,
    chance: Chance,
    until_s: f64,
    now: f64,
}

impl<'a> Loads<'a> {
    fn new(session: &'a Session) -> Self {
        let stream = if let Test::Speeds { stream, .. } = session.test { stream } else { 0 };
        Self { session, chance: Chance::new(stream, "rig load", 0), until_s: 0.0, now: 0.0 }
    }

    fn share(&mut self, t: f64) -> f64 {
        match self.session.test {
            Test::Accuracy { load, .. } => load,
            Test::Torsion { ramp_s, load, .. } => {
                let since = t % (2.0 * ramp_s + 0.5);
                if since < 2.0 * ramp_s { load * triangle(since / ramp_s) } else { 0.0 }
            }
            Test::Speeds { .. } => {
                if t >= self.until_s {
                    self.until_s = t + self.chance.uniform(1.5, 4.0);
                    self.now = self.chance.uniform(-0.8, 0.8);
                }
                self.now
            }
            Test::Points { load, swing_s, .. } => load * (TAU * t / swing_s).sin(),
        }
    }
}

/// 0, 1, 0, -1, 0 within a cycle.
fn triangle(cycles: f64) -> f64 {
    let x = (cycles + 0.75).rem_euclid(1.0);
    4.0 * (x - 0.5).abs() - 1.0
}

/// What the gear feels of its surroundings.
#[derive(Debug, Clone, Copy, Default)]
struct Now {
    /// Share of the run that is over.
    done: f64,
    /// Work on the teeth so far over that of such a run.
    worn: f64,
    temperature_c: f64,
    /// Of the metal that sets the clearance.
    metal_c: f64,
    orientation_rad: f64,
}

#[derive(Default)]
struct State {
    generator_rad: f64,
    motor_speed: f64,
    output_rad: f64,
    output_speed: f64,
    acceleration: f64,
    /// Place of the teeth beside the exact ratio, where the load holds them or friction does, arcsec.
    rest_arcsec: f64,
    on_flank: bool,
    torque_n_m: f64,
    /// Deflection that lags behind the load, arcsec.
    lag_arcsec: f64,
    /// Teeth climbed over so far, 0 to 1, and the way.
    climbed: (f64, f64),
    /// An arm on a soft bracket before the sensor: angle beside the output and its speed.
    arm: (f64, f64),
    /// What a clamp has slipped by, arcsec.
    slipped_arcsec: f64,
    /// Torque as a slow amplifier tells it, N m.
    told_n_m: f64,
    work: f64,
}

/// The gear, with what is hidden in it.
struct Train<'a> {
    drive: &'a Drive,
    hidden: &'a [Hides],
    profiles: Vec<Vec<f64>>,
    lines: Vec<(f64, f64, f64)>,
    half_arcsec: f64,
    friction_n_m: f64,
    stiffness: f64,
    /// Torque per arcsec of a zone that is just pressed, N m, and depth at which that has doubled, arcsec.
    zone: (f64, f64),
    ratio: f64,
    load: f64,
    now: Now,
}

const PROFILE: usize = 4096;

impl<'a> Train<'a> {
    fn new(rig: &Rig, drive: &'a Drive, unit: &'a Unit, hidden: &'a [Hides]) -> Self {
        let lines = drive.harmonics.iter().zip(&unit.harmonics);
        let (share, doubles) = rig.teeth;
        let press = 0.5 * drive.first_stiffness() / ARCSEC / share;
        let stiffness = hidden.iter().fold(unit.stiffness, |product, one| match one.thing {
            Thing::Cause(Cause::StiffnessError) => product * (1.0 + one.size),
            _ => product,
        });
        Self {
            drive,
            hidden,
            profiles: hidden.iter().map(profile).collect(),
            lines: lines.map(|(h, (scale, by))| (h.order, h.amplitude_arcsec * scale, h.phase_rad + by)).collect(),
            half_arcsec: 0.5 * drive.backlash_arcsec * unit.backlash,
            friction_n_m: drive.friction_torque_n_m * unit.friction,
            stiffness,
            zone: (press, doubles * drive.rated_n_m / (2.0 * press)),
            ratio: drive.ratio(),
            load: rig.load,
            now: Now::default(),
        }
    }

    /// Output over generator, of the teeth.
    fn slope(&self, generator_rad: f64) -> f64 {
        let lines = self.lines.iter().map(|(order, a, phase)| a * order * (order * generator_rad + phase).cos());
        1.0 / self.ratio + lines.sum::<f64>() / ARCSEC
    }

    /// Upper and lower limits of both zones beside the exact ratio, arcsec.
    fn limits(&self, state: &State) -> ([f64; 2], [f64; 2]) {
        let psi = state.generator_rad;
        let mut middle: f64 = self.lines.iter().map(|(order, a, phase)| a * (order * psi + phase).sin()).sum();
        let mut half = self.half_arcsec;
        // Of each zone: turned, and moved out of mesh.
        let (mut turned, mut out) = ([0.0; 2], [0.0; 2]);
        let mut retreat = ([0.0; 2], [0.0; 2]);
        let (on_flexspline, on_circular, side) = match self.drive.fixed {
            Fixed::Flexspline => (psi, psi - state.output_rad, 1.0),
            Fixed::CircularSpline => (psi - state.output_rad, psi, -1.0),
        };
        let angle = |x: f64, zone: usize| x + PI * zone as f64;
        let rated = self.drive.rated_n_m;
        let loaded = (state.torque_n_m / rated).abs();
        for (one, profile) in self.hidden.iter().zip(&self.profiles) {
            let Thing::Cause(cause) = one.thing else { continue };
            let (size, phase) = (one.size, one.phase(0));
            match cause {
                // An axis beside the other: each zone is turned by the part along the flank's motion and opened by the
                // other.
                Cause::CircularSplineEccentricity | Cause::FlexsplineRunout | Cause::GravitySideLoad => {
                    let x = match cause {
                        Cause::FlexsplineRunout => on_flexspline,
                        Cause::GravitySideLoad => psi + self.now.orientation_rad,
                        _ => on_circular,
                    } - phase;
                    for zone in 0..2 {
                        turned[zone] += size * FLANK_RAD.cos() * angle(x, zone).sin();
                        out[zone] += side * size * FLANK_RAD.sin() * angle(x, zone).cos();
                    }
                }
                // A ring that three jaws hold: it bends without stretching, twice around and a little thrice.
                Cause::CircularSplineOvality => {
                    for zone in 0..2 {
                        for (order, share) in [(2.0, 1.0), (3.0, 0.15)] {
                            let x = order * angle(on_circular, zone) + phase * order / 2.0;
                            turned[zone] += size * share / order * x.sin();
                            out[zone] += size * share * FLANK_RAD.tan() * x.cos();
                        }
                    }
                }
                Cause::FlexsplinePitchError | Cause::CircularSplinePitchError => {
                    let x = if cause == Cause::FlexsplinePitchError { on_flexspline } else { on_circular };
                    let sign = if cause == Cause::FlexsplinePitchError { 1.0 } else { -1.0 };
                    for zone in 0..2 {
                        turned[zone] += sign * size * around(profile, angle(x, zone));
                    }
                }
                // One lobe is pressed deeper, and shows what each wheel has once around, which two lobes alike would
                // not.
                Cause::GeneratorEccentricity => {
                    for (zone, sign) in [1.0, -1.0].into_iter().enumerate() {
                        out[zone] -= sign * 0.8 * size;
                        let once = (0.2 + 0.5 * one.shape[2]) * (on_flexspline + phase).sin()
                            + (0.2 + 0.5 * one.shape[3]) * (on_circular + one.phase(1)).sin();
                        turned[zone] += sign * size * once;
                    }
                }
                Cause::CamFormError => {
                    middle += size / (1.0 + loaded) * (self.drive.mesh_order() * psi + phase).sin();
                    half += 0.6 * size;
                }
                // A tooth is broken off: where its zone meets it, that flank has to go on until others bear.
                Cause::DamagedTooth => {
                    let x = if one.shape[1] < 0.5 { on_flexspline } else { on_circular };
                    for zone in 0..2 {
                        let near = wrapped(angle(x, zone) - phase) / (0.25 + 0.2 * one.shape[3]);
                        let gone = size * (1.0 - near * near).max(0.0).powi(2);
                        let flank = if one.shape[2] < 0.5 { &mut retreat.0 } else { &mut retreat.1 };
                        flank[zone] += gone;
                        // The rim without its support gives way in the other zone as well.
                        flank[1 - zone] += 0.5 * gone * loaded.min(1.0);
                    }
                }
                Cause::BacklashGrowth => half += 0.5 * size,
                // Archard: as the work on the flanks.
                Cause::Wear => half += 0.5 * size * self.now.worn,
                Cause::ThermalClearance => half += 0.5 * size * (self.now.metal_c - 20.0),
                Cause::Ratcheting => {
                    middle += state.climbed.1 * state.climbed.0 * TAU / self.drive.output_teeth() * ARCSEC;
                }
                _ => {}
            }
        }
        let upper = [0, 1].map(|zone| middle + turned[zone] + half + out[zone] + retreat.0[zone]);
        let lower = [0, 1].map(|zone| middle + turned[zone] - half - out[zone] - retreat.1[zone]);
        (upper, lower)
    }

    /// Depth to which a torque presses two zones alike, arcsec of a drive of nominal stiffness.
    fn alike(&self, torque: f64) -> f64 {
        let (press, depth) = self.zone;
        0.5 * depth * ((1.0 + 2.0 * torque / (press * depth)).sqrt() - 1.0)
    }

    /// Where the teeth rest on two zones with these limits (of the flank towards which the torque, not below zero,
    /// turns), less what two zones alike would be pressed in by.
    fn rests(&self, limits: [f64; 2], torque: f64) -> f64 {
        let (press, depth) = self.zone;
        let first = limits[0].min(limits[1]);
        let gap = self.stiffness * (limits[0] - limits[1]).abs();
        let mut y = 0.5 * depth * ((1.0 + 4.0 * torque / (press * depth)).sqrt() - 1.0);
        if y > gap {
            let b = 1.0 - gap / depth;
            let c = 0.5 * (gap - gap * gap / depth + torque / press);
            y = 0.5 * depth * ((b * b + 4.0 * c / depth).sqrt() - b);
        }
        first + (y - self.alike(torque)) / self.stiffness
    }

    /// Wind-up of the catalogue under a torque, with what is hidden in it, arcsec.
    fn wind_up(&self, torque: f64, state: &State) -> f64 {
        let mut x = self.drive.wind_up_arcsec(torque) / self.stiffness;
        let loaded = (torque / self.drive.rated_n_m).abs();
        let mut lag = 0.0;
        for one in self.hidden {
            match one.thing {
                // Joints that seat themselves: the last is met at half of the rated load.
                Thing::Cause(Cause::StiffnessHardening) => x /= 1.0 + one.size * loaded / (loaded + 0.5),
                Thing::Cause(Cause::ThermalStiffness) => {
                    x /= (1.0 + one.size * (self.now.temperature_c - 20.0)).max(0.2)
                }
                Thing::Cause(Cause::TorsionalHysteresis) => lag = self.lag(one, torque, state),
                _ => {}
            }
        }
        x + lag
    }

    /// A deflection that nears its bound as an exponential of the path of the load (Duhem), sooner backwards than
    /// forwards.
    fn lag(&self, one: &Hides, torque: f64, state: &State) -> f64 {
        let by = torque - state.torque_n_m;
        let path = (0.15 + 0.25 * one.shape[0]) * self.drive.rated_n_m * if by > 0.0 { 1.0 } else { 0.8 };
        let bound = one.size.copysign(by);
        bound + (state.lag_arcsec - bound) * (-by.abs() / path).exp()
    }

    /// Torque in the gear at the output's place; moves the teeth in their clearance.
    fn spring(&self, state: &mut State) -> f64 {
        let aside = (state.output_rad - state.generator_rad / self.ratio) * ARCSEC;
        let (upper, lower) = self.limits(state);
        let friction = self.friction_n_m;
        let high = |torque: f64| self.rests(upper, torque);
        let low = |torque: f64| -self.rests(lower.map(|x| -x), torque);
        let (mut from, mut to) = (low(friction), high(friction));
        if from > to {
            (from, to) = (0.5 * (from + to), 0.5 * (from + to));
        }
        let free = state.rest_arcsec.clamp(from, to);
        let held = self.solve(state, |torque| free + self.wind_up(torque, state) - aside);
        // Pushed by the load, the teeth go on until friction holds it or a flank does.
        let (rest, torque) = if held.abs() <= friction {
            (free, held)
        } else {
            let way = held.signum();
            let reached = aside - self.wind_up(way * friction, state);
            if way * reached < way * if way > 0.0 { to } else { from } {
                (reached, way * friction)
            } else {
                let bound = |torque: f64| {
                    if way > 0.0 { high(torque.max(0.0)).max(from) } else { low((-torque).max(0.0)).min(to) }
                };
                let torque = self.solve(state, |torque| bound(torque) + self.wind_up(torque, state) - aside);
                (bound(torque), torque)
            }
        };
        state.on_flank = torque.abs() > friction || free != state.rest_arcsec;
        if let Some(one) = self.hidden.iter().find(|one| one.thing == Thing::Cause(Cause::TorsionalHysteresis)) {
            state.lag_arcsec = self.lag(one, torque, state);
        }
        state.rest_arcsec = rest;
        state.torque_n_m = torque;
        if let Some(one) = self.size_of(Cause::Ratcheting) {
            self.climb(one, state);
        }
        torque
    }

    /// A torque at which a rising function of it is zero, by secants from the last one.
    fn solve(&self, state: &State, off: impl Fn(f64) -> f64) -> f64 {
        let per_arcsec = self.drive.first_stiffness() * self.stiffness / ARCSEC;
        let (mut a, mut at_a) = (state.torque_n_m, off(state.torque_n_m));
        let mut b = a - at_a * per_arcsec;
        for _ in 0..30 {
            let at_b = off(b);
            if at_b.abs() < 1e-6 {
                break;
            }
            // What rises by less than a tenth or more than ten times the catalogue's is a corner: a step of the
            // catalogue's spring.
            let slope = if (b - a).abs() < 1e-12 { per_arcsec } else { (b - a) / (at_b - at_a) };
            let slope = if slope.is_finite() { slope.clamp(0.1 * per_arcsec, 10.0 * per_arcsec) } else { per_arcsec };
            (a, at_a) = (b, at_b);
            b -= at_b * slope;
        }
        b
    }

    /// Under more than half of the rated load, once the place drawn is reached, within 30 ms.
    fn climb(&self, one: &Hides, state: &mut State) {
        let (climbed, way) = state.climbed;
        let begins = self.now.done > 0.25 + 0.4 * one.shape[0] && state.torque_n_m.abs() > 0.5 * self.drive.rated_n_m;
        if climbed > 0.0 || begins {
            let way = if way == 0.0 { state.torque_n_m.signum() } else { way };
            state.climbed = ((climbed + STEP_S / 0.03).min(1.0), way);
        }
    }

    /// Torque on the flange before the sensor, that the sensor does not tell, N m.
    fn unseen(&self, state: &mut State) -> f64 {
        let mut sum = 0.0;
        for one in self.hidden {
            match one.thing {
                Thing::Cause(Cause::GravityTorque) => {
                    sum += one.size * (state.output_rad + self.now.orientation_rad + one.phase(0)).sin();
                }
                // A film of oil after Newton, thinner with temperature after Arrhenius.
                Thing::Cause(Cause::LubricantViscosity) => {
                    let warm = 1.0 / (273.15 + self.now.temperature_c) - 1.0 / 293.15;
                    let speed = self.ratio * state.output_speed / 12.0;
                    sum -= one.size * (3500.0 * warm).exp() * speed.abs().powf(0.85).copysign(state.output_speed);
                }
                // A cable that pulls once it is taut.
                Thing::Stranger(Stranger::CableSpring) => {
                    let from = wrapped(state.output_rad - one.phase(0));
                    let pull = self.drive.first_stiffness() * one.size / ARCSEC;
                    sum -= pull * (from.abs() - 0.4).max(0.0).copysign(from);
                }
                // An arm of that share of the load's inertia on a bracket, 6 to 14 Hz.
                Thing::Cause(Cause::TorsionalResonance) => {
                    let (turn, damping) = (TAU * (6.0 + 8.0 * one.shape[0]), 0.02 + 0.06 * one.shape[1]);
                    let pull = -turn * turn * state.arm.0 - 2.0 * damping * turn * state.arm.1;
                    state.arm.1 += (pull - state.acceleration) * STEP_S;
                    state.arm.0 += state.arm.1 * STEP_S;
                    sum -= 0.3 * one.size * self.load * pull;
                }
                _ => {}
            }
        }
        sum
    }

    /// Generator, output and torque at this instant as the sensors feel them.
    fn seen(&self, state: &mut State, mut sensor: f64) -> [f64; 3] {
        let rated = self.drive.rated_n_m;
        let mut output = state.output_rad;
        for one in self.hidden {
            match one.thing {
                Thing::Stranger(Stranger::TorqueFilter) => {
                    state.told_n_m += (sensor - state.told_n_m) * (STEP_S / (one.size * 1e-3)).min(1.0);
                    sensor = state.told_n_m;
                }
                Thing::Stranger(Stranger::SlippingClamp) => {
                    let beyond = (state.torque_n_m.abs() / rated - 0.4).max(0.0);
                    state.slipped_arcsec += one.size * beyond.copysign(state.torque_n_m) * STEP_S / 2.0;
                    output += state.slipped_arcsec / ARCSEC;
                }
                _ => {}
            }
        }
        [state.generator_rad, output, sensor]
    }

    /// Readings of the generator's and the output's encoder at these angles.
    fn readings(&self, generator_rad: f64, output_rad: f64) -> (f64, f64) {
        let (mut generator, mut output) = (generator_rad, output_rad);
        for one in self.hidden {
            let disc = |e: f64, angle: f64| (e * (angle + one.phase(0)).sin()).asin();
            match one.thing {
                Thing::Cause(Cause::OutputEncoderEccentricity) => output += disc(one.size / ARCSEC, output_rad),
                Thing::Cause(Cause::GeneratorEncoderEccentricity) => {
                    generator += disc(one.size / ARCSEC * self.ratio.abs(), generator_rad);
                }
                Thing::Cause(Cause::RatioError) => generator -= one.size * generator_rad,
                // The encoder is driven by a pinion of its own.
                Thing::Stranger(Stranger::EncoderGear) => {
                    let order = 2.6 + 2.1 * one.shape[1] + 0.017;
                    output += one.size / ARCSEC * (order * output_rad + one.phase(0)).sin();
                }
                _ => {}
            }
        }
        (generator, output)
    }

    fn size_of(&self, cause: Cause) -> Option<&Hides> {
        self.hidden.iter().find(|one| one.thing == Thing::Cause(cause))
    }
}

fn around(profile: &[f64], angle_rad: f64) -> f64 {
    let x = (angle_rad / TAU).rem_euclid(1.0) * PROFILE as f64;
    let (at, part) = (x as usize % PROFILE, x.fract());
    profile[at] + part * (profile[(at + 1) % PROFILE] - profile[at])
}

/// Teeth out of place around a wheel as a gear tester draws them: cumulative error that falls as the order, twice
/// around leading, and single teeth, averaged over the arc that is engaged with a cosine.
fn profile(one: &Hides) -> Vec<f64> {
    if !matches!(one.thing, Thing::Cause(Cause::FlexsplinePitchError | Cause::CircularSplinePitchError)) {
        return Vec::new();
    }
    let mut chance = Chance::new((1e9 * one.shape[1]) as u64, "rig teeth", 0);
    let orders: Vec<(f64, f64, f64)> = (1..=30)
        .map(|order| {
            let k = f64::from(order);
            let a = match order {
                1 => chance.uniform(0.3, 0.9),
                2 => 1.0,
                _ => 0.5 * chance.normal() / k,
            };
            // Mean of a cosine window of ±0.3 rad.
            let (w, q) = (0.3, PI / 0.6);
            let mean = if (k - q).abs() < 1e-9 { PI / 4.0 } else { (k * w).cos() * q * q / (q * q - k * k) };
            (k, a * mean, chance.phase())
        })
        .collect();
    let angle = |at: usize| TAU * at as f64 / PROFILE as f64;
    (0..PROFILE).map(|at| orders.iter().map(|(k, a, p)| a * (k * angle(at) + p).sin()).sum()).collect()
}

/// What the bus reads.
struct Log {
    /// Generator, output and torque at each step of the session.
    trace: Vec<[f64; 3]>,
    start_s: f64,
    chance: Chance,
    motion: Motion,
    generator: Vec<f64>,
    output: Vec<f64>,
}

impl Log {
    fn new(rig: &Rig) -> Self {
        Self {
            trace: Vec::new(),
            start_s: 0.0,
            chance: Chance::new(rig.polls, "rig poll", 0),
            motion: Motion { step_s: rig.row_s, stride: 1, ..Motion::default() },
            generator: Vec::new(),
            output: Vec::new(),
        }
    }

    fn begin(&mut self, start_s: f64) {
        self.start_s = start_s;
        self.trace.clear();
    }

    /// Reads the rows of the session that is over.
    fn poll(&mut self, train: &Train, session: &Session, rig: &Rig) {
        self.motion.session_start.push(self.motion.time_s.len());
        let delay_s = train.size_of(Cause::SensorLatency).map_or(0.0, |one| one.size);
        let trace = &self.trace;
        let at = |time_s: f64, channel: usize| {
            let x = (time_s / STEP_S).clamp(0.0, (trace.len() - 2) as f64);
            let (whole, part) = (x as usize, x.fract());
            trace[whole][channel] + part * (trace[whole + 1][channel] - trace[whole][channel])
        };
        let rows = ((session.seconds - 0.04) / rig.row_s) as usize;
        for row in 0..rows {
            let stamp = 0.02 + row as f64 * rig.row_s + rig.late_s * self.chance.normal().abs();
            let jitter = [(); 2].map(|()| (rig.jitter_s * self.chance.normal()).clamp(-1e-3, 1e-3));
            // Positive: the output's reading is old.
            let psi_s = stamp + jitter[0] - (-delay_s).max(0.0);
            let out_s = stamp + jitter[1] - delay_s.max(0.0);
            let (generator, output) = train.readings(at(psi_s, 0), at(out_s, 1));
            let warm = session.room_c + session.rise_c * (1.0 - (-stamp / rig.warms_s).exp());
            self.motion.time_s.push(self.start_s + stamp);
            self.motion.generator_rad.push(at(stamp, 0));
            self.motion.speed_rad_s.push((at(stamp + STEP_S, 0) - at(stamp - STEP_S, 0)) / (2.0 * STEP_S));
            self.motion.torque_n_m.push(at(psi_s, 2));
            self.motion.temperature_c.push(warm);
            self.motion.orientation_rad.push(session.orientation_rad);
            self.generator.push(generator);
            self.output.push(output);
        }
    }

    fn finish(mut self, orientation_known: bool, ratio: f64) -> (Motion, Readings) {
        self.motion.orientation_known = orientation_known;
        let error = self.generator.iter().zip(&self.output).map(|(psi, out)| (out - psi / ratio) * ARCSEC).collect();
        (self.motion, Readings { generator_rad: self.generator, output_rad: self.output, error_arcsec: error })
    }
}
