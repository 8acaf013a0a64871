//! Deviations without a cause in the library. They compete with the causes: where one of them fits the data better, no
//! cause is named for it.

use std::f64::consts::TAU;
use std::ops::Range;

use super::geometry::{Angle, waves};
use super::stiffness::follow;
use super::{Excitation, Label, Law, Per, Shape, Shaped, Tag, by_row, main, times};
use crate::causes::ParameterName as Name;
use crate::measurement::FaultName;
use flexspline_base::units::ARCSEC_PER_RAD;

fn law(name: &'static str, values: impl Fn(&Excitation<'_>, usize) -> f64 + Send + Sync + 'static) -> Law {
    Law::new(name, move |on, _| vec![main(of_unit_size(by_row(on, |k| values(on, k))), 20.0)])
}

/// The column over its root mean square.
fn of_unit_size(column: Vec<f64>) -> Vec<f64> {
    let size = super::super::rows::rms(&column).max(1e-12);
    column.into_iter().map(|v| v / size).collect()
}

/// Lost motion before the generator, as of an Oldham coupling: whatever the load, the output lags by half of it either
/// way. So does an output that rubs.
fn lash_before_the_generator() -> Law {
    Law::new("friction of the output, or lost motion before the generator", |on, shape| {
        let half_rad = shape.of(Name::HalfLashArcsec) * on.nominal.ratio.abs() / ARCSEC_PER_RAD;
        let mut held = vec![0.0; on.rows.len()];
        for session in &on.rows.sessions {
            follow(&on.rows.generator, session.clone(), half_rad, 0.0, &mut held);
        }
        vec![main(by_row(on, |k| -held[k] * on.nominal.ratio.signum()), 20.0).called(Tag::SIZE)]
    })
    .shapes([Shape::by_factors(Name::HalfLashArcsec, 0.5, 60.0, 5)])
    .physical_if(|_, c| c.of(Tag::SIZE) > 0.0)
}

/// A coupling between the motor's encoder and the generator that gives way: it is wound up by what the load, friction,
/// oil and inertia of the generator ask of the motor, a ratio-th of which is seen at the output. Softer under load and
/// late in motion, at once.
fn coupling_before_the_generator() -> Law {
    const LOAD: Tag = Tag("load");
    const FRICTION: Tag = Tag("friction");
    Law::new("a coupling before the generator that gives way", |on, _| {
        let forward = on.nominal.ratio.signum();
        // Of the generator, it holds back what the output is turned on by.
        let held_back = |values: &dyn Fn(usize) -> f64| of_unit_size(by_row(on, |k| -forward * values(k)));
        let gathers = super::sensor::rate(on, &on.rows.speed);
        vec![
            main(of_unit_size(by_row(on, |k| on.rows.torque[k])), 20.0).called(LOAD),
            main(held_back(&|k| on.rows.direction[k]), 10.0).called(FRICTION),
            main(held_back(&|k| on.rows.speed[k]), 10.0),
            main(held_back(&|k| gathers[k]), 5.0),
        ]
    })
    .physical_if(|_, c| c.of(LOAD) > 0.0 && c.of(FRICTION) > 0.0)
}

/// Wind-up that comes late: what relaxes within about a second, ten, a hundred and a thousand, from rest under the
/// first load.
fn creep_under_load() -> Law {
    Law::new("creep under load", |on, _| {
        let late = |lasts_s: f64| {
            let reached = on.rows.lagged(&on.base.wind_up, lasts_s, false);
            main(by_row(on, |k| reached[k] - on.base.wind_up[k]), 0.3)
        };
        [1.0, 10.0, 100.0, 1000.0].into_iter().map(late).collect()
    })
}

/// Another zero in each session: a sensor that was taken off and put back. No session predicts the next one's.
fn zero_of_each_session() -> Law {
    let mut law = Law::new("another zero in each session", |on, _| {
        let of = |session: &std::ops::Range<usize>| by_row(on, |k| f64::from(u8::from(session.contains(&k))));
        on.rows.sessions_used().skip(1).map(|session| main(of(&session), 20.0)).collect()
    });
    law.wrong.foretells = false;
    measured(law)
}

/// What is measured, not modelled: it is wrong by nothing.
fn measured(mut law: Law) -> Law {
    law.wrong.misfit = 0.0;
    law
}

/// Spread of a fault of the data before the rows say anything, arcsec. *Guess*: beyond a few hundred nobody takes it
/// for the drive.
const OF_A_FAULT: f64 = 300.0;

/// A fault of the data that adds this to the error.
fn fault(
    (name, session, since_s): (FaultName, usize, f64),
    values: impl Fn(&Excitation<'_>, usize) -> f64 + Send + Sync + 'static,
) -> Law {
    let column = move |on: &Excitation<'_>, _: Shaped<'_>| vec![main(by_row(on, |k| values(on, k)), OF_A_FAULT)];
    measured(Law::new(Label::Fault { name, session, since_s }, column))
}

/// An index that an encoder lost so long after a session began: the error has another zero from there on.
pub fn index_step(session: usize, since_s: f64) -> Law {
    let mut law = fault((FaultName::EncoderIndexJump, session, since_s), move |on, k| {
        let Range { start, end } = on.rows.sessions[session];
        f64::from(u8::from(k >= start && (k >= end || on.rows.since[k] >= since_s)))
    });
    // Where each session has a zero of its own, no other shows it.
    law.wrong.foretells = false;
    law
}

/// A line at any order of an angle or of time: `per` is what it is counted against.
pub fn line(per: Per, order: f64) -> Law {
    let label = Label::Line { per, order };
    let of_angle = |of: Angle| Law::new(label, move |on, _| waves(on, of, order).map(|wave| main(wave, 15.0)).into());
    match per {
        Per::GeneratorTurn => return of_angle(Angle::Generator),
        Per::OutputTurn => return of_angle(Angle::Output),
        Per::Second => {}
    }
    // Nothing says that a line in time keeps its phase while nobody records.
    Law::new(label, move |on, _| {
        let turned = |k: usize| order * (TAU * on.rows.time[k]);
        let of = |session: &std::ops::Range<usize>, shift: f64| {
            let inside = |k: usize| if session.contains(&k) { (turned(k) - shift).cos() } else { 0.0 };
            main(by_row(on, inside), 15.0)
        };
        on.rows.sessions.iter().flat_map(|s| [of(s, 0.0), of(s, std::f64::consts::FRAC_PI_2)]).collect()
    })
}

/// Arcsec of an offset in a row, but for its size.
type Offset = fn(&Excitation<'_>, usize) -> f64;

/// Everything without a name that is always tried.
pub(crate) fn unnamed(on: &Excitation<'_>) -> Vec<Law> {
    let (warm, timed, loaded) = (on.rows.recorded.temperature, on.rows.recorded.time, on.scales.load > 0.0);
    let offsets: [(bool, &'static str, Offset); 12] = [
        (warm, "offset with temperature", warmer),
        (warm, "offset with temperature squared", |on, k| warmer(on, k).powi(2)),
        (timed, "creep since the session began (logarithm)", |on, k| (1.0 + on.rows.since[k]).ln()),
        (timed, "settling since the session began (exponential, 20 s)", |on, k| (-on.rows.since[k] / 20.0).exp()),
        (timed, "offset with the magnitude of speed", |on, k| on.rows.speed[k].abs()),
        (timed, "offset with speed squared", |on, k| on.rows.speed[k].powi(2)),
        (timed, "offset with speed squared, by direction", |on, k| on.rows.speed[k].powi(2) * on.rows.direction[k]),
        (true, "offset by direction", |on, k| on.rows.direction[k]),
        (loaded, "offset with the magnitude of torque", |on, k| on.rows.torque[k].abs()),
        (loaded, "offset with torque squared", |on, k| on.rows.torque[k].powi(2)),
        (loaded, "torque by direction", |on, k| on.rows.torque[k].abs() * on.rows.direction[k]),
        (loaded && timed, "wind-up with time", |on, k| on.base.wind_up[k] * since_begin(on, k)),
    ];
    let offsets = offsets.into_iter().filter(|(there, ..)| *there).map(|(_, name, values)| law(name, values));
    let mut laws: Vec<Law> = offsets.chain([lash_before_the_generator()]).collect();
    if timed {
        // Of all the time, as a share.
        laws.push(fault((FaultName::Drift, 0, 0.0), |on, k| since_begin(on, k) / on.scales.duration_s));
    }
    if on.rows.sessions_used().count() > 2 {
        laws.push(zero_of_each_session());
    }
    if loaded && timed {
        laws.extend([creep_under_load(), coupling_before_the_generator()]);
    }
    laws.extend([3.0, 5.0, 7.0, 10.0, 12.0].map(|order| line(Per::GeneratorTurn, order)));
    laws.push(line(Per::OutputTurn, 3.0));
    laws
}

/// Temperature above the nominal one, K.
fn warmer(on: &Excitation<'_>, k: usize) -> f64 {
    on.rows.temperature[k] - on.nominal.temperature_c
}

/// Time since the first row, s.
fn since_begin(on: &Excitation<'_>, k: usize) -> f64 {
    on.rows.time[k] - on.rows.time[0]
}

/// A function of one or two quantities, free but for its smoothness: hats on a grid.
fn map(name: &'static str, grids: Vec<(Vec<f64>, usize)>) -> Law {
    Law::new(name, move |on, _| {
        let n = on.rows.len();
        let mut columns: Vec<Vec<f64>> = vec![vec![1.0; n]];
        for (values, nodes) in &grids {
            let low = super::super::rows::quantile(values.iter().copied(), 0.01);
            let high = super::super::rows::quantile(values.iter().copied(), 0.99);
            if high <= low {
                continue;
            }
            let hats: Vec<Vec<f64>> = (0..*nodes)
                .map(|j| {
                    let hat = |v: &f64| {
                        let place = ((v - low) / (high - low)).clamp(0.0, 1.0) * (*nodes - 1) as f64;
                        (1.0 - (place - j as f64).abs()).max(0.0)
                    };
                    values.iter().map(hat).collect()
                })
                .collect();
            columns = columns.iter().flat_map(|column| hats.iter().map(|hat| times(column, hat))).collect();
        }
        columns.into_iter().map(|values| main(values, 10.0)).collect()
    })
}

/// The residual as a free function of measured quantities: tried only when the causes are in, to see whether anything
/// is left.
pub(crate) fn maps(on: &Excitation<'_>) -> Vec<Law> {
    let rows = on.rows;
    let (warm, timed, loaded) = (rows.recorded.temperature, rows.recorded.time, on.scales.load > 0.0);
    let turn = |angle: &[f64]| angle.iter().map(|a| a.rem_euclid(TAU)).collect::<Vec<f64>>();
    let (torque, temperature) = (&rows.torque, &rows.temperature);
    let maps = [
        (true, "a function of the generator angle", vec![(turn(&rows.generator), 25)]),
        (true, "a function of the angle on the circular spline", vec![(turn(&rows.on_circular_spline), 25)]),
        (true, "a function of the output angle", vec![(turn(&rows.output), 13)]),
        (loaded, "a function of torque and direction", vec![(torque.clone(), 11), (rows.direction.clone(), 2)]),
        (warm, "a function of temperature", vec![(temperature.clone(), 6)]),
        (warm && loaded, "a function of torque and temperature", vec![(torque.clone(), 6), (temperature.clone(), 4)]),
        (timed, "a function of speed", vec![(rows.speed.clone(), 12)]),
        (timed && loaded, "a function of torque and time", vec![(torque.clone(), 6), (rows.time.clone(), 4)]),
    ];
    maps.into_iter().filter(|(there, ..)| *there).map(|(_, name, grids)| map(name, grids)).collect()
}
