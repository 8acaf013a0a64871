// Compensation of strain wave drives on a microcontroller: the C interface of the crate flexspline.
// Made by cbindgen of core/src/c_api.rs; tests/c_header.rs sees that it is up to date.

#ifndef FLEXSPLINE_H
#define FLEXSPLINE_H

#include <stddef.h>
#include <stdint.h>

// Eight-byte words of a [`FlexsplineStore`].
#define FLEXSPLINE_STORE_WORDS 1056

// Eight-byte words of a [`FlexsplineJoint`].
#define FLEXSPLINE_JOINT_WORDS 16

// Eight-byte words of a [`FlexsplineState`].
#define FLEXSPLINE_STATE_WORDS 16

// Bytes of a saved state.
#define FLEXSPLINE_SAVED_BYTES 40

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
  // Second image; the same one is allowed.
  const uint8_t *second;
  // Its bytes.
  size_t second_bytes;
} FlexsplineImages;

// One tick's measurements. Angles are counts of 2^-32 turn.
typedef struct FlexsplineInput {
  // Generator angle.
  int64_t generator_counts;
  // Where the output shall be.
  int64_t target_counts;
  // Load torque at the output, N m, positive when it turns the output forward.
  float torque_n_m;
  // Ticks missed since the last call.
  uint16_t missed_ticks;
  // 0 if there is no sample of the generator, else 1.
  uint8_t has_generator;
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
  // Bits: 1 sample lost, 2 glitch, 4 overrun, 8 held back, 16 not corrected, 32 table in doubt, 64 state torn.
  uint16_t flags;
} FlexsplineOutput;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Makes an empty store.
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

// Tells the temperature, degrees C: in a slow rate group.
enum FlexsplineStatus flexspline_store_set_temperature(struct FlexsplineStore *store,
                                                       const struct FlexsplineImages *table,
                                                       float temperature_c);

// Checks so many words of the images: in a slow rate group.
enum FlexsplineStatus flexspline_store_check_images(struct FlexsplineStore *store,
                                                    const struct FlexsplineImages *table,
                                                    uint16_t words);

// Changes the mode: 0 off, 1 tracking, 2 hold, 3 safe.
enum FlexsplineStatus flexspline_state_request(struct FlexsplineState *state, uint8_t mode);

// Writes what must survive a reset: `FLEXSPLINE_SAVED_BYTES` bytes.
enum FlexsplineStatus flexspline_state_save(const struct FlexsplineState *state,
                                            uint8_t (*saved)[FLEXSPLINE_SAVED_BYTES]);

// Makes a state of saved bytes, in mode off; only if the joint cannot have moved meanwhile.
enum FlexsplineStatus flexspline_state_restore(struct FlexsplineState *state,
                                               const uint8_t (*saved)[FLEXSPLINE_SAVED_BYTES]);

// One tick.
enum FlexsplineStatus flexspline_tick(const struct FlexsplineJoint *joint,
                                      const struct FlexsplineImages *table,
                                      struct FlexsplineStore *store,
                                      struct FlexsplineState *state,
                                      const struct FlexsplineInput *input,
                                      struct FlexsplineOutput *output);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* FLEXSPLINE_H */
