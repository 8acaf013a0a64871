//! Flank pairs that touch or may soon, and how far the drive has moved since each was looked at.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use crate::contact::{
    Across, Bearing, Configuration, FlankContact, FlankLaw, FlankLayout, FlankPair, OpenEdges, PairContribution,
};

use super::state::State;

/// Pairs closer than this (mm) are looked after during an increment.
const REACH: f64 = 0.015;
/// How far (mm) flanks are looked for when the output is balanced.
const CLEARANCE_REACH: f64 = 0.06;
/// Gap (mm) below which a pair counts as touching when its layout is checked.
const TOUCH: f64 = 1e-7;
/// Shift (mm) of a corner on the flank up to which the integration points stay.
const CORNER_DRIFT: f64 = 1e-4;

/// A pair with its integration points.
struct NearPair {
    layout: FlankLayout,
    /// It stays open until the drive has moved this far.
    open_until: f64,
}

/// The pairs of one increment.
#[derive(Default)]
pub(super) struct NearPairs {
    pairs: BTreeMap<FlankPair, NearPair>,
    /// How far (mm) any two flanks may have moved against one another, all steps added up.
    moved: f64,
    /// Edges of the bore.
    pub bore: OpenEdges,
    /// Pairs beyond the reach come no closer than this motion allows.
    searched_until: f64,
}

impl NearPairs {
    /// The drive moves: no gap changes by more than `distance_mm`.
    pub(crate) fn advance(&mut self, distance_mm: f64) {
        self.moved += distance_mm;
        self.bore.moved += distance_mm;
    }

    /// Forgets all pairs.
    pub fn clear(&mut self) {
        self.pairs.clear();
        self.searched_until = self.moved;
    }

    /// Whether a pair that was taken for open bears in this state.
    pub fn missed(&self, flanks: &FlankContact, at: Configuration) -> bool {
        let mut taken_for_open = self.pairs.iter().filter(|(_, near)| self.moved < near.open_until);
        taken_for_open.any(|(pair, _)| flanks.is_near(*pair, at, 0.0))
    }

    /// Takes no pair for open any more.
    pub(crate) fn look_again(&mut self) {
        self.pairs.values_mut().for_each(|near| near.open_until = 0.0);
    }

    /// Whether pairs that were out of reach may have come near.
    pub(crate) fn must_search(&self) -> bool {
        self.moved >= self.searched_until
    }

    /// Looks for pairs that may touch from here on. Friction begins where the pair stood in the state `from`.
    pub(crate) fn search(&mut self, flanks: &FlankContact, at: Configuration, from: &State, friction: bool) {
        self.searched_until = self.moved + 0.5 * REACH;
        for pair in flanks.near_pairs(at, REACH) {
            if let Entry::Vacant(place) = self.pairs.entry(pair) {
                let mut layout = flanks.layout(pair, at);
                if friction {
                    let empty = Vec::new();
                    let history = from.friction.get(&(pair.tooth, pair.side)).unwrap_or(&empty);
                    flanks.start_friction((pair, configuration(from)), history, &mut layout.points);
                }
                place.insert(NearPair { layout, open_until: 0.0 });
            }
        }
    }

    /// The pairs.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = FlankPair> + '_ {
        self.pairs.keys().copied()
    }

    /// Forces and tangents of the pairs that touch.
    pub(crate) fn evaluate(
        &mut self,
        flanks: &FlankContact,
        at: Configuration,
        law: FlankLaw,
        mut report: impl FnMut(FlankPair, PairContribution),
    ) {
        for (&pair, near) in &mut self.pairs {
            if self.moved < near.open_until {
                continue;
            }
            match flanks.evaluate_with_gap((pair, at), law, &near.layout.points) {
                (Some(contact), _) => report(pair, contact),
                (None, gap) => near.open_until = self.moved + gap,
            }
        }
    }

    /// Largest pressure between flanks, MPa, by the forces of a state and the shape of its gaps.
    pub(crate) fn peak_pressure_mpa(
        &self,
        flanks: &FlankContact,
        at: Configuration,
        law: FlankLaw,
        modulus_mpa: f64,
    ) -> f64 {
        let touching = self.pairs.iter().filter(|(_, near)| self.moved >= near.open_until);
        let peak = |(pair, near): (&FlankPair, &NearPair)| {
            flanks.peak_pressure_mpa((*pair, at), law, &near.layout.points, modulus_mpa)
        };
        touching.map(peak).fold(0.0, f64::max)
    }

    /// Whether the corners of the spaces still face the places they were laid out for.
    pub(crate) fn layouts_fit(&self, flanks: &FlankContact, at: Configuration) -> bool {
        let touching =
            self.pairs.iter().filter(|(pair, near)| self.moved >= near.open_until && flanks.is_near(**pair, at, TOUCH));
        touching.map(|(pair, near)| (near.layout.corner, flanks.corner(*pair, at))).all(|corners| match corners {
            (Some(a), Some(b)) => (a - b).abs() < CORNER_DRIFT,
            (None, None) => true,
            (Some(r), None) | (None, Some(r)) => {
                (r - flanks.tooth.start_radius).abs().min((r - flanks.tooth.junction_radius).abs()) < CORNER_DRIFT
            }
        })
    }

    /// Tangential tractions at the end of an increment, pair by pair.
    pub(crate) fn friction(
        &self,
        flanks: &FlankContact,
        at: Configuration,
        law: FlankLaw,
    ) -> BTreeMap<(usize, crate::drive::Side), crate::contact::FrictionHistory> {
        self.pairs
            .iter()
            .map(|(&pair, near)| {
                ((pair.tooth, pair.side), flanks.friction_history((pair, at), law, &near.layout.points))
            })
            .filter(|(_, history)| history.iter().any(|(_, traction)| *traction != 0.0))
            .collect()
    }

    /// Output angle at which `torque` of everything but the flanks (and its slope), and frictionless flanks balance
    /// while the wheels keep their shape; `None` when no flank is in reach.
    ///
    /// Gaps are linear in so small a turn: the points are looked at once, and again where the turn was not so small.
    pub(crate) fn balance(
        &mut self,
        flanks: &FlankContact,
        state: &State,
        law: FlankLaw,
        tolerance: f64,
        others: impl Fn(f64) -> (f64, f64),
    ) -> Option<f64> {
        const SMALL: f64 = 2e-3;
        let radius = flanks.space.lever();
        let start = configuration(state);
        let mut output_rad = state.output_rad;
        // The pairs that are looked after anyway mostly suffice.
        let mut reach = REACH;
        for _ in 0..20 {
            let at = Configuration { output_rad, ..start };
            let mut pairs = Vec::new();
            let mut add = |pair, layout: &FlankLayout| {
                let mut points = Vec::with_capacity(layout.points.len());
                // No turn within the reach moves a point by twice as much.
                let across = flanks.gaps((pair, at), &layout.points, 2.0 * reach, &mut |gap, rate, weight| {
                    points.push(RigidPoint { gap, rate, weight });
                });
                pairs.push((across, points));
            };
            if reach == REACH {
                self.pairs.iter().for_each(|(pair, near)| add(*pair, &near.layout));
            } else {
                flanks.near_pairs(at, reach).into_iter().for_each(|pair| add(pair, &flanks.layout(pair, at)));
            }
            let torque = |turn: f64| {
                let all = others(output_rad + turn);
                pairs.iter().fold(all, |all, (across, points)| with_pair(all, law, across.as_ref(), points, turn))
            };
            let turn = balance(torque, tolerance, reach / radius);
            let small = turn.is_some_and(|turn| (turn * radius).abs() < SMALL);
            if reach == REACH && !small {
                reach = CLEARANCE_REACH;
                continue;
            }
            output_rad += turn?;
            if small {
                break;
            }
            self.clear();
        }
        ((output_rad - state.output_rad).abs() < CLEARANCE_REACH / radius).then_some(output_rad)
    }
}

/// A point of a flank while the wheels keep their shape: its gap, how it changes as the output turns (mm/rad), and the
/// length that it stands for.
struct RigidPoint {
    gap: f64,
    rate: f64,
    weight: f64,
}

/// Torque on the output and its slope (N mm/mm, and per rad), and that of a pair when the output turns by so much.
fn with_pair(
    (mut torque, mut slope): (f64, f64),
    law: FlankLaw,
    across: Option<&Across>,
    points: &[RigidPoint],
    turn: f64,
) -> (f64, f64) {
    let gap = |point: &RigidPoint| point.gap + point.rate * turn;
    let near =
        || points.iter().map(|point| (gap(point), point.weight)).filter(|(gap, _)| *gap < 0.0).collect::<Vec<_>>();
    let bearing = across.map_or(Some(Bearing::EVEN), |across| across.bearing(law, &near()));
    let Some(Bearing { later_mm, softness, .. }) = bearing else { return (torque, slope) };
    let (mut stiffness, mut by_turn) = (0.0, 0.0);
    for point in points {
        let depth = -(gap(point) + later_mm);
        if depth > 0.0 {
            torque += law.stiffness * point.weight * depth * point.rate;
            slope -= law.stiffness * point.weight * point.rate * point.rate;
            stiffness += law.stiffness * point.weight;
            by_turn += law.stiffness * point.weight * point.rate;
        }
    }
    // What the slices give way by is one spring in series with all points.
    slope += softness / (1.0 + softness * stiffness) * by_turn * by_turn;
    (torque, slope)
}

/// Zero of a falling function (value, slope) within `reach` of zero: bracketed, then Newton safeguarded by bisection.
fn balance(torque: impl Fn(f64) -> (f64, f64), tolerance: f64, reach: f64) -> Option<f64> {
    let (mut behind, mut ahead) = (None::<f64>, None::<f64>);
    let mut stride = 1e-6_f64;
    let mut turn = 0.0_f64;
    for _ in 0..60 {
        let (value, slope) = torque(turn);
        if value.abs() <= tolerance {
            break;
        }
        if value > 0.0 {
            behind = Some(turn);
        } else {
            ahead = Some(turn);
        }
        let newton = if slope < 0.0 { turn - value / slope } else { f64::NAN };
        turn = match (behind, ahead) {
            (Some(low), Some(high)) if newton > low && newton < high => newton,
            (Some(low), Some(high)) => 0.5 * (low + high),
            _ => {
                stride *= 4.0;
                let stride = stride.copysign(value);
                if (newton - turn).abs() < stride.abs() { newton } else { turn + stride }
            }
        };
        if turn.abs() > reach {
            // A stride may pass what lies just within the reach: its end is looked at before giving up.
            let end = reach.copysign(turn);
            if behind.is_some_and(|low| low >= end) || ahead.is_some_and(|high| high <= end) {
                return None;
            }
            turn = end;
        }
    }
    Some(turn)
}

/// Where a state stands.
pub(super) fn configuration(state: &State) -> Configuration<'_> {
    Configuration { u: &state.u, v: &state.v, output_rad: state.output_rad, leans: &state.leans }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flank that meets a load of 1 after a clearance: wherever it is within the reach, it is found, and beyond it is
    /// not.
    #[test]
    fn a_clearance_is_crossed_up_to_the_reach() {
        let reach = 1.344e-3;
        for clearance in [1e-5, 3e-4, 3.5e-4, 8e-4, 1.3e-3, 1.4e-3] {
            for sense in [1.0, -1.0] {
                let torque = |turn: f64| {
                    let depth = (sense * turn - clearance).max(0.0);
                    (sense * (1.0 - 1e6 * depth), if depth > 0.0 { -1e6 } else { 0.0 })
                };
                let found = balance(torque, 1e-6, reach);
                assert_eq!(found.is_some(), clearance < reach, "{clearance}: {found:?}");
                assert!(
                    found.is_none_or(|turn| (sense * turn - clearance - 1e-6).abs() < 1e-11),
                    "{clearance}: {found:?}"
                );
            }
        }
    }
}
