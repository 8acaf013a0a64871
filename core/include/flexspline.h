// SPDX-License-Identifier: MIT OR Apache-2.0
/// @file Compensation of strain wave drives on a microcontroller: the C interface of the crate flexspline.
/// Made by cbindgen of core/c_api/src; tests/c_header.rs sees that it is up to date. docs/reference/c_interface.md says how to use it.

#ifndef FLEXSPLINE_H
#define FLEXSPLINE_H

#include <stddef.h>
#include <stdint.h>

#define FLEXSPLINE_TEXT_OF_(number) #number
#define FLEXSPLINE_TEXT_OF(number) FLEXSPLINE_TEXT_OF_(number)
// Version of this header as text, as `flexspline_version` says of the library.
#define FLEXSPLINE_VERSION \
  FLEXSPLINE_TEXT_OF(FLEXSPLINE_VERSION_MAJOR) "." FLEXSPLINE_TEXT_OF(FLEXSPLINE_VERSION_MINOR) "." FLEXSPLINE_TEXT_OF(FLEXSPLINE_VERSION_PATCH)

#ifndef FLEXSPLINE_STORE_WORDS
// Eight-byte words of a `FlexsplineStore`, for any table. Fewer if the compiler is given what the environment of cargo had when it compiled the library.
#define FLEXSPLINE_STORE_WORDS 1072
#endif

// There was no sample.
#define FLEXSPLINE_FLAG_SAMPLE_LOST 1

// The sample was not believed; or it was, and what the one before it did to the play was taken back.
#define FLEXSPLINE_FLAG_GLITCH 2

// The tick came late.
#define FLEXSPLINE_FLAG_OVERRUN 4

// The correction is not what the table wants: the limiter, the mode (off, safe, hold) or the overrun policy holds it
// back.
#define FLEXSPLINE_FLAG_HELD_BACK 8

// No correction could be made; the last one is kept or fades out.
#define FLEXSPLINE_FLAG_NOT_CORRECTED 16

// The words read of the table differed between the copies. They were repaired and the tick repeated, unless not
// corrected is set too.
#define FLEXSPLINE_FLAG_TABLE_DOUBT 32

// The state was not whole, and was taken from its other copy; where neither was, the joint is safe.
#define FLEXSPLINE_FLAG_STATE_TORN 64

// The settings are not whole: `flexspline_joint_mend`, or make the joint anew. If no correction could be made either,
// the command is the last sample that was believed (0 before the first): hold the generator.
#define FLEXSPLINE_FLAG_JOINT_TORN 128

// The joint is in mode safe.
#define FLEXSPLINE_FLAG_SAFE 256

// An image is not the one that was activated, or both are the same one.
#define FLEXSPLINE_FLAG_OTHER_IMAGES 512

// The adjustment of the input was larger than any may be, and was taken at its largest: what made it is not sound.
#define FLEXSPLINE_FLAG_BOUNDED 1024

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
#define FLEXSPLINE_PREDICTOR_WORDS 19

// Eight-byte words of a [`FlexsplineObserver`].
#define FLEXSPLINE_OBSERVER_WORDS 4

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

// Eight-byte words of a [`FlexsplineEncoder`].
#define FLEXSPLINE_ENCODER_WORDS 7

// Largest number of coefficients of a learner.
#define FLEXSPLINE_LEARNER_COEFFICIENTS 7

// Eight-byte words of a [`FlexsplineLearner`].
#define FLEXSPLINE_LEARNER_WORDS 68

// Bytes of a saved learner with the largest number of coefficients; n of them take 2 n (n - 1) + 8 n + 32.
#define FLEXSPLINE_SAVED_LEARNER_BYTES 172

// Largest number of springs.
#define FLEXSPLINE_SLIP_SPRINGS 8

// Eight-byte words of a [`FlexsplineSlip`].
#define FLEXSPLINE_SLIP_WORDS 24

// Bytes of saved springs with the largest number of them; n of them take 8 n + 36.
#define FLEXSPLINE_SAVED_SLIP_BYTES 100

// Offset of the mean error, rad.
#define FLEXSPLINE_TERM_MEAN 0

// Wind-up in addition to that of the table, rad/(N m).
#define FLEXSPLINE_TERM_WIND_UP 1

// Half-width of the play in addition to that of the table, rad.
#define FLEXSPLINE_TERM_HALF_WIDTH 2

// Cosine of `order` periods in a generator turn, rad.
#define FLEXSPLINE_TERM_COSINE 3

// Sine of `order` periods in a generator turn, rad.
#define FLEXSPLINE_TERM_SINE 4

// The adjustment is zero; what was learnt is kept. The start.
#define FLEXSPLINE_LEARNING_OFF 0

// The learnt coefficients are used and stay as they are.
#define FLEXSPLINE_LEARNING_FROZEN 1

// Measurements are used.
#define FLEXSPLINE_LEARNING_ON 2

// There was no measurement, or nothing is to be learnt.
#define FLEXSPLINE_VERDICT_IDLE 0

// It was used.
#define FLEXSPLINE_VERDICT_USED 1

// Within what is not known anyway: it says nothing.
#define FLEXSPLINE_VERDICT_QUIET 2

// Beyond the gate.
#define FLEXSPLINE_VERDICT_OUTLIER 3

// Too soon after a reversal.
#define FLEXSPLINE_VERDICT_UNSETTLED 4

// No coefficient changes the output enough here to be seen in the noise.
#define FLEXSPLINE_VERDICT_UNEXCITED 5

// The tick itself was not to be trusted.
#define FLEXSPLINE_VERDICT_UNTRUSTED 6

// Learnt coefficients or settings are lost to an upset: nothing is added, and the uncertainty is all that can have
// been added. Until `flexspline_learner_set`, or until the learner is made anew.
#define FLEXSPLINE_VERDICT_LOST 7

// Eight-byte words of a [`FlexsplineAdjustment`].
#define FLEXSPLINE_ADJUSTMENT_WORDS 3

// Springs that slip with the nominal output: widths in rad, 0 to 0.05, gains without a unit.
#define FLEXSPLINE_SLIP_OF_OUTPUT 0

// Springs that slip with the load torque: widths in N m, 0 to 10000, gains in rad/(N m).
#define FLEXSPLINE_SLIP_OF_TORQUE 1

// Version of this header: the first of three numbers.
#define FLEXSPLINE_VERSION_MAJOR 0

// The second.
#define FLEXSPLINE_VERSION_MINOR 1

// The third.
#define FLEXSPLINE_VERSION_PATCH 0

// 10000 times the first, 100 times the second, and the third: as `flexspline_version_number` says of the library.
#define FLEXSPLINE_VERSION_NUMBER 100

// No correction: it is taken back within the limits. The start.
#define FLEXSPLINE_MODE_OFF 0

// The correction follows the table.
#define FLEXSPLINE_MODE_TRACKING 1

// The correction stays as it is; withdrawn where none could be made for `debounce_ticks`, it stays so.
#define FLEXSPLINE_MODE_HOLD 2

// No correction, and none before off was asked for: after a fault.
#define FLEXSPLINE_MODE_SAFE 3

// Trust estimate and correction. Output angles, and loads at an angle, that were not recorded count as inside.
#define FLEXSPLINE_QUALITY_IN_RANGE 0

// The side of the play is not known yet: the uncertainty says by how much the estimate can be off.
#define FLEXSPLINE_QUALITY_UNCERTAIN 1

// Torque or temperature lies beyond the table: that of its edge is used.
#define FLEXSPLINE_QUALITY_EXTRAPOLATED 2

// Nothing can be said: the error is taken as none.
#define FLEXSPLINE_QUALITY_DISABLED 3

// Both images are whole, as far as they were checked.
#define FLEXSPLINE_HEALTH_SOUND 0

// A page of one image is damaged, and can be written again from the other.
#define FLEXSPLINE_HEALTH_ONE_IMAGE 1

// A page is damaged in both images.
#define FLEXSPLINE_HEALTH_LOST 2

// There is no table.
#define FLEXSPLINE_HEALTH_EMPTY 3

// The store's data on the table is corrupt: activate it again.
#define FLEXSPLINE_HEALTH_TORN 4

// A tick that came late: the ticks missed are counted, nothing more.
#define FLEXSPLINE_OVERRUN_SKIP 0

// The correction stays as it is in that tick, in tracking and hold, and where some can be made.
#define FLEXSPLINE_OVERRUN_HOLD 1

// The correction fades out within `fade_ticks`, stays there for as many after the last late tick, and comes back.
#define FLEXSPLINE_OVERRUN_FADE 2

// The flexspline is fixed, the circular spline is the output.
#define FLEXSPLINE_FIXED_FLEXSPLINE 0

// The circular spline is fixed, the flexspline is the output.
#define FLEXSPLINE_FIXED_CIRCULAR_SPLINE 1

// `flexspline_activation_step`: the images are checked, the store is as it was.
#define FLEXSPLINE_PROGRESS_CHECKING 0

// The store is filled, and has no table meanwhile.
#define FLEXSPLINE_PROGRESS_FILLING 1

// The table is in use.
#define FLEXSPLINE_PROGRESS_DONE 2

// `flexspline_identity_step`: there is more to take in.
#define FLEXSPLINE_IDENTITY_HASHING 0

// The image is the one of its id.
#define FLEXSPLINE_IDENTITY_SAME 1

// It is not.
#define FLEXSPLINE_IDENTITY_OTHER 2

// Eight-byte words of a [`FlexsplineStartUp`].
#define FLEXSPLINE_START_UP_WORDS 32

// The generator's encoder gave no sample.
#define FLEXSPLINE_IMPLAUSIBLE_GENERATOR_LOST 1

// It did not move.
#define FLEXSPLINE_IMPLAUSIBLE_GENERATOR_STILL 2

// It moved the other way.
#define FLEXSPLINE_IMPLAUSIBLE_GENERATOR_SIGN 4

// It moved by another way: counts in a turn, unit, or a motor that does not follow.
#define FLEXSPLINE_IMPLAUSIBLE_GENERATOR_RATIO 8

// The output did not move.
#define FLEXSPLINE_IMPLAUSIBLE_OUTPUT_STILL 16

// It moved the other way.
#define FLEXSPLINE_IMPLAUSIBLE_OUTPUT_SIGN 32

// It moved by another way than the ratio says: unit, ratio, or the member that is fixed.
#define FLEXSPLINE_IMPLAUSIBLE_OUTPUT_RATIO 64

// The torque did not change with the direction.
#define FLEXSPLINE_IMPLAUSIBLE_TORQUE_STILL 128

// It changed the other way.
#define FLEXSPLINE_IMPLAUSIBLE_TORQUE_SIGN 256

// It changed by less than a third or more than three times what the drag says: a unit.
#define FLEXSPLINE_IMPLAUSIBLE_TORQUE_RATIO 512

// A reading came and went, or was no number.
#define FLEXSPLINE_IMPLAUSIBLE_LOST 1024

// Eight-byte words of a [`FlexsplineRecorder`].
#define FLEXSPLINE_RECORDER_WORDS 4

// Where all places hold a record: the oldest is lost, the end of a story is kept.
#define FLEXSPLINE_FULL_LOSE_OLDEST 0

// The new one is lost, the beginning is kept.
#define FLEXSPLINE_FULL_LOSE_NEW 1

// Eight-byte words of a [`FlexsplineTorquePath`].
#define FLEXSPLINE_TORQUE_PATH_WORDS 8

// Eight-byte words of a [`FlexsplineAged`].
#define FLEXSPLINE_AGED_WORDS 4

// The torque is that on the load: what gravity, wind and the like do to it. Inertia times the acceleration of the
// target comes off what the tick gives, unless that inertia torque is the larger: while a target speeds up from a
// light load the flank does not change.
#define FLEXSPLINE_TORQUE_ON_LOAD 0

// The torque is that in the mesh: of a sensor between drive and load, of the twist, or of the motor's current less its
// friction.
#define FLEXSPLINE_TORQUE_IN_MESH 1

// Status of a call.
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
  // The image is whole and its wind-up is none that a drive has: a flank falls while the load grows (the sign of the
  // torque?), or rises too fast.
  FLEXSPLINE_STATUS_IMPLAUSIBLE = 16,
  // The saved progress of an activation is corrupt: begin again.
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
  // `FLEXSPLINE_FIXED_...`.
  uint8_t fixed_member;
  // `FLEXSPLINE_OVERRUN_...`.
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
  // Fastest generator, rad/s, also in ticks that were missed.
  float generator_rate_rad_s;
  // A target no further from the output than this is reached on the flank that bears already, rad; 0 for none. Three
  // times the peak of the encoder's noise at the output keeps the flank from changing to and fro; it costs up to
  // this much after a reversal.
  float hold_rad;
} FlexsplineSettings;

// State of a running joint.
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

// Report on a store.
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
  // `FLEXSPLINE_HEALTH_...`.
  uint8_t health;
  // Image with a page that can be written again from the other: 0 or 1; 255 if there is none.
  uint8_t damaged_image;
  // That page.
  uint8_t damaged_page;
} FlexsplineStoreReport;

// Report on a state.
typedef struct FlexsplineStateReport {
  // Ticks missed since the start; wraps.
  uint32_t missed_ticks;
  // `FLEXSPLINE_MODE_...`.
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
  // Load torque at the output, N m, positive when it turns the output forward: that in the mesh, with the drag added
  // that the table was made with (times the direction), not that on the load where drag or inertia differ:
  // `flexspline_torque_tick` makes it of a reading.
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
  // Generator angle to command: the target times the ratio, as it is, less the correction. Where the target leaps
  // this leaps, without a flag: its rate is the caller's to limit.
  int64_t command_counts;
  // Where the output is estimated to be.
  int64_t output_counts;
  // Transmission error now, rad.
  float transmission_error_rad;
  // It lies within +- this, rad. Of the estimate, whether it is corrected or not. Without a sample that is believed
  // in this tick: no less than the table's limit and the reported uncertainty.
  float uncertainty_rad;
  // Correction in the command, rad: target less command over ratio. It is taken off the target, and has the sign of
  // the error.
  float correction_rad;
  // Correction missing from the table's demand, rad: held back by the limiter, the mode or the overrun policy.
  float held_back_rad;
  // `FLEXSPLINE_QUALITY_...`.
  uint8_t quality;
  // `FLEXSPLINE_FLAG_...`.
  uint16_t flags;
} FlexsplineOutput;

// Addition to the table in the next tick, and how far it is known, under a sum: an upset of one word is mended.
typedef struct FlexsplineAdjustment {
  uint64_t opaque[FLEXSPLINE_ADJUSTMENT_WORDS];
} FlexsplineAdjustment;

// Expected motion of the output.
typedef struct FlexsplinePrediction {
  // Output angle, counts of 2^-32 turn: nominal plus transmission error.
  int64_t output_counts;
  // Nominal output angle: generator over ratio.
  int64_t nominal_counts;
  // Actual less nominal, rad; 0 if disabled.
  float transmission_error_rad;
  // The error lies within +- this as far as play and jumps go, rad.
  float uncertainty_rad;
  // `FLEXSPLINE_QUALITY_...`.
  uint8_t quality;
} FlexsplinePrediction;

// Command for a wanted output angle.
typedef struct FlexsplineCommand {
  // Generator angle to go to, counts of 2^-32 turn.
  int64_t generator_counts;
  // The transmission error expected there, rad; 0 if disabled.
  float predicted_error_rad;
  // It lies within +- this, rad.
  float uncertainty_rad;
  // `FLEXSPLINE_QUALITY_...`.
  uint8_t quality;
} FlexsplineCommand;

// Where the generator is by a reading of the output.
typedef struct FlexsplineLocated {
  // Generator angle, counts of 2^-32 turn: the middle of what is possible; output times ratio if disabled.
  int64_t generator_counts;
  // It lies within +- this, rad of the generator; infinite if disabled. The sum of the three below.
  float half_width_rad;
  // What the reading makes of it.
  float of_reading_rad;
  // What the play makes of it.
  float of_play_rad;
  // The rest: the load, and the table's inverse.
  float of_load_rad;
  // Whole turns of the generator that remain possible: 1 if it is located, 0 if disabled.
  uint32_t turns;
  // `FLEXSPLINE_QUALITY_...`: located where it is in range. Uncertain: more than half a turn to either side remains
  // possible, and the largest of the three parts says why.
  uint8_t quality;
} FlexsplineLocated;

// The torque by the wind-up.
typedef struct FlexsplineTorqueFromWindUp {
  // Middle of the interval within the table's range, N m; NaN if disabled.
  float torque_n_m;
  // The torque is no less, N m; -infinity where the table ends before the reading is reached.
  float low_n_m;
  // It is no more, N m; infinity likewise.
  float high_n_m;
  // `FLEXSPLINE_QUALITY_...`. Uncertain: the flank or the adjustment is not known. Extrapolated: the interval is
  // open, or the temperature lies beyond the table.
  uint8_t quality;
} FlexsplineTorqueFromWindUp;

// Where a drive rests inside its play.
typedef struct FlexsplinePlay {
  // Nominal output of the last tick with a sample, counts of 2^-32 turn; 0 before the first.
  int64_t nominal_counts;
  // Estimated output then; 0 before the first.
  int64_t output_counts;
  // Offset from the middle of the play, rad: the middle of what is possible.
  float offset_rad;
  // It is off by no more than this, rad.
  float uncertainty_rad;
  // 1 if the side is known, else 0.
  uint8_t is_known;
  // 0 before the first tick with a sample and a table, else 1.
  uint8_t is_started;
} FlexsplinePlay;

// Contents of an image's header.
typedef struct FlexsplineImageReport {
  // Id of the table: the first 8 bytes of the BLAKE3 of its contents, as reports show them in hexadecimal digits.
  uint8_t table_id[8];
  // Torques that it holds for, N m, both ends included.
  float torque_range_n_m[2];
  // Temperatures that it holds for, degrees C, both ends included.
  float temperature_range_c[2];
  // No error that it gives is larger, rad.
  float error_limit_rad;
  // Largest deviation from the samples that it was made of, rad.
  float projection_worst_rad;
  // Root of the mean square of that, rad.
  float projection_rms_rad;
  // Teeth of the flexspline.
  uint16_t flexspline_teeth;
  // Teeth of the circular spline.
  uint16_t circular_spline_teeth;
  // `FLEXSPLINE_FIXED_...`.
  uint8_t fixed_member;
  // Kind of wave generator: 0 other, 1 two-roller, 2 four-roller, 3 double-disc, 4 cam
  // (`flexspline_generator_name`).
  uint8_t generator;
} FlexsplineImageReport;

// How far a table on its way in has come.
typedef struct FlexsplineUpload {
  uint64_t opaque[FLEXSPLINE_UPLOAD_WORDS];
} FlexsplineUpload;

// Knows how the last tick was.
typedef struct FlexsplineWatch {
  uint64_t opaque[FLEXSPLINE_WATCH_WORDS];
} FlexsplineWatch;

// Events of a tick.
typedef struct FlexsplineEvents {
  // Ticks missed since the start.
  uint32_t missed_ticks;
  // `FLEXSPLINE_EVENT_...`; the fields below are only set with their event.
  uint16_t events;
  // `FLEXSPLINE_MODE_...`.
  uint8_t mode_before;
  // The mode now.
  uint8_t mode;
  // `FLEXSPLINE_HEALTH_...`.
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

// Two inertias, at the output.
typedef struct FlexsplineInertias {
  // Motor, generator and what turns with them: their inertia times the square of the ratio, kg m^2.
  double motor_kg_m2;
  // Load, kg m^2.
  double load_kg_m2;
  // Torsional stiffness, N m/rad: the slope of the wind-up.
  double stiffness_n_m_per_rad;
  // Damping parallel to it, N m s/rad.
  double damping_n_m_s_per_rad;
} FlexsplineInertias;

// How much of what is measured and assumed can be trusted: standard deviations.
typedef struct FlexsplineNoise {
  // Motor torque at the output, N m.
  double torque_n_m;
  // Change of the torque on the load in a tick, N m.
  double load_change_n_m;
  // Motor speed over the ratio as measured in one tick, rad/s.
  double speed_rad_s;
  // Twist as measured, rad; of no matter without an encoder at the output.
  double twist_rad;
  // 0 without an encoder at the output, else 1.
  uint8_t has_twist;
} FlexsplineNoise;

// How far what is measured and assumed can be off: bounds, each +-.
typedef struct FlexsplineDisturbance {
  // Motor torque at the output, N m.
  float torque_n_m;
  // Change of the torque on the load in a tick, N m.
  float load_change_n_m;
  // Motor speed over the ratio as measured, rad/s.
  float speed_rad_s;
  // Twist as measured, rad; of no matter without an encoder at the output.
  float twist_rad;
} FlexsplineDisturbance;

// State of an observer.
typedef struct FlexsplineObserver {
  uint64_t opaque[FLEXSPLINE_OBSERVER_WORDS];
} FlexsplineObserver;

// Measurements of a tick, for the observer.
typedef struct FlexsplineMeasured {
  // Motor torque times the ratio in the tick before, N m.
  float torque_n_m;
  // Motor speed over the ratio, rad/s.
  float speed_rad_s;
  // Twist, rad: only used if the predictor was made with a noise for it.
  float twist_rad;
} FlexsplineMeasured;

// Estimates of an observer, to read.
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
  // Turn of the load until then, rad.
  float load_rad;
  // Turn of the motor until then, over the ratio, rad.
  float motor_rad;
  // Twist then, rad.
  float twist_rad;
  // `FLEXSPLINE_QUALITY_...`: the worse of now and then.
  uint8_t quality;
} FlexsplineAhead;

// An encoder, and where it is.
typedef struct FlexsplineEncoder {
  uint64_t opaque[FLEXSPLINE_ENCODER_WORDS];
} FlexsplineEncoder;

// How an encoder counts.
typedef struct FlexsplineEncoderSettings {
  // Reading at the angle 0, counts of the encoder: -2^62 to 2^62.
  int64_t zero_counts;
  // Counts in a turn, 2 to 2^31: four times the lines of an incremental one.
  uint32_t counts_per_turn;
  // Bits of the register, 1 to 64: it begins anew after 2^bits counts. 0: it begins anew after each turn. A signed
  // register is given by its bits, those above them zero.
  uint8_t wrap_bits;
  // 1 if it counts up where the angle falls, else 0.
  uint8_t reversed;
} FlexsplineEncoderSettings;

// A few coefficients that measurements of the output teach, and what is learnt.
typedef struct FlexsplineLearner {
  uint64_t opaque[FLEXSPLINE_LEARNER_WORDS];
} FlexsplineLearner;

// How a learner learns.
typedef struct FlexsplineLearnSettings {
  // Standard deviation of one measurement, rad at the output: its noise and what the table missed of its samples.
  float noise_rad;
  // Measurements after which what was learnt in their direction is forgotten: 1 to 1000000.
  float memory_measurements;
  // Standard deviations beyond which an innovation is an outlier: 1 to 100.
  float gate;
  // Way at the output after a reversal that is left out in addition to four times the limit of the half-width,
  // rad; 0 to 0.049.
  float settle_rad;
  // Torque beyond which the wind-up's share grows no more, N m.
  float torque_limit_n_m;
} FlexsplineLearnSettings;

// A coefficient to be learnt.
typedef struct FlexsplineCoefficient {
  // It stays within +- this: rad, or rad/(N m); above 0, 0.049 at most.
  float limit;
  // Standard deviation that it is expected to have at first, and never exceeds: same unit; 1e-6 to 10 times the
  // limit.
  float initial_std;
  // `FLEXSPLINE_TERM_...`.
  uint8_t term;
  // Periods in a generator turn, 1 to 255, of a cosine or sine; else 0.
  uint8_t order;
} FlexsplineCoefficient;

// A learner's addition in the next tick.
typedef struct FlexsplineAdapted {
  // For `FlexsplineInput` of the next tick: mean error, counts of 2^-32 turn at the output.
  int32_t mean_counts;
  // The same: half-width of the play.
  int32_t half_width_counts;
  // Standard deviation of what it adds to the error, rad.
  float uncertainty_rad;
  // Verdict on the measurement: `FLEXSPLINE_VERDICT_...`.
  uint8_t verdict;
} FlexsplineAdapted;

// A coefficient as learnt.
typedef struct FlexsplineLearnt {
  // Its value: rad, or rad/(N m).
  float value;
  // Its standard deviation, same unit.
  float std;
} FlexsplineLearnt;

// Counts of measurements by verdict; counters stop at their largest value.
typedef struct FlexsplineLearnerReport {
  // Used.
  uint32_t used;
  // Within what is not known anyway.
  uint32_t quiet;
  // Outliers.
  uint32_t outliers;
  // Outliers in a row until now: many say that the output encoder or its zero is not what it was.
  uint32_t outliers_in_a_row;
  // Too soon after a reversal.
  uint32_t unsettled;
  // No coefficient was excited.
  uint32_t unexcited;
  // The tick was not to be trusted.
  uint32_t untrusted;
  // Coefficients held at their limit, once for each and each measurement.
  uint32_t limited;
  // Starts with the first variances: measurements contradicted what was learnt for a window, or, from zero, the
  // state was hit by an upset.
  uint32_t restarts;
  // `FLEXSPLINE_LEARNING_...`.
  uint8_t learning;
  // Number of coefficients.
  uint8_t coefficients;
} FlexsplineLearnerReport;

// Springs that slip, and their deflections.
typedef struct FlexsplineSlip {
  uint64_t opaque[FLEXSPLINE_SLIP_WORDS];
} FlexsplineSlip;

// A spring that slips.
typedef struct FlexsplineSpring {
  // Deflection at which it slips: rad of the nominal output, or N m.
  float width;
  // Error per deflection: without a unit, or rad/(N m).
  float gain;
} FlexsplineSpring;

// Contribution of the springs.
typedef struct FlexsplineSlipReport {
  // Error at the output, rad.
  float error_rad;
  // It lies within +- this, rad: 0 once every spring has slipped from one end to the other.
  float uncertainty_rad;
  // The error for `flexspline_input_add`, counts of 2^-32 turn at the output.
  int32_t mean_counts;
  // 1 if every deflection is known, else 0.
  uint8_t is_known;
} FlexsplineSlipReport;

// A test of the sensors under way.
typedef struct FlexsplineStartUp {
  uint64_t opaque[FLEXSPLINE_START_UP_WORDS];
} FlexsplineStartUp;

// How far the motor moves, and what is expected of it.
typedef struct FlexsplineStartUpSettings {
  // Way of the generator, there and back, rad. At the output it must be ten times `output_error_rad` at least, and
  // half a turn at most.
  float way_rad;
  // Error of the output in one move, rad: twice the error that the table states is enough.
  float output_error_rad;
  // Coulomb drag of the output that a torque in the mesh turns over by, N m; it may be wrong by three times. Above
  // 0.
  float drag_n_m;
  // Ticks for each way, 8 or more; the last half of each is for the servo to settle.
  uint16_t ticks;
} FlexsplineStartUpSettings;

// Sensor readings in a tick of the test. Angles are counts of 2^-32 turn.
typedef struct FlexsplineReadings {
  // The generator's encoder.
  int64_t generator_counts;
  // An encoder at the output.
  int64_t output_counts;
  // A torque that is measured in the mesh, N m. (One on the load says nothing about a motion.)
  float torque_n_m;
  // 1 if there is a sample of the generator, else 0; likewise below.
  uint8_t has_generator;
  // Of the output.
  uint8_t has_output;
  // Of the torque.
  uint8_t has_torque;
} FlexsplineReadings;

// Command and result of a tick of the test.
typedef struct FlexsplineStartUpStep {
  // Generator angle to command, counts of 2^-32 turn.
  int64_t command_counts;
  // `FLEXSPLINE_IMPLAUSIBLE_...` once it is done: 0 if every sensor says what it must.
  uint16_t implausible;
  // 1 with the last tick of the test, else 0.
  uint8_t is_done;
} FlexsplineStartUpStep;

// Which records of the caller's list wait to be sent.
typedef struct FlexsplineRecorder {
  uint64_t opaque[FLEXSPLINE_RECORDER_WORDS];
} FlexsplineRecorder;

// One tick, as it is kept and as it was sent.
typedef struct FlexsplineRecord {
  // Estimated output, counts of 2^-32 turn.
  int64_t output_counts;
  // Number of the tick.
  uint32_t tick;
  // Transmission error, rad.
  float transmission_error_rad;
  // It lies within +- this, rad.
  float uncertainty_rad;
  // Correction, rad at the output: target less command over ratio.
  float correction_rad;
  // Part of it that the limiter held back, rad.
  float held_back_rad;
  // Number of the record; wraps.
  uint16_t number;
  // Records lost since the start; wraps.
  uint16_t lost;
  // `FLEXSPLINE_FLAG_...`.
  uint16_t flags;
  // Ticks missed since the start; wraps, as all counters.
  uint16_t missed_ticks;
  // Ticks that were done again because something was not whole.
  uint16_t doubtful_ticks;
  // Words of the copies that were found to differ and made anew.
  uint16_t words_mended;
  // Words that could not be made anew.
  uint16_t words_skipped;
  // Pages of an image found damaged.
  uint16_t pages_damaged;
  // `FLEXSPLINE_QUALITY_...`.
  uint8_t quality;
  // `FLEXSPLINE_MODE_...`.
  uint8_t mode;
  // `FLEXSPLINE_HEALTH_...`.
  uint8_t health;
} FlexsplineRecord;

// From a reading of torque to the one that a tick is given.
typedef struct FlexsplineTorquePath {
  uint64_t opaque[FLEXSPLINE_TORQUE_PATH_WORDS];
} FlexsplineTorquePath;

// Settings of the processing of a torque reading.
typedef struct FlexsplineTorqueSettings {
  // Time from tick to tick, s.
  float tick_s;
  // Corner of the low-pass, Hz: of the first order.
  float bandwidth_hz;
  // Coulomb drag of the output of this unit, N m, whichever torque is read; 0 or more.
  float drag_n_m;
  // Coulomb drag that the table was made with, N m; 0 or more.
  float table_drag_n_m;
  // A torque in the mesh below this changes the flank only where the direction changes, N m: some three times the
  // peak of the noise behind the low-pass, and for a torque read in the mesh a fifth of the drag. 0 or more.
  float hold_n_m;
} FlexsplineTorqueSettings;

// A measurement with its age.
typedef struct FlexsplineAged {
  uint64_t opaque[FLEXSPLINE_AGED_WORDS];
} FlexsplineAged;

// How the generator has to move so that the output moves as it shall.
typedef struct FlexsplineMotionAhead {
  // Its rate, rad/s.
  float rate_rad_s;
  // Its acceleration, rad/s^2.
  float acceleration_rad_s2;
} FlexsplineMotionAhead;



#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Makes an empty store, where it lies: nothing of its size is on the stack.
enum FlexsplineStatus flexspline_store_init(struct FlexsplineStore *store);

// Makes a joint of its settings.
enum FlexsplineStatus flexspline_joint_init(struct FlexsplineJoint *joint,
                                            const struct FlexsplineSettings *settings);

// Limits the acceleration of a joint's generator, rad/s^2: a sample that would need more is a glitch, and one that is
// out and back within two ticks is taken back. A multiple of what motor and load can do. Without this call a sample
// may need full speed in one tick, and one that is out and back a 64th of that in each. After
// `flexspline_joint_init`: a state saved before belongs to another joint. `FLEXSPLINE_STATUS_ARGUMENT` if it is not
// finite or too small to matter in a tick.
enum FlexsplineStatus flexspline_joint_limit_acceleration(struct FlexsplineJoint *joint,
                                                          float rad_s2);

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

// A step: the same store and images with each, until `progress` (`FLEXSPLINE_PROGRESS_...`) is done. If a step fails
// the activation is over; begin again.
enum FlexsplineStatus flexspline_activation_step(struct FlexsplineActivation *activation,
                                                 struct FlexsplineStore *store,
                                                 const struct FlexsplineImages *table,
                                                 uint8_t *progress);

// Begins to find out whether an image is the one of its id.
enum FlexsplineStatus flexspline_identity_begin(struct FlexsplineIdentity *identity);

// Takes in a block of 64 bytes of the image, the same one with each step. `found` (`FLEXSPLINE_IDENTITY_...`) is
// hashing while there is more, then same or other; with the next step it begins anew.
enum FlexsplineStatus flexspline_identity_step(struct FlexsplineIdentity *identity,
                                               const uint8_t *image,
                                               size_t image_bytes,
                                               uint8_t *found);

// Known answers of what a tick is made of, for a slow rate group: `FLEXSPLINE_STATUS_SELF_TEST` if one is another.
enum FlexsplineStatus flexspline_self_test(void);

// Sets the temperature, degrees C: in a slow rate group.
enum FlexsplineStatus flexspline_store_set_temperature(struct FlexsplineStore *store,
                                                       const struct FlexsplineImages *table,
                                                       float temperature_c);

// Checks the given number of words of the images: in a slow rate group.
enum FlexsplineStatus flexspline_store_check_images(struct FlexsplineStore *store,
                                                    const struct FlexsplineImages *table,
                                                    uint16_t words);

// Writes the report on a store.
enum FlexsplineStatus flexspline_store_report(const struct FlexsplineStore *store,
                                              struct FlexsplineStoreReport *report);

// Writes a damaged page of an image in memory again from the other image, both whole images of `bytes` bytes, and
// notifies the store. What `flexspline_store_report` named is `image` and `page`.
enum FlexsplineStatus flexspline_store_mend_page(struct FlexsplineStore *store,
                                                 uint8_t *damaged,
                                                 const uint8_t *good,
                                                 size_t length,
                                                 uint8_t image,
                                                 uint8_t page);

// Makes a copy of a joint's settings that is not whole anew from the other; `FLEXSPLINE_STATUS_ARGUMENT` if neither
// is. In a slow rate group.
enum FlexsplineStatus flexspline_joint_mend(struct FlexsplineJoint *joint);

// Changes the mode (`FLEXSPLINE_MODE_...`): `FLEXSPLINE_STATUS_MODE` where there is no such transition
// (`flexspline_mode_may_become`).
enum FlexsplineStatus flexspline_state_request(struct FlexsplineState *state,
                                               uint8_t mode);

// On command: which side of the play the drive rests on is not known any more, as after work on it.
enum FlexsplineStatus flexspline_state_forget_side(struct FlexsplineState *state);

// Writes the report on a state, as the last tick left it.
enum FlexsplineStatus flexspline_state_report(const struct FlexsplineState *state,
                                              struct FlexsplineStateReport *report);

// Writes what must survive a reset: `FLEXSPLINE_SAVED_BYTES` bytes, with version, table and joint.
enum FlexsplineStatus flexspline_state_save(const struct FlexsplineState *state,
                                            const struct FlexsplineJoint *joint,
                                            const struct FlexsplineStore *store,
                                            uint8_t (*saved)[FLEXSPLINE_SAVED_BYTES]);

// Makes a state of bytes that the same joint saved with the same table, in mode off; only if the joint cannot have
// moved meanwhile. The first sample is held against the one that was saved.
enum FlexsplineStatus flexspline_state_restore(struct FlexsplineState *state,
                                               const struct FlexsplineJoint *joint,
                                               const struct FlexsplineStore *store,
                                               const uint8_t (*saved)[FLEXSPLINE_SAVED_BYTES]);

// One tick: from what was measured to what to command, once every `tick_s` and in the order of time.
// `FLEXSPLINE_STATUS_OK` also where no correction could be made: `flags` and `quality` of the output say so.
//
// The adjustment in the input is taken as known, and unprotected: what learning or springs add belongs into an
// adjustment of its own (`flexspline_tick_adjusted`).
enum FlexsplineStatus flexspline_tick(const struct FlexsplineJoint *joint,
                                      const struct FlexsplineImages *table,
                                      struct FlexsplineStore *store,
                                      struct FlexsplineState *state,
                                      const struct FlexsplineInput *input,
                                      struct FlexsplineOutput *output);

// As `flexspline_tick`, with an adjustment that was kept under a sum since the tick before, and has its uncertainty;
// that of the input comes on top.
enum FlexsplineStatus flexspline_tick_adjusted(const struct FlexsplineJoint *joint,
                                               const struct FlexsplineImages *table,
                                               struct FlexsplineStore *store,
                                               struct FlexsplineState *state,
                                               const struct FlexsplineInput *input,
                                               const struct FlexsplineAdjustment *adjustment,
                                               struct FlexsplineOutput *output);

// Where the output will be at a generator angle, counts of 2^-32 turn, under a torque, N m: from where the state
// rests, which stays as it is. A path with a reversal is that of ticks.
enum FlexsplineStatus flexspline_forward(const struct FlexsplineJoint *joint,
                                         const struct FlexsplineStore *store,
                                         const struct FlexsplineState *state,
                                         int64_t generator_counts,
                                         float torque_n_m,
                                         struct FlexsplinePrediction *prediction);

// Generator angle that brings the output to a target, counts of 2^-32 turn, under a torque, N m: in steady motion
// forward (+1) or backward (-1), or from where the state rests (0). No limiter and no mode: that is the tick's part.
enum FlexsplineStatus flexspline_inverse(const struct FlexsplineJoint *joint,
                                         const struct FlexsplineStore *store,
                                         const struct FlexsplineState *state,
                                         int64_t target_counts,
                                         float torque_n_m,
                                         int8_t direction,
                                         struct FlexsplineCommand *command);

// Where the generator is by an absolute reading of the output, counts of 2^-32 turn, under a torque, N m, both to
// within +- their half-widths; that of the reading with what the table missed (`projection_worst_rad`). For start-up:
// `flexspline_encoder_start` begins with the answer. The turn of the output is the one that is given.
enum FlexsplineStatus flexspline_joint_locate(const struct FlexsplineJoint *joint,
                                              const struct FlexsplineStore *store,
                                              int64_t output_counts,
                                              float output_half_width_rad,
                                              float torque_n_m,
                                              float torque_half_width_n_m,
                                              struct FlexsplineLocated *located);

// The torque by the wind-up, of a generator angle and a reading of the output, counts of 2^-32 turn: that which brings
// the output there while it moves forward (+1) or backward (-1), or on the flank that the state knows (0). The state
// knows it where its ticks were given the torque; one that was never ticked knows none, as it is right for an output
// that stands: the interval then goes from the torque of one flank to that of the other. The half-width of the
// reading, rad, is that of `flexspline_joint_locate`; the adjustment is that of the tick, or null. It takes ten to
// twenty times as long as a tick.
enum FlexsplineStatus flexspline_joint_torque(const struct FlexsplineJoint *joint,
                                              const struct FlexsplineStore *store,
                                              const struct FlexsplineState *state,
                                              const struct FlexsplineAdjustment *adjustment,
                                              int8_t direction,
                                              int64_t generator_counts,
                                              int64_t output_counts,
                                              float output_half_width_rad,
                                              struct FlexsplineTorqueFromWindUp *torque);

// Nominal output angle of a generator angle, counts of 2^-32 turn: generator over ratio.
enum FlexsplineStatus flexspline_nominal_output(const struct FlexsplineJoint *joint,
                                                int64_t generator_counts,
                                                int64_t *output_counts);

// Generator angle whose nominal output is an output angle, counts of 2^-32 turn: output times ratio.
enum FlexsplineStatus flexspline_nominal_generator(const struct FlexsplineJoint *joint,
                                                   int64_t output_counts,
                                                   int64_t *generator_counts);

// Ratio of a joint's drive, signed: generator turns in a turn of the output.
enum FlexsplineStatus flexspline_ratio(const struct FlexsplineJoint *joint, float *ratio);

// Reports the position of a drive inside its play, as the last tick left it.
enum FlexsplineStatus flexspline_state_play(const struct FlexsplineState *state,
                                            struct FlexsplinePlay *play);

// Checks one image in full, without a store, and reports its header. The work grows with the image: for
// start-up, or the host.
enum FlexsplineStatus flexspline_image_report(const uint8_t *image,
                                              size_t image_bytes,
                                              struct FlexsplineImageReport *report);

// How far units scatter about a table that a data sheet completed, as a share s of their stiffness: 0.3 of `+-30 %`; 0
// of any other table. What the table says of wind-up may be off by s / (1 - s) of it, which no tick states. Checks the
// image in full, as [`flexspline_image_report`] does.
enum FlexsplineStatus flexspline_image_sheet_scatter(const uint8_t *image,
                                                     size_t image_bytes,
                                                     float *scatter);

// Begins to receive a table of the given length. The buffer is the caller's and is given with every call; it is no
// image in use.
enum FlexsplineStatus flexspline_upload_begin(struct FlexsplineUpload *upload,
                                              size_t announced);

// Takes the bytes from `offset` on: `FLEXSPLINE_STATUS_ORDER` if they are not the next ones, which can still come.
enum FlexsplineStatus flexspline_upload_chunk(struct FlexsplineUpload *upload,
                                              uint8_t *buffer,
                                              size_t buffer_bytes,
                                              size_t offset,
                                              const uint8_t *chunk,
                                              size_t chunk_bytes);

// Checks a table of which all bytes came, in full, and reports its id; it can then be activated.
enum FlexsplineStatus flexspline_upload_finish(const struct FlexsplineUpload *upload,
                                               const uint8_t *buffer,
                                               size_t buffer_bytes,
                                               uint8_t (*table_id)[8]);

// Begins to watch for events: off, without a table.
enum FlexsplineStatus flexspline_watch_init(struct FlexsplineWatch *watch);

// Reports the changes, after `flexspline_tick`; `output` is that tick's output.
enum FlexsplineStatus flexspline_watch_see(struct FlexsplineWatch *watch,
                                           const struct FlexsplineState *state,
                                           const struct FlexsplineStore *store,
                                           const struct FlexsplineOutput *output,
                                           struct FlexsplineEvents *events);

// Writes a record of telemetry of a tick: `FLEXSPLINE_RECORD_BYTES` bytes with a CRC-32. `number` and `lost` are the
// caller's: of the record, and of those that it could not keep.
enum FlexsplineStatus flexspline_record(uint32_t tick,
                                        uint16_t number,
                                        uint16_t lost,
                                        const struct FlexsplineState *state,
                                        const struct FlexsplineStore *store,
                                        const struct FlexsplineOutput *output,
                                        uint8_t (*record)[FLEXSPLINE_RECORD_BYTES]);

// Makes a predictor of its numbers, which the host discretised; `FLEXSPLINE_STATUS_ARGUMENT` if its observer does not
// contract.
enum FlexsplineStatus flexspline_predictor_init(struct FlexsplinePredictor *predictor,
                                                const float (*parts)[FLEXSPLINE_PREDICTOR_PARTS]);

// Makes a predictor of two inertias: discretises them over a tick and finds the gains of the observer, in double
// precision. For the host, or for a start-up that has the time (some 20000 products of small matrices).
// `FLEXSPLINE_STATUS_ARGUMENT` if a number is not finite and positive, or the observer does not contract.
enum FlexsplineStatus flexspline_predictor_of(struct FlexsplinePredictor *predictor,
                                              const struct FlexsplineInertias *inertias,
                                              const struct FlexsplineNoise *noise,
                                              double tick_s);

// Reports the numbers of a predictor, for `flexspline_predictor_init` of the firmware.
enum FlexsplineStatus flexspline_predictor_parts(const struct FlexsplinePredictor *predictor,
                                                 float (*parts)[FLEXSPLINE_PREDICTOR_PARTS]);

// Reports the largest error of the observer while the disturbances stay within their bounds: twist rad, speeds of
// motor and load rad/s, torque on the load N m; for `FlexsplineNow`. For the host or start-up: 10000 ticks in double
// precision.
enum FlexsplineStatus flexspline_predictor_state_bound(const struct FlexsplinePredictor *predictor,
                                                       const struct FlexsplineDisturbance *disturbance,
                                                       float (*bound)[4]);

// Makes an observer at rest, without load.
enum FlexsplineStatus flexspline_observer_init(struct FlexsplineObserver *observer);

// One tick of the observer. `FLEXSPLINE_STATUS_ARGUMENT` if a number that is used is not finite or beyond any drive,
// and the estimate stays; `FLEXSPLINE_STATUS_NOT_INITIALISED` if an upset hit more than a word of observer or
// predictor (one is mended): make them anew. The reported values are NaN then.
enum FlexsplineStatus flexspline_observer_step(struct FlexsplineObserver *observer,
                                               const struct FlexsplinePredictor *predictor,
                                               const struct FlexsplineMeasured *measured);

// Reports the estimates of an observer.
enum FlexsplineStatus flexspline_observer_report(const struct FlexsplineObserver *observer,
                                                 struct FlexsplineObserverReport *report);

// Predicts the output some ticks from now, with the table as the output map of the two inertias. The work
// grows with the ticks; call it in a slow rate group. `FLEXSPLINE_STATUS_ARGUMENT` if a number of `now` is not finite.
enum FlexsplineStatus flexspline_predict(const struct FlexsplinePredictor *predictor,
                                         const struct FlexsplineObserver *observer,
                                         const struct FlexsplineJoint *joint,
                                         const struct FlexsplineStore *store,
                                         const struct FlexsplineState *state,
                                         const struct FlexsplineNow *now,
                                         struct FlexsplineAhead *ahead);

// Makes an encoder of its settings, `FLEXSPLINE_STATUS_ARGUMENT` if they cannot be; where it is is not known yet.
enum FlexsplineStatus flexspline_encoder_init(struct FlexsplineEncoder *encoder,
                                              const struct FlexsplineEncoderSettings *settings);

// The first reading after a reset: of all angles with this reading the one nearest to `near_counts` (2^-32 turn) is
// taken, which is 0 or the angle that was saved. `FLEXSPLINE_STATUS_ARGUMENT` if the register cannot read that.
enum FlexsplineStatus flexspline_encoder_start(struct FlexsplineEncoder *encoder,
                                               uint64_t reading,
                                               int64_t near_counts);

// Takes a reading of the encoder of a joint's generator and reports the angle to give to its next tick, counts of
// 2^-32 turn, to the nearest. A reading that the tick does not believe (`FLEXSPLINE_FLAG_GLITCH`) moves no turn: one
// that is further from the one before than a tick allows is taken from the angle that was believed last, for N ticks;
// in N + 2 the generator cannot make half of what the register counts. So the turns are right as soon as the readings
// are, if no more than N - 1 in a row were wrong: 3 where a register of one turn is read a thousand times a second at
// 500 rad/s. After more the encoder is lost: give the tick no sample, and call `flexspline_encoder_start` with what is
// known otherwise. Wrong readings that agree with each other for longer than the joint's patience, or until the
// generator could have got there, are believed, as nothing tells them from motion: then, too, start it anew. A tick
// that is missed counts as one of the N at this call, as two at later ones.
// `FLEXSPLINE_STATUS_ARGUMENT` if the register cannot read that (give the tick no
// sample then), or if `generator_rate_rad_s` allows a sixth of what the register counts in a tick, so that motion
// hides a wrong bit; `FLEXSPLINE_STATUS_NOT_INITIALISED` before `flexspline_encoder_start`, and where encoder or joint
// are lost.
enum FlexsplineStatus flexspline_joint_read(const struct FlexsplineJoint *joint,
                                            const struct FlexsplineState *state,
                                            struct FlexsplineEncoder *encoder,
                                            uint64_t reading,
                                            int64_t *angle_counts);

// The same for an encoder that no joint judges: one wrong reading, half of what the register counts away, moves it by
// all that it counts, for good. Takes a reading and reports the angle, counts of 2^-32 turn, to the nearest. Between
// two readings it may move by less than half of what the register counts. `FLEXSPLINE_STATUS_ARGUMENT` if the register
// cannot read that (give the tick no sample then), `FLEXSPLINE_STATUS_NOT_INITIALISED` before
// `flexspline_encoder_start`, and after an upset of more than a word (one word is mended): make it and start it again.
enum FlexsplineStatus flexspline_encoder_read(struct FlexsplineEncoder *encoder,
                                              uint64_t reading,
                                              int64_t *angle_counts);

// Register value at an angle, to the nearest count: for a drive that is commanded in counts of its encoder.
enum FlexsplineStatus flexspline_encoder_reading(const struct FlexsplineEncoder *encoder,
                                                 int64_t angle_counts,
                                                 uint64_t *reading);

// Counts of 2^-32 turn of an angle in radians, to the nearest; `FLEXSPLINE_STATUS_ARGUMENT` if it is not finite or
// beyond 2^31 turns. For start-up and the host: in double precision.
enum FlexsplineStatus flexspline_counts_from_rad(double rad,
                                                 int64_t *angle_counts);

// Radians of an angle in counts of 2^-32 turn. For start-up and the host: in double precision.
double flexspline_rad_from_counts(int64_t angle_counts);

// Radians from one angle to another, both in counts of 2^-32 turn, held within half a turn: in single precision, exact
// to 1.2e-7 of it.
float flexspline_rad_between(int64_t from_counts,
                             int64_t to_counts);

// 1 if a slower group that runs in every `divisor`-th tick, from `offset` on, runs in tick number `tick`, else 0; 0
// too where `divisor` is 0 or `offset` not below it.
uint8_t flexspline_is_due(uint32_t tick,
                          uint32_t divisor,
                          uint32_t offset);

// Makes a learner of 1 to `FLEXSPLINE_LEARNER_COEFFICIENTS` coefficients that has learnt nothing yet and is off;
// `FLEXSPLINE_STATUS_ARGUMENT` if a setting is out of its range. An update takes as long with one as with all.
enum FlexsplineStatus flexspline_learner_init(struct FlexsplineLearner *learner,
                                              const struct FlexsplineLearnSettings *settings,
                                              const struct FlexsplineCoefficient *coefficients,
                                              uint8_t number);

// Switches learning (`FLEXSPLINE_LEARNING_...`), from the next update on.
enum FlexsplineStatus flexspline_learner_set(struct FlexsplineLearner *learner, uint8_t learning);

// Says whose coefficients are learnt: of this joint with the table in use. Saved learners carry both, and are restored
// only where they belong. `unit` distinguishes joints with the same settings and the same table, such as the
// wheels of a rover; 0 if there is one. After `flexspline_learner_init` and the table, before
// `flexspline_learner_restore`; again after another table was activated: what was learnt for another owner is
// forgotten. `FLEXSPLINE_STATUS_ARGUMENT` if no table is in use.
enum FlexsplineStatus flexspline_learner_bind(struct FlexsplineLearner *learner,
                                              const struct FlexsplineJoint *joint,
                                              const struct FlexsplineStore *store,
                                              uint32_t unit);

// Forgets what was learnt; counters and `FLEXSPLINE_LEARNING_...` stay. The limiter of the joint takes the adjustment
// out.
enum FlexsplineStatus flexspline_learner_reset(struct FlexsplineLearner *learner);

// One tick, every tick and in order, after `flexspline_tick` with what it was given and gave: learns from the output
// angle measured at the same moment (`has_measured` 1, `measured_counts` of 2^-32 turn) if there is one, and reports
// the addition in the next tick. Nothing that comes in can make that exceed the limits. `input` is that of the tick
// with the learner's own adjustment alone: what springs or a model of yours added to it counts as known then, and
// is not learnt a second time.
enum FlexsplineStatus flexspline_learner_update(struct FlexsplineLearner *learner,
                                                const struct FlexsplineState *state,
                                                const struct FlexsplineInput *input,
                                                const struct FlexsplineOutput *output,
                                                uint8_t has_measured,
                                                int64_t measured_counts,
                                                struct FlexsplineAdapted *adapted);

// Reports a coefficient, by its index in the list that the learner was made of; `FLEXSPLINE_STATUS_ARGUMENT` beyond
// it.
enum FlexsplineStatus flexspline_learner_coefficient(const struct FlexsplineLearner *learner,
                                                     uint8_t place,
                                                     struct FlexsplineLearnt *learnt);

// Reports the counts of measurements by verdict.
enum FlexsplineStatus flexspline_learner_report(const struct FlexsplineLearner *learner,
                                                struct FlexsplineLearnerReport *report);

// Writes what was learnt, with a CRC-32, and how many bytes that took: `FLEXSPLINE_SAVED_LEARNER_BYTES` at most.
// `FLEXSPLINE_STATUS_TOO_LARGE` if there is less room. The same bytes as in Rust.
enum FlexsplineStatus flexspline_learner_save(const struct FlexsplineLearner *learner,
                                              uint8_t *saved,
                                              size_t saved_bytes,
                                              size_t *written);

// Takes back what a learner of the same coefficients and the same owner (`flexspline_learner_bind`) saved, and is off.
// `FLEXSPLINE_STATUS_SAVED` if the bytes are damaged, fewer, of another version, or were saved with other
// coefficients; `FLEXSPLINE_STATUS_OTHER_TABLE`, `FLEXSPLINE_STATUS_OTHER_JOINT` if they belong elsewhere. Then the
// learner is as it was. It is made first, by `flexspline_learner_init`, and bound.
enum FlexsplineStatus flexspline_learner_restore(struct FlexsplineLearner *learner,
                                                 const uint8_t *saved,
                                                 size_t saved_bytes);

// Makes 1 to `FLEXSPLINE_SLIP_SPRINGS` springs that slip with `variable` (`FLEXSPLINE_SLIP_OF_...`), no deflection of
// which is known; `FLEXSPLINE_STATUS_ARGUMENT` if a width is not allowed or a gain not finite.
enum FlexsplineStatus flexspline_slip_init(struct FlexsplineSlip *slip,
                                           uint8_t variable,
                                           const struct FlexsplineSpring *springs,
                                           uint8_t number);

// Sets all deflections anew: 0, not known, as after a reset; 1, none, as before the first motion or after strokes that
// died away.
enum FlexsplineStatus flexspline_slip_set(struct FlexsplineSlip *slip,
                                          uint8_t is_relaxed);

// One tick of springs that slip with the nominal output (`flexspline_nominal_output`), counts of 2^-32 turn: what they
// add in the next. `FLEXSPLINE_STATUS_ARGUMENT` if they slip with the torque; `FLEXSPLINE_STATUS_NOT_INITIALISED` if
// an upset hit more than a word of the springs (one is mended). Deflections of which more was hit are unknown again,
// as after a reset.
enum FlexsplineStatus flexspline_slip_update(struct FlexsplineSlip *slip,
                                             int64_t nominal_counts,
                                             struct FlexsplineSlipReport *report);

// One tick of springs that slip with the load torque, N m: what they add in the next. A torque that is not finite
// moves nothing. `FLEXSPLINE_STATUS_ARGUMENT` if they slip with the output.
enum FlexsplineStatus flexspline_slip_update_torque(struct FlexsplineSlip *slip,
                                                    float torque_n_m,
                                                    struct FlexsplineSlipReport *report);

// Writes the deflections with a CRC-32, and how many bytes that took: `FLEXSPLINE_SAVED_SLIP_BYTES` at most.
// `FLEXSPLINE_STATUS_TOO_LARGE` if there is less room, or before the first update. They belong to no joint and no
// table: those of `flexspline_slip_save_for` do. The same bytes as in Rust.
enum FlexsplineStatus flexspline_slip_save(const struct FlexsplineSlip *slip,
                                           uint8_t *saved,
                                           size_t saved_bytes,
                                           size_t *written);

// Takes back the deflections that the same springs saved; only if the joint (of springs on the torque: the load)
// cannot have moved meanwhile. `FLEXSPLINE_STATUS_SAVED` if the bytes are damaged, fewer, of other springs, or were
// saved for a joint (`flexspline_slip_restore_for`). The springs are made first, by `flexspline_slip_init`.
enum FlexsplineStatus flexspline_slip_restore(struct FlexsplineSlip *slip,
                                              const uint8_t *saved,
                                              size_t saved_bytes);

// Makes an adjustment that adds nothing.
enum FlexsplineStatus flexspline_adjustment_init(struct FlexsplineAdjustment *adjustment);

// Adds to an adjustment, counts of 2^-32 turn at the output, each sum held within +-0.049 rad; and to its uncertainty,
// rad: that of springs, and that of a learner whose verdict is lost (else 0: its standard deviation is no bound).
// Where it is not 0 the next tick is uncertain by it. Below 0 and what is no number count as the largest.
enum FlexsplineStatus flexspline_adjustment_add(struct FlexsplineAdjustment *adjustment,
                                                int32_t mean_counts,
                                                int32_t half_width_counts,
                                                float uncertainty_rad);

// Adds to the adjustment of an input, counts of 2^-32 turn at the output: what a learner, springs or a friction model
// of your own say. Each sum is held within
// +-0.049 rad.
enum FlexsplineStatus flexspline_input_add(struct FlexsplineInput *input,
                                           int32_t mean_counts,
                                           int32_t half_width_counts);

// The same in radians at the output; NaN adds nothing.
enum FlexsplineStatus flexspline_input_add_rad(struct FlexsplineInput *input,
                                               float mean_rad,
                                               float half_width_rad);

// A sum of the sizes of all types of this header, as the library has them. Where it is not `FLEXSPLINE_LAYOUT` the
// program was compiled with another header, or with options that change a layout (packed structures, enumerations of
// another size): do not go on.
uint32_t flexspline_layout(void);

// Version of this library, as text.
const char *flexspline_version(void);

// Version of this library, to compare with `FLEXSPLINE_VERSION_NUMBER` of the header.
uint32_t flexspline_version_number(void);

// Version of the table format that is read.
uint16_t flexspline_format_version(void);

// Short text of a status.
const char *flexspline_status_text(int status);

// Name of a mode.
const char *flexspline_mode_name(uint8_t mode);

// 1 if a mode may be followed by another, else 0: everything may become off or safe; off and hold tracking; tracking
// hold.
uint8_t flexspline_mode_may_become(uint8_t mode,
                                   uint8_t next);

// Name of a quality.
const char *flexspline_quality_name(uint8_t quality);

// Name of a health, as in `FlexsplineStoreReport`.
const char *flexspline_health_name(uint8_t health);

// Name of one flag: of `FLEXSPLINE_FLAG_...`, one bit at a time.
const char *flexspline_flag_name(uint16_t flag);

// Name of one event: of `FLEXSPLINE_EVENT_...`, one bit at a time.
const char *flexspline_event_name(uint16_t event);

// Name of what is implausible: of `FLEXSPLINE_IMPLAUSIBLE_...`, one bit at a time.
const char *flexspline_implausible_name(uint16_t implausible);

// Name of what is done in a tick that came late: of `FLEXSPLINE_OVERRUN_...`.
const char *flexspline_overrun_name(uint8_t overrun);

// Name of a fixed member: of `FLEXSPLINE_FIXED_...`.
const char *flexspline_fixed_member_name(uint8_t fixed_member);

// Name of a kind of wave generator, as in `FlexsplineImageReport`.
const char *flexspline_generator_name(uint8_t generator);

// Name of how far an activation is: of `FLEXSPLINE_PROGRESS_...`.
const char *flexspline_progress_name(uint8_t progress);

// Name of what was found of an identity: of `FLEXSPLINE_IDENTITY_...`.
const char *flexspline_identity_name(uint8_t found);

// Name of what learning does: of `FLEXSPLINE_LEARNING_...`.
const char *flexspline_learning_name(uint8_t learning);

// Name of what became of a measurement: of `FLEXSPLINE_VERDICT_...`.
const char *flexspline_verdict_name(uint8_t verdict);

// Name of a coefficient: of `FLEXSPLINE_TERM_...`.
const char *flexspline_term_name(uint8_t term);

// Begins a test of the sensors that moves the generator from where it is and back, before the first tick.
// `FLEXSPLINE_STATUS_ARGUMENT` if a number is not finite, the way too short to decide or too long, or the ticks too
// few.
enum FlexsplineStatus flexspline_start_up_init(struct FlexsplineStartUp *start_up,
                                               const struct FlexsplineJoint *joint,
                                               int64_t generator_counts,
                                               const struct FlexsplineStartUpSettings *settings);

// One tick of the test: what the sensors say, with the command of the tick before; what to command now, and with the
// last one what was found. Where something is implausible do not let the joint correct: its numbers are not what they
// are taken for.
enum FlexsplineStatus flexspline_start_up_step(struct FlexsplineStartUp *start_up,
                                               const struct FlexsplineReadings *readings,
                                               struct FlexsplineStartUpStep *step);

// As `flexspline_slip_save`, with joint and table: the bytes are restored for the same ones alone.
enum FlexsplineStatus flexspline_slip_save_for(const struct FlexsplineSlip *slip,
                                               const struct FlexsplineJoint *joint,
                                               const struct FlexsplineStore *store,
                                               uint8_t *saved,
                                               size_t saved_bytes,
                                               size_t *written);

// As `flexspline_slip_restore`, of bytes that the same springs saved for the same joint with the same table:
// `FLEXSPLINE_STATUS_OTHER_TABLE` or `FLEXSPLINE_STATUS_OTHER_JOINT` (or other springs) if not.
enum FlexsplineStatus flexspline_slip_restore_for(struct FlexsplineSlip *slip,
                                                  const struct FlexsplineJoint *joint,
                                                  const struct FlexsplineStore *store,
                                                  const uint8_t *saved,
                                                  size_t saved_bytes);

// Makes a recorder for a list of the given number of records (1 or more), which is the caller's and given with every
// call. It keeps every `divisor`-th tick, from `offset` on; `full` (`FLEXSPLINE_FULL_...`) says what is lost where
// there is no room.
enum FlexsplineStatus flexspline_recorder_init(struct FlexsplineRecorder *recorder,
                                               uint16_t places,
                                               uint32_t divisor,
                                               uint32_t offset,
                                               uint8_t full);

// One tick, after `flexspline_tick`: kept if it is due, or whether due or not (`at_once` 1: something happened). Never
// waits. `records` are those that the recorder was made for.
enum FlexsplineStatus flexspline_recorder_see(struct FlexsplineRecorder *recorder,
                                              struct FlexsplineRecord *records,
                                              uint32_t tick,
                                              uint8_t at_once,
                                              const struct FlexsplineState *state,
                                              const struct FlexsplineStore *store,
                                              const struct FlexsplineOutput *output);

// Takes the oldest record out: `is_taken` is 1, or 0 if none waits, and `record` is as it was. With the interrupt of
// the tick held off.
enum FlexsplineStatus flexspline_recorder_take(struct FlexsplineRecorder *recorder,
                                               const struct FlexsplineRecord *records,
                                               struct FlexsplineRecord *record,
                                               uint8_t *is_taken);

// Writes a record as `FLEXSPLINE_RECORD_BYTES` bytes with a CRC-32, for the ground: docs/telemetry.xtce.xml is their
// dictionary. `FLEXSPLINE_STATUS_ARGUMENT` if its quality, mode or health is none.
enum FlexsplineStatus flexspline_record_encode(const struct FlexsplineRecord *record,
                                               uint8_t (*bytes)[FLEXSPLINE_RECORD_BYTES]);

// Reads such bytes (`FLEXSPLINE_RECORD_BYTES`), on the ground: `FLEXSPLINE_STATUS_SAVED` if they are damaged or no
// record, `FLEXSPLINE_STATUS_ARGUMENT` if they are one of another version.
enum FlexsplineStatus flexspline_record_decode(const uint8_t *first,
                                               struct FlexsplineRecord *record);

// Makes a path that has seen nothing yet; `FLEXSPLINE_STATUS_ARGUMENT` if a time or bandwidth is not finite and
// positive, or a drag or hold not finite or below 0. A torque in the mesh may change the flank in any tick, and any
// reading is believed: `flexspline_torque_init_sensor` says more.
enum FlexsplineStatus flexspline_torque_init(struct FlexsplineTorquePath *path,
                                             const struct FlexsplineTorqueSettings *settings);

// As `flexspline_torque_init`, with what is known of sensor and servo. After a torque read in the mesh has changed the
// flank it does not change it again for `settle_s`, s (some periods of the servo's position loop, 0 or more): the
// correction crosses the play then, and what its own motion makes of the torque has to die away. A reading beyond
// `largest_n_m`, N m (above 0), is forgotten as one that is not finite.
enum FlexsplineStatus flexspline_torque_init_sensor(struct FlexsplineTorquePath *path,
                                                    const struct FlexsplineTorqueSettings *settings,
                                                    float settle_s,
                                                    float largest_n_m);

// One tick: a reading, N m, positive where it turns the output forward, where it was measured
// (`FLEXSPLINE_TORQUE_...`), and the direction in which the output moves or moved last, +1 or -1; what to give to
// `FlexsplineInput`. A reading that is not finite, larger than the sensor's largest, frozen, or too far from the last
// one gives NaN and is forgotten. `FLEXSPLINE_STATUS_NOT_INITIALISED` where an upset hit more than a word of it (one
// is mended): make the path anew.
enum FlexsplineStatus flexspline_torque_tick(struct FlexsplineTorquePath *path,
                                             uint8_t place,
                                             float reading_n_m,
                                             int8_t direction,
                                             float *torque_n_m);

// Other limits of what a sensor can read, after `flexspline_torque_init_sensor`: the largest change from one tick to
// the next, N m (a quarter of the largest reading and twice the drag without this call; a reading that changes by more
// is believed once three in a row are near each other), and the number of ticks after which a reading that stays the
// same to the last bit is frozen (0 for never, as without this call: what comes from a model may stand still, a sensor
// has noise). `FLEXSPLINE_STATUS_ARGUMENT` if the change is not finite or below 1e-6 N m.
enum FlexsplineStatus flexspline_torque_set_sensor(struct FlexsplineTorquePath *path,
                                                   float jump_n_m,
                                                   uint16_t frozen_ticks);

// Nothing measured yet; what is older than `most_ticks` is not used.
enum FlexsplineStatus flexspline_aged_init(struct FlexsplineAged *aged, uint16_t most_ticks);

// One tick: what was measured in it, if anything (`has_measured` 1, else 0); the value to use, or NaN where it is too
// old, or was hit by an upset. A tick takes NaN as torque: it keeps its correction for `patience` ticks, then fades it
// out.
enum FlexsplineStatus flexspline_aged_tick(struct FlexsplineAged *aged,
                                           uint8_t has_measured,
                                           float measured,
                                           float *value);

// 1 if there is no value that may be used, else 0: ask for the sensor.
enum FlexsplineStatus flexspline_aged_is_stale(const struct FlexsplineAged *aged,
                                               uint8_t *is_stale);

// Rate at which the generator has to turn so that the output moves at `rate_rad_s`, rad/s: the nominal one and what
// the error adds, along the way of the target over `ahead_s` (some ticks, above 0). For the speed loop of a servo; it
// cannot feed a torque back. NaN where the table gives nothing. Two inverse solutions: for a tick that has the time,
// or every few ticks.
enum FlexsplineStatus flexspline_rate_ahead(const struct FlexsplineJoint *joint,
                                            const struct FlexsplineStore *store,
                                            int64_t target_counts,
                                            float rate_rad_s,
                                            float torque_n_m,
                                            float ahead_s,
                                            float *generator_rate_rad_s);

// As `flexspline_rate_ahead`, with the acceleration that goes with it: what the error's curvature adds along the way
// of the target, and what a target asks for that itself accelerates by `acceleration_rad_s2`. Inertia of motor and
// generator times it goes to the motor's current; the load's inertia times `acceleration_rad_s2` over the ratio comes
// on top. Both are NaN where the table gives nothing. Three inverse solutions.
enum FlexsplineStatus flexspline_motion_ahead(const struct FlexsplineJoint *joint,
                                              const struct FlexsplineStore *store,
                                              int64_t target_counts,
                                              float rate_rad_s,
                                              float acceleration_rad_s2,
                                              float torque_n_m,
                                              float ahead_s,
                                              struct FlexsplineMotionAhead *ahead);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* FLEXSPLINE_H */


#ifndef FLEXSPLINE_LAYOUT
// What `flexspline_layout` says where program and library agree on the size of all types above: `if (flexspline_layout() != FLEXSPLINE_LAYOUT) stop();`
#define FLEXSPLINE_AND_SIZE_(type) * 31u + (uint32_t)sizeof(type))
#define FLEXSPLINE_LAYOUT \
  (((((((((((((((((((((((((((((((((((((((((((((((((((((0u \
  FLEXSPLINE_AND_SIZE_(FlexsplineStatus) \
  FLEXSPLINE_AND_SIZE_(size_t) \
  FLEXSPLINE_AND_SIZE_(FlexsplineStore) \
  FLEXSPLINE_AND_SIZE_(FlexsplineActivation) \
  FLEXSPLINE_AND_SIZE_(FlexsplineIdentity) \
  FLEXSPLINE_AND_SIZE_(FlexsplineJoint) \
  FLEXSPLINE_AND_SIZE_(FlexsplineState) \
  FLEXSPLINE_AND_SIZE_(FlexsplineSettings) \
  FLEXSPLINE_AND_SIZE_(FlexsplineImages) \
  FLEXSPLINE_AND_SIZE_(FlexsplineInput) \
  FLEXSPLINE_AND_SIZE_(FlexsplineOutput) \
  FLEXSPLINE_AND_SIZE_(FlexsplineStoreReport) \
  FLEXSPLINE_AND_SIZE_(FlexsplineStateReport) \
  FLEXSPLINE_AND_SIZE_(FlexsplineUpload) \
  FLEXSPLINE_AND_SIZE_(FlexsplineWatch) \
  FLEXSPLINE_AND_SIZE_(FlexsplinePredictor) \
  FLEXSPLINE_AND_SIZE_(FlexsplineObserver) \
  FLEXSPLINE_AND_SIZE_(FlexsplineEvents) \
  FLEXSPLINE_AND_SIZE_(FlexsplineMeasured) \
  FLEXSPLINE_AND_SIZE_(FlexsplineObserverReport) \
  FLEXSPLINE_AND_SIZE_(FlexsplineNow) \
  FLEXSPLINE_AND_SIZE_(FlexsplineAhead) \
  FLEXSPLINE_AND_SIZE_(FlexsplineInertias) \
  FLEXSPLINE_AND_SIZE_(FlexsplineNoise) \
  FLEXSPLINE_AND_SIZE_(FlexsplineDisturbance) \
  FLEXSPLINE_AND_SIZE_(FlexsplinePrediction) \
  FLEXSPLINE_AND_SIZE_(FlexsplineCommand) \
  FLEXSPLINE_AND_SIZE_(FlexsplineLocated) \
  FLEXSPLINE_AND_SIZE_(FlexsplineTorqueFromWindUp) \
  FLEXSPLINE_AND_SIZE_(FlexsplinePlay) \
  FLEXSPLINE_AND_SIZE_(FlexsplineImageReport) \
  FLEXSPLINE_AND_SIZE_(FlexsplineTorqueSettings) \
  FLEXSPLINE_AND_SIZE_(FlexsplineTorquePath) \
  FLEXSPLINE_AND_SIZE_(FlexsplineAged) \
  FLEXSPLINE_AND_SIZE_(FlexsplineMotionAhead) \
  FLEXSPLINE_AND_SIZE_(FlexsplineCoefficient) \
  FLEXSPLINE_AND_SIZE_(FlexsplineLearnSettings) \
  FLEXSPLINE_AND_SIZE_(FlexsplineLearner) \
  FLEXSPLINE_AND_SIZE_(FlexsplineAdapted) \
  FLEXSPLINE_AND_SIZE_(FlexsplineLearnerReport) \
  FLEXSPLINE_AND_SIZE_(FlexsplineLearnt) \
  FLEXSPLINE_AND_SIZE_(FlexsplineSpring) \
  FLEXSPLINE_AND_SIZE_(FlexsplineSlip) \
  FLEXSPLINE_AND_SIZE_(FlexsplineSlipReport) \
  FLEXSPLINE_AND_SIZE_(FlexsplineRecorder) \
  FLEXSPLINE_AND_SIZE_(FlexsplineRecord) \
  FLEXSPLINE_AND_SIZE_(FlexsplineEncoderSettings) \
  FLEXSPLINE_AND_SIZE_(FlexsplineEncoder) \
  FLEXSPLINE_AND_SIZE_(FlexsplineStartUp) \
  FLEXSPLINE_AND_SIZE_(FlexsplineStartUpSettings) \
  FLEXSPLINE_AND_SIZE_(FlexsplineReadings) \
  FLEXSPLINE_AND_SIZE_(FlexsplineStartUpStep) \
  FLEXSPLINE_AND_SIZE_(FlexsplineAdjustment)

// Sizes and alignments that the compiler can check without the library.
#if defined(__cplusplus)
#define FLEXSPLINE_CHECK_(name, condition) static_assert(condition, "flexspline.h: size or alignment of " #name)
#elif defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L
#define FLEXSPLINE_CHECK_(name, condition) _Static_assert(condition, "flexspline.h: size or alignment of " #name)
#else
#define FLEXSPLINE_CHECK_(name, condition) typedef char flexspline_size_or_alignment_of_##name[(condition) ? 1 : -1]
#endif
struct FlexsplineWord_ {
  char before;
  uint64_t word;
};
#define FLEXSPLINE_OBJECT_(type, words) \
  struct type##Aligned_ { \
    char before; \
    type object; \
  }; \
  FLEXSPLINE_CHECK_(type, sizeof(type) == 8 * (words) && \
                              offsetof(struct type##Aligned_, object) == offsetof(struct FlexsplineWord_, word))
FLEXSPLINE_OBJECT_(FlexsplineStore, FLEXSPLINE_STORE_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineJoint, FLEXSPLINE_JOINT_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineState, FLEXSPLINE_STATE_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineActivation, FLEXSPLINE_ACTIVATION_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineIdentity, FLEXSPLINE_IDENTITY_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineUpload, FLEXSPLINE_UPLOAD_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineWatch, FLEXSPLINE_WATCH_WORDS);
FLEXSPLINE_OBJECT_(FlexsplinePredictor, FLEXSPLINE_PREDICTOR_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineObserver, FLEXSPLINE_OBSERVER_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineLearner, FLEXSPLINE_LEARNER_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineSlip, FLEXSPLINE_SLIP_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineRecorder, FLEXSPLINE_RECORDER_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineTorquePath, FLEXSPLINE_TORQUE_PATH_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineAged, FLEXSPLINE_AGED_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineEncoder, FLEXSPLINE_ENCODER_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineStartUp, FLEXSPLINE_START_UP_WORDS);
FLEXSPLINE_OBJECT_(FlexsplineAdjustment, FLEXSPLINE_ADJUSTMENT_WORDS);
FLEXSPLINE_CHECK_(packed_structures, sizeof(FlexsplineStateReport) == 8);
FLEXSPLINE_CHECK_(FlexsplineWord_, sizeof(uint64_t) == 8 && sizeof(float) == 4 && sizeof(double) == 8);
#endif
