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
 *   // in the background, a page at a time: are the image and the fxt_table still what fxt_open left? nothing else finds all of that out
 *   if (!fxt_page_intact(&table, page++ % fxt_page_count(&table))) stop();
 *
 * A pointer that is NULL is refused: each function says how below. A table that was refused, or is NULL, knows no ratio: all its angles are 0.
 * A command of fxt_step has no limiter: from one tick to the next it moves as far as the correction does, the whole of it where the quality
 * becomes FXT_DISABLED. fxt_tick has one, with modes and what else a joint needs: see below.
 *
 * Angles are counts of 2^-32 turn in 64 bits: whole turns above, the fraction below. Positive is counter-clockwise; a positive torque turns
 * the output forward. Torque N*m, temperature degrees Celsius, errors rad at the output.
 *
 * Not in here, but in the core with its C interface (flexspline.h): two copies of the table compared in each tick, state that is whole after
 * an upset, learning, predictor, uploads, telemetry, the BLAKE3 of the table.
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

/** The format that is read, and no other; bytes of a page, and of a saved play. */
#define FXT_FORMAT_VERSION 3u
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
    FXT_IN_RANGE = 0, /**< torque and temperature in the range of the table, side of the play known. Not covered: output angles, or loads at an
                         angle, that were not recorded. The end of fxt_info.mesh_level (", turn ...") says the former, calibration.json both */
    FXT_UNCERTAIN,    /**< known to within the uncertainty only: inside a jump, or the side of the play is not known yet */
    FXT_EXTRAPOLATED, /**< torque or temperature outside the range of the table; the value at its edge is used */
    FXT_DISABLED      /* no correction: an input was not finite, a number from a changed image is beyond the limits of the table, or in the
                         fxt_table the ratio or the place of the image changed. Other changes are seen by fxt_page_intact alone */
} fxt_quality;

/** A direction of motion of the output. */
typedef enum fxt_direction { FXT_FORWARD = 0, FXT_BACKWARD } fxt_direction;

/** A ratio of tooth counts: a whole part and 64 fractional bits. */
typedef struct fxt_factor {
    uint64_t fraction;
    uint32_t whole, zero; /* no padding */
} fxt_factor;

/** Periods in an output turn: 32 whole and 32 fractional bits, and 32 more. */
typedef struct fxt_rate {
    uint64_t periods;
    uint32_t rest, zero; /* no padding */
} fxt_rate;

/** A table that passed every check. Made by fxt_open alone; its fields are nobody else's. The image must stay where it is. */
typedef struct fxt_table {
    fxt_factor to_output, to_generator;
    fxt_rate generator_rate, tooth_rate;
    uint32_t bytes, body_bytes;
    uint32_t ripple_order, reversed;
    float cell_width;
    int32_t ripple_cells, limit, hold;
    uint32_t ripple_nodes, ripple_unit, iterations;
    uint32_t curves[3];
    /* Bounds found while the image was checked: error rad, of the periodic parts rad, slope, of the curves, cells, rounding rad. */
    float bounds[6];
    float inverse_error_rad;
    uint32_t ratio_sum; /* of what turns counts of one shaft into counts of the other; each call looks at it */
    uint32_t sum;       /* CRC-32 of all above, which has no padding; the image stands here twice instead */
    const uint8_t *image, *again;
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
    float uncertainty_rad;        /**< the error lies within this of it, as far as play and jumps go: 0 is not that the table is exact */
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
/** Whether the fxt_table is what fxt_open left, and one page of 256 bytes of the image still matches its checksum; and how many pages there are:
 * one, which is not intact, where the fxt_table changed, was refused or is NULL. The only function that sees each change: a step with a changed image
 * or fxt_table is wrong by some two error limits at most, in any quality. Where more would be, as the ratio or the place of the image in the
 * fxt_table changed, each function takes it as refused. */
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

/* A joint: a step for every tick, with a limiter, modes and what is to be done where a sample, a tick or an answer is missing. At
 * every temperature all bits are those of the core's `Joint` to which nothing is added.
 *
 *   static fxt_table table;
 *   static fxt_joint joint;
 *   static fxt_encoder encoder;
 *   static const fxt_limits limits = {.tick_s = 1e-3f, .rate_rad_s = 0.05f, .acceleration_rad_s2 = 5.0f,
 *                                     .generator_rate_rad_s = 600.0f, .patience = 5};
 *   if (fxt_open(&table, image, sizeof image).reason != FXT_OK || fxt_joint_init(&joint, &limits) != FXT_LIMITS_OK ||
 *       !fxt_encoder_init(&encoder, 65536, 16, false, 0) || !fxt_joint_request(&joint, FXT_TRACKING)) stop();
 *   // every tick:
 *   fxt_input in = {.target = wanted, .torque_n_m = torque_n_m, .temperature_c = temperature_c};
 *   in.has_generator = fxt_joint_read(&joint, &encoder, timer_register(), &in.generator);
 *   move_generator_to(fxt_tick(&table, &joint, &in).command);
 */

/** What a joint does with its correction. */
typedef enum fxt_mode {
    FXT_OFF = 0,  /**< none: it is taken back within the limits. The start */
    FXT_TRACKING, /**< it follows the table */
    FXT_HOLD,     /**< it stays as it is: also none, after it was withdrawn as none could be made for longer than patience */
    FXT_SAFE      /**< none, and none before FXT_OFF was asked for: after a fault */
} fxt_mode;

/** What a tick that came late does to the correction, but in FXT_OFF and FXT_SAFE, or where none could be made for longer than patience. */
typedef enum fxt_overrun {
    FXT_SKIP = 0,  /**< nothing more: the ticks missed are skipped */
    FXT_HOLD_LAST, /**< it stays as it is in this tick */
    FXT_FADE_OUT   /**< it fades to none within fade_ticks, however many of them come late, stays there for as many after the last late one, and
                    * comes back */
} fxt_overrun;

/** Limits of a joint, in units of its output and of seconds. */
typedef struct fxt_limits {
    float tick_s;               /**< time from tick to tick, 1e-7 to 1e3 s */
    float rate_rad_s;           /**< fastest correction: 1.8e-10 to 0.05 rad in a tick */
    float acceleration_rad_s2;  /**< largest acceleration of the correction, no less than 1.8e-10 rad in a tick more each tick; it brakes with half of that */
    float generator_rate_rad_s; /**< fastest generator: what moves faster from tick to tick, those missed counted, is a glitch; 1.5e-9 rad to half a
                                 * turn in a tick. Its acceleration: fxt_joint_limit_acceleration */
    float hold_rad;             /**< a target no further from the output is reached on the flank that bears already; 0: none; 1.5e-9 to 0.05 */
    uint16_t patience;          /**< ticks for which a glitch is not believed, and the last correction kept where none can be made */
    uint16_t fade_ticks;        /**< of FXT_FADE_OUT */
    fxt_overrun overrun;
} fxt_limits;

/** Which limit a joint cannot have: the first that is not finite or out of its range. */
typedef enum fxt_limit {
    FXT_LIMITS_OK = 0,
    FXT_TICK,
    FXT_RATE,
    FXT_ACCELERATION,
    FXT_GENERATOR_RATE,
    FXT_HOLD_RAD,
    FXT_OVERRUN_POLICY,
    FXT_NO_JOINT /**< the pointer to the joint is NULL */
} fxt_limit;

/** A joint: its limits, and what changes while it runs; one for each axis. Its fields are nobody else's, but for the play, which may be saved. Memory of zeros is no
 * joint: it corrects nothing. */
typedef struct fxt_joint {
    fxt_play play;
    int64_t generator;                                   /* the last sample that was believed */
    int32_t correction, goal, speed;                     /* eighths of a count */
    int32_t rate, acceleration, largest_move, hold;      /* eighths of a count in a tick, and more each tick; counts */
    int32_t largest_bend, spike;                         /* changes of the way from tick to tick: a glitch; an outlier to take back. Counts */
    int32_t step, bend;                                  /* way in the last tick, and how much longer it was than in the one before */
    int32_t without[2];                                  /* bounds of the play as if the last sample had not moved it */
    float fade_step, tick_s;
    uint32_t fading, missed_ticks;
    uint16_t glitches, uncorrected, patience, fade;
    uint16_t unseen;                                     /* ticks since three samples in a row were believed */
    fxt_mode mode;
    uint8_t flank, flank_before, sampled, hold_late, in_a_row;
    uint8_t gap;                                         /* ticks in a row without a sample, those missed among them; up to 15 */
} fxt_joint;

/** One tick's measurements. */
typedef struct fxt_input {
    int64_t generator, target;        /**< counts: the measured generator angle; where the output shall be */
    float torque_n_m, temperature_c;
    uint16_t missed_ticks;            /**< since the last call */
    bool has_generator;               /**< false where there is no sample in this tick */
} fxt_input;

/** What happened in a tick: bits of fxt_output.flags, those of the core. */
typedef enum fxt_flag {
    FXT_SAMPLE_LOST = 1,
    FXT_GLITCH = 2,         /**< the sample was not believed; or the one before was wrong, and what it did to the play is taken back */
    FXT_LATE = 4,           /**< ticks were missed */
    FXT_HELD_BACK = 8,      /**< the correction is not what the table wants: limiter, mode or overrun policy hold it back */
    FXT_NOT_CORRECTED = 16, /**< no correction could be made; the last one is kept or fades out */
    FXT_NO_JOINT_OR_TABLE = 128, /**< the joint was not made or the table was refused; do not follow the command (fxt_tick) */
    FXT_IN_SAFE_MODE = 256
} fxt_flag;

/** One tick's results. */
typedef struct fxt_output {
    int64_t command, output;      /**< counts: the generator angle to command, which leaps where the target leaps; where the output is */
    float transmission_error_rad; /**< now: output less the nominal one; 0 without a usable torque, temperature or table; before the first
                                   * sample that of generator angle 0, known to uncertainty_rad */
    float uncertainty_rad;        /**< it lies within this of it, as far as play and jumps go, corrected or not; without a sample that is believed
                                   * in this tick no less than the table's limit and the error told */
    float correction_rad;         /**< in the command: target less command over ratio */
    float held_back_rad;          /**< what it lacks of what the table wants: by limiter, mode or overrun policy */
    fxt_quality quality;
    uint32_t flags;
} fxt_output;

/** Makes a joint: off, no correction, the side of the play unknown. One that is refused corrects nothing. NULL limits are refused. */
fxt_limit fxt_joint_init(fxt_joint *joint, const fxt_limits *limits);
/** Limits the acceleration of the generator, rad/s^2: a sample that would need more is a glitch, and one that is out and back within two ticks is
 * taken back. A multiple of what motor and load can do; no less than hold_rad allows for noise. Without this call a sample may need full speed
 * in one tick, and one that is out and back a 64th of that in each. False, and nothing changes, if it is not finite, or below 1.5e-9 rad in a
 * tick more each tick, or the joint was not made. */
bool fxt_joint_limit_acceleration(fxt_joint *joint, float rad_s2);
/** Changes the mode from the next tick on; false, and nothing changes, if it may not follow: everything may stop, tracking starts from off or
 * hold, hold only from tracking, and safe is left to off alone. One that was not made is in FXT_SAFE. */
bool fxt_joint_request(fxt_joint *joint, fxt_mode mode);
fxt_mode fxt_joint_mode(const fxt_joint *joint);
/** Which side of the play the drive rests on is not known any more, as after work on it. */
void fxt_joint_forget_side(fxt_joint *joint);
/** One tick: in the order of its calls the play follows the generator. The command is the target times the ratio less a correction. The correction
 * moves within rate and acceleration, and stays within the error limit of the table (times 1.001, and 16 counts), whatever the input is: but at
 * that limit it stops at once, and after a table of a larger limit it first comes back. The target is taken as it is: where it leaps the command
 * leaps, without a flag, so its rate is yours to limit. Without a joint, a table or an input (FXT_NO_JOINT_OR_TABLE) the command is the sample of
 * the input, not judged; without one the last that was believed; 0 if there was none: do not follow it. It does not see each change of the memory
 * of the table (fxt_page_intact), and none of that of the joint. */
fxt_output fxt_tick(const fxt_table *table, fxt_joint *joint, const fxt_input *input);

/** An encoder and where it is, one for each axis: from its register to an angle and back, as the core's; nothing drifts, also where the counts in a turn are no power
 * of two. Its fields are nobody else's; memory of zeros is none. */
typedef struct fxt_encoder {
    uint64_t reading;
    int64_t since_zero, zero_counts;
    uint32_t counts_per_turn;
    uint8_t wrap_bits, reversed, started;
} fxt_encoder;

/** counts_per_turn: 2 to 2^31, four times the lines of an incremental one. wrap_bits: the register begins anew after 2^wrap_bits counts, 1 to 64 (a
 * signed one is taken by its bits); 0: after each turn. reversed: it counts up where the angle falls. zero_counts: what it reads at the angle 0,
 * -2^62 to 2^62. False, and no encoder, if one is out of its range. */
bool fxt_encoder_init(fxt_encoder *encoder, uint32_t counts_per_turn, uint8_t wrap_bits, bool reversed, int64_t zero_counts);
/** The first reading after a reset, to be called before any other: of all angles with this reading the one nearest to near_counts (2^-32 turn), one
 * that was saved. Without this call the first reading is taken nearest to 0: off by whole turns of the register where the generator is not there,
 * and no flag says so. False if the register cannot read that. */
bool fxt_encoder_start(fxt_encoder *encoder, uint64_t reading, int64_t near_counts);
/** Takes a reading of the encoder of a joint's generator and gives the angle for the next tick, counts of 2^-32 turn, to the nearest. A reading
 * that the tick does not believe (FXT_GLITCH) moves no turn: one that is further from the one before than a tick allows is taken from the angle
 * that was believed last, for N ticks; in N + 2 the generator cannot make half of what the register counts. So the turns are right as soon as the
 * readings are, if no more than N - 1 in a row were wrong: 3 where a register of one turn is read a thousand times a second at 500 rad/s. After
 * more the encoder is lost (fxt_encoder_is_lost): call fxt_encoder_start with what is known otherwise. Wrong readings that agree with each other
 * for longer than patience, or until the generator could have got there, are believed, as nothing tells them from motion: then, too, start it
 * anew. A tick that is missed counts as one of the N at this call, as two at later ones. False, and nothing else changes: the encoder is lost; the register cannot read that; there is no joint or no
 * encoder; or generator_rate_rad_s allows a sixth of what the register counts in a tick, so that motion hides a wrong bit. Give the tick no
 * sample then. */
bool fxt_joint_read(const fxt_joint *joint, fxt_encoder *encoder, uint64_t reading, int64_t *angle);
/** Whether nothing shows any more which turn the encoder is in, or it is none: start it anew. */
bool fxt_encoder_is_lost(const fxt_encoder *encoder);
/** The same for an encoder that no joint judges. Between two readings it moves by less than half of what the register counts; one wrong reading
 * half of that away moves it by all that the register counts, for good. False, and nothing changes, if the register cannot read that. */
bool fxt_encoder_read(fxt_encoder *encoder, uint64_t reading, int64_t *angle);
/** What the register reads at an angle, to the nearest count: for a drive that is commanded in counts of its encoder. 0 without an encoder. */
uint64_t fxt_encoder_reading(const fxt_encoder *encoder, int64_t angle);

/** Radians to the nearest count, false beyond 2^31 turns and without a place for it; counts to radians. For start-up: double precision. */
bool fxt_from_rad(double rad, int64_t *counts);
double fxt_to_rad(int64_t counts);

#ifdef __cplusplus
}
#endif
#endif
