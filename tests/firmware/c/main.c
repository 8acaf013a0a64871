// The core from C: the table of the cam generator in flash, 2000 ticks with a reversal, and what must be refused.
//
//   tests/run firmware

#include "cam.h"
#include "flexspline.h"

static FlexsplineStore store;
static FlexsplineJoint joint;
static FlexsplineState state;

static const FlexsplineSettings settings = {
    .flexspline_teeth = 188,
    .circular_spline_teeth = 190,
    .fixed_member = 0,
    .overrun = 2,
    .fade_ticks = 50,
    .patience = 5,
    .tick_s = 1e-3f,
    .rate_rad_s = 0.05f,
    .acceleration_rad_s2 = 5.0f,
    .generator_rate_rad_s = 600.0f,
};

// 0 if all is as it should be, else the number of what is not.
int run(void)
{
    const FlexsplineImages table = {
        .first = flexspline_cam_table,
        .first_bytes = sizeof flexspline_cam_table,
        .second = flexspline_cam_table,
        .second_bytes = sizeof flexspline_cam_table,
    };
    if (flexspline_state_request(&state, 1) != FLEXSPLINE_STATUS_NOT_INITIALISED)
        return 1;
    if (flexspline_store_init(&store) || flexspline_joint_init(&joint, &settings) || flexspline_state_init(&state))
        return 2;
    FlexsplineImages cut = table;
    cut.first_bytes = cut.second_bytes = 600;
    if (flexspline_store_activate(&store, &joint, &cut, 20.0f) != FLEXSPLINE_STATUS_IMAGE)
        return 3;
    if (flexspline_store_activate(&store, &joint, &table, 20.0f) || flexspline_state_request(&state, 1))
        return 4;

    FlexsplineOutput out = {0};
    int64_t generator = 0, target = 0;
    int held_back = 0;
    for (int tick = 0; tick < 2000; tick++) {
        target += tick < 1000 ? 7000 : -7000;
        const FlexsplineInput input = {
            .generator_counts = generator,
            .target_counts = target,
            .torque_n_m = 12.0f,
            .missed_ticks = 0,
            .has_generator = 1,
        };
        if (flexspline_tick(&joint, &table, &store, &state, &input, &out))
            return 5;
        generator = out.command_counts;
        held_back += out.held_back_rad != 0.0f;
        if (tick % 100 == 50 &&
            (flexspline_store_set_temperature(&store, &table, 21.0f) || flexspline_store_check_images(&store, &table, 16)))
            return 6;
    }
    // In range, correcting, the limiter busy after start and reversal and not for ever.
    if (out.quality != 0 || out.flags != 0 || out.correction_rad == 0.0f)
        return 7;
    if (held_back == 0 || held_back > 1000)
        return 8;
    if (flexspline_tick(&joint, &table, &store, &state, 0, &out) != FLEXSPLINE_STATUS_POINTER)
        return 9;
    return 0;
}
