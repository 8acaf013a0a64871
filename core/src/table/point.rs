//! A torque and temperature, located in the table, and how far an answer there can be trusted.

use super::image::NODE_WORDS;
use super::memory::{Doubt, PointPlan};
use super::windup;
#[cfg(test)]
use crate::angle::RAD_PER_COUNT;

numbered! { coded
    /// How far an answer can be trusted, worst last.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub enum Quality {
        /// Inside the torques and temperatures of the table, side of the play known. Output angles, and loads at an
        /// angle, that were not recorded count as inside.
        InRange,
        /// The error is known only to within the uncertainty reported: the torque lies inside a jump, or the side of
        /// the play is not known yet.
        Uncertain,
        /// Torque or temperature outside the range the table holds for; the value at its edge is used.
        Extrapolated,
        /// An input was not finite, or the table gave a number it cannot give: no correction is made.
        Disabled,
    }
}

/// A torque and temperature, located in the table: [`Table::at`](crate::Table::at). What forward and inverse of one
/// tick share.
#[derive(Clone, Copy, Debug)]
pub struct OperatingPoint {
    /// Half words: where the records below and above the torque start.
    pub(super) rows: [usize; 2],
    /// Their shares in 2⁻³⁰, to 2⁻¹⁴.
    pub(super) shares: [i32; 2],
    /// How many half words further they are at the hotter temperature, and its share in 2⁻¹⁴.
    pub(super) hotter: (usize, i32),
    /// D and H there, counts.
    pub(crate) mean: i32,
    pub(crate) half_width: i32,
    /// The part of them that was added to the table's.
    added: [i32; 2],
    /// Height of the jump the torque lies in, else 0, counts.
    pub(crate) jump: i32,
    /// All inputs are finite.
    pub(crate) finite: bool,
    in_range: bool,
    /// Words in which two copies of the table disagreed while it was read.
    pub(crate) doubt: Doubt,
}

impl OperatingPoint {
    /// The quality here, lowered while the side of the play is not known.
    #[inline(always)]
    pub(crate) const fn quality(&self, sane: bool, known: bool) -> Quality {
        let inside = if known & (self.jump == 0) { Quality::InRange } else { Quality::Uncertain };
        let quality = if self.in_range { inside } else { Quality::Extrapolated };
        if sane { quality } else { Quality::Disabled }
    }

    /// The point with this added to D and H, each within ±2²⁵ counts. H stays where the ripple can take no play below
    /// zero, or where it is.
    #[inline(always)]
    pub(crate) fn adjusted(mut self, plan: &PointPlan, mean: i32, half_width: i32) -> Self {
        let before = self.half_width;
        let least = if before < plan.play_ripple { before } else { plan.play_ripple };
        let half = before.wrapping_add(half_width);
        let half = if half > least { half } else { least };
        self.mean = self.mean.wrapping_add(mean);
        self.half_width = half;
        self.added = [mean, half.wrapping_sub(before)];
        self
    }

    /// Whether |centre| + |half| is within what an accepted table can give, and what was added to it.
    #[inline(always)]
    pub(crate) const fn allows(&self, plan: &PointPlan, centre: i32, half: i32) -> bool {
        let [mean, half_width] = self.added;
        let (centre, half) = (centre.wrapping_sub(mean), half.wrapping_sub(half_width));
        // Negative numbers have room for every magnitude.
        let centre = if centre > 0 { centre.wrapping_neg() } else { centre };
        let half = if half > 0 { half.wrapping_neg() } else { half };
        centre.saturating_add(half) >= plan.limit.wrapping_neg()
    }

    /// Whether an error on this side is.
    #[inline(always)]
    pub(crate) const fn allows_error(&self, plan: &PointPlan, error: i32, backward: bool) -> bool {
        let [mean, half_width] = self.added;
        let mask = (backward as i32).wrapping_neg();
        let added = (half_width ^ !mask).wrapping_sub(!mask).wrapping_add(mean);
        error.wrapping_sub(added).wrapping_add(plan.limit) as u32 <= plan.limit.wrapping_mul(2) as u32
    }

    /// The largest error that the table may give with what was added to it, counts.
    #[inline(always)]
    pub(crate) const fn most(&self, plan: &PointPlan) -> i32 {
        let [mean, half_width] = self.added;
        plan.limit.wrapping_add(mean.saturating_abs()).wrapping_add(half_width.saturating_abs())
    }

    /// D, rad.
    #[cfg(test)]
    pub(crate) fn mean_rad(&self) -> f32 {
        self.mean as f32 * RAD_PER_COUNT
    }
}

/// D, slope of D and H of a torque node.
pub(crate) type Node = [f32; NODE_WORDS];

/// The torque among nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TorquePlace {
    /// Place in the interval, 0 to 1, and the interval's width, N·m.
    pub weight: f32,
    pub width: f32,
    /// Whether the interval is a jump.
    pub jump: bool,
}

impl OperatingPoint {
    /// From the nodes around the torque, at one temperature.
    #[inline(always)]
    pub(crate) fn new(
        place: TorquePlace,
        [low, high]: [Node; 2],
        rows: [usize; 2],
        hotter: (usize, i32),
        (finite, in_range): (bool, bool),
        doubt: Doubt,
    ) -> Self {
        let TorquePlace { weight, width, jump } = place;
        let ([mean_low, slope_low, half_low], [mean_high, slope_high, half_high]) = (low, high);
        let (rise, widening) = (mean_high - mean_low, half_high - half_low);
        let bend = windup::bend(weight, width, [rise, slope_low, slope_high]);
        let bend = if jump { 0.0 } else { bend };
        let t = (weight * 16_384.0) as i32;
        // A search that was led astray ends in an interval that does not hold the torque.
        let doubt = Doubt(doubt.0 | (t as u32 > 16_384) as u32);
        // In doubt strictly inside a jump.
        let inside = (t.wrapping_sub(1) as u32) < 16_383;
        let height = (rise.abs() + widening.abs()) as i32 & ((jump & inside) as i32).wrapping_neg();
        Self {
            rows,
            shares: [16_384i32.wrapping_sub(t), t].map(|share| share << 16),
            hotter,
            mean: (mean_low + weight * rise + bend) as i32,
            half_width: (half_low + weight * widening) as i32,
            added: [0; 2],
            jump: height,
            finite,
            in_range,
            doubt,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(mean: f32, half_width: f32) -> OperatingPoint {
        let place = TorquePlace { weight: 0.0, width: 1.0, jump: false };
        OperatingPoint::new(place, [[mean, 0.0, half_width]; 2], [0; 2], (0, 0), (true, true), Doubt(0))
    }

    /// H is taken down to what the ripple needs, or not at all where it is there already; up by all of it.
    #[test]
    fn an_adjustment_takes_the_play_no_further_down_than_the_ripple_needs() {
        let plan = PointPlan { play_ripple: 30, ..PointPlan::default() };
        for (before, change, after) in [(100, -60, 40), (100, -90, 30), (20, -15, 20), (20, 5, 25), (100, 7, 107)] {
            let adjusted = point(50.0, before as f32).adjusted(&plan, -8, change);
            assert_eq!((adjusted.mean, adjusted.half_width), (42, after), "{before} {change}");
        }
    }

    /// An adjusted point allows the added amount on top of the table's limit: for the centre, and for the wanted flank.
    #[test]
    fn an_adjusted_point_allows_what_was_added_and_no_more() {
        let plan = PointPlan { limit: 1000, ..PointPlan::default() };
        let adjusted = point(0.0, 100.0).adjusted(&plan, 5, 7);
        for (backward, least, most) in [(false, -1002, 998), (true, -988, 1012)] {
            for (error, allowed) in [(least - 1, false), (least, true), (most, true), (most + 1, false)] {
                assert_eq!(adjusted.allows_error(&plan, error, backward), allowed, "{error} {backward}");
            }
        }
        for (centre, half, allowed) in [(605, 407, true), (605, 408, false), (-595, 407, true), (-596, 407, false)] {
            assert_eq!(adjusted.allows(&plan, centre, half), allowed, "{centre} {half}");
        }
        assert_eq!(adjusted.most(&plan), 1012);
    }
}
