// SPDX-License-Identifier: MIT OR Apache-2.0
/// @file The core from C: 2000 ticks with a reversal and what they cost, with the tables of the four generators and one with curves; a table sent
/// in chunks, events, a record, and what must be refused.
///
/// tests/run firmware

#include "beside.h"
#include "cam.h"
#include "flexspline.h"

static FlexsplineStore store;
static FlexsplineJoint joint;
static FlexsplineState state;

// The second image, in memory here; in flight at another place of the flash.
static uint8_t second[sizeof flexspline_cam_table];

// Two images of a table in flash; the assembler looks for the file where headers are looked for.
#define TWICE(name, file) \
    __asm__(".section .rodata\n.balign 4\n" #name ": .incbin \"" file "\"\n" #name "_again: .incbin \"" file "\"\n.text"); \
    extern const uint8_t name[], name##_again[];
#define IMAGES(name) {name, (size_t)(name##_again - name), name##_again, (size_t)(name##_again - name)}
TWICE(double_disc, "double-disc.fxt")
TWICE(four_roller, "four-roller.fxt")
TWICE(two_roller, "two-roller.fxt")
TWICE(curves, "core/src/fixtures/long.fxt")

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
    .hold_rad = 1e-6f,
};

// Instructions: under -icount shift=10 each takes 1.024 us of virtual time, and the 25 MHz SysTick of the MPS2 counts 25.6 for it.
#define SYSTICK ((volatile uint32_t *)0xE000E010)
#define RELOAD 0x00ffffffu

static uint32_t now(void)
{
    return SYSTICK[2];
}

static uint32_t instructions(uint32_t before, uint32_t after)
{
    return (((before - after) & RELOAD) * 10 + 128) / 256;
}

static void print(const char *text)
{
    register uint32_t operation __asm__("r0") = 0x04;
    register const char *argument __asm__("r1") = text;
    __asm__ volatile("bkpt 0xab" : "+r"(operation) : "r"(argument) : "memory");
}

static void print_number(uint32_t number)
{
    char digits[11];
    char *at = digits + sizeof digits - 1;
    *at = 0;
    do
        *--at = (char)('0' + number % 10);
    while (number /= 10);
    print(at);
}

// 2000 ticks with a table that was activated, and what they cost; 0 if all is as it should be.
static int fly(const char *name, const FlexsplineImages *table)
{
    FlexsplineOutput out = {0};
    int64_t generator = 0, target = 0;
    int held_back = 0;
    FlexsplineWatch watch;
    uint16_t seen = 0;
    if (flexspline_watch_init(&watch))
        return 21;
    // The joint was made at run time: it lies in memory.
    SYSTICK[1] = RELOAD;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    uint32_t start = now();
    const uint32_t own = instructions(start, now());
    uint32_t least = RELOAD, most = 0;
    for (int tick = 0; tick < 2000; tick++) {
        target += tick < 1000 ? 7000 : -7000;
        const FlexsplineInput input = {
            .generator_counts = generator,
            .target_counts = target,
            .torque_n_m = 12.0f,
            .missed_ticks = 0,
            .has_generator = 1,
        };
        start = now();
        const FlexsplineStatus done = flexspline_tick(&joint, table, &store, &state, &input, &out);
        const uint32_t count = instructions(start, now()) - own;
        if (done)
            return 5;
        least = count < least ? count : least;
        most = count > most ? count : most;
        FlexsplineEvents events;
        if (flexspline_watch_see(&watch, &state, &store, &out, &events))
            return 22;
        seen |= events.events;
        generator = out.command_counts;
        held_back += out.held_back_rad != 0.0f;
        if (tick % 100 == 50 &&
            (flexspline_store_set_temperature(&store, table, 21.0f) || flexspline_store_check_images(&store, table, 16)))
            return 6;
    }
    print(name);
    print(": ");
    print_number(most);
    print(" instructions (min ");
    print_number(least);
    print(", max ");
    print_number(most);
    print(")\n");
    if (least != most)
        return 23;
    if (seen != (FLEXSPLINE_EVENT_MODE | FLEXSPLINE_EVENT_HEALTH))
        return 24;
    // In range, correcting, the limiter busy after start and reversal and not for ever.
    if (out.quality != 0 || out.flags != 0 || out.correction_rad == 0.0f)
        return 7;
    if (held_back == 0 || held_back > 1000)
        return 8;
    return 0;
}

// A table in chunks into a buffer, and checked: 0 if all is well.
static int receive(void)
{
    static uint8_t buffer[sizeof flexspline_cam_table];
    FlexsplineUpload upload;
    uint8_t id[8];
    if (flexspline_upload_begin(&upload, sizeof buffer))
        return 15;
    for (size_t at = 0; at < sizeof buffer; at += 100) {
        const size_t left = sizeof buffer - at, length = left < 100 ? left : 100;
        if (flexspline_upload_chunk(&upload, buffer, sizeof buffer, at + 1, flexspline_cam_table + at, length) !=
            FLEXSPLINE_STATUS_ORDER)
            return 16;
        if (flexspline_upload_finish(&upload, buffer, sizeof buffer, &id) != FLEXSPLINE_STATUS_INCOMPLETE)
            return 17;
        if (flexspline_upload_chunk(&upload, buffer, sizeof buffer, at, flexspline_cam_table + at, length))
            return 18;
    }
    FlexsplineStoreReport report;
    if (flexspline_upload_finish(&upload, buffer, sizeof buffer, &id) || flexspline_store_report(&store, &report))
        return 19;
    for (size_t i = 0; i < sizeof id; i++)
        if (id[i] != report.table_id[i])
            return 20;
    return 0;
}

// 0 if all is as it should be, else the number of what is not.
int run(void)
{
    const FlexsplineImages table = {
        .first = flexspline_cam_table,
        .first_bytes = sizeof flexspline_cam_table,
        .second = second,
        .second_bytes = sizeof second,
    };
    for (size_t i = 0; i < sizeof second; i++)
        second[i] = flexspline_cam_table[i];
    if (flexspline_state_request(&state, 1) != FLEXSPLINE_STATUS_NOT_INITIALISED)
        return 1;
    if (flexspline_store_init(&store) || flexspline_joint_init(&joint, &settings) || flexspline_state_init(&state))
        return 2;
    FlexsplineImages cut = table;
    cut.first_bytes = cut.second_bytes = 600;
    if (flexspline_store_activate(&store, &joint, &cut, 20.0f) != FLEXSPLINE_STATUS_IMAGE)
        return 3;
    FlexsplineImages once = table;
    once.second = once.first;
    if (flexspline_store_activate(&store, &joint, &once, 20.0f) != FLEXSPLINE_STATUS_SAME_IMAGE)
        return 10;
    if (flexspline_store_activate(&store, &joint, &table, 0.0f / 0.0f) != FLEXSPLINE_STATUS_ARGUMENT)
        return 11;
    if (flexspline_self_test())
        return 22;
    const FlexsplineImages others[] = {IMAGES(double_disc), IMAGES(four_roller), IMAGES(two_roller), IMAGES(curves)};
    const size_t number = sizeof others / sizeof others[0];
    for (size_t i = 0; i < number; i++)
        if (flexspline_store_activate(&store, &joint, &others[i], 20.0f) || flexspline_state_init(&state) ||
            flexspline_state_request(&state, 1) || fly(i + 1 < number ? "c-tick" : "c-curves-tick", &others[i]))
            return 29;
    if (flexspline_store_init(&store) || flexspline_state_init(&state))
        return 30;
    static FlexsplineIdentity identity;
    uint8_t found = 0;
    if (flexspline_identity_begin(&identity))
        return 23;
    while (found == 0)
        if (flexspline_identity_step(&identity, second, sizeof second, &found))
            return 24;
    if (found != 1)
        return 25;
    static FlexsplineActivation activation;
    uint8_t progress = 0;
    if (flexspline_activation_begin(&activation, &joint, 20.0f))
        return 26;
    while (progress != 2)
        if (flexspline_activation_step(&activation, &store, &table, &progress))
            return 27;
    if (flexspline_state_request(&state, 1))
        return 4;

    const int flown = fly("c-tick", &table);
    if (flown)
        return flown;
    FlexsplineOutput out;
    if (flexspline_tick(&joint, &table, &store, &state, 0, &out) != FLEXSPLINE_STATUS_POINTER)
        return 9;
    // Saved, restored, read back; mended though nothing is torn.
    static uint8_t saved[FLEXSPLINE_SAVED_BYTES];
    FlexsplineStoreReport report;
    FlexsplineStateReport told;
    if (flexspline_state_save(&state, &joint, &store, &saved) || flexspline_state_restore(&state, &joint, &store, &saved))
        return 12;
    if (flexspline_store_report(&store, &report) || flexspline_state_report(&state, &told) || flexspline_joint_mend(&joint))
        return 13;
    if (report.health != 0 || report.words_skipped != 0 || told.mode != 0 || told.side_known != 1)
        return 14;
    static uint8_t record[FLEXSPLINE_RECORD_BYTES];
    if (flexspline_record(2000, 0, 0, &state, &store, &out, &record) || record[0] != 'F' || record[1] != 'X')
        return 25;
    uint32_t sum = 0;
    const int failed = beside(&table, 2000, &sum);
    if (failed)
        return 40 + failed;
    print("c-beside: ");
    print_number(sum);
    print("\n");
    return receive();
}
