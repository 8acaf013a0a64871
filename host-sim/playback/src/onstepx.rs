//! OnStepX periodic error correction (src/telescope/mount/pec): one `int8` of motor steps for each sidereal second of a
//! turn, played as a rate one entry late, the turn found again where the motor's steps wrap.
//!
//! The loop that looks for all this runs every 10 ms; its wait is left out.

use std::f64::consts::TAU;
use std::fmt::Write;

use flexspline::Direction;

use super::hats::Hats;
use super::section::sign;
use super::track::{Track, wanted_in_time};
use super::{FIT_POINTS, Origin, Player, Refusal, Section, Written};

/// Sidereal seconds in a degree.
const SECONDS_A_DEGREE: f64 = 240.0;
/// Sizes of a buffer that are taken, s (Validate.h, `Pec::init`).
const BUFFER_S: std::ops::RangeInclusive<u32> = 61..=30_000;
/// The partition that holds the buffer is cut to a multiple of this (Telescope.cpp).
const PARTITION_STEP: u32 = 16;
/// A timing that is a whole number of seconds to this is one, s.
const WHOLE_S: f64 = 1e-9;

/// A buffer and its playback.
#[derive(Debug, Clone)]
pub struct OnStepX {
    worm_steps: u32,
    steps_a_second: f64,
    buffer: Vec<i8>,
    track: Track,
}

/// What a turn of the generator is to the playback.
#[derive(Debug, Clone, Copy)]
struct Timing {
    /// Motor steps in a sidereal second.
    rate: f64,
    /// `PEC_STEPS_PER_WORM_ROTATION`.
    worm_steps: u32,
    /// Entries in use.
    entries: usize,
    /// Whole seconds that are free to be chosen, and the second that the first of them is. What is left of the turn
    /// plays an entry that a whole second plays too; both are kept at 0.
    free: usize,
    first: usize,
}

impl Timing {
    fn new(ratio: f64, steps_a_degree: f64, buffer_s: u32) -> Result<Timing, Refusal> {
        if !BUFFER_S.contains(&buffer_s) {
            let [least, most] = [BUFFER_S.start(), BUFFER_S.end()];
            return Err(Refusal::Impossible(format!("--buffer-s: found {buffer_s}; allowed: {least} to {most} s")));
        }
        let rate = steps_a_degree / SECONDS_A_DEGREE;
        let worm_steps = (steps_a_degree * 360.0 / ratio.abs()).round();
        let seconds = worm_steps / rate;
        let entries = seconds.round() as u32;
        let room = buffer_s / PARTITION_STEP * PARTITION_STEP;
        let needed = entries.div_ceil(PARTITION_STEP) * PARTITION_STEP;
        if !BUFFER_S.contains(&entries) || needed > *BUFFER_S.end() {
            return Err(Refusal::Impossible(format!(
                "a generator turn takes {seconds:.1} sidereal seconds; OnStepX plays turns of {} to {} s",
                BUFFER_S.start(),
                BUFFER_S.end()
            )));
        }
        if entries > room {
            return Err(Refusal::Impossible(format!(
                "the buffer of {buffer_s} s is shorter than a generator turn: at the sidereal rate and ratio {:.4} \
                 that takes {seconds:.1} sidereal seconds; set PEC_BUFFER_SIZE_LIMIT to {needed} or more in Config.h, \
                 then --buffer-s {needed}",
                ratio.abs()
            )));
        }
        let entries = entries as usize;
        let left = seconds - entries as f64;
        let (free, first) = if left.abs() < WHOLE_S {
            (entries, 0)
        } else if left > 0.0 {
            // Beyond the last entry the index goes to 0, whose second plays the last entry, and so does the rest.
            (entries - 1, 1)
        } else {
            // The last second is cut short.
            (entries - 1, 0)
        };
        Ok(Timing { rate, worm_steps: worm_steps as u32, entries, free, first })
    }
}

impl OnStepX {
    /// Fits a buffer for tracking in this direction.
    pub fn fit(
        section: &Section<'_>,
        direction: Direction,
        steps_a_degree: f64,
        buffer_s: u32,
    ) -> Result<OnStepX, Refusal> {
        let timing = Timing::new(section.ratio(), steps_a_degree, buffer_s)?;
        let steps_a_rad = steps_a_degree * 360.0 / TAU;
        let samples = section.samples(None, FIT_POINTS, &[direction]);
        let mut hats = Hats::new(timing.free, 0.0, 1.0, true);
        for (time, value) in wanted_in_time(section, &samples, direction) {
            let seconds = time * steps_a_rad / timing.rate;
            let free = (seconds - timing.first as f64).rem_euclid(f64::from(timing.worm_steps) / timing.rate);
            // What the rest of the turn wants is what its flat end holds.
            hats.add(free.min(timing.free as f64), value * steps_a_rad);
        }
        let nodes: Vec<f64> = hats.solve().iter().map(|value| value.round()).collect();
        let most = f64::from(i8::MAX).min(timing.rate.round());
        let mut buffer = vec![0i8; timing.entries];
        for k in 0..timing.free {
            let steps = nodes[(k + 1) % timing.free] - nodes[k];
            if steps.abs() > most {
                return Err(Refusal::Impossible(format!(
                    "the table wants {steps} steps in a second; OnStepX adds at most {most} at {:.2} steps a second",
                    timing.rate
                )));
            }
            // A second plays the entry before its own.
            let entry = (timing.first + k + timing.entries - 1) % timing.entries;
            buffer[entry] = steps as i8;
        }
        let track = Track::new(direction, play(&timing, &buffer, steps_a_rad));
        Ok(OnStepX { worm_steps: timing.worm_steps, steps_a_second: timing.rate, buffer, track })
    }
}

/// Knots of a playback at most: it has one for each of the 86 164 sidereal seconds of an output turn, and one for each
/// turn of the generator, which takes 61 s or more. The entries of a turn add up to nothing, so that the mean rate is
/// the sidereal one.
const MOST_KNOTS: usize = 200_000;

/// Plays the buffer for an output turn of tracking: where the motor is and what was added, rad, at each change.
fn play(timing: &Timing, buffer: &[i8], steps_a_rad: f64) -> Vec<[f64; 2]> {
    let most = timing.rate.round() as i32;
    let rate_of = |index: usize| {
        let entry = buffer[(index + timing.entries - 1) % timing.entries];
        f64::from(i32::from(entry).clamp(-most, most))
    };
    let end = TAU * steps_a_rad;
    let (mut motor, mut time, mut began, mut wraps) = (0.0, 0.0, 0.0, 1u32);
    let mut index = 0;
    let mut rate = rate_of(index);
    let mut knots = vec![[0.0, 0.0]];
    for _ in 0..MOST_KNOTS {
        if motor >= end {
            break;
        }
        let speed = timing.rate + rate;
        let wrap = time + (f64::from(wraps) * f64::from(timing.worm_steps) - motor) / speed;
        let second = began + 1.0;
        let next = wrap.min(second);
        motor += speed * (next - time);
        time = next;
        began = time;
        let before = index;
        if wrap <= second {
            wraps += 1;
            index = 0;
        } else {
            index = (index + 1) % timing.entries;
        }
        if index != before {
            rate = rate_of(index);
        }
        knots.push([motor / steps_a_rad, (motor - timing.rate * time) / steps_a_rad]);
    }
    knots
}

impl Player for OnStepX {
    fn correction_rad(&self, led_rad: f64, _: Direction) -> f64 {
        self.track.at(led_rad)
    }

    fn directions(&self) -> &[Direction] {
        self.track.directions()
    }

    fn points(&self) -> String {
        format!(
            "{} seconds to a generator turn, in steps of {:.3} arcsec",
            self.buffer.len(),
            15.0 / self.steps_a_second
        )
    }

    fn files(&self, _: &Origin) -> Vec<Written> {
        // Commands only: what is outside `:` and `#` is not for a mount.
        let mut text = String::from(":$QZZ#\n");
        for (k, steps) in self.buffer.iter().enumerate() {
            let _ = writeln!(text, ":WR{k},{steps}#");
        }
        text += ":$QZ!#\n";
        vec![Written::text("onstepx_pec.txt", text)]
    }

    fn notes(&self) -> Vec<String> {
        let sense = if sign(self.track.directions()[0]) > 0.0 { "forward" } else { "backward" };
        vec![
            format!(
                "Config.h: PEC_STEPS_PER_WORM_ROTATION {}, PEC_BUFFER_SIZE_LIMIT {} or more",
                self.worm_steps,
                self.buffer.len().div_ceil(PARTITION_STEP as usize) * PARTITION_STEP as usize
            ),
            format!(
                "for tracking that turns the output {sense}, the worm index at the generator's zero; a rate that is \
                 {:.3} arcsec an output turn off is left to guiding",
                self.track.drift_arcsec()
            ),
        ]
    }
}
