//! Pulses that stay in one position of a wheel: a damaged tooth, or a piece of debris in a space.

use std::f64::consts::{PI, TAU};

use serde::Serialize;

use super::rows::Axis;
use crate::diagnosis::rows::Rows;
use crate::least_squares::Normal;
use crate::measurement::{least_and_most, median_and_std};

/// Bins of a turn: 2 degrees.
const BINS: usize = 180;
/// Waves in a turn that are no pulse.
const WAVES: usize = 4;
/// Widths of a pulse that are tried (standard deviation of a bell), rad: the arc of engaged teeth is 10 to 30 degrees.
const WIDTHS_RAD: [f64; 3] = [0.06, 0.12, 0.2];
/// Standard deviations that a pulse stands out by: of 180 places, 3 widths and 2 periods one does so by chance once in
/// 10^6.
const STANDS_OUT: f64 = 6.5;
/// Turns of the axis below which another wheel's lines do not average out.
const FEWEST_TURNS: f64 = 6.0;

/// A pulse at one position.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Pulse {
    /// The angle it stays at: ψ for the flexspline, ψ−δ for the circular spline.
    pub axis: Axis,
    /// Pulses in a turn: two where both lobes pass the place alike.
    pub per_turn: u32,
    /// Its first place in a turn, rad.
    pub position_rad: f64,
    /// Standard deviation of its bell, rad.
    pub width_rad: f64,
    /// Its height, arcsec, and the standard deviation of that.
    pub height_arcsec: f64,
    /// Standard deviation of the height, arcsec.
    pub height_std_arcsec: f64,
}

impl Pulse {
    /// Its height in standard deviations.
    fn stands_out(&self) -> f64 {
        (self.height_arcsec / self.height_std_arcsec).abs()
    }
}

/// The pulse of a residual less its median in each direction, `centred`. Both wheels turn almost alike: a pulse of one
/// is a shadow on the other, and the sharper one is meant.
pub(super) fn find(rows: &Rows, centred: &[f64]) -> Vec<Pulse> {
    let found = [Axis::Generator, Axis::GeneratorLessOutput].into_iter().filter_map(|axis| on(rows, centred, axis));
    found.max_by(|a, b| a.stands_out().total_cmp(&b.stands_out())).into_iter().collect()
}

fn on(rows: &Rows, centred: &[f64], axis: Axis) -> Option<Pulse> {
    let angle = axis.angles(rows);
    let (low, high) = least_and_most(angle.iter().copied());
    if high - low < FEWEST_TURNS * TAU {
        return None;
    }
    // First and second half of the rows by themselves: a pulse is in both.
    let half = angle.len() / 2;
    let [whole, first, second] =
        [0..angle.len(), 0..half, half..angle.len()].map(|part| medians(&angle[part.clone()], &centred[part]));
    let mut best: Option<Pulse> = None;
    for per_turn in [1, 2] {
        for width_rad in WIDTHS_RAD {
            for place in 0..BINS / per_turn as usize {
                let at = Pulse { axis, per_turn, position_rad: middle(place), width_rad, ..Pulse::default() };
                let Some(pulse) = fit(&whole, at) else { continue };
                if pulse.stands_out() > best.map_or(STANDS_OUT, |best| best.stands_out()) {
                    best = Some(pulse);
                }
            }
        }
    }
    let in_both = |best: &Pulse| {
        let height = |bins: &[(f64, f64)]| fit(bins, *best).map(|part| part.height_arcsec);
        [height(&first), height(&second)].into_iter().flatten().all(|part| part / best.height_arcsec > 0.4)
    };
    best.filter(in_both)
}

/// Middle of a bin of a turn, rad.
fn middle(bin: usize) -> f64 {
    (bin as f64 + 0.5) / BINS as f64 * TAU
}

/// Median and number of rows in each bin of a turn.
fn medians(angle: &[f64], value: &[f64]) -> Vec<(f64, f64)> {
    let mut bins = vec![Vec::new(); BINS];
    for (angle, value) in angle.iter().zip(value) {
        bins[((angle.rem_euclid(TAU) / TAU * BINS as f64) as usize).min(BINS - 1)].push(*value);
    }
    bins.iter_mut().map(|values| (median_and_std(values).0, values.len() as f64)).collect()
}

/// The pulse with its height and the standard deviation of that, waves of low order fitted with it.
fn fit(bins: &[(f64, f64)], pulse: Pulse) -> Option<Pulse> {
    const COLUMNS: usize = 2 + 2 * WAVES;
    let period = TAU / f64::from(pulse.per_turn);
    let most = bins.iter().map(|bin| bin.1).fold(0.0, f64::max);
    let used = bins.iter().filter(|bin| bin.1 >= 1.0).count() as f64;
    if used < 0.9 * BINS as f64 {
        return None;
    }
    let fit = Normal::of(COLUMNS, bins.len(), |place, row| {
        let ((median, count), angle) = (bins[place], middle(place));
        let off = angle - pulse.position_rad;
        let off = off - period * (off / period).round();
        for wave in 0..WAVES {
            (row[1 + 2 * wave], row[2 + 2 * wave]) = ((wave + 1) as f64 * angle).sin_cos();
        }
        row[COLUMNS - 1] = (-0.5 * (off / pulse.width_rad).powi(2)).exp();
        // Beyond some rows in a bin, it is no longer their noise that matters.
        (median, if count < 1.0 { 0.0 } else { (count / most).sqrt() })
    })?;
    // Neighbouring bins share what is left over; a bell covers several of them.
    let shared = (2.0 * pulse.width_rad / (TAU / BINS as f64)).max(1.0) * PI.sqrt() / 2.0;
    let variance = fit.misfit() / (used - COLUMNS as f64) * shared.min(3.0);
    let std = (variance * fit.inverse[(COLUMNS - 1, COLUMNS - 1)]).sqrt().max(1e-12);
    Some(Pulse { height_arcsec: fit.values()[COLUMNS - 1], height_std_arcsec: std, ..pulse })
}
