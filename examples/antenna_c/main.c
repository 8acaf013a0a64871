// SPDX-License-Identifier: MIT OR Apache-2.0
/// @file One joint of an antenna in C: the program of ../antenna_rust, call by call, and the same lines.

#include "cam.h"
#include "flexspline.h"

static FlexsplineStore store;
static FlexsplineJoint joint;
static FlexsplineState state;

// HHD-95, a thousand ticks a second.
static const FlexsplineSettings settings = {
    .flexspline_teeth = 188,
    .circular_spline_teeth = 190,
    .fixed_member = 0,
    .overrun = 2, // fade out
    .fade_ticks = 50,
    .patience = 5,
    .tick_s = 1e-3f,
    .rate_rad_s = 0.05f,
    .acceleration_rad_s2 = 5.0f,
    .generator_rate_rad_s = 600.0f,
    .hold_rad = 0.0f,
};

// The second image: in flight at another place of the flash, here copied into memory.
static uint8_t second[sizeof flexspline_cam_table];

static const FlexsplineImages table = {
    .first = flexspline_cam_table,
    .first_bytes = sizeof flexspline_cam_table,
    .second = second,
    .second_bytes = sizeof second,
};

enum { TICKS = 4000, SLEW_COUNTS = 6836 }; // 0.01 rad/s in counts of 2^-32 output turn

static void print(const char *text)
{
    register uint32_t operation __asm__("r0") = 0x04; // SYS_WRITE0
    register const char *argument __asm__("r1") = text;
    __asm__ volatile("bkpt 0xab" : "+r"(operation) : "r"(argument) : "memory");
}

static void print_number(int32_t number, const char *after)
{
    char digits[12], *at = digits + sizeof digits;
    uint32_t left = number < 0 ? 0u - (uint32_t)number : (uint32_t)number;
    *--at = 0;
    do
        *--at = (char)('0' + left % 10);
    while (left /= 10);
    if (number < 0)
        *--at = '-';
    print(at);
    print(after);
}

static int32_t mas(float rad)
{
    return (int32_t)(rad * 206264806.0f);
}

// 0 if all is as it should be, else the number of what is not. Called by startup.c.
int run(void)
{
    for (size_t i = 0; i < sizeof second; i++)
        second[i] = flexspline_cam_table[i];
    if (flexspline_store_init(&store) || flexspline_joint_init(&joint, &settings) || flexspline_state_init(&state))
        return 1;
    if (flexspline_store_activate(&store, &joint, &table, 20.0f) || flexspline_state_request(&state, 1))
        return 2;
    int64_t generator = 0, target = 0;
    int limited = 0;
    print("time_ms,load_n_m,error_mas,missed_mas\n");
    for (int tick = 0; tick < TICKS; tick++) {
        const int64_t told = target;
        target += tick < TICKS / 2 ? SLEW_COUNTS : -SLEW_COUNTS;
        const int from_middle = tick < TICKS / 2 ? TICKS / 2 - tick : tick - TICKS / 2;
        const FlexsplineInput input = {
            .generator_counts = generator,
            .target_counts = target,
            .torque_n_m = (float)(from_middle - TICKS / 4) * 0.04f,
            .missed_ticks = 0,
            .has_generator = 1,
        };
        FlexsplineOutput out;
        if (flexspline_tick(&joint, &table, &store, &state, &input, &out))
            return 3;
        generator = out.command_counts;
        // In a slower rate group: the temperature, and a slice of the check of both images.
        if (tick % 100 == 50 &&
            (flexspline_store_set_temperature(&store, &table, 20.0f) || flexspline_store_check_images(&store, &table, 16)))
            return 4;
        limited += (out.flags & 8) != 0; // held back
        if (tick % 20 == 0) {
            print_number(tick, ",");
            print_number((int32_t)input.torque_n_m, ",");
            print_number(mas(out.transmission_error_rad), ",");
            // 2 pi / 2^32 rad in a count.
            print_number(mas((float)(int32_t)(out.output_counts - told) * 1.4629180e-9f), "\n");
        }
        if (out.flags & (16 | 32)) // not corrected, table in doubt
            return 5;
    }
    return limited > 0 && limited < TICKS / 4 ? 0 : 6;
}
