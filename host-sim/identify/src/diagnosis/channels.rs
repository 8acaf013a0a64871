//! Channels held against the nominal model before any cause is asked: does the torque wind this drive up, with its sign
//! and in its unit; are both angles in degrees, which no ratio shows?
//!
//! What floats freely in every drive is taken out first: zeros, the ratio, first orders, the nominal harmonics, speed
//! and the direction of motion. What is left of the error is then held against what the nominal model says of the
//! torque, as recorded and otherwise.

use flexspline::Table;

use super::base::{PlayLaw, predicted_by_table};
use super::noise::white_level;
use super::rows::{Rows, quantile, rms, robust_std};
use crate::least_squares::{FreeSpan, jackknife};
use crate::measurement::{
    ColumnMap, Fault, FaultName, MeasuredError, Quantity, Recording, Refusal, Treatment, throughout,
};
use crate::nominal::{Harmonic, Nominal};
use flexspline_base::robust::dot;

/// Rows that are looked at, about, spread evenly. *Guess*: some 250 to each of the [`BLOCKS`].
const SAMPLE: usize = 6000;
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
/// Degrees in a radian, by definition.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;
/// Clearance and waves are those of the model within these factors. *Guess*: they vary much more from unit to unit than
/// springs do.
const AS_NOMINAL: [f64; 2] = [0.25, 4.0];
/// Residuals farther out than this many standard deviations are cut there. *Guess*: no normal row in a million lies so
/// far out.
const CUT: f64 = 5.0;
/// The deviation is that of the block which this share of all does not exceed. *Guess*: two of [`BLOCKS`] may be full
/// of bad rows.
const MOST_GOES_ON: f64 = 0.9;

/// Rows that are used, about this many, spread evenly.
fn sample(rows: &Rows, count: usize) -> Vec<usize> {
    let used: Vec<usize> = rows.sessions_used().flatten().collect();
    used.iter().copied().step_by(used.len().div_ceil(count).max(1)).collect()
}

/// Sine and cosine of an angle times an order, at the places.
pub(super) fn waves(order: f64, angle: &[f64], places: &[usize]) -> [Vec<f64>; 2] {
    [f64::sin, f64::cos].map(|wave| places.iter().map(|k| wave(order * angle[*k])).collect())
}

/// What floats freely in every drive, column by column at the places: zeros of the error and of sessions, ratio, speed,
/// direction, nominal harmonics, and two orders of the output.
fn floating(rows: &Rows, nominal: &Nominal, places: &[usize]) -> Vec<Vec<f64>> {
    let of = |value: &dyn Fn(usize) -> f64| -> Vec<f64> { places.iter().map(|k| value(*k)).collect() };
    let mut columns = vec![of(&|_| 1.0), of(&|k| rows.output[k]), of(&|k| rows.speed[k]), of(&|k| rows.direction[k])];
    for session in rows.sessions.iter().skip(1).take(MOST_ZEROS) {
        columns.push(of(&|k| f64::from(u8::from(k >= session.start))));
    }
    for harmonic in &nominal.harmonics {
        columns.extend(waves(harmonic.order_per_generator_turn, &rows.generator, places));
    }
    for order in [1.0, 2.0] {
        columns.extend(waves(order, &rows.output, places));
    }
    columns
}

/// A sample of the rows with the nominal model over it, under any torque, and a basis of what floats freely.
pub(super) struct Sampled<'a> {
    rows: &'a Rows,
    against: (&'a Nominal, Option<&'a Table<'a>>),
    /// The rows.
    pub places: Vec<usize>,
    /// What floats.
    pub free: FreeSpan,
}

impl<'a> Sampled<'a> {
    /// Of about `count` rows; the columns that `further` gives at the places float as well.
    pub fn new(
        rows: &'a Rows,
        against: (&'a Nominal, Option<&'a Table<'a>>),
        count: usize,
        further: impl FnOnce(&[usize]) -> Vec<Vec<f64>>,
    ) -> Sampled<'a> {
        let places = sample(rows, count);
        let columns = floating(rows, against.0, &places).into_iter().chain(further(&places));
        Sampled { rows, against, free: FreeSpan::default().beyond(columns), places }
    }

    /// A column of all rows at the places.
    pub fn at(&self, column: &[f64]) -> Vec<f64> {
        self.places.iter().map(|k| column[*k]).collect()
    }

    /// Wind-up, half the clearance on the flank that carries, and what a table predicts apart from them, at the places
    /// under a torque of all rows, arcsec. Without a table the rest is the harmonics, which float.
    pub fn parts(&self, law: PlayLaw, torque: &[f64]) -> [Vec<f64>; 3] {
        let (nominal, table) = self.against;
        let half = 0.5 * nominal.backlash_arcsec;
        let wind_up: Vec<f64> = self.places.iter().map(|k| nominal.wind_up_arcsec(torque[*k])).collect();
        let mut play = self.at(&law.flanks(self.rows, torque, nominal));
        play.iter_mut().for_each(|flank| *flank *= half);
        let all = table.map(|table| self.at(&predicted_by_table(self.rows, torque, table)));
        let rest = |(k, predicted): (usize, f64)| predicted - wind_up[k] - play[k];
        let rest = all.map_or_else(|| vec![0.0; play.len()], |all| all.into_iter().enumerate().map(rest).collect());
        [wind_up, play, rest]
    }
}

/// A sample of the rows with what floats freely taken out of their error.
struct Freed<'a> {
    sampled: Sampled<'a>,
    error: Vec<f64>,
}

/// Standard deviation of a residual in the blocks in which most goes on: at a bench that loads the drive in some
/// sessions alone, what the load does is far out in the others. One block of bad rows lifts it by little.
fn spread(error: &[f64]) -> f64 {
    let blocks = error.chunks(error.len().div_ceil(BLOCKS).max(1));
    quantile(blocks.map(|block| robust_std(block.iter().copied())), MOST_GOES_ON)
}

impl<'a> Freed<'a> {
    /// With `further` columns of all rows among what floats.
    fn new(rows: &'a Rows, against: (&'a Nominal, Option<&'a Table<'a>>), further: &[Vec<f64>]) -> Freed<'a> {
        let sampled = Sampled::new(rows, against, SAMPLE, |places| {
            let further = further.iter().map(|column| places.iter().map(|k| column[*k]).collect());
            waves(1.0, &rows.generator, places).into_iter().chain(further).collect()
        });
        let mut error = sampled.free.freed(sampled.at(&rows.error));
        let spread = spread(&error);
        error.iter_mut().for_each(|error| *error = error.clamp(-CUT * spread, CUT * spread));
        Freed { sampled, error }
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
    /// Share of the clearance alone.
    clearance: f64,
}

impl TorqueEffect {
    /// By nominal wind-up and clearance under `scale` times the recorded torque.
    fn by(freed: &Freed<'_>, scale: f64) -> TorqueEffect {
        let Freed { sampled, error } = freed;
        let torque: Vec<f64> = sampled.rows.torque.iter().map(|torque| scale * torque).collect();
        let parts = sampled.parts(PlayLaw::Held, &torque).map(|part| sampled.free.freed(part));
        let [wound, play, rest] = parts;
        // What a table says apart from them is ripple, which the load shapes.
        let error: Vec<f64> = error.iter().zip(&rest).map(|(error, rest)| error - rest).collect();
        let wind_up = share_beside(&error, &wound, &play);
        let clearance = share_beside(&error, &play, &wound);
        let should: Vec<f64> = wound.iter().zip(&play).map(|(wound, play)| wound + play).collect();
        let block = should.len().div_ceil(BLOCKS).max(1);
        let blocks = should.chunks(block).zip(error.chunks(block));
        let products: Vec<[f64; 2]> = blocks.map(|(should, error)| [dot(should, should), dot(should, error)]).collect();
        let all = products.iter().fold([0.0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]]);
        let share = all[1] / all[0].max(1e-12);
        let without: Vec<f64> = products.iter().map(|of| (all[1] - of[1]) / (all[0] - of[0]).max(1e-12)).collect();
        let left = robust_std(error.iter().zip(&should).map(|(error, should)| error - should));
        TorqueEffect { size: rms(&should), share, std: jackknife(&without), left, wind_up, clearance }
    }

    fn is_certain(&self) -> bool {
        self.share.abs() > CERTAIN * self.std
    }
}

/// How much of `column` is in `of`, with `other` free.
fn share_beside(of: &[f64], column: &[f64], other: &[f64]) -> f64 {
    let (cc, oo, co) = (dot(column, column), dot(other, other), dot(column, other));
    // Where the sign never changes there is one flank, which is a zero.
    let (share, rest) = if oo > 1e-9 { (co / oo, cc - co * co / oo) } else { (0.0, cc) };
    (dot(of, column) - share * dot(of, other)) / rest.max(1e-12)
}

/// Factors by which a torque may be wrong: the other shaft, by this ratio, or another unit; and turned round.
fn factors(ratio: f64) -> Vec<f64> {
    let shafts = [ratio.abs(), 1.0 / ratio.abs()];
    shafts.into_iter().chain(UNITS.map(|(_, factor)| factor)).flat_map(|factor| [factor, -factor]).collect()
}

/// Units that a torque may be in though N·m was said, as a mapping names them, in N·m.
const UNITS: [(&str, f64); 5] =
    [("N.cm", 1e-2), ("mN.m", 1e-3), ("kN.m", 1e3), ("lbf.in", 0.112_985), ("N.m*9.80665", 9.806_65)];

/// The unit of a factor, and which way it counts.
fn unit_of(factor: f64) -> Option<String> {
    let sign = if factor < 0.0 { "-" } else { "" };
    UNITS.iter().find(|(_, of)| *of == factor.abs()).map(|(name, _)| format!("{sign}{name}"))
}

/// Holds the torque against what it should do; turned round, or taken to the other shaft, where that explains it; left
/// out where it does nothing, or where it looks like another unit. Gives
/// why the data are unusable, where they are.
pub(crate) fn check_torque(recording: &mut Recording, nominal: &Nominal, table: Option<&Table<'_>>) -> Option<String> {
    let rows = Rows::new(&recording.sessions, nominal);
    if !rows.recorded.torque || rows.torque.iter().all(|torque| *torque == 0.0) || nominal.wind_up_arcsec(1.0) == 0.0 {
        return None;
    }
    let freed = Freed::new(&rows, (nominal, table), &[]);
    let plain: Vec<f64> = (0..rows.len()).map(|k| rows.error[k] - nominal.wind_up_arcsec(rows.torque[k])).collect();
    let white = white_level(&rows, &rows.error).min(white_level(&rows, &plain));
    let seen = |effect: &TorqueEffect| effect.size > SEEN_ARCSEC.max(SEEN_OF_NOISE * white);
    let none = robust_std(freed.error.iter().copied());
    let under = |scale: f64| TorqueEffect::by(&freed, scale);
    let recorded = under(1.0);
    let of_this_drive =
        |effect: &TorqueEffect| (OF_THIS_DRIVE[0]..=OF_THIS_DRIVE[1]).contains(&effect.share) && effect.is_certain();
    let too_soft = recorded.wind_up > FAR_TOO_SOFT;
    if seen(&recorded) && recorded.share > NO_EFFECT && !too_soft {
        return None;
    }
    let turned = under(-1.0);
    if seen(&turned) && of_this_drive(&turned) && turned.left < EXPLAINS_TURNED * recorded.left.min(none) {
        scale(recording, -1.0);
        let what = format!(
            "the error follows the torque with {:.2} (± {:.2}) of the nominal wind-up and clearance: it counts \
                 the other way, and was turned round",
            recorded.share, recorded.std
        );
        report(recording, FaultName::TorqueSign, Treatment::Repaired, none, what);
        return None;
    }
    let best = factors(nominal.ratio)
        .into_iter()
        .map(|factor| (factor, under(factor)))
        .filter(|(_, effect)| !too_soft || (OF_THIS_DRIVE[0]..=OF_THIS_DRIVE[1]).contains(&effect.wind_up))
        .filter(|(_, effect)| seen(effect) && of_this_drive(effect) && effect.left < EXPLAINS * recorded.left.min(none))
        .min_by(|a, b| a.1.left.total_cmp(&b.1.left));
    if let Some((unit, (_, effect))) = best.as_ref().and_then(|best| Some((unit_of(best.0)?, best))) {
        // A stiffness that looks like another unit is a look, no word: a soft drive does the same.
        let what = format!(
            "the residual is {:.0} arcsec with the torque as given, {:.0} if it is in {unit}: nothing says so, and it \
             is not converted; if it is, say --columns torque=NAME:{unit}, else the drive is not as stiff as its model \
             says; load and drive are indistinguishable",
            recorded.left, effect.left
        );
        recording.sessions.iter_mut().for_each(|session| session.torque_n_m = None);
        report(recording, FaultName::UnitMismatch, Treatment::Masked, recorded.size, what.clone());
        return Some(what);
    }
    if let Some((factor, effect)) = best {
        scale(recording, factor);
        let what = format!(
            "the torque times {factor:.4} gives the wind-up and clearance that the error shows ({:.2} ± {:.2} of \
                 the nominal ones); as it stands it leaves {:.0} arcsec, so {:.0}: it was converted",
            effect.share, effect.std, recorded.left, effect.left
        );
        report(recording, FaultName::TorqueScale, Treatment::Repaired, none, what);
        return None;
    }
    let nothing = seen(&recorded) && 1.0 - recorded.share > CERTAIN * recorded.std && recorded.left > none;
    if !nothing {
        return None;
    }
    recording.sessions.iter_mut().for_each(|session| session.torque_n_m = None);
    let what = format!(
        "the torque should move the error by {:.0} arcsec rms, and it shows {:.2} (± {:.2}) of that: it is not the \
         torque at this output, and is not used; load and drive are indistinguishable",
        recorded.size, recorded.share, recorded.std
    );
    report(recording, FaultName::TorqueScale, Treatment::Masked, recorded.size, what.clone());
    Some(what)
}

/// Multiplies the torque.
fn scale(recording: &mut Recording, factor: f64) {
    recording
        .sessions
        .iter_mut()
        .flat_map(|session| &mut session.torque_n_m)
        .flatten()
        .for_each(|torque| *torque *= factor);
}

/// Reports a fault of the torque in all rows.
pub(super) fn report(
    recording: &mut Recording,
    name: FaultName,
    treatment: Treatment,
    size_arcsec: f64,
    what: String,
) -> Option<&mut Fault> {
    let (channel, size_arcsec) = (Some(Quantity::Torque), Some(size_arcsec));
    let all = throughout(&recording.sessions, name)?;
    recording.faults.push(Fault { channel, size_arcsec, treatment, what, ..all });
    recording.faults.last_mut()
}

/// Refuses angles that are in degrees where radians are said: no ratio shows that, but wind-up, clearance and the
/// largest wave of the model are then 180/π times what it says. A torque in another unit or of the other shaft moves
/// the wind-up alone. A unit that the mapping says is believed.
///
/// # Errors
/// The angles look like degrees.
pub(crate) fn check_degrees(
    recording: &Recording,
    columns: &ColumnMap,
    nominal: &Nominal,
    table: Option<&Table<'_>>,
) -> Result<(), MeasuredError> {
    let (generator, said) = columns.column(Quantity::Generator);
    let rows = Rows::new(&recording.sessions, nominal);
    if said || !rows.recorded.torque || nominal.wind_up_arcsec(1.0) == 0.0 {
        return Ok(());
    }
    let effect = TorqueEffect::by(&Freed::new(&rows, (nominal, table), &[]), 1.0);
    let by_size = |a: &&Harmonic, b: &&Harmonic| a.amplitude_arcsec.total_cmp(&b.amplitude_arcsec);
    let wave = nominal.harmonics.iter().max_by(by_size).map(|wave| {
        // A load that is put on in steps while the generator turns a little looks like a wave: it goes first.
        let wound = rows.torque.iter().map(|torque| nominal.wind_up_arcsec(*torque)).collect();
        let further = [wound, PlayLaw::Held.flanks(&rows, &rows.torque, nominal)];
        let Freed { sampled, error } = Freed::new(&rows, (nominal, table), &further);
        let [sine, cosine] = waves(wave.order_per_generator_turn / DEGREES, &rows.generator, &sampled.places)
            .map(|wave| sampled.free.freed(wave));
        let [sine, cosine] = [(&sine, &cosine), (&cosine, &sine)].map(|(a, b)| share_beside(&error, a, b));
        sine.hypot(cosine) / wave.amplitude_arcsec
    });
    let clearance = (nominal.backlash_arcsec > 0.0).then_some(effect.clearance);
    let degrees = |share: f64, [low, high]: [f64; 2]| (low * DEGREES..=high * DEGREES).contains(&share);
    let mut others = [wave, clearance].into_iter().flatten().peekable();
    let Some(other) = others.peek().copied() else { return Ok(()) };
    if !degrees(effect.wind_up, OF_THIS_DRIVE) || !others.all(|share| degrees(share, AS_NOMINAL)) {
        return Ok(());
    }
    let [generator, output] = [generator, columns.column(Quantity::Output).0].map(str::to_owned);
    let why = Refusal::BothInDegrees { wind_up: effect.wind_up, other, generator, output };
    Err(MeasuredError::of_file(&recording.file, &why))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;
    use crate::synthesize::catalogue_drive;

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
            session.push([t, psi, error / flexspline_base::units::ARCSEC_PER_RAD, told(t, load)]);
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
    fn a_torque_is_turned_round_converted_or_left_out_and_a_right_one_left_alone() {
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
        assert!(fault == Some(FaultName::TorqueScale) && !unusable && near(torque));
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
        let check = |recording: &Recording, map: &ColumnMap| check_degrees(recording, map, &nominal, None);
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
}
