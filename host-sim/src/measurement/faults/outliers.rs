//! Single rows that neither the rows before nor those after bear out.

use super::resolution::seen;
use super::{ARCSEC, Findings, of_rows};
use crate::measurement::Session;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::robust::{median_of, quantile_of, sampled, white_noise};

/// A row is out by so many standard deviations of the white noise…
const OUT: f64 = 10.0;
/// …and by so many times what all rows around it but one are out by: ripple that rows follow too slowly stands out everywhere.
const OUT_OF_AROUND: f64 = 3.0;
/// And by this at least, rad at the output, and by two steps of the resolution.
const LEAST_RAD: f64 = 3.0 * ARCSEC;
const STEPS: f64 = 2.0;
/// And, in torque and temperature, by this share of the range.
const LEAST_OF_RANGE: f64 = 0.05;
/// The pulse of a tooth is this wide, rad of the generator; rows that are farther apart may catch it once.
const TOOTH_RAD: f64 = 0.05;
/// Fewer outliers than this, or any in fast motion, are named only if they are large: teeth and kinks of the motion give small ones.
const FEW: usize = 4;
/// Large, rad at the output: more than a tooth or a usual clearance gives.
const LARGE_RAD: f64 = 120.0 * ARCSEC;
/// Load changes at once if it does by so many times its usual pace.
const LOAD_PACE: f64 = 10.0;
/// Rows before and after that are looked at.
const BESIDE: usize = 3;
/// Rows around, for what is usual there.
const AROUND: usize = 15;
/// If more rows than this are out, they are not outliers but the noise.
const SHARE: f64 = 0.05;
/// Mean resultant length above which four or more outliers repeat with position: a damaged tooth, which is the drive.
const REPEATS: f64 = 0.9;
/// Rayleigh's n R² above which many outliers repeat with position: chance exp(−12).
const REPEATS_MANY: f64 = 12.0;

/// How far row `row` is from the rows before and after, if both say so; 0 if one of them bears it out.
fn out_by(values: &[f64], row: usize) -> f64 {
    if row < BESIDE || row + BESIDE >= values.len() {
        return 0.0;
    }
    let middle = |from: usize| {
        let (a, b, c) = (values[from], values[from + 1], values[from + 2]);
        a.max(b).min(a.min(b).max(c))
    };
    let (before, after) = (values[row] - middle(row - BESIDE), values[row] - middle(row + 1));
    if before * after <= 0.0 { 0.0 } else { before.signum() * before.abs().min(after.abs()) }
}

/// Whether the drive goes on steadily around a row: no reversal and no load that changes at once, which give peaks of their own.
fn steady(session: &Session, row: usize) -> bool {
    let near = row.saturating_sub(6).max(1)..(row + 7).min(session.len());
    let moved = |k: usize| session.generator_rad[k] - session.generator_rad[k - 1];
    // The row itself may be the one that is out.
    let mut others = near.clone().filter(|k| *k != row && *k != row + 1);
    let direction = others.clone().map(moved).sum::<f64>();
    if others.any(|k| moved(k) * direction < 0.0) {
        return false;
    }
    session.torque_n_m.as_ref().is_none_or(|torque| {
        let mut paces: Vec<f64> = near.clone().map(|k| (torque[k] - torque[k - 1]).abs()).collect();
        let largest = paces.iter().copied().fold(0.0, f64::max);
        largest <= LOAD_PACE * median_of(&mut paces) || largest == 0.0
    })
}

/// Rows that are out by more than `least`.
fn rows_out(values: &[f64], least: f64) -> Vec<(usize, f64)> {
    let mut found = Vec::new();
    for row in BESIDE..values.len().saturating_sub(BESIDE) {
        let by = out_by(values, row);
        if by.abs() <= least {
            continue;
        }
        let around = row.saturating_sub(AROUND)..(row + AROUND + 1).min(values.len());
        let mut usual: Vec<f64> = around.filter(|k| *k != row).map(|k| out_by(values, k).abs()).collect();
        usual.sort_unstable_by(f64::total_cmp);
        let usual = usual.iter().rev().nth(1).copied().unwrap_or(0.0);
        let (mut before, mut after) = (values[row - BESIDE..row].to_vec(), values[row + 1..=row + BESIDE].to_vec());
        let step = (median_of(&mut before) - median_of(&mut after)).abs();
        if by.abs() > OUT_OF_AROUND * usual && step < 0.5 * by.abs() {
            found.push((row, by));
        }
    }
    found
}

/// Finds outliers; rows with an outlying error are left out, other channels are mended from the rows beside.
pub(in crate::measurement) fn check(
    sessions: &mut [Session],
    gear: &Gear,
    error_recorded: bool,
    findings: &mut Findings,
) {
    let rows: usize = sessions.iter().map(Session::len).sum();
    let noise = white_noise(sessions.iter().map(|session| session.error_rad.as_slice()));
    let resolution = seen(sessions, gear, error_recorded).into_iter().map(|(_, step)| step).fold(0.0, f64::max);
    let least = (OUT * noise).max(LEAST_RAD).max(STEPS * resolution);
    let found: Vec<Vec<(usize, f64)>> = sessions
        .iter()
        .map(|session| {
            let mut rows = rows_out(&session.error_rad, least);
            rows.retain(|(row, _)| steady(session, *row));
            rows
        })
        .collect();
    let count: usize = found.iter().map(Vec::len).sum();
    if count > 0 && count as f64 <= SHARE * rows as f64 {
        let fast = found.iter().zip(sessions.iter()).all(|(rows, session)| {
            rows.iter().all(|(row, _)| {
                (session.generator_rad[row + 1] - session.generator_rad[row - 1]).abs() > 2.0 * TOOTH_RAD
            })
        });
        let large = found.iter().flatten().any(|(_, by)| by.abs() > LARGE_RAD);
        if (count < FEW || fast) && !large {
            findings.notes.push(format!(
                "{count} single rows stand out: too few, or in too fast a motion, to tell drive from data"
            ));
        } else if repeat_with_position(sessions, &found, gear) {
            findings
                .notes
                .push(format!("{count} single rows stand out, always in the same position: the drive, not the data"));
        } else {
            report(sessions, &found, Quantity::Error, Treatment::Masked, "their rows are left out", findings);
            for (session, found) in sessions.iter_mut().zip(&found) {
                let mut drop = vec![false; session.len()];
                found.iter().for_each(|(row, _)| drop[*row] = true);
                if !found.is_empty() {
                    session.leave_out(&drop);
                }
            }
        }
    }
    for channel in [Quantity::Torque, Quantity::Temperature] {
        let series: Vec<&[f64]> = sessions.iter().filter_map(|session| session.beside(channel)).collect();
        let mut some: Vec<f64> = series.iter().flat_map(|values| sampled(values)).collect();
        let range = quantile_of(&mut some, 0.99) - quantile_of(&mut some, 0.01);
        let least = (OUT * white_noise(series)).max(LEAST_OF_RANGE * range);
        if least == 0.0 {
            continue;
        }
        let found: Vec<Vec<(usize, f64)>> = sessions
            .iter()
            .map(|session| session.beside(channel).map_or_else(Vec::new, |v| rows_out(v, least)))
            .collect();
        let count: usize = found.iter().map(Vec::len).sum();
        if count == 0 || count as f64 > SHARE * rows as f64 {
            continue;
        }
        report(sessions, &found, channel, Treatment::Repaired, "the rows beside stand in", findings);
        for (session, found) in sessions.iter_mut().zip(&found) {
            if let Some(values) = session.beside_mut(channel) {
                found.iter().for_each(|(row, _)| values[*row] = 0.5 * (values[row - 1] + values[row + 1]));
            }
        }
    }
}

fn report(
    sessions: &[Session],
    found: &[Vec<(usize, f64)>],
    channel: Quantity,
    treatment: Treatment,
    done: &str,
    findings: &mut Findings,
) {
    let all = || found.iter().enumerate().flat_map(|(k, rows)| rows.iter().map(move |(row, by)| (k, *row, *by)));
    let (Some(first), Some(last)) = (all().next(), all().last()) else { return };
    let largest = all().map(|(.., by)| by).fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
    let mut fault = of_rows(&sessions[first.0], FaultName::Outliers, first.1..first.1 + 1);
    let end = of_rows(&sessions[last.0], FaultName::Outliers, last.1..last.1 + 1);
    (fault.until_s, fault.last_line) = (end.until_s, end.last_line);
    fault.rows = all().count() as u64;
    (fault.channel, fault.treatment) = (Some(channel), treatment);
    let size = if channel == Quantity::Error {
        fault.size_arcsec = Some(largest / ARCSEC);
        format!("{:.1} arcsec", largest / ARCSEC)
    } else {
        format!("{largest:.3}")
    };
    fault.what = format!("{} single rows of the {channel} are out, the farthest by {size}: {done}", fault.rows);
    findings.faults.push(fault);
}

/// Whether rows gather at the same angle of a wheel, more than all rows do.
fn repeat_with_position(sessions: &[Session], found: &[Vec<(usize, f64)>], gear: &Gear) -> bool {
    let count: usize = found.iter().map(Vec::len).sum();
    if count < FEW {
        return false;
    }
    // Generator on the flexspline, once or twice a turn (two lobes); on the circular spline likewise; the output.
    let share = 1.0 / gear.ratio;
    [1.0, 2.0, 1.0 - share, 2.0 * (1.0 - share), share, 2.0 * share].iter().any(|order| {
        let resultant = |angles: &mut dyn Iterator<Item = f64>| {
            let (mut c, mut s, mut n) = (0.0, 0.0, 0.0);
            for angle in angles {
                let (sin, cos) = (order * angle).sin_cos();
                (c, s, n) = (c + cos, s + sin, n + 1.0);
            }
            f64::hypot(c, s) / f64::max(n, 1.0)
        };
        let of_found = resultant(
            &mut sessions
                .iter()
                .zip(found)
                .flat_map(|(session, rows)| rows.iter().map(|(row, _)| session.generator_rad[*row])),
        );
        let of_all = resultant(&mut sessions.iter().flat_map(|session| session.generator_rad.iter().copied()));
        let n = count as f64;
        of_found > of_all + 0.3 && (of_found > REPEATS || n * of_found.powi(2) > REPEATS_MANY)
    })
}
