//! One joint in its loop: the tick, what is added to the table, what is learnt beside it, and what lies ahead.

mod adapt;
mod adjustment;
mod aged;
mod feed_forward;
mod learning;
mod limits;
mod mode;
mod predictor;
mod runtime;
mod signals;
mod slip;
mod start_up;
mod state;
mod torque_path;

#[cfg(any(test, feature = "c-api"))]
pub(crate) use adapt::NO_COEFFICIENT;
pub use adapt::{
    AdaptCounters, AdaptError, AdaptRestoreError, AdaptSettings, Adapted, Coefficient, Learning, Seen, Term, Verdict,
    saved_adapt_bytes,
};
pub use adjustment::Adjustment;
pub use aged::Aged;
pub use feed_forward::MotionAhead;
pub use learning::{AdaptState, Adapter};
pub use limits::{Limits, SettingError};
pub use mode::{Mode, ModeError, Overrun};
pub use predictor::{
    Ahead, Disturbance, Inertias, Measured, Noise, Now, OutputAhead, PREDICTOR_PARTS, Predictor, PredictorError,
    PredictorState,
};
pub use runtime::Joint;
pub use signals::{Flags, Input, Output};
#[cfg(any(test, feature = "c-api"))]
pub(crate) use slip::NOBODY;
pub use slip::{
    LoadTorque, NominalOutput, Slip, SlipBank, SlipElement, SlipState, SlipVariable, TorqueSlipElement,
    saved_slip_bytes,
};
pub use start_up::{Implausible, Readings, StartUp, StartUpSettings, StartUpStep};
#[cfg(any(test, feature = "c-api"))]
pub(crate) use state::owner;
pub use state::{JointState, RestoreError, SAVED_JOINT_BYTES};
pub use torque_path::{TorquePath, TorqueReading, TorqueSettings};
