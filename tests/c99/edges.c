/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * The edges of the reader in C99 that tables and hostile images of the core seldom come to: each side of each condition, by images that are
 * written here, and by calls of joints and encoders. 0 if each is answered as flexspline_table.h says. */
#include "flexspline_table.h"

#include <fenv.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef __SSE__
#include <xmmintrin.h>
#endif

#define EXPECT(true_is)                                          \
    do {                                                         \
        if (!(true_is)) {                                        \
            printf("line %d: not so: %s\n", __LINE__, #true_is); \
            return 1;                                            \
        }                                                        \
    } while (0)

#define COUNTS_PER_RAD (4294967296.0 / 6.283185307179586)
#define MOST_TORQUES 64u
#define MOST_BYTES 8192u

/* A table without ripple, with one temperature. */
typedef struct {
    uint32_t torques;
    float torque[MOST_TORQUES], mean[MOST_TORQUES], half[MOST_TORQUES];
    uint8_t image[MOST_BYTES];
    uint32_t bytes;
} made;

static void put(made *of, uint32_t word, uint32_t value)
{
    for (uint32_t i = 0; i < 4u; i++)
        of->image[4u * word + i] = (uint8_t)(value >> 8u * i);
}

static void put_number(made *of, uint32_t word, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(of, word, bits);
}

static uint32_t crc(const uint8_t *bytes, uint32_t count)
{
    uint32_t sum = 0xffffffffu;
    for (uint32_t i = 0; i < count; i++) {
        sum ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            sum = sum >> 1 ^ ((sum & 1u) != 0u ? 0xedb88320u : 0u);
    }
    return ~sum;
}

/* The checksums of pages and of all, over whatever stands there. */
static void seal_body(made *of, uint32_t body)
{
    const uint32_t pages = (body + 255u) / 256u;
    of->bytes = body + 4u * (pages + 1u);
    put(of, 3, of->bytes);
    for (uint32_t page = 0; page < pages; page++)
        put(of, body / 4u + page, crc(of->image + 256u * page, body - 256u * page < 256u ? body - 256u * page : 256u));
    put(of, of->bytes / 4u - 1u, crc(of->image, of->bytes - 4u));
}

static void seal(made *of)
{
    seal_body(of, 4u * (136u + 3u * (of->torques > 1u ? of->torques : 2u)));
}

static void write_image(made *of)
{
    static const uint8_t start[12] = {0x89, 'F', 'X', 'T', 0x0d, 0x0a, 0x1a, 0x0a, 3, 0, 0xff, 0xfe};
    const uint32_t last = of->torques > 2u ? of->torques - 2u : 0u, slots = of->torques > 1u ? of->torques : 2u;
    const float limit = 0.01f;
    memset(of->image, 0, sizeof of->image);
    memcpy(of->image, start, sizeof start);
    memcpy(of->image + 56, "edges", 5);
    of->image[106] = 188;
    of->image[108] = 190;
    of->image[110] = (uint8_t)of->torques;
    of->image[111] = 1;
    put(of, 30, (uint32_t)((double)limit * COUNTS_PER_RAD * 1.001 + 16.0));
    put_number(of, 34, of->torque[0]);
    put_number(of, 35, of->torque[of->torques - 1u]);
    put_number(of, 36, 20.0f);
    put_number(of, 37, 20.0f);
    put_number(of, 38, limit);
    put_number(of, 39, 1.0f);
    put(of, 40, last);
    put(of, 41, 136);
    put(of, 42, 136u + 3u * slots);
    for (uint32_t curve = 0; curve < 3u; curve++)
        put(of, 44u + curve, 136);
    put(of, 47, 1);
    put(of, 48, 8);
    put(of, 49, 136u + 3u * slots);
    for (uint32_t i = 0; i < 72u; i++)
        put_number(of, 64u + i, FLT_MAX);
    put_number(of, 128, 20.0f);
    for (uint32_t i = 0; i < slots; i++) {
        const uint32_t node = i < of->torques ? i : 0u;
        put_number(of, 64u + i, i < of->torques ? of->torque[i] : FLT_MAX);
        put_number(of, 136u + 3u * i, of->mean[node]);
        put_number(of, 138u + 3u * i, of->half[node]);
    }
    seal(of);
}

/* Half a milliradian of play, errors of a stiffness of 1e5 N*m/rad. */
static made plain(void)
{
    static const float torques[3] = {-8.0f, 0.0f, 8.0f};
    static made of;
    of.torques = 3;
    for (uint32_t i = 0; i < 3u; i++) {
        of.torque[i] = torques[i];
        of.mean[i] = (float)((double)torques[i] * 1e-5 * COUNTS_PER_RAD);
        of.half[i] = 341782.0f;
    }
    write_image(&of);
    return of;
}

static fxt_verdict verdict_of(const made *of)
{
    fxt_table table;
    return fxt_open(&table, of->image, of->bytes);
}

/* One byte or word of a sound image is another, under right checksums. */
static fxt_verdict with_byte(uint32_t at, uint8_t value)
{
    made of = plain();
    of.image[at] = value;
    seal(&of);
    return verdict_of(&of);
}

static fxt_verdict with_word(uint32_t at, uint32_t value)
{
    made of = plain();
    put(&of, at, value);
    seal(&of);
    return verdict_of(&of);
}

static fxt_verdict with_number(uint32_t at, float value)
{
    made of = plain();
    put_number(&of, at, value);
    seal(&of);
    return verdict_of(&of);
}

/* A curve over a turn that does not end where it begins. */
static int curves(void)
{
    static made of;
    FILE *file = fopen("core/src/fixtures/long.fxt", "rb");
    EXPECT(file != NULL);
    of.bytes = (uint32_t)fread(of.image, 1, sizeof of.image, file);
    (void)fclose(file);
    EXPECT(verdict_of(&of).reason == FXT_OK);
    const uint32_t at = of.image[176] + 256u * of.image[177], body = 4u * (of.image[196] + 256u * of.image[197]);
    of.image[4u * at] ^= 1u;
    seal_body(&of, body);
    EXPECT(verdict_of(&of).reason == FXT_NOT_CLOSED && verdict_of(&of).field == FXT_GENERATOR_CURVE);
    return 0;
}

static int images(void)
{
    made of = plain();
    fxt_table table;
    EXPECT(verdict_of(&of).reason == FXT_OK);
    EXPECT(fxt_open(&table, NULL, 5000).reason == FXT_TOO_SHORT);
    EXPECT(fxt_open(&table, of.image, 583).reason == FXT_TOO_SHORT);
    /* All 24 bytes of a text in use; what is not printable, or comes after its end. */
    memset(of.image + 80, 'm', 24);
    seal(&of);
    EXPECT(verdict_of(&of).reason == FXT_OK);
    EXPECT(with_byte(56, 0x7f).field == FXT_TOOL_VERSION && with_byte(82, 'm').field == FXT_MESH_LEVEL);
    EXPECT(with_byte(57, 0x1f).reason == FXT_TEXT);
    /* Counts, on either side of what may be. */
    static const struct {
        uint8_t at, value;
        fxt_field field;
    } counts[] = {{110, 0, FXT_TORQUE_NODES},     {110, 65, FXT_TORQUE_NODES},      {111, 0, FXT_TEMPERATURE_NODES}, {111, 9, FXT_TEMPERATURE_NODES},
                  {112, 3, FXT_RIPPLE_NODES},     {112, 33, FXT_RIPPLE_NODES},      {113, 3, FXT_GENERATOR_CURVE},   {113, 129, FXT_GENERATOR_CURVE},
                  {114, 3, FXT_MATERIAL_CURVE},   {115, 129, FXT_OUTPUT_CURVE}};
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
        const fxt_verdict found = with_byte(counts[i].at, counts[i].value);
        EXPECT(found.reason == FXT_COUNT && found.field == counts[i].field && found.index == counts[i].value);
    }
    EXPECT(with_byte(112, 8).reason == FXT_SIZE && with_byte(111, 2).reason == FXT_SIZE);
    /* Words that follow from others. */
    static const uint8_t derived[] = {30, 39, 40, 41, 42, 43, 44, 45, 46, 47, 48, 49};
    for (size_t i = 0; i < sizeof derived; i++) {
        const fxt_verdict found = with_word(derived[i], 77);
        EXPECT(found.reason == FXT_DERIVED && found.index == 4u * derived[i]);
    }
    /* Numbers of the header. */
    EXPECT(with_number(34, -9.0f).field == FXT_TORQUE_RANGE && with_number(35, 9.0f).field == FXT_TORQUE_RANGE);
    EXPECT(with_number(37, 19.0f).field == FXT_TEMPERATURE_RANGE && with_number(36, -2e6f).field == FXT_TEMPERATURE_RANGE);
    EXPECT(with_number(31, -1.0f).field == FXT_SOLVER_RESIDUAL && with_number(32, 0.06f).field == FXT_PROJECTION_WORST);
    EXPECT(with_number(33, 1e-6f).field == FXT_PROJECTION_RMS && with_number(31, NAN).reason == FXT_NOT_FINITE);
    EXPECT(with_number(38, 0.06f).field == FXT_ERROR_LIMIT);
    /* Three jumps; the middle one is no interval in which the drive may let go. */
    static const float torques[8] = {-8.0f, -2.0f, -1.9f, -0.05f, 0.05f, 1.9f, 2.0f, 8.0f};
    const float odd = 1.0f + FLT_EPSILON;
    of.torques = 8;
    for (uint32_t i = 0; i < 8u; i++) {
        of.torque[i] = torques[i];
        of.mean[i] = (float)((double)torques[i] * 1e-5 * COUNTS_PER_RAD);
        of.half[i] = i == 1u || i == 3u || i == 5u ? odd : 1.0f;
    }
    write_image(&of);
    EXPECT(verdict_of(&of).reason == FXT_OK);
    /* It falls in an interval between jumps by half a pitch, and not in a jump. */
    of.mean[3] = of.mean[2] - (float)(5e-3 * COUNTS_PER_RAD);
    write_image(&of);
    EXPECT(verdict_of(&of).reason != FXT_FALLS || verdict_of(&of).index != 3u);
    of.mean[3] = of.mean[2];
    of.mean[4] = of.mean[3] - (float)(1e-4 * COUNTS_PER_RAD);
    write_image(&of);
    EXPECT(verdict_of(&of).reason == FXT_FALLS && verdict_of(&of).index == 4u);
    /* One torque has no slope. */
    of.torques = 1;
    write_image(&of);
    EXPECT(verdict_of(&of).reason == FXT_OK);
    put_number(&of, 137, 1.0f);
    put_number(&of, 140, 1.0f);
    seal(&of);
    EXPECT(verdict_of(&of).reason == FXT_OUT_OF_RANGE && verdict_of(&of).field == FXT_MEAN_SLOPE);
    return curves();
}

/* A processor that rounds otherwise, or takes small numbers for zero, has other bits: nothing is opened. */
static int arithmetic(void)
{
    static const int otherwise[3] = {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO};
    const made of = plain();
    for (int i = 0; i < 3; i++) {
        EXPECT(fesetround(otherwise[i]) == 0);
        const fxt_verdict found = verdict_of(&of);
        (void)fesetround(FE_TONEAREST);
        EXPECT(found.reason == FXT_ARITHMETIC);
    }
#ifdef __SSE__
    _mm_setcsr(_mm_getcsr() | 0x8000u);
    const fxt_verdict found = verdict_of(&of);
    _mm_setcsr(_mm_getcsr() & ~0x8000u);
    EXPECT(found.reason == FXT_ARITHMETIC);
#endif
    EXPECT(verdict_of(&of).reason == FXT_OK);
    return 0;
}

/* Of a play whose memory changed, and of one that is fresh: which is restored. */
static bool restored(int32_t error, int32_t lower, int32_t upper, int32_t half)
{
    const uint32_t words[4] = {(uint32_t)error, (uint32_t)lower, (uint32_t)upper, (uint32_t)half};
    uint8_t saved[FXT_SAVED_PLAY_BYTES] = {0};
    for (uint32_t i = 0; i < 16u; i++)
        saved[8u + i] = (uint8_t)(words[i / 4u] >> 8u * (i % 4u));
    const uint32_t sum = crc(saved, 24);
    for (uint32_t i = 0; i < 4u; i++)
        saved[24u + i] = (uint8_t)(sum >> 8u * i);
    fxt_play play;
    return fxt_play_restore(&play, saved);
}

static int plays(void)
{
    EXPECT(restored(0, INT32_MIN, INT32_MAX, -1) && restored(0, INT32_MAX, INT32_MAX, -1) && restored(5, -9, 9, 9));
    EXPECT(!restored(0, 0, 0, -1) && !restored(0, INT32_MIN, INT32_MAX, -2) && !restored(0, INT32_MIN, INT32_MAX, 9));
    EXPECT(!restored(0, 9, 8, 9) && !restored(0, -10, 9, 9) && !restored(0, -9, 10, 9) && !restored(0, 0, 0, INT32_MAX));
    EXPECT(!restored(INT32_MAX, 0, 0, 9) && !restored(INT32_MIN, 0, 0, 9));
    return 0;
}

/* Memory of an image that changes after its check: no answer beyond the limit on either side of the play. */
static int changed(void)
{
    static const double sides[4][2] = {{0.007, 0.007}, {-0.007, 0.007}, {0.007, -0.007}, {0.02, 0.0}};
    made of = plain();
    fxt_table table;
    float error;
    EXPECT(fxt_open(&table, of.image, of.bytes).reason == FXT_OK);
    EXPECT(fxt_steady_error(&table, 5, 1.0f, 20.0f, FXT_FORWARD, &error) && !fxt_steady_error(&table, 5, NAN, 20.0f, FXT_FORWARD, &error));
    EXPECT(!fxt_steady_error(&table, 5, 1.0f, INFINITY, FXT_BACKWARD, &error));
    for (int i = 0; i < 4; i++) {
        const fxt_play play = fxt_play_unknown();
        for (uint32_t node = 0; node < 3u; node++) {
            put_number(&of, 136u + 3u * node, (float)(sides[i][0] * COUNTS_PER_RAD));
            put_number(&of, 138u + 3u * node, (float)(sides[i][1] * COUNTS_PER_RAD));
        }
        EXPECT(fxt_inverse_from(&table, 1000, 0.0f, 20.0f, &play).quality == FXT_DISABLED);
        EXPECT(i == 2 || !fxt_steady_error(&table, 5, 1.0f, 20.0f, FXT_FORWARD, &error));
    }
    EXPECT(!fxt_page_intact(&table, 2));
    return 0;
}

static const fxt_limits usual = {.tick_s = 1e-3f, .rate_rad_s = 0.05f, .acceleration_rad_s2 = 5.0f, .generator_rate_rad_s = 600.0f, .patience = 5};

static int joints(void)
{
    static const float odd[4] = {0.0f, -1.0f, NAN, 1e-40f};
    const made of = plain();
    fxt_table table, refused;
    fxt_joint joint;
    EXPECT(fxt_open(&table, of.image, of.bytes).reason == FXT_OK && fxt_open(&refused, of.image, 600).reason == FXT_LENGTH);
    EXPECT(fxt_joint_init(NULL, &usual) == FXT_NO_JOINT && fxt_joint_init(&joint, NULL) == FXT_TICK);
    /* Each limit on either side of its range; what is refused is no joint. */
    for (int i = 0; i < 4; i++) {
        fxt_limits limits = usual;
        limits.tick_s = odd[i];
        EXPECT(fxt_joint_init(&joint, &limits) == FXT_TICK && !fxt_joint_request(&joint, FXT_OFF));
        limits = usual;
        limits.rate_rad_s = odd[i];
        EXPECT(fxt_joint_init(&joint, &limits) == FXT_RATE && fxt_joint_mode(&joint) == FXT_SAFE);
        limits = usual;
        limits.acceleration_rad_s2 = odd[i];
        EXPECT(fxt_joint_init(&joint, &limits) == FXT_ACCELERATION);
        limits = usual;
        limits.generator_rate_rad_s = odd[i];
        EXPECT(fxt_joint_init(&joint, &limits) == FXT_GENERATOR_RATE);
        limits = usual;
        limits.hold_rad = odd[i];
        EXPECT(fxt_joint_init(&joint, &limits) == (i == 0 ? FXT_LIMITS_OK : FXT_HOLD_RAD));
    }
    fxt_limits limits = usual;
    limits.tick_s = 2e3f;
    EXPECT(fxt_joint_init(&joint, &limits) == FXT_TICK);
    limits.tick_s = 1e-3f;
    limits.rate_rad_s = 50.1f;
    EXPECT(fxt_joint_init(&joint, &limits) == FXT_RATE);
    limits.rate_rad_s = 49.9f;
    limits.acceleration_rad_s2 = 1e8f;
    limits.patience = UINT16_MAX;
    EXPECT(fxt_joint_init(&joint, &limits) == FXT_LIMITS_OK && joint.patience == UINT16_MAX - 1);
    limits.overrun = (fxt_overrun)3;
    EXPECT(fxt_joint_init(&joint, &limits) == FXT_OVERRUN_POLICY);
    /* Without joint, input or table: where the generator is. */
    const fxt_input input = {77, 5, 0.0f, 20.0f, 0, true};
    fxt_input blind = input;
    blind.has_generator = false;
    EXPECT(fxt_tick(&table, NULL, &input).command == 77 && fxt_tick(&table, NULL, NULL).command == 0);
    EXPECT(fxt_joint_mode(NULL) == FXT_SAFE && !fxt_joint_request(NULL, FXT_OFF));
    fxt_joint_forget_side(NULL);
    EXPECT(fxt_joint_init(&joint, &usual) == FXT_LIMITS_OK && fxt_joint_request(&joint, FXT_TRACKING));
    fxt_output out = fxt_tick(&table, &joint, &blind);
    EXPECT((out.flags & FXT_NOT_CORRECTED) != 0u && !joint.sampled);
    (void)fxt_tick(&table, &joint, &input);
    EXPECT(fxt_tick(&table, &joint, NULL).command == 77 && fxt_tick(&refused, &joint, &blind).command == 77);
    out = fxt_tick(NULL, &joint, &input);
    EXPECT(out.command == 77 && out.quality == FXT_DISABLED && out.flags == ((uint32_t)FXT_NOT_CORRECTED | FXT_NO_JOINT_OR_TABLE));
    /* A sample that is not there: the last that was believed, and 0 where none was. */
    const fxt_input dark = {0, 0, 1.0f, 20.0f, 0, false};
    joint.generator = 55;
    EXPECT(fxt_tick(&refused, &joint, &dark).command == 55 && fxt_tick(&table, NULL, &dark).command == 0);
    joint.generator = 0;
    EXPECT(fxt_tick(&refused, &joint, &dark).command == 0);
    /* A target that leaps leaps in the command; the correction does not. */
    static fxt_joint leaping;
    EXPECT(fxt_joint_init(&leaping, &usual) == FXT_LIMITS_OK && fxt_joint_request(&leaping, FXT_TRACKING));
    fxt_input leap = {0, 0, 8.0f, 20.0f, 0, true};
    const int64_t stands = fxt_tick(&table, &leaping, &leap).command;
    leap.target = INT64_C(1) << 30;
    const fxt_output leapt = fxt_tick(&table, &leaping, &leap);
    EXPECT(leapt.command - stands > INT64_C(90) << 30 && fabsf(leapt.correction_rad) <= 5.0e-5f);
    /* Not seen, or not corrected: told as such. */
    fxt_output told = {0};
    for (int tick = 0; tick < 900; tick++) {
        leap.generator += 1 << 20;
        leap.target = leap.generator / 95;
        told = fxt_tick(&table, &leaping, &leap);
    }
    EXPECT(told.quality == FXT_IN_RANGE && told.flags == 0u && told.uncertainty_rad < 1e-6f);
    const float lacks = told.correction_rad, limit = fxt_tell(&table).error_limit_rad;
    leap.has_generator = false;
    told = fxt_tick(&table, &leaping, &leap);
    EXPECT(told.quality == FXT_UNCERTAIN && told.uncertainty_rad >= 0.999f * (limit + fabsf(told.transmission_error_rad)));
    leap.has_generator = true;
    leap.generator += INT64_C(1) << 31;
    told = fxt_tick(&table, &leaping, &leap);
    EXPECT(told.flags == (uint32_t)FXT_GLITCH && told.quality == FXT_UNCERTAIN && told.uncertainty_rad >= 0.999f * limit);
    leap.generator -= INT64_C(1) << 31;
    EXPECT(fxt_joint_request(&leaping, FXT_OFF));
    for (int tick = 0; tick < 400; tick++)
        told = fxt_tick(&table, &leaping, &leap);
    EXPECT(told.correction_rad == 0.0f && (told.flags & FXT_HELD_BACK) != 0u && fabsf(told.held_back_rad - lacks) < 1e-6f);
    /* Memory of zeros, and memory that changed, is no joint. */
    static fxt_joint zeros;
    EXPECT(fxt_tick(&table, &zeros, &input).command == 77 && fxt_joint_mode(&zeros) == FXT_SAFE);
    for (int i = 0; i < 4; i++) {
        fxt_joint other = joint;
        other.rate = i == 0 ? 0 : i == 1 ? INT32_MAX : joint.rate;
        other.acceleration = i == 2 ? 0 : i == 3 ? INT32_MAX : joint.acceleration;
        EXPECT(fxt_tick(&table, &other, &input).quality == FXT_DISABLED);
    }
    /* Each mode after each. */
    static const char may[4][5] = {"yyny", "yyyy", "yyyy", "ynny"};
    for (int from = 0; from < 4; from++) {
        for (int to = 0; to < 6; to++) {
            joint.mode = (fxt_mode)from;
            EXPECT(fxt_joint_request(&joint, (fxt_mode)to) == (to < 4 && may[from][to] == 'y'));
            EXPECT(fxt_joint_mode(&joint) == (fxt_mode)(to < 4 && may[from][to] == 'y' ? to : from));
        }
    }
    /* A temperature that is no number: the last correction for as long as patience lasts, then none, and never a leap. */
    EXPECT(fxt_joint_init(&joint, &usual) == FXT_LIMITS_OK && fxt_joint_request(&joint, FXT_TRACKING));
    fxt_input moving = {0, 0, 8.0f, 20.0f, 0, true};
    float before = 0.0f, most = 0.0f;
    for (int tick = 0; tick < 400; tick++) {
        moving.generator += 1 << 20;
        moving.target = moving.generator / 95;
        moving.temperature_c = tick < 200 ? 20.0f : NAN;
        out = fxt_tick(&table, &joint, &moving);
        EXPECT(fabsf(out.correction_rad - before) <= 5.0e-5f && (tick < 200) == (out.quality != FXT_DISABLED));
        EXPECT(tick < 200 || tick > 204 || out.correction_rad == most);
        before = out.correction_rad;
        most = tick < 200 ? out.correction_rad : most;
    }
    EXPECT(fabsf(most) > 4e-5f && out.correction_rad == 0.0f);
    /* A correction beyond the limit of the table, as after one with a larger limit: it comes back and goes no further out. */
    for (int side = -1; side <= 1; side += 2) {
        joint.correction = side * 200000000;
        joint.speed = side * joint.rate;
        (void)fxt_tick(&table, &joint, &input);
        EXPECT(joint.correction == side * 200000000 && joint.speed == 0);
        (void)fxt_tick(&table, &joint, &input);
        EXPECT(joint.correction * side < 200000000 && joint.correction * side > 199000000);
    }
    return 0;
}

/* Each bit of a reading wrong once, everywhere in the register and at every speed within the limit: what moves half of the register is not
 * believed, and the turns are right with the next reading. An encoder alone loses them. */
static int wrong_bits(void)
{
    const made of = plain();
    const int64_t fastest = INT64_C(410000000);
    fxt_table table;
    int lost = 0;
    EXPECT(fxt_open(&table, of.image, of.bytes).reason == FXT_OK);
    for (int64_t i = 0; i < 16 * 16 * 9; i++) {
        const int64_t bit = i % 16, start = (INT64_C(3) << 32) + i / 16 % 16 * (INT64_C(3) << 27), speed = (i / 256 - 4) * (fastest / 4);
        fxt_joint joint;
        fxt_encoder judged, alone;
        int64_t now = 0, other = 0, last = start;
        EXPECT(fxt_joint_init(&joint, &usual) == FXT_LIMITS_OK && fxt_encoder_init(&judged, 65536, 16, false, 77));
        EXPECT(fxt_encoder_start(&judged, fxt_encoder_reading(&judged, start), start));
        alone = judged;
        for (int tick = 0; tick < 14; tick++) {
            last = start + tick * speed;
            const uint64_t good = fxt_encoder_reading(&judged, last), reading = tick == 4 ? good ^ (uint64_t)1 << bit : good;
            fxt_input input = {0, 0, 5.0f, 20.0f, 0, fxt_joint_read(&joint, &judged, reading, &now)};
            input.generator = now;
            EXPECT(input.has_generator && fxt_encoder_read(&alone, reading, &other) && (tick == 4 || llabs(now - last) <= 1 << 15));
            const fxt_output out = fxt_tick(&table, &joint, &input);
            const bool told = (out.flags & FXT_GLITCH) != 0u;
            EXPECT(told || llabs(joint.generator - last) <= 2 * fastest + (1 << 16));
            EXPECT(tick < 11 || (!told && joint.generator == now));
        }
        lost += llabs(other - last) > INT64_C(1) << 31;
    }
    printf("%d of 2304 wrong bits move an encoder alone by a turn, none one that is read for a joint\n", lost);
    EXPECT(lost > 0);
    return 0;
}

/* Ticks with the torque, late or not, of a joint that moves on: the last of them. */
static fxt_output ticks(const fxt_table *table, fxt_joint *joint, int number, float torque_n_m, bool late)
{
    fxt_output out = {0};
    for (int tick = 0; tick < number; tick++) {
        const int64_t generator = joint->generator + (1 << 20);
        const fxt_input input = {generator, generator / 95, torque_n_m, 20.0f, late ? 1 : 0, true};
        out = fxt_tick(table, joint, &input);
    }
    return out;
}

/* However many ticks come late: off, safe and a torque that is lost for good leave no correction, and a fade ends. What is late may be as far away as
 * the ticks since the last one allow. */
static int late_ticks(void)
{
    const made of = plain();
    fxt_table table;
    fxt_joint joint;
    EXPECT(fxt_open(&table, of.image, of.bytes).reason == FXT_OK);
    for (int i = 0; i < 3 * 2 * 2 * 3; i++) {
        fxt_limits limits = usual;
        const bool late = i / 3 % 2 == 1, holds = i / 6 % 2 == 1, lost = i / 12 == 2;
        limits.overrun = (fxt_overrun)(i % 3);
        limits.fade_ticks = 10;
        EXPECT(fxt_joint_init(&joint, &limits) == FXT_LIMITS_OK && fxt_joint_request(&joint, FXT_TRACKING));
        const fxt_output before = ticks(&table, &joint, 400, 8.0f, false);
        EXPECT(fabsf(before.correction_rad) > 4e-5f && before.flags == 0u);
        EXPECT(!holds || fxt_joint_request(&joint, FXT_HOLD));
        EXPECT(lost || fxt_joint_request(&joint, i / 12 == 0 ? FXT_OFF : FXT_SAFE));
        /* Kept for as long as patience lasts. */
        const fxt_output kept = ticks(&table, &joint, 5, lost ? NAN : 8.0f, late);
        EXPECT(!lost || kept.correction_rad == before.correction_rad || (late && limits.overrun == FXT_FADE_OUT));
        const fxt_output out = ticks(&table, &joint, 100, lost ? NAN : 8.0f, late);
        EXPECT(out.correction_rad == 0.0f && (lost || (out.flags & FXT_HELD_BACK) != 0u));
    }
    /* Late in each tick: down within the fade, none, and back after it. Late once while there is none: as long once more. */
    fxt_limits limits = usual;
    limits.overrun = FXT_FADE_OUT;
    limits.fade_ticks = 100;
    EXPECT(fxt_joint_init(&joint, &limits) == FXT_LIMITS_OK && fxt_joint_request(&joint, FXT_TRACKING));
    const fxt_output before = ticks(&table, &joint, 400, 8.0f, false);
    EXPECT(fabsf(ticks(&table, &joint, 50, 8.0f, true).correction_rad) < 0.6f * fabsf(before.correction_rad) && joint.fading == 151u);
    for (int i = 0; i < 200; i++)
        EXPECT(ticks(&table, &joint, 1, 8.0f, true).correction_rad == 0.0f || i < 70);
    EXPECT(ticks(&table, &joint, 99, 8.0f, false).correction_rad == 0.0f && joint.fading == 1u && joint.goal != 0);
    EXPECT(ticks(&table, &joint, 1, 8.0f, true).correction_rad == 0.0f && joint.fading == 100u);
    EXPECT(ticks(&table, &joint, 200, 8.0f, false).flags == 0u && joint.fading == 0u);
    /* On either side of what may be; a wrong one counts for more of the turns that an encoder can lose. */
    for (uint32_t missed = 0; missed <= UINT16_MAX; missed = missed * 5u + 1u) {
        for (int64_t more = 0; more < 2; more++) {
            EXPECT(fxt_joint_init(&joint, &usual) == FXT_LIMITS_OK);
            (void)ticks(&table, &joint, 3, 8.0f, false);
            EXPECT(joint.unseen == 0u);
            const int64_t way = (int64_t)joint.largest_move * (int64_t)(missed + 1u) + more;
            const fxt_input input = {joint.generator + way, 0, 8.0f, 20.0f, (uint16_t)missed, true};
            const fxt_output out = fxt_tick(&table, &joint, &input);
            EXPECT(((out.flags & FXT_GLITCH) != 0u) == (more == 1));
            EXPECT(joint.unseen == (missed < 32767u ? 2u * missed + 1u : UINT16_MAX) || (missed == 0u && more == 0));
        }
    }
    return 0;
}

/* The memory of a fxt_table, each bit of which changes: no page of it is intact, nothing is read beyond the image, and where a ratio changed nothing is
 * commanded. */
static int changed_table(void)
{
    /* In memory of its own, so that a sanitizer sees a reading beyond its end. */
    static uint8_t *image;
    const made of = plain();
    fxt_table table, other;
    image = malloc(of.bytes);
    EXPECT(image != NULL);
    memcpy(image, of.image, of.bytes);
    EXPECT(fxt_open(&table, image, of.bytes).reason == FXT_OK);
    for (size_t bit = 0; bit < 8u * sizeof table; bit++) {
        fxt_joint joint;
        other = table;
        ((uint8_t *)&other)[bit / 8u] ^= (uint8_t)(1u << bit % 8u);
        /* No field changed: it lies between those at the end. */
        if (memcmp(&other, &table, offsetof(fxt_table, sum)) == 0 && other.sum == table.sum && other.image == table.image && other.again == table.again)
            continue;
        EXPECT(fxt_page_count(&other) == 1u && !fxt_page_intact(&other, 0));
        EXPECT(fxt_joint_init(&joint, &usual) == FXT_LIMITS_OK && fxt_joint_request(&joint, FXT_TRACKING));
        const fxt_output out = ticks(&other, &joint, 9, 8.0f, false);
        const bool bounded = llabs(joint.generator - out.command) < INT64_C(95) * 2 * table.limit;
        EXPECT((out.flags & FXT_NO_JOINT_OR_TABLE) != 0u || bounded);
    }
    EXPECT(fxt_page_intact(&table, 0) && fxt_page_count(&table) == 3u && !fxt_page_intact(&table, 3));
    EXPECT(fxt_page_count(NULL) == 1u && fxt_open(&other, image, 600).reason == FXT_LENGTH && fxt_page_count(&other) == 1u);
    free(image);
    return 0;
}

/* A joint that follows a steady way, with one sample that is out: output and flags of a tick. */
static fxt_output steady(const fxt_table *table, fxt_joint *joint, int64_t tick, int64_t step, int64_t out)
{
    const fxt_input input = {tick * step + out, tick * step / 95, 5.0f, 20.0f, 0, true};
    return fxt_tick(table, joint, &input);
}

/* A lone wrong sample within the largest move is off in its tick; what it did to play and flank is taken back in the next. With the acceleration of
 * the generator it is not believed, and neither is one beyond it where samples are missing. */
static int outliers(void)
{
    static const float bad[5] = {0.0f, -1.0f, NAN, INFINITY, 1e-6f};
    static const int64_t sizes[3] = {1 << 24, -(1 << 24), 1 << 27};
    const made of = plain();
    fxt_table table;
    fxt_joint joint;
    EXPECT(fxt_open(&table, of.image, of.bytes).reason == FXT_OK && fxt_joint_init(&joint, &usual) == FXT_LIMITS_OK);
    for (int i = 0; i < 5; i++)
        EXPECT(!fxt_joint_limit_acceleration(&joint, bad[i]) && joint.largest_bend == joint.largest_move);
    EXPECT(!fxt_joint_limit_acceleration(NULL, 1e3f) && fxt_joint_limit_acceleration(&joint, FLT_MAX) && joint.spike == 2 * joint.largest_move);
    /* As much as the acceleration allows; one count more; of a brake, as in the core, two. */
    static const struct {
        int more;
        bool glitch;
    } counts[4] = {{0, false}, {1, true}, {-1, false}, {-2, true}};
    for (int i = 0; i < 4; i++) {
        EXPECT(fxt_joint_init(&joint, &usual) == FXT_LIMITS_OK && fxt_joint_limit_acceleration(&joint, 3e3f));
        for (int64_t tick = 0; tick < 3; tick++)
            (void)steady(&table, &joint, tick, 0, 0);
        const int64_t most = joint.largest_bend, step = counts[i].more < 0 ? counts[i].more - most : counts[i].more + most;
        EXPECT(((steady(&table, &joint, 3, 0, step).flags & FXT_GLITCH) != 0u) == counts[i].glitch);
    }
    for (int i = 0; i < 3 * 2; i++) {
        const bool limited = i % 2 == 1;
        EXPECT(fxt_joint_init(&joint, &usual) == FXT_LIMITS_OK && fxt_joint_request(&joint, FXT_TRACKING));
        EXPECT(!limited || fxt_joint_limit_acceleration(&joint, 3e3f));
        for (int64_t tick = 0; tick < 300; tick++)
            (void)steady(&table, &joint, tick, 1 << 20, 0);
        fxt_joint clean = joint;
        const fxt_output before = steady(&table, &clean, 300, 1 << 20, 0), wrong = steady(&table, &joint, 300, 1 << 20, sizes[i / 2]);
        EXPECT(before.flags == 0u && ((wrong.flags & FXT_GLITCH) != 0u) == limited);
        /* The largest reaches beyond the target, so that another flank bears. */
        EXPECT(limited || wrong.output != before.output);
        EXPECT((joint.flank == clean.flank) != (!limited && i / 2 == 2));
        const fxt_joint wronged = joint;
        const fxt_output next = steady(&table, &clean, 301, 1 << 20, 0), after = steady(&table, &joint, 301, 1 << 20, 0);
        EXPECT(after.output == next.output && after.uncertainty_rad == next.uncertainty_rad && joint.flank == clean.flank);
        EXPECT((after.flags & FXT_GLITCH) == (limited ? 0u : (uint32_t)FXT_GLITCH) && after.quality == FXT_IN_RANGE);
        /* A whole turn more than back is not back; nor is the way of a late tick. */
        fxt_joint turned = wronged, late = wronged;
        EXPECT((steady(&table, &turned, 301, 1 << 20, INT64_C(1) << 32).flags & FXT_GLITCH) != 0u && turned.generator == wronged.generator);
        const fxt_input missed = {301 << 20, (301 << 20) / 95, 5.0f, 20.0f, 1, true};
        EXPECT((fxt_tick(&table, &late, &missed).flags & ((uint32_t)FXT_LATE | (uint32_t)FXT_GLITCH)) == (uint32_t)FXT_LATE);
    }
    return 0;
}

/* Wrong readings in a row of a register of one turn: up to three lose no turn; after more, in a place further away than a tick allows, the encoder is
 * lost, and says so until it is started anew. */
static int wrong_in_a_row(void)
{
    const made of = plain();
    const int64_t step = INT64_C(150000000);
    fxt_table table;
    fxt_limits limits = usual;
    limits.generator_rate_rad_s = 500.0f;
    EXPECT(fxt_open(&table, of.image, of.bytes).reason == FXT_OK);
    for (int wrongs = 1; wrongs < 9; wrongs++) {
        fxt_joint joint;
        fxt_encoder encoder;
        int64_t now = 0;
        bool was_lost = false;
        EXPECT(fxt_joint_init(&joint, &limits) == FXT_LIMITS_OK && fxt_encoder_init(&encoder, 1 << 20, 0, false, 0));
        EXPECT(fxt_encoder_start(&encoder, 0, INT64_C(3) << 32));
        for (int64_t tick = 0; tick < 40; tick++) {
            const int64_t true_angle = (INT64_C(3) << 32) + tick * step;
            /* By turns half a turn off, and a quarter. */
            const int64_t off = tick < 5 || tick >= 5 + wrongs ? 0 : tick % 2 == 0 ? INT64_C(1) << 31 : INT64_C(1) << 30;
            const uint64_t reading = fxt_encoder_reading(&encoder, true_angle + off);
            const bool read = fxt_joint_read(&joint, &encoder, reading, &now);
            EXPECT(read != fxt_encoder_is_lost(&encoder));
            was_lost = was_lost || !read;
            EXPECT(!read || off != 0 || llabs(now - true_angle) <= 1 << 12);
            const fxt_input input = {now, 0, 5.0f, 20.0f, 0, read};
            (void)fxt_tick(&table, &joint, &input);
        }
        EXPECT(was_lost == (wrongs > 3));
        EXPECT(!was_lost || (!fxt_joint_read(&joint, &encoder, 7, &now) && fxt_encoder_start(&encoder, 7, now) && !fxt_encoder_is_lost(&encoder)));
    }
    return 0;
}

/* For longer than a counter of 16 bits: a reading that may be of another turn is none, and a torque that comes back finds the side unknown. A target
 * half a turn of the output away is commanded, with a correction within its limits. */
static int for_long(void)
{
    const made of = plain();
    fxt_table table;
    fxt_joint joint;
    fxt_encoder encoder;
    int64_t now = 0;
    EXPECT(fxt_open(&table, of.image, of.bytes).reason == FXT_OK && fxt_joint_init(&joint, &usual) == FXT_LIMITS_OK);
    EXPECT(fxt_encoder_init(&encoder, 1 << 20, 0, false, 0) && fxt_encoder_start(&encoder, 0, 0) && fxt_joint_request(&joint, FXT_TRACKING));
    fxt_input input = {0, 0, 5.0f, 20.0f, 0, true};
    for (int tick = 0; tick < 5; tick++) {
        (void)fxt_tick(&table, &joint, &input);
        input.generator += 1 << 26;
    }
    EXPECT(fxt_play_known(&joint.play));
    input.has_generator = false;
    input.torque_n_m = NAN;
    for (int tick = 0; tick <= UINT16_MAX; tick++)
        EXPECT((fxt_tick(&table, &joint, &input).flags & FXT_NOT_CORRECTED) != 0u);
    EXPECT(!fxt_joint_read(&joint, &encoder, 1 << 19, &now) && fxt_encoder_is_lost(&encoder));
    input.has_generator = true;
    input.torque_n_m = 5.0f;
    fxt_output out = fxt_tick(&table, &joint, &input);
    EXPECT(out.quality == FXT_UNCERTAIN);
    input.target = out.output + INT32_MIN;
    out = fxt_tick(&table, &joint, &input);
    EXPECT(out.output + INT32_MIN == input.target && fabsf(out.correction_rad) < 1e-2f);
    EXPECT(llabs(out.command - 95 * input.target) < INT64_C(1) << 32);
    return 0;
}

static int encoders(void)
{
    fxt_joint joint;
    fxt_encoder encoder;
    int64_t angle = 7;
    EXPECT(!fxt_encoder_init(NULL, 4096, 0, false, 0) && !fxt_encoder_init(&encoder, 1, 0, false, 0));
    EXPECT(!fxt_encoder_start(NULL, 0, 0) && !fxt_encoder_read(NULL, 0, &angle) && fxt_encoder_reading(NULL, 1) == 0u);
    EXPECT(!fxt_encoder_read(&encoder, 0, &angle) && angle == 7 && !fxt_encoder_start(&encoder, 0, 0));
    EXPECT(!fxt_encoder_init(&encoder, 0x80000001u, 0, false, 0) && !fxt_encoder_init(&encoder, 4096, 65, false, 0));
    EXPECT(!fxt_encoder_init(&encoder, 4096, 0, false, INT64_MIN) && !fxt_encoder_init(&encoder, 4096, 0, false, INT64_MAX));
    EXPECT(fxt_encoder_init(&encoder, 4096, 0, false, 0) && !fxt_encoder_read(&encoder, 1, NULL) && !fxt_encoder_read(&encoder, 4096, &angle));
    EXPECT(!fxt_encoder_start(&encoder, 4096, 0) && fxt_encoder_start(&encoder, 1024, INT64_C(3) << 32));
    /* Three and a quarter turns; then a reading that cannot be, which changes nothing. */
    EXPECT(fxt_encoder_read(&encoder, 1024, &angle) && angle == INT64_C(13) << 30);
    EXPECT(!fxt_encoder_read(&encoder, 5000, &angle) && fxt_encoder_read(&encoder, 1025, &angle) && angle == (INT64_C(13) << 30) + (1 << 20));
    EXPECT(fxt_encoder_reading(&encoder, angle) == 1025u);
    /* Its memory changed: lost until it is started anew. */
    EXPECT(fxt_encoder_is_lost(NULL) && !fxt_encoder_is_lost(&encoder));
    encoder.reading = 4096;
    EXPECT(!fxt_encoder_read(&encoder, 1, &angle) && fxt_encoder_is_lost(&encoder));
    encoder.reading = 0;
    encoder.started = 3;
    EXPECT(!fxt_encoder_read(&encoder, 1, &angle) && fxt_encoder_is_lost(&encoder));
    EXPECT(fxt_encoder_start(&encoder, 1, 0) && !fxt_encoder_is_lost(&encoder));
    /* Without a start: near 0. */
    EXPECT(fxt_encoder_init(&encoder, 4096, 16, true, 0) && fxt_encoder_read(&encoder, 65535, &angle) && angle == 1 << 20);
    EXPECT(!fxt_encoder_read(&encoder, 65536, &angle));
    /* For a joint: whatever is missing, what the register cannot read, and a limit that hides a wrong bit; without a start near 0. */
    fxt_limits limits = usual;
    EXPECT(fxt_joint_init(&joint, &limits) == FXT_LIMITS_OK && fxt_encoder_init(&encoder, 4096, 0, false, 0));
    angle = 7;
    EXPECT(!fxt_joint_read(NULL, &encoder, 1, &angle) && !fxt_joint_read(&joint, NULL, 1, &angle) && !fxt_joint_read(&joint, &encoder, 1, NULL));
    EXPECT(!fxt_joint_read(&joint, &encoder, 4096, &angle) && angle == 7);
    joint.sampled = 1u;
    joint.generator = INT64_C(3) << 32;
    EXPECT(fxt_joint_read(&joint, &encoder, 1, &angle) && angle == 1 << 20 && fxt_joint_read(&joint, &encoder, 0, &angle) && angle == 0);
    /* Further than a tick allows: from the angle that was believed last. */
    EXPECT(fxt_joint_read(&joint, &encoder, 1024, &angle) && angle == INT64_C(13) << 30);
    for (int bits = 0; bits <= 64; bits += 13) {
        EXPECT(fxt_encoder_init(&encoder, 4096, (uint8_t)bits, false, 0));
        limits.generator_rate_rad_s = bits == 13 ? 2090.0f : 1040.0f;
        EXPECT(fxt_joint_init(&joint, &limits) == FXT_LIMITS_OK && fxt_joint_read(&joint, &encoder, 1, &angle));
        limits.generator_rate_rad_s = bits == 13 ? 2100.0f : 1050.0f;
        EXPECT(fxt_joint_init(&joint, &limits) == FXT_LIMITS_OK && fxt_joint_read(&joint, &encoder, 1, &angle) == (bits > 13));
    }
    return for_long();
}

static int radians(void)
{
    int64_t counts = 7;
    for (int i = 0; i <= FXT_NO_TABLE; i++)
        EXPECT(strcmp(fxt_reason_name((fxt_reason)i), "unknown") != 0);
    for (int i = 0; i <= FXT_ERROR_LIMIT; i++)
        EXPECT(strcmp(fxt_field_name((fxt_field)i), "unknown") != 0);
    EXPECT(strcmp(fxt_reason_name((fxt_reason)99), "unknown") == 0 && strcmp(fxt_field_name((fxt_field)99), "unknown") == 0);
    EXPECT(fxt_from_rad(6.283185307179586, &counts) && counts == INT64_C(1) << 32 && fxt_from_rad(-1e-9, &counts) && counts == -1);
    EXPECT(!fxt_from_rad(1.4e10, &counts) && counts == 0 && !fxt_from_rad(-1.4e10, &counts) && !fxt_from_rad((double)NAN, &counts));
    EXPECT(fxt_to_rad(INT64_C(1) << 31) == 3.141592653589793);
    return 0;
}

int main(void)
{
    int wrong = images() + arithmetic() + plays() + changed() + changed_table() + joints() + late_ticks();
    wrong += wrong_bits() + outliers() + wrong_in_a_row() + encoders() + radians();
    printf("%d of 12 groups of edges are wrong\n", wrong);
    return wrong != 0;
}
