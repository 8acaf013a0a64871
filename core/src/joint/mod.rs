//! One joint in its loop: the tick, what is added to the table, what is learnt beside it, and what lies ahead.

mod adapt;
mod predictor;
mod runtime;
mod slip;

pub use adapt::{
    AdaptCounters, AdaptError, AdaptSettings, AdaptState, Adapted, Adapter, Coefficient, Learning, Seen, Term, Verdict,
    saved_adapt_bytes,
};
pub use predictor::{
    Ahead, Disturbance, Inertias, Measured, Noise, Now, OutputAhead, PREDICTOR_PARTS, Predictor, PredictorError,
    PredictorState,
};
pub use runtime::{
    Adjustment, Flags, Input, Joint, JointState, Limits, Mode, ModeError, Output, Overrun, RateGroup,
    SAVED_JOINT_BYTES, SettingError,
};
pub use slip::{
    FittedSlip, LoadTorque, NominalOutput, Slip, SlipBank, SlipElement, SlipState, SlipVariable, TorqueSlipElement,
    saved_slip_bytes,
};
