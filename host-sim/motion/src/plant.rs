//! Motor, drive and load in motion: a fixed step that keeps the books of energy to rounding.
//!
//! All at the output: `q` is generator/ratio and output. A step solves
//! ```text
//! q' = q + h·v,   J·(w' − w) = h·(τ − ∇̄V − friction),   v = (w + w')/2
//! ```
//! for the mean speed `v`. `∇̄V` is the slope at the middle, corrected so that its product with the way is the change
//! of energy (the discrete gradient of O. Gonzalez, "Time integration and discrete Hamiltonian systems", J. Nonlinear
//! Sci. 6, 1996): what is stored never drifts, whatever the step, and contact comes without an impact. Friction acts on
//! `v`, and holds fast where nothing overcomes it. The equations are solved by repetition. By itself that shrinks the
//! error by `(h·ω/2)²` each time, with the fastest resonance `ω`; with the spring between motor and load taken along to
//! first order what is left is how much that spring changes over the step.

use super::friction::Friction;
use super::gear::{Gear, Meshed, Near};
use super::servo::{Servo, ServoCommand, ServoSettings};

/// Coordinates: motor, load.
pub const PARTS: usize = 2;
/// Most repetitions in a step; four are usual.
const REPETITIONS: usize = 40;
/// Repetitions after which the spring is no longer taken along: where flanks touch and part in one step the plain
/// repetition ends surely.
const TAKEN_ALONG: usize = 8;
/// Two speeds are the same if they differ by no more than this part of themselves, and this much, rad/s.
const SAME: [f64; 2] = [1e-11, 1e-16];
/// Over shorter ways than this the slope at the middle is exact to rounding, rad.
const SHORT_RAD: f64 = 1e-9;

/// Parameters of the plant; all at the output.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantSettings {
    /// Motor and generator times the square of the ratio, kg·m².
    pub motor_kg_m2: f64,
    /// Load, kg·m².
    pub load_kg_m2: f64,
    /// The drive.
    pub gear: Gear,
    /// Damping of the twist as a time, s: damping is this times the stiffness that the mesh has, so none where flanks
    /// do not touch.
    pub damping_s: f64,
    /// Friction on the motor's side.
    pub friction: Friction,
    /// Coulomb drag of the output's bearing and seal, N·m.
    pub drag_n_m: f64,
    /// Weight times arm of the load, N·m, and the output angle at which it pulls forward most, rad.
    pub gravity: [f64; 2],
}

/// Energies since the start, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Put in by the motor.
    pub motor: f64,
    /// Put in by wind, gravity and the like.
    pub outside: f64,
    /// Turned into heat.
    pub heat: f64,
}

/// A plant in motion.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPlant {
    /// Its parameters.
    pub settings: PlantSettings,
    /// Angles, rad.
    pub angle_rad: [f64; PARTS],
    /// Speeds, rad/s.
    pub rate_rad_s: [f64; PARTS],
    /// Energies since the start.
    pub energy: Energy,
    /// Factor of the cold on the friction.
    cold: f64,
    /// Torques of the drive now.
    pub meshed: Meshed,
    middle: Meshed,
    /// Where the step began.
    near: Near,
    /// Mean speeds of the last step, for a first guess.
    mean: [f64; PARTS],
    before: [f64; PARTS],
}

impl JointPlant {
    /// At rest with all angles zero.
    pub fn new(settings: PlantSettings, temperature_c: f64) -> Self {
        let meshed = settings.gear.at(0.0, 0.0);
        Self {
            cold: settings.friction.cold(temperature_c),
            meshed,
            middle: meshed,
            near: Near::default(),
            settings,
            angle_rad: [0.0; PARTS],
            rate_rad_s: [0.0; PARTS],
            energy: Energy::default(),
            mean: [0.0; PARTS],
            before: [0.0; PARTS],
        }
    }

    /// Elsewhere, with other speeds; nothing else changes.
    pub fn set_motion(&mut self, angle_rad: [f64; PARTS], rate_rad_s: [f64; PARTS]) {
        (self.angle_rad, self.rate_rad_s) = (angle_rad, rate_rad_s);
        self.meshed = self.settings.gear.at(angle_rad[0], angle_rad[1]);
        (self.mean, self.before) = (rate_rad_s, rate_rad_s);
    }

    /// Another temperature of the lubricant, °C.
    pub fn set_temperature(&mut self, temperature_c: f64) {
        self.cold = self.settings.friction.cold(temperature_c);
    }

    /// One tick of the servo: the current is set, and the plant goes on under a torque from outside.
    pub fn go(&mut self, servo: &mut Servo, asked: &ServoCommand, outside_n_m: impl Fn(f64) -> f64) {
        let ServoSettings { tick_s, steps, late_steps, .. } = servo.settings;
        servo.control(asked);
        let step_s = tick_s / steps as f64;
        for step in 0..steps {
            if step == late_steps {
                servo.give();
            }
            self.step(step_s, servo.motor_n_m() * servo.ratio, outside_n_m((step as f64 + 0.5) * step_s));
        }
    }

    /// Torque in the mesh now, N·m.
    pub fn mesh_n_m(&self) -> f64 {
        self.meshed.torque_n_m
    }

    /// Energy that can come back, J: of motion and in the mesh.
    pub fn stored_j(&self) -> f64 {
        let moving: f64 = self.inertias().iter().zip(&self.rate_rad_s).map(|(j, w)| 0.5 * j * w * w).sum();
        moving + self.meshed.energy_j
    }

    fn inertias(&self) -> [f64; PARTS] {
        [self.settings.motor_kg_m2, self.settings.load_kg_m2]
    }

    /// One step: motor torque times ratio, and torque on the load from outside but for gravity, N·m.
    pub fn step(&mut self, step_s: f64, motor_n_m: f64, outside_n_m: f64) {
        let h = step_s;
        let inertias = self.inertias();
        let start = self.angle_rad;
        // As in the step before, and as much more as then.
        let mut mean: [f64; PARTS] = core::array::from_fn(|k| 2.0 * self.mean[k] - self.before[k]);
        let mut end = self.meshed;
        let mut loss = 0.0;
        let mut outside = 0.0;
        // As fast as in the step before. With as much in the mesh as in that, its friction would come late, and pull a
        // joint that gives way to its load on.
        let [idle, by_load] = self.settings.friction.parts(self.mean[0]).map(|part| self.cold * part);
        self.settings.gear.nearby(&mut self.near, start[0], start[1]);
        for repetition in 0..REPETITIONS {
            let way: [f64; PARTS] = core::array::from_fn(|k| h * mean[k]);
            let gear = &self.settings.gear;
            end = gear.at_near(&self.near, way[0], way[1]);
            self.middle = gear.at_near(&self.near, 0.5 * way[0], 0.5 * way[1]);
            let mut push = [motor_n_m, 0.0];
            let twist_by = self.sloped(&end, &way, &mut push);
            let lost = self.damped(&twist_by, &end, h, &mut push);
            let [weight_n_m, most_at] = self.settings.gravity;
            outside = outside_n_m + weight_n_m * libm::cos(start[1] + 0.5 * way[1] - most_at);
            push[1] += outside;
            let rubbing = idle + by_load * self.middle.torque_n_m.abs();
            let (next, heat) = self.rubbed(h, &inertias, &push, rubbing);
            loss = lost + heat;
            let same = (0..PARTS).all(|k| (next[k] - mean[k]).abs() <= SAME[0] * next[k].abs() + SAME[1]);
            let corrected =
                if same || repetition >= TAKEN_ALONG { next } else { self.taken_along(h, &mean, next, &twist_by) };
            mean = corrected;
            if same {
                break;
            }
        }
        let way: [f64; PARTS] = core::array::from_fn(|k| h * mean[k]);
        for k in 0..PARTS {
            let rate = self.rate_rad_s[k];
            // What friction holds has stopped: else its speed would turn over in each step, and nothing would move.
            let held = mean[k] == 0.0;
            self.rate_rad_s[k] = if held { 0.0 } else { 2.0 * mean[k] - rate };
            loss += if held { 0.5 * inertias[k] * rate * rate } else { 0.0 };
        }
        self.energy.motor += motor_n_m * way[0];
        self.energy.outside += outside * way[1];
        self.energy.heat += loss;
        self.angle_rad = core::array::from_fn(|k| start[k] + way[k]);
        (self.before, self.mean) = (self.mean, mean);
        self.meshed = end;
    }

    /// Takes the slopes of the energy off the push; gives those of the twist, so corrected that their product with the
    /// way is its change.
    fn sloped(&self, end: &Meshed, way: &[f64; PARTS], push: &mut [f64; PARTS]) -> [f64; 2] {
        let Meshed { mut energy_by, mut twist_by, .. } = self.middle;
        let square = way[0] * way[0] + way[1] * way[1];
        if square > SHORT_RAD * SHORT_RAD {
            let missed = |total: f64, by: &[f64; 2]| (total - by[0] * way[0] - by[1] * way[1]) / square;
            let energy = missed(end.energy_j - self.meshed.energy_j, &energy_by);
            let twist = missed(end.twist_rad - self.meshed.twist_rad, &twist_by);
            for k in 0..2 {
                energy_by[k] += energy * way[k];
                twist_by[k] += twist * way[k];
            }
        }
        push[0] -= energy_by[0];
        push[1] -= energy_by[1];
        twist_by
    }

    /// Damping of the twist; gives the heat.
    fn damped(&self, twist_by: &[f64; 2], end: &Meshed, h: f64, push: &mut [f64; PARTS]) -> f64 {
        let twisted = end.twist_rad - self.meshed.twist_rad;
        let across = self.settings.damping_s * self.middle.stiffness * twisted / h;
        push[0] -= across * twist_by[0];
        push[1] -= across * twist_by[1];
        across * twisted
    }

    /// The mean speed that the next repetition begins with: where this one would go on to, if the spring between motor
    /// and load were straight.
    ///
    /// A repetition `G` turns what `mean` is off by, across the twist `t`, into `A = −h/2·J⁻¹·K·(h/2 + damping)·t·tᵀ`
    /// of it; the solution is `mean + (1 − A)⁻¹·(G − mean)`. What friction holds does not move.
    fn taken_along(&self, h: f64, mean: &[f64; PARTS], next: [f64; PARTS], twist_by: &[f64; 2]) -> [f64; PARTS] {
        let PlantSettings { motor_kg_m2, load_kg_m2, damping_s, .. } = &self.settings;
        let moves = |k: usize, inertia: f64| if next[k] == 0.0 { 0.0 } else { 0.5 * h / inertia * twist_by[k] };
        let lever = [moves(0, *motor_kg_m2), moves(1, *load_kg_m2)];
        let stiff = self.middle.stiffness * (0.5 * h + damping_s);
        let off = twist_by[0] * (next[0] - mean[0]) + twist_by[1] * (next[1] - mean[1]);
        let across = stiff * off / (1.0 + stiff * (lever[0] * twist_by[0] + lever[1] * twist_by[1]));
        [next[0] - lever[0] * across, next[1] - lever[1] * across]
    }

    /// The mean speed that the push gives against friction, and the heat of it.
    fn rubbed(&self, h: f64, inertias: &[f64; PARTS], push: &[f64; PARTS], rubbing_n_m: f64) -> ([f64; PARTS], f64) {
        let PlantSettings { friction, drag_n_m, .. } = &self.settings;
        let rubbing = [rubbing_n_m, *drag_n_m];
        let viscous = [self.cold * friction.viscous_n_m_s, 0.0];
        let mut heat = 0.0;
        let next = core::array::from_fn(|k| {
            let half = 0.5 * h / inertias[k];
            let free = self.rate_rad_s[k] + half * push[k];
            let held = half * rubbing[k];
            let slower = if free.abs() <= held { 0.0 } else { free - libm::copysign(held, free) };
            let mean = slower / (1.0 + half * viscous[k]);
            heat += h * mean * (libm::copysign(rubbing[k], mean) + viscous[k] * mean);
            mean
        });
        (next, heat)
    }
}
