//! State of a running joint, and the part of it that survives a reset.

use super::mode::{Mode, ModeError};
use super::runtime::Joint;
use crate::angle::GeneratorAngle;
use crate::crc::{seal, unseal};
use crate::play::{MOST_ERROR_COUNTS, PlayState};
use crate::store::Store;
use crate::whole::{SUMS_START, high, low, pair, same, sums};
use core::fmt;

/// Parts of a count that the correction is kept in: the difference of any two corrections fits 32 bits.
pub(super) const FINE: i32 = 8;
/// No table with its adjustment gives a larger correction, and no joint a faster one, fine counts.
pub(super) const MOST_FINE: u32 = MOST_ERROR_COUNTS * FINE as u32;

/// State of a running joint: two copies with sums over each, so that an upset of one is noticed and mended in
/// the next tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState {
    copies: [SealedState; 2],
    /// Reported in telemetry only; does not influence the tick.
    missed_ticks: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct SealedState {
    kept: Kept,
    samples: LastSamples,
    sums: [u32; 2],
}

/// Values that a tick changes: 64 bytes, the most that is copied without a call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kept {
    pub play: PlayState,
    /// Mean of the last adjustment, counts.
    pub adjusted: i32,
    /// The last sample that was believed.
    pub generator: GeneratorAngle,
    /// The correction, fine counts.
    pub correction: i32,
    /// Wanted correction.
    pub goal: i32,
    /// Change of the correction in the last tick.
    pub speed: i32,
    /// Ticks in a row with a glitch, and without a correction.
    pub glitches: u16,
    pub uncorrected: u16,
    pub fading: u32,
    /// Mode, what samples there were, and towards which flank the last motion went; a whole word, of which every bit
    /// means something or is zero.
    pub marks: u32,
}

/// How the generator moved last, copied apart from the other values for the same reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LastSamples {
    /// Way of the generator in the last tick, and how much it was longer than that in the tick before, counts: of
    /// samples that were believed ([`IN_A_ROW`]).
    pub step: i32,
    pub bend: i32,
    /// Bounds of the play as if the last sample had not moved it.
    pub free: [i32; 2],
}

/// Bits of the marks: mode.
pub(super) const MODE: u32 = 3;
/// No sample yet after a reset; one that is saved, to hold the first against; a sample.
pub(super) const SEEN: u32 = 3 << 2;
const SAVED: u32 = 1 << 2;
pub(super) const SAMPLED: u32 = 2 << 2;
/// The flank that the last motion went to: none yet, that of forward, that of backward motion.
pub(super) const FLANK: u32 = 3 << 4;
pub(super) const FLANK_FORWARD: u32 = 1 << 4;
pub(super) const FLANK_BACKWARD: u32 = 2 << 4;
/// The state was mended since the last tick, which the next has to report.
pub(super) const MENDED: u32 = 1 << 6;
/// Bits by definition: a bit for each of the last ticks in a row whose samples were believed, up to three. With the
/// second there is a step, with the third a bend.
pub(super) const IN_A_ROW: u32 = 7 << 7;
/// The first of them, by definition.
pub(super) const FIRST_IN_A_ROW: u32 = 1 << 7;
/// From the second to the sign of a word, by definition.
pub(super) const STEP_TO_SIGN: u32 = 31 - 8;
/// From the third to the sign of a word, by definition.
pub(super) const BEND_TO_SIGN: u32 = 31 - 9;
/// The flank before the last sample, as that of the last motion.
pub(super) const FLANK_BEFORE: u32 = FLANK << FLANK_SHIFT;
/// To those bits, by definition.
pub(super) const FLANK_SHIFT: u32 = 6;
/// Ticks in a row without a sample, those missed among them; up to all ones.
pub(super) const GAP: u32 = 15 << 12;
/// In the upper half, by definition: ticks since three samples in a row were believed.
pub(super) const UNSEEN: u32 = u32::MAX << 16;

impl Kept {
    /// After a reset: no correction, the side of the play unknown, off.
    const NEW: Self = Self {
        play: PlayState::unknown(),
        adjusted: 0,
        generator: GeneratorAngle::ZERO,
        correction: 0,
        goal: 0,
        speed: 0,
        glitches: 0,
        uncorrected: 0,
        fading: 0,
        marks: Mode::Off.code(),
    };
    /// Neither copy is whole.
    const LOST: Self = Self { marks: Mode::Safe.code(), ..Self::NEW };

    #[inline(never)]
    const fn sums(&self, samples: &LastSamples) -> u64 {
        let (nominal, [error, lower, upper, half]) = self.play.parts();
        let LastSamples { step, bend, free: [free_lower, free_upper] } = *samples;
        sums!(
            SUMS_START;
            low(nominal),
            high(nominal),
            error as u32,
            lower as u32,
            upper as u32,
            half as u32,
            self.adjusted as u32,
            low(self.generator.counts()),
            high(self.generator.counts()),
            self.correction as u32,
            self.goal as u32,
            self.speed as u32,
            self.glitches as u32 | (self.uncorrected as u32) << 16,
            self.fading,
            self.marks,
            step as u32,
            bend as u32,
            free_lower as u32,
            free_upper as u32,
        )
    }

    #[inline(always)]
    const fn sealed(self) -> SealedState {
        let samples = LastSamples::NONE;
        SealedState { kept: self, samples, sums: pair(self.sums(&samples)) }
    }

    #[inline(always)]
    pub(super) const fn mode(&self) -> Mode {
        Mode::from_code(self.marks & MODE)
    }

    /// The mark of what samples there were.
    #[inline(always)]
    pub(super) const fn seen(&self) -> u32 {
        self.marks & SEEN
    }

    /// Ticks since three samples in a row were believed, up to 65 535.
    #[inline(always)]
    pub(super) const fn unseen(&self) -> u32 {
        self.marks >> UNSEEN.trailing_zeros()
    }
}

impl LastSamples {
    /// Before two samples.
    const NONE: Self = Self { step: 0, bend: 0, free: [0; 2] };
}

impl SealedState {
    #[inline(always)]
    const fn is_whole(&self) -> bool {
        same(pair(self.kept.sums(&self.samples)), self.sums)
    }
}

/// First bytes of a saved state; the last byte is the version.
const SAVED_MARK: [u8; 4] = *b"FXJ\x01";

/// Why saved bytes are no state of this joint with this table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestoreError {
    /// Of another kind or version.
    Version {
        /// The first bytes; of a joint `FXJ` and 1 are read, of springs `FXS` and 2.
        found: [u8; 4],
    },
    /// The CRC-32 does not match: damaged, or not written to the end.
    Crc,
    /// Saved with another table.
    OtherTable,
    /// Saved by a joint of another drive or with other settings.
    OtherJoint,
    /// Numbers that no joint can have saved.
    Impossible,
}

impl fmt::Display for RestoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Version { found } => {
                write!(f, "saved state begins with {found:02x?}: it is of another kind or version")
            }
            Self::Crc => f.write_str("the saved state is damaged"),
            Self::OtherTable => f.write_str("the state was saved with another table"),
            Self::OtherJoint => f.write_str("the state was saved by another joint"),
            Self::Impossible => f.write_str("no joint can have saved this state"),
        }
    }
}

impl core::error::Error for RestoreError {}

/// Table and joint that something saved belongs to.
pub fn owner(joint: &Joint, store: &Store) -> [u32; 4] {
    let [a, b, c, d, e, f, g, h] = store.id().0;
    let [turned, added] = joint.sums();
    [u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]), turned, added]
}

/// Words of something saved behind its mark and its owner, which must be these.
pub fn opened(bytes: &[u8], mark: [u8; 4], owner: [u32; 4]) -> Result<impl FnMut() -> u32, RestoreError> {
    let found = bytes.first_chunk::<4>().copied().unwrap_or_default();
    if found != mark {
        return Err(RestoreError::Version { found });
    }
    let mut next = unseal(bytes).ok_or(RestoreError::Crc)?;
    let (_, table, settings) = (next(), [next(), next()], [next(), next()]);
    let [low, high, turned, added] = owner;
    if table != [low, high] {
        return Err(RestoreError::OtherTable);
    }
    if settings != [turned, added] {
        return Err(RestoreError::OtherJoint);
    }
    Ok(next)
}

/// How a state was found.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum CopyStatus {
    Whole,
    /// One copy was not whole; the other was taken.
    Mended,
    /// Neither was whole: all but the correction is what it is after a reset, and the mode is safe.
    Lost,
}

impl Default for JointState {
    fn default() -> Self {
        Self::new()
    }
}

impl JointState {
    /// Bytes of a saved state.
    pub const SAVED_BYTES: usize = 72;
    const NEW: [SealedState; 2] = [Kept::NEW.sealed(); 2];

    /// After a reset: no correction, the side of the play unknown, off.
    #[must_use]
    pub const fn new() -> Self {
        Self { copies: Self::NEW, missed_ticks: 0 }
    }

    /// Values of the copy that is whole.
    #[inline(always)]
    pub(super) fn open(&self) -> (Kept, LastSamples, CopyStatus) {
        let [first, _] = &self.copies;
        // Copied once.
        let (mut kept, mut samples, mut found) = (first.kept, first.samples, CopyStatus::Whole);
        if !first.is_whole() {
            found = self.open_other(&mut kept, &mut samples);
        }
        (kept, samples, found)
    }

    #[cold]
    #[inline(never)]
    fn open_other(&self, kept: &mut Kept, samples: &mut LastSamples) -> CopyStatus {
        let [first, second] = &self.copies;
        if second.is_whole() {
            (*kept, *samples) = (second.kept, second.samples);
            return CopyStatus::Mended;
        }
        let (one, other) = (first.kept.correction, second.kept.correction);
        // What both have is likely to be what is commanded, and taken back within the limits.
        let correction = if one == other && one.unsigned_abs() <= MOST_FINE { one } else { 0 };
        (*kept, *samples) = (Kept { correction, goal: correction, ..Kept::LOST }, LastSamples::NONE);
        CopyStatus::Lost
    }

    /// Keeps what a tick leaves.
    #[inline(always)]
    pub(super) const fn close(&mut self, kept: &Kept, samples: &LastSamples) {
        let sums = pair(kept.sums(samples));
        let [first, second] = &mut self.copies;
        first.kept = *kept;
        first.samples = *samples;
        first.sums = sums;
        second.kept = *kept;
        second.samples = *samples;
        second.sums = sums;
    }

    /// The copy that is whole, for a look: as the last tick left it.
    const fn kept(&self) -> &Kept {
        match &self.copies {
            [first, _] if first.is_whole() => &first.kept,
            [_, second] if second.is_whole() => &second.kept,
            _ => &Kept::LOST,
        }
    }

    /// The mode; safe where the state is lost.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.kept().mode()
    }

    /// Changes the mode from the next tick on.
    ///
    /// # Errors
    /// [`ModeError`] if [`Mode::may_become`] says no; the mode stays.
    pub fn request(&mut self, to: Mode) -> Result<(), ModeError> {
        let (mut kept, samples, found) = self.open();
        let from = kept.mode();
        if !from.may_become(to) {
            return Err(ModeError { from, to });
        }
        kept.marks = kept.marks & !MODE | to.code();
        self.keep(kept, &samples, found);
        Ok(())
    }

    /// On command: which side of the play the drive rests on is not known any more, as after work on it.
    pub fn forget_side(&mut self) {
        let (mut kept, samples, found) = self.open();
        kept.play = PlayState::unknown();
        kept.marks &= !(FLANK | IN_A_ROW);
        self.keep(kept, &samples, found);
    }

    /// Keeps it between two ticks: what was found not to be whole the next one has to report.
    fn keep(&mut self, mut kept: Kept, samples: &LastSamples, found: CopyStatus) {
        kept.marks |= if found == CopyStatus::Whole { 0 } else { MENDED };
        self.close(&kept, samples);
    }

    /// The play; unknown where the state is lost.
    pub const fn play(&self) -> &PlayState {
        &self.kept().play
    }

    /// Ticks missed since the start; wraps.
    #[must_use]
    pub const fn missed_ticks(&self) -> u32 {
        self.missed_ticks
    }

    /// Counts ticks that were missed.
    #[inline(always)]
    pub(super) const fn missed(&mut self, ticks: u16) {
        self.missed_ticks = self.missed_ticks.wrapping_add(ticks as u32);
    }

    /// Data that must survive a reset: play, correction and the last sample, with version, table and joint, and a
    /// CRC-32 over all of it.
    ///
    /// | offset | type | what |
    /// |---|---|---|
    /// | 0 | 4 bytes | `FXJ`, version 1 |
    /// | 4 | 8 bytes | id of the table |
    /// | 12 | 2 × `u32` | sums of the joint's settings |
    /// | 20 | `i64` | nominal output, counts of 2⁻³² turn, as all that follows |
    /// | 28 | 4 × `i32` | error; bounds of the offset in the play; half-width |
    /// | 44 | `i32` | mean of the last adjustment |
    /// | 48 | `i64` | generator |
    /// | 56 | 2 × `i32` | correction and its change in a tick, eighths of a count |
    /// | 64 | `u32` | flank: 0 none, 16 forward, 32 backward |
    /// | 68 | `u32` | CRC-32 of the 68 bytes before |
    #[must_use]
    pub fn save(&self, joint: &Joint, store: &Store) -> [u8; Self::SAVED_BYTES] {
        let (kept, _, found) = self.open();
        let (nominal, [error, lower, upper, half]) = kept.play.parts();
        let generator = kept.generator.counts();
        let [table, more, turned, added] = owner(joint, store);
        let words = [
            u32::from_le_bytes(SAVED_MARK),
            table,
            more,
            turned,
            added,
            low(nominal),
            high(nominal),
            error as u32,
            lower as u32,
            upper as u32,
            half as u32,
            kept.adjusted as u32,
            low(generator),
            high(generator),
            kept.correction as u32,
            kept.speed as u32,
            kept.marks & FLANK,
        ];
        let mut bytes = [0; Self::SAVED_BYTES];
        seal(&mut bytes, words);
        if found == CopyStatus::Lost {
            // It is not to come back as one that was saved.
            bytes.iter_mut().rev().take(4).for_each(|byte| *byte = !*byte);
        }
        bytes
    }

    /// A state from [`Self::save`], in [`Mode::Off`] with the correction still there, for the same joint with the same
    /// table.
    ///
    /// The first sample is held against the one that was saved: if the generator is further away than a tick allows, it
    /// is a glitch, and if it stays there the side of the play is unknown. Until there is a sample nothing is corrected
    /// anew. Restore only if the joint cannot have moved meanwhile, else start from [`Self::new`]. Ask for
    /// [`Mode::Tracking`] before the first tick to keep the correction.
    ///
    /// # Errors
    /// [`RestoreError`]; then [`Self::new`] is left.
    pub fn restore(bytes: &[u8; Self::SAVED_BYTES], joint: &Joint, store: &Store) -> Result<Self, RestoreError> {
        let mut next = opened(bytes, SAVED_MARK, owner(joint, store))?;
        let nominal = next() as i64 | (next() as i64) << 32;
        let parts = [next(), next(), next(), next()].map(|part| part as i32);
        let play = PlayState::of(nominal, parts).ok_or(RestoreError::Impossible)?;
        let adjusted = next() as i32;
        let generator = next() as i64 | (next() as i64) << 32;
        let ([correction, speed], flank) = ([next(), next()].map(|fine| fine as i32), next());
        let small = [correction, speed].iter().all(|fine| fine.unsigned_abs() <= MOST_FINE);
        // A side is rested on once there was a sample, and forgotten with the play.
        let one_flank = flank & !FLANK == 0 && flank != FLANK && (flank == 0 || play.is_started());
        if !small || !one_flank || adjusted.unsigned_abs() > MOST_ERROR_COUNTS {
            return Err(RestoreError::Impossible);
        }
        let kept = Kept {
            play,
            adjusted,
            generator: GeneratorAngle::from_counts(generator),
            correction,
            goal: correction,
            speed,
            marks: Mode::Off.code() | SAVED | flank,
            ..Kept::NEW
        };
        // Before any sample there is none to hold the first against.
        let kept = if play.is_started() { kept } else { Kept { marks: Mode::Off.code(), ..kept } };
        Ok(Self { copies: [kept.sealed(); 2], missed_ticks: 0 })
    }
}

const _: () = assert!(size_of::<Kept>() == 64);

bits_of!(JointState { copies, missed_ticks });
bits_of!(SealedState { kept, samples, sums });
bits_of!(Kept { play, adjusted, generator, correction, goal, speed, glitches, uncorrected, fading, marks });
bits_of!(LastSamples { step, bend, free });
