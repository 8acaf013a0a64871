//! The nominal prediction over the rows, and what of it may float without being a discrepancy.
//!
//! # Play
//! The flank that carries follows the load: `p = +1` where the torque turns the output forward onto one flank, `−1` on
//! the other, and the error holds `p · backlash / 2`. Inside `|torque| < friction` drives differ, so several laws are
//! tried and the one that leaves least is taken:
//! held (p stays where it was), pushed (friction holds the output until the generator has used up the clearance and
//! pushes it: a play operator in the nominal output), by sign alone, and smooth.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use flexspline::Table;
use serde::{Deserialize, Serialize};

use super::candidate::geometry::Angle;
use super::channels::waves;
use super::rows::Rows;
use super::select::less;
use crate::calibrate::{SAME_TORQUE, TURNS_WITH_THE_OUTPUT};
use crate::least_squares::FreeSpan;
use crate::misfit::{about_mean, correlation};
use crate::nominal::{Nominal, UNSTATED};
use crate::replay::by_core;
use flexspline_base::robust::dot;
use flexspline_base::units::ARCSEC_PER_RAD;

table! {
    /// How the flank changes where the torque is below friction; with its name in a file.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub(crate) enum PlayLaw: &'static str {
        /// It stays as it was until the torque exceeds friction.
        Held = "held",
        /// Friction holds the output until the generator pushes it.
        Pushed = "pushed",
        /// It follows the sign of the torque.
        Sign = "sign",
        /// `tanh(torque / friction)`.
        Smooth = "smooth",
    }
}

impl PlayLaw {
    /// Which flank carries in each row, −1 to 1, under a torque.
    pub(crate) fn flanks(self, rows: &Rows, torque: &[f64], nominal: &Nominal) -> Vec<f64> {
        // Before the first load: where the friction of a moving output puts it.
        let begun = |first: usize| -rows.direction[first] * nominal.ratio.signum();
        self.flanks_from(begun, 1.0, rows, torque, nominal)
    }

    /// Flanks with a clearance `wider` than nominal, from where each session has `begun` if no load says (first row).
    fn flanks_from(
        self,
        begun: impl Fn(usize) -> f64,
        wider: f64,
        rows: &Rows,
        torque: &[f64],
        nominal: &Nominal,
    ) -> Vec<f64> {
        let friction = nominal.friction_torque_n_m;
        let half_rad = (0.5 * wider * nominal.backlash_arcsec / ARCSEC_PER_RAD).max(1e-12);
        let mut flanks = vec![0.0; rows.len()];
        for session in &rows.sessions {
            let first = session.start;
            let mut p = if torque[first].abs() > friction { torque[first].signum() } else { begun(first) };
            for k in session.clone() {
                let load = torque[k];
                p = match self {
                    PlayLaw::Smooth => (load / friction.max(1e-9)).tanh(),
                    _ if load.abs() > friction => load.signum(),
                    PlayLaw::Held => p,
                    PlayLaw::Sign if load != 0.0 => load.signum(),
                    PlayLaw::Sign => p,
                    PlayLaw::Pushed => {
                        let turned = if k > first { rows.output[k] - rows.output[k - 1] } else { 0.0 };
                        (p - turned / half_rad).clamp(-1.0, 1.0)
                    }
                };
                flanks[k] = p;
            }
        }
        flanks
    }
}

/// A column that belongs to the nominal model and may float: coefficient 0 is nominal.
#[derive(Clone, Debug)]
pub(crate) struct Floating {
    /// What it is.
    pub name: String,
    /// Column, arcsec per unit of the coefficient.
    pub values: Vec<f64>,
    /// Standard deviation between units; large for the zero of the encoder, [`HELD`] of what does not float.
    pub spread: f64,
}

type Pair = Arc<[Vec<f64>; 2]>;

/// Cosines and sines of angles that many laws share, made when first asked for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Waves(Arc<Mutex<HashMap<(Angle, u64), Pair>>>);

impl Waves {
    /// Cosine and sine of `order` times an angle.
    pub fn of(&self, angle: Angle, order: f64, make: impl FnOnce() -> [Vec<f64>; 2]) -> Pair {
        let key = (angle, order.to_bits());
        let known = |waves: &Waves| waves.0.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        if let Some(pair) = known(self) {
            return pair;
        }
        let pair = Arc::new(make());
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(key, pair.clone());
        pair
    }
}

/// Nominal prediction and tolerances.
#[derive(Clone, Debug)]
pub(crate) struct Base {
    /// Prediction of the nominal model, arcsec.
    pub prediction: Vec<f64>,
    /// Which flank carries, −1 to 1.
    pub flank: Vec<f64>,
    /// Nominal wind-up, arcsec.
    pub wind_up: Vec<f64>,
    /// Half the nominal backlash, arcsec.
    pub half_backlash: f64,
    /// Law of the play.
    pub law: PlayLaw,
    /// What may float.
    pub floating: Vec<Floating>,
    /// Cosines and sines of angles that many laws share.
    pub waves: Waves,
    /// Rows where the flank is not known well: crossing the clearance, or torque around friction.
    pub uncertain: Vec<bool>,
}

/// The parameter that floats where angles are read at other instants than is known, s.
pub const BETWEEN_READINGS: &str = "time between the readings";
/// What floats as a load that goes with the angle of the output leaves open whose a wave of the output is.
pub const WAVE_OF_LOAD: &str = "wave of the output under its load";
/// What floats as the output takes a time to go to its other flank, s: by each of `FLANK_S` as much of a lag, which
/// together are its mean.
pub const CHANGE_OF_FLANK: &str = "time of a change of flank";
/// The output goes from one flank to the other with lags of which some of these make any, s. *Guess*: a load behind a
/// clearance takes some milliseconds, and what takes longer than these swings.
const FLANK_S: [f64; 4] = [5e-3, 10e-3, 20e-3, 40e-3];
/// Spread of the drag of an output, of the load, where the nominal model states no friction. *Source*: what starts a
/// drive of the catalogue (CSG-14 to 25, 100), through the ratio, is 7 to 21 % of its rated torque.
const DRAG_OF_LOAD: f64 = 0.1;
/// Spread of what a spring that a calibration has found hardens by, of it. *Guess*: the softness under light loads that
/// play hides.
const HARDENING: f64 = 0.2;
/// Powers of the load that any spring may harden by. *Guess*: with that of itself those of a calibrated spring but one.
const POWERS: i32 = 4;
/// Prior standard deviation of what no drawing fixes, arcsec: the offset of the output encoder. *Guess*: 2.8°, so wide
/// that the data alone decide.
pub(super) const FREE: f64 = 1e4;
/// Least spread of a phase, over that of the amplitude. *Guess*: small enough to hold a phase that the nominal model
/// fixes.
const LEAST_TURN: f64 = 1e-3;
/// A backlash model is preferred if it leaves less than this share of the residual of the best one before it. *Guess*:
/// half a per cent is no difference, and the first one follows friction, as most drives do.
const CLEARLY_BETTER: f64 = 0.995;
/// The same for the smooth model, which leaves the flank uncertain far beyond friction. *Guess*: a cause not yet known
/// may look like a clearance that is crossed slowly, and leaves less of the residual by itself.
const FAR_BETTER: f64 = 0.8;
/// Share of its squares below which hardly anything of a column is its own. *Guess*: what is left where a drive turns.
const HARDLY_OWN: f64 = 0.1;
/// Spread of what stays as stated in these rows, and may not in others that a fit predicts: by definition none.
pub(super) const HELD: f64 = f64::MIN_POSITIVE;
/// Rows are uncertain where the torque is below this multiple of friction. *Guess*: friction of a unit is known to a
/// quarter.
pub(super) const NEAR_FRICTION: f64 = 1.25;
/// Nor is a flank sure below this share of the largest load, for the rated one. *Source*: a catalogue's lost motion is
/// that between loads of 4 % of the rated one, either way (Hrcek et al., Materials 14 (2021) 5057).
const SETTLES: f64 = 0.04;
/// A clearance is crossed within this time, s. *Guess*: twice the longest of [`FLANK_S`].
const CROSSING_S: f64 = 0.08;
/// A clearance may be this many times as wide as the nominal one before anything else is known. *Guess*: wear and
/// tolerances rarely add more than half.
pub(super) const WIDER: f64 = 1.6;
/// If more of the rows than this are uncertain, none is set aside: then they are what the data are about. *Guess*: two
/// thirds of the rows are enough to fit.
const UNCERTAIN_AT_MOST: f64 = 0.35;

impl Base {
    /// The nominal model over the rows; `table` takes the place of its parts where it is given.
    pub fn new(rows: &Rows, nominal: &Nominal, table: Option<&Table<'_>>) -> Base {
        Base::of_laws(rows, nominal, table, &PlayLaw::ALL)
    }

    /// The base model with the law of the play known.
    pub(crate) fn with_play(rows: &Rows, nominal: &Nominal, table: Option<&Table<'_>>, law: PlayLaw) -> Base {
        Base::of_laws(rows, nominal, table, &[law])
    }

    fn of_laws(rows: &Rows, nominal: &Nominal, table: Option<&Table<'_>>, laws: &[PlayLaw]) -> Base {
        let wind_up: Vec<f64> = rows.torque.iter().map(|t| nominal.wind_up_arcsec(*t)).collect();
        let harmonics: Vec<f64> = rows.generator.iter().map(|psi| nominal.harmonics_arcsec(*psi)).collect();
        let half_backlash = 0.5 * nominal.backlash_arcsec;
        let used: Vec<usize> = rows.sessions_used().flatten().collect();
        let free = of_any_drive(rows, &used);
        let mut best: Option<(f64, PlayLaw, Vec<f64>)> = None;
        for &law in laws {
            let flank = law.flanks(rows, &rows.torque, nominal);
            let left: Vec<f64> =
                (0..rows.len()).map(|k| rows.error[k] - harmonics[k] - wind_up[k] - half_backlash * flank[k]).collect();
            let spread = middle_spread(&left, nominal.friction_torque_n_m, rows, (&used, &free));
            // A cause not yet known may look like a clearance that is not crossed at once.
            let needed = if law == PlayLaw::Smooth { FAR_BETTER } else { CLEARLY_BETTER };
            if best.as_ref().is_none_or(|(least, _, _)| spread < needed * least) {
                best = Some((spread, law, flank));
            }
        }
        let (law, flank) = best.map_or((PlayLaw::Held, Vec::new()), |(_, law, flank)| (law, flank));
        let prediction: Vec<f64> = match table {
            Some(table) => predicted_by_table(rows, &rows.torque, table),
            None => (0..rows.len()).map(|k| harmonics[k] + wind_up[k] + half_backlash * flank[k]).collect(),
        };
        let mut floating = vec![Floating { name: "zero".into(), values: vec![1.0; rows.len()], spread: FREE }];
        floating.extend(zeros(rows).map(|values| Floating { name: "zero".into(), values, spread: FREE }));
        let mut add = |name: &str, values: Vec<f64>, spread: f64| {
            if spread > 0.0 && values.iter().any(|v| *v != 0.0) {
                floating.push(Floating { name: name.into(), values, spread });
            }
        };
        // Where angles are read at other instants than is known, their mean may be off, too: that is the logger's.
        let late = rows.speed.iter().map(|speed| -speed * ARCSEC_PER_RAD / nominal.ratio);
        add(BETWEEN_READINGS, late.collect(), rows.unsure_s);
        // No output is on its other flank at once.
        if rows.recorded.time {
            for lag_s in FLANK_S {
                let reached = rows.lagged(&flank, lag_s, false).into_iter().zip(&flank);
                let per_s = reached.map(|(reached, flank)| half_backlash * (reached - flank) / lag_s);
                add(CHANGE_OF_FLANK, per_s.collect(), lag_s);
            }
        }
        // Nor does a catalogue print the drag of the output, which winds a drive up against its motion: by as much
        // under every load, as lost motion is, or less where the load has made it stiffer. Of a friction that is stated
        // the rows say whether it does; they do not where the motion alone chooses the flank.
        let stated_n_m = nominal.friction_torque_n_m;
        // As far as friction takes a spring it may have another slope than where the load alone would.
        let by_n_m = -nominal.ratio.signum() * if stated_n_m > 0.0 { stated_n_m } else { 1.0 };
        let winds = |torque: f64, way: &f64| {
            (nominal.wind_up_arcsec(torque + by_n_m * way) - nominal.wind_up_arcsec(torque)) / by_n_m.abs()
        };
        let against: Vec<f64> = rows.direction.iter().map(|way| winds(0.0, way)).collect();
        let under_load = rows.torque.iter().zip(&rows.direction).map(|(torque, way)| winds(*torque, way)).collect();
        let (drag_n_m, winds_up) = if nominal.teeth.is_none() || stated_n_m == 0.0 {
            (DRAG_OF_LOAD * rows.load_scale(), true)
        } else {
            let of = |column: &[f64]| -> Vec<f64> { used.iter().map(|k| column[*k]).collect() };
            let loaded = free.beyond([of(&wind_up), of(&flank)]);
            let freed = |column: &[f64]| loaded.freed(free.freed(of(column)));
            let (left, drag, all) = (freed(&less(&rows.error, &prediction)), freed(&against), of(&against));
            let fewer = stated_n_m * (2.0 * dot(&left, &drag) - stated_n_m * dot(&drag, &drag));
            let by_motion = dot(&drag, &drag) < HARDLY_OWN * dot(&all, &all);
            (stated_n_m, by_motion || fewer > (1.0 - CLEARLY_BETTER) * dot(&left, &left))
        };
        for column in [against, under_load] {
            add("drag", column, if winds_up { drag_n_m } else { HELD });
        }
        add("stiffness", wind_up.clone(), nominal.spread.stiffness);
        // Of a spring that nobody has stated nothing says how it hardens, nor, where a load goes with the angle of the
        // output, what of the error is the spring's.
        if nominal.teeth.is_none() && nominal.spread.stiffness >= UNSTATED {
            let scale = rows.load_scale().max(f64::MIN_POSITIVE);
            let waves = waves_of_load(rows);
            let (powers, spread) = if waves.is_some() { (POWERS, nominal.spread.stiffness) } else { (1, HARDENING) };
            for power in 1..=powers {
                let harder = |(arcsec, torque): (&f64, &f64)| arcsec * (torque.abs() / scale).powi(power);
                add("stiffness under load", wind_up.iter().zip(&rows.torque).map(harder).collect(), spread);
            }
            for wave in waves.into_iter().flatten() {
                add(WAVE_OF_LOAD, wave, FREE);
            }
        }
        add("backlash", flank.iter().map(|p| half_backlash * p).collect(), nominal.spread.backlash);
        for harmonic in &nominal.harmonics {
            let wave = |shift: f64| -> Vec<f64> {
                let at = |psi: &f64| harmonic.order_per_generator_turn * psi + harmonic.phase_rad + shift;
                rows.generator.iter().map(|psi| harmonic.amplitude_arcsec * at(psi).sin()).collect()
            };
            add("harmonic", wave(0.0), nominal.spread.harmonic);
            // A wave a quarter of a period ahead turns the phase. It floats with the amplitude: they are read as a
            // pair.
            let turns = nominal.spread.harmonic_phase_rad.max(LEAST_TURN * nominal.spread.harmonic);
            add("harmonic", wave(std::f64::consts::FRAC_PI_2), turns);
        }
        let uncertain = uncertain(rows, nominal, (law, &flank), winds_up);
        Base { prediction, flank, wind_up, half_backlash, law, floating, waves: Waves::default(), uncertain }
    }
}

impl Base {
    /// A copy to be changed, without what floats.
    pub(super) fn without_floating(&self) -> Base {
        Base { waves: self.waves.clone(), ..self.each(<[f64]>::to_vec) }
    }

    /// With each column changed by `of`, without what floats, and without the waves of its rows.
    pub(super) fn each(&self, of: impl Fn(&[f64]) -> Vec<f64>) -> Base {
        Base {
            prediction: of(&self.prediction),
            flank: of(&self.flank),
            wind_up: of(&self.wind_up),
            half_backlash: self.half_backlash,
            law: self.law,
            floating: Vec::new(),
            waves: Waves::default(),
            uncertain: Vec::new(),
        }
    }

    /// Flanks, wind-up and prediction under the torque that `rows` have now.
    pub(super) fn load_with(&mut self, rows: &Rows, nominal: &Nominal) {
        let flank = self.law.flanks(rows, &rows.torque, nominal);
        for k in 0..rows.len() {
            let wind_up = nominal.wind_up_arcsec(rows.torque[k]);
            self.prediction[k] += wind_up - self.wind_up[k] + self.half_backlash * (flank[k] - self.flank[k]);
            self.wind_up[k] = wind_up;
        }
        self.flank = flank;
    }
}

/// Steps to the zero of each session that has one of its own.
fn zeros(rows: &Rows) -> impl Iterator<Item = Vec<f64>> + '_ {
    let begins = rows.zeros.iter().map(|session| rows.sessions[*session].start);
    begins.map(|from| (0..rows.len()).map(|k| f64::from(u8::from(k >= from))).collect())
}

/// What any drive may have, whatever its play does, and what would decide between the laws of the play: a zero, a late
/// reading, a wrong ratio and waves of the output, over the rows that are learnt from.
fn of_any_drive(rows: &Rows, used: &[usize]) -> FreeSpan {
    let of = |column: &[f64]| -> Vec<f64> { used.iter().map(|k| column[*k]).collect() };
    let any = zeros(rows).map(|zero| of(&zero)).chain([vec![1.0; used.len()], of(&rows.speed), of(&rows.output)]);
    FreeSpan::default().beyond(any.chain([1.0, 2.0].iter().flat_map(|k| waves(*k, &rows.output, used))))
}

/// First waves of the output, where the load is one of its angle, as the weight of an arm: then they and a spring are
/// one.
fn waves_of_load(rows: &Rows) -> Option<Vec<Vec<f64>>> {
    let [sine, cosine] = waves(1.0, &rows.output, &(0..rows.len()).collect::<Vec<usize>>());
    let by_angle = [vec![1.0; rows.len()], sine, cosine];
    let varies = about_mean(&rows.torque) > SAME_TORQUE * rows.load_scale();
    let goes = correlation(&rows.torque, &by_angle) > TURNS_WITH_THE_OUTPUT;
    (varies && goes).then(|| by_angle[1..].to_vec())
}

/// Sum of squares that a law of the play leaves where the torque is around friction, freed of that.
fn middle_spread(left: &[f64], friction: f64, rows: &Rows, (used, free): (&[usize], &FreeSpan)) -> f64 {
    let left = free.freed(used.iter().map(|k| left[*k]).collect());
    let inside = used.iter().zip(left).filter(|(k, _)| rows.torque[**k].abs() <= friction);
    inside.map(|(_, left)| left.powi(2)).sum()
}

/// What a table predicts over the rows under a torque, arcsec.
pub(super) fn predicted_by_table(rows: &Rows, torque: &[f64], table: &Table<'_>) -> Vec<f64> {
    let mut predicted = vec![0.0; rows.len()];
    for session in &rows.sessions {
        let states = session.clone().map(|k| [rows.generator[k], torque[k], rows.temperature[k]]);
        for (predicted, said) in predicted[session.clone()].iter_mut().zip(by_core(table, states)) {
            *predicted = f64::from(said.transmission_error_rad) * ARCSEC_PER_RAD;
        }
    }
    predicted
}

fn uncertain(rows: &Rows, nominal: &Nominal, (law, flank): (PlayLaw, &[f64]), drags: bool) -> Vec<bool> {
    // Where hardly any load says which flank carries, the motion does, or nothing says it but at the beginning.
    // Sessions without a load are set aside as a whole, unless too little is left then.
    let ways: [&dyn Fn() -> Option<Vec<bool>>; 4] = [
        &|| Some(uncertain_by_load(rows, nominal, flank, drags)),
        &|| (law == PlayLaw::Pushed).then(|| uncertain_by_motion(rows, nominal)),
        &|| Some(uncertain_at_first(rows, nominal, true)),
        &|| Some(uncertain_at_first(rows, nominal, false)),
    ];
    let found = ways.iter().filter_map(|way| way()).find(|uncertain| few(uncertain));
    found.unwrap_or_else(|| vec![false; rows.len()])
}

/// Rows of a session before the first load that says which flank carries: nobody knows where the drive was left. Of a
/// session that nothing loads these are all, if such sessions count.
fn uncertain_at_first(rows: &Rows, nominal: &Nominal, unloaded_too: bool) -> Vec<bool> {
    let mut uncertain = vec![false; rows.len()];
    for session in &rows.sessions {
        let loaded = session.clone().find(|k| rows.torque[*k].abs() > nominal.friction_torque_n_m);
        let never = if unloaded_too { session.end } else { session.start };
        uncertain[session.start..loaded.unwrap_or(never)].fill(true);
    }
    uncertain
}

/// Whether so few rows are uncertain that they can be set aside.
pub(super) fn few(uncertain: &[bool]) -> bool {
    let share = uncertain.iter().filter(|u| **u).count() as f64 / uncertain.len().max(1) as f64;
    share <= UNCERTAIN_AT_MOST
}

/// Rows before the generator has pushed the output to a flank, wherever it stood and were the clearance [`WIDER`].
fn uncertain_by_motion(rows: &Rows, nominal: &Nominal) -> Vec<bool> {
    let from = |begun: f64, wider: f64| PlayLaw::Pushed.flanks_from(|_| begun, wider, rows, &rows.torque, nominal);
    let all = [from(1.0, 1.0), from(-1.0, 1.0), from(1.0, WIDER), from(-1.0, WIDER)];
    let carries = |flank: f64| if flank.abs() < 0.999 { 0.0 } else { flank.signum() };
    (0..rows.len())
        .map(|k| {
            let first = carries(all[0][k]);
            first == 0.0 || all.iter().any(|flank| carries(flank[k]) != first)
        })
        .collect()
}

/// Rows after which a clearance is crossed.
pub(super) fn rows_of_crossing(rows: &Rows) -> usize {
    (CROSSING_S / rows.period).ceil().clamp(2.0, 50.0) as usize
}

/// Rows with a torque around friction, and those while the clearance is crossed.
fn uncertain_by_load(rows: &Rows, nominal: &Nominal, flank: &[f64], drags: bool) -> Vec<bool> {
    let settles = if nominal.backlash_arcsec > 0.0 { SETTLES * rows.load_scale() } else { 0.0 };
    let near = settles.max(NEAR_FRICTION * nominal.friction_torque_n_m);
    let mut uncertain: Vec<bool> =
        (0..rows.len()).map(|k| rows.torque[k].abs() <= near || flank[k].abs() < 0.999).collect();
    for session in &rows.sessions {
        for k in session.start + 1..session.end {
            // What an output's drag winds up is crossed where the drive turns.
            if flank[k] * flank[k - 1] < 0.0 || drags && rows.direction[k] != rows.direction[k - 1] {
                let around = k.saturating_sub(2).max(session.start)..(k + 1 + rows_of_crossing(rows)).min(session.end);
                uncertain[around].fill(true);
            }
        }
    }
    uncertain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;

    #[test]
    fn the_flank_of_a_clearance_is_sure_from_four_per_cent_of_the_load_on() {
        let session = Session {
            generator_rad: (0..1001).map(|k| 0.1 * f64::from(k)).collect(),
            error_rad: vec![0.0; 1001],
            torque_n_m: Some((0..1001).map(|k| 0.02 * f64::from(k) - 10.0).collect()),
            ..Session::default()
        };
        let uncertain = |backlash_arcsec: f64| {
            let play = Nominal { backlash_arcsec, friction_torque_n_m: 0.0, ..crate::synthesize::catalogue_drive() };
            let rows = Rows::new(std::slice::from_ref(&session), &play);
            Base::new(&rows, &play, None).uncertain.iter().filter(|uncertain| **uncertain).count()
        };
        // Of 9.8 N·m, which 98 % of the rows do not exceed.
        assert_eq!((uncertain(60.0), uncertain(0.0)), (39, 5));
    }

    #[test]
    fn nobody_knows_the_flank_before_the_first_load_or_without_one() {
        let nominal = crate::synthesize::catalogue_drive();
        let rows = 10;
        let session = |torque: Vec<f64>| Session {
            line: (0..rows as u64).collect(),
            generator_rad: (0..rows).map(|k| 0.1 * k as f64).collect(),
            error_rad: vec![0.0; rows],
            time_s: Some((0..rows).map(|k| 0.01 * k as f64).collect()),
            torque_n_m: Some(torque),
            ..Session::default()
        };
        let load = 3.0 * nominal.friction_torque_n_m;
        let late = (0..rows).map(|k| if k < 4 { 0.0 } else { -load }).collect();
        let rows = Rows::new(&[session(late), session(vec![0.0; rows]), session(vec![load; rows])], &nominal);
        let first = |unloaded_too: bool| -> Vec<usize> {
            let uncertain = uncertain_at_first(&rows, &nominal, unloaded_too);
            rows.sessions.iter().map(|session| uncertain[session.clone()].iter().filter(|u| **u).count()).collect()
        };
        assert_eq!(first(true), [4, 10, 0]);
        assert_eq!(first(false), [4, 0, 0]);
    }
}
