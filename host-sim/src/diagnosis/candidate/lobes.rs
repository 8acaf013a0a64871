//! An eccentric generator: one lobe of the wave lies deeper in mesh than the other.
//!
//! The deeper lobe stops the output on either flank, by as much as it is deeper, and with it go the teeth that are out of place in it: odd
//! harmonics of both wheels, which equal lobes cancel, come through, order 1 of each above all. A load presses the deeper lobe in until the
//! other one carries as well: from there on both share, and the odd harmonics vanish.

use super::displaced::{PRESSED_ARCSEC, ZONES_MISFIT, stopped};
use super::geometry::{Angle, USUAL_ARCSEC, kept, waves};
use super::{Column, Excitation, Law, Named, Shape, Tolerance, Zones, beside, by_row, main, nuisance, polar};
use crate::causes::{CauseName, ParameterName as Name};
use crate::diagnosis::linear::Prior;

/// Plausible differences between the lobes, arcsec at the output.
const DEEPER_ARCSEC: [f64; 2] = [2.0, 200.0];
/// Errors of the teeth over the difference of the lobes, at most.
const MOST_TEETH: f64 = 1.3;
/// Where the column of what the deeper lobe takes of the clearance stands.
const TAKEN: usize = 4;

/// What a load does to a lobe that is this much deeper, row by row.
struct Lobe {
    /// How far it still stops the output, arcsec.
    stops: Vec<f64>,
    /// Share of its teeth's errors that still shows.
    shows: Vec<f64>,
}

impl Lobe {
    fn new(on: &Excitation<'_>, shape: &[f64]) -> Lobe {
        let (deeper, per_n_m) = match shape {
            [deeper, pressed] => (*deeper, pressed / on.scales.load),
            _ => (0.0, 0.0),
        };
        let pressed = |k: usize| per_n_m * on.rows.torque[k].abs();
        // A small step deeper.
        let step = 1e-3 * deeper.max(1.0);
        Lobe {
            stops: by_row(on, |k| stopped(deeper, pressed(k)) - stopped(0.0, pressed(k))),
            shows: by_row(on, |k| (stopped(deeper + step, pressed(k)) - stopped(deeper, pressed(k))) / step),
        }
    }
}

/// The law.
pub(super) fn generator_eccentricity(on: &Excitation<'_>) -> Law {
    let loaded = on.scales.load > 0.0;
    let mut law = Law::new(CauseName::GeneratorEccentricity, move |on, shape| {
        let lobe = Lobe::new(on, shape);
        let flank = |k: usize| on.base.flank[k];
        let shows = |k: usize| lobe.shows[k];
        let mut columns: Vec<Column> = Vec::new();
        for of in [Angle::Flexspline, Angle::CircularSpline] {
            columns.extend(waves(on, of, 1.0, shows).map(|v| main(v, USUAL_ARCSEC)));
        }
        if loaded {
            // No more than the clearance.
            let taken = by_row(on, |k| -flank(k) * lobe.stops[k].min(on.base.half_backlash));
            columns.push(Column { values: taken, tolerance: Tolerance::Main(Prior { mean: 1.0, std: 0.15 }) });
        }
        for of in [Angle::Flexspline, Angle::CircularSpline] {
            columns.extend(waves(on, of, 1.0, |k| shows(k) * flank(k)).map(|v| nuisance(v, 0.12)));
            columns.extend(waves(on, of, 2.0, shows).map(|v| nuisance(v, 0.05)));
            columns.extend(waves(on, of, 3.0, shows).map(|v| nuisance(v, 0.1)));
            if loaded {
                columns.extend(waves(on, of, 1.0, |_| 1.0).map(|v| nuisance(v, 0.03)));
            }
        }
        columns.push(if loaded { nuisance(by_row(on, flank), 0.05) } else { beside(by_row(on, flank), 2.0) });
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
    .parameters(|on, shape, c| {
        let (on_flexspline, phase) = polar(c[0], c[1]);
        let on_ring = polar(c[2], c[3]).0;
        let strongest = on_flexspline.max(on_ring);
        let mut named: Vec<Named> = vec![
            (Name::AmplitudeUm, strongest / on.scales.arcsec_per_um),
            (Name::AmplitudeArcsec, strongest),
            (Name::PhaseRad, phase),
        ];
        if let [deeper, pressed] = shape {
            named.extend([(Name::DeeperArcsec, *deeper), (Name::PressedArcsec, *pressed)]);
        }
        named
    });
    law.misfit = ZONES_MISFIT;
    law.physical = Box::new(|shape, c| {
        // Teeth farther out than the lobe is deep would make the other lobe the deeper one, once a turn.
        let teeth = polar(c[0], c[1]).0 + polar(c[2], c[3]).0;
        shape.first().is_none_or(|deeper| teeth < MOST_TEETH * deeper * c.get(TAKEN).copied().unwrap_or(1.0))
    });
    law.zones = Some(Box::new(|on, shape, c| {
        let waves: Vec<_> = [Angle::Flexspline, Angle::CircularSpline].map(|of| kept(on, of, 1.0)).into();
        let teeth =
            by_row(on, |k| (0..2).map(|w| c[2 * w] * waves[w][0][k] + c[2 * w + 1] * waves[w][1][k]).sum::<f64>());
        let deeper = shape.first().map_or_else(|| -c.last().unwrap_or(&0.0), |deeper| deeper * c[TAKEN]);
        Zones { upper: by_row(on, |k| teeth[k] - deeper), lower: by_row(on, |k| teeth[k] + deeper) }
    }));
    law
}
