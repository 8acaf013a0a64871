//! Causes that move the load: gravity that the torque column does not hold, and the load's inertia on the drive's
//! spring.

use std::f64::consts::PI;

use super::{Coefficients, Excitation, Law, Regressor, Shape, Shaped, Tag, by_row, main, main_about, of_both};
use crate::causes::ParameterName as Name;
use crate::causes::spec::{
    CauseName, CauseSpec, InTable, Kin, Need,
    Usual::{OfLoad, Value},
    number, phase, plain,
};
use crate::diagnosis::base::{PlayLaw, WAVE_OF_LOAD};
use crate::diagnosis::rows::quantile;
use crate::diagnosis::thinned::Thinned;
use flexspline_base::units::ARCSEC_PER_RAD;

/// Moments, over the scale of the load, and directions that are tried on a drive without load; and how closely the best
/// is followed.
const MOMENTS: [f64; 5] = [0.2, 0.35, 0.6, 1.0, 1.6];
const DIRECTIONS: usize = 16;
const CLOSER: usize = 6;

/// Moment and phase with which the `load` leaves least of the error by the flanks that it turns over. Where it turns
/// one over too early or too late rows are off by the whole clearance, which a wander would follow: so all rows count
/// alike.
fn moment_that_turns_flanks(
    on: &Excitation<'_>,
    play: PlayLaw,
    scale: f64,
    load: impl Fn(&Excitation<'_>, [f64; 2]) -> Vec<f64> + Sync,
) -> [f64; 2] {
    use rayon::prelude::*;
    let (rows, base) = (on.rows, on.base);
    let used: Vec<usize> = rows.sessions_used().flatten().collect();
    let spread = |shape: &[f64; 2]| -> f64 {
        let torque: Vec<f64> = rows.torque.iter().zip(load(on, *shape)).map(|(t, added)| t + added).collect();
        let flank = play.flanks(rows, &torque, on.nominal);
        let left = |k: &usize| {
            let turned_over = base.half_backlash * (flank[*k] - base.flank[*k]);
            rows.error[*k] - base.prediction[*k] - on.wound_up(*k, torque[*k]) - turned_over
        };
        let left: Vec<f64> = used.iter().map(left).collect();
        let mean = left.iter().sum::<f64>() / left.len().max(1) as f64;
        left.iter().map(|left| (left - mean).powi(2)).sum()
    };
    let least = |tried: Vec<[f64; 2]>| -> ([f64; 2], f64) {
        let judged = tried.into_par_iter().map(|shape| (shape, spread(&shape)));
        judged.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or(([scale, 0.0], f64::INFINITY))
    };
    let (mut turn, mut factor) = (2.0 * PI / DIRECTIONS as f64, 1.6f64);
    let every = |moment: f64| (0..DIRECTIONS).map(move |k| [moment * scale, turn * k as f64]);
    let (mut best, mut spread_of_best) = least(MOMENTS.into_iter().flat_map(every).collect());
    for _ in 0..CLOSER {
        (turn, factor) = (0.5 * turn, factor.sqrt());
        let [moment, phase] = best;
        let near = [1.0 / factor, 1.0, factor]
            .into_iter()
            .flat_map(|by| [-turn, 0.0, turn].map(|of| [by * moment, phase + of]));
        let (better, spread) = least(near.collect());
        if spread < spread_of_best {
            (best, spread_of_best) = (better, spread);
        }
    }
    [best[0], best[1].rem_euclid(2.0 * PI)]
}

/// How far a load is off the one that its law was put to. *Guess*: what a step between places leaves.
const AS_FITTED: f64 = 0.02;

/// The columns of a load that the torque does not hold: its wind-up and the play that it moves by this law, as wide as
/// that of a unit may be.
pub(super) fn columns_of_load(on: &Excitation<'_>, added: &[f64], law: PlayLaw) -> Vec<Regressor> {
    let torque = of_both(&on.rows.torque, added, |torque, added| torque + added);
    let flank = law.flanks(on.rows, &torque, on.nominal);
    let play = by_row(on, |k| on.base.half_backlash * (flank[k] - on.base.flank[k]));
    let together = by_row(on, |k| on.wound_up(k, torque[k]) + play[k]);
    vec![main_about(1.0, together, AS_FITTED).called(Tag::SIZE), main(play, on.nominal.spread.backlash.max(AS_FITTED))]
}

/// An unbalanced load, m g l sin of the output angle against gravity: adds to the torque, so it winds the drive up and
/// moves the play. On a drive without load, `on_sample` says where to begin.
fn gravity_torque(play: PlayLaw, on: &Excitation<'_>, on_sample: &Excitation<'_>) -> Law {
    let scale = on.plausible_load();
    // Next to no moment of a law of another play is that play alone; with the play that is there it adds next to
    // nothing.
    let least = if play == on.base.law { LEAST_MOMENT } else { LEAST_MOMENT_OF_ANOTHER_PLAY };
    let load = move |on: &Excitation<'_>, [moment, phase]: [f64; 2]| -> Vec<f64> {
        let rows = on.rows;
        by_row(on, |k| moment * (rows.output[k] + rows.orientation[k] + phase).sin())
    };
    let of = |shape: Shaped<'_>| [shape.of(Name::TorqueNM), shape.of(Name::PhaseRad)];
    // Where nothing else loads the drive, its moment decides which flank carries, and no linear law is near.
    let by_flank = on.unloaded().then(|| moment_that_turns_flanks(on_sample, play, scale, load));
    Law::new(CauseName::GravityTorque, move |on, shape| columns_of_load(on, &load(on, of(shape)), play))
        .shapes([
            Shape::by_factors(Name::TorqueNM, 0.75 * least * scale, 2.0 * scale, 1),
            Shape::angle(Name::PhaseRad, 2.0 * PI, 1),
        ])
        .parameters_by(|_, shape, c| {
            let torque_n_m = shape.of(Name::TorqueNM) * c.of(Tag::SIZE);
            vec![(Name::TorqueNM, torque_n_m), (Name::PhaseRad, shape.of(Name::PhaseRad))]
        })
        .physical_if(move |shape, _| shape.of(Name::TorqueNM) > least * scale)
        .adds_load(move |on, shape| load(on, of(shape)))
        .led_by(
            move |on, _| {
                let slope = |k: usize| on.wound_up(k, on.rows.torque[k] + 1.0);
                let at = |k: usize| on.rows.output[k] + on.rows.orientation[k];
                vec![
                    main(by_row(on, |k| slope(k) * at(k).sin()), 0.3 * scale).called(SINE),
                    main(by_row(on, |k| slope(k) * at(k).cos()), 0.3 * scale).called(COSINE),
                ]
            },
            move |shape, c| {
                // a sin(x) + b cos(x) = m sin(x + phase).
                let (sin, cos) = (c.of(SINE), c.of(COSINE));
                let by_wind_up = [sin.hypot(cos), cos.atan2(sin).rem_euclid(2.0 * PI)];
                [by_wind_up]
                    .into_iter()
                    .chain(by_flank)
                    .map(|[moment, phase]| shape.with(&[(Name::TorqueNM, moment), (Name::PhaseRad, phase)]))
                    .collect()
            },
        )
}

/// Least moment, as a share of the load. *Guess*: moments of 0.09 and 0.13 N·m of examinations, 2.1 and 2.6″ rms, were
/// below the one of another play.
const LEAST_MOMENT: f64 = 0.001;
/// The same where the law of the play is another one than that found before. *Guess*.
const LEAST_MOMENT_OF_ANOTHER_PLAY: f64 = 0.004;

/// In the lead: parts of the moment.
const SINE: Tag = Tag("sine");
const COSINE: Tag = Tag("cosine");
/// Motions that make the load swing: wind-up, kinematic error, the turning itself.
const WIND_UP: Tag = Tag("wind-up");
const KINEMATIC: Tag = Tag("kinematic error");
const TURNING: Tag = Tag("turning");

/// A load that is damped more than this does not swing.
const MOST_DAMPING: f64 = 0.5;
/// A damping beyond this share of the largest stands on the bound, or as good as: what is fitted hardly swings, and a
/// flank or a reading that takes some milliseconds looks like it.
const ON_THE_BOUND: f64 = 0.8;

/// Spread of the share of a jump that makes the load ring, in addition to that of a step of the torque.
const SLIDING: f64 = 0.3;

/// Speeds that are apart by this share make the waves of the drive sweep over frequencies; a load that changes by this
/// share in this many seconds is a step. Guesses.
const SPEEDS_APART: f64 = 0.2;
const STEP_SHARE: f64 = 0.1;
const STEP_S: f64 = 0.1;
/// Starts, stops and steps that have to be there.
const FEWEST_STEPS: usize = 3;

/// Whether speed or load changes so that a load on a spring would swing: waves at one speed are a line in time,
/// whatever makes them.
pub(super) fn makes_a_load_swing(on: &Excitation<'_>) -> bool {
    let rows = on.rows;
    if !on.scales.jumps.is_empty() {
        return true;
    }
    let speeds = |share: f64| quantile(rows.speed.iter().map(|speed| speed.abs()), share);
    let (slow, fast) = (speeds(0.1), speeds(0.9));
    if fast - slow > SPEEDS_APART * fast {
        return true;
    }
    let apart = (STEP_S / rows.period.max(1e-9)).ceil().max(1.0) as usize;
    let steps_of = |values: &[f64], least: f64| -> usize {
        let steps = |within: &[f64]| {
            let later = within.iter().skip(apart).step_by(apart);
            within.iter().step_by(apart).zip(later).filter(|(a, b)| (*a - *b).abs() > least).count()
        };
        rows.sessions.iter().map(|session| steps(&values[session.clone()])).sum()
    };
    let of_speed = steps_of(&rows.speed, SPEEDS_APART * fast.max(1e-9));
    let of_load = if on.scales.load > 0.0 { steps_of(&rows.torque, STEP_SHARE * on.scales.load) } else { 0 };
    of_speed + of_load >= FEWEST_STEPS
}

/// Sum of all jumps, each from where it has half its height on, if there are any.
fn skipped(on: &Excitation<'_>) -> Option<Vec<f64>> {
    let jumps = &on.scales.jumps;
    (!jumps.is_empty()).then(|| by_row(on, |k| jumps.iter().map(|jump| jump.reached(on.rows.time[k])).sum()))
}

/// Response of a mass on a spring to `driven`, less what it is driven to.
fn ringing(on: &Excitation<'_>, driven: &[f64], frequency_hz: f64, damping: f64) -> Vec<f64> {
    let rows = on.rows;
    let omega = 2.0 * PI * frequency_hz;
    let mut less = vec![0.0; driven.len()];
    for session in &rows.sessions {
        let first = session.start;
        let (mut x, mut v) = (driven[first], 0.0);
        let (mut dt_known, mut step) = (f64::NAN, [0.0; 4]);
        for k in first + 1..session.end {
            let dt = rows.time[k] - rows.time[k - 1];
            if (dt - dt_known).abs() > 1e-9 * dt.abs() || dt_known.is_nan() {
                (dt_known, step) = (dt, transition(omega, damping, dt));
            }
            // Straight from one row to the next: exact for the mass under a ramp.
            let slope = if dt > 0.0 { (driven[k] - driven[k - 1]) / dt } else { 0.0 };
            let lag = 2.0 * damping / omega;
            let (off, rate) = (x - driven[k - 1] + lag * slope, v - slope);
            x = driven[k] - lag * slope + step[0] * off + step[1] * rate;
            v = slope + step[2] * off + step[3] * rate;
            less[k] = x - driven[k];
        }
    }
    less
}

/// Free motion of a damped oscillator over `dt`: position and velocity after from before.
fn transition(omega: f64, damping: f64, dt: f64) -> [f64; 4] {
    let zeta = damping.min(0.999);
    let (decay, turned) = (omega * zeta, omega * (1.0 - zeta * zeta).sqrt());
    let (fade, c, s) = ((-decay * dt).exp(), (turned * dt).cos(), (turned * dt).sin());
    [
        fade * (c + decay / turned * s),
        fade * s / turned,
        -fade * omega * omega / turned * s,
        fade * (c - decay / turned * s),
    ]
}

/// How far the load swings beyond what drives it: the gain of wind-up or of kinematic error, whichever adds more. The
/// other may have any gain, as badly known as it is.
fn gain_of(c: Coefficients<'_>) -> f64 {
    c.of(if c.adds(KINEMATIC) > c.adds(WIND_UP) { KINEMATIC } else { WIND_UP })
}

/// A load on a spring swings beyond where it is driven to, and not short of it as what hangs on a string may: its gain
/// is not below none by more than this. *Guess*: eleven resonances of the examinations have 0.2 to 1.9.
const NO_GAIN: f64 = 0.1;

/// The load's inertia on the torsion of the drive: rings after steps of the torque, where the kinematic error meets its
/// frequency, and where teeth skip.
fn torsional_resonance(on: &Excitation<'_>) -> Law {
    let fastest = 0.45 / on.rows.period;
    let mut law = Law::new(CauseName::TorsionalResonance, |on, shape| {
        let (frequency, damping) = (shape.of(Name::FrequencyHz), shape.of(Name::DampingRatio));
        let base = on.base;
        let kinematic = by_row(on, |k| base.prediction[k] - base.wind_up[k]);
        let turning: Vec<f64> = on.rows.output.iter().map(|out| out * ARCSEC_PER_RAD).collect();
        let lag = 2.0 * damping / (2.0 * PI * frequency);
        let moved = ringing(on, &turning, frequency, damping);
        // A steady speed is no lag of a mass whose damper is inside the drive.
        let moved = by_row(on, |k| moved[k] + lag * on.rows.speed[k] / on.nominal.ratio * ARCSEC_PER_RAD);
        let skipped = skipped(on);
        let moved_to = by_row(on, |k| base.wind_up[k] + skipped.as_ref().map_or(0.0, |skipped| skipped[k]));
        let mut columns = vec![
            main(ringing(on, &moved_to, frequency, damping), 1.0).called(WIND_UP),
            main(ringing(on, &kinematic, frequency, damping), 1.0).called(KINEMATIC),
        ];
        // The scatter of when an angle is read swings as a load would that the turning shakes: then the turning says
        // nothing.
        if !on.rows.jitters {
            columns.push(main(moved, 0.5).called(TURNING));
        }
        // Teeth that slide into the next space do so less suddenly.
        columns.extend(skipped.map(|skipped| main(ringing(on, &skipped, frequency, damping), SLIDING)));
        columns
    })
    .shapes([
        Shape::by_factors(Name::FrequencyHz, 1.0f64.min(0.3 * fastest), fastest.clamp(0.5, 80.0), 28),
        Shape::by_factors(Name::DampingRatio, 0.008, MOST_DAMPING, 3),
    ])
    .parameters_by(|_, shape, c| {
        let shape = |name| (name, shape.of(name));
        vec![shape(Name::FrequencyHz), shape(Name::DampingRatio), (Name::Gain, gain_of(c))]
    })
    .physical_if(|shape, c| {
        let swings = shape.of(Name::DampingRatio) < ON_THE_BOUND * MOST_DAMPING;
        swings && gain_of(c) > -NO_GAIN && [WIND_UP, KINEMATIC, TURNING].into_iter().any(|role| c.of(role) > 0.0)
    });
    // It rings most when the load turns over.
    law.acts.in_crossings = true;
    // Rows are joined by straight lines.
    law.wrong.doubt = 0.006;
    law
}

/// Models of an unbalanced load: the load that gravity adds moves the torque at which the play turns over, so that the
/// law which the play follows there shows only now.
fn gravity_torques(on: &Excitation<'_>) -> Vec<Law> {
    let known = [PlayLaw::Held, PlayLaw::Pushed];
    // It is one with a spring that nobody knows.
    let is_told = on.base.floating.iter().all(|of| of.name != WAVE_OF_LOAD);
    let plays = known.into_iter().chain(Some(on.base.law).filter(|law| !known.contains(law))).filter(|_| is_told);
    let thinned = if on.unloaded() { Thinned::of(on, 1) } else { None };
    let on_sample = thinned.as_ref().map_or(*on, |thinned| on.over(&thinned.rows, &thinned.base));
    plays.map(|play| gravity_torque(play, on, &on_sample).variant(play.row())).collect()
}

/// Gravity turns an unbalanced load, which the torque column does not hold.
pub(crate) const GRAVITY_TORQUE: CauseSpec = CauseSpec {
    name: "gravity_torque",
    words: "unbalanced load",
    does: "gravity on the load, which the torque column does not hold",
    kin: Kin::Torque,
    needs: &[Need::Spring],
    in_table: InTable::AtOneOrientation,
    made_by_loads: true,
    parameters: &[
        number(Name::TorqueNM, "m g l", 0.0, 1e5, OfLoad(0.2)),
        phase("of sin(output + orientation + phase)"),
    ],
    laws: gravity_torques,
    simulated: |on, p| gravity_torque(on.base.law, on, on).with(p, &[], []),
    ..plain()
};

/// The inertia of the load swings on the spring of the drive.
pub(crate) const TORSIONAL_RESONANCE: CauseSpec = CauseSpec {
    name: "torsional_resonance",
    words: "torsional resonance",
    does: "the inertia of the load on the spring of the drive",
    needs: &[Need::Time, Need::Swings],
    in_table: InTable::No("it follows the motion in time, and a table knows steady motion alone"),
    made_by_loads: true,
    parameters: &[
        number(Name::FrequencyHz, "of the free oscillation", 0.1, 1000.0, Value(8.0)),
        number(Name::DampingRatio, "of critical damping", 0.001, 0.9, Value(0.03)),
    ],
    laws: |on| vec![torsional_resonance(on)],
    simulated: |on, p| torsional_resonance(on).with(p, &[], [WIND_UP, KINEMATIC, TURNING].map(|role| (role, 1.0))),
    ..plain()
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gain_of_a_resonance_is_that_of_what_adds_most() {
        let roles = [WIND_UP, KINEMATIC];
        // A kinematic error of next to nothing says nothing of its gain.
        let c = Coefficients::new(&roles, &[0.6, -1.1]);
        assert_eq!(gain_of(c.of_sizes(&[30.0, 0.4])), 0.6);
        assert_eq!(gain_of(c.of_sizes(&[0.0, 0.4])), -1.1);
        assert_eq!(gain_of(c), -1.1, "columns that are not known count alike");
    }
}
