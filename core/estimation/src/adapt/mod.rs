//! Corrections of the table learnt from measurements of the output: a few coefficients, by recursive least squares.
//!
//! ```text
//! y − ŷ = h·x + v,      error = table + m + g·τ + Σ (aₙ·cos nψ + bₙ·sin nψ) − s·w
//! ```
//!
//! with `y` the measured output and `ŷ` what the table says, `m` a mean offset, `g` a wind-up beside the table's, `w` a
//! half-width beside the table's with `s` = ±1 the side of the play in contact, and `a`, `b` the cosine and sine of a
//! few orders of the generator angle. Which of them are estimated is a list of [`Term`]s; their number is a type.
//!
//! [`OnlineCalibration::update`] is called once each tick after [`Joint::tick`](flexspline::Joint::tick), with a
//! measurement if there is one: an encoder at the output each tick, or a star or beacon now and then. What it returns
//! is added in the next tick.
//!
//! # How
//! A Kalman filter for coefficients that wander, in the form `P = U·D·Uᵀ` (Bierman, *Factorization Methods for Discrete
//! Sequential Estimation*, 1977, ch. V: the measurement; Agee and Turner 1972: the wandering). `D ≥ 0` holds whatever
//! the rounding, so the covariance stays symmetric and positive in `f32`, for any number of updates.
//!
//! * Measurements are judged over windows, see [`consistency`]: where they contradict what was learnt the covariance
//!   goes back to the first one, where the table alone does better the coefficients fade, and what is not explained is
//!   in the stated uncertainty.
//! * Forgetting is directional: a measurement in direction `h` adds `h·hᵀ/(|h|⁴·M²)` to the covariance first, `M` the
//!   [memory](AdaptSettings::memory_measurements). In directions in which nothing is measured nothing is forgotten, so
//!   nothing drifts there and no variance winds up; a correlation learnt long ago fades where only one of the two is
//!   excited.
//! * No variance grows beyond its first one.
//! * An innovation beyond the gate, in standard deviations, is an outlier: counted, not used. So is every one while the
//!   sensor is impossible.
//! * Where the error is known to within ± an interval only (side of the play unknown, torque inside a jump), that much
//!   of an innovation says nothing: only what exceeds it is used (a dead zone), with the interval added to the noise.
//! * After a reversal, from where contact is lost until the play has moved on by four times the limit of the half-width
//!   (it is taken up later or earlier than estimated by no more) and [`AdaptSettings::settle_rad`], nothing is learnt.
//! * Every coefficient stays within its limit.
//!
//! # What it promises
//! From when the sensors are right, learning is worse than no learning by more than three times the stated uncertainty
//! for no longer than T, five windows of measurements: half of the memory between memories of 100 and 10 000. Measured
//! with a memory of 2000: at most 67 measurements after a sensor that was off, sliding, jumping, frozen, late or of the
//! other sign, or a load sensor with another gain or dead, for 20 s (`faults`).
//!
//! # Not in here
//! While a sensor is off by something that coefficients could be, the estimate is off by as much: nothing here can see
//! it. The stated uncertainty has no bias of the sensor.
//!
//! The measurement must be of the same moment as the generator sample of the tick. What a delay does looks like an
//! offset that changes with the direction, and would be taken for play.

#![allow(clippy::arithmetic_side_effects)] // Floating-point numbers: nothing overflows. Integers are handled by name.

mod consistency;
mod factors;
#[cfg(test)]
mod faults;
mod settings;
mod state;
#[cfg(test)]
mod tests;
mod words;

pub use settings::{AdaptError, AdaptRestoreError, AdaptSettings, Coefficient, Term};
pub use state::{AdaptCounters, AdaptState, Learning, Verdict};

use consistency::{Consistency, HypothesisErrors, Judgement, per_window};
use factors::{dot, measure, spread_of, transform, wander_by};
use flexspline::shared::{COUNTS_PER_RAD, RAD_PER_COUNT, counts_from_rad, crc32, num, owner, seal};
use flexspline::{Adjustment, Flags, GeneratorAngle, Input, Joint, Output, OutputAngle, PlayState, Quality, Store};

/// One tick as the adapter sees it.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'s> {
    /// Input of the tick: generator, torque, and this adapter's part of the adjustment. Any other addition
    /// it (springs that slip) is left out here and counts as known; left in, it is learnt a second time.
    pub input: &'s Input,
    /// The play after the tick.
    pub play: &'s PlayState,
    /// Output of the tick.
    pub output: &'s Output,
    /// The output angle as measured at the same moment; `None` if there is no measurement.
    pub measured: Option<OutputAngle>,
}

/// Addition to the table in the next tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapted {
    /// For [`Input`](flexspline::Input) of the next tick. Where learning is lost it adds nothing, with all that
    /// coefficients can have added as its uncertainty, until `AdaptState::set_learning` is called or the adapter is
    /// made anew.
    pub adjustment: Adjustment,
    /// Standard deviation of what it adds to the error, rad: no bound, so the adjustment does not have it. Where
    /// learning is lost that of the adjustment.
    pub uncertainty_rad: f32,
    /// Verdict on the measurement.
    pub verdict: Verdict,
}

/// Estimates `N` coefficients: all that does not change while it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnlineCalibration<const N: usize> {
    /// Codes of the [`Term`]s: every pattern of bits is a number.
    terms: [u32; N],
    /// Limits, rad or rad/(N·m): the units of the coefficients inside.
    limits: [f32; N],
    /// First variances in those units, and the row of a measurement in units of noise and limit.
    first: [f32; N],
    per_noise: [f32; N],
    noise_counts: f32,
    /// 1/M, and the square of the gate.
    forget: f32,
    gate: f32,
    /// 1/W.
    per_window: f32,
    settle: i32,
    /// Half-width that is in doubt while the side is not known, in units of the noise.
    half_limit: f32,
    torque_limit: f32,
    /// Of the settings: a saved state of others is not taken.
    sum: u32,
    owner: Owner,
}

/// Bytes of the saved state of `coefficients` coefficients.
#[must_use]
pub const fn saved_adapt_bytes(coefficients: usize) -> usize {
    let upper = coefficients.saturating_mul(coefficients.saturating_sub(1)) >> 1;
    coefficients.saturating_mul(2).saturating_add(upper).saturating_add(HEADING).saturating_add(1).saturating_mul(4)
}

/// Takes a place and adds nothing: the sine of no period is 0 at every angle.
pub const NO_COEFFICIENT: Coefficient = Coefficient { term: Term::Sin(0), limit: 1.0, initial_std: 1.0 };

/// Weakest excitation that is used: all coefficients at their limits move the output by a tenth of the noise.
const WEAKEST: f32 = 0.01;
/// Steps back from contact that are noise of the generator's encoder, counts (2.9e-8 rad).
const JITTER: i32 = 20;

/// `sin 2πx` of a fraction of a turn, to 2e-7: Taylor to the eleventh order of the angle folded to ±¼ turn.
fn sine(fraction: u32) -> f32 {
    let half_turns = fraction as i32 as f32 * (1.0 / 2_147_483_648.0);
    let beyond = if half_turns < 0.0 { -1.0 - half_turns } else { 1.0 - half_turns };
    let x = core::f32::consts::PI * if half_turns.abs() > 0.5 { beyond } else { half_turns };
    let y = x * x;
    let high = -1.984_127e-4 + y * (2.755_732e-6 - y * 2.505_211e-8);
    x * (1.0 + y * (-0.166_666_67 + y * (8.333_333e-3 + y * high)))
}

/// Where the play is.
#[derive(Clone, Copy)]
enum Contact {
    Unknown,
    Crossing,
    /// On this side, far enough.
    Side(i32),
}

impl<const N: usize> OnlineCalibration<N> {
    /// An adapter of the first N coefficients: those after them (`NO_COEFFICIENT`) change no bit of what these
    /// come to, and are in no sum and no saved state.
    pub(crate) fn of_first(settings: &AdaptSettings<N>, used: usize) -> Result<Self, AdaptError> {
        let AdaptSettings { coefficients, noise_rad, memory_measurements, gate, settle_rad, torque_limit_n_m } =
            *settings;
        let most = Adjustment::MAX_RAD;
        let checked = |name, found: f32, least: f32, most: f32| {
            if found >= least && found <= most { Ok(()) } else { Err(AdaptError { name, found }) }
        };
        checked("noise_rad", noise_rad, 1e-10, 0.05)?;
        checked("memory_measurements", memory_measurements, 1.0, 1e6)?;
        checked("gate", gate, 1.0, 100.0)?;
        checked("settle_rad", settle_rad, 0.0, most)?;
        checked("torque_limit_n_m", torque_limit_n_m, 0.0, 1e6)?;
        let mut half_limit = 0.0;
        for Coefficient { term, limit, initial_std } in coefficients.into_iter().take(used) {
            checked("limit", limit, 1e-12, most)?;
            checked("initial_std", initial_std, 1e-6 * limit, 10.0 * limit)?;
            match term {
                Term::HalfWidth => half_limit += limit,
                Term::Cos(0) | Term::Sin(0) => return Err(AdaptError { name: "order", found: 0.0 }),
                _ => {}
            }
        }
        let square = |value: f32| value * value;
        let mut sum = 0u32;
        for Coefficient { term, limit, initial_std } in coefficients.into_iter().take(used) {
            let (kind, order) = match term {
                Term::Mean => (0, 0),
                Term::WindUp => (1, 0),
                Term::HalfWidth => (2, 0),
                Term::Cos(order) => (3, order),
                Term::Sin(order) => (4, order),
            };
            let mut bytes = [kind, order, 0, 0, 0, 0, 0, 0, 0, 0];
            let numbers = limit.to_le_bytes().into_iter().chain(initial_std.to_le_bytes());
            bytes.iter_mut().skip(2).zip(numbers).for_each(|(to, from)| *to = from);
            sum = sum.rotate_left(7) ^ crc32(&bytes);
        }
        Ok(Self {
            terms: coefficients.map(|c| c.term.code()),
            limits: coefficients.map(|c| c.limit),
            first: coefficients.map(|c| square(c.initial_std / c.limit)),
            per_noise: coefficients.map(|c| c.limit / noise_rad),
            noise_counts: noise_rad * COUNTS_PER_RAD,
            forget: 1.0 / memory_measurements,
            per_window: per_window(1.0 / memory_measurements),
            gate: square(gate),
            settle: counts_from_rad(4.0 * half_limit).saturating_add(counts_from_rad(settle_rad)),
            half_limit: half_limit / noise_rad,
            torque_limit: torque_limit_n_m,
            sum,
            owner: Owner::default(),
        })
    }

    /// The same adapter of this joint with the table in use.
    pub fn owned_by(mut self, joint: &Joint, store: &Store, unit: u32) -> Self {
        self.owner = Owner::of(joint, store, unit);
        self
    }

    /// Whether it has another owner than `other`.
    pub(crate) fn has_other_owner(&self, other: &Self) -> bool {
        self.owner != other.owner
    }

    /// A state in which nothing is learnt yet, [`Learning::Off`].
    #[must_use]
    pub fn start(&self) -> AdaptState<N> {
        AdaptState {
            x: [0.0; N],
            d: self.first,
            u: [[0.0; N]; N],
            learning: Learning::Off.code(),
            counters: AdaptCounters::default(),
            generator: GeneratorAngle::ZERO,
            contact: OutputAngle::ZERO,
            has_contact: 0,
            touched: OutputAngle::ZERO,
            side: 0,
            run: 0,
            consistency: Consistency::NEW,
        }
    }

    /// Forgets what was learnt; counters and [`Learning`] stay. The joint's limiter takes the adjustment out.
    pub fn reset(&self, state: &mut AdaptState<N>) {
        let (learning, counters) = (state.learning().code(), state.counters);
        *state = AdaptState { learning, counters, ..self.start() };
    }

    /// One tick: follows the play, learns from the measurement if there is one, and returns the addition in the next
    /// tick.
    pub fn update(&self, state: &mut AdaptState<N>, seen: &Seen<'_>) -> Adapted {
        let contact = self.follow(state, seen.play);
        let generator = seen.input.generator.unwrap_or(state.generator);
        let moved = generator.minus_counts(state.generator);
        state.generator = generator;
        let verdict = match (state.learning(), seen.measured) {
            (Learning::On, Some(measured)) => self.learn(state, seen, measured, generator, contact),
            _ => Verdict::Idle,
        };
        state.counters.note(verdict);
        let side = if state.side < 0 { -1 } else { 1 };
        let next = self.row(generator.offset_counts(moved), seen.input.torque_n_m, side);
        self.adapted(state, &next, verdict)
    }

    /// Where the play is, from how it moved.
    fn follow(&self, state: &mut AdaptState<N>, play: &PlayState) -> Contact {
        let (Some(nominal), true) = (play.nominal(), play.is_known()) else {
            (state.has_contact, state.run) = (0, 0);
            return Contact::Unknown;
        };
        let at = nominal.offset_counts(play.offset_counts() as i64);
        let moved = if state.has_contact == 0 { 0 } else { at.minus_small_counts(state.contact) };
        (state.contact, state.has_contact) = (at, 1);
        let way = moved.saturating_abs();
        if way > 0 {
            let side = moved.signum();
            state.run = if side == state.side { state.run.saturating_add(way) } else { way };
            (state.side, state.touched) = (side, nominal);
        }
        let back = nominal.minus_small_counts(state.touched).saturating_mul(state.side.wrapping_neg());
        if state.side != 0 && state.run >= self.settle && back <= JITTER {
            Contact::Side(state.side)
        } else {
            Contact::Crossing
        }
    }

    /// How much of each coefficient, at its limit, is in the error there: in units of the noise.
    fn row(&self, generator: GeneratorAngle, torque_n_m: f32, side: i32) -> [f32; N] {
        // Not finite: nothing of the wind-up.
        let torque = if torque_n_m.is_finite() { torque_n_m } else { 0.0 };
        let torque = num::within(torque, [-self.torque_limit, self.torque_limit]);
        let turned = |order: u8| generator.fraction().wrapping_mul(order as u32);
        let mut row = self.per_noise;
        for (row, term) in row.iter_mut().zip(self.terms) {
            *row *= match Term::of_code(term) {
                Term::Mean => 1.0,
                Term::WindUp => torque,
                Term::HalfWidth => side.wrapping_neg() as f32,
                Term::Cos(order) => sine(turned(order).wrapping_add(1 << 30)),
                Term::Sin(order) => sine(turned(order)),
            };
        }
        row
    }

    /// Learns from one measurement.
    fn learn(
        &self,
        state: &mut AdaptState<N>,
        seen: &Seen<'_>,
        measured: OutputAngle,
        generator: GeneratorAngle,
        contact: Contact,
    ) -> Verdict {
        let out = seen.output;
        let doubtful = [Flags::SAMPLE_LOST, Flags::GLITCH, Flags::NOT_CORRECTED, Flags::TABLE_DOUBT, Flags::STATE_TORN];
        let trusted = matches!(out.quality, Quality::InRange | Quality::Uncertain)
            && seen.input.generator.is_some()
            && seen.input.torque_n_m.is_finite()
            && out.uncertainty_rad >= 0.0
            && out.uncertainty_rad.is_finite()
            && !doubtful.iter().any(|&flag| out.flags.contains(flag));
        if !trusted {
            return Verdict::Untrusted;
        }
        let Some([mean_counts, half_width_counts, _]) = seen.input.adjustment.open() else {
            return Verdict::Untrusted;
        };
        let side = match contact {
            Contact::Unknown => 0,
            Contact::Crossing => return Verdict::Unsettled,
            Contact::Side(side) => side,
        };
        let row = self.row(generator, seen.input.torque_n_m, side);
        let strength = dot(&row, &row);
        if strength < WEAKEST {
            return Verdict::Unexcited;
        }
        if !state.is_sound() {
            (state.x, state.consistency) = ([0.0; N], Consistency::NEW);
            self.open_up(state);
        }
        // What the table alone missed, less what is known of it already.
        let most = Adjustment::MAX_COUNTS;
        let applied = |counts: i32| counts.max(most.wrapping_neg()).min(most);
        let half = side.wrapping_mul(applied(half_width_counts));
        let beside = applied(mean_counts).wrapping_sub(half) as i64;
        let missed = measured.offset_counts(beside).minus_small_counts(out.output) as f32 / self.noise_counts;
        let innovation = missed - dot(&row, &state.x);
        let open = out.uncertainty_rad * COUNTS_PER_RAD / self.noise_counts;
        let open = if side == 0 { open + self.half_limit } else { open };
        let beyond = |missed: f32| num::larger(missed.abs() - open, 0.0);
        let excess = beyond(innovation);
        if open > 0.0 && excess == 0.0 {
            return Verdict::Quiet;
        }
        let scale = state.consistency.noise();
        let (stated, without) = (1.0 + open * open, beyond(missed));
        let noise = stated + (scale - 1.0);
        let judged = HypothesisErrors {
            with: excess * excess,
            without: without * without,
            noise,
            stated,
            learnt: spread_of(&transform(&state.u, &row), &state.d),
            prior: spread_of(&row, &self.first),
        };
        match state.consistency.judge(&judged, self.gate, self.per_window) {
            Judgement::Sensor => return Verdict::Outlier,
            Judgement::Anew => {
                self.open_up(state);
                return Verdict::Outlier;
            }
            Judgement::Fade(by) => state.x.iter_mut().for_each(|x| *x *= by),
        }
        if judged.with > self.gate * (noise + judged.learnt) {
            return Verdict::Outlier;
        }
        let gains = measure(&mut state.d, &mut state.u, &row, noise);
        let excess = if innovation < 0.0 { -excess } else { excess };
        // What was learnt is forgotten in the direction of the measurement.
        let (share, mut wander) = (self.forget * num::sqrt::<3>(scale) / strength, row);
        for ((x, gain), wander) in state.x.iter_mut().zip(gains).zip(&mut wander) {
            let free = *x + gain * excess;
            let held = num::within(free, [-1.0, 1.0]);
            state.counters.limited = state.counters.limited.saturating_add(u32::from(held != free));
            // No measurement said to hold it at its limit: by so much it is less known. Else what follows would look
            // like outliers for ever.
            *wander = *wander * share + (free - held);
            *x = held;
        }
        wander_by(&mut state.d, &mut state.u, wander);
        self.bound_variances(state);
        Verdict::Used
    }

    /// Goes back to the covariance of the settings: the next measurements decide.
    fn open_up(&self, state: &mut AdaptState<N>) {
        (state.d, state.u) = (self.first, [[0.0; N]; N]);
        state.counters.restarts = state.counters.restarts.saturating_add(1);
    }

    /// Scales rows and columns so that no variance exceeds its first one: what is symmetric and positive stays so.
    fn bound_variances(&self, state: &mut AdaptState<N>) {
        let mut scale = [1.0; N];
        for ((scale, variance), first) in scale.iter_mut().zip(state.variances()).zip(self.first) {
            *scale = if variance > first { num::sqrt::<3>(first / variance) } else { 1.0 };
        }
        for ((column, d), by) in state.u.iter_mut().zip(&mut state.d).zip(scale) {
            *d *= by * by;
            column.iter_mut().zip(scale).for_each(|(u, own)| *u *= own / by);
        }
    }

    fn adapted(&self, state: &AdaptState<N>, row: &[f32; N], verdict: Verdict) -> Adapted {
        let noise_rad = self.noise_counts * RAD_PER_COUNT;
        let is_lost = state.learning == Learning::LOST || !state.x.iter().all(|x| x.abs() <= 1.0);
        if is_lost || state.learning() == Learning::Off {
            // All that coefficients can have added here.
            let uncertainty_rad = if is_lost { row.iter().map(|h| h.abs()).sum::<f32>() * noise_rad } else { 0.0 };
            let adjustment = Adjustment::default().with_uncertainty(uncertainty_rad);
            let verdict = if is_lost { Verdict::Lost } else { verdict };
            return Adapted { adjustment, uncertainty_rad, verdict };
        }
        let (mut mean, mut half) = (0.0, 0.0);
        let parts = self.terms.iter().zip(state.x).zip(row.iter().zip(self.per_noise));
        for ((term, x), (h, per_noise)) in parts {
            match Term::of_code(*term) {
                Term::HalfWidth => half += x * per_noise,
                _ => mean += x * h,
            }
        }
        let learnt = spread_of(&transform(&state.u, row), &state.d);
        let variance = learnt + state.consistency.doubt(spread_of(row, &self.first));
        Adapted {
            adjustment: Adjustment::from_rad(mean * noise_rad, half * noise_rad),
            uncertainty_rad: num::sqrt::<3>(variance) * noise_rad,
            verdict,
        }
    }

    /// The coefficients in the order of the settings, and their standard deviations: rad, or rad/(N·m).
    #[must_use]
    pub fn coefficients(&self, state: &AdaptState<N>) -> [(f32, f32); N] {
        let mut found = [(0.0, 0.0); N];
        let parts = state.x.iter().zip(state.variances()).zip(self.limits);
        for (to, ((x, variance), limit)) in found.iter_mut().zip(parts) {
            *to = (x * limit, num::sqrt::<3>(variance) * limit);
        }
        found
    }

    /// See `save` of what is kept under a sum: the first N coefficients.
    pub(crate) fn save_first(&self, state: &AdaptState<N>, used: usize, bytes: &mut [u8]) -> Option<usize> {
        let bytes = bytes.get_mut(..saved_adapt_bytes(used))?;
        let above = state.u.iter().take(used).enumerate().flat_map(|(j, column)| column.iter().take(j));
        let numbers = state.x.iter().take(used).chain(state.d.iter().take(used)).chain(above);
        seal(bytes, self.heading().into_iter().chain(numbers.map(|number| number.to_bits())));
        Some(saved_adapt_bytes(used))
    }

    /// See `restore` there.
    pub(crate) fn restore_first(&self, used: usize, bytes: &[u8]) -> Result<AdaptState<N>, AdaptRestoreError> {
        let needed = saved_adapt_bytes(used);
        let short = AdaptRestoreError::Short { found: bytes.len(), needed };
        let (contents, crc) = bytes.get(..needed).and_then(|bytes| bytes.split_last_chunk::<4>()).ok_or(short)?;
        let (heading, numbers) = contents.as_chunks::<4>().0.split_first_chunk::<HEADING>().ok_or(short)?;
        let [mark, ..] = *heading;
        if mark != SAVED_MARK {
            return Err(AdaptRestoreError::Version { found: mark });
        }
        if u32::from_le_bytes(*crc) != crc32(contents) {
            return Err(AdaptRestoreError::Crc);
        }
        let (found, wanted) = (heading.map(u32::from_le_bytes), self.heading());
        let (_, table, joint, sum) = parts(&found);
        let (_, own_table, own_joint, own_sum) = parts(&wanted);
        if table != own_table {
            return Err(AdaptRestoreError::OtherTable);
        }
        if joint != own_joint {
            return Err(AdaptRestoreError::OtherJoint);
        }
        if sum != own_sum {
            return Err(AdaptRestoreError::OtherCoefficients);
        }
        let mut state = AdaptState { consistency: Consistency::RESTORED, ..self.start() };
        let above = state.u.iter_mut().take(used).enumerate().flat_map(|(j, column)| column.iter_mut().take(j));
        let places = state.x.iter_mut().take(used).chain(state.d.iter_mut().take(used)).chain(above);
        for (to, from) in places.zip(numbers) {
            *to = f32::from_le_bytes(*from);
        }
        if state.is_sound() { Ok(state) } else { Err(AdaptRestoreError::Impossible) }
    }

    /// First words of a saved state.
    fn heading(&self) -> [u32; HEADING] {
        let Owner { table: [a, b], joint: [c, d], unit } = self.owner;
        [u32::from_le_bytes(SAVED_MARK), a, b, c, d, unit, self.sum]
    }
}

/// Words before the numbers of a saved state.
const HEADING: usize = 7;
/// First bytes of a saved state; the last byte is the version. Version 1 had no mark and no owner.
const SAVED_MARK: [u8; 4] = *b"FXA\x02";

/// Mark, table, joint with unit, and settings.
const fn parts(heading: &[u32; HEADING]) -> (u32, [u32; 2], [u32; 3], u32) {
    let [mark, a, b, c, d, unit, sum] = *heading;
    (mark, [a, b], [c, d, unit], sum)
}

/// Whose coefficients they are; zeros if nobody said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Owner {
    table: [u32; 2],
    joint: [u32; 2],
    unit: u32,
}

flexspline::shared::words!([] Owner { table, joint, unit });

impl Owner {
    fn of(joint: &Joint, store: &Store, unit: u32) -> Self {
        let [a, b, c, d] = owner(joint, store);
        if [a, b] == [0; 2] { Self::default() } else { Self { table: [a, b], joint: [c, d], unit } }
    }
}
