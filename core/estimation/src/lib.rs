//! Motion of a strain wave drive that its table does not have: estimators that hand an [`Adjustment`] to the next tick
//! of the joint, and nothing else.
//!
//! An encoder at the output, or a star or beacon now and then, teaches a few coefficients ([`OnlineCalibration`]):
//! ```
//! use flexspline::*;
//! use flexspline_estimation::*;
//!
//! let mean = Coefficient { term: Term::Mean, limit: 2e-4, initial_std: 1e-4 };
//! let half = Coefficient { term: Term::HalfWidth, limit: 5e-5, initial_std: 2e-5 };
//! let settings = AdaptSettings {
//!     coefficients: [mean, half], noise_rad: 2e-6, memory_measurements: 1e4, gate: 5.0, settle_rad: 1e-5,
//!     torque_limit_n_m: 0.0,
//! };
//! # let drive = Drive::new(188, 190, FixedMember::Flexspline).unwrap();
//! # let limits = Limits {
//! #     tick_s: 1e-3, rate_rad_s: 0.05, acceleration_rad_s2: 5.0, generator_rate_rad_s: 600.0, debounce_ticks: 5,
//! #     deadband_rad: 1e-6,
//! # };
//! # let joint = Joint::new(drive, limits, Overrun::SkipAndCount).unwrap();
//! # let store = Store::new();
//! let adapter = OnlineCalibration::new(&settings, &joint, &store, 0)?; // after the table is activated
//! let mut learnt = adapter.start();
//! learnt.set_learning(Learning::On);
//! // Each tick, after `Joint::tick`: the adjustment for the input of the next.
//! let mut after_tick = |input: &Input, output: &Output, play: &PlayState, measured: Option<OutputAngle>| {
//!     adapter.update(&mut learnt, &Seen { input, output, play, measured }).adjustment
//! };
//! # let output = Output { command: GeneratorAngle::ZERO, output: OutputAngle::ZERO, transmission_error_rad: 0.0,
//! #     uncertainty_rad: 0.0,
//! #     correction_rad: 0.0, held_back_rad: 0.0, quality: Quality::InRange, flags: Flags::default() };
//! # let input = Input {
//! #     generator: Some(GeneratorAngle::ZERO), target: OutputAngle::ZERO, torque_n_m: 0.0, missed_ticks: 0,
//! #     adjustment: Adjustment::default(),
//! # };
//! # let next = after_tick(&input, &output, &PlayState::unknown(), Some(OutputAngle::ZERO.offset_rad(5e-4)));
//! # assert!(next.mean_counts() > 0);
//! # Ok::<(), AdaptError>(())
//! ```
//! Elastic hysteresis, as springs that slip ([`MaxwellSlip`]), over the nominal output or over the torque:
//! ```
//! use flexspline::*;
//! use flexspline_estimation::*;
//!
//! let spring = |width_n_m, gain_rad_per_n_m| TorqueSlipElement { width_n_m, gain_rad_per_n_m };
//! let bank = MaxwellSlip::of_torque([spring(2.0, 4e-6), spring(10.0, 1.5e-6)]).ok_or("widths")?;
//! let mut springs = SlipState::unknown();
//! for torque_n_m in [0.0, 30.0, 5.0] {
//!     let slip = bank.update(&mut springs, torque_n_m);
//!     let _adjustment = slip.added_to(Adjustment::default());
//! }
//! assert!(springs.is_known());
//! # Ok::<(), &str>(())
//! ```
//! Where the output will be some ticks from now, with the table as the output map of two inertias
//! ([`TwoMassObserver`]):
//! ```
//! use flexspline::*;
//! use flexspline_estimation::*;
//!
//! fn in_ten_ticks(
//!     joint: &Joint, store: &Store, predictor: &TwoMassObserver, state: &PredictorState, now: &Now,
//! ) -> OutputAhead {
//!     let off = Disturbance { torque_n_m: 0.5, load_change_n_m: 0.05, ..Disturbance::default() };
//!     let state_bound = [2e-6, 1e-4, 1e-3, 0.5]; // from `TwoMassObserver::state_bound`, once
//!     let ahead = predictor.ahead(state, 12.0, 10, state_bound, &off);
//!     predictor.output_ahead(joint, store, state, &ahead, now)
//! }
//! let inertias = Inertias {
//!     motor_kg_m2: 1.0, load_kg_m2: 3.0, stiffness_n_m_per_rad: 3e4, damping_n_m_s_per_rad: 20.0,
//! };
//! let noise = Noise { torque_n_m: 0.5, load_change_n_m: 0.2, speed_rad_s: 1e-4, twist_rad: None };
//! let predictor = TwoMassObserver::new(inertias, noise, 1e-3)?;
//! # let _ = (predictor, in_ten_ticks);
//! # Ok::<(), PredictorError>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::arithmetic_side_effects,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable,
        clippy::todo,
        clippy::unimplemented
    )
)]

mod adapt;
mod maxwell_slip;
mod online_calibration;
mod two_mass_observer;

pub use adapt::{
    AdaptCounters, AdaptError, AdaptRestoreError, AdaptSettings, Adapted, Coefficient, Learning, Seen, Term, Verdict,
    saved_adapt_bytes,
};
pub use maxwell_slip::{
    LoadTorque, MaxwellSlip, NominalOutput, Slip, SlipElement, SlipState, SlipVariable, TorqueSlipElement,
    saved_slip_bytes,
};
pub use online_calibration::{AdaptState, OnlineCalibration};
pub use two_mass_observer::{
    Ahead, Disturbance, Inertias, Measured, Noise, Now, OutputAhead, PREDICTOR_PARTS, PredictorError, PredictorState,
    TwoMassObserver,
};
#[doc(hidden)] // For the C interface, which has a fixed number of places.
pub use {adapt::NO_COEFFICIENT, maxwell_slip::NOBODY};

/// Old name of [`OnlineCalibration`].
#[deprecated(since = "0.1.0", note = "named OnlineCalibration")]
pub type Adapter<const N: usize> = OnlineCalibration<N>;
/// Old name of [`MaxwellSlip`].
#[deprecated(since = "0.1.0", note = "named MaxwellSlip")]
pub type SlipBank<const N: usize, V = NominalOutput> = MaxwellSlip<N, V>;
/// Old name of [`TwoMassObserver`].
#[deprecated(since = "0.1.0", note = "named TwoMassObserver")]
pub type Predictor = TwoMassObserver;

#[cfg(doc)]
use flexspline::Adjustment;

#[cfg(test)]
extern crate std;
