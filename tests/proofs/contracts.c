/* ESBMC: what functions of the reader promise, for any argument that their premise allows. One function here is one proof.
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
    const play_state play = {nondet_long(), nondet_int(), nondet_int(), nondet_int(), nondet_int()};
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
