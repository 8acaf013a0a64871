/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * The reader in C99 as it is called by mistake: pointers that are not there, a play that nobody started, angles beyond the range, memory
 * that changes. 0 if each is answered as flexspline_table.h says; else the number of the line.
 *
 * misuse TABLE.fxt */
#include "flexspline_table.h"

#include <stdio.h>
#include <string.h>

#define EXPECT(true_is)                                            \
    do {                                                           \
        if (!(true_is)) {                                          \
            printf("line %d: not so: %s\n", __LINE__, #true_is);   \
            return __LINE__;                                       \
        }                                                          \
    } while (0)

static int no_pointers(const fxt_table *table, const uint8_t *image, size_t bytes)
{
    fxt_play play = fxt_play_unknown();
    fxt_prediction now;
    fxt_command next, alone;
    const double ratio = (double)fxt_tell(table).ratio;
    int64_t angle = 7;
    float error = 7.0f;
    uint8_t saved[FXT_SAVED_PLAY_BYTES];
    EXPECT(fxt_open(NULL, image, bytes).reason == FXT_NO_TABLE);
    EXPECT(strcmp(fxt_reason_name(FXT_NO_TABLE), "no table") == 0);
    EXPECT(fxt_tell(NULL).flexspline_teeth == 0);
    EXPECT(fxt_page_count(NULL) == 1 && !fxt_page_intact(NULL, 0));
    EXPECT(!fxt_play_known(NULL) && !fxt_play_output(NULL, &angle) && !fxt_play_output(&play, NULL));
    EXPECT(fxt_play_offset_rad(NULL) == 0.0f && fxt_play_uncertainty_rad(NULL) == fxt_play_uncertainty_rad(&play));
    fxt_play_save(NULL, saved);
    EXPECT(fxt_play_restore(&play, saved) && !fxt_play_known(&play) && !fxt_play_output(&play, &angle));
    EXPECT(!fxt_play_restore(&play, NULL) && !fxt_play_restore(NULL, saved));
    fxt_play_save(&play, NULL);
    /* No table: nothing is known, not even the ratio. */
    EXPECT(fxt_forward(NULL, &play, 1, 0.0f, 20.0f).quality == FXT_DISABLED);
    EXPECT(fxt_inverse(NULL, 1, 0.0f, 20.0f, FXT_FORWARD).quality == FXT_DISABLED);
    EXPECT(fxt_inverse_from(NULL, 1, 0.0f, 20.0f, &play).quality == FXT_DISABLED);
    EXPECT(!fxt_steady_error(NULL, 1, 0.0f, 20.0f, FXT_FORWARD, &error) && !fxt_steady_error(table, 1, 0.0f, 20.0f, FXT_FORWARD, NULL));
    fxt_table refused;
    EXPECT(fxt_open(&refused, image, bytes - 1).reason == FXT_LENGTH);
    EXPECT(!fxt_steady_error(&refused, 1, 0.0f, 20.0f, FXT_FORWARD, &error));
    /* No play: the ideal drive. */
    now = fxt_forward(table, NULL, INT64_C(1) << 40, 0.0f, 20.0f);
    EXPECT(now.quality == FXT_DISABLED && now.output == now.nominal && now.nominal != 0 && now.transmission_error_rad == 0.0f);
    next = fxt_inverse_from(table, INT64_C(1) << 33, 0.0f, 20.0f, NULL);
    EXPECT(next.quality == FXT_DISABLED && next.predicted_error_rad == 0.0f);
    EXPECT((double)next.generator == ratio * 8589934592.0);
    fxt_step(table, NULL, 0, INT64_C(1) << 33, 0.0f, 20.0f, &now, &next);
    EXPECT(now.quality == FXT_DISABLED && next.quality == FXT_DISABLED);
    fxt_step(NULL, &play, 0, 1, 0.0f, 20.0f, &now, &next);
    EXPECT(now.quality == FXT_DISABLED && next.quality == FXT_DISABLED);
    /* An answer that is not wanted: the other is the same, and the play moves. */
    fxt_play other = play = fxt_play_after(FXT_FORWARD);
    fxt_step(table, &play, 1000, 5, 0.0f, 20.0f, &now, &next);
    fxt_step(table, &other, 1000, 5, 0.0f, 20.0f, NULL, &alone);
    EXPECT(memcmp(&play, &other, sizeof play) == 0 && alone.generator == next.generator && alone.quality == next.quality);
    fxt_step(table, &play, 1000, 5, 0.0f, 20.0f, &now, NULL);
    EXPECT(now.quality != FXT_DISABLED);
    EXPECT(!fxt_from_rad(1.0, NULL));
    return 0;
}

/* static, and no start: the side is not known, as after fxt_play_unknown. */
static int forgotten_start(const fxt_table *table)
{
    static fxt_play forgotten;
    fxt_play play = fxt_play_unknown();
    uint8_t saved[FXT_SAVED_PLAY_BYTES], again[FXT_SAVED_PLAY_BYTES];
    int64_t angle;
    EXPECT(!fxt_play_known(&forgotten) && !fxt_play_output(&forgotten, &angle));
    EXPECT(fxt_play_uncertainty_rad(&forgotten) == fxt_play_uncertainty_rad(&play));
    fxt_play_save(&forgotten, saved);
    fxt_play_save(&play, again);
    EXPECT(memcmp(saved, again, sizeof saved) == 0);
    for (int tick = 0; tick < 3; tick++) {
        const fxt_prediction of = fxt_forward(table, &forgotten, tick, 0.0f, 20.0f), as = fxt_forward(table, &play, tick, 0.0f, 20.0f);
        EXPECT(of.output == as.output && of.uncertainty_rad == as.uncertainty_rad && of.quality == as.quality);
    }
    EXPECT(!fxt_play_known(&forgotten) && fxt_forward(table, &forgotten, 3, 0.0f, 20.0f).quality == FXT_UNCERTAIN);
    /* A drive without play at angle 0: saved it is all zeros, and it is known. */
    static const uint8_t known[FXT_SAVED_PLAY_BYTES] = {[24] = 0x20, 0xca, 0xc1, 0xa3};
    EXPECT(fxt_play_restore(&play, known) && fxt_play_known(&play) && fxt_play_uncertainty_rad(&play) == 0.0f);
    fxt_play_save(&play, saved);
    EXPECT(memcmp(saved, known, sizeof saved) == 0);
    return 0;
}

/* Beyond 2^31 generator turns a command wraps, as the core's: the same quality, the angle to within the error modulo 2^32 turns. */
static int beyond_the_range(const fxt_table *table)
{
    const fxt_command far = fxt_inverse(table, INT64_C(1) << 62, 0.0f, 20.0f, FXT_FORWARD);
    const int64_t ratio = (int64_t)fxt_tell(table).ratio;
    const int64_t away = (int64_t)((uint64_t)far.generator - ((uint64_t)ratio << 62));
    EXPECT((float)ratio == fxt_tell(table).ratio);
    EXPECT(far.quality == FXT_IN_RANGE && away > -(INT64_C(1) << 32) && away < INT64_C(1) << 32);
    return 0;
}

/* What changed after fxt_open is seen by fxt_page_intact alone. */
static int changed_memory(const fxt_table *table, uint8_t *image, size_t bytes)
{
    const uint32_t pages = fxt_page_count(table);
    for (size_t at = 0; at < (size_t)table->body_bytes; at += 97) {
        image[at] ^= 0x10;
        for (uint32_t page = 0; page < pages; page++)
            EXPECT(fxt_page_intact(table, page) == (page != at / FXT_PAGE_BYTES));
        image[at] ^= 0x10;
    }
    EXPECT(bytes > table->body_bytes);
    return 0;
}

int main(int count, char **arguments)
{
    static uint8_t image[200000];
    static fxt_table table;
    FILE *file = count > 1 ? fopen(arguments[1], "rb") : NULL;
    if (file == NULL)
        return 1;
    const size_t bytes = fread(image, 1, sizeof image, file);
    (void)fclose(file);
    EXPECT(fxt_open(&table, image, bytes).reason == FXT_OK);
    int wrong = forgotten_start(&table);
    wrong = wrong != 0 ? wrong : no_pointers(&table, image, bytes);
    wrong = wrong != 0 ? wrong : beyond_the_range(&table);
    wrong = wrong != 0 ? wrong : changed_memory(&table, image, bytes);
    return wrong != 0;
}
