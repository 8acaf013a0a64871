//! Forms of causes in the spring.

use super::form::{Form, Numbers, PATHS, Setting, warmth};

/// Of a spring that stiffens.
pub const HARDENING: &[&str] = &["cube", "power", "knee", "arctangent", "soft_knee", "by_sense", "seating"];
/// Of a wrong stiffness.
pub const SOFT: &[&str] = &["bearing", "by_sense", "around", "first_part", "twice_a_turn"];
/// Of hysteresis.
pub const HYSTERESIS: &[&str] = &["bouc_wen", "dahl", "prandtl", "asymmetric", "relaxing", "butterfly"];
/// Of a stiffness that follows temperature.
pub const HEAT: &[&str] = &["one_lag", "two_lags", "exponential", "bent", "softening", "light_load", "own_heat"];

/// Places and weights of Gauss and Legendre on 0..1.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077, 0.118_463_443),
    (0.230_765_345, 0.239_314_335),
    (0.5, 0.284_444_444),
    (0.769_234_655, 0.239_314_335),
    (0.953_089_923, 0.118_463_443),
];

/// Stiffness larger by `size` of itself at the rated torque.
pub fn hardening(name: &'static str, n: &mut Numbers) -> Form {
    let power = n.log("power", 0.4, 4.0);
    let knee = n.log("knee", 0.1, 0.6);
    let soft = n.log("softness", 0.03, 0.3);
    let steep = n.log("steepness", 1.0, 10.0);
    let unlike = n.flat("unlike", -0.7, 0.7);
    let softplus = move |x: f64| soft * (1.0 + ((x - knee) / soft).exp()).ln();
    let gains = move |load: f64| {
        let x = load.abs().min(1.6);
        let gain = match name {
            "power" => x.powf(power),
            "knee" => ((x - knee) / (1.0 - knee)).clamp(0.0, 1.0),
            "arctangent" => (steep * x).atan() / steep.atan(),
            "soft_knee" => (softplus(x) - softplus(0.0)) / (softplus(1.0) - softplus(0.0)),
            "by_sense" => x * x * (1.0 + unlike * load.signum()),
            "seating" => (1.0 - (-x / knee).exp()) / (1.0 - (-1.0 / knee).exp()),
            _ => x * x,
        };
        gain.min(2.5)
    };
    Form::winds(move |size, own, load, _, _| {
        let mean: f64 = GAUSS.iter().map(|(at, weight)| weight / (1.0 + size * gains(at * load))).sum();
        own * (mean - 1.0)
    })
}

/// Stiffness wrong by `size` of itself.
pub fn soft(name: &'static str, n: &mut Numbers, setting: &Setting) -> Form {
    let rated = setting.rated_arcsec;
    let power = n.flat("power", 0.75, 0.95);
    let unlike = n.flat("unlike", -0.6, 0.6);
    let (swell, at) = (n.log("swell", 0.1, 0.6), n.any_phase());
    let first = n.log("first_part", 0.15, 0.8);
    Form::winds(move |size, own, load, now, _| {
        // So much of the wind-up goes, or comes.
        let gives = |size: f64| -size / (1.0 + size);
        match name {
            // Balls under load, of which a share of the wind-up is: without the steep start at no load.
            "bearing" => {
                let bent = |x: f64| (x + 0.02_f64).powf(power) - 0.02_f64.powf(power);
                gives(size) * rated * bent(load.abs()).copysign(load)
            }
            "by_sense" => own * gives(size * (1.0 + unlike * load.signum())),
            "around" => own * gives(size * (1.0 + swell * (now.wheel_rad[1] + at).sin())),
            "twice_a_turn" => own * gives(size * (1.0 + swell * (2.0 * now.generator_rad + at).sin())),
            _ => 0.9 * gives(size) * rated * first * (load / first).tanh(),
        }
    })
}

/// Half of the loop of large turns is `size` wide at no load. It is a slip that holds the spring back: where load moves
/// the other way the spring seems stiffer, never stiffer than rigid, so the way to slip has a least length.
pub fn hysteresis(name: &'static str, n: &mut Numbers, setting: &Setting) -> Form {
    let slope = 0.75 * setting.rated_arcsec;
    let way = n.log("way_of_load", 0.03, 0.6);
    let power = n.log("power", 0.5, 8.0);
    let unlike = n.flat("unlike", -0.5, 0.5);
    let relax_s = n.log("relax_s", 1.0, 60.0);
    let (rest, grows) = (n.flat("rest", 0.2, 0.7), n.log("grows_as", 0.5, 2.0));
    // Prandtl's and Ishlinskii's: shares of stops that slip sooner and later.
    let lean = n.flat("lean", -1.0, 1.0);
    let spread = n.log("spread", 1.4, 2.6);
    let stops: [(f64, f64); 5] = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|k: f64| (spread.powf(k), spread.powf(lean * k)));
    let whole: f64 = stops.iter().map(|(_, weight)| weight).sum();
    let steep: f64 = stops.iter().map(|(way, weight)| weight / whole / way).sum();
    Form::winds(move |size, _, load, now, memory| {
        let moved = load - memory[5];
        memory[5] = load;
        let steepest = match name {
            "prandtl" => steep,
            // (1 + 1) to the power of Dahl at a turn.
            "dahl" => 2.0_f64.powf(power.min(2.0)),
            "asymmetric" => 1.5 * 1.5,
            _ => 1.0,
        };
        let way = way.max(1.1 * size.abs() * steepest / slope);
        if name == "prandtl" {
            let mut sum = 0.0;
            for ((reach, weight), held) in stops.iter().zip(memory.iter_mut()) {
                *held = (*held + moved / (reach * way)).clamp(-1.0, 1.0);
                sum += weight / whole * *held;
            }
            return -size * sum;
        }
        let parts = (moved.abs() / (0.1 * way)).ceil().clamp(1.0, 40.0);
        for _ in 0..parts as usize {
            let step = moved / parts / way;
            let along = memory[0] * step.signum();
            let rate = match name {
                "dahl" => (1.0 - along).max(0.0).powf(power.min(2.0)),
                "asymmetric" => {
                    (1.0 + unlike * step.signum()) * if along > 0.0 { 1.0 - along.powf(power) } else { 1.0 }
                }
                _ if along > 0.0 => 1.0 - along.powf(power),
                _ => 1.0,
            };
            memory[0] = (memory[0] + step * rate).clamp(-1.0, 1.0);
        }
        let slip = memory[0];
        match name {
            "relaxing" => {
                memory[0] *= 1.0 - (now.step_s / relax_s).min(1.0);
                -size * slip
            }
            "asymmetric" => -size * slip * (1.0 + unlike * slip.signum()),
            "butterfly" => -size * slip * (rest + (1.0 - rest) * load.abs().min(1.3).powf(grows)),
            _ => -size * slip,
        }
    })
}

/// Stiffness larger by `size` of itself for each kelvin above 20 °C.
pub fn heat(name: &'static str, n: &mut Numbers, setting: &Setting) -> Form {
    let path = PATHS.iter().find(|path| **path == name).copied().unwrap_or("one_lag");
    let warm = warmth(path, n);
    let rated = setting.rated_arcsec;
    let bend = n.flat("bend_per_k", -0.01, 0.02);
    let (middle, wide) = (n.flat("middle_c", -5.0, 35.0), n.log("width_k", 5.0, 25.0));
    let first = n.log("first_part", 0.15, 0.6);
    // Memory: the fifth number is the warmth of this step.
    let add = move |_: f64, now: &crate::train::Now, memory: &mut crate::train::Memory, _: &mut _| {
        memory[4] = warm(now, memory) - 20.0;
    };
    let winds = move |size: f64, own: f64, load: f64, memory: &[f64]| {
        let kelvin = memory[4];
        let stiffer = match name {
            "exponential" => (size * kelvin).exp() - 1.0,
            "bent" => size * kelvin * (1.0 + bend * kelvin),
            // A bond that softens around a temperature: so much over the whole width.
            "softening" => size * wide * (((kelvin + 20.0 - middle) / wide).tanh() + ((middle - 20.0) / wide).tanh()),
            _ => size * kelvin,
        };
        let gives = 1.0 / (1.0 + stiffer.max(-0.7)) - 1.0;
        if name == "light_load" { 0.9 * gives * rated * first * (load / first).tanh() } else { own * gives }
    };
    Form {
        add: Box::new(add),
        wind_up: Box::new(move |size, own, load, _, memory| winds(size, own, load, memory)),
        numbers: Vec::new(),
    }
}
