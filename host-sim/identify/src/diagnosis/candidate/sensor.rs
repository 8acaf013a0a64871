//! Causes of the sensors: geometry of the encoders, time between their readings, a wrong ratio. None knows of load.

use std::f64::consts::TAU;

use super::geometry::{Angle, waves};
use super::{Excitation, Law, Named, Regressor, Simulated, Tag, Values, by_row, main, nuisance, polar};
use crate::causes::ParameterName as Name;
use crate::causes::spec::{
    CauseName, CauseSpec, ENCODERS, Factor, InTable, Kin, Need, OF_THE_OUTPUT_ENCODER, ParameterSpec,
    Usual::{Follows, Value},
    number, phase, plain,
};
use crate::measurement::rates;

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
        let mut columns: Vec<Regressor> = waves(on, angle, order).map(|wave| main(wave, std).called(Tag::WAVE)).into();
        if has_overtone {
            columns.extend(waves(on, angle, 2.0 * order).map(|wave| nuisance(wave, OVERTONE)));
        }
        columns
    })
    .parameters_by(move |on, _, c| {
        // c cos(x) + s sin(x) = A sin(x + phase).
        let [cos, sin] = c.wave(Tag::WAVE);
        let (amplitude, phase) = polar(sin, cos);
        let mut named = vec![(Name::AmplitudeArcsec, amplitude), (Name::PhaseRad, phase)];
        if !of_output {
            named.push((Name::GeneratorAmplitudeArcsec, amplitude * on.nominal.ratio.abs()));
        }
        named.extend(further());
        named
    })
    .exact()
}

/// The first order of an encoder: a disc off its axis.
fn encoder_eccentricity(of_output: bool) -> Law {
    let cause = match of_output {
        true => CauseName::OutputEncoderEccentricity,
        false => CauseName::GeneratorEncoderEccentricity,
    };
    encoder(cause, of_output, (1.0, 30.0), true, Vec::new)
}

/// The second order of an encoder: a disc or a magnet that is tilted, a ring that is not flat, two signals of unlike
/// size in a magnetic one. That of the generator has no overtone: overtones distinguish a wheel.
fn encoder_tilt(of_output: bool) -> Law {
    match of_output {
        true => encoder(CauseName::OutputEncoderTilt, true, (2.0, 15.0), true, Vec::new).kin_of_shapes(),
        false => encoder(CauseName::GeneratorEncoderTilt, false, (2.0, 15.0), false, Vec::new).after_wheels(),
    }
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

/// Change of values per second, row by row, from the neighbours in a session.
pub(super) fn rate(on: &Excitation<'_>, values: &[f64]) -> Vec<f64> {
    rates(&on.rows.sessions, &on.rows.time, values)
}

/// The output of a row is older than its generator.
fn sensor_latency() -> Law {
    let mut law = Law::new(CauseName::SensorLatency, |on, _| {
        let per_s = flexspline_base::units::ARCSEC_PER_RAD / on.nominal.ratio;
        let begun = on.scales.begin_s + 0.5 * on.scales.duration_s;
        // Without changes of the flank, which take a time of their own.
        let of_angle =
            by_row(on, |k| on.base.prediction[k] - on.base.half_backlash * on.base.flank[k] - on.base.wind_up[k]);
        let (waves, wind_up) = (rate(on, &of_angle), rate(on, &on.base.wind_up));
        let since = |k: usize| 2.0 * (on.rows.time[k] - begun) / on.scales.duration_s.max(1e-9);
        vec![
            // The error is that of the instant at which the output was read: its waves are where the generator was
            // then, …
            main(by_row(on, |k| -on.rows.speed[k] * per_s - waves[k]), DELAY_S).called(Tag::SIZE),
            // Two clocks seldom run at the same rate.
            nuisance(by_row(on, |k| -on.rows.speed[k] * per_s * since(k)), 0.3),
            // … and so is its wind-up, if it is the output that is read early, and not the generator; …
            nuisance(by_row(on, |k| -wind_up[k]), 1.0),
            // … a motor that gathers speed was slower then.
            nuisance(rate(on, &on.rows.speed).into_iter().map(|by| 0.5 * by * per_s).collect(), DELAY_S),
        ]
    })
    .parameters_by(|_, _, c| vec![(Name::DelayS, c.of(Tag::SIZE))])
    .exact();
    // Of a long delay in fast motion what comes with it is more than noise.
    law.search.whole_beside_noise = true;
    law
}

/// The error grows with the angle: the ratio is not what the nominal model says.
fn ratio_error() -> Law {
    Law::new(CauseName::RatioError, |on, _| {
        vec![main(by_row(on, |k| on.rows.output[k] * flexspline_base::units::ARCSEC_PER_RAD), 3e-4).called(Tag::SIZE)]
    })
    .parameters_by(|_, _, c| vec![(Name::RatioRelativeError, c.of(Tag::SIZE))])
    .exact()
}

/// Periods of a subdivision that the output has to turn through: fewer are a curve that anything may make.
const FEWEST_PERIODS: f64 = 1.5;

/// A wave of known size in a turn of an encoder.
fn simulated_encoder(law: Law, p: Values<'_>) -> Simulated {
    let (sin, cos) = p(Name::PhaseRad).sin_cos();
    law.with(p, &[], [sin, cos].map(|part| (Tag::WAVE, part * p(Name::AmplitudeArcsec))))
}

/// Subdivisions of both encoders, of the output's those that come often enough.
fn subdivisions(on: &Excitation<'_>) -> Vec<Law> {
    let turned = on.output_span_rad() / TAU;
    let of_output = SUBDIVISIONS.iter().filter(|order| turned * **order >= FEWEST_PERIODS);
    let generators = SUBDIVISIONS.iter().map(|order| encoder_subdivision(false, *order));
    generators.chain(of_output.map(|order| encoder_subdivision(true, *order))).collect()
}

/// The disc of the output encoder stands off its axis.
pub(crate) const OUTPUT_ENCODER_ECCENTRICITY: CauseSpec = CauseSpec {
    name: "output_encoder_eccentricity",
    words: "eccentricity of the output encoder",
    does: "one wave in an output turn, whatever the load",
    in_table: InTable::No(OF_THE_OUTPUT_ENCODER),
    made_by_loads: true,
    parameters: &[
        number(Name::AmplitudeArcsec, "at the output", 0.0, 10_000.0, Value(20.0)),
        phase("of sin(output + phase)"),
    ],
    laws: |_| vec![encoder_eccentricity(true)],
    simulated: |_, p| simulated_encoder(encoder_eccentricity(true), p),
    ..plain()
};

/// The amplitude of a wave of the generator's encoder there.
const AT_THE_GENERATOR: ParameterSpec =
    number(Name::GeneratorAmplitudeArcsec, "the same at the generator", 0.0, 1e5, Follows);
const BY_THE_RATIO: (Name, Name, Factor) = (Name::AmplitudeArcsec, Name::GeneratorAmplitudeArcsec, Factor::Ratio);

/// The disc of the generator's encoder stands off its axis.
pub(crate) const GENERATOR_ENCODER_ECCENTRICITY: CauseSpec = CauseSpec {
    name: "generator_encoder_eccentricity",
    words: "eccentricity of the generator encoder",
    does: "one wave in a generator turn, whatever the load",
    parameters: &[
        number(Name::AmplitudeArcsec, "at the output", 0.0, 1000.0, Value(10.0)),
        AT_THE_GENERATOR,
        phase("of sin(generator + phase)"),
    ],
    twins: &[BY_THE_RATIO],
    laws: |_| vec![encoder_eccentricity(false)],
    simulated: |_, p| simulated_encoder(encoder_eccentricity(false), p),
    ..plain()
};

/// The output encoder reads twice around wrong: a tilted disc, a magnet that is not square.
pub(crate) const OUTPUT_ENCODER_TILT: CauseSpec = CauseSpec {
    name: "output_encoder_tilt",
    words: "tilt of the output encoder",
    does: "two waves in an output turn, whatever the load",
    in_table: InTable::No(OF_THE_OUTPUT_ENCODER),
    parameters: &[
        number(Name::AmplitudeArcsec, "at the output", 0.0, 10_000.0, Value(15.0)),
        phase("of sin(2 output + phase)"),
    ],
    double_outside: true,
    laws: |_| vec![encoder_tilt(true)],
    simulated: |_, p| simulated_encoder(encoder_tilt(true), p),
    ..plain()
};

/// The generator's encoder reads twice around wrong.
pub(crate) const GENERATOR_ENCODER_TILT: CauseSpec = CauseSpec {
    name: "generator_encoder_tilt",
    words: "tilt of the generator encoder",
    does: "two waves in a generator turn, the same on both flanks and under any load",
    kin: Kin::Shape,
    parameters: &[
        number(Name::AmplitudeArcsec, "at the output", 0.0, 1000.0, Value(8.0)),
        AT_THE_GENERATOR,
        phase("of sin(2 generator + phase)"),
    ],
    twins: &[BY_THE_RATIO],
    laws: |_| vec![encoder_tilt(false)],
    simulated: |_, p| simulated_encoder(encoder_tilt(false), p),
    ..plain()
};

/// An encoder divides its periods unevenly: four and more waves around it.
pub(crate) const ENCODER_SUBDIVISION: CauseSpec = CauseSpec {
    name: "encoder_subdivision",
    words: "subdivision error of an encoder",
    does: "four waves or a multiple in a turn of an encoder, whatever the load and the speed",
    parameters: &[
        number(Name::AmplitudeArcsec, "at the output", 0.0, 1000.0, Value(6.0)),
        AT_THE_GENERATOR,
        number(Name::Harmonic, "waves in a turn of the encoder", 3.0, 65_536.0, Value(4.0)),
        ParameterSpec { words: ENCODERS, ..number(Name::Encoder, "0 generator, 1 output", 0.0, 1.0, Value(0.0)) },
        phase("of sin(harmonic angle + phase)"),
    ],
    twins: &[BY_THE_RATIO],
    laws: subdivisions,
    simulated: |_, p| simulated_encoder(encoder_subdivision(p(Name::Encoder) > 0.5, p(Name::Harmonic)), p),
    ..plain()
};

/// The output of a row is older than its generator.
pub(crate) const SENSOR_LATENCY: CauseSpec = CauseSpec {
    name: "sensor_latency",
    words: "time between the sensors",
    does: "output and generator are read at different instants: an error in proportion to speed",
    kin: Kin::Motion,
    needs: &[Need::Time],
    in_table: InTable::No("it follows the speed, and a table knows none"),
    made_by_loads: true,
    parameters: &[number(Name::DelayS, "positive: the output's is older", -0.1, 0.1, Value(0.002))],
    laws: |_| vec![sensor_latency()],
    simulated: |_, p| sensor_latency().with(p, &[], [(Tag::SIZE, p(Name::DelayS))]),
    ..plain()
};

/// The ratio is another one.
pub(crate) const RATIO_ERROR: CauseSpec = CauseSpec {
    name: "ratio_error",
    words: "another ratio",
    does: "the error grows with the angle",
    in_table: InTable::No("it grows from turn to turn, and a table repeats"),
    made_by_loads: true,
    parameters: &[number(Name::RatioRelativeError, "of the output angle", -0.01, 0.01, Value(1e-4))],
    laws: |_| vec![ratio_error()],
    simulated: |_, p| ratio_error().with(p, &[], [(Tag::SIZE, p(Name::RatioRelativeError))]),
    ..plain()
};
