/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * A drive on a bench that exists in this program alone: its output is to go forth and back, an encoder of 65536 counts in a turn says where the
 * generator is, and the generator goes where it is told. Beside each tick the program looks at one page of the table's memory.
 *
 * cc -std=c99 -ffp-contract=off -I include example.c c99/flexspline_table.c tables/flexspline_@FIRST@.c -o ../example && ../example */
#include "flexspline_@FIRST@.h"
#include "flexspline_table.h"

#include <stdio.h>

#define ARCSEC_PER_RAD 206264.806247

int main(void)
{
    static const fxt_limits limits = {.tick_s = 1e-3f, .rate_rad_s = 0.05f, .acceleration_rad_s2 = 5.0f, .generator_rate_rad_s = 600.0f, .patience = 5};
    fxt_table table;
    fxt_joint joint;
    fxt_encoder encoder;
    const fxt_verdict verdict = fxt_open(&table, flexspline_@FIRST@_table, sizeof flexspline_@FIRST@_table);
    if (verdict.reason != FXT_OK) {
        printf("table refused: %s, %s\n", fxt_reason_name(verdict.reason), fxt_field_name(verdict.field));
        return 1;
    }
    if (fxt_joint_init(&joint, &limits) != FXT_LIMITS_OK || !fxt_encoder_init(&encoder, 65536, 0, false, 0) || !fxt_joint_request(&joint, FXT_TRACKING))
        return 1;
    const fxt_info info = fxt_tell(&table);
    printf("table ");
    for (int i = 0; i < 8; i++)
        printf("%02x", (unsigned)info.table_id[i]);
    printf(", ratio %g\n  target rad  error arcsec  within arcsec  correction arcsec  command rad  quality flags\n", (double)info.ratio);
    uint64_t reading = 0;
    for (int tick = 0; tick <= 800; tick++) {
        const double wanted_rad = 1e-5 * (tick <= 400 ? tick : 800 - tick);
        fxt_input in = {.torque_n_m = 5.0f, .temperature_c = 20.0f};
        in.has_generator = fxt_joint_read(&joint, &encoder, reading, &in.generator);
        if (!fxt_from_rad(wanted_rad, &in.target) || !fxt_page_intact(&table, (uint32_t)tick % fxt_page_count(&table))) {
            printf("the memory of the table changed\n");
            return 1;
        }
        const fxt_output out = fxt_tick(&table, &joint, &in);
        reading = fxt_encoder_reading(&encoder, out.command);
        if (tick % 50 == 0)
            printf("%12.4f %13.3f %14.3f %18.3f %12.5f %8d %5u\n", wanted_rad, ARCSEC_PER_RAD * (double)out.transmission_error_rad,
                   ARCSEC_PER_RAD * (double)out.uncertainty_rad, ARCSEC_PER_RAD * (double)out.correction_rad, fxt_to_rad(out.command),
                   (int)out.quality, (unsigned)out.flags);
    }
    return 0;
}
