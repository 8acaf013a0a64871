/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * A drive on a bench that exists in this program alone: the generator goes forth and back, the table says where the output is, and what to
 * command so that the output would be where the ideal drive has it. Beside each step it looks at one page of the table's memory.
 *
 * cc -std=c99 -ffp-contract=off -I include example.c c99/flexspline_table.c tables/flexspline_@FIRST@.c -o ../example && ../example */
#include "flexspline_@FIRST@.h"
#include "flexspline_table.h"

#include <stdio.h>

#define ARCSEC_PER_RAD 206264.806247

int main(void)
{
    fxt_table table;
    fxt_play play = fxt_play_unknown();
    const fxt_verdict verdict = fxt_open(&table, flexspline_@FIRST@_table, sizeof flexspline_@FIRST@_table);
    if (verdict.reason != FXT_OK) {
        printf("table refused: %s, %s\n", fxt_reason_name(verdict.reason), fxt_field_name(verdict.field));
        return 1;
    }
    const fxt_info info = fxt_tell(&table);
    printf("table ");
    for (int i = 0; i < 8; i++)
        printf("%02x", (unsigned)info.table_id[i]);
    printf(", ratio %g\n  generator rad  error arcsec  within arcsec  command rad  quality\n", (double)info.ratio);
    for (int step = 0; step <= 16; step++) {
        const double turned = 0.01 * (step <= 8 ? step : 16 - step);
        int64_t measured, wanted;
        fxt_prediction now;
        fxt_command next;
        if (!fxt_from_rad(turned, &measured) || !fxt_from_rad(turned / (double)info.ratio, &wanted))
            return 1;
        if (!fxt_page_intact(&table, (uint32_t)step % fxt_page_count(&table))) {
            printf("the memory of the table changed\n");
            return 1;
        }
        fxt_step(&table, &play, measured, wanted, 5.0f, 20.0f, &now, &next);
        if (next.quality == FXT_DISABLED) /* here no input is NaN; in a drive: stop slowly, for the correction is gone at once */
            return 1;
        printf("%15.3f %13.3f %14.3f %12.5f %8d\n", turned, ARCSEC_PER_RAD * (double)now.transmission_error_rad,
               ARCSEC_PER_RAD * (double)now.uncertainty_rad, fxt_to_rad(next.generator), (int)now.quality);
    }
    return 0;
}
