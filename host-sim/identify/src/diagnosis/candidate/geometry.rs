//! Errors of shape and place of the toothed wheels and the generator (docs/explanation/theory.md, "Signatures of
//! causes").
//!
//! An error of harmonic k on the flexspline's material returns k times per turn of the wave on it, one on the circular
//! spline's 94/95 as often: orders 2 and 1.979, apart after half an output turn. Eccentricities are rectified by the
//! clearance, `|sin|` on the flank that carries: orders 2, 4, 6 as 1 : 1/5 : 3/35, phase turned by twice the flank
//! angle between flanks, a mean that eats backlash, and less the more teeth share the load.

use std::f64::consts::{PI, TAU};

use crate::nominal::Nominal;
use flexspline::FixedMember;

use super::displaced::displaced;
use super::{
    Coefficients, Excitation, Law, Named, Regressor, Shape, Simulated, Tag, Values, beside, by_row, directed, kernel,
    main, nuisance, of_both, of_wave, polar, times,
};
use crate::causes::ParameterName as Name;
use crate::causes::spec::{
    ARCSECONDS, CauseName, CauseSpec, Factor, HALF_LOAD, HARMONIC, InTable, Kin, Need, ParameterSpec,
    Usual::{Follows, Value},
    WHEELS, microns, number, phase, plain,
};
use flexspline_mechanics::drive::Wheel;

/// Largest plausible amplitude, arcsec, one standard deviation.
pub(super) const USUAL_ARCSEC: f64 = 20.0;

/// Cosine of the pressure angle of a working flank, 20 to 25 degrees.
pub(super) const COS_PRESSURE_ANGLE: f64 = 0.93;

/// Clearance that odd orders of a pitch error take on a flank, over its second order: a first order as large as the
/// second takes 2/π of it, and a wheel that takes more and shows little is off its place.
const MOST_CLEARANCE_TAKEN: f64 = 0.85;

/// The wave of a law by flank, of opposite sign on each.
const WAVE_BY_FLANK: Tag = Tag("wave by flank");
/// Clearance that goes with a pitch error, under any load and under light ones.
const TAKEN: Tag = Tag("clearance taken");
const TAKEN_UNDER_LIGHT_LOAD: Tag = Tag("clearance taken under light load");
/// The wave of a pitch error in proportion to the load.
const BY_LOAD: Tag = Tag("wave by load");
/// Share of its wave that a pitch error loses to the full load, at most: teeth out of place stay there, and what a load
/// centres is a wheel off its place. *Source*: by definition, that load is no half-load.
const MOST_FADED: f64 = 0.5;
/// Pulses of a damaged tooth, by flank and load.
const PULSE: Tag = Tag("pulse");

/// Which angle an error is locked to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Angle {
    Generator,
    Output,
    Flexspline,
    CircularSpline,
    /// Gravity as the wave sees it.
    Gravity,
}

pub(super) fn angle(on: &Excitation<'_>, of: Angle, k: usize) -> f64 {
    match of {
        Angle::Generator => on.rows.generator[k],
        Angle::Output => on.rows.output[k],
        Angle::Flexspline => on.rows.on_flexspline[k],
        Angle::CircularSpline => on.rows.on_circular_spline[k],
        Angle::Gravity => on.rows.generator[k] + on.rows.orientation[k],
    }
}

/// How an error fades as the load brings more teeth to bear, row by row.
pub(super) fn faded(on: &Excitation<'_>, half_load: f64) -> Vec<f64> {
    on.rows.torque.iter().map(|torque| 1.0 / (1.0 + (torque / half_load).abs())).collect()
}

/// Cosine and sine of a multiple of an angle.
pub(super) fn waves(on: &Excitation<'_>, of: Angle, order: f64) -> [Vec<f64>; 2] {
    <[Vec<f64>; 2]>::clone(&kept(on, of, order))
}

/// Cosine and sine of a multiple of an angle, each row with its weight.
pub(super) fn weighted_waves(on: &Excitation<'_>, of: Angle, order: f64, weight: &[f64]) -> [Vec<f64>; 2] {
    let kept = kept(on, of, order);
    [times(weight, &kept[0]), times(weight, &kept[1])]
}

/// Cosine and sine of a multiple of an angle, made once.
pub(super) fn kept(on: &Excitation<'_>, of: Angle, order: f64) -> std::sync::Arc<[Vec<f64>; 2]> {
    on.base.waves.of(of, order, || {
        let (sin, cos) = (0..on.rows.len()).map(|k| (order * angle(on, of, k)).sin_cos()).unzip();
        [cos, sin]
    })
}

/// Half-load of the fading: from a thirtieth of the load scale to where nothing fades.
pub(super) fn half_load(on: &Excitation<'_>) -> Shape {
    let load = on.scales.load.max(1e-3);
    Shape::by_factors(Name::HalfLoadNM, load / 30.0, load * 30.0, 3)
}

/// How much errors show that a load hides, row by row; all of it where there is none.
fn light(on: &Excitation<'_>) -> Vec<f64> {
    if on.scales.load > 0.0 { faded(on, 0.3 * on.scales.load) } else { vec![1.0; on.rows.len()] }
}

/// Magnitude of the torque in units of the load scale, row by row.
fn load_shares(on: &Excitation<'_>) -> Vec<f64> {
    on.rows.torque.iter().map(|torque| (torque / on.scales.load).abs()).collect()
}

/// +1 where the circular spline is the output. Where the flexspline is, a load that turns it forward rests on the other
/// flank of the circular spline, and what a flank is ahead by changes its sign.
pub(super) fn sense(on: &Excitation<'_>) -> f64 {
    if standing(on.nominal) == Angle::CircularSpline { -1.0 } else { 1.0 }
}

/// Errors of position along the pitch: nearly the same on both flanks and under any load. Of the teeth in mesh the
/// foremost carries, which is another one on each flank: flanks differ somewhat, and a part of the clearance goes.
fn pitch(cause: CauseName, of: Angle) -> Law {
    let mut law = Law::new(cause, move |on, _| {
        let (flank, light) = (&on.base.flank, light(on));
        let light_by_flank = times(flank, &light);
        let mut columns: Vec<Regressor> = Vec::new();
        columns.extend(waves(on, of, 2.0).map(|v| main(v, USUAL_ARCSEC).called(Tag::WAVE)));
        // Clearance that odd orders take, of which the even ones say nothing.
        columns.push(beside(flank.clone(), 0.6).called(TAKEN));
        columns.push(beside(light_by_flank.clone(), 0.4).called(TAKEN_UNDER_LIGHT_LOAD));
        columns.extend(weighted_waves(on, of, 2.0, flank).map(|v| nuisance(v, 0.15)));
        for (order, both, by_flank) in [(4.0, 0.35, 0.12), (6.0, 0.12, 0.06), (8.0, 0.075, 0.0375), (10.0, 0.06, 0.03)]
        {
            columns.extend(waves(on, of, order).map(|v| nuisance(v, both)));
            columns.extend(weighted_waves(on, of, order, flank).map(|v| nuisance(v, by_flank)));
        }
        // Equal lobes cancel odd harmonics; under light load they are not quite equal.
        columns.extend(waves(on, of, 1.0).map(|v| nuisance(v, 0.03)));
        columns.extend(weighted_waves(on, of, 1.0, &light).map(|v| nuisance(v, 0.2)));
        columns.extend(waves(on, of, 3.0).map(|v| nuisance(v, 0.05)));
        for order in [12.0, 14.0, 16.0] {
            columns.extend(waves(on, of, order).map(|v| nuisance(v, 0.6 / order)));
        }
        // The first order of the wheel, which most cutting leaves, is rectified by the clearance like an eccentricity.
        columns.extend(weighted_waves(on, of, 2.0, &light_by_flank).map(|v| nuisance(v, 0.4)));
        if on.scales.load > 0.0 {
            columns.extend(weighted_waves(on, of, 2.0, &load_shares(on)).map(|v| nuisance(v, 0.1).called(BY_LOAD)));
        }
        columns
    })
    .parameters_by(|on, _, c| wave_parameters(on, c, 2.0))
    .physical_if(|_, c| {
        let (taken, light) = (c.of(TAKEN), c.of(TAKEN_UNDER_LIGHT_LOAD));
        let ([cos, sin], [by_cos, by_sin]) = (c.wave(Tag::WAVE), c.wave(BY_LOAD));
        let stays = by_cos * cos + by_sin * sin > -MOST_FADED * (cos * cos + sin * sin);
        stays && taken.abs().max((taken + light).abs()) < MOST_CLEARANCE_TAKEN * cos.hypot(sin)
    });
    law.search.whole_beside_noise = true;
    law.of_shape()
}

/// Of a wave of n periods in a turn of the wheel.
fn wave_parameters(on: &Excitation<'_>, c: Coefficients<'_>, harmonic: f64) -> Vec<Named> {
    let (amplitude, phase) = of_wave(c, Tag::WAVE);
    let mut named = directed(amplitude / on.scales.arcsec_per_um, amplitude, phase / harmonic);
    named.push((Name::Harmonic, harmonic));
    named
}

/// Further harmonics that both lobes see alike, as jaws, screws or an indexing head with n places leave them; odd
/// ones cancel.
const HIGHER_HARMONICS: [f64; 5] = [4.0, 6.0, 8.0, 10.0, 12.0];

/// The models of the pitch error of a wheel: the one by the kernels of the drive, where it has them.
fn pitch_errors(cause: CauseName, (of, wheel): (Angle, Wheel), on: &Excitation<'_>) -> Vec<Law> {
    if let Some(kernels) = on.kernels() {
        return vec![kernel::pitch(cause, (of, wheel), kernels)];
    }
    let of_encoder = |harmonic: f64| of == standing(on.nominal) && super::sensor::is_subdivision(harmonic);
    let higher = HIGHER_HARMONICS.into_iter().filter(|harmonic| !of_encoder(*harmonic));
    std::iter::once(pitch(cause, of)).chain(higher.map(|harmonic| higher_harmonic(cause, of, harmonic))).collect()
}

/// The model of a wheel off its place: the one by the kernels of the drive, where it has them.
fn displacement(cause: CauseName, of: Angle, on: &Excitation<'_>) -> Law {
    match on.kernels() {
        Some(kernels) => kernel::eccentric(cause, of, kernels),
        None => displaced(cause, of, on),
    }
}

/// A pitch error that is one wave of a higher harmonic, with little of the second: rarer than those that the second
/// leads. At the wheel that stands a subdivision of the generator's encoder makes the very same wave, and is the rule:
/// it has the name there.
fn higher_harmonic(cause: CauseName, of: Angle, harmonic: f64) -> Law {
    Law::new(cause, move |on, _| {
        let (flank, light) = (&on.base.flank, light(on));
        let mut columns: Vec<Regressor> = Vec::new();
        columns.extend(waves(on, of, harmonic).map(|v| main(v, USUAL_ARCSEC).called(Tag::WAVE)));
        columns.extend(weighted_waves(on, of, harmonic, flank).map(|v| nuisance(v, 0.15)));
        columns.extend(weighted_waves(on, of, harmonic, &light).map(|v| nuisance(v, 0.1)));
        columns.extend(waves(on, of, 2.0).map(|v| nuisance(v, 0.15)));
        columns.extend(waves(on, of, 2.0 * harmonic).map(|v| nuisance(v, 0.15)));
        columns
    })
    .parameters_by(move |on, _, c| wave_parameters(on, c, harmonic))
    .variant(format!("order {harmonic}"))
    .after_wheels()
    .of_shape()
}

/// The wheel that does not turn: what is cut into it comes back once in each turn of the generator.
fn standing(nominal: &Nominal) -> Angle {
    match nominal.teeth.map(|teeth| teeth.fixed) {
        Some(FixedMember::CircularSpline) => Angle::CircularSpline,
        _ => Angle::Flexspline,
    }
}

/// The pitch error of the wheel that stands.
pub(crate) fn standing_pitch_error(nominal: &Nominal) -> CauseName {
    match standing(nominal) {
        Angle::CircularSpline => CauseName::CircularSplinePitchError,
        _ => CauseName::FlexsplinePitchError,
    }
}

/// Ring pressed to an oval: order 2 alone. Radius `d cos 2x` with the tangential part `-d/2 sin 2x` of a ring that
/// keeps its length: the output lags where spaces are displaced forward, and a flank at the pressure angle gives way
/// where they are displaced outward, `e = d/r (1/2 sin 2x ± tan a cos 2x)`. 10 µm of radius are 0.67 of 10 µm on the
/// pitch circle.
fn ovality() -> Law {
    let of = Angle::CircularSpline;
    Law::new(CauseName::CircularSplineOvality, move |on, _| {
        let flank = &on.base.flank;
        let [cos, sin] = waves(on, of, 2.0);
        let together = |a: &[f64], b: &[f64], sign: f64| -> Vec<f64> {
            let (root, radial) = (1.0f64.hypot(RADIAL_OF_TANGENTIAL), sign * sense(on) * RADIAL_OF_TANGENTIAL);
            by_row(on, |k| (a[k] + radial * flank[k] * b[k]) / root)
        };
        let mut columns: Vec<Regressor> = [together(&sin, &cos, 1.0), together(&cos, &sin, -1.0)]
            .map(|v| main(v, USUAL_ARCSEC).called(Tag::WAVE))
            .into();
        columns.extend(weighted_waves(on, of, 2.0, flank).map(|v| nuisance(v, 0.15)));
        // Screws and seats leave further waves on the ring: of n per turn, 1/n of the radial part is tangential.
        for order in [3.0, 4.0, 6.0] {
            columns.extend(waves(on, of, order).map(|v| nuisance(v, 0.12)));
            columns.extend(weighted_waves(on, of, order, flank).map(|v| nuisance(v, 0.12)));
        }
        if on.scales.load > 0.0 {
            columns.extend(weighted_waves(on, of, 2.0, &load_shares(on)).map(|v| nuisance(v, 0.1)));
        }
        columns
    })
    .parameters_by(|on, _, c| {
        // sin 2(x - c) = cos 2c sin 2x - sin 2c cos 2x.
        let [of_sine, of_cosine] = c.wave(Tag::WAVE);
        let (amplitude, phase) = polar(of_sine, -of_cosine);
        directed(amplitude / (0.67 * on.scales.arcsec_per_um), amplitude, 0.5 * phase)
    })
    .well_known()
    .of_shape()
}

/// Radial over tangential part of an oval ring as a flank sees them: twice the tangent of the pressure angle.
const RADIAL_OF_TANGENTIAL: f64 = 0.8;

/// Form error of the generator: a constant shape repeats from tooth to tooth, so its order is the tooth mesh (z per
/// turn), other on each flank, with a change of the clearance.
fn cam_form_error() -> Law {
    Law::new(CauseName::CamFormError, |on, _| {
        let teeth = on.nominal.teeth.map_or(188.0, |t| f64::from(t.flexspline));
        let of = Angle::Flexspline;
        let flank = &on.base.flank;
        let mut columns: Vec<Regressor> = Vec::new();
        columns.extend(waves(on, of, teeth).map(|v| main(v, 8.0).called(Tag::WAVE)));
        columns.extend(weighted_waves(on, of, teeth, flank).map(|v| main(v, 8.0).called(WAVE_BY_FLANK)));
        if on.scales.load > 0.0 {
            // More teeth carry, or other ones.
            let load = load_shares(on);
            columns.extend(weighted_waves(on, of, teeth, &load).map(|v| nuisance(v, 0.6)));
            columns.extend(weighted_waves(on, of, teeth, &times(&load, flank)).map(|v| nuisance(v, 0.6)));
        }
        columns.extend(weighted_waves(on, of, 2.0 * teeth, flank).map(|v| nuisance(v, 0.4)));
        columns.extend(waves(on, of, 2.0 * teeth).map(|v| nuisance(v, 0.4)));
        columns.push(beside(flank.clone(), 1.0));
        columns
    })
    .parameters_by(|on, _, c| {
        let (both, phase) = of_wave(c, Tag::WAVE);
        let mesh = both.hypot(of_wave(c, WAVE_BY_FLANK).0);
        directed(mesh / on.scales.arcsec_per_um, mesh, phase)
    })
    .of_shape()
}

/// A pulse is nothing beyond this number of its widths.
const PULSE_ENDS: f64 = 8.0;

/// Widest pulse of a tooth that is looked for, rad, and the share of it beyond which one is on that bound. *Guess*:
/// eight damaged teeth of the examinations have 0.10 to 0.27.
const WIDEST_PULSE: f64 = 0.4;
const ON_THE_BOUND: f64 = 0.9;

/// Effect of a tooth, from 0 to 1, at an angle (rad) from where a lobe is on it: each half turn brings a lobe.
pub(super) fn pulse(from_tooth: f64, width: f64) -> f64 {
    let turns = from_tooth / PI;
    let away = PI * (turns - turns.round()) / width;
    if away.abs() < PULSE_ENDS { (-0.5 * away * away).exp() } else { 0.0 }
}

/// A tooth that lacks material: a pulse each time a lobe of the wave passes it, twice per turn, on the flank that
/// carries, under load.
fn damaged_tooth(of: Angle) -> Law {
    Law::new(CauseName::DamagedTooth, move |on, shape| {
        let (place, width) = (shape.of(Name::AngleRad), shape.of(Name::WidthRad));
        let load = if on.scales.load > 0.0 { on.scales.load } else { 1.0 };
        let pulse = by_row(on, |k| pulse(angle(on, of, k) - place, width));
        let by_load = of_both(&pulse, &on.rows.torque, |pulse, torque| pulse * torque / load);
        let by_flank = times(&pulse, &on.base.flank);
        let of_load = by_load.iter().map(|v| v.abs()).collect();
        vec![
            main(by_flank, 30.0).called(PULSE),
            main(by_load, 30.0).called(PULSE),
            main(pulse, 20.0).called(PULSE),
            main(of_load, 20.0).called(PULSE),
        ]
    })
    .shapes([Shape::angle(Name::AngleRad, PI, 30), Shape::by_factors(Name::WidthRad, 0.03, WIDEST_PULSE, 2)])
    // What would be wider still is a wave, of the stiffness or of many teeth.
    .physical_if(|shape, _| shape.of(Name::WidthRad) < ON_THE_BOUND * WIDEST_PULSE)
    .parameters_by(move |on, shape, c| {
        let place = shape.of(Name::AngleRad);
        let teeth =
            on.nominal.teeth.map_or((188.0, 190.0), |t| (f64::from(t.flexspline), f64::from(t.circular_spline)));
        let count = if of == Angle::Flexspline { teeth.0 } else { teeth.1 };
        let depth = c.all(PULSE).reduce(f64::hypot).unwrap_or(0.0);
        vec![
            (Name::DepthUm, depth / on.scales.arcsec_per_um),
            (Name::AmplitudeArcsec, depth),
            (Name::AngleRad, place),
            (Name::WidthRad, shape.of(Name::WidthRad)),
            (Name::Tooth, (place / (2.0 * PI) * count).round()),
            (Name::Wheel, f64::from(u8::from(of == Angle::CircularSpline))),
        ]
    })
    .of_shape()
}

/// A wave of this amplitude whose crest is at a phase.
pub(super) fn crest_at(amplitude: f64, phase: f64) -> [f64; 2] {
    [amplitude * phase.cos(), amplitude * phase.sin()]
}

/// A displacement of known size.
fn simulated_displacement(cause: CauseName, of: Angle, on: &Excitation<'_>, p: Values<'_>) -> Simulated {
    displaced(cause, of, on).with(p, &[(Name::SizeArcsec, p(Name::AmplitudeArcsec))], [])
}

/// A pitch error of one known wave.
fn simulated_pitch(cause: CauseName, of: Angle, p: Values<'_>) -> Simulated {
    let harmonic = p(Name::Harmonic);
    let wave = crest_at(p(Name::AmplitudeArcsec), harmonic * p(Name::PhaseRad));
    higher_harmonic(cause, of, harmonic).with(p, &[], wave.map(|c| (Tag::WAVE, c)))
}

/// An error of shape or place of a toothed wheel.
pub(super) const OF_WHEELS: CauseSpec = CauseSpec { kin: Kin::Shape, needs: &[Need::Teeth], ..plain() };

/// A displacement.
const DISPLACEMENT: CauseSpec =
    CauseSpec { twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongNormal)], ..OF_WHEELS };

/// A pitch error.
const PITCH_ERROR: CauseSpec = CauseSpec {
    parameters: &[microns("along the pitch", 5.0), ARCSECONDS, HARMONIC, phase("angle of a crest of the error")],
    twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongPitch)],
    ..OF_WHEELS
};

/// The axis of the circular spline is off that of the generator.
pub(crate) const CIRCULAR_SPLINE_ECCENTRICITY: CauseSpec = CauseSpec {
    name: "circular_spline_eccentricity",
    words: "eccentricity of the circular spline",
    does: "its axis off the axis of the generator: two waves in a turn of the generator against the circular \
             spline",
    place: |placing| {
        let paths = ["as_built.circular_spline_eccentricity_um", "as_built.circular_spline_eccentricity_phase_deg"];
        placing.set_displacement(true, paths);
    },
    parameters: &[microns("how far", 10.0), ARCSECONDS, phase("whereto, on the circular spline"), HALF_LOAD],
    laws: |on| vec![displacement(CauseName::CircularSplineEccentricity, Angle::CircularSpline, on)],
    simulated: |on, p| simulated_displacement(CauseName::CircularSplineEccentricity, Angle::CircularSpline, on, p),
    ..DISPLACEMENT
};

/// The axis of the flexspline's toothing is off that of its bore.
pub(crate) const FLEXSPLINE_RUNOUT: CauseSpec = CauseSpec {
    name: "flexspline_runout",
    words: "runout of the flexspline",
    does: "its axis off the axis of the generator: two waves in a generator turn",
    place: |placing| {
        placing.set_displacement(false, ["as_built.flexspline_runout_um", "as_built.flexspline_runout_phase_deg"]);
    },
    parameters: &[microns("how far", 10.0), ARCSECONDS, phase("whereto, on the flexspline"), HALF_LOAD],
    laws: |on| vec![displacement(CauseName::FlexsplineRunout, Angle::Flexspline, on)],
    simulated: |on, p| simulated_displacement(CauseName::FlexsplineRunout, Angle::Flexspline, on, p),
    ..DISPLACEMENT
};

/// The circular spline is pressed to an oval.
pub(crate) const CIRCULAR_SPLINE_OVALITY: CauseSpec = CauseSpec {
    name: "circular_spline_ovality",
    words: "oval circular spline",
    does: "pressed out of round: two waves in a turn against the circular spline",
    place: |placing| placing.set_ovality(),
    parameters: &[microns("of the radius", 8.0), ARCSECONDS, phase("angle of a crest of the radius")],
    twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::Oval)],
    laws: |on| vec![on.kernels().map_or_else(ovality, kernel::ovality)],
    simulated: |_, p| {
        let [sine, cosine] = crest_at(p(Name::AmplitudeArcsec), 2.0 * p(Name::PhaseRad));
        ovality().with(p, &[], [(Tag::WAVE, sine), (Tag::WAVE, -cosine)])
    },
    ..OF_WHEELS
};

/// The teeth of the flexspline are out of place along the pitch.
pub(crate) const FLEXSPLINE_PITCH_ERROR: CauseSpec = CauseSpec {
    name: "flexspline_pitch_error",
    words: "pitch error of the flexspline",
    does: "teeth out of place: whole orders of the generator turn",
    place: |placing| placing.set_pitch_harmonics(Wheel::Flexspline),
    laws: |on| pitch_errors(CauseName::FlexsplinePitchError, (Angle::Flexspline, Wheel::Flexspline), on),
    simulated: |_, p| simulated_pitch(CauseName::FlexsplinePitchError, Angle::Flexspline, p),
    ..PITCH_ERROR
};

/// The teeth of the circular spline are out of place along the pitch.
pub(crate) const CIRCULAR_SPLINE_PITCH_ERROR: CauseSpec = CauseSpec {
    name: "circular_spline_pitch_error",
    words: "pitch error of the circular spline",
    does: "teeth out of place: whole orders of a turn against the circular spline",
    place: |placing| placing.set_pitch_harmonics(Wheel::CircularSpline),
    laws: |on| pitch_errors(CauseName::CircularSplinePitchError, (Angle::CircularSpline, Wheel::CircularSpline), on),
    simulated: |_, p| simulated_pitch(CauseName::CircularSplinePitchError, Angle::CircularSpline, p),
    ..PITCH_ERROR
};

/// The generator has another shape than the drawn one.
pub(crate) const CAM_FORM_ERROR: CauseSpec = CauseSpec {
    name: "cam_form_error",
    words: "form error of the generator",
    does: "a shape that is not the drawn one: tooth mesh and even orders of the generator turn",
    needs: &[Need::Teeth],
    parameters: &[microns("of the error it makes", 3.0), ARCSECONDS, phase("of the form")],
    twins: &[(Name::AmplitudeUm, Name::AmplitudeArcsec, Factor::AlongPitch)],
    laws: |_| vec![cam_form_error()],
    simulated: |_, p| {
        cam_form_error().with(p, &[], crest_at(p(Name::AmplitudeArcsec), p(Name::PhaseRad)).map(|c| (Tag::WAVE, c)))
    },
    ..plain()
};

/// A tooth lacks material.
pub(crate) const DAMAGED_TOOTH: CauseSpec = CauseSpec {
    name: "damaged_tooth",
    words: "damaged tooth",
    does: "a pulse each time a lobe passes one place",
    kin: Kin::Pulse,
    needs: &[Need::Teeth, Need::Turns],
    place: |placing| placing.set_damaged_tooth(),
    parameters: &[
        number(Name::DepthUm, "depth that lacks, along the normal", 0.0, 500.0, Value(10.0)),
        number(Name::AmplitudeArcsec, "the same at the output, under the largest load", 0.0, 3000.0, Follows),
        ParameterSpec { words: WHEELS, ..number(Name::Wheel, "0 flexspline, 1 circular spline", 0.0, 1.0, Value(0.0)) },
        number(Name::Tooth, "which one, from 0", 0.0, 2000.0, Value(40.0)),
        number(Name::AngleRad, "the same as an angle on the wheel", -TAU, TAU, Follows),
        number(Name::WidthRad, "half the arc over which it is felt", 0.02, 0.6, Value(0.15)),
    ],
    twins: &[(Name::DepthUm, Name::AmplitudeArcsec, Factor::AlongNormal), (Name::Tooth, Name::AngleRad, Factor::Tooth)],
    laws: |_| vec![damaged_tooth(Angle::Flexspline), damaged_tooth(Angle::CircularSpline).variant("circular spline")],
    simulated: |_, p| {
        let of = if p(Name::Wheel) == 0.0 { Angle::Flexspline } else { Angle::CircularSpline };
        // What the load on it gives way by.
        damaged_tooth(of).with(p, &[], [0.0, -p(Name::AmplitudeArcsec), 0.0, 0.0].map(|c| (PULSE, c)))
    },
    ..plain()
};

/// A weight pushes the circular spline aside.
pub(crate) const GRAVITY_SIDE_LOAD: CauseSpec = CauseSpec {
    name: "gravity_side_load",
    words: "side load by gravity",
    does: "a weight that pushes the wheels out of centre",
    in_table: InTable::AtOneOrientation,
    place: |placing| placing.set_offset(),
    parameters: &[microns("how far", 10.0), ARCSECONDS, phase("whereto, against gravity"), HALF_LOAD],
    laws: |on| vec![displacement(CauseName::GravitySideLoad, Angle::Gravity, on)],
    simulated: |on, p| simulated_displacement(CauseName::GravitySideLoad, Angle::Gravity, on, p),
    ..DISPLACEMENT
};
