//! Input and output of a tick.

use super::adjustment::Adjustment;
use crate::angle::{GeneratorAngle, OutputAngle};
use crate::table::Quality;

/// One tick's measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Generator angle; `None` if there is no sample.
    pub generator: Option<GeneratorAngle>,
    /// Where the output shall be.
    pub target: OutputAngle,
    /// Load torque at the output, N·m, positive when it turns the output forward: that in the mesh, with the drag added
    /// that the table was made with ([`TorquePath`](crate::TorquePath) makes it of a reading).
    pub torque_n_m: f32,
    /// Ticks that were missed since the last call.
    pub missed_ticks: u16,
    /// Added to the table in this tick; `Adjustment::default()` for none.
    pub adjustment: Adjustment,
}

/// Events of a tick; a set of the constants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Flags(u16);

impl Flags {
    /// There was no sample.
    pub const SAMPLE_LOST: Self = Self(1);
    /// The sample was not believed; or it was, and what the one before it did to the play was taken back.
    pub const GLITCH: Self = Self(2);
    /// The tick came late.
    pub const OVERRUN: Self = Self(4);
    /// The correction is not what the table wants: the limiter, the mode (off, safe, hold) or the overrun policy holds
    /// it back.
    pub const HELD_BACK: Self = Self(8);
    /// No correction could be made; the last one is kept or fades out.
    pub const NOT_CORRECTED: Self = Self(16);
    /// The words read of the table differed between the copies, or the store's data on it was corrupt. It was
    /// made anew and the tick done again, so the answer is sound, unless [`Self::NOT_CORRECTED`] is set too: then it
    /// could not be mended, and was not used. Also set, with that one, where the table is for another drive than the
    /// joint.
    pub const TABLE_DOUBT: Self = Self(32);
    /// The state was not whole, and was taken from its other copy; where neither was whole the joint is in
    /// [`Mode::Safe`](crate::Mode::Safe).
    pub const STATE_TORN: Self = Self(64);
    /// Settings of the joint in memory are not whole. Those of the other copy are used until the joint is made anew
    /// ([`Joint::mend`](crate::Joint::mend)); if neither is whole the command is the last sample that was believed (0
    /// before the first), and nothing is corrected.
    pub const JOINT_TORN: Self = Self(128);
    /// The joint is in [`Mode::Safe`](crate::Mode::Safe): no correction is made.
    pub const SAFE: Self = Self(256);
    /// An image is not the one that was activated, or both are the same one: copies are made anew from the other, or
    /// not at all.
    pub const OTHER_IMAGES: Self = Self(512);
    /// The adjustment of the input was larger than [`Adjustment::MAX_COUNTS`](crate::Adjustment::MAX_COUNTS) and was
    /// taken at that: what made it (learning, springs, a model) is not sound.
    pub const BOUNDED: Self = Self(1024);
    /// Within a tick: it has to be done again.
    pub(super) const AGAIN: Self = Self(1 << 15);

    /// Whether all of `other` are set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// The flags as bits, for telemetry.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// From bits, those of no flag left out.
    #[must_use]
    pub const fn of_bits(bits: u16) -> Self {
        Self(bits & !Self::AGAIN.0)
    }

    #[inline(always)]
    pub(crate) const fn with(self, other: Self, set: bool) -> Self {
        Self(self.0 | (set as u16).wrapping_shl(other.0.trailing_zeros()))
    }
}

/// Implausible readings of the sensors; a set of the constants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Implausible(u16);

impl Implausible {
    /// The generator's encoder gave no sample.
    pub const GENERATOR_LOST: Self = Self(1);
    /// The generator's encoder did not move.
    pub const GENERATOR_STILL: Self = Self(2);
    /// The generator's encoder moved the other way.
    pub const GENERATOR_SIGN: Self = Self(4);
    /// The generator's encoder moved by another way: counts in a turn, unit, or a motor that does not follow.
    pub const GENERATOR_RATIO: Self = Self(8);
    /// The output did not move.
    pub const OUTPUT_STILL: Self = Self(16);
    /// The output moved the other way.
    pub const OUTPUT_SIGN: Self = Self(32);
    /// The output moved by another way than the ratio says: unit, ratio, or the member that is fixed.
    pub const OUTPUT_RATIO: Self = Self(64);
    /// The torque did not change with the direction.
    pub const TORQUE_STILL: Self = Self(128);
    /// The torque changed the other way.
    pub const TORQUE_SIGN: Self = Self(256);
    /// The torque changed by less than a third or more than three times what the drag says: a unit.
    pub const TORQUE_RATIO: Self = Self(512);
    /// A reading came and went, or was no number.
    pub const LOST: Self = Self(1024);

    /// Whether nothing is wrong.
    #[must_use]
    pub const fn is_plausible(self) -> bool {
        self.0 == 0
    }

    /// Whether all of `other` are set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// As bits.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    pub(super) const fn with(self, other: Self, set: bool) -> Self {
        Self(self.0 | if set { other.0 } else { 0 })
    }
}

/// One tick's results.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// Generator angle to command: the target times the ratio, as it is, less the correction. The correction alone is
    /// limited: where the target leaps this leaps, without a flag, so the rate of the target is the caller's to limit.
    pub command: GeneratorAngle,
    /// Where the output is estimated to be now.
    pub output: OutputAngle,
    /// The transmission error now, rad: the output less the nominal one; 0 without a usable torque, temperature or
    /// table. Before the first sample that of generator angle 0, known to [`Self::uncertainty_rad`].
    pub transmission_error_rad: f32,
    /// It lies within ± this, as far as play, jumps and the adjustment go, rad. Of the estimate, whether it is
    /// corrected or not: what is left at the output is [`Self::output`] less the target. Without a sample that is
    /// believed in this tick: no less than the table's limit and the reported uncertainty, which is all that is known.
    pub uncertainty_rad: f32,
    /// The correction in the command: target − command/ratio, rad. It is taken off the target, and so has the sign of
    /// the transmission error that it takes out.
    pub correction_rad: f32,
    /// Correction missing from the table's demand, rad: held back by the limiter, the mode or the overrun policy.
    pub held_back_rad: f32,
    /// How far to trust estimate and correction.
    pub quality: Quality,
    /// Events of the tick.
    pub flags: Flags,
}
