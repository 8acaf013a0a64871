//! From samples to a table: weighted least squares onto the grid, without heap.
//!
//! A sample is one point of steady motion: generator angle, torque, temperature, direction, output angle. Its error
//! `e = output − generator/ratio` is a linear function of the unknowns
//!
//! ```text
//! e = Σ wθτ·wᵢ·c±[θ][τ][i]  +  Σ vθτ·D[θ][τ]  +  Σ aₖ·cos(k·phase) + bₖ·sin(k·phase)
//! ```
//!
//! with the same weights (torque, temperature, tooth phase) as the control step uses, one set of ripple coefficients
//! `c±` for each direction, and harmonics of ψ, ψ − δ and δ. D, the average of `(c₋ + c₊)/2` over the pitch, counts
//! again with the weights `v` of what its cubic adds to a straight line between torque nodes; they are zero at the
//! nodes. All are fitted together by conjugate gradients on the normal equations, scaled by their diagonal. Then centre
//! `(c₋ + c₊)/2` and half-width `(c₋ − c₊)/2` give D, R and H, h.
//!
//! # Between torque nodes
//! The slope of D at a torque node is that of a polynomial through D at the nodes around it, never across a jump.
//! Wind-up that starts steeply at a jump and saturates wants nodes close together there. In a piece of five nodes or
//! more between a jump and an end of the axis the polynomial is a quartic in `√(|τ − τⱼ| + w/4)`, τⱼ the node at the
//! jump and w the interval after it: exact for parabolas, close for roots. In other pieces it is a parabola through
//! three nodes.
//!
//! Largest interpolation error, as part of the rise from 0 to 50 N·m, with nodes at 0.021, 0.12, 0.35, 0.9, 2, 4, 8,
//! 15, 28, 50 N·m, and in the last row at 0.021, 0.12, 0.4, 1.2, 3, 6.5, 12, 20, 33, 50 N·m:
//!
//! | | τ^0.45 to τ^0.6 | τ/(τ + 30) | 1 − exp(−τ/20) | tanh(τ/25) |
//! |---|---|---|---|---|
//! | straight lines | 9.1e-3 | 1.8e-2 | 2.4e-2 | 3.1e-2 |
//! | slopes of parabolas | 5.1e-3 | 9.9e-3 | 1.4e-2 | 1.9e-2 |
//! | slopes of quartics in the root | 7.3e-4 | 1.1e-3 | 2.4e-4 | 6.1e-3 |
//! | the same, other nodes | 6.9e-4 | 4.3e-4 | 3.2e-4 | 6.6e-4 |
//!
//! [`make_image`] then reads the finished image with the code of the control step at every sample and records the worst
//! and the rms deviation in it: that bound includes interpolation, quantisation and single precision.
//!
//! A node that the samples do not determine is an error that names it, never a guess. Samples strictly inside a torque
//! jump say nothing about either side of it; they are left out and counted.
//!
//! ```
//! use flexspline::{Direction, Drive, FixedMember, GeneratorKind, Table};
//! use flexspline_make::{Harmonics, MissingDirection, Plan, Provenance, Sample, Workspace, make_image};
//!
//! let plan = Plan {
//!     drive: Drive::new(188, 190, FixedMember::Flexspline).unwrap(),
//!     torque_nodes_n_m: &[-20.0, 20.0],
//!     temperature_nodes_c: &[20.0],
//!     ripple_nodes: 8,
//!     generator: Harmonics::default(),
//!     material: Harmonics::default(),
//!     output: Harmonics::default(),
//!     missing_direction: MissingDirection::Refuse,
//!     negative_half_width_tolerance_rad: 5e-8,
//!     deviation_limit_rad: 5e-6,
//! };
//! # let provenance = Provenance {
//! #     generator_kind: GeneratorKind::Cam, drive_hash: [0; 32], tool_version: "doc", mesh_level: "none",
//! #     solver_residual: 0.0, torque_range_n_m: [-20.0, 20.0], temperature_range_c: [0.0, 40.0],
//! #     error_limit_rad: 0.02,
//! # };
//! // One tooth pitch at every node, both ways: wind-up, a lag of 1e-4 rad, and a ripple.
//! let mut samples = Vec::new();
//! for torque_n_m in [-20.0, 20.0] {
//!     for (direction, lag_rad) in [(Direction::Forward, 1e-4), (Direction::Backward, -1e-4)] {
//!         for position in 0..8 {
//!             let generator_rad = position as f64 / 8.0 * std::f64::consts::TAU / 188.0;
//!             let error_rad = torque_n_m / 3e4 - lag_rad + 1e-6 * (188.0 * generator_rad).sin();
//!             let output_rad = generator_rad / 95.0 + error_rad;
//!             samples.push(Sample { generator_rad, torque_n_m, temperature_c: 20.0, direction, output_rad });
//!         }
//!     }
//! }
//! let (mut numbers, mut marks) = (vec![0.0; plan.numbers_len()], vec![0; plan.marks_len()]);
//! let (mut values, mut image) = (vec![0.0; plan.values_len()], vec![0; plan.image_bytes()]);
//! let workspace = Workspace { numbers: &mut numbers, marks: &mut marks, values: &mut values };
//! let hash = |_contents: &[u8]| [0; 8]; // the first 8 bytes of BLAKE3
//! let fit = make_image(&plan, &provenance, &samples, workspace, &mut image, hash).unwrap();
//! assert!(fit.worst_rad < 4e-9);
//! assert!(Table::check(&image).is_ok());
//! ```
//!
//! Memory is the caller's: [`Plan::numbers_len`], [`Plan::marks_len`] and [`Plan::values_len`]. A pass over the samples
//! takes one sine and cosine for each harmonic and some 50 multiplications for each sample; well-spread samples need
//! 10 to 30 passes. [`Plan::kept_len`] numbers more keep the sines: less than half of the time, the same image. Uses
//! libm: not for the control step.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable,
        clippy::todo,
        clippy::unimplemented
    )
)]
// Overflow of integers is left out: sizes are limited to small node counts before they are multiplied.

#[cfg(test)]
extern crate std;

mod coverage;
mod equations;
mod error;
#[cfg(test)]
mod fixture;
mod lay_out;
mod plan;
mod slopes;
mod solve;
#[cfg(test)]
mod tests;
mod write;

pub use error::ProjectError;
pub use flexspline::shared::grid;
pub use flexspline::shared::image::{MAX_RIPPLE_NODES, MAX_TEMPERATURE_NODES, TEXT_BYTES, image_bytes};
pub use plan::{Harmonics, MAX_HARMONICS, MissingDirection, NODES_PER_PERIOD, Plan, Sample, Workspace};
pub use write::{Provenance, TableData, WriteError, write_image};

use flexspline::{GeneratorAngle, Table};
use lay_out::lay_out;
use plan::take;
use solve::{System, solve};

/// How well the finished image reproduces the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Length of the image.
    pub image_bytes: usize,
    /// Largest deviation, rad.
    pub worst_rad: f64,
    /// The sample with the largest deviation.
    pub worst_sample: usize,
    /// Root mean square deviation, rad.
    pub rms_rad: f64,
    /// Samples used.
    pub used: usize,
    /// Samples left out because they lie inside a torque jump.
    pub inside_jumps: usize,
}

/// Fits the plan's table to the samples; deviations are left 0, [`make_image`] finds them.
///
/// # Errors
/// [`ProjectError`]: a plan that makes no table, samples outside it, or unknowns that the samples do not determine.
pub fn project<'a>(
    plan: &Plan<'a>,
    samples: &[Sample],
    workspace: Workspace<'a>,
) -> Result<TableData<'a>, ProjectError> {
    plan.check()?;
    if samples.is_empty() {
        return Err(ProjectError::NoSamples);
    }
    samples.iter().enumerate().try_for_each(|(index, sample)| plan.check_sample(index, sample))?;
    plan.check_coverage(samples)?;

    let unknowns = plan.unknowns();
    let (mut numbers, mut marks, mut values) = (workspace.numbers, workspace.marks, workspace.values);
    if numbers.len() < plan.numbers_len() {
        let (needed, found) = (plan.numbers_len(), numbers.len());
        return Err(ProjectError::Workspace { part: "numbers", needed, found });
    }
    let marks = take(&mut marks, "marks", plan.marks_len())?;
    let values = take(&mut values, "values", plan.values_len())?;
    let solution = take(&mut numbers, "numbers", unknowns)?;
    let mut vector = || take(&mut numbers, "numbers", unknowns);
    let (diagonal, residual, search, product) = (vector()?, vector()?, vector()?, vector()?);
    let mut by_record = || take(&mut numbers, "numbers", plan.records());
    let (means, pulls) = (by_record()?, by_record()?);
    let system = System { diagonal, residual, search, product, means, pulls, kept: numbers };

    solve(plan, samples, solution, marks, system)?;
    lay_out(plan, solution, marks, values)
}

/// Deviation of an accepted table from samples, read with the code of the control step.
///
/// The samples are those of a [`project`]; ones the table cannot place are left out.
#[must_use]
pub fn measure(table: &Table<'_>, plan: &Plan<'_>, samples: &[Sample]) -> Fit {
    let mut fit = Fit {
        image_bytes: table.image().len(),
        worst_rad: 0.0,
        worst_sample: 0,
        rms_rad: 0.0,
        used: 0,
        inside_jumps: 0,
    };
    let mut squares = 0.0;
    for (index, sample) in plan.used(samples) {
        let Some(generator) = GeneratorAngle::from_rad(sample.generator_rad) else {
            continue;
        };
        let (torque, temperature) = (sample.torque_n_m as f32, sample.temperature_c as f32);
        let Some(error) = table.steady_error_rad(generator, torque, temperature, sample.direction) else {
            continue;
        };
        let deviation = (error as f64 - plan.error_rad(sample)).abs();
        fit.used += 1;
        squares += deviation * deviation;
        if deviation > fit.worst_rad {
            (fit.worst_rad, fit.worst_sample) = (deviation, index);
        }
    }
    fit.rms_rad = libm::sqrt(squares / fit.used.max(1) as f64);
    fit.inside_jumps = samples.len() - fit.used;
    fit
}

/// Makes the image of the plan's table from samples, in `out`, with the deviations it has from them inside.
///
/// `id` as in [`write_image`].
///
/// # Errors
/// As [`project`] and [`write_image`]; [`ProjectError::Deviation`] if a sample is missed by more than the plan allows.
pub fn make_image<'a>(
    plan: &Plan<'a>,
    provenance: &Provenance<'_>,
    samples: &[Sample],
    workspace: Workspace<'a>,
    out: &mut [u8],
    id: impl FnOnce(&[u8]) -> [u8; 8],
) -> Result<Fit, ProjectError> {
    let mut data = project(plan, samples, workspace)?;
    let bytes = write_image(&data, provenance, out, |_| [0; 8])?;
    let fit = measure(&Table::check(out.get(..bytes).unwrap_or_default())?, plan, samples);
    if fit.worst_rad.is_nan() || fit.worst_rad > plan.deviation_limit_rad {
        let (sample, found_rad) = (fit.worst_sample, fit.worst_rad);
        return Err(ProjectError::Deviation { sample, found_rad, limit_rad: plan.deviation_limit_rad });
    }
    // Rounded up: single precision may not make a bound smaller than it is.
    (data.projection_worst_rad, data.projection_rms_rad) =
        ((fit.worst_rad as f32).next_up(), (fit.rms_rad as f32).min(fit.worst_rad as f32));
    write_image(&data, provenance, out, id)?;
    Ok(fit)
}
