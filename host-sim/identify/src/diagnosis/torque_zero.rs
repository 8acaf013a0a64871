//! A torque sensor whose zero is off: it reads a load where there is none. The drive then changes flanks, and stiffens,
//! at other torques than its model, always by the same amount; whatever turns with an angle or follows the motion may
//! explain a part of that, and none of it is there.
//!
//! The torque less a constant is tried, from a share of the load on either side: what the model leaves of the error
//! then, with everything free that floats in any drive, gives the constant. It counts where neither an unbalanced load
//! nor a drag, all of their sizes and phases free, leaves as little, nor a spring that is stiffer one way than the
//! other: a spring that stiffens makes of a zero just about that.

use flexspline::Table;

use super::base::PlayLaw;
use super::channels::{BLOCKS, Sampled, report, waves};
use super::rows::{Rows, mean, rms};
use crate::least_squares::jackknife;
use crate::measurement::{FaultName, Measures, Recording, Session, Treatment};
use crate::nominal::Nominal;

/// Rows that are followed, about: of longer recordings the beginnings of all sessions. *Guess*: it bounds the time.
const FOLLOWED: usize = 200_000;
/// Rows of these that are compared, about. *Guess*: some 330 to each of the blocks.
const SAMPLE: usize = 8000;

/// The largest zero that is looked for, as a share of the load: sensors are good to some per cent of their range. One
/// from there on is none that was found, but the end of what was tried: something else goes on as far as one lets
/// it. *Guess*.
const LARGEST_SHARE: f64 = 0.06;
/// A smaller one is no matter. *Guess*.
const LEAST_SHARE: f64 = 0.004;
/// Step of the first look, as a share of the load: the residual grows with the distance from the offset on either side,
/// so that a coarse look leads there. *Guess*: six steps to the largest.
const STEP_SHARE: f64 = 0.01;
/// Times that the step is halved then. *Guess*: to 0.03 % of the load, less than a tenth of the least that counts.
const HALVINGS: u32 = 5;

// Chosen on healthy drives of the catalogue and of a table (zero of 0.3 to 2 N·m at 40 N·m: share 3 % to 65 %, 3.2 to
// 6.1 standard deviations) against 24 unbalanced loads and drags of the examination (share below 6 %, below 1.9).
/// A zero takes this share of what is left without it, …
const LEAST_GAIN: f64 = 0.03;
/// … by this many standard deviations of the blocks' means, … *Chosen* on the same, between 1.9 and 3.2.
const CERTAIN: f64 = 2.5;
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
/// First and last step of the search for such loads, as shares of the load. *Guess*: from the size of a usual offset to
/// half the least that counts.
const RIVAL_STEPS: [f64; 2] = [0.04, 0.002];

/// What the model leaves of the error under a torque that is not the one recorded.
struct Other<'a> {
    rows: &'a Rows,
    /// The rows that are compared, with the smooth part of the error of any drive.
    sampled: Sampled<'a>,
    law: PlayLaw,
    /// Sine and cosine of the angle against gravity, in each row.
    turned: Vec<(f64, f64)>,
}

/// A load in addition to that of the torque column: a constant, an unbalanced load (sine and cosine), a drag. N·m.
type Beside = [f64; 4];

impl<'a> Other<'a> {
    fn new(rows: &'a Rows, nominal: &'a Nominal, table: Option<&'a Table<'a>>) -> Other<'a> {
        let sampled = Sampled::new(rows, (nominal, table), SAMPLE, |places| {
            let wheels = [&rows.on_flexspline, &rows.on_circular_spline];
            let orders = [1.0, 2.0].into_iter().flat_map(|order| wheels.map(|wheel| waves(order, wheel, places)));
            orders.flatten().collect()
        });
        let turned =
            rows.output.iter().zip(&rows.orientation).map(|(out, housing)| (out + housing).sin_cos()).collect();
        Other { rows, sampled, law: PlayLaw::Held, turned }
    }

    /// Takes the law of the play that leaves least at any of some zeros, and gives what each of them leaves by it,
    /// block by block; and what is left at least without a zero, by any law. A zero turns flanks over too early, which
    /// by itself looks like a play that goes over slowly.
    fn with_zeros(&mut self, zeros: &[f64]) -> (Vec<Try>, f64) {
        let of_law = |law: PlayLaw| -> (PlayLaw, Vec<Try>) {
            let left = |zero: &f64| (*zero, by_block(&self.of_law(law, [-zero, 0.0, 0.0, 0.0], false)));
            (law, zeros.iter().map(left).collect())
        };
        let all: Vec<(PlayLaw, Vec<Try>)> = PlayLaw::ALL.into_iter().map(of_law).collect();
        let without = all.iter().flat_map(|(_, tries)| tries).filter(|of| of.0 == 0.0).map(|of| sum(&of.1));
        let without = without.fold(f64::INFINITY, f64::min);
        let least = |(law, tries): &(PlayLaw, Vec<Try>)| {
            let least = tries.iter().map(|of| sum(&of.1)).fold(f64::INFINITY, f64::min);
            if *law == PlayLaw::Smooth { least / FAR_LESS } else { least }
        };
        let Some((law, tries)) = all.into_iter().min_by(|a, b| least(a).total_cmp(&least(b))) else {
            return (Vec::new(), without);
        };
        self.law = law;
        (tries, without)
    }

    /// What is left of the error at the places with a load beside the torque, arcsec.
    fn left(&self, beside: Beside) -> Vec<f64> {
        self.of_law(self.law, beside, false)
    }

    /// By a law of the play; the spring may be stiffer one way than the other where it is `by_sign`.
    fn of_law(&self, law: PlayLaw, [constant, sine, cosine, drag]: Beside, by_sign: bool) -> Vec<f64> {
        let rows = self.rows;
        let torque: Vec<f64> = (0..rows.len())
            .map(|k| {
                let (sin, cos) = self.turned[k];
                rows.torque[k] + constant + sine * sin + cosine * cos + drag * rows.direction[k]
            })
            .collect();
        let [wind_up, play, rest] = self.sampled.parts(law, &torque);
        let left = self.sampled.at(&rows.error).into_iter().zip(rest).map(|(error, rest)| error - rest).collect();
        // Stiffness and backlash float as well: all that they predict.
        let by_sign = by_sign.then(|| wind_up.iter().map(|arcsec| arcsec.abs()).collect());
        let free = &self.sampled.free;
        free.beyond([wind_up, play].into_iter().chain(by_sign)).freed(free.freed(left))
    }

    /// What is left, block by block, under a torque less `zero` where the spring may be stiffer one way than the other.
    fn by_sign(&self, zero: f64) -> Vec<f64> {
        by_block(&self.of_law(self.law, [-zero, 0.0, 0.0, 0.0], true))
    }

    /// What is left at least, block by block, with an unbalanced load and a drag beside `from`, and a constant where it
    /// is `free`: by steps that are halved where none leads on.
    fn least_beside(&self, from: Beside, free: bool, load: f64) -> Vec<f64> {
        let left = |beside: Beside| self.left(beside).iter().map(|v| v.abs()).sum::<f64>();
        let (mut at, mut least) = (from, left(from));
        let mut step = RIVAL_STEPS[0] * load;
        let round_off = ROUND_OFF_ARCSEC * self.sampled.places.len() as f64;
        for _ in 0..MOST_ROUNDS {
            // Written so that a residual that is not a number ends it.
            if !(step > RIVAL_STEPS[1] * load && least > round_off) {
                break;
            }
            let before = least;
            for j in usize::from(!free)..at.len() {
                for by in [-step, step] {
                    let mut to = at;
                    to[j] += by;
                    let then = left(to);
                    if then < least {
                        (least, at) = (then, to);
                    }
                }
            }
            if least > WORTH_A_ROUND * before {
                step *= 0.5;
            }
        }
        by_block(&self.left(at))
    }
}

/// Rounds of that search at most. *Chosen*: ten times as many as the 6 to 40 that it takes on healthy drives and those
/// of the tests below.
const MOST_ROUNDS: usize = 500;
/// A residual of this much in each row is round-off, arcsec. *Source*: double precision holds angles of 1000 rad to
/// 2e-8 arcsec; the factor of 50 is a guess.
const ROUND_OFF_ARCSEC: f64 = 1e-6;

/// A round of steps that leaves more than this share of the residual of the one before leads nowhere. *Guess*: a tenth
/// of a per cent decides nothing.
const WORTH_A_ROUND: f64 = 0.999;

/// How much is left in each block of rows: the sum of the magnitudes, which the rows of a flank turned over too early
/// do not rule.
fn by_block(left: &[f64]) -> Vec<f64> {
    left.chunks(left.len().div_ceil(BLOCKS).max(1)).map(|block| block.iter().map(|v| v.abs()).sum()).collect()
}

fn sum(values: &[f64]) -> f64 {
    values.iter().sum()
}

/// Whether less is left in the second than in the first, by this many standard deviations of the blocks' mean.
fn is_certain(first: &[f64], second: &[f64], stds: f64) -> bool {
    let gains: Vec<f64> = first.iter().zip(second).map(|(first, second)| first - second).collect();
    let (gain, blocks) = (mean(&gains), gains.len() as f64);
    let spread = (gains.iter().map(|of| (of - gain).powi(2)).sum::<f64>() / (blocks - 1.0) / blocks).sqrt();
    gain > stds * spread
}

/// A zero that was tried, N·m, and what it leaves in each block.
type Try = (f64, Vec<f64>);

/// The zero that leaves least in the blocks but `without`.
fn least(tries: &[Try], without: Option<usize>) -> f64 {
    let left = |of: &Try| sum(&of.1) - without.map_or(0.0, |block| of.1[block]);
    tries.iter().min_by(|a, b| left(a).total_cmp(&left(b))).map_or(0.0, |of| of.0)
}

/// A zero that was found, N·m, with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Zero {
    n_m: f64,
    std: f64,
    /// Its effect on the error, arcsec rms.
    size_arcsec: f64,
    /// Whether an unbalanced load would do the same in these rows.
    may_be_unbalance: bool,
}

/// The zero of the torque, where it is distinguished from none and from loads that follow the output or the motion.
fn find(sessions: &[Session], nominal: &Nominal, table: Option<&Table<'_>>) -> Option<Zero> {
    let rows = Rows::new(sessions, nominal);
    let load = rows.load_scale();
    if !rows.recorded.torque || load == 0.0 || nominal.wind_up_arcsec(1.0) == 0.0 || rows.count_used() < SAMPLE / 4 {
        return None;
    }
    let mut other = Other::new(&rows, nominal, table);
    let steps = (LARGEST_SHARE / STEP_SHARE).round() as i32;
    let mut step = STEP_SHARE * load;
    let zeros: Vec<f64> = (-steps..=steps).map(|k| f64::from(k) * step).collect();
    let (mut tries, without_any) = other.with_zeros(&zeros);
    let left = |zero: f64| by_block(&other.left([-zero, 0.0, 0.0, 0.0]));
    for _ in 0..HALVINGS {
        step *= 0.5;
        let best = least(&tries, None);
        tries.extend([best - step, best + step].map(|zero| (zero, left(zero))));
    }
    let zero = least(&tries, None);
    let of = |zero: f64| tries.iter().find(|of| of.0 == zero).map_or(&[][..], |of| &of.1);
    let (none, there) = (of(0.0), of(zero));
    let gain = sum(none) - sum(there);
    let gains = gain >= LEAST_GAIN * sum(none) && sum(there) <= (1.0 - LEAST_GAIN) * without_any;
    let tried = LEAST_SHARE * load..LARGEST_SHARE * load;
    if !tried.contains(&zero.abs()) || !gains || !is_certain(none, there, CERTAIN) {
        return None;
    }
    // No finer than the steps.
    let without: Vec<f64> = (0..none.len()).map(|block| least(&tries, Some(block))).collect();
    let std = jackknife(&without).max(step);
    if zero.abs() < TOLD_FROM_NONE * std {
        return None;
    }
    let least = sum(there);
    let by_rivals = other.least_beside([0.0; 4], false, load);
    let rivals = sum(&by_rivals);
    // They have three numbers to its one: they are there only where they leave less, for certain, and by more than the
    // lag of flanks and other trifles, of which three numbers always tell a part.
    let better = |than: &[f64], share: f64| {
        sum(than) < share * least && is_certain(there, than, CERTAIN) && least - sum(than) > NO_TRIFLE * gain
    };
    if better(&by_rivals, RIVALS_LEAVE)
        || better(&other.by_sign(0.0), RIVALS_LEAVE)
        || better(&other.by_sign(zero), BESIDE_IT_LEAVE)
        || better(&other.least_beside([-zero, 0.0, 0.0, 0.0], true, load), BESIDE_IT_LEAVE)
    {
        return None;
    }
    let may_be_unbalance = rivals * RIVALS_LEAVE < least;
    let (with, without) = (other.left([-zero, 0.0, 0.0, 0.0]), other.left([0.0; 4]));
    let moved: Vec<f64> = with.iter().zip(&without).map(|(with, without)| with - without).collect();
    Some(Zero { n_m: zero, std, size_arcsec: rms(&moved), may_be_unbalance })
}

/// Finds a zero of the torque, names it and takes it off.
pub(super) fn check(recording: &mut Recording, nominal: &Nominal, table: Option<&Table<'_>>) {
    if recording.sessions.iter().any(|session| session.torque_n_m.is_none()) {
        return;
    }
    let rows: usize = recording.sessions.iter().map(Session::len).sum();
    let found = if rows > FOLLOWED {
        let share = FOLLOWED as f64 / rows as f64;
        let sessions: Vec<Session> =
            recording.sessions.iter().map(|s| s.part(0..(share * s.len() as f64) as usize)).collect();
        find(&sessions, nominal, table)
    } else {
        find(&recording.sessions, nominal, table)
    };
    // A zero that moves the error by no more than round-off was found in round-off.
    let found = found.filter(|zero| zero.size_arcsec > ROUND_OFF_ARCSEC);
    let Some(Zero { n_m, std, size_arcsec, may_be_unbalance }) = found else { return };
    let torques = recording.sessions.iter_mut().flat_map(|session| &mut session.torque_n_m).flatten();
    torques.for_each(|torque| *torque -= n_m);
    let alike = if may_be_unbalance {
        "; an unbalanced load of that size, which is nearly constant where the load changes its side, would do the \
         same here"
    } else {
        ""
    };
    let what = format!(
        "the torque reads {n_m:+.2} N·m (± {std:.2}) where there is none: the output changes its flank at that \
         reading, wherever it stands and whichever way it turns; it was taken off{alike}"
    );
    if let Some(fault) = report(recording, FaultName::TorqueZero, Treatment::Repaired, size_arcsec, what) {
        fault.measures = Measures { zero_n_m: Some(n_m), zero_std_n_m: Some(std), ..Measures::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Fault;
    use crate::synthesize::catalogue_drive;
    use flexspline_base::units::ARCSEC_PER_RAD;

    /// A drive as its catalogue says that turns to and fro by so much from row to row under a load that swings, 2
    /// arcsec of noise; with `unseen` N·m (of output angle and direction) beside what the column of torque says.
    fn recording(nominal: &Nominal, turned: f64, unseen: impl Fn(f64, f64) -> f64) -> Recording {
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
    fn checked(unseen: impl Fn(f64, f64) -> f64) -> (Option<Fault>, f64) {
        // A third of an output turn.
        checked_turning(0.08, unseen)
    }

    fn checked_turning(turned: f64, unseen: impl Fn(f64, f64) -> f64) -> (Option<Fault>, f64) {
        let nominal = catalogue_drive();
        let mut recording = recording(&nominal, turned, unseen);
        let first = |recording: &Recording| recording.sessions[0].torque_n_m.as_ref().unwrap()[0];
        let before = first(&recording);
        check(&mut recording, &nominal, None);
        let by = first(&recording) - before;
        (recording.faults.pop(), by)
    }

    #[test]
    fn a_zero_is_named_with_its_size_and_taken_off() {
        for zero in [-1.6, -0.5, 0.3, 0.8] {
            // What is read less what is there is the zero.
            let (fault, by) = checked(|_, _| -zero);
            let fault = fault.expect("a fault");
            let (found, std) = (fault.measures.zero_n_m.unwrap(), fault.measures.zero_std_n_m.unwrap());
            assert_eq!((fault.name, fault.treatment), (FaultName::TorqueZero, Treatment::Repaired));
            assert!((found - zero).abs() < 3.0 * std && std < 0.15, "{zero}: {found} ± {std}");
            assert!((by + found).abs() < 1e-9, "{by}");
        }
    }

    #[test]
    fn in_a_small_part_of_a_turn_a_zero_goes_before_an_unbalanced_load_that_would_do_the_same() {
        let (fault, _) = checked_turning(0.01, |_, _| -1.2);
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
            check(&mut recording, &nominal, None);
            assert_eq!(recording, before, "{forward} and {back}");
        }
        // A load nobody reads that pulls ever harder, as a cable that winds up.
        let (fault, _) = checked(|output, _| -2.0 - 0.2 * output);
        assert_eq!(fault, None);
    }

    #[test]
    fn a_right_zero_an_unbalanced_load_and_a_drag_are_left_alone() {
        assert_eq!(checked(|_, _| 0.0).0, None);
        assert_eq!(checked(|output, _| 3.0 * (output + 0.4).sin()).0, None);
        assert_eq!(checked(|_, direction| -0.9 * direction).0, None);
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
                let load = rows.load_scale();
                let mut other = Other::new(&rows, &nominal, None);
                other.with_zeros(&[0.0]);
                let left = [other.least_beside([0.0; 4], false, load), other.least_beside([0.0; 4], true, load)];
                send.send(left).unwrap();
            });
            let ended = receive.recv_timeout(std::time::Duration::from_secs(120));
            let left = ended.unwrap_or_else(|_| panic!("it does not end: {back}, {backlash}"));
            assert!(error.is_nan() || left.iter().all(|left| sum(left) < 1.0), "{left:?}");
        }
    }
}
