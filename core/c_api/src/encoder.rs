//! From the register of an encoder to an angle and back; angles in other units; rate groups.

use super::*;
use flexspline::{Encoder, EncoderSettings, EncoderState, EncoderWrap};

/// Eight-byte words of a [`FlexsplineEncoder`].
pub const FLEXSPLINE_ENCODER_WORDS: usize = 7;

/// An encoder, and where it is.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineEncoder {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_ENCODER_WORDS],
}

/// How an encoder counts.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineEncoderSettings {
    /// Reading at the angle 0, counts of the encoder: -2^62 to 2^62.
    pub zero_counts: i64,
    /// Counts in a turn, 2 to 2^31: four times the lines of an incremental one.
    pub counts_per_turn: u32,
    /// Bits of the register, 1 to 64: it begins anew after 2^bits counts. 0: it begins anew after each turn. A signed
    /// register is given by its bits, those above them zero.
    pub wrap_bits: u8,
    /// 1 if it counts up where the angle falls, else 0.
    pub reversed: u8,
}

/// Saved data of an encoder.
#[derive(Clone, Copy)]
struct Followed {
    encoder: Encoder,
    /// Nowhere before the start.
    at: EncoderState,
}

/// Makes an encoder of its settings, `FLEXSPLINE_STATUS_ARGUMENT` if they cannot be; where it is is not known yet.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_encoder_init(
    encoder: *mut FlexsplineEncoder,
    settings: *const FlexsplineEncoderSettings,
) -> FlexsplineStatus {
    status(|| {
        let s = copied(settings)?;
        if s.reversed > 1 {
            return Err(FlexsplineStatus::Argument);
        }
        let settings = EncoderSettings {
            counts_per_turn: s.counts_per_turn,
            wrap: if s.wrap_bits == 0 { EncoderWrap::Turn } else { EncoderWrap::Bits(s.wrap_bits) },
            reversed: s.reversed == 1,
            zero_counts: s.zero_counts,
        };
        let made = Encoder::new(settings).map_err(|_| FlexsplineStatus::Argument)?;
        put(encoder, Object::Encoder, Followed { encoder: made, at: EncoderState::NOWHERE })
    })
}

/// The first reading after a reset: of all angles with this reading the one nearest to `near_counts` (2^-32 turn) is
/// taken, which is 0 or the angle that was saved. `FLEXSPLINE_STATUS_ARGUMENT` if the register cannot read that.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_encoder_start(
    encoder: *mut FlexsplineEncoder,
    reading: u64,
    near_counts: i64,
) -> FlexsplineStatus {
    status(|| {
        let Followed { encoder, at } = get_mut(encoder, Object::Encoder)?;
        if !encoder.mend() {
            return Err(FlexsplineStatus::NotInitialised);
        }
        *at = encoder.start(reading, near_counts).ok_or(FlexsplineStatus::Argument)?;
        Ok(())
    })
}

/// Takes a reading of the encoder of a joint's generator and reports the angle to give to its next tick, counts of
/// 2^-32 turn, to the nearest. A reading that the tick does not believe (`FLEXSPLINE_FLAG_GLITCH`) moves no turn: one
/// that is further from the one before than a tick allows is taken from the angle that was believed last, for N ticks;
/// in N + 2 the generator cannot make half of what the register counts. So the turns are right as soon as the readings
/// are, if no more than N - 1 in a row were wrong: 3 where a register of one turn is read a thousand times a second at
/// 500 rad/s. After more the encoder is lost: give the tick no sample, and call `flexspline_encoder_start` with what is
/// known otherwise. Wrong readings that agree with each other for longer than the joint's patience, or until the
/// generator could have got there, are believed, as nothing tells them from motion: then, too, start it anew. A tick
/// that is missed counts as one of the N at this call, as two at later ones.
/// `FLEXSPLINE_STATUS_ARGUMENT` if the register cannot read that (give the tick no
/// sample then), or if `generator_rate_rad_s` allows a sixth of what the register counts in a tick, so that motion
/// hides a wrong bit; `FLEXSPLINE_STATUS_NOT_INITIALISED` before `flexspline_encoder_start`, and where encoder or joint
/// are lost.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_joint_read(
    joint: *const FlexsplineJoint,
    state: *const FlexsplineState,
    encoder: *mut FlexsplineEncoder,
    reading: u64,
    angle_counts: *mut i64,
) -> FlexsplineStatus {
    answer(angle_counts, [span(encoder), span(joint), span(state)], || {
        clear(span(encoder), [span(joint), span(state)])?;
        let (joint, state) = (joint_of(joint)?, state_of(state)?);
        let Followed { encoder, at } = get_mut(encoder, Object::Encoder)?;
        if !encoder.mend() || at.is_lost() || joint.is_lost() {
            return Err(FlexsplineStatus::NotInitialised);
        }
        let angle = joint.read(state, encoder, at, reading);
        let refused = if at.is_lost() { FlexsplineStatus::NotInitialised } else { FlexsplineStatus::Argument };
        Ok(angle.ok_or(refused)?.counts())
    })
}

/// The same for an encoder that no joint judges: one wrong reading, half of what the register counts away, moves it by
/// all that it counts, for good. Takes a reading and reports the angle, counts of 2^-32 turn, to the nearest. Between
/// two readings it may move by less than half of what the register counts. `FLEXSPLINE_STATUS_ARGUMENT` if the register
/// cannot read that (give the tick no sample then), `FLEXSPLINE_STATUS_NOT_INITIALISED` before
/// `flexspline_encoder_start`, and after an upset of more than a word (one word is mended): make it and start it again.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_encoder_read(
    encoder: *mut FlexsplineEncoder,
    reading: u64,
    angle_counts: *mut i64,
) -> FlexsplineStatus {
    answer(angle_counts, [span(encoder)], || {
        let Followed { encoder, at } = get_mut(encoder, Object::Encoder)?;
        if !encoder.mend() || at.is_lost() {
            return Err(FlexsplineStatus::NotInitialised);
        }
        if !encoder.read(at, reading) {
            return Err(FlexsplineStatus::Argument);
        }
        encoder.angle(at).ok_or(FlexsplineStatus::NotInitialised)
    })
}

/// Register value at an angle, to the nearest count: for a drive that is commanded in counts of its encoder.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_encoder_reading(
    encoder: *const FlexsplineEncoder,
    angle_counts: i64,
    reading: *mut u64,
) -> FlexsplineStatus {
    answer(reading, [span(encoder)], || {
        let Followed { encoder, .. } = get(encoder, Object::Encoder)?;
        if encoder.is_lost() { Err(FlexsplineStatus::NotInitialised) } else { Ok(encoder.reading(angle_counts)) }
    })
}

/// Counts of 2^-32 turn of an angle in radians, to the nearest; `FLEXSPLINE_STATUS_ARGUMENT` if it is not finite or
/// beyond 2^31 turns. For start-up and the host: in double precision.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_counts_from_rad(rad: f64, angle_counts: *mut i64) -> FlexsplineStatus {
    answer(angle_counts, [], || Ok(OutputAngle::from_rad(rad).ok_or(FlexsplineStatus::Argument)?.counts()))
}

/// Radians of an angle in counts of 2^-32 turn. For start-up and the host: in double precision.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_rad_from_counts(angle_counts: i64) -> f64 {
    OutputAngle::from_counts(angle_counts).to_rad()
}

/// Radians from one angle to another, both in counts of 2^-32 turn, held within half a turn: in single precision, exact
/// to 1.2e-7 of it.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_rad_between(from_counts: i64, to_counts: i64) -> f32 {
    OutputAngle::from_counts(to_counts).minus_rad(OutputAngle::from_counts(from_counts))
}

/// 1 if a slower group that runs in every `divisor`-th tick, from `offset` on, runs in tick number `tick`, else 0; 0
/// too where `divisor` is 0 or `offset` not below it.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_is_due(tick: u32, divisor: u32, offset: u32) -> u8 {
    flexspline_telemetry::is_due(tick, divisor, offset) as u8
}
