//! Signatures of geometric causes from the influence kernels of the contact FEM ([`flexspline_design::kernels`]), where
//! the drive has them: what each load and each place in the wave makes of an error is then computed, not assumed.
//!
//! Errors that the kernels leave open stay nuisances: the kernels are those of the frictionless drive at one
//! temperature and on one mesh.

use std::f64::consts::PI;
use std::sync::Arc;

use super::displaced::SCALE_MISFIT;
use super::geometry::{Angle, COS_PRESSURE_ANGLE, angle, waves, weighted_waves};
use super::{Excitation, Law, Regressor, Shape, Tag, beside, by_row, directed, main, main_about, nuisance, of_wave};
use crate::causes::{CauseName, Kin, ParameterName as Name};
use flexspline_design::kernels::{Gain, Kernels};
use flexspline_mechanics::drive::Wheel;

/// Share by which a kernel's signature may be wrong: friction, temperature, mesh. *Guess*: less than a model without a
/// kernel may be wrong by.
const KERNEL_MISFIT: f64 = 0.08;
/// Plausible size of an error of pitch, of an oval, µm: one standard deviation. *Guess*: the order of magnitude of fine
/// gears.
const USUAL_UM: f64 = 6.0;
/// Plausible eccentricities, µm. *Guess*: from a tenth of what fine gears have to ten times as much.
const ECCENTRICITY_UM: [f64; 2] = [0.5, 60.0];

/// A value that depends on the load, by which flank carries: between the flanks, part of both.
fn by_flank(flank: f64, torque: f64, value: impl Fn(f64) -> f64) -> f64 {
    let load = torque.abs();
    let forward = if flank > -1.0 { 0.5 * (1.0 + flank) * value(load) } else { 0.0 };
    let backward = if flank < 1.0 { 0.5 * (1.0 - flank) * value(-load.max(f64::MIN_POSITIVE)) } else { 0.0 };
    forward + backward
}

fn main_um(values: Vec<f64>) -> Regressor {
    main(values, USUAL_UM).called(Tag::WAVE)
}

/// Columns of the response to `cos(k α)` and to `sin(k α)` of an error on a wheel.
fn responses(on: &Excitation<'_>, of: Angle, order: f64, gain: impl Fn(f64) -> Gain) -> [Vec<f64>; 2] {
    // The gain changes slowly with the load: it is looked up on a grid of its root. *Guess*: steps of 1.6 % of the
    // root, in which straight lines do.
    const NODES: usize = 64;
    let most = on.rows.torque.iter().fold(1e-6, |m: f64, t| m.max(t.abs())).sqrt();
    let node = |k: usize, sign: f64| gain(sign * (most * k as f64 / (NODES - 1) as f64).powi(2).max(1e-9));
    let nodes: [Vec<Gain>; 2] = [1.0, -1.0].map(|sign| (0..NODES).map(|k| node(k, sign)).collect());
    let at = |torque: f64| -> Gain {
        let place = torque.abs().sqrt() / most * (NODES - 1) as f64;
        let (k, x) = ((place as usize).min(NODES - 2), place - (place as usize).min(NODES - 2) as f64);
        let of = &nodes[usize::from(torque < 0.0)];
        [0, 1].map(|i| (1.0 - x) * of[k][i] + x * of[k + 1][i])
    };
    let response = |k: usize, of_sine: bool| {
        let (sin, cos) = (order * angle(on, of, k)).sin_cos();
        by_flank(on.base.flank[k], on.rows.torque[k], |torque| {
            let [c, s] = at(torque);
            if of_sine { c * sin + s * cos } else { c * cos - s * sin }
        })
    };
    [by_row(on, |k| response(k, false)), by_row(on, |k| response(k, true))]
}

/// Deviations that any law of shape may have from its kernel: the flanks' share and the clearance.
fn left_open(on: &Excitation<'_>, of: Angle, order: f64) -> Vec<Regressor> {
    let flank = &on.base.flank;
    let both = waves(on, of, order).into_iter().chain(weighted_waves(on, of, order, flank));
    both.map(|wave| nuisance(wave, 0.05)).chain([beside(flank.clone(), 0.1)]).collect()
}

/// An axis off that of the generator: size and direction enter as the FEM of such drives has them.
pub(super) fn eccentric(cause: CauseName, of: Angle, kernels: &Arc<Kernels>) -> Law {
    let kernels = Arc::clone(kernels);
    let law = Law::new(cause, move |on, shape| {
        let (size, phase) = (shape.of(Name::SizeUm), shape.of(Name::PhaseRad));
        let field = kernels.eccentric_field(size);
        let pattern = by_row(on, |k| {
            let place = kernels.place_of_load(on.rows.torque[k]);
            let direction = phase - angle(on, of, k);
            by_flank(on.base.flank[k], on.rows.torque[k], |torque| field.at(direction, torque < 0.0, place))
        });
        let mut columns = vec![main_about(1.0, pattern, SCALE_MISFIT).called(Tag::SIZE)];
        columns.extend(left_open(on, of, 2.0));
        columns
    })
    .shapes([
        Shape::by_factors(Name::SizeUm, ECCENTRICITY_UM[0], ECCENTRICITY_UM[1], 10),
        Shape::angle(Name::PhaseRad, PI, 8),
    ])
    .parameters_by(|on, shape, c| {
        let size = shape.of(Name::SizeUm) * c.of(Tag::SIZE);
        directed(size, size * on.scales.arcsec_per_um / COS_PRESSURE_ANGLE, shape.of(Name::PhaseRad))
    })
    .physical_if(|_, c| c.of(Tag::SIZE) > 0.5);
    by_kernels(law)
}

/// Harmonics of the pitch of a wheel that both lobes see alike; the odd ones cancel.
pub(super) fn pitch(cause: CauseName, (of, wheel): (Angle, Wheel), kernels: &Arc<Kernels>) -> Law {
    /// Even orders of the pitch of a wheel. *Guess*: those beyond are small, as a zone of engaged teeth averages over
    /// them.
    const ORDERS: [u32; 8] = [2, 4, 6, 8, 10, 12, 14, 16];
    let kernels = Arc::clone(kernels);
    let mut law = Law::new(cause, move |on, _| {
        let mut columns: Vec<Regressor> = Vec::new();
        for order in ORDERS {
            let pair = responses(on, of, f64::from(order), |torque| kernels.pitch_error(wheel, order, torque));
            // Cumulative errors fall with their order (ISO 1328-1: the total is a few times the single pitch error).
            let share = 1.4 / f64::from(order);
            columns.extend(pair.map(|v| if order == 2 { main_um(v) } else { nuisance(v, share) }));
        }
        columns.extend(left_open(on, of, 2.0));
        for order in [1.0, 3.0] {
            columns.extend(waves(on, of, order).map(|wave| nuisance(wave, 0.1)));
        }
        columns
    })
    .parameters_by(|on, _, c| {
        let (amplitude, phase) = of_wave(c, Tag::WAVE);
        let mut named = directed(amplitude, amplitude * on.scales.arcsec_per_um, 0.5 * phase);
        named.push((Name::Harmonic, 2.0));
        named
    });
    law.search.whole_beside_noise = true;
    by_kernels(law)
}

/// A ring pressed to an oval.
pub(super) fn ovality(kernels: &Arc<Kernels>) -> Law {
    let (of, kernels) = (Angle::CircularSpline, Arc::clone(kernels));
    let law = Law::new(CauseName::CircularSplineOvality, move |on, _| {
        let mut columns: Vec<Regressor> = responses(on, of, 2.0, |torque| kernels.ovality(torque)).map(main_um).into();
        columns.extend(left_open(on, of, 2.0));
        columns
    })
    .parameters_by(|on, _, c| {
        let (amplitude, phase) = of_wave(c, Tag::WAVE);
        directed(amplitude, amplitude * 0.67 * on.scales.arcsec_per_um, 0.5 * phase)
    });
    by_kernels(law)
}

/// The model with the misfit and the name of all models by kernels.
fn by_kernels(mut law: Law) -> Law {
    law.wrong.misfit = KERNEL_MISFIT;
    law.wrong.kin = Kin::Unlike;
    law.variant("kernels")
}
