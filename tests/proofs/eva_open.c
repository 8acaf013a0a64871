/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * Frama-C Eva: an image of any bytes and any length up to the largest that a header can state is opened.
 * READER is the reader, or one with a planted bug. */
#include READER
#include "__fc_builtin.h"

/* 64 torques, 8 temperatures, 32 ripple nodes, three curves of 128 nodes, and the sums of their pages. */
static uint8_t image[83276];

int main(void)
{
    fxt_table table;
    Frama_C_make_unknown((char *)image, sizeof image);
    const fxt_verdict verdict = fxt_open(&table, image, Frama_C_unsigned_int_interval(0u, sizeof image));
    /* The premise can be met: an image is accepted, and refused for each reason. */
    Frama_C_show_each_reached(verdict.reason);
    return 0;
}
