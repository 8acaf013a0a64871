//! Which loops of a servo ring with motor and load: by theory and in motion.

use std::f64::consts::TAU;

use flexspline::GeneratorAngle;
use flexspline_motion::friction::Friction;
use flexspline_motion::gear::{Gear, Spring};
use flexspline_motion::loops::{LoopTorquePath, TwoMasses};
use flexspline_motion::plant::{JointPlant, PlantSettings};
use flexspline_motion::servo::{Servo, ServoCommand, ServoSettings};

const RATIO: f64 = 95.0;
const TICK_S: f64 = 1e-3;

/// A fast servo without delay, for a motor of the size that turns HHD-95.
const SERVO: ServoSettings = ServoSettings {
    tick_s: TICK_S,
    steps: 20,
    late_steps: 0,
    inertia_kg_m2: 1.1e-4,
    largest_n_m: 4.0,
    position_hz: 25.0,
    speed_hz: 100.0,
    integral_hz: 10.0,
    encoder_bits: 30,
    jitter_s: 0.0,
    current_noise_n_m: 0.0,
};

/// The cam under load: 70 N·m to 200 N·m in 29″ by its map.
const CAM: TwoMasses = TwoMasses {
    motor_kg_m2: 1.1e-4 * RATIO * RATIO,
    load_kg_m2: 3.0,
    stiffness: 9.1e5,
    damping_s: 6.6e-5,
    ratio: RATIO,
};

fn plant(joint: &TwoMasses) -> JointPlant {
    let spring = Spring::Cubic { half_clearance_rad: 0.0, stiffness: joint.stiffness, hardening: 0.0 };
    let settings = PlantSettings {
        motor_kg_m2: joint.motor_kg_m2,
        load_kg_m2: joint.load_kg_m2,
        gear: Gear { ratio: RATIO, lines: Vec::new(), spring },
        damping_s: joint.damping_s,
        friction: Friction::NONE,
        drag_n_m: 0.0,
        gravity: [0.0; 2],
    };
    let mut plant = JointPlant::new(settings, 20.0);
    // A knock on the load.
    plant.set_motion([0.0; 2], [0.0, 1e-4]);
    plant
}

/// Torque given to the motor: none, or the torque of the mesh through the compensation.
fn fed_back(path: Option<&LoopTorquePath>, filtered: &mut f64, plant: &JointPlant) -> f64 {
    let Some(path) = path else { return 0.0 };
    let share = 1.0 - libm::exp(-TAU * path.bandwidth_hz * TICK_S);
    *filtered += share * (plant.mesh_n_m() - *filtered);
    -path.gain * *filtered / plant_stiffness(plant)
}

fn plant_stiffness(plant: &JointPlant) -> f64 {
    let Spring::Cubic { stiffness, .. } = plant.settings.gear.spring else { unreachable!() };
    stiffness
}

/// Largest speed of the load over each tenth of a second.
fn knocked(joint: &TwoMasses, servo: &ServoSettings, path: Option<&LoopTorquePath>, seconds: f64) -> Vec<f64> {
    let mut plant = plant(joint);
    let mut servo = Servo::new(*servo, RATIO, 1);
    let (mut filtered, mut before) = (0.0, 0.0);
    let mut swings = Vec::new();
    for _ in 0..(seconds / 0.1).round() as usize {
        let mut most = 0.0_f64;
        for _ in 0..100 {
            let _ = servo.read(plant.angle_rad[0], plant.rate_rad_s[0]);
            let correction = fed_back(path, &mut filtered, &plant) * RATIO;
            let fed = path.is_some_and(|path| path.rate_fed_forward);
            let asked = ServoCommand {
                command: GeneratorAngle::from_rad(correction).unwrap(),
                rate_rad_s: if fed { (correction - before) / TICK_S } else { 0.0 },
                acceleration_rad_s2: 0.0,
                torque_n_m: 0.0,
                starts: 0.0,
            };
            before = correction;
            plant.go(&mut servo, &asked, |_| 0.0);
            most = most.max(plant.rate_rad_s[1].abs());
            if most > 1e3 {
                swings.push(most);
                return swings;
            }
        }
        swings.push(most);
    }
    swings
}

/// The two-mass resonance of the cam with 3 kg·m²: the servo is stable around it, and a knock dies away. A plant whose
/// motor felt the mesh's torque of the tick before would ring there, by a damping of less than nothing.
#[test]
fn the_servo_does_not_ring_at_the_resonance_of_motor_and_load() {
    let margin = CAM.servo(&SERVO);
    println!(
        "motor and load swing at {:.0} Hz; servo's least distance from -1 {:.2} at {:.0} Hz",
        CAM.free_hz(),
        margin.distance,
        margin.at_hz
    );
    assert!((150.0..185.0).contains(&CAM.free_hz()));
    assert!(margin.stable && margin.distance > 0.15);
    let swings = knocked(&CAM, &SERVO, None, 1.0);
    println!("load's speed after a knock of 1e-4 rad/s: {swings:?} rad/s");
    assert!(swings[9] < 1e-2 * swings[0], "{swings:?}");
}

/// Joints from a light camera on a soft drive to a heavy dish on a stiff one, and servos quick and late.
fn joints() -> impl Iterator<Item = (TwoMasses, ServoSettings)> {
    let loads = [0.1, 0.3, 1.0, 3.0, 10.0];
    let stiffnesses = [2e4, 1e5, 3e5, 9e5];
    let servos = [(25.0, 100.0, 0), (12.0, 50.0, 20), (10.0, 40.0, 0), (5.0, 20.0, 20)];
    loads.into_iter().flat_map(move |load_kg_m2| {
        stiffnesses.into_iter().flat_map(move |stiffness| {
            servos.into_iter().map(move |(position_hz, speed_hz, late_steps)| {
                let free = stiffness * (1.0 / load_kg_m2 + 1.0 / CAM.motor_kg_m2);
                // A fiftieth of critical damping.
                let joint = TwoMasses { load_kg_m2, stiffness, damping_s: 0.04 / free.sqrt(), ..CAM };
                (joint, ServoSettings { position_hz, speed_hz, late_steps, integral_hz: speed_hz / 10.0, ..SERVO })
            })
        })
    })
}

/// Whether a servo by itself is stable, with some distance: 0.05 from −1.
fn sound(joint: &TwoMasses, servo: &ServoSettings) -> bool {
    let margin = joint.servo(servo);
    margin.stable && margin.distance >= 0.05
}

/// Whether a knock of 1e-4 rad/s lasts; what is below a hundredth of it is the encoder's.
fn grows(swings: &[f64]) -> bool {
    let last = swings[swings.len() - 1];
    last > 1e-3 || last > 1e-6 && last > 0.97 * swings[swings.len() / 2]
}

#[test]
fn theory_says_which_loops_are_stable_and_motion_agrees() {
    let (mut wrong, mut fast, mut unstable, mut near, mut count) = (0, 0, 0, 0, 0);
    for (k, (joint, servo)) in joints().enumerate() {
        let alone = joint.servo(&servo);
        if alone.distance < 0.05 || !alone.stable {
            assert!(alone.distance < 0.05 || grows(&knocked(&joint, &servo, None, 3.0)), "{joint:?} {servo:?}");
            continue;
        }
        let bandwidth_hz = [2.0, 15.0, 80.0, 400.0][(k + k / 4) % 4];
        for rate_fed_forward in [false, true] {
            let path = LoopTorquePath { gain: 1.0, bandwidth_hz, late_s: 0.0, rate_fed_forward };
            let theory = joint.torque_loop(&servo, &path);
            count += 1;
            // On the limit itself 3 s tell nothing.
            if theory.distance < 0.06 {
                near += 1;
                continue;
            }
            let found = !grows(&knocked(&joint, &servo, Some(&path), 3.0));
            unstable += usize::from(!found);
            // Above a third of half the sampling frequency sampling is more than a delay.
            if found != theory.stable && joint.free_hz() > 160.0 {
                fast += 1;
            } else if found != theory.stable {
                println!(
                    "{:.1} kg.m2 {:.0e}: low-pass {bandwidth_hz} Hz: theory {theory:?}, motion {found}",
                    joint.load_kg_m2, joint.stiffness
                );
                wrong += 1;
            }
        }
    }
    println!(
        "{count} loops, {unstable} unstable in motion, {near} near the limit, {wrong} where theory and motion differ, \
         and {fast} that swing faster than 160 Hz"
    );
    assert!(count > 100 && unstable > 10);
    assert!(wrong == 0 && fast < 8, "{wrong} {fast}");
}

/// No point of the map where the compensation turns a stable loop unstable, with the low-pass that the theory gives.
#[test]
fn with_the_low_pass_that_keeps_the_margin_no_stable_loop_turns_unstable() {
    const DISTANCE: f64 = 0.5;
    let mut least = (f64::INFINITY, 0.0, 0.0);
    let mut range = [f64::INFINITY, 0.0_f64];
    let (mut checked, mut unsound, mut refused) = (0, 0, 0);
    for (k, (joint, servo)) in joints().enumerate() {
        if !sound(&joint, &servo) {
            continue;
        }
        for (gain, late_s) in [(1.0, 0.0), (1.2, 0.0), (1.0, 2e-3)] {
            let path = LoopTorquePath { gain, bandwidth_hz: 0.0, late_s, rate_fed_forward: false };
            let Some(bandwidth_hz) = joint.widest_hz(&servo, &path, [DISTANCE, 0.2], 50.0) else {
                refused += 1;
                continue;
            };
            range = [range[0].min(bandwidth_hz), range[1].max(bandwidth_hz)];
            // The drive is a fifth stiffer or softer than it was thought to be.
            for wrong in [1.0, 0.8, 1.2] {
                let unit = TwoMasses { stiffness: joint.stiffness * wrong, ..joint };
                if !sound(&unit, &servo) {
                    unsound += 1;
                    continue;
                }
                let gain = gain * wrong;
                let margin = unit.torque_loop(&servo, &LoopTorquePath { bandwidth_hz, gain, ..path });
                checked += 1;
                assert!(margin.stable, "{unit:?} {servo:?} {:?} {bandwidth_hz}", unit.servo(&servo));
                if margin.distance < least.0 {
                    least = (margin.distance, unit.load_kg_m2, unit.stiffness);
                }
            }
            if k % 7 == 0 && late_s == 0.0 {
                let path = LoopTorquePath { bandwidth_hz, ..path };
                let swings = knocked(&joint, &servo, Some(&path), 3.0);
                assert!(
                    !grows(&swings),
                    "{joint:?} {servo:?} {bandwidth_hz} {:?} {:?} {swings:?}",
                    joint.servo(&servo),
                    joint.torque_loop(&servo, &path)
                );
            }
        }
    }
    println!(
        "{checked} loops stable ({unsound} whose servo alone is not sound, {refused} for which there is no low-pass), \
         least distance {least:?}; low-pass {range:.2?} Hz"
    );
    assert!(checked > 300 && least.0 > 0.3, "{least:?}");
}
