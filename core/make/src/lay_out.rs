//! From the solution to the numbers of a table.

use super::error::ProjectError;
use super::plan::{Harmonics, Plan, take};
use super::solve::{SampledNodes, dot};
use crate::TableData;
use core::f64::consts::TAU;
use flexspline::Direction;

/// From coefficients of both directions to centre and half-width, and from harmonics to curves.
pub(super) fn lay_out<'a>(
    plan: &Plan<'a>,
    solution: &mut [f64],
    marks: &[u64],
    values: &'a mut [f32],
) -> Result<TableData<'a>, ProjectError> {
    let (records, count) = (plan.records(), plan.coefficients());
    let ripples = records * plan.ripple_nodes;
    let mut values = values;
    let mean_rad = take(&mut values, "values", records)?;
    let half_width_rad = take(&mut values, "values", records)?;
    let mean_ripple_rad = take(&mut values, "values", ripples)?;
    let half_width_ripple_rad = take(&mut values, "values", ripples)?;
    let (both, harmonics) = solution.split_at_mut_checked(2 * plan.block()).unwrap_or_default();
    let (forward, backward) = both.split_at_mut_checked(plan.block()).unwrap_or_default();
    let sampled = SampledNodes { records, marks };
    let one_sided = plan.missing_direction.half_width_rad();
    let means = mean_rad.iter_mut().zip(half_width_rad.iter_mut());
    for (record, (mean, half_width)) in means.enumerate() {
        let range = record * count..(record + 1) * count;
        let forward = forward.get_mut(range.clone()).unwrap_or_default();
        let backward = backward.get_mut(range).unwrap_or_default();
        match (sampled.is(Direction::Forward, record), sampled.is(Direction::Backward, record)) {
            (true, false) => backward.iter_mut().zip(&*forward).for_each(|(b, f)| *b = f + 2.0 * one_sided),
            (false, true) => forward.iter_mut().zip(&*backward).for_each(|(f, b)| *f = b - 2.0 * one_sided),
            _ => {}
        }
        // From here on `forward` holds the centre and `backward` the half-width.
        let mut least = f64::INFINITY;
        for (forward, backward) in forward.iter_mut().zip(backward.iter_mut()) {
            (*forward, *backward) = (0.5 * (*backward + *forward), 0.5 * (*backward - *forward));
            least = least.min(*backward);
            *backward = backward.max(0.0);
        }
        if least < -plan.negative_half_width_tolerance_rad {
            let torque_nodes = plan.torque_nodes_n_m.len().max(1);
            return Err(ProjectError::NegativeHalfWidth {
                temperature: record / torque_nodes,
                torque: record % torque_nodes,
                found_rad: least,
                tolerance_rad: plan.negative_half_width_tolerance_rad,
            });
        }
        let average = |values: &[f64]| values.iter().sum::<f64>() / count as f64;
        let (centre, half) = (average(forward), average(backward));
        (*mean, *half_width) = (centre as f32, half as f32);
        let range = record * plan.ripple_nodes..(record + 1) * plan.ripple_nodes;
        for (ripple, from, middle) in
            [(&mut *mean_ripple_rad, &*forward, centre), (&mut *half_width_ripple_rad, &*backward, half)]
        {
            let ripple = ripple.get_mut(range.clone()).unwrap_or_default();
            ripple.iter_mut().zip(from).for_each(|(to, from)| *to = (from - middle) as f32);
        }
    }
    let mut harmonics = &*harmonics;
    let mut curve = |part: Harmonics<'_>| {
        let (mine, rest) = harmonics.split_at_checked(2 * part.orders.len()).unwrap_or_default();
        harmonics = rest;
        let curve = take(&mut values, "values", part.nodes)?;
        spread_harmonics(part.orders, mine, curve);
        Ok::<&'a [f32], ProjectError>(curve)
    };
    Ok(TableData {
        generator_curve_rad: curve(plan.generator)?,
        material_curve_rad: curve(plan.material)?,
        output_curve_rad: curve(plan.output)?,
        drive: plan.drive,
        torque_nodes_n_m: plan.torque_nodes_n_m,
        temperature_nodes_c: plan.temperature_nodes_c,
        ripple_nodes: plan.ripple_nodes,
        mean_rad,
        half_width_rad,
        mean_ripple_rad,
        half_width_ripple_rad,
        projection_worst_rad: 0.0,
        projection_rms_rad: 0.0,
    })
}

/// Coefficients of the spline that passes through `Σ aₖ·cos(k·phase) + bₖ·sin(k·phase)` at every node.
///
/// A spline with coefficients `cos(k·xᵢ)`, node spacing `s`, has `(3 + cos ks)/4·cos(k·xᵢ)` at its nodes.
fn spread_harmonics(orders: &[u16], amplitudes: &[f64], curve: &mut [f32]) {
    let spacing = TAU / curve.len().max(1) as f64;
    for (node, value) in curve.iter_mut().enumerate() {
        let mut sum = 0.0;
        for (&order, pair) in orders.iter().zip(amplitudes.chunks_exact(2)) {
            let gain = 4.0 / (3.0 + libm::cos(order as f64 * spacing));
            let (sine, cosine) = libm::sincos(order as f64 * spacing * node as f64);
            sum += gain * dot(pair, &[cosine, sine]);
        }
        *value = sum as f32;
    }
}
