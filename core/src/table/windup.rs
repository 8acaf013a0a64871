//! How the wind-up D goes between its torque nodes: a cubic through the values and slopes of two nodes.
//!
//! Intervals that are jumps cut the torque axis into pieces. Inside a piece D and its slope are continuous; across a
//! jump D is linear, and each of its two nodes has the slope of its own side.
//!
//! Slopes come from the node values alone and linearly: `flexspline-make` finds them, stores them in the image, and its
//! least squares assume them; [`bend`] is what the control step and the least squares evaluate. A limiter against
//! overshoot would not be linear; what a cubic can reach is bounded when a table is accepted instead.

/// Difference of a cubic from the straight line at `weight` of an interval of `width`, from its rise over the interval,
/// its slope below and its slope above.
#[inline(always)]
pub fn bend(weight: f32, width: f32, [rise, below, above]: [f32; 3]) -> f32 {
    let rest = 1.0 - weight;
    weight * rest * (rest * (width * below - rise) + weight * (rise - width * above))
}

#[cfg(test)]
mod tests {
    use crate::fixture::{self, ARCSEC};
    use crate::slopes::{NodeSlope, Slopes};
    use crate::{Quality, Table};
    use proptest::prelude::*;
    use std::vec::Vec;

    /// Nodes of one side, closer together towards the jump at 0.02.
    const SIDE: [f32; 10] = [0.021, 0.12, 0.35, 0.9, 2.0, 4.0, 8.0, 15.0, 28.0, 50.0];
    const EVENER: [f32; 10] = [0.021, 0.12, 0.4, 1.2, 3.0, 6.5, 12.0, 20.0, 33.0, 50.0];

    /// The side and its mirror image, and the inner nodes of both jumps.
    fn axis(side: &[f32]) -> Vec<f32> {
        let mirrored = side.iter().rev().map(|node| -node);
        mirrored.chain([-0.019, 0.019]).chain(side.iter().copied()).collect()
    }

    fn image(nodes: &[f32], means: &[f32], temperatures: &[f32]) -> Vec<u8> {
        fixture::image_of(nodes, means, temperatures, 0)
    }

    /// D that a table of `nodes` has for a curve of torque, at `places` in each interval: torque, D, curve.
    fn against(nodes: &[f32], places: u32, curve: impl Fn(f64) -> f64) -> Vec<(f64, f64, f64)> {
        let means: Vec<f32> = nodes.iter().map(|&node| curve(node as f64) as f32).collect();
        let image = image(nodes, &means, &[20.0]);
        let table = Table::check(&image).unwrap();
        let mut found = Vec::new();
        for pair in nodes.windows(2) {
            for place in 0..=places {
                let torque = pair[0] + (pair[1] - pair[0]) * place as f32 / places as f32;
                let mean = table.at(torque, 20.0).unwrap().mean_rad();
                found.push((torque as f64, mean as f64, curve(torque as f64)));
            }
        }
        found
    }

    /// Largest deviation beyond the jumps.
    fn worst(nodes: &[f32], curve: impl Fn(f64) -> f64) -> f64 {
        let outside_jumps = |(torque, ..): &(f64, f64, f64)| torque.abs() > 0.020_99;
        let points = against(nodes, 100, curve);
        points
            .iter()
            .filter(|p| outside_jumps(p))
            .fold(0.0, |worst, (_, found, curve)| worst.max((found - curve).abs()))
    }

    /// A curve of |τ| that rises by 900″ to 50 from a backlash of 45″, with the sign of τ.
    fn signed(rise: impl Fn(f64) -> f64) -> impl Fn(f64) -> f64 {
        move |torque| 900.0 * ARCSEC * torque.signum() * (0.05 + rise(torque.abs()) / rise(50.0))
    }

    #[test]
    fn curved_wind_up_is_met_to_the_stated_error() {
        let part = |nodes: &[f32], rise: &dyn Fn(f64) -> f64| worst(&axis(nodes), signed(rise)) / (900.0 * ARCSEC);
        let saturating: [&dyn Fn(f64) -> f64; 3] =
            [&|t| t / (t + 30.0), &|t| 1.0 - (-t / 20.0).exp(), &|t| (t / 25.0).tanh()];
        for (nodes, power, stated) in
            [(&SIDE, 7.3e-4, [1.1e-3, 2.4e-4, 6.1e-3]), (&EVENER, 6.9e-4, [4.3e-4, 3.2e-4, 6.6e-4])]
        {
            let worst = [0.45, 0.5, 0.55, 0.6].map(|exponent| part(nodes, &|t| t.powf(exponent)));
            let worst = worst.into_iter().fold(0.0, f64::max);
            assert!(worst < 1.02 * power && worst > 0.9 * power, "powers: {worst:e}, stated {power:e}");
            for (rise, stated) in saturating.iter().zip(stated) {
                let worst = part(nodes, rise);
                assert!(worst < 1.02 * stated && worst > 0.9 * stated, "{worst:e}, stated {stated:e}");
            }
        }
        // Straight lines, for comparison.
        let straight = SIDE.windows(2).map(|pair| {
            let [low, high] = [pair[0] as f64, pair[1] as f64];
            let (middle, rise) = (0.5 * (low + high), |t: f64| (t / 25.0).tanh() / 2.0f64.tanh());
            (rise(middle) - 0.5 * (rise(low) + rise(high))).abs()
        });
        let straight = straight.fold(0.0, f64::max);
        assert!(straight > 2.8e-2 && straight < 3.2e-2, "{straight:e}");
    }

    #[test]
    fn parabolas_are_exact_on_every_piece() {
        let few = [-50.0, -20.0, -1.51, -1.49, -1.0, 0.3, 1.0, 1.49, 1.51, 4.0, 11.0, 30.0];
        let smooth = [-50.0, -20.0, -5.0, 1.0, 2.0, 7.0, 30.0];
        let long = axis(&SIDE);
        for (nodes, jump, half) in [(&few[..], 1.5, 0.01), (&smooth, f64::INFINITY, 0.0), (&long, 0.02, 0.001)] {
            let curve = |torque: f64| {
                let [a, b, c] = if torque < -jump {
                    [-1.0e-3, 4.0e-5, 3.0e-7]
                } else if torque > jump {
                    [2.0e-3, 6.0e-5, -5.0e-7]
                } else {
                    [1.0e-4, 2.0e-5, 1.0e-7]
                };
                a + torque * (b + torque * c)
            };
            for (torque, found, exact) in against(nodes, 40, curve) {
                let in_jump = (torque.abs() - jump).abs() < 0.99 * half;
                assert!(in_jump || (found - exact).abs() < 2.0e-9, "{torque}: {found:e} {exact:e}");
            }
        }
    }

    #[test]
    fn jumps_stay_straight_and_ends_flat() {
        let nodes = axis(&SIDE);
        let curve = signed(f64::sqrt);
        let means: Vec<f32> = nodes.iter().map(|&node| curve(node as f64) as f32).collect();
        let image = image(&nodes, &means, &[20.0]);
        let table = Table::check(&image).unwrap();
        let at = |torque: f32| table.at(torque, 20.0).unwrap();
        for jump in [9, 11] {
            assert!(table.is_torque_jump(jump));
            let (low, high) = (nodes[jump], nodes[jump + 1]);
            for i in 1..50 {
                let share = i as f32 / 50.0;
                let torque = low + (high - low) * share;
                let share = (torque - low) / (high - low);
                let straight = means[jump] * (1.0 - share) + means[jump + 1] * share;
                assert!((at(torque).mean_rad() - straight).abs() < 2.0e-9);
                assert_eq!(at(torque).quality(true, true), Quality::Uncertain);
            }
        }
        // At the nodes nothing but the values, on both sides of a jump too.
        for (&node, &mean) in nodes.iter().zip(&means) {
            assert!((at(node).mean_rad() - mean).abs() < 2.0e-9, "{node}");
        }
        for (beyond, edge) in [(50.01, 50.0), (1.0e6, 50.0), (-50.01, -50.0), (-1.0e6, -50.0)] {
            assert_eq!(at(beyond).mean_rad(), at(edge).mean_rad());
            assert_eq!(
                (at(beyond).quality(true, true), at(edge).quality(true, true)),
                (Quality::Extrapolated, Quality::InRange)
            );
        }
    }

    #[test]
    fn planes_of_temperature_blend_linearly() {
        let nodes = [1.0, 2.0, 4.0, 8.0, 16.0];
        let means: [f32; 10] =
            core::array::from_fn(|i| if i < 5 { 1.0e-4 * i as f32 } else { 3.0e-4 * (i as f32).sqrt() });
        let both = image(&nodes, &means, &[0.0, 40.0]);
        let both = Table::check(&both).unwrap();
        let planes = [&means[..5], &means[5..]].map(|means| image(&nodes, means, &[0.0]));
        let planes = planes.each_ref().map(|image| Table::check(image).unwrap());
        for i in 0..100 {
            let torque = 1.0 + 0.15 * i as f32;
            let [cold, hot] = planes.map(|table| table.at(torque, 0.0).unwrap().mean_rad());
            let found = both.at(torque, 10.0).unwrap().mean_rad();
            assert!((found - (0.75 * cold + 0.25 * hot)).abs() < 3.0e-9, "{torque}");
        }
    }

    #[test]
    fn neither_jumps_nor_other_temperatures_widen_the_bound() {
        let means = [-1.0e-3, -1.0e-3, 3.0e-3, 3.0e-3, -2.0e-3, -2.0e-3, 2.0e-3, 2.0e-3];
        let image = image(&[-20.0, -0.01, 0.01, 20.0], &means, &[0.0, 40.0]);
        let bounds = Table::check(&image).unwrap().bounds;
        assert!((bounds.error_rad - 3.001e-3).abs() < 1.0e-9, "{bounds:?}");
    }

    #[test]
    fn slopes_of_a_mirrored_axis_are_mirrored() {
        let nodes = axis(&SIDE);
        let slopes = Slopes::new(&nodes);
        let last = nodes.len() - 1;
        for node in 0..nodes.len() {
            let (here, there) = (slopes.at(node), slopes.at(last - node));
            let along = |slope: NodeSlope, other: usize| {
                other.checked_sub(slope.first).and_then(|i| slope.weights.get(i)).copied().unwrap_or(0.0)
            };
            for other in 0..nodes.len() {
                let (a, b) = (along(here, other), along(there, last - other));
                assert!((a + b).abs() <= 1.0e-9 * a.abs(), "{node} {other}: {a} {b}");
            }
        }
    }

    #[test]
    fn short_axes_have_slopes_too() {
        assert_eq!(Slopes::new(&[3.0]).at(0).of(&[1.0]), 0.0);
        let two = Slopes::new(&[1.0, 3.0]);
        assert!((0..2).all(|node| two.at(node).of(&[5.0, 9.0]) == 2.0));
        // Two nodes between two jumps, and an end that is cut off by one.
        let lone = [-9.0, -5.01, -4.99, 5.0, 5.02, 9.0];
        assert_eq!(Slopes::new(&lone).at(2).of(&[0.0, 1.0, 2.0, 4.0, 8.0, 16.0]), 2.0 / (5.0 + 4.99f32) as f64);
        assert_eq!(Slopes::new(&[0.0, 2.0, 20.0, 40.0]).at(0).of(&[1.0, 2.0, 3.0, 4.0]), 0.0);
        assert_eq!(Slopes::new(&[]).at(0).of(&[]), 0.0);
    }

    proptest! {
        #[test]
        fn value_and_slope_are_continuous_outside_jumps(
            values in prop::collection::vec(-1.0f32..1.0, 22), offset in 0.5f32..2.0, evener: bool,
        ) {
            let nodes = axis(if evener { &EVENER } else { &SIDE });
            // Rough values on a rise; whatever they are, no kink may be left.
            let means: Vec<f32> =
                nodes.iter().zip(&values).map(|(&node, value)| 1.0e-5 * (offset * node + 0.5 * value)).collect();
            let image = image(&nodes, &means, &[20.0]);
            let table = Table::check(&image).unwrap();
            let at = |torque: f32| table.at(torque, 20.0).unwrap().mean_rad() as f64;
            let slopes = Slopes::new(&nodes);
            for i in 1..nodes.len() - 1 {
                if table.is_torque_jump(i - 1) || table.is_torque_jump(i) {
                    continue;
                }
                // A cubic is fixed by four points: its slope at the node, from each side.
                let side = |other: f32| {
                    // Counts are 1.5e-9 rad.
                    let third = |k: f32| nodes[i] + (other - nodes[i]) * k / 3.0;
                    let step = (third(1.0) - nodes[i]) as f64;
                    let [a, b, c, d] = [0.0, 1.0, 2.0, 3.0].map(|k| at(third(k)));
                    ((-11.0 * a + 18.0 * b - 9.0 * c + 2.0 * d) / (6.0 * step), 4.0e-9 / step.abs())
                };
                let ((before, rough_before), (after, rough_after)) = (side(nodes[i - 1]), side(nodes[i + 1]));
                let rounding = 3.0 * (rough_before + rough_after) + 1.0e-4 * before.abs();
                prop_assert!((before - after).abs() <= rounding, "{}: {:e} {:e}", nodes[i], before, after);
                let slope = slopes.at(i).of(&means);
                prop_assert!((before - slope).abs() <= rounding, "{}: {:e} {:e}", nodes[i], before, slope);
            }
        }
    }
}
