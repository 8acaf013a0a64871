/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * Finds again with the reader in C what the core said: tests/fuzz/examples/c99.rs writes the records that are read here; a release has them,
 * too (docs/how-to/release.md), for who has no Rust.
 *
 * On a host, from the top of the project: cc -std=c99 -ffp-contract=off -I core/c99 tests/c99/driver.c core/c99/flexspline_table.c -lm
 * makes the program; driver FILE. On a Cortex-M4F in QEMU the file VECTORS is read through semihosting. 0 if all bits are equal. */
#include "flexspline_table.h"

static bool read_bytes(void *to, size_t count);
static void print(const char *text);
/* The image in memory of its own, where there is a heap, so that a sanitizer sees a reading beyond its end. */
static uint8_t *alone(uint8_t *image, uint32_t length);
/* Around a call: what it takes, where that can be counted. */
static void begin(void);
static void end(uint32_t kind);

static unsigned calls, ticks, accepted, refused, differences;

static void print_number(unsigned number)
{
    char digits[12];
    char *at = digits + sizeof digits - 1;
    *at = 0;
    do
        *--at = (char)('0' + number % 10u);
    while (number /= 10u);
    print(at);
}

static uint32_t word(void)
{
    uint8_t bytes[4];
    (void)read_bytes(bytes, 4);
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static uint32_t byte(void)
{
    uint8_t one = 0;
    (void)read_bytes(&one, 1);
    return one;
}

static int64_t angle(void)
{
    const uint64_t low = word();
    return (int64_t)(low | (uint64_t)word() << 32);
}

static uint32_t bits(float value)
{
    union {
        float f;
        uint32_t u;
    } both;
    both.f = value;
    return both.u;
}

static float number(void)
{
    union {
        uint32_t u;
        float f;
    } both;
    both.u = word();
    return both.f;
}

static void differs(const char *what, uint32_t kind)
{
    if (differences++ < 8u) {
        print("image ");
        print_number(accepted + refused);
        print(", call ");
        print_number(calls);
        print(" of kind ");
        print_number(kind);
        print(": ");
        print(what);
        print("\n");
    }
}

static void same(bool equal, const char *what, uint32_t kind)
{
    if (!equal)
        differs(what, kind);
}

static void same_prediction(const fxt_prediction *found, uint32_t kind)
{
    same(found->output == angle(), "output", kind);
    same(found->nominal == angle(), "nominal output", kind);
    same(bits(found->transmission_error_rad) == word(), "transmission error", kind);
    same(bits(found->uncertainty_rad) == word(), "uncertainty", kind);
    same((uint32_t)found->quality == word(), "quality", kind);
}

static void same_command(const fxt_command *found, uint32_t kind)
{
    same(found->generator == angle(), "command", kind);
    same(bits(found->predicted_error_rad) == word(), "predicted error", kind);
    same(bits(found->uncertainty_rad) == word(), "uncertainty of a command", kind);
    same((uint32_t)found->quality == word(), "quality of a command", kind);
}

/* An image and its verdict; at odd images the image lies at an odd address. */
static bool open_image(fxt_table *table, uint8_t **opened)
{
    static uint8_t memory[100001];
    const uint32_t length = word();
    uint8_t *image = memory + (accepted + refused) % 2u;
    if (length >= sizeof memory || !read_bytes(image, length)) {
        differs("an image that is too long or cut off", 1);
        return false;
    }
    image = alone(image, length);
    *opened = image;
    const fxt_verdict verdict = fxt_open(table, image, length);
    const uint32_t reason = byte(), field = byte(), index = word(), temperature = word();
    if ((uint32_t)verdict.reason != reason || (uint32_t)verdict.field != field || verdict.index != index ||
        verdict.temperature != temperature) {
        differs(fxt_reason_name(verdict.reason), 1);
        print("  of ");
        print(fxt_field_name(verdict.field));
        print("; the core says ");
        print(fxt_reason_name((fxt_reason)reason));
        print(" of ");
        print(fxt_field_name((fxt_field)field));
        print("\n");
    }
    if (reason != 0) {
        refused++;
        return true;
    }
    accepted++;
    const fxt_info info = fxt_tell(table);
    for (int i = 0; i < 8; i++)
        same(info.table_id[i] == byte(), "table id", 1);
    for (int i = 0; i < 6; i++)
        same(bits(table->bounds[i]) == word(), "bounds", 1);
    same(bits(info.inverse_error_rad) == word(), "error of the inverse", 1);
    same(bits(info.ratio) == word(), "ratio", 1);
    for (int i = 0; i < 2; i++)
        same(bits(info.torque_range_n_m[i]) == word(), "torque range", 1);
    for (int i = 0; i < 2; i++)
        same(bits(info.temperature_range_c[i]) == word(), "temperature range", 1);
    same(info.inverse_iterations == word(), "iterations", 1);
    same(fxt_page_count(table) == word(), "pages", 1);
    for (uint32_t page = 0; page < fxt_page_count(table); page++)
        same(fxt_page_intact(table, page), "a page", 1);
    return true;
}

static void call(const fxt_table *table, fxt_play *play)
{
    const uint32_t kind = byte();
    const int64_t generator = angle(), target = angle();
    const float torque = number(), temperature = number();
    calls++;
    switch (kind) {
    case 0: {
        begin();
        const fxt_prediction found = fxt_forward(table, play, generator, torque, temperature);
        end(kind);
        same_prediction(&found, kind);
        break;
    }
    case 1:
    case 2: {
        begin();
        const fxt_command found = fxt_inverse(table, target, torque, temperature, kind == 1u ? FXT_FORWARD : FXT_BACKWARD);
        end(kind);
        same_command(&found, kind);
        break;
    }
    case 3: {
        begin();
        const fxt_command found = fxt_inverse_from(table, target, torque, temperature, play);
        end(kind);
        same_command(&found, kind);
        break;
    }
    case 4: {
        fxt_prediction prediction;
        fxt_command command;
        begin();
        fxt_step(table, play, generator, target, torque, temperature, &prediction, &command);
        end(kind);
        same_prediction(&prediction, kind);
        same_command(&command, kind);
        break;
    }
    case 5:
    case 6: {
        float error;
        const bool there =
            fxt_steady_error(table, generator, torque, temperature, kind == 5u ? FXT_FORWARD : FXT_BACKWARD, &error);
        same((uint32_t)there == word(), "steady error or none", kind);
        same((there ? bits(error) : 0u) == word(), "steady error", kind);
        break;
    }
    case 7:
        *play = fxt_play_unknown();
        break;
    case 8:
        *play = fxt_play_after(FXT_FORWARD);
        break;
    default:
        *play = fxt_play_after(FXT_BACKWARD);
        break;
    }
    same(bits(fxt_play_offset_rad(play)) == word(), "offset in the play", kind);
    same(bits(fxt_play_uncertainty_rad(play)) == word(), "uncertainty of the play", kind);
    uint8_t saved[FXT_SAVED_PLAY_BYTES];
    fxt_play_save(play, saved);
    bool equal = true;
    for (int i = 0; i < FXT_SAVED_PLAY_BYTES; i++)
        equal &= saved[i] == byte();
    same(equal, "play", kind);
}

static void restore(void)
{
    uint8_t saved[FXT_SAVED_PLAY_BYTES], again[FXT_SAVED_PLAY_BYTES];
    fxt_play play = fxt_play_unknown();
    (void)read_bytes(saved, sizeof saved);
    const bool restored = fxt_play_restore(&play, saved);
    same(restored == (byte() != 0u), "restored or not", 3);
    fxt_play_save(&play, again);
    bool equal = true;
    for (int i = 0; i < FXT_SAVED_PLAY_BYTES; i++)
        equal &= saved[i] == again[i];
    same(equal == restored, "restored and saved again", 3);
}

/* The limits of a joint. */
static void make_joint(fxt_joint *joint)
{
    fxt_limits limits;
    limits.tick_s = number();
    limits.rate_rad_s = number();
    limits.acceleration_rad_s2 = number();
    limits.generator_rate_rad_s = number();
    limits.hold_rad = number();
    const uint32_t both = word();
    limits.patience = (uint16_t)(both & 0xffffu);
    limits.fade_ticks = (uint16_t)(both >> 16);
    limits.overrun = (fxt_overrun)word();
    same((uint32_t)fxt_joint_init(joint, &limits) == byte(), "limits of a joint", 4);
    same(fxt_joint_mode(joint) == (joint->rate > 0 ? FXT_OFF : FXT_SAFE), "mode at the start", 4);
    const bool is_given = byte() != 0u;
    const float most = number();
    const bool taken = byte() != 0u;
    same(is_given ? fxt_joint_limit_acceleration(joint, most) == taken : !taken, "the acceleration of a generator or none", 4);
}

static void tick(const fxt_table *table, fxt_joint *joint)
{
    const uint32_t asked = byte();
    const bool taken = byte() != 0u;
    fxt_input input;
    input.has_generator = byte() != 0u;
    input.generator = angle();
    input.target = angle();
    input.torque_n_m = number();
    input.temperature_c = number();
    input.missed_ticks = (uint16_t)word();
    if (asked < 4u)
        same(fxt_joint_request(joint, (fxt_mode)asked) == taken, "a mode that may be or not", 5);
    else if (asked == 4u)
        fxt_joint_forget_side(joint);
    ticks++;
    begin();
    const fxt_output found = fxt_tick(table, joint, &input);
    end(7);
    same(found.command == angle(), "command of a tick", 5);
    same(found.output == angle(), "output of a tick", 5);
    same(bits(found.transmission_error_rad) == word(), "transmission error of a tick", 5);
    same(bits(found.uncertainty_rad) == word(), "uncertainty of a tick", 5);
    same(bits(found.correction_rad) == word(), "correction", 5);
    same(bits(found.held_back_rad) == word(), "what is held back", 5);
    same((uint32_t)found.quality == word(), "quality of a tick", 5);
    same(found.flags == word(), "flags of a tick", 5);
    same(joint->missed_ticks == word(), "ticks missed", 5);
}

static void make_encoder(fxt_encoder *encoder)
{
    const uint32_t per_turn = word(), bits_of_it = byte();
    const bool reversed = byte() != 0u;
    const int64_t zero = angle();
    same(fxt_encoder_init(encoder, per_turn, (uint8_t)bits_of_it, reversed, zero) == (byte() != 0u), "an encoder or none", 6);
}

static void call_encoder(fxt_encoder *encoder)
{
    const uint32_t kind = byte();
    const uint64_t asked = (uint64_t)angle();
    const bool taken = byte() != 0u;
    const int64_t told = angle();
    int64_t found = 0;
    if (kind == 0u)
        same(fxt_encoder_start(encoder, asked, told) == taken, "start of an encoder", 7);
    else if (kind == 1u) {
        same(fxt_encoder_read(encoder, asked, &found) == taken, "a reading or none", 7);
        same(!taken || found == told, "angle of an encoder", 7);
    } else
        same(fxt_encoder_reading(encoder, (int64_t)asked) == (uint64_t)told, "reading at an angle", 7);
}

static void read_by_joint(const fxt_joint *joint, fxt_encoder *encoder)
{
    const uint64_t asked = (uint64_t)angle();
    const bool taken = byte() != 0u, is_lost = byte() != 0u;
    const int64_t expected = angle();
    int64_t found = 0;
    same(fxt_joint_read(joint, encoder, asked, &found) == taken, "a reading for a joint or none", 8);
    same(!taken || found == expected, "angle of a reading for a joint", 8);
    same(fxt_encoder_is_lost(encoder) == is_lost, "an encoder that is lost or not", 8);
}

/* The memory of an accepted image changes after the check: whatever is read then lies in it, and an error is within the stated limit. */
static void damage(const fxt_table *table, uint8_t *image)
{
    static const fxt_limits fast = {.tick_s = 1e-3f, .rate_rad_s = 1.0f, .acceleration_rad_s2 = 1e3f, .generator_rate_rad_s = 3e3f};
    fxt_play play = fxt_play_unknown();
    fxt_joint joint;
    const float limit = 1.002f * fxt_tell(table).error_limit_rad + 1e-6f;
    uint32_t mixed = 1;
    same(fxt_joint_init(&joint, &fast) == FXT_LIMITS_OK && fxt_joint_request(&joint, FXT_TRACKING), "a joint", 0);
    for (uint32_t i = 0; i < 64u; i++) {
        fxt_prediction now;
        fxt_command next;
        mixed = mixed * 1664525u + 1013904223u;
        if (image != NULL)
            image[(mixed >> 8) % table->bytes] ^= (uint8_t)(1u << (mixed & 7u));
        /* Torque, temperature, and where the parts are. */
        if (image != NULL && i % 4u == 0u)
            image[136u + (mixed >> 16) % 60u] = (uint8_t)(mixed >> 24);
        const float at = (float)((int32_t)mixed >> 24);
        fxt_step(table, &play, (int64_t)mixed << 8, (int64_t)mixed << 2, at, at, &now, &next);
        const fxt_input input = {(int64_t)mixed << 8, (int64_t)mixed << 2, at, at, 0, true};
        const fxt_output ticked = fxt_tick(table, &joint, &input);
        /* The play of before may still be in the first. */
        const float error = now.transmission_error_rad, aimed = next.predicted_error_rad;
        const bool bounded = error >= -2.0f * limit && error <= 2.0f * limit && aimed >= -2.0f * limit && aimed <= 2.0f * limit;
        /* A correction stays within once, whatever is read. */
        same(ticked.correction_rad >= -limit && ticked.correction_rad <= limit && ticked.quality <= FXT_DISABLED, "a tick after damage", i);
        same(bounded && now.quality <= FXT_DISABLED && next.quality <= FXT_DISABLED, "after damage", i);
    }
}

static int compare(void)
{
    static fxt_table table;
    static fxt_joint joint;
    static fxt_encoder encoder;
    fxt_play play = fxt_play_unknown();
    bool whole = true, ended = false;
    uint8_t *image = NULL;
    while (whole && !ended) {
        uint8_t record = 0;
        whole = read_bytes(&record, 1);
        if (record < 2 && table.image != NULL)
            damage(&table, image);
        if (record == 1) {
            whole = whole && open_image(&table, &image);
            play = fxt_play_unknown();
        } else if (record == 2)
            call(&table, &play);
        else if (record == 3)
            restore();
        else if (record == 4)
            make_joint(&joint);
        else if (record == 5)
            tick(&table, &joint);
        else if (record == 6)
            make_encoder(&encoder);
        else if (record == 7)
            call_encoder(&encoder);
        else if (record == 8)
            read_by_joint(&joint, &encoder);
        else
            ended = record == 0;
        if (record > 8)
            whole = false;
    }
    print_number(calls);
    print(" calls, ");
    print_number(ticks);
    print(" ticks, ");
    print_number(accepted);
    print(" images accepted, ");
    print_number(refused);
    print(" refused, ");
    print_number(differences);
    print(" differences\n");
    return whole && calls > 0u && ticks > 0u && accepted > 0u && differences == 0u ? 0 : 1;
}

#ifdef VECTORS
/* A Cortex-M in QEMU. */
int run(void);

static uint32_t semihosting(uint32_t number, const void *block)
{
    register uint32_t operation __asm__("r0") = number;
    register const void *argument __asm__("r1") = block;
    __asm__ volatile("bkpt 0xab" : "+r"(operation) : "r"(argument) : "memory");
    return operation;
}

static void print(const char *text)
{
    (void)semihosting(0x04, text);
}

static bool read_bytes(void *to, size_t count)
{
    static uint8_t buffer[4096];
    static uint32_t handle, have, used;
    uint8_t *at = to;
    if (handle == 0u) {
        static const char name[] = VECTORS;
        const uint32_t block[3] = {(uint32_t)(uintptr_t)name, 1, sizeof name - 1u};
        handle = semihosting(0x01, block);
    }
    for (size_t i = 0; i < count; i++) {
        if (used == have) {
            const uint32_t block[3] = {handle, (uint32_t)(uintptr_t)buffer, sizeof buffer};
            have = (uint32_t)sizeof buffer - semihosting(0x06, block);
            used = 0;
            if (have == 0u)
                return false;
        }
        at[i] = buffer[used++];
    }
    return true;
}

static uint8_t *alone(uint8_t *image, uint32_t length)
{
    (void)length;
    return image;
}

/* What a compiler may call for a structure, and a C library has. */
void *memset(void *to, int value, size_t count);
void *memcpy(void *to, const void *from, size_t count);

void *memset(void *to, int value, size_t count)
{
    for (volatile uint8_t *at = to; count > 0; count--)
        *at++ = (uint8_t)value;
    return to;
}

void *memcpy(void *to, const void *from, size_t count)
{
    const uint8_t *source = from;
    for (volatile uint8_t *at = to; count > 0; count--)
        *at++ = *source++;
    return to;
}

/* Instructions: under -icount shift=10 each takes 1.024 us of virtual time, and the 25 MHz SysTick of the MPS2 counts 25.6 for it. */
#define SYSTICK ((volatile uint32_t *)0xE000E010)
#define RELOAD 0x00ffffffu
/* Tables that are counted: those of the four generators, which come first, and one with curves of all three angles. */
#define GENERATORS 4u

static uint32_t started;
static uint32_t least[2][8], most[2][8];

static void begin(void)
{
    started = SYSTICK[2];
}

/* Apart from what reads the time, so that this costs the same whatever is kept. */
__attribute__((noinline)) static void keep(uint32_t kind, uint32_t ended)
{
    const uint32_t count = (((started - ended) & RELOAD) * 10u + 128u) / 256u, curves = accepted > GENERATORS ? 1u : 0u;
    if (accepted > GENERATORS + 1u || refused > 0)
        return;
    least[curves][kind] = least[curves][kind] == 0u || count < least[curves][kind] ? count : least[curves][kind];
    most[curves][kind] = count > most[curves][kind] ? count : most[curves][kind];
}

static void end(uint32_t kind)
{
    keep(kind, SYSTICK[2]);
}

int run(void)
{
    static const char *const names[8] = {"forward", "inverse", "inverse", "inverse from", "step", NULL, NULL, "tick"};
    SYSTICK[1] = RELOAD;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    const int status = compare();
    for (uint32_t i = 0; i < 16; i++) {
        const uint32_t curves = i / 8u, kind = i % 8u;
        if (names[kind] == NULL)
            continue;
        print(curves ? "c99-curves-" : "c99-");
        print(names[kind]);
        print(": ");
        print_number(most[curves][kind]);
        print(" instructions at most, ");
        print_number(least[curves][kind]);
        print(" at least\n");
    }
    print("c99-ram: ");
    print_number((unsigned)(sizeof(fxt_table) + sizeof(fxt_joint) + sizeof(fxt_encoder)));
    print(" bytes\n");
    return status;
}
#else
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static FILE *file;

static void print(const char *text)
{
    (void)fputs(text, stdout);
}

static bool read_bytes(void *to, size_t count)
{
    return fread(to, 1, count, file) == count;
}

static uint8_t *alone(uint8_t *image, uint32_t length)
{
    static uint8_t *kept;
    const uint32_t odd = (uint32_t)((uintptr_t)image & 1u);
    free(kept);
    kept = malloc((size_t)length + odd);
    if (kept == NULL)
        exit(2);
    if (length > 0)
        memcpy(kept + odd, image, length);
    return kept + odd;
}

static void begin(void)
{
}

static void end(uint32_t kind)
{
    (void)kind;
}

int main(int count, char **arguments)
{
    file = count > 1 ? fopen(arguments[1], "rb") : NULL;
    if (file == NULL)
        return 2;
    const int status = compare();
    (void)alone(NULL, 0);
    (void)fclose(file);
    return status;
}
#endif
