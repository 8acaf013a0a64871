//! Whether the sensors of a joint say what its motor does: units, signs and dead wires, before the first tick.
//!
//! The motor turns the generator a little forward and back. What each sensor says of that is held against what must
//! come of it: the generator's encoder against the command, an encoder at the output against the ratio, a torque in the
//! mesh against the drag, which turns over with the direction. A wrong unit is a wrong ratio, a wrong sign a wrong
//! sign, a frozen sensor says nothing.
//!
//! ```
//! use flexspline::*;
//!
//! # const JOINT: Joint = {
//! #     let Ok(drive) = Drive::new(188, 190, FixedMember::Flexspline) else { panic!() };
//! #     let limits = Limits {
//! #         tick_s: 1e-3, rate_rad_s: 0.05, acceleration_rad_s2: 5.0, generator_rate_rad_s: 600.0, debounce_ticks: 5,
//! #         deadband_rad: 1e-6,
//! #     };
//! #     let Ok(joint) = Joint::new(drive, limits, Overrun::SkipAndCount) else { panic!() };
//! #     joint
//! # };
//! let settings = StartUpSettings {
//!     way_rad: Degrees(1080.0).rad(), ticks: 1000, output_error_rad: 1e-3, drag_n_m: 1.5,
//! };
//! let mut start_up = StartUp::new(&JOINT, GeneratorAngle::ZERO, &settings)?;
//! let mut generator = GeneratorAngle::ZERO; // what the encoder says
//! let found = loop {
//!     let readings = Readings { generator: Some(generator), output: None, torque_n_m: None };
//!     let step = start_up.step(&readings);
//!     generator = step.command; // the motor follows
//!     if let Some(found) = step.found {
//!         break found;
//!     }
//! };
//! assert!(found.is_plausible());
//! # Ok::<(), SettingError>(())
//! ```

use super::limits::{SettingError, checked};
use super::runtime::Joint;
use super::signals::Implausible;
use crate::angle::{GeneratorAngle, OutputAngle};
use crate::whole::{Sealed, words};

/// How far the motor moves, and what is expected of it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartUpSettings {
    /// Way of the generator, there and back, rad. At the output it must be ten times `output_error_rad` at least, and
    /// half a turn at most.
    pub way_rad: f32,
    /// Error of the output in one move, rad: twice the error that the table states is enough.
    pub output_error_rad: f32,
    /// Coulomb drag of the output that a torque in the mesh turns over by, N m; it may be wrong by three times. Above
    /// 0.
    pub drag_n_m: f32,
    /// Ticks for each way, 8 or more; the last half of each is for the servo to settle.
    pub ticks: u16,
}

/// Sensor readings of a tick; `None` for a missing one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readings {
    /// The generator's encoder.
    pub generator: Option<GeneratorAngle>,
    /// An encoder at the output.
    pub output: Option<OutputAngle>,
    /// A torque that is measured in the mesh, N·m. (One on the load says nothing about a motion.)
    pub torque_n_m: Option<f32>,
}

/// Command and result of a tick of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartUpStep {
    /// The generator angle to command.
    pub command: GeneratorAngle,
    /// With the last tick what was found: [`Implausible::is_plausible`] or not.
    pub found: Option<Implausible>,
}

/// A test of the sensors under way, under a sum ([`whole`](../../whole.rs)): an upset of one word is mended in the next
/// step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartUp {
    test: Sealed<SensorTest>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct SensorTest {
    /// Where the generator begins, its way there, and the way of the output that belongs to it, counts.
    from: i64,
    way: i64,
    output_way: i64,
    output_error: i64,
    drag_n_m: f32,
    ticks: u32,
    tick: u32,
    /// At the start, at the end of the way there, and of that back.
    generator: [i64; 3],
    output: [i64; 3],
    torque_n_m: [f32; 3],
    /// Sum of the torques in the moving half of the way, and their number.
    torque_sum: f32,
    torques: u32,
    /// Which sensors there are ([`present`]), and [`LOST`].
    marks: u32,
}
words!([] SensorTest {
    from, way, output_way, output_error, drag_n_m, ticks, tick, generator, output, torque_n_m, torque_sum, torques,
    marks,
});

/// A bit of the marks of a test, by definition: there is an encoder of the generator.
const GENERATOR: u32 = 1;
/// By definition: there is one at the output.
const OUTPUT: u32 = 2;
/// By definition: there is a torque.
const TORQUE: u32 = 4;
/// By definition: a sensor came or went, or said what is no number.
const LOST: u32 = 8;

const fn present(readings: &Readings) -> u32 {
    let generator = if readings.generator.is_some() { GENERATOR } else { 0 };
    let output = if readings.output.is_some() { OUTPUT } else { 0 };
    generator | output | if readings.torque_n_m.is_some() { TORQUE } else { 0 }
}

/// A way may differ from the expected one by a hundredth: the lag that a servo has left, not a unit or the counts in a
/// turn (4000 for 4096 is 2.3 hundredths). A guess.
const WAY_SHARE: u64 = 100;
/// A way below 2⁻⁸ of the expected one is none: noise of a sensor that stands. A guess.
const STILL_SHIFT: u32 = 8;
/// The torque turns over by this part of what the drag says, and by these factors, at least and at most; below a tenth
/// it does not change. Drag differs from unit to unit and with the temperature by two or three times
/// ([motion.md](https://docs.rs/crate/flexspline)); the nearest unit is 8.9 times off (N·m and lbf·in).
const DRAG_TIMES: f32 = 3.0;
const DRAG_STILL: f32 = 0.1;

impl StartUp {
    /// A test that moves the generator from where it is.
    ///
    /// # Errors
    /// [`SettingError`]: a number that is not finite, a way that is too short or too long for the error of the
    /// output, too few ticks, a drag of 0.
    pub fn new(joint: &Joint, from: GeneratorAngle, settings: &StartUpSettings) -> Result<Self, SettingError> {
        let StartUpSettings { way_rad, ticks, output_error_rad, drag_n_m } = *settings;
        let drive = joint.drive();
        let error = checked("output_error_rad", output_error_rad, output_error_rad as f64, [1e-7, 0.1])?;
        let least = 10.0 * error as f64;
        let at_output = way_rad as f64 / drive.exact_ratio();
        checked("way_rad", way_rad, at_output.abs(), [least, core::f64::consts::PI])?;
        checked("ticks", ticks as f32, ticks as f64, [8.0, 65_535.0])?;
        checked("drag_n_m", drag_n_m, drag_n_m as f64, [1e-6, 1e9])?;
        let counts = |rad: f64| crate::num::counts(rad) as i64;
        let way = counts(way_rad as f64);
        let test = SensorTest {
            from: from.counts(),
            way,
            output_way: drive.nominal_output(GeneratorAngle::from_counts(way)).counts(),
            output_error: counts(output_error_rad as f64),
            drag_n_m,
            ticks: ticks as u32,
            tick: 0,
            generator: [0; 3],
            output: [0; 3],
            torque_n_m: [0.0; 3],
            torque_sum: 0.0,
            torques: 0,
            marks: 0,
        };
        Ok(Self { test: Sealed::new(test) })
    }

    /// One tick: what the sensors say, with the command of the tick before; what to command now. Where an upset hit
    /// more than can be mended the generator stays where it is read, and the test ends with [`Implausible::LOST`].
    #[must_use]
    pub fn step(&mut self, readings: &Readings) -> StartUpStep {
        let command = readings.generator.unwrap_or_default();
        let lost = StartUpStep { command, found: Some(Implausible::LOST) };
        self.test.change(|test| test.step(readings)).unwrap_or(lost)
    }
}

impl SensorTest {
    fn step(&mut self, readings: &Readings) -> StartUpStep {
        let Self { way, ticks, tick, .. } = *self;
        let moving = ticks >> 1;
        let (leg, within) = if tick < ticks { (0u8, tick) } else { (1, tick.wrapping_sub(ticks)) };
        if tick == 0 {
            self.marks = present(readings);
            self.place(0, readings);
        }
        let torque_n_m = readings.torque_n_m.unwrap_or(0.0);
        let same = present(readings) == self.marks & !LOST && torque_n_m.is_finite();
        self.marks |= if same { 0 } else { LOST };
        // Where it moves, but for its beginning and its end.
        if within > moving >> 2 && within < moving {
            self.torque_sum += torque_n_m;
            self.torques = self.torques.saturating_add(1);
        }
        let place = if leg == 0 { 1 } else { 2 };
        if within == moving {
            if let Some(mean) = self.torque_n_m.get_mut(place) {
                *mean = self.torque_sum / self.torques as f32;
            }
            (self.torque_sum, self.torques) = (0.0, 0);
        }
        let last = within.wrapping_add(1) >= ticks;
        if last {
            self.place(place, readings);
        }
        self.tick = tick.saturating_add(1);
        let share = |within: u32| {
            let within = within.wrapping_add(1).min(moving) as i64;
            way.wrapping_mul(within).checked_div(moving as i64).unwrap_or(0)
        };
        let along = if leg == 0 { share(within) } else { way.wrapping_sub(share(within)) };
        let done = last && leg == 1;
        let command = self.from.wrapping_add(if done { 0 } else { along });
        StartUpStep { command: GeneratorAngle::from_counts(command), found: done.then(|| self.judge()) }
    }

    fn place(&mut self, number: usize, readings: &Readings) {
        let places = self.generator.get_mut(number).zip(self.output.get_mut(number));
        if let Some((generator, output)) = places {
            *generator = readings.generator.unwrap_or_default().counts();
            *output = readings.output.unwrap_or_default().counts();
        }
    }

    fn judge(&self) -> Implausible {
        let has = |sensor: u32| self.marks & sensor != 0;
        let mut found = Implausible::default()
            .with(Implausible::LOST, has(LOST))
            .with(Implausible::GENERATOR_LOST, !has(GENERATOR));
        let generator = [Implausible::GENERATOR_STILL, Implausible::GENERATOR_SIGN, Implausible::GENERATOR_RATIO];
        let output = [Implausible::OUTPUT_STILL, Implausible::OUTPUT_SIGN, Implausible::OUTPUT_RATIO];
        for (sensor, places, way, error, faults) in [
            (GENERATOR, self.generator, self.way, 0, generator),
            (OUTPUT, self.output, self.output_way, self.output_error, output),
        ] {
            let [start, there, back] = places;
            let share = way.unsigned_abs().checked_div(WAY_SHARE).unwrap_or(0);
            for (moved, way) in [(there.wrapping_sub(start), way), (back.wrapping_sub(there), way.wrapping_neg())] {
                if has(sensor) {
                    found = differs(found, moved, way, share.saturating_add(error.unsigned_abs()), faults);
                }
            }
        }
        if has(TORQUE) {
            // Forward the mesh carries the load less the drag, backward the load and the drag.
            let [_, there_n_m, back_n_m] = self.torque_n_m;
            let turned = if self.output_way > 0 { back_n_m - there_n_m } else { there_n_m - back_n_m };
            let part = turned / (2.0 * self.drag_n_m);
            let size = part.abs();
            let (still, wrong_way) = (size.is_nan() || size < DRAG_STILL, part < 0.0);
            let unit = !still && !wrong_way && (size * DRAG_TIMES < 1.0 || size > DRAG_TIMES);
            found = found
                .with(Implausible::TORQUE_STILL, still)
                .with(Implausible::TORQUE_SIGN, !still && wrong_way)
                .with(Implausible::TORQUE_RATIO, unit);
        }
        found
    }
}

/// How a way differs from the one that it must be.
fn differs(
    found: Implausible,
    moved: i64,
    expected: i64,
    allowed: u64,
    [still, sign, ratio]: [Implausible; 3],
) -> Implausible {
    if moved.abs_diff(expected) <= allowed {
        found
    } else if moved.unsigned_abs() <= allowed.min(expected.unsigned_abs() >> STILL_SHIFT) {
        found.with(still, true)
    } else {
        // Both may be: another way in another unit.
        let wrong_way = (moved < 0) != (expected < 0);
        let off = moved.unsigned_abs().abs_diff(expected.unsigned_abs()) > allowed;
        found.with(sign, wrong_way).with(ratio, off)
    }
}

bits_of!(StartUp { test });

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::{Limits, Overrun};
    use crate::upset::Upset;
    use crate::{Degrees, Drive, FixedMember};

    const SETTINGS: StartUpSettings =
        StartUpSettings { way_rad: Degrees(1080.0).rad(), ticks: 400, output_error_rad: 1e-3, drag_n_m: 1.5 };
    const LIMITS: Limits = crate::fixture::LIMITS;

    fn joint(fixed: FixedMember) -> Joint {
        Joint::new(Drive::new(188, 190, fixed).unwrap(), LIMITS, Overrun::SkipAndCount).unwrap()
    }

    /// A servo that lags, a drive with play and wind-up, a mesh with drag; each sensor as it is given to be.
    fn tested(
        fixed: FixedMember,
        way_rad: f32,
        generator: impl Fn(GeneratorAngle) -> Option<GeneratorAngle>,
        output: impl Fn(OutputAngle) -> Option<OutputAngle>,
        torque: impl Fn(f32) -> Option<f32>,
    ) -> Implausible {
        let joint = joint(fixed);
        let from = GeneratorAngle::of(Degrees(777.0)).unwrap();
        let mut test = StartUp::new(&joint, from, &StartUpSettings { way_rad, ..SETTINGS }).unwrap();
        let (mut at, mut command, mut rests) = (from, from, joint.drive().nominal_output(from).counts());
        for tick in 0..800u32 {
            let lag = command.minus_counts(at);
            at = at.offset_counts(lag / 8);
            let (nominal, half) = (joint.drive().nominal_output(at).counts(), 100_000);
            let before = rests;
            rests = rests.clamp(nominal - half, nominal + half);
            // The load is 4 N·m; standing the mesh keeps what it had.
            let way = (rests - before).signum() as f32;
            let noise = 0.05 * ((tick * 37 % 21) as f32 - 10.0) / 10.0;
            let mesh = 4.0 - 1.2 * way + noise;
            let readings = Readings {
                generator: generator(at),
                output: output(OutputAngle::from_counts(rests)),
                torque_n_m: torque(mesh),
            };
            let step = test.step(&readings);
            command = step.command;
            assert_eq!(step.found.is_some(), tick == 799, "{tick}");
            assert!(command.minus_counts(from).unsigned_abs() <= test.test.kept().way.unsigned_abs());
            if let Some(found) = step.found {
                assert_eq!(command, from);
                return found;
            }
        }
        unreachable!()
    }

    #[test]
    fn sensors_that_are_right_are_plausible() {
        for fixed in [FixedMember::Flexspline, FixedMember::CircularSpline] {
            for way in [SETTINGS.way_rad, -SETTINGS.way_rad] {
                assert!(tested(fixed, way, Some, Some, Some).is_plausible());
                assert!(tested(fixed, way, Some, |_| None, |_| None).is_plausible());
            }
        }
    }

    #[test]
    fn wrong_units_and_signs_and_dead_sensors_are_found_at_start_up() {
        let scaled = |counts: i64, by: f64| (counts as f64 * by) as i64;
        let generator = |by: f64| move |at: GeneratorAngle| Some(GeneratorAngle::from_counts(scaled(at.counts(), by)));
        let output = |by: f64| move |at: OutputAngle| Some(OutputAngle::from_counts(scaled(at.counts(), by)));
        let torque = |by: f32| move |torque: f32| Some(by * torque);
        for fixed in [FixedMember::Flexspline, FixedMember::CircularSpline] {
            for way in [SETTINGS.way_rad, -SETTINGS.way_rad] {
                let of_generator = |by: f64| tested(fixed, way, generator(by), |_| None, |_| None);
                assert_eq!(of_generator(-1.0), Implausible::GENERATOR_SIGN);
                // Degrees for radians and the other way, lines for counts, the output's encoder for the generator's.
                // Counts in a turn that are nearly right.
                for by in [57.3, 1.0 / 57.3, 4.0, 0.25, 0.5, 95.0, 4000.0 / 4096.0, 4096.0 / 4000.0, 0.96, 1.04] {
                    assert_eq!(of_generator(by), Implausible::GENERATOR_RATIO, "{by}");
                }
                assert_eq!(of_generator(0.0), Implausible::GENERATOR_STILL);
                assert_eq!(tested(fixed, way, |_| None, Some, Some), Implausible::GENERATOR_LOST);
                let of_output = |by: f64| tested(fixed, way, Some, output(by), |_| None);
                assert_eq!(of_output(-1.0), Implausible::OUTPUT_SIGN);
                for by in [57.3, 4.0, 0.25, 0.5] {
                    assert_eq!(of_output(by), Implausible::OUTPUT_RATIO, "{by}");
                }
                assert_eq!(of_output(0.0), Implausible::OUTPUT_STILL);
                let of_torque = |by: f32| tested(fixed, way, Some, |_| None, torque(by));
                assert_eq!(of_torque(-1.0), Implausible::TORQUE_SIGN);
                // N·mm, lbf·in, kgf·cm and lbf·ft for N·m.
                for by in [1000.0, 8.85, 10.2] {
                    assert_eq!(of_torque(by), Implausible::TORQUE_RATIO, "{by}");
                }
                assert_eq!(of_torque(0.0), Implausible::TORQUE_STILL);
                assert!(tested(fixed, way, Some, Some, |_| Some(f32::NAN)).contains(Implausible::LOST));
            }
        }
    }

    /// Every bit before every fifth tick: the same commands and findings as without; two words: the test ends, and
    /// commands nothing.
    #[test]
    fn an_upset_of_the_test_is_mended_or_ends_it() {
        let settings = StartUpSettings { ticks: 10, ..SETTINGS };
        let mut test = StartUp::new(&joint(FixedMember::Flexspline), GeneratorAngle::ZERO, &settings).unwrap();
        let mut at = GeneratorAngle::ZERO;
        for tick in 0..20 {
            let readings = Readings { generator: Some(at), output: None, torque_n_m: Some(tick as f32) };
            let sound = test;
            let step = test.step(&readings);
            for bit in (0..sound.bits()).filter(|_| tick % 5 == 3) {
                let mut hit = sound;
                hit.flip(bit, &mut std::string::String::new());
                assert_eq!((hit.step(&readings), hit), (step, test), "{bit}");
                hit = sound;
                hit.flip(bit, &mut std::string::String::new());
                hit.flip((bit + 300) % sound.bits(), &mut std::string::String::new());
                assert_eq!(hit.step(&readings), StartUpStep { command: at, found: Some(Implausible::LOST) }, "{bit}");
            }
            at = step.command;
        }
    }

    #[test]
    fn a_way_that_tells_nothing_is_refused() {
        let named = |settings: StartUpSettings| {
            StartUp::new(&joint(FixedMember::Flexspline), GeneratorAngle::ZERO, &settings).unwrap_err().name
        };
        for way_rad in [0.0, f32::NAN, 0.9, 400.0] {
            assert_eq!(named(StartUpSettings { way_rad, ..SETTINGS }), "way_rad");
        }
        assert_eq!(named(StartUpSettings { ticks: 7, ..SETTINGS }), "ticks");
        assert_eq!(named(StartUpSettings { drag_n_m: 0.0, ..SETTINGS }), "drag_n_m");
        assert_eq!(named(StartUpSettings { output_error_rad: 1e-40, ..SETTINGS }), "output_error_rad");
    }
}
