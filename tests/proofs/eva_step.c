/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * Frama-C Eva: one step with a shipped table, from any memory of a play, for any angle, torque and temperature.
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
    fxt_play play;
    fxt_prediction now;
    fxt_command next;
    Frama_C_make_unknown((char *)&play, sizeof play);
    fxt_step(&table, &play, any_angle(), any_angle(), any_number(), any_number(), &now, &next);
    /* The premise can be met: the end is reached, in every quality. */
    Frama_C_show_each_reached(now.quality, next.quality);
    return 0;
}
