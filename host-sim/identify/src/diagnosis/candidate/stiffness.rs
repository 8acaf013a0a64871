//! Causes that follow the torque, beyond the nominal wind-up and play.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use super::super::prepare::Jump;
use super::geometry::{Angle, angle, pulse, weighted_waves};
use super::{Coefficients, Excitation, Law, Shape, Shaped, Tag, by_row, main, nuisance};
use crate::causes::ParameterName as Name;
use crate::causes::spec::{
    CauseName, CauseSpec, InTable, Kin, Need, TIME,
    Usual::{OfLoad, ToothPitch, Value},
    number, plain,
};
use flexspline_base::units::ARCSEC_PER_TURN;

/// Torque in units of the load scale.
fn load_share(on: &Excitation<'_>, k: usize) -> f64 {
    on.rows.torque[k] / on.scales.load.max(1e-9)
}

/// The spring part of a slip element (stop operator): follows the torque up to ±`slip`, in units of `slip`. Each
/// session begins with the element at rest before its first load.
pub(super) fn stop_operator(on: &Excitation<'_>, slip: f64) -> Vec<f64> {
    let torque = &on.rows.torque;
    let mut held = vec![0.0; torque.len()];
    for session in &on.rows.sessions {
        let first = torque.get(session.start).map_or(0.0, |t| t.clamp(-slip, slip));
        follow(torque, session.clone(), slip, first, &mut held);
    }
    held
}

/// The element through one session, from what it holds at the first row.
pub(super) fn follow(torque: &[f64], session: Range<usize>, slip: f64, first: f64, held: &mut [f64]) {
    let mut z = first;
    for k in session.clone() {
        if k > session.start {
            z = (z + torque[k] - torque[k - 1]).clamp(-slip, slip);
        }
        held[k] = z / slip;
    }
}

/// The spring that a hysteresis is stated by, and those that slip earlier and later: at these shares of its torque.
const SPRING: Tag = Tag("spring");
const EARLIER_SPRING: Tag = Tag("spring that slips earlier");
const LATER_SPRING: Tag = Tag("spring that slips later");
const EARLIER: f64 = 0.35;
const LATER: f64 = 2.5;
/// Wear that grows faster than the law says.
const FASTER: Tag = Tag("faster");
/// A jump by whole teeth.
const JUMP: Tag = Tag("jump");

/// Half the opening of a loop at no torque, arcsec: on the way back from the full load an element holds this share of
/// what it can when the torque passes zero.
fn half_width(full: f64, shape: Shaped<'_>, c: Coefficients<'_>) -> f64 {
    let slips = shape.of(Name::SlipTorqueNM);
    let springs = [(1.0, SPRING), (EARLIER, EARLIER_SPRING), (LATER, LATER_SPRING)];
    springs.iter().map(|(factor, role)| c.of(*role) * held(full, factor * slips)).sum()
}

/// Share of its torque that an element which slips at `slip` holds when the torque passes zero.
fn held(full: f64, slip: f64) -> f64 {
    ((full - slip) / slip).clamp(0.0, 1.0)
}

/// Springs that slip one after the other (Maxwell slip, Prandtl-Ishlinskii): the output lags the torque by what they
/// hold.
fn torsional_hysteresis(on: &Excitation<'_>) -> Law {
    let load = on.scales.load;
    let mut law = Law::new(CauseName::TorsionalHysteresis, |on, shape| {
        let slip = shape.of(Name::SlipTorqueNM);
        let usual = on.nominal.wind_up_arcsec(on.scales.load).mul_add(0.3, 30.0);
        let negative = |values: Vec<f64>| values.into_iter().map(|z| -z).collect::<Vec<f64>>();
        vec![
            // The opening is a share of the wind-up: a plastic gear's is wide, a steel drive's at rated load 0.5 to 2'
            // of 3'.
            main(negative(stop_operator(on, slip)), usual).called(SPRING),
            nuisance(negative(stop_operator(on, EARLIER * slip)), 0.35).called(EARLIER_SPRING),
            nuisance(negative(stop_operator(on, LATER * slip)), 0.5).called(LATER_SPRING),
            nuisance(by_row(on, |k| load_share(on, k)), 0.25),
            nuisance(by_row(on, |k| load_share(on, k).powi(3)), 0.15),
        ]
    })
    .shapes([Shape::by_factors(Name::SlipTorqueNM, 0.03 * load, 1.0 * load, 6)])
    .parameters_by(move |_, shape, c| {
        vec![(Name::HalfWidthArcsec, half_width(load, shape, c)), (Name::SlipTorqueNM, shape.of(Name::SlipTorqueNM))]
    })
    // All springs together take work; of three that stand for many one may be too much.
    .physical_if(move |shape, c| half_width(load, shape, c) > 0.0);
    // Three elements stand for the many of a real drive: where the load passes zero they hold about, not exactly, as
    // much (a fifth to a quarter less than springs that give way smoothly, hidden in made-up data).
    law.wrong.doubt = 0.15;
    law.search.whole = true;
    law.wrong.misfit_unnamed = LOOKS_LIKE_CREEP;
    // What springs hold goes with the load; the wind-up in the law takes that back.
    law.wrong.most_nuisance = 2.0;
    law
}

/// Share of a loop by which another curve of it may look like something that lags the load in time: where the load
/// swings with one period the two are one. *Chosen* on Bouc-Wen loops of 2 to 12 arcsec, none of which were named
/// before.
const LOOKS_LIKE_CREEP: f64 = 0.5;
/// Stiffer the higher the load: the wind-up lags behind the nominal line by a power of the torque.
fn stiffness_hardening() -> Law {
    Law::new(CauseName::StiffnessHardening, |on, shape| {
        let power = |n: f64| by_row(on, |k| -load_share(on, k).signum() * load_share(on, k).abs().powf(n));
        let exponent = shape.of(Name::Exponent);
        vec![
            main(power(exponent), 30.0).called(Tag::SIZE),
            nuisance(power(1.0), 0.4),
            nuisance(power(exponent + 1.5), 0.3),
        ]
    })
    .shapes([Shape::evenly(Name::Exponent, 1.6, 4.4, 3)])
    .parameters_by(|on, shape, c| {
        vec![
            (Name::HardeningArcsec, c.of(Tag::SIZE)),
            (Name::HardeningExponent, shape.of(Name::Exponent)),
            (Name::FullLoadNM, on.scales.load),
        ]
    })
    .physical_if(|_, c| c.of(Tag::SIZE) > 0.0)
}

/// A wind-up cannot lose more of itself than this: beyond, something else stands in for it. *Chosen*.
const LARGEST_SHARE_LOST: f64 = 0.95;
fn stiffness_error() -> Law {
    let mut law =
        Law::new(CauseName::StiffnessError, |on, _| vec![main(on.base.wind_up.clone(), 0.5).called(Tag::SIZE)])
            .parameters_by(|_, _, c| vec![(Name::StiffnessRatio, 1.0 / (1.0 + c.of(Tag::SIZE)))])
            .physical_if(|_, c| c.of(Tag::SIZE) > -LARGEST_SHARE_LOST);
    law.acts.tolerance_of = Some(super::among::STIFFNESS);
    law
}

/// Share by which the law of a cracked root may be wrong in either of two ways: a crack that opens bends more than one
/// that is pressed shut, and the two loaded zones may carry unequally. *Guess*.
const OTHER_CRACK: f64 = 0.3;
/// A tooth of the circular spline that is cracked at its root: the drive winds up more, both ways, while a loaded zone
/// is on it, twice in a turn of the wave on that wheel. Without load it is where it was.
fn cracked_tooth_root() -> Law {
    const WHEEL: Angle = Angle::CircularSpline;
    Law::new(CauseName::CrackedToothRoot, |on, shape| {
        let (place, width) = (shape.of(Name::AngleRad), shape.of(Name::WidthRad));
        let size = by_row(on, |k| load_share(on, k) * pulse(angle(on, WHEEL, k) - place, width));
        let opening = size.iter().map(|v| v.abs()).collect();
        let lobe = by_row(on, |k| size[k] * (angle(on, WHEEL, k) - place).cos().signum());
        vec![main(size, 30.0).called(Tag::SIZE), nuisance(opening, OTHER_CRACK), nuisance(lobe, OTHER_CRACK)]
    })
    .shapes([Shape::angle(Name::AngleRad, PI, 30), Shape::by_factors(Name::WidthRad, 0.03, 0.4, 2)])
    .parameters_by(|on, shape, c| {
        vec![
            (Name::AmplitudeArcsec, c.of(Tag::SIZE)),
            (Name::FullLoadNM, on.scales.load),
            (Name::AngleRad, shape.of(Name::AngleRad)),
            (Name::WidthRad, shape.of(Name::WidthRad)),
        ]
    })
    .physical_if(|_, c| c.of(Tag::SIZE) > 0.0)
    .well_known()
}

/// Share of a grown clearance by which it may differ around a wheel.
const UNEVEN_WEAR: f64 = 0.15;

fn backlash_growth() -> Law {
    let mut law = Law::new(CauseName::BacklashGrowth, |on, _| {
        let half = on.base.half_backlash.max(1.0);
        let mut columns = vec![main(by_row(on, |k| half * on.base.flank[k]), 1.0).called(Tag::SIZE)];
        // Teeth that are used most wear most.
        if on.nominal.teeth.is_some() {
            for wheel in [Angle::Flexspline, Angle::CircularSpline] {
                columns.extend(weighted_waves(on, wheel, 2.0, &on.base.flank).map(|v| nuisance(v, UNEVEN_WEAR)));
            }
        }
        columns
    })
    .parameters_by(|on, _, c| vec![(Name::GrowthArcsec, 2.0 * c.of(Tag::SIZE) * on.base.half_backlash.max(1.0))])
    .physical_if(|_, c| c.of(Tag::SIZE) > 0.0);
    law.acts.tolerance_of = Some("backlash");
    law
}

/// A clearance that widens during the data, with the travel of the generator.
fn wear() -> Law {
    Law::new(CauseName::Wear, |on, shape| {
        let travel = &on.rows.travel;
        let travelled = |sum: &mut f64, k: usize| {
            *sum += (travel[k] - travel[k.saturating_sub(1)]).max(0.0);
            Some(*sum)
        };
        let done: Vec<f64> = (0..travel.len()).scan(0.0, travelled).collect();
        let all = on.scales.travel.max(1e-12);
        let exponent = shape.of(Name::Exponent);
        let widened = |k: usize| (done[k] / all).powf(exponent);
        vec![
            main(by_row(on, |k| on.base.flank[k] * widened(k)), 30.0).called(Tag::SIZE),
            nuisance(by_row(on, |k| on.base.flank[k] * widened(k).powi(2)), 0.25).called(FASTER),
            nuisance(by_row(on, |k| on.base.flank[k]), 0.25),
        ]
    })
    .shapes([Shape::by_factors(Name::Exponent, 0.5, 2.0, 1)])
    .parameters_by(|_, shape, c| {
        let growth_arcsec = 2.0 * (c.of(Tag::SIZE) + c.of(FASTER));
        vec![(Name::GrowthArcsec, growth_arcsec), (Name::Exponent, shape.of(Name::Exponent))]
    })
    .physical_if(|_, c| c.of(Tag::SIZE) > 0.0)
    .well_known()
}

/// Growth of the clearance between two sessions.
const STEP: Tag = Tag("step between sessions");
/// A clearance that is narrower in a session than before does not wear; nor does one that is by less than this share of
/// all its growth. *Guess*.
const NOT_NARROWER: f64 = 0.1;
/// Fewest sessions and most in which wear may go on between them. Of two any change of the clearance would be a growth,
/// as it has one step and no order; and each session has a step of its own, so that of many the law follows what it
/// likes. *Guess*.
const SESSIONS: std::ops::RangeInclusive<usize> = 3..=12;

/// A clearance that widens with travel, and while nobody records: the drive works on between the sessions.
fn wear_between_sessions(on: &Excitation<'_>) -> Option<Law> {
    let sessions: Vec<std::ops::Range<usize>> = on.rows.sessions_used().collect();
    if !SESSIONS.contains(&sessions.len()) {
        return None;
    }
    let law = Law::new(CauseName::Wear, move |on, _| {
        let travel = on.scales.travel.max(1e-12);
        let of_path = by_row(on, |k| on.base.flank[k] * on.rows.travel[k] / travel);
        let from =
            |session: &std::ops::Range<usize>| by_row(on, |k| if k >= session.start { on.base.flank[k] } else { 0.0 });
        let mut columns = vec![main(of_path, 30.0).called(STEP)];
        columns.extend(on.rows.sessions_used().skip(1).map(|session| main(from(&session), 30.0).called(STEP)));
        columns
    })
    .parameters_by(|_, _, c| vec![(Name::GrowthArcsec, 2.0 * c.all(STEP).sum::<f64>())])
    .physical_if(|_, c| {
        let growth: f64 = c.all(STEP).sum();
        growth > 0.0 && c.all(STEP).all(|step| step > -NOT_NARROWER * growth)
    })
    .well_known()
    .variant("between sessions");
    Some(law)
}

/// Teeth that skipped: the output is off by whole teeth from then on.
fn ratcheting(on: &Excitation<'_>) -> Option<Law> {
    let pitch = ARCSEC_PER_TURN / f64::from(on.nominal.teeth?.circular_spline);
    let jumps = on.scales.jumps.clone();
    (!jumps.is_empty()).then(|| skipped_teeth(jumps, pitch))
}

/// These jumps, each with a coefficient in arcsec around nothing, a pitch at 1.
fn skipped_teeth(jumps: Vec<Jump>, pitch: f64) -> Law {
    let first_s = jumps.first().map_or(0.0, |jump| jump.time_s[1]);
    let columns = jumps.clone();
    let mut law = Law::new(CauseName::Ratcheting, move |on, _| {
        let reached = |jump: &Jump| by_row(on, |k| jump.reached(on.rows.time[k]) / pitch);
        columns.iter().map(|jump| main(reached(jump), 2.0 * pitch).called(JUMP)).collect()
    })
    .parameters_by(move |_, _, c| {
        let slipped: f64 = jumps.iter().zip(c.all(JUMP)).map(|(jump, c)| c * jump.height_arcsec / pitch).sum();
        vec![(Name::JumpArcsec, slipped), (Name::TimeS, first_s), (Name::Events, jumps.len() as f64)]
    })
    .exact();
    // The jump is measured, not modelled: nothing of its height is left over.
    law.wrong.misfit = 0.0;
    law.wrong.doubt = 1e-5;
    law
}

/// A tooth of the circular spline is cracked at its root.
pub(crate) const CRACKED_TOOTH_ROOT: CauseSpec = CauseSpec {
    name: "cracked_tooth_root",
    words: "cracked tooth root",
    does: "softer each time a lobe passes one tooth of the circular spline: nothing there without load",
    kin: Kin::Pulse,
    needs: &[Need::Teeth, Need::Turns, Need::Load],
    parameters: &[
        number(Name::AmplitudeArcsec, "by which it winds up more at the full load", 0.0, 1000.0, Value(30.0)),
        number(Name::FullLoadNM, "the torque at which it is stated", 1e-3, 1e6, OfLoad(1.0)),
        number(
            Name::AngleRad,
            "where the tooth, or the one opposite, is on the circular spline",
            -TAU,
            TAU,
            Value(1.2),
        ),
        number(Name::WidthRad, "half the arc over which it is felt", 0.02, 0.6, Value(0.15)),
    ],
    laws: |_| vec![cracked_tooth_root()],
    simulated: |on, p| {
        let size = p(Name::AmplitudeArcsec) * on.scales.load / p(Name::FullLoadNM);
        cracked_tooth_root().with(p, &[], [(Tag::SIZE, size)])
    },
    ..plain()
};

/// The clearance is wider throughout the data.
pub(crate) const BACKLASH_GROWTH: CauseSpec = CauseSpec {
    name: "backlash_growth",
    words: "wider backlash",
    does: "more clearance than nominal throughout the data",
    kin: Kin::Clearance,
    place: |placing| placing.set_wear(),
    made_by_loads: true,
    parameters: &[number(Name::GrowthArcsec, "whole width over nominal", 0.0, 10_000.0, Value(40.0))],
    laws: |_| vec![backlash_growth()],
    simulated: |on, p| {
        let half = on.base.half_backlash.max(1.0);
        backlash_growth().with(p, &[], [(Tag::SIZE, 0.5 * p(Name::GrowthArcsec) / half)])
    },
    ..plain()
};

/// The clearance widens during the data.
pub(crate) const WEAR: CauseSpec = CauseSpec {
    name: "wear",
    words: "wear",
    does: "a clearance that widens from the first row to the last",
    kin: Kin::Clearance,
    needs: &[Need::Use],
    in_table: InTable::No("it grows with use, and a table stays"),
    place: |placing| placing.set_wear(),
    parameters: &[number(Name::GrowthArcsec, "whole width, first row to last", 0.0, 10_000.0, Value(40.0))],
    laws: |on| {
        let between = wear_between_sessions(on).filter(|_| on.rows.recorded.time);
        std::iter::once(wear().variant("travel")).chain(between).collect()
    },
    simulated: |_, p| wear().with(p, &[(Name::Exponent, 1.0)], [(Tag::SIZE, 0.5 * p(Name::GrowthArcsec))]),
    ..plain()
};

/// The drive is stiffer the higher the load.
pub(crate) const STIFFNESS_HARDENING: CauseSpec = CauseSpec {
    name: "stiffness_hardening",
    words: "hardening stiffness",
    does: "stiffer the higher the load",
    kin: Kin::Torque,
    needs: &[Need::Load],
    parameters: &[
        number(Name::HardeningArcsec, "by which the wind-up falls short at the full load", 0.0, 1000.0, Value(20.0)),
        number(Name::HardeningExponent, "of the torque", 1.2, 8.0, Value(3.0)),
        number(Name::FullLoadNM, "the torque at which it is stated", 1e-3, 1e6, OfLoad(1.0)),
    ],
    laws: |_| vec![stiffness_hardening()],
    simulated: |on, p| {
        let exponent = p(Name::HardeningExponent);
        let size = p(Name::HardeningArcsec) * (on.scales.load / p(Name::FullLoadNM)).powf(exponent);
        stiffness_hardening().with(p, &[(Name::Exponent, exponent)], [(Tag::SIZE, size)])
    },
    ..plain()
};

/// The drive has another stiffness than the nominal one.
pub(crate) const STIFFNESS_ERROR: CauseSpec = CauseSpec {
    name: "stiffness_error",
    words: "other stiffness",
    does: "wind-up in proportion to nominal, of another size",
    kin: Kin::Torque,
    needs: &[Need::Load],
    place: |placing| placing.set_stiffness(),
    parameters: &[number(Name::StiffnessRatio, "true over nominal", 0.05, 20.0, Value(0.8))],
    laws: |_| vec![stiffness_error()],
    simulated: |_, p| stiffness_error().with(p, &[], [(Tag::SIZE, 1.0 / p(Name::StiffnessRatio) - 1.0)]),
    ..plain()
};

/// Contacts slip inside the drive: the output lags the torque.
pub(crate) const TORSIONAL_HYSTERESIS: CauseSpec = CauseSpec {
    name: "torsional_hysteresis",
    words: "torsional hysteresis",
    does: "the output lags the torque by what slipping contacts hold",
    kin: Kin::Friction,
    needs: &[Need::Load, Need::LoadTurns],
    in_table: InTable::No("it depends on the torques before, and a table knows the present one alone"),
    made_by_loads: true,
    parameters: &[
        number(Name::HalfWidthArcsec, "half the opening of the large loop at zero torque", 0.0, 1000.0, Value(15.0)),
        number(Name::SlipTorqueNM, "at which the middle spring slips", 1e-3, 1e6, OfLoad(0.2)),
    ],
    laws: |on| vec![torsional_hysteresis(on)],
    simulated: |on, p| {
        let held = held(on.scales.load, p(Name::SlipTorqueNM));
        // A spring that slips beyond the load opens no loop: its width is what it can hold.
        let width = p(Name::HalfWidthArcsec) / if held > 0.0 { held } else { 1.0 };
        torsional_hysteresis(on).with(p, &[], [(SPRING, width)])
    },
    ..plain()
};

/// Teeth have skipped.
pub(crate) const RATCHETING: CauseSpec = CauseSpec {
    name: "ratcheting",
    words: "ratcheting",
    does: "teeth that skipped",
    needs: &[Need::Teeth, Need::Jump],
    in_table: InTable::No("it happens at an instant"),
    parameters: &[number(Name::JumpArcsec, "of the output, whole teeth", -1e5, 1e5, ToothPitch), TIME],
    laws: |on| ratcheting(on).into_iter().collect(),
    simulated: |_, p| {
        let jump = Jump { time_s: [p(Name::TimeS); 3], height_arcsec: p(Name::JumpArcsec) };
        skipped_teeth(vec![jump], 1.0).with(p, &[], [(JUMP, 1.0)])
    },
    ..plain()
};
