//! What the sensors do: geometry of the encoders, time between their readings, a wrong ratio. None knows of load.

use std::f64::consts::TAU;

use super::geometry::{Angle, waves};
use super::{Column, Excitation, Law, Named, Role, Simulated, Values, by_row, main, nuisance, polar};
use crate::causes::{CauseName, ParameterName as Name};
use crate::measurement::rates;

/// The line of an encoder.
const WAVE: Role = Role("wave");

/// Share of a second order that its own first overtone may have, and a subdivision of its own: signals of unlike size
/// make little of it. Guess.
const OVERTONE: f64 = 0.15;

/// A line at `order` waves in a turn of the encoder of the output or of the generator, arcsec of this `std`, with a
/// little of its overtone or without. Its parameters are amplitude and phase, and `further` ones.
fn encoder(
    cause: CauseName,
    of_output: bool,
    (order, std): (f64, f64),
    has_overtone: bool,
    further: impl Fn() -> Vec<Named> + Send + Sync + 'static,
) -> Law {
    let angle = if of_output { Angle::Output } else { Angle::Generator };
    Law::new(cause, move |on, _| {
        let mut columns: Vec<Column> = waves(on, angle, order).map(|wave| main(wave, std).called(WAVE)).into();
        if has_overtone {
            columns.extend(waves(on, angle, 2.0 * order).map(|wave| nuisance(wave, OVERTONE)));
        }
        columns
    })
    .parameters_by(move |on, _, c| {
        // c cos(x) + s sin(x) = A sin(x + phase).
        let [cos, sin] = c.wave(WAVE);
        let (amplitude, phase) = polar(sin, cos);
        let mut named = vec![(Name::AmplitudeArcsec, amplitude), (Name::PhaseRad, phase)];
        if !of_output {
            named.push((Name::GeneratorAmplitudeArcsec, amplitude * on.nominal.ratio.abs()));
        }
        named.extend(further());
        named
    })
}

/// The first order of an encoder: a disc off its axis.
fn encoder_eccentricity() -> [Law; 2] {
    [(CauseName::OutputEncoderEccentricity, true), (CauseName::GeneratorEncoderEccentricity, false)]
        .map(|(cause, of_output)| encoder(cause, of_output, (1.0, 30.0), true, Vec::new))
}

/// The second order of an encoder: a disc or a magnet that is tilted, a ring that is not flat, two signals of unlike
/// size in a magnetic one. That of the generator has no overtone: overtones distinguish a wheel.
fn encoder_tilt() -> [Law; 2] {
    let of_output = encoder(CauseName::OutputEncoderTilt, true, (2.0, 15.0), true, Vec::new);
    let of_generator = encoder(CauseName::GeneratorEncoderTilt, false, (2.0, 15.0), false, Vec::new);
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
    let law = encoder(CauseName::EncoderSubdivision, of_output, (order, 15.0), of_output, move || {
        vec![(Name::Harmonic, order), (Name::Encoder, f64::from(u8::from(of_output)))]
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

/// Change of values per second, row by row, from the neighbours in a session.
pub(super) fn rate(on: &Excitation<'_>, values: &[f64]) -> Vec<f64> {
    rates(&on.rows.sessions, &on.rows.time, values)
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

/// A wave of known size in a turn of an encoder.
pub(crate) fn simulated_encoder(cause: CauseName, of_output: bool, order: f64, p: Values<'_>) -> Simulated {
    let (sin, cos) = p(Name::PhaseRad).sin_cos();
    let law = match cause {
        CauseName::EncoderSubdivision => encoder_subdivision(of_output, order),
        _ => encoder(cause, of_output, (order, 1.0), false, Vec::new),
    };
    law.with(&[], [sin, cos].map(|part| (WAVE, part * p(Name::AmplitudeArcsec))))
}

/// A known delay.
pub(crate) fn simulated_latency(p: Values<'_>) -> Simulated {
    sensor_latency().with(&[], [(Role::SIZE, p(Name::DelayS))])
}

/// A known error of the ratio.
pub(crate) fn simulated_ratio_error(p: Values<'_>) -> Simulated {
    ratio_error().with(&[], [(Role::SIZE, p(Name::RatioRelativeError))])
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
    // The order of the library: eccentric encoders, ratio, latency, then the further lines of encoders.
    encoder_eccentricity()
        .into_iter()
        .chain([ratio_error(), sensor_latency()])
        .chain(encoder_tilt())
        .chain(subdivisions)
        .map(Law::exact)
        .collect()
}
