//! A joint with mass: motor, servo, drive and load, as `flexspline fly` flies it.

use flexspline::{GeneratorAngle, OutputAngle, Quality, Table, TorqueReading};
use flexspline_motion::flight::{ARCSEC_PER_RAD, OneJoint, Ticked, Unit};
use flexspline_motion::keep::Kept;
use flexspline_motion::scenario::{Load, Moment, Scenario, TableKnown, TorqueKnown};
use flexspline_motion::servo::ServoSettings;

use crate::FmuError;
use crate::compensation::{QUALITIES, quality};
use crate::instance::{Inputs, Model};
use crate::resources::{DRIVE_FILE, Resources, file_error};
use crate::variables::{Choices, Kind, Variable, variables};

/// From what the torque is known.
pub static TORQUES: Choices = Choices {
    name: "TorqueKnown",
    items: &[
        ("on_load", "load_torque and gravity, with noise"),
        ("in_mesh", "a sensor between drive and load, with noise"),
        ("current", "the motor's current through a model of the friction"),
        ("none", "load_mean alone"),
    ],
};

const POSITIVE: [f64; 2] = [1e-9, 1e9];
const NOT_NEGATIVE: [f64; 2] = [0.0, 1e9];
const TORQUE: [f64; 2] = [-1e6, 1e6];

variables! {
    OUTPUT_ANGLE_COMMAND => Variable::input("output_angle_command", "rad", 0.0,
        "commanded angle of the output, positive counter-clockwise; generator and output are seen from the same side");
    OUTPUT_RATE_COMMAND => Variable::input("output_rate_command", "rad/s", 0.0,
        "rate of output_angle_command, fed forward");
    OUTPUT_ACCELERATION_COMMAND => Variable::input("output_acceleration_command", "rad/s2", 0.0,
        "acceleration of output_angle_command, fed forward");
    MOTOR_TORQUE_COMMAND => Variable::input("motor_torque_command", "N.m", 0.0,
        "torque of the motor, at the motor, positive where it turns it forward; read where servo is not set");
    LOAD_TORQUE => Variable::input("load_torque", "N.m", 0.0,
        "torque on the load from outside, without gravity, positive where it turns the output forward");
    SERVO => Variable::parameter("servo", Kind::Boolean, 1.0, [0.0, 1.0], "the servo follows output_angle_command; else motor_torque_command turns the motor");
    COMPENSATE => Variable::parameter("compensate", Kind::Boolean, 1.0, [0.0, 1.0], "the core corrects output_angle_command with the table; else the generator gets the command times the ratio");
    TORQUE_KNOWN => Variable::parameter("torque_known", Kind::Choice(&TORQUES), 0.0, [0.0, 3.0], "from what the compensation knows the torque");
    TORQUE_NOISE => Variable::parameter("torque_noise", Kind::Real("N.m"), 0.05, NOT_NEGATIVE, "noise of that torque, rms");
    LOAD_INERTIA => Variable::parameter("load_inertia", Kind::Real("kg.m2"), 3.0, POSITIVE, "inertia of the load");
    MOTOR_INERTIA => Variable::parameter("motor_inertia", Kind::Real("kg.m2"), 1.1e-4, POSITIVE, "inertia of motor and generator, at the motor; the servo is tuned for it");
    DRAG => Variable::parameter("drag", Kind::Real("N.m"), 0.5, NOT_NEGATIVE, "Coulomb drag of the output");
    DAMPING => Variable::parameter("damping", Kind::Real("1"), 0.02, [0.0, 1.0], "part of critical damping of the twist, at the largest load expected");
    GRAVITY_TORQUE => Variable::parameter("gravity_torque", Kind::Real("N.m"), 0.0, TORQUE, "weight times arm of the load");
    GRAVITY_ANGLE => Variable::parameter("gravity_angle", Kind::Real("rad"), 0.0, [-100.0, 100.0], "output angle at which the weight pulls forward most");
    FRICTION_KNOWN => Variable::parameter("friction_known", Kind::Real("1"), 0.8, [0.0, 1.0], "share of the motor's friction that the servo is told before");
    LOAD_FED_FORWARD => Variable::parameter("load_fed_forward", Kind::Real("1"), 1.0, [0.0, 1.0], "share of a torque known on the load that the servo is told before");
    LOAD_MEAN => Variable::parameter("load_mean", Kind::Real("N.m"), 0.0, TORQUE, "mean of the load that is expected");
    LOAD_SWING => Variable::parameter("load_swing", Kind::Real("N.m"), 0.0, TORQUE, "load that is expected: amplitude of a slow swing");
    LOAD_SWING_FREQUENCY => Variable::parameter("load_swing_frequency", Kind::Real("Hz"), 0.0, NOT_NEGATIVE, "load that is expected: frequency of the swing");
    LOAD_GUST => Variable::parameter("load_gust", Kind::Real("N.m"), 0.0, NOT_NEGATIVE, "load that is expected: gusts, rms");
    LOAD_GUST_FREQUENCY => Variable::parameter("load_gust_frequency", Kind::Real("Hz"), 0.0, NOT_NEGATIVE, "load that is expected: corner of the gusts' spectrum");
    LOAD_STEP => Variable::parameter("load_step", Kind::Real("N.m"), 0.0, TORQUE, "load that is expected: size of steps");
    OUTPUT_ACCELERATION_MOST => Variable::parameter("output_acceleration_most", Kind::Real("rad/s2"), 0.05, POSITIVE, "largest acceleration of the command that is expected");
    TICK => Variable::parameter("tick", Kind::Real("s"), 1e-3, [1e-5, 0.1], "time from tick to tick of the servo");
    STEPS => Variable::parameter("steps", Kind::Integer, 5.0, [1.0, 1000.0], "steps of the plant in a tick");
    LATE_STEPS => Variable::parameter("late_steps", Kind::Integer, 1.0, [0.0, 1000.0], "steps of the plant from a sample to the torque that it asks for; at most steps");
    MOTOR_TORQUE_MOST => Variable::parameter("motor_torque_most", Kind::Real("N.m"), 4.0, POSITIVE, "largest torque of the servo's motor, at the motor");
    POSITION_BANDWIDTH => Variable::parameter("position_hz", Kind::Real("Hz"), 6.0, POSITIVE, "position loop of the servo");
    SPEED_BANDWIDTH => Variable::parameter("speed_hz", Kind::Real("Hz"), 50.0, POSITIVE, "speed loop of the servo");
    INTEGRAL_BANDWIDTH => Variable::parameter("integral_hz", Kind::Real("Hz"), 3.0, NOT_NEGATIVE, "corner of the integral part of the speed loop");
    ENCODER_BITS => Variable::parameter("encoder_bits", Kind::Integer, 17.0, [8.0, 30.0], "bits of the encoder in a motor turn");
    ENCODER_JITTER => Variable::parameter("encoder_jitter", Kind::Real("s"), 5e-6, [0.0, 1e-3], "the encoder is read up to so much too late");
    CURRENT_NOISE => Variable::parameter("current_noise", Kind::Real("N.m"), 1e-3, NOT_NEGATIVE, "noise of the torque told from the motor's current, at the motor, rms");
    SEED => Variable::parameter("seed", Kind::Integer, 1.0, [0.0, 2_147_483_647.0], "start of the noises, which are the same in every run");
    MOTOR_ANGLE => Variable::motion("motor_angle", "rad", "angle of motor and wave generator, positive counter-clockwise");
    MOTOR_RATE => Variable::motion("motor_rate", "rad/s", "rate of motor_angle");
    OUTPUT_ANGLE => Variable::motion("output_angle", "rad", "angle of output and load, positive counter-clockwise");
    OUTPUT_RATE => Variable::motion("output_rate", "rad/s", "rate of output_angle");
    TRANSMISSION_ERROR => Variable::motion("transmission_error", "arcsec",
        "output_angle less motor_angle over the ratio, positive where the output leads");
    MESH_TORQUE => Variable::motion("mesh_torque", "N.m",
        "torque in the mesh at the output, positive where it turns the motor forward and the load back");
    MOTOR_TORQUE => Variable::motion("motor_torque", "N.m",
        "torque of the motor in the last tick, at the motor, positive where it turns the motor forward");
    STORED_ENERGY => Variable::motion("stored_energy", "J", "energy of motion and in the mesh");
    MOTOR_WORK => Variable::motion("motor_work", "J", "work of the motor since the start");
    LOAD_WORK => Variable::motion("load_work", "J", "work of load_torque and gravity since the start");
    HEAT => Variable::motion("heat", "J", "energy turned into heat since the start");
    ENERGY_ERROR => Variable::motion("energy_error", "J", "both works less heat less what is stored now beyond the start: rounding");
    GENERATOR_ANGLE_COMMAND => Variable::output("generator_angle_command", Kind::Real("rad"),
        "angle that the servo turned the wave generator to, positive counter-clockwise");
    OUTPUT_ANGLE_CORRECTION => Variable::output("output_angle_correction", Kind::Real("arcsec"),
        "output_angle_command less generator_angle_command over the ratio: has the sign of the error");
    MOTOR_SATURATED => Variable::output("motor_saturated", Kind::Boolean, "the motor of the servo gives all it has");
    CORRECTION_LIMITED => Variable::output("correction_limited", Kind::Boolean, "the limiter held the correction back");
    NOT_CORRECTED => Variable::output("not_corrected", Kind::Boolean,
        "no correction could be made in the tick, as where a torque is read beyond 1.5 times the table's range and beyond 3 times the load that is expected and 10 N.m more: no sensor shows it; the log says so");
    CORRECTION_QUALITY => Variable::output("correction_quality", Kind::Choice(&QUALITIES),
        "how far prediction and correction can be trusted; disabled where the core does not correct");
    DRIVE_TEMPERATURE => Variable::constant("drive_temperature", Kind::Real("degC"), "temperature of drive and lubricant");
    RATIO => Variable::constant("ratio", Kind::Real("rad/rad"), "generator over output");
    TABLE_ID => Variable::constant("table_id", Kind::Text, "id of the table");
    TIME => Variable::time();
}

/// Start values that differ from the usual for a scenario, by name.
pub fn starts_of(scenario: &Scenario) -> Vec<(&'static str, f64)> {
    let Scenario { load, servo, .. } = scenario;
    let known = match scenario.torque {
        TorqueKnown::OnLoad => 0.0,
        TorqueKnown::InMesh => 1.0,
        TorqueKnown::Current => 2.0,
        TorqueKnown::Not => 3.0,
    };
    let places = [
        (TORQUE_KNOWN, known),
        (TORQUE_NOISE, scenario.torque_noise_n_m),
        (LOAD_INERTIA, scenario.load_kg_m2),
        (MOTOR_INERTIA, servo.inertia_kg_m2),
        (DRAG, scenario.drag_n_m),
        (DAMPING, scenario.damping),
        (GRAVITY_TORQUE, load.gravity[0]),
        (GRAVITY_ANGLE, load.gravity[1]),
        (FRICTION_KNOWN, scenario.friction_known),
        (LOAD_FED_FORWARD, scenario.load_fed_forward),
        (LOAD_MEAN, load.bias_n_m),
        (LOAD_SWING, load.swing[0]),
        (LOAD_SWING_FREQUENCY, load.swing[1]),
        (LOAD_GUST, load.gust[0]),
        (LOAD_GUST_FREQUENCY, load.gust[1]),
        (LOAD_STEP, load.step[0]),
        (OUTPUT_ACCELERATION_MOST, scenario.acceleration_rad_s2),
        (TICK, servo.tick_s),
        (STEPS, servo.steps as f64),
        (LATE_STEPS, servo.late_steps as f64),
        (MOTOR_TORQUE_MOST, servo.largest_n_m),
        (POSITION_BANDWIDTH, servo.position_hz),
        (SPEED_BANDWIDTH, servo.speed_hz),
        (INTEGRAL_BANDWIDTH, servo.integral_hz),
        (ENCODER_BITS, f64::from(servo.encoder_bits)),
        (ENCODER_JITTER, servo.jitter_s),
        (CURRENT_NOISE, servo.current_noise_n_m),
        (SEED, f64::from(scenario.seed)),
        (DRIVE_TEMPERATURE, scenario.temperature_c),
    ];
    places.map(|(place, start)| (VARIABLES[place].name, start)).to_vec()
}

fn scenario_of(values: &[f64]) -> Scenario {
    Scenario {
        name: String::new(),
        legs: Vec::new(),
        acceleration_rad_s2: values[OUTPUT_ACCELERATION_MOST],
        load: Load {
            bias_n_m: values[LOAD_MEAN],
            swing: [values[LOAD_SWING], values[LOAD_SWING_FREQUENCY]],
            gust: [values[LOAD_GUST], values[LOAD_GUST_FREQUENCY]],
            step: [values[LOAD_STEP], 0.0],
            gravity: [values[GRAVITY_TORQUE], values[GRAVITY_ANGLE]],
        },
        load_kg_m2: values[LOAD_INERTIA],
        drag_n_m: values[DRAG],
        damping: values[DAMPING],
        temperature_c: values[DRIVE_TEMPERATURE],
        warming_k_s: 0.0,
        servo: ServoSettings {
            tick_s: values[TICK],
            steps: values[STEPS] as usize,
            late_steps: values[LATE_STEPS] as usize,
            inertia_kg_m2: values[MOTOR_INERTIA],
            largest_n_m: values[MOTOR_TORQUE_MOST],
            position_hz: values[POSITION_BANDWIDTH],
            speed_hz: values[SPEED_BANDWIDTH],
            integral_hz: values[INTEGRAL_BANDWIDTH],
            encoder_bits: values[ENCODER_BITS] as u32,
            jitter_s: values[ENCODER_JITTER],
            current_noise_n_m: values[CURRENT_NOISE],
        },
        friction: 1.0,
        friction_known: values[FRICTION_KNOWN],
        load_fed_forward: values[LOAD_FED_FORWARD],
        torque: match values[TORQUE_KNOWN] as u8 {
            0 => TorqueKnown::OnLoad,
            1 => TorqueKnown::InMesh,
            2 => TorqueKnown::Current,
            _ => TorqueKnown::Not,
        },
        torque_noise_n_m: values[TORQUE_NOISE],
        // Its image is given.
        table: TableKnown::Calibrated,
        seed: values[SEED] as u32,
    }
}

/// The outputs before the first tick where they are not zero: all stands.
pub fn initial(values: &mut [f64]) {
    values[CORRECTION_QUALITY] = f64::from(quality(Quality::Disabled));
}

/// The joint in a simulation.
pub struct MovingJoint {
    joint: OneJoint,
    /// Whether the last tick was not corrected, which the log says once.
    not_corrected: bool,
}

/// Why a tick was not corrected, as far as the reading of the torque tells.
fn why_not(joint: &OneJoint) -> String {
    let most = joint.on_board_settings().torque.largest_n_m;
    let reading = joint.on_board().map(|(told, _)| told.reading);
    match reading {
        Some(TorqueReading::OnLoad(torque) | TorqueReading::InMesh(torque))
            if torque.is_nan() || torque.abs() > most =>
        {
            format!(
                "not corrected: the torque reads {torque:.1} N.m, and its sensor shows up to {most:.1} N.m; a larger \
             {} or a table of a larger range widens it",
                VARIABLES[LOAD_MEAN].name
            )
        }
        _ => "not corrected: torque or table cannot be used in this tick".to_owned(),
    }
}

impl MovingJoint {
    /// With the values of its parameters.
    ///
    /// # Errors
    /// Which of them cannot be.
    pub fn new(resources: &Resources, values: &[f64]) -> Result<Self, FmuError> {
        let scenario = scenario_of(values);
        if scenario.servo.late_steps > scenario.servo.steps {
            let found = scenario.servo.late_steps as f64;
            return Err(FmuError::Value { name: VARIABLES[LATE_STEPS].name, found, allowed: "up to steps" });
        }
        let table = Table::check(&resources.image)?;
        let [built, nominal] = resources.gears.clone().ok_or_else(|| file_error(DRIVE_FILE, "missing"))?;
        let unit = Unit { drive: *table.drive(), nominal, built };
        let compensated = values[COMPENSATE] != 0.0;
        let joint = OneJoint::new(&scenario, &unit, Some(resources.image.clone()), compensated)?;
        Ok(Self { joint, not_corrected: false })
    }
}

impl Model for MovingJoint {
    fn tick_s(&self, values: &[f64]) -> f64 {
        values[TICK]
    }

    fn tick(&mut self, at: &Inputs<'_>, outputs: &mut [f64], says: &mut dyn FnMut(String)) -> Result<(), FmuError> {
        let joint = &mut self.joint;
        let outside_n_m = [at.start(LOAD_TORQUE), at.end(LOAD_TORQUE)];
        let read =
            [OUTPUT_ANGLE_COMMAND, OUTPUT_RATE_COMMAND, OUTPUT_ACCELERATION_COMMAND, MOTOR_TORQUE_COMMAND, LOAD_TORQUE];
        if let Some(place) = read.into_iter().find(|&place| !at.start(place).is_finite()) {
            let (name, found) = (VARIABLES[place].name, at.start(place));
            return Err(FmuError::Value { name, found, allowed: "a finite number" });
        }
        let servo = at.start(SERVO) != 0.0;
        if servo {
            let target_rad = at.start(OUTPUT_ANGLE_COMMAND);
            let held = OutputAngle::from_rad(target_rad).and(GeneratorAngle::from_rad(target_rad * joint.ratio()));
            held.ok_or(FmuError::Value {
                name: VARIABLES[OUTPUT_ANGLE_COMMAND].name,
                found: target_rad,
                allowed: "an angle for which the generator makes less than 2e9 turns",
            })?;
        }
        let ticked = if servo {
            joint.tick(&Moment {
                time_s: 0.0,
                target_rad: at.start(OUTPUT_ANGLE_COMMAND),
                rate_rad_s: at.start(OUTPUT_RATE_COMMAND),
                acceleration_rad_s2: at.start(OUTPUT_ACCELERATION_COMMAND),
                steady: false,
                outside_n_m,
            })
        } else {
            joint.push(at.start(MOTOR_TORQUE_COMMAND), outside_n_m);
            Ticked::default()
        };
        if ticked.not_corrected && !self.not_corrected {
            says(why_not(joint));
        }
        self.not_corrected = ticked.not_corrected;
        let plant = joint.plant();
        let ratio = joint.ratio();
        let ([motor, output, _], [motor_rate, output_rate, _]) = (plant.angle_rad, plant.rate_rad_s);
        if !(motor.is_finite() && output.is_finite()) {
            return Err(FmuError::RunsAway);
        }
        outputs[MOTOR_ANGLE] = motor * ratio;
        outputs[MOTOR_RATE] = motor_rate * ratio;
        outputs[OUTPUT_ANGLE] = output;
        outputs[OUTPUT_RATE] = output_rate;
        outputs[TRANSMISSION_ERROR] = (output - motor) * ARCSEC_PER_RAD;
        outputs[MESH_TORQUE] = plant.mesh_n_m();
        outputs[MOTOR_TORQUE] = if servo { joint.motor_n_m() } else { at.start(MOTOR_TORQUE_COMMAND) };
        outputs[STORED_ENERGY] = plant.stored_j();
        outputs[MOTOR_WORK] = plant.energy.motor;
        outputs[LOAD_WORK] = plant.energy.outside;
        outputs[HEAT] = plant.energy.heat;
        outputs[ENERGY_ERROR] = joint.missing_j();
        outputs[GENERATOR_ANGLE_COMMAND] = ticked.command_rad;
        outputs[OUTPUT_ANGLE_CORRECTION] = ticked.correction_rad * ARCSEC_PER_RAD;
        for (place, set) in [
            (MOTOR_SATURATED, ticked.saturated),
            (CORRECTION_LIMITED, ticked.held_back),
            (NOT_CORRECTED, ticked.not_corrected),
        ] {
            outputs[place] = f64::from(u8::from(set));
        }
        outputs[CORRECTION_QUALITY] = f64::from(quality(ticked.quality.unwrap_or(Quality::Disabled)));
        Ok(())
    }

    fn keep(&self, to: &mut Vec<u64>) {
        self.joint.keep(to);
    }

    fn take(&mut self, from: &mut dyn Iterator<Item = u64>) -> Option<()> {
        self.joint.take(from)
    }
}
