// SPDX-License-Identifier: MIT OR Apache-2.0
/// @file What goes on beside a tick, from C: a sum over every bit of it, the same on a PC and on the target.

#include "beside.h"

static FlexsplineStore store;
static FlexsplineJoint joint;
static FlexsplineState state;
static FlexsplineLearner learner;
static FlexsplineSlip slip, torque_slip;
static FlexsplineTorquePath path;
static FlexsplineAged aged;
static FlexsplineEncoder encoder;
static FlexsplinePredictor predictor;
static FlexsplineObserver observer;
static FlexsplineRecorder recorder;
static FlexsplineRecord records[8];

// 188 and 190 teeth, a thousand ticks a second.
static const FlexsplineSettings settings = {
    .flexspline_teeth = 188,
    .circular_spline_teeth = 190,
    .fixed_member = FLEXSPLINE_FIXED_FLEXSPLINE,
    .overrun = FLEXSPLINE_OVERRUN_FADE,
    .fade_ticks = 50,
    .patience = 5,
    .tick_s = 1e-3f,
    .rate_rad_s = 0.05f,
    .acceleration_rad_s2 = 5.0f,
    .generator_rate_rad_s = 600.0f,
    .hold_rad = 1e-6f,
};

static const FlexsplineCoefficient coefficients[] = {
    {.term = FLEXSPLINE_TERM_MEAN, .order = 0, .limit = 2e-4f, .initial_std = 1e-4f},
    {.term = FLEXSPLINE_TERM_HALF_WIDTH, .order = 0, .limit = 5e-5f, .initial_std = 2e-5f},
    {.term = FLEXSPLINE_TERM_COSINE, .order = 2, .limit = 1e-4f, .initial_std = 5e-5f},
    {.term = FLEXSPLINE_TERM_SINE, .order = 2, .limit = 1e-4f, .initial_std = 5e-5f},
};

static const FlexsplineLearnSettings learn = {
    .noise_rad = 2e-6f,
    .memory_measurements = 300.0f,
    .gate = 5.0f,
    .settle_rad = 1e-5f,
    .torque_limit_n_m = 20.0f,
};

static const FlexsplineSpring springs[] = {{1e-4f, 0.05f}, {3e-4f, 0.03f}};
static const FlexsplineSpring torque_springs[] = {{0.5f, 4e-6f}, {2.0f, 1.5e-6f}, {4.0f, -1e-6f}};

static const FlexsplineTorqueSettings torque_settings = {
    .tick_s = 1e-3f,
    .bandwidth_hz = 20.0f,
    .drag_n_m = 0.4f,
    .table_drag_n_m = 0.05f,
    .hold_n_m = 0.1f,
};

static const FlexsplineEncoderSettings encoder_settings = {
    .zero_counts = 1234,
    .counts_per_turn = 20000,
    .wrap_bits = 16,
    .reversed = 1,
};

static const FlexsplineInertias inertias = {
    .motor_kg_m2 = 1.0,
    .load_kg_m2 = 3.0,
    .stiffness_n_m_per_rad = 3e4,
    .damping_n_m_s_per_rad = 20.0,
};
static const FlexsplineNoise noise = {
    .torque_n_m = 0.5,
    .load_change_n_m = 0.2,
    .speed_rad_s = 1e-4,
    .twist_rad = 1e-6,
    .has_twist = 1,
};

// FNV-1a over the bytes of a number from the lowest up: of no structure as it lies, whose gaps hold anything.
static uint32_t sum;

static void take(uint64_t number)
{
    for (int byte = 0; byte < 8; byte++)
        sum = (sum ^ (uint8_t)(number >> (8 * byte))) * 16777619u;
}

static void take_float(float number)
{
    union {
        float number;
        uint32_t bits;
    } as = {number};
    // One NaN is as good as another.
    take(number == number ? as.bits : 0x7fc00000u);
}

// The calls below that are not made in the loop are linked all the same: none has a panic path.
typedef void (*AnyCall)(void);
static AnyCall const volatile others[] = {
    (AnyCall)flexspline_version,          (AnyCall)flexspline_format_version,    (AnyCall)flexspline_status_text,
    (AnyCall)flexspline_mode_name,        (AnyCall)flexspline_quality_name,      (AnyCall)flexspline_health_name,
    (AnyCall)flexspline_flag_name,        (AnyCall)flexspline_event_name,        (AnyCall)flexspline_overrun_name,
    (AnyCall)flexspline_fixed_member_name, (AnyCall)flexspline_generator_name,   (AnyCall)flexspline_progress_name,
    (AnyCall)flexspline_identity_name,    (AnyCall)flexspline_learning_name,     (AnyCall)flexspline_verdict_name,
    (AnyCall)flexspline_term_name,        (AnyCall)flexspline_mode_may_become,   (AnyCall)flexspline_is_due,
    (AnyCall)flexspline_counts_from_rad,  (AnyCall)flexspline_rad_from_counts,   (AnyCall)flexspline_predictor_init,
    (AnyCall)flexspline_predictor_parts,  (AnyCall)flexspline_predictor_state_bound, (AnyCall)flexspline_learner_reset,
    (AnyCall)flexspline_slip_set,         (AnyCall)flexspline_state_forget_side, (AnyCall)flexspline_store_mend_page,
    (AnyCall)flexspline_nominal_generator, (AnyCall)flexspline_ratio,            (AnyCall)flexspline_encoder_reading,
    (AnyCall)flexspline_torque_set_sensor, (AnyCall)flexspline_implausible_name,
    (AnyCall)flexspline_learner_bind,     (AnyCall)flexspline_encoder_read,
};

// What a table says outside the tick.
static int ask(int64_t generator, int64_t target, float torque)
{
    FlexsplinePrediction prediction;
    FlexsplinePlay play;
    FlexsplineMotionAhead motion;
    float rate;
    if (flexspline_forward(&joint, &store, &state, generator, torque, &prediction) ||
        flexspline_rate_ahead(&joint, &store, target, 0.01f, torque, 4e-3f, &rate) || flexspline_state_play(&state, &play) ||
        flexspline_motion_ahead(&joint, &store, target, 0.01f, 0.1f, torque, 4e-3f, &motion))
        return 1;
    take((uint64_t)prediction.output_counts);
    take_float(prediction.transmission_error_rad);
    take_float(rate);
    take_float(motion.rate_rad_s);
    take_float(motion.acceleration_rad_s2);
    take((uint64_t)play.output_counts);
    for (int8_t direction = -1; direction <= 1; direction++) {
        FlexsplineCommand command;
        if (flexspline_inverse(&joint, &store, &state, target, torque, direction, &command))
            return 2;
        take((uint64_t)command.generator_counts);
        take_float(command.uncertainty_rad);
        FlexsplineTorqueFromWindUp by_wind_up;
        if (flexspline_joint_torque(&joint, &store, &state, 0, direction, generator, target, 1e-5f, &by_wind_up))
            return 4;
        take_float(by_wind_up.low_n_m);
        take_float(by_wind_up.high_n_m);
        take(by_wind_up.quality);
    }
    FlexsplineLocated located;
    if (flexspline_joint_locate(&joint, &store, target, 1e-5f, torque, 2.0f, &located))
        return 5;
    take((uint64_t)located.generator_counts);
    take_float(located.half_width_rad);
    take(located.turns);
    const FlexsplineNow now = {
        .generator_counts = generator,
        .torque_n_m = torque,
        .torque_off_n_m = 0.5f,
        .load_change_n_m = 0.05f,
        .state_bound = {2e-6f, 1e-4f, 1e-3f, 0.5f},
        .ticks = 10,
        .has_measured = 0,
    };
    FlexsplineAhead ahead;
    if (flexspline_predict(&predictor, &observer, &joint, &store, &state, &now, &ahead))
        return 3;
    take((uint64_t)ahead.output_counts);
    take_float(ahead.bound_rad);
    return 0;
}

// What was learnt goes through bytes and comes back; only with settings that are the same.
static int save(void)
{
    static uint8_t saved[FLEXSPLINE_SAVED_LEARNER_BYTES];
    size_t written = 0;
    if (flexspline_learner_save(&learner, saved, sizeof saved, &written) ||
        flexspline_learner_restore(&learner, saved, written) || flexspline_learner_set(&learner, FLEXSPLINE_LEARNING_ON))
        return 4;
    for (size_t i = 0; i < written; i++)
        take(saved[i]);
    if (flexspline_slip_save_for(&slip, &joint, &store, saved, sizeof saved, &written) ||
        flexspline_slip_restore(&slip, saved, written) != FLEXSPLINE_STATUS_SAVED ||
        flexspline_slip_restore_for(&slip, &joint, &store, saved, written))
        return 5;
    if (flexspline_slip_save(&slip, saved, sizeof saved, &written) || flexspline_slip_restore(&slip, saved, written))
        return 5;
    for (size_t i = 0; i < written; i++)
        take(saved[i]);
    return flexspline_slip_restore(&torque_slip, saved, written) == FLEXSPLINE_STATUS_SAVED ? 0 : 6;
}

// The motor goes where it is commanded, and its encoder counts the wrong way.
static int start_up(void)
{
    static FlexsplineStartUp test;
    const FlexsplineStartUpSettings way = {.way_rad = 20.0f, .output_error_rad = 1e-3f, .drag_n_m = 1.0f, .ticks = 40};
    for (int wrong = 0; wrong < 2; wrong++) {
        FlexsplineStartUpStep step = {0, 0, 0};
        if (flexspline_start_up_init(&test, &joint, 0, &way))
            return 9;
        while (!step.is_done) {
            const FlexsplineReadings readings = {
                .generator_counts = wrong ? -step.command_counts : step.command_counts,
                .has_generator = 1,
            };
            if (flexspline_start_up_step(&test, &readings, &step))
                return 9;
        }
        if (step.implausible != (wrong ? FLEXSPLINE_IMPLAUSIBLE_GENERATOR_SIGN : 0))
            return 9;
    }
    return 0;
}

// A record out of the list, as bytes and back.
static int send(unsigned *sent)
{
    FlexsplineRecord record, back;
    static uint8_t bytes[FLEXSPLINE_RECORD_BYTES];
    uint8_t is_taken;
    if (flexspline_recorder_take(&recorder, records, &record, &is_taken))
        return 7;
    if (!is_taken)
        return 0;
    if (flexspline_record_encode(&record, &bytes) || flexspline_record_decode(bytes, &back) || back.tick != record.tick)
        return 8;
    ++*sent;
    for (size_t i = 0; i < sizeof bytes; i++)
        take(bytes[i]);
    return 0;
}

int beside(const FlexsplineImages *table, int ticks, uint32_t *found)
{
    sum = 2166136261u;
    if (flexspline_layout() != FLEXSPLINE_LAYOUT || flexspline_version_number() != FLEXSPLINE_VERSION_NUMBER || !others[0])
        return 20;
    FlexsplineImageReport image;
    if (flexspline_image_report(table->first, table->first_bytes, &image) || image.flexspline_teeth != 188)
        return 21;
    // No data sheet completed this table.
    float scatter = 1.0f;
    if (flexspline_image_sheet_scatter(table->first, table->first_bytes, &scatter) || scatter != 0.0f)
        return 21;
    if (flexspline_store_init(&store) || flexspline_joint_init(&joint, &settings) || flexspline_state_init(&state) ||
        flexspline_store_activate(&store, &joint, table, 20.0f) || flexspline_state_request(&state, FLEXSPLINE_MODE_TRACKING))
        return 22;
    if (flexspline_learner_init(&learner, &learn, coefficients, 4) || flexspline_learner_set(&learner, FLEXSPLINE_LEARNING_ON) ||
        flexspline_slip_init(&slip, FLEXSPLINE_SLIP_OF_OUTPUT, springs, 2) ||
        flexspline_slip_init(&torque_slip, FLEXSPLINE_SLIP_OF_TORQUE, torque_springs, 3) ||
        flexspline_torque_init(&path, &torque_settings) || flexspline_torque_init_sensor(&path, &torque_settings, 0.05f, 50.0f) || flexspline_aged_init(&aged, 4) ||
        flexspline_encoder_init(&encoder, &encoder_settings) || flexspline_encoder_start(&encoder, 1234, 0) ||
        flexspline_predictor_of(&predictor, &inertias, &noise, 1e-3) || flexspline_observer_init(&observer) ||
        flexspline_recorder_init(&recorder, 8, 10, 3, FLEXSPLINE_FULL_LOSE_OLDEST))
        return 23;
    int32_t mean = 0, half = 0;
    uint64_t reading = 1234;
    unsigned used = 0, sent = 0;
    for (int tick = 0; tick < ticks; tick++) {
        const int forward = tick % 1000 < 500;
        const int8_t direction = forward ? 1 : -1;
        reading = (reading + (forward ? 65536u - 37u : 41u)) & 0xffff;
        // One rounding: nothing that a compiler may contract.
        const float load = 0.02f * (float)(400 - tick % 800);
        int64_t generator, nominal;
        float fresh, torque;
        uint8_t stale;
        if (flexspline_joint_read(&joint, &state, &encoder, reading, &generator) ||
            flexspline_aged_tick(&aged, tick % 50 < 43, load, &fresh) || flexspline_aged_is_stale(&aged, &stale) ||
            flexspline_torque_tick(&path, FLEXSPLINE_TORQUE_ON_LOAD, fresh, direction, &torque) ||
            flexspline_nominal_output(&joint, generator, &nominal))
            return 24;
        FlexsplineInput input = {
            .generator_counts = generator,
            .target_counts = nominal,
            .torque_n_m = torque,
            .missed_ticks = 0,
            .has_generator = 1,
            .mean_counts = mean,
            .half_width_counts = half,
        };
        FlexsplineOutput out;
        if (flexspline_tick(&joint, table, &store, &state, &input, &out))
            return 25;
        FlexsplineAdapted adapted;
        // What the table misses: an offset, and play that is wider.
        const int64_t measured = out.output_counts + 60000 + (forward ? -9000 : 9000) - tick % 11 * 500 - mean;
        if (flexspline_learner_update(&learner, &state, &input, &out, tick % 3 == 0, measured, &adapted))
            return 26;
        used += adapted.verdict == FLEXSPLINE_VERDICT_USED;
        FlexsplineSlipReport one, other;
        if (flexspline_slip_update(&slip, nominal, &one) || flexspline_slip_update_torque(&torque_slip, torque, &other))
            return 27;
        input.mean_counts = adapted.mean_counts;
        input.half_width_counts = adapted.half_width_counts;
        if (flexspline_input_add(&input, one.mean_counts, 0) || flexspline_input_add_rad(&input, other.error_rad, 0.0f))
            return 28;
        mean = input.mean_counts;
        half = input.half_width_counts;
        const FlexsplineMeasured measured_now = {load, 0.02f * (float)direction, load * 3e-5f};
        FlexsplineObserverReport estimate;
        if (flexspline_observer_step(&observer, &predictor, &measured_now) || flexspline_observer_report(&observer, &estimate) ||
            flexspline_recorder_see(&recorder, records, (uint32_t)tick, tick % 331 == 0, &state, &store, &out))
            return 29;
        take((uint64_t)generator);
        take((uint64_t)out.command_counts);
        take((uint64_t)(int64_t)mean);
        take((uint64_t)(int64_t)half);
        take_float(torque);
        take_float(out.correction_rad);
        take_float(adapted.uncertainty_rad);
        take_float(one.uncertainty_rad);
        take_float(estimate.load_torque_n_m);
        take(stale);
        int failed = tick % 12 == 0 ? send(&sent) : 0;
        if (!failed && tick % 100 == 60)
            failed = ask(generator, nominal, torque);
        if (!failed && tick == ticks / 2)
            failed = save();
        if (!failed && tick == ticks / 3)
            failed = start_up();
        if (failed)
            return failed;
    }
    FlexsplineLearnerReport report;
    FlexsplineLearnt learnt;
    if (flexspline_learner_report(&learner, &report) || flexspline_learner_coefficient(&learner, 1, &learnt))
        return 30;
    take(report.used);
    take_float(learnt.value);
    take_float(flexspline_rad_between(0, mean));
    *found = sum;
    // What is summed is something.
    return used > (unsigned)ticks / 20 && sent > (unsigned)ticks / 20 ? 0 : 31;
}
