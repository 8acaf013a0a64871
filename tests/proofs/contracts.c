/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * ESBMC: what functions of the reader promise, for any argument that their premise allows. One function here is one proof.
 * READER is the reader, or one with a planted bug. With REACH each proof ends in an assertion that is false: it has to fail, or nothing was
 * proved, as no argument meets the premise. */
#include <stdlib.h>
#include READER

int32_t nondet_int(void);
uint32_t nondet_uint(void);
int64_t nondet_long(void);
float nondet_float(void);
_Bool nondet_bool(void);
void __ESBMC_assume(_Bool);
void __ESBMC_assert(_Bool, const char *);

#ifdef REACH
#define END __ESBMC_assert(0, "reached")
#else
#define END (void)0
#endif
#define PROMISE(of) __ESBMC_assert(of, #of)

/* The largest limit that fxt_open accepts: 0.05 rad in counts, times 1.001, plus 16. */
#define MOST_LIMIT 34212915
/* The fastest correction that fxt_joint_init accepts: 0.05 rad in a tick, eighths of a count, as a float. */
#define MOST_FINE_RATE 273429760

void weights_sum_to_one(void)
{
    const cell at = {nondet_uint(), nondet_uint()};
    int32_t weights[3];
    weights_q15(at, weights);
    PROMISE(weights[0] + weights[1] + weights[2] == 0x8000);
    for (int i = 0; i < 3; i++) {
        PROMISE(weights[i] >= 0 && weights[i] <= INT16_MAX);
    }
    END;
}

void cell_is_within_the_curve(void)
{
    const uint32_t nodes = nondet_uint();
    __ESBMC_assume(nodes >= LEAST_PERIODIC_NODES && nodes <= MOST_PERIODIC_NODES);
    const cell at = cell_at(nodes, nondet_uint());
    PROMISE(at.node + 2u < stored(nodes));
    END;
}

void any_number_converts(void)
{
    const float value = nondet_float();
    const int32_t found = to_i32(value);
    const double exact = (double)value;
    if (value != value) {
        PROMISE(found == 0);
    } else if (exact >= 2147483648.0) {
        PROMISE(found == INT32_MAX);
    } else if (exact <= -2147483648.0) {
        PROMISE(found == INT32_MIN);
    } else {
        /* Towards zero, by less than one. */
        PROMISE(exact < 0.0 ? (double)found >= exact && (double)found - exact < 1.0 : (double)found <= exact && exact - (double)found < 1.0);
    }
    END;
}

void words_lie_within_the_image(void)
{
    const uint32_t bytes = nondet_uint(), at = nondet_uint(), count = nondet_uint();
    __ESBMC_assume(bytes >= 1u && bytes <= 83276u && count >= 1u && count <= 6u);
    uint8_t *image = malloc(bytes);
    __ESBMC_assume(image != NULL);
    uint32_t words[6];
    words_from(image, bytes, at, count, words);
    END;
    free(image);
}

static bool is_play(const play_state *play)
{
    const bool started = play->half >= 0 && play->half <= MOST_PLAY && play->lower >= -play->half && play->upper <= play->half;
    const bool fresh = play->half == -1;
    return play->lower <= play->upper && (started || fresh);
}

static play_state any_play(void)
{
    const play_state play = {nondet_long(), nondet_int(), nondet_int(), nondet_int(), nondet_int(), {0, 0}};
    __ESBMC_assume(is_play(&play));
    return play;
}

void play_stays_a_play(void)
{
    play_state play = any_play();
    (void)play_update(&play, nondet_long(), nondet_int(), nondet_int(), nondet_bool());
    PROMISE(is_play(&play) && play.half >= 0);
    END;
}

void play_contains_every_truth(void)
{
    play_state play = any_play(), truth = play;
    const int64_t nominal = nondet_long();
    const int32_t centre = nondet_int(), half = nondet_int(), inside = nondet_int();
    const bool sane = nondet_bool();
    __ESBMC_assume(inside >= play.lower && inside <= play.upper);
    truth.lower = truth.upper = inside;
    /* About the same centre. */
    truth.error = add(sub(play.error, play_offset(&play)), play_offset(&truth));
    (void)play_update(&play, nominal, centre, half, sane);
    (void)play_update(&truth, nominal, centre, half, sane);
    PROMISE(truth.lower == truth.upper && truth.lower >= play.lower && truth.lower <= play.upper);
    END;
}

/* After an update the error is the centre plus the offset (play_is_what_it_was_given); so this is that of a step. */
void error_of_a_step_is_within_the_limit(void)
{
    fxt_table table;
    table.limit = nondet_int();
    __ESBMC_assume(table.limit >= 16 && table.limit <= MOST_LIMIT);
    const play_state play = any_play();
    const int32_t centre = nondet_int();
    /* What play_at says of any memory. */
    __ESBMC_assume(play.half >= 0 && allows(&table, centre, play.half));
    const int32_t error = add(centre, play_offset(&play));
    PROMISE(error >= -table.limit && error <= table.limit);
    END;
}

void play_is_what_it_was_given(void)
{
    play_state play = any_play();
    const int64_t nominal = nondet_long();
    const int32_t centre = nondet_int(), half = nondet_int();
    __ESBMC_assume(half >= 0 && half <= MOST_PLAY);
    const int32_t error = play_update(&play, nominal, centre, half, true);
    PROMISE(play.half == half && play.nominal == nominal && play.error == error && error == add(centre, play_offset(&play)));
    END;
}

void error_of_the_inverse_is_within_the_limit(void)
{
    fxt_table table;
    table.limit = nondet_int();
    __ESBMC_assume(table.limit >= 16 && table.limit <= MOST_LIMIT);
    const int32_t error = nondet_int();
    PROMISE(allows_error(&table, error) == (error >= -table.limit && error <= table.limit));
    END;
}

void play_survives_storage(void)
{
    const play_state play = any_play();
    const fxt_play stored_play = kept(&play);
    const play_state again = state_of(&stored_play);
    PROMISE(again.nominal == play.nominal && again.error == play.error && again.lower == play.lower && again.upper == play.upper &&
            again.half == play.half);
    END;
}

void only_a_play_is_restored(void)
{
    uint8_t saved[FXT_SAVED_PLAY_BYTES];
    for (int i = 0; i < FXT_SAVED_PLAY_BYTES; i++) {
        saved[i] = (uint8_t)nondet_uint();
    }
    fxt_play play;
    if (fxt_play_restore(&play, saved)) {
        const play_state is = state_of(&play);
        PROMISE(is_play(&is));
        END;
    }
}

/* What fxt_joint_init can leave (limits_that_are_accepted), and a correction that a tick can have left with this table. */
static fxt_joint any_joint(int32_t size)
{
    static const fxt_joint no_joint;
    fxt_joint joint = no_joint;
    joint.rate = nondet_int();
    joint.acceleration = nondet_int();
    joint.correction = nondet_int();
    joint.speed = nondet_int();
    joint.goal = nondet_int();
    joint.mode = (fxt_mode)nondet_uint();
    joint.patience = (uint16_t)nondet_uint();
    joint.uncorrected = (uint16_t)nondet_uint();
    joint.glitches = (uint16_t)nondet_uint();
    joint.fade = (uint16_t)nondet_uint();
    joint.fading = nondet_uint();
    joint.largest_move = nondet_int();
    joint.largest_bend = nondet_int();
    joint.spike = nondet_int();
    joint.step = nondet_int();
    joint.bend = nondet_int();
    joint.in_a_row = (uint8_t)nondet_uint();
    joint.unseen = (uint16_t)nondet_uint();
    joint.gap = (uint8_t)nondet_uint();
    joint.generator = nondet_long();
    joint.hold_late = nondet_bool() ? 1u : 0u;
    joint.sampled = nondet_bool() ? 1u : 0u;
    __ESBMC_assume(joint.rate >= 1 && joint.rate <= MOST_FINE_RATE && joint.acceleration >= 1 && joint.acceleration <= MOST_CHANGE &&
                   joint.acceleration <= 2 * joint.rate + 1);
    __ESBMC_assume(joint.correction >= -size && joint.correction <= size && joint.speed >= -joint.rate && joint.speed <= joint.rate);
    __ESBMC_assume(joint.largest_move >= 1 && joint.mode <= FXT_SAFE && joint.patience < UINT16_MAX);
    return joint;
}

static int32_t any_size(void)
{
    const int32_t limit = nondet_int();
    __ESBMC_assume(limit >= 16 && limit <= MOST_LIMIT);
    return limit * FINE;
}

/* fxt_tick moves its correction by this alone, wherever it wants to have it: so these are the limits of a tick. */
void correction_is_within_the_limit_of_the_table(void)
{
    const int32_t size = any_size();
    fxt_joint joint = any_joint(size);
    const int32_t found = moved_by(&joint, nondet_int(), size);
    PROMISE(found == joint.correction && found >= -size && found <= size);
    END;
}

void correction_moves_within_the_rate(void)
{
    const int32_t size = any_size();
    fxt_joint joint = any_joint(size);
    const int32_t before = joint.correction, found = moved_by(&joint, nondet_int(), size);
    PROMISE(joint.speed == found - before && joint.speed >= -joint.rate && joint.speed <= joint.rate);
    END;
}

void correction_moves_within_the_acceleration(void)
{
    const int32_t size = any_size();
    fxt_joint joint = any_joint(size);
    const int32_t before = joint.speed, found = moved_by(&joint, nondet_int(), size), change = joint.speed - before;
    /* At the limit of the table it stops whatever its speed was. */
    PROMISE((change >= -joint.acceleration && change <= joint.acceleration) || found == size || found == -size);
    END;
}

void limits_that_are_accepted_keep_a_joint_in_its_ranges(void)
{
    fxt_limits limits;
    limits.tick_s = nondet_float();
    limits.rate_rad_s = nondet_float();
    limits.acceleration_rad_s2 = nondet_float();
    limits.generator_rate_rad_s = nondet_float();
    limits.hold_rad = nondet_float();
    limits.patience = (uint16_t)nondet_uint();
    limits.fade_ticks = (uint16_t)nondet_uint();
    limits.overrun = (fxt_overrun)nondet_uint();
    fxt_joint joint;
    if (fxt_joint_init(&joint, &limits) == FXT_LIMITS_OK) {
        PROMISE(joint.rate >= 1 && joint.rate <= MOST_FINE_RATE && joint.acceleration >= 1);
        PROMISE(joint.acceleration <= 2 * joint.rate + 1 && joint.acceleration <= MOST_CHANGE);
        PROMISE(joint.largest_move >= 1 && joint.hold >= 0 && joint.patience < UINT16_MAX);
        PROMISE(joint.largest_bend == joint.largest_move && joint.spike >= 0 && joint.spike <= joint.largest_move);
        PROMISE(joint.mode == FXT_OFF && joint.correction == 0 && joint.speed == 0 && is_made(&joint));
        END;
    }
    PROMISE(joint.correction == 0);
}

void modes_follow_the_rules(void)
{
    fxt_joint joint = any_joint(any_size());
    const fxt_mode from = joint.mode, to = (fxt_mode)nondet_uint();
    __ESBMC_assume(to <= FXT_SAFE);
    const bool may = fxt_joint_request(&joint, to);
    PROMISE(joint.mode == (may ? to : from));
    PROMISE(may || to == FXT_TRACKING || to == FXT_HOLD);
    PROMISE(!(may && from == FXT_SAFE) || to == FXT_SAFE || to == FXT_OFF);
    PROMISE(!(may && to == FXT_HOLD) || from == FXT_TRACKING || from == FXT_HOLD);
    END;
}

void goal_follows_the_mode(void)
{
    const int32_t size = any_size();
    fxt_joint joint = any_joint(size);
    const int32_t before = joint.goal, wanted = nondet_int();
    __ESBMC_assume(before >= -size && before <= size && wanted >= -MOST_LIMIT && wanted <= MOST_LIMIT);
    /* As fxt_joint_init leaves it, and a tick. */
    joint.fade_step = joint.fade > 0u ? 1.0f / (float)joint.fade : 0.0f;
    const uint32_t fading = joint.fading, fade = joint.fade;
    __ESBMC_assume(fading <= 2u * fade);
    const bool late = nondet_bool(), sane = nondet_bool();
    const int32_t goal = goal_of(&joint, late, wanted, sane);
    if (joint.mode == FXT_OFF || joint.mode == FXT_SAFE || joint.uncorrected > joint.patience) {
        PROMISE(joint.goal == 0 && goal == 0);
    } else if (joint.mode == FXT_HOLD || (late && joint.hold_late != 0u)) {
        PROMISE(joint.goal == before);
    } else {
        PROMISE(joint.goal == (sane ? wanted * FINE : before));
    }
    PROMISE(joint.fading > 0u ? joint.fading > fade || goal == 0 : goal == joint.goal);
    /* A late tick begins a fade, but no new one while the correction is on its way down; where there is none it stays so. */
    PROMISE(joint.fading == (fading > fade ? fading - 1u : late ? (fading == 0u ? 2u * fade : fade) : fading > 0u ? fading - 1u : 0u));
    PROMISE(!sane || joint.uncorrected == 0u);
    END;
}

void a_sample_moves_no_further_than_a_tick_allows_or_is_doubted(void)
{
    fxt_joint joint = any_joint(any_size());
    const fxt_joint before = joint;
    fxt_input input;
    input.generator = nondet_long();
    input.has_generator = nondet_bool();
    input.missed_ticks = (uint16_t)nondet_uint();
    const judged is = judge(&joint, &input, nondet_int());
    const int64_t way = minus(joint.generator, before.generator);
    const uint64_t most = (uint64_t)(uint32_t)before.largest_move * (before.gap + input.missed_ticks + 1u);
    PROMISE(size_of(way) <= most || before.glitches >= before.patience || is.back || before.sampled == 0u);
    PROMISE(joint.generator == before.generator || (input.has_generator && joint.generator == input.generator));
    PROMISE(joint.glitches <= joint.patience && (!is.good || joint.sampled != 0u) && is.good == (input.has_generator && !is.glitch));
    /* Only after three in a row that were believed, and within a turn, is the one before taken back. */
    PROMISE(!is.back || (before.in_a_row >= HAS_BEND && is.good && input.missed_ticks == 0u && way >= INT32_MIN && way <= INT32_MAX));
    PROMISE(joint.in_a_row <= HAS_BEND && (is.good || joint.in_a_row == 0u));
    PROMISE(joint.gap <= MOST_GAP && (joint.gap != 0u) == !input.has_generator);
    END;
}

static fxt_encoder any_encoder(void)
{
    fxt_encoder encoder;
    __ESBMC_assume(fxt_encoder_init(&encoder, nondet_uint(), (uint8_t)nondet_uint(), nondet_bool(), nondet_long()));
    return encoder;
}

void the_shorter_way_within_a_turn(void)
{
    const fxt_encoder encoder = any_encoder();
    const int64_t from = nondet_long(), to = nondet_long(), turn = encoder.counts_per_turn;
    __ESBMC_assume(encoder.wrap_bits == 0u && from >= 0 && to >= 0 && can_read(&encoder, (uint64_t)from) && can_read(&encoder, (uint64_t)to));
    const int64_t way = encoder_way(&encoder, (uint64_t)from, (uint64_t)to);
    PROMISE(2 * way < turn && 2 * way >= -turn && from + way >= -turn && from + way < 2 * turn);
    PROMISE(from + way == to || from + way == to + turn || from + way == to - turn);
    END;
}

void the_shorter_way_of_a_register(void)
{
    const fxt_encoder encoder = any_encoder();
    const uint64_t from = (uint64_t)nondet_long(), to = (uint64_t)nondet_long();
    __ESBMC_assume(encoder.wrap_bits > 0u && can_read(&encoder, from) && can_read(&encoder, to));
    const int64_t way = encoder_way(&encoder, from, to);
    const uint64_t all = most_of_bits(encoder.wrap_bits);
    const int64_t half = (int64_t)(all / 2u);
    PROMISE(((from + (uint64_t)way) & all) == to && way <= half && way >= -half - 1);
    END;
}
