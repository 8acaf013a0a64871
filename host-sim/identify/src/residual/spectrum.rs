//! Spectrum of orders: least squares of a sine and a floating mean at each order (generalised Lomb-Scargle; Zechmeister
//! and Kürster, Astron. Astrophys. 496, 577, 2009), for rows that are not evenly spaced in the angle.
//!
//! The sums over rows that it needs are Fourier sums of ones and of the values. Rows are shared out
//! linearly between the cells of a fine grid, the sums are taken by FFT, and the sharing is undone by its transform,
//! sinc². Lines are then found one by one, the strongest first, taken out, and at last fitted all together to the rows
//! themselves.

use std::f64::consts::{PI, TAU};

use flexspline_algebra::{Complex, spectrum};
use serde::Serialize;

use super::orders::{Line, NamedOrder, confusion, harmonics, named_orders};
use super::rows::Axis;
use crate::diagnosis::rows::sampled_twice;
use crate::measurement::{least_and_most, median_of, sampled};

/// Cells in the shortest wave.
const CELLS_PER_WAVE: f64 = 10.0;
/// Orders in a resolution width.
const OVERSAMPLING: f64 = 5.0;
/// Largest transform.
const LARGEST: usize = 1 << 22;
/// The spectrum is sampled this much finer than its independent values, and its maxima are that much more (Baluev 2008
/// has 2 to 4).
const MAXIMA: f64 = 4.0;
/// The noise at an order is judged by the orders around it within this factor…
const AROUND: f64 = 1.6;
/// …and by this many resolution widths on each side at least.
const AROUND_WIDTHS: f64 = 20.0;

/// Waves in the record below which a line cannot be distinguished from wander.
const FEWEST_WAVES: f64 = 1.5;
/// Surrogates that noise with a memory is judged by.
const SURROGATES: u32 = 16;
/// Lines that are no lines lower the noise left over by up to this factor.
const TAKEN: f64 = 2.0;

/// Highest order; lower if rows are too far apart for it.
const HIGHEST_ORDER: f64 = 32.0;
/// Chance that noise alone gives a line.
const FALSE_ALARM: f64 = 1e-3;
/// Lines that are reported at most.
const MOST_PEAKS: usize = 12;
/// Points of the curve that are reported at most: of each stretch the highest.
const MOST_POINTS: usize = 700;

/// A line of the spectrum.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Peak {
    /// Waves in a turn of the axis.
    pub order: f64,
    /// Its standard deviation.
    pub order_std: f64,
    /// Amplitude, arcsec.
    pub amplitude_arcsec: f64,
    /// Phase of `amplitude * sin(order * angle + phase)`, rad.
    pub phase_rad: f64,
    /// Standard deviation of the amplitude, from the noise around this order, arcsec.
    pub amplitude_std_arcsec: f64,
    /// Standard deviation of the phase, rad.
    pub phase_std_rad: f64,
    /// Orders of the drive within the resolution; more than one: they cannot be distinguished.
    pub named: Vec<NamedOrder>,
}

/// Orders of a residual along one angle.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct OrderSpectrum {
    /// The angle.
    pub axis: Axis,
    /// Turns of that angle from the least to the largest.
    pub turns: f64,
    /// Orders closer than this, 1/turns, are not distinguished.
    pub resolution: f64,
    /// Orders of the curve.
    pub orders: Vec<f64>,
    /// Amplitude of a sine that explains as much, arcsec.
    pub amplitude_arcsec: Vec<f64>,
    /// Amplitude that noise exceeds nowhere, but for the chance of a false alarm, at those orders, arcsec.
    pub level_arcsec: Vec<f64>,
    /// Lines above that level, the strongest first.
    pub peaks: Vec<Peak>,
}

/// The spectrum of `value` (arcsec) along `angle` (rad), an `axis` of a drive with this ratio. Orders below one wave in
/// the record are left out; a record that turns too little for any order gives an empty spectrum.
pub fn order_spectrum(axis: Axis, angle: &[f64], value: &[f64], ratio: f64) -> OrderSpectrum {
    let (low, high) = least_and_most(angle.iter().copied());
    let turns = if high > low { (high - low) / TAU } else { 0.0 };
    // Waves must be sampled twice, as rows follow each other or, to and fro, as they lie.
    let mut steps =
        sampled(&angle.windows(2).map(|x| (x[1] - x[0]).abs()).filter(|step| *step > 0.0).collect::<Vec<_>>());
    let mut highest = HIGHEST_ORDER.min(sampled_twice(&mut steps, 0.75));
    let resolution = 1.0 / turns.max(1e-300);
    let transform = |highest: f64| OVERSAMPLING * turns * highest * CELLS_PER_WAVE;
    if transform(highest) > LARGEST as f64 {
        highest *= LARGEST as f64 / transform(highest);
    }
    if angle.len() < 16 || !turns.is_finite() || highest < 2.0 * resolution {
        let resolution = if turns > 0.0 { resolution } else { 0.0 };
        return OrderSpectrum { axis, turns, resolution, ..OrderSpectrum::default() };
    }
    let grid = Grid::new(angle, low, turns, highest, resolution);
    let mut left = value.to_vec();
    let mut scan = grid.scan(&left);
    let (orders, first) = (grid.orders(), scan.clone());
    let waves = (highest - resolution) * turns;
    let times = (MAXIMA * waves.max(1.0) / FALSE_ALARM).ln();
    let mut found: Vec<f64> = Vec::new();
    let mut noise = background(&orders, &scan, resolution);
    while found.len() < MOST_PEAKS {
        let free = |k: &usize| found.iter().all(|order| (orders[*k] - order).abs() > resolution);
        let Some(best) =
            (0..orders.len()).filter(free).max_by(|a, b| (scan[*a] / noise[*a]).total_cmp(&(scan[*b] / noise[*b])))
        else {
            break;
        };
        if scan[best] <= noise[best] * times {
            break;
        }
        found.push(summit(&orders, &scan, best));
        // Lines closer than three widths pull at each other: each is placed anew with the others taken out.
        if crowded(&found, found.len() - 1, resolution) {
            for k in (0..found.len()).chain(0..found.len()) {
                if crowded(&found, k, resolution) {
                    let others: Vec<f64> =
                        found.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, order)| *order).collect();
                    found[k] = placed(angle, value, &others, found[k], resolution);
                }
            }
        }
        let Some((constant, lines)) = harmonics(angle, value, &found) else {
            found.pop();
            break;
        };
        for ((left, value), x) in left.iter_mut().zip(value).zip(angle) {
            *left = value - constant - lines.iter().map(|line| line.at(*x)).sum::<f64>();
        }
        scan = grid.scan(&left);
        noise = background(&orders, &scan, resolution);
    }
    // Noise with a memory has its own spectrum, steepest where local medians say least: lines must stand above that,
    // too.
    if !found.is_empty() {
        let red = grid.remembering(&left);
        noise.iter_mut().zip(&red).for_each(|(noise, red)| *noise = noise.max(*red));
        if let Some((_, lines)) = harmonics(angle, value, &found) {
            let stands = |line: &Line| {
                let at = orders.partition_point(|order| *order < line.order).min(orders.len() - 1);
                line.amplitude.powi(2) > noise[at] * times && line.order >= FEWEST_WAVES * resolution
            };
            found = lines.iter().filter(|line| stands(line)).map(|line| line.order).collect();
        }
    }
    let peaks = peaks(axis, angle, value, ratio, &found, &orders, &noise, resolution);
    let (orders, amplitude_arcsec, level_arcsec) = thinned(&orders, &first, &noise, times);
    OrderSpectrum { axis, turns, resolution, orders, amplitude_arcsec, level_arcsec, peaks }
}

#[allow(clippy::too_many_arguments, reason = "what the last step needs of all those before")]
fn peaks(
    axis: Axis,
    angle: &[f64],
    value: &[f64],
    ratio: f64,
    found: &[f64],
    orders: &[f64],
    noise: &[f64],
    resolution: f64,
) -> Vec<Peak> {
    let Some((_, lines)) = harmonics(angle, value, found) else { return Vec::new() };
    let confused = confusion(angle, found).unwrap_or_else(|| vec![1.0; found.len()]);
    let turns_of_axis = axis.turns_per_generator_turn(ratio).abs();
    let mut peaks: Vec<Peak> = lines
        .iter()
        .enumerate()
        .map(|(place, line)| {
            let at = orders.partition_point(|order| *order < line.order).min(orders.len() - 1);
            // Of a squared amplitude that noise gives, half belongs to each of sine and cosine. Lines that pull at each
            // other are less certain, by as much as the joint fit says.
            let std = (0.5 * noise[at]).sqrt() * confused[place].max(1.0);
            let per_generator_turn = line.order * turns_of_axis;
            let near =
                |named: &NamedOrder| (named.per_generator_turn - per_generator_turn).abs() < resolution * turns_of_axis;
            Peak {
                order: line.order,
                order_std: 3.0_f64.sqrt() * resolution / PI * std / line.amplitude,
                amplitude_arcsec: line.amplitude,
                phase_rad: line.phase_rad,
                amplitude_std_arcsec: std,
                phase_std_rad: std / line.amplitude,
                named: named_orders(ratio).into_iter().filter(near).collect(),
            }
        })
        .collect();
    peaks.sort_by(|a, b| b.amplitude_arcsec.total_cmp(&a.amplitude_arcsec));
    peaks
}

/// Rows shared out on a grid, and what of the spectrum depends on the angles alone.
struct Grid<'a> {
    angle: &'a [f64],
    low: f64,
    /// Cells in a turn.
    per_turn: f64,
    /// Length of the transforms.
    length: usize,
    /// Places of the transform that are looked at.
    places: std::ops::RangeInclusive<usize>,
    /// Transform of ones.
    window: Vec<Complex<f64>>,
}

impl<'a> Grid<'a> {
    fn new(angle: &'a [f64], low: f64, turns: f64, highest: f64, resolution: f64) -> Grid<'a> {
        let per_turn = highest * CELLS_PER_WAVE;
        let length =
            ((OVERSAMPLING * turns * per_turn).max(turns * per_turn + 2.0) as usize).next_power_of_two().max(64);
        let place = |order: f64| order * length as f64 / per_turn;
        let places = place(resolution).ceil() as usize..=(place(highest) as usize).min(length / 2 - 1);
        let mut grid = Grid { angle, low, per_turn, length, places, window: Vec::new() };
        grid.window = grid.transform(|_| 1.0);
        grid
    }

    fn orders(&self) -> Vec<f64> {
        self.places.clone().map(|place| place as f64 * self.per_turn / self.length as f64).collect()
    }

    /// Mean of `value * exp(-i order (angle - low))` at each place of the transform.
    fn transform(&self, value: impl Fn(usize) -> f64) -> Vec<Complex<f64>> {
        let mut cells = vec![0.0; self.length];
        for row in 0..self.angle.len() {
            let at = (self.angle[row] - self.low) / TAU * self.per_turn;
            let cell = at as usize;
            let part = at - cell as f64;
            let w = value(row) / self.angle.len() as f64;
            cells[cell] += w * (1.0 - part);
            cells[cell + 1] += w * part;
        }
        let mut sums = spectrum(&mut cells);
        for (place, sum) in sums.iter_mut().enumerate() {
            let x = PI * place as f64 / self.length as f64;
            let sinc = if place == 0 { 1.0 } else { x.sin() / x };
            *sum /= sinc * sinc;
        }
        sums
    }

    /// Squared amplitude of a sine that explains as much of the variance as the best one of each order.
    fn scan(&self, value: &[f64]) -> Vec<f64> {
        let mean = value.iter().sum::<f64>() / self.angle.len() as f64;
        let sums = self.transform(|row| value[row] - mean);
        self.places
            .clone()
            .map(|place| {
                let (w, y) = (self.window[place], sums[place]);
                // Twice the order; beyond the transform nothing is known, and little is there.
                let w2 = self.window.get(2 * place).copied().unwrap_or_default();
                let (c, s) = (w.re, -w.im);
                let (yc, ys) = (y.re, -y.im);
                let cc = 0.5 * (1.0 + w2.re) - c * c;
                let ss = 0.5 * (1.0 - w2.re) - s * s;
                let cs = -0.5 * w2.im - c * s;
                let d = cc * ss - cs * cs;
                if d < 1e-6 {
                    return 0.0;
                }
                2.0 * (ss * yc * yc + cc * ys * ys - 2.0 * cs * yc * ys) / d
            })
            .collect()
    }
}

impl Grid<'_> {
    /// Mean squared amplitude, at each order, of noise as white and with as long a memory (in rows, first-order
    /// autoregressive) as what is `left`, from surrogates in the places of the rows (Schulz and Mudelsee, Comput.
    /// Geosci. 28, 421, 2002, for REDFIT).
    fn remembering(&self, left: &[f64]) -> Vec<f64> {
        let n = left.len();
        let mean = left.iter().sum::<f64>() / n as f64;
        let covariance = |lag: usize| {
            left.iter().zip(&left[lag.min(n)..]).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>()
                / (n - lag.min(n - 1)) as f64
        };
        let whole = covariance(0);
        // The longest pair of lags at which something is remembered gives memory and size of what remembers.
        let (mut memory, mut size, mut lag) = (0.0_f64, 0.0, 1);
        while 4 * lag < n {
            let (near, far) = (covariance(lag), covariance(2 * lag));
            if far < 0.1 * whole || far >= near {
                break;
            }
            memory = (far / near).powf(1.0 / lag as f64);
            size = (near * near / far).min(whole);
            lag *= 2;
        }
        if size <= 0.0 {
            return vec![0.0; self.places.clone().count()];
        }
        // The mean takes with it what is remembered over the whole record.
        let length = (1.0 + memory) / (1.0 - memory).max(1.0 / n as f64);
        size *= 1.0 + 2.0 * (length / n as f64).min(1.0);
        let white = (whole - size).max(0.0).sqrt();
        let mut random = fastrand::Rng::with_seed(7);
        let mut normal = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
        let mut level = vec![0.0; self.places.clone().count()];
        for _ in 0..SURROGATES {
            let mut slow = size.sqrt() * normal();
            let surrogate: Vec<f64> = (0..n)
                .map(|_| {
                    slow = memory * slow + (size * (1.0 - memory * memory)).sqrt() * normal();
                    slow + white * normal()
                })
                .collect();
            let scan = self.scan(&surrogate);
            level.iter_mut().zip(scan).for_each(|(level, scan)| *level += scan / f64::from(SURROGATES));
        }
        // What the lines found took with them belongs to the noise as well.
        level.iter().map(|level| TAKEN * level).collect()
    }
}

/// Mean squared amplitude of the noise at each order, from the median around it: squares of noise are exponentially
/// distributed, with a median of ln 2 of the mean, and lines, being few, do not move it.
fn background(orders: &[f64], scan: &[f64], resolution: f64) -> Vec<f64> {
    let n = orders.len();
    // At a few places, interpolated between.
    let knots = 96.min(n);
    let at: Vec<usize> = (0..knots).map(|k| k * (n - 1) / (knots - 1).max(1)).collect();
    let level: Vec<f64> = at
        .iter()
        .map(|place| {
            let order = orders[*place];
            let from = (order / AROUND).min(order - AROUND_WIDTHS * resolution);
            let to = (order * AROUND).max(order + AROUND_WIDTHS * resolution);
            let range = orders.partition_point(|o| *o < from)..orders.partition_point(|o| *o <= to);
            let mut around = scan[range].to_vec();
            let local = median_of(&mut around);
            // A slope of the noise within the window is met by its steeper side.
            let half = (0.5 * AROUND_WIDTHS) * resolution;
            let near = orders.partition_point(|o| *o < order - half)..orders.partition_point(|o| *o <= order + half);
            let near = median_of(&mut scan[near].to_vec());
            local.max(near) / std::f64::consts::LN_2
        })
        .collect();
    let floor = level.iter().copied().fold(0.0, f64::max) * 1e-12 + 1e-300;
    let mut knot = 0;
    (0..n)
        .map(|place| {
            while knot + 2 < knots && place > at[knot + 1] {
                knot += 1;
            }
            if knots < 2 {
                return level[0].max(floor);
            }
            let width = (at[knot + 1] - at[knot]).max(1) as f64;
            let part = (place - at[knot]) as f64 / width;
            (level[knot] + part * (level[knot + 1] - level[knot])).max(floor)
        })
        .collect()
}

/// The order of a maximum, by a parabola through it and its neighbours.
fn summit(orders: &[f64], scan: &[f64], best: usize) -> f64 {
    if best == 0 || best + 1 >= orders.len() {
        return orders[best];
    }
    let (a, b, c) = (scan[best - 1], scan[best], scan[best + 1]);
    let bend = a - 2.0 * b + c;
    let off = if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    orders[best] + off * (orders[best + 1] - orders[best])
}

/// Whether another order is within three widths.
fn crowded(orders: &[f64], k: usize, resolution: f64) -> bool {
    orders.iter().enumerate().any(|(j, order)| j != k && (order - orders[k]).abs() < 3.0 * resolution)
}

/// The order near `order` that, fitted together with others, explains most.
fn placed(angle: &[f64], value: &[f64], others: &[f64], order: f64, resolution: f64) -> f64 {
    let step = angle.len().div_ceil(2500).max(1);
    let x: Vec<f64> = angle.iter().copied().step_by(step).collect();
    let y: Vec<f64> = value.iter().copied().step_by(step).collect();
    let explained = |order: f64| {
        let mut orders = others.to_vec();
        orders.push(order);
        harmonics(&x, &y, &orders).map_or(f64::NEG_INFINITY, |(constant, lines)| {
            let left = |k: usize| y[k] - constant - lines.iter().map(|line| line.at(x[k])).sum::<f64>();
            -(0..x.len()).map(|k| left(k).powi(2)).sum::<f64>()
        })
    };
    // Golden section within half a width; the summit is that wide.
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = (order - 0.5 * resolution, order + 0.5 * resolution);
    let (mut c, mut d) = (b - golden * (b - a), a + golden * (b - a));
    let (mut fc, mut fd) = (explained(c), explained(d));
    for _ in 0..9 {
        if fc > fd {
            (b, d, fd) = (d, c, fc);
            c = b - golden * (b - a);
            fc = explained(c);
        } else {
            (a, c, fc) = (c, d, fd);
            d = a + golden * (b - a);
            fd = explained(d);
        }
    }
    0.5 * (a + b)
}

/// The curve with at most this many points; of those left out the highest stand.
fn thinned(orders: &[f64], scan: &[f64], noise: &[f64], times: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let step = orders.len().div_ceil(MOST_POINTS).max(1);
    let highest = (0..orders.len())
        .step_by(step)
        .filter_map(|from| (from..(from + step).min(orders.len())).max_by(|a, b| scan[*a].total_cmp(&scan[*b])));
    let highest: Vec<usize> = highest.collect();
    let of = |values: &dyn Fn(usize) -> f64| highest.iter().map(|k| values(*k)).collect();
    (of(&|k| orders[k]), of(&|k| scan[k].max(0.0).sqrt()), of(&|k| (noise[k] * times).sqrt()))
}
