// SPDX-License-Identifier: MIT OR Apache-2.0
/// @file One joint on a PC: encoder counts in, commands out; a star now and then teaches what this unit has beside its table, springs that slip
/// add its hysteresis, an observer says where the output will be, and records go to the ground.

#include "cam.h"
#include "flexspline.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { TICKS_IN_SECOND = 1000, SECONDS = 12, STAR_EVERY = 20, RECORDS = 32, AHEAD = 10 };

static FlexsplineStore store;
static FlexsplineJoint joint;
static FlexsplineState state;
static FlexsplineState bench; // of the unit itself: the same table, nothing added

// HHD-95, a thousand ticks a second.
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
    .hold_rad = 0.0f,
};

// The motor's encoder: 4 x 4096 lines, a timer of 16 bits that counts down where the generator turns forward.
static const FlexsplineEncoderSettings encoder_settings = {
    .zero_counts = 500,
    .counts_per_turn = 16384,
    .wrap_bits = 16,
    .reversed = 1,
};

static const FlexsplineLearnSettings learn_settings = {
    .noise_rad = 3e-6f,
    .memory_measurements = 10000.0f,
    .gate = 5.0f,
    .settle_rad = 2e-5f,
    .torque_limit_n_m = 20.0f,
};
static const FlexsplineCoefficient coefficients[] = {
    {.term = FLEXSPLINE_TERM_MEAN, .limit = 2e-4f, .initial_std = 1e-4f},
    {.term = FLEXSPLINE_TERM_COSINE, .order = 2, .limit = 1e-4f, .initial_std = 5e-5f},
    {.term = FLEXSPLINE_TERM_SINE, .order = 2, .limit = 1e-4f, .initial_std = 5e-5f},
};

static const FlexsplineSpring springs[] = {{.width = 1.0f, .gain = 8e-6f}, {.width = 3.0f, .gain = 4e-6f}};

static const FlexsplineTorqueSettings torque_settings = {.tick_s = 1e-3f, .bandwidth_hz = 50.0f};

static const FlexsplineInertias inertias = {
    .motor_kg_m2 = 1.0,
    .load_kg_m2 = 3.0,
    .stiffness_n_m_per_rad = 3e4,
    .damping_n_m_s_per_rad = 20.0,
};
static const FlexsplineNoise noise = {.torque_n_m = 0.5, .load_change_n_m = 0.2, .speed_rad_s = 1e-4};

static void must(FlexsplineStatus status, const char *what)
{
    if (status != FLEXSPLINE_STATUS_OK) {
        fprintf(stderr, "%s: %s\n", what, flexspline_status_text((int)status));
        _Exit(1);
    }
}

static double arcsec(int64_t counts)
{
    return flexspline_rad_from_counts(counts) * 206264.806;
}

// What this unit has beside its table, counts at the output: an offset, two waves in a generator turn, and the springs of its hysteresis.
static int64_t hidden(int64_t generator, FlexsplineSlip *truth, float torque)
{
    FlexsplineSlipReport slip;
    int64_t counts;
    must(flexspline_slip_update_torque(truth, torque, &slip), "springs of the unit");
    const double psi = flexspline_rad_from_counts(generator & 0xffffffff);
    must(flexspline_counts_from_rad(6e-5 + 3e-5 * cos(2.0 * psi + 0.7), &counts), "hidden error");
    return counts + slip.mean_counts;
}

int main(void)
{
    if (flexspline_layout() != FLEXSPLINE_LAYOUT)
        return 1; // another header, or other options of the compiler
    static uint8_t second[sizeof flexspline_cam_table];
    memcpy(second, flexspline_cam_table, sizeof second);
    const FlexsplineImages table = {flexspline_cam_table, sizeof flexspline_cam_table, second, sizeof second};
    must(flexspline_store_init(&store), "store");
    must(flexspline_joint_init(&joint, &settings), "joint");
    must(flexspline_state_init(&state), "state");
    must(flexspline_state_init(&bench), "bench");
    must(flexspline_store_activate(&store, &joint, &table, 20.0f), "table");
    must(flexspline_state_request(&state, FLEXSPLINE_MODE_TRACKING), "mode");

    FlexsplineEncoder encoder;
    FlexsplineTorquePath path;
    FlexsplineLearner learner;
    FlexsplineSlip slip, truth;
    FlexsplinePredictor predictor;
    FlexsplineObserver observer;
    FlexsplineWatch watch;
    FlexsplineRecorder recorder;
    static FlexsplineRecord records[RECORDS];
    must(flexspline_encoder_init(&encoder, &encoder_settings), "encoder");
    must(flexspline_encoder_start(&encoder, 500, 0), "first reading");
    must(flexspline_torque_init(&path, &torque_settings), "torque");
    must(flexspline_learner_init(&learner, &learn_settings, coefficients, 3), "learner");
    must(flexspline_slip_init(&slip, FLEXSPLINE_SLIP_OF_TORQUE, springs, 2), "springs");
    must(flexspline_slip_init(&truth, FLEXSPLINE_SLIP_OF_TORQUE, springs, 2), "springs");
    must(flexspline_slip_set(&truth, 1), "springs");
    must(flexspline_predictor_of(&predictor, &inertias, &noise, 1e-3), "predictor");
    must(flexspline_observer_init(&observer), "observer");
    must(flexspline_watch_init(&watch), "watch");
    must(flexspline_recorder_init(&recorder, RECORDS, 250, 0, FLEXSPLINE_FULL_LOSE_OLDEST), "recorder");

    int64_t target = 0, command = 0, expected[AHEAD] = {0};
    FlexsplineAdapted adapted = {0};
    FlexsplineSlipReport slipped = {0};
    FlexsplineAdjustment adjustment; // from tick to tick, under a sum
    must(flexspline_adjustment_init(&adjustment), "adjustment");
    double missed = 0.0, ahead_missed = 0.0;
    printf("second,learning,missed_arcsec_rms,ahead_arcsec_rms,offset_arcsec,springs_known\n");
    for (int tick = 0; tick < SECONDS * TICKS_IN_SECOND; tick++) {
        const int second_now = tick / TICKS_IN_SECOND;
        if (tick == 3 * TICKS_IN_SECOND)
            must(flexspline_learner_set(&learner, FLEXSPLINE_LEARNING_ON), "learning");
        const int forward = second_now % 4 < 2;
        const float load = 6.0f + 4.0f * (float)sin(0.002 * tick);

        // The motor went where it was told to, to a count of its encoder.
        uint64_t reading;
        int64_t generator;
        float torque;
        must(flexspline_encoder_reading(&encoder, command, &reading), "reading");
        must(flexspline_joint_read(&joint, &state, &encoder, reading, &generator), "encoder");
        must(flexspline_torque_tick(&path, FLEXSPLINE_TORQUE_ON_LOAD, load, forward ? 1 : -1, &torque), "torque");

        // Where the unit is.
        const FlexsplineInput plain = {.generator_counts = generator, .target_counts = target, .torque_n_m = load, .has_generator = 1};
        FlexsplineOutput unit;
        must(flexspline_tick(&joint, &table, &store, &bench, &plain, &unit), "unit");
        const int64_t output = unit.output_counts + hidden(generator, &truth, load);
        missed += pow(arcsec(output - target), 2.0);
        ahead_missed += pow(arcsec(output - expected[tick % AHEAD]), 2.0);

        // The tick of the joint.
        target += forward ? 13672 : -13672; // 0.02 rad/s
        const FlexsplineInput input = {.generator_counts = generator, .target_counts = target, .torque_n_m = torque, .has_generator = 1};
        FlexsplineInput own = input; // what springs add is no error to be learnt
        must(flexspline_input_add(&own, adapted.mean_counts, adapted.half_width_counts), "learnt");
        FlexsplineOutput out;
        must(flexspline_tick_adjusted(&joint, &table, &store, &state, &input, &adjustment, &out), "tick");
        command = out.command_counts;

        // Beside it: what is learnt, what slips, what lies ahead, what changed.
        must(flexspline_learner_update(&learner, &state, &own, &out, tick % STAR_EVERY == 0, output, &adapted), "learner");
        must(flexspline_slip_update_torque(&slip, torque, &slipped), "springs");
        const float unknown = adapted.verdict == FLEXSPLINE_VERDICT_LOST ? adapted.uncertainty_rad : 0.0f;
        must(flexspline_adjustment_init(&adjustment), "adjustment");
        must(flexspline_adjustment_add(&adjustment, adapted.mean_counts, adapted.half_width_counts, unknown), "learnt");
        if (tick + 1 >= 3 * TICKS_IN_SECOND)
            must(flexspline_adjustment_add(&adjustment, slipped.mean_counts, 0, slipped.uncertainty_rad), "springs");
        const FlexsplineMeasured measured = {.torque_n_m = -load, .speed_rad_s = forward ? 0.02f : -0.02f};
        must(flexspline_observer_step(&observer, &predictor, &measured), "observer");
        const FlexsplineNow now = {
            .generator_counts = generator,
            .measured_counts = output,
            .has_measured = 1,
            .torque_n_m = -load,
            .ticks = AHEAD,
        };
        FlexsplineAhead ahead;
        must(flexspline_predict(&predictor, &observer, &joint, &store, &state, &now, &ahead), "ahead");
        expected[tick % AHEAD] = ahead.output_counts;
        FlexsplineEvents events;
        must(flexspline_watch_see(&watch, &state, &store, &out, &events), "watch");
        for (uint16_t bit = 1; bit; bit = (uint16_t)(bit << 1))
            if (events.events & bit)
                fprintf(stderr, "tick %d: %s\n", tick, flexspline_event_name(bit));
        must(flexspline_recorder_see(&recorder, records, (uint32_t)tick, 0, &state, &store, &out), "recorder");

        if (tick % TICKS_IN_SECOND == TICKS_IN_SECOND - 1) {
            FlexsplineLearnerReport report;
            FlexsplineLearnt offset;
            must(flexspline_learner_report(&learner, &report), "report");
            must(flexspline_learner_coefficient(&learner, 0, &offset), "coefficient");
            printf("%d,%s,%.2f,%.2f,%.2f,%d\n", second_now, flexspline_learning_name(report.learning), sqrt(missed / TICKS_IN_SECOND),
                   sqrt(ahead_missed / TICKS_IN_SECOND), offset.value * 206264.806, slipped.is_known);
            missed = ahead_missed = 0.0;
        }
    }

    // To the ground, and what the ground reads.
    int sent = 0;
    uint8_t is_taken = 1;
    FlexsplineRecord record, last = {0};
    while (must(flexspline_recorder_take(&recorder, records, &record, &is_taken), "record"), is_taken) {
        uint8_t bytes[FLEXSPLINE_RECORD_BYTES];
        must(flexspline_record_encode(&record, &bytes), "encode");
        must(flexspline_record_decode(bytes, &last), "decode");
        sent++;
    }
    fprintf(stderr, "%d records, %d lost; the last: tick %lu, %s, %s, correction %.1f arcsec\n", sent, last.lost, (unsigned long)last.tick,
           flexspline_mode_name(last.mode), flexspline_quality_name(last.quality), last.correction_rad * 206264.806);
    return 0;
}
