//! A torque loop at rest: what gives way beyond a spring, play or contact that hardens.
//!
//! The generator stands, the load goes round, and the output errs by
//!
//! ```text
//! zero of the log + c0 flank + a sign(x) |x|^p + b way (1 - x^2) + c held + d x^3         x: load over the largest
//! ```
//!
//! `way` is that of the load, `held` what a spring holds that slips; both make the loss, x^3 a spring that hardens.
//! Play turns over to the other flank at a knee, the same both ways, and stays there as the load comes back: a loop.
//! Contact of curved bodies (Hertz) goes with the power ⅔ of the load and leaves none. Both are laid beside a spring
//! and a loss, and the one that leaves more than the other is rejected.

use serde::Serialize;

use super::zero::{BLOCKS, OF_95_OF_BLOCKS};
use crate::least_squares::{Normal, jackknife};
use crate::measurement::{Recording, least_and_most, white_noise};
use flexspline_base::units::ARCSEC_PER_RAD;

/// A generator that moves by less than this stands, rad. *Guess*: a tenth of a tooth pitch.
const STANDS_RAD: f64 = 3.5e-3;
/// The load goes round if the smaller end is this share of the larger. *Guess*.
const BOTH_ENDS: f64 = 0.5;
/// The load turns round where it comes back by this share of the largest, *guess*, …
const COMES_BACK: f64 = 0.03;
/// … and by this many times its noise, *guess*.
const BEYOND_NOISE: f64 = 6.0;
/// Loads at which the flank may turn over, of the largest. *Guess*.
const KNEES: [f64; 2] = [0.0, 0.25];
/// Knees that are tried in an interval, *guess*; the next is between the neighbours of the best, …
const KNEES_TRIED: usize = 16;
/// … this often, *guess*: to 2e-4 of the largest load.
const KNEES_NARROWED: usize = 4;
/// Load at which a spring slips that takes the place of the smooth loss, of the largest. *Guess*.
const SLIPS: f64 = 0.3;
/// Power of the load by which curved bodies approach, of Hertz's contact (Johnson 1985, *Contact Mechanics*, 4.2).
const HERTZ: f64 = 2.0 / 3.0;
/// Powers that are looked among. *Guess*.
const POWERS: [f64; 2] = [0.3, 1.5];

/// A figure with the half width of its interval, 95 %, as blocks left out change it; that of the play with what other
/// laws of the spring change, too.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LoopFigure {
    /// The figure.
    pub value: f64,
    /// Half width.
    pub half_width: f64,
}

/// What a torque loop at rest says.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TorqueLoop {
    /// Rows.
    pub rows: usize,
    /// Largest load, N·m.
    pub most_n_m: f64,
    /// Half of the play, arcsec.
    pub c0_arcsec: LoopFigure,
    /// Load at which it is crossed, either way, N·m.
    pub knee_n_m: f64,
    /// Power of the load by which the output gives way beside the play.
    pub exponent: LoopFigure,
    /// Half of what way up and way down are apart at no load, the play aside, arcsec.
    pub loss_arcsec: LoopFigure,
    /// Which of `play` and `hertz` the loop rejects.
    pub rejects: Option<&'static str>,
}

impl std::fmt::Display for LoopFigure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let digits = f.precision().unwrap_or(1);
        write!(f, "{:.digits$} ± {:.digits$}", self.value, self.half_width)
    }
}

impl std::fmt::Display for TorqueLoop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let TorqueLoop { rows, c0_arcsec, knee_n_m, exponent, loss_arcsec, .. } = self;
        let says = match self.rejects {
            Some("play") => "rejects play: the output gives way as contact of curved bodies does (Hertz)",
            Some(_) => "rejects contact of curved bodies (Hertz): the output has play",
            None => "does not tell play from contact of curved bodies (Hertz)",
        };
        write!(
            f,
            "the generator stands and the load goes round, {rows} rows: no table, but what the output gives way by\n  \
             half the play, c0: {c0_arcsec:.1} arcsec, crossed at ±{knee_n_m:.2} N·m\n  power of the load, play aside: \
             {exponent:.2}\n  half the loop at no load, the play aside: {loss_arcsec:.1} arcsec\nthe loop {says}"
        )
    }
}

struct Row {
    log: usize,
    x: f64,
    way: f64,
    flank: f64,
    /// What a spring holds that slips.
    held: f64,
    error_arcsec: f64,
}

impl Row {
    fn power(&self, p: f64) -> f64 {
        self.x.abs().powf(p).copysign(self.x)
    }

    fn loss(&self) -> f64 {
        self.way * (1.0 - self.x * self.x)
    }
}

/// Coefficients of columns in addition to the zeros of the logs, over the rows outside of a block: columns, then zeros;
/// and the squares that they leave there.
fn fit<const N: usize>(
    rows: &[Row],
    columns: impl Fn(&Row) -> [f64; N],
    without: Option<usize>,
) -> Option<(Vec<f64>, f64)> {
    let normal = Normal::of(N + rows.last()?.log + 1, rows.len(), |k, row| {
        row[N..].fill(0.0);
        row[N + rows[k].log] = 1.0;
        row[..N].copy_from_slice(&columns(&rows[k]));
        (rows[k].error_arcsec, if without == Some(block(k, rows)) { 0.0 } else { 1.0 })
    })?;
    Some((normal.values(), normal.misfit()))
}

/// The block of a row.
fn block(k: usize, rows: &[Row]) -> usize {
    k * BLOCKS / rows.len()
}

/// The squares that columns leave of all rows, and those of each block.
fn left_by_block<const N: usize>(rows: &[Row], columns: impl Fn(&Row) -> [f64; N]) -> Option<(f64, [f64; BLOCKS])> {
    let (found, all) = fit(rows, &columns, None)?;
    let mut left = [0.0; BLOCKS];
    for (k, row) in rows.iter().enumerate() {
        let says: f64 = columns(row).iter().zip(&found).map(|(x, c)| x * c).sum();
        left[block(k, rows)] += (row.error_arcsec - found[N + row.log] - says).powi(2);
    }
    Some((all, left))
}

/// The rows of logs in which the generator stands and the load goes round; none if one does otherwise.
fn rows_of(files: &[Recording]) -> Option<(Vec<Row>, f64)> {
    let sessions = || files.iter().flat_map(|file| &file.sessions);
    let loads = sessions().map(|session| session.torque_n_m.as_deref()).collect::<Option<Vec<_>>>()?;
    let (low, high) = least_and_most(loads.iter().flat_map(|loads| loads.iter().copied()));
    let (most, noise) = (high.max(-low), white_noise(loads.iter().copied()));
    let stands = sessions().all(|session| {
        let (from, to) = least_and_most(session.generator_rad.iter().copied());
        to - from < STANDS_RAD
    });
    if !stands || high.min(-low) < BOTH_ENDS * most || most <= 0.0 {
        return None;
    }
    let (mut rows, mut turns) = (Vec::new(), 0);
    for (log, (session, loads)) in sessions().zip(loads).enumerate() {
        let (mut way, mut end, mut is_known) = (1.0, f64::NEG_INFINITY, false);
        let (mut held, mut before) = (0.0, 0.0);
        for (load, error_rad) in loads.iter().zip(&session.error_rad) {
            if way * (end - load) > (COMES_BACK * most).max(BEYOND_NOISE * noise) {
                (way, end, turns) = (-way, *load, turns + 1);
            }
            end = if way > 0.0 { end.max(*load) } else { end.min(*load) };
            let x = load / most;
            held = f64::clamp(held + x - before, -SLIPS, SLIPS);
            before = x;
            // Before the first knee nobody knows the flank.
            is_known |= x.abs() > KNEES[1];
            if is_known {
                rows.push(Row { log, x, way, flank: 0.0, held, error_arcsec: error_rad * ARCSEC_PER_RAD });
            }
        }
    }
    (turns >= 2 && rows.len() >= super::FEWEST_ROWS).then_some((rows, most))
}

/// Puts rows on the flank that a load beyond the knee has brought them to.
fn turn_over(rows: &mut [Row], knee: f64) {
    let mut flank = 0.0;
    for row in rows {
        flank = if row.x.abs() > knee { row.x.signum() } else { flank };
        row.flank = flank;
    }
}

impl TorqueLoop {
    /// Of logs in which the generator stands and the load goes round; none of others.
    pub fn of(files: &[Recording]) -> Option<TorqueLoop> {
        let (mut rows, most_n_m) = rows_of(files)?;
        let ([mut from, mut to], mut best) = (KNEES, (f64::INFINITY, 0.0));
        for _ in 0..KNEES_NARROWED {
            let step = (to - from) / KNEES_TRIED as f64;
            for knee in (0..=KNEES_TRIED).map(|k| from + step * k as f64) {
                turn_over(&mut rows, knee);
                let (_, left) = fit(&rows, |row| [row.x, row.flank, row.loss()], None)?;
                best = if left < best.0 { (left, knee) } else { best };
            }
            [from, to] = [(best.1 - step).max(0.0), best.1 + step];
        }
        let (_, knee) = best;
        turn_over(&mut rows, knee);
        let (of_play, by_play) = left_by_block(&rows, |row| [row.x, row.flank, row.loss()])?;
        let (of_hertz, by_hertz) = left_by_block(&rows, |row| [row.x, row.power(HERTZ), row.loss()])?;
        let apart = of_play - of_hertz;
        let without: Vec<f64> = by_play.iter().zip(&by_hertz).map(|(play, hertz)| apart - (play - hertz)).collect();
        // c0, exponent and loss, of all rows or without a block, beside springs that harden and that slip.
        let found = |without: Option<usize>| -> Option<[f64; 3]> {
            let with =
                |p: f64| fit(&rows, |row| [row.flank, row.power(p), row.loss(), row.held, row.x.powi(3)], without);
            let [mut low, mut high] = POWERS;
            while high - low > 1e-4 {
                let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
                if with(a)?.1 < with(b)?.1 { high = b } else { low = a }
            }
            let (of, _) = with(low)?;
            // Flank, power, loss, what the spring holds.
            Some([of[0], low, -of[2] - SLIPS * of[3]])
        };
        let value = found(None)?;
        // Half of the play by other laws: Hertz's power beside a spring, and no springs at all.
        let by_hertz =
            fit(&rows, |row| [row.flank, row.x, row.power(HERTZ), row.loss(), row.held, row.x.powi(3)], None)?.0[0];
        let alone = fit(&rows, |row| [row.flank, row.power(value[1]), row.loss()], None)?.0[0];
        let of_laws = (by_hertz - value[0]).abs().max((alone - value[0]).abs());
        let each = (0..BLOCKS).map(|block| found(Some(block))).collect::<Option<Vec<_>>>()?;
        let figure = |k: usize| {
            let without: Vec<f64> = each.iter().map(|found| found[k]).collect();
            let half_width = OF_95_OF_BLOCKS * jackknife(&without);
            LoopFigure { value: value[k], half_width: if k == 0 { half_width.hypot(of_laws) } else { half_width } }
        };
        let worse = if apart > 0.0 { "play" } else { "hertz" };
        Some(TorqueLoop {
            rows: rows.len(),
            most_n_m,
            c0_arcsec: figure(0),
            knee_n_m: knee * most_n_m,
            exponent: figure(1),
            loss_arcsec: figure(2),
            rejects: (apart.abs() > OF_95_OF_BLOCKS * jackknife(&without)).then_some(worse),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;

    /// Loops of both kinds by laws of their own: a spring that hardens or softens, a slip spring that loses, noise of
    /// angle and torque, the load a sine or a triangle.
    fn made(seed: u64, has_play: bool) -> (Recording, f64) {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
        let (most, periods, spring) = (between(10.0, 60.0), between(1.6, 4.0), between(60.0, 150.0));
        let (gives, knee, hardens) = (between(20.0, 60.0), between(0.002, 0.1), between(-0.05, 0.05));
        let (loss, slips, triangle) = (between(0.0, 15.0), between(0.1, 0.6), between(0.0, 1.0) < 0.5);
        let mut noise = |size: f64| size * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
        let (mut flank, mut held) = (-1.0, 0.0_f64);
        let mut session = Session { torque_n_m: Some(Vec::new()), ..Session::default() };
        let mut before = 0.0;
        for k in 0..2000 {
            let phase = periods * f64::from(k) / 2000.0;
            let x = if triangle {
                1.0 - 4.0 * ((phase + 0.25).rem_euclid(1.0) - 0.5).abs()
            } else {
                (std::f64::consts::TAU * phase).sin()
            };
            held = (held + x - before).clamp(-slips, slips);
            before = x;
            if x.abs() > knee {
                flank = x.signum();
            }
            let beyond = if has_play { flank } else { x.abs().powf(2.0 / 3.0).copysign(x) };
            let error = spring * (x + hardens * x * x * x) + gives * beyond - loss * held / slips;
            session.line.push(k as u64);
            session.generator_rad.push(1.0 + noise(1e-5));
            session.error_rad.push((error + noise(2.0)) / ARCSEC_PER_RAD);
            session.torque_n_m.as_mut().unwrap().push(most * (x + noise(0.001)));
        }
        (Recording::made("loop.log", vec![session]), if has_play { gives } else { 0.0 })
    }

    #[test]
    fn play_and_hertz_are_told_apart_in_twenty_of_twenty() {
        let mut inside = 0;
        for seed in 0..10 {
            for (has_play, other) in [(true, "hertz"), (false, "play")] {
                let (made, c0_arcsec) = made(seed, has_play);
                let found = TorqueLoop::of(&[made]).unwrap();
                let LoopFigure { value, half_width } = found.c0_arcsec;
                println!("{seed} c0 {c0_arcsec:.2}, found {value:.2} ± {half_width:.2}; power {:.2}", found.exponent);
                assert_eq!(found.rejects, Some(other), "{seed}: {found:?}");
                inside += u32::from((value - c0_arcsec).abs() < half_width);
            }
        }
        assert!(inside >= 18, "{inside} of 20 have the play inside their interval");
    }

    #[test]
    fn a_log_in_motion_is_no_loop_at_rest() {
        let (mut log, _) = made(1, true);
        log.sessions[0].generator_rad.iter_mut().enumerate().for_each(|(k, psi)| *psi += 1e-4 * k as f64);
        assert_eq!(TorqueLoop::of(&[log]), None);
    }
}
