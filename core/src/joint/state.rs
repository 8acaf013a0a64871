//! What changes while a joint runs, and what of it survives a reset.

use super::mode::{Mode, ModeError};
use crate::angle::{GeneratorAngle, OutputAngle};
use crate::crc::crc32;
use crate::play::{MOST_ERROR_COUNTS, PlayState, SAVED_STATE_BYTES};

/// Parts of a count that the correction is kept in: the difference of any two corrections fits 32 bits.
pub(super) const FINE: i32 = 8;
/// No table with its adjustment gives a larger correction, and no joint a faster one, fine counts.
pub(super) const MOST_FINE: u32 = MOST_ERROR_COUNTS * FINE as u32;

/// What changes while a joint runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState {
    pub(super) play: PlayState,
    /// Mean of the last adjustment, counts.
    pub(super) adjusted: i32,
    /// Output of the play and the last adjustment, added up: once more.
    pub(super) output: OutputAngle,
    pub(super) generator: GeneratorAngle,
    /// The correction in fine counts, twice.
    pub(super) correction: [i32; 2],
    /// What is wanted, and what of it was asked of the limiter.
    pub(super) goal: i32,
    pub(super) aimed: i32,
    pub(super) speed: i32,
    /// Ticks in a row with a glitch, and without a correction.
    pub(super) glitches: u32,
    pub(super) uncorrected: u32,
    pub(super) fading: u32,
    pub(super) missed_ticks: u32,
    pub(super) mode: Mode,
    pub(super) started: bool,
}

/// Size of a saved joint state.
pub const SAVED_JOINT_BYTES: usize = SAVED_STATE_BYTES + 12;

impl Default for JointState {
    fn default() -> Self {
        Self::new()
    }
}

impl JointState {
    /// After a reset: no correction, the side of the play unknown, off.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            play: PlayState::unknown(),
            adjusted: 0,
            output: OutputAngle::ZERO,
            generator: GeneratorAngle::ZERO,
            correction: [0; 2],
            goal: 0,
            aimed: 0,
            speed: 0,
            glitches: 0,
            uncorrected: 0,
            fading: 0,
            missed_ticks: 0,
            mode: Mode::Off,
            started: false,
        }
    }

    /// The mode.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// Changes the mode from the next tick on.
    ///
    /// # Errors
    /// [`ModeError`] if [`Mode::may_become`] says no; the mode stays.
    pub const fn request(&mut self, to: Mode) -> Result<(), ModeError> {
        if !self.mode.may_become(to) {
            return Err(ModeError { from: self.mode, to });
        }
        self.mode = to;
        Ok(())
    }

    /// What [`Self::output`] must be.
    #[inline(always)]
    pub(super) const fn told_twice(&self) -> OutputAngle {
        self.play.output_or_zero().offset_counts(self.adjusted as i64)
    }

    /// The play.
    #[must_use]
    pub const fn play(&self) -> &PlayState {
        &self.play
    }

    /// Ticks missed since the start; wraps.
    #[must_use]
    pub const fn missed_ticks(&self) -> u32 {
        self.missed_ticks
    }

    /// What must survive a reset: the play and the correction, with checksums.
    #[must_use]
    pub fn save(&self) -> [u8; SAVED_JOINT_BYTES] {
        let mut bytes = [0; SAVED_JOINT_BYTES];
        let [correction, _] = self.correction;
        let parts = self.play.save().into_iter().chain(correction.to_le_bytes()).chain(self.speed.to_le_bytes());
        for (to, from) in bytes.iter_mut().zip(parts) {
            *to = from;
        }
        if let Some((before, sum)) = bytes.split_last_chunk_mut::<4>() {
            *sum = crc32(before).to_le_bytes();
        }
        bytes
    }

    /// A state from [`Self::save`], in [`Mode::Off`] with the correction still there; `None` if the bytes are damaged.
    ///
    /// Restore only if the joint cannot have moved meanwhile, else start from [`Self::new`]. Ask for [`Mode::Tracking`] before
    /// the first tick to keep the correction.
    #[must_use]
    pub fn restore(bytes: &[u8; SAVED_JOINT_BYTES]) -> Option<Self> {
        let (before, sum) = bytes.split_last_chunk::<4>()?;
        let (play, rest) = before.split_first_chunk::<SAVED_STATE_BYTES>()?;
        let (correction, speed) = rest.split_first_chunk::<4>()?;
        let correction = i32::from_le_bytes(*correction);
        let speed = i32::from_le_bytes(*speed.first_chunk::<4>()?);
        let play = PlayState::restore(play)?;
        let possible = correction.unsigned_abs() <= MOST_FINE && speed.unsigned_abs() <= MOST_FINE;
        let intact = crc32(before) == u32::from_le_bytes(*sum) && possible;
        let state = Self {
            play,
            output: play.output_or_zero(),
            correction: [correction; 2],
            goal: correction,
            aimed: correction,
            speed,
            ..Self::new()
        };
        intact.then_some(state)
    }
}
