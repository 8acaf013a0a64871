//! Two inertias and the spring between them: what the table, which is quasi-static, leaves out.
//!
//! ```text
//! φ̇  = ω_l − ω_m                                     φ    twist: load ahead of the motor, rad
//! ω̇_m = (u + kφ + d(ω_l − ω_m))/J_m                  ω_m  motor speed over the ratio, ω_l load speed, rad/s
//! ω̇_l = (τ − kφ − d(ω_l − ω_m))/J_l                  u    motor torque times the ratio, τ torque on the load, N·m
//! τ̇  = 0
//! ```
//!
//! All at the output; angles do not occur, so nothing drifts and nothing wraps. [`TwoMassObserver::new`] discretises
//! that exactly over one tick, finds the gains of a stationary Kalman observer, both in double precision, and proves
//! that the observer contracts; it is meant for the host or for start-up, and [`TwoMassObserver::check`] proves it
//! again for one that was made elsewhere. [`TwoMassObserver::step`] is for every tick, with the motor's speed alone or
//! with the twist measured too (output angle less nominal less the error of the table).
//!
//! # Ahead
//! [`TwoMassObserver::ahead`] goes on without measurements, and bounds what it says: each disturbance ([`Disturbance`])
//! and each part of the state by its own response at the output, summed by magnitude. For this model and disturbances
//! that stay within their bounds no smaller bound holds. [`TwoMassObserver::state_bound`] is the same sum for the
//! observer: what its estimate can be off by.
//!
//! [`TwoMassObserver::output_ahead`] takes the table as the output map of this model: the output is expected at the
//! nominal output of the generator then, plus the error of the table at the torque that the spring carries then
//! (stiffness times twist, which at rest is the load). So the play is followed, ripple and curves are those of the
//! angle then, and the wind-up is the table's, not that of a straight spring. With an encoder at the output what it
//! measures now takes the place of the table's error now, and only its change comes from the table.
//!
//! Model and estimate are each kept under a sum ([`Sealed`]): where an upset hit one word it is mended
//! in the next step. An estimate or a model that is lost says NaN, and a bound without end.
//!
//! Not in here: friction other than the table's.

#![allow(clippy::arithmetic_side_effects)] // Matrices of floating-point numbers: nothing overflows.

use core::fmt;
use core::slice::from_mut;
use flexspline::shared::num::larger;
use flexspline::shared::{Sealed, Words};
use flexspline::{GeneratorAngle, Joint, OutputAngle, PlayState, Prediction, Quality, Store};
use nalgebra::{Matrix2, Matrix2x4, Matrix3x4, Matrix4, Matrix4x2, RowVector4, Vector2, Vector3, Vector4};

/// Two inertias, at the output.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertias {
    /// Motor, generator and what turns with them: their inertia times the square of the ratio, kg m^2.
    pub motor_kg_m2: f64,
    /// Load, kg m^2.
    pub load_kg_m2: f64,
    /// Torsional stiffness, N m/rad: the slope of the wind-up.
    pub stiffness_n_m_per_rad: f64,
    /// Damping parallel to it, N m s/rad.
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

/// Measurements of a tick, for the observer.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Motor torque times the ratio in the tick before, N m.
    pub torque_n_m: f32,
    /// Motor speed over the ratio, rad/s.
    pub speed_rad_s: f32,
    /// Twist, rad: only used if the predictor was made with a noise for it.
    pub twist_rad: f32,
}

/// A predictor: all that does not change while it runs. A step checks no more than it reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoMassObserver {
    step: Sealed<StepModel>,
    ahead: Sealed<AheadModel>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct TwoMassModel {
    a: Matrix4<f32>,
    b: Vector4<f32>,
    gain: Matrix4x2<f32>,
    /// Load rotation over one tick: row vector on the previous state, and gain on the motor torque.
    turn: RowVector4<f32>,
    turn_push: f32,
    stiffness: f32,
}

/// The parts of the model that a step reads: rows for the torque on the load, which stays, are not among them. In the
/// order of memory, so that the sum loads words in pairs.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
struct StepModel {
    a: Matrix3x4<f32>,
    b: Vector3<f32>,
    gain: Matrix4x2<f32>,
}

/// The parts of the model that only a look ahead reads.
#[derive(Clone, Copy, Debug, PartialEq)]
struct AheadModel {
    turn: [f32; 4],
    turn_push: f32,
    stiffness: f32,
}

flexspline::shared::words!([] AheadModel { turn, turn_push, stiffness });

/// Row of the torque on the load in `a`: it stays.
const LOAD_STAYS: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// Of a matrix, by columns.
#[inline(always)]
fn sum_of(matrix: &[f32], sum: u64) -> u64 {
    matrix.iter().fold(sum, |sum, value| value.sum(sum))
}

impl Words for StepModel {
    #[inline(always)]
    fn sum(&self, sum: u64) -> u64 {
        let Self { a, b, gain } = self;
        sum_of(gain.as_slice(), sum_of(b.as_slice(), sum_of(a.as_slice(), sum)))
    }

    fn each(&mut self, see: &mut dyn FnMut(u32) -> u32) {
        let Self { a, b, gain } = self;
        for part in [a.as_mut_slice(), b.as_mut_slice(), gain.as_mut_slice()] {
            part.iter_mut().for_each(|value| value.each(see));
        }
    }
}

/// φ, ω_m, ω_l, τ as estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictorState {
    x: Sealed<Estimated>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Estimated(Vector4<f32>);

impl Words for Estimated {
    #[inline(always)]
    fn sum(&self, sum: u64) -> u64 {
        sum_of(self.0.as_slice(), sum)
    }

    fn each(&mut self, see: &mut dyn FnMut(u32) -> u32) {
        self.0.iter_mut().for_each(|value| value.each(see));
    }
}

/// How far what is measured and assumed can be off: bounds, each +-.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Disturbance {
    /// Motor torque at the output, N m.
    pub torque_n_m: f32,
    /// Change of the torque on the load in a tick, N m.
    pub load_change_n_m: f32,
    /// Motor speed over the ratio as measured, rad/s.
    pub speed_rad_s: f32,
    /// Twist as measured, rad; of no matter without an encoder at the output.
    pub twist_rad: f32,
}

/// Predicted motion of motor and load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ahead {
    /// Angle that the load turns until then, rad.
    pub load_rad: f32,
    /// It lies within ± this, rad.
    pub bound_rad: f32,
    /// Angle that the motor turns until then, over the ratio, rad.
    pub motor_rad: f32,
    /// It lies within ± this, rad.
    pub motor_bound_rad: f32,
    /// Twist then, rad.
    pub twist_rad: f32,
    /// It lies within ± this, rad.
    pub twist_bound_rad: f32,
    /// The twist now lies within ± this of the estimate, rad: as reported.
    pub twist_now_bound_rad: f32,
    /// The two farthest angles of the motor on the way, over the ratio, in the order in which they come, rad.
    pub turning_rad: [f32; 2],
}

/// Where the output is expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputAhead {
    /// The output angle then.
    pub output: OutputAngle,
    /// It lies within ± this, rad; what the table itself misses comes on top
    /// ([`Table::projection_worst_rad`](flexspline::Table::projection_worst_rad)).
    pub bound_rad: f32,
    /// How far to trust it: the worse of now and then.
    pub quality: Quality,
}

/// Where the prediction of the output starts.
#[derive(Clone, Copy, Debug)]
pub struct Now<'s> {
    /// The generator angle.
    pub generator: GeneratorAngle,
    /// The play, followed until now.
    pub play: &'s PlayState,
    /// The output as measured now; `None` without an encoder there.
    pub measured: Option<OutputAngle>,
    /// The measured output lies within ± this, rad.
    pub measured_bound_rad: f32,
}

/// Why there is no predictor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PredictorError {
    /// A number is not within 1e-12 to 1e12.
    Setting {
        /// Which.
        name: &'static str,
        /// Value found.
        found: f64,
    },
    /// The observer does not contract: its error after a thousand ticks, as a factor. NaN where the model is lost.
    Observer {
        /// Factor found; below 1 is needed.
        factor: f32,
    },
    /// The torque on the load does not stay as it is.
    Load,
}

impl fmt::Display for PredictorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Setting { name, found } => write!(f, "{name} = {found}: must be within 1e-12 to 1e12"),
            Self::Observer { factor } => write!(f, "the observer's error grows to {factor} times in 1024 ticks"),
            Self::Load => {
                f.write_str("the torque on the load does not stay in a tick: its row must be 0 0 0 1, and 0 of b")
            }
        }
    }
}

impl core::error::Error for PredictorError {}

/// Numbers of a predictor.
pub const PREDICTOR_PARTS: usize = 34;

/// Squarings of the observer's matrix that the proof takes: 1024 ticks.
const SQUARINGS: u32 = 10;
/// Ticks after which the gains of the observer stand.
const RICCATI_TICKS: u32 = 20_000;
/// Ticks after which nothing of a disturbance is left in the estimate.
const SETTLED_TICKS: u32 = 10_000;
/// Rounding of `f32` in each tick of a horizon, as a part of the angle turned.
const ROUNDING: f32 = 1.2e-7;
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

/// Product of two matrices, by columns: a seventh of the code where double precision is a call for each operation.
#[inline(never)]
fn product(a: &Matrix4<f64>, b: &Matrix4<f64>) -> Matrix4<f64> {
    Matrix4::from_columns(&b.data.0.map(|column| times(a, &column.into())))
}

#[inline(never)]
fn times(a: &Matrix4<f64>, column: &Vector4<f64>) -> Vector4<f64> {
    a * column
}

/// Part of an error that a measurement leaves: identity less gain times what is measured of a state.
fn kept_of(gain: &Matrix4x2<f64>) -> Matrix4<f64> {
    let [by_speed, by_twist] = gain.data.0.map(Vector4::from);
    Matrix4::identity() - Matrix4::from_columns(&[by_twist, by_speed, Vector4::zeros(), Vector4::zeros()])
}

/// Measured part of a state: ω_m, φ.
fn measured_of(x: &Vector4<f32>) -> Vector2<f32> {
    Vector2::new(x.y, x.x)
}

impl TwoMassObserver {
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
            if !allowed(found) {
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
        // ∫ exp(slope·t) dt and ∫ (tick − t)·exp(slope·t) dt, by the means of Gauss: exact to the seventh order.
        let (mut integral, mut second) = (Matrix4::zeros(), Matrix4::zeros());
        for (place, weight) in
            [(0.069_431_844_202_973_7, 0.173_927_422_568_727), (0.330_009_478_207_572, 0.326_072_577_431_273)]
        {
            let (early, late) = (exponential(slope * (tick_s * place)), exponential(slope * (tick_s * (1.0 - place))));
            integral += (early + late) * (weight * tick_s);
            second += (early * (1.0 - place) + late * place) * (weight * tick_s * tick_s);
        }
        let push = Vector4::new(0.0, 1.0 / jm, 0.0, 0.0);
        let b = integral * push;

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
            // Without an encoder at the output its row is left out: its gain is zero, and the other's that of itself
            // alone.
            let inverse =
                if used > 0.0 { s.try_inverse().unwrap_or_default() } else { Matrix2::new(1.0 / s.m11, 0.0, 0.0, 0.0) };
            gain = p * c.transpose() * inverse;
            p -= gain * c * p;
            p = (p + p.transpose()) * 0.5;
        }
        let turn: RowVector4<f64> = integral.fixed_rows::<1>(2).into_owned();
        let model = TwoMassModel {
            a: a.cast(),
            b: b.cast(),
            gain: gain.cast(),
            turn: turn.cast(),
            turn_push: (second * push).z as f32,
            stiffness: k as f32,
        };
        model.checked()
    }

    /// Makes the model whole, where it lies in memory and an upset hit a word of it; false if it is lost, and the
    /// predictor has to be made anew. For a slow rate group: until then each step mends a copy.
    pub fn mend(&mut self) -> bool {
        self.step.mend() & self.ahead.mend()
    }

    /// Whether the model is lost to an upset that cannot be mended.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.step.open().is_none() || self.ahead.open().is_none()
    }

    /// The whole model; `None` where a part of it is lost.
    #[inline(never)]
    fn model(&self) -> Option<TwoMassModel> {
        let (StepModel { a, b, gain }, AheadModel { turn, turn_push, stiffness }) =
            (self.step.open()?, self.ahead.open()?);
        let mut whole = Matrix4::from_rows(&[LOAD_STAYS.into(); 4]);
        whole.fixed_rows_mut::<3>(0).copy_from(&a);
        Some(TwoMassModel { a: whole, b: b.push(0.0), gain, turn: turn.into(), turn_push, stiffness })
    }

    /// All numbers of a predictor, for the image of the firmware: the matrices by columns, what the load turns in a
    /// tick, the stiffness. NaN where the model is lost.
    #[must_use]
    pub fn parts(&self) -> [f32; PREDICTOR_PARTS] {
        let mut parts = [f32::NAN; PREDICTOR_PARTS];
        let Some(mut model) = self.model() else { return parts };
        parts.iter_mut().zip(model.numbers()).for_each(|(to, from)| *to = *from);
        parts
    }

    /// A predictor of [`Self::parts`], checked.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn from_parts(parts: &[f32; PREDICTOR_PARTS]) -> Result<Self, PredictorError> {
        let mut model = TwoMassModel {
            a: Matrix4::zeros(),
            b: Vector4::zeros(),
            gain: Matrix4x2::zeros(),
            turn: RowVector4::zeros(),
            turn_push: 0.0,
            stiffness: 0.0,
        };
        model.numbers().zip(parts).for_each(|(to, from)| *to = *from);
        let stiffness = model.stiffness as f64;
        if !allowed(stiffness) {
            return Err(PredictorError::Setting { name: "stiffness_n_m_per_rad", found: stiffness });
        }
        let pushes = model.b.iter().map(|value| ("b", *value));
        let turns = model.turn.iter().chain([&model.turn_push]).map(|value| ("turn", *value));
        if let Some((name, bad)) = pushes.chain(turns).find(|(_, value)| !value.is_finite()) {
            return Err(PredictorError::Setting { name, found: bad as f64 });
        }
        model.checked()
    }

    /// Proves that the observer contracts: the error of an estimate is less than before after 1024 ticks, whatever it
    /// is.
    ///
    /// # Errors
    /// [`PredictorError::Observer`], [`PredictorError::Load`].
    pub fn check(self) -> Result<Self, PredictorError> {
        self.model().ok_or(PredictorError::Observer { factor: f32::NAN })?.checked()
    }

    /// One tick: what the last estimate leads to, corrected by what was measured. The same work for all values.
    ///
    /// False, and the estimate stays, if a number that is used is not finite or beyond any drive (`MOST`), or the
    /// estimate would come to be. Where the model of a step is lost the estimate is lost with it, and says NaN: make
    /// them anew.
    #[inline]
    pub fn step(&self, state: &mut PredictorState, measured: &Measured) -> bool {
        let done = self.step.with(|model| model.step(state, measured));
        if done.is_none() {
            *state = PredictorState::LOST;
        }
        done.unwrap_or(false)
    }

    /// Largest error of the estimate when the disturbances stay within these bounds, once the start is forgotten: φ
    /// rad, ω_m, ω_l rad/s, τ N·m. For start-up and the host: 10 000 ticks of the observer in double precision.
    /// Infinite where the model is lost.
    #[must_use]
    pub fn state_bound(&self, disturbance: &Disturbance) -> [f32; 4] {
        let Some(model) = self.model() else { return [f32::INFINITY; 4] };
        let gain: Matrix4x2<f64> = model.gain.cast();
        let kept = kept_of(&gain);
        let contract = kept * model.a.cast::<f64>();
        let Disturbance { torque_n_m, load_change_n_m, speed_rad_s, twist_rad } = *disturbance;
        // What a disturbance of each kind leaves in the estimate after its tick: by columns.
        let mut left = Matrix4::from_columns(&[
            kept * model.b.cast::<f64>() * torque_n_m as f64,
            kept.column(3) * load_change_n_m as f64,
            gain.column(0) * speed_rad_s as f64,
            gain.column(1) * twist_rad as f64,
        ]);
        let mut bound = Vector4::zeros();
        for _ in 0..SETTLED_TICKS {
            for column in left.column_iter() {
                bound += column.abs();
            }
            left = contract * left;
        }
        bound.map(|value| value as f32).into()
    }

    /// Motion of motor and load in `ticks` more ticks with this motor torque, if the state differs from the truth by
    /// ± `state_bound` at most (φ rad, ω_m, ω_l rad/s, τ N·m) and torque and load from what is assumed (the load: that
    /// it stays) by `disturbance` (what is measured does not matter here).
    ///
    /// Where model or estimate are lost, or a number given is not finite, the bounds are infinite. The work grows with
    /// `ticks` and with nothing else. The rounding of `f32` is in the bounds, with 1.2e-7 of the angle turned for each
    /// tick. The torque is held during a tick.
    #[must_use]
    pub fn ahead(
        &self,
        state: &PredictorState,
        torque_n_m: f32,
        ticks: u16,
        state_bound: [f32; 4],
        disturbance: &Disturbance,
    ) -> Ahead {
        let off = Vector4::from(state_bound);
        let Disturbance { torque_n_m: torque_off, load_change_n_m: load_off, .. } = *disturbance;
        let (Some(model), Some(Estimated(start))) = (self.model(), state.x.open()) else { return Ahead::UNKNOWN };
        let (mut x, mut ahead) = (start, Ahead::default());
        // Rows: load, motor and twist then, as they follow from a state that number of ticks before.
        let twist_now = RowVector4::new(1.0, 0.0, 0.0, 0.0);
        let (mut load, mut twist) = (RowVector4::zeros(), twist_now);
        let (mut load_pushed, mut motor_pushed, mut twist_pushed, mut turned) = (0.0f32, 0.0f32, 0.0f32, 0.0f32);
        // The farthest to both sides, and when.
        let (mut most, mut least) = ((0.0, 0u16), (0.0, 0u16));
        for tick in 1..=ticks {
            // What disturbs in the first of the remaining ticks.
            let load_by_torque = load.transpose().dot(&model.b) + model.turn_push;
            let twist_by_torque = twist.transpose().dot(&model.b);
            let (load_by_load, twist_by_load) = (load.w, twist.w);
            load_pushed += load_by_torque.abs() * torque_off + load_by_load.abs() * load_off;
            motor_pushed +=
                (load_by_torque - twist_by_torque).abs() * torque_off + (load_by_load - twist_by_load).abs() * load_off;
            twist_pushed += twist_by_torque.abs() * torque_off + twist_by_load.abs() * load_off;
            load = load * model.a + model.turn;
            twist *= model.a;
            ahead.load_rad += model.turn.transpose().dot(&x) + model.turn_push * torque_n_m;
            x = model.a * x + model.b * torque_n_m;
            let motor = ahead.load_rad - (x.x - start.x);
            turned += (motor - ahead.motor_rad).abs();
            ahead.motor_rad = motor;
            most = if motor > most.0 { (motor, tick) } else { most };
            least = if motor < least.0 { (motor, tick) } else { least };
        }
        let rounding = ROUNDING * ticks as f32 * turned;
        let through = |row: RowVector4<f32>| row.abs().transpose().dot(&off);
        ahead.bound_rad = through(load) + load_pushed + rounding;
        ahead.motor_bound_rad = through(load - twist + twist_now) + motor_pushed + rounding;
        ahead.twist_bound_rad = through(twist) + twist_pushed + ROUNDING * ticks as f32 * (x.x.abs() + start.x.abs());
        (ahead.twist_rad, ahead.twist_now_bound_rad) = (x.x, off.x);
        ahead.turning_rad = if most.1 < least.1 { [most.0, least.0] } else { [least.0, most.0] };
        // What is no number in is none out.
        let known = [ahead.load_rad, ahead.motor_rad, ahead.twist_rad, ahead.bound_rad, ahead.motor_bound_rad];
        let known = known.into_iter().chain([ahead.twist_bound_rad, ahead.twist_now_bound_rad]).all(f32::is_finite);
        if known { ahead } else { Ahead::UNKNOWN }
    }

    /// Where the output will be after what [`Self::ahead`] says, with the table as the output map.
    ///
    /// `now.play` is that of the joint and stays as it is. The play is taken through the farthest angles of the motor
    /// on the way: exact for up to two reversals until then. The bound is that of the table at the ends of what motor
    /// and twist can be then (the error grows with the torque, and the output with the generator), the uncertainty of
    /// play and jumps, and what is measured. Where the twist is known to a jump of the table or less exactly, that is
    /// the height of the jump. Costs twelve calls of [`Joint::forward`], in every case.
    #[must_use]
    pub fn output_ahead(
        &self,
        joint: &Joint,
        store: &Store,
        state: &PredictorState,
        ahead: &Ahead,
        now: &Now<'_>,
    ) -> OutputAhead {
        let unknown = OutputAhead {
            output: joint.drive().nominal_output(now.generator),
            bound_rad: f32::INFINITY,
            quality: Quality::Disabled,
        };
        let (Some(AheadModel { stiffness, .. }), Some(Estimated(x))) = (self.ahead.open(), state.x.open()) else {
            return unknown;
        };
        let measured_sound = now.measured.is_none() || now.measured_bound_rad.is_finite();
        let sound = measured_sound && !joint.is_lost();
        if !(ahead.bound_rad.is_finite() && ahead.motor_bound_rad.is_finite() && sound) {
            return unknown;
        }
        let to_generator = |motor_rad: f32| {
            let nominal = OutputAngle::ZERO.offset_rad(motor_rad);
            now.generator.offset_counts(joint.drive().nominal_generator(nominal).counts())
        };
        let torque = stiffness * ahead.twist_rad;
        let through = |motor_off: f32, torque_off: f32| -> Prediction {
            let (mut play, torque) = (*now.play, torque + torque_off);
            for turning in ahead.turning_rad {
                let _ = joint.forward(store, &mut play, to_generator(turning + motor_off), torque);
            }
            joint.forward(store, &mut play, to_generator(ahead.motor_rad + motor_off), torque)
        };
        let resting = |torque_off: f32| -> Prediction {
            let torque = stiffness * x.x + torque_off;
            joint.forward(store, &mut now.play.clone(), now.generator, torque)
        };
        let spread = |middle: &Prediction, ends: [Prediction; 2]| {
            ends.iter().fold(middle.uncertainty_rad, |bound, end| {
                larger(bound, end.output.minus_rad(middle.output).abs() + end.uncertainty_rad)
            })
        };
        let (motor_off, torque_off) = (ahead.motor_bound_rad, stiffness * ahead.twist_bound_rad);
        let then = through(0.0, 0.0);
        let bound_rad = spread(&then, [through(-motor_off, -torque_off), through(motor_off, torque_off)]);
        let torque_off = stiffness * ahead.twist_now_bound_rad;
        let here = resting(0.0);
        let here_bound_rad = spread(&here, [resting(-torque_off), resting(torque_off)]);
        let quality = if here.quality > then.quality { here.quality } else { then.quality };
        match now.measured {
            Some(measured) => OutputAhead {
                output: measured.offset_counts(then.output.minus_counts(here.output)),
                bound_rad: bound_rad + here_bound_rad + now.measured_bound_rad,
                quality,
            },
            None => OutputAhead { output: then.output, bound_rad, quality },
        }
    }
}

/// A number of two inertias, or of their noise, that can be.
fn allowed(found: f64) -> bool {
    (1e-12..=1e12).contains(&found)
}

/// No twist, rad, speed of motor and load, rad/s, or torque, N·m, of a joint is larger: a whole radian, a thousand
/// turns a second, ten times the rating of the largest drives. Guesses; they only keep what is no measurement out.
const MOST: [f32; 4] = [1.0, 6.3e3, 6.3e3, 1e6];

/// Whether all four are numbers, and not larger than any drive's.
fn is_possible(x: &Vector4<f32>) -> bool {
    x.iter().zip(MOST).fold(true, |possible, (value, most)| possible & (value.abs() <= most))
}

impl Ahead {
    /// Nothing is known.
    const UNKNOWN: Self = Self {
        load_rad: 0.0,
        bound_rad: f32::INFINITY,
        motor_rad: 0.0,
        motor_bound_rad: f32::INFINITY,
        twist_rad: 0.0,
        twist_bound_rad: f32::INFINITY,
        twist_now_bound_rad: f32::INFINITY,
        turning_rad: [0.0; 2],
    };
}

impl StepModel {
    /// See [`TwoMassObserver::step`].
    #[inline(always)]
    fn step(&self, state: &mut PredictorState, measured: &Measured) -> bool {
        let Some(Estimated(x)) = state.x.open() else { return false };
        // Without an encoder at the output whatever stands there for the twist is not read. Zeros of either sign.
        let twist_used = self.gain.column(1).iter().fold(0, |bits, gain| bits | gain.to_bits()) << 1 != 0;
        let Measured { torque_n_m, speed_rad_s, twist_rad } = *measured;
        let expected = self.a * x + self.b * torque_n_m;
        let twist_rad = if twist_used { twist_rad } else { expected.x };
        // The torque on the load stays; a zero has no sign, as in a sum.
        let expected = expected.push(x.w + 0.0);
        let missed = Vector2::new(speed_rad_s, twist_rad) - measured_of(&expected);
        let next = expected + self.gain * missed;
        let sound = is_possible(&Vector4::new(twist_rad, speed_rad_s, 0.0, torque_n_m)) & is_possible(&next);
        if sound {
            state.x.close(Estimated(next));
        }
        sound
    }
}

impl TwoMassModel {
    /// Its numbers in the order of [`TwoMassObserver::parts`].
    fn numbers(&mut self) -> impl Iterator<Item = &mut f32> {
        let Self { a, b, gain, turn, turn_push, stiffness } = self;
        let (push, stiffness) = (from_mut(turn_push), from_mut(stiffness));
        let parts = [a.as_mut_slice(), b.as_mut_slice(), gain.as_mut_slice(), turn.as_mut_slice(), push, stiffness];
        parts.into_iter().flatten()
    }

    /// See [`TwoMassObserver::check`].
    fn checked(self) -> Result<TwoMassObserver, PredictorError> {
        let mut error = product(&kept_of(&self.gain.cast()), &self.a.cast());
        // Scaled to one tick's units, so that rows of different units are alike.
        let scale = Vector4::new(1e4, 1e2, 1e2, 1e-1);
        error = product(&Matrix4::from_diagonal(&scale), &error);
        error = product(&error, &Matrix4::from_diagonal(&scale.map(|s| 1.0 / s)));
        for _ in 0..SQUARINGS {
            error = product(&error, &error);
        }
        let factor = row_sum(&error) as f32;
        if factor >= 1.0 || factor.is_nan() {
            return Err(PredictorError::Observer { factor });
        }
        let Self { a, b, gain, turn, turn_push, stiffness } = self;
        if a.row(3) != RowVector4::from(LOAD_STAYS) || b.w != 0.0 {
            return Err(PredictorError::Load);
        }
        let step = StepModel { a: a.fixed_rows::<3>(0).into_owned(), b: b.xyz(), gain };
        let ahead = AheadModel { turn: turn.transpose().into(), turn_push, stiffness };
        Ok(TwoMassObserver { step: Sealed::new(step), ahead: Sealed::new(ahead) })
    }
}

impl Default for PredictorState {
    fn default() -> Self {
        Self::new()
    }
}

impl PredictorState {
    /// Not whole.
    const LOST: Self = Self { x: Sealed::of(Estimated(Vector4::new(0.0, 0.0, 0.0, 0.0)), 0) };

    /// At rest, without load.
    #[must_use]
    pub fn new() -> Self {
        Self::of([0.0; 4])
    }

    fn of(x: [f32; 4]) -> Self {
        Self { x: Sealed::new(Estimated(x.into())) }
    }

    fn open(&self) -> Vector4<f32> {
        self.x.open().map_or(Vector4::repeat(f32::NAN), |Estimated(x)| x)
    }

    /// Whether it is lost to an upset that cannot be mended: begin at rest again. Until then all that it says is NaN.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.x.open().is_none()
    }

    /// Twist: load ahead of the motor, rad.
    #[must_use]
    pub fn twist_rad(&self) -> f32 {
        self.open().x
    }

    /// Load speed, rad/s.
    #[must_use]
    pub fn load_speed_rad_s(&self) -> f32 {
        self.open().z
    }

    /// Torque on the load, N·m: what the table is asked with where no sensor measures it.
    #[must_use]
    pub fn load_torque_n_m(&self) -> f32 {
        self.open().w
    }
}

#[cfg(any(test, feature = "testing"))]
flexspline::testing::upsets!(TwoMassObserver { step, ahead });
#[cfg(any(test, feature = "testing"))]
flexspline::testing::upsets!(PredictorState { x });

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline::testing::fixture;
    use flexspline::{Images, Overrun, Table};

    const INERTIAS: Inertias =
        Inertias { motor_kg_m2: 1.0, load_kg_m2: 3.0, stiffness_n_m_per_rad: 3.0e4, damping_n_m_s_per_rad: 20.0 };
    const NOISE: Noise = Noise { torque_n_m: 0.5, load_change_n_m: 0.2, speed_rad_s: 1e-4, twist_rad: Some(1e-6) };
    const TICK_S: f64 = 1e-3;

    /// The equations of the predictor in arithmetic of the test's own: Runge-Kutta of fourth order in a hundredth of a
    /// tick.
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
                let (before, rate) = (self.x[2], slope(self.x)[2]);
                let k1 = slope(self.x);
                let k2 = slope(add(self.x, k1, h / 2.0));
                let k3 = slope(add(self.x, k2, h / 2.0));
                let k4 = slope(add(self.x, k3, h));
                for n in 0..3 {
                    self.x[n] += h / 6.0 * (k1[n] + 2.0 * k2[n] + 2.0 * k3[n] + k4[n]);
                }
                self.load_rad += 0.5 * h * (before + self.x[2]) + h * h / 12.0 * (rate - slope(self.x)[2]);
            }
        }
    }

    /// The estimate after a second of motion under load, and the truth.
    fn observed(noise: Noise) -> (TwoMassObserver, PredictorState, Plant) {
        let predictor = TwoMassObserver::new(INERTIAS, noise, TICK_S).unwrap();
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
        let predictor = TwoMassObserver::new(INERTIAS, NOISE, TICK_S).unwrap();
        let mut plant = Plant { x: [1e-3, 0.02, -0.01], load_rad: 0.0 };
        let state = PredictorState::of([1e-3, 0.02, -0.01, -7.0]);
        for _ in 0..200 {
            plant.tick(9.0, -7.0);
        }
        let ahead = predictor.ahead(&state, 9.0, 200, [0.0; 4], &Disturbance::default());
        assert!((ahead.twist_rad as f64 - plant.x[0]).abs() < 2e-8, "{} {}", ahead.twist_rad, plant.x[0]);
        let off = (ahead.load_rad as f64 - plant.load_rad).abs();
        assert!(off < 5e-8 && off < ahead.bound_rad as f64, "{off:e} {:e}", ahead.bound_rad);
        let motor = ahead.motor_rad as f64 - (plant.load_rad - (plant.x[0] - 1e-3));
        assert!(motor.abs() < 5e-8, "{motor:e}");
        // Rounding only.
        assert!(ahead.bound_rad < 1e-5 && ahead.bound_rad == ahead.motor_bound_rad);
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
            let off = Disturbance { torque_n_m: 2.0, ..Disturbance::default() };
            let ahead = predictor.ahead(&state, 15.0, ticks, bound, &off);
            for torque in [13.0, 15.0, 17.0] {
                let mut there = Plant { load_rad: 0.0, ..plant };
                (0..ticks).for_each(|_| there.tick(torque, -15.0));
                let off = (ahead.load_rad as f64 - there.load_rad).abs();
                assert!(off <= ahead.bound_rad as f64, "{ticks} ticks: {off} {}", ahead.bound_rad);
            }
        }
    }

    /// A bounded disturbance drives the estimate no farther than its bound, and nearly as far where it is the worst
    /// one.
    #[test]
    fn the_observer_keeps_its_bound_and_can_come_near_it() {
        let off = Disturbance { torque_n_m: 0.5, load_change_n_m: 0.01, speed_rad_s: 1e-4, twist_rad: 1e-6 };
        for noise in [NOISE, Noise { twist_rad: None, ..NOISE }] {
            let predictor = TwoMassObserver::new(INERTIAS, noise, TICK_S).unwrap();
            let off = if noise.twist_rad.is_some() { off } else { Disturbance { twist_rad: 0.0, ..off } };
            let bound = predictor.state_bound(&off);
            let mut state = PredictorState::new();
            // The model itself is the truth, disturbed to one side, then at the pace of the spring.
            let mut truth = Vector4::zeros();
            let mut farthest = Vector4::zeros();
            for tick in 0..20_000 {
                let sign = if tick < 5000 { 1.0 } else { (tick as f32 * 0.2).sin().signum() };
                let model = predictor.model().unwrap();
                truth = model.a * truth + model.b * (10.0 + sign * off.torque_n_m);
                truth.w += if tick % 2 == 0 { off.load_change_n_m } else { -off.load_change_n_m };
                truth.w = truth.w.clamp(-50.0, 50.0);
                let measured = Measured {
                    torque_n_m: 10.0,
                    speed_rad_s: truth.y - sign * off.speed_rad_s,
                    twist_rad: truth.x - sign * off.twist_rad,
                };
                predictor.step(&mut state, &measured);
                let away = (truth - state.open()).abs();
                // Speeds grow without end here; their rounding does too.
                let rounding = Vector4::new(1e-9, 1e-6, 1e-6, 1e-4) * (1.0 + truth.y.abs());
                for (away, (bound, rounding)) in away.iter().zip(bound.iter().zip(rounding.iter())) {
                    assert!(*away <= bound + rounding, "{tick}: {away:e} {bound:e}");
                }
                farthest = farthest.zip_map(&away, f32::max);
            }
            assert!(farthest.zip_map(&Vector4::from(bound), |f, b| f / b).max() > 0.3, "{farthest} {bound:?}");
        }
    }

    /// Numbers between −1 and 1 that look random.
    struct Mixed(u64);

    impl Mixed {
        fn part(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) as f64 / (1u64 << 30) as f64 - 1.0
        }
    }

    /// The two inertias and the drive of the fixture, with its play followed in small steps in double precision.
    struct Joined {
        plant: Plant,
        motor_rad: f64,
        contact_rad: f64,
    }

    impl Joined {
        fn tick(&mut self, torque: f64, load: f64) -> f64 {
            let (before, twist) = (self.plant.load_rad, self.plant.x[0]);
            let (from, speed) = (self.motor_rad, self.plant.x[1]);
            self.plant.tick(torque, load);
            self.motor_rad += self.plant.load_rad - before - (self.plant.x[0] - twist);
            // Between the ends of the tick: as fast as at its start, at first.
            for place in [0.25, 0.5, 0.75] {
                let between = from + place * (self.motor_rad - from);
                let turned = from + place * TICK_S * speed;
                self.follow(place * turned + (1.0 - place) * between);
            }
            self.follow(self.motor_rad)
        }

        fn follow(&mut self, motor_rad: f64) -> f64 {
            use flexspline::Direction::{Backward, Forward};
            let torque = INERTIAS.stiffness_n_m_per_rad * self.plant.x[0];
            let [forward, backward] =
                [Forward, Backward].map(|side| fixture::error(motor_rad * 95.0, torque, 20.0, side, true));
            let half = 0.5 * (backward - forward);
            self.contact_rad = self.contact_rad.clamp(motor_rad - half, motor_rad + half);
            self.contact_rad + 0.5 * (forward + backward)
        }
    }

    /// Every bit of the joint: what lies ahead is what it was. A joint that is lost says nothing.
    #[test]
    fn no_single_bit_of_the_joint_changes_what_lies_ahead() {
        use flexspline::testing::Upset;
        let image = fixture::image(true);
        let twin = image.clone();
        let joint = Joint::new(fixture::drive(), fixture::LIMITS, Overrun::SkipAndCount).unwrap();
        let mut store = Store::new();
        store.activate(&Images::new(&image, &twin), &fixture::drive(), 20.0).unwrap();
        let observer = TwoMassObserver::new(INERTIAS, Noise { twist_rad: None, ..NOISE }, TICK_S).unwrap();
        let mut play = PlayState::unknown();
        for rad in [0.0, 1.0] {
            let _ = joint.forward(&store, &mut play, GeneratorAngle::ZERO.offset_rad(rad), 5.0);
        }
        let generator = GeneratorAngle::ZERO.offset_rad(1.01);
        let now = Now { generator, play: &play, measured: None, measured_bound_rad: 0.0 };
        let ask = |joint: &Joint| observer.output_ahead(joint, &store, &PredictorState::new(), &Ahead::default(), &now);
        let expected = ask(&joint);
        assert!(expected.quality == Quality::InRange && expected.bound_rad.is_finite());
        let hit = |joint: &mut Joint, bit| joint.flip(bit, &mut std::string::String::new());
        for bit in 0..joint.bits() {
            let mut one = joint;
            hit(&mut one, bit);
            assert_eq!(ask(&one), expected, "bit {bit}");
        }
        let mut lost = joint;
        [3, joint.bits() / 2 + 90].into_iter().for_each(|bit| hit(&mut lost, bit));
        assert!(lost.is_lost() && ask(&lost).bound_rad.is_infinite());
    }

    /// Twelve hundred drawn runs, half with the motor's encoder alone, half with one at the output: the output is where
    /// it was said to be, within the bound, and the bound is not empty.
    #[test]
    fn the_output_is_where_it_was_predicted() {
        let image = fixture::image(true);
        let twin = image.clone();
        let images = Images::new(&image, &twin);
        let missed = Table::check(&image).unwrap().projection_worst_rad() as f64;
        let joint = Joint::new(fixture::drive(), fixture::LIMITS, Overrun::SkipAndCount).unwrap();
        let mut store = Store::new();
        store.activate(&images, &fixture::drive(), 20.0).unwrap();
        let off = Disturbance { torque_n_m: 0.5, load_change_n_m: 0.05, speed_rad_s: 1e-4, twist_rad: 2e-6 };
        let (mut cases, mut outside, mut reversed) = (0, 0, 0);
        let mut shares = [0.0, 0.0];
        for with_encoder in [false, true] {
            let noise = if with_encoder { NOISE } else { Noise { twist_rad: None, ..NOISE } };
            let predictor = TwoMassObserver::new(INERTIAS, noise, TICK_S).unwrap();
            let state_bound = predictor.state_bound(&off);
            for seed in 0..600 {
                let mut mixed = Mixed(seed * 2 + with_encoder as u64);
                mixed.part();
                let mut load = -15.0 + 5.0 * mixed.part();
                let (pace, swing) = (0.01 + 0.005 * mixed.part(), 6.0 * mixed.part());
                let push = |tick: u64, load: f64| -load + swing * (tick as f64 * pace).cos();
                let mut truth = Joined {
                    plant: Plant { x: [load / 3e4, 0.0, 0.0], load_rad: 0.0 },
                    motor_rad: 0.02 * mixed.part(),
                    contact_rad: 1.0,
                };
                let mut state = PredictorState::of([(load / 3e4) as f32, 0.0, 0.0, load as f32]);
                let mut play = PlayState::unknown();
                let start = load;
                let mut output = 0.0;
                let ticks = 600 + (seed % 50);
                let generator = |truth: &Joined| GeneratorAngle::from_rad(95.0 * truth.motor_rad).unwrap();
                for tick in 0..ticks {
                    let torque = push(tick, start);
                    output = truth.tick(torque + 0.5 * mixed.part(), load);
                    load += 0.05 * mixed.part();
                    let measured = Measured {
                        torque_n_m: torque as f32,
                        speed_rad_s: (truth.plant.x[1] + 1e-4 * mixed.part()) as f32,
                        twist_rad: (truth.plant.x[0] + 2e-6 * mixed.part()) as f32,
                    };
                    predictor.step(&mut state, &measured);
                    let torque = INERTIAS.stiffness_n_m_per_rad as f32 * state.twist_rad();
                    let _ = joint.forward(&store, &mut play, generator(&truth), torque);
                }
                if !play.is_known() {
                    continue;
                }
                let horizon = 1 + (seed % 40) as u16;
                let torque = push(ticks, start);
                let ahead = predictor.ahead(&state, torque as f32, horizon, state_bound, &off);
                let measured = OutputAngle::from_rad(output + 1e-6 * mixed.part());
                let now = Now {
                    generator: generator(&truth),
                    play: &play,
                    measured: measured.filter(|_| with_encoder),
                    measured_bound_rad: 1e-6,
                };
                let said = predictor.output_ahead(&joint, &store, &state, &ahead, &now);
                assert_eq!(said.quality, Quality::InRange);
                let (from, sense) = (truth.motor_rad, truth.plant.x[1]);
                for _ in 0..horizon {
                    output = truth.tick(torque + 0.5 * mixed.part(), load);
                    load += 0.05 * mixed.part();
                }
                reversed += (truth.plant.x[1] * sense < 0.0) as u32;
                assert!((truth.motor_rad - from - ahead.motor_rad as f64).abs() <= ahead.motor_bound_rad as f64);
                let away = (said.output.to_rad() - output).abs();
                let bound = said.bound_rad as f64 + if with_encoder { 2.0 * missed } else { missed };
                cases += 1;
                outside += (away > bound) as u32;
                let share = &mut shares[with_encoder as usize];
                *share = f64::max(*share, away / bound);
            }
        }
        std::println!("{cases} cases, {outside} outside, {reversed} reversed, largest shares {shares:?}");
        assert!(cases > 1150 && reversed > 30, "{cases} {reversed}");
        assert!(1000 * outside <= cases, "{outside} of {cases}");
        // Not empty: some come near it, with random disturbances that hardly ever all pull one way.
        assert!(shares.iter().all(|&share| share > 0.05), "{shares:?}");
    }

    /// Unused values may be anything; used values must be finite numbers, of a drive.
    #[test]
    fn a_measurement_that_is_no_number_leaves_the_observer_as_it_was() {
        let good = Measured { torque_n_m: 12.0, speed_rad_s: 0.01, twist_rad: 4e-4 };
        let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e9];
        for noise in [NOISE, Noise { twist_rad: None, ..NOISE }] {
            let predictor = TwoMassObserver::new(INERTIAS, noise, TICK_S).unwrap();
            let (mut state, mut twin) = (PredictorState::new(), PredictorState::new());
            for tick in 0..200 {
                assert!(predictor.step(&mut state, &good) && predictor.step(&mut twin, &good));
                let wrong = bad[tick % bad.len()];
                for measured in [Measured { torque_n_m: wrong, ..good }, Measured { speed_rad_s: wrong, ..good }] {
                    assert!(!predictor.step(&mut state, &measured) && state == twin, "{measured:?}");
                }
                let measured = Measured { twist_rad: wrong, ..good };
                let used = predictor.step(&mut state, &measured);
                assert_eq!(used, noise.twist_rad.is_none());
                if used {
                    assert!(predictor.step(&mut twin, &good));
                }
                assert_eq!(state, twin);
            }
            // Nor is a value that is not finite reported.
            let ahead = predictor.ahead(&state, f32::NAN, 10, [0.0; 4], &Disturbance::default());
            assert!(ahead.bound_rad == f32::INFINITY && ahead.load_rad == 0.0);
        }
    }

    fn good_parts() -> [f32; PREDICTOR_PARTS] {
        TwoMassObserver::new(INERTIAS, NOISE, TICK_S).unwrap().parts()
    }

    #[test]
    fn what_makes_no_predictor_is_named() {
        let named = |inertias, noise, tick| match TwoMassObserver::new(inertias, noise, tick).unwrap_err() {
            PredictorError::Setting { name, .. } => name,
            error => panic!("{error}"),
        };
        assert_eq!(named(Inertias { load_kg_m2: 0.0, ..INERTIAS }, NOISE, 1e-3), "load_kg_m2");
        assert_eq!(named(INERTIAS, Noise { twist_rad: Some(f64::NAN), ..NOISE }, 1e-3), "twist_rad");
        assert_eq!(named(INERTIAS, NOISE, -1e-3), "tick_s");
        assert_eq!(
            TwoMassObserver::from_parts(&good_parts()),
            Ok(TwoMassObserver::new(INERTIAS, NOISE, TICK_S).unwrap())
        );
        for (place, value) in [
            (0, f32::NAN),
            (3, 1e-9),
            (15, 0.999),
            (17, f32::INFINITY),
            (19, 1e-3),
            (21, 5.0),
            (29, f32::NAN),
            (32, f32::INFINITY),
            (33, 0.0),
        ] {
            let mut parts = good_parts();
            parts[place] = value;
            assert!(TwoMassObserver::from_parts(&parts).is_err(), "{place}");
        }
        // One that was damaged on its way, or made for another machine.
        let good = TwoMassObserver::new(INERTIAS, NOISE, TICK_S).unwrap().model().unwrap();
        let wild = TwoMassModel { gain: good.gain * -3.0, ..good };
        assert!(matches!(wild.checked(), Err(PredictorError::Observer { factor }) if factor.is_nan() || factor > 1.0));
        let undefined = TwoMassModel { a: good.a * f32::NAN, ..good };
        assert!(undefined.checked().is_err());
    }
}
