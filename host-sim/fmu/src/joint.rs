//! A joint with mass: motor, servo, drive and load, as `flexspline fly` flies it.

use flexspline::{GeneratorAngle, OutputAngle, Quality, Table, TorqueReading};
use flexspline_motion::flight::{ARCSEC_PER_RAD, JointUnit, OneJoint, Ticked};
use flexspline_motion::scenario::{Moment, Scenario, TableKnown, TorqueKnown};

use crate::FmuError;
use crate::compensation::QUALITIES;
use crate::instance::{Inputs, Model};
use crate::resources::{DRIVE_FILE, Resources, file_error};
use crate::variables::{Choices, FmiRole, FmiType, NOT_NEGATIVE, POSITIVE, Variable, variables};

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
    SERVO => Variable::boolean("servo", true,
        "the servo follows output_angle_command; else motor_torque_command turns the motor");
    COMPENSATE => Variable::boolean("compensate", true,
        "the core corrects output_angle_command with the table; else the generator gets the command times the ratio");
    TORQUE_KNOWN => Variable::choice("torque_known", &TORQUES, FmiRole::Parameter, 0.0,
        "from what the compensation knows the torque");
    TORQUE_NOISE => Variable::real("torque_noise", "N.m", 0.05, NOT_NEGATIVE, "noise of that torque, rms");
    LOAD_INERTIA => Variable::real("load_inertia", "kg.m2", 3.0, POSITIVE, "inertia of the load");
    MOTOR_INERTIA => Variable::real("motor_inertia", "kg.m2", 1.1e-4, POSITIVE,
        "inertia of motor and generator, at the motor; the servo is tuned for it");
    DRAG => Variable::real("drag", "N.m", 0.5, NOT_NEGATIVE, "Coulomb drag of the output");
    DAMPING => Variable::real("damping", "1", 0.02, [0.0, 1.0],
        "part of critical damping of the twist, at the largest load expected");
    GRAVITY_TORQUE => Variable::real("gravity_torque", "N.m", 0.0, TORQUE, "weight times arm of the load");
    GRAVITY_ANGLE => Variable::real("gravity_angle", "rad", 0.0, [-100.0, 100.0],
        "output angle at which the weight pulls forward most");
    FRICTION_KNOWN => Variable::real("friction_known", "1", 0.8, [0.0, 1.0],
        "share of the motor's friction fed forward to the servo");
    LOAD_FED_FORWARD => Variable::real("load_fed_forward", "1", 1.0, [0.0, 1.0],
        "share of a torque known on the load fed forward to the servo");
    LOAD_MEAN => Variable::real("load_mean", "N.m", 0.0, TORQUE, "mean of the load that is expected");
    LOAD_SWING => Variable::real("load_swing", "N.m", 0.0, TORQUE, "load that is expected: amplitude of a slow swing");
    LOAD_SWING_FREQUENCY => Variable::real("load_swing_frequency", "Hz", 0.0, NOT_NEGATIVE,
        "load that is expected: frequency of the swing");
    LOAD_GUST => Variable::real("load_gust", "N.m", 0.0, NOT_NEGATIVE, "load that is expected: gusts, rms");
    LOAD_GUST_FREQUENCY => Variable::real("load_gust_frequency", "Hz", 0.0, NOT_NEGATIVE,
        "load that is expected: corner of the gusts' spectrum");
    LOAD_STEP => Variable::real("load_step", "N.m", 0.0, TORQUE, "load that is expected: size of steps");
    OUTPUT_ACCELERATION_MOST => Variable::real("output_acceleration_most", "rad/s2", 0.05, POSITIVE,
        "largest acceleration of the command that is expected");
    TICK => Variable::real("tick", "s", 1e-3, [1e-5, 0.1], "time from tick to tick of the servo");
    STEPS => Variable::whole("steps", 5.0, [1.0, 1000.0], "steps of the plant in a tick");
    LATE_STEPS => Variable::whole("late_steps", 1.0, [0.0, 1000.0],
        "steps of the plant from a sample to the torque that it asks for; at most steps");
    MOTOR_TORQUE_MOST => Variable::real("motor_torque_most", "N.m", 4.0, POSITIVE,
        "largest torque of the servo's motor, at the motor");
    POSITION_BANDWIDTH => Variable::real("position_hz", "Hz", 6.0, POSITIVE, "position loop of the servo");
    SPEED_BANDWIDTH => Variable::real("speed_hz", "Hz", 50.0, POSITIVE, "speed loop of the servo");
    INTEGRAL_BANDWIDTH => Variable::real("integral_hz", "Hz", 3.0, NOT_NEGATIVE,
        "corner of the integral part of the speed loop");
    ENCODER_BITS => Variable::whole("encoder_bits", 17.0, [8.0, 30.0], "bits of the encoder in a motor turn");
    ENCODER_JITTER => Variable::real("encoder_jitter", "s", 5e-6, [0.0, 1e-3],
        "the encoder is read up to so much too late");
    CURRENT_NOISE => Variable::real("current_noise", "N.m", 1e-3, NOT_NEGATIVE,
        "noise of the torque from the motor's current, at the motor, rms");
    SEED => Variable::whole("seed", 1.0, [0.0, 2_147_483_647.0],
        "start of the noises, which are the same in every run");
    MOTOR_ANGLE => Variable::motion("motor_angle", "rad",
        "angle of motor and wave generator, positive counter-clockwise");
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
    ENERGY_ERROR => Variable::motion("energy_error", "J",
        "both works less heat less what is stored now beyond the start: rounding");
    GENERATOR_ANGLE_COMMAND => Variable::output("generator_angle_command", FmiType::Real("rad"),
        "angle that the servo turned the wave generator to, positive counter-clockwise");
    OUTPUT_ANGLE_CORRECTION => Variable::output("output_angle_correction", FmiType::Real("arcsec"),
        "output_angle_command less generator_angle_command over the ratio: has the sign of the error");
    MOTOR_SATURATED => Variable::output("motor_saturated", FmiType::Boolean, "the motor of the servo gives all it has");
    CORRECTION_LIMITED => Variable::output("correction_limited", FmiType::Boolean,
        "the limiter held the correction back");
    NOT_CORRECTED => Variable::output("not_corrected", FmiType::Boolean,
        "no correction could be made in the tick, as where a torque is read beyond 1.5 times the table's range and \
         beyond 3 times the load that is expected and 10 N.m more: no sensor shows it; the log says so");
    CORRECTION_QUALITY => Variable::output("correction_quality", FmiType::Choice(&QUALITIES),
        "how far prediction and correction can be trusted; disabled where the core does not correct");
    DRIVE_TEMPERATURE => Variable::constant("drive_temperature", FmiType::Real("degC"),
        "temperature of drive and lubricant");
    RATIO => Variable::constant("ratio", FmiType::Real("rad/rad"), "generator over output");
    TABLE_ID => Variable::constant("table_id", FmiType::Text, "id of the table");
}

/// A number in a scenario.
type Number = fn(&mut Scenario) -> &mut f64;
/// Variables that are numbers of a scenario.
const OF_SCENARIO: [(usize, Number); 24] = [
    (TORQUE_NOISE, |scenario| &mut scenario.torque_noise_n_m),
    (LOAD_INERTIA, |scenario| &mut scenario.load_kg_m2),
    (MOTOR_INERTIA, |scenario| &mut scenario.servo.inertia_kg_m2),
    (DRAG, |scenario| &mut scenario.drag_n_m),
    (DAMPING, |scenario| &mut scenario.damping),
    (GRAVITY_TORQUE, |scenario| &mut scenario.load.gravity[0]),
    (GRAVITY_ANGLE, |scenario| &mut scenario.load.gravity[1]),
    (FRICTION_KNOWN, |scenario| &mut scenario.friction_known),
    (LOAD_FED_FORWARD, |scenario| &mut scenario.load_fed_forward),
    (LOAD_MEAN, |scenario| &mut scenario.load.bias_n_m),
    (LOAD_SWING, |scenario| &mut scenario.load.swing[0]),
    (LOAD_SWING_FREQUENCY, |scenario| &mut scenario.load.swing[1]),
    (LOAD_GUST, |scenario| &mut scenario.load.gust[0]),
    (LOAD_GUST_FREQUENCY, |scenario| &mut scenario.load.gust[1]),
    (LOAD_STEP, |scenario| &mut scenario.load.step[0]),
    (OUTPUT_ACCELERATION_MOST, |scenario| &mut scenario.acceleration_rad_s2),
    (TICK, |scenario| &mut scenario.servo.tick_s),
    (MOTOR_TORQUE_MOST, |scenario| &mut scenario.servo.largest_n_m),
    (POSITION_BANDWIDTH, |scenario| &mut scenario.servo.position_hz),
    (SPEED_BANDWIDTH, |scenario| &mut scenario.servo.speed_hz),
    (INTEGRAL_BANDWIDTH, |scenario| &mut scenario.servo.integral_hz),
    (ENCODER_JITTER, |scenario| &mut scenario.servo.jitter_s),
    (CURRENT_NOISE, |scenario| &mut scenario.servo.current_noise_n_m),
    (DRIVE_TEMPERATURE, |scenario| &mut scenario.temperature_c),
];

/// Start values of a scenario, by the name of their variable.
pub fn starts_of(scenario: &Scenario) -> Vec<(&'static str, f64)> {
    let mut scenario = scenario.clone();
    let mut starts: Vec<(usize, f64)> = OF_SCENARIO.map(|(place, number)| (place, *number(&mut scenario))).to_vec();
    starts.extend([
        (TORQUE_KNOWN, f64::from(scenario.torque as u8)),
        (STEPS, scenario.servo.steps as f64),
        (LATE_STEPS, scenario.servo.late_steps as f64),
        (ENCODER_BITS, f64::from(scenario.servo.encoder_bits)),
        (SEED, f64::from(scenario.seed)),
    ]);
    starts.into_iter().map(|(place, start)| (VARIABLES[place].name, start)).collect()
}

fn scenario_of(values: &[f64]) -> Scenario {
    // The image of the table is given.
    let mut scenario = Scenario { friction: 1.0, table: TableKnown::Calibrated, ..Scenario::default() };
    for (place, number) in OF_SCENARIO {
        *number(&mut scenario) = values[place];
    }
    (_, scenario.torque) = TorqueKnown::NAMES[(values[TORQUE_KNOWN] as usize).min(3)];
    scenario.servo.steps = values[STEPS] as usize;
    scenario.servo.late_steps = values[LATE_STEPS] as usize;
    scenario.servo.encoder_bits = values[ENCODER_BITS] as u32;
    scenario.seed = values[SEED] as u32;
    scenario
}

/// The outputs before the first tick where they are not zero: all stands.
pub fn initial(values: &mut [f64]) {
    values[CORRECTION_QUALITY] = f64::from(Quality::Disabled as u8);
}

/// The joint in a simulation.
pub struct MovingJoint {
    joint: OneJoint,
    /// Whether the last tick was not corrected, which the log says once.
    not_corrected: bool,
}

/// Why a tick was not corrected, as far as the reading of the torque shows.
fn why_not(joint: &OneJoint) -> String {
    let most = joint.on_board_settings().torque.largest_n_m;
    let reading = joint.on_board().map(|(input, _)| input.reading);
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
        let unit = JointUnit { drive: *table.drive(), nominal, built };
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
            let _ = held.ok_or(FmuError::Value {
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
        let ([motor, output], [motor_rate, output_rate]) = (plant.angle_rad, plant.rate_rad_s);
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
        outputs[CORRECTION_QUALITY] = f64::from(ticked.quality.unwrap_or(Quality::Disabled) as u8);
        Ok(())
    }
}
