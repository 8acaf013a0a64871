//! The same drive with a load that has inertia: what the tables, which are quasi-static, leave out.
//!
//! `J·δ̈ = T − F − c·(δ̇ − ψ̇/N) ∓ d`: the torque on the load `T`, the flank torque `F` of the dense map at the output angle `δ`
//! (none inside the clearance), damping `c` while the flanks touch, and the Coulomb drag `d`. Integrated in steps much shorter
//! than a tick. The generator is felt through the servo: `F` over the ratio pulls at the motor.
//!
//! The controllers are told `T`, as an observer or a known load gives it, not `F`: a generator that gives way to the torque of the
//! flanks takes the stiffness from the drive, and with the bare reading of a sensor between drive and load core and table by torque
//! alike swing up to some 1500″ with this load.

use super::flight::Plant;
use super::flight::gear::{Gear, GearMap, Header};
use super::flight::profile::TICK_S;

/// Steps within a tick.
const STEPS: usize = 10;
/// Halvings in which the flank torque is found: a share of 1e-9.
const HALVINGS: usize = 30;

/// What hangs on the output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadSettings {
    /// Inertia, kg·m².
    pub inertia_kg_m2: f64,
    /// Damping of the twist while the flanks touch, N·m·s/rad.
    pub damping_n_m_s: f64,
}

/// A light dish.
pub const DISH: LoadSettings = LoadSettings { inertia_kg_m2: 3.0, damping_n_m_s: 60.0 };

/// A drive with an inert load.
#[derive(Clone, Debug)]
pub struct InertGear<'a> {
    gear: Gear<'a>,
    load: LoadSettings,
    generator_rad: f64,
    output_rad: f64,
    rate_rad_s: f64,
    flank_n_m: f64,
    torque_n_m: f64,
}

impl<'a> InertGear<'a> {
    /// At rest at zero.
    pub fn new(map: GearMap<'a>, temperature_c: f64, load: LoadSettings) -> Self {
        let gear = Gear::new(map, temperature_c);
        Self { gear, load, generator_rad: 0.0, output_rad: 0.0, rate_rad_s: 0.0, flank_n_m: 0.0, torque_n_m: 0.0 }
    }

    /// Flank torque that goes with an error of the output: the inverse of the map; none inside the clearance.
    fn flank(&self, generator_rad: f64, error_rad: f64) -> f64 {
        let largest = 1.2 * self.gear.map().header.largest_n_m;
        for sign in [1.0, -1.0] {
            let error =
                |share: f64| sign * self.gear.elastic_error_rad(generator_rad, sign * share.powi(4) * largest, sign);
            let size = sign * error_rad;
            if size <= error(0.0) {
                continue;
            }
            let (mut low, mut high) = (0.0, 1.0);
            let (mut below, mut above) = (error(low) - size, error(high) - size);
            if above <= 0.0 {
                return sign * largest;
            }
            // Regula falsi, the end that stays weighed half each time.
            let mut side = 0;
            for _ in 0..HALVINGS {
                let middle = (low * above - high * below) / (above - below);
                let found = error(middle) - size;
                if found.abs() < 1e-11 {
                    low = middle;
                    break;
                }
                if found < 0.0 {
                    (low, below) = (middle, found);
                    if side == -1 {
                        above *= 0.5;
                    }
                    side = -1;
                } else {
                    (high, above) = (middle, found);
                    if side == 1 {
                        below *= 0.5;
                    }
                    side = 1;
                }
            }
            return sign * low.powi(4) * largest;
        }
        0.0
    }
}

impl Plant for InertGear<'_> {
    fn go(&mut self, generator_rad: f64, torque_n_m: f64) -> f64 {
        let LoadSettings { inertia_kg_m2, damping_n_m_s } = self.load;
        let Header { ratio, drag_n_m: drag, .. } = self.gear.map().header;
        let dt = TICK_S / STEPS as f64;
        let (from, load_from) = (self.generator_rad, self.torque_n_m);
        let generator_rate = (generator_rad - from) / TICK_S;
        for step in 0..STEPS {
            let share = (step + 1) as f64 / STEPS as f64;
            let generator = from + share * (generator_rad - from);
            let load = load_from + share * (torque_n_m - load_from);
            self.flank_n_m = self.flank(generator, self.output_rad - generator / ratio);
            let touching = if self.flank_n_m == 0.0 { 0.0 } else { damping_n_m_s };
            // Damping implicit, drag at most what brings the load to rest.
            let push = load - self.flank_n_m + touching * generator_rate / ratio;
            let free = (self.rate_rad_s + push / inertia_kg_m2 * dt) / (1.0 + touching / inertia_kg_m2 * dt);
            let most = drag / inertia_kg_m2 * dt;
            self.rate_rad_s = if free.abs() <= most { 0.0 } else { free - most.copysign(free) };
            self.output_rad += self.rate_rad_s * dt;
        }
        (self.generator_rad, self.torque_n_m) = (generator_rad, torque_n_m);
        self.output_rad
    }

    fn carried_n_m(&self, _: f64) -> f64 {
        self.flank_n_m
    }

    fn set_temperature(&mut self, temperature_c: f64) {
        self.gear.set_temperature(temperature_c);
    }
}
