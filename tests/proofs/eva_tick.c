/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * Frama-C Eva: one tick of a joint with a shipped table, from any memory of the joint, for any input; and an encoder of any settings, read alone and for the joint.
 * TABLE is what dump.c wrote of the table; READER the reader, or one with a planted bug. */
#include READER
#include TABLE
#include "__fc_builtin.h"

static float any_number(void)
{
    return float_of(Frama_C_unsigned_int_interval(0u, UINT32_MAX));
}

static int64_t any_angle(void)
{
    const uint64_t above = Frama_C_unsigned_int_interval(0u, UINT32_MAX), below = Frama_C_unsigned_int_interval(0u, UINT32_MAX);
    return (int64_t)(above << 32 | below);
}

int main(void)
{
    fxt_joint joint;
    fxt_encoder encoder;
    fxt_limits limits;
    int64_t angle = 0;
    /* What a limiter is given is any number that an init can leave or not: memory that changed. */
    Frama_C_make_unknown((char *)&joint, sizeof joint);
    const fxt_input input = {any_angle(), any_angle(), any_number(), any_number(),
                             (uint16_t)Frama_C_interval(0, UINT16_MAX), Frama_C_interval(0, 1) == 1};
    const fxt_output out = fxt_tick(&table, &joint, &input);
    (void)fxt_joint_request(&joint, (fxt_mode)Frama_C_interval(0, 9));
    (void)fxt_joint_limit_acceleration(&joint, any_number());
    Frama_C_make_unknown((char *)&encoder, sizeof encoder);
    (void)fxt_encoder_read(&encoder, (uint64_t)any_angle(), &angle);
    (void)fxt_joint_read(&joint, &encoder, (uint64_t)any_angle(), &angle);
    (void)fxt_encoder_init(&encoder, (uint32_t)any_angle(), (uint8_t)any_angle(), Frama_C_interval(0, 1) == 1, any_angle());
    (void)fxt_encoder_start(&encoder, (uint64_t)any_angle(), any_angle());
    const bool read = fxt_encoder_read(&encoder, (uint64_t)any_angle(), &angle);
    (void)fxt_encoder_reading(&encoder, any_angle());
    limits.tick_s = any_number();
    limits.rate_rad_s = any_number();
    limits.acceleration_rad_s2 = any_number();
    limits.generator_rate_rad_s = any_number();
    limits.hold_rad = any_number();
    limits.patience = (uint16_t)Frama_C_interval(0, UINT16_MAX);
    limits.fade_ticks = (uint16_t)Frama_C_interval(0, UINT16_MAX);
    limits.overrun = (fxt_overrun)Frama_C_interval(0, 9);
    const fxt_limit made = fxt_joint_init(&joint, &limits);
    /* The premise can be met: the end is reached, in every quality, with and without a reading, for each limit. */
    Frama_C_show_each_reached(out.quality, read, made);
    return 0;
}
