//! Forms of causes that load the flange unseen by the torque sensor.

use super::form::{Form, Numbers, Setting, fades, warmth};
use crate::ARCSEC;
use std::f64::consts::TAU;

/// Of the lubricant's drag.
pub const DRAG: &[&str] = &["vogel", "herschel_bulkley", "stribeck", "walther_two_thirds", "carreau", "churning"];
/// Of the torque of gravity.
pub const ARM: &[&str] = &["sagging", "spring_balanced", "hinged", "with_cable", "slack_mount"];
/// Of a resonance.
pub const RESONANCE: &[&str] = &["quadratic", "dry", "play", "duffing", "two_modes", "softening"];

/// Speed and temperature at which `size` is the drag.
const DRAG_AT: (f64, f64) = (10.0, 20.0);
/// The film does not get thicker than this factor over 20 °C: starved.
const THICKEST: f64 = 15.0;

/// Drag `size` at 10 rad/s of the generator and 20 °C, against the motion.
pub fn drag(name: &'static str, n: &mut Numbers, setting: &Setting) -> Form {
    let warm = warmth(if n.side("own_heat") == 1 { "own_heat" } else { "two_lags" }, n);
    let forward = setting.ratio.signum();
    let (b, c) = (n.log("vogel_b_k", 400.0, 1300.0), n.log("vogel_c_k", 95.0, 180.0));
    let per_k = n.log("per_k", 0.015, 0.06);
    let exponent = n.flat("exponent", 0.3, 0.9);
    let dry = n.log("dry_share", 0.1, 1.0);
    let knee = n.log("knee_rad_s", 0.4, 8.0);
    let (at_40, walther) = (n.log("cst_at_40_c", 20.0, 250.0), n.flat("walther_m", 3.0, 4.0));
    let cst = move |celsius: f64| {
        let double = |x: f64| (x + 0.8).log10().log10();
        let up = walther * ((celsius + 273.15) / 313.15).log10();
        10.0_f64.powf(10.0_f64.powf(double(at_40) - up)) - 0.8
    };
    let law = move |speed: f64, celsius: f64| {
        let thick = match name {
            "vogel" | "churning" => (b / (celsius + c) - b / (DRAG_AT.1 + c)).exp(),
            "walther_two_thirds" | "stribeck" => cst(celsius) / cst(DRAG_AT.1),
            // Andrade, with the slope at 20 °C.
            _ => (per_k * 293.15 * (293.15 / (celsius + 273.15) - 1.0)).exp(),
        };
        let thick = thick.min(THICKEST);
        let (v, sense) = (speed.abs(), (speed / 0.15).tanh());
        match name {
            "herschel_bulkley" => sense * (dry + (v / DRAG_AT.0).powf(exponent)) * thick,
            "stribeck" => sense * dry * (0.3 + (-(v / knee).powi(2)).exp()) + thick * speed / DRAG_AT.0,
            "walther_two_thirds" => sense * (thick * v / DRAG_AT.0).powf(2.0 / 3.0),
            "carreau" => thick * speed * (1.0 + (v * thick / knee).powi(2)).powf(0.5 * (exponent - 1.0)),
            "churning" => thick * speed / DRAG_AT.0 + dry * sense * (v / DRAG_AT.0).powf(1.7),
            _ => thick * speed / DRAG_AT.0,
        }
    };
    let unit = law(DRAG_AT.0, DRAG_AT.1);
    Form::adds(move |size, now, memory, to| {
        let celsius = warm(now, memory);
        to.unseen_n_m -= forward * size * law(now.speed_rad_s, celsius) / unit;
    })
}

/// Load that hangs on the output: `size` is mass times lever.
pub fn arm(name: &'static str, n: &mut Numbers) -> Form {
    let phase = n.phase("phase_rad");
    let sag = n.log("sag_rad", 0.05, 0.4);
    let (share, lever) = (n.flat("spring_share", 0.2, 0.9), n.log("spring_lever", 0.2, 0.8));
    let (second, second_at) = (n.log("second_share", 0.1, 0.6), n.any_phase());
    let (cable, middle) = (n.log("cable_per_turn", 0.05, 0.6), n.flat("cable_middle_rad", -3.0, 3.0));
    let slack = n.log("slack_rad", 0.02, 0.25);
    Form::adds(move |size, now, _, to| {
        let at = now.output_rad + now.orientation_rad + phase;
        let hangs = at.sin();
        let torque = match name {
            // The lever bends towards the ground.
            "sagging" => (at - sag * hangs).sin(),
            // A spring with its foot off the axis takes a share of it.
            "spring_balanced" => {
                let long = (1.0 + lever * lever + 2.0 * lever * at.cos()).max(0.16).sqrt();
                hangs * (1.0 - share * (1.0 - 0.6 / long) / (1.0 - 0.6))
            }
            // A second link on a hinge with stops hangs down as far as they let it.
            "hinged" => hangs + second * (at + 0.6 * (2.0 * at + second_at).sin()).sin(),
            "with_cable" => hangs + cable * ((now.output_rad - middle) / TAU).clamp(-2.0, 2.0),
            // A mount that falls over to the other side at the top and at the bottom.
            _ => (at + slack * (hangs / 0.15).tanh()).sin(),
        };
        to.unseen_n_m += size * torque;
    })
}

/// An inertia of `size` times that of the load on a spring at the flange. Memory: angle (arcsec) and speed of each.
pub fn resonance(name: &'static str, n: &mut Numbers) -> Form {
    let hertz = n.log("frequency_hz", 3.0, 11.0);
    let damping = n.log("damping_ratio", 0.008, 0.08);
    let apart = 1.0 + n.log("apart", 0.08, 0.6);
    let share = n.flat("second_share", 0.2, 0.8);
    let (play, swing) = (n.log("play_arcsec", 1.0, 15.0), n.log("swing_arcsec", 15.0, 120.0));
    let grip = n.log("grip", 0.01, 0.1);
    let pulls = move |omega: f64, angle: f64, speed: f64| {
        let spring = match name {
            "play" => (angle.abs() - play).max(0.0).copysign(angle),
            "duffing" => angle * (1.0 + (angle / swing).powi(2).min(20.0)),
            "softening" => angle * (0.5 + 0.5 * fades(angle, swing, 2.0)),
            _ => angle,
        };
        let loss = match name {
            "quadratic" => 2.0 * damping * omega * speed * (0.3 + speed.abs() / (omega * swing)).min(12.0),
            "dry" => {
                let held = grip * omega * omega * swing * (speed / (0.03 * omega * swing)).tanh();
                held + 0.5 * damping * omega * speed
            }
            _ => 2.0 * damping * omega * speed,
        };
        omega * omega * spring + loss
    };
    let modes = [(TAU * hertz, if name == "two_modes" { 1.0 - share } else { 1.0 }), (TAU * hertz * apart, share)];
    let count = if name == "two_modes" { 2 } else { 1 };
    Form::adds(move |size, now, memory, to| {
        // What a session starts with is at rest.
        if now.since_s < -1.4 {
            *memory = [0.0; 6];
        }
        for (at, (omega, part)) in modes.iter().take(count).enumerate() {
            let (angle, speed) = (memory[2 * at], memory[2 * at + 1]);
            let pull = pulls(*omega, angle, speed);
            let speed = speed + (-now.output_arcsec_s2 - pull) * now.step_s;
            memory[2 * at] = angle + speed * now.step_s;
            memory[2 * at + 1] = speed;
            to.unseen_n_m += size * part * now.inertia_kg_m2 * pull / ARCSEC;
        }
    })
}
