//! Maxwell-slip bank: the elastic hysteresis that remains beside the play, as a sum of springs that slip.
//!
//! ```text
//! zᵢ ← clamp(zᵢ + Δx, −wᵢ, wᵢ),      e = Σ gᵢ·zᵢ
//! ```
//!
//! with `x` the nominal output. Springs that stick give the slope after a reversal, springs that slip the dwell; the sum gives the
//! branches of a loop, whose memory are the turning points. Deflections are integer counts: the result depends on the turning
//! points only, not on how many steps a motion is cut into.
//!
//! After a reset no deflection is known. Each is an interval, moved at both ends by the same operator: motion brings the ends
//! together, and one stroke of `2wᵢ` makes them one.

use crate::angle::{OutputAngle, RAD_PER_COUNT};
use crate::hysteresis::MAX_HALF_COUNTS;

/// One spring that slips.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SlipElement {
    /// Deflection at which it slips, rad of the nominal output, 0 to 0.05.
    pub width_rad: f32,
    /// Error per deflection; its error when slipping is `gain·width_rad`, signed.
    pub gain: f32,
}

/// A bank of springs: the settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlipBank<const N: usize> {
    widths: [i32; N],
    gains: [f32; N],
}

/// Deflections of a bank: all that must survive a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlipState<const N: usize> {
    nominal: OutputAngle,
    started: bool,
    lower: [i32; N],
    upper: [i32; N],
}

/// What a bank adds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slip {
    /// Error at the output, rad.
    pub error_rad: f32,
    /// It lies within ± this, rad: 0 once every spring has slipped from one end to the other.
    pub uncertainty_rad: f32,
}

impl<const N: usize> SlipBank<N> {
    /// A bank; `None` if a width is not within 0 to 0.05 rad or a gain not finite.
    #[must_use]
    pub fn new(elements: [SlipElement; N]) -> Option<Self> {
        let sound = |e: &SlipElement| e.width_rad >= 0.0 && e.width_rad <= 0.05 && e.gain.is_finite();
        if !elements.iter().all(sound) {
            return None;
        }
        let width = |e: SlipElement| crate::angle::counts_from_rad(e.width_rad).min(MAX_HALF_COUNTS);
        Some(Self { widths: elements.map(width), gains: elements.map(|e| e.gain) })
    }

    /// Follows the motion to `nominal`. The same work for all values.
    pub fn update(&self, state: &mut SlipState<N>, nominal: OutputAngle) -> Slip {
        let moved = if state.started { nominal.minus_small_counts(state.nominal) } else { 0 };
        (state.nominal, state.started) = (nominal, true);
        let mut slip = Slip { error_rad: 0.0, uncertainty_rad: 0.0 };
        let ends = state.lower.iter_mut().zip(state.upper.iter_mut());
        for ((lower, upper), (&width, &gain)) in ends.zip(self.widths.iter().zip(&self.gains)) {
            let clamped = |z: i32| z.saturating_add(moved).max(width.wrapping_neg()).min(width);
            (*lower, *upper) = (clamped(*lower), clamped(*upper));
            let (middle, open) = (lower.wrapping_add(*upper) >> 1, upper.wrapping_sub(*lower));
            slip.error_rad += gain * (middle as f32 * RAD_PER_COUNT);
            slip.uncertainty_rad += gain.abs() * (0.5 * open as f32 * RAD_PER_COUNT);
        }
        slip
    }
}

impl<const N: usize> Default for SlipState<N> {
    fn default() -> Self {
        Self::unknown()
    }
}

impl<const N: usize> SlipState<N> {
    /// After a reset: any deflection.
    #[must_use]
    pub const fn unknown() -> Self {
        Self { nominal: OutputAngle::ZERO, started: false, lower: [i32::MIN; N], upper: [i32::MAX; N] }
    }

    /// Whether every deflection is known.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.lower == self.upper
    }

    /// Deflections as lower and upper ends in counts, to be stored across a reset with a checksum of the caller's.
    #[must_use]
    pub const fn ends(&self) -> ([i32; N], [i32; N], OutputAngle) {
        (self.lower, self.upper, self.nominal)
    }

    /// From [`Self::ends`]; `None` if an upper end is below its lower. Only if the joint cannot have moved meanwhile.
    #[must_use]
    pub fn from_ends(lower: [i32; N], upper: [i32; N], nominal: OutputAngle) -> Option<Self> {
        let ordered = lower.iter().zip(&upper).all(|(lower, upper)| lower <= upper);
        ordered.then_some(Self { nominal, started: true, lower, upper })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const WIDTH: i32 = 300_000;

    fn bank() -> SlipBank<3> {
        let element =
            |share: f64, gain| SlipElement { width_rad: (share * WIDTH as f64 * RAD_PER_COUNT as f64) as f32, gain };
        SlipBank::new([element(0.2, 0.05), element(0.5, 0.03), element(1.0, 0.02)]).unwrap()
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
            assert_eq!(SlipBank::new([SlipElement { width_rad: bad.0, gain: bad.1 }]), None);
        }
        let (lower, upper, nominal) = known().ends();
        assert_eq!(SlipState::from_ends(lower, upper, nominal), Some(known()));
        assert_eq!(SlipState::from_ends([1, 0, 0], [0, 0, 0], nominal), None);
    }

    proptest! {
        #[test]
        fn only_the_turning_points_matter(path in prop::collection::vec(-2 * WIDTH..2 * WIDTH, 1..20), pieces in 1i32..7) {
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
        fn a_larger_stroke_wipes_out_a_smaller_one(small in 1..2 * WIDTH, extra in 0..2 * WIDTH, before in -WIDTH..WIDTH) {
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
                        work += if lap == 1 { 0.5 * (slip.error_rad + before.error_rad) as f64 * piece as f64 } else { 0.0 };
                        (x, before) = (next, slip);
                    }
                }
            }
            prop_assert!(work >= -1e-3, "{}", work);
        }

        #[test]
        fn the_interval_holds_every_possible_truth(
            start in prop::array::uniform3(-1.0f64..=1.0), path in prop::collection::vec(-WIDTH..WIDTH, 1..20),
        ) {
            let mut interval = SlipState::unknown();
            let (_, first) = run(&mut interval, 0, &[]);
            let mut deflections = bank().widths;
            deflections.iter_mut().zip(start).for_each(|(z, share)| *z = (*z as f64 * share) as i32);
            let mut truth = SlipState::from_ends(deflections, deflections, OutputAngle::ZERO).unwrap();
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
