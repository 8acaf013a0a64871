//! Forms of causes that open the clearance, and teeth that skip.

use super::form::{Form, Numbers, PATHS, Setting, fades, warmth};
use crate::train::ease;

/// Of a clearance that has grown.
pub const GROWTH: &[&str] = &["around_the_ring", "around_the_cup", "one_flank", "under_load", "one_zone"];
/// Of wear during the log.
pub const WEAR: &[&str] = &["power_of_path", "running_in", "steps", "work", "accelerating", "most_used_teeth"];
/// Of a clearance that follows temperature.
pub const HEAT: &[&str] = &["one_lag", "two_lags", "own_heat", "quicker_heating", "gradient", "bent", "one_flank"];
/// Of teeth that skip.
pub const RATCHETING: &[&str] = &["at_once", "climbed", "two_slides", "two_teeth", "late"];

/// Full width `size` more on the whole.
pub fn growth(name: &'static str, n: &mut Numbers) -> Form {
    let (swell, at) = (n.log("swell", 0.1, 0.8), n.any_phase());
    let order = f64::from(1 + n.side("twice_around") as u32);
    let forward =
        if name == "one_flank" { n.flat("forward_share", 0.0, 1.0) } else { n.flat("forward_share", 0.4, 0.6) };
    let (half, rest) = (n.log("half_at_load", 0.1, 1.0), n.flat("rest", 0.2, 0.8));
    let zone = n.side("zone");
    Form::adds(move |size, now, _, to| {
        let around = |angle: f64| size * (1.0 + swell * (order * angle + at).sin());
        let width = match name {
            "around_the_ring" => around(now.wheel_rad[1]),
            "around_the_cup" => around(now.wheel_rad[0]),
            // Rough flanks: the widest gap shows once the load has flattened what stood up.
            "under_load" => size * (1.0 - (1.0 - rest) * fades(now.load, half, 1.0)),
            _ => size,
        };
        if name == "one_zone" {
            to.zones[zone][0] += forward * width;
            to.zones[zone][1] -= (1.0 - forward) * width;
        } else {
            to.wider(forward * width, (1.0 - forward) * width);
        }
    })
}

/// Full width `size` more at the end.
pub fn wear(name: &'static str, n: &mut Numbers, setting: &Setting) -> Form {
    let power = n.log("power", 0.35, 0.85);
    let soon = n.log("run_in_path", 0.05, 0.4);
    let (grows, count) = (n.log("grows", 1.5, 6.0), 2.0 + (3.0 * n.flat("steps", 0.0, 1.0)).floor());
    let (swell, at) = (n.log("swell", 0.2, 0.9), n.any_phase());
    let forward = n.flat("forward_share", 0.2, 0.8);
    // A mean load of about two fifths of the rated one.
    let all = 0.4 * setting.way_rad;
    let press = n.log("load_power", 0.5, 2.0);
    Form::adds(move |size, now, memory, to| {
        let x = now.path;
        let shares = [forward, 1.0 - forward];
        let [ahead, behind] = match name {
            "running_in" => [(1.0 - (-x / soon).exp()) / (1.0 - (-1.0 / soon).exp()); 2],
            // Flakes that break away: rounded by the path on which they do.
            "steps" => {
                let place = count * x;
                [((place.floor() + ease((place.fract() - 0.4) / 0.1)) / count).min(1.0); 2]
            }
            // Each flank by its own work.
            "work" => {
                let flank = usize::from(now.load < 0.0);
                memory[flank] += (now.load.abs() / 0.4).powf(press) * 0.4 * now.moved_rad.abs() / all;
                [2.0 * memory[0], 2.0 * memory[1]]
            }
            "accelerating" => [((grows * x).exp() - 1.0) / (grows.exp() - 1.0); 2],
            "most_used_teeth" => [x * (1.0 + swell * (now.wheel_rad[1] + at).sin()); 2],
            _ => [x.powf(power); 2],
        };
        to.wider(size * shares[0] * ahead, size * shares[1] * behind);
    })
}

/// Full width `size` more for each kelvin above 20 °C.
pub fn heat(name: &'static str, n: &mut Numbers) -> Form {
    let path = PATHS.iter().find(|path| **path == name).copied().unwrap_or("two_lags");
    let warm = warmth(path, n);
    let bend = n.flat("bend_per_k", -0.01, 0.02);
    let mean = n.flat("mean_share", 0.2, 0.7);
    let forward = if name == "one_flank" { n.flat("forward_share", 0.0, 1.0) } else { 0.5 };
    Form::adds(move |size, now, memory, to| {
        let kelvin = warm(now, memory) - 20.0;
        let width = match name {
            // The generator warms before the housing does: what is between them, and the mean.
            "gradient" => size * (mean * kelvin + (1.0 - mean) * (memory[0] - memory[1])),
            "bent" => size * kelvin * (1.0 + bend * kelvin),
            _ => size * kelvin,
        };
        to.wider(forward * width, (1.0 - forward) * width);
    })
}

/// Teeth climb over one another under load, `size` of them at a time.
pub fn ratcheting(name: &'static str, n: &mut Numbers, setting: &Setting) -> Form {
    let pitch = setting.pitch_arcsec;
    let when = match name {
        "late" => n.flat("when", 0.7, 0.88),
        "two_slides" => n.flat("when", 0.15, 0.5),
        _ => n.flat("when", 0.2, 0.8),
    };
    let threshold = n.log("at_load", 0.2, 0.6);
    let teeth = if name == "two_teeth" { 2.0 } else { 1.0 };
    let lasts = n.log("lasts_s", 0.1, if name == "climbed" { 1.5 } else { 0.25 });
    let again = n.flat("again_after", 0.05, 0.3);
    let events = if name == "two_slides" { 2.0 } else { 1.0 };
    // Memory: events that are over or under way, progress of the last one, its sense, where the others have led.
    Form::adds(move |size, now, memory, to| {
        let due = when + memory[0] * again;
        let loaded = now.load.abs() > threshold || now.done > due + 0.08 && now.load.abs() > 0.1;
        let over = memory[0] == 0.0 || memory[1] >= 1.0;
        if memory[0] < events && over && now.done > due && now.since_s > 1.0 && loaded {
            memory[3] += memory[2] * ease(memory[1]);
            (memory[0], memory[1], memory[2]) = (memory[0] + 1.0, 0.0, now.load.signum());
        }
        // A climb takes the wave half a turn, or its time at rest.
        let turned = if name == "climbed" { now.moved_rad.abs() / std::f64::consts::PI } else { 0.0 };
        memory[1] = (memory[1] + (now.step_s / lasts).max(turned.min(0.02))).min(1.0);
        let led = memory[3] + memory[2] * ease(memory[1]);
        let shift = size * teeth * pitch * led;
        to.flanks[0] += shift;
        to.flanks[1] += shift;
    })
}
