//! Errors of shape and place of the toothed wheels and the generator (PHYSICS §1.3).
//!
//! An error of harmonic k on the flexspline's material returns k times per turn of the wave on it, one on the circular spline's
//! 94/95 as often: orders 2 and 1.979, apart after half an output turn. Eccentricities are rectified by the clearance, `|sin|` on the
//! flank that carries: orders 2, 4, 6 as 1 : 1/5 : 3/35, phase turned by twice the flank angle between flanks, a mean that eats
//! backlash, and less the more teeth share the load.

use std::f64::consts::PI;

use super::{Column, Excitation, Law, Named, Shape, by_row, main, nuisance, polar};

/// Largest plausible amplitude, arcsec, one standard deviation.
const USUAL_ARCSEC: f64 = 20.0;

/// Cosine of the pressure angle of a working flank, 20 to 25 degrees (PHYSICS §3.1).
const COS_PRESSURE_ANGLE: f64 = 0.93;

/// Which angle an error is locked to.
#[derive(Clone, Copy, PartialEq)]
enum Angle {
    Flexspline,
    CircularSpline,
    /// Gravity as the wave sees it, orientation counted with this sign.
    Gravity(f64),
}

fn angle(on: &Excitation<'_>, of: Angle, k: usize) -> f64 {
    match of {
        Angle::Flexspline => on.rows.on_flexspline[k],
        Angle::CircularSpline => on.rows.on_circular_spline[k],
        Angle::Gravity(sign) => on.rows.generator[k] + sign * on.rows.orientation[k],
    }
}

/// How an error fades as the load brings more teeth to bear.
fn fading(on: &Excitation<'_>, half_load: f64, k: usize) -> f64 {
    1.0 / (1.0 + (on.rows.torque[k] / half_load).abs())
}

fn waves(on: &Excitation<'_>, of: Angle, order: f64, weight: impl Fn(usize) -> f64) -> [Vec<f64>; 2] {
    let at = |k: usize| order * angle(on, of, k);
    [by_row(on, |k| weight(k) * at(k).cos()), by_row(on, |k| weight(k) * at(k).sin())]
}

/// Half-load of the fading: from a thirtieth of the load scale to three times it.
fn half_load(on: &Excitation<'_>) -> Shape {
    let load = on.scales.load.max(1e-3);
    Shape::by_factors("half_load_n_m", load / 30.0, load * 3.0, 3)
}

/// An eccentricity, rectified by the clearance.
fn rectified(cause: &'static str, of: Angle, on: &Excitation<'_>) -> Law {
    let loaded = on.scales.load > 0.0;
    Law::new(cause, move |on, shape| {
        let half = shape.first().copied().unwrap_or(f64::INFINITY);
        let (flank, fade) = (|k: usize| on.base.flank[k], |k: usize| fading(on, half, k));
        let mut columns: Vec<Column> = Vec::new();
        columns.extend(waves(on, of, 2.0, fade).map(|v| main(v, USUAL_ARCSEC)));
        columns.extend(waves(on, of, 2.0, |k| fade(k) * flank(k)).map(|v| main(v, USUAL_ARCSEC)));
        columns.extend(waves(on, of, 4.0, fade).map(|v| nuisance(v, 0.3)));
        columns.extend(waves(on, of, 4.0, |k| fade(k) * flank(k)).map(|v| nuisance(v, 0.3)));
        columns.push(nuisance(by_row(on, |k| fade(k) * flank(k)), 1.5));
        if half.is_finite() {
            columns.extend(waves(on, of, 2.0, |_| 1.0).map(|v| nuisance(v, 0.2)));
            columns.extend(waves(on, of, 2.0, flank).map(|v| nuisance(v, 0.2)));
        }
        columns.extend(waves(on, of, 6.0, fade).map(|v| nuisance(v, 0.1)));
        columns
    })
    .shapes(loaded.then(|| half_load(on)))
    .parameters(move |on, shape, c| {
        // On each flank the second order has 4 / 3 pi = 0.424 of e / (r cos alpha).
        let plus = polar(c[0] + c[2], c[1] + c[3]);
        let minus = polar(c[0] - c[2], c[1] - c[3]);
        let second = 0.5 * (plus.0 + minus.0);
        let mut named: Vec<Named> = vec![
            ("amplitude_um", second / 0.424 * COS_PRESSURE_ANGLE / on.scales.arcsec_per_um),
            ("amplitude_arcsec", second / 0.424),
            ("phase_rad", 0.5 * polar(c[0], c[1]).1),
        ];
        if let Some(half) = shape.first() {
            named.push(("half_load_n_m", *half));
        }
        named
    })
}

/// Errors of position along the pitch: the same on both flanks and under any load.
fn pitch(cause: &'static str, of: Angle) -> Law {
    const ORDERS: [(f64, f64); 5] = [(2.0, 20.0), (1.0, 10.0), (3.0, 8.0), (4.0, 8.0), (6.0, 5.0)];
    Law::new(cause, move |on, _| {
        let mut columns: Vec<Column> = Vec::new();
        for (order, usual) in ORDERS {
            columns.extend(waves(on, of, order, |_| 1.0).map(|v| main(v, usual)));
        }
        columns.extend(waves(on, of, 2.0, |k| on.base.flank[k]).map(|v| nuisance(v, 0.15)));
        if on.scales.load > 0.0 {
            columns.extend(waves(on, of, 2.0, |k| on.rows.torque[k].abs() / on.scales.load).map(|v| nuisance(v, 0.1)));
        }
        columns
    })
    .parameters(|on, _, c| {
        let amplitude = |pair: usize| polar(c[2 * pair], c[2 * pair + 1]);
        let largest = (0..ORDERS.len()).max_by(|a, b| amplitude(*a).0.total_cmp(&amplitude(*b).0)).unwrap_or(0);
        vec![
            ("amplitude_um", amplitude(largest).0 / on.scales.arcsec_per_um),
            ("amplitude_arcsec", amplitude(largest).0),
            ("harmonic", ORDERS[largest].0),
            ("phase_rad", amplitude(largest).1 / ORDERS[largest].0),
        ]
    })
}

/// Ring pressed to an oval: order 2 alone; 10 µm of radius are 0.67 of 10 µm on the pitch circle with the tangential part of a ring that keeps its length.
fn ovality() -> Law {
    let of = Angle::CircularSpline;
    Law::new("circular_spline_ovality", move |on, _| {
        let mut columns: Vec<Column> = Vec::new();
        columns.extend(waves(on, of, 2.0, |_| 1.0).map(|v| main(v, USUAL_ARCSEC)));
        columns.extend(waves(on, of, 2.0, |k| on.base.flank[k]).map(|v| nuisance(v, 0.4)));
        if on.scales.load > 0.0 {
            columns.extend(waves(on, of, 2.0, |k| on.rows.torque[k].abs() / on.scales.load).map(|v| nuisance(v, 0.15)));
        }
        columns
    })
    .parameters(|on, _, c| {
        let (amplitude, phase) = polar(c[0], c[1]);
        vec![
            ("amplitude_um", amplitude / (0.67 * on.scales.arcsec_per_um)),
            ("amplitude_arcsec", amplitude),
            ("phase_rad", 0.5 * phase),
        ]
    })
}

/// One lobe carries more than the other, so that odd harmonics of both wheels come through: order 1 of each, fading with load.
fn generator_eccentricity(on: &Excitation<'_>) -> Law {
    let loaded = on.scales.load > 0.0;
    Law::new("generator_eccentricity", |on, shape| {
        let half = shape.first().copied().unwrap_or(f64::INFINITY);
        let fade = |k: usize| fading(on, half, k);
        let mut columns: Vec<Column> = Vec::new();
        for of in [Angle::Flexspline, Angle::CircularSpline] {
            columns.extend(waves(on, of, 1.0, fade).map(|v| main(v, USUAL_ARCSEC)));
            columns.extend(waves(on, of, 1.0, |k| fade(k) * on.base.flank[k]).map(|v| nuisance(v, 0.4)));
            columns.extend(waves(on, of, 3.0, fade).map(|v| nuisance(v, 0.2)));
            if half.is_finite() {
                columns.extend(waves(on, of, 1.0, |_| 1.0).map(|v| nuisance(v, 0.2)));
            }
        }
        columns
    })
    .shapes(loaded.then(|| half_load(on)))
    .parameters(|on, shape, c| {
        let per_wheel = if shape.is_empty() { 6 } else { 8 };
        let (on_flexspline, phase) = polar(c[0], c[1]);
        let on_ring = polar(c[per_wheel], c[per_wheel + 1]).0;
        let strongest = on_flexspline.max(on_ring);
        let mut named: Vec<Named> = vec![
            ("amplitude_um", strongest / on.scales.arcsec_per_um),
            ("amplitude_arcsec", strongest),
            ("phase_rad", phase),
        ];
        if let Some(half) = shape.first() {
            named.push(("half_load_n_m", *half));
        }
        named
    })
}

/// Form error of the generator: a constant shape repeats from tooth to tooth, so its own order is the tooth mesh (z per turn), with a
/// change of the clearance; with unequal lobes even orders of the generator angle beyond the second come along.
fn cam_form_error() -> Law {
    Law::new("cam_form_error", |on, _| {
        let teeth = on.nominal.teeth.map_or(188.0, |t| f64::from(t.flexspline));
        let of = Angle::Flexspline;
        let flank = |k: usize| on.base.flank[k];
        let mut columns: Vec<Column> = Vec::new();
        columns.extend(waves(on, of, teeth, |_| 1.0).map(|v| main(v, 8.0)));
        columns.extend(waves(on, of, teeth, flank).map(|v| main(v, 8.0)));
        columns.extend(waves(on, of, 4.0, |_| 1.0).map(|v| main(v, 8.0)));
        columns.extend(waves(on, of, 6.0, |_| 1.0).map(|v| main(v, 8.0)));
        columns.extend(waves(on, of, 2.0, |_| 1.0).map(|v| nuisance(v, 0.5)));
        columns.extend(waves(on, of, 4.0, flank).map(|v| nuisance(v, 0.5)));
        columns.extend(waves(on, of, 8.0, |_| 1.0).map(|v| nuisance(v, 0.4)));
        columns.extend(waves(on, of, 2.0 * teeth, flank).map(|v| nuisance(v, 0.4)));
        columns.push(nuisance(by_row(on, flank), 1.0));
        if on.scales.load > 0.0 {
            for order in [4.0, 6.0, teeth] {
                columns.extend(
                    waves(on, of, order, |k| on.rows.torque[k].abs() / on.scales.load).map(|v| nuisance(v, 0.4)),
                );
            }
        }
        columns
    })
    .parameters(|on, _, c| {
        let mesh = polar(c[0], c[1]).0.hypot(polar(c[2], c[3]).0);
        let (fourth, sixth) = (polar(c[4], c[5]).0, polar(c[6], c[7]).0);
        vec![
            ("amplitude_um", mesh.max(fourth).max(sixth) / on.scales.arcsec_per_um),
            ("mesh_ripple_arcsec", mesh),
            ("fourth_order_arcsec", fourth),
            ("sixth_order_arcsec", sixth),
        ]
    })
}

/// A tooth that lacks material: a pulse each time a lobe of the wave passes it, twice per turn, on the flank that carries, under load.
fn damaged_tooth(of: Angle) -> Law {
    Law::new("damaged_tooth", move |on, shape| {
        let (place, width) = (shape[0], shape[1]);
        let period = PI;
        let pulse: Vec<f64> = by_row(on, |k| {
            let away = (angle(on, of, k) - place + 0.5 * period).rem_euclid(period) - 0.5 * period;
            (-0.5 * (away / width).powi(2)).exp()
        });
        // The two lobes meet the tooth half a turn apart and may share the load unequally.
        let lobe = |k: usize| (angle(on, of, k) - place).cos().signum();
        let flank = |k: usize| on.base.flank[k];
        let load = if on.scales.load > 0.0 { on.scales.load } else { 1.0 };
        vec![
            main(by_row(on, |k| pulse[k] * flank(k)), 30.0),
            main(by_row(on, |k| pulse[k] * on.rows.torque[k] / load), 30.0),
            main(pulse.clone(), 20.0),
            main(by_row(on, |k| pulse[k] * (on.rows.torque[k] / load).abs()), 20.0),
            nuisance(by_row(on, |k| pulse[k] * flank(k) * lobe(k)), 1.0),
            nuisance(by_row(on, |k| pulse[k] * on.rows.torque[k] / load * lobe(k)), 1.0),
            nuisance(by_row(on, |k| pulse[k] * lobe(k)), 1.0),
        ]
    })
    .shapes([Shape::angle("angle_rad", PI, 30), Shape::by_factors("width_rad", 0.03, 0.4, 2)])
    .parameters(move |on, shape, c| {
        let teeth =
            on.nominal.teeth.map_or((188.0, 190.0), |t| (f64::from(t.flexspline), f64::from(t.circular_spline)));
        let count = if of == Angle::Flexspline { teeth.0 } else { teeth.1 };
        let depth = c[0].hypot(c[1]).hypot(c[2]).hypot(c[3]);
        vec![
            ("depth_um", depth / on.scales.arcsec_per_um),
            ("amplitude_arcsec", depth),
            ("angle_rad", shape[0]),
            ("width_rad", shape[1]),
            ("tooth", (shape[0] / (2.0 * PI) * count).round()),
            ("wheel", f64::from(u8::from(of == Angle::CircularSpline))),
        ]
    })
}

pub(super) fn laws(on: &Excitation<'_>) -> Vec<Law> {
    let mut laws = vec![
        rectified("circular_spline_eccentricity", Angle::CircularSpline, on),
        rectified("flexspline_runout", Angle::Flexspline, on),
        rectified("gravity_side_load", Angle::Gravity(1.0), on),
        ovality(),
        pitch("flexspline_pitch_error", Angle::Flexspline),
        pitch("circular_spline_pitch_error", Angle::CircularSpline),
        generator_eccentricity(on),
        cam_form_error(),
        damaged_tooth(Angle::Flexspline),
        damaged_tooth(Angle::CircularSpline),
    ];
    if on.rows.orientation.iter().any(|o| (o - on.rows.orientation[0]).abs() > 1e-3) {
        laws.push(rectified("gravity_side_load", Angle::Gravity(-1.0), on));
    }
    laws
}
