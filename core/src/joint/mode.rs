//! Use of the correction: by mode, and in a tick that came late.

use core::fmt;

/// Use of the correction by a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mode {
    /// No correction: it is taken back within the limits. The start.
    Off,
    /// The correction follows the table.
    Tracking,
    /// The correction stays as it is; withdrawn where none could be made for `debounce_ticks`, it stays so.
    Hold,
    /// No correction, and none before [`Mode::Off`] was asked for: after a fault.
    Safe,
}

/// A transition that is not legal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModeError {
    /// The mode now.
    pub from: Mode,
    /// The mode asked for.
    pub to: Mode,
}

impl fmt::Display for ModeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no transition from {:?} to {:?}", self.from, self.to)
    }
}

impl core::error::Error for ModeError {}

impl Mode {
    /// As a number: of telemetry, of the C interface, of what is kept.
    #[must_use]
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// From its number; safe for any that is none.
    #[must_use]
    pub const fn from_code(code: u32) -> Self {
        match code {
            0 => Self::Off,
            1 => Self::Tracking,
            2 => Self::Hold,
            _ => Self::Safe,
        }
    }

    /// Whether `self` may be followed by `to`: everything may stop, tracking starts from off or hold, hold only from
    /// tracking, and safe is left to off alone.
    #[must_use]
    pub const fn may_become(self, to: Self) -> bool {
        matches!(
            (self, to),
            (_, Self::Safe | Self::Off)
                | (Self::Off | Self::Tracking | Self::Hold, Self::Tracking)
                | (Self::Tracking | Self::Hold, Self::Hold)
        )
    }
}

/// Effect of a late tick on the correction in tracking and hold, where some can be made. Missed ticks are counted with
/// each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overrun {
    /// Nothing more: the ticks missed are skipped.
    SkipAndCount,
    /// The correction stays as it is in this tick.
    HoldLast,
    /// The correction fades to none within this number of ticks, however many come late, stays there for as many after
    /// the last late one, and comes back.
    FadeOut {
        /// Ticks, at least 1.
        ticks: u16,
    },
}
