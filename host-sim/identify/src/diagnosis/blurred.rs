//! Rows that are means over some time: a logger that reads often and writes the mean, or that filters angles and torque
//! alike.
//!
//! What bends within that time comes out round. The output goes to its other flank over it, and begins to before the
//! load has changed its side, which a drive, which follows its load, never does; and waves of the generator fade with
//! the speed, by the sine of half the angle that they turn in that time over that half angle. Where both say the same
//! time, and no flank that takes a while, nor a torque that is read late, does as well, the rows are means. What the
//! means take of what the model says is put back then; what has no model stays round.

use std::borrow::Cow;

use flexspline::Table;

use super::base::PlayLaw;
use super::channels::{report, sample, smooth_span, waves};
use super::flank_lag::behind;
use super::rows::{Rows, combined, rms};
use super::torque_zero::{SAMPLE, by_block, is_certain, sum};
use crate::least_squares::FreeSpan;
use crate::linear::{Gram, Prior, solve};
use crate::measurement::{FaultName, Measures, Recording, Treatment};
use crate::nominal::Nominal;
use flexspline_base::units::ARCSEC_PER_RAD;

/// Fewest rows. *Guess*: some forty to each of the blocks that are compared.
const LEAST_ROWS: usize = 1000;
/// Times that are tried, s: the shortest and the longest. *Guess*: beyond, a mean shows nowhere, or everywhere.
const TIMES_S: [f64; 2] = [5e-3, 0.2];
/// Each time that is tried is this multiple of the one before. *Guess*: four to an octave (2^¼).
const LONGER: f64 = 1.19;
/// No time that is shorter than this many periods of the rows is tried. *Guess*: a mean over less than a period is as
/// good as one instant.
const LEAST_PERIODS: f64 = 0.9;
/// Steps to a row with which a mean over rows is taken. *Guess*: straight lines between rows need few.
const STEPS: f64 = 4.0;
/// Times, s, that a change of flank may take instead. *Guess*: an octave apart, from the usual one on.
const LAGS_S: [f64; 4] = [5e-3, 0.01, 0.02, 0.04];
/// Times, s, by which the torque may be read late (positive) or early instead. *Guess*: as long as half of the longest
/// mean.
const LATE_S: [f64; 8] = [-0.1, -0.05, -0.02, -0.005, 0.005, 0.02, 0.05, 0.1];
/// Means leave no more than this share of what is left by the best of these, … *Chosen* between perfect drives, 0.93
/// and more, and those whose rows are means over 40 to 80 ms, mostly 0.91 and less, of a plant that somebody else
/// wrote.
const LEAVE: f64 = 0.92;
/// … of what is left where flanks alone are round, and where waves alone fade, … *Chosen* on the same: of flanks alone
/// 0.996 and more without means, 0.95 and less with them.
const LEAVE_OF_EACH: f64 = 0.97;
/// … for certain, by this many standard deviations of the blocks' means. *Guess*.
const CERTAIN: f64 = 3.0;

/// How a row comes about.
#[derive(Clone, Copy, PartialEq)]
enum Read {
    /// At one instant.
    AtOnce,
    /// The mean over this many seconds.
    Mean(f64),
    /// The same of what follows the load alone.
    MeanOfLoad(f64),
    /// The same of the waves of the generator alone.
    MeanOfWaves(f64),
    /// At one instant; flanks take this many seconds.
    Lag(f64),
    /// The torque by this many seconds later than the angles.
    Late(f64),
}

/// Rows, and what floats in any drive: columns at the places, each free of those before it.
struct Held<'a> {
    rows: &'a Rows,
    nominal: &'a Nominal,
    places: Vec<usize>,
    free: FreeSpan,
    error: Vec<f64>,
    /// Sine and cosine of each harmonic at the places.
    waves: Vec<Vec<f64>>,
}

impl<'a> Held<'a> {
    fn new(rows: &'a Rows, nominal: &'a Nominal) -> Held<'a> {
        let places = sample(rows, SAMPLE);
        let waves_at_places = waves_at(rows, nominal, &places);
        // The form of a generator repeats from tooth to tooth, another one on each flank, and is as large as what means
        // take.
        let mut mesh_by_side = Vec::new();
        if let Some(teeth) = nominal.teeth {
            let mesh = waves(f64::from(teeth.flexspline), &rows.on_flexspline, &places);
            let by_side = |wave: &Vec<f64>| -> Vec<f64> {
                wave.iter().zip(&places).map(|(v, k)| v * rows.torque[*k].signum()).collect()
            };
            mesh_by_side = mesh.iter().map(by_side).collect();
            mesh_by_side.extend(mesh);
        }
        let smooth = Nominal { harmonics: Vec::new(), ..nominal.clone() };
        let free = smooth_span(rows, &smooth, &places, mesh_by_side);
        let error = free.freed(places.iter().map(|k| rows.error[*k]).collect());
        Held { rows, nominal, places, free, error, waves: waves_at_places }
    }

    /// What the model says, column by column at some rows, arcsec: the waves of its harmonics (`waves` at these rows),
    /// wind-up, flank.
    fn columns(&self, law: PlayLaw, read: Read, at: &[usize], waves: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let (rows, nominal) = (self.rows, self.nominal);
        let mut columns = Vec::new();
        for (harmonic, pair) in nominal.harmonics.iter().zip(waves.chunks(2)) {
            let share = |k: usize| match read {
                Read::Mean(s) | Read::MeanOfWaves(s) => {
                    sinc(0.5 * harmonic.order_per_generator_turn * rows.speed[k] * s)
                }
                _ => 1.0,
            };
            let amplitude: Vec<f64> = at.iter().map(|k| harmonic.amplitude_arcsec * share(*k)).collect();
            columns.extend(pair.iter().map(|wave| amplitude.iter().zip(wave).map(|(a, wave)| a * wave).collect()));
        }
        let shifted = match read {
            Read::Late(s) => Cow::Owned(shifted(rows, s)),
            _ => Cow::Borrowed(&rows.torque),
        };
        let half = 0.5 * nominal.backlash_arcsec;
        let flank = law.flanks(rows, &shifted, nominal);
        let mut play: Vec<f64> = flank.iter().map(|flank| half * flank).collect();
        let wind_up = |k: usize| nominal.wind_up_arcsec(shifted[k]);
        let wound: Vec<f64> = match read {
            Read::Mean(s) | Read::MeanOfLoad(s) => {
                let wound: Vec<f64> = (0..rows.len()).map(wind_up).collect();
                columns.extend([averaged(rows, &wound, s, at), averaged(rows, &play, s, at)]);
                return columns;
            }
            _ => at.iter().map(|k| wind_up(*k)).collect(),
        };
        if let Read::Lag(s) = read {
            play.iter_mut().zip(behind(rows, &flank, half, s)).for_each(|(play, late)| *play += late);
        }
        columns.extend([wound, at.iter().map(|k| play[*k]).collect()]);
        columns
    }

    /// How much is left, block by block: the sum of the magnitudes.
    fn left(&self, law: PlayLaw, read: Read) -> Vec<f64> {
        let said = self.free.beyond(self.columns(law, read, &self.places, &self.waves));
        by_block(&said.freed(self.error.clone()))
    }

    /// What means over `s` seconds take of what the model says, in all rows, arcsec; sizes are those that the rows
    /// tell.
    fn taken(&self, law: PlayLaw, s: f64) -> Option<Vec<f64>> {
        let all: Vec<usize> = (0..self.rows.len()).collect();
        let waves = waves_at(self.rows, self.nominal, &all);
        let [means, at_once] = [Read::Mean(s), Read::AtOnce].map(|read| self.columns(law, read, &all, &waves));
        let freed: Vec<Vec<f64>> =
            means.iter().map(|column| self.free.freed(self.places.iter().map(|k| column[*k]).collect())).collect();
        let views: Vec<&[f64]> = freed.iter().chain([&self.error]).map(Vec::as_slice).collect();
        // Each column is as large as the model says: its size is about one.
        let priors = vec![Prior { mean: 0.0, std: 1e2 }; freed.len()];
        let sizes = solve(&Gram::of(&views, 0..self.error.len()), &priors, 1.0)?.coefficients;
        let apart: Vec<Vec<f64>> = at_once
            .iter()
            .zip(&means)
            .map(|(at_once, mean)| at_once.iter().zip(mean).map(|(a, m)| a - m).collect())
            .collect();
        Some(combined(self.rows.len(), apart.iter().map(Vec::as_slice), &sizes))
    }
}

/// sin x / x.
fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 { 1.0 } else { x.sin() / x }
}

/// Sine and cosine of each harmonic at some rows.
fn waves_at(rows: &Rows, nominal: &Nominal, at: &[usize]) -> Vec<Vec<f64>> {
    nominal
        .harmonics
        .iter()
        .flat_map(|harmonic| waves(harmonic.order_per_generator_turn, &rows.generator, at))
        .collect()
}

/// Means over this many seconds about some rows, which are in order, between rows by straight lines, at the ends of a
/// session of what there is.
fn averaged(rows: &Rows, values: &[f64], s: f64, at: &[usize]) -> Vec<f64> {
    let wide = s / rows.period;
    let steps = (STEPS * wide).ceil().max(STEPS) as usize;
    let mut sessions = rows.sessions.iter().filter(|session| !session.is_empty());
    let mut session = 0..0;
    let mean = |k: &usize| {
        if *k >= session.end {
            session = sessions.find(|session| *k < session.end).cloned().unwrap_or(0..values.len());
        }
        let (first, last) = (session.start as f64, (session.end - 1) as f64);
        let at = |step: usize| {
            let place = *k as f64 + wide * ((step as f64 + 0.5) / steps as f64 - 0.5);
            let place = place.clamp(first, last);
            let below = place as usize;
            let share = place - below as f64;
            values[below] + share * (values[(below + 1).min(session.end - 1)] - values[below])
        };
        (0..steps).map(at).sum::<f64>() / steps as f64
    };
    at.iter().map(mean).collect()
}

/// The torque of this many seconds later, held at the ends of a session.
fn shifted(rows: &Rows, s: f64) -> Vec<f64> {
    let by = s / rows.period;
    let mut shifted = vec![0.0; rows.len()];
    for session in rows.sessions.iter().filter(|session| !session.is_empty()) {
        for k in session.clone() {
            let place = (k as f64 + by).clamp(session.start as f64, (session.end - 1) as f64);
            let (below, share) = (place.floor() as usize, place - place.floor());
            let above = rows.torque[(below + 1).min(session.end - 1)];
            shifted[k] = rows.torque[below] + share * (above - rows.torque[below]);
        }
    }
    shifted
}

/// The time over which rows are means, s, and the law of the play that tells them so.
fn find(held: &Held<'_>) -> Option<(f64, PlayLaw)> {
    let laws = [PlayLaw::Held, PlayLaw::Pushed, PlayLaw::Sign];
    let least = |read: Read| laws.map(|law| sum(&held.left(law, read))).into_iter().fold(f64::INFINITY, f64::min);
    let at_once = least(Read::AtOnce);
    let shortest = TIMES_S[0].max(LEAST_PERIODS * held.rows.period);
    let times = std::iter::successors(Some(shortest), |s| Some(s * LONGER)).take_while(|s| *s <= TIMES_S[1]);
    // The law that friction makes of the play is the one that most drives have; the others are tried where it tells
    // enough.
    let tried = times.map(|s| (s, sum(&held.left(PlayLaw::Held, Read::Mean(s)))));
    let (s, left) = tried.min_by(|a, b| a.1.total_cmp(&b.1))?;
    if left > LEAVE * at_once {
        return None;
    }
    let law = laws.into_iter().min_by(|a, b| {
        let left = |law: PlayLaw| sum(&held.left(law, Read::Mean(s)));
        left(*a).total_cmp(&left(*b))
    })?;
    let means = held.left(law, Read::Mean(s));
    let far_less = |than: f64| sum(&means) <= LEAVE * than;
    let smooth = sum(&held.left(PlayLaw::Smooth, Read::AtOnce));
    if !far_less(smooth) || !LAGS_S.into_iter().all(|lag| far_less(least(Read::Lag(lag)))) {
        return None;
    }
    if !LATE_S.into_iter().all(|late| far_less(least(Read::Late(late)))) {
        return None;
    }
    // Flanks and waves have to say it each by itself.
    let (of_load, of_waves) = (held.left(law, Read::MeanOfLoad(s)), held.left(law, Read::MeanOfWaves(s)));
    let says = |without: &[f64]| sum(&means) <= LEAVE_OF_EACH * sum(without) && is_certain(without, &means, CERTAIN);
    (says(&of_load) && says(&of_waves)).then_some((s, law))
}

/// Finds rows that are means, names them, and puts back what that takes of what the model says.
pub(super) fn check(recording: &mut Recording, nominal: &Nominal, table: Option<&Table<'_>>) {
    // A table does not say its waves by their orders.
    if table.is_some() || nominal.harmonics.is_empty() || nominal.backlash_arcsec == 0.0 {
        return;
    }
    let rows = Rows::new(&recording.sessions, nominal);
    if !rows.recorded.time || !rows.recorded.torque || rows.count_used() < LEAST_ROWS {
        return;
    }
    let held = Held::new(&rows, nominal);
    let Some((s, law)) = find(&held) else { return };
    let Some(taken) = held.taken(law, s) else { return };
    let mut each = taken.iter();
    for error in recording.sessions.iter_mut().flat_map(|session| &mut session.error_rad) {
        *error += each.next().copied().unwrap_or(0.0) / ARCSEC_PER_RAD;
    }
    recording.sessions.iter_mut().for_each(|session| session.mean_over_s = s);
    let what = format!(
        "rows are means over about {:.0} ms: the output goes to its other flank over that time, and begins to before \
         the load has changed its side, and waves of the generator fade with the speed as in such means; what that \
         takes of what the model says was put back, and a load that swings is not looked for",
        1e3 * s
    );
    if let Some(fault) = report(recording, FaultName::AveragedRows, Treatment::Repaired, rms(&taken), what) {
        fault.channel = None;
        fault.measures = Measures { size_ms: Some(1e3 * s), ..Measures::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::{Fault, Session};
    use crate::synthesize::catalogue_drive;

    /// A drive as its catalogue says, every millisecond, that turns to and fro at up to 42 rad/s under a load that
    /// swings, with a flank that takes `lag_s`; read every 10 ms, as means over `mean_s`, with 1.5 arcsec and
    /// `torque_noise` N·m of noise, the torque `late_s` late.
    fn recording(nominal: &Nominal, mean_s: f64, lag_s: f64, late_s: f64, torque_noise: f64) -> Recording {
        let mut random = fastrand::Rng::with_seed(3);
        let mut gauss = move || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
        let (mut side, mut flank) = (1.0, 1.0);
        let load = |t: f64| 24.0 * (2.6 * t).sin() + 9.0 * (5.4 * t).cos();
        let fine: Vec<[f64; 3]> = (0..121_000)
            .map(|k| {
                let t = 1e-3 * f64::from(k);
                let psi = 60.0 * (0.7 * t).sin();
                if load(t).abs() > nominal.friction_torque_n_m {
                    flank = load(t).signum();
                }
                side += (flank - side) * (1.0 - f64::exp(-1e-3 / lag_s));
                let error = nominal.harmonics_arcsec(psi)
                    + nominal.wind_up_arcsec(load(t))
                    + 0.5 * nominal.backlash_arcsec * side;
                [psi, error, load(t - late_s)]
            })
            .collect();
        let half = (500.0 * mean_s).round() as usize;
        let mut session = Session { time_s: Some(Vec::new()), torque_n_m: Some(Vec::new()), ..Session::default() };
        for k in (500..120_500).step_by(10) {
            let about = &fine[k - half..=k + half];
            let mean = |column: usize| about.iter().map(|row| row[column]).sum::<f64>() / about.len() as f64;
            session.line.push(k as u64 / 10 + 2);
            session.generator_rad.push(mean(0));
            session.error_rad.push((mean(1) + 1.5 * gauss()) / ARCSEC_PER_RAD);
            session.time_s.as_mut().unwrap().push(1e-3 * k as f64);
            session.torque_n_m.as_mut().unwrap().push(mean(2) + torque_noise * gauss());
        }
        Recording {
            file: "made.csv".into(),
            rows: session.len(),
            sessions: vec![session],
            faults: Vec::new(),
            tooth_steps: Vec::new(),
            notes: Vec::new(),
            unusable: None,
        }
    }

    /// The fault found, and how far the error is from that of rows read at once then, arcsec rms.
    fn checked(mean_s: f64, lag_s: f64, late_s: f64, torque_noise: f64) -> (Option<Fault>, f64) {
        let nominal = catalogue_drive();
        let mut means = recording(&nominal, mean_s, lag_s, late_s, torque_noise);
        let at_once = recording(&nominal, 0.0, lag_s, late_s, torque_noise);
        check(&mut means, &nominal, None);
        let pairs = means.sessions[0].error_rad.iter().zip(&at_once.sessions[0].error_rad);
        let off: Vec<f64> = pairs.map(|(a, b)| (a - b) * ARCSEC_PER_RAD).collect();
        (means.faults.pop(), rms(&off))
    }

    #[test]
    fn rows_that_are_means_are_told_with_their_time_and_what_they_take_is_put_back() {
        for mean_s in [0.04, 0.08, 0.12] {
            let (fault, off) = checked(mean_s, 4e-3, 0.0, 0.0);
            let fault = fault.expect("a fault");
            assert_eq!((fault.name, fault.treatment), (FaultName::AveragedRows, Treatment::Repaired));
            let found = fault.measures.size_ms.unwrap();
            assert!((found / (1e3 * mean_s) - 1.0).abs() < 0.25, "{found} ms for {mean_s} s");
            assert!(off < 0.5 * fault.size_arcsec.unwrap(), "{off} of {:?} are left", fault.size_arcsec);
        }
    }

    #[test]
    fn a_slow_flank_a_late_torque_and_a_noisy_one_are_no_means() {
        for (lag_s, late_s, torque_noise) in
            [(1e-4, 0.0, 0.0), (4e-3, 0.0, 0.0), (0.03, 0.0, 0.0), (4e-3, 0.03, 0.0), (4e-3, 0.0, 0.6)]
        {
            assert_eq!(checked(0.0, lag_s, late_s, torque_noise).0, None, "{lag_s} {late_s} {torque_noise}");
        }
    }
}
