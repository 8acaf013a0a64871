//! Two inertias and the spring between them: what the table, which is quasi-static, leaves out.
//!
//! ```text
//! φ̇  = ω_l − ω_m                                     φ    twist: load ahead of the motor, rad
//! ω̇_m = (u + kφ + d(ω_l − ω_m))/J_m                  ω_m  motor speed over the ratio, ω_l load speed, rad/s
//! ω̇_l = (τ − kφ − d(ω_l − ω_m))/J_l                  u    motor torque times the ratio, τ torque on the load, N·m
//! τ̇  = 0
//! ```
//!
//! All at the output; angles do not occur, so nothing drifts and nothing wraps. [`Predictor::new`] discretises that exactly
//! over one tick, finds the gains of a stationary Kalman observer, both in double precision, and proves that the observer
//! contracts; it is meant for the host or for start-up, and [`Predictor::check`] proves it again for one that was made elsewhere.
//! [`Predictor::step`] is for every tick, with the motor's speed alone or with the twist measured too (output angle less nominal
//! less the error of the table). [`Predictor::ahead`] goes on without measurements.
//!
//! Not in here: friction, and the play, which belongs to the table.

#![allow(clippy::arithmetic_side_effects)] // Matrices of floating-point numbers: nothing overflows.

use core::fmt;
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Matrix4x2, Vector2, Vector4};

/// Two inertias, at the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertias {
    /// Motor, generator and what turns with them: their inertia times the square of the ratio, kg·m².
    pub motor_kg_m2: f64,
    /// Load, kg·m².
    pub load_kg_m2: f64,
    /// Torsional stiffness, N·m/rad: the slope of the wind-up.
    pub stiffness_n_m_per_rad: f64,
    /// Damping beside it, N·m·s/rad.
    pub damping_n_m_s_per_rad: f64,
}

/// How much of what is measured and assumed can be trusted: standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Motor torque at the output, N·m.
    pub torque_n_m: f64,
    /// Change of the torque on the load in a tick, N·m.
    pub load_change_n_m: f64,
    /// Motor speed over the ratio as measured in one tick, rad/s.
    pub speed_rad_s: f64,
    /// Twist as measured, rad; `None` without an encoder at the output.
    pub twist_rad: Option<f64>,
}

/// What was measured in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Motor torque times the ratio in the tick before, N·m.
    pub torque_n_m: f32,
    /// Motor speed over the ratio, rad/s.
    pub speed_rad_s: f32,
    /// Twist, rad: only used if the predictor was made with a noise for it.
    pub twist_rad: f32,
}

/// A predictor: all that does not change while it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predictor {
    a: Matrix4<f32>,
    b: Vector4<f32>,
    gain: Matrix4x2<f32>,
    tick_s: f32,
}

/// φ, ω_m, ω_l, τ as estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PredictorState {
    x: Vector4<f32>,
}

/// What the load will have done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ahead {
    /// Angle that the load turns until then, rad.
    pub load_rad: f32,
    /// Twist then, rad.
    pub twist_rad: f32,
    /// The angle lies within ± this, rad.
    pub bound_rad: f32,
}

/// Why there is no predictor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PredictorError {
    /// A number is not finite or not positive.
    Setting {
        /// Which.
        name: &'static str,
        /// Value found.
        found: f64,
    },
    /// The observer does not contract: its error after a thousand ticks, as a factor.
    Observer {
        /// Factor found; below 1 is needed.
        factor: f32,
    },
}

impl fmt::Display for PredictorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Setting { name, found } => write!(f, "{name} = {found}: must be finite and above zero"),
            Self::Observer { factor } => write!(f, "the observer's error grows to {factor} times in 1024 ticks"),
        }
    }
}

impl core::error::Error for PredictorError {}

/// Numbers of a predictor.
pub const PREDICTOR_PARTS: usize = 29;

/// Squarings of the observer's matrix that the proof takes: 1024 ticks.
const SQUARINGS: u32 = 10;
/// Ticks after which the gains of the observer stand.
const RICCATI_TICKS: u32 = 20_000;
/// Terms of the exponential series, after the time is halved until it is short.
const SERIES_TERMS: u32 = 12;

/// `exp(m)`, for matrices whose largest sum of a row is below 2¹⁵.
fn exponential(m: Matrix4<f64>) -> Matrix4<f64> {
    let mut halvings = 0u32;
    let mut small = m;
    while row_sum(&small) > 0.5 && halvings < 16 {
        small *= 0.5;
        halvings = halvings.saturating_add(1);
    }
    let (mut sum, mut term) = (Matrix4::identity(), Matrix4::identity());
    for n in 1..=SERIES_TERMS {
        term = term * small / n as f64;
        sum += term;
    }
    for _ in 0..halvings {
        sum *= sum;
    }
    sum
}

/// Largest sum of the magnitudes of a row.
fn row_sum(m: &Matrix4<f64>) -> f64 {
    let mut largest = 0.0;
    for row in m.row_iter() {
        let sum = row.iter().fold(0.0, |sum, value| sum + value.abs());
        // NaN is the largest of all.
        largest = if sum <= largest { largest } else { sum };
    }
    largest
}

/// What is measured of a state: ω_m, φ.
fn measured_of(x: &Vector4<f32>) -> Vector2<f32> {
    Vector2::new(x.y, x.x)
}

impl Predictor {
    /// Discretises two inertias over a tick and finds the gains of the observer.
    ///
    /// # Errors
    /// [`PredictorError`].
    pub fn new(inertias: Inertias, noise: Noise, tick_s: f64) -> Result<Self, PredictorError> {
        let Inertias { motor_kg_m2: jm, load_kg_m2: jl, stiffness_n_m_per_rad: k, damping_n_m_s_per_rad: d } = inertias;
        let twist_noise = noise.twist_rad.unwrap_or(1.0);
        for (name, found) in [
            ("motor_kg_m2", jm),
            ("load_kg_m2", jl),
            ("stiffness_n_m_per_rad", k),
            ("damping_n_m_s_per_rad", d),
            ("torque_n_m", noise.torque_n_m),
            ("load_change_n_m", noise.load_change_n_m),
            ("speed_rad_s", noise.speed_rad_s),
            ("twist_rad", twist_noise),
            ("tick_s", tick_s),
        ] {
            if !(found > 0.0 && found < 1e12) {
                return Err(PredictorError::Setting { name, found });
            }
        }
        #[rustfmt::skip]
        let slope = Matrix4::new(
            0.0, -1.0, 1.0, 0.0,
            k / jm, -d / jm, d / jm, 0.0,
            -k / jl, d / jl, -d / jl, 1.0 / jl,
            0.0, 0.0, 0.0, 0.0,
        );
        let a = exponential(slope * tick_s);
        // ∫ exp(slope·t) dt of a constant torque: the mean of the exponential at the points of Gauss, exact to the seventh order.
        let mut integral = Matrix4::zeros();
        for (place, weight) in
            [(0.069_431_844_202_973_7, 0.173_927_422_568_727), (0.330_009_478_207_572, 0.326_072_577_431_273)]
        {
            integral +=
                (exponential(slope * (tick_s * place)) + exponential(slope * (tick_s * (1.0 - place)))) * weight;
        }
        let b = integral * Vector4::new(0.0, 1.0 / jm, 0.0, 0.0) * tick_s;

        // The stationary Kalman observer, by iterating the covariance.
        let c = Matrix2x4::new(0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0);
        let used = if noise.twist_rad.is_some() { 1.0 } else { 0.0 };
        let square = |value: f64| value * value;
        let r = Matrix2::new(square(noise.speed_rad_s), 0.0, 0.0, square(twist_noise));
        let mut q = b * b.transpose() * square(noise.torque_n_m);
        q += Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, 0.0, square(noise.load_change_n_m)));
        let mut p = q + Matrix4::identity() * square(noise.speed_rad_s);
        let mut gain = Matrix4x2::zeros();
        for _ in 0..RICCATI_TICKS {
            p = a * p * a.transpose() + q;
            let s = c * p * c.transpose() + r;
            // Without an encoder at the output its row is left out: its gain is zero, and the other's that of itself alone.
            let inverse =
                if used > 0.0 { s.try_inverse().unwrap_or_default() } else { Matrix2::new(1.0 / s.m11, 0.0, 0.0, 0.0) };
            gain = p * c.transpose() * inverse;
            p -= gain * c * p;
            p = (p + p.transpose()) * 0.5;
        }
        let predictor = Self { a: a.cast(), b: b.cast(), gain: gain.cast(), tick_s: tick_s as f32 };
        predictor.check()
    }

    /// All numbers of a predictor, for the image of the firmware: the matrices by columns and the tick.
    #[must_use]
    pub fn parts(&self) -> [f32; PREDICTOR_PARTS] {
        let mut parts = [self.tick_s; PREDICTOR_PARTS];
        let numbers = self.a.iter().chain(self.b.iter()).chain(self.gain.iter());
        parts.iter_mut().zip(numbers).for_each(|(to, from)| *to = *from);
        parts
    }

    /// A predictor of [`Self::parts`], checked.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn from_parts(parts: &[f32; PREDICTOR_PARTS]) -> Result<Self, PredictorError> {
        let mut predictor = Self { a: Matrix4::zeros(), b: Vector4::zeros(), gain: Matrix4x2::zeros(), tick_s: 0.0 };
        let numbers = predictor.a.iter_mut().chain(predictor.b.iter_mut()).chain(predictor.gain.iter_mut());
        numbers.chain([&mut predictor.tick_s]).zip(parts).for_each(|(to, from)| *to = *from);
        let tick_s = predictor.tick_s as f64;
        if !(tick_s > 0.0 && tick_s < 1e3) {
            return Err(PredictorError::Setting { name: "tick_s", found: tick_s });
        }
        if let Some(bad) = predictor.b.iter().find(|value| !value.is_finite()) {
            return Err(PredictorError::Setting { name: "b", found: *bad as f64 });
        }
        predictor.check()
    }

    /// Proves that the observer contracts: the error of an estimate is less than before after 1024 ticks, whatever it is.
    ///
    /// # Errors
    /// [`PredictorError::Observer`].
    pub fn check(self) -> Result<Self, PredictorError> {
        let c = Matrix2x4::new(0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0);
        let gain: Matrix4x2<f64> = self.gain.cast();
        let mut error = (Matrix4::identity() - gain * c) * self.a.cast::<f64>();
        // Scaled to one tick's units, so that rows of different units are alike.
        let scale = Vector4::new(1e4, 1e2, 1e2, 1e-1);
        error = Matrix4::from_diagonal(&scale) * error * Matrix4::from_diagonal(&scale.map(|s| 1.0 / s));
        for _ in 0..SQUARINGS {
            error *= error;
        }
        let factor = row_sum(&error) as f32;
        if factor < 1.0 { Ok(self) } else { Err(PredictorError::Observer { factor }) }
    }

    /// One tick: what the last estimate leads to, corrected by what was measured. The same work for all values.
    #[inline]
    pub fn step(&self, state: &mut PredictorState, measured: &Measured) {
        let expected = self.a * state.x + self.b * measured.torque_n_m;
        let missed = Vector2::new(measured.speed_rad_s, measured.twist_rad) - measured_of(&expected);
        state.x = expected + self.gain * missed;
    }

    /// Where the load will be after `ticks` more ticks with this motor torque, which may differ by ± `torque_bound_n_m`, if the
    /// state differs from the truth by ± `state_bound` at most (φ rad, ω_m, ω_l rad/s, τ N·m).
    ///
    /// The bound is that of interval arithmetic: rigorous for this model, and wider than need be for long horizons.
    #[must_use]
    pub fn ahead(
        &self,
        state: &PredictorState,
        torque_n_m: f32,
        ticks: u16,
        state_bound: [f32; 4],
        torque_bound_n_m: f32,
    ) -> Ahead {
        let magnitude = self.a.map(f32::abs);
        let push = self.b.map(f32::abs) * torque_bound_n_m;
        let (mut x, mut bound) = (state.x, Vector4::from(state_bound));
        let (mut load_rad, mut bound_rad) = (0.0, 0.0);
        for _ in 0..ticks {
            let (next, next_bound) = (self.a * x + self.b * torque_n_m, magnitude * bound + push);
            // Trapezium: exact for a speed that changes evenly during a tick.
            load_rad += 0.5 * self.tick_s * (x.z + next.z);
            bound_rad += 0.5 * self.tick_s * (bound.z + next_bound.z);
            (x, bound) = (next, next_bound);
        }
        Ahead { load_rad, twist_rad: x.x, bound_rad }
    }
}

impl PredictorState {
    /// At rest, without load.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Twist: load ahead of the motor, rad.
    #[must_use]
    pub fn twist_rad(&self) -> f32 {
        self.x.x
    }

    /// Load speed, rad/s.
    #[must_use]
    pub fn load_speed_rad_s(&self) -> f32 {
        self.x.z
    }

    /// Torque on the load, N·m: what the table is asked with where no sensor measures it.
    #[must_use]
    pub fn load_torque_n_m(&self) -> f32 {
        self.x.w
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INERTIAS: Inertias =
        Inertias { motor_kg_m2: 1.0, load_kg_m2: 3.0, stiffness_n_m_per_rad: 3.0e4, damping_n_m_s_per_rad: 20.0 };
    const NOISE: Noise = Noise { torque_n_m: 0.5, load_change_n_m: 0.2, speed_rad_s: 1e-4, twist_rad: Some(1e-6) };
    const TICK_S: f64 = 1e-3;

    /// The same equations, own arithmetic: Runge-Kutta of fourth order in a hundredth of a tick.
    #[derive(Clone, Copy)]
    struct Plant {
        x: [f64; 3],
        load_rad: f64,
    }

    impl Plant {
        fn tick(&mut self, torque: f64, load: f64) {
            let i = INERTIAS;
            let slope = |[phi, wm, wl]: [f64; 3]| {
                let spring = i.stiffness_n_m_per_rad * phi + i.damping_n_m_s_per_rad * (wl - wm);
                [wl - wm, (torque + spring) / i.motor_kg_m2, (load - spring) / i.load_kg_m2]
            };
            let add = |x: [f64; 3], k: [f64; 3], h: f64| [x[0] + h * k[0], x[1] + h * k[1], x[2] + h * k[2]];
            let h = TICK_S / 100.0;
            for _ in 0..100 {
                let before = self.x[2];
                let k1 = slope(self.x);
                let k2 = slope(add(self.x, k1, h / 2.0));
                let k3 = slope(add(self.x, k2, h / 2.0));
                let k4 = slope(add(self.x, k3, h));
                for n in 0..3 {
                    self.x[n] += h / 6.0 * (k1[n] + 2.0 * k2[n] + 2.0 * k3[n] + k4[n]);
                }
                self.load_rad += 0.5 * h * (before + self.x[2]);
            }
        }
    }

    /// The estimate after a second of motion under load, and the truth.
    fn observed(noise: Noise) -> (Predictor, PredictorState, Plant) {
        let predictor = Predictor::new(INERTIAS, noise, TICK_S).unwrap();
        let mut state = PredictorState::new();
        let mut plant = Plant { x: [1e-3, 0.02, -0.01], load_rad: 0.0 };
        for tick in 0..2000 {
            let torque = 15.0 + 5.0 * (tick as f64 * 0.02).sin();
            plant.tick(torque, -15.0);
            let measured = Measured {
                torque_n_m: torque as f32,
                speed_rad_s: plant.x[1] as f32,
                twist_rad: if noise.twist_rad.is_some() { plant.x[0] as f32 } else { f32::MAX / 1e30 },
            };
            predictor.step(&mut state, &measured);
        }
        (predictor, state, plant)
    }

    #[test]
    fn the_discrete_model_is_the_continuous_one() {
        let predictor = Predictor::new(INERTIAS, NOISE, TICK_S).unwrap();
        let mut plant = Plant { x: [1e-3, 0.02, -0.01], load_rad: 0.0 };
        let state = PredictorState { x: Vector4::new(1e-3, 0.02, -0.01, -7.0) };
        for _ in 0..200 {
            plant.tick(9.0, -7.0);
        }
        let ahead = predictor.ahead(&state, 9.0, 200, [0.0; 4], 0.0);
        assert!((ahead.twist_rad as f64 - plant.x[0]).abs() < 2e-8, "{} {}", ahead.twist_rad, plant.x[0]);
        // The trapezium at 1 kHz, with the spring at 32 Hz.
        assert!((ahead.load_rad as f64 - plant.load_rad).abs() < 2e-6, "{} {}", ahead.load_rad, plant.load_rad);
        assert_eq!(ahead.bound_rad, 0.0);
    }

    #[test]
    fn the_observer_finds_twist_and_load_with_and_without_an_output_encoder() {
        for (noise, twist, load) in [(NOISE, 1e-6, 0.1), (Noise { twist_rad: None, ..NOISE }, 2e-5, 0.5)] {
            let (_, state, plant) = observed(noise);
            assert!((state.twist_rad() as f64 - plant.x[0]).abs() < twist, "{} {}", state.twist_rad(), plant.x[0]);
            assert!((state.load_torque_n_m() as f64 + 15.0).abs() < load, "{}", state.load_torque_n_m());
            assert!((state.load_speed_rad_s() as f64 - plant.x[2]).abs() < 1e-3);
        }
    }

    #[test]
    fn the_horizon_keeps_its_bound() {
        let (predictor, state, plant) = observed(NOISE);
        let bound = [1e-6, 1e-4, 1e-3, 0.1];
        for ticks in [1u16, 5, 20, 50] {
            let ahead = predictor.ahead(&state, 15.0, ticks, bound, 2.0);
            for torque in [13.0, 15.0, 17.0] {
                let mut there = Plant { load_rad: 0.0, ..plant };
                (0..ticks).for_each(|_| there.tick(torque, -15.0));
                let off = (ahead.load_rad as f64 - there.load_rad).abs();
                assert!(off <= ahead.bound_rad as f64, "{ticks} ticks: {off} {}", ahead.bound_rad);
            }
        }
    }

    fn good_parts() -> [f32; PREDICTOR_PARTS] {
        Predictor::new(INERTIAS, NOISE, TICK_S).unwrap().parts()
    }

    #[test]
    fn what_makes_no_predictor_is_named() {
        let named = |inertias, noise, tick| match Predictor::new(inertias, noise, tick).unwrap_err() {
            PredictorError::Setting { name, .. } => name,
            error => panic!("{error}"),
        };
        assert_eq!(named(Inertias { load_kg_m2: 0.0, ..INERTIAS }, NOISE, 1e-3), "load_kg_m2");
        assert_eq!(named(INERTIAS, Noise { twist_rad: Some(f64::NAN), ..NOISE }, 1e-3), "twist_rad");
        assert_eq!(named(INERTIAS, NOISE, -1e-3), "tick_s");
        assert_eq!(Predictor::from_parts(&good_parts()), Ok(Predictor::new(INERTIAS, NOISE, TICK_S).unwrap()));
        for (place, value) in [(0, f32::NAN), (17, f32::INFINITY), (21, 5.0), (28, 0.0), (28, f32::NAN)] {
            let mut parts = good_parts();
            parts[place] = value;
            assert!(Predictor::from_parts(&parts).is_err(), "{place}");
        }
        // One that was damaged on its way, or made for another machine.
        let good = Predictor::new(INERTIAS, NOISE, TICK_S).unwrap();
        let wild = Predictor { gain: good.gain * -3.0, ..good };
        assert!(matches!(wild.check(), Err(PredictorError::Observer { factor }) if factor.is_nan() || factor > 1.0));
        let undefined = Predictor { a: good.a * f32::NAN, ..good };
        assert!(undefined.check().is_err());
    }
}
