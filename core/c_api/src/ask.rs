//! Questions to a table outside a tick.

use super::*;

/// Expected motion of the output.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplinePrediction {
    /// Output angle, counts of 2^-32 turn: nominal plus transmission error.
    pub output_counts: i64,
    /// Nominal output angle: generator over ratio.
    pub nominal_counts: i64,
    /// Actual less nominal, rad; 0 if disabled.
    pub transmission_error_rad: f32,
    /// The error lies within +- this as far as play and jumps go, rad.
    pub uncertainty_rad: f32,
    /// `FLEXSPLINE_QUALITY_...`.
    pub quality: u8,
}

/// Command for a wanted output angle.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineCommand {
    /// Generator angle to go to, counts of 2^-32 turn.
    pub generator_counts: i64,
    /// The transmission error expected there, rad; 0 if disabled.
    pub predicted_error_rad: f32,
    /// It lies within +- this, rad.
    pub uncertainty_rad: f32,
    /// `FLEXSPLINE_QUALITY_...`.
    pub quality: u8,
}

/// Where the generator is by a reading of the output.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineLocated {
    /// Generator angle, counts of 2^-32 turn: the middle of what is possible; output times ratio if disabled.
    pub generator_counts: i64,
    /// It lies within +- this, rad of the generator; infinite if disabled. The sum of the three below.
    pub half_width_rad: f32,
    /// What the reading makes of it.
    pub of_reading_rad: f32,
    /// What the play makes of it.
    pub of_play_rad: f32,
    /// The rest: the load, and the table's inverse.
    pub of_load_rad: f32,
    /// Whole turns of the generator that remain possible: 1 if it is located, 0 if disabled.
    pub turns: u32,
    /// `FLEXSPLINE_QUALITY_...`: located where it is in range. Uncertain: more than half a turn to either side remains
    /// possible, and the largest of the three parts says why.
    pub quality: u8,
}

/// The torque by the wind-up.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineTorqueFromWindUp {
    /// Middle of the interval within the table's range, N m; NaN if disabled.
    pub torque_n_m: f32,
    /// The torque is no less, N m; -infinity where the table ends before the reading is reached.
    pub low_n_m: f32,
    /// It is no more, N m; infinity likewise.
    pub high_n_m: f32,
    /// `FLEXSPLINE_QUALITY_...`. Uncertain: the flank or the adjustment is not known. Extrapolated: the interval is
    /// open, or the temperature lies beyond the table.
    pub quality: u8,
}

/// Where a drive rests inside its play.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplinePlay {
    /// Nominal output of the last tick with a sample, counts of 2^-32 turn; 0 before the first.
    pub nominal_counts: i64,
    /// Estimated output then; 0 before the first.
    pub output_counts: i64,
    /// Offset from the middle of the play, rad: the middle of what is possible.
    pub offset_rad: f32,
    /// It is off by no more than this, rad.
    pub uncertainty_rad: f32,
    /// 1 if the side is known, else 0.
    pub is_known: u8,
    /// 0 before the first tick with a sample and a table, else 1.
    pub is_started: u8,
}

/// Contents of an image's header.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct FlexsplineImageReport {
    /// Id of the table: the first 8 bytes of the BLAKE3 of its contents, as reports show them in hexadecimal digits.
    pub table_id: [u8; 8],
    /// Torques that it holds for, N m, both ends included.
    pub torque_range_n_m: [f32; 2],
    /// Temperatures that it holds for, degrees C, both ends included.
    pub temperature_range_c: [f32; 2],
    /// No error that it gives is larger, rad.
    pub error_limit_rad: f32,
    /// Largest deviation from the samples that it was made of, rad.
    pub projection_worst_rad: f32,
    /// Root of the mean square of that, rad.
    pub projection_rms_rad: f32,
    /// Teeth of the flexspline.
    pub flexspline_teeth: u16,
    /// Teeth of the circular spline.
    pub circular_spline_teeth: u16,
    /// `FLEXSPLINE_FIXED_...`.
    pub fixed_member: u8,
    /// Kind of wave generator: 0 other, 1 two-roller, 2 four-roller, 3 double-disc, 4 cam
    /// (`flexspline_generator_name`).
    pub generator: u8,
}

/// Where the output will be at a generator angle, counts of 2^-32 turn, under a torque, N m: from where the state
/// rests, which stays as it is. A path with a reversal is that of ticks.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_forward(
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    state: *const FlexsplineState,
    generator_counts: i64,
    torque_n_m: f32,
    prediction: *mut FlexsplinePrediction,
) -> FlexsplineStatus {
    answer(prediction, [span(joint), span(store), span(state)], || {
        let mut play: PlayState = *state_of(state)?.play();
        let generator = GeneratorAngle::from_counts(generator_counts);
        let found = joint_of(joint)?.forward(store_of(store)?, &mut play, generator, torque_n_m);
        Ok(FlexsplinePrediction {
            output_counts: found.output.counts(),
            nominal_counts: found.nominal.counts(),
            transmission_error_rad: found.transmission_error_rad,
            uncertainty_rad: found.uncertainty_rad,
            quality: found.quality.code(),
        })
    })
}

/// Generator angle that brings the output to a target, counts of 2^-32 turn, under a torque, N m: in steady motion
/// forward (+1) or backward (-1), or from where the state rests (0). No limiter and no mode: that is the tick's part.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_inverse(
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    state: *const FlexsplineState,
    target_counts: i64,
    torque_n_m: f32,
    direction: i8,
    command: *mut FlexsplineCommand,
) -> FlexsplineStatus {
    answer(command, [span(joint), span(store), span(state)], || {
        let (joint, store, state) = (joint_of(joint)?, store_of(store)?, state_of(state)?);
        let approach = match direction {
            0 => Approach::From(state.play()),
            sign => Approach::Moving(direction_of(sign)?),
        };
        let found = joint.inverse(store, OutputAngle::from_counts(target_counts), torque_n_m, approach);
        Ok(FlexsplineCommand {
            generator_counts: found.generator.counts(),
            predicted_error_rad: found.predicted_error_rad,
            uncertainty_rad: found.uncertainty_rad,
            quality: found.quality.code(),
        })
    })
}

/// Where the generator is by an absolute reading of the output, counts of 2^-32 turn, under a torque, N m, both to
/// within +- their half-widths; that of the reading with what the table missed (`projection_worst_rad`). For start-up:
/// `flexspline_encoder_start` begins with the answer. The turn of the output is the one that is given.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_joint_locate(
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    output_counts: i64,
    output_half_width_rad: f32,
    torque_n_m: f32,
    torque_half_width_n_m: f32,
    located: *mut FlexsplineLocated,
) -> FlexsplineStatus {
    answer(located, [span(joint), span(store)], || {
        let (store, output) = (store_of(store)?, OutputAngle::from_counts(output_counts));
        let found = joint_of(joint)?.locate(store, output, output_half_width_rad, torque_n_m, torque_half_width_n_m);
        Ok(FlexsplineLocated {
            generator_counts: found.generator.counts(),
            half_width_rad: found.half_width_rad,
            of_reading_rad: found.of_reading_rad,
            of_play_rad: found.of_play_rad,
            of_load_rad: found.of_load_rad,
            turns: found.turns,
            quality: found.quality.code(),
        })
    })
}

/// The torque by the wind-up, of a generator angle and a reading of the output, counts of 2^-32 turn: that which brings
/// the output there while it moves forward (+1) or backward (-1), or on the flank that the state knows (0). The state
/// knows it where its ticks were given the torque; one that was never ticked knows none, as it is right for an output
/// that stands: the interval then goes from the torque of one flank to that of the other. The half-width of the
/// reading, rad, is that of `flexspline_joint_locate`; the adjustment is that of the tick, or null. It takes ten to
/// twenty times as long as a tick.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_joint_torque(
    joint: *const FlexsplineJoint,
    store: *const FlexsplineStore,
    state: *const FlexsplineState,
    adjustment: *const FlexsplineAdjustment,
    direction: i8,
    generator_counts: i64,
    output_counts: i64,
    output_half_width_rad: f32,
    torque: *mut FlexsplineTorqueFromWindUp,
) -> FlexsplineStatus {
    answer(torque, [span(joint), span(store), span(state), span(adjustment)], || {
        let (joint, store, state) = (joint_of(joint)?, store_of(store)?, state_of(state)?);
        let none = Adjustment::default();
        let adjustment = if adjustment.is_null() { &none } else { get(adjustment, Object::Adjustment)? };
        let play = match direction {
            0 => *state.play(),
            sign => PlayState::after_motion(direction_of(sign)?),
        };
        let (generator, output) =
            (GeneratorAngle::from_counts(generator_counts), OutputAngle::from_counts(output_counts));
        let found = joint.torque(store, &play, adjustment, generator, output, output_half_width_rad);
        Ok(FlexsplineTorqueFromWindUp {
            torque_n_m: found.torque_n_m,
            low_n_m: found.low_n_m,
            high_n_m: found.high_n_m,
            quality: found.quality.code(),
        })
    })
}

/// Nominal output angle of a generator angle, counts of 2^-32 turn: generator over ratio.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_nominal_output(
    joint: *const FlexsplineJoint,
    generator_counts: i64,
    output_counts: *mut i64,
) -> FlexsplineStatus {
    let generator = GeneratorAngle::from_counts(generator_counts);
    answer(output_counts, [span(joint)], || Ok(joint_of(joint)?.drive().nominal_output(generator).counts()))
}

/// Generator angle whose nominal output is an output angle, counts of 2^-32 turn: output times ratio.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_nominal_generator(
    joint: *const FlexsplineJoint,
    output_counts: i64,
    generator_counts: *mut i64,
) -> FlexsplineStatus {
    let output = OutputAngle::from_counts(output_counts);
    answer(generator_counts, [span(joint)], || Ok(joint_of(joint)?.drive().nominal_generator(output).counts()))
}

/// Ratio of a joint's drive, signed: generator turns in a turn of the output.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_ratio(joint: *const FlexsplineJoint, ratio: *mut f32) -> FlexsplineStatus {
    answer(ratio, [span(joint)], || Ok(joint_of(joint)?.drive().ratio()))
}

/// Reports the position of a drive inside its play, as the last tick left it.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_state_play(state: *const FlexsplineState, play: *mut FlexsplinePlay) -> FlexsplineStatus {
    answer(play, [span(state)], || {
        let found = state_of(state)?.play();
        Ok(FlexsplinePlay {
            nominal_counts: found.nominal().map_or(0, OutputAngle::counts),
            output_counts: found.output().map_or(0, OutputAngle::counts),
            offset_rad: found.offset_rad(),
            uncertainty_rad: found.uncertainty_rad(),
            is_known: found.is_known() as u8,
            is_started: found.nominal().is_some() as u8,
        })
    })
}

/// Checks one image in full, without a store, and reports its header. The work grows with the image: for
/// start-up, or the host.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_image_report(
    image: *const u8,
    image_bytes: usize,
    report: *mut FlexsplineImageReport,
) -> FlexsplineStatus {
    answer(report, [(image as usize, image_bytes)], || {
        let table = Table::check(bytes(image, image_bytes)?).map_err(image_status)?;
        let drive = table.drive();
        Ok(FlexsplineImageReport {
            table_id: table.id().0,
            torque_range_n_m: table.torque_range_n_m(),
            temperature_range_c: table.temperature_range_c(),
            error_limit_rad: table.error_limit_rad(),
            projection_worst_rad: table.projection_worst_rad(),
            projection_rms_rad: table.projection_rms_rad(),
            flexspline_teeth: drive.flexspline_teeth(),
            circular_spline_teeth: drive.circular_spline_teeth(),
            fixed_member: match drive.fixed() {
                FixedMember::Flexspline => FLEXSPLINE_FIXED_FLEXSPLINE,
                FixedMember::CircularSpline => FLEXSPLINE_FIXED_CIRCULAR_SPLINE,
            },
            generator: table.generator_kind().code(),
        })
    })
}

/// How far units scatter about a table that a data sheet completed, as a share s of their stiffness: 0.3 of `+-30 %`; 0
/// of any other table. What the table says of wind-up may be off by s / (1 - s) of it, which no tick states. Checks the
/// image in full, as [`flexspline_image_report`] does.
#[unsafe(no_mangle)]
pub extern "C" fn flexspline_image_sheet_scatter(
    image: *const u8,
    image_bytes: usize,
    scatter: *mut f32,
) -> FlexsplineStatus {
    answer(scatter, [(image as usize, image_bytes)], || {
        let table = Table::check(bytes(image, image_bytes)?).map_err(image_status)?;
        Ok(table.sheet_scatter().unwrap_or(0.0))
    })
}
