//! What has to be known before causes are compared: how noisy the data are, and where they jump.

use std::f64::consts::PI;

use flexspline::Table;
use rayon::prelude::*;

use super::LEAST_ROWS;
use super::base::{Base, Floating, NEAR_FRICTION, few};
use super::candidate::{Excitation, Law, Regressor, Tolerance};
use super::model::{Problem, Term};
use super::noise::{Noise, Whitener, white_level};
use super::report::Finding;
use super::rows::{Rows, add_scaled, combined, quantile, rms, robust_std};
use crate::linear::{Gram, Prior, solve};
use crate::nominal::Nominal;
use flexspline_algebra::{Mat, eigen};
use flexspline_base::units::ARCSEC_PER_TURN;

/// Averages from which the drift of the noise is found, about. *Guess*: enough for correlation times of seconds in
/// recordings of minutes.
const WANDER_AVERAGES: usize = 2500;
/// Rows before and after a jump of which the medians are compared. *Guess*: a median of twelve has a third of the noise
/// of a row.
const BESIDE: usize = 12;
/// Least height of a jump, before anything else is known, arcsec. *Guess*: beyond clearance and wind-up, far below a
/// tooth pitch (6480 arcsec with 200 teeth).
const LEAST_JUMP: f64 = 1000.0;

/// The nominal model over the rows, and the jumps: these are taken out before the law of the play is chosen.
pub fn base(rows: &Rows, nominal: &Nominal, table: Option<&Table<'_>>) -> (Base, Vec<Jump>) {
    let base = Base::new(rows, nominal, table);
    let jumps = jumps(rows, &base, nominal);
    if jumps.is_empty() {
        return (base, jumps);
    }
    let mut level = rows.clone();
    for jump in &jumps {
        for (error, time) in level.error.iter_mut().zip(&rows.time) {
            *error -= jump.reached(*time);
        }
    }
    let play = Base::new(&level, nominal, table).law;
    (Base::with_play(rows, nominal, table, play), jumps)
}

/// A change of the error to another level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Jump {
    /// When it begins, has half its height, and is over, s.
    pub time_s: [f64; 3],
    /// Height, arcsec.
    pub height_arcsec: f64,
}

impl Jump {
    /// What it has added at a time (s), arcsec: all of it from where it has half its height on.
    pub fn reached(&self, time_s: f64) -> f64 {
        if time_s >= self.time_s[1] { self.height_arcsec } else { 0.0 }
    }
}

/// Where the error leaves for another level: at once, or, where that shows no whole pitches, while the wave passes
/// (half a turn of the generator): so long teeth take to climb over each other. Where the load rings after that, the
/// level is what it rings about.
pub fn jumps(rows: &Rows, base: &Base, nominal: &Nominal) -> Vec<Jump> {
    let left: Vec<f64> = rows.error.iter().zip(&base.prediction).map(|(e, p)| e - p).collect();
    let whole = |found: &[Jump]| {
        !found.is_empty() && found.iter().all(|jump| whole_pitches(nominal, jump.height_arcsec).is_some())
    };
    let at_once = jumps_within(rows, &left, 0.0, 0.0);
    if whole(&at_once) {
        return at_once;
    }
    let others = [(PI, 0.0), (0.0, RINGING_S), (PI, RINGING_S)];
    let mut found = others.iter().map(|(turned_rad, level_s)| jumps_within(rows, &left, *turned_rad, *level_s));
    found.find(|found| whole(found)).unwrap_or(at_once)
}

/// How many pitches of either wheel a jump is, if it is a whole number of them.
pub(crate) fn whole_pitches(nominal: &Nominal, height_arcsec: f64) -> Option<f64> {
    let teeth = nominal.teeth?;
    [teeth.circular_spline, teeth.flexspline].into_iter().find_map(|count| {
        let pitch = ARCSEC_PER_TURN / f64::from(count);
        let pitches = (height_arcsec / pitch).round();
        let near = (height_arcsec - pitches * pitch).abs() < PITCH_SHARE * pitch * pitches.abs() + PITCH_ARCSEC;
        (pitches != 0.0 && near).then_some(pitches)
    })
}

/// Jumps that are over after [`JUMPING_S`] and after the generator has turned by `turned_rad`, to the level of
/// `level_s` from there on.
fn jumps_within(rows: &Rows, left: &[f64], turned_rad: f64, level_s: f64) -> Vec<Jump> {
    let last = rows.len().saturating_sub(1);
    let middle = |range: std::ops::Range<usize>| quantile(range.map(|k| left[k]), 0.5);
    // First row of the level before, first row after the jump begins, row at rest, height.
    let mut found: Vec<[usize; 3]> = Vec::new();
    let mut heights: Vec<f64> = Vec::new();
    let mut before_gap: Option<usize> = None;
    for session in rows.sessions_used() {
        // Teeth slide into the next space, and the output swings out: what counts is where it comes to rest. At the end
        // of a recording the next one says where.
        let mut rest = session.start;
        for k in session.clone() {
            let from = k.saturating_sub(1).max(session.start);
            let over = |row: usize| {
                rows.time[row] - rows.time[from] >= JUMPING_S && rows.travel[row] - rows.travel[from] >= turned_rad
            };
            while rest < session.end && rest - from < MOST_ROWS_OF_A_JUMP && !over(rest) {
                rest += 1;
            }
            let begins =
                if k == session.start { before_gap } else { Some(k.saturating_sub(BESIDE).max(session.start)) };
            let (Some(begins), at_rest) = (begins, rest.min(last)) else { continue };
            if (left[at_rest] - left[k - 1]).abs() < 0.5 * LEAST_JUMP {
                continue;
            }
            let level = (at_rest..rows.len()).take_while(|row| {
                *row < at_rest + BESIDE || *row < session.end && rows.time[*row] < rows.time[at_rest] + level_s
            });
            let height = quantile(level.map(|row| left[row]), 0.5) - middle(begins..k);
            if height.abs() > LEAST_JUMP {
                found.push([begins, k, at_rest]);
                heights.push(height);
            }
        }
        before_gap = Some(session.end.saturating_sub(BESIDE).max(session.start));
    }
    // Rows one after another that see the same one: the one that sees the most of it; the first where all later ones
    // see it ring.
    let mut seen: Vec<(usize, usize)> = Vec::new();
    for k in 0..found.len() {
        let row = found[k][1];
        let same =
            |best: usize, latest: usize| row - latest < BESIDE || rows.time[row] - rows.time[found[best][1]] < level_s;
        match seen.last_mut() {
            Some((best, latest)) if same(*best, *latest) => {
                *latest = row;
                if level_s == 0.0 && heights[k].abs() > heights[*best].abs() {
                    *best = k;
                }
            }
            _ => seen.push((k, row)),
        }
    }
    seen.into_iter()
        .map(|(best, _)| {
            let ([begins, from, at_rest], height_arcsec) = (found[best], heights[best]);
            let level = middle(begins..from);
            let passed = |share: f64| {
                let beyond = |k: &usize| (left[*k] - level) * height_arcsec.signum() > share * height_arcsec.abs();
                rows.time[(from..=at_rest).find(beyond).unwrap_or(at_rest)]
            };
            Jump { time_s: [passed(0.02), passed(0.5), passed(0.98)], height_arcsec }
        })
        .collect()
}

/// Rows whose flank is not known well, with what the causes chosen add to the load, and those in which the output
/// `hung` in the clearance.
pub(crate) fn uncertain(on: &Excitation<'_>, terms: &[Term<'_>], hung: &[bool]) -> Vec<bool> {
    let mut uncertain = on.base.uncertain.clone();
    // A jump passes over some rows, and the output swings out.
    for jump in &on.scales.jumps {
        let ([begins, _, over], beside) = (jump.time_s, JUMPING_S.max(BESIDE as f64 * on.rows.period));
        for (doubtful, time) in uncertain.iter_mut().zip(&on.rows.time) {
            *doubtful |= (begins - beside..over + beside).contains(time);
        }
    }
    for others in [hung, &leaps_of_speed(on.rows)] {
        let mut with = uncertain.clone();
        with.iter_mut().zip(others).for_each(|(doubtful, other)| *doubtful |= other);
        if few(&with) {
            uncertain = with;
        }
    }
    let without = uncertain.clone();
    for term in terms {
        let Some(added) = term.law.load(on, &term.values()) else { continue };
        for (k, doubtful) in uncertain.iter_mut().enumerate() {
            let near = NEAR_FRICTION * on.nominal.friction_torque_n_m + LOAD_UNKNOWN * added[k].abs();
            *doubtful |= (on.rows.torque[k] + added[k]).abs() < near;
        }
    }
    if few(&uncertain) { uncertain } else { without }
}

/// Rows about a leap of the generator's speed, from one pace that is kept to another. What is read late, averaged or
/// filtered on the way follows a kept pace as one delay, whatever its kind. How it gets over a leap is of its kind,
/// which no law here tells: a few such rows, far from what a delay says, would decide against all others.
fn leaps_of_speed(rows: &Rows) -> Vec<bool> {
    let mut about = vec![false; rows.len()];
    for session in rows.sessions.iter().filter(|session| rows.recorded.time && session.len() > 2 * KEPT) {
        let pace: Vec<f64> = session.clone().skip(1).map(|k| pace_to(rows, k)).collect();
        // The step in which it leaps may hold some of both paces.
        for step in KEPT..pace.len() - KEPT {
            let (before, after) = (&pace[step - KEPT..step], &pace[step + 1..=step + KEPT]);
            let leap = after[0] - before[KEPT - 1];
            let kept = |paces: &[f64]| paces.iter().all(|pace| (pace - paces[0]).abs() < EVEN * leap.abs());
            let fastest = before[0].abs().max(after[0].abs());
            if leap.abs() > LEAP * fastest && kept(before) && kept(after) {
                let at = session.start + step;
                let over = |k: &usize| rows.time[*k] - rows.time[at] <= SETTLES_S;
                about[at..session.end]
                    .iter_mut()
                    .zip(at..)
                    .take_while(|(_, k)| over(k))
                    .for_each(|(row, _)| *row = true);
            }
        }
    }
    about
}

/// Speed of the generator from the row before to this one, rad/s.
fn pace_to(rows: &Rows, k: usize) -> f64 {
    let passed = rows.time[k] - rows.time[k - 1];
    if passed > 0.0 { (rows.generator[k] - rows.generator[k - 1]) / passed } else { f64::NAN }
}

/// A pace is kept where this number of steps one after another are it, … *Guess*.
const KEPT: usize = 4;
/// … each within this share of what it leaps by, … *Guess*.
const EVEN: f64 = 0.1;
/// … and a leap is a change by at least this share of the faster of the two. *Guess*: a ramp that rows resolve is none.
const LEAP: f64 = 0.2;
/// A reading has settled after a leap within this time, s. *Guess*: six time constants of a filter of 10 ms.
const SETTLES_S: f64 = 0.06;

/// Where a drive is found sound, no more than this share of its rows may have been set aside. *Guess*: by definition
/// most of them must count.
const MOST_SET_ASIDE: f64 = 0.5;

/// Why the rows that count say nothing of the unit, if too few of them do. What was found in spite of that is the
/// trouble itself, and stands as long as there are rows to judge it by.
pub(crate) fn too_few_left(problem: &Problem<'_>, finding: Finding) -> Option<String> {
    let rows = problem.on.rows;
    let used = rows.count_used();
    let left = rows.sessions_used().flatten().filter(|k| !problem.uncertain[*k]).count();
    let none_left = left < LEAST_ROWS || !problem.certain.contains(&true);
    let most_gone = left as f64 <= (1.0 - MOST_SET_ASIDE) * used as f64 && finding == Finding::NothingFound;
    if !none_left && !most_gone {
        return None;
    }
    let jumps = &problem.on.scales.jumps;
    let why = match jumps.iter().map(|jump| jump.height_arcsec.abs()).reduce(f64::max) {
        Some(largest) => {
            let often = if jumps.len() == 1 { "once".to_owned() } else { format!("{} times", jumps.len()) };
            format!("the error leaps {often}, by {largest:.0} arcsec at most, and rows about a leap do not count")
        }
        None => "nobody knows on which flank the drive stands in the others".to_owned(),
    };
    Some(format!("{left} of {used} rows are left to judge by: {why}"))
}

/// A jump is over after this time, s. *Guess*: teeth slide into the next space within tens of ms.
const JUMPING_S: f64 = 0.15;
/// Nor does a jump take more than this number of rows. *Guess*: it bounds the search.
const MOST_ROWS_OF_A_JUMP: usize = 2000;
/// A load rings about its new level for so long that its median is that level, s. *Guess*: a load that rings at a few
/// Hz has died down by then.
const RINGING_S: f64 = 4.0;
/// A jump is one of whole pitches within this share of its height, … *Guess*: pitches of a wheel are alike to far less.
const PITCH_SHARE: f64 = 0.004;
/// … and this many arcsec. *Guess*: so much the rest of the error may move meanwhile.
const PITCH_ARCSEC: f64 = 100.0;
/// A load that a cause adds is known to this share. *Guess*: as well as a load without a sensor is known.
const LOAD_UNKNOWN: f64 = 0.2;

/// Largest drift of the noise that is tried, in units of the white noise. *Guess*: a sensor that drifts farther is
/// none.
pub(super) const MOST_WANDER: f64 = 3.0;
/// Shortest correlation time of a drift that is tried, s. *Guess*: what is faster is a line, or a cause.
const FASTEST_S: f64 = 2.5;

/// Difference in evidence (natural logarithm of the ratio) within which two drifts are equally likely. *Guess*: odds of
/// 1.6 to 1 say nothing.
const AS_LIKELY: f64 = 0.5;

/// Innovations beyond this number of their robust standard deviations are no noise, whatever it is… *Guess*: beyond any
/// tail of a sensor's noise.
const NO_NOISE: f64 = 8.0;
/// …as long as they are rare: at most this share. *Guess*: more of them are what the data are about.
const RARE: f64 = 0.1;

/// Everything that laws could explain, as free columns; of laws and rows alone, whatever is known of the noise.
pub(crate) struct FreeColumns {
    /// Averages of this number of rows.
    stride: usize,
    columns: Vec<Vec<f64>>,
    priors: Vec<Prior>,
}

impl FreeColumns {
    /// Main columns of laws, at some places of their shape parameters, averaged over whole averages of `finest` rows.
    pub fn of(on: &Excitation<'_>, laws: &[Law], finest: usize) -> FreeColumns {
        let stride = finest * on.rows.count_used().div_ceil(WANDER_AVERAGES * finest).max(1);
        let plain = Whitener::plain(on.rows, &vec![false; on.rows.len()], stride, 1.0);
        let floating = |f: &Floating| (plain.average(&f.values), Prior { mean: 0.0, std: f.spread });
        let of_law = |law: &Law| -> Vec<Vec<f64>> {
            let tried = law.tried();
            let spread = if tried.len() > 8 { tried.len() / 2 } else { (tried.len() / 4).max(1) };
            let all = tried.iter().step_by(spread).flat_map(|places| law.lead_columns(on, &law.values(places)));
            let counts =
                |column: &Regressor| law.search.whole_beside_noise || matches!(column.tolerance, Tolerance::Main(_));
            let wide = |column: Regressor| {
                let mut averaged = plain.average(&column.values);
                let std = 20.0 / rms(&averaged).max(1e-9);
                averaged.iter_mut().for_each(|value| *value *= std);
                averaged
            };
            all.filter(counts).map(wide).collect()
        };
        let by_law: Vec<Vec<Vec<f64>>> = laws.par_iter().with_max_len(1).map(of_law).collect();
        let of_laws = directions(by_law.concat()).into_iter().map(|column| (column, Prior { mean: 0.0, std: 1.0 }));
        let (columns, priors) = on.base.floating.iter().map(floating).chain(of_laws).unzip();
        FreeColumns { stride, columns, priors }
    }
}

/// Directions in which free columns add more than this to a row, arcsec, say as much as all of them. *Source*: the
/// least white noise that is taken ([`white_level`]).
const LEAST_ADDED: f64 = 1e-3;

/// Columns, each with a coefficient of unit variance, as fewer that add the same: the principal components. Laws at
/// several places of their shapes are much alike, and each hypothesis of the noise takes all of them.
fn directions(columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let rows = columns.first().map_or(0, Vec::len);
    let views: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let gram = Gram::of(&views, 0..rows);
    let products = Mat::from_fn(gram.size, gram.size, |i, j| gram.at(i, j));
    let Some((values, vectors)) = eigen(products.as_ref()) else { return columns };
    let adds = |k: &usize| values[*k] > LEAST_ADDED * LEAST_ADDED * rows as f64;
    let along = |k: usize| combined(rows, views.iter().copied(), vectors.col_as_slice(k));
    (0..values.len()).filter(adds).collect::<Vec<_>>().into_par_iter().map(along).collect()
}

/// White noise and wander, with everything a law could explain taken out: each hypothesis of the wander is judged by
/// its evidence with the main columns of all laws as free columns. Returns also the worth of the information: below 1
/// where innovations are not white. `explained` is what is explained already, row by row.
pub fn noise(on: &Excitation<'_>, columns: &FreeColumns, explained: &[f64], uncertain: &[bool]) -> (Noise, f64) {
    let rows = on.rows;
    let left = on.left(explained);
    let white = white_level(rows, &left);
    let stride = columns.stride;
    let plain = Whitener::plain(rows, uncertain, stride, white);
    let data = plain.average(&left);
    let judge_under = |whitener: Whitener| columns.judge(&data, whitener);
    let unit = if rows.recorded.time { 1.0 } else { 100.0 * rows.period };
    let hypotheses = hypotheses(white, unit);
    // Rows that a flank turned over too early or a ringing throws out are no noise: they would make a fast wander of
    // it.
    let uncertain = match judge_under(plain) {
        Some(judged) => thrown_out(&judged, uncertain),
        None => uncertain.to_vec(),
    };
    let judge = |noise: &Noise| judge_under(Whitener::new(rows, &uncertain, stride, *noise));
    let judged: Vec<Option<Hypothesis>> = hypotheses.par_iter().map(judge).collect();
    let evidence = |k: usize| judged[k].as_ref().map_or(f64::NEG_INFINITY, |judged| judged.evidence);
    let most = (0..judged.len()).map(evidence).fold(f64::NEG_INFINITY, f64::max);
    // A short recording does not tell a wander from none: then what it could hide is no cause.
    let power = |k: &usize| hypotheses[*k].wander * hypotheses[*k].correlation_s.sqrt();
    let likely = (0..judged.len()).filter(|k| evidence(*k) >= most - AS_LIKELY);
    let best = likely.max_by(|a, b| power(a).total_cmp(&power(b))).unwrap_or(0);
    let worth = judged[best].as_ref().map_or(1.0, |judged| worth_of(&judged.innovations, &judged.whitener));
    (hypotheses[best], worth)
}

/// Standard deviations of the drift that are tried, in units of the white noise. *Guess*: mostly half as much again
/// from one to the next.
const WANDERS: [f64; 8] = [0.1, 0.2, 0.3, 0.45, 0.7, 1.0, 1.5, MOST_WANDER];
/// Correlation times of the drift that are tried, s. *Guess*: two to a decade, from the fastest to minutes.
const CORRELATIONS_S: [f64; 4] = [FASTEST_S, 8.0, 25.0, 80.0];

/// White noise alone, and with each wander that is tried, wander by wander.
fn hypotheses(white: f64, unit: f64) -> Vec<Noise> {
    let with =
        |wander: f64, correlation: f64| Noise { white, wander: wander * white, correlation_s: correlation * unit };
    let all = WANDERS.iter().flat_map(|wander| CORRELATIONS_S.map(|correlation| with(*wander, correlation)));
    [Noise { white, wander: 0.0, correlation_s: 1.0 }].into_iter().chain(all).collect()
}

/// How well a hypothesis of the noise tells what is left.
struct Hypothesis {
    evidence: f64,
    innovations: Vec<f64>,
    whitener: Whitener,
}

impl FreeColumns {
    /// How well a hypothesis of the noise explains averaged data.
    fn judge(&self, data: &[f64], whitener: Whitener) -> Option<Hypothesis> {
        let mut all = whitener.whiten_each(&self.columns);
        all.push(whitener.whiten_averaged(data));
        let views: Vec<&[f64]> = all.iter().map(Vec::as_slice).collect();
        let solution = solve(&Gram::of(&views, 0..data.len()), &self.priors, 1.0)?;
        let mut innovations = all.pop()?;
        all.iter().zip(&solution.coefficients).for_each(|(column, c)| add_scaled(&mut innovations, column, -c));
        Some(Hypothesis { evidence: solution.evidence - whitener.log_scale(), innovations, whitener })
    }
}

/// Rows that were uncertain, and those of averages whose innovations are no noise, if rare.
fn thrown_out(judged: &Hypothesis, uncertain: &[bool]) -> Vec<bool> {
    let spread = robust_std(judged.innovations.iter().copied());
    let beyond: Vec<f64> =
        judged.innovations.iter().map(|i| f64::from(u8::from(i.abs() > NO_NOISE * spread))).collect();
    if beyond.iter().sum::<f64>() > RARE * beyond.len() as f64 {
        return uncertain.to_vec();
    }
    let thrown = judged.whitener.in_rows(&beyond, uncertain.len());
    uncertain.iter().zip(thrown).map(|(doubtful, thrown)| *doubtful || thrown > 0.0).collect()
}

/// Worth of innovations that should be white with unit variance: the inverse of the variance of their sums over blocks.
fn worth_of(innovations: &[f64], whitener: &Whitener) -> f64 {
    let mut worst: f64 = 1.0;
    for length in [1usize, 5, 20] {
        let mut sums = Vec::new();
        for session in &whitener.sessions {
            for block in innovations[session.clone()].chunks_exact(length) {
                sums.push(block.iter().sum::<f64>() / (length as f64).sqrt());
            }
        }
        if sums.len() >= 30 {
            let spread = robust_std(sums.into_iter());
            worst = worst.max(spread * spread);
        }
    }
    (1.0 / worst).clamp(0.05, 1.0)
}
