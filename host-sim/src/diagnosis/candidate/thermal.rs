//! What the temperature does.

use super::{Column, Excitation, Law, Lead, Named, Shape, Tolerance, by_row, lagged_through, main, nuisance};
use crate::causes::{CauseName, ParameterName as Name};
use crate::diagnosis::linear::Prior;

/// Temperature above nominal, felt with a lag of `lag_s`, K. Metal does not know when it is recorded: what was felt when a session ended
/// nears the temperature at which the next one begins.
fn warmer_by(on: &Excitation<'_>, lag_s: f64) -> Vec<f64> {
    let felt = lagged_through(on, &on.rows.temperature, lag_s);
    by_row(on, |k| felt[k] - on.nominal.temperature_c)
}

/// Warm parts close the clearance, cold ones open it (or the reverse): −2″/K of generator and flexspline against the circular spline.
fn thermal_clearance(on: &Excitation<'_>) -> Law {
    Law::new(CauseName::ThermalClearance, |on, shape| {
        let warmer = warmer_by(on, shape.first().copied().unwrap_or(1e-3));
        let flank = |k: usize| on.base.flank[k];
        vec![
            main(by_row(on, |k| flank(k) * warmer[k]), 1.0),
            nuisance(by_row(on, |k| flank(k) * warmer[k] * warmer[k].abs() / 30.0), 0.3),
            nuisance(by_row(on, |k| flank(k) * warmer[k] * warmer[k] / 30.0), 0.3),
        ]
    })
    .shapes(on.rows.recorded.time.then(|| Shape::by_factors(Name::LagS, 0.5, 600.0, 3)))
    .parameters(|_, shape, c| {
        let mut named = vec![(Name::ClearanceArcsecPerK, 2.0 * c[0])];
        if let Some(lag) = shape.first() {
            named.push((Name::LagS, *lag));
        }
        named
    })
    .well_known()
}

/// The same where it goes so far that the clearance is shut in the cold or in the heat: it cannot be less than nothing.
fn thermal_clearance_shut(on: &Excitation<'_>) -> Law {
    let timed = on.rows.recorded.time;
    Law::new(CauseName::ThermalClearance, move |on, shape| {
        let warmer = warmer_by(on, if timed { shape[1] } else { 1e-3 });
        let width = 2.0 * on.base.half_backlash;
        let changed = by_row(on, |k| 0.5 * on.base.flank[k] * ((width + shape[0] * warmer[k]).max(0.0) - width));
        vec![
            Column { values: changed, tolerance: Tolerance::Main(Prior { mean: 1.0, std: 0.1 }) },
            nuisance(by_row(on, |k| on.base.flank[k] * warmer[k]), 0.15),
        ]
    })
    .shapes(
        [Shape::evenly(Name::ClearanceArcsecPerK, -SHUT_ARCSEC_PER_K, SHUT_ARCSEC_PER_K, 8)]
            .into_iter()
            .chain(timed.then(|| Shape::by_factors(Name::LagS, 0.5, 600.0, 2))),
    )
    .parameters(move |_, shape, c| {
        let mut named = vec![(Name::ClearanceArcsecPerK, shape[0] * c[0])];
        if timed {
            named.push((Name::LagS, shape[1]));
        }
        named
    })
    .physical(|_, c| c[0] > 0.5)
    .well_known()
}

/// Largest change of the clearance with temperature, arcsec/K: twice that of a hot generator in a cold ring (2″/K).
const SHUT_ARCSEC_PER_K: f64 = 4.5;

/// Wind-up that grows or falls with temperature.
fn thermal_stiffness() -> Law {
    Law::new(CauseName::ThermalStiffness, |on, _| {
        let warmer = |k: usize| on.rows.temperature[k] - on.nominal.temperature_c;
        vec![
            main(by_row(on, |k| on.base.wind_up[k] * warmer(k) / 100.0), 0.5),
            nuisance(by_row(on, |k| on.base.wind_up[k] * warmer(k).powi(2) / 3000.0), 0.4),
        ]
    })
    .parameters(|_, _, c| vec![(Name::StiffnessRelativePerK, -0.01 * c[0])])
    .well_known()
}

/// Whether a drag is one of a lubricant: at the edge of the range it is dry friction or lash, which knows neither speed nor cold.
fn viscous(power: f64, per_k: f64) -> bool {
    power > 0.27 && per_k > 0.009
}

/// Speed at which a drag is stated, rad/s.
fn usual_speed(on: &Excitation<'_>) -> f64 {
    on.scales.mean_speed.max(1e-9)
}

/// Slope of the wind-up at no load, arcsec/N·m; 1 for a drive that does not give.
fn wind_up_arcsec_per_n_m(on: &Excitation<'_>) -> f64 {
    on.slope_at_rest().map_or(1.0, |slope| on.softer * slope)
}

/// How much thicker a lubricant is that is `cold` K below the nominal temperature. Vogel's `ln ν = B / (T + C)` written by its slope
/// there, `per_k`, and `bend` = 1 / (nominal temperature + C): 0 is an exponential, 1/293 K Andrade's law at 20 °C, 1/115 K Vogel's.
fn thicker(cold: f64, per_k: f64, bend: f64) -> f64 {
    (per_k * cold / (1.0 - bend * cold).max(LEAST_ABOVE_SETTING)).exp()
}

/// Vogel's law holds down to where a lubricant sets: not closer to it than this share of the way from the nominal temperature.
const LEAST_ABOVE_SETTING: f64 = 0.2;
/// Largest [`thicker`] bend, 1/K.
const MOST_BEND: f64 = 0.01;

/// Share of a drag of 1 at the mean speed and the nominal temperature, against the motion.
fn drag(on: &Excitation<'_>, power: f64, per_k: f64, bend: f64) -> Vec<f64> {
    let (rows, usual) = (on.rows, usual_speed(on));
    by_row(on, |k| {
        let share = (rows.speed[k] / usual).abs().powf(power);
        let thicker = thicker(on.nominal.temperature_c - rows.temperature[k], per_k, bend);
        -rows.direction[k] * on.nominal.ratio.signum() * share * thicker
    })
}

/// A drag by name: its size, and its power, slope and bend.
fn named_drag(drag_n_m: f64, shape: &[f64]) -> Vec<Named> {
    vec![
        (Name::DragNM, drag_n_m),
        (Name::SpeedExponent, shape[0]),
        (Name::RelativeDragPerK, -shape[1]),
        (Name::DragBendPerK, shape[2]),
    ]
}

/// Arcsec for 1 N·m of drag at the mean speed and the nominal temperature.
fn drag_wind_up(on: &Excitation<'_>, power: f64, per_k: f64, bend: f64) -> Vec<f64> {
    let slope = wind_up_arcsec_per_n_m(on);
    drag(on, power, per_k, bend).into_iter().map(|share| share * slope).collect()
}

/// Drag of the lubricant, against the motion: a power of the speed, and thicker in the cold (Vogel, close to exponential).
fn lubricant_viscosity() -> Law {
    Law::new(CauseName::LubricantViscosity, |on, shape| {
        let (power, per_k, bend) = (shape[0], shape[1], shape[2]);
        let drag = |power: f64, per_k: f64, bend: f64| drag_wind_up(on, power, per_k, bend);
        let size = super::super::rows::rms(&drag(power, per_k, bend)).max(1e-12);
        vec![
            main(drag(power, per_k, bend), 15.0 / size),
            nuisance(drag(0.5 * power, per_k, bend), 0.15),
            nuisance(drag(power, 0.5 * per_k, bend), 0.15),
        ]
    })
    .shapes([
        Shape::evenly(Name::SpeedExponent, 0.25, 1.05, 3),
        Shape::by_factors(Name::PerK, 0.008, 0.12, 4),
        Shape::evenly(Name::BendPerK, 0.0, MOST_BEND, 1),
    ])
    .parameters(|_, shape, c| named_drag(c[0], &shape[..3]))
    .physical(|shape, c| c[0] > 0.0 && viscous(shape[0], shape[1]))
}

/// The same drag as a load: it winds the drive up and, where it exceeds the torque, moves the play to the other flank.
fn lubricant_load(on: &Excitation<'_>) -> Law {
    let scale = on.plausible_load();
    let load = |on: &Excitation<'_>, shape: &[f64]| -> Vec<f64> {
        drag(on, shape[1], shape[2], shape[3]).into_iter().map(|share| shape[0] * share).collect()
    };
    let mut law = Law::new(CauseName::LubricantViscosity, move |on, shape| {
        let rows = on.rows;
        let added = load(on, shape);
        let torque: Vec<f64> = (0..rows.len()).map(|k| rows.torque[k] + added[k]).collect();
        let flank = on.base.law.flanks(rows, &torque, on.nominal);
        let play = by_row(on, |k| on.base.half_backlash * (flank[k] - on.base.flank[k]));
        let together = by_row(on, |k| on.wound_up(k, torque[k]) + play[k]);
        vec![
            Column { values: together, tolerance: Tolerance::Main(Prior { mean: 1.0, std: 0.02 }) },
            Column { values: play, tolerance: Tolerance::Main(Prior { mean: 0.0, std: 0.5 }) },
        ]
    })
    .shapes([
        Shape::by_factors(Name::DragNM, 0.001 * scale, 1.0 * scale, 1),
        Shape::evenly(Name::SpeedExponent, 0.25, 1.05, 2),
        Shape::by_factors(Name::PerK, 0.008, 0.12, 3),
        Shape::evenly(Name::BendPerK, 0.0, MOST_BEND, 1),
    ])
    .parameters(|_, shape, c| named_drag(shape[0] * c[0], &shape[1..]))
    .physical(|shape, c| c[0] > 0.0 && viscous(shape[1], shape[2]));
    law.load = Some(Box::new(load));
    law.in_crossings = true;
    law.lead = Some(Lead {
        columns: Box::new(|on, shape| vec![main(drag_wind_up(on, shape[1], shape[2], shape[3]), 10.0)]),
        shape: Box::new(|shape, c| vec![vec![c[0].max(0.0), shape[1], shape[2], shape[3]]]),
        loaded_only: true,
    });
    law
}

pub(super) fn laws(on: &Excitation<'_>) -> Vec<Law> {
    let rows = on.rows;
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for t in &rows.temperature {
        (low, high) = (low.min(*t), high.max(*t));
    }
    let mut laws = Vec::new();
    // At one temperature nothing thermal can be told from a changed constant.
    if rows.recorded.temperature && (high - low > 2.0 || (low - on.nominal.temperature_c).abs() > 5.0) {
        laws.push(thermal_clearance(on));
        if on.base.half_backlash > 0.0 {
            laws.push(thermal_clearance_shut(on));
        }
        if on.scales.load > 0.0 {
            laws.push(thermal_stiffness());
        }
    }
    if rows.recorded.time && rows.speed.iter().any(|w| *w != 0.0) {
        laws.push(lubricant_viscosity());
        if on.scales.load > 0.0 && on.nominal.wind_up_arcsec(1.0) > 0.0 {
            laws.push(lubricant_load(on));
        }
    }
    laws
}
