//! Additions to the table: coefficients learnt from measurements of the output, and springs that slip.

use super::*;
use flexspline_estimation::{
    AdaptRestoreError, AdaptSettings, AdaptState, Coefficient, Learning, LoadTorque, MaxwellSlip, NO_COEFFICIENT,
    NOBODY, OnlineCalibration, Seen, Slip, SlipElement, SlipState, Term, TorqueSlipElement, Verdict, saved_adapt_bytes,
    saved_slip_bytes,
};

/// Largest number of coefficients of a learner.
pub const FLEXSPLINE_LEARNER_COEFFICIENTS: usize = 7;
/// Eight-byte words of a [`FlexsplineLearner`].
pub const FLEXSPLINE_LEARNER_WORDS: usize = 68;
/// Bytes of a saved learner with the largest number of coefficients; n of them take 2 n (n - 1) + 8 n + 32.
pub const FLEXSPLINE_SAVED_LEARNER_BYTES: usize = 172;
/// Largest number of springs.
pub const FLEXSPLINE_SLIP_SPRINGS: usize = 8;
/// Eight-byte words of a [`FlexsplineSlip`].
pub const FLEXSPLINE_SLIP_WORDS: usize = 24;
/// Bytes of saved springs with the largest number of them; n of them take 8 n + 36.
pub const FLEXSPLINE_SAVED_SLIP_BYTES: usize = 100;

/// Offset of the mean error, rad.
pub const FLEXSPLINE_TERM_MEAN: u8 = 0;
/// Wind-up in addition to that of the table, rad/(N m).
pub const FLEXSPLINE_TERM_WIND_UP: u8 = 1;
/// Half-width of the play in addition to that of the table, rad.
pub const FLEXSPLINE_TERM_HALF_WIDTH: u8 = 2;
/// Cosine of `order` periods in a generator turn, rad.
pub const FLEXSPLINE_TERM_COSINE: u8 = 3;
/// Sine of `order` periods in a generator turn, rad.
pub const FLEXSPLINE_TERM_SINE: u8 = 4;

/// The adjustment is zero; what was learnt is kept. The start.
pub const FLEXSPLINE_LEARNING_OFF: u8 = 0;
/// The learnt coefficients are used and stay as they are.
pub const FLEXSPLINE_LEARNING_FROZEN: u8 = 1;
/// Measurements are used.
pub const FLEXSPLINE_LEARNING_ON: u8 = 2;

/// There was no measurement, or nothing is to be learnt.
pub const FLEXSPLINE_VERDICT_IDLE: u8 = 0;
/// It was used.
pub const FLEXSPLINE_VERDICT_USED: u8 = 1;
/// Within what is not known anyway: it says nothing.
pub const FLEXSPLINE_VERDICT_QUIET: u8 = 2;
/// Beyond the gate.
pub const FLEXSPLINE_VERDICT_OUTLIER: u8 = 3;
/// Too soon after a reversal.
pub const FLEXSPLINE_VERDICT_UNSETTLED: u8 = 4;
/// No coefficient changes the output enough here to be seen in the noise.
pub const FLEXSPLINE_VERDICT_UNEXCITED: u8 = 5;
/// The tick itself was not to be trusted.
pub const FLEXSPLINE_VERDICT_UNTRUSTED: u8 = 6;
/// Learnt coefficients or settings are lost to an upset: nothing is added, and the uncertainty is all that can have
/// been added. Until `flexspline_learner_set`, or until the learner is made anew.
pub const FLEXSPLINE_VERDICT_LOST: u8 = 7;

/// Eight-byte words of a [`FlexsplineAdjustment`].
pub const FLEXSPLINE_ADJUSTMENT_WORDS: usize = 3;

/// Springs that slip with the nominal output: widths in rad, 0 to 0.05, gains without a unit.
pub const FLEXSPLINE_SLIP_OF_OUTPUT: u8 = 0;
/// Springs that slip with the load torque: widths in N m, 0 to 10000, gains in rad/(N m).
pub const FLEXSPLINE_SLIP_OF_TORQUE: u8 = 1;

/// Addition to the table in the next tick, and how far it is known, under a sum: an upset of one word is mended.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineAdjustment {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_ADJUSTMENT_WORDS],
}

/// A few coefficients that measurements of the output teach, and what is learnt.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineLearner {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_LEARNER_WORDS],
}

/// Springs that slip, and their deflections.
#[repr(C)]
#[derive(Debug)]
pub struct FlexsplineSlip {
    pub(super) opaque: [MaybeUninit<u64>; FLEXSPLINE_SLIP_WORDS],
}

/// A coefficient to be learnt.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineCoefficient {
    /// It stays within +- this: rad, or rad/(N m); above 0, 0.049 at most.
    pub limit: f32,
    /// Standard deviation that it is expected to have at first, and never exceeds: same unit; 1e-6 to 10 times the
    /// limit.
    pub initial_std: f32,
    /// `FLEXSPLINE_TERM_...`.
    pub term: u8,
    /// Periods in a generator turn, 1 to 255, of a cosine or sine; else 0.
    pub order: u8,
}

/// How a learner learns.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct FlexsplineLearnSettings {
    /// Standard deviation of one measurement, rad at the output: its noise and what the table missed of its samples.
    pub noise_rad: f32,
    /// Measurements after which what was learnt in their direction is forgotten: 1 to 1000000.
    pub memory_measurements: f32,
    /// Standard deviations beyond which an innovation is an outlier: 1 to 100.
    pub gate: f32,
    /// Way at the output after a reversal that is left out in addition to four times the limit of the half-width,
    /// rad; 0 to 0.049.
    pub settle_rad: f32,
    /// Torque beyond which the wind-up's share grows no more, N m.
    pub torque_limit_n_m: f32,
}

/// A learner's addition in the next tick.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineAdapted {
    /// For `FlexsplineInput` of the next tick: mean error, counts of 2^-32 turn at the output.
    pub mean_counts: i32,
    /// The same: half-width of the play.
    pub half_width_counts: i32,
    /// Standard deviation of what it adds to the error, rad.
    pub uncertainty_rad: f32,
    /// Verdict on the measurement: `FLEXSPLINE_VERDICT_...`.
    pub verdict: u8,
}

/// Counts of measurements by verdict; counters stop at their largest value.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineLearnerReport {
    /// Used.
    pub used: u32,
    /// Within what is not known anyway.
    pub quiet: u32,
    /// Outliers.
    pub outliers: u32,
    /// Outliers in a row until now: many say that the output encoder or its zero is not what it was.
    pub outliers_in_a_row: u32,
    /// Too soon after a reversal.
    pub unsettled: u32,
    /// No coefficient was excited.
    pub unexcited: u32,
    /// The tick was not to be trusted.
    pub untrusted: u32,
    /// Coefficients held at their limit, once for each and each measurement.
    pub limited: u32,
    /// Starts with the first variances: measurements contradicted what was learnt for a window, or, from zero, the
    /// state was hit by an upset.
    pub restarts: u32,
    /// `FLEXSPLINE_LEARNING_...`.
    pub learning: u8,
    /// Number of coefficients.
    pub coefficients: u8,
}

/// A coefficient as learnt.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineLearnt {
    /// Its value: rad, or rad/(N m).
    pub value: f32,
    /// Its standard deviation, same unit.
    pub std: f32,
}

/// A spring that slips.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineSpring {
    /// Deflection at which it slips: rad of the nominal output, or N m.
    pub width: f32,
    /// Error per deflection: without a unit, or rad/(N m).
    pub gain: f32,
}

/// Contribution of the springs.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineSlipReport {
    /// Error at the output, rad.
    pub error_rad: f32,
    /// It lies within +- this, rad: 0 once every spring has slipped from one end to the other.
    pub uncertainty_rad: f32,
    /// The error for `flexspline_input_add`, counts of 2^-32 turn at the output.
    pub mean_counts: i32,
    /// 1 if every deflection is known, else 0.
    pub is_known: u8,
}

const MOST: usize = FLEXSPLINE_LEARNER_COEFFICIENTS;
const SPRINGS: usize = FLEXSPLINE_SLIP_SPRINGS;

/// An adapter with its learnt state, for the first N coefficients.
#[derive(Clone, Copy)]
struct Learner {
    adapter: OnlineCalibration<MOST>,
    state: AdaptState<MOST>,
    used: u8,
}

/// A bank with its deflections.
#[derive(Clone, Copy)]
enum Bank {
    Output(MaxwellSlip<SPRINGS>, SlipState<SPRINGS>),
    Torque(MaxwellSlip<SPRINGS, LoadTorque>, SlipState<SPRINGS, LoadTorque>),
}

/// The first N springs of a bank.
#[derive(Clone, Copy)]
struct CSprings {
    bank: Bank,
    used: u8,
}

const _: () = {
    assert!(FLEXSPLINE_SAVED_LEARNER_BYTES == saved_adapt_bytes(MOST));
    assert!(FLEXSPLINE_SAVED_SLIP_BYTES == saved_slip_bytes(SPRINGS));
    assert!(FLEXSPLINE_LEARNING_FROZEN == Learning::Frozen as u8 && FLEXSPLINE_LEARNING_ON == Learning::On as u8);
    assert!(FLEXSPLINE_VERDICT_USED == Verdict::Used as u8 && FLEXSPLINE_VERDICT_QUIET == Verdict::Quiet as u8);
    assert!(FLEXSPLINE_VERDICT_OUTLIER == Verdict::Outlier as u8);
    assert!(FLEXSPLINE_VERDICT_UNSETTLED == Verdict::Unsettled as u8);
    assert!(FLEXSPLINE_VERDICT_UNEXCITED == Verdict::Unexcited as u8);
    assert!(FLEXSPLINE_VERDICT_UNTRUSTED == Verdict::Untrusted as u8);
    assert!(FLEXSPLINE_VERDICT_LOST == Verdict::Lost as u8);
};

fn coefficient(c: FlexsplineCoefficient) -> Result<Coefficient, FlexsplineStatus> {
    let term = match (c.term, c.order) {
        (FLEXSPLINE_TERM_MEAN, 0) => Term::Mean,
        (FLEXSPLINE_TERM_WIND_UP, 0) => Term::WindUp,
        (FLEXSPLINE_TERM_HALF_WIDTH, 0) => Term::HalfWidth,
        (FLEXSPLINE_TERM_COSINE, order) => Term::Cos(order),
        (FLEXSPLINE_TERM_SINE, order) => Term::Sin(order),
        _ => return Err(FlexsplineStatus::Argument),
    };
    Ok(Coefficient { term, limit: c.limit, initial_std: c.initial_std })
}

/// Makes a learner of 1 to `FLEXSPLINE_LEARNER_COEFFICIENTS` coefficients that has learnt nothing yet and is off;
/// `FLEXSPLINE_STATUS_ARGUMENT` if a setting is out of its range. An update takes as long with one as with all.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_learner_init(
    learner: *mut FlexsplineLearner,
    settings: *const FlexsplineLearnSettings,
    coefficients: *const FlexsplineCoefficient,
    number: u8,
) -> FlexsplineStatus {
    status(|| {
        let s = copied(settings)?;
        let none = FlexsplineCoefficient { limit: 0.0, initial_std: 0.0, term: 0, order: 0 };
        let wanted = list(coefficients, number, [none; MOST])?;
        let mut found = [NO_COEFFICIENT; MOST];
        for (to, from) in found.iter_mut().zip(wanted).take(number as usize) {
            *to = coefficient(from)?;
        }
        let settings = AdaptSettings {
            coefficients: found,
            noise_rad: s.noise_rad,
            memory_measurements: s.memory_measurements,
            gate: s.gate,
            settle_rad: s.settle_rad,
            torque_limit_n_m: s.torque_limit_n_m,
        };
        let adapter =
            OnlineCalibration::of_first(&settings, number as usize).map_err(|_| FlexsplineStatus::Argument)?;
        put(learner, Object::Learner, Learner { adapter, state: adapter.start(), used: number })
    })
}

/// Switches learning (`FLEXSPLINE_LEARNING_...`), from the next update on.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_learner_set(learner: *mut FlexsplineLearner, learning: u8) -> FlexsplineStatus {
    status(|| {
        let learner: &mut Learner = get_mut(learner, Object::Learner)?;
        learner.state.set_learning(match learning {
            FLEXSPLINE_LEARNING_OFF => Learning::Off,
            FLEXSPLINE_LEARNING_FROZEN => Learning::Frozen,
            FLEXSPLINE_LEARNING_ON => Learning::On,
            _ => return Err(FlexsplineStatus::Argument),
        });
        Ok(())
    })
}

/// Says whose coefficients are learnt: of this joint with the table in use. Saved learners carry both, and are restored
/// only where they belong. `unit` distinguishes joints with the same settings and the same table, such as the
/// wheels of a rover; 0 if there is one. After `flexspline_learner_init` and the table, before
/// `flexspline_learner_restore`; again after another table was activated: what was learnt for another owner is
/// forgotten. `FLEXSPLINE_STATUS_ARGUMENT` if no table is in use.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_learner_bind(
    learner: *mut FlexsplineLearner,
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    unit: u32,
) -> FlexsplineStatus {
    status(|| {
        clear(span(learner), [span(joint), span(store)])?;
        let (joint, store) = (joint_of(joint)?, store_of(store)?);
        let Learner { adapter, state, .. } = get_mut(learner, Object::Learner)?;
        if store.id() == TableId::default() {
            return Err(FlexsplineStatus::Argument);
        }
        let before = *adapter;
        *adapter = before.owned_by(joint, store, unit);
        if adapter.has_other_owner(&before) {
            adapter.reset(state);
        }
        Ok(())
    })
}

/// Forgets what was learnt; counters and `FLEXSPLINE_LEARNING_...` stay. The limiter of the joint takes the adjustment
/// out.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_learner_reset(learner: *mut FlexsplineLearner) -> FlexsplineStatus {
    status(|| {
        let Learner { adapter, state, .. } = get_mut(learner, Object::Learner)?;
        adapter.reset(state);
        Ok(())
    })
}

/// One tick, every tick and in order, after `flexspline_tick` with what it was given and gave: learns from the output
/// angle measured at the same moment (`has_measured` 1, `measured_counts` of 2^-32 turn) if there is one, and reports
/// the addition in the next tick. Nothing that comes in can make that exceed the limits. `input` is that of the tick
/// with the learner's own adjustment alone: what springs or a model of yours added to it counts as known then, and
/// is not learnt a second time.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_learner_update(
    learner: *mut FlexsplineLearner,
    state: *const FlexsplineState,
    input: *const FlexsplineInput,
    output: *const FlexsplineOutput,
    has_measured: u8,
    measured_counts: i64,
    adapted: *mut FlexsplineAdapted,
) -> FlexsplineStatus {
    answer(adapted, [span(learner), span(state), span(input), span(output)], || {
        clear(span(learner), [span(state), span(input), span(output)])?;
        let (input, output) = (core_input(&copied(input)?), given(output)?);
        let play = state_of(state)?.play();
        let learner: &mut Learner = get_mut(learner, Object::Learner)?;
        let measured = (has_measured != 0).then_some(OutputAngle::from_counts(measured_counts));
        let found =
            learner.adapter.update(&mut learner.state, &Seen { input: &input, play, output: &output, measured });
        Ok(FlexsplineAdapted {
            mean_counts: found.adjustment.mean_counts(),
            half_width_counts: found.adjustment.half_width_counts(),
            uncertainty_rad: found.uncertainty_rad,
            verdict: found.verdict as u8,
        })
    })
}

/// Reports a coefficient, by its index in the list that the learner was made of; `FLEXSPLINE_STATUS_ARGUMENT` beyond
/// it.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_learner_coefficient(
    learner: *const FlexsplineLearner,
    place: u8,
    learnt: *mut FlexsplineLearnt,
) -> FlexsplineStatus {
    answer(learnt, [span(learner)], || {
        let learner: &Learner = get(learner, Object::Learner)?;
        let found = learner.adapter.coefficients(&learner.state);
        let known = found.iter().take(learner.used as usize).nth(place as usize);
        let &(value, std) = known.ok_or(FlexsplineStatus::Argument)?;
        Ok(FlexsplineLearnt { value, std })
    })
}

/// Reports the counts of measurements by verdict.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_learner_report(
    learner: *const FlexsplineLearner,
    report: *mut FlexsplineLearnerReport,
) -> FlexsplineStatus {
    answer(report, [span(learner)], || {
        let learner: &Learner = get(learner, Object::Learner)?;
        let counters = learner.state.counters();
        Ok(FlexsplineLearnerReport {
            used: counters.used,
            quiet: counters.quiet,
            outliers: counters.outliers,
            outliers_in_a_row: counters.outliers_in_a_row,
            unsettled: counters.unsettled,
            unexcited: counters.unexcited,
            untrusted: counters.untrusted,
            limited: counters.limited,
            restarts: counters.restarts,
            learning: learner.state.learning() as u8,
            coefficients: learner.used,
        })
    })
}

/// Writes what was learnt, with a CRC-32, and how many bytes that took: `FLEXSPLINE_SAVED_LEARNER_BYTES` at most.
/// `FLEXSPLINE_STATUS_TOO_LARGE` if there is less room. The same bytes as in Rust.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_learner_save(
    learner: *const FlexsplineLearner,
    saved: *mut u8,
    saved_bytes: usize,
    written: *mut usize,
) -> FlexsplineStatus {
    answer(written, [span(learner), (saved as usize, saved_bytes)], || {
        apart([span(learner), (saved as usize, saved_bytes)])?;
        let learner: &Learner = get(learner, Object::Learner)?;
        let room = bytes_mut(saved, saved_bytes)?;
        let took = learner.adapter.save_first(&learner.state, learner.used as usize, room);
        took.ok_or(FlexsplineStatus::TooLarge)
    })
}

/// Takes back what a learner of the same coefficients and the same owner (`flexspline_learner_bind`) saved, and is off.
/// `FLEXSPLINE_STATUS_SAVED` if the bytes are damaged, fewer, of another version, or were saved with other
/// coefficients; `FLEXSPLINE_STATUS_OTHER_TABLE`, `FLEXSPLINE_STATUS_OTHER_JOINT` if they belong elsewhere. Then the
/// learner is as it was. It is made first, by `flexspline_learner_init`, and bound.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_learner_restore(
    learner: *mut FlexsplineLearner,
    saved: *const u8,
    saved_bytes: usize,
) -> FlexsplineStatus {
    status(|| {
        apart([span(learner), (saved as usize, saved_bytes)])?;
        let kept = bytes(saved, saved_bytes)?;
        let learner: &mut Learner = get_mut(learner, Object::Learner)?;
        let found = learner.adapter.restore_first(learner.used as usize, kept);
        learner.state = found.map_err(|error| match error {
            AdaptRestoreError::OtherTable => FlexsplineStatus::OtherTable,
            AdaptRestoreError::OtherJoint => FlexsplineStatus::OtherJoint,
            _ => FlexsplineStatus::Saved,
        })?;
        Ok(())
    })
}

/// Makes 1 to `FLEXSPLINE_SLIP_SPRINGS` springs that slip with `variable` (`FLEXSPLINE_SLIP_OF_...`), no deflection of
/// which is known; `FLEXSPLINE_STATUS_ARGUMENT` if a width is not allowed or a gain not finite.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_slip_init(
    slip: *mut FlexsplineSlip,
    variable: u8,
    springs: *const FlexsplineSpring,
    number: u8,
) -> FlexsplineStatus {
    status(|| {
        let springs = list(springs, number, [FlexsplineSpring::default(); SPRINGS])?;
        let bank = match variable {
            FLEXSPLINE_SLIP_OF_OUTPUT => {
                let bank = MaxwellSlip::new(springs.map(|s| SlipElement { width_rad: s.width, gain: s.gain }));
                bank.map(|bank| Bank::Output(bank.of_first(number as usize), SlipState::unknown()))
            }
            FLEXSPLINE_SLIP_OF_TORQUE => {
                let spring = |s: FlexsplineSpring| TorqueSlipElement { width_n_m: s.width, gain_rad_per_n_m: s.gain };
                let bank = MaxwellSlip::of_torque(springs.map(spring));
                bank.map(|bank| Bank::Torque(bank.of_first(number as usize), SlipState::unknown()))
            }
            _ => None,
        };
        put(slip, Object::Slip, CSprings { bank: bank.ok_or(FlexsplineStatus::Argument)?, used: number })
    })
}

/// Sets all deflections anew: 0, not known, as after a reset; 1, none, as before the first motion or after strokes that
/// died away.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_slip_set(slip: *mut FlexsplineSlip, is_relaxed: u8) -> FlexsplineStatus {
    status(|| {
        let CSprings { bank, .. } = get_mut(slip, Object::Slip)?;
        if is_relaxed > 1 {
            return Err(FlexsplineStatus::Argument);
        }
        match bank {
            Bank::Output(_, state) => {
                *state = if is_relaxed == 1 { SlipState::relaxed() } else { SlipState::unknown() }
            }
            Bank::Torque(_, state) => {
                *state = if is_relaxed == 1 { SlipState::relaxed() } else { SlipState::unknown() }
            }
        }
        Ok(())
    })
}

/// One tick of springs: what they add, and whether every deflection is known.
fn slip_tick(
    slip: *mut FlexsplineSlip,
    report: *mut FlexsplineSlipReport,
    follow: impl FnOnce(&mut Bank) -> Result<(Slip, bool), FlexsplineStatus>,
) -> FlexsplineStatus {
    answer(report, [span(slip)], || {
        let CSprings { bank, .. } = get_mut(slip, Object::Slip)?;
        let (found, is_known) = follow(bank)?;
        let Slip { error_rad, uncertainty_rad } = found;
        let (mean_counts, is_known) = (found.mean_counts(), is_known as u8);
        Ok(FlexsplineSlipReport { error_rad, uncertainty_rad, mean_counts, is_known })
    })
}

/// One tick of springs that slip with the nominal output (`flexspline_nominal_output`), counts of 2^-32 turn: what they
/// add in the next. `FLEXSPLINE_STATUS_ARGUMENT` if they slip with the torque; `FLEXSPLINE_STATUS_NOT_INITIALISED` if
/// an upset hit more than a word of the springs (one is mended). Deflections of which more was hit are unknown again,
/// as after a reset.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_slip_update(
    slip: *mut FlexsplineSlip,
    nominal_counts: i64,
    report: *mut FlexsplineSlipReport,
) -> FlexsplineStatus {
    slip_tick(slip, report, |bank| match bank {
        Bank::Output(bank, state) => {
            let nominal = OutputAngle::from_counts(nominal_counts);
            let done = bank.mend().then(|| (bank.update(state, nominal), state.is_known()));
            done.ok_or(FlexsplineStatus::NotInitialised)
        }
        Bank::Torque(..) => Err(FlexsplineStatus::Argument),
    })
}

/// One tick of springs that slip with the load torque, N m: what they add in the next. A torque that is not finite
/// moves nothing. `FLEXSPLINE_STATUS_ARGUMENT` if they slip with the output.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_slip_update_torque(
    slip: *mut FlexsplineSlip,
    torque_n_m: f32,
    report: *mut FlexsplineSlipReport,
) -> FlexsplineStatus {
    slip_tick(slip, report, |bank| match bank {
        Bank::Torque(bank, state) => {
            let done = bank.mend().then(|| (bank.update(state, torque_n_m), state.is_known()));
            done.ok_or(FlexsplineStatus::NotInitialised)
        }
        Bank::Output(..) => Err(FlexsplineStatus::Argument),
    })
}

/// Writes the deflections with a CRC-32, and how many bytes that took: `FLEXSPLINE_SAVED_SLIP_BYTES` at most.
/// `FLEXSPLINE_STATUS_TOO_LARGE` if there is less room, or before the first update. They belong to no joint and no
/// table: those of `flexspline_slip_save_for` do. The same bytes as in Rust.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_slip_save(
    slip: *const FlexsplineSlip,
    saved: *mut u8,
    saved_bytes: usize,
    written: *mut usize,
) -> FlexsplineStatus {
    answer(written, [span(slip), (saved as usize, saved_bytes)], || save_slip(slip, NOBODY, saved, saved_bytes))
}

/// Springs as bytes, that belong to somebody or nobody; the number of bytes.
pub(super) fn save_slip(
    slip: *const FlexsplineSlip,
    owner: [u32; 4],
    saved: *mut u8,
    saved_bytes: usize,
) -> Result<usize, FlexsplineStatus> {
    apart([span(slip), (saved as usize, saved_bytes)])?;
    let &CSprings { ref bank, used } = get(slip, Object::Slip)?;
    let (room, used) = (bytes_mut(saved, saved_bytes)?, used as usize);
    let (took, is_lost) = match bank {
        Bank::Output(bank, state) => (bank.save_first(state, owner, used, room), bank.is_lost() || state.is_lost()),
        Bank::Torque(bank, state) => (bank.save_first(state, owner, used, room), bank.is_lost() || state.is_lost()),
    };
    took.ok_or(if is_lost { FlexsplineStatus::NotInitialised } else { FlexsplineStatus::TooLarge })
}

/// Takes back the deflections that the same springs saved; only if the joint (of springs on the torque: the load)
/// cannot have moved meanwhile. `FLEXSPLINE_STATUS_SAVED` if the bytes are damaged, fewer, of other springs, or were
/// saved for a joint (`flexspline_slip_restore_for`). The springs are made first, by `flexspline_slip_init`.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_slip_restore(
    slip: *mut FlexsplineSlip,
    saved: *const u8,
    saved_bytes: usize,
) -> FlexsplineStatus {
    // Of whom they are is not asked, so it is not said either.
    status(|| {
        restore_slip(slip, NOBODY, saved, saved_bytes).map_err(|error| match error {
            FlexsplineStatus::OtherTable | FlexsplineStatus::OtherJoint => FlexsplineStatus::Saved,
            error => error,
        })
    })
}

/// Springs of bytes that belong to somebody or nobody.
pub(super) fn restore_slip(
    slip: *mut FlexsplineSlip,
    owner: [u32; 4],
    saved: *const u8,
    saved_bytes: usize,
) -> Result<(), FlexsplineStatus> {
    apart([span(slip), (saved as usize, saved_bytes)])?;
    let kept = bytes(saved, saved_bytes)?;
    let CSprings { bank, used } = get_mut(slip, Object::Slip)?;
    let used = *used as usize;
    match bank {
        Bank::Output(bank, state) => *state = bank.restore_first(owner, used, kept).map_err(restore_status)?,
        Bank::Torque(bank, state) => *state = bank.restore_first(owner, used, kept).map_err(restore_status)?,
    }
    Ok(())
}

/// Makes an adjustment that adds nothing.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_adjustment_init(adjustment: *mut FlexsplineAdjustment) -> FlexsplineStatus {
    status(|| put(adjustment, Object::Adjustment, Adjustment::default()))
}

/// Adds to an adjustment, counts of 2^-32 turn at the output, each sum held within +-0.049 rad; and to its uncertainty,
/// rad: that of springs, and that of a learner whose verdict is lost (else 0: its standard deviation is no bound).
/// Where it is not 0 the next tick is uncertain by it. Below 0 and what is no number count as the largest.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_adjustment_add(
    adjustment: *mut FlexsplineAdjustment,
    mean_counts: i32,
    half_width_counts: i32,
    uncertainty_rad: f32,
) -> FlexsplineStatus {
    status(|| {
        let adjustment: &mut Adjustment = get_mut(adjustment, Object::Adjustment)?;
        let added = Adjustment::new(mean_counts, half_width_counts);
        *adjustment = adjustment.plus(added).with_uncertainty(uncertainty_rad);
        Ok(())
    })
}

/// Adds to the adjustment of an input, counts of 2^-32 turn at the output: what a learner, springs or a friction model
/// of your own say. Each sum is held within
/// +-0.049 rad.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_input_add(
    input: *mut FlexsplineInput,
    mean_counts: i32,
    half_width_counts: i32,
) -> FlexsplineStatus {
    status(|| {
        let before = copied(input)?;
        let sum = core_input(&before).adjustment.plus(Adjustment::new(mean_counts, half_width_counts));
        let (mean_counts, half_width_counts) = (sum.mean_counts(), sum.half_width_counts());
        give(input, FlexsplineInput { mean_counts, half_width_counts, ..before })
    })
}

/// The same in radians at the output; NaN adds nothing.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_input_add_rad(
    input: *mut FlexsplineInput,
    mean_rad: f32,
    half_width_rad: f32,
) -> FlexsplineStatus {
    let added = Adjustment::from_rad(mean_rad, half_width_rad);
    flexspline_input_add(input, added.mean_counts(), added.half_width_counts())
}
