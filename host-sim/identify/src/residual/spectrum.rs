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

use super::orders::{Line, NamedOrder, harmonics, named_orders, without};
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
/// Halvings of the step in which a line is placed among others. *Guess*: to half a hundredth of a width.
const HALVINGS: usize = 6;
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
    highest = highest.min(highest_within(turns));
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
        let over_noise = |k: &usize| scan[*k] / noise[*k];
        let strongest = (0..orders.len()).filter(free).max_by(|a, b| over_noise(a).total_cmp(&over_noise(b)));
        let Some(best) = strongest.filter(|best| over_noise(best) > times) else { break };
        found.push(summit(&orders, &scan, best));
        // Lines closer than three widths pull at each other: each is placed anew with the others taken out.
        let crowded = |found: &[f64], k: usize| {
            let near = |(j, order): (usize, &f64)| j != k && (order - found[k]).abs() < 3.0 * resolution;
            found.iter().enumerate().any(near)
        };
        if crowded(&found, found.len() - 1) {
            for k in (0..found.len()).chain(0..found.len()) {
                if crowded(&found, k) {
                    let order = found.remove(k);
                    found.insert(k, placed(angle, value, &found, order, resolution));
                }
            }
        }
        let Some(lines) = harmonics(angle, value, &found) else {
            found.pop();
            break;
        };
        left = without(angle, value, &lines);
        scan = grid.scan(&left);
        noise = background(&orders, &scan, resolution);
    }
    // Noise with a memory has its own spectrum, steepest where local medians say least: lines must stand above that,
    // too.
    if !found.is_empty() {
        let red = grid.remembering(&left);
        noise.iter_mut().zip(&red).for_each(|(noise, red)| *noise = noise.max(*red));
    }
    let noise_at = |order: f64| noise[orders.partition_point(|o| *o < order).min(orders.len() - 1)];
    let stands =
        |line: &Line| line.amplitude.powi(2) > noise_at(line.order) * times && line.order >= FEWEST_WAVES * resolution;
    let lines = |orders: &[f64]| harmonics(angle, value, orders).map_or_else(Vec::new, |(_, lines)| lines);
    let found: Vec<f64> = lines(&found).iter().filter(|line| stands(line)).map(|line| line.order).collect();
    let turns_of_axis = axis.turns_per_generator_turn(ratio).abs();
    let peak = |line: &Line| {
        // Of a squared amplitude that noise gives, half belongs to each of sine and cosine. Lines that pull at each
        // other are less certain, by as much as the joint fit says.
        let std = (0.5 * noise_at(line.order)).sqrt() * line.confusion.max(1.0);
        let off = |named: &NamedOrder| (named.per_generator_turn - line.order * turns_of_axis).abs();
        Peak {
            order: line.order,
            order_std: 3.0_f64.sqrt() * resolution / PI * std / line.amplitude,
            amplitude_arcsec: line.amplitude,
            phase_rad: line.phase_rad,
            amplitude_std_arcsec: std,
            phase_std_rad: std / line.amplitude,
            named: named_orders(ratio).into_iter().filter(|named| off(named) < resolution * turns_of_axis).collect(),
        }
    };
    let mut peaks: Vec<Peak> = lines(&found).iter().map(peak).collect();
    peaks.sort_by(|a, b| b.amplitude_arcsec.total_cmp(&a.amplitude_arcsec));
    // Of each stretch of the curve the highest point.
    let stretch = orders.len().div_ceil(MOST_POINTS).max(1);
    let points: Vec<usize> = (0..orders.len())
        .step_by(stretch)
        .filter_map(|from| (from..(from + stretch).min(orders.len())).max_by(|a, b| first[*a].total_cmp(&first[*b])))
        .collect();
    OrderSpectrum {
        axis,
        turns,
        resolution,
        orders: points.iter().map(|k| orders[*k]).collect(),
        amplitude_arcsec: points.iter().map(|k| first[*k].max(0.0).sqrt()).collect(),
        level_arcsec: points.iter().map(|k| (noise[*k] * times).sqrt()).collect(),
        peaks,
    }
}

/// Highest order along this number of turns that the largest transform holds.
fn highest_within(turns: f64) -> f64 {
    LARGEST as f64 / (OVERSAMPLING * turns * CELLS_PER_WAVE)
}

/// The strongest line of `value` along `angle` (rad), from the order `lowest` to `highest`: its order, and its power in
/// units of what white noise has on average.
pub(crate) fn strongest(angle: &[f64], value: &[f64], lowest: f64, highest: f64) -> Option<(f64, f64)> {
    let (low, high) = least_and_most(angle.iter().copied());
    let turns = (high - low) / TAU;
    let (lowest, highest) = (lowest.max(1.0 / turns), highest.min(highest_within(turns)));
    if !(turns > 0.0 && highest > lowest) {
        return None;
    }
    let grid = Grid::new(angle, low, turns, highest, lowest);
    let (orders, scan) = (grid.orders(), grid.scan(value));
    let best = (0..scan.len()).max_by(|a, b| scan[*a].total_cmp(&scan[*b]))?;
    let (rows, total) = (value.len() as f64, value.iter().map(|v| v * v).sum::<f64>());
    Some((summit(&orders, &scan, best), 0.25 * rows * rows * scan[best] / total.max(1e-30)))
}

/// Whether the strongest line of some rows is too strong for noise: white noise reaches that power once in about 10⁵
/// spectra.
pub(crate) fn is_no_noise(power: f64, rows: usize) -> bool {
    power > (4.0 * rows as f64).ln() + 12.0
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
    /// What the sharing leaves of each place of the transform: sinc².
    kept: Vec<f64>,
    /// Transform of ones.
    window: Vec<Complex<f64>>,
}

impl<'a> Grid<'a> {
    /// Of orders from `lowest` to `highest`; the angle turns from `low` by `turns`.
    fn new(angle: &'a [f64], low: f64, turns: f64, highest: f64, lowest: f64) -> Grid<'a> {
        let per_turn = highest * CELLS_PER_WAVE;
        let length =
            ((OVERSAMPLING * turns * per_turn).max(turns * per_turn + 2.0) as usize).next_power_of_two().max(64);
        let place = |order: f64| order * length as f64 / per_turn;
        let places = place(lowest).ceil() as usize..=(place(highest) as usize).min(length / 2 - 1);
        let kept = |place: usize| {
            let x = PI * place as f64 / length as f64;
            if place == 0 { 1.0 } else { (x.sin() / x).powi(2) }
        };
        let kept = (0..=length / 2).map(kept).collect();
        let mut grid = Grid { angle, low, per_turn, length, places, kept, window: Vec::new() };
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
        sums.iter_mut().zip(&self.kept).for_each(|(sum, kept)| *sum /= *kept);
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
        // Of unit variance: squares of many rows do not ask for more.
        let mut any = || 12f64.sqrt() * (random.f64() - 0.5);
        let mut level = vec![0.0; self.places.clone().count()];
        for _ in 0..SURROGATES {
            let mut slow = size.sqrt() * any();
            let surrogate: Vec<f64> = (0..n)
                .map(|_| {
                    slow = memory * slow + (size * (1.0 - memory * memory)).sqrt() * any();
                    slow + white * any()
                })
                .collect();
            let scan = self.scan(&surrogate);
            level.iter_mut().zip(scan).for_each(|(level, scan)| *level += scan / f64::from(SURROGATES));
        }
        // Noise that the lines found took with them belongs to the noise as well.
        level.iter().map(|level| TAKEN * level).collect()
    }
}

/// Mean squared amplitude of the noise at each order, from the median around it: squares of noise are exponentially
/// distributed, with a median of ln 2 of the mean, and lines, being few, do not move it.
fn background(orders: &[f64], scan: &[f64], resolution: f64) -> Vec<f64> {
    let n = orders.len();
    // At a few places, interpolated between.
    let knots = 96.min(n);
    let level: Vec<f64> = (0..knots)
        .map(|k| {
            let order = orders[k * (n - 1) / (knots - 1).max(1)];
            let median = |from: f64, to: f64| {
                let range = orders.partition_point(|o| *o < from)..orders.partition_point(|o| *o <= to);
                median_of(&mut scan[range].to_vec())
            };
            let (width, half) = (AROUND_WIDTHS * resolution, 0.5 * AROUND_WIDTHS * resolution);
            let local = median((order / AROUND).min(order - width), (order * AROUND).max(order + width));
            // A slope of the noise within the window is met by its steeper side.
            local.max(median(order - half, order + half)) / std::f64::consts::LN_2
        })
        .collect();
    let floor = level.iter().copied().fold(0.0, f64::max) * 1e-12 + 1e-300;
    (0..n)
        .map(|place| {
            let x = place as f64 * (knots - 1) as f64 / (n - 1).max(1) as f64;
            let (below, above) = (level[x as usize], level[(x as usize + 1).min(knots - 1)]);
            (below + x.fract() * (above - below)).max(floor)
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

/// The order within half a width of `order` that, fitted together with others, explains most.
fn placed(angle: &[f64], value: &[f64], others: &[f64], order: f64, resolution: f64) -> f64 {
    let step = angle.len().div_ceil(2500).max(1);
    let x: Vec<f64> = angle.iter().copied().step_by(step).collect();
    let y: Vec<f64> = value.iter().copied().step_by(step).collect();
    let misfit = |order: f64| {
        let lines = harmonics(&x, &y, &[others, &[order]].concat());
        lines.map_or(f64::INFINITY, |lines| without(&x, &y, &lines).iter().map(|left| left * left).sum())
    };
    // Steps of a quarter of a width, then halves of the step before.
    let (mut best, mut least, mut by) = (order, misfit(order), 0.25 * resolution);
    for _ in 0..HALVINGS {
        for tried in [best - by, best + by] {
            let misfit = misfit(tried);
            if misfit < least {
                (best, least) = (tried, misfit);
            }
        }
        by *= 0.5;
    }
    best
}
