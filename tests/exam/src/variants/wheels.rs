//! Forms of causes in wheels, generator and teeth.

use super::form::{Form, Numbers, Setting, fades, wave};
use crate::cause::Cause;
use crate::profile::Profile;
use crate::train::{Adds, Now, near_zero, place};

/// Of an axis that is displaced: wheel or push of gravity.
pub const DISPLACED: &[&str] =
    &["overtones", "relieved", "by_sense", "unlike_zones", "unlike_flanks", "floating", "breathing"];
/// Of an oval circular spline.
pub const OVAL: &[&str] = &["three_bolts", "four_bolts", "six_bolts", "rounded_by_load", "radial", "breathing"];
/// Of pitch errors.
pub const PITCH: &[&str] = &["sawtooth", "walk", "two_passes", "unlike_flanks", "averaged_by_load", "few_orders"];
/// Of an eccentric generator.
pub const LOBES: &[&str] = &["deep_lobe", "pressed_in", "first_and_third", "one_wheel", "by_sense"];
/// Of the form of the cam.
pub const CAM: &[&str] = &["two_lines", "twice_a_turn", "handover", "fading", "growing", "unlike_flanks"];
/// Of a damaged tooth.
pub const TOOTH: &[&str] = &["rectangle", "triangle", "tail", "double", "bell", "burr"];

/// Half of the angle between the directions in which the two flanks feel a displacement.
fn pressure(n: &mut Numbers) -> f64 {
    n.log("pressure_rad", 0.28, 0.58)
}

/// An axis out of its place. Flank 0 bears forward load.
pub fn displaced(cause: Cause, name: &'static str, n: &mut Numbers) -> Form {
    let (phase, alpha) = (n.phase("phase_rad"), pressure(n));
    let shape = wave(n, if name == "overtones" { 0.4 } else { 0.12 });
    let (half, power) = (n.log("half_at_load", 0.1, 1.5), n.log("power", 0.6, 3.0));
    let share = n.log("share", 0.3, 0.9);
    let turns = n.flat("turns_rad", -0.6, 0.6);
    let per_k = n.flat("per_k", -0.008, 0.015);
    Form::adds(move |size, now: &Now, _, to: &mut Adds| {
        let angle = match cause {
            Cause::FlexsplineRunout => now.wheel_rad[0],
            Cause::CircularSplineEccentricity => now.wheel_rad[1],
            _ => now.generator_rad + now.orientation_rad,
        };
        // -1..1 with the load's sense, without a step at zero.
        let sense = (now.load / 0.08).tanh();
        for zone in 0..2 {
            for flank in 0..2 {
                let side = if flank == 0 { alpha } else { -alpha };
                let mut at = place(angle, zone) - phase + side;
                if name == "by_sense" {
                    at += turns * sense;
                }
                let lift = shape.at(at);
                let lift = match name {
                    "relieved" => lift * fades(now.load, half, power),
                    "by_sense" => lift * (1.0 + 0.5 * (1.0 - share) * sense),
                    "unlike_zones" if zone == 1 => lift * share,
                    "unlike_flanks" if flank == 1 => lift * share,
                    // The generator gives way across its axis before it takes a displacement on.
                    "floating" => (lift.abs() - 0.5 * share).max(0.0).copysign(lift) / (1.0 - 0.5 * share),
                    "breathing" => lift * (1.0 + per_k * (now.gear_c - 20.0)),
                    _ => lift,
                };
                to.zones[zone][flank] += size * lift;
            }
        }
    })
}

/// A ring that is not round.
pub fn oval(name: &'static str, n: &mut Numbers) -> Form {
    let phase = n.phase("phase_rad");
    let bolts = match name {
        "three_bolts" => 3.0,
        "four_bolts" => 4.0,
        "six_bolts" => 6.0,
        _ => f64::from(3 + n.side("four_not_three") as u32),
    };
    let share = n.log("bolt_share", 0.05, 0.3);
    let shape = Profile::of(&[(2.0, 1.0, 0.0), (bolts, share, n.any_phase()), (4.0, 0.3 * share, n.any_phase())]);
    let half = n.log("half_at_load", 0.2, 2.0);
    // Radial part over the tangential one: sideways on the two flanks.
    let radial = n.flat("radial_rad", 0.05, if name == "radial" { 0.9 } else { 0.3 });
    let per_k = n.flat("per_k", -0.01, 0.02);
    Form::adds(move |size, now, _, to| {
        let scale = match name {
            "rounded_by_load" => fades(now.load, half, 1.0),
            "breathing" => 1.0 + per_k * (now.housing_c - 20.0),
            _ => 1.0,
        };
        for zone in 0..2 {
            let at = place(now.wheel_rad[1], zone) + phase;
            to.zones[zone][0] += size * scale * shape.at(at + 0.5 * radial);
            to.zones[zone][1] += size * scale * shape.at(at - 0.5 * radial);
        }
    })
}

/// Profile of a cut wheel.
fn cut(name: &str, n: &mut Numbers) -> Profile {
    let mut lines = Vec::new();
    match name {
        // A hob or an indexing worm: one flank of the wave is steep.
        "sawtooth" => {
            let (order, shift) = (2.0, n.any_phase());
            let first = n.log("first_share", 0.1, 0.8);
            lines.push((1.0, first, n.any_phase()));
            lines.extend((1..6).map(|k| (order * f64::from(k), 1.0 / f64::from(k), f64::from(k) * shift)));
        }
        "walk" => {
            let power = n.flat("power", 0.8, 1.8);
            for k in 1..20 {
                let lead = if k == 2 { 1.5 } else { 1.0 };
                let size = lead * n.normal().abs().max(0.1) * f64::from(k).powf(-power);
                lines.push((f64::from(k), size, n.any_phase()));
            }
        }
        // The second half of the teeth was cut in a second pass, the blank taken up anew: steps, rounded by the arc.
        "two_passes" => {
            let (shift, first) = (n.any_phase(), n.log("first_share", 0.1, 0.5));
            lines.push((2.0, 1.0, n.any_phase()));
            lines.extend([1, 3, 5, 7].map(|k| (f64::from(k), first / f64::from(k), f64::from(k) * shift)));
        }
        _ => {
            let (first, third) = (n.log("first_share", 0.05, 0.7), n.log("third_share", 0.03, 0.4));
            let fourth = n.log("fourth_share", 0.05, 0.5);
            let orders = [(1.0, first), (2.0, 1.0), (3.0, third), (4.0, fourth)];
            lines.extend(orders.map(|(order, share)| (order, share, n.any_phase())));
        }
    }
    Profile::of(&lines).scaled()
}

/// Teeth out of their places on one wheel.
pub fn pitch(cause: Cause, name: &'static str, n: &mut Numbers) -> Form {
    let shape = cut(name, n);
    let other = n.unwritten(|n| cut("few_orders", n));
    let unlike = if name == "unlike_flanks" { n.flat("unlike", 0.15, 0.7) } else { 0.0 };
    let half = n.log("half_at_load", 0.3, 3.0);
    let wheel = usize::from(cause == Cause::CircularSplinePitchError);
    Form::adds(move |size, now, _, to| {
        let scale = if name == "averaged_by_load" { fades(now.load, half, 1.0) } else { 1.0 };
        for zone in 0..2 {
            let at = place(now.wheel_rad[wheel], zone);
            let (one, two) = (shape.at(at), other.at(at));
            to.zones[zone][0] += size * scale * one;
            to.zones[zone][1] += size * scale * ((1.0 - unlike) * one + unlike * two);
        }
    })
}

/// A generator one lobe of which stands deeper: what the teeth of one zone have wrong shows.
pub fn lobes(name: &'static str, n: &mut Numbers) -> Form {
    let share = if name == "one_wheel" { n.side("circular_spline") as f64 } else { n.flat("wheel_share", 0.25, 0.75) };
    let phases = [n.phase("flexspline_phase_rad"), n.phase("circular_spline_phase_rad")];
    let third = if name == "first_and_third" { n.log("third_share", 0.1, 0.5) } else { 0.0 };
    let deeper = n.log("deeper", 0.25, 1.2);
    let (half, power) = (n.log("half_at_load", 0.1, 1.0), n.log("power", 0.7, 3.0));
    let unlike = n.flat("unlike", -0.5, 0.5);
    let (first, other) = (Profile::of(&[(1.0, 1.0, phases[0]), (3.0, third, n.any_phase())]), phases[1]);
    let second = Profile::of(&[(1.0, 1.0, other), (3.0, third, n.any_phase())]);
    Form::adds(move |size, now, _, to| {
        let mut lobe = deeper;
        if name == "pressed_in" {
            lobe *= fades(now.load, half, power);
        }
        if name == "by_sense" {
            lobe *= 1.0 + unlike * (now.load / 0.1).tanh();
        }
        for zone in 0..2 {
            let on = |wheel: usize| place(now.wheel_rad[wheel], zone);
            let teeth = (1.0 - share) * first.at(on(0)) + share * second.at(on(1));
            let inward = if zone == 0 { lobe } else { -lobe };
            to.zones[zone][0] += size * (teeth - inward);
            to.zones[zone][1] += size * (teeth + inward);
        }
    })
}

/// A generator whose form is wrong all around: the mesh shows, and the clearance.
pub fn cam(name: &'static str, n: &mut Numbers, setting: &Setting) -> Form {
    let order = setting.mesh_order;
    let (phase, apart) = (n.phase("phase_rad"), n.flat("flank_phase_rad", 0.1, 1.8));
    let second = n.log("second_share", if name == "two_lines" { 0.2 } else { 0.02 }, 0.7);
    let shift = n.any_phase();
    let (swell, swell_at) = (n.log("swell", 0.2, 0.9), n.any_phase());
    let (half, power) = (n.log("half_at_load", 0.1, 1.0), n.log("power", 0.6, 2.0));
    let wider = n.flat("wider", -0.8, 0.8);
    let unlike = n.log("flank_share", 0.25, 0.8);
    let handover = Profile::of(&[1, 2, 3, 4].map(|k| {
        // A parabola from one tooth to the next.
        (f64::from(k), 1.0 / f64::from(k * k), std::f64::consts::FRAC_PI_2)
    }));
    Form::adds(move |size, now, _, to| {
        let at = order * now.generator_rad + phase;
        let line = |at: f64| match name {
            "handover" => handover.at(at),
            "two_lines" => at.sin() + second * (2.0 * at + shift).sin(),
            _ => at.sin() + 0.3 * second * (2.0 * at + shift).sin(),
        };
        let scale = match name {
            "twice_a_turn" => 1.0 + swell * (2.0 * now.generator_rad + swell_at).sin(),
            "fading" => fades(now.load, half, power),
            "growing" => (now.load.abs() / half).powf(power).min(4.0),
            _ => 1.0,
        };
        let other = if name == "unlike_flanks" { unlike } else { 1.0 };
        to.flanks[0] += size * scale * line(at);
        to.flanks[1] += size * scale * other * line(at + apart);
        to.wider(size * wider, size * wider * other);
    })
}

/// A tooth that bears late, or too early.
pub fn tooth(name: &'static str, n: &mut Numbers) -> Form {
    let position = n.phase("position_rad");
    let (wheel, flank) = (n.side("circular_spline"), n.side("backward_flank"));
    let width = n.log("half_width_rad", 0.12, 0.5);
    let lasts = n.log("tail_rad", 0.15, 0.6);
    let apart = width * n.flat("apart_widths", 2.0, 4.0);
    let second = n.flat("second_share", 0.3, 1.0);
    let (full, power) = (n.log("full_at_load", 0.05, 1.0), n.log("power", 0.3, 1.5));
    let rim = n.flat("other_flank", 0.0, 0.3);
    let ahead = if n.side("ahead") == 0 { 1.0 } else { -1.0 };
    let bell = move |gap: f64| (-(gap / (0.6 * width)).powi(2)).exp();
    let pulse = move |gap: f64| match name {
        // Edges are as wide as the arc over which teeth come in.
        "rectangle" => 0.5 * (((gap + width) / 0.03).tanh() - ((gap - width) / 0.03).tanh()),
        "triangle" => (1.0 - gap.abs() / (1.4 * width)).max(0.0),
        "tail" if gap < 0.0 => (1.0 + gap / 0.04).max(0.0),
        "tail" => (-gap / lasts).exp() * (1.0 - gap / std::f64::consts::PI).max(0.0),
        "double" => bell(gap) + second * bell(gap - apart),
        _ => bell(gap),
    };
    let early = if name == "burr" { -1.0 } else { 1.0 };
    Form::adds(move |size, now, _, to| {
        let bears = (now.load.abs() / full).powf(power).min(2.0);
        // A burr is there without load.
        let depth = if name == "burr" { 1.0 } else { bears };
        for zone in 0..2 {
            let gap = near_zero(ahead * (place(now.wheel_rad[wheel], zone) - position));
            let deep = size * early * depth * pulse(gap);
            // A flank that retreats lets the hub on, forward on flank 0, backward on flank 1.
            let side = |flank: usize| if flank == 0 { 1.0 } else { -1.0 };
            to.zones[zone][flank] += side(flank) * deep;
            to.zones[zone][1 - flank] += side(1 - flank) * rim * deep;
        }
    })
}
