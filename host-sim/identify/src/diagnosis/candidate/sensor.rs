//! What the sensors do: geometry of the encoders, time between their readings, a wrong ratio. None knows of load.

use std::f64::consts::TAU;

use super::geometry::{Angle, waves};
use super::{Column, Excitation, Law, Named, Role, by_row, main, nuisance, polar};
use crate::causes::{CauseName, ParameterName as Name};

/// The first order of an encoder.
const WAVE: Role = Role("wave");

fn encoder(cause: CauseName, angle: Angle, per_ratio: bool) -> Law {
    Law::new(cause, move |on, _| {
        let first = waves(on, angle, 1.0).map(|wave| main(wave, 30.0).called(WAVE));
        first.into_iter().chain(waves(on, angle, 2.0).map(|wave| nuisance(wave, 0.15))).collect()
    })
    .parameters_by(move |on, _, c| {
        // c cos(x) + s sin(x) = A sin(x + phase).
        let [cos, sin] = c.wave(WAVE);
        let (amplitude, phase) = polar(sin, cos);
        let mut named = vec![(Name::AmplitudeArcsec, amplitude), (Name::PhaseRad, phase)];
        if per_ratio {
            named.push((Name::GeneratorAmplitudeArcsec, amplitude * on.nominal.ratio.abs()));
        }
        named
    })
}

/// Share of a second order that its own first overtone may have, and a subdivision of its own: signals of unlike size
/// make little of it. Guess.
const OVERTONE: f64 = 0.15;

/// A line of an encoder at `order` waves in a turn of it, with a little of its overtone. At the generator there is
/// none: overtones are what tells a wheel.
fn waves_of(
    cause: CauseName,
    angle: Angle,
    order: f64,
    has_overtone: bool,
    parameters: impl Fn(&Excitation<'_>, f64, f64) -> Vec<Named> + Send + Sync + 'static,
) -> Law {
    Law::new(cause, move |on, _| {
        let mut columns: Vec<Column> = waves(on, angle, order).map(|wave| main(wave, 15.0).called(WAVE)).into();
        if has_overtone {
            columns.extend(waves(on, angle, 2.0 * order).map(|wave| nuisance(wave, OVERTONE)));
        }
        columns
    })
    .parameters_by(move |on, _, c| {
        let [cos, sin] = c.wave(WAVE);
        let (amplitude, phase) = polar(sin, cos);
        parameters(on, amplitude, phase)
    })
}

/// The second order of an encoder: a disc or a magnet that is tilted, a ring that is not flat, two signals of unlike
/// size in a magnetic one.
fn encoder_tilt() -> [Law; 2] {
    let at_output =
        |_: &Excitation<'_>, amplitude, phase| vec![(Name::AmplitudeArcsec, amplitude), (Name::PhaseRad, phase)];
    let at_generator = |on: &Excitation<'_>, amplitude: f64, phase| {
        let generator_arcsec = amplitude * on.nominal.ratio.abs();
        vec![
            (Name::AmplitudeArcsec, amplitude),
            (Name::GeneratorAmplitudeArcsec, generator_arcsec),
            (Name::PhaseRad, phase),
        ]
    };
    let of_generator = waves_of(CauseName::GeneratorEncoderTilt, Angle::Generator, 2.0, false, at_generator);
    let of_output = waves_of(CauseName::OutputEncoderTilt, Angle::Output, 2.0, true, at_output);
    [of_output.kin_of_shapes(), of_generator.after_wheels()]
}

/// Waves in a turn that interpolation leaves: four of a magnet with two poles, and so on for 4, 8, ... signal periods
/// in a turn, the orders that loggers of such encoders resolve.
const SUBDIVISIONS: [f64; 5] = [4.0, 8.0, 16.0, 32.0, 64.0];

/// Whether an encoder may leave this many waves in a turn.
pub(super) fn is_subdivision(order: f64) -> bool {
    SUBDIVISIONS.contains(&order)
}

/// An encoder that divides the periods of its signals unevenly.
fn encoder_subdivision(of_output: bool, order: f64) -> Law {
    let angle = if of_output { Angle::Output } else { Angle::Generator };
    let law = waves_of(CauseName::EncoderSubdivision, angle, order, of_output, move |on, amplitude, phase| {
        let at_generator = (Name::GeneratorAmplitudeArcsec, amplitude * on.nominal.ratio.abs());
        [(Name::AmplitudeArcsec, amplitude)]
            .into_iter()
            .chain((!of_output).then_some(at_generator))
            .chain([(Name::Harmonic, order), (Name::Encoder, f64::from(u8::from(of_output))), (Name::PhaseRad, phase)])
            .collect()
    });
    let law = law.variant(format!("{} {order}", if of_output { "output" } else { "generator" }));
    if of_output { law } else { law.after_wheels() }
}

/// Delays of loggers are some milliseconds.
const DELAY_S: f64 = 5e-3;

/// The nominal prediction without changes of the flank, which take a time of their own.
fn on_its_flank(on: &Excitation<'_>) -> Vec<f64> {
    let of = |(said, flank): (&f64, &f64)| said - on.base.half_backlash * flank;
    on.base.prediction.iter().zip(&on.base.flank).map(of).collect()
}

/// Change in a second of a column, row by row; none over a break.
pub(super) fn rate(on: &Excitation<'_>, values: &[f64]) -> Vec<f64> {
    let mut rates = vec![0.0; values.len()];
    for session in &on.rows.sessions {
        for k in session.clone() {
            let (from, to) = (k.max(session.start + 1) - 1, (k + 1).min(session.end - 1));
            let passed = on.rows.time[to] - on.rows.time[from];
            rates[k] = if passed > 0.0 { (values[to] - values[from]) / passed } else { 0.0 };
        }
    }
    rates
}

/// The output of a row is older than its generator.
fn sensor_latency() -> Law {
    let mut law = Law::new(CauseName::SensorLatency, |on, _| {
        let per_s = flexspline_base::units::ARCSEC_PER_RAD / on.nominal.ratio;
        let begun = on.scales.begin_s + 0.5 * on.scales.duration_s;
        let behind = |values: &[f64]| rate(on, values).into_iter().map(|by| -by).collect::<Vec<f64>>();
        let of_angle: Vec<f64> =
            on_its_flank(on).iter().zip(&on.base.wind_up).map(|(all, wind_up)| all - wind_up).collect();
        let since = |k: usize| 2.0 * (on.rows.time[k] - begun) / on.scales.duration_s.max(1e-9);
        vec![
            main(by_row(on, |k| -on.rows.speed[k] * per_s), 5e-3).called(Role::SIZE),
            // Two clocks seldom run at the same rate.
            nuisance(by_row(on, |k| -on.rows.speed[k] * per_s * since(k)), 0.3),
            // The error is that of the instant at which the output was read: its waves are where the generator was
            // then, …
            nuisance(behind(&of_angle), 1.0),
            // … and so is its wind-up, if it is the output that is read early, and not the generator; …
            nuisance(behind(&on.base.wind_up), 1.0),
            // … a motor that gathers speed was slower then.
            nuisance(rate(on, &on.rows.speed).into_iter().map(|by| 0.5 * by * per_s).collect(), DELAY_S),
        ]
    })
    .parameters_by(|_, _, c| vec![(Name::DelayS, c.of(Role::SIZE))]);
    // Of a long delay in fast motion what comes with it is more than noise.
    law.search.whole_beside_noise = true;
    law
}

/// The error grows with the angle: the ratio is not what the nominal model says.
fn ratio_error() -> Law {
    Law::new(CauseName::RatioError, |on, _| {
        vec![main(by_row(on, |k| on.rows.output[k] * flexspline_base::units::ARCSEC_PER_RAD), 3e-4).called(Role::SIZE)]
    })
    .parameters_by(|_, _, c| vec![(Name::RatioRelativeError, c.of(Role::SIZE))])
}

/// Periods of a subdivision that the output has to turn through: fewer are a curve that anything may make.
const FEWEST_PERIODS: f64 = 1.5;

pub(super) fn laws(on: &Excitation<'_>) -> Vec<Law> {
    let turned = on.output_span_rad() / TAU;
    let seen = |of_output: bool, order: f64| !of_output || turned * order >= FEWEST_PERIODS;
    let subdivisions = [false, true].into_iter().flat_map(|of_output| {
        SUBDIVISIONS
            .into_iter()
            .filter(move |order| seen(of_output, *order))
            .map(move |order| encoder_subdivision(of_output, order))
    });
    [
        encoder(CauseName::OutputEncoderEccentricity, Angle::Output, false),
        encoder(CauseName::GeneratorEncoderEccentricity, Angle::Generator, true),
        ratio_error(),
        sensor_latency(),
    ]
    .into_iter()
    .chain(encoder_tilt())
    .chain(subdivisions)
    .map(Law::exact)
    .collect()
}
