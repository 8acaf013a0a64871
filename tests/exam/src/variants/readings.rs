//! Forms of causes in what is read.

use super::form::{Form, Numbers, Setting, wave};
use crate::ARCSEC;
use crate::cause::Cause;
use crate::chance::Chance;
use crate::profile::Profile;
use crate::train::near_zero;

/// Of an encoder out of centre.
pub const DISC: &[&str] = &["overtones", "scratched", "two_heads", "breathing", "subdivided", "bearing"];
/// Of a late reading.
pub const LATENCY: &[&str] = &["jittered", "phase_locked", "drifting", "beating", "filtered", "by_session"];
/// Of a wrong ratio.
pub const RATIO: &[&str] = &["scale", "count", "creeping", "warm_scale"];

/// An encoder that is read out of its centre by `size` at the output.
pub fn disc(cause: Cause, name: &'static str, n: &mut Numbers) -> Form {
    let of_output = cause == Cause::OutputEncoderEccentricity;
    let phase = n.phase("phase_rad");
    let most = if name == "overtones" { 0.4 } else { 0.1 };
    let shape = if name == "two_heads" {
        // The mean of two heads that are not quite opposite: little of order 1, all of order 2.
        let second = n.log("second_share", 0.2, 1.0);
        Profile::of(&[(1.0, 1.0, 0.0), (2.0, second, n.any_phase()), (4.0, 0.3 * second, n.any_phase())])
    } else {
        wave(n, most)
    };
    let (scratch, at) = (n.log("scratch_share", 0.1, 1.0), n.any_phase());
    let wide = n.log("scratch_rad", 0.05, 0.5);
    let per_k = n.flat("per_k", -0.01, 0.01);
    // Of an output, periods small enough that it turns through some; of a generator, slow enough for the rows.
    let (lines, fine) = (if of_output { 64.0 } else { 4.0 }, n.log("fine_share", 0.05, 0.4));
    let shifts = [n.any_phase(), n.any_phase(), n.any_phase()];
    // Balls and cage go around at some two fifths of the shaft.
    let (cage, swing) = (n.flat("cage_order", 0.38, 0.45), n.log("cage_share", 0.05, 0.4));
    Form::adds(move |size, now, _, to| {
        let angle = if of_output { now.output_rad } else { now.generator_rad };
        let mut lift = shape.at(angle + phase);
        match name {
            "scratched" => lift += scratch * (-(near_zero(angle - at) / wide).powi(2)).exp(),
            "breathing" => lift *= 1.0 + per_k * (now.column_c - 20.0),
            "subdivided" => {
                // A signal period shows its first, second and fourth order.
                let line = |k: f64, shift: f64| (k * lines * angle + shift).sin();
                lift += fine * (line(1.0, shifts[0]) + 0.5 * line(2.0, shifts[1]));
                lift += if of_output { 0.2 * fine * line(4.0, shifts[2]) } else { 0.0 };
            }
            "bearing" => lift += swing * (cage * angle + at).sin(),
            _ => (),
        }
        if of_output {
            to.output_arcsec += size * lift;
        } else {
            to.generator_arcsec += size * lift;
        }
    })
}

/// Seconds by which the reading of the output is older: `size` on the whole.
pub fn latency(name: &'static str, n: &mut Numbers) -> Form {
    let share = n.log("share", 0.1, 0.8);
    let lasts = n.log("lasts_s", 0.01, 1.0);
    let knee = n.log("knee_rad_s", 1.0, 20.0);
    let drift = n.flat("drift", -0.8, 0.8);
    let period = n.log("period_s", 0.5, 20.0);
    let seed = (1e9 * n.any_phase()) as u64;
    Form::adds(move |size, now, memory, to| {
        let factor = match name {
            // Ornstein and Uhlenbeck's, by a draw of each step.
            "jittered" => {
                let step = (now.time_s / now.step_s).round() as i64 as u64;
                let normal = Chance::new(seed, "jitter", step).normal();
                let kept = (-now.step_s / lasts).exp();
                memory[0] = kept * memory[0] + (1.0 - kept * kept).sqrt() * normal;
                1.0 + 0.5 * share * memory[0]
            }
            // A loop that follows sooner the more edges it sees.
            "phase_locked" => 1.0 - share + 2.0 * share * knee / (knee + now.speed_rad_s.abs()),
            "drifting" => 1.0 + drift * (2.0 * now.done - 1.0),
            // Two clocks: the age runs up and falls back.
            "beating" => 1.0 + share * (2.0 * (now.time_s / period).rem_euclid(1.0) - 1.0),
            "by_session" => {
                if now.since_s < -1.4 && memory[0] != now.time_s - now.since_s {
                    memory[0] = now.time_s - now.since_s;
                    memory[1] = Chance::new(seed, "age", (now.time_s.abs() * 10.0) as u64).uniform(-share, share);
                }
                1.0 + memory[1]
            }
            // A low-pass, whose lag in a steady motion is the delay.
            _ => {
                let read = now.output_rad * ARCSEC;
                if now.since_s < -1.4 || size < 1e-5 {
                    memory[0] = read;
                }
                let lag = (share * size).max(now.step_s);
                memory[0] += (read - memory[0]) * (now.step_s / lag).min(1.0);
                if share * size > now.step_s {
                    to.output_arcsec += memory[0] - read;
                    1.0 - share
                } else {
                    1.0
                }
            }
        };
        to.delay_s += size * factor;
    })
}

/// The output goes further than the ratio by `size` of the way.
pub fn ratio(name: &'static str, n: &mut Numbers, setting: &Setting) -> Form {
    let per_rad = ARCSEC / setting.ratio;
    let by_load = n.log("by_load", 0.1, 1.0);
    let per_k = n.flat("per_k", -0.003, 0.003);
    Form::adds(move |size, now, memory, to| {
        let whole = size * now.generator_rad * per_rad;
        match name {
            "scale" => to.output_arcsec += whole,
            "count" => to.generator_arcsec -= whole,
            // A friction wheel or belt before the encoder: slips more under load.
            "creeping" => {
                memory[0] += now.moved_rad * (1.0 + by_load * (now.load.abs() - 0.4));
                to.output_arcsec += size * memory[0] * per_rad;
            }
            _ => to.output_arcsec += whole * (1.0 + per_k * (now.column_c - 20.0)),
        }
    })
}
