//! A mount that tracks: its playback changes the rate second by second, and what it has added so far is a curve over
//! its motor.

use std::f64::consts::TAU;

use flexspline::Direction;

use super::section::sign;
use super::{Sample, Section, mean};

/// What a playback has added over one output turn: straight between its changes of rate.
#[derive(Debug, Clone)]
pub(super) struct Track {
    direction: [Direction; 1],
    /// Where the motor has led the output to, and what of that was added; rad along the tracking.
    knots: Vec<[f64; 2]>,
    /// What was added in the whole turn, taken out of the knots, rad.
    drift_rad: f64,
}

impl Track {
    /// From the knots of one output turn, the first at 0. What has piled up over the turn is taken out evenly: it is a
    /// wrong rate, which any guiding holds.
    pub(super) fn new(direction: Direction, mut knots: Vec<[f64; 2]>) -> Track {
        let [first, last] = [knots[0], knots[knots.len() - 1]];
        let drift_rad = last[1] - first[1];
        let slope = drift_rad / (last[0] - first[0]);
        knots.iter_mut().for_each(|knot| knot[1] -= slope * (knot[0] - first[0]));
        Track { direction: [direction], knots, drift_rad }
    }

    /// What has been added where the output was led to `led_rad`.
    pub(super) fn at(&self, led_rad: f64) -> f64 {
        let sign = sign(self.direction[0]);
        let led = (sign * led_rad).rem_euclid(TAU);
        let above = self.knots.partition_point(|knot| knot[0] <= led).clamp(1, self.knots.len() - 1);
        let [low, high] = [self.knots[above - 1], self.knots[above]];
        let width = high[0] - low[0];
        let share = if width > 0.0 { (led - low[0]) / width } else { 0.0 };
        sign * (low[1] + share * (high[1] - low[1]))
    }

    pub(super) fn directions(&self) -> &[Direction] {
        &self.direction
    }

    /// What it adds too much in an output turn, arcsec.
    pub(super) fn drift_arcsec(&self) -> f64 {
        self.drift_rad * flexspline_base::units::ARCSEC_PER_RAD
    }
}

/// The wanted correction over the time since the generator's zero: pairs of time and correction, both as angles of the
/// output along the tracking (rad). The correction that is in force at the zero has been added before.
pub(super) fn wanted_in_time(section: &Section<'_>, samples: &[Sample], direction: Direction) -> Vec<(f64, f64)> {
    let zero = mean(samples.iter().map(|sample| sample.error_rad));
    let turn = TAU / section.ratio().abs();
    let turns = (section.ratio().abs() * f64::from(section.period_turns())).round() as u32;
    // Mean of the starts of all generator turns.
    let starts = (0..turns).map(|k| sign(direction) * (section.error_rad(TAU * f64::from(k), direction) - zero));
    let start = -starts.sum::<f64>() / f64::from(turns);
    let of = |sample: &Sample| {
        let correction = -sign(direction) * (sample.error_rad - zero);
        let led = (sign(direction) * sample.led_rad).rem_euclid(turn);
        (led - (correction - start), correction)
    };
    samples.iter().map(of).collect()
}
