//! The plant against closed forms, its own books, and an integrator of small steps that knows nothing of it.

use std::f64::consts::{PI, TAU};

use flexspline_motion::friction::Friction;
use flexspline_motion::gear::{Gear, GearLine, Spring};
use flexspline_motion::plant::{JointPlant, PlantSettings};

const RATIO: f64 = 95.0;

fn spring(half_clearance_rad: f64, stiffness: f64, hardening: f64) -> Spring {
    Spring::Cubic { half_clearance_rad, stiffness, hardening }
}

/// Motor 1 kg·m² at the output, load 3 kg·m², nothing that rubs.
fn bare(spring: Spring, lines: Vec<GearLine>) -> PlantSettings {
    PlantSettings {
        motor_kg_m2: 1.0,
        load_kg_m2: 3.0,
        gear: Gear { ratio: RATIO, lines, spring },
        damping_s: 0.0,
        friction: Friction::NONE,
        drag_n_m: 0.0,
        gravity: [0.0; 2],
    }
}

/// Times at which the twist crosses zero upward, by straight lines between steps.
fn crossings(plant: &mut JointPlant, step_s: f64, seconds: f64) -> Vec<f64> {
    let mut times = Vec::new();
    let mut before = plant.meshed.twist_rad;
    for k in 1..=(seconds / step_s).round() as usize {
        plant.step(step_s, 0.0, 0.0);
        let now = plant.meshed.twist_rad;
        if before < 0.0 && now >= 0.0 {
            times.push((k as f64 - now / (now - before)) * step_s);
        }
        before = now;
    }
    times
}

fn period(times: &[f64]) -> f64 {
    (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64
}

#[test]
fn two_masses_swing_at_their_frequency_and_the_middle_goes_straight_on() {
    let stiffness = 7e5;
    let mut plant = JointPlant::new(bare(spring(0.0, stiffness, 0.0), Vec::new()), 20.0);
    plant.set_motion([0.0; 2], [0.3, 0.02]);
    let found = period(&crossings(&mut plant, 1e-5, 10.0));
    let theory = TAU / (stiffness * (1.0 / 1.0 + 1.0 / 3.0)).sqrt();
    println!("two masses: {:.6} Hz, theory {:.6} Hz", 1.0 / found, 1.0 / theory);
    assert!((found / theory - 1.0).abs() < 1e-5, "{found} {theory}");
    let middle = (plant.angle_rad[0] + 3.0 * plant.angle_rad[1]) / 4.0;
    assert!((middle - 10.0 * (0.3 + 3.0 * 0.02) / 4.0).abs() < 1e-9, "{middle}");
}

/// Complete elliptic integral of the first kind of modulus squared `m`, by the arithmetic-geometric mean.
fn elliptic(m: f64) -> f64 {
    let (mut a, mut g) = (1.0, (1.0 - m).sqrt());
    while (a - g).abs() > 1e-15 {
        (a, g) = (0.5 * (a + g), (a * g).sqrt());
    }
    0.5 * PI / a
}

#[test]
fn a_hardening_spring_swings_with_the_period_of_duffing() {
    let (stiffness, hardening, amplitude) = (2e5, 6e12, 3e-4);
    let mut plant = JointPlant::new(bare(spring(0.0, stiffness, hardening), Vec::new()), 20.0);
    // Twisted by the amplitude, with no momentum.
    plant.set_motion([-amplitude * 0.75, amplitude * 0.25], [0.0; 2]);
    let found = period(&crossings(&mut plant, 1e-5, 5.0));
    let reduced = 0.75;
    let (linear, cubic) = (stiffness / reduced, hardening / reduced * amplitude * amplitude);
    let theory = 4.0 * elliptic(cubic / (2.0 * (linear + cubic))) / (linear + cubic).sqrt();
    println!("Duffing: period {found:.9} s, theory {theory:.9} s");
    assert!(((linear + cubic) / linear).sqrt() > 1.5);
    assert!((found / theory - 1.0).abs() < 2e-5, "{found} {theory}");
}

fn lines() -> Vec<GearLine> {
    vec![
        GearLine { generator: 2.0, output: 0.0, amplitude_rad: 1.0e-4, phase_rad: 0.4 },
        GearLine { generator: 2.0, output: -2.0, amplitude_rad: 0.7e-4, phase_rad: 1.4 },
        GearLine { generator: 0.0, output: 1.0, amplitude_rad: 1.0e-4, phase_rad: 0.1 },
    ]
}

/// Everything that there is.
fn full() -> PlantSettings {
    PlantSettings {
        damping_s: 5e-5,
        friction: Friction::EROB80_100,
        drag_n_m: 0.5,
        gravity: [6.0, 0.3],
        ..bare(spring(1.5e-4, 4e5, 2e12), lines())
    }
}

#[test]
fn energy_balances_to_a_millionth_over_minutes() {
    let mut plant = JointPlant::new(full(), 5.0);
    let step = 1e-4;
    let mut moved = 0.0;
    for k in 0..1_800_000 {
        let t = f64::from(k) * step;
        let motor = 22.0 * (1.3 * t).sin() + 4.0 * (70.0 * t).sin();
        plant.step(step, motor, 3.0 * (0.7 * t).sin() + 6.0 * (9.0 * t).sin());
        moved += (motor * plant.rate_rad_s[0]).abs() * step;
    }
    let books = plant.energy.motor + plant.energy.outside - plant.energy.heat;
    let missing = books - plant.stored_j();
    println!(
        "3 minutes: {:.3} J in, {:.3} J heat, {:.4} J stored, missing {missing:.2e} J of {moved:.1} J",
        plant.energy.motor + plant.energy.outside,
        plant.energy.heat,
        plant.stored_j()
    );
    assert!(plant.energy.heat > 10.0);
    assert!(missing.abs() < 1e-6 * plant.energy.heat, "{missing}");
}

/// Runge and Kutta of fourth order, small steps, forces written down from the error alone.
fn reference(gear: &Gear, start: [[f64; 2]; 2], step: f64, steps: usize) -> [[f64; 2]; 2] {
    let Spring::Cubic { half_clearance_rad, stiffness, hardening } = gear.spring else { unreachable!() };
    let slope = |[[motor, load], rates]: [[f64; 2]; 2]| {
        let (mut error, mut by_generator, mut by_output) = (0.0, 0.0, 0.0);
        for line in &gear.lines {
            let angle = line.generator * motor * gear.ratio + line.output * load + line.phase_rad;
            error += line.amplitude_rad * angle.sin();
            by_generator += line.amplitude_rad * line.generator * angle.cos();
            by_output += line.amplitude_rad * line.output * angle.cos();
        }
        let twist = load - motor - error;
        let beyond = (twist.abs() - half_clearance_rad).max(0.0) * twist.signum();
        let torque = beyond * (stiffness + hardening * beyond * beyond);
        [rates, [torque * (1.0 + gear.ratio * by_generator), -torque * (1.0 - by_output) / 3.0]]
    };
    let plus = |[a, b]: [[f64; 2]; 2], h: f64, [c, d]: [[f64; 2]; 2]| {
        [[a[0] + h * c[0], a[1] + h * c[1]], [b[0] + h * d[0], b[1] + h * d[1]]]
    };
    let mut now = start;
    for _ in 0..steps {
        let a = slope(now);
        let b = slope(plus(now, 0.5 * step, a));
        let c = slope(plus(now, 0.5 * step, b));
        let d = slope(plus(now, step, c));
        now = plus(plus(plus(plus(now, step / 6.0, a), step / 3.0, b), step / 3.0, c), step / 6.0, d);
    }
    now
}

#[test]
fn the_plant_is_where_an_integrator_of_small_steps_has_it() {
    let settings = bare(spring(1.5e-4, 4e5, 2e12), lines());
    let start = [[0.0, 2.0e-4], [0.05, 0.07]];
    let seconds = 0.2;
    let far = |step: f64| {
        let mut plant = JointPlant::new(settings.clone(), 20.0);
        let [[m, l], [v, w]] = start;
        plant.set_motion([m, l], [v, w]);
        for _ in 0..(seconds / step).round() as usize {
            plant.step(step, 0.0, 0.0);
        }
        let there = reference(&settings.gear, start, 1e-6, 200_000);
        (plant.angle_rad[0] - there[0][0]).abs().max((plant.angle_rad[1] - there[0][1]).abs())
    };
    let [coarse, fine, finest] = [1e-4, 5e-5, 2.5e-5].map(far);
    println!("off the reference after {seconds} s: {coarse:.2e}, {fine:.2e}, {finest:.2e} rad at 100, 50, 25 us");
    // Second order, but for the corners of contact.
    assert!(finest < 2e-7 && finest < 0.15 * coarse, "{coarse} {fine} {finest}");
}

#[test]
fn order_two_resonates_where_and_as_much_as_theory_says() {
    let (stiffness, damping_s, load, amplitude) = (4e5, 1e-4, 3.0, 2e-6);
    let lines = vec![GearLine { generator: 2.0, output: 0.0, amplitude_rad: amplitude, phase_rad: 0.0 }];
    // A motor so heavy that nothing disturbs it.
    let settings =
        PlantSettings { motor_kg_m2: 1e9, damping_s, load_kg_m2: load, ..bare(spring(0.0, stiffness, 0.0), lines) };
    let natural = (stiffness / load).sqrt();
    for part in [0.5, 0.9, 0.97, 1.0, 1.03, 1.1, 1.6] {
        let order_two = part * natural;
        let speed = order_two / 2.0 / RATIO;
        let mut plant = JointPlant::new(settings.clone(), 20.0);
        plant.set_motion([0.0; 2], [speed, speed]);
        let step = 2e-5;
        let (mut sine, mut cosine, mut count) = (0.0, 0.0, 0.0);
        let whole = (20.0 * TAU / order_two / step).round() as usize;
        let settled = (1.5 / step) as usize;
        for k in 0..settled + whole {
            plant.step(step, 0.0, 0.0);
            if k >= settled {
                let angle = 2.0 * plant.angle_rad[0] * RATIO;
                let swing = plant.angle_rad[1] - plant.angle_rad[0];
                sine += swing * angle.sin();
                cosine += swing * angle.cos();
                count += 1.0;
            }
        }
        let found = 2.0 * sine.hypot(cosine) / count;
        let stiff = (1.0_f64).hypot(damping_s * order_two);
        let theory = amplitude * stiff / (1.0 - part * part).hypot(damping_s * order_two);
        println!(
            "order 2 at {part:4} of the resonance: {:.3} times the error, theory {:.3}",
            found / amplitude,
            theory / amplitude
        );
        assert!((found / theory - 1.0).abs() < 0.02, "{part}: {found} {theory}");
    }
}

#[test]
fn a_joint_at_rest_under_less_than_its_drag_stays_there() {
    let mut plant = JointPlant::new(full(), 20.0);
    plant.settings.gravity = [0.0; 2];
    for _ in 0..20_000 {
        plant.step(1e-4, 3.0, 0.4);
    }
    assert_eq!(plant.rate_rad_s, [0.0; 2]);
    for _ in 0..60_000 {
        plant.step(1e-4, -1.0, 3.0);
    }
    // Through the clearance, to the flank that carries it.
    assert!(plant.angle_rad[1] > 1.4e-4 && plant.rate_rad_s[1].abs() < 1e-6, "{plant:?}");
}

/// Friction that grows with the load changes the frequency, and takes or gives nothing:
/// `d²x/dt² = −(K·x + c·dx/dt)/J_l − ((1 + μ)·K·x + c·dx/dt)/J_m` of the twist `x`, where the motor lifts the load. If
/// it followed the load a step late it would be a damper of −µ·K·h, here three times the damping there is.
#[test]
fn friction_by_load_neither_damps_nor_drives_a_swing_whatever_the_step() {
    let (stiffness, damping, share, load_n_m) = (1e5, 1.0, 0.166, 6.0);
    let [motor, load] = [1.0, 0.3];
    let settings = PlantSettings {
        load_kg_m2: load,
        damping_s: damping / stiffness,
        friction: Friction { load_base: share, ..Friction::NONE },
        ..bare(spring(0.0, stiffness, 0.0), Vec::new())
    };
    let decay = 0.5 * damping * (1.0 / load + 1.0 / motor);
    for (step_s, way) in [(2e-4, -1.0), (2e-4, 1.0), (2e-5, -1.0)] {
        let mut plant = JointPlant::new(settings.clone(), 20.0);
        let (still, swing) = (load_n_m / stiffness, 1e-5);
        plant.set_motion([0.0, still + swing], [0.1 * way, 0.1 * way]);
        let steps = |seconds: f64| (seconds / step_s).round() as usize;
        let mut left = 0.0_f64;
        for step in 0..steps(0.5) {
            plant.step(step_s, -load_n_m * (1.0 - share * way), load_n_m);
            // Over more than a period at the end.
            if step >= steps(0.49) {
                left = left.max((plant.meshed.twist_rad - still).abs());
            }
        }
        let theory = (-0.5 * decay).exp();
        println!("{step_s} s, {way}: {:.3} of the swing left, theory {theory:.3}", left / swing);
        assert!((left / swing / theory - 1.0).abs() < 0.05, "{step_s} {way}: {left} {theory}");
    }
}
