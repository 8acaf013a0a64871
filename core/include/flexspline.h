// Compensation of strain wave drives on a microcontroller: the C interface of the crate flexspline.
// Made by cbindgen of core/src/c_api.rs; tests/c_header.rs sees that it is up to date.

#ifndef FLEXSPLINE_H
#define FLEXSPLINE_H

#include <stddef.h>
#include <stdint.h>

// There was no sample.
#define FLEXSPLINE_FLAG_SAMPLE_LOST 1

// The sample was not believed.
#define FLEXSPLINE_FLAG_GLITCH 2

// The tick came late.
#define FLEXSPLINE_FLAG_OVERRUN 4

// The limiter held the correction back.
#define FLEXSPLINE_FLAG_HELD_BACK 8

// No correction could be made; the last one is kept or fades out.
#define FLEXSPLINE_FLAG_NOT_CORRECTED 16

// What was read of the table was not whole. It was mended and the tick done again, unless not corrected is set too.
#define FLEXSPLINE_FLAG_TABLE_DOUBT 32

// The state was not whole, and was taken from its other copy; where neither was, the joint is safe.
#define FLEXSPLINE_FLAG_STATE_TORN 64

// The settings are not whole: `flexspline_joint_mend`, or make the joint anew.
#define FLEXSPLINE_FLAG_JOINT_TORN 128

// The joint is in mode safe.
#define FLEXSPLINE_FLAG_SAFE 256

// An image is not the one that was activated, or both are the same one.
#define FLEXSPLINE_FLAG_OTHER_IMAGES 512

// Eight-byte words of a [`FlexsplineStore`].
#define FLEXSPLINE_STORE_WORDS 1072

// Eight-byte words of a [`FlexsplineJoint`].
#define FLEXSPLINE_JOINT_WORDS 32

// Eight-byte words of a [`FlexsplineState`].
#define FLEXSPLINE_STATE_WORDS 24

// Eight-byte words of a [`FlexsplineActivation`].
#define FLEXSPLINE_ACTIVATION_WORDS 88

// Eight-byte words of a [`FlexsplineIdentity`].
#define FLEXSPLINE_IDENTITY_WORDS 40

// Bytes of a saved state.
#define FLEXSPLINE_SAVED_BYTES 72

// Bytes of a record of telemetry.
#define FLEXSPLINE_RECORD_BYTES 52

// Numbers of a predictor.
#define FLEXSPLINE_PREDICTOR_PARTS 34

// Eight-byte words of a [`FlexsplineUpload`].
#define FLEXSPLINE_UPLOAD_WORDS 3

// Eight-byte words of a [`FlexsplineWatch`].
#define FLEXSPLINE_WATCH_WORDS 6

// Eight-byte words of a [`FlexsplinePredictor`].
#define FLEXSPLINE_PREDICTOR_WORDS 18

// Eight-byte words of a [`FlexsplineObserver`].
#define FLEXSPLINE_OBSERVER_WORDS 3

// The mode changed: `mode_before`, `mode`.
#define FLEXSPLINE_EVENT_MODE 1

// The health of the table changed: `health_before`, `health`.
#define FLEXSPLINE_EVENT_HEALTH 2

// A page of one image is damaged and can be written again from the other: `damaged_image`, `damaged_page`.
#define FLEXSPLINE_EVENT_PAGE_DAMAGED 4

// The copies of the table disagreed in what was read.
#define FLEXSPLINE_EVENT_TABLE_DOUBT 8

// No correction can be made from now on.
#define FLEXSPLINE_EVENT_FALLBACK 16

// Corrections are made again.
#define FLEXSPLINE_EVENT_RECOVERED 32

// A tick came late: `missed_ticks`.
#define FLEXSPLINE_EVENT_OVERRUN 64

// The state was not whole.
#define FLEXSPLINE_EVENT_STATE_TORN 128

// What a call came to.
typedef enum FlexsplineStatus {
  // Done.
  FLEXSPLINE_STATUS_OK = 0,
  // A pointer is null, or not aligned for its type.
  FLEXSPLINE_STATUS_POINTER = 1,
  // An object was not initialised, or is damaged.
  FLEXSPLINE_STATUS_NOT_INITIALISED = 2,
  // Two objects of which one is written overlap.
  FLEXSPLINE_STATUS_OVERLAP = 3,
  // A number or enumeration is not allowed.
  FLEXSPLINE_STATUS_ARGUMENT = 4,
  // Neither image is a table.
  FLEXSPLINE_STATUS_IMAGE = 5,
  // The table is larger than a store.
  FLEXSPLINE_STATUS_TOO_LARGE = 6,
  // The table is for another drive.
  FLEXSPLINE_STATUS_OTHER_DRIVE = 7,
  // No transition between these modes.
  FLEXSPLINE_STATUS_MODE = 8,
  // The saved bytes are damaged.
  FLEXSPLINE_STATUS_SAVED = 9,
  // Each image is a table, and they differ.
  FLEXSPLINE_STATUS_TWO_TABLES = 10,
  // The state was saved with another table.
  FLEXSPLINE_STATUS_OTHER_TABLE = 11,
  // The state was saved by a joint with other settings.
  FLEXSPLINE_STATUS_OTHER_JOINT = 12,
  // Both images are the same place in memory.
  FLEXSPLINE_STATUS_SAME_IMAGE = 13,
  // A chunk of an upload is not the next one.
  FLEXSPLINE_STATUS_ORDER = 14,
  // Not all bytes of an upload came.
  FLEXSPLINE_STATUS_INCOMPLETE = 15,
  // The image is whole and its wind-up is none that a drive has: a flank falls while the load grows (the sign of the torque?),
  // or rises too fast.
  FLEXSPLINE_STATUS_IMPLAUSIBLE = 16,
  // What was kept of an activation is not whole: begin again.
  FLEXSPLINE_STATUS_TORN = 17,
  // The self-test gave another answer than it must: processor or program are not what they were.
  FLEXSPLINE_STATUS_SELF_TEST = 18,
} FlexsplineStatus;

// The copies of a table.
typedef struct FlexsplineStore {
  uint64_t opaque[FLEXSPLINE_STORE_WORDS];
} FlexsplineStore;

// The settings of a joint.
typedef struct FlexsplineJoint {
  uint64_t opaque[FLEXSPLINE_JOINT_WORDS];
} FlexsplineJoint;

// Settings of a joint; angles at the output unless named otherwise.
typedef struct FlexsplineSettings {
  // Teeth of the flexspline.
  uint16_t flexspline_teeth;
  // Teeth of the circular spline, more than those.
  uint16_t circular_spline_teeth;
  // 0: the flexspline is fixed; 1: the circular spline.
  uint8_t fixed_member;
  // 0: skip late ticks and count; 1: hold the last correction; 2: fade out.
  uint8_t overrun;
  // Ticks of a fade.
  uint16_t fade_ticks;
  // Ticks for which a glitch is not believed, and the last correction is kept where none can be made.
  uint16_t patience;
  // Time from tick to tick, s.
  float tick_s;
  // Fastest correction, rad/s.
  float rate_rad_s;
  // Largest acceleration of the correction, rad/s^2.
  float acceleration_rad_s2;
  // Fastest generator, rad/s.
  float generator_rate_rad_s;
  // A target no further from the output than this is reached on the flank that bears already, rad; 0 for none. Three times the peak
  // of the encoder's noise at the output keeps the flank from changing to and fro; it costs up to this much after a reversal.
  float hold_rad;
} FlexsplineSettings;

// What changes while a joint runs.
typedef struct FlexsplineState {
  uint64_t opaque[FLEXSPLINE_STATE_WORDS];
} FlexsplineState;

// Two images of one table.
typedef struct FlexsplineImages {
  // First image.
  const uint8_t *first;
  // Its bytes.
  size_t first_bytes;
  // Second image, at another place.
  const uint8_t *second;
  // Its bytes.
  size_t second_bytes;
} FlexsplineImages;

// A table on its way into a store.
typedef struct FlexsplineActivation {
  uint64_t opaque[FLEXSPLINE_ACTIVATION_WORDS];
} FlexsplineActivation;

// Whether an image is the one of its id, as far as it was found out.
typedef struct FlexsplineIdentity {
  uint64_t opaque[FLEXSPLINE_IDENTITY_WORDS];
} FlexsplineIdentity;

// What is known of a store.
typedef struct FlexsplineStoreReport {
  // Id of the table in use; zeros if there is none.
  uint8_t table_id[8];
  // Ticks that were done again because something was not whole; wraps, as all counters.
  uint32_t doubtful_ticks;
  // Words of the copies that were found to differ and made anew.
  uint32_t words_mended;
  // Words that could not be made anew.
  uint32_t words_skipped;
  // Pages of an image found damaged.
  uint32_t pages_damaged;
  // Passes over both copies.
  uint32_t passes;
  // 0 sound, 1 a page of one image is damaged, 2 of both: lost, 3 no table, 4 torn: activate again.
  uint8_t health;
  // Image with a page that can be written again from the other: 0 or 1; 255 if there is none.
  uint8_t damaged_image;
  // That page.
  uint8_t damaged_page;
} FlexsplineStoreReport;

// What is known of a state.
typedef struct FlexsplineStateReport {
  // Ticks missed since the start; wraps.
  uint32_t missed_ticks;
  // 0 off, 1 tracking, 2 hold, 3 safe.
  uint8_t mode;
  // 1 if the side of the play is known, else 0.
  uint8_t side_known;
} FlexsplineStateReport;

// One tick's measurements. Angles are counts of 2^-32 turn.
typedef struct FlexsplineInput {
  // Generator angle.
  int64_t generator_counts;
  // Where the output shall be.
  int64_t target_counts;
  // Load torque at the output, N m, positive when it turns the output forward: that in the mesh, with the drag added that the
  // table was made with (times the direction), not that on the load where drag or inertia differ.
  float torque_n_m;
  // Ticks missed since the last call.
  uint16_t missed_ticks;
  // 0 if there is no sample of the generator, else 1.
  uint8_t has_generator;
  // Added to the mean error of the table in this tick, counts at the output; 0 for none.
  int32_t mean_counts;
  // Added to the half-width of the play, counts; 0 for none.
  int32_t half_width_counts;
} FlexsplineInput;

// One tick's results. Angles are counts of 2^-32 turn.
typedef struct FlexsplineOutput {
  // Generator angle to command.
  int64_t command_counts;
  // Where the output is estimated to be.
  int64_t output_counts;
  // Transmission error now, rad.
  float transmission_error_rad;
  // It lies within +- this, rad.
  float uncertainty_rad;
  // Correction in the command, rad.
  float correction_rad;
  // What the limiter held back, rad.
  float held_back_rad;
  // 0 in range, 1 uncertain, 2 extrapolated, 3 disabled.
  uint8_t quality;
  // `FLEXSPLINE_FLAG_...`.
  uint16_t flags;
} FlexsplineOutput;

// How far a table on its way in has come.
typedef struct FlexsplineUpload {
  uint64_t opaque[FLEXSPLINE_UPLOAD_WORDS];
} FlexsplineUpload;

// Knows how the last tick was.
typedef struct FlexsplineWatch {
  uint64_t opaque[FLEXSPLINE_WATCH_WORDS];
} FlexsplineWatch;

// What changed in a tick.
typedef struct FlexsplineEvents {
  // Ticks missed since the start.
  uint32_t missed_ticks;
  // `FLEXSPLINE_EVENT_...`; what follows is only told with its event.
  uint16_t events;
  // 0 off, 1 tracking, 2 hold, 3 safe.
  uint8_t mode_before;
  // The mode now.
  uint8_t mode;
  // As in `FlexsplineStoreReport`.
  uint8_t health_before;
  // The health now.
  uint8_t health;
  // 0 or 1.
  uint8_t damaged_image;
  // That page.
  uint8_t damaged_page;
} FlexsplineEvents;

// Two inertias and an observer of them: all that does not change while they run.
typedef struct FlexsplinePredictor {
  uint64_t opaque[FLEXSPLINE_PREDICTOR_WORDS];
} FlexsplinePredictor;

// What an observer estimates.
typedef struct FlexsplineObserver {
  uint64_t opaque[FLEXSPLINE_OBSERVER_WORDS];
} FlexsplineObserver;

// What was measured in a tick, for the observer.
typedef struct FlexsplineMeasured {
  // Motor torque times the ratio in the tick before, N m.
  float torque_n_m;
  // Motor speed over the ratio, rad/s.
  float speed_rad_s;
  // Twist, rad: only used if the predictor was made with a noise for it.
  float twist_rad;
} FlexsplineMeasured;

// What an observer estimates, to read.
typedef struct FlexsplineObserverReport {
  // Twist of the drive, rad.
  float twist_rad;
  // Speed of the load, rad/s.
  float load_speed_rad_s;
  // Torque on the load, N m.
  float load_torque_n_m;
} FlexsplineObserverReport;

// Where a prediction starts.
typedef struct FlexsplineNow {
  // Generator angle, counts of 2^-32 turn.
  int64_t generator_counts;
  // Output angle as measured.
  int64_t measured_counts;
  // It lies within +- this, rad.
  float measured_bound_rad;
  // Motor torque times the ratio from now on, N m; it can be off by +- `torque_off_n_m`.
  float torque_n_m;
  // See `torque_n_m`.
  float torque_off_n_m;
  // Change of the torque on the load in a tick, +- N m.
  float load_change_n_m;
  // How far off the observer can be, +-: twist rad, speeds of motor and load rad/s, torque on the load N m.
  float state_bound[4];
  // Ticks ahead.
  uint16_t ticks;
  // 0 if there is no encoder at the output, else 1.
  uint8_t has_measured;
} FlexsplineNow;

// Where the output is expected.
typedef struct FlexsplineAhead {
  // The output angle then, counts of 2^-32 turn.
  int64_t output_counts;
  // It lies within +- this, rad.
  float bound_rad;
  // What the load turns until then, rad.
  float load_rad;
  // What the motor turns until then, over the ratio, rad.
  float motor_rad;
  // Twist then, rad.
  float twist_rad;
  // 0 in range, 1 uncertain, 2 extrapolated, 3 disabled: the worse of now and then.
  uint8_t quality;
} FlexsplineAhead;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Makes an empty store, where it lies: nothing of its size is on the stack.
enum FlexsplineStatus flexspline_store_init(struct FlexsplineStore *store);

// Makes a joint of its settings.
enum FlexsplineStatus flexspline_joint_init(struct FlexsplineJoint *joint,
                                            const struct FlexsplineSettings *settings);

// Makes the state of a joint after a reset.
enum FlexsplineStatus flexspline_state_init(struct FlexsplineState *state);

// Checks the images and fills the store from them, between two ticks. If it fails the table in use stays.
enum FlexsplineStatus flexspline_store_activate(struct FlexsplineStore *store,
                                                const struct FlexsplineJoint *joint,
                                                const struct FlexsplineImages *table,
                                                float temperature_c);

// Begins to bring a table into a store in short steps, between ticks.
enum FlexsplineStatus flexspline_activation_begin(struct FlexsplineActivation *activation,
                                                  const struct FlexsplineJoint *joint,
                                                  float temperature_c);

// A step: the same store and images with each, until `progress` is 2. 0: the images are checked, the store is as it was; 1: the store is
// filled, and has no table meanwhile; 2: the table is in use. If a step fails the activation is over; begin again.
enum FlexsplineStatus flexspline_activation_step(struct FlexsplineActivation *activation,
                                                 struct FlexsplineStore *store,
                                                 const struct FlexsplineImages *table,
                                                 uint8_t *progress);

// Begins to find out whether an image is the one of its id.
enum FlexsplineStatus flexspline_identity_begin(struct FlexsplineIdentity *identity);

// Takes in a block of 64 bytes of the image, the same one with each step. `found` is 0 while there is more, then 1 if the image is the one of its id,
// or 2 if it is not; with the next step it begins anew.
enum FlexsplineStatus flexspline_identity_step(struct FlexsplineIdentity *identity,
                                               const uint8_t *image,
                                               size_t image_bytes,
                                               uint8_t *found);

// Known answers of what a tick is made of, for a slow rate group: `FLEXSPLINE_STATUS_SELF_TEST` if one is another.
enum FlexsplineStatus flexspline_self_test(void);

// Tells the temperature, degrees C: in a slow rate group.
enum FlexsplineStatus flexspline_store_set_temperature(struct FlexsplineStore *store,
                                                       const struct FlexsplineImages *table,
                                                       float temperature_c);

// Checks so many words of the images: in a slow rate group.
enum FlexsplineStatus flexspline_store_check_images(struct FlexsplineStore *store,
                                                    const struct FlexsplineImages *table,
                                                    uint16_t words);

// Tells what is known of a store.
enum FlexsplineStatus flexspline_store_report(const struct FlexsplineStore *store,
                                              struct FlexsplineStoreReport *report);

// Writes a damaged page of an image in memory again from the other image, both whole images of `bytes` bytes, and tells the store.
// What `flexspline_store_report` named is `image` and `page`.
enum FlexsplineStatus flexspline_store_mend_page(struct FlexsplineStore *store,
                                                 uint8_t *damaged,
                                                 const uint8_t *good,
                                                 size_t length,
                                                 uint8_t image,
                                                 uint8_t page);

// Makes a copy of a joint's settings that is not whole anew from the other; `FLEXSPLINE_STATUS_ARGUMENT` if neither is. In a slow
// rate group.
enum FlexsplineStatus flexspline_joint_mend(struct FlexsplineJoint *joint);

// Changes the mode: 0 off, 1 tracking, 2 hold, 3 safe.
enum FlexsplineStatus flexspline_state_request(struct FlexsplineState *state, uint8_t mode);

// On command: which side of the play the drive rests on is not known any more, as after work on it.
enum FlexsplineStatus flexspline_state_forget_side(struct FlexsplineState *state);

// Tells what is known of a state, as the last tick left it.
enum FlexsplineStatus flexspline_state_report(const struct FlexsplineState *state,
                                              struct FlexsplineStateReport *report);

// Writes what must survive a reset: `FLEXSPLINE_SAVED_BYTES` bytes, with version, table and joint.
enum FlexsplineStatus flexspline_state_save(const struct FlexsplineState *state,
                                            const struct FlexsplineJoint *joint,
                                            const struct FlexsplineStore *store,
                                            uint8_t (*saved)[FLEXSPLINE_SAVED_BYTES]);

// Makes a state of bytes that the same joint saved with the same table, in mode off; only if the joint cannot have moved meanwhile.
// The first sample is held against the one that was saved.
enum FlexsplineStatus flexspline_state_restore(struct FlexsplineState *state,
                                               const struct FlexsplineJoint *joint,
                                               const struct FlexsplineStore *store,
                                               const uint8_t (*saved)[FLEXSPLINE_SAVED_BYTES]);

// Version of this library, as text.
const char *flexspline_version(void);

// Version of the table format that is read.
uint16_t flexspline_format_version(void);

// Name of a mode.
const char *flexspline_mode_name(uint8_t mode);

// Name of a health, as in `FlexsplineStoreReport`.
const char *flexspline_health_name(uint8_t health);

// Name of one flag.
const char *flexspline_flag_name(uint16_t flag);

// One tick.
enum FlexsplineStatus flexspline_tick(const struct FlexsplineJoint *joint,
                                      const struct FlexsplineImages *table,
                                      struct FlexsplineStore *store,
                                      struct FlexsplineState *state,
                                      const struct FlexsplineInput *input,
                                      struct FlexsplineOutput *output);

// Begins to receive a table of so many bytes. The buffer is the caller's and is given with every call; it is no image in use.
enum FlexsplineStatus flexspline_upload_begin(struct FlexsplineUpload *upload,
                                              size_t announced);

// Takes the bytes from `offset` on: `FLEXSPLINE_STATUS_ORDER` if they are not the next ones, which can still come.
enum FlexsplineStatus flexspline_upload_chunk(struct FlexsplineUpload *upload,
                                              uint8_t *buffer,
                                              size_t buffer_bytes,
                                              size_t offset,
                                              const uint8_t *chunk,
                                              size_t chunk_bytes);

// Checks a table of which all bytes came, in full, and tells its id; it can then be activated.
enum FlexsplineStatus flexspline_upload_finish(const struct FlexsplineUpload *upload,
                                               const uint8_t *buffer,
                                               size_t buffer_bytes,
                                               uint8_t (*table_id)[8]);

// Begins to watch for events: off, without a table.
enum FlexsplineStatus flexspline_watch_init(struct FlexsplineWatch *watch);

// Tells what changed, after `flexspline_tick`; `output` is what it gave.
enum FlexsplineStatus flexspline_watch_see(struct FlexsplineWatch *watch,
                                           const struct FlexsplineState *state,
                                           const struct FlexsplineStore *store,
                                           const struct FlexsplineOutput *output,
                                           struct FlexsplineEvents *events);

// Writes a record of telemetry of a tick: `FLEXSPLINE_RECORD_BYTES` bytes with a CRC-32. `number` and `lost` are the caller's: of the
// record, and of those that it could not keep.
enum FlexsplineStatus flexspline_record(uint32_t tick,
                                        uint16_t number,
                                        uint16_t lost,
                                        const struct FlexsplineState *state,
                                        const struct FlexsplineStore *store,
                                        const struct FlexsplineOutput *output,
                                        uint8_t (*record)[FLEXSPLINE_RECORD_BYTES]);

// Makes a predictor of its numbers, which the host discretised; `FLEXSPLINE_STATUS_ARGUMENT` if its observer does not contract.
enum FlexsplineStatus flexspline_predictor_init(struct FlexsplinePredictor *predictor,
                                                const float (*parts)[FLEXSPLINE_PREDICTOR_PARTS]);

// Makes an observer at rest, without load.
enum FlexsplineStatus flexspline_observer_init(struct FlexsplineObserver *observer);

// One tick of the observer.
enum FlexsplineStatus flexspline_observer_step(struct FlexsplineObserver *observer,
                                               const struct FlexsplinePredictor *predictor,
                                               const struct FlexsplineMeasured *measured);

// Tells what an observer estimates.
enum FlexsplineStatus flexspline_observer_report(const struct FlexsplineObserver *observer,
                                                 struct FlexsplineObserverReport *report);

// Tells where the output will be some ticks from now, with the table as the output map of the two inertias. The work grows with the
// ticks; call it in a slow rate group.
enum FlexsplineStatus flexspline_predict(const struct FlexsplinePredictor *predictor,
                                         const struct FlexsplineObserver *observer,
                                         const struct FlexsplineJoint *joint,
                                         const struct FlexsplineStore *store,
                                         const struct FlexsplineState *state,
                                         const struct FlexsplineNow *now,
                                         struct FlexsplineAhead *ahead);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* FLEXSPLINE_H */
