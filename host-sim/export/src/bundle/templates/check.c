/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * Steps of each table beside what the core says of them, bit by bit: 0 if a port is right, else the number of the first step that differs, or
 * less than 0 where a table is refused: -reason of fxt_open.
 *
 * On a PC: cc -std=c99 -ffp-contract=off -I include vectors/check.c c99/flexspline_table.c tables/[a-z]*.c -o ../check && ../check
 * On a target: compile with -D FLEXSPLINE_NO_MAIN and call flexspline_check. */
#include "vectors.h"

static bool same(float found, uint32_t expected)
{
    const union { float number; uint32_t bits; } both = {.number = found};
    return both.bits == expected;
}

static bool agrees(const fxt_table *table, fxt_play *play, const flexspline_vector *v)
{
    const union { uint32_t bits; float number; } torque = {.bits = v->torque}, temperature = {.bits = v->temperature};
    fxt_prediction now;
    fxt_command next;
    fxt_step(table, play, v->measured, v->target, torque.number, temperature.number, &now, &next);
    return now.output == v->output && same(now.transmission_error_rad, v->error) && same(now.uncertainty_rad, v->uncertainty) &&
           now.quality == v->quality && next.generator == v->command && same(next.predicted_error_rad, v->predicted) &&
           same(next.uncertainty_rad, v->command_uncertainty) && next.quality == v->command_quality;
}

int flexspline_check(void);

int flexspline_check(void)
{
    int number = 0;
    for (uint32_t i = 0; i < sizeof flexspline_cases / sizeof flexspline_cases[0]; i++) {
        fxt_table table;
        fxt_play play = fxt_play_unknown();
        const fxt_verdict verdict = fxt_open(&table, flexspline_cases[i].image, flexspline_cases[i].bytes);
        if (verdict.reason != FXT_OK)
            return -(int)verdict.reason;
        for (uint32_t step = 0; step < flexspline_cases[i].steps; step++) {
            number++;
            if (!agrees(&table, &play, &flexspline_cases[i].vectors[step]))
                return number;
        }
    }
    return 0;
}

#ifndef FLEXSPLINE_NO_MAIN
#include <stdio.h>

int main(void)
{
    const int wrong = flexspline_check();
    if (wrong < 0)
        printf("table refused: %s\n", fxt_reason_name((fxt_reason)-wrong));
    else if (wrong > 0)
        printf("step %d differs\n", wrong);
    else
        printf("all steps have the bits of the core\n");
    return wrong != 0;
}
#endif
