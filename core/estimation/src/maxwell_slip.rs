//! Maxwell-slip bank: the elastic hysteresis that remains beside the play, as a sum of springs that slip.
//!
//! ```text
//! zᵢ ← clamp(zᵢ + Δx, −wᵢ, wᵢ),      e = Σ gᵢ·zᵢ
//! ```
//!
//! with `x` the nominal output ([`NominalOutput`]: the friction of the generator's path) or the load torque
//! ([`LoadTorque`]: wind-up that does not come back the way it went). Springs that stick give the slope after a
//! reversal, springs that slip the dwell; the sum gives the branches of a loop, whose memory are the turning points.
//! Deflections are integer counts: the result depends on the turning points only, not on how many steps a motion is cut
//! into.
//!
//! In the loop: one update each tick, and [`Slip::added_to`] the [`Adjustment`] of the next.
//!
//! After a reset no deflection is known. Each is an interval, moved at both ends by the same operator: motion brings
//! the ends together, and one stroke of `2wᵢ` makes them one.
//!
//! Springs and deflections are each kept under a sum ([`Sealed`]): where an upset hit one word it is
//! mended in the next update. Deflections that are lost are unknown, as after a reset; springs that are lost add
//! nothing, with an uncertainty of [`Adjustment::MAX_RAD`].

use core::marker::PhantomData;
use flexspline::shared::{
    MAX_HALF_COUNTS, RAD_PER_COUNT, START, Sealed, add, bounded, counts_from_rad, crc32, num, opened, owner, seal,
    uncertainty_counts, words,
};
use flexspline::{Adjustment, Joint, OutputAngle, RestoreError, Store};

/// One spring that slips with the nominal output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SlipElement {
    /// Deflection at which it slips, rad of the nominal output, 0 to 0.05.
    pub width_rad: f32,
    /// Error per deflection; its error when slipping is `gain·width_rad`, signed.
    pub gain: f32,
}

/// One spring that slips with the load torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TorqueSlipElement {
    /// Torque from its middle at which it slips, N·m, 0 to 10 000.
    pub width_n_m: f32,
    /// Error per torque, rad/(N·m); its error when slipping is `gain·width_n_m`, signed.
    pub gain_rad_per_n_m: f32,
}

/// The variable is the nominal output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NominalOutput;

/// The variable is the load torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadTorque;

/// Unit of the deflections of a bank.
pub trait SlipVariable {
    /// Which, in the sum of the settings.
    const KIND: u32;
}

impl SlipVariable for NominalOutput {
    const KIND: u32 = 1;
}

impl SlipVariable for LoadTorque {
    const KIND: u32 = 2;
}

/// Counts of a torque in 1 N·m.
const PER_N_M: f32 = 65_536.0;
/// Largest width and torque, N·m: the way from end to end is below half of what counts hold.
const MAX_N_M: f32 = 10_000.0;

/// A bank of springs: the settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaxwellSlip<const N: usize, V = NominalOutput> {
    springs: Sealed<Springs<N>>,
    variable: PhantomData<V>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Springs<const N: usize> {
    widths: [i32; N],
    /// Rad per count.
    gains: [f32; N],
    /// Of the settings: a saved state of others is not taken.
    sum: u32,
}
words!([const N: usize] Springs<N> { widths, gains, sum });

/// Deflections of a bank: all that must survive a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlipState<const N: usize, V = NominalOutput> {
    deflections: Sealed<Deflections<N>>,
    variable: PhantomData<V>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Deflections<const N: usize> {
    at: i64,
    /// 1 after the first update, else 0.
    started: u32,
    lower: [i32; N],
    upper: [i32; N],
}
words!([const N: usize] Deflections<N> { at, started, lower, upper });

/// Contribution of a bank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slip {
    /// Error at the output, rad.
    pub error_rad: f32,
    /// It lies within ± this, rad: 0 once every spring has slipped from one end to the other.
    pub uncertainty_rad: f32,
}

impl Slip {
    /// The error in counts, within ±[`Adjustment::MAX_COUNTS`]: to be added to the mean of an [`Adjustment`].
    #[must_use]
    pub fn mean_counts(&self) -> i32 {
        bounded(counts_from_rad(self.error_rad))
    }

    /// An adjustment with this added, and its uncertainty: while springs are not known the tick says so.
    pub fn added_to(&self, adjustment: Adjustment) -> Adjustment {
        adjustment.with([self.mean_counts(), 0, uncertainty_counts(self.uncertainty_rad)])
    }
}

impl<const N: usize> MaxwellSlip<N, NominalOutput> {
    /// A bank on the nominal output; `None` if a width is not within 0 to 0.05 rad, a gain not finite, or all of them
    /// together give more than [`Adjustment::MAX_RAD`].
    #[must_use]
    pub fn new(elements: [SlipElement; N]) -> Option<Self> {
        let sound = |e: &SlipElement| e.width_rad >= 0.0 && e.width_rad <= 0.05 && e.gain.is_finite();
        let width = |e: SlipElement| counts_from_rad(e.width_rad).min(MAX_HALF_COUNTS);
        let most = elements.iter().map(|e| e.width_rad * e.gain.abs()).sum::<f32>();
        let sound = elements.iter().all(sound) && most <= Adjustment::MAX_RAD;
        sound.then(|| Self::of(elements.map(width), elements.map(|e| e.gain * RAD_PER_COUNT), N))
    }

    /// Follows the motion to `nominal`, once each tick. The same work for all values.
    pub fn update(&self, state: &mut SlipState<N>, nominal: OutputAngle) -> Slip {
        self.follow(state, Some(nominal.counts()))
    }
}

impl<const N: usize> MaxwellSlip<N, LoadTorque> {
    /// A bank on the load torque; `None` if a width is not within 0 to 10 000 N·m, a gain not finite, or all of them
    /// together give more than [`Adjustment::MAX_RAD`].
    #[must_use]
    pub fn of_torque(elements: [TorqueSlipElement; N]) -> Option<Self> {
        let sound =
            |e: &TorqueSlipElement| e.width_n_m >= 0.0 && e.width_n_m <= MAX_N_M && e.gain_rad_per_n_m.is_finite();
        let width = |e: TorqueSlipElement| (e.width_n_m * PER_N_M) as i32;
        let gain = |e: TorqueSlipElement| e.gain_rad_per_n_m / PER_N_M;
        let most = elements.iter().map(|e| e.width_n_m * e.gain_rad_per_n_m.abs()).sum::<f32>();
        let sound = elements.iter().all(sound) && most <= Adjustment::MAX_RAD;
        sound.then(|| Self::of(elements.map(width), elements.map(gain), N))
    }

    /// Follows the load torque, N·m, once each tick: beyond ±10 000 N·m it is taken there, and one that is not finite
    /// moves nothing. The same work for all values.
    pub fn update(&self, state: &mut SlipState<N, LoadTorque>, torque_n_m: f32) -> Slip {
        self.follow(state, torque_counts(torque_n_m))
    }
}

fn torque_counts(torque_n_m: f32) -> Option<i64> {
    torque_n_m.is_finite().then(|| num::within(torque_n_m, [-MAX_N_M, MAX_N_M]) * PER_N_M).map(|c| c as i64)
}

/// Bytes of the saved state of `elements` springs.
#[must_use]
pub const fn saved_slip_bytes(elements: usize) -> usize {
    elements.saturating_mul(8).saturating_add(36)
}

/// First bytes of a saved state; the last byte is the version.
const SAVED_MARK: [u8; 4] = *b"FXS\x02";
/// Table and joint of a state that is saved without them, from C.
pub const NOBODY: [u32; 4] = [0; 4];

impl<const N: usize> Springs<N> {
    fn follow(&self, state: &mut Deflections<N>, at: i64) {
        let moved = OutputAngle::from_counts(at).minus_small_counts(OutputAngle::from_counts(state.at));
        let moved = if state.started == 0 { 0 } else { moved };
        (state.at, state.started) = (at, 1);
        let ends = state.lower.iter_mut().zip(state.upper.iter_mut());
        for ((lower, upper), &width) in ends.zip(&self.widths) {
            let clamped = |z: i32| z.saturating_add(moved).max(width.wrapping_neg()).min(width);
            (*lower, *upper) = (clamped(*lower), clamped(*upper));
        }
    }

    fn slip(&self, state: &Deflections<N>) -> Slip {
        let mut slip = Slip { error_rad: 0.0, uncertainty_rad: 0.0 };
        for ((lower, upper), (gain, &width)) in
            state.lower.iter().zip(&state.upper).zip(self.gains.iter().zip(&self.widths))
        {
            let within = |z: i32| z.max(width.wrapping_neg()).min(width);
            let (lower, upper) = (within(*lower), within(*upper));
            let (middle, open) = (lower.wrapping_add(upper) >> 1, upper.wrapping_sub(lower));
            slip.error_rad += gain * middle as f32;
            slip.uncertainty_rad += gain.abs() * (0.5 * open as f32);
        }
        slip
    }
}

impl<const N: usize> Deflections<N> {
    const fn of(known: bool) -> Self {
        let (least, most) = if known { (0, 0) } else { (i32::MIN, i32::MAX) };
        Self { at: 0, started: 0, lower: [least; N], upper: [most; N] }
    }

    /// As [`Sealed::new`], for constants.
    const fn sealed(self) -> Sealed<Self> {
        let mut sum = add(add(add(START, self.at as u32), (self.at >> 32) as u32), self.started);
        let (mut lower, mut upper) = (self.lower.as_slice(), self.upper.as_slice());
        while let [end, rest @ ..] = lower {
            (sum, lower) = (add(sum, *end as u32), rest);
        }
        while let [end, rest @ ..] = upper {
            (sum, upper) = (add(sum, *end as u32), rest);
        }
        Sealed::of(self, add(sum, 0))
    }
}

impl<const N: usize, V: SlipVariable> MaxwellSlip<N, V> {
    /// The sum is over the first N springs.
    fn of(widths: [i32; N], gains: [f32; N], used: usize) -> Self {
        let gains_used = gains.into_iter().take(used).map(f32::to_le_bytes);
        let words = widths.into_iter().take(used).map(i32::to_le_bytes).chain(gains_used);
        let sum = words.fold(V::KIND, |sum, word| sum.rotate_left(7) ^ crc32(&word));
        Self { springs: Sealed::new(Springs { widths, gains, sum }), variable: PhantomData }
    }

    /// A bank of the first N springs: those after them, of no width and no gain, are in no sum and no saved
    /// state.
    #[doc(hidden)]
    #[must_use]
    pub fn of_first(self, used: usize) -> Self {
        let Springs { widths, gains, .. } = *self.springs.kept();
        Self::of(widths, gains, used)
    }

    /// Makes the springs whole, where they lie in memory and an upset hit a word of them; false if they are lost, and
    /// the bank has to be made anew. For a slow rate group: until then each update mends a copy.
    pub fn mend(&mut self) -> bool {
        self.springs.mend()
    }

    /// Whether the springs are lost to an upset that cannot be mended.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.springs.open().is_none()
    }

    /// `None` moves nothing.
    fn follow(&self, state: &mut SlipState<N, V>, at: Option<i64>) -> Slip {
        if !state.deflections.is_whole() && !state.deflections.mend() {
            *state = SlipState::unknown();
        }
        let move_on = |springs: &Springs<N>, deflections: &mut Deflections<N>| {
            if let Some(at) = at {
                springs.follow(deflections, at);
            }
            springs.slip(deflections)
        };
        let deflections = &mut state.deflections;
        let slip = match self.springs.is_whole() {
            true => deflections.change(|deflections| move_on(self.springs.kept(), deflections)),
            false => self.springs.open().and_then(|springs| deflections.change(|to| move_on(&springs, to))),
        };
        slip.unwrap_or(Slip { error_rad: 0.0, uncertainty_rad: Adjustment::MAX_RAD })
    }

    /// Writes the state with joint, table and a CRC-32, for storage across a reset: the first
    /// [`saved_slip_bytes`]`(N)` bytes. `None` if there are fewer, before the first update, or if springs or
    /// deflections are lost.
    ///
    /// Little endian: `FXS` and the version 2, id of the table (8 bytes), sums of the joint's settings (2 × `u32`),
    /// variable (`i64`), lower ends, upper ends (`i32`), sum of the springs, CRC-32 of all before.
    pub fn save(&self, state: &SlipState<N, V>, joint: &Joint, store: &Store, bytes: &mut [u8]) -> Option<usize> {
        self.save_first(state, owner(joint, store), N, bytes)
    }

    /// The same for the first N springs, of somebody or [`NOBODY`].
    #[doc(hidden)]
    pub fn save_first(&self, state: &SlipState<N, V>, owner: [u32; 4], used: usize, bytes: &mut [u8]) -> Option<usize> {
        let springs = self.springs.open()?;
        let state = state.deflections.open().filter(|state| state.started != 0)?;
        let bytes = bytes.get_mut(..saved_slip_bytes(used))?;
        let head = [u32::from_le_bytes(SAVED_MARK)].into_iter().chain(owner);
        let at = [state.at as u32, (state.at >> 32) as u32];
        let ends = state.lower.iter().take(used).chain(state.upper.iter().take(used));
        seal(bytes, head.chain(at).chain(ends.map(|end| *end as u32)).chain([springs.sum]));
        Some(saved_slip_bytes(used))
    }

    /// A state from [`Self::save`], for the same joint with the same table. Only if the joint cannot have moved (for a
    /// bank on the torque: the load cannot have changed) meanwhile, else [`SlipState::unknown`].
    ///
    /// # Errors
    /// [`RestoreError`]; other springs count as another joint. Then start from [`SlipState::unknown`].
    pub fn restore(&self, joint: &Joint, store: &Store, bytes: &[u8]) -> Result<SlipState<N, V>, RestoreError> {
        self.restore_first(owner(joint, store), N, bytes)
    }

    /// The same for the first N springs.
    #[doc(hidden)]
    pub fn restore_first(&self, owner: [u32; 4], used: usize, bytes: &[u8]) -> Result<SlipState<N, V>, RestoreError> {
        let springs = self.springs.open().ok_or(RestoreError::OtherJoint)?;
        let bytes = bytes.get(..saved_slip_bytes(used)).ok_or(RestoreError::Crc)?;
        let mut next = opened(bytes, SAVED_MARK, owner)?;
        let (low, high) = (next(), next());
        let mut state = Deflections { at: (high as i64) << 32 | low as i64, started: 1, ..Deflections::of(true) };
        for to in state.lower.iter_mut().take(used).chain(state.upper.iter_mut().take(used)) {
            *to = next() as i32;
        }
        if next() != springs.sum {
            return Err(RestoreError::OtherJoint);
        }
        let mut ends = state.lower.iter().zip(&state.upper).zip(&springs.widths);
        let possible =
            ends.all(|((&lower, &upper), &width)| lower >= width.wrapping_neg() && lower <= upper && upper <= width);
        let state = SlipState { deflections: Sealed::new(state), variable: PhantomData };
        if possible { Ok(state) } else { Err(RestoreError::Impossible) }
    }
}

impl<const N: usize, V> Default for SlipState<N, V> {
    fn default() -> Self {
        Self::unknown()
    }
}

impl<const N: usize, V> SlipState<N, V> {
    /// After a reset: any deflection.
    #[must_use]
    pub const fn unknown() -> Self {
        Self { deflections: Deflections::of(false).sealed(), variable: PhantomData }
    }

    /// No deflection, as before the first motion, or after strokes that died away.
    #[must_use]
    pub const fn relaxed() -> Self {
        Self { deflections: Deflections::of(true).sealed(), variable: PhantomData }
    }

    /// Whether it is lost to an upset that cannot be mended: the next update begins with no deflection known.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.deflections.open().is_none()
    }

    /// Whether every deflection is known.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.deflections.open().is_some_and(|state| state.lower == state.upper)
    }
}

#[cfg(any(test, feature = "testing"))]
flexspline::testing::upsets!([const N: usize, V] MaxwellSlip<N, V> { springs, variable });
#[cfg(any(test, feature = "testing"))]
flexspline::testing::upsets!([const N: usize, V] SlipState<N, V> { deflections, variable });

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline::shared::COUNTS_PER_RAD;
    use proptest::prelude::*;
    use std::vec::Vec;

    const WIDTH: i32 = 300_000;

    fn bank() -> MaxwellSlip<3> {
        let element =
            |share: f64, gain| SlipElement { width_rad: (share * WIDTH as f64 * RAD_PER_COUNT as f64) as f32, gain };
        MaxwellSlip::new([element(0.2, 0.05), element(0.5, 0.03), element(1.0, 0.02)]).unwrap()
    }

    fn of(deflections: Deflections<3>) -> SlipState<3> {
        SlipState { deflections: Sealed::new(deflections), variable: PhantomData }
    }

    fn run(state: &mut SlipState<3>, from: i64, path: &[i32]) -> (i64, Slip) {
        let (mut x, mut last) = (from, bank().update(state, OutputAngle::from_counts(from)));
        for &step in path {
            x += step as i64;
            last = bank().update(state, OutputAngle::from_counts(x));
        }
        (x, last)
    }

    fn known() -> SlipState<3> {
        let mut state = SlipState::unknown();
        run(&mut state, -3 * WIDTH as i64, &[3 * WIDTH]);
        state
    }

    #[test]
    fn a_long_stroke_saturates_and_makes_everything_known() {
        let mut state = SlipState::unknown();
        let (x, first) = run(&mut state, 0, &[]);
        assert!(!state.is_known() && first.error_rad.abs() < 1e-12);
        let saturated = (0.2 * 0.05 + 0.5 * 0.03 + 1.0 * 0.02) * WIDTH as f64 * RAD_PER_COUNT as f64;
        assert!((first.uncertainty_rad as f64 - saturated).abs() < 1e-4 * saturated);
        let (x, forward) = run(&mut state, x, &[2 * WIDTH + 2]);
        assert!(state.is_known() && forward.uncertainty_rad == 0.0);
        assert!((forward.error_rad as f64 - saturated).abs() < 1e-4 * saturated);
        let (_, backward) = run(&mut state, x, &[-2 * WIDTH - 2]);
        assert!((backward.error_rad + forward.error_rad).abs() < 1e-9);
    }

    #[test]
    fn elements_and_states_that_cannot_be_are_refused() {
        for bad in [(f32::NAN, 0.1), (-1e-6, 0.1), (0.06, 0.1), (1e-3, f32::INFINITY)] {
            assert_eq!(MaxwellSlip::new([SlipElement { width_rad: bad.0, gain: bad.1 }]), None);
        }
        for bad in [(f32::NAN, 0.1), (-1e-6, 0.1), (1.1e4, 0.1), (1e-3, f32::INFINITY)] {
            let element = TorqueSlipElement { width_n_m: bad.0, gain_rad_per_n_m: bad.1 };
            assert_eq!(MaxwellSlip::of_torque([element]), None);
        }
    }

    #[test]
    fn states_come_back_from_bytes_or_not_at_all() {
        let mut state = SlipState::unknown();
        let mut saved = [0; saved_slip_bytes(3)];
        let save = |state: &SlipState<3>, bytes: &mut [u8]| bank().save_first(state, NOBODY, 3, bytes);
        let restore = |bytes: &[u8]| bank().restore_first(NOBODY, 3, bytes).ok();
        assert_eq!(save(&state, &mut saved), None);
        run(&mut state, i64::MIN / 3, &[WIDTH / 2, -7, 19]);
        assert_eq!(save(&state, &mut saved), Some(60));
        assert_eq!(save(&state, &mut saved[..59]), None);
        assert_eq!(restore(&saved), Some(state));
        for bit in 0..saved.len() * 8 {
            let mut damaged = saved;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(restore(&damaged), None, "bit {bit}");
        }
        let mut other = *bank().springs.kept();
        other.gains[1] *= 2.0;
        let other = MaxwellSlip::<3>::of(other.widths, other.gains, 3);
        assert_eq!(other.restore_first(NOBODY, 3, &saved), Err(RestoreError::OtherJoint));
        for (lower, upper) in [(1, 0), (-WIDTH, 0), (0, WIDTH)] {
            let impossible = Deflections { lower: [lower, 0, 0], upper: [upper, 0, 0], ..*state.deflections.kept() };
            save(&of(impossible), &mut saved).unwrap();
            assert_eq!(restore(&saved), None);
        }
    }

    fn torque_bank() -> MaxwellSlip<2, LoadTorque> {
        let element = |width_n_m, gain_rad_per_n_m| TorqueSlipElement { width_n_m, gain_rad_per_n_m };
        MaxwellSlip::of_torque([element(2.0, 4e-6), element(10.0, 1.5e-6)]).unwrap()
    }

    /// The loop of wind-up over torque, in closed form: as wide as twice what slips, and nothing that is no number
    /// moves it.
    #[test]
    fn torque_has_its_loop() {
        let mut state = SlipState::unknown();
        let at = |state: &mut SlipState<2, LoadTorque>, torque| torque_bank().update(state, torque).error_rad as f64;
        let slipping = 2.0 * 4e-6 + 10.0 * 1.5e-6;
        assert!(at(&mut state, -40.0).abs() < 1e-12 && !state.is_known());
        assert!((at(&mut state, 40.0) - slipping).abs() < 1e-11 && state.is_known());
        assert!((at(&mut state, 35.0) - (-2.0 * 4e-6 + 5.0 * 1.5e-6)).abs() < 1e-11);
        assert!((at(&mut state, 0.0) + slipping).abs() < 1e-11);
        for wild in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let before = state;
            assert!((at(&mut state, wild) + slipping).abs() < 1e-11);
            assert_eq!(state, before);
        }
        assert!((at(&mut state, f32::MAX) - slipping).abs() < 1e-11);
        assert!((at(&mut state, -f32::MAX) + slipping).abs() < 1e-11);
        let adjustment = Adjustment::new(100, 7);
        let slip = torque_bank().update(&mut state, f32::MAX);
        let added = slip.added_to(adjustment);
        assert_eq!(added, Adjustment::new(100 + slip.mean_counts(), 7));
        assert!((slip.mean_counts() as f64 - slipping * COUNTS_PER_RAD as f64).abs() < 1.0);
        let full = Adjustment::new(i32::MAX, 0);
        assert_eq!(slip.added_to(full).mean_counts(), Adjustment::MAX_COUNTS);
    }

    proptest! {
        #[test]
        fn only_the_turning_points_matter(
            path in prop::collection::vec(-2 * WIDTH..2 * WIDTH, 1..20), pieces in 1i32..7,
        ) {
            let cut: Vec<i32> = path
                .iter()
                .flat_map(|&step| {
                    let part = step / pieces;
                    (0..pieces - 1).map(move |_| part).chain([step - part * (pieces - 1)])
                })
                .collect();
            let (mut coarse, mut fine) = (SlipState::unknown(), SlipState::unknown());
            let (a, b) = (run(&mut coarse, 0, &path), run(&mut fine, 0, &cut));
            prop_assert_eq!(a, b);
            prop_assert_eq!(coarse, fine);
        }

        #[test]
        fn a_larger_stroke_wipes_out_a_smaller_one(
            small in 1..2 * WIDTH, extra in 0..2 * WIDTH, before in -WIDTH..WIDTH,
        ) {
            let (mut with, mut without) = (known(), known());
            run(&mut with, 0, &[before, small, -small, small + extra]);
            run(&mut without, 0, &[before, small + extra]);
            // From a turning point the excursion and its way back close their loop.
            prop_assert_eq!(with, without);
        }

        #[test]
        fn loops_between_the_same_extremes_are_congruent(
            histories in prop::array::uniform2(prop::collection::vec(-2 * WIDTH..2 * WIDTH, 0..6)),
            amplitude in 1..3 * WIDTH, part in 0i32..=100,
        ) {
            let mut rises = [0.0f32; 2];
            for (history, rise) in histories.iter().zip(&mut rises) {
                let mut state = known();
                let back = -history.iter().sum::<i32>();
                let (x, _) = run(&mut state, 0, history);
                let (x, low) = run(&mut state, x, &[back, amplitude, -amplitude]);
                let (_, high) = run(&mut state, x, &[(amplitude as i64 * part as i64 / 100) as i32]);
                *rise = high.error_rad - low.error_rad;
            }
            prop_assert!((rises[0] - rises[1]).abs() < 2e-10, "{:?}", rises);
        }

        #[test]
        fn a_closed_loop_dissipates(path in prop::collection::vec(-2 * WIDTH..2 * WIDTH, 1..20)) {
            let mut state = known();
            let back = -path.iter().sum::<i32>();
            let (mut x, mut before) = run(&mut state, 0, &[]);
            let mut work = 0.0;
            // Twice around, so that the second loop is closed; in fine steps.
            for lap in 0..2 {
                for &step in path.iter().chain([&back]) {
                    for i in 0..200 {
                        let piece = (step as i64 * (i + 1) / 200 - step as i64 * i / 200) as i32;
                        let (next, slip) = run(&mut state, x, &[piece]);
                        let mean = 0.5 * (slip.error_rad + before.error_rad) as f64;
                        work += if lap == 1 { mean * piece as f64 } else { 0.0 };
                        (x, before) = (next, slip);
                    }
                }
            }
            prop_assert!(work >= -1e-3, "{}", work);
        }

        /// Madelung: a loop inside the last stroke comes back to its turning point, with all that came before, however
        /// deep loops are nested in it; beyond the turning point the motion goes on as if the loop had not been.
        #[test]
        fn inner_loops_close_at_their_turning_point(
            before in prop::collection::vec(-2 * WIDTH..2 * WIDTH, 0..5), stroke in 10..3 * WIDTH,
            nested in prop::collection::vec(1i32..100, 1..6), beyond in 0..2 * WIDTH, sign in prop::bool::ANY,
        ) {
            let turned = |step: i32| if sign { step } else { -step };
            let mut state = known();
            let (x, _) = run(&mut state, 0, &before);
            let (x, at) = run(&mut state, x, &[turned(stroke)]);
            let turning = state;
            // Ever smaller strokes to and fro, and back out again through each of their turning points.
            let mut amplitudes = std::vec![stroke];
            for share in &nested {
                amplitudes.push((*amplitudes.last().unwrap() as i64 * *share as i64 / 100) as i32);
            }
            let signed = amplitudes[1..].iter().enumerate().map(|(i, a)| if i % 2 == 0 { -a } else { *a });
            let path: Vec<i32> = signed.map(turned).collect();
            let back: Vec<i32> = path.iter().rev().map(|step| -step).collect();
            let (x, _) = run(&mut state, x, &path);
            let (x, again) = run(&mut state, x, &back);
            prop_assert_eq!((state, again), (turning, at));
            let mut straight = turning;
            prop_assert_eq!(run(&mut state, x, &[turned(beyond)]), run(&mut straight, x, &[turned(beyond)]));
        }

        #[test]
        fn the_interval_holds_every_possible_truth(
            start in prop::array::uniform3(-1.0f64..=1.0), path in prop::collection::vec(-WIDTH..WIDTH, 1..20),
        ) {
            let mut interval = SlipState::unknown();
            let (_, first) = run(&mut interval, 0, &[]);
            let mut deflections = bank().springs.kept().widths;
            deflections.iter_mut().zip(start).for_each(|(z, share)| *z = (*z as f64 * share) as i32);
            let mut truth = of(Deflections { at: 0, started: 1, lower: deflections, upper: deflections });
            let (mut x, mut open) = (0, first.uncertainty_rad);
            for step in path {
                let (_, real) = run(&mut truth, x, &[step]);
                let (next, found) = run(&mut interval, x, &[step]);
                x = next;
                prop_assert!((real.error_rad - found.error_rad).abs() <= found.uncertainty_rad + 1e-9);
                prop_assert!(found.uncertainty_rad <= open + 1e-12);
                open = found.uncertainty_rad;
            }
        }
    }
}
