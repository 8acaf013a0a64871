//! What a run of the protocol comes to. Each metric is one thing and keeps its name: a lag is no ripple, a ripple no
//! lost motion.
//!
//! ```text
//!  e ^        B ______________________ C   e_b   backward: the other flank drives
//!    |       /                                   A-B: the output stands (dwell)
//!  0 |-O----/---------------------------> travel
//!    |  \_______________ A                 e_f   forward, after start-up
//! ```
//!
//! - *largest lag*: largest |e| from the start to the turn, and on the way back, from where the drive was deformed, the
//!   output in the middle of its clearance;
//! - *mean lag* e_f, e_b: over whole tooth pitches after start-up;
//! - *ripple*: largest less smallest e of one way after start-up;
//! - *half-width at reversal*: (e_b − e_f) / 2; the whole is the backlash at no load;
//! - *dwell*: generator travel A–B while the output stands; over the ratio it is a backlash;
//! - *lost motion* 0–A against B–C: e on the way back less e on the way there, at the same generator angle.

use flexspline_base::units::ARCMIN_PER_RAD;
use flexspline_design::simulate::{Row, Simulation};
use serde::Serialize;

/// Metrics of a run of the protocol, errors in arc-seconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ProtocolMetrics {
    /// Largest |error| from the start to +1 rad.
    pub largest_out_arcsec: f64,
    /// Largest |error| on the way back.
    pub largest_back_arcsec: f64,
    /// Mean error forward after start-up.
    pub lag_forward_arcsec: Option<f64>,
    /// Mean error backward after the reversal is behind.
    pub lag_backward_arcsec: Option<f64>,
    /// Ripple after start-up, peak to peak.
    pub ripple_pp_arcsec: Option<f64>,
    /// Half of what is lost between forward and backward.
    pub half_width_arcsec: Option<f64>,
    /// Generator travel during which the output stands after the reversal, rad.
    pub dwell_rad: Option<f64>,
    /// Dwell at the output: that of the generator over the ratio.
    pub dwell_arcsec: Option<f64>,
    /// Error where the generator turns back, +1 rad.
    pub error_at_turn_arcsec: f64,
    /// Error at the end, −1 rad.
    pub error_at_end_arcsec: f64,
    /// Mean of |e(B–C) − e(0–A)| at the same generator angles, the start and A–B left out.
    pub lost_motion_arcsec: Option<f64>,
    /// How far the error moves over a pitch a third of the way on against the last before the turn; a perfect drive
    /// repeats.
    pub drift_arcsec: Option<f64>,
    /// Largest von Mises stress on the path, MPa.
    pub peak_mpa: f64,
}

/// Place of the row at which the generator turns back: the largest angle.
pub fn turn_of(rows: &[Row]) -> usize {
    let farthest = rows.iter().enumerate().max_by(|a, b| a.1.generator_rad.total_cmp(&b.1.generator_rad));
    farthest.map_or(0, |(at, _)| at)
}

impl ProtocolMetrics {
    /// Of a run along [`flexspline_design::simulate::Path::Paper`]; `pitch` is that of the flexspline, rad.
    pub fn new(run: &Simulation, ratio: f64, pitch: f64) -> ProtocolMetrics {
        let (rows, summary) = (&run.rows, &run.summary);
        let turn = turn_of(rows);
        let (out, back) = rows.split_at(turn + 1);
        let largest = |rows: &[Row]| rows.iter().map(|row| row.error_arcsec.abs()).fold(0.0, f64::max);
        let (forward, backward) = (summary.mean_error_forward_arcsec, summary.mean_error_backward_arcsec);
        let dwell_rad = summary.dwell_generator_rad;
        ProtocolMetrics {
            largest_out_arcsec: largest(out),
            largest_back_arcsec: largest(back),
            lag_forward_arcsec: forward,
            lag_backward_arcsec: backward,
            ripple_pp_arcsec: summary.kinematic_error_pp_arcsec,
            half_width_arcsec: forward.zip(backward).map(|(f, b)| 0.5 * (b - f)),
            dwell_rad,
            dwell_arcsec: dwell_rad.map(|rad| rad / ratio * 60.0 * ARCMIN_PER_RAD),
            error_at_turn_arcsec: rows[turn].error_arcsec,
            error_at_end_arcsec: rows[rows.len() - 1].error_arcsec,
            lost_motion_arcsec: lost_motion(out, back, pitch),
            drift_arcsec: drift(out, pitch),
            peak_mpa: summary.max_von_mises_mpa,
        }
    }
}

/// Error at a generator angle, linear between rows; `rows` one way.
fn error_at(rows: &[Row], angle: f64) -> Option<f64> {
    rows.windows(2).find_map(|pair| {
        let (a, b) = (pair[0].generator_rad, pair[1].generator_rad);
        let t = (angle - a) / (b - a);
        (-1e-9..=1.0 + 1e-9)
            .contains(&t)
            .then(|| pair[0].error_arcsec + t * (pair[1].error_arcsec - pair[0].error_arcsec))
    })
}

/// Mean of |e back − e out| at the angles of the way out, from a pitch after the start to two pitches before the turn.
fn lost_motion(out: &[Row], back: &[Row], pitch: f64) -> Option<f64> {
    let (first, last) = (out.first()?.generator_rad, out.last()?.generator_rad);
    let differences: Vec<f64> = out
        .iter()
        .filter(|row| row.generator_rad > first + pitch && row.generator_rad < last - 2.0 * pitch)
        .filter_map(|row| Some((error_at(back, row.generator_rad)? - row.error_arcsec).abs()))
        .collect();
    (!differences.is_empty()).then(|| differences.iter().sum::<f64>() / differences.len() as f64)
}

/// Largest change of the error between a pitch one third of the way on and the one whole pitches later before the turn.
fn drift(out: &[Row], pitch: f64) -> Option<f64> {
    let last = out.last()?.generator_rad;
    let from = out.first()?.generator_rad + (last - out.first()?.generator_rad) / 3.0;
    let whole = ((last - from) / pitch).floor() - 1.0;
    if whole < 1.0 {
        return None;
    }
    (0..=8)
        .map(|k| {
            let angle = from + pitch * f64::from(k) / 8.0;
            Some((error_at(out, angle + whole * pitch)? - error_at(out, angle)?).abs())
        })
        .try_fold(0.0, |worst, change| Some(f64::max(worst, change?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(generator_rad: f64, error_arcsec: f64) -> Row {
        Row {
            step: 0,
            generator_rad,
            output_rad: 0.0,
            error_arcsec,
            torque_n_m: 0.0,
            flank_contacts: 0,
            generator_contacts: 0,
            max_von_mises_mpa: 0.0,
            iterations: 1,
            temperature_c: 20.0,
            generator_torque_n_m: 0.0,
            drag_torque_n_m: 0.0,
            torque_balance_n_m: 0.0,
            peak_flank_pressure_mpa: 0.0,
            peak_generator_pressure_mpa: 0.0,
            residual: 0.0,
            face: flexspline_mechanics::stepping::Face::EVEN,
            lobe_force_n: 0.0,
            tips: None,
            settled: true,
            turn_rad: 0.0,
        }
    }

    const PITCH: f64 = std::f64::consts::TAU / 188.0;

    #[test]
    fn the_lost_motion_is_the_distance_of_the_two_ways() {
        let out: Vec<Row> = (0..=100).map(|k| row(0.01 * f64::from(k), -30.0)).collect();
        let back: Vec<Row> = (1..=200).map(|k| row(1.0 - 0.01 * f64::from(k), 31.0)).collect();
        assert!((lost_motion(&out, &back, PITCH).unwrap() - 61.0).abs() < 1e-9);
        assert_eq!(turn_of(&[out, back].concat()), 100);
    }

    #[test]
    fn a_ripple_repeats_and_a_slow_wave_does_not() {
        let rows = |e: fn(f64) -> f64| -> Vec<Row> {
            (0..=1000).map(|k| row(1e-3 * f64::from(k), e(1e-3 * f64::from(k)))).collect()
        };
        let ripple = rows(|psi| -30.0 + 0.2 * (188.0 * psi).cos());
        assert!(drift(&ripple, PITCH).unwrap() < 0.01);
        let wave = rows(|psi| 1000.0 * (2.0 * psi).sin());
        assert!(drift(&wave, PITCH).unwrap() > 100.0);
    }
}
