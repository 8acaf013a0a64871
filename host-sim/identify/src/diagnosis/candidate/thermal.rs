//! Causes that follow the temperature.

use super::dynamic::columns_of_load;
use super::{Excitation, Law, Named, Shape, Shaped, Tag, by_row, main, main_about, nuisance};
use crate::causes::ParameterName as Name;
use crate::causes::spec::{
    CauseName, CauseSpec, InTable, Kin, Need,
    Usual::{OfLoad, Value},
    number, plain,
};

/// Temperature above nominal, felt with a lag of `lag_s`, K. Metal does not know when it is recorded: what was felt
/// when a session ended nears the temperature at which the next one begins.
fn warmer_by(on: &Excitation<'_>, lag_s: f64) -> Vec<f64> {
    let felt = on.rows.lagged(&on.rows.temperature, lag_s, true);
    by_row(on, |k| felt[k] - on.nominal.temperature_c)
}

/// Warm parts close the clearance, cold ones open it (or the reverse): −2″/K of generator and flexspline against the
/// circular spline.
fn thermal_clearance(on: &Excitation<'_>) -> Law {
    Law::new(CauseName::ThermalClearance, |on, shape| {
        let warmer = warmer_by(on, lag_of(shape));
        let flank = |k: usize| on.base.flank[k];
        vec![
            main(by_row(on, |k| flank(k) * warmer[k]), 1.0).called(Tag::SIZE),
            nuisance(by_row(on, |k| flank(k) * warmer[k] * warmer[k].abs() / 30.0), 0.3),
            nuisance(by_row(on, |k| flank(k) * warmer[k] * warmer[k] / 30.0), 0.3),
        ]
    })
    .shapes(on.rows.recorded.time.then(|| Shape::by_factors(Name::LagS, 0.5, 600.0, 3)))
    .parameters_by(|_, shape, c| named_clearance(2.0 * c.of(Tag::SIZE), shape))
    .well_known()
}

/// Lag with which the clearance follows the sensor, s; next to nothing where no time was recorded.
fn lag_of(shape: Shaped<'_>) -> f64 {
    shape.get(Name::LagS).unwrap_or(LEAST_LAG_S)
}

/// As good as no lag, s: below the step between rows of any log here. *Guess*.
const LEAST_LAG_S: f64 = 1e-3;

/// A clearance by name: its change, and its lag where there is a time.
fn named_clearance(arcsec_per_k: f64, shape: Shaped<'_>) -> Vec<Named> {
    let lag = shape.get(Name::LagS).map(|lag| (Name::LagS, lag));
    [(Name::ClearanceArcsecPerK, arcsec_per_k)].into_iter().chain(lag).collect()
}

/// The clearance where it changes so far that the clearance is shut in the cold or in the heat: it cannot be less than
/// nothing.
fn thermal_clearance_shut(on: &Excitation<'_>) -> Law {
    Law::new(CauseName::ThermalClearance, |on, shape| {
        let (warmer, per_k) = (warmer_by(on, lag_of(shape)), shape.of(Name::ClearanceArcsecPerK));
        let width = 2.0 * on.base.half_backlash;
        let changed = by_row(on, |k| 0.5 * on.base.flank[k] * ((width + per_k * warmer[k]).max(0.0) - width));
        vec![
            main_about(1.0, changed, 0.1).called(Tag::SIZE),
            nuisance(by_row(on, |k| on.base.flank[k] * warmer[k]), 0.15),
        ]
    })
    .shapes(
        [Shape::evenly(Name::ClearanceArcsecPerK, -SHUT_ARCSEC_PER_K, SHUT_ARCSEC_PER_K, 8)]
            .into_iter()
            .chain(on.rows.recorded.time.then(|| Shape::by_factors(Name::LagS, 0.5, 600.0, 2))),
    )
    .parameters_by(|_, shape, c| named_clearance(shape.of(Name::ClearanceArcsecPerK) * c.of(Tag::SIZE), shape))
    .physical_if(|_, c| c.of(Tag::SIZE) > 0.5)
    .well_known()
}

/// Largest change of the clearance with temperature, arcsec/K: twice that of a hot generator in a cold ring (2″/K).
const SHUT_ARCSEC_PER_K: f64 = 4.5;

/// Wind-up that grows or falls with temperature.
fn thermal_stiffness() -> Law {
    Law::new(CauseName::ThermalStiffness, |on, _| {
        let warmer = |k: usize| on.rows.temperature[k] - on.nominal.temperature_c;
        vec![
            main(by_row(on, |k| on.base.wind_up[k] * warmer(k) / 100.0), 0.5).called(Tag::SIZE),
            nuisance(by_row(on, |k| on.base.wind_up[k] * warmer(k).powi(2) / 3000.0), 0.4),
        ]
    })
    .parameters_by(|_, _, c| vec![(Name::StiffnessRelativePerK, -0.01 * c.of(Tag::SIZE))])
    .well_known()
}

/// How a drag depends on speed and temperature.
#[derive(Clone, Copy)]
struct Drag {
    /// Power of the speed.
    power: f64,
    /// How much thicker the lubricant gets, of itself, for 1 K colder.
    per_k: f64,
    /// How much that slope bends, see [`thicker`].
    bend: f64,
}

impl Drag {
    fn of(shape: Shaped<'_>) -> Drag {
        Drag { power: shape.of(Name::SpeedExponent), per_k: shape.of(Name::PerK), bend: shape.of(Name::BendPerK) }
    }

    /// Whether it is one of a lubricant: at the edge of the range it is dry friction or lash, which knows neither speed
    /// nor cold.
    fn is_viscous(self) -> bool {
        self.power > 0.27 && self.per_k > 0.009
    }

    /// Share of a drag of 1 at the mean speed and the nominal temperature, against the motion.
    fn share(self, on: &Excitation<'_>) -> Vec<f64> {
        let (rows, usual) = (on.rows, on.scales.mean_speed.max(1e-9));
        by_row(on, |k| {
            let share = (rows.speed[k] / usual).abs().powf(self.power);
            let thicker = thicker(on.nominal.temperature_c - rows.temperature[k], self.per_k, self.bend);
            -rows.speed[k].signum() * on.nominal.ratio.signum() * share * thicker
        })
    }

    /// It by name, of this size.
    fn named(self, drag_n_m: f64) -> Vec<Named> {
        vec![
            (Name::DragNM, drag_n_m),
            (Name::SpeedExponent, self.power),
            (Name::RelativeDragPerK, -self.per_k),
            (Name::DragBendPerK, self.bend),
        ]
    }
}

/// How much thicker a lubricant is that is `cold` K below the nominal temperature. Vogel's `ln ν = B / (T + C)` written
/// by its slope there, `per_k`, and `bend` = 1 / (nominal temperature + C): 0 is an exponential, 1/293 K Andrade's law
/// at 20 °C, 1/115 K Vogel's.
fn thicker(cold: f64, per_k: f64, bend: f64) -> f64 {
    (per_k * cold / (1.0 - bend * cold).max(LEAST_ABOVE_SETTING)).exp()
}

/// Vogel's law holds down to where a lubricant sets: not closer to it than this share of the way from the nominal
/// temperature.
const LEAST_ABOVE_SETTING: f64 = 0.2;
/// Largest [`thicker`] bend, 1/K.
const MOST_BEND: f64 = 0.01;

/// Drag of the lubricant, against the motion: a power of the speed, and thicker in the cold (Vogel, close to
/// exponential). A load: it winds the drive up and, where it exceeds the torque, moves the play to the other flank.
fn lubricant_viscosity(on: &Excitation<'_>) -> Law {
    let scale = on.plausible_load();
    let load = |on: &Excitation<'_>, shape: Shaped<'_>| -> Vec<f64> {
        let drag_n_m = shape.of(Name::DragNM);
        Drag::of(shape).share(on).into_iter().map(|share| drag_n_m * share).collect()
    };
    Law::new(CauseName::LubricantViscosity, move |on, shape| columns_of_load(on, &load(on, shape), on.base.law))
        .shapes([
            Shape::by_factors(Name::DragNM, 0.001 * scale, 1.0 * scale, 1),
            Shape::evenly(Name::SpeedExponent, 0.25, 1.05, 2),
            Shape::by_factors(Name::PerK, 0.008, 0.12, 3),
            Shape::evenly(Name::BendPerK, 0.0, MOST_BEND, 1),
        ])
        .parameters_by(|_, shape, c| Drag::of(shape).named(shape.of(Name::DragNM) * c.of(Tag::SIZE)))
        .physical_if(|shape, c| c.of(Tag::SIZE) > 0.0 && Drag::of(shape).is_viscous())
        .adds_load(load)
        .led_by(
            |on, shape| {
                // Arcsec for 1 N·m of it at the mean speed and the nominal temperature.
                let slope = on.slope_at_rest().unwrap_or(0.0);
                let wind_up = Drag::of(shape).share(on).into_iter().map(|share| share * slope).collect();
                vec![main(wind_up, 10.0).called(Tag::SIZE)]
            },
            |shape, c| vec![shape.with(&[(Name::DragNM, c.of(Tag::SIZE).max(0.0))])],
        )
        .variant("load")
}

/// The clearance follows the temperature.
pub(crate) const THERMAL_CLEARANCE: CauseSpec = CauseSpec {
    name: "thermal_clearance",
    words: "clearance with temperature",
    does: "backlash that follows the temperature",
    kin: Kin::Clearance,
    needs: &[Need::Temperature, Need::TemperatureSpan],
    place: |placing| placing.set_expansion(),
    parameters: &[
        number(Name::ClearanceArcsecPerK, "whole width, wider when warm", -50.0, 50.0, Value(-1.0)),
        number(Name::LagS, "with which it follows", 0.0, 1e5, Value(0.0)),
    ],
    laws: |on| {
        let shut = (on.base.half_backlash > 0.0).then(|| thermal_clearance_shut(on).variant("shut"));
        std::iter::once(thermal_clearance(on)).chain(shut).collect()
    },
    simulated: |on, p| {
        let lag = (Name::LagS, p(Name::LagS).max(LEAST_LAG_S));
        thermal_clearance(on).with(p, &[lag], [(Tag::SIZE, 0.5 * p(Name::ClearanceArcsecPerK))])
    },
    ..plain()
};

/// The stiffness follows the temperature.
pub(crate) const THERMAL_STIFFNESS: CauseSpec = CauseSpec {
    name: "thermal_stiffness",
    words: "stiffness with temperature",
    does: "wind-up that follows the temperature",
    kin: Kin::Torque,
    needs: &[Need::Temperature, Need::TemperatureSpan, Need::Load],
    place: |placing| placing.set_stiffness_per_k(),
    parameters: &[number(Name::StiffnessRelativePerK, "of the stiffness", -0.02, 0.02, Value(-0.004))],
    laws: |_| vec![thermal_stiffness()],
    simulated: |_, p| thermal_stiffness().with(p, &[], [(Tag::SIZE, -100.0 * p(Name::StiffnessRelativePerK))]),
    ..plain()
};

/// The lubricant drags the output.
pub(crate) const LUBRICANT_VISCOSITY: CauseSpec = CauseSpec {
    name: "lubricant_viscosity",
    words: "drag of the lubricant",
    does: "a load against the motion that grows with speed and cold",
    kin: Kin::Drag,
    needs: &[Need::Time, Need::Motion, Need::Spring],
    in_table: InTable::No("it follows the speed, and a table knows none"),
    made_by_loads: true,
    parameters: &[
        number(Name::DragNM, "at the mean speed and the nominal temperature", 0.0, 1e5, OfLoad(0.1)),
        number(Name::SpeedExponent, "of the speed", 0.2, 1.2, Value(2.0 / 3.0)),
        number(Name::RelativeDragPerK, "of the drag", -0.15, 0.0, Value(-0.035)),
    ],
    laws: |on| vec![lubricant_viscosity(on)],
    simulated: |on, p| lubricant_viscosity(on).with(p, &[(Name::PerK, -p(Name::RelativeDragPerK))], []),
    ..plain()
};
