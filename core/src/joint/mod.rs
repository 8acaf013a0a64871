//! One joint in its loop: the tick, what feeds it, and what is added to its table.

mod adjustment;
mod aged;
mod feed_forward;
mod limits;
mod mode;
mod output_reading;
mod runtime;
mod signals;
mod start_up;
mod state;
mod torque_path;

pub use adjustment::{Adjustment, bounded, uncertainty_counts};
pub use aged::Aged;
pub use limits::{Limits, SettingError};
pub use mode::{Mode, ModeError, Overrun};
pub use output_reading::{Located, TorqueFromWindUp};
pub use runtime::Joint;
pub use signals::{Flags, Implausible, Input, Output};
pub use start_up::{Readings, StartUp, StartUpSettings, StartUpStep};
pub use state::{JointState, RestoreError, opened, owner};
pub use torque_path::{TorquePath, TorqueReading, TorqueSettings};
