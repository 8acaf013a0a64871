//! What the sensors do: geometry of the encoders, time between their readings, a wrong ratio. None knows of load.

use super::{Excitation, Law, Role, by_row, main, nuisance, polar};
use crate::causes::{CauseName, ParameterName as Name};

/// The first order of an encoder.
const WAVE: Role = Role("wave");

fn encoder(cause: CauseName, phase: fn(&Excitation<'_>, usize) -> f64, per_ratio: bool) -> Law {
    Law::new(cause, move |on, _| {
        let wave = |order: f64, shift: f64| by_row(on, |k| (order * phase(on, k) - shift).cos());
        let quarter = std::f64::consts::FRAC_PI_2;
        vec![
            main(wave(1.0, 0.0), 30.0).called(WAVE),
            main(wave(1.0, quarter), 30.0).called(WAVE),
            nuisance(wave(2.0, 0.0), 0.15),
            nuisance(wave(2.0, quarter), 0.15),
        ]
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

/// The output is read later than the generator.
fn sensor_latency() -> Law {
    Law::new(CauseName::SensorLatency, |on, _| {
        let per_s = crate::units::ARCSEC_PER_RAD / on.nominal.ratio;
        let begun = on.scales.begin_s + 0.5 * on.scales.duration_s;
        let since = |k: usize| 2.0 * (on.rows.time[k] - begun) / on.scales.duration_s.max(1e-9);
        vec![
            main(by_row(on, |k| -on.rows.speed[k] * per_s), 5e-3).called(Role::SIZE),
            // Two clocks seldom run at the same rate.
            nuisance(by_row(on, |k| -on.rows.speed[k] * per_s * since(k)), 0.3),
        ]
    })
    .parameters_by(|_, _, c| vec![(Name::DelayS, c.of(Role::SIZE))])
}

/// The error grows with the angle: the ratio is not what the nominal model says.
fn ratio_error() -> Law {
    Law::new(CauseName::RatioError, |on, _| {
        vec![main(by_row(on, |k| on.rows.output[k] * crate::units::ARCSEC_PER_RAD), 3e-4).called(Role::SIZE)]
    })
    .parameters_by(|_, _, c| vec![(Name::RatioRelativeError, c.of(Role::SIZE))])
}

pub(super) fn laws() -> Vec<Law> {
    let laws = [
        encoder(CauseName::OutputEncoderEccentricity, |on, k| on.rows.output[k], false),
        encoder(CauseName::GeneratorEncoderEccentricity, |on, k| on.rows.generator[k], true),
        ratio_error(),
        sensor_latency(),
    ];
    laws.into_iter().map(Law::exact).collect()
}
