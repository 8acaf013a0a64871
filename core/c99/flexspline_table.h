/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * A flexspline table (.fxt, format 3) read in plain C99: the same answers, bit for bit, as the Rust core's `Table`.
 *
 * No allocation, no recursion, no global state, no library: of the standard headers only those that a freestanding compiler has. Every loop
 * is bounded by the limits of the format. An image is read in place, at any address, and never beyond its end.
 *
 *   fxt_table table;
 *   fxt_play play = fxt_play_unknown();
 *   if (fxt_open(&table, image, image_bytes).reason != FXT_OK) stop();
 *   // every tick:
 *   fxt_step(&table, &play, measured, target, torque_n_m, temperature_c, &now, &command);
 *   // now.output: where the output is; command.generator: where the generator has to go, if command.quality is not FXT_DISABLED
 *   // in the background, a page at a time: is the memory of the table still what fxt_open checked? nothing else finds that out
 *   if (!fxt_page_intact(&table, page++ % fxt_page_count(&table))) stop();
 *
 * A pointer that is NULL is refused: each function says how below. A table that was refused, or is NULL, knows no ratio: all its angles are 0.
 * A command has no limiter: from one tick to the next it moves as far as the correction does, the whole of it where the quality becomes
 * FXT_DISABLED. Watch the quality, and limit the rate.
 *
 * Angles are counts of 2^-32 turn in 64 bits: whole turns above, the fraction below. Positive is counter-clockwise; a positive torque turns
 * the output forward. Torque N*m, temperature degrees Celsius, errors rad at the output.
 *
 * Not in here, but in the core with its C interface (flexspline.h): two copies of the table compared in each tick, state that is whole after
 * an upset, the limiter of the correction, glitches and late samples, learning, predictor, uploads, telemetry, the BLAKE3 of the table.
 *
 * Compile it without contraction and without -ffast-math or any of its parts: -ffp-contract=off. Where that was forgotten it does not compile, or
 * fxt_open refuses with FXT_ARITHMETIC; two parts that Clang takes alone are found by vectors/check only (-freciprocal-math,
 * -fassociative-math). */
#ifndef FLEXSPLINE_TABLE_H
#define FLEXSPLINE_TABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The format that is read, and no other. */
#define FXT_FORMAT_VERSION 3
#define FXT_PAGE_BYTES 256
#define FXT_SAVED_PLAY_BYTES 28

/** Why an image is refused: the first check that fails, as the core's `ImageError` has it. */
typedef enum fxt_reason {
    FXT_OK = 0,
    FXT_TOO_SHORT,           /**< fewer bytes than a header and its checksums */
    FXT_MAGIC,               /**< not a table image */
    FXT_VERSION,             /**< a format version that is not read; index: the one found */
    FXT_BYTE_ORDER,          /**< bytes were swapped on the way; index: the mark found */
    FXT_LENGTH,              /**< the stated length differs from the bytes given; index: the one stated */
    FXT_CRC,                 /**< CRC-32 of all; index: the one computed */
    FXT_PAGE_CRC,            /**< CRC-32 of a page; index: the page */
    FXT_RESERVED,            /**< reserved bytes are not zero; index: offset in the image */
    FXT_TEXT,                /**< a text is not printable ASCII padded with zeros */
    FXT_GENERATOR_KIND,      /**< unknown kind of wave generator; index: its code */
    FXT_FIXED_MEMBER,        /**< unknown fixed member; index: its code */
    FXT_TEETH,               /**< tooth counts that make no drive; index: those of the flexspline */
    FXT_COUNT,               /**< a number of nodes outside its limits; index: the number */
    FXT_SIZE,                /**< counts and length do not fit together; index: bytes that the counts need */
    FXT_NOT_FINITE,          /**< NaN or infinite; index: inside the field */
    FXT_NOT_INCREASING,      /**< nodes of an axis; index: the first not above the one before */
    FXT_NOT_CLOSED,          /**< a periodic curve; index: position in the stored curve */
    FXT_DERIVED,             /**< a number that follows from others does not; index: offset in the image */
    FXT_OUT_OF_RANGE,        /**< a value outside its limits */
    FXT_NEGATIVE_HALF_WIDTH, /**< the play would have a negative width; index: torque node, temperature: temperature node */
    FXT_ERROR_BOUND,         /**< the table can give a larger error than it states */
    FXT_SLOPE,               /**< the output would not follow the generator one to one */
    FXT_FALLS,               /**< the error falls while the load grows; index: torque node above, temperature: temperature node */
    FXT_STEEP,               /**< it grows faster than that of any drive; likewise */
    FXT_INVERSE,             /**< the inverse does not come close enough in its iterations */
    FXT_ARITHMETIC,          /**< not the image: this code was compiled so that sums differ from the core's (contraction, fast math) */
    FXT_NO_TABLE             /* not the image: the pointer to the table is NULL */
} fxt_reason;

/** The field that a reason is about. */
typedef enum fxt_field {
    FXT_NO_FIELD = 0,
    FXT_TOOL_VERSION,
    FXT_MESH_LEVEL,
    FXT_TORQUE_NODES,
    FXT_TEMPERATURE_NODES,
    FXT_RIPPLE_NODES,
    FXT_GENERATOR_CURVE,
    FXT_MATERIAL_CURVE,
    FXT_OUTPUT_CURVE,
    FXT_MEAN,
    FXT_HALF_WIDTH,
    FXT_MEAN_SLOPE,
    FXT_MEAN_RIPPLE,
    FXT_SOLVER_RESIDUAL,
    FXT_PROJECTION_WORST,
    FXT_PROJECTION_RMS,
    FXT_TORQUE_RANGE,
    FXT_TEMPERATURE_RANGE,
    FXT_ERROR_LIMIT
} fxt_field;

/** What a check of an image found. */
typedef struct fxt_verdict {
    fxt_reason reason;
    fxt_field field;
    uint32_t index;       /**< told with each reason; else 0 */
    uint32_t temperature; /**< a temperature node, where there is one; else 0 */
} fxt_verdict;

/** How far an answer can be trusted, worst last. */
typedef enum fxt_quality {
    FXT_IN_RANGE = 0,
    FXT_UNCERTAIN,    /**< known to within the uncertainty only: inside a jump, or the side of the play is not known yet */
    FXT_EXTRAPOLATED, /**< torque or temperature outside the range of the table; the value at its edge is used */
    FXT_DISABLED      /* no correction: an input was not finite, or a number from a changed image is beyond the limits of the table. Most
                         changes of its memory are not seen here but by fxt_page_intact alone */
} fxt_quality;

/** A direction of motion of the output. */
typedef enum fxt_direction { FXT_FORWARD = 0, FXT_BACKWARD } fxt_direction;

/** A ratio of tooth counts: a whole part and 64 fractional bits. */
typedef struct fxt_factor {
    uint64_t fraction;
    uint32_t whole;
} fxt_factor;

/** Periods in an output turn: 32 whole and 32 fractional bits, and 32 more. */
typedef struct fxt_rate {
    uint64_t periods;
    uint32_t rest;
} fxt_rate;

/** A table that passed every check. Made by fxt_open alone; its fields are nobody else's. The image must stay where it is. */
typedef struct fxt_table {
    const uint8_t *image;
    uint32_t bytes, body_bytes;
    fxt_factor to_output, to_generator;
    fxt_rate generator_rate, tooth_rate;
    uint32_t ripple_order;
    bool reversed;
    float cell_width;
    int32_t ripple_cells, limit, hold;
    uint32_t ripple_nodes, ripple_unit, iterations;
    uint32_t curves[3];
    /* Bounds found while the image was checked: error rad, of the periodic parts rad, slope, of the curves, cells, rounding rad. */
    float bounds[6];
    float inverse_error_rad;
} fxt_table;

/** What a table is for. */
typedef struct fxt_info {
    uint8_t table_id[8];    /**< first bytes of the BLAKE3 of its contents: as printed by the tools, byte after byte in hexadecimal */
    uint8_t drive_hash[32]; /**< BLAKE3 of the drive it was made from */
    char tool_version[25], mesh_level[25];
    uint8_t generator_kind; /**< 0 other, 1 two-roller, 2 four-roller, 3 double disc, 4 cam */
    uint8_t fixed_member;   /**< 0 flexspline, 1 circular spline */
    uint16_t flexspline_teeth, circular_spline_teeth;
    uint8_t torque_nodes, temperature_nodes, ripple_nodes, curve_nodes[3];
    float ratio; /**< generator turns in an output turn, signed */
    float torque_range_n_m[2], temperature_range_c[2];
    float error_limit_rad, solver_residual, projection_worst_rad, projection_rms_rad;
    float inverse_error_rad; /**< what the iterations of the inverse leave at most */
    uint32_t inverse_iterations;
} fxt_info;

/** Where the drive rests inside its play: all that must survive a reset. Its fields are nobody else's. Memory of zeros (static, {0}) is that
 * of fxt_play_unknown. */
typedef struct fxt_play {
    int64_t nominal;
    int32_t error;
    uint32_t lower, upper, half;
} fxt_play;

/** What the output is expected to do. */
typedef struct fxt_prediction {
    int64_t output, nominal;      /**< counts; nominal: generator over ratio */
    float transmission_error_rad; /**< actual less nominal; 0 when disabled */
    float uncertainty_rad;        /**< the error lies within this of it, as far as play and jumps go */
    fxt_quality quality;
} fxt_prediction;

/** What to command for a wanted output angle. */
typedef struct fxt_command {
    int64_t generator;
    float predicted_error_rad, uncertainty_rad;
    fxt_quality quality;
} fxt_command;

/** Checks an image in full and opens it; nothing of it is used before, and nothing is checked again after. A table that was refused answers
 * FXT_DISABLED to everything, as NULL does. */
fxt_verdict fxt_open(fxt_table *table, const void *image, size_t bytes);
/** "crc", "not increasing"; "torque nodes". */
const char *fxt_reason_name(fxt_reason reason);
const char *fxt_field_name(fxt_field field);
/** What the table is for; all zero for one that was refused. */
fxt_info fxt_tell(const fxt_table *table);
/** Whether one page of 256 bytes of the image still matches its checksum, and how many there are. The only function that sees that the memory
 * changed after fxt_open: a step with a changed table is wrong by some two error limits at most, in any quality. */
bool fxt_page_intact(const fxt_table *table, uint32_t page);
uint32_t fxt_page_count(const fxt_table *table);

/** After a reset: anywhere inside the play. After motion through all of it: on the side of that direction. */
fxt_play fxt_play_unknown(void);
fxt_play fxt_play_after(fxt_direction direction);
/** Whether the side is known, where the output was last, counts (false before the first step), and the middle of the play from it, rad. A NULL
 * play is one that is unknown. */
bool fxt_play_known(const fxt_play *play);
bool fxt_play_output(const fxt_play *play, int64_t *output);
float fxt_play_offset_rad(const fxt_play *play);
float fxt_play_uncertainty_rad(const fxt_play *play);
/** To bytes with a checksum for storage across a reset, the same as the core's, and back; false if they are damaged. Checked are the checksum
 * and that some play can have these numbers. Not checked: that it was saved with this table and this drive, and that nothing moved since.
 * That is yours to know; else start from fxt_play_unknown. A NULL play is saved as an unknown one; nothing is restored from or to NULL. */
void fxt_play_save(const fxt_play *play, uint8_t saved[FXT_SAVED_PLAY_BYTES]);
bool fxt_play_restore(fxt_play *play, const uint8_t saved[FXT_SAVED_PLAY_BYTES]);

/** The output at a generator angle. Call it once for every measured angle, in order: the play lives on the turning points. Here and below a NULL
 * play gives the angles of the ideal drive, FXT_DISABLED. */
fxt_prediction fxt_forward(const fxt_table *table, fxt_play *play, int64_t generator, float torque_n_m, float temperature_c);
/** The generator angle that brings the output to a target: in steady motion, or from where the drive rests now. As in the core it wraps beyond
 * 2^31 generator turns, whatever the quality says: keep targets within 2^31 turns over the ratio (some 2e7 turns at 100). */
fxt_command fxt_inverse(const fxt_table *table, int64_t target, float torque_n_m, float temperature_c, fxt_direction direction);
fxt_command fxt_inverse_from(const fxt_table *table, int64_t target, float torque_n_m, float temperature_c, const fxt_play *play);
/** Both in one: forward at the measured angle, then from there to the target. Torque and temperature are located once. An answer that is not
 * wanted may be NULL. */
void fxt_step(const fxt_table *table, fxt_play *play, int64_t measured, int64_t target, float torque_n_m, float temperature_c,
              fxt_prediction *prediction, fxt_command *command);
/** The transmission error in steady motion, rad; false if there is none, or no place for it. */
bool fxt_steady_error(const fxt_table *table, int64_t generator, float torque_n_m, float temperature_c, fxt_direction direction,
                      float *error_rad);

/** Radians to the nearest count, false beyond 2^31 turns and without a place for it; counts to radians. For start-up: double precision. */
bool fxt_from_rad(double rad, int64_t *counts);
double fxt_to_rad(int64_t counts);

#ifdef __cplusplus
}
#endif
#endif
