/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * See flexspline_table.h. Each function has the name of what it follows in the Rust core (core/src/table, core/src/play.rs, core/src/drive.rs),
 * where the reasons are told; the order of sums and products is the core's, so that all bits are. Where a result is a whole number that does
 * not hang on it (`stoppable`, judging samples) it may be reached in another way. */
#include "flexspline_table.h"

#include <float.h>

#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || \
    (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0)
#error "flexspline_table.c: compile it without -ffast-math and its parts"
#endif
/* 16: as 0 for float; _Float16, of which there is none here, is computed as it is (ISO/IEC TS 18661-3). */
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16
#error "flexspline_table.c: float is computed in another precision (x87?); use -msse2 -mfpmath=sse, or the compiler's like"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
/* GCC does not know the pragma of the standard; where the option -ffp-contract=off cannot be given (Arduino), this does the same. */
#pragma GCC optimize("fp-contract=off")
#endif

/* Single and double precision of IEEE 754, two's complement, and a right shift that keeps the sign. */
typedef char fxt_needs_ieee_single[(FLT_MANT_DIG == 24 && FLT_MAX_EXP == 128 && sizeof(float) == 4) ? 1 : -1];
typedef char fxt_needs_ieee_double[(DBL_MANT_DIG == 53 && DBL_MAX_EXP == 1024 && sizeof(double) == 8) ? 1 : -1];
typedef char fxt_needs_signed_shift[(((int32_t)-5 >> 1) == -3 && ((int64_t)-5 >> 1) == -3) ? 1 : -1];
typedef char fxt_needs_two_complement[((int32_t)0xfffffffdu == -3 && (int16_t)0xfffd == -3) ? 1 : -1];
typedef char fxt_needs_32_bit_sizes[(SIZE_MAX >= 0xffffffffu) ? 1 : -1];

#define TAU 6.283185307179586
#define TURN 4294967296.0
static const float rad_per_count = (float)(TAU / TURN);
static const float tau_f32 = (float)TAU;

/* Limits of the format. */
enum {
    HEADER_BYTES = 256,
    TEXT_BYTES = 24,
    LEAST_BYTES = 584,
    TORQUE_SLOTS = 64,
    TEMPERATURE_SLOTS = 8,
    MOST_RIPPLE_NODES = 32,
    LEAST_PERIODIC_NODES = 4,
    MOST_PERIODIC_NODES = 128,
    NODE_WORDS = 3,
    USUAL_ITERATIONS = 8,
    MORE_ITERATIONS = 16,
    MOST_ITERATIONS = 24,
    HOLD_COUNTS = 8
};
/* Where things are, in words. */
enum {
    AT_RIPPLE_UNIT = 29,
    AT_LIMIT = 30,
    AT_TORQUE_RANGE = 34,
    AT_TEMPERATURE_RANGE = 36,
    AT_CELL_WIDTH = 39,
    AT_LAST = 40,
    AT_NODES = 41,
    AT_RECORDS = 42,
    AT_RECORD_STEP = 43,
    AT_CURVE_WORDS = 44,
    AT_ITERATIONS = 47,
    AT_HOLD = 48,
    AT_BODY = 49,
    AT_TORQUE_NODES = 64,
    AT_TEMPERATURE_NODES = 128,
    AT_CURVES = 136
};
#define PAGE_BYTES ((uint32_t)FXT_PAGE_BYTES)
/* 2^-24 cells in one. */
#define CELL INT32_C(0x1000000)
/* Counts in a quarter turn. */
#define QUARTER_TURN INT32_C(0x40000000)
/* The largest half-width of a play, and the largest error that is kept, counts. */
#define MOST_PLAY INT32_C(0x8000000)
#define MOST_KEPT (34178720u + (34178720u >> 8) + 2u * 33554431u + 0x8000000u)

/* Numbers: sums wrap, conversions saturate, as in Rust. */

static inline int32_t i32(uint32_t bits)
{
    return (int32_t)bits;
}

static inline int32_t add(int32_t a, int32_t b)
{
    return i32((uint32_t)a + (uint32_t)b);
}

static inline int32_t sub(int32_t a, int32_t b)
{
    return i32((uint32_t)a - (uint32_t)b);
}

static inline int32_t mul(int32_t a, int32_t b)
{
    return i32((uint32_t)a * (uint32_t)b);
}

static inline int32_t saturate(int64_t value)
{
    return value > INT32_MAX ? INT32_MAX : value < INT32_MIN ? INT32_MIN : (int32_t)value;
}

/* Divided by a power of two, rounded down. The shifts keep the sign, as asserted above: deviations from MISRA C:2012 rule 10.1. */
static inline int32_t shifted(int32_t value, uint32_t by)
{
    return value >> by;
}

static inline int64_t whole_turns(int64_t counts)
{
    return counts >> 32;
}

/* a*b/2^32, rounded down. */
static inline int32_t mul_high(int32_t a, int32_t b)
{
    const int64_t product = (int64_t)a * b;
    return i32((uint32_t)((uint64_t)product >> 32));
}

static inline uint32_t bits_of(float value)
{
    union {
        float f;
        uint32_t u;
    } both;
    both.f = value;
    return both.u;
}

static inline float float_of(uint32_t bits)
{
    union {
        uint32_t u;
        float f;
    } both;
    both.u = bits;
    return both.f;
}

static inline float magnitude(float value)
{
    return float_of(bits_of(value) & 0x7fffffffu);
}

static inline bool is_finite(float value)
{
    return (bits_of(value) & 0x7fffffffu) < 0x7f800000u;
}

/* Towards zero; the end of the range beyond it; 0 of NaN. */
static inline int32_t to_i32(float value)
{
    if (value >= 2147483648.0f) {
        return INT32_MAX;
    }
    if (value <= -2147483648.0f) {
        return INT32_MIN;
    }
    /* Only NaN differs from itself. */
    return value == value ? (int32_t)value : 0;
}

/* The larger; the second if the first is NaN. */
static inline float larger(float a, float b)
{
    return a > b ? a : b;
}

/* Within a range; its lower end if NaN. */
static inline float within(float value, float least, float most)
{
    const float above = value > least ? value : least;
    return above < most ? above : most;
}

/* The same for a conversion that follows. Written so that a prover sees that the result is a number. */
static float number_within(float value, float least, float most)
{
    return value == value ? within(value, least, most) : least;
}

/* Square root, to 3e-7 of it. */
static inline float root_of(float value)
{
    const uint32_t bits = (bits_of(value) & 0x80000000u) != 0u ? 0u : bits_of(value);
    const float x = float_of(bits);
    const float half = 0.5f * x;
    float inverse = float_of(0x5f3759dfu - (bits >> 1));
    for (int i = 0; i < 3; i++) {
        inverse = inverse * (1.5f - half * inverse * inverse);
    }
    return x * inverse;
}

static double counts_of_rad(double rad)
{
    return rad * (TURN / TAU);
}

/* Of a number within [0, 2^32). */
static uint32_t to_u32(double counts)
{
    return (uint32_t)counts;
}

static float rad_of(float counts)
{
    return counts * rad_per_count;
}

/* Memory: what lies beyond the end is zero. */

static inline uint32_t word_from(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

/* `count` words from a byte on: all of them or zeros. */
static inline void words_from(const uint8_t *image, uint32_t bytes, uint32_t at, uint32_t count, uint32_t *words)
{
    const bool there = bytes >= 4u * count && at <= bytes - 4u * count;
    for (uint32_t i = 0u; i < count; i++) {
        words[i] = there ? word_from(image + at + 4u * i) : 0u;
    }
}

/* Words of the body. */
static inline void words_at(const fxt_table *table, uint32_t at, uint32_t count, uint32_t *words)
{
    words_from(table->image, table->body_bytes, 4u * at, count, words);
}

static inline uint32_t word_at(const fxt_table *table, uint32_t at)
{
    uint32_t word;
    words_at(table, at, 1, &word);
    return word;
}

static inline float number_at(const fxt_table *table, uint32_t at)
{
    return float_of(word_at(table, at));
}

static inline int32_t low(uint32_t word)
{
    const uint32_t bits = word & 0xffffu;
    return (int16_t)bits;
}

static inline int32_t high(uint32_t word)
{
    const uint32_t bits = word >> 16;
    return (int16_t)bits;
}

/* CRC-32 of ISO-HDLC, four bits at a time; before the last inversion. */
static uint32_t crc_bytes(uint32_t crc, const uint8_t *bytes, uint32_t count)
{
    static const uint32_t of_nibble[16] = {0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u,
                                           0x4db26158u, 0x5005713cu, 0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu,
                                           0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu};
    for (uint32_t i = 0u; i < count; i++) {
        crc ^= bytes[i];
        crc = crc >> 4 ^ of_nibble[crc & 15u];
        crc = crc >> 4 ^ of_nibble[crc & 15u];
    }
    return crc;
}

static uint32_t crc32_of(const uint8_t *bytes, uint32_t count)
{
    return ~crc_bytes(0xffffffffu, bytes, count);
}

/* A table and its pages as they lie in memory, which may have changed. */

static uint32_t sum_of(const fxt_table *table)
{
    return crc32_of((const uint8_t *)table, (uint32_t)offsetof(fxt_table, sum));
}

static uint32_t pages_of(const fxt_table *table)
{
    return (table->body_bytes + PAGE_BYTES - 1u) / PAGE_BYTES;
}

static bool page_matches(const fxt_table *table, uint32_t page)
{
    const uint32_t at = page * PAGE_BYTES, left = table->body_bytes - at;
    uint32_t sum;
    words_from(table->image, table->bytes, table->body_bytes + 4u * page, 1, &sum);
    return crc32_of(table->image + at, left < PAGE_BYTES ? left : PAGE_BYTES) == sum;
}

/* The drive: tooth counts and the nominal motion. */

static fxt_factor factor_new(uint32_t times, uint32_t over)
{
    fxt_factor factor = {0, times / over, 0};
    uint32_t remainder = times % over;
    for (int digit = 0; digit < 4; digit++) {
        const uint32_t part = remainder << 16;
        factor.fraction = factor.fraction << 16 | part / over;
        remainder = part % over;
    }
    factor.fraction = (factor.fraction + (remainder * 2u >= over ? 1u : 0u)) & ~(uint64_t)1;
    return factor;
}

static inline int64_t factor_of(const fxt_factor *factor, int64_t counts)
{
    const uint64_t above = (uint64_t)whole_turns(counts), below = (uint32_t)counts;
    const uint64_t fraction_high = factor->fraction >> 32, fraction_low = (uint32_t)factor->fraction;
    const uint64_t lowest = below * fraction_low >> 32;
    const uint64_t middle = below * fraction_high + lowest;
    const uint64_t other = above * fraction_low + (uint32_t)middle + ((uint64_t)1 << 31);
    const uint64_t scaled = above * fraction_high + (middle >> 32) + (uint64_t)whole_turns((int64_t)other);
    const uint64_t product = (uint64_t)counts * factor->whole + scaled;
    return (int64_t)product;
}

static fxt_rate rate_new(const fxt_factor *factor, uint32_t times, bool reversed)
{
    const uint64_t below = (uint64_t)(uint32_t)factor->fraction * times;
    const uint64_t whole = ((uint64_t)factor->whole << 32) + (factor->fraction >> 32);
    fxt_rate rate = {whole * times + (below >> 32), (uint32_t)below, 0};
    if (reversed) {
        rate.rest = 0u - rate.rest;
        rate.periods = ~rate.periods + (rate.rest == 0u ? 1u : 0u);
    }
    return rate;
}

static inline uint32_t rate_phase(const fxt_rate *rate, int64_t counts)
{
    const uint64_t turns = (uint64_t)whole_turns(counts);
    const uint32_t late = (uint32_t)(turns * rate->rest >> 32);
    return (uint32_t)((uint64_t)counts * rate->periods >> 32) + late;
}

static inline int64_t minus(int64_t angle, int64_t counts)
{
    const uint64_t difference = (uint64_t)angle - (uint64_t)counts;
    return (int64_t)difference;
}

static inline int64_t plus(int64_t angle, int64_t counts)
{
    const uint64_t sum = (uint64_t)angle + (uint64_t)counts;
    return (int64_t)sum;
}

static int64_t nominal_output(const fxt_table *table, int64_t generator)
{
    const int64_t output = factor_of(&table->to_output, generator);
    return table->reversed != 0u ? minus(0, output) : output;
}

static int64_t nominal_generator(const fxt_table *table, int64_t output)
{
    const int64_t generator = factor_of(&table->to_generator, output);
    return table->reversed != 0u ? minus(0, generator) : generator;
}

/* a - b in counts if that is within half a turn, else a quarter turn with its sign. */
static inline int32_t minus_near(int64_t a, int64_t b)
{
    const int64_t counts = minus(a, b);
    if (counts >= INT32_MIN && counts <= INT32_MAX) {
        return (int32_t)counts;
    }
    return counts < 0 ? -QUARTER_TURN : QUARTER_TURN - 1;
}

typedef struct {
    uint32_t generator, material, output, tooth;
} phases;

static phases phases_at(const fxt_table *table, int64_t generator, int64_t nominal)
{
    const uint32_t fraction = (uint32_t)generator;
    const phases at = {fraction, fraction - (uint32_t)nominal, (uint32_t)nominal, fraction * table->ripple_order};
    return at;
}

static phases phases_at_output(const fxt_table *table, int64_t nominal)
{
    const uint32_t generator = rate_phase(&table->generator_rate, nominal);
    const phases at = {generator, generator - (uint32_t)nominal, (uint32_t)nominal, 0};
    return at;
}

/* A torque and temperature, located in the table. */

typedef struct {
    uint32_t row, torque_step, plane_step; /* half words */
    int32_t shares[2];                     /* of the records below and above the torque, 2^-30 */
    int32_t hotter;                        /* of those at the hotter temperature, 2^-14 */
    int32_t mean, half_width, jump;        /* counts */
    bool finite, in_range, led_astray;
} point;

static inline uint32_t search(const fxt_table *table, uint32_t first, uint32_t step, float value)
{
    uint32_t found = 0;
    for (; step > 0u; step >>= 1) {
        if (number_at(table, first + (found | step)) <= value) {
            found |= step;
        }
    }
    return found;
}

static point locate(const fxt_table *table, float torque_n_m, float temperature_c)
{
    uint32_t words[6], warmer[6];
    float here[6];
    point at;
    words_at(table, AT_TORQUE_RANGE, 4, words);
    const float torque = within(torque_n_m, float_of(words[0]), float_of(words[1]));
    const float temperature = within(temperature_c, float_of(words[2]), float_of(words[3]));
    words_at(table, AT_LAST, 4, words);
    const uint32_t last_torque = words[0] & 0xffffu, last_temperature = words[0] >> 16;
    const uint32_t nodes = words[1] & 0xffffu, node_plane = words[1] >> 16;
    const uint32_t records = words[2] & 0xffffu, record_plane = words[2] >> 16;
    const uint32_t record_step = words[3] & 0xffffu;

    uint32_t interval = search(table, AT_TORQUE_NODES, TORQUE_SLOTS / 2, torque);
    interval = interval < last_torque ? interval : last_torque;
    words_at(table, AT_TORQUE_NODES + interval, 2, words);
    const float low_torque = float_of(words[0]), width = float_of(words[1]) - low_torque;
    uint32_t plane = search(table, AT_TEMPERATURE_NODES, TEMPERATURE_SLOTS / 2, temperature);
    plane = plane < last_temperature ? plane : last_temperature;
    words_at(table, AT_TEMPERATURE_NODES + plane, 2, words);
    const float cold = float_of(words[0]);
    const float warm = (temperature - cold) / (float_of(words[1]) - cold);

    const uint32_t first = nodes + plane * node_plane + interval * NODE_WORDS;
    words_at(table, first, 6, words);
    words_at(table, first + node_plane, 6, warmer);
    for (int i = 0; i < 6; i++) {
        const float value = float_of(words[i]);
        /* The last bit of H is a mark, and of the others too small to matter: that of the colder. */
        here[i] = float_of((bits_of(value + warm * (float_of(warmer[i]) - value)) & ~1u) | (words[i] & 1u));
    }
    const bool jump = (words[2] & 1u) != 0u;
    const float weight = (torque - low_torque) / width;
    const float rise = here[3] - here[0], widening = here[5] - here[2];
    const float rest = 1.0f - weight;
    float bend = weight * rest * (rest * (width * here[1] - rise) + weight * (rise - width * here[4]));
    bend = jump ? 0.0f : bend;
    const int32_t t = to_i32(weight * 16384.0f), shares[2] = {sub(16384, t), t};
    for (int i = 0; i < 2; i++) {
        at.shares[i] = i32((uint32_t)shares[i] << 16);
    }
    at.hotter = to_i32(warm * 16384.0f);
    const bool inside = (uint32_t)t - 1u < 16383u;
    at.jump = jump && inside ? to_i32(magnitude(rise) + magnitude(widening)) : 0;
    at.mean = to_i32(here[0] + weight * rise + bend);
    at.half_width = to_i32(here[2] + weight * widening);
    at.row = 2u * (records + plane * record_plane + interval * record_step);
    at.torque_step = 2u * record_step;
    at.plane_step = 2u * record_plane;
    at.finite = is_finite(torque_n_m) && is_finite(temperature_c) && table->image != NULL;
    at.in_range = torque == torque_n_m && temperature == temperature_c;
    /* Only where the memory changed after it was checked. */
    at.led_astray = (uint32_t)t > 16384u;
    return at;
}

static fxt_quality quality_of(const point *at, bool sane, bool known)
{
    if (!sane) {
        return FXT_DISABLED;
    }
    if (!at->in_range) {
        return FXT_EXTRAPOLATED;
    }
    return known && at->jump == 0 ? FXT_IN_RANGE : FXT_UNCERTAIN;
}

/* |centre| + |half| is within what an accepted table can give. */
static bool allows(const fxt_table *table, int32_t centre, int32_t half)
{
    const int32_t below = centre > 0 ? -centre : centre, width = half > 0 ? -half : half;
    return saturate((int64_t)below + width) >= sub(0, table->limit);
}

static bool allows_error(const fxt_table *table, int32_t error)
{
    return (uint32_t)error + (uint32_t)table->limit <= (uint32_t)table->limit * 2u;
}

/* Values of one direction in a record. */
static inline uint32_t ripple_row(uint32_t nodes)
{
    return nodes == 0u ? 0u : (nodes + 5u) & ~1u;
}

typedef struct {
    uint32_t node, fraction;
} cell;

static inline cell cell_at(uint32_t nodes, uint32_t phase)
{
    const uint64_t scaled = (uint64_t)phase * nodes + ((uint64_t)1 << 31);
    const cell at = {(uint32_t)(scaled >> 32), (uint32_t)scaled};
    return at;
}

/* B-spline weights of the three nodes around the place, 2^-15. */
static inline void weights_q15(cell at, int32_t weights[3])
{
    const uint32_t t = at.fraction >> 17, s = 0x8000u - t;
    const uint32_t first = s * s >> 16, last = t * t >> 16;
    weights[0] = i32(first);
    weights[1] = i32(0x8000u - first - last);
    weights[2] = i32(last);
}

static bool has_curves(const fxt_table *table)
{
    return (table->curves[0] | table->curves[1] | table->curves[2]) >> 16 != 0u;
}

/* A + B + C, counts. */
static int32_t curves_at(const fxt_table *table, const phases *where)
{
    const uint32_t phase[3] = {where->generator, where->material, where->output};
    int32_t sum = 0;
    for (uint32_t curve = 0u; curve < 3u; curve++) {
        const uint32_t nodes = table->curves[curve] >> 16, first = table->curves[curve] & 0xffffu;
        if (nodes == 0u) {
            continue;
        }
        const cell at = cell_at(nodes, phase[curve]);
        uint32_t words[3];
        int32_t weights[3];
        words_at(table, first + at.node, 3, words);
        weights_q15(at, weights);
        for (int i = 0; i < 3; i++) {
            sum = add(sum, mul_high(i32(words[i]), i32((uint32_t)weights[i] << 16)));
        }
    }
    return sum;
}

/* Between two temperatures, rounded. */
static inline int32_t blended(const point *at, int32_t cold, int32_t hot)
{
    return add(cold, shifted(add(mul(sub(hot, cold), at->hotter), 8192), 14u));
}

/* Numbers of one of the two records around a torque, two in a word of at most three; where there are temperatures blended to that of the point. */
static inline void record_at(const fxt_table *table, const point *at, uint32_t above, uint32_t from, uint32_t words, int32_t *numbers)
{
    const uint32_t first = at->row + above * at->torque_step + from;
    uint32_t cold[3], hot[3];
    words_from(table->image, table->bytes, 2u * first, words, cold);
    for (uint32_t i = 0u; i < words; i++) {
        numbers[2u * i] = low(cold[i]);
        numbers[2u * i + 1u] = high(cold[i]);
    }
    if (at->plane_step != 0u) {
        words_from(table->image, table->bytes, 2u * (first + at->plane_step), words, hot);
        for (uint32_t i = 0u; i < words; i++) {
            numbers[2u * i] = blended(at, numbers[2u * i], low(hot[i]));
            numbers[2u * i + 1u] = blended(at, numbers[2u * i + 1u], high(hot[i]));
        }
    }
}

/* The ripple of forward and of backward motion, counts. */
static void ripple_at(const fxt_table *table, const point *at, uint32_t tooth, int32_t ripple[2])
{
    const cell where = cell_at(table->ripple_nodes, tooth);
    const uint32_t backward_row = ripple_row(table->ripple_nodes);
    int32_t weights[3];
    weights_q15(where, weights);
    for (int i = 0; i < 3; i++) {
        weights[i] = (int16_t)weights[i];
    }
    ripple[0] = 0;
    ripple[1] = 0;
    for (uint32_t row = 0u; row < 2u; row++) {
        for (uint32_t side = 0u; side < 2u; side++) {
            int32_t numbers[4];
            record_at(table, at, row, where.node + (side != 0u ? backward_row : 0u), 2, numbers);
            const int32_t own = add(add(mul(numbers[0], weights[0]), mul(numbers[1], weights[1])), mul(numbers[2], weights[2]));
            ripple[side] = add(ripple[side], mul_high(own, at->shares[row]));
        }
    }
    for (int side = 0; side < 2; side++) {
        ripple[side] = mul_high(ripple[side], i32(table->ripple_unit));
    }
}

/* Centre and half-width of the play, counts; false where they are not what an accepted table can give. */
static bool play_at(const fxt_table *table, const point *at, const phases *where, int32_t *centre, int32_t *half)
{
    *centre = at->mean;
    *half = at->half_width;
    if (table->ripple_nodes > 0u) {
        int32_t ripple[2];
        ripple_at(table, at, where->tooth, ripple);
        *centre = add(*centre, shifted(add(ripple[0], ripple[1]), 1u));
        *half = add(*half, shifted(sub(ripple[1], ripple[0]), 1u));
    }
    if (has_curves(table)) {
        *centre = add(*centre, curves_at(table, where));
    }
    *half = *half < 0 ? 0 : *half;
    return allows(table, *centre, *half);
}

/* How far from a place the solution of x + ripple(x) = place is, 2^-24 cells, from the phase at a guess so far ahead of it. */
static int32_t to_solution(const fxt_table *table, const point *at, uint32_t tooth, int32_t ahead, bool backward)
{
    const cell guess = cell_at(table->ripple_nodes, tooth);
    const uint32_t node = guess.node == 0u ? table->ripple_nodes : guess.node;
    const uint32_t first = node - 1u + (backward ? ripple_row(table->ripple_nodes) : 0u);
    int32_t sums[5] = {0, 0, 0, 0, 0};
    for (uint32_t row = 0u; row < 2u; row++) {
        int32_t numbers[6];
        const int32_t share = shifted(at->shares[row], 16u);
        record_at(table, at, row, first, 3, numbers);
        for (int i = 0; i < 5; i++) {
            sums[i] = add(sums[i], mul(numbers[i], share));
        }
    }
    for (int i = 0; i < 5; i++) {
        sums[i] = mul_high(sums[i], table->ripple_cells);
    }
    const int32_t place = sub(shifted(i32(guess.fraction ^ 0x80000000u), 8u), ahead);
    /* What is missing at either end of the node's cell tells whether the solution is in it, before or after. */
    const int32_t below = sub(shifted(add(sums[1], sums[2]), 1u), place), above = sub(shifted(add(sums[2], sums[3]), 1u), place);
    const int32_t which = add(below <= CELL / 2 ? 1 : 0, above <= -(CELL / 2) ? 1 : 0);
    const int32_t a = sums[which], b = sums[which + 1], c = sums[which + 2];
    const int32_t start = sub(which * CELL - CELL / 2 * 3, place);
    const float linear = (float)add(CELL, sub(b, a));
    const float bend = (float)add(sub(a, b), sub(c, b));
    const float missing = (float)add(shifted(add(a, b), 1u), start);
    const float twice = missing + missing;
    const float root = twice / (linear + root_of(linear * linear - bend * twice));
    int32_t along = to_i32(root * -(float)CELL);
    along = along > 0 ? along : 0;
    along = along < CELL ? along : CELL;
    return add(start, along);
}

/* 2^-24 cells in counts. */
static int32_t counts_of_cells(const fxt_table *table, int32_t cells)
{
    return to_i32((float)cells * (table->cell_width * (1.0f / (float)CELL)));
}

/* The error on one side of the play where that brings the output to a target, counts; false where no accepted table gives it. */
static bool solve(const fxt_table *table, const point *at, int64_t target, bool backward, int32_t *error)
{
    const int32_t base = backward ? add(at->mean, at->half_width) : sub(at->mean, at->half_width);
    int32_t curves = 0, ahead = 0;
    *error = base;
    const uint32_t iterations = table->iterations < MOST_ITERATIONS ? table->iterations : MOST_ITERATIONS;
    for (uint32_t i = 0u; i < iterations; i++) {
        int32_t guess = *error;
        if (has_curves(table)) {
            const phases where = phases_at_output(table, minus(target, *error));
            const int32_t before = curves;
            curves = curves_at(table, &where);
            guess = sub(add(guess, curves), before);
        }
        *error = add(base, curves);
        if (table->ripple_nodes > 0u) {
            const uint32_t tooth = rate_phase(&table->tooth_rate, minus(target, guess));
            ahead = to_solution(table, at, tooth, ahead, backward);
            *error = sub(*error, counts_of_cells(table, ahead));
        }
    }
    return allows_error(table, *error);
}

/* The play. */

/* As the core has it: bounds of the offset from the centre, counts; half-width at the last update, -1 before the first. */
typedef struct {
    int64_t nominal;
    int32_t error, lower, upper, half;
    int32_t without[2]; /* the bounds as they would be if no flank had taken the output along in the last update; not kept */
} play_state;

static const play_state unknown_state = {0, 0, INT32_MIN, INT32_MAX, -1, {0, 0}};

/* Each number of a fxt_play is kept beside that of an unknown side, so that memory of zeros is one: a known play may be all zero here. */
static inline play_state state_of(const fxt_play *play)
{
    static const fxt_play no_play;
    const fxt_play *of = play != NULL ? play : &no_play;
    const play_state is = {of->nominal, of->error, i32(of->lower ^ 0x80000000u), i32(of->upper ^ 0x7fffffffu), i32(~of->half), {0, 0}};
    return is;
}

static inline fxt_play kept(const play_state *is)
{
    const fxt_play play = {is->nominal, is->error, (uint32_t)is->lower ^ 0x80000000u, (uint32_t)is->upper ^ 0x7fffffffu, ~(uint32_t)is->half};
    return play;
}

static inline int32_t clamped(int32_t offset, int32_t half)
{
    return offset < -half ? -half : offset > half ? half : offset;
}

static inline int32_t play_offset(const play_state *play)
{
    return shifted(add(play->lower, play->upper), 1u);
}

static inline int32_t play_uncertainty(const play_state *play)
{
    const int32_t width = saturate((int64_t)play->upper - play->lower);
    return add(shifted(width, 1u), i32((uint32_t)width & 1u));
}

/* Moves the play to `nominal` with the centre and half-width there; those of the last update if they are not sane. */
static int32_t play_update(play_state *play, int64_t nominal, int32_t centre, int32_t half, bool sane)
{
    const bool started = play->half >= 0;
    const int32_t last_half = started ? play->half : MOST_PLAY;
    const int32_t last_centre = started ? sub(play->error, play_offset(play)) : 0;
    half = sane ? half : last_half;
    half = (uint32_t)half > (uint32_t)MOST_PLAY ? MOST_PLAY : half;
    centre = sane ? centre : last_centre;
    const int64_t went = (int64_t)minus_near(nominal, play->nominal) + sub(centre, last_centre);
    const int32_t moved = started ? saturate(went) : 0;
    play->without[0] = saturate((int64_t)play->lower - moved);
    play->without[1] = saturate((int64_t)play->upper - moved);
    play->lower = clamped(play->without[0], half);
    play->upper = clamped(play->without[1], half);
    play->nominal = nominal;
    play->half = half;
    play->error = add(centre, play_offset(play));
    return play->error;
}

/* The last update was none: the output is where it was before it. The centre stays. */
static void play_take_back(play_state *play, const int32_t without[2])
{
    const int32_t offset = play_offset(play);
    play->lower = without[0];
    play->upper = without[1];
    play->error = add(play->error, sub(play_offset(play), offset));
}

/* What the output does now, counts. */
typedef struct {
    int64_t nominal;
    int32_t error, uncertainty;
    bool sane;
} estimate;

static inline estimate estimated(const fxt_table *table, const point *at, play_state *play, int64_t generator)
{
    const int64_t nominal = nominal_output(table, generator);
    const phases where = phases_at(table, generator, nominal);
    int32_t centre, half;
    const bool sane = play_at(table, at, &where, &centre, &half) && at->finite && !at->led_astray;
    const int32_t followed = play_update(play, nominal, centre, half, sane);
    const int32_t known = add(play_uncertainty(play), at->jump);
    const estimate now = {nominal, sane ? followed : 0, sane ? known : table->limit, sane};
    return now;
}

static inline fxt_prediction follow(const fxt_table *table, const point *at, play_state *play, int64_t generator)
{
    const estimate is = estimated(table, at, play, generator);
    fxt_prediction now;
    now.output = plus(is.nominal, is.error);
    now.nominal = is.nominal;
    now.transmission_error_rad = (float)is.error * rad_per_count;
    now.uncertainty_rad = (float)is.uncertainty * rad_per_count;
    now.quality = quality_of(at, is.sane, play->lower == play->upper);
    return now;
}

static fxt_command commanded(const fxt_table *table, const point *at, int64_t target, bool sane, int64_t nominal, int32_t error,
                             int32_t uncertainty)
{
    fxt_command command;
    sane = sane && at->finite && !at->led_astray;
    command.quality = quality_of(at, sane, uncertainty <= 0);
    command.generator = nominal_generator(table, sane ? nominal : target);
    command.predicted_error_rad = (float)(sane ? error : 0) * rad_per_count;
    command.uncertainty_rad = (float)(sane ? add(uncertainty, at->jump) : table->limit) * rad_per_count;
    return command;
}

static fxt_command aim_moving(const fxt_table *table, const point *at, int64_t target, bool backward)
{
    int32_t error;
    const bool sane = solve(table, at, target, backward, &error);
    return commanded(table, at, target, sane, minus(target, error), error, 0);
}

/* What a motion ends in: how far the target is, and what is not known of where the output is and of the side on which it will be reached. */
typedef struct {
    int32_t ahead, unknown, guess;
    bool backward, hold;
} departure;

static inline int32_t magnitude_of(int32_t value)
{
    return value == INT32_MIN ? INT32_MAX : value < 0 ? -value : value;
}

static inline departure departure_from(const fxt_table *table, const point *at, int64_t target, const play_state *play, int64_t output)
{
    const int32_t ahead = minus_near(target, output), away = magnitude_of(ahead), unknown = play_uncertainty(play);
    /* A target inside the interval may lie on the other side of the output: then the whole play is in doubt. */
    const int32_t guess = away <= unknown && unknown > 0 ? mul(at->half_width, 2) : 0;
    const departure from = {ahead, unknown, guess, ahead <= 0, away <= table->hold};
    return from;
}

static fxt_command aim_from(const fxt_table *table, const point *at, int64_t target, const play_state *play)
{
    int32_t error;
    if (play->half < 0) {
        int32_t back;
        const bool forward_sane = solve(table, at, target, false, &error);
        const bool sane = solve(table, at, target, true, &back) && forward_sane;
        const int32_t middle = shifted(add(error, back), 1u);
        return commanded(table, at, target, sane, minus(target, middle), middle, at->half_width);
    }
    const departure from = departure_from(table, at, target, play, plus(play->nominal, play->error));
    const bool sane = solve(table, at, target, from.backward, &error);
    if (from.hold) {
        return commanded(table, at, target, sane, play->nominal, play->error, from.unknown);
    }
    return commanded(table, at, target, sane, minus(target, error), error, from.guess);
}

/* The check of an image. */

typedef struct {
    fxt_table *table;
    fxt_verdict verdict;
    uint32_t torques, temperatures, ripple_nodes, curve_nodes[3];
    uint32_t circular_spline_teeth;
    uint32_t curves[3], nodes, node_plane, records, record, end;
    uint64_t jumps;
    float ratio, tooth_periods;
    float error_rad, periodic_rad, slope, curve_slope, cells, rounding_rad;
} check;

static bool refuse(check *is, fxt_reason reason, fxt_field field, uint32_t index, uint32_t temperature)
{
    const fxt_verdict verdict = {reason, field, index, temperature};
    is->verdict = verdict;
    return false;
}

static bool finite_is(check *is, fxt_field field, uint32_t index, float value)
{
    if (!is_finite(value)) {
        return refuse(is, FXT_NOT_FINITE, field, index, 0);
    }
    return true;
}

static bool in_range(check *is, fxt_field field, uint32_t index, float value, float least, float most)
{
    if (!finite_is(is, field, index, value)) {
        return false;
    }
    if (value < least || value > most) {
        return refuse(is, FXT_OUT_OF_RANGE, field, 0, 0);
    }
    return true;
}

static bool derived_is(check *is, uint32_t at, uint32_t value)
{
    if (word_at(is->table, at) != value) {
        return refuse(is, FXT_DERIVED, FXT_NO_FIELD, 4u * at, 0);
    }
    return true;
}

static uint32_t u16_at(const uint8_t *image, uint32_t at)
{
    return (uint32_t)image[at] | (uint32_t)image[at + 1u] << 8;
}

static bool check_envelope(check *is, const uint8_t *image, size_t bytes)
{
    static const uint8_t magic[8] = {0x89, 'F', 'X', 'T', 0x0d, 0x0a, 0x1a, 0x0a};
    if (image == NULL || bytes < LEAST_BYTES) {
        return refuse(is, FXT_TOO_SHORT, FXT_NO_FIELD, 0, 0);
    }
    for (int i = 0; i < 8; i++) {
        if (image[i] != magic[i]) {
            return refuse(is, FXT_MAGIC, FXT_NO_FIELD, 0, 0);
        }
    }
    if (u16_at(image, 10) != 0xfeffu) {
        return refuse(is, FXT_BYTE_ORDER, FXT_NO_FIELD, u16_at(image, 10), 0);
    }
    if (u16_at(image, 8) != FXT_FORMAT_VERSION) {
        return refuse(is, FXT_VERSION, FXT_NO_FIELD, u16_at(image, 8), 0);
    }
    const uint32_t stated = word_from(image + 12);
    if (stated != bytes) {
        return refuse(is, FXT_LENGTH, FXT_NO_FIELD, stated, 0);
    }
    const uint32_t computed = crc32_of(image, stated - 4u);
    if (computed != word_from(image + stated - 4u)) {
        return refuse(is, FXT_CRC, FXT_NO_FIELD, computed, 0);
    }
    return true;
}

static bool check_text(check *is, const uint8_t *text, fxt_field field)
{
    uint32_t length = 0;
    while (length < (uint32_t)TEXT_BYTES && text[length] >= 0x20u && text[length] < 0x7fu) {
        length++;
    }
    while (length < (uint32_t)TEXT_BYTES && text[length] == 0u) {
        length++;
    }
    if (length != (uint32_t)TEXT_BYTES) {
        return refuse(is, FXT_TEXT, field, 0, 0);
    }
    return true;
}

static bool check_drive(check *is, const uint8_t *image)
{
    fxt_table *table = is->table;
    const uint32_t flexspline = u16_at(image, 106), circular = u16_at(image, 108);
    if (image[105] > 1u) {
        return refuse(is, FXT_FIXED_MEMBER, FXT_NO_FIELD, image[105], 0);
    }
    const uint32_t waves = circular > flexspline ? circular - flexspline : 0u;
    if (flexspline == 0u || waves == 0u || waves > flexspline) {
        return refuse(is, FXT_TEETH, FXT_NO_FIELD, flexspline, 0);
    }
    const bool reversed = image[105] == 1u;
    const uint32_t teeth = reversed ? flexspline : circular;
    table->reversed = image[105];
    table->ripple_order = reversed ? circular : flexspline;
    table->to_output = factor_new(waves, teeth);
    table->to_generator = factor_new(teeth, waves);
    table->generator_rate = rate_new(&table->to_generator, 1, reversed);
    table->tooth_rate = rate_new(&table->to_generator, table->ripple_order, reversed);
    is->circular_spline_teeth = circular;
    is->ratio = (float)teeth / (float)waves;
    is->ratio = reversed ? -is->ratio : is->ratio;
    is->tooth_periods = is->ratio * (float)table->ripple_order;
    return true;
}

static fxt_field curve_field(uint32_t curve)
{
    static const fxt_field fields[3] = {FXT_GENERATOR_CURVE, FXT_MATERIAL_CURVE, FXT_OUTPUT_CURVE};
    return fields[curve];
}

static uint32_t stored(uint32_t nodes)
{
    return nodes == 0u ? 0u : nodes + 3u;
}

/* What an image is for, and its sizes. */
static bool check_identity(check *is, const uint8_t *image)
{
    for (uint32_t at = 200; at < (uint32_t)HEADER_BYTES; at++) {
        if (image[at] != 0u) {
            return refuse(is, FXT_RESERVED, FXT_NO_FIELD, at, 0);
        }
    }
    if (!check_text(is, image + 56, FXT_TOOL_VERSION) || !check_text(is, image + 80, FXT_MESH_LEVEL) || !check_drive(is, image)) {
        return false;
    }
    if (image[104] > 4u) {
        return refuse(is, FXT_GENERATOR_KIND, FXT_NO_FIELD, image[104], 0);
    }
    is->torques = image[110];
    is->temperatures = image[111];
    is->ripple_nodes = image[112];
    if (is->torques < 1u || is->torques > (uint32_t)TORQUE_SLOTS) {
        return refuse(is, FXT_COUNT, FXT_TORQUE_NODES, is->torques, 0);
    }
    if (is->temperatures < 1u || is->temperatures > (uint32_t)TEMPERATURE_SLOTS) {
        return refuse(is, FXT_COUNT, FXT_TEMPERATURE_NODES, is->temperatures, 0);
    }
    if (is->ripple_nodes != 0u && (is->ripple_nodes < (uint32_t)LEAST_PERIODIC_NODES || is->ripple_nodes > (uint32_t)MOST_RIPPLE_NODES)) {
        return refuse(is, FXT_COUNT, FXT_RIPPLE_NODES, is->ripple_nodes, 0);
    }
    uint32_t next = AT_CURVES;
    for (uint32_t i = 0u; i < 3u; i++) {
        is->curve_nodes[i] = image[113u + i];
        if (is->curve_nodes[i] != 0u &&
            (is->curve_nodes[i] < (uint32_t)LEAST_PERIODIC_NODES || is->curve_nodes[i] > (uint32_t)MOST_PERIODIC_NODES)) {
            return refuse(is, FXT_COUNT, curve_field(i), is->curve_nodes[i], 0);
        }
        is->curves[i] = next;
        next += stored(is->curve_nodes[i]);
    }
    is->nodes = next;
    is->node_plane = (is->torques > 1u ? is->torques : 2u) * NODE_WORDS;
    is->records = is->nodes + is->node_plane * is->temperatures;
    is->record = ripple_row(is->ripple_nodes);
    is->end = is->records + is->record * is->torques * is->temperatures;
    is->table->body_bytes = 4u * is->end;
    const uint32_t needed = is->table->body_bytes + 4u * (pages_of(is->table) + 1u);
    if (needed != is->table->bytes) {
        return refuse(is, FXT_SIZE, FXT_NO_FIELD, needed, 0);
    }
    return true;
}

static uint32_t along(uint32_t nodes, uint32_t step)
{
    return nodes > 1u ? step : 0u;
}

static uint32_t pair(uint32_t below, uint32_t above)
{
    return (below & 0xffffu) | above << 16;
}

/* Words that follow from the sizes, the error limit, and what follows from it. */
static bool check_places(check *is)
{
    const float cell_width =
        is->ripple_nodes == 0u ? 1.0f : (float)(TURN / ((double)is->ripple_nodes * (double)is->tooth_periods));
    const uint32_t last_torque = is->torques > 2u ? is->torques - 2u : 0u;
    const uint32_t last_temperature = is->temperatures > 2u ? is->temperatures - 2u : 0u;
    const uint32_t plan[7] = {
        pair(last_torque, last_temperature),
        pair(is->nodes, along(is->temperatures, is->node_plane)),
        pair(is->records, along(is->temperatures, is->record * is->torques)),
        pair(along(is->torques, is->record), is->ripple_nodes),
        pair(is->curves[0], is->curve_nodes[0]),
        pair(is->curves[1], is->curve_nodes[1]),
        pair(is->curves[2], is->curve_nodes[2]),
    };
    if (!derived_is(is, AT_BODY, is->end) || !derived_is(is, AT_CELL_WIDTH, bits_of(cell_width))) {
        return false;
    }
    for (uint32_t i = 0u; i < 7u; i++) {
        if (!derived_is(is, AT_LAST + i, plan[i])) {
            return false;
        }
    }
    is->table->cell_width = cell_width;
    const float limit = number_at(is->table, 38);
    const double limit_counts = counts_of_rad((double)number_within(limit, FLT_MIN, 0.05f)) * 1.001 + 16.0;
    return in_range(is, FXT_ERROR_LIMIT, 0, limit, FLT_MIN, 0.05f) && derived_is(is, AT_LIMIT, to_u32(limit_counts));
}

static bool check_axis(check *is, fxt_field field, uint32_t first, uint32_t nodes, uint32_t slots)
{
    for (uint32_t i = 0u; i < slots; i++) {
        const float node = number_at(is->table, first + i);
        if (i >= nodes) {
            if (!derived_is(is, first + i, bits_of(FLT_MAX))) {
                return false;
            }
            continue;
        }
        if (!in_range(is, field, i, node, -1e6f, 1e6f)) {
            return false;
        }
        if (i > 0u && node <= number_at(is->table, first + i - 1u)) {
            return refuse(is, FXT_NOT_INCREASING, field, i, 0);
        }
    }
    return true;
}

/* A range lies inside its axis; an axis of one node holds wherever its maker says. */
static bool check_range(check *is, fxt_field field, uint32_t at, uint32_t first, uint32_t nodes)
{
    const float least = number_at(is->table, at), most = number_at(is->table, at + 1u);
    const float from = nodes > 1u ? number_at(is->table, first) : -1e6f;
    const float to = nodes > 1u ? number_at(is->table, first + nodes - 1u) : 1e6f;
    return in_range(is, field, 0, least, from, to) && in_range(is, field, 1, most, least, to);
}

static bool check_header_numbers(check *is)
{
    const fxt_table *table = is->table;
    const float residual = number_at(table, 31), worst = number_at(table, 32), rms = number_at(table, 33);
    if (!check_range(is, FXT_TORQUE_RANGE, AT_TORQUE_RANGE, AT_TORQUE_NODES, is->torques) ||
        !check_range(is, FXT_TEMPERATURE_RANGE, AT_TEMPERATURE_RANGE, AT_TEMPERATURE_NODES, is->temperatures) ||
        !in_range(is, FXT_SOLVER_RESIDUAL, 0, residual, 0.0f, FLT_MAX) || !in_range(is, FXT_PROJECTION_WORST, 0, worst, 0.0f, 0.05f) ||
        !in_range(is, FXT_PROJECTION_RMS, 0, rms, 0.0f, worst)) {
        return false;
    }
    /* So that the ripple in cells, and in counts, fits the integers of a step. */
    const float widest = magnitude(table->cell_width) * 255.0f;
    const float most = is->ripple_nodes == 0u || widest > 2147483648.0f ? 2147483648.0f : widest;
    return in_range(is, FXT_MEAN_RIPPLE, 0, (float)word_at(table, AT_RIPPLE_UNIT), 0.0f, most);
}

static float torque_at(const check *is, uint32_t node)
{
    return number_at(is->table, AT_TORQUE_NODES + node);
}

/* Whether the interval above a torque node is a jump: at most an eighth as wide as each neighbour it has. */
static bool jump_at(const check *is, uint32_t node)
{
    const uint32_t intervals = is->torques - 1u;
    if (node >= intervals || intervals <= 1u) {
        return false;
    }
    const float own = (torque_at(is, node + 1u) - torque_at(is, node)) * 8.0f;
    return (node == 0u || torque_at(is, node) - torque_at(is, node - 1u) >= own) &&
           (node + 1u == intervals || torque_at(is, node + 2u) - torque_at(is, node + 1u) >= own);
}

static bool is_jump(const check *is, uint32_t node)
{
    return (is->jumps >> node & 1u) != 0u;
}

static uint32_t node_at(const check *is, uint32_t index)
{
    return is->nodes + index * (is->torques > 1u ? NODE_WORDS : 2u * NODE_WORDS);
}

/* What D and H can give at each node, and between it and the one before: a cubic stays within its control points. */
static bool check_nodes(check *is)
{
    const float most = (float)counts_of_rad((double)0.05f);
    float torque_below = 0.0f, mean_below = 0.0f, slope_below = 0.0f, half_below = 0.0f;
    for (uint32_t index = 0u; index < is->torques * is->temperatures; index++) {
        const uint32_t node = index % is->torques, at = node_at(is, index);
        const float mean = number_at(is->table, at), slope = number_at(is->table, at + 1u), half = number_at(is->table, at + 2u);
        if (!in_range(is, FXT_MEAN, index, mean, -most, most) || !finite_is(is, FXT_MEAN_SLOPE, index, slope) ||
            !in_range(is, FXT_HALF_WIDTH, index, half, 0.0f, most)) {
            return false;
        }
        if (((bits_of(half) & 1u) != 0u) != is_jump(is, node)) {
            return refuse(is, FXT_DERIVED, FXT_NO_FIELD, 4u * (at + 2u), 0);
        }
        if (is->torques == 1u) {
            for (uint32_t i = 0u; i < (uint32_t)NODE_WORDS; i++) {
                if (!derived_is(is, at + NODE_WORDS + i, word_at(is->table, at + i))) {
                    return false;
                }
            }
            if (!in_range(is, FXT_MEAN_SLOPE, index, slope, 0.0f, 0.0f)) {
                return false;
            }
        }
        const float torque = torque_at(is, node);
        is->error_rad = larger(is->error_rad, rad_of(magnitude(mean) + half));
        if (node > 0u && !is_jump(is, node - 1u)) {
            const float third = (torque - torque_below) / 3.0f;
            float inner = larger(magnitude(mean_below + slope_below * third), magnitude(mean - slope * third));
            inner = is_finite(inner) ? inner : float_of(0x7f800000u);
            is->error_rad = larger(is->error_rad, rad_of(inner + larger(half, half_below)));
        }
        torque_below = torque;
        mean_below = mean;
        slope_below = slope;
        half_below = half;
    }
    return true;
}

static uint32_t leading_zeros(uint64_t bits)
{
    uint32_t zeros = 0;
    for (uint64_t bit = (uint64_t)1 << 63; bit != 0u && (bits & bit) == 0u; bit >>= 1) {
        zeros++;
    }
    return zeros;
}

static uint32_t trailing_zeros(uint64_t bits)
{
    uint32_t zeros = 0;
    for (uint64_t bit = 1; bit != 0u && (bits & bit) == 0u; bit <<= 1) {
        zeros++;
    }
    return zeros;
}

/* Whether the error of both flanks grows with the load up to each node, and no faster than a drive can. */
static bool check_rise(check *is)
{
    const float pitch_rad = tau_f32 / (float)is->circular_spline_teeth;
    const uint32_t first = trailing_zeros(is->jumps), zeros = leading_zeros(is->jumps), last = zeros > 63u ? 0u : 63u - zeros;
    const float endless = float_of(0xff800000u);
    float highest[2] = {endless, endless};
    for (uint32_t index = 0u; index < is->torques * is->temperatures; index++) {
        const uint32_t torque = index % is->torques, temperature = index / is->torques;
        if (torque == 0u) {
            highest[0] = endless;
            highest[1] = endless;
            continue;
        }
        const uint32_t below = torque - 1u, from = node_at(is, index - 1u), to = node_at(is, index);
        const float mean_low = rad_of(number_at(is->table, from)), mean_high = rad_of(number_at(is->table, to));
        const float slope_low = rad_of(number_at(is->table, from + 1u)), slope_high = rad_of(number_at(is->table, to + 1u));
        const float half_low = rad_of(number_at(is->table, from + 2u)), half_high = rad_of(number_at(is->table, to + 2u));
        const float width = torque_at(is, torque) - torque_at(is, below), third = width / 3.0f;
        const bool jump = is_jump(is, below);
        const float rise = mean_high - mean_low;
        const float widening = jump ? half_high - half_low : (half_high - half_low) / 3.0f;
        const float a = jump ? rise : slope_low * third;
        const float b = jump ? rise : rise - (slope_low + slope_high) * third;
        const float c = jump ? rise : slope_high * third;
        const float allowed = jump ? 0.5f * pitch_rad : 1.0f * third;
        const float most = larger(larger(a, b), c) + magnitude(widening);
        float least = -larger(larger(-a, -b), -c) - magnitude(widening);
        for (int side = 0; side < 2; side++) {
            const float sign = side == 0 ? -1.0f : 1.0f;
            highest[side] = larger(highest[side], mean_low + sign * half_low);
            const float change = mean_high + sign * half_high - highest[side];
            least = change < least ? change : least;
        }
        const bool lets_go = first < below && below < last && !jump;
        if (least < -(lets_go ? 0.5f * pitch_rad : 5.0e-5f)) {
            return refuse(is, FXT_FALLS, FXT_NO_FIELD, torque, temperature);
        }
        if (most > allowed + 5.0e-5f) {
            return refuse(is, FXT_STEEP, FXT_NO_FIELD, torque, temperature);
        }
    }
    return true;
}

/* Numbers of a closed curve, rad: of A, B, C, or of a ripple. */
typedef struct {
    const fxt_table *table;
    uint32_t words, halves; /* where it starts: in words; or in half words from there */
    bool is_ripple;
    float unit;
} curve;

static int32_t half_at(const fxt_table *table, uint32_t words, uint32_t half)
{
    const uint32_t word = word_at(table, words + half / 2u);
    return half % 2u == 0u ? low(word) : high(word);
}

static float curve_rad(const curve *of, uint32_t i)
{
    if (of->is_ripple) {
        return rad_of((float)half_at(of->table, of->words, of->halves + i) * of->unit);
    }
    return rad_of((float)i32(word_at(of->table, of->words + i)) * 0.5f);
}

/* What a closed B-spline has at most: coefficient, slope per node spacing, value. */
static void extremes(const curve *of, uint32_t count, float most[3])
{
    most[0] = 0.0f;
    most[1] = 0.0f;
    most[2] = 0.0f;
    for (uint32_t i = 0u; i + 2u < count; i++) {
        const float a = curve_rad(of, i), b = curve_rad(of, i + 1u), c = curve_rad(of, i + 2u);
        const float turn = (a - b) / (a - 2.0f * b + c);
        const float there = 0.5f * (a + b) + 0.5f * turn * (b - a);
        const float top = turn > 0.0f && turn < 1.0f ? magnitude(there) : 0.0f;
        most[0] = larger(most[0], magnitude(a));
        most[1] = larger(most[1], magnitude(b - a));
        most[2] = larger(most[2], larger(top, 0.5f * magnitude(a + b)));
    }
}

static const float weight_rounding = 3.0f / 32768.0f;

/* A record: closed, the play nowhere negative, and what its two ripples can give. */
static bool check_record(check *is, uint32_t index)
{
    const fxt_table *table = is->table;
    const uint32_t words = is->records + index * is->record, nodes = is->ripple_nodes;
    const float unit = (float)word_at(table, AT_RIPPLE_UNIT) * (1.0f / 524288.0f);
    for (uint32_t i = 0u; i < 2u * is->record; i++) {
        const uint32_t first = i < is->record ? 0u : is->record;
        const uint32_t node = (i - first + nodes - 1u) % nodes + 1u;
        if (half_at(table, words, i) != half_at(table, words, first + node)) {
            return refuse(is, FXT_NOT_CLOSED, FXT_MEAN_RIPPLE, i, 0);
        }
    }
    const float half = number_at(table, node_at(is, index) + 2u);
    float least = half;
    for (uint32_t i = 0u; i < stored(nodes); i++) {
        const float forward = (float)half_at(table, words, i), backward = (float)half_at(table, words, i + is->record);
        const float play = half + 0.5f * (backward * unit - forward * unit);
        least = play < least ? play : least;
    }
    if (least < -(3.0f + unit)) {
        return refuse(is, FXT_NEGATIVE_HALF_WIDTH, FXT_NO_FIELD, index % is->torques, index / is->torques);
    }
    const float cells_per_rad = (float)nodes * magnitude(is->tooth_periods) / tau_f32;
    for (uint32_t side = 0u; side < 2u; side++) {
        const curve of = {table, words, side * is->record, true, unit};
        float most[3];
        extremes(&of, stored(nodes), most);
        is->periodic_rad = larger(is->periodic_rad, most[0]);
        is->slope = larger(is->slope, most[1] * cells_per_rad);
        is->cells = larger(is->cells, most[2] * cells_per_rad);
        is->rounding_rad = larger(is->rounding_rad, weight_rounding * most[1]);
    }
    return true;
}

static bool check_curve(check *is, uint32_t index)
{
    const fxt_field field = curve_field(index);
    const uint32_t nodes = is->curve_nodes[index], count = stored(nodes), at = is->curves[index];
    const curve of = {is->table, at, 0, false, 0.0f};
    for (uint32_t i = 0u; i < count; i++) {
        if (!in_range(is, field, i, curve_rad(&of, i), -0.05f, 0.05f)) {
            return false;
        }
    }
    if (count > 0u) {
        const uint32_t repeats[3] = {0, nodes + 1u, nodes + 2u}, own[3] = {nodes, 1, 2};
        for (int i = 0; i < 3; i++) {
            if (word_at(is->table, at + repeats[i]) != word_at(is->table, at + own[i])) {
                return refuse(is, FXT_NOT_CLOSED, field, repeats[i], 0);
            }
        }
    }
    float most[3];
    extremes(&of, count, most);
    const float periods = index == 0u ? is->ratio : index == 1u ? is->ratio - 1.0f : 1.0f;
    if (index == 0u) {
        is->error_rad = is->error_rad + is->periodic_rad;
    }
    const float slope = most[1] * (float)nodes * magnitude(periods) / tau_f32;
    is->rounding_rad = is->rounding_rad + 2.0f * weight_rounding * most[1];
    is->error_rad = is->error_rad + most[0];
    is->periodic_rad = is->periodic_rad + most[0];
    is->slope = is->slope + slope;
    is->curve_slope = is->curve_slope + slope;
    return true;
}

/* Iterations of the inverse and what they leave, by the rougher bound or, where that does not do, by the other, as in the core; the words
   that say so. */
static bool check_inverse(check *is)
{
    fxt_table *table = is->table;
    const float cell_rad = is->ripple_nodes == 0u ? float_of(0x7f800000u) : rad_of(magnitude(table->cell_width));
    const float place = is_finite(cell_rad) ? 4.0f * FLT_EPSILON * cell_rad : 0.0f;
    const float ripple = is->slope - is->curve_slope;
    float left = 1.0f;
    uint32_t iterations = 0;
    for (uint32_t most = USUAL_ITERATIONS; most <= (uint32_t)MOST_ITERATIONS && !(left <= 1.0e-6f); most += MORE_ITERATIONS) {
        const bool steep = most > (uint32_t)USUAL_ITERATIONS;
        const float rate = is->curve_slope / (1.0f - (steep ? ripple : is->slope));
        const float of_left = steep ? ripple * (1.0f + rate) : 1.0f + rate, of_beyond = steep ? 1.0f + ripple : 0.0f;
        float away = is->cells * cell_rad + (steep ? 0.0f : is->periodic_rad * rate);
        left = is->periodic_rad;
        iterations = 0;
        while (iterations < most) {
            const float beyond = larger(away - cell_rad, 0.0f);
            left = left * rate + beyond;
            away = left * of_left + beyond * of_beyond;
            iterations++;
            if (left <= 1.0e-7f) {
                break;
            }
        }
        left = left + (is->rounding_rad + place) / (1.0f - is->slope);
    }
    if (!(left <= 1.0e-6f)) {
        return refuse(is, FXT_INVERSE, FXT_NO_FIELD, 0, 0);
    }
    table->inverse_error_rad = left;
    const double left_counts = counts_of_rad((double)number_within(left, 0.0f, 1.0e-6f));
    const uint32_t hold = to_u32(left_counts) + (uint32_t)HOLD_COUNTS;
    return derived_is(is, AT_ITERATIONS, iterations) && derived_is(is, AT_HOLD, hold);
}

static bool check_numbers(check *is)
{
    if (!check_places(is) || !check_axis(is, FXT_TORQUE_NODES, AT_TORQUE_NODES, is->torques, TORQUE_SLOTS) ||
        !check_axis(is, FXT_TEMPERATURE_NODES, AT_TEMPERATURE_NODES, is->temperatures, TEMPERATURE_SLOTS) ||
        !check_header_numbers(is)) {
        return false;
    }
    for (uint32_t i = 0u; i < is->torques; i++) {
        is->jumps |= (uint64_t)(jump_at(is, i) ? 1u : 0u) << i;
    }
    if (!check_nodes(is)) {
        return false;
    }
    if (is->ripple_nodes > 0u) {
        for (uint32_t i = 0u; i < is->torques * is->temperatures; i++) {
            if (!check_record(is, i)) {
                return false;
            }
        }
    }
    for (uint32_t i = 0u; i < 3u; i++) {
        if (!check_curve(is, i)) {
            return false;
        }
    }
    if (!(is->error_rad <= number_at(is->table, 38))) {
        return refuse(is, FXT_ERROR_BOUND, FXT_NO_FIELD, 0, 0);
    }
    if (!(is->slope < 1.0f)) {
        return refuse(is, FXT_SLOPE, FXT_NO_FIELD, 0, 0);
    }
    return check_rise(is) && check_inverse(is);
}

/* What is computed as the core computes it: products rounded before they are added, small numbers kept, to nearest. */
static bool arithmetic_is_exact(void)
{
    volatile float a = 1.0f + 1.0f / 4096.0f, b = 1.0f + 2.0f / 4096.0f, least = FLT_MIN, one = 1.0f, bit = 0.75f * FLT_EPSILON;
    const float x = a, y = b, product_less = x * x - y, low_sum = x * x + -y;
    const float half = least * 0.5f, up = one + bit, down = -one - bit;
    return product_less == 0.0f && low_sum == 0.0f && half > 0.0f && up == one + FLT_EPSILON && down == -one - FLT_EPSILON;
}

/* One that was refused. */
static const fxt_table no_table;

/* A change of one word always changes it, as the factor is odd: that of the core's sums (core/src/whole.rs). */
#define SUM_FACTOR 4294957665u
static inline uint32_t factor_sum_of(const fxt_factor *factor, uint32_t sum)
{
    const uint32_t lower = sum * SUM_FACTOR + (uint32_t)factor->fraction, upper = lower * SUM_FACTOR + (uint32_t)(factor->fraction >> 32);
    return upper * SUM_FACTOR + factor->whole;
}

static inline uint32_t ratio_sum_of(const fxt_table *table)
{
    return factor_sum_of(&table->to_generator, factor_sum_of(&table->to_output, table->reversed));
}

/* Where memory changed, nothing is read beyond the image, and no command is away by turns: neither is bounded by the limit of the table. */
static inline const fxt_table *given(const fxt_table *table)
{
    return table != NULL && table->image == table->again && table->ratio_sum == ratio_sum_of(table) ? table : &no_table;
}

static bool is_whole(const fxt_table *table)
{
    return table->image != NULL && table->sum == sum_of(table);
}

/* All checks in their order. */
static bool check_image(check *is, const uint8_t *image, uint32_t bytes)
{
    fxt_table *table = is->table;
    table->image = image;
    table->again = image;
    table->bytes = bytes;
    if (!check_identity(is, image)) {
        return false;
    }
    for (uint32_t page = 0u; page < pages_of(table); page++) {
        if (!page_matches(table, page)) {
            return refuse(is, FXT_PAGE_CRC, FXT_NO_FIELD, page, 0);
        }
    }
    return check_numbers(is);
}

/* What a step needs of an image that was checked: as the core's plan. */
static void fill_in(fxt_table *table, const check *is)
{
    const float bounds[6] = {is->error_rad, is->periodic_rad, is->slope, is->curve_slope, is->cells, is->rounding_rad};
    table->ripple_nodes = word_at(table, AT_RECORD_STEP) >> 16;
    table->ripple_unit = word_at(table, AT_RIPPLE_UNIT);
    table->ripple_cells = to_i32((float)table->ripple_unit * (8388608.0f / table->cell_width));
    for (uint32_t i = 0u; i < 3u; i++) {
        table->curves[i] = word_at(table, AT_CURVE_WORDS + i);
    }
    table->limit = i32(word_at(table, AT_LIMIT));
    table->iterations = word_at(table, AT_ITERATIONS);
    table->hold = i32(word_at(table, AT_HOLD));
    for (uint32_t i = 0u; i < 6u; i++) {
        table->bounds[i] = bounds[i];
    }
    table->ratio_sum = ratio_sum_of(table);
    table->sum = sum_of(table);
}

fxt_verdict fxt_open(fxt_table *table, const void *image, size_t bytes)
{
    const check start = {0};
    check is = start;
    const uint8_t *at = image;
    if (table == NULL) {
        (void)refuse(&is, FXT_NO_TABLE, FXT_NO_FIELD, 0, 0);
        return is.verdict;
    }
    *table = no_table;
    is.table = table;
    if (!arithmetic_is_exact()) {
        (void)refuse(&is, FXT_ARITHMETIC, FXT_NO_FIELD, 0, 0);
    } else if (check_envelope(&is, at, bytes) && check_image(&is, at, (uint32_t)bytes)) {
        fill_in(table, &is);
    } else {
        *table = no_table;
    }
    return is.verdict;
}

const char *fxt_reason_name(fxt_reason reason)
{
    static const char *const names[] = {
        "ok", "too short", "magic", "version", "byte order", "length", "crc", "page crc", "reserved", "text", "generator kind",
        "fixed member", "teeth", "count", "size", "not finite", "not increasing", "not closed", "derived", "out of range",
        "negative half-width", "error bound", "slope", "falls", "steep", "inverse", "arithmetic", "no table"};
    return (uint32_t)reason < sizeof names / sizeof names[0] ? names[reason] : "unknown";
}

const char *fxt_field_name(fxt_field field)
{
    static const char *const names[] = {
        "none", "tool version", "mesh level", "torque nodes", "temperature nodes", "ripple nodes", "curve over the generator angle",
        "curve over the material phase", "curve over the output angle", "mean error", "half-width of the play",
        "slope of the mean error", "ripple of the mean", "solver residual", "worst projection error", "rms projection error",
        "torque range", "temperature range", "error limit"};
    return (uint32_t)field < sizeof names / sizeof names[0] ? names[field] : "unknown";
}

fxt_info fxt_tell(const fxt_table *table)
{
    fxt_info info = {0};
    const uint8_t *image = given(table)->image;
    if (image == NULL) {
        return info;
    }
    for (uint32_t i = 0u; i < 8u; i++) {
        info.table_id[i] = image[48u + i];
    }
    for (uint32_t i = 0u; i < 32u; i++) {
        info.drive_hash[i] = image[16u + i];
    }
    for (uint32_t i = 0u; i < (uint32_t)TEXT_BYTES; i++) {
        info.tool_version[i] = (char)image[56u + i];
        info.mesh_level[i] = (char)image[80u + i];
    }
    info.generator_kind = image[104];
    info.fixed_member = image[105];
    info.flexspline_teeth = (uint16_t)u16_at(image, 106);
    info.circular_spline_teeth = (uint16_t)u16_at(image, 108);
    info.torque_nodes = image[110];
    info.temperature_nodes = image[111];
    info.ripple_nodes = image[112];
    for (uint32_t i = 0u; i < 3u; i++) {
        info.curve_nodes[i] = image[113u + i];
    }
    for (uint32_t i = 0u; i < 2u; i++) {
        info.torque_range_n_m[i] = number_at(table, AT_TORQUE_RANGE + i);
        info.temperature_range_c[i] = number_at(table, AT_TEMPERATURE_RANGE + i);
    }
    const uint32_t waves = (uint32_t)info.circular_spline_teeth - info.flexspline_teeth;
    const uint32_t teeth = table->reversed != 0u ? info.flexspline_teeth : info.circular_spline_teeth;
    const float ratio = (float)teeth / (float)(waves > 0u ? waves : 1u);
    info.ratio = table->reversed != 0u ? -ratio : ratio;
    info.error_limit_rad = number_at(table, 38);
    info.solver_residual = number_at(table, 31);
    info.projection_worst_rad = number_at(table, 32);
    info.projection_rms_rad = number_at(table, 33);
    info.inverse_error_rad = table->inverse_error_rad;
    info.inverse_iterations = table->iterations;
    return info;
}

uint32_t fxt_page_count(const fxt_table *table)
{
    return is_whole(given(table)) ? pages_of(table) : 1u;
}

bool fxt_page_intact(const fxt_table *table, uint32_t page)
{
    return page < fxt_page_count(table) && is_whole(given(table)) && page_matches(table, page);
}

fxt_play fxt_play_unknown(void)
{
    return kept(&unknown_state);
}

fxt_play fxt_play_after(fxt_direction direction)
{
    const int32_t side = i32(direction == FXT_FORWARD ? 0x80000000u : 0x7fffffffu);
    const play_state is = {0, 0, side, side, -1, {0, 0}};
    return kept(&is);
}

bool fxt_play_known(const fxt_play *play)
{
    const play_state is = state_of(play);
    return is.lower == is.upper;
}

bool fxt_play_output(const fxt_play *play, int64_t *output)
{
    const play_state is = state_of(play);
    if (output == NULL) {
        return false;
    }
    *output = plus(is.nominal, is.error);
    return is.half >= 0;
}

float fxt_play_offset_rad(const fxt_play *play)
{
    const play_state is = state_of(play);
    return is.half < 0 ? 0.0f : (float)play_offset(&is) * rad_per_count;
}

float fxt_play_uncertainty_rad(const fxt_play *play)
{
    const play_state is = state_of(play);
    return (float)play_uncertainty(&is) * rad_per_count;
}

static void put_word(uint8_t *to, uint32_t word)
{
    for (uint32_t i = 0u; i < 4u; i++) {
        to[i] = (uint8_t)(word >> 8u * i & 0xffu);
    }
}

void fxt_play_save(const fxt_play *play, uint8_t saved[FXT_SAVED_PLAY_BYTES])
{
    const play_state is = state_of(play);
    if (saved == NULL) {
        return;
    }
    put_word(saved, (uint32_t)is.nominal);
    put_word(saved + 4, (uint32_t)((uint64_t)is.nominal >> 32));
    put_word(saved + 8, (uint32_t)is.error);
    put_word(saved + 12, (uint32_t)is.lower);
    put_word(saved + 16, (uint32_t)is.upper);
    put_word(saved + 20, (uint32_t)is.half);
    put_word(saved + 24, crc32_of(saved, 24));
}

bool fxt_play_restore(fxt_play *play, const uint8_t saved[FXT_SAVED_PLAY_BYTES])
{
    if (play == NULL || saved == NULL) {
        return false;
    }
    const uint64_t nominal = (uint64_t)word_from(saved + 4) << 32 | word_from(saved);
    const play_state found = {(int64_t)nominal, i32(word_from(saved + 8)), i32(word_from(saved + 12)), i32(word_from(saved + 16)),
                              i32(word_from(saved + 20)), {0, 0}};
    const uint32_t size = found.error < 0 ? 0u - (uint32_t)found.error : (uint32_t)found.error;
    const bool started =
        found.half >= 0 && found.half <= MOST_PLAY && found.lower >= -found.half && found.upper <= found.half;
    const bool fresh = found.half == -1 && (found.lower == INT32_MIN || found.lower == INT32_MAX);
    const bool possible = found.lower <= found.upper && size <= MOST_KEPT && (started || fresh);
    if (!possible || word_from(saved + 24) != crc32_of(saved, 24)) {
        return false;
    }
    *play = kept(&found);
    return true;
}

/* Without a play nothing can be corrected. */
fxt_prediction fxt_forward(const fxt_table *table, fxt_play *play, int64_t generator, float torque_n_m, float temperature_c)
{
    const fxt_table *of = given(table);
    point at = locate(of, torque_n_m, temperature_c);
    at.finite = at.finite && play != NULL;
    play_state is = state_of(play);
    const fxt_prediction now = follow(of, &at, &is, generator);
    if (play != NULL) {
        *play = kept(&is);
    }
    return now;
}

fxt_command fxt_inverse(const fxt_table *table, int64_t target, float torque_n_m, float temperature_c, fxt_direction direction)
{
    const fxt_table *of = given(table);
    const point at = locate(of, torque_n_m, temperature_c);
    return aim_moving(of, &at, target, direction == FXT_BACKWARD);
}

fxt_command fxt_inverse_from(const fxt_table *table, int64_t target, float torque_n_m, float temperature_c, const fxt_play *play)
{
    const fxt_table *of = given(table);
    point at = locate(of, torque_n_m, temperature_c);
    at.finite = at.finite && play != NULL;
    const play_state is = state_of(play);
    return aim_from(of, &at, target, &is);
}

void fxt_step(const fxt_table *table, fxt_play *play, int64_t measured, int64_t target, float torque_n_m, float temperature_c,
              fxt_prediction *prediction, fxt_command *command)
{
    const fxt_table *of = given(table);
    point at = locate(of, torque_n_m, temperature_c);
    at.finite = at.finite && play != NULL;
    play_state is = state_of(play);
    const fxt_prediction now = follow(of, &at, &is, measured);
    if (play != NULL) {
        *play = kept(&is);
    }
    if (prediction != NULL) {
        *prediction = now;
    }
    if (command != NULL) {
        *command = aim_from(of, &at, target, &is);
    }
}

bool fxt_steady_error(const fxt_table *table, int64_t generator, float torque_n_m, float temperature_c, fxt_direction direction,
                      float *error_rad)
{
    if (given(table)->image == NULL || error_rad == NULL) {
        return false;
    }
    const point at = locate(table, torque_n_m, temperature_c);
    const phases where = phases_at(table, generator, nominal_output(table, generator));
    int32_t centre, half;
    const bool sane = play_at(table, &at, &where, &centre, &half);
    *error_rad = (float)(direction == FXT_BACKWARD ? add(centre, half) : sub(centre, half)) * rad_per_count;
    return sane && at.finite;
}

/* A joint: what the core's `Joint` does in a tick with one copy of a table and nothing added to it (core/src/joint/runtime.rs). */

/* Parts of a count that a correction is kept in. */
#define FINE INT32_C(8)
/* The fastest correction, and what it may change by, in a tick: 0.05 rad; a quarter of the integers. */
#define MOST_RATE (0.05 * (TURN / TAU) * 8.0)
#define MOST_CHANGE INT32_C(0x20000000)

/* The flank that the last motion went to. */
#define NO_FLANK 0u
#define FLANK_FORWARD 1u
#define FLANK_BACKWARD 2u

/* Samples in a row that were believed: with the second there is a way in a tick, with the third a change of it. */
#define HAS_STEP 2u
#define HAS_BEND 3u
/* Most ticks without a sample that are counted. */
#define MOST_GAP 15u
/* Without a given acceleration a sample that is out and back is taken back where it needs full speed in less than 2^6 ticks. */
#define SPIKE_SHIFT 6u

static inline uint32_t to_count(float value)
{
    const int32_t whole = to_i32(value);
    return whole > 0 ? (uint32_t)whole : 0u;
}

static inline int32_t between(int32_t value, int32_t least, int32_t most)
{
    const int32_t above = value > least ? value : least;
    return above < most ? above : most;
}

/* Within its range; of NaN nothing is. */
static bool may_be(double counts, double least, double most)
{
    return counts >= least && counts <= most;
}

fxt_limit fxt_joint_init(fxt_joint *joint, const fxt_limits *limits)
{
    static const fxt_limits no_limits;
    const fxt_joint no_joint = {0};
    if (joint == NULL) {
        return FXT_NO_JOINT;
    }
    *joint = no_joint;
    const fxt_limits is = limits != NULL ? *limits : no_limits;
    const double tick = (double)is.tick_s, rate = counts_of_rad((double)is.rate_rad_s * tick) * 8.0;
    const double change = counts_of_rad((double)is.acceleration_rad_s2 * tick * tick) * 8.0;
    const double move = counts_of_rad((double)is.generator_rate_rad_s * tick), hold = counts_of_rad((double)is.hold_rad);
    if (!may_be(tick, 1.0e-7, 1.0e3)) {
        return FXT_TICK;
    }
    if (!may_be(rate, 1.0, MOST_RATE)) {
        return FXT_RATE;
    }
    if (!may_be(change, 1.0, 1.0e12)) {
        return FXT_ACCELERATION;
    }
    if (!may_be(move, 1.0, 2147483000.0)) {
        return FXT_GENERATOR_RATE;
    }
    if (is.hold_rad != 0.0f && !may_be(hold, 1.0, 0.05 * (TURN / TAU))) {
        return FXT_HOLD_RAD;
    }
    if ((uint32_t)is.overrun > (uint32_t)FXT_FADE_OUT) {
        return FXT_OVERRUN_POLICY;
    }
    /* More than from full speed to full speed back is not needed, and would drown what is left to go in rounding. */
    const float fast = (float)rate, quick = within((float)change, 1.0f, 2.0f * fast);
    joint->rate = to_i32(fast);
    joint->acceleration = quick < (float)MOST_CHANGE ? to_i32(quick) : MOST_CHANGE;
    joint->largest_move = to_i32((float)move);
    joint->largest_bend = joint->largest_move;
    joint->spike = shifted(joint->largest_move, SPIKE_SHIFT);
    joint->tick_s = is.tick_s;
    joint->hold = to_i32((float)hold);
    /* One tick more can still be counted. */
    joint->patience = (uint16_t)(is.patience < UINT16_MAX ? is.patience : UINT16_MAX - 1u);
    joint->fade = (uint16_t)(is.overrun == FXT_FADE_OUT ? is.fade_ticks : 0u);
    joint->fade_step = joint->fade > 0u ? 1.0f / (float)joint->fade : 0.0f;
    joint->hold_late = is.overrun == FXT_HOLD_LAST ? 1u : 0u;
    return FXT_LIMITS_OK;
}

/* Made, and of a number that an init can have left: memory of zeros, or any other, is no joint. */
static bool is_made(const fxt_joint *joint)
{
    return joint != NULL && joint->rate >= 1 && joint->acceleration >= 1 && joint->acceleration <= MOST_CHANGE &&
           joint->rate <= MOST_CHANGE;
}

bool fxt_joint_limit_acceleration(fxt_joint *joint, float rad_s2)
{
    if (!is_made(joint)) {
        return false;
    }
    const double tick = (double)joint->tick_s, counts = counts_of_rad((double)rad_s2 * tick * tick);
    if (!may_be(counts, 1.0, DBL_MAX)) {
        return false;
    }
    /* From full speed to full speed back is all that samples within the largest move can do. */
    const int32_t most = saturate((int64_t)joint->largest_move * 2), bend = to_i32(counts < TURN ? (float)counts : (float)TURN);
    joint->largest_bend = bend < most ? bend : most;
    joint->spike = joint->largest_bend;
    return true;
}

fxt_mode fxt_joint_mode(const fxt_joint *joint)
{
    return is_made(joint) ? joint->mode : FXT_SAFE;
}

bool fxt_joint_request(fxt_joint *joint, fxt_mode mode)
{
    if (!is_made(joint)) {
        return false;
    }
    const fxt_mode from = joint->mode;
    const bool stops = mode == FXT_OFF || mode == FXT_SAFE;
    const bool starts = mode == FXT_TRACKING && (from == FXT_OFF || from == FXT_TRACKING || from == FXT_HOLD);
    const bool stays = mode == FXT_HOLD && (from == FXT_TRACKING || from == FXT_HOLD);
    const bool may = stops || starts || stays;
    joint->mode = may ? mode : from;
    return may;
}

void fxt_joint_forget_side(fxt_joint *joint)
{
    if (joint != NULL) {
        joint->play = kept(&unknown_state);
        joint->flank = NO_FLANK;
        joint->in_a_row = 0u;
    }
}

static uint64_t size_of(int64_t way)
{
    return way < 0 ? (uint64_t)0 - (uint64_t)way : (uint64_t)way;
}

/* A change of the way from tick to tick that noise makes, counts of the generator: twice the dead band. */
static int32_t noise_of(const fxt_table *table, const fxt_joint *joint)
{
    const uint32_t way = (uint32_t)joint->hold * 2u;
    const uint64_t counts = (uint64_t)factor_of(&table->to_generator, (int64_t)way);
    return counts > (uint64_t)(uint32_t)joint->largest_move ? joint->largest_move : i32((uint32_t)counts);
}

/* The size of a change; of one below zero one less, as in the core. */
static inline int32_t bend_size(int32_t bend)
{
    return bend < 0 ? sub(-1, bend) : bend;
}

/* A sample, judged: whether it is there and believed; whether it is not believed, or takes the one before back; whether the side of the play is not
 * known any more. */
typedef struct {
    bool good, glitch, back, forgotten;
} judged;

static judged judge(fxt_joint *now, const fxt_input *input, int32_t noise)
{
    const bool present = input->has_generator, was_sampled = now->sampled != 0u;
    const int64_t sample = present ? input->generator : now->generator, way = minus(sample, now->generator);
    const int32_t step = i32((uint32_t)way), bend = saturate((int64_t)step - now->step), size = bend_size(bend);
    const int32_t largest_bend = now->largest_bend > noise ? now->largest_bend : noise, spike = now->spike > noise ? now->spike : noise;
    /* As far as it may in each tick since the last sample. */
    const uint32_t gap = now->gap + input->missed_ticks + 1u, most_gap = gap < MOST_GAP ? gap : MOST_GAP;
    const uint64_t most = (uint64_t)(uint32_t)now->largest_move * gap;
    const bool wide = way != step, far = was_sampled && size_of(way) > most;
    /* The way of a tick that came late is that of several. */
    const uint32_t row = present && input->missed_ticks == 0u ? now->in_a_row : 0u;
    /* The sample before was out, and this one is back: without that one the way would hardly have changed. */
    const int32_t without = saturate((int64_t)saturate((int64_t)bend + now->bend) + now->bend);
    judged is;
    is.back = row >= HAS_BEND && !wide && size > spike && bend_size(without) <= shifted(size, 1u);
    const bool bent = row >= HAS_STEP && size > largest_bend, doubted = (far || bent) && !is.back;
    const uint32_t glitches = doubted ? now->glitches + 1u : 0u;
    const bool believed = glitches > now->patience;
    is.glitch = doubted && !believed;
    is.good = present && !is.glitch;
    /* After too long without an answer of the table nobody followed the play. */
    is.forgotten = believed || (was_sampled && now->uncorrected > now->patience);
    /* A tick in which a new place is believed has no way. */
    const uint32_t more = row < HAS_BEND ? row + 1u : HAS_BEND, in_a_row = is.good && !believed ? more : 0u;
    /* In a late tick one that is wrong may be off by the way of as many more. */
    const uint32_t passed = now->unseen + 1u + 2u * input->missed_ticks, unseen = passed < UINT16_MAX ? passed : UINT16_MAX;
    now->glitches = (uint16_t)(believed ? 0u : glitches);
    now->generator = is.glitch ? now->generator : sample;
    now->sampled = was_sampled || is.good ? 1u : 0u;
    /* The flank that the sample before moved is taken back with it. */
    now->flank = is.back ? now->flank_before : now->flank;
    /* One sample or two may each look like motion and be wrong. */
    now->unseen = (uint16_t)(in_a_row >= HAS_BEND ? 0u : unseen);
    now->in_a_row = (uint8_t)(is.forgotten ? 0u : in_a_row);
    now->gap = (uint8_t)(present ? 0u : most_gap);
    now->step = is.back ? add(shifted(step, 1u), shifted(now->step, 1u)) : step;
    now->bend = is.back ? 0 : bend;
    return is;
}

/* A part of a goal, of 0 to 1. */
static int32_t part_of(int32_t goal, float part)
{
    return to_i32((float)goal * part);
}

/* The correction wanted in this tick, fine counts: by mode, in a tick that came late, and while none can be made. */
static int32_t goal_of(fxt_joint *now, bool late, int32_t wanted_counts, bool sane)
{
    const uint32_t missing = now->uncorrected < UINT16_MAX ? now->uncorrected + 1u : now->uncorrected;
    now->uncorrected = (uint16_t)(sane ? 0u : missing);
    const bool off = now->uncorrected > now->patience || (now->mode != FXT_TRACKING && now->mode != FXT_HOLD);
    const bool keep = !sane || now->mode == FXT_HOLD || (late && now->hold_late != 0u);
    const int32_t wanted = keep ? now->goal : mul(wanted_counts, FINE);
    /* Whatever is to be kept. */
    now->goal = off ? 0 : wanted;
    /* Down in `fade` ticks, late or not, and none for as many, with each late one anew; without that policy `fade` is 0. */
    const uint32_t left = now->fading > 0u ? now->fading - 1u : 0u, least = late ? now->fade : 0u, start = now->fading > 0u ? 0u : least;
    now->fading = (left > least ? left : least) + start;
    const uint32_t above = now->fading > now->fade ? now->fading - now->fade : 0u;
    return now->fading > 0u ? part_of(now->goal, (float)above * now->fade_step) : now->goal;
}

/* What braking in so many whole ticks takes. */
static inline uint32_t way_of(uint32_t braking, uint32_t ticks)
{
    return (braking * ticks * (ticks + 1u)) >> 1;
}

/* The speed that can be stopped at the goal in whole ticks, braking with half of the acceleration; its sign is the way to go. */
static int32_t stoppable(int32_t acceleration, int32_t lag)
{
    const uint32_t away = lag < 0 ? 0u - (uint32_t)lag : (uint32_t)lag, braking = ((uint32_t)acceleration + 1u) >> 1;
    /* Rounded up, so that it is right or one too many. */
    const float root = root_of(1.0f + 8.0f * ((float)away / (float)braking));
    const uint32_t up = to_count(0.5f * (root * (1.0f + 1e-6f) - 1.0f));
    const uint32_t ticks = way_of(braking, up) > away ? up - 1u : up;
    /* Below 2^17, the root of twice the integers. */
    const uint32_t speed = (away + way_of(braking, ticks)) / (1u + (ticks & 0x1ffffu));
    return i32(lag < 0 ? 0u - speed : speed);
}

/* A correction moved by what is wanted: within acceleration, rate and size, whatever is wanted. */
static int32_t moved_by(fxt_joint *now, int32_t wanted, int32_t size)
{
    const int32_t before = now->correction;
    const int32_t slower = sub(now->speed, now->acceleration), faster = add(now->speed, now->acceleration);
    const int32_t speed = between(between(wanted, slower, faster), sub(0, now->rate), now->rate);
    /* Where a table with a smaller limit is used it is on its way back, and goes no further out. */
    const int32_t least = before < -size ? before : -size, most = before > size ? before : size;
    now->correction = between(add(before, speed), least, most);
    now->speed = sub(now->correction, before);
    return now->correction;
}

/* Without a table or a joint: where the generator is by what there is; 0 where nothing is known. */
static fxt_output standing(const fxt_input *input, int64_t generator)
{
    fxt_output out = {0, 0, 0.0f, 0.05f, 0.0f, 0.0f, FXT_DISABLED, FXT_NOT_CORRECTED | FXT_NO_JOINT_OR_TABLE};
    out.command = input != NULL && input->has_generator ? input->generator : generator;
    return out;
}

fxt_output fxt_tick(const fxt_table *table, fxt_joint *joint, const fxt_input *input)
{
    if (!is_made(joint) || input == NULL || given(table)->image == NULL) {
        return standing(input, joint != NULL ? joint->generator : 0);
    }
    const point at = locate(table, input->torque_n_m, input->temperature_c);
    const judged sample = judge(joint, input, noise_of(table, joint));
    play_state play = state_of(&joint->play);
    if (sample.back) {
        play_take_back(&play, joint->without);
    }
    play = sample.forgotten ? unknown_state : play;
    const estimate is = estimated(table, &at, &play, joint->generator);
    const int64_t output = plus(is.nominal, is.error);
    const departure from = departure_from(table, &at, input->target, &play, output);
    /* The flank that the last motion went to is kept for a target that is near. */
    const bool near_by = magnitude_of(from.ahead) < joint->hold && joint->flank != NO_FLANK;
    const bool was_backward = joint->flank == FLANK_BACKWARD, backward = near_by ? was_backward : from.backward;
    int32_t found;
    const bool sane = solve(table, &at, input->target, backward, &found) && is.sane && joint->sampled != 0u;
    const bool hold = from.hold && !near_by;
    const int32_t open = hold ? from.unknown : from.guess, aimed = sane ? add(open, at.jump) : table->limit;
    const bool late = input->missed_ticks > 0u;
    joint->flank_before = joint->flank;
    if (sane) {
        joint->flank = (uint8_t)(backward ? FLANK_BACKWARD : FLANK_FORWARD);
    }
    /* Held, the correction leaves the generator where it is. */
    const int32_t goal = goal_of(joint, late, hold ? add(from.ahead, is.error) : found, sane);
    const int32_t wanted = stoppable(joint->acceleration, sub(goal, joint->correction));
    const int32_t correction = moved_by(joint, wanted, mul(table->limit, FINE));
    /* Of what the table wants, whoever holds it back. */
    const int32_t asked = sane ? mul(hold ? add(from.ahead, is.error) : found, FINE) : goal, held_back = sub(asked, correction);
    /* Where the generator is is not known in this tick: the error is any that the table gives. */
    const int32_t least = sample.good ? 0 : add(table->limit, magnitude_of(is.error)), known = aimed > is.uncertainty ? aimed : is.uncertainty;
    const int32_t uncertainty = known > least ? known : least;
    /* Nothing was seen of the generator yet. */
    joint->play = kept(joint->sampled != 0u ? &play : &unknown_state);
    joint->without[0] = play.without[0];
    joint->without[1] = play.without[1];
    joint->missed_ticks += input->missed_ticks;
    fxt_output out;
    out.command = nominal_generator(table, minus(input->target, shifted(correction, 3u)));
    out.output = output;
    out.transmission_error_rad = (float)is.error * rad_per_count;
    out.uncertainty_rad = (float)uncertainty * rad_per_count;
    out.correction_rad = (float)correction * (rad_per_count / (float)FINE);
    out.held_back_rad = (float)held_back * (rad_per_count / (float)FINE);
    out.quality = quality_of(&at, sane, play.lower == play.upper && sample.good);
    out.flags = (input->has_generator ? 0u : (uint32_t)FXT_SAMPLE_LOST) | (sample.glitch || sample.back ? (uint32_t)FXT_GLITCH : 0u) |
                (late ? (uint32_t)FXT_LATE : 0u) | (magnitude_of(held_back) >= FINE ? (uint32_t)FXT_HELD_BACK : 0u) |
                (sane ? 0u : (uint32_t)FXT_NOT_CORRECTED) | (joint->mode == FXT_SAFE ? (uint32_t)FXT_IN_SAFE_MODE : 0u);
    return out;
}

/* An encoder (core/src/encoder.rs). */

/* Whether there was a reading; or that nothing shows any more which turn it is in. */
#define NOT_STARTED 0u
#define STARTED 1u
#define LOST 2u

static inline uint64_t most_of_bits(uint8_t bits)
{
    return UINT64_MAX >> ((64u - bits) & 63u);
}

static inline int64_t as_signed(const fxt_encoder *encoder, int64_t counts)
{
    return encoder->reversed != 0u ? minus(0, counts) : counts;
}

/* Whole turns, rounded down, and what is left. */
static int64_t turns_of(int64_t counts, int64_t per_turn, int64_t *left)
{
    const int64_t towards = counts / per_turn, rest = counts % per_turn;
    *left = rest < 0 ? rest + per_turn : rest;
    return rest < 0 ? minus(towards, 1) : towards;
}

/* The angle of so many counts since the zero, to the nearest. */
static int64_t encoder_angle(const fxt_encoder *encoder)
{
    const uint64_t per_turn = encoder->counts_per_turn;
    int64_t left;
    const uint64_t turns = (uint64_t)turns_of(as_signed(encoder, encoder->since_zero), (int64_t)per_turn, &left);
    /* Rounding up at the end of a turn carries into the next. */
    const uint64_t fraction = (((uint64_t)left << 32) + (per_turn >> 1)) / per_turn, angle = (turns << 32) + fraction;
    return (int64_t)angle;
}

static int64_t encoder_since_zero(const fxt_encoder *encoder, int64_t angle)
{
    const uint64_t per_turn = encoder->counts_per_turn, whole = (uint64_t)whole_turns(angle) * per_turn;
    const uint64_t counts = whole + (((uint64_t)(uint32_t)angle * per_turn + ((uint64_t)1 << 31)) >> 32);
    return as_signed(encoder, (int64_t)counts);
}

/* What the register reads where it has counted so far. */
static uint64_t encoder_register(const fxt_encoder *encoder, int64_t counts)
{
    int64_t left;
    if (encoder->wrap_bits > 0u) {
        return (uint64_t)counts & most_of_bits(encoder->wrap_bits);
    }
    (void)turns_of(counts, (int64_t)encoder->counts_per_turn, &left);
    return (uint64_t)left;
}

static bool can_read(const fxt_encoder *encoder, uint64_t reading)
{
    return encoder->wrap_bits > 0u ? reading <= most_of_bits(encoder->wrap_bits) : reading < encoder->counts_per_turn;
}

/* The shorter way from a reading to another; both can be read. Half of what the register counts is backward. */
static int64_t encoder_way(const fxt_encoder *encoder, uint64_t from, uint64_t to)
{
    const uint64_t turn = encoder->counts_per_turn, all = most_of_bits(encoder->wrap_bits);
    if (encoder->wrap_bits > 0u) {
        const uint64_t half = (all >> 1) + 1u, bits = (((to - from) & all) ^ half) - half;
        return (int64_t)bits;
    }
    const uint64_t ahead = to >= from ? to - from : to + turn - from, way = ahead * 2u >= turn ? ahead - turn : ahead;
    return (int64_t)way;
}

static bool is_encoder(const fxt_encoder *encoder)
{
    return encoder != NULL && encoder->counts_per_turn >= 2u && encoder->counts_per_turn <= 0x80000000u && encoder->wrap_bits <= 64u;
}

bool fxt_encoder_init(fxt_encoder *encoder, uint32_t counts_per_turn, uint8_t wrap_bits, bool reversed, int64_t zero_counts)
{
    const int64_t most = INT64_C(1) << 62;
    const fxt_encoder made = {0u, 0, zero_counts, counts_per_turn, wrap_bits, reversed ? 1u : 0u, NOT_STARTED};
    const fxt_encoder none = {0u, 0, 0, 0u, 0u, 0u, NOT_STARTED};
    if (encoder == NULL) {
        return false;
    }
    const bool may = is_encoder(&made) && zero_counts >= -most && zero_counts <= most;
    *encoder = may ? made : none;
    return may;
}

bool fxt_encoder_start(fxt_encoder *encoder, uint64_t reading, int64_t near_counts)
{
    if (!is_encoder(encoder) || !can_read(encoder, reading)) {
        return false;
    }
    const int64_t there = encoder_since_zero(encoder, near_counts);
    const uint64_t from = encoder_register(encoder, plus(there, encoder->zero_counts));
    encoder->since_zero = plus(there, encoder_way(encoder, from, reading));
    encoder->reading = reading;
    encoder->started = STARTED;
    return true;
}

/* Also where the reading that is kept cannot be: its memory changed. */
bool fxt_encoder_is_lost(const fxt_encoder *encoder)
{
    return !is_encoder(encoder) || encoder->started > STARTED || !can_read(encoder, encoder->reading);
}

bool fxt_encoder_read(fxt_encoder *encoder, uint64_t reading, int64_t *angle)
{
    if (angle == NULL || fxt_encoder_is_lost(encoder) || !can_read(encoder, reading)) {
        return false;
    }
    if (encoder->started == NOT_STARTED) {
        (void)fxt_encoder_start(encoder, reading, 0);
    } else {
        encoder->since_zero = plus(encoder->since_zero, encoder_way(encoder, encoder->reading, reading));
        encoder->reading = reading;
    }
    *angle = encoder_angle(encoder);
    return true;
}

/* A move, 2^-32 turn, in counts, rounded up. */
static uint64_t counts_of_move(const fxt_encoder *encoder, int32_t largest_move)
{
    return ((uint64_t)(uint32_t)largest_move * encoder->counts_per_turn >> 32) + 1u;
}

/* Whether that number of such moves is less than half of what the register counts. */
static bool half_is_more_than(const fxt_encoder *encoder, int32_t largest_move, uint32_t number)
{
    const uint64_t most = encoder->wrap_bits > 0u ? most_of_bits(encoder->wrap_bits) : (uint64_t)encoder->counts_per_turn;
    return counts_of_move(encoder, largest_move) * ((uint64_t)number * 2u) < most;
}

bool fxt_joint_read(const fxt_joint *joint, fxt_encoder *encoder, uint64_t reading, int64_t *angle)
{
    if (angle == NULL || !is_made(joint) || fxt_encoder_is_lost(encoder) || !can_read(encoder, reading) ||
        !half_is_more_than(encoder, joint->largest_move, 3u)) {
        return false;
    }
    if (joint->sampled != 0u && encoder->started != NOT_STARTED &&
        size_of(encoder_way(encoder, encoder->reading, reading)) > counts_of_move(encoder, joint->largest_move)) {
        /* This tick, and two more: by those the angle that was believed last may be off, where it was a wrong one within the largest move. */
        if (!half_is_more_than(encoder, joint->largest_move, joint->unseen + 3u)) {
            encoder->started = LOST;
            return false;
        }
        encoder->since_zero = encoder_since_zero(encoder, joint->generator);
        encoder->reading = encoder_register(encoder, plus(encoder->since_zero, encoder->zero_counts));
    }
    return fxt_encoder_read(encoder, reading, angle);
}

uint64_t fxt_encoder_reading(const fxt_encoder *encoder, int64_t angle)
{
    return is_encoder(encoder) ? encoder_register(encoder, plus(encoder_since_zero(encoder, angle), encoder->zero_counts)) : 0u;
}

bool fxt_from_rad(double rad, int64_t *counts)
{
    const double exact = rad / TAU * TURN;
    if (counts == NULL) {
        return false;
    }
    *counts = 0;
    if (!(exact > -9.223372e18 && exact < 9.223372e18)) {
        return false;
    }
    *counts = (int64_t)(exact + (exact < 0.0 ? -0.5 : 0.5));
    return true;
}

double fxt_to_rad(int64_t counts)
{
    return (double)counts * (TAU / TURN);
}
