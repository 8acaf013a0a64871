//! A wheel off the axis of the generator: an eccentric circular spline, a flexspline that runs out of true, an axis
//! that gravity pushes aside.
//!
//! Two zones of engaged teeth lie half a turn apart. A displacement `A = ε / (r cos a)` brings the teeth of one zone
//! forward by `A sin(x ± a)` and those of the other back by as much, other on each flank: the zone that is ahead stops
//! the output, which therefore rests `A |sin(x ± a)|` short of where it would. A load presses that zone in until the
//! other one carries as well, and moves a rim that gives towards the middle. Where the flanks come so far that no
//! clearance is left between them, both bind, and the output stands in the middle, whatever the load.

use std::f64::consts::{FRAC_PI_2, PI};

use super::geometry::{Angle, COS_PRESSURE_ANGLE, USUAL_ARCSEC, faded, half_load, kept, sense, waves, weighted_waves};
use super::{
    Coefficients, Excitation, Law, Regressor, Shape, Shaped, Tag, Zones, by_row, directed, main, main_about, nuisance,
    of_both, polar, times,
};
use crate::causes::{CauseName, ParameterName as Name};

/// Relative uncertainty of an eccentricity: the wave that it makes depends on how far teeth yield and the rim centres
/// itself, which differ between generators. *Guess*: in the FEM they differ by 5 % up to a factor.
const ECCENTRICITY_DOUBT: f64 = 0.15;
/// Angle on the wheel by which a flank is ahead of the eccentricity, rad: the pressure angle. *Guess*: the middle of 20
/// to 25 degrees.
const FLANK_AHEAD: f64 = 0.39;
/// Standard deviation of that angle, rad. *Guess*: 20 to 25 degrees are 1.5 of it to either side.
const AHEAD_SPREAD: f64 = 0.03;
/// Plausible eccentricities over radius and cosine of the pressure angle, arcsec. *Guess*: 0.2 to 60 µm on a radius of
/// 50 mm.
const RANGE_ARCSEC: [f64; 2] = [0.7, 250.0];
/// By how much the full load presses the zone in that carries first, arcsec. *Guess*: from nothing that shows to half a
/// usual clearance.
pub(super) const PRESSED_ARCSEC: [f64; 2] = [0.3, 60.0];
/// Teeth of a zone come to bear one after another: share of the pressing over which the second zone comes in. *Guess*:
/// not at once, and not over the whole way.
const ROUNDED: f64 = 0.5;
/// Share by which such a model may be wrong. *Guess*: more than a kernel of the FEM (8 %).
pub(super) const ZONES_MISFIT: f64 = 0.12;
/// Share by which the scale of a pattern may be wrong: its size is a shape parameter, and no factor. *Guess*: little is
/// left for the factor.
pub(super) const SCALE_MISFIT: f64 = 0.02;
/// Amplitude of the second order of a rectified sine on one flank over its own: 4 / (3π) to three digits.
/// *Source*: derived, the Fourier series of |sin x|.
const SECOND_ORDER: f64 = 0.424;
/// Share of the pattern's second order that deviations have to leave of an eccentricity. *Guess*: what keeps less is
/// another error of the second order.
const LEAST_OF_PATTERN: f64 = 0.15;

/// How far a zone that is `ahead` stops the output, when the load presses it in by `pressed`.
pub(super) fn stopped(ahead: f64, pressed: f64) -> f64 {
    let left = ahead.abs() - pressed;
    let round = ROUNDED * pressed;
    0.5 * (left + (left * left + round * round).sqrt())
}

/// A displacement, for the error that it makes row by row.
struct Displacement {
    of: Angle,
    phase: f64,
    size: f64,
    /// Pressing in per load, arcsec/N·m.
    pressed_per_n_m: f64,
    /// Angle by which a flank is ahead, rad.
    flank_ahead: f64,
}

impl Displacement {
    fn of(of: Angle, on: &Excitation<'_>, shape: Shaped<'_>) -> Displacement {
        Displacement {
            of,
            phase: shape.of(Name::PhaseRad),
            size: shape.of(Name::SizeArcsec),
            pressed_per_n_m: shape.get(Name::PressedArcsec).map_or(0.0, |pressed| pressed / on.scales.load),
            flank_ahead: FLANK_AHEAD,
        }
    }

    /// How far it brings one zone ahead of the other, where it fades like this.
    fn zones(&self, on: &Excitation<'_>, fade: &[f64]) -> Zones {
        let first = kept(on, self.of, 1.0);
        let by = self.flank_ahead * sense(on);
        [1.0, -1.0].map(|flank| {
            let (sin, cos) = (flank * by - self.phase).sin_cos();
            let (along, across) = (self.size * cos, self.size * sin);
            let waves = first[1].iter().zip(&first[0]);
            waves.zip(fade).map(|((s, c), fade)| fade * (along * s + across * c)).collect()
        })
    }

    /// Change of the error by it, with other causes acting in the zones.
    fn pattern(&self, on: &Excitation<'_>, fade: &[f64]) -> Vec<f64> {
        let own = self.zones(on, fade);
        // Where the output rests with zones this far ahead, half the clearance being `half`.
        let rests = |upper: f64, lower: f64, half: f64, flank: f64, pressed: f64| {
            let high = half - stopped(upper, pressed.max(0.0));
            let low = -half + stopped(lower, (-pressed).max(0.0));
            0.5 * (high + low) + flank * 0.5 * (high - low).max(0.0)
        };
        by_row(on, |k| {
            let (flank, pressed) = (on.base.flank[k], self.pressed_per_n_m * on.rows.torque[k]);
            let half = (on.base.half_backlash + on.widened.map_or(0.0, |w| w[k])).max(0.0);
            let [high, low] = on.zones.map_or([0.0; 2], |[upper, lower]| [upper[k], lower[k]]);
            rests(high + own[0][k], low + own[1][k], half, flank, pressed) - rests(high, low, half, flank, pressed)
        })
    }
}

/// Second orders that fade with the load, and those that do not: as waves of both flanks alike, and of opposite sign on
/// each.
const FADING: Tag = Tag("second order that fades");
const FADING_BY_FLANK: Tag = Tag("second order that fades, by flank");
const STEADY: Tag = Tag("second order");
const STEADY_BY_FLANK: Tag = Tag("second order, by flank");
/// The change of the pattern where a flank is farther ahead.
const FARTHER_AHEAD: Tag = Tag("flank farther ahead");
/// In the lead: the second order along the cosine and the sine of twice the angle by which a flank is ahead.
const ALONG: Tag = Tag("second order along the flanks");

/// Load that halves a displacement, N·m; without a load nothing does.
fn half_of(shape: Shaped<'_>) -> f64 {
    shape.get(Name::HalfLoadNM).unwrap_or(f64::INFINITY)
}

/// An axis off its place.
pub(super) fn displaced(cause: CauseName, of: Angle, on: &Excitation<'_>) -> Law {
    let loaded = on.scales.load > 0.0;
    let by = FLANK_AHEAD * sense(on);
    let mut law = Law::new(cause, move |on, shape| {
        let half = half_of(shape);
        let (flank, fade) = (&on.base.flank, faded(on, half));
        let fade_by_flank = times(&fade, flank);
        let displacement = Displacement::of(of, on, shape);
        let pattern = displacement.pattern(on, &fade);
        let steeper = Displacement { flank_ahead: FLANK_AHEAD + AHEAD_SPREAD, ..displacement }.pattern(on, &fade);
        let change = of_both(&steeper, &pattern, |steeper, pattern| steeper - pattern);
        let mut columns: Vec<Regressor> = vec![main_about(1.0, pattern, SCALE_MISFIT).called(Tag::SIZE)];
        columns.push(nuisance(fade_by_flank.clone(), 0.08));
        columns.extend(weighted_waves(on, of, 2.0, &fade).map(|v| nuisance(v, 0.12).called(FADING)));
        columns.extend(weighted_waves(on, of, 2.0, &fade_by_flank).map(|v| nuisance(v, 0.12).called(FADING_BY_FLANK)));
        columns.extend(weighted_waves(on, of, 4.0, &fade).map(|v| nuisance(v, 0.08)));
        columns.extend(weighted_waves(on, of, 4.0, &fade_by_flank).map(|v| nuisance(v, 0.08)));
        columns.extend(weighted_waves(on, of, 6.0, &fade_by_flank).map(|v| nuisance(v, 0.04)));
        if loaded {
            columns.extend(waves(on, of, 2.0).map(|v| nuisance(v, 0.12).called(STEADY)));
            columns.extend(weighted_waves(on, of, 2.0, flank).map(|v| nuisance(v, 0.12).called(STEADY_BY_FLANK)));
        }
        columns.push(main(change, 1.0).called(FARTHER_AHEAD));
        columns
    })
    .shapes(
        [
            Shape::angle(Name::PhaseRad, 2.0 * PI, 1),
            Shape::by_factors(Name::SizeArcsec, RANGE_ARCSEC[0], RANGE_ARCSEC[1], 1),
        ]
        .into_iter()
        .chain(loaded.then(|| half_load(on)))
        .chain(loaded.then(|| Shape::by_factors(Name::PressedArcsec, PRESSED_ARCSEC[0], PRESSED_ARCSEC[1], 2))),
    )
    .parameters_by(move |on, shape, c| {
        let amplitude = second_order_unloaded(c, shape, by) / SECOND_ORDER;
        let um = amplitude * COS_PRESSURE_ANGLE / on.scales.arcsec_per_um;
        let mut named = directed(um, amplitude, shape.of(Name::PhaseRad));
        named.extend([Name::HalfLoadNM, Name::PressedArcsec].into_iter().filter_map(|n| Some((n, shape.get(n)?))));
        named
    })
    // Where its deviations take back what the law says, it is another error of order 2.
    .physical_if(move |shape, c| {
        let scale = c.of(Tag::SIZE);
        let least = LEAST_OF_PATTERN * SECOND_ORDER * shape.of(Name::SizeArcsec) * scale;
        scale > 0.5 && second_order_unloaded(c, shape, by) > least
    })
    .parts_zones(move |on, shape, _| Displacement::of(of, on, shape).zones(on, &faded(on, half_of(shape))))
    .led_by(
        move |on, shape| {
            let half = half_of(shape);
            let (flank, fade) = (&on.base.flank, faded(on, half));
            let fade_by_flank = times(&fade, flank);
            let second = kept(on, of, 2.0);
            let mut columns: Vec<Regressor> = Vec::new();
            // Second order along cos 2 eps and sin 2 eps.
            for shift in [0.0, FRAC_PI_2] {
                let along = |k: usize| {
                    let (sin, cos) = (2.0 * by * flank[k] - shift).sin_cos();
                    second[0][k] * cos - second[1][k] * sin
                };
                columns.push(main(by_row(on, |k| fade_by_flank[k] * along(k)), USUAL_ARCSEC).called(ALONG));
            }
            columns.extend(weighted_waves(on, of, 2.0, &fade).map(|v| main(v, USUAL_ARCSEC).called(FADING)));
            columns.push(main(fade_by_flank, USUAL_ARCSEC));
            // What no load takes would go to the nominal wave of the same order, far from its tolerance.
            columns.extend(waves(on, of, 2.0).map(|v| main(v, USUAL_ARCSEC).called(STEADY)));
            columns
        },
        move |shape, c| {
            let beginning = |size: f64, twice: f64| {
                shape.with(&[(Name::PhaseRad, (0.5 * twice).rem_euclid(PI)), (Name::SizeArcsec, size)])
            };
            let [cos, sin] = c.wave(ALONG);
            let (free, twice) = polar(cos, sin);
            // Both flanks bind: -0.424 A sin 2a sin 2x, whichever carries.
            let both = (2.0 * by).sin();
            let (fading, steady) = (c.wave(FADING), c.wave(STEADY));
            let (bound, twice_bound) = polar(-(fading[1] + steady[1]) / both, (fading[0] + steady[0]) / both);
            vec![beginning(free / SECOND_ORDER, twice), beginning(bound / SECOND_ORDER, twice_bound)]
        },
    );
    law.wrong.doubt = ECCENTRICITY_DOUBT;
    law.wrong.misfit = ZONES_MISFIT;
    law.acts.meets_zones = true;
    law
}

/// Second order of a rectified eccentricity without load, all columns together: what fades and what does not share it
/// in proportions that loads of a narrow range do not separate. Each column of order 2 is projected on the pattern,
/// flank by flank.
fn second_order_unloaded(c: Coefficients<'_>, shape: Shaped<'_>, ahead_by: f64) -> f64 {
    let loaded = shape.get(Name::HalfLoadNM).is_some();
    // Without a load the place of the steady wave is that of what a flank farther ahead changes.
    let steady = if loaded { c.wave(STEADY) } else { [c.of(FARTHER_AHEAD), 0.0] };
    let both = [c.wave(FADING), steady];
    let by_flank = [c.wave(FADING_BY_FLANK), c.wave(STEADY_BY_FLANK)];
    let on_pattern = |flank: f64| {
        let (sin, cos) = (2.0 * shape.of(Name::PhaseRad) - 2.0 * ahead_by * flank).sin_cos();
        let along = |w: &[f64; 2]| w[0] * cos + w[1] * sin;
        both.iter().map(|w| flank * along(w)).chain(by_flank.iter().map(along)).sum::<f64>()
    };
    SECOND_ORDER * shape.of(Name::SizeArcsec) * c.of(Tag::SIZE) + 0.5 * (on_pattern(1.0) + on_pattern(-1.0))
}
