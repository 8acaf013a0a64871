//! The core's joint over its table: where to turn the generator so that the output comes to where it is wanted.

use flexspline::{
    Adjustment, Direction, Flags, GeneratorAngle, Images, Input, Joint, JointState, Limits, Mode, OutputAngle, Overrun,
    Quality, Store, Table, TorquePath, TorqueReading, TorqueSettings,
};
use flexspline_motion::flight::{ARCSEC_PER_RAD, TABLE_DRAG_N_M};

use crate::FmuError;
use crate::instance::{Inputs, Model};
use crate::resources::Resources;
use crate::variables::{Choices, FmiRole, FmiType, NOT_NEGATIVE, POSITIVE, Variable, variables};

/// Modes of the correction, in the order of the core's `Mode`.
pub(crate) static MODES: Choices = Choices {
    name: "Mode",
    items: &[
        ("off", "no correction; one that is there is taken back within the limits"),
        ("tracking", "the correction follows the table"),
        ("hold", "the correction stays as it is"),
        ("safe", "no correction before off was asked for"),
    ],
};
/// How far an answer of the table can be trusted, in the order of the core's `Quality`.
pub(crate) static QUALITIES: Choices = Choices {
    name: "Quality",
    items: &[
        ("in_range", "inside the range of the table, side of the play known"),
        ("uncertain", "known to within the uncertainty"),
        ("extrapolated", "torque or temperature beyond the table, the value at its edge is used"),
        ("disabled", "no correction"),
    ],
};
/// Which torque is given.
pub(crate) static READINGS: Choices = Choices {
    name: "TorqueReading",
    items: &[
        (
            "table",
            "on the load in steady motion with the drag that the table was made with; goes to the table as it is",
        ),
        ("in_mesh", "in the mesh: goes through a low-pass and the hold"),
        ("on_load", "on the load: also less the drag of this unit"),
    ],
};

/// A simulation's torque has no sensor whose range it could leave.
const LARGEST_READING_N_M: f32 = 1e9;

variables! {
    OUTPUT_ANGLE_COMMAND => Variable::input("output_angle_command", "rad", 0.0,
        "commanded angle of the output, positive counter-clockwise; generator and output are seen from the same side");
    OUTPUT_RATE_COMMAND => Variable::input("output_rate_command", "rad/s", 0.0,
        "rate of output_angle_command, for generator_rate_command and the direction of the drag; 0 if not known");
    GENERATOR_ANGLE_MEASURED => Variable::input("generator_angle_measured", "rad", 0.0,
        "measured angle of the wave generator, positive counter-clockwise; read where generator_measured is set");
    OUTPUT_TORQUE => Variable::input("output_torque", "N.m", 0.0,
        "torque at the output, positive where it turns the output forward; torque_is says which torque");
    DRIVE_TEMPERATURE => Variable::input("drive_temperature", "degC", 20.0, "temperature of the drive");
    MODE => Variable::choice("mode", &MODES, FmiRole::Tunable, 1.0,
        "mode asked for; a change that is not legal is logged, and the mode stays");
    GENERATOR_MEASURED => Variable::boolean("generator_measured", false,
        "the generator is where generator_angle_measured says; else where it was commanded a tick before");
    TORQUE_IS => Variable::choice("torque_is", &READINGS, FmiRole::Parameter, 0.0, "which torque is given");
    TORQUE_BANDWIDTH => Variable::real("torque_bandwidth", "Hz", 100.0, POSITIVE,
        "corner of the low-pass of a torque in the mesh or on the load");
    DRAG => Variable::real("drag", "N.m", 0.0, NOT_NEGATIVE,
        "Coulomb drag of the output of this unit, taken off a torque on the load");
    TABLE_DRAG => Variable::real("table_drag", "N.m", TABLE_DRAG_N_M, NOT_NEGATIVE,
        "Coulomb drag of the output that the table was made with");
    TORQUE_HOLD => Variable::real("torque_hold", "N.m", 0.0, NOT_NEGATIVE,
        "a torque in the mesh below this does not change the flank");
    TICK => Variable::real("tick", "s", 1e-3, [1e-6, 10.0], "time from tick to tick");
    CORRECTION_RATE_LIMIT => Variable::real("correction_rate_limit", "rad/s", 0.05, POSITIVE,
        "fastest correction at the output");
    CORRECTION_ACCELERATION_LIMIT => Variable::real("correction_acceleration_limit", "rad/s2", 5.0, POSITIVE,
        "largest acceleration of the correction at the output");
    GENERATOR_RATE_LIMIT => Variable::real("generator_rate_limit", "rad/s", 600.0, POSITIVE,
        "a generator that moves faster from tick to tick is a glitch");
    PATIENCE => Variable::whole("patience", 5.0, [0.0, 65_534.0],
        "ticks for which a glitch is not believed, and the last correction is kept where none can be made");
    ANGLE_HOLD => Variable::real("angle_hold", "rad", 2.4e-6, [0.0, 0.05],
        "commands nearer than this to the one before keep the flank; 0 for none");
    RATE_AHEAD => Variable::real("rate_ahead", "s", 4e-3, [1e-6, 10.0],
        "generator_rate_command is the slope of the table over this time");
    GENERATOR_ANGLE_COMMAND => Variable::output("generator_angle_command", FmiType::Real("rad"),
        "where to turn the wave generator, positive counter-clockwise");
    GENERATOR_RATE_COMMAND => Variable::output("generator_rate_command", FmiType::Real("rad/s"),
        "rate of generator_angle_command, to feed forward to a speed loop");
    OUTPUT_ANGLE_CORRECTION => Variable::output("output_angle_correction", FmiType::Real("arcsec"),
        "output_angle_command less generator_angle_command over the ratio: has the sign of the error");
    CORRECTION_HELD_BACK => Variable::output("correction_held_back", FmiType::Real("arcsec"),
        "part of the correction that the limiter held back");
    OUTPUT_ANGLE_PREDICTED => Variable::output("output_angle_predicted", FmiType::Real("rad"),
        "angle of the output by the table, positive counter-clockwise");
    TRANSMISSION_ERROR_PREDICTED => Variable::output("transmission_error_predicted", FmiType::Real("arcsec"),
        "transmission error by the table: output less generator over the ratio, positive where the output leads");
    PREDICTION_UNCERTAINTY => Variable::output("prediction_uncertainty", FmiType::Real("arcsec"),
        "the output lies within this of output_angle_predicted, either way, as far as play and jumps go");
    CORRECTION_QUALITY => Variable::output("correction_quality", FmiType::Choice(&QUALITIES),
        "how far prediction and correction can be trusted");
    TICK_FLAGS => Variable::output("tick_flags", FmiType::Integer,
        "what happened in the tick, sum of: 1 no sample, 2 sample not believed, 8 held back, 16 not corrected, \
         32 table in doubt, 256 safe");
    NOT_CORRECTED => Variable::output("not_corrected", FmiType::Boolean, "no correction could be made in the tick");
    MODE_ACTIVE => Variable::output("mode_active", FmiType::Choice(&MODES), "mode of the joint");
    RATIO => Variable::constant("ratio", FmiType::Real("rad/rad"), "generator over output");
    TABLE_ID => Variable::constant("table_id", FmiType::Text, "id of the table");
    TORQUE_SETTLE => Variable::real("torque_settle", "s", 0.25, NOT_NEGATIVE,
        "after a torque in the mesh has changed the flank it does not change it again for so long");
}

/// The outputs before the first tick where they are not zero: the command without a correction.
pub fn initial(values: &mut [f64]) {
    values[GENERATOR_ANGLE_COMMAND] = values[OUTPUT_ANGLE_COMMAND] * values[RATIO];
    values[GENERATOR_RATE_COMMAND] = values[OUTPUT_RATE_COMMAND] * values[RATIO];
    values[OUTPUT_ANGLE_PREDICTED] = values[OUTPUT_ANGLE_COMMAND];
    values[CORRECTION_QUALITY] = f64::from(Quality::Disabled as u8);
}

/// Modes in the order of [`MODES`].
const MODE_OF: [Mode; 4] = [Mode::Off, Mode::Tracking, Mode::Hold, Mode::Safe];

/// The joint in a simulation.
pub struct CompensationModel {
    joint: Joint,
    image: [Vec<u8>; 2],
    store: Store,
    state: JointState,
    path: TorquePath,
    temperature_c: f32,
    asked: u32,
    command: GeneratorAngle,
    target: OutputAngle,
    direction: Direction,
}

impl CompensationModel {
    /// With the values of its parameters and its first inputs.
    ///
    /// # Errors
    /// Which of them cannot be.
    pub fn new(resources: &Resources, values: &[f64]) -> Result<Self, FmuError> {
        let table = Table::check(&resources.image)?;
        let limits = Limits {
            tick_s: values[TICK] as f32,
            rate_rad_s: values[CORRECTION_RATE_LIMIT] as f32,
            acceleration_rad_s2: values[CORRECTION_ACCELERATION_LIMIT] as f32,
            generator_rate_rad_s: values[GENERATOR_RATE_LIMIT] as f32,
            debounce_ticks: values[PATIENCE] as u16,
            deadband_rad: values[ANGLE_HOLD] as f32,
        };
        let joint = Joint::new(*table.drive(), limits, Overrun::SkipAndCount)?;
        let path = TorquePath::new(TorqueSettings {
            tick_s: values[TICK] as f32,
            bandwidth_hz: values[TORQUE_BANDWIDTH] as f32,
            drag_n_m: values[DRAG] as f32,
            table_drag_n_m: values[TABLE_DRAG] as f32,
            hold_n_m: values[TORQUE_HOLD] as f32,
            settle_s: values[TORQUE_SETTLE] as f32,
            largest_n_m: LARGEST_READING_N_M,
        })?;
        let image = [resources.image.clone(), resources.image.clone()];
        let mut store = Store::new();
        let temperature_c = values[DRIVE_TEMPERATURE] as f32;
        let activated = store.activate(&Images::new(&image[0], &image[1]), joint.drive(), temperature_c);
        activated.map_err(|error| FmuError::Activate { temperature_c, error })?;
        let target = angle(values[OUTPUT_ANGLE_COMMAND], "output_angle_command", OutputAngle::from_rad)?;
        let command = joint.drive().nominal_generator(target);
        Ok(Self {
            joint,
            image,
            store,
            state: JointState::new(),
            path,
            temperature_c,
            asked: 0,
            command,
            target,
            direction: Direction::Forward,
        })
    }

    /// The copies follow a temperature at once: a simulation need not spread the work over a slow rate group.
    fn follow(&mut self, temperature_c: f32) {
        if temperature_c.to_bits() == self.temperature_c.to_bits() {
            return;
        }
        let [image, twin] = &self.image;
        let images = Images::new(image, twin);
        if self.store.set_temperature(&images, temperature_c) {
            self.store.check_images(&images, self.store.used_words());
            self.temperature_c = temperature_c;
        }
    }

    fn torque_n_m(&mut self, is: f64, torque_n_m: f32) -> f32 {
        match is as u8 {
            0 => torque_n_m,
            1 => self.path.tick(TorqueReading::InMesh(torque_n_m), self.direction),
            _ => self.path.tick(TorqueReading::OnLoad(torque_n_m), self.direction),
        }
    }
}

fn angle<T>(rad: f64, name: &'static str, of: impl Fn(f64) -> Option<T>) -> Result<T, FmuError> {
    of(rad).ok_or(FmuError::Value { name, found: rad, allowed: "a finite angle of less than 2e9 turns" })
}

impl Model for CompensationModel {
    fn tick_s(&self, values: &[f64]) -> f64 {
        values[TICK]
    }

    fn tick(&mut self, at: &Inputs<'_>, outputs: &mut [f64], says: &mut dyn FnMut(String)) -> Result<(), FmuError> {
        let rate_rad_s = at.start(OUTPUT_RATE_COMMAND);
        let target = angle(at.start(OUTPUT_ANGLE_COMMAND), "output_angle_command", OutputAngle::from_rad)?;
        let asked = at.start(MODE) as u32;
        if asked != self.asked {
            self.asked = asked;
            if let Err(error) = self.state.request(MODE_OF[asked.min(3) as usize]) {
                says(format!("mode: {error}"));
            }
        }
        self.follow(at.start(DRIVE_TEMPERATURE) as f32);
        let moved = if rate_rad_s == 0.0 { target.minus_counts(self.target) as f64 } else { rate_rad_s };
        if moved != 0.0 {
            self.direction = if moved > 0.0 { Direction::Forward } else { Direction::Backward };
        }
        self.target = target;
        let torque_n_m = self.torque_n_m(at.start(TORQUE_IS), at.start(OUTPUT_TORQUE) as f32);
        let measured = at.start(GENERATOR_MEASURED) != 0.0;
        let generator =
            if measured { GeneratorAngle::from_rad(at.start(GENERATOR_ANGLE_MEASURED)) } else { Some(self.command) };
        let input = Input { generator, target, torque_n_m, missed_ticks: 0, adjustment: Adjustment::default() };
        let ahead_s = at.start(RATE_AHEAD) as f32;
        let rate = self.joint.rate_ahead(&self.store, target, rate_rad_s as f32, torque_n_m, ahead_s);
        let [image, twin] = &self.image;
        let out = self.joint.tick(&Images::new(image, twin), &mut self.store, &mut self.state, &input);
        self.command = out.command;

        let arcsec = |rad: f32| f64::from(rad) * ARCSEC_PER_RAD;
        let nominal = rate_rad_s * at.start(RATIO);
        outputs[GENERATOR_ANGLE_COMMAND] = out.command.to_rad();
        outputs[GENERATOR_RATE_COMMAND] = if rate_rad_s == 0.0 || rate.is_nan() { nominal } else { f64::from(rate) };
        outputs[OUTPUT_ANGLE_CORRECTION] = arcsec(out.correction_rad);
        outputs[CORRECTION_HELD_BACK] = arcsec(out.held_back_rad);
        outputs[OUTPUT_ANGLE_PREDICTED] = out.output.to_rad();
        outputs[TRANSMISSION_ERROR_PREDICTED] = arcsec(out.transmission_error_rad);
        outputs[PREDICTION_UNCERTAINTY] = arcsec(out.uncertainty_rad);
        outputs[CORRECTION_QUALITY] = f64::from(out.quality as u8);
        outputs[TICK_FLAGS] = f64::from(out.flags.bits());
        outputs[NOT_CORRECTED] = f64::from(u8::from(out.flags.contains(Flags::NOT_CORRECTED)));
        outputs[MODE_ACTIVE] = f64::from(self.state.mode() as u8);
        Ok(())
    }
}
