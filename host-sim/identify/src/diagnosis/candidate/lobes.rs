//! An eccentric generator: one lobe of the wave lies deeper in mesh than the other.
//!
//! The deeper lobe stops the output on either flank, by as much as it is deeper, and with it go the teeth that are out
//! of place in it: odd harmonics of both wheels, which equal lobes cancel, come through, order 1 of each above all. A
//! load presses the deeper lobe in until the other one carries as well: from there on both share, and the odd harmonics
//! vanish.

use super::displaced::{PRESSED_ARCSEC, ZONES_MISFIT, stopped};
use super::geometry::{Angle, OF_WHEELS, USUAL_ARCSEC, crest_at, kept, waves, weighted_waves};
use super::{
    Excitation, Law, Regressor, Shape, Shaped, Simulated, Tag, Values, beside, by_row, directed, main, main_about,
    nuisance, of_wave, times,
};
use crate::causes::ParameterName as Name;
use crate::causes::spec::{ARCSECONDS, CauseName, CauseSpec, Factor, HALF_LOAD, Usual::Value, microns, number, phase};

/// Plausible differences between the lobes, arcsec at the output. *Guess*: from what noise hides to more than a usual
/// clearance.
const DEEPER_ARCSEC: [f64; 2] = [2.0, 200.0];
/// Errors of the teeth over the difference of the lobes, at most. Well above one, the other lobe is the deeper one for
/// part of a turn, which the model does not have. *Chosen* on plants in which the teeth are out by 1.43 times that
/// difference; at 2, waves of a wheel passed for a lobe.
const MOST_TEETH: f64 = 1.5;
/// Where the full load leaves less than this share of the teeth's errors, a lobe that is pressed in has been
/// seen. *Guess*.
const LEFT_BY_LOAD: f64 = 0.5;
/// The clearance that the deeper lobe takes, under a load and without one.
const TAKEN: Tag = Tag("clearance taken");
const TAKEN_UNLOADED: Tag = Tag("clearance taken without a load");
/// First orders of the teeth that the deeper lobe shows.
const TEETH: [(Angle, Tag); 2] = [
    (Angle::Flexspline, Tag("first order of the flexspline")),
    (Angle::CircularSpline, Tag("first order of the circular spline")),
];

/// A deeper lobe under load, row by row.
struct Lobe {
    /// How far it still stops the output, arcsec.
    stops: Vec<f64>,
    /// Share of its teeth's errors that still shows.
    shows: Vec<f64>,
}

impl Lobe {
    fn new(on: &Excitation<'_>, shape: Shaped<'_>) -> Lobe {
        let (deeper, per_n_m) = match (shape.get(Name::DeeperArcsec), shape.get(Name::PressedArcsec)) {
            (Some(deeper), Some(pressed)) => (deeper, pressed / on.scales.load),
            _ => (0.0, 0.0),
        };
        let pressed = |k: usize| per_n_m * on.rows.torque[k].abs();
        Lobe {
            stops: by_row(on, |k| stopped(deeper, pressed(k)) - stopped(0.0, pressed(k))),
            shows: by_row(on, |k| still_shows(deeper, pressed(k))),
        }
    }
}

/// Share of the teeth's errors that still shows where a lobe this much deeper is pressed in by so much.
fn still_shows(deeper: f64, pressed: f64) -> f64 {
    let step = 1e-3 * deeper.max(1.0);
    (stopped(deeper + step, pressed) - stopped(deeper, pressed)) / step
}

/// The law.
fn generator_eccentricity(on: &Excitation<'_>) -> Law {
    let loaded = on.scales.load > 0.0;
    let mut law = Law::new(CauseName::GeneratorEccentricity, move |on, shape| {
        let lobe = Lobe::new(on, shape);
        let (flank, shows) = (&on.base.flank, &lobe.shows);
        let shows_by_flank = times(shows, flank);
        let mut columns: Vec<Regressor> = Vec::new();
        for (of, role) in TEETH {
            columns.extend(weighted_waves(on, of, 1.0, shows).map(|v| main(v, USUAL_ARCSEC).called(role)));
        }
        if loaded {
            // No more than the clearance.
            let taken = by_row(on, |k| -flank[k] * lobe.stops[k].min(on.base.half_backlash));
            columns.push(main_about(1.0, taken, 0.15).called(TAKEN));
        }
        for of in [Angle::Flexspline, Angle::CircularSpline] {
            columns.extend(weighted_waves(on, of, 1.0, &shows_by_flank).map(|v| nuisance(v, 0.12)));
            columns.extend(weighted_waves(on, of, 2.0, shows).map(|v| nuisance(v, 0.05)));
            columns.extend(weighted_waves(on, of, 3.0, shows).map(|v| nuisance(v, 0.1)));
            if loaded {
                columns.extend(waves(on, of, 1.0).map(|v| nuisance(v, 0.03)));
            }
        }
        columns.push(if loaded {
            nuisance(flank.clone(), 0.05)
        } else {
            beside(flank.clone(), 2.0).called(TAKEN_UNLOADED)
        });
        columns
    })
    .shapes(if loaded {
        vec![
            Shape::by_factors(Name::DeeperArcsec, DEEPER_ARCSEC[0], DEEPER_ARCSEC[1], 3),
            Shape::by_factors(Name::PressedArcsec, PRESSED_ARCSEC[0], PRESSED_ARCSEC[1], 2),
        ]
    } else {
        Vec::new()
    })
    .parameters_by(|on, shape, c| {
        let [(on_flexspline, phase), (on_ring, _)] = TEETH.map(|(_, role)| of_wave(c, role));
        let strongest = on_flexspline.max(on_ring);
        let mut named = directed(strongest / on.scales.arcsec_per_um, strongest, phase);
        let deeper = [Name::DeeperArcsec, Name::PressedArcsec];
        named.extend(deeper.into_iter().filter_map(|name| Some((name, shape.get(name)?))));
        named
    })
    .physical_if(|shape, c| {
        // Teeth farther out than the lobe is deep would make the other lobe the deeper one, once a turn.
        let [on_flexspline, on_ring] = TEETH.map(|(_, role)| of_wave(c, role).0);
        let (Some(deeper), Some(pressed)) = (shape.get(Name::DeeperArcsec), shape.get(Name::PressedArcsec)) else {
            return true;
        };
        let taken = c.of(TAKEN);
        // A lobe that the load presses in shows itself by that, however little of the clearance it takes.
        let lobe = if taken > 0.0 && still_shows(deeper, pressed) < LEFT_BY_LOAD { deeper } else { deeper * taken };
        on_flexspline + on_ring < MOST_TEETH * lobe
    })
    .parts_zones(|on, shape, c| {
        let waves = TEETH.map(|(of, role)| (kept(on, of, 1.0), c.wave(role)));
        let teeth = by_row(on, |k| waves.iter().map(|(wave, c)| c[0] * wave[0][k] + c[1] * wave[1][k]).sum::<f64>());
        let deeper = shape.get(Name::DeeperArcsec).map_or_else(|| -c.of(TAKEN_UNLOADED), |deeper| deeper * c.of(TAKEN));
        [-deeper, deeper].map(|by| teeth.iter().map(|teeth| teeth + by).collect())
    });
    law.wrong.misfit = ZONES_MISFIT;
    law
}

/// An eccentric generator of known size; the ring's first order is a part of the flexspline's, at twice its phase.
fn simulated_generator_eccentricity(on: &Excitation<'_>, p: Values<'_>) -> Simulated {
    let (amplitude, phase, deeper) = (p(Name::AmplitudeArcsec), p(Name::PhaseRad), p(Name::DeeperArcsec));
    let waves = [crest_at(amplitude, phase), crest_at(RING_OF_FLEXSPLINE * amplitude, 2.0 * phase)];
    let teeth = TEETH.iter().zip(waves).flat_map(|((_, role), wave)| wave.map(|c| (*role, c)));
    // Where a lobe is pressed in by what it is deeper, half of it shows.
    let pressed = deeper * on.scales.load / p(Name::HalfLoadNM);
    generator_eccentricity(on).with(p, &[(Name::PressedArcsec, pressed)], teeth.chain([(TAKEN_UNLOADED, -deeper)]))
}

/// First order of the circular spline over that of the flexspline in simulated data. *Guess*.
const RING_OF_FLEXSPLINE: f64 = 0.7;

/// The generator is off its axis.
pub(crate) const GENERATOR_ECCENTRICITY: CauseSpec = CauseSpec {
    name: "generator_eccentricity",
    words: "eccentricity of the generator",
    does: "one lobe carries more: odd orders, once in a turn above all",
    parameters: &[
        microns("once around each wheel: what the deeper lobe shows of the teeth", 2.0),
        ARCSECONDS,
        phase("whereto, on the generator"),
        number(
            Name::DeeperArcsec,
            "how much deeper one lobe is: what it takes of the clearance at either flank",
            0.0,
            1000.0,
            Value(20.0),
        ),
        HALF_LOAD,
    ],
    twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongPitch)],
    laws: |on| vec![generator_eccentricity(on)],
    simulated: simulated_generator_eccentricity,
    ..OF_WHEELS
};
