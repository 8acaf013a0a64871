//! Steps of the error that last: an encoder that lost its index, or a drive that has ratcheted.
//!
//! A step happens within one row, faster than an output at rest could give it (a dwell in the clearance changes the
//! error by no more than the generator moves), and it stays, through reversals and at any load. Clearance that is
//! crossed, wind-up and damaged teeth do not: they come back with the state of the drive.

use super::state::{Extra, StateFit, StateModel};
use super::{ARCSEC, Findings, add_steps, level, whole_pitches};
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, ToothStep, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
use flexspline_base::robust::{median_and_std, median_of, sampled, white_noise};

/// A change in one row that is suspected exceeds the motion of the generator, over the ratio, by this factor… *Guess*:
/// half as much again, for noise and for rows that are not even.
const FASTER_THAN_DWELL: f64 = 1.5;
/// …and the robust spread of all such changes this many times. *Guess*: beyond any tail of noise.
const SUDDEN: f64 = 10.0;
/// Means over this many rows before and after are compared… *Guess*: means of a quarter of the noise of a row.
const WINDOW: usize = 16;
/// …and suspected from this many robust standard deviations of all such comparisons on. *Guess*: beyond any tail of
/// noise.
const STANDS_OUT: f64 = 8.0;
/// The lasting part of a step is this many standard deviations. *Guess*: more than the five by which causes are
/// separated, as a repair changes the rows.
const LASTS: f64 = 8.0;
/// The lasting part and the sudden part agree within this share. *Guess*: clearance that is crossed, or ripple, differs
/// by all of it.
pub(crate) const AGREES: f64 = 0.4;
/// A step is taken back by one of the other sign that differs by less than this share. *Chosen* (0.2 before) with
/// `a_flank_that_friction_lets_go_is_no_lost_index`.
const TAKEN_BACK: f64 = 0.35;
/// It is taken back by several together if their sum is less than this share of the largest. *Guess*: less than for
/// two, as of many some cancel by chance.
const TAKEN_BACK_TOGETHER: f64 = 0.15;
/// No step smaller than this is looked for, rad. *Guess*, raised from 2 arcsec for fewer false alarms.
const LEAST_RAD: f64 = 5.0 * ARCSEC;
/// Nor one that is not seen from one row to the next: this many standard deviations of the white noise. *Guess*: one
/// more than the five by which causes are separated.
const SEEN: f64 = 6.0;
/// Steps that are looked for at a time. *Guess*: an index is lost a few times in a recording.
const AT_ONCE: usize = 8;
/// Rounds of looking. *Guess*: each finds smaller ones, few to the last.
const ROUNDS: usize = 4;
/// A step is that many whole tooth pitches if it differs by less than this share of one. *Guess*: pitch errors of fine
/// gears are a third of that.
pub(super) const WHOLE_PITCH: f64 = 0.01;
/// Load of this share of its largest holds the drive on one flank. *Guess*: above the friction of most drives.
pub(super) const HELD: f64 = 0.1;
/// A step above this is no change of flank, rad. *Guess*: three arc-minutes, wider than the clearance of drives that
/// are not worn.
const WIDER_THAN_CLEARANCE_RAD: f64 = 180.0 * ARCSEC;
/// A change of load by this share of its largest, near the step, may be wind-up. *Guess*, lowered from 0.15 for fewer
/// false alarms.
const LOAD_STEP: f64 = 0.03;
/// Its noise alone changes it by no more than this many of its standard deviations. *Guess*: beyond any tail of noise.
const LOAD_NOISE: f64 = 8.0;
/// And its usual pace no more than this many times. *Guess*: a load that swings evenly stays below 3.
const LOAD_PACE: f64 = 6.0;
/// A step is separated from what it might be instead if it leaves less than this share of its misfit. *Guess*: with
/// some thousand rows one per cent would do, were they independent.
const CLEARLY_LESS: f64 = 0.95;
/// Medians of six rows before and after differ by no more than this many standard deviations of the white noise.
/// *Chosen* (4 before) as [`TAKEN_BACK`].
const LOCAL_NOISE: f64 = 2.2;
/// A jump stands alone: this many rows before and after it change the error by less than half as much. *Guess*: longer
/// than a traverse of the clearance.
const APART: usize = 12;

/// A column that steps from 0 to 1 at a row.
fn column(at: usize) -> impl Fn(usize) -> f64 {
    move |row| f64::from(u8::from(row >= at))
}

/// Does something with the columns of steps, and `more` behind them.
fn with_columns<T>(steps: impl IntoIterator<Item = usize>, more: &[Extra], then: impl FnOnce(&[Extra]) -> T) -> T {
    let steps: Vec<_> = steps.into_iter().map(column).collect();
    let all: Vec<Extra> = steps.iter().map(|step| step as Extra).chain(more.iter().copied()).collect();
    then(&all)
}

/// Finds lasting steps: index jumps are named and taken out, ratcheting is handed on.
pub(in crate::measurement) fn check(log: &mut Log, gear: &Gear, findings: &mut Findings) {
    let Some([sure, doubtful]) = Seen::of(log, gear).find() else { return };
    for (row, size, _) in &doubtful {
        findings.notes.push(format!(
            "line {}: the error steps by {:.1} arcsec; a jump of an encoder or a change of flank, which these data do \
             not tell",
            log.line[*row],
            size / ARCSEC
        ));
    }
    for (row, size, std) in sure {
        let size_arcsec = size / ARCSEC;
        if let Some(pitches) = whole_pitches(size, gear, WHOLE_PITCH, 5.0 * std) {
            let session = log.sessions().take_while(|rows| rows.end <= row).count();
            let (line, time_s) = (log.line[row], log.get(Quantity::Time).map(|time| time[row]));
            let (pitches, row) = (pitches as i32, row - log.around(row).start);
            findings.tooth_steps.push(ToothStep { session, row, line, time_s, size_arcsec, pitches });
            continue;
        }
        let fault = log.fault(FaultName::EncoderIndexJump, [row]);
        findings.add(fault, Quantity::Error, Treatment::Repaired, |fault| {
            (fault.size_arcsec, fault.until_s) = (Some(size_arcsec), None);
            format!(
                "the error steps by {size_arcsec:.1} arcsec (standard deviation {:.1}) within one row and stays \
                 there: an encoder has lost its index; the step is taken out",
                std / ARCSEC
            )
        });
        log.get_mut(Quantity::Error).into_iter().for_each(|error| add_steps(error, &[(row, size)], -1.0));
    }
}

/// A row into which the error steps, with the size and its standard deviation.
type Step = (usize, f64, f64);

/// A recording with what is known of it.
struct Seen<'a> {
    log: &'a Log,
    error: &'a [f64],
    generator: &'a [f64],
    gear: &'a Gear,
    /// White noise of the error, rad.
    noise: f64,
    state: StateModel<'a>,
    /// Rows at which clearance is taken up.
    settled: Vec<bool>,
    /// Largest torque, N·m.
    largest: f64,
}

impl<'a> Seen<'a> {
    fn of(log: &'a Log, gear: &'a Gear) -> Seen<'a> {
        let (error, generator) = (log.of(Quantity::Error), log.of(Quantity::Generator));
        let (noise, state) = (white_noise(log.pieces(error)), StateModel::new(log, gear));
        Seen { log, error, generator, gear, noise, settled: state.settled(), state, largest: largest_torque(log) }
    }

    /// Lasting steps, and those that may be a change of flank.
    fn find(&self) -> Option<[Vec<Step>; 2]> {
        let mut places = self.sudden();
        let mut rejected: Vec<usize> = Vec::new();
        let mut steps: Vec<Step> = Vec::new();
        for round in 0..ROUNDS {
            // Drop one by one what does not last, the weakest first.
            let fit = loop {
                let fit = with_columns(places.iter().copied(), &[], |columns| self.state.fit(columns))?;
                let first = fit.value.len() - places.len();
                let of_place = |(k, row): (usize, &usize)| (*row, fit.value[first + k], fit.std[first + k]);
                steps = places.iter().enumerate().map(of_place).collect();
                let strengths = steps.iter().map(|step| self.strength(*step)).enumerate();
                match strengths.min_by(|a, b| a.1.total_cmp(&b.1)) {
                    Some((k, strength)) if strength < 1.0 => rejected.push(places.remove(k)),
                    _ => break fit,
                }
            };
            if round + 1 == ROUNDS {
                break;
            }
            let known: Vec<usize> = places.iter().chain(&rejected).copied().collect();
            let more = self.standing_out(&fit, &places, &known);
            if more.is_empty() {
                break;
            }
            places.extend(more);
            places.sort_unstable();
        }
        let steps = lasting(self.log, steps);
        let (sure, doubtful) = steps.iter().copied().partition(|step| self.no_flank_was_changed(&steps, *step));
        Some([sure, doubtful])
    }

    /// The change of the error into a row.
    fn change(&self, row: usize) -> f64 {
        self.error[row] - self.error[row - 1]
    }

    /// The motion of the generator into a row, over the ratio.
    fn motion(&self, row: usize) -> f64 {
        ((self.generator[row] - self.generator[row - 1]) / self.gear.ratio).abs()
    }

    /// The change of the error into a row beyond that of a dwell, 0 if less. An output dwells after the generator
    /// turned back.
    fn beyond_dwell(&self, row: usize) -> f64 {
        let change = self.change(row);
        if self.settled[row] {
            return change;
        }
        change.signum() * (change.abs() - FASTER_THAN_DWELL * self.motion(row)).max(0.0)
    }

    /// Rows into which the error changes more than anything smooth explains, the largest changes first.
    fn sudden(&self) -> Vec<usize> {
        let changes: Vec<f64> = self.log.continued().map(|row| self.change(row)).collect();
        let usual = median_and_std(&mut sampled(&changes)).1;
        let least = (SUDDEN * usual.max(self.noise)).max(LEAST_RAD);
        let by = self.log.continued().map(|row| (row, self.beyond_dwell(row).abs()));
        largest(by.filter(|(_, by)| *by > least).collect(), &[])
    }

    /// Rows where means before and after differ more than they do elsewhere, in what state and known steps leave.
    fn standing_out(&self, fit: &StateFit, places: &[usize], known: &[usize]) -> Vec<usize> {
        let left = with_columns(places.iter().copied(), &[], |columns| self.state.left(fit, columns));
        let of_session = |left: &[f64]| -> Vec<f64> {
            let mut sums = vec![0.0; left.len() + 1];
            for row in 0..left.len() {
                sums[row + 1] = sums[row] + left[row];
            }
            let mean = |from: usize, to: usize| (sums[to] - sums[from]) / (to - from) as f64;
            let inside = |row: &usize| (WINDOW..=left.len().saturating_sub(WINDOW)).contains(row);
            let difference = |row: usize| mean(row, row + WINDOW) - mean(row - WINDOW, row);
            (0..left.len()).map(|row| Some(row).filter(inside).map_or(0.0, difference)).collect()
        };
        let differences: Vec<f64> = self.log.pieces(&left).flat_map(of_session).collect();
        let usual = median_and_std(&mut self.log.pieces(&differences).flat_map(sampled).collect::<Vec<_>>()).1;
        let least = (STANDS_OUT * usual).max(LEAST_RAD);
        let stands_out = |row: usize| {
            let size = differences[row];
            // Of the rows around, the one where it happens.
            let sharp = || self.beyond_dwell(row) * size.signum() > (1.0 - AGREES) * size.abs() - 4.0 * self.noise;
            (size.abs() > least && sharp()).then_some((row, size.abs()))
        };
        largest(self.log.continued().filter_map(stands_out).collect(), known)
    }

    /// At least 1 for a step that lasts, is sudden, and is the same in both views.
    fn strength(&self, (row, size, std): Step) -> f64 {
        let agrees = AGREES * size.abs() + 6.0 * self.noise + 0.5 * self.motion(row);
        let is_seen = size.abs() >= LEAST_RAD.max(SEEN * self.noise);
        let is_sudden = is_seen && (self.change(row) - size).abs() < agrees;
        let loaded = || self.load_changes(row) && whole_pitches(size, self.gear, WHOLE_PITCH, 0.0).is_none();
        if !is_sudden || loaded() || self.others_change_as_much(row, size) {
            return 0.0;
        }
        // Seen close by, so that a slow change is no step: medians of a few rows.
        let session = self.log.around(row);
        let few = 6.min(row - session.start).min(session.end - row);
        let near = &self.error[row - few..row + few];
        let local = level(near, few..2 * few) - level(near, 0..few);
        let mut paces: Vec<f64> = near.windows(2).map(|error| (error[1] - error[0]).abs()).collect();
        let moves = few as f64 * median_of(&mut paces);
        if (local - size).abs() > AGREES * size.abs() + LOCAL_NOISE * self.noise + moves {
            return 0.0;
        }
        size.abs() / (LASTS * std).max(1e-300)
    }

    /// Whether a step cannot be a change of flank: no clearance is so wide, or a load holds the flank there, and the
    /// step leaves clearly less than what may come in its place, together with the other steps: a step at the same
    /// angle, which goes back where the generator does, and the flank that the load last held.
    fn no_flank_was_changed(&self, steps: &[Step], (place, size, _): Step) -> bool {
        let torque = self.log.get(Quantity::Torque).filter(|_| self.largest > 0.0);
        let held = |row: usize| {
            let torque = torque?[row];
            Some(if torque.abs() >= HELD * self.largest { torque.signum() } else { 0.0 })
        };
        if size.abs() > WIDER_THAN_CLEARANCE_RAD {
            return true;
        }
        if held(place) == Some(0.0) {
            return false;
        }
        let last = |last: &mut f64, row: usize| {
            let before = if self.log.continues(row) { *last } else { 0.0 };
            *last = held(row).filter(|held| *held != 0.0).unwrap_or(before);
            Some(*last)
        };
        let flanks: Vec<f64> = (0..self.log.len()).scan(0.0, last).collect();
        let at_angle = |row: usize| f64::from(u8::from(self.generator[row] >= self.generator[place]));
        let of_load = |row: usize| flanks[row];
        let misfit = |this: Extra| {
            let others = steps.iter().map(|(other, ..)| *other).filter(|other| *other != place);
            with_columns(others, &[this], |columns| self.state.fit(columns)).map(|fit| fit.misfit)
        };
        let less = |other: Extra| misfit(&column(place)) < misfit(other).map(|other| CLEARLY_LESS * other);
        less(&at_angle) && less(&of_load)
    }

    /// Whether load changes at once, by more than its noise and its usual pace, near a row.
    fn load_changes(&self, row: usize) -> bool {
        self.log.get(Quantity::Torque).is_some_and(|torque| {
            let session = self.log.around(row);
            let near = |rows| &torque[row.saturating_sub(rows).max(session.start)..(row + rows).min(session.end)];
            let mut paces: Vec<f64> = near(50).windows(2).map(|t| (t[1] - t[0]).abs()).collect();
            let usual = (LOAD_STEP * self.largest)
                .max(LOAD_NOISE * white_noise([near(50)]))
                .max(LOAD_PACE * median_of(&mut paces));
            self.largest > 0.0 && near(4).windows(2).any(|t| (t[1] - t[0]).abs() > usual)
        })
    }

    /// Whether the error changes about as much in other rows near by: ringing, a change of speed, a traverse of the
    /// clearance.
    fn others_change_as_much(&self, row: usize, size: f64) -> bool {
        let session = self.log.around(row);
        let near = row.saturating_sub(APART).max(session.start + 1)..(row + APART + 1).min(session.end);
        near.filter(|k| *k != row).any(|k| self.change(k).abs() > 0.5 * size.abs())
    }
}

/// The steps without those that come and go by the same amount, which do not last: teeth and clearance that fast motion
/// samples once, a flank that drag turns over until the drive slows down. Each is taken back once, by its nearest
/// neighbours first.
fn lasting(log: &Log, mut steps: Vec<Step>) -> Vec<Step> {
    for long in 2..=steps.len() {
        let share = if long == 2 { TAKEN_BACK } else { TAKEN_BACK_TOGETHER };
        let cancel = |run: &[Step]| {
            let largest = run.iter().fold(0.0, |most: f64, (_, size, _)| most.max(size.abs()));
            run.iter().map(|(_, size, _)| size).sum::<f64>().abs() < share * largest
        };
        let apart = |run: &[Step]| {
            let (first, last) = (run[0].0, run[long - 1].0);
            (log.number(last) - log.number(first), last - first)
        };
        loop {
            let runs = steps.windows(long).enumerate().filter(|(_, run)| cancel(run));
            let Some((from, _)) = runs.min_by_key(|(_, run)| apart(run)) else { break };
            steps.drain(from..from + long);
        }
    }
    steps
}

/// The rows of the largest values, apart from each other and from those known.
fn largest(mut found: Vec<(usize, f64)>, known: &[usize]) -> Vec<usize> {
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut places: Vec<usize> = Vec::new();
    for (place, _) in found {
        let near = |other: &usize| other.abs_diff(place) < WINDOW / 2;
        if places.len() < AT_ONCE && !places.iter().chain(known).any(near) {
            places.push(place);
        }
    }
    places.sort_unstable();
    places
}

/// Largest torque of either sign, N·m; 0 where none was recorded.
pub(super) fn largest_torque(log: &Log) -> f64 {
    log.of(Quantity::Torque).iter().fold(0.0, |most: f64, torque| most.max(torque.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;

    /// Sizes of the steps that last, of steps in some rows.
    fn left(steps: &[(usize, f64)]) -> Vec<f64> {
        let steps = steps.iter().map(|(row, size)| (*row, *size, 0.1)).collect();
        lasting(&Log::default(), steps).into_iter().map(|(_, size, _)| size).collect()
    }

    #[test]
    fn a_step_is_taken_back_once_and_by_its_nearest_neighbour() {
        assert_eq!(left(&[(1287, -60.5), (1364, 60.4), (9000, 76.3)]), [76.3]);
        assert_eq!(left(&[(21, 47.2), (490, -45.7), (525, 46.4)]), [47.2]);
        assert_eq!(left(&[(21, 46.1), (80, 30.0)]), [46.1, 30.0]);
    }

    /// A session at rest with this error and torque in each row.
    fn session(error_rad: Vec<f64>, torque_n_m: Vec<f64>) -> Session {
        let rows = error_rad.len();
        Session {
            line: (0..rows as u64).collect(),
            time_s: None,
            generator_rad: vec![0.0; rows],
            error_rad,
            torque_n_m: Some(torque_n_m),
            ..Session::default()
        }
    }

    /// Sessions at rest but for slow waves of the generator, under a torque each. A light load leaves the flank where
    /// it is (friction); in the first session a counter slips once under load.
    fn flanks_that_friction_holds(slip_arcsec: f64) -> Vec<Session> {
        let mut random = fastrand::Rng::with_seed(11);
        let torques: [fn(f64) -> f64; 3] =
            [|x| 8.0 + 6.0 * (9.0 * x).sin(), |x| 2.4 * (x - 0.45) / 0.45, |x| 8.0 + 6.0 * (7.0 * x).cos()];
        let one = |(number, torque): (usize, &fn(f64) -> f64)| {
            let mut noise = || 2.0 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
            let mut flank = 0.0;
            let torque: Vec<f64> = (0..2000).map(|k| torque(f64::from(k) / 2000.0)).collect();
            let error = torque.iter().enumerate().map(|(k, torque)| {
                if torque.abs() > 0.9 || flank == 0.0 {
                    flank = torque.signum();
                }
                let slipped = if number > 0 || k >= 700 { slip_arcsec } else { 0.0 };
                ARCSEC * (7.0 * torque + 40.0 * flank + slipped + noise())
            });
            let mut one = session(error.collect(), torque.clone());
            one.generator_rad = (0..2000).map(|k| 30.0 * (6e-3 * f64::from(k)).sin()).collect();
            one.time_s = Some((0..2000).map(|k| 0.01 * f64::from(k)).collect());
            one
        };
        torques.iter().enumerate().map(one).collect()
    }

    #[test]
    fn a_large_slip_makes_no_slip_of_a_change_of_flank() {
        for slip_arcsec in [400.0, 3000.0] {
            let mut sessions = flanks_that_friction_holds(slip_arcsec);
            let change = (1..2000).find(|row| sessions[1].torque_n_m.as_ref().unwrap()[*row] > 0.9).unwrap();
            let gear = Gear::of_ratio(100.0);
            let steps = [(700, slip_arcsec * ARCSEC, ARCSEC), (2000 + change, 80.0 * ARCSEC, ARCSEC)];
            let mut findings = Findings::default();
            Log::on(&mut sessions, |log| {
                let seen = Seen::of(log, &gear);
                assert!(seen.no_flank_was_changed(&steps, steps[0]));
                assert!(!seen.no_flank_was_changed(&steps, steps[1]));
                check(log, &gear, &mut findings);
            });
            let found: Vec<u64> = findings.faults.iter().map(|fault| fault.first_line).collect();
            assert_eq!(found, [700], "{:?} {:?}", findings.faults, findings.notes);
        }
    }

    #[test]
    fn several_steps_that_end_where_they_began_do_not_last() {
        assert_eq!(left(&[(39, 46.1), (132, -19.3), (3067, -25.1)]), [0.0; 0]);
        assert_eq!(left(&[(39, 46.1), (132, -19.3), (3067, -10.1)]), [46.1, -19.3, -10.1]);
    }
}
