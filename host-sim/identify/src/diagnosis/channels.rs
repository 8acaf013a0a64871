//! Channels held against the nominal model before any cause is asked: does the torque wind this drive up, with its sign
//! and in its unit, and is nothing read where there is no load; are both angles in degrees, which no ratio shows?
//!
//! What floats freely in every drive is taken out first: zeros, the ratio, first orders, the nominal harmonics, speed
//! and the direction of motion. What is left of the error is then held against what the nominal model says of the
//! torque, as recorded and otherwise.
//!
//! A torque sensor whose zero is off reads a load where there is none. The drive then changes flanks, and stiffens, at
//! other torques than its model, always by the same amount; whatever turns with an angle or follows the motion may
//! explain a part of that, and none of it is there. The zero counts where neither an unbalanced load nor a drag, all of
//! their sizes and phases free, leaves as little, nor a spring that is stiffer one way than the other: a spring that
//! stiffens makes of a zero just about that.

use std::f64::consts::TAU;
use std::ops::Range;

use flexspline::Table;

use super::base::{PlayLaw, predicted_by_table};
use super::noise::white_level;
use super::rows::{Rows, mean, quantile, rms, robust_std};
use crate::least_squares::{FreeSpan, jackknife};
use crate::measurement::{
    ColumnMap, Fault, FaultName, MeasuredError, Measures, Quantity, Recording, Session, Treatment, Unit,
    least_and_most, other_reading, throughout,
};
use crate::misfit::about_mean;
use crate::nominal::Nominal;
use flexspline_base::robust::dot;

/// Rows that are looked at, about, spread evenly. *Guess*: some 330 to each of the [`BLOCKS`].
const SAMPLE: usize = 8000;
/// Session offsets that float, at most. *Guess*: it bounds the columns; recordings have few sessions.
const MOST_ZEROS: usize = 24;
/// Blocks of neighbouring rows that are left out one at a time, as loads repeat and rows are not independent. *Guess*:
/// enough of them for a standard deviation, each long enough to hold several loads.
pub(super) const BLOCKS: usize = 24;
/// The expected effect of the torque is visible from this many times the white noise on, … *Guess*.
const SEEN_OF_NOISE: f64 = 3.0;
/// … and from this many arcsec on. *Guess*: less is no more than the ripple of a drive.
const SEEN_ARCSEC: f64 = 8.0;
/// A share of it is certain from this many of its standard deviations on. *Source*: by convention.
const CERTAIN: f64 = 5.0;
/// Shares that a drive may show of its nominal wind-up and clearance: springs are softer and harder than catalogues
/// say. *Guess*.
const OF_THIS_DRIVE: [f64; 2] = [0.4, 2.5];
/// No drive winds up by this many times what its model says: a torque that asks for that is in another unit. *Guess*.
const FAR_TOO_SOFT: f64 = 8.0;
/// A torque in another unit leaves less than this share of what is left as it stands, and without any torque. *Guess*.
const EXPLAINS: f64 = 0.5;
/// One of the wrong sign leaves less than this. *Guess*.
const EXPLAINS_TURNED: f64 = 0.8;
/// A torque of which the error shows no more than this is none of this output. *Guess*.
const NO_EFFECT: f64 = 0.3;
/// Residuals farther out than this many standard deviations are cut there. *Guess*: no normal row in a million lies so
/// far out.
const CUT: f64 = 5.0;
/// The deviation is that of the block which this share of all does not exceed. *Guess*: two of [`BLOCKS`] may be full
/// of bad rows.
const MOST_GOES_ON: f64 = 0.9;

/// A sample of the rows with what floats freely taken out of their error.
#[derive(Clone)]
struct Sampled<'a> {
    rows: &'a Rows,
    against: (&'a Nominal, Option<&'a Table<'a>>),
    /// The rows, and which of them are known together.
    places: Vec<usize>,
    block: Vec<usize>,
    /// What floats.
    free: FreeSpan,
    /// The error without it, arcsec.
    error: Vec<f64>,
    /// Scale of the load, N·m.
    load: f64,
    /// Sine and cosine of the angle against gravity, in each row.
    turned: Vec<(f64, f64)>,
}

/// Rows that are used, [`SAMPLE`] of them, spread evenly.
fn sample(rows: &Rows) -> Vec<usize> {
    let used: Vec<usize> = rows.sessions_used().flatten().collect();
    used.iter().copied().step_by(used.len().div_ceil(SAMPLE).max(1)).collect()
}

/// Values of all rows at the places.
fn at(places: &[usize], values: &[f64]) -> Vec<f64> {
    places.iter().map(|k| values[*k]).collect()
}

/// Sine and cosine of an angle times an order, at the places.
pub(super) fn waves(order: f64, angle: &[f64], places: &[usize]) -> [Vec<f64>; 2] {
    [f64::sin, f64::cos].map(|wave| places.iter().map(|k| wave(order * angle[*k])).collect())
}

/// What floats freely in every drive whatever its waves are, column by column at the places: zeros of the error and of
/// up to so many sessions, ratio, speed, direction.
fn floating(rows: &Rows, places: &[usize], zeros: usize) -> Vec<Vec<f64>> {
    let since = |start: usize| places.iter().map(|k| f64::from(u8::from(*k >= start))).collect();
    let zeros = rows.sessions.iter().take(zeros + 1).map(|session| since(session.start));
    zeros.chain([&rows.output, &rows.speed, &rows.direction].map(|column| at(places, column))).collect()
}

/// Standard deviation of a residual in the blocks in which most goes on: at a bench that loads the drive in some
/// sessions alone, what the load does is far out in the others. One block of bad rows lifts it by little.
fn spread(error: &[f64]) -> f64 {
    quantile(blocks(error).map(|block| robust_std(block.iter().copied())), MOST_GOES_ON)
}

/// A column in its blocks.
fn blocks(column: &[f64]) -> impl Iterator<Item = &[f64]> {
    column.chunks(column.len().div_ceil(BLOCKS).max(1))
}

impl<'a> Sampled<'a> {
    fn new(rows: &'a Rows, against: (&'a Nominal, Option<&'a Table<'a>>), zeros: usize) -> Sampled<'a> {
        let places = sample(rows);
        let nominal = against.0.harmonics.iter().map(|of| (of.order_per_generator_turn, &rows.generator));
        let wheels = [&rows.output, &rows.on_flexspline, &rows.on_circular_spline];
        let wheels = [1.0, 2.0].into_iter().flat_map(|order| wheels.map(|wheel| (order, wheel)));
        let all = nominal.chain(wheels).flat_map(|(order, angle)| waves(order, angle, &places));
        let free = FreeSpan::default().beyond(floating(rows, &places, zeros).into_iter().chain(all));
        let mut error = free.freed(at(&places, &rows.error));
        let spread = spread(&error);
        error.iter_mut().for_each(|error| *error = error.clamp(-CUT * spread, CUT * spread));
        let turned =
            rows.output.iter().zip(&rows.orientation).map(|(out, housing)| (out + housing).sin_cos()).collect();
        // What the zero of a session that does not float is off by is the same in all of its rows.
        let block = |(place, k): (usize, &usize)| match zeros {
            0 => rows.sessions.partition_point(|session| session.end <= *k),
            _ => place / places.len().div_ceil(BLOCKS).max(1),
        };
        let block = places.iter().enumerate().map(block).collect();
        Sampled { rows, against, places, block, free, error, load: rows.load_scale(), turned }
    }

    /// The error less what a table predicts apart from wind-up and clearance, which is ripple that the load shapes;
    /// wind-up; half the clearance on the flank that carries: at the places under a torque of all rows, arcsec. Without
    /// a table the ripple is the harmonics, which float.
    fn parts(&self, law: PlayLaw, torque: &[f64]) -> [Vec<f64>; 3] {
        let (nominal, table) = self.against;
        let half = 0.5 * nominal.backlash_arcsec;
        let wind_up: Vec<f64> = self.places.iter().map(|k| nominal.wind_up_arcsec(torque[*k])).collect();
        let mut play = at(&self.places, &law.flanks(self.rows, torque, nominal));
        play.iter_mut().for_each(|flank| *flank *= half);
        let mut error = self.error.clone();
        if let Some(table) = table {
            let all = at(&self.places, &predicted_by_table(self.rows, torque, table));
            let rest = (0..all.len()).map(|k| all[k] - wind_up[k] - play[k]).collect();
            error.iter_mut().zip(self.free.freed(rest)).for_each(|(error, rest)| *error -= rest);
        }
        [error, wind_up, play]
    }
}

/// How the error stands to what a torque should do.
#[derive(Clone, Copy, Debug)]
struct TorqueEffect {
    /// What it should do, arcsec rms.
    size: f64,
    /// Share of it that the error shows, with its standard deviation.
    share: f64,
    std: f64,
    /// What is left of the error where it does what it should, arcsec.
    left: f64,
    /// Share of the wind-up alone, whatever the clearance is: that follows the sign of a torque in any unit.
    wind_up: f64,
}

impl TorqueEffect {
    /// By nominal wind-up and clearance under `factor` times the recorded torque.
    fn by(sampled: &Sampled<'_>, factor: f64) -> TorqueEffect {
        let torque: Vec<f64> = sampled.rows.torque.iter().map(|torque| factor * torque).collect();
        let [error, wound, play] = sampled.parts(PlayLaw::Held, &torque);
        let [wound, play] = [wound, play].map(|part| sampled.free.freed(part));
        let should: Vec<f64> = wound.iter().zip(&play).map(|(wound, play)| wound + play).collect();
        let mut products = vec![[0.0; 2]; sampled.block.last().map_or(0, |last| last + 1)];
        for (k, block) in sampled.block.iter().enumerate() {
            products[*block][0] += should[k] * should[k];
            products[*block][1] += should[k] * error[k];
        }
        let all = products.iter().fold([0.0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
        let share = all[1] / all[0].max(1e-12);
        let without: Vec<f64> = products.iter().map(|of| (all[1] - of[1]) / (all[0] - of[0]).max(1e-12)).collect();
        let left = robust_std(error.iter().zip(&should).map(|(error, should)| error - should));
        // Where the sign never changes there is one flank, which is a zero.
        let wound = FreeSpan::default().beyond([play]).freed(wound);
        let wind_up = dot(&error, &wound) / dot(&wound, &wound).max(1e-12);
        TorqueEffect { size: rms(&should), share, std: jackknife(&without), left, wind_up }
    }
}

/// How a torque of which N·m were said may be meant, as a mapping says it, with its factor: in another unit, of the
/// generator's shaft or divided by the ratio twice, and all of them turned round.
fn readings(ratio: f64) -> impl Iterator<Item = (String, f64)> {
    let shafts = [(format!("N.m*{ratio}"), ratio), (format!("N.m/{ratio}"), 1.0 / ratio)];
    let units = Unit::of_a_torque().map(|unit| (unit.name().to_owned(), unit.factor()));
    shafts.into_iter().chain(units).flat_map(|(unit, factor)| [(format!("-{unit}"), -factor), (unit, factor)])
}

/// Holds the torque against what it should do; turned round where that explains it; left out where it does nothing, or
/// where it looks like another unit or shaft. Gives why the data are unusable, where they are.
pub(crate) fn check_torque(recording: &mut Recording, nominal: &Nominal, table: Option<&Table<'_>>) -> Option<String> {
    let rows = Rows::new(&recording.sessions, nominal);
    if nominal.wind_up_arcsec(1.0) == 0.0 {
        return None;
    }
    if !rows.recorded.torque {
        let lost = |of: &&Fault| of.name == FaultName::FrozenChannel && of.channel == Some(Quantity::Torque);
        return recording.faults.iter().find(lost).map(|fault| fault.what.clone());
    }
    if rows.torque.iter().all(|torque| *torque == 0.0) {
        return None;
    }
    let sampled = Sampled::new(&rows, (nominal, table), MOST_ZEROS);
    let plain: Vec<f64> = (0..rows.len()).map(|k| rows.error[k] - nominal.wind_up_arcsec(rows.torque[k])).collect();
    let white = white_level(&rows, &rows.error).min(white_level(&rows, &plain));
    let seen = |effect: &TorqueEffect| effect.size > SEEN_ARCSEC.max(SEEN_OF_NOISE * white);
    let at_first = |sampled: &Sampled<'_>| (TorqueEffect::by(sampled, 1.0), robust_std(sampled.error.iter().copied()));
    let (mut recorded, mut none) = at_first(&sampled);
    let too_soft = recorded.wind_up > FAR_TOO_SOFT;
    if seen(&recorded) && recorded.share > NO_EFFECT && !too_soft {
        return None;
    }
    let explains = |(_, factor, effect): &(String, f64, TorqueEffect), recorded: &TorqueEffect, none: f64| {
        let of_this_drive = |share: f64| (OF_THIS_DRIVE[0]..=OF_THIS_DRIVE[1]).contains(&share);
        let most = if *factor == -1.0 { EXPLAINS_TURNED } else { EXPLAINS };
        let fits = of_this_drive(effect.share) && (!too_soft || of_this_drive(effect.wind_up));
        seen(effect) && fits && effect.share > CERTAIN * effect.std && effect.left < most * recorded.left.min(none)
    };
    let tried = readings(nominal.ratio.abs()).map(|(unit, factor)| (unit, factor, TorqueEffect::by(&sampled, factor)));
    let mut meant: Vec<_> = tried.filter(|tried| explains(tried, &recorded, none)).collect();
    meant.sort_by(|a, b| a.2.left.total_cmp(&b.2.left));
    // Where each session keeps to one load, a zero of its own hides what that does; of three and more a line shows.
    if !seen(&recorded) && meant.is_empty() && rows.zeros.is_empty() && rows.sessions_used().count() > 2 {
        let by_session = Sampled::new(&rows, (nominal, table), 0);
        (recorded, none) = at_first(&by_session);
        meant.push((String::new(), -1.0, TorqueEffect::by(&by_session, -1.0)));
        if !explains(&meant[0], &recorded, none) {
            return None;
        }
    }
    let nothing = seen(&recorded) && 1.0 - recorded.share > CERTAIN * recorded.std && recorded.left > none;
    let (repaired, name, what) = match meant.first() {
        Some((_, -1.0, effect)) => {
            let what = format!(
                "the torque turned round gives the wind-up and clearance that the error shows ({:.2} ± {:.2} of the \
                 nominal ones); as it stands it leaves {:.0} arcsec, so {:.0}: it was turned round",
                effect.share, effect.std, recorded.left, effect.left
            );
            (Some(|torque: f64| -torque), FaultName::TorqueSign, what)
        }
        // A stiffness that looks like another unit, or the other shaft, is a look, no word: a soft drive does the same.
        Some((first, ..)) => {
            let if_so = meant.iter().map(|(unit, _, effect)| format!("{:.0} if it is in {unit}", effect.left));
            let what = format!(
                "the residual is {:.0} arcsec with the torque as given, {}: nothing says so, and it is not converted; \
                 if it is, say so, as in --columns torque=NAME:{first}, else the drive is not as stiff as its model \
                 says; load and drive are indistinguishable",
                recorded.left,
                if_so.collect::<Vec<String>>().join(", ")
            );
            (None, FaultName::UnitMismatch, what)
        }
        None if nothing => {
            let what = format!(
                "the torque should move the error by {:.0} arcsec rms, and it shows {:.2} (± {:.2}) of that: it is not \
                 the torque at this output, and is not used; load and drive are indistinguishable",
                recorded.size, recorded.share, recorded.std
            );
            (None, FaultName::TorqueScale, what)
        }
        None => return None,
    };
    let size = if repaired.is_some() { none } else { recorded.size };
    report(recording, name, size, what.clone(), repaired);
    repaired.is_none().then_some(what)
}

/// Reports a fault of the torque in all rows, which are changed as it is `repaired`; without that it is left out.
fn report(
    recording: &mut Recording,
    name: FaultName,
    size_arcsec: f64,
    what: String,
    repaired: Option<impl Fn(f64) -> f64>,
) -> Option<&mut Fault> {
    let treatment = if repaired.is_some() { Treatment::Repaired } else { Treatment::Masked };
    for session in &mut recording.sessions {
        match &repaired {
            Some(repaired) => session.torque_n_m.iter_mut().flatten().for_each(|torque| *torque = repaired(*torque)),
            None => session.torque_n_m = None,
        }
    }
    let all = throughout(&recording.sessions, name)?;
    let (channel, size_arcsec) = (Some(Quantity::Torque), Some(size_arcsec));
    recording.faults.push(Fault { channel, size_arcsec, treatment, what, ..all });
    recording.faults.last_mut()
}

/// Rows that are followed for a zero, about: of longer recordings the beginnings of all sessions. *Guess*: it bounds
/// the time.
const FOLLOWED: usize = 200_000;
/// The largest zero that is looked for, as a share of the load: sensors are good to some per cent of their range. One
/// from there on is none that was found: something else goes on as far as one lets it. *Guess*.
const LARGEST_SHARE: f64 = 0.06;
/// A smaller one is no matter. *Guess*.
const LEAST_SHARE: f64 = 0.004;
/// First step of the search for loads beside the torque, and the one that ends it, as shares of the load. *Guess*: from
/// the size of a usual offset to less than a sixth of the least that counts.
const STEPS: [f64; 2] = [0.04, 6e-4];

// Chosen on healthy drives of the catalogue and of a table (zero of 0.3 to 2 N·m at 40 N·m: share 3 % to 65 %, 3.2 to
// 6.1 standard deviations) against 24 unbalanced loads and drags of the examination (share below 6 %, below 1.9).
/// A zero takes this share of what is left without it, …
const LEAST_GAIN: f64 = 0.03;
/// … by this many standard deviations of the blocks' means, … *Chosen* on the same, between 1.9 and 3.2.
const GAIN_CERTAIN: f64 = 2.5;
/// … and differs from zero by this many of its own standard deviations. *Guess*: it is one of many that were tried.
const TOLD_FROM_NONE: f64 = 4.0;
/// Unbalanced loads and drags leave no less than this share of what it leaves, … *Guess*: they have three numbers to
/// its one, and a per cent is no difference.
const RIVALS_LEAVE: f64 = 0.99;
/// … and together with it no less than this: else they are there. *Guess*: with four numbers in all, more is needed.
const BESIDE_IT_LEAVE: f64 = 0.95;
/// In either case by this share of what the zero has taken away. *Chosen* between what they take of a zero in the tests
/// below, at most 0.09, and of an unbalanced load there, 0.149; on healthy drives more is trifles.
const NO_TRIFLE: f64 = 0.12;
/// The smooth backlash model is taken where it leaves less than this of the least that another model leaves. *Guess*:
/// these are sums of magnitudes, so that it asks for more than where squares decide between the models; a load that the
/// torque column lacks looks like such a backlash.
const FAR_LESS: f64 = 0.8;
/// Rounds of the search at most. *Chosen*: ten times as many as the 6 to 40 that it takes on healthy drives and those
/// of the tests below.
const MOST_ROUNDS: usize = 500;
/// A residual of this much in each row is round-off, arcsec. *Source*: double precision holds angles of 1000 rad to
/// 2e-8 arcsec; the factor of 50 is a guess.
const ROUND_OFF_ARCSEC: f64 = 1e-6;
/// A round of steps that leaves more than this share of the residual of the one before leads nowhere. *Guess*: a tenth
/// of a per cent decides nothing.
const WORTH_A_ROUND: f64 = 0.999;

/// A load in addition to that of the torque column: a constant, an unbalanced load (sine and cosine), a drag. N·m.
type Beside = [f64; 4];
/// The place of the constant among these, those of an unbalanced load, and those of the rivals of a zero.
const CONSTANT: Range<usize> = 0..1;
const UNBALANCED: Range<usize> = 1..3;
const RIVALS: Range<usize> = 1..4;

/// A load that was tried, and what it leaves in each block: the sum of the magnitudes, which the rows of a flank turned
/// over too early do not rule.
type Tried = (Beside, Vec<f64>);

/// The same over all blocks but `without`.
fn sum((_, left): &Tried, without: Option<usize>) -> f64 {
    left.iter().sum::<f64>() - without.map_or(0.0, |block| left[block])
}

/// The one of those tried that leaves least in the blocks but `without`; the first is there always.
fn least(tried: &[Tried], without: Option<usize>) -> &Tried {
    tried.iter().min_by(|a, b| sum(a, without).total_cmp(&sum(b, without))).unwrap_or(&tried[0])
}

impl Sampled<'_> {
    /// What is left of the error at the places with a load beside the torque, arcsec; stiffness and backlash float, and
    /// the spring may be stiffer one way than the other where it is `by_sign`.
    fn left(&self, law: PlayLaw, [constant, sine, cosine, drag]: Beside, by_sign: bool) -> Vec<f64> {
        let rows = self.rows;
        let torque: Vec<f64> = (0..rows.len())
            .map(|k| {
                let (sin, cos) = self.turned[k];
                rows.torque[k] + constant + sine * sin + cosine * cos + drag * rows.direction[k]
            })
            .collect();
        let [error, wind_up, play] = self.parts(law, &torque);
        let by_sign = by_sign.then(|| wind_up.iter().map(|arcsec| arcsec.abs()).collect());
        self.free.beyond([wind_up, play].into_iter().chain(by_sign)).freed(error)
    }

    /// This load, and what it leaves.
    fn of(&self, law: PlayLaw, beside: Beside, by_sign: bool) -> Tried {
        let left = self.left(law, beside, by_sign);
        (beside, blocks(&left).map(|block| block.iter().map(|v| v.abs()).sum()).collect())
    }

    /// Loads that were tried: this one first, then by steps at some places that are halved where none leads on.
    fn tried(&self, law: PlayLaw, from: Beside, places: Range<usize>) -> Vec<Tried> {
        let mut tried = vec![self.of(law, from, false)];
        let mut step = STEPS[0] * self.load;
        for _ in 0..MOST_ROUNDS {
            let before = sum(least(&tried, None), None);
            // Written so that a residual that is not a number ends it.
            if !(step > STEPS[1] * self.load && before > ROUND_OFF_ARCSEC * self.places.len() as f64) {
                break;
            }
            for place in places.clone() {
                let from = least(&tried, None).0;
                for by in [-step, step] {
                    let mut to = from;
                    to[place] += by;
                    tried.push(self.of(law, to, false));
                }
            }
            if sum(least(&tried, None), None) > WORTH_A_ROUND * before {
                step *= 0.5;
            }
        }
        tried
    }
}

/// Whether less is left with the second than with the first, by this many standard deviations of the blocks' mean.
fn is_certain((_, first): &Tried, (_, second): &Tried, stds: f64) -> bool {
    let gains: Vec<f64> = first.iter().zip(second).map(|(first, second)| first - second).collect();
    let (gain, blocks) = (mean(&gains), gains.len() as f64);
    let spread = (gains.iter().map(|of| (of - gain).powi(2)).sum::<f64>() / (blocks - 1.0) / blocks).sqrt();
    gain > stds * spread
}

/// Beginnings of all sessions, where the torque of enough rows winds the drive up.
fn followed(recording: &Recording, nominal: &Nominal) -> Option<Rows> {
    let share = FOLLOWED as f64 / recording.sessions.iter().map(Session::len).sum::<usize>() as f64;
    let begun = |session: &Session| session.part(0..(share.min(1.0) * session.len() as f64) as usize);
    let begun: Vec<Session> = recording.sessions.iter().map(begun).collect();
    let rows = Rows::new(&begun, nominal);
    let winds_up = rows.recorded.torque && nominal.wind_up_arcsec(1.0) != 0.0;
    (winds_up && rows.count_used() >= SAMPLE / 4).then_some(rows)
}

/// Frictions of the play that are tried, of the one stated. *Guess*: each within what [`super::base::NEAR_FRICTION`]
/// sets aside of the one before it, as far as drives of one catalogue may differ.
const FRICTIONS: [f64; 13] = [0.3, 0.37, 0.45, 0.55, 0.67, 0.82, 1.0, 1.22, 1.5, 1.84, 2.25, 2.77, 3.4];
/// The one that they are of where none is stated, of the load. *Guess*: the grid ends at 2 and 20 % of it.
const FRICTION_OF_LOAD: f64 = 0.06;
/// Where none is stated it takes at least this share of what a load that nobody read would take. *Guess*: that has
/// three numbers to its one, and no drive is without friction.
const TAKES_OF_LOAD: f64 = 0.5;

/// Takes the friction of the play that the rows show in place of the one stated, which no catalogue prints, where it
/// leaves less for certain, with a note, and of none. Else what changes its flank elsewhere would look like a zero of
/// the torque, a step of an encoder, or a cause.
pub(super) fn take_friction(recording: &mut Recording, nominal: &mut Nominal, table: Option<&Table<'_>>) {
    let Some(rows) = followed(recording, nominal) else { return };
    let stated = nominal.friction_torque_n_m;
    let of = if stated > 0.0 { stated } else { FRICTION_OF_LOAD * rows.load_scale() };
    let sampled = Sampled::new(&rows, (nominal, table), MOST_ZEROS);
    let leaves = |friction_torque_n_m: f64| {
        let other = Nominal { friction_torque_n_m, ..nominal.clone() };
        // What floats does not depend on it.
        let sampled = Sampled { against: (&other, table), ..sampled.clone() };
        let by_law = PlayLaw::ALL.map(|law| {
            let (beside, left) = sampled.of(law, [0.0; 4], false);
            let penalty = if law == PlayLaw::Smooth { FAR_LESS } else { 1.0 };
            (beside, left.into_iter().map(|left| left / penalty).collect())
        });
        least(&by_law, None).clone()
    };
    let as_stated = leaves(stated);
    let tried = FRICTIONS.map(|share| (share * of, leaves(share * of)));
    let Some((n_m, best)) = tried.iter().min_by(|a, b| sum(&a.1, None).total_cmp(&sum(&b.1, None))) else { return };
    let left = sum(best, None) / sum(&as_stated, None);
    // A load that nobody read changes the flank elsewhere, too; a drag where no friction is known is that friction.
    let (others, share) = if stated > 0.0 { (RIVALS, 1.0) } else { (UNBALANCED, TAKES_OF_LOAD) };
    let rivals = || sampled.tried(PlayLaw::Held, [0.0; 4], CONSTANT.start..others.end);
    let taken = |by: &Tried| sum(&as_stated, None) - sum(by, None);
    let certain = || left <= 1.0 - LEAST_GAIN && is_certain(&as_stated, best, GAIN_CERTAIN);
    if left < 1.0 && (stated == 0.0 || certain()) && taken(best) > share * taken(least(&rivals(), None)) {
        let instead = format!(
            "the output changes its flank at a load of about {n_m:.2} N·m, the friction of its play, where the model \
             states a friction of {stated:.2}: with that {:.0} % less is left, and it takes its place",
            100.0 * (1.0 - left)
        );
        recording.notes.extend((stated > 0.0).then_some(instead));
        nominal.friction_torque_n_m = *n_m;
    }
}

/// Finds a zero of the torque, where it is distinguished from none and from loads that follow the output or the motion,
/// names it and takes it off.
pub(super) fn check_zero(recording: &mut Recording, nominal: &Nominal, table: Option<&Table<'_>>) {
    let Some(rows) = followed(recording, nominal) else { return };
    let sampled = Sampled::new(&rows, (nominal, table), MOST_ZEROS);
    // A zero turns flanks over too early, which by itself looks like a play that goes over slowly.
    let by_law = PlayLaw::ALL.map(|law| (law, sampled.tried(law, [0.0; 4], CONSTANT)));
    let without_any = by_law.iter().map(|(_, tried)| sum(&tried[0], None)).fold(f64::INFINITY, f64::min);
    let leaves = |(law, tried): &(PlayLaw, Vec<Tried>)| {
        sum(least(tried, None), None) / if *law == PlayLaw::Smooth { FAR_LESS } else { 1.0 }
    };
    let Some((law, tried)) = by_law.into_iter().min_by(|a, b| leaves(a).total_cmp(&leaves(b))) else { return };
    let (none, there) = (&tried[0], least(&tried, None));
    let (n_m, left) = (-there.0[0], sum(there, None));
    let gain = sum(none, None) - left;
    // No finer than the steps.
    let without: Vec<f64> = (0..none.1.len()).map(|block| least(&tried, Some(block)).0[0]).collect();
    let std = jackknife(&without).max(STEPS[1] * sampled.load);
    let tried = LEAST_SHARE * sampled.load..LARGEST_SHARE * sampled.load;
    let found = tried.contains(&n_m.abs()) && n_m.abs() >= TOLD_FROM_NONE * std;
    let gains = gain >= LEAST_GAIN * sum(none, None) && left <= (1.0 - LEAST_GAIN) * without_any;
    if !found || !gains || !is_certain(none, there, GAIN_CERTAIN) {
        return;
    }
    // Rivals have three numbers to its one: they are there only where they leave less, for certain, and by more than
    // the lag of flanks and other trifles, of which three numbers always tell a part.
    let better = |than: &Tried, share: f64| {
        let least = sum(than, None);
        least < share * left && is_certain(there, than, GAIN_CERTAIN) && left - least > NO_TRIFLE * gain
    };
    let rivals = sampled.tried(law, [0.0; 4], RIVALS);
    let instead = least(&rivals, None);
    let beside = || sampled.tried(law, there.0, CONSTANT.start..RIVALS.end);
    let moved = [there.0, none.0].map(|beside| sampled.left(law, beside, false));
    let size_arcsec = rms(&moved[0].iter().zip(&moved[1]).map(|(with, without)| with - without).collect::<Vec<f64>>());
    // A zero that moves the error by no more than round-off was found in round-off.
    if size_arcsec <= ROUND_OFF_ARCSEC
        || better(instead, RIVALS_LEAVE)
        || better(&sampled.of(law, [0.0; 4], true), RIVALS_LEAVE)
        || better(&sampled.of(law, there.0, true), BESIDE_IT_LEAVE)
        || better(least(&beside(), None), BESIDE_IT_LEAVE)
    {
        return;
    }
    let alike = if sum(instead, None) * RIVALS_LEAVE < left {
        "; an unbalanced load of that size, which is nearly constant where the load changes its side, would do the \
         same here"
    } else {
        ""
    };
    let what = format!(
        "the torque reads {n_m:+.2} N·m (± {std:.2}) where there is none: the output changes its flank at that \
         reading, wherever it stands and whichever way it turns; it was taken off{alike}"
    );
    if let Some(fault) = report(recording, FaultName::TorqueZero, size_arcsec, what, Some(|torque| torque - n_m)) {
        fault.measures = Measures { zero_n_m: Some(n_m), zero_std_n_m: Some(std), ..Measures::default() };
    }
}

/// Generator turns in degrees that tell waves from drift. *Guess*.
const MANY_TURNS: f64 = 5.0;
/// The reading that is meant leaves less than this share of the variance that the other leaves. *Guess*.
const LEAVES: f64 = 0.5;
/// An error about its mean that asks for its unit, arcsec rms. *Guess*: fifteen arc-minutes, where wind-up and play are
/// a few.
const LARGE_ARCSEC: f64 = 900.0;
/// Orders of the output that float, as many as a table may have, and of both wheels and the output in degrees.
/// *Source*: by definition.
const ORDERS: [i32; 2] = [6, 2];

/// Refuses angles that are in degrees where radians are read, which no ratio shows: the error, without what the load
/// and the output make of it, repeats in each turn of the generator, on either wheel, in degrees and not in radians.
/// Where no such wave shows, an error too large for a gear is asked about in a note. A unit that the mapping says is
/// believed.
///
/// # Errors
/// The angles look like degrees.
pub(crate) fn check_degrees(
    recording: &mut Recording,
    columns: &ColumnMap,
    nominal: &Nominal,
) -> Result<(), MeasuredError> {
    let (generator, said) = columns.column(Quantity::Generator);
    if said {
        return Ok(());
    }
    let rows = Rows::new(&recording.sessions, nominal);
    let (degree, output) = (1f64.to_radians(), columns.column(Quantity::Output).0);
    let readings = vec![
        format!("--columns generator={generator}:deg,output={output}:deg"),
        format!("--columns generator={generator}:rad,output={output}:rad if they are not"),
    ];
    // Left beside waves of the wheels in radians and in degrees.
    let beside_waves = || -> [f64; 2] {
        let places = sample(&rows);
        let wound: Vec<f64> = rows.torque.iter().map(|torque| nominal.wind_up_arcsec(*torque)).collect();
        let load = [&rows.torque, &wound, &PlayLaw::Held.flanks(&rows, &rows.torque, nominal)];
        let waves_to = |most: i32, unit: f64, angle| {
            (1..=most).flat_map(|order| waves(unit * f64::from(order), angle, &places)).collect::<Vec<_>>()
        };
        let of_output = [waves_to(ORDERS[0], 1.0, &rows.output), waves_to(ORDERS[1], degree, &rows.output)].concat();
        let any =
            floating(&rows, &places, MOST_ZEROS).into_iter().chain(load.map(|of| at(&places, of))).chain(of_output);
        let free = FreeSpan::default().beyond(any);
        let error = free.freed(at(&places, &rows.error));
        [1.0, degree].map(|unit| {
            let wheels = [&rows.on_flexspline, &rows.on_circular_spline];
            let waves = wheels.into_iter().flat_map(|wheel| waves_to(ORDERS[1], unit, wheel));
            robust_std(free.beyond(waves).freed(error.clone()).into_iter())
        })
    };
    let (from, to) = least_and_most(rows.generator.iter().copied());
    let [radians, degrees] = if (to - from) * degree >= MANY_TURNS * TAU { beside_waves() } else { [0.0; 2] };
    if degrees.powi(2) < LEAVES * radians.powi(2) && radians >= ROUND_OFF_ARCSEC {
        let seen = format!(
            "with load and waves of the output, waves of {generator} to 2 pi have a residual of {radians:.0} arcsec, \
             to 360 {degrees:.0}"
        );
        let what = other_reading(&seen, "angles in degrees read as radians", &readings);
        return Err(MeasuredError::of_file(&recording.file, &what));
    }
    let size = about_mean(&rows.error);
    if size > LARGE_ARCSEC {
        let seen = format!("the error is {size:.0} arcsec rms, {:.1} if the angles are in degrees", size.to_radians());
        recording.notes.push(other_reading(&seen, "no wave of the generator shows which", &readings).0);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesize::catalogue_drive;
    use flexspline_base::units::ARCSEC_PER_RAD;

    #[test]
    fn a_block_of_bad_rows_does_not_decide_where_residuals_are_cut() {
        let rows = |load: std::ops::Range<usize>, bad: std::ops::Range<usize>| -> Vec<f64> {
            let wave = |k: usize| (1.3 * k as f64).sin();
            let size = |k: usize| {
                if bad.contains(&k) {
                    900.0
                } else if load.contains(&k) {
                    20.0
                } else {
                    1.0
                }
            };
            (0..2400).map(|k| size(k) * wave(k)).collect()
        };
        // Loaded in one session of five.
        let (with, without) = (spread(&rows(480..960, 100..200)), spread(&rows(480..960, 0..0)));
        assert!(without > 10.0 && (with / without - 1.0).abs() < 0.1, "{with}, {without}");
    }

    /// A drive as its catalogue says under a load that swings, 2 arcsec of noise; `told` is what the column of torque
    /// says of the load.
    fn recording(nominal: &Nominal, told: impl Fn(f64, f64) -> f64) -> Recording {
        recording_under(nominal, |t| 25.0 * (0.9 * t).sin() + 6.0 * (2.3 * t).cos(), 0.05, told)
    }

    /// The same under a load of time, with a generator that turns by so much from row to row.
    fn recording_under(
        nominal: &Nominal,
        load: impl Fn(f64) -> f64,
        turned: f64,
        told: impl Fn(f64, f64) -> f64,
    ) -> Recording {
        let mut random = fastrand::Rng::with_seed(3);
        let mut session = Session { time_s: Some(Vec::new()), torque_n_m: Some(Vec::new()), ..Session::default() };
        let mut flank = 1.0;
        for k in 0..12_000 {
            let t = 0.01 * f64::from(k);
            let load = load(t);
            let psi = turned * f64::from(k);
            if load.abs() > nominal.friction_torque_n_m {
                flank = load.signum();
            }
            let noise = 2.0 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
            let error = nominal.harmonics_arcsec(psi)
                + nominal.wind_up_arcsec(load)
                + 0.5 * nominal.backlash_arcsec * flank
                + noise;
            session.push([t, psi, error / ARCSEC_PER_RAD, told(t, load)]);
        }
        Recording::made("made.csv", vec![session])
    }

    /// Fault found, whether data are unusable, and the torque in a row after that.
    fn checked(told: impl Fn(f64, f64) -> f64) -> (Option<FaultName>, bool, Option<f64>) {
        let nominal = catalogue_drive();
        let mut recording = recording(&nominal, told);
        let unusable = check_torque(&mut recording, &nominal, None).is_some();
        let torque = recording.sessions[0].torque_n_m.as_ref().map(|torque| torque[150]);
        (recording.faults.first().map(|fault| fault.name), unusable, torque)
    }

    #[test]
    fn a_torque_is_turned_round_or_left_out_and_a_right_one_left_alone() {
        let load = 25.0 * (0.9f64 * 1.5).sin() + 6.0 * (2.3f64 * 1.5).cos();
        let near = |torque: Option<f64>| (torque.unwrap() / load - 1.0).abs() < 1e-6;
        let (fault, unusable, torque) = checked(|_, load| load);
        assert!(fault.is_none() && !unusable && near(torque));
        // A drive twice as stiff as its catalogue is a drive.
        assert_eq!(checked(|_, load| 2.0 * load).0, None);
        let (fault, unusable, torque) = checked(|_, load| -load);
        assert!(fault == Some(FaultName::TorqueSign) && !unusable && near(torque));
        let ratio = catalogue_drive().ratio;
        let (fault, unusable, torque) = checked(|_, load| load / ratio.abs());
        assert!(fault == Some(FaultName::UnitMismatch) && unusable && torque.is_none());
        // All units are told that explain it, the one that explains most first.
        let nominal = catalogue_drive();
        let mut hundredths = recording(&nominal, |_, load| 100.0 * load);
        let said = check_torque(&mut hundredths, &nominal, None).unwrap();
        let of_shaft = format!(" if it is in N.m/{}, ", nominal.ratio.abs());
        assert!(
            said.contains("if it is in N.cm, ") && said.contains(&of_shaft) && said.contains("=NAME:N.cm,"),
            "{said}"
        );
        // A unit that nothing says is not taken for one, nor is a drive nine times as soft.
        let (fault, unusable, torque) = checked(|_, load| load / 0.112_985);
        assert!(fault == Some(FaultName::UnitMismatch) && unusable && torque.is_none());
        let (_, _, torque) = checked(|_, load| 0.112_985 * load);
        assert!(torque.is_none_or(|torque| (torque / (0.112_985 * load) - 1.0).abs() < 1e-6), "{torque:?}");
        // That of a neighbour, who swings at his own pace; and one that nothing follows.
        let (fault, unusable, torque) = checked(|t, _| 30.0 * (1.7 * t).sin());
        assert!(fault == Some(FaultName::TorqueScale) && unusable && torque.is_none());
        // Nothing recorded is no torque that does nothing.
        assert_eq!(checked(|_, _| 0.0), (None, false, Some(0.0)));
    }

    #[test]
    fn angles_in_degrees_are_refused_and_no_other_ratio_torque_or_unit_that_is_said() {
        let nominal = catalogue_drive();
        let map = ColumnMap::default();
        let check = |recording: &Recording, map: &ColumnMap| check_degrees(&mut recording.clone(), map, &nominal);
        let in_degrees = |mut recording: Recording| {
            for session in &mut recording.sessions {
                session.generator_rad.iter_mut().for_each(|angle| *angle = angle.to_degrees());
                session.error_rad.iter_mut().for_each(|angle| *angle = angle.to_degrees());
            }
            recording
        };
        let levels = [21.0, -14.0, 30.0, 8.0, -25.0, 17.0, -9.0];
        let steps = recording_under(&nominal, |t| levels[(t / 18.0) as usize % 7], 5e-3, |_, load| load);
        for right in [recording(&nominal, |_, load| load), steps] {
            assert_eq!(check(&right, &map), Ok(()));
            let refused = check(&in_degrees(right.clone()), &map).unwrap_err().to_string();
            assert!(refused.contains("--columns generator=generator_rad:deg,output=output_rad:deg"), "{refused}");
            let said = ColumnMap::parse("generator=generator_rad:rad").unwrap();
            assert_eq!(check(&in_degrees(right.clone()), &said), Ok(()));
            let mut other_ratio = right;
            for session in &mut other_ratio.sessions {
                let by = 1.0 / (nominal.ratio * 1.05) - 1.0 / nominal.ratio;
                session.error_rad.iter_mut().zip(&session.generator_rad).for_each(|(error, psi)| *error += by * psi);
            }
            assert_eq!(check(&other_ratio, &map), Ok(()));
        }
        // The torque of a motor behind a ratio near 57 moves the wind-up alone.
        for factor in [60.0, 95.0, 0.01] {
            assert_eq!(check(&recording(&nominal, |_, load| load / factor), &map), Ok(()), "{factor}");
        }
    }

    /// A drive as its catalogue says that turns to and fro by so much from row to row under a load that swings, 2
    /// arcsec of noise; with `unseen` N·m (of output angle and direction) beside what the column of torque says.
    fn to_and_fro(nominal: &Nominal, turned: f64, unseen: impl Fn(f64, f64) -> f64) -> Recording {
        with_spring(nominal, turned, unseen, |load| nominal.wind_up_arcsec(load))
    }

    /// The same with a spring of its own, arcsec.
    fn with_spring(
        nominal: &Nominal,
        turned: f64,
        unseen: impl Fn(f64, f64) -> f64,
        wind_up: impl Fn(f64) -> f64,
    ) -> Recording {
        let mut random = fastrand::Rng::with_seed(3);
        let mut session = Session { time_s: Some(Vec::new()), torque_n_m: Some(Vec::new()), ..Session::default() };
        let (mut flank, mut psi) = (1.0, 0.0);
        for k in 0..16_000 {
            let t = 0.01 * f64::from(k);
            let told = 25.0 * (0.9 * t).sin() + 6.0 * (2.3 * t).cos();
            let direction = if k / 3000 % 2 == 0 { 1.0 } else { -1.0 };
            psi += turned * direction;
            let load = told + unseen(psi / nominal.ratio, direction);
            if load.abs() > nominal.friction_torque_n_m {
                flank = load.signum();
            }
            let noise = 2.0 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
            let play = 0.5 * nominal.backlash_arcsec * flank;
            let error = nominal.harmonics_arcsec(psi) + wind_up(load) + play + noise;
            session.push([t, psi, error / ARCSEC_PER_RAD, told]);
        }
        Recording::made("made.csv", vec![session])
    }

    /// The fault found, and by how much the first torque was changed.
    fn zero_checked(unseen: impl Fn(f64, f64) -> f64) -> (Option<Fault>, f64) {
        // A third of an output turn.
        zero_checked_turning(0.08, unseen)
    }

    fn zero_checked_turning(turned: f64, unseen: impl Fn(f64, f64) -> f64) -> (Option<Fault>, f64) {
        let nominal = catalogue_drive();
        let mut recording = to_and_fro(&nominal, turned, unseen);
        let first = |recording: &Recording| recording.sessions[0].torque_n_m.as_ref().unwrap()[0];
        let before = first(&recording);
        check_zero(&mut recording, &nominal, None);
        let by = first(&recording) - before;
        (recording.faults.pop(), by)
    }

    #[test]
    fn a_zero_is_named_with_its_size_and_taken_off() {
        for zero in [-1.6, -0.5, 0.3, 0.8] {
            // What is read less what is there is the zero.
            let (fault, by) = zero_checked(|_, _| -zero);
            let fault = fault.expect("a fault");
            let (found, std) = (fault.measures.zero_n_m.unwrap(), fault.measures.zero_std_n_m.unwrap());
            assert_eq!((fault.name, fault.treatment), (FaultName::TorqueZero, Treatment::Repaired));
            assert!((found - zero).abs() < 3.0 * std && std < 0.15, "{zero}: {found} ± {std}");
            assert!((by + found).abs() < 1e-9, "{by}");
        }
    }

    #[test]
    fn in_a_small_part_of_a_turn_a_zero_goes_before_an_unbalanced_load_that_would_do_the_same() {
        let (fault, _) = zero_checked_turning(0.01, |_, _| -1.2);
        let fault = fault.expect("a fault");
        assert!(fault.what.contains("an unbalanced load of that size"), "{}", fault.what);
    }

    #[test]
    fn a_spring_that_is_stiffer_one_way_than_the_other_is_no_zero_nor_is_what_ends_where_the_search_does() {
        let nominal = catalogue_drive();
        for (forward, back) in [(1.1, 0.93), (1.03, 0.98), (0.92, 1.1), (1.15, 0.95)] {
            let spring = |load: f64| nominal.wind_up_arcsec(load) * if load > 0.0 { forward } else { back };
            let mut recording = with_spring(&nominal, 0.08, |_, _| 0.0, spring);
            let before = recording.clone();
            check_zero(&mut recording, &nominal, None);
            assert_eq!(recording, before, "{forward} and {back}");
        }
        // A load nobody reads that pulls ever harder, as a cable that winds up.
        let (fault, _) = zero_checked(|output, _| -2.0 - 0.2 * output);
        assert_eq!(fault, None);
    }

    #[test]
    fn a_right_zero_an_unbalanced_load_and_a_drag_are_left_alone() {
        assert_eq!(zero_checked(|_, _| 0.0).0, None);
        assert_eq!(zero_checked(|output, _| 3.0 * (output + 0.4).sin()).0, None);
        assert_eq!(zero_checked(|_, direction| -0.9 * direction).0, None);
    }

    #[test]
    fn a_friction_of_the_play_other_than_stated_is_that_of_the_rows_and_an_unbalanced_load_is_none() {
        let nominal = catalogue_drive();
        let of_rows = |stated: f64, unseen: fn(f64, f64) -> f64| {
            let mut recording = to_and_fro(&nominal, 0.08, unseen);
            let mut other = Nominal { friction_torque_n_m: stated, ..nominal.clone() };
            take_friction(&mut recording, &mut other, None);
            other.friction_torque_n_m
        };
        for stated in [0.6, 3.4] {
            let found = of_rows(stated, |_, _| 0.0);
            assert!((found / nominal.friction_torque_n_m - 1.0).abs() < 0.25, "{stated}: {found}");
        }
        assert_eq!(of_rows(1.5, |_, _| 0.0), 1.5);
        assert_eq!(of_rows(1.5, |output, _| 3.0 * (output + 0.4).sin()), 1.5);
    }

    #[test]
    fn the_search_ends_where_nothing_is_left_but_round_off() {
        let nominal = catalogue_drive();
        // Exact rows at one load, there and back or one way, as anybody writes who tries the program on numbers of his
        // own; and what is no number.
        for (back, backlash, error) in [(true, 1.0, 0.0), (false, 1.0, 0.0), (true, 0.0, 0.0), (true, 1.0, f64::NAN)] {
            let mut session =
                Session { time_s: Some(Vec::new()), torque_n_m: Some(vec![1.0; 2000]), ..Session::default() };
            for k in 0..2000 {
                let psi = 0.05 * f64::from(if back && k >= 1000 { 2000 - k } else { k });
                session.line.push(k as u64 + 2);
                session.generator_rad.push(psi);
                let wind_up = nominal.wind_up_arcsec(1.0) + 0.5 * backlash * nominal.backlash_arcsec;
                session.error_rad.push((nominal.harmonics_arcsec(psi) + wind_up) / ARCSEC_PER_RAD + error);
                session.time_s.as_mut().unwrap().push(0.01 * f64::from(k));
            }
            let nominal = nominal.clone();
            let (send, receive) = std::sync::mpsc::channel();
            std::thread::spawn(move || {
                let rows = Rows::new(&[session], &nominal);
                let sampled = Sampled::new(&rows, (&nominal, None), MOST_ZEROS);
                let left = [CONSTANT, RIVALS, CONSTANT.start..RIVALS.end].map(|places| {
                    let tried = sampled.tried(PlayLaw::Held, [0.0; 4], places);
                    sum(least(&tried, None), None)
                });
                send.send(left).unwrap();
            });
            let ended = receive.recv_timeout(std::time::Duration::from_secs(120));
            let left = ended.unwrap_or_else(|_| panic!("it does not end: {back}, {backlash}"));
            assert!(error.is_nan() || left.iter().all(|left| *left < 1.0), "{left:?}");
        }
    }
}
