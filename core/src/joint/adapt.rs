//! What measurements of the output teach beside the table: a few coefficients, by recursive least squares.
//!
//! ```text
//! y − ŷ = h·x + v,      error = table + m + g·τ + Σ (aₙ·cos nψ + bₙ·sin nψ) − s·w
//! ```
//!
//! with `y` the measured output and `ŷ` what the table says, `m` a mean offset, `g` a wind-up beside the table's, `w` a half-width
//! beside the table's with `s` = ±1 the side of the play in contact, and `a`, `b` the cosine and sine of a few orders of the
//! generator angle. Which of them are estimated is a list of [`Term`]s; their number is a type.
//!
//! [`Adapter::update`] is called once each tick after [`Joint::tick`](crate::Joint::tick), with a measurement if there is one: an
//! encoder at the output each tick, or a star or beacon now and then. What it returns is added in the next tick.
//!
//! # How
//! A Kalman filter for coefficients that wander, in the form `P = U·D·Uᵀ` (Bierman, *Factorization Methods for Discrete Sequential
//! Estimation*, 1977, ch. V: the measurement; Agee and Turner 1972: the wandering). `D ≥ 0` holds whatever the rounding, so the
//! covariance stays symmetric and positive in `f32`, for any number of updates.
//!
//! * Forgetting is directional: a measurement in direction `h` adds `h·hᵀ/(|h|⁴·M²)` to the covariance first, `M` the
//!   [memory](AdaptSettings::memory_measurements). In directions in which nothing is measured nothing is forgotten, so nothing
//!   drifts there and no variance winds up; a correlation learnt long ago fades where only one of the two is excited.
//! * No variance grows beyond its first one.
//! * An innovation beyond so many standard deviations is an outlier: counted, not used.
//! * Where the error is known to within ± an interval only (side of the play unknown, torque inside a jump), that much of an
//!   innovation says nothing: only what exceeds it is used (a dead zone), with the interval added to the noise.
//! * After a reversal, from where contact is lost until the play has moved on by four times the limit of the half-width (it is taken
//!   up later or earlier than estimated by no more) and [`AdaptSettings::settle_rad`], nothing is learnt.
//! * Every coefficient stays within its limit.
//!
//! # Not in here
//! The measurement must be of the same moment as the generator sample of the tick. What a delay does looks like an offset that
//! changes with the direction, and would be taken for play.

#![allow(clippy::arithmetic_side_effects)] // Floating-point numbers: nothing overflows. Integers are handled by name.

use super::runtime::{Adjustment, Flags, Input, Output};
use crate::angle::{COUNTS_PER_RAD, GeneratorAngle, OutputAngle, RAD_PER_COUNT, counts_from_rad};
use crate::crc::crc32;
use crate::num;
use crate::play::PlayState;
use crate::table::Quality;
use core::fmt;

/// A coefficient beside the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Term {
    /// Offset of the mean error, rad.
    Mean,
    /// Wind-up, rad/(N·m).
    WindUp,
    /// Half-width of the play, rad.
    HalfWidth,
    /// Cosine of so many periods in a generator turn, rad.
    Cos(u8),
    /// Sine of so many periods in a generator turn, rad.
    Sin(u8),
}

/// A coefficient to be estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficient {
    /// Which.
    pub term: Term,
    /// It stays within ± this: rad, or rad/(N·m); above 0, 0.05 at most.
    pub limit: f32,
    /// Standard deviation that it is expected to have at first, and never exceeds: same unit, above 0.
    pub initial_std: f32,
}

/// What an [`Adapter`] is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptSettings<const N: usize> {
    /// The coefficients.
    pub coefficients: [Coefficient; N],
    /// Standard deviation of one measurement, rad at the output: its noise and what the table missed of its samples.
    pub noise_rad: f32,
    /// Measurements after which what was learnt in their direction is forgotten: 1 to 10⁶.
    pub memory_measurements: f32,
    /// Standard deviations beyond which an innovation is an outlier: 1 to 100.
    pub gate: f32,
    /// Way at the output after a reversal that is left out beside four times the limit of the half-width, rad: elastic hysteresis;
    /// 0 to 0.05.
    pub settle_rad: f32,
    /// Torque beyond which the wind-up's share grows no more, N·m.
    pub torque_limit_n_m: f32,
}

/// Which setting cannot be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AdaptError {
    /// Name of the setting.
    pub name: &'static str,
    /// Value found.
    pub found: f32,
}

impl fmt::Display for AdaptError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}: not within its range", self.name, self.found)
    }
}

impl core::error::Error for AdaptError {}

/// Whether measurements change anything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Learning {
    /// The adjustment is zero; what was learnt is kept. The start.
    #[default]
    Off,
    /// What was learnt is used and stays as it is.
    Frozen,
    /// Measurements are used.
    On,
}

/// One tick as the adapter sees it.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'s> {
    /// What the tick was given: generator, torque, and the adjustment that was in force.
    pub input: &'s Input,
    /// The play after the tick.
    pub play: &'s PlayState,
    /// What the tick gave.
    pub output: &'s Output,
    /// The output angle as measured at the same moment; `None` if there is no measurement.
    pub measured: Option<OutputAngle>,
}

/// What became of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Verdict {
    /// There was none, or nothing is to be learnt.
    Idle,
    /// Used.
    Used,
    /// Within what is not known anyway: it says nothing.
    Quiet,
    /// Beyond the gate.
    Outlier,
    /// Too soon after a reversal.
    Unsettled,
    /// No coefficient changes the output enough here to be seen in the noise.
    Unexcited,
    /// The tick itself was not to be trusted: sample lost or not believed, torque out of range or not finite, table in doubt.
    Untrusted,
}

/// How many measurements of each [`Verdict`], and what else happened; all stop at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AdaptCounters {
    /// [`Verdict::Used`].
    pub used: u32,
    /// [`Verdict::Quiet`].
    pub quiet: u32,
    /// [`Verdict::Outlier`].
    pub outliers: u32,
    /// Outliers in a row until now: many say that the output encoder or its zero is not what it was.
    pub outliers_in_a_row: u32,
    /// [`Verdict::Unsettled`].
    pub unsettled: u32,
    /// [`Verdict::Unexcited`].
    pub unexcited: u32,
    /// [`Verdict::Untrusted`].
    pub untrusted: u32,
    /// Coefficients held at their limit, once for each and each measurement.
    pub limited: u32,
    /// Starts from zero because the state was hit by an upset.
    pub restarts: u32,
}

/// What is to be added to the table in the next tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapted {
    /// For [`Input`](crate::Input) of the next tick.
    pub adjustment: Adjustment,
    /// Standard deviation of what it adds to the error, rad.
    pub uncertainty_rad: f32,
    /// What became of the measurement.
    pub verdict: Verdict,
}

/// Estimates `N` coefficients: all that does not change while it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapter<const N: usize> {
    terms: [Term; N],
    /// Limits, rad or rad/(N·m): the units of the coefficients inside.
    limits: [f32; N],
    /// First variances in those units, and the row of a measurement in units of noise and limit.
    first: [f32; N],
    per_noise: [f32; N],
    noise_counts: f32,
    /// 1/M, and the square of the gate.
    forget: f32,
    gate: f32,
    settle: i32,
    /// Half-width that is in doubt while the side is not known, in units of the noise.
    half_limit: f32,
    torque_limit: f32,
    /// Of the settings: a saved state of others is not taken.
    sum: u32,
}

/// What is learnt. Coefficients in units of their limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptState<const N: usize> {
    x: [f32; N],
    d: [f32; N],
    /// Columns above the diagonal, which is 1.
    u: [[f32; N]; N],
    learning: Learning,
    counters: AdaptCounters,
    generator: GeneratorAngle,
    contact: Option<OutputAngle>,
    /// Nominal output where the play last moved, the side in contact there, and the way it moved to that side.
    touched: OutputAngle,
    side: i32,
    run: i32,
}

/// Bytes of the saved state of `coefficients` coefficients.
#[must_use]
pub const fn saved_adapt_bytes(coefficients: usize) -> usize {
    let upper = coefficients.saturating_mul(coefficients.saturating_sub(1)) >> 1;
    coefficients.saturating_mul(2).saturating_add(upper).saturating_add(2).saturating_mul(4)
}

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

impl<const N: usize> Adapter<N> {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`AdaptError`] names the first that is out of its range.
    pub fn new(settings: &AdaptSettings<N>) -> Result<Self, AdaptError> {
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
        for Coefficient { term, limit, initial_std } in coefficients {
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
        for Coefficient { term, limit, initial_std } in coefficients {
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
            terms: coefficients.map(|c| c.term),
            limits: coefficients.map(|c| c.limit),
            first: coefficients.map(|c| square(c.initial_std / c.limit)),
            per_noise: coefficients.map(|c| c.limit / noise_rad),
            noise_counts: noise_rad * COUNTS_PER_RAD,
            forget: 1.0 / memory_measurements,
            gate: square(gate),
            settle: counts_from_rad(4.0 * half_limit).saturating_add(counts_from_rad(settle_rad)),
            half_limit: half_limit / noise_rad,
            torque_limit: torque_limit_n_m,
            sum,
        })
    }

    /// A state in which nothing is learnt yet, [`Learning::Off`].
    #[must_use]
    pub const fn start(&self) -> AdaptState<N> {
        AdaptState {
            x: [0.0; N],
            d: self.first,
            u: [[0.0; N]; N],
            learning: Learning::Off,
            counters: AdaptCounters {
                used: 0,
                quiet: 0,
                outliers: 0,
                outliers_in_a_row: 0,
                unsettled: 0,
                unexcited: 0,
                untrusted: 0,
                limited: 0,
                restarts: 0,
            },
            generator: GeneratorAngle::ZERO,
            contact: None,
            touched: OutputAngle::ZERO,
            side: 0,
            run: 0,
        }
    }

    /// Forgets what was learnt; counters and [`Learning`] stay. The joint's limiter takes the adjustment out.
    pub fn reset(&self, state: &mut AdaptState<N>) {
        let AdaptState { learning, counters, .. } = *state;
        *state = AdaptState { learning, counters, ..self.start() };
    }

    /// One tick: follows the play, learns from the measurement if there is one, and tells what to add in the next tick.
    ///
    /// Call it every tick, in order, also without a measurement. Nothing that comes in can make the adjustment exceed the limits
    /// or be undefined. No search, no loop that depends on data: on a Cortex-M4F a tick with a measurement that is used takes 1573
    /// instructions for five coefficients, whatever the values, and one without at most 445 (counted by `tests/firmware`).
    pub fn update(&self, state: &mut AdaptState<N>, seen: &Seen<'_>) -> Adapted {
        let contact = self.follow(state, seen.play);
        let generator = seen.input.generator.unwrap_or(state.generator);
        let moved = generator.minus_counts(state.generator);
        state.generator = generator;
        let verdict = match (state.learning, seen.measured) {
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
            (state.contact, state.run) = (None, 0);
            return Contact::Unknown;
        };
        let at = nominal.offset_counts(play.offset_counts() as i64);
        let moved = state.contact.map_or(0, |last| at.minus_small_counts(last));
        state.contact = Some(at);
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
            *row *= match term {
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
            && !doubtful.iter().any(|&flag| out.flags.contains(flag));
        if !trusted {
            return Verdict::Untrusted;
        }
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
            self.reset(state);
            state.counters.restarts = state.counters.restarts.saturating_add(1);
        }
        // What the table alone missed, less what is known of it already.
        let most = Adjustment::MAX_COUNTS;
        let applied = |counts: i32| counts.max(most.wrapping_neg()).min(most);
        let Adjustment { mean_counts, half_width_counts } = seen.input.adjustment;
        let half = side.wrapping_mul(applied(half_width_counts));
        let beside = applied(mean_counts).wrapping_sub(half) as i64;
        let missed = measured.offset_counts(beside).minus_small_counts(out.output) as f32;
        let innovation = missed / self.noise_counts - dot(&row, &state.x);
        let open = out.uncertainty_rad * COUNTS_PER_RAD / self.noise_counts;
        let open = if side == 0 { open + self.half_limit } else { open };
        let excess = innovation.abs() - open;
        if !(open >= 0.0 && (excess > 0.0 || open == 0.0)) {
            return Verdict::Quiet;
        }
        let noise = 1.0 + open * open;
        let (seen_as, expected) = (transform(&state.u, &row), state.d);
        let spread = noise + seen_as.iter().zip(expected).map(|(f, d)| d * f * f).sum::<f32>();
        let plausible = excess * excess <= self.gate * spread;
        if !plausible {
            return Verdict::Outlier;
        }
        let wander = row.map(|h| h * self.forget / strength);
        wander_by(&mut state.d, &mut state.u, wander);
        let gains = measure(&mut state.d, &mut state.u, &row, noise);
        self.bound_variances(state);
        let excess = if innovation < 0.0 { -excess } else { excess };
        for (x, gain) in state.x.iter_mut().zip(gains) {
            let free = *x + gain * excess;
            *x = num::within(free, [-1.0, 1.0]);
            state.counters.limited = state.counters.limited.saturating_add(u32::from(*x != free));
        }
        Verdict::Used
    }

    /// Scales rows and columns so that no variance exceeds its first one: what is symmetric and positive stays so.
    fn bound_variances(&self, state: &mut AdaptState<N>) {
        let mut scale = [1.0; N];
        for ((scale, variance), first) in scale.iter_mut().zip(state.variances()).zip(self.first) {
            *scale = if variance > first { num::sqrt(first / variance) } else { 1.0 };
        }
        for ((column, d), by) in state.u.iter_mut().zip(&mut state.d).zip(scale) {
            *d *= by * by;
            column.iter_mut().zip(scale).for_each(|(u, own)| *u *= own / by);
        }
    }

    fn adapted(&self, state: &AdaptState<N>, row: &[f32; N], verdict: Verdict) -> Adapted {
        if state.learning == Learning::Off || !state.x.iter().all(|x| x.abs() <= 1.0) {
            return Adapted { adjustment: Adjustment::default(), uncertainty_rad: 0.0, verdict };
        }
        let (mut mean, mut half) = (0.0, 0.0);
        let parts = self.terms.iter().zip(state.x).zip(row.iter().zip(self.per_noise));
        for ((term, x), (h, per_noise)) in parts {
            match term {
                Term::HalfWidth => half += x * per_noise,
                _ => mean += x * h,
            }
        }
        let noise_rad = self.noise_counts * RAD_PER_COUNT;
        let variance: f32 = transform(&state.u, row).iter().zip(state.d).map(|(f, d)| d * f * f).sum();
        Adapted {
            adjustment: Adjustment::from_rad(mean * noise_rad, half * noise_rad),
            uncertainty_rad: num::sqrt(variance) * noise_rad,
            verdict,
        }
    }

    /// The coefficients in the order of the settings, and their standard deviations: rad, or rad/(N·m).
    #[must_use]
    pub fn coefficients(&self, state: &AdaptState<N>) -> [(f32, f32); N] {
        let mut found = [(0.0, 0.0); N];
        let parts = state.x.iter().zip(state.variances()).zip(self.limits);
        for (to, ((x, variance), limit)) in found.iter_mut().zip(parts) {
            *to = (x * limit, num::sqrt(variance) * limit);
        }
        found
    }

    /// Writes what was learnt, with a CRC-32, for storage across a reset: the first [`saved_adapt_bytes`]`(N)` bytes.
    /// `None` if there are fewer.
    ///
    /// | bytes | what, little endian |
    /// |---|---|
    /// | 4·N | coefficients in units of their limits, `f32` |
    /// | 4·N | `D`, `f32` |
    /// | 2·N·(N−1) | `U` above its diagonal, by columns, `f32` |
    /// | 4 | sum of the settings |
    /// | 4 | CRC-32 of all before |
    pub fn save(&self, state: &AdaptState<N>, bytes: &mut [u8]) -> Option<usize> {
        let bytes = bytes.get_mut(..saved_adapt_bytes(N))?;
        let (contents, crc) = bytes.split_last_chunk_mut::<4>()?;
        let above = state.u.iter().enumerate().flat_map(|(j, column)| column.iter().take(j));
        let numbers = state.x.iter().chain(&state.d).chain(above).map(|number| number.to_bits());
        for (to, from) in contents.as_chunks_mut::<4>().0.iter_mut().zip(numbers.chain([self.sum])) {
            *to = from.to_le_bytes();
        }
        *crc = crc32(contents).to_le_bytes();
        Some(saved_adapt_bytes(N))
    }

    /// A state from [`Self::save`], in [`Learning::Off`]; `None` if the bytes are damaged or were saved with other coefficients.
    #[must_use]
    pub fn restore(&self, bytes: &[u8]) -> Option<AdaptState<N>> {
        let bytes = bytes.get(..saved_adapt_bytes(N))?;
        let (contents, crc) = bytes.split_last_chunk::<4>()?;
        let mut words = contents.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word));
        let mut state = self.start();
        let above = state.u.iter_mut().enumerate().flat_map(|(j, column)| column.iter_mut().take(j));
        for to in state.x.iter_mut().chain(&mut state.d).chain(above) {
            *to = f32::from_bits(words.next()?);
        }
        let same = words.next()? == self.sum && u32::from_le_bytes(*crc) == crc32(contents);
        (same && state.is_sound()).then_some(state)
    }
}

impl<const N: usize> AdaptState<N> {
    /// Whether measurements are used.
    #[must_use]
    pub const fn learning(&self) -> Learning {
        self.learning
    }

    /// Switches it, from the next update on.
    pub const fn set_learning(&mut self, learning: Learning) {
        self.learning = learning;
    }

    /// What became of the measurements.
    #[must_use]
    pub const fn counters(&self) -> AdaptCounters {
        self.counters
    }

    /// Whether it is what updates leave.
    fn is_sound(&self) -> bool {
        self.x.iter().all(|x| x.abs() <= 1.0)
            && self.d.iter().all(|d| *d >= 0.0 && *d < 1e6)
            && self.u.as_flattened().iter().all(|u| u.is_finite())
    }

    /// The diagonal of `U·D·Uᵀ`.
    fn variances(&self) -> [f32; N] {
        let mut variances = self.d;
        for (j, (column, d)) in self.u.iter().zip(self.d).enumerate() {
            variances.iter_mut().zip(column).take(j).for_each(|(variance, u)| *variance += d * u * u);
        }
        variances
    }
}

impl AdaptCounters {
    fn note(&mut self, verdict: Verdict) {
        let one = |counter: &mut u32| *counter = counter.saturating_add(1);
        match verdict {
            Verdict::Idle => return,
            Verdict::Used => one(&mut self.used),
            Verdict::Quiet => one(&mut self.quiet),
            Verdict::Outlier => one(&mut self.outliers),
            Verdict::Unsettled => one(&mut self.unsettled),
            Verdict::Unexcited => one(&mut self.unexcited),
            Verdict::Untrusted => one(&mut self.untrusted),
        }
        match verdict {
            Verdict::Outlier => one(&mut self.outliers_in_a_row),
            Verdict::Used | Verdict::Quiet => self.outliers_in_a_row = 0,
            _ => {}
        }
    }
}

fn dot<const N: usize>(a: &[f32; N], b: &[f32; N]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `Uᵀ·h`.
fn transform<const N: usize>(u: &[[f32; N]; N], h: &[f32; N]) -> [f32; N] {
    let mut f = *h;
    for (j, (f, column)) in f.iter_mut().zip(u).enumerate() {
        *f += column.iter().zip(h).take(j).map(|(u, h)| u * h).sum::<f32>();
    }
    f
}

/// `U·D·Uᵀ + a·aᵀ` (Agee and Turner).
fn wander_by<const N: usize>(d: &mut [f32; N], u: &mut [[f32; N]; N], mut a: [f32; N]) {
    let mut share = 1.0;
    for (j, (d, column)) in d.iter_mut().zip(u).enumerate().rev() {
        let own = a.get(j).copied().unwrap_or(0.0);
        let sum = *d + share * own * own;
        // Neither variance nor wandering: nothing to change.
        if sum > 0.0 {
            let by = share * own / sum;
            for (a, u) in a.iter_mut().zip(column).take(j) {
                *a -= own * *u;
                *u += by * *a;
            }
            share *= *d / sum;
            *d = sum;
        }
    }
}

/// One measurement with this row and noise (Bierman); returns the gains.
fn measure<const N: usize>(d: &mut [f32; N], u: &mut [[f32; N]; N], row: &[f32; N], noise: f32) -> [f32; N] {
    let f = transform(u, row);
    let mut gains = [0.0; N];
    let mut spread = noise;
    for (j, ((d, column), f)) in d.iter_mut().zip(u).zip(f).enumerate() {
        let own = *d * f;
        let (before, back) = (spread, -f / spread);
        spread += own * f;
        *d *= before / spread;
        for (gain, u) in gains.iter_mut().zip(column).take(j) {
            let above = *u;
            *u += *gain * back;
            *gain += above * own;
        }
        if let Some(gain) = gains.get_mut(j) {
            *gain = own;
        }
    }
    gains.map(|gain| gain / spread)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const HALF_RAD: f64 = 1.5e-4;
    const COUNTS: f64 = COUNTS_PER_RAD as f64;

    const SETTINGS: AdaptSettings<7> = AdaptSettings {
        coefficients: [
            Coefficient { term: Term::Mean, limit: 2e-4, initial_std: 1e-4 },
            Coefficient { term: Term::WindUp, limit: 1e-5, initial_std: 5e-6 },
            Coefficient { term: Term::HalfWidth, limit: 5e-5, initial_std: 2e-5 },
            Coefficient { term: Term::Cos(2), limit: 1e-4, initial_std: 3e-5 },
            Coefficient { term: Term::Sin(2), limit: 1e-4, initial_std: 3e-5 },
            Coefficient { term: Term::Cos(1), limit: 1e-4, initial_std: 3e-5 },
            Coefficient { term: Term::Sin(1), limit: 1e-4, initial_std: 3e-5 },
        ],
        noise_rad: 2e-6,
        memory_measurements: 2000.0,
        gate: 5.0,
        settle_rad: 1e-5,
        torque_limit_n_m: 50.0,
    };

    /// Numbers that look random, of unit variance and within ±1.8.
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((self.0 >> 33) as f64 / (1u64 << 30) as f64 - 1.0) * 3f64.sqrt()
        }
    }

    /// A drive that differs from its table in the seven coefficients; own arithmetic.
    struct Plant {
        hidden: [f64; 7],
        /// Where the output rests, rad.
        contact: f64,
    }

    impl Plant {
        fn output(&mut self, generator: f64, torque: f64) -> f64 {
            let nominal = generator / 95.0;
            let [mean, gain, half, c2, s2, c1, s1] = self.hidden;
            let half = HALF_RAD + half;
            let turned = c2 * (2.0 * generator).cos()
                + s2 * (2.0 * generator).sin()
                + c1 * generator.cos()
                + s1 * generator.sin();
            let centre = nominal + torque / 3e4 + mean + gain * torque + turned;
            self.contact = self.contact.max(centre - half).min(centre + half);
            self.contact
        }
    }

    /// Table, adapter and plant in a loop: the table is flat but for wind-up and play.
    struct Loop<const N: usize> {
        adapter: Adapter<N>,
        state: AdaptState<N>,
        play: PlayState,
        plant: Plant,
        noise: Noise,
        applied: Adjustment,
        /// What the adjusted table missed of the truth in the last tick, rad.
        missed: f64,
        last: Adapted,
        adjusted: i32,
    }

    impl<const N: usize> Loop<N> {
        fn new(settings: &AdaptSettings<N>, hidden: [f64; 7], seed: u64) -> Self {
            let adapter = Adapter::new(settings).unwrap();
            let mut state = adapter.start();
            state.set_learning(Learning::On);
            let plant = Plant { hidden, contact: 0.0 };
            let applied = Adjustment::default();
            let last = Adapted { adjustment: applied, uncertainty_rad: 0.0, verdict: Verdict::Idle };
            let play = PlayState::unknown();
            Self { adapter, state, play, plant, noise: Noise(seed), applied, missed: 0.0, last, adjusted: 0 }
        }

        /// `off` is what the sensor is off by; `None` if there is no measurement.
        fn tick(&mut self, generator: f64, torque: f64, off: Option<f64>) {
            let angle = GeneratorAngle::from_rad(generator).unwrap();
            let nominal = OutputAngle::from_rad(generator / 95.0).unwrap();
            let centre = ((torque / 3e4 * COUNTS) as i32).saturating_add(self.applied.mean_counts);
            let half = ((HALF_RAD * COUNTS) as i32 + self.applied.half_width_counts).max(0);
            self.play.shift(self.applied.mean_counts.wrapping_sub(self.adjusted));
            self.adjusted = self.applied.mean_counts;
            let error = self.play.update(nominal, centre, half, true);
            let estimated = nominal.offset_counts(error as i64);
            let truth = self.plant.output(generator, torque);
            let output = Output {
                command: angle,
                output: estimated,
                transmission_error_rad: error as f32 * RAD_PER_COUNT,
                uncertainty_rad: self.play.uncertainty_rad(),
                correction_rad: 0.0,
                held_back_rad: 0.0,
                quality: if self.play.is_known() { Quality::InRange } else { Quality::Uncertain },
                flags: Flags::default(),
            };
            self.missed = truth - estimated.to_rad();
            let noise = 2e-6 * self.noise.next();
            let measured = off.map(|off| OutputAngle::from_rad(truth + noise + off).unwrap_or_default());
            let input = Input {
                generator: Some(angle),
                target: estimated,
                torque_n_m: torque as f32,
                missed_ticks: 0,
                adjustment: self.applied,
            };
            let seen = Seen { input: &input, play: &self.play, output: &output, measured };
            self.last = self.adapter.update(&mut self.state, &seen);
            self.applied = self.last.adjustment;
        }

        /// To and fro with changing torque; the largest miss in the last tenth, in contact.
        fn swing(&mut self, ticks: usize, torque: impl Fn(f64) -> f64) -> f64 {
            let mut worst = 0.0f64;
            for i in 0..ticks {
                let time = i as f64 * 1e-3;
                self.tick(30.0 * (0.9 * time).sin(), torque(time), Some(0.0));
                let settled = matches!(self.last.verdict, Verdict::Used);
                worst = if settled && 10 * i > 9 * ticks { worst.max(self.missed.abs()) } else { worst };
            }
            worst
        }
    }

    const HIDDEN: [f64; 7] = [8e-5, -4e-6, 2.5e-5, 2e-5, -3e-5, -1e-5, 1.5e-5];

    fn mixed(time: f64) -> f64 {
        15.0 * (2.3 * time).sin() + 5.0 * (0.7 * time).cos()
    }

    #[test]
    fn sines_are_sines() {
        for i in 0..100_000u32 {
            let fraction = i.wrapping_mul(0x9e37_79b9);
            let exact = (fraction as f64 / 4_294_967_296.0 * core::f64::consts::TAU).sin();
            assert!((sine(fraction) as f64 - exact).abs() < 4e-7, "{fraction} {}", sine(fraction) as f64 - exact);
        }
    }

    #[test]
    fn it_finds_what_differs_from_the_table() {
        let mut run = Loop::new(&SETTINGS, HIDDEN, 1);
        let before = Loop::new(&SETTINGS, HIDDEN, 1).swing(2, |_| 10.0);
        let worst = run.swing(60_000, mixed);
        assert!(worst < 1e-6, "{worst:e} {before:e}");
        for (((found, std), hidden), of) in
            run.adapter.coefficients(&run.state).into_iter().zip(HIDDEN).zip(SETTINGS.coefficients)
        {
            assert!((found as f64 - hidden).abs() < 5.0 * std as f64 + 1e-9, "{:?} {found:e} {std:e}", of.term);
            assert!(std < 0.1 * of.initial_std, "{:?} {std:e}", of.term);
        }
        let counters = run.state.counters();
        assert!(counters.used > 40_000 && counters.unsettled > 100, "{counters:?}");
        assert_eq!((counters.outliers, counters.limited, counters.restarts), (0, 0, 0));
        // It follows what changes: what was learnt is forgotten within its memory.
        run.plant.hidden[0] -= 1.5e-5;
        assert!(run.swing(60_000, mixed) < 1e-6);
    }

    /// A seldom fix is enough, and what is learnt off is not added.
    #[test]
    fn a_fix_now_and_then_and_the_switch() {
        let mut run = Loop::new(&SETTINGS, HIDDEN, 2);
        for i in 0..400_000 {
            let time = i as f64 * 1e-3;
            run.tick(30.0 * (0.9 * time).sin(), mixed(time), (i % 97 == 0).then_some(0.0));
        }
        let (found, std) = run.adapter.coefficients(&run.state)[0];
        assert!((found - 8e-5).abs() < 2e-6 && std < 1e-6, "{found:e} {std:e}");
        run.state.set_learning(Learning::Off);
        run.tick(0.3, 10.0, Some(0.0));
        assert_eq!(run.last.adjustment, Adjustment::default());
        run.state.set_learning(Learning::Frozen);
        let before = run.adapter.coefficients(&run.state);
        run.swing(5000, mixed);
        assert_eq!(run.adapter.coefficients(&run.state), before);
        assert!(run.applied.half_width_counts > 10_000);
        run.adapter.reset(&mut run.state);
        run.tick(0.3, 10.0, Some(0.0));
        assert_eq!(run.last.adjustment, Adjustment::default());
    }

    #[test]
    fn outliers_and_what_is_no_number_change_nothing() {
        let mut run = Loop::new(&SETTINGS, HIDDEN, 3);
        run.swing(30_000, mixed);
        let before = run.adapter.coefficients(&run.state);
        for (i, off) in [1e-4, -1e-4, 0.1, -3.0, 1e5].into_iter().enumerate() {
            run.tick(30.0 * (0.9 * 30.0f64).sin() - 1e-3 * i as f64, 12.0, Some(off));
        }
        let counters = run.state.counters();
        assert_eq!((counters.outliers, counters.outliers_in_a_row), (5, 5));
        for torque in [f64::NAN, f64::INFINITY] {
            run.tick(1.0, torque, Some(0.0));
            assert_eq!(run.last.verdict, Verdict::Untrusted);
        }
        assert_eq!(run.adapter.coefficients(&run.state), before);
        // An offset that stays, beyond the gate, stays out, and is told.
        for i in 0..3000 {
            run.tick(27.0 + 1e-2 * i as f64, 12.0, Some(1e-3));
        }
        assert_eq!(run.adapter.coefficients(&run.state), before);
        assert!(run.state.counters().outliers_in_a_row > 2500);
    }

    /// What the motion does not excite stays, whatever else moves.
    #[test]
    fn what_is_not_excited_stays() {
        let mut run = Loop::new(&SETTINGS, HIDDEN, 4);
        run.swing(60_000, mixed);
        let learnt = run.adapter.coefficients(&run.state);
        // No torque; the mean wanders, as with temperature.
        for _ in 0..10 {
            run.plant.hidden[0] -= 1e-5;
            run.swing(10_000, |_| 0.0);
        }
        let after = run.adapter.coefficients(&run.state);
        assert!((after[0].0 - (8e-5 - 1e-4)).abs() < 2e-6, "{:e}", after[0].0);
        assert!((after[1].0 - learnt[1].0).abs() < 1e-7, "{:e} {:e}", after[1].0, learnt[1].0);
        assert!(after[1].1 <= SETTINGS.coefficients[1].initial_std);
        // Forward only, at one torque: mean, wind-up and half-width cannot be told apart, and none runs away.
        let mut x = 30.0;
        for _ in 0..1_000_000 {
            x += 0.02;
            run.tick(x, 10.0, Some(0.0));
        }
        let there = run.adapter.coefficients(&run.state);
        for i in 0..3 {
            let moved = (there[i].0 - after[i].0).abs() / SETTINGS.coefficients[i].limit;
            assert!(moved < 0.02, "{i} {moved}");
            assert!(there[i].1 <= 1.001 * SETTINGS.coefficients[i].initial_std);
        }
        assert!(run.missed.abs() < 1e-6);
        let worst = run.swing(60_000, mixed);
        assert!(worst < 1.5e-6, "{worst:e}");
    }

    #[test]
    fn no_coefficient_exceeds_its_limit_and_hits_are_counted() {
        let mut settings = SETTINGS;
        settings.coefficients[0].limit = 3e-5;
        settings.coefficients[0].initial_std = 1e-4;
        settings.noise_rad = 1e-5;
        let mut run = Loop::new(&settings, HIDDEN, 5);
        run.swing(60_000, mixed);
        let found = run.adapter.coefficients(&run.state);
        assert!((found[0].0 - 3e-5).abs() < 1e-10, "{:e}", found[0].0);
        assert!(run.state.counters().limited > 1000);
        assert!(found.iter().zip(settings.coefficients).all(|(found, of)| found.0.abs() <= of.limit));
    }

    /// While the side of the play is not known only what exceeds the interval is learnt.
    #[test]
    fn inside_the_interval_nothing_is_said() {
        let mut run = Loop::new(&SETTINGS, [1.2e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 6);
        run.plant.contact = 10.0 / 3e4 + 1.2e-4 + 1e-4;
        for _ in 0..2000 {
            run.tick(0.0, 10.0, Some(0.0));
        }
        // 2.2e-4 seen, 1.5e-4 and the limit of the half-width not known: at least 2e-5 of the mean.
        assert!(run.play.uncertainty_rad() > 1e-4);
        let [(mean, std), ..] = run.adapter.coefficients(&run.state);
        assert!((0.0..=4e-5).contains(&mean), "{mean:e}");
        assert!(std > 5e-6, "{std:e}");
        let (half, std) = run.adapter.coefficients(&run.state)[2];
        assert!(half == 0.0 && std > 0.999 * SETTINGS.coefficients[2].initial_std, "{half:e} {std:e}");
        let counters = run.state.counters();
        assert!(counters.quiet + counters.used == 2000 && counters.quiet > 1000, "{counters:?}");
    }

    fn covariance(state: &AdaptState<7>) -> nalgebra::SMatrix<f64, 7, 7> {
        let d = nalgebra::SMatrix::<f64, 7, 7>::from_diagonal(&nalgebra::SVector::from(state.d.map(f64::from)));
        let u = nalgebra::SMatrix::<f64, 7, 7>::from_fn(|i, j| match i.cmp(&j) {
            core::cmp::Ordering::Less => state.u[j][i] as f64,
            core::cmp::Ordering::Equal => 1.0,
            core::cmp::Ordering::Greater => 0.0,
        });
        u * d * u.transpose()
    }

    /// Both updates of the factors are those of the matrix.
    #[test]
    fn factors_are_updated_as_the_covariance_is() {
        let mut state = Adapter::new(&SETTINGS).unwrap().start();
        let mut noise = Noise(7);
        for _ in 0..200 {
            let row: [f32; 7] = core::array::from_fn(|_| noise.next() as f32);
            let wander: [f32; 7] = core::array::from_fn(|_| 0.1 * noise.next() as f32);
            let h = nalgebra::SVector::from(row.map(f64::from));
            let w = nalgebra::SVector::from(wander.map(f64::from));
            let mut p = covariance(&state) + w * w.transpose();
            wander_by(&mut state.d, &mut state.u, wander);
            assert!((covariance(&state) - p).amax() < 1e-5 * p.amax());
            let spread = (h.transpose() * p * h).x + 1.5;
            let gains = p * h / spread;
            p -= gains * h.transpose() * p;
            let found = measure(&mut state.d, &mut state.u, &row, 1.5);
            assert!((covariance(&state) - p).amax() < 1e-5 * p.amax());
            assert!((nalgebra::SVector::from(found.map(f64::from)) - gains).amax() < 1e-5);
        }
    }

    /// Ten million updates in `f32`, with long spells of one kind of motion.
    #[test]
    fn the_covariance_stays_positive_and_bounded_for_ten_million_updates() {
        let adapter = Adapter::new(&SETTINGS).unwrap();
        let mut state = adapter.start();
        let mut noise = Noise(8);
        for i in 0..10_000_000u32 {
            let spell = i / 300_000;
            let torque = if spell % 3 == 0 { 10.0 } else { 20.0 * noise.next() as f32 };
            let side = if spell % 4 == 1 { 1 } else { 1 - 2 * (i / 1000 % 2) as i32 };
            let generator = GeneratorAngle::from_counts(i as i64 * if spell % 5 == 2 { 0 } else { 98_765_432 });
            let row = adapter.row(generator, torque, side);
            let strength = dot(&row, &row);
            wander_by(&mut state.d, &mut state.u, row.map(|h| h * adapter.forget / strength));
            let _ = measure(&mut state.d, &mut state.u, &row, 1.0);
            adapter.bound_variances(&mut state);
            if i % 100_000 == 99_999 {
                let p = covariance(&state);
                assert!(state.is_sound());
                assert_eq!(p, p.transpose());
                let scale = nalgebra::SMatrix::<f64, 7, 7>::from_diagonal(&p.diagonal().map(|v| 1.0 / v.sqrt()));
                let least = (scale * p * scale).symmetric_eigenvalues().min();
                assert!(least > -1e-9, "{i}: {least:e}");
                for (variance, first) in p.diagonal().iter().zip(adapter.first) {
                    assert!(*variance > 0.0 && *variance <= 1.001 * first as f64, "{i}: {variance:e}");
                }
            }
        }
    }

    #[test]
    fn states_come_back_from_bytes_or_not_at_all() {
        let mut run = Loop::new(&SETTINGS, HIDDEN, 9);
        run.swing(3000, mixed);
        let mut bytes = [0; saved_adapt_bytes(7)];
        assert_eq!(run.adapter.save(&run.state, &mut bytes), Some(148));
        assert_eq!(run.adapter.save(&run.state, &mut bytes[..147]), None);
        let restored = run.adapter.restore(&bytes).unwrap();
        assert_eq!((restored.x, restored.d, restored.u), (run.state.x, run.state.d, run.state.u));
        assert_eq!(restored.learning(), Learning::Off);
        for bit in 0..bytes.len() * 8 {
            let mut damaged = bytes;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(run.adapter.restore(&damaged), None, "bit {bit}");
        }
        let mut other = SETTINGS;
        other.coefficients[1].limit *= 2.0;
        assert_eq!(Adapter::new(&other).unwrap().restore(&bytes), None);
    }

    #[test]
    fn settings_that_cannot_be_are_named() {
        let named = |change: fn(&mut AdaptSettings<7>)| {
            let mut settings = SETTINGS;
            change(&mut settings);
            Adapter::new(&settings).unwrap_err().name
        };
        assert_eq!(named(|s| s.noise_rad = 0.0), "noise_rad");
        assert_eq!(named(|s| s.memory_measurements = f32::NAN), "memory_measurements");
        assert_eq!(named(|s| s.gate = f32::INFINITY), "gate");
        assert_eq!(named(|s| s.settle_rad = -1e-6), "settle_rad");
        assert_eq!(named(|s| s.torque_limit_n_m = -1.0), "torque_limit_n_m");
        assert_eq!(named(|s| s.coefficients[2].limit = 0.06), "limit");
        assert_eq!(named(|s| s.coefficients[2].initial_std = 0.0), "initial_std");
        assert_eq!(named(|s| s.coefficients[3].term = Term::Sin(0)), "order");
    }

    #[test]
    fn an_upset_of_the_state_starts_anew() {
        for number in [f32::NAN, f32::INFINITY, 7.0, -2.0] {
            let mut run = Loop::new(&SETTINGS, HIDDEN, 10);
            run.swing(30_000, mixed);
            run.state.x[2] = number;
            run.tick(27.0, 10.0, None);
            assert_eq!(run.last.adjustment, Adjustment::default());
            run.swing(60_000, mixed);
            assert_eq!(run.state.counters().restarts, 1);
            assert!(run.missed.abs() < 3e-6);
            run.state.d[4] = -number.abs();
            run.swing(60_000, mixed);
            assert_eq!(run.state.counters().restarts, 2);
        }
    }

    /// With the runtime itself: a drive whose mean and play are not those of the table comes where it is wanted.
    #[test]
    fn a_joint_that_learns_comes_where_it_is_wanted() {
        use crate::fixture;
        use crate::{Images, Joint, JointState, Limits, Mode, Overrun, Store};
        let image = fixture::image(true);
        let images = Images::new(&image, &image);
        let limits = Limits { rate_rad_s: 0.5, acceleration_rad_s2: 100.0, ..fixture::LIMITS };
        let joint = Joint::new(fixture::drive(), limits, Overrun::SkipAndCount).unwrap();
        let mut worst = [0.0f64; 2];
        for (worst, learning) in worst.iter_mut().zip([Learning::Off, Learning::On]) {
            let adapter = Adapter::new(&SETTINGS).unwrap();
            let mut learnt = adapter.start();
            learnt.set_learning(learning);
            let (mut store, mut state) = (Store::new(), JointState::new());
            store.activate(&images, &fixture::drive(), 20.0).unwrap();
            state.request(Mode::Tracking).unwrap();
            let (mut generator, mut contact, mut adjustment) = (GeneratorAngle::ZERO, 0.0f64, Adjustment::default());
            let mut noise = Noise(21);
            for tick in 0..60_000 {
                let time = tick as f64 * 1e-3;
                let torque = 15.0 + 5.0 * (2.3 * time).sin();
                let target = OutputAngle::from_rad(0.3 * (0.9 * time).sin()).unwrap();
                let input = Input {
                    generator: Some(generator),
                    target,
                    torque_n_m: torque as f32,
                    missed_ticks: 0,
                    adjustment,
                };
                let output = joint.tick(&images, &mut store, &mut state, &input);
                // The drive: table's closed form, 6e-5 rad beside it, and a play that is 1.5e-5 wider to each side.
                let at = generator.to_rad();
                let [forward, backward] = [crate::Direction::Forward, crate::Direction::Backward]
                    .map(|side| fixture::error(at, torque, 20.0, side, true));
                let half = 0.5 * (backward - forward) + 1.5e-5;
                let centre = at / 95.0 + 0.5 * (forward + backward) + 6e-5;
                contact = contact.clamp(centre - half, centre + half);
                let truth = contact;
                let measured = OutputAngle::from_rad(truth + 2e-6 * noise.next());
                let seen = Seen { input: &input, output: &output, play: state.play(), measured };
                adjustment = adapter.update(&mut learnt, &seen).adjustment;
                if tick > 50_000 && output.held_back_rad == 0.0 {
                    // Where the last command was meant to bring the output: the target of the tick before.
                    let meant = 0.3 * (0.9 * (time - 1e-3)).sin();
                    *worst = worst.max((truth - meant).abs());
                }
                generator = output.command;
            }
        }
        let [without, with] = worst;
        assert!(without > 5e-5 && with < 1.2e-5, "{without:e} {with:e}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Whatever comes in, the adjustment stays within the limits and the state sound.
        #[test]
        fn any_input_keeps_the_limits(
            seen in prop::collection::vec((-1e3f64..1e3, any::<f32>(), any::<bool>(), any::<i64>(), any::<i32>(), -1e-3f64..1e-3), 1..300),
        ) {
            let mut run = Loop::new(&SETTINGS, HIDDEN, 11);
            run.swing(300, mixed);
            for (generator, torque, wild, measured, applied, off) in seen {
                run.applied = if wild { Adjustment { mean_counts: applied, half_width_counts: applied } } else { run.applied };
                if wild {
                    let angle = GeneratorAngle::from_counts(measured.rotate_left(13));
                    let output = Output {
                        command: angle, output: OutputAngle::from_counts(measured), transmission_error_rad: torque,
                        uncertainty_rad: torque, correction_rad: 0.0, held_back_rad: 0.0,
                        quality: Quality::InRange, flags: Flags::default(),
                    };
                    let _ = run.play.update(output.output, 0, 0, false);
                    let input = Input {
                        generator: Some(angle), target: output.output, torque_n_m: torque, missed_ticks: 0,
                        adjustment: run.applied,
                    };
                    let found = run.adapter.update(&mut run.state, &Seen {
                        input: &input, play: &run.play, output: &output,
                        measured: Some(OutputAngle::from_counts(measured ^ applied as i64)),
                    });
                    (run.last, run.applied) = (found, found.adjustment);
                } else {
                    run.tick(generator, (torque % 50.0) as f64, Some(off));
                }
                prop_assert!(run.state.is_sound());
                // 2e-4 and 4e-4 of the circles, and 5e-4 of the wind-up.
                prop_assert!((run.applied.mean_counts as f64).abs() <= 1.11e-3 * COUNTS);
                prop_assert!((run.applied.half_width_counts as f64).abs() <= 5.01e-5 * COUNTS);
                prop_assert!(run.last.uncertainty_rad >= 0.0 && run.last.uncertainty_rad < 1e-3);
            }
        }

        /// Any deviation within the limits is found, from any seed.
        #[test]
        fn hidden_deviations_are_found(parts in prop::array::uniform7(-0.25f64..0.25), seed in any::<u64>()) {
            let mut hidden = parts;
            hidden.iter_mut().zip(SETTINGS.coefficients).for_each(|(h, of)| *h *= of.limit as f64);
            let mut run = Loop::new(&SETTINGS, hidden, seed);
            prop_assert!(run.swing(30_000, mixed) < 1.5e-6);
        }
    }

    #[test]
    fn fewer_coefficients_take_fewer_numbers() {
        let [mean, _, half, ..] = SETTINGS.coefficients;
        let settings = AdaptSettings {
            coefficients: [mean, half],
            noise_rad: 2e-6,
            memory_measurements: 2000.0,
            gate: 5.0,
            settle_rad: 0.0,
            torque_limit_n_m: 0.0,
        };
        let mut run = Loop::new(&settings, [8e-5, 0.0, 2.5e-5, 0.0, 0.0, 0.0, 0.0], 12);
        assert!(run.swing(10_000, |_| 3.0) < 1e-6);
        let sizes: Vec<usize> = [1, 2, 3, 7].map(saved_adapt_bytes).into();
        assert_eq!(sizes, [16, 28, 44, 148]);
    }
}
