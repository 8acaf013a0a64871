//! Counts that leap: by whole turns of the motor in one row, or from one session to the next.
//!
//! A counter that begins anew, or wraps at a power of two, moves one column by whole turns while the other goes on as
//! it did. Teeth that skip move the output, and stay for the diagnosis. Between sessions nobody saw which of the two
//! columns moved.

use std::f64::consts::TAU;
use std::ops::Range;

use super::{ARCSEC, Findings, add_steps, extent, farthest, level, whole_pitches};
use crate::calibrate::MOST_ERROR_RAD;
use crate::measurement::columns::Quantity;
use crate::measurement::fault::{FaultName, Treatment};
use crate::measurement::gear::Gear;
use crate::measurement::log::Log;
use flexspline_base::robust::median_of;

/// A counter leaps by whole motor turns within this, turns. *Guess*: clearance and wind-up are a tenth of that.
const NEAR_TURNS: f64 = 0.2;
/// The column that leaps does so this many times more than the other. *Guess*: what both do is a motion.
const LEAPS_MORE: f64 = 3.0;
/// Before a leap the generator and the ratio times the output move alike, within this, rad in a row, … *Guess*: 41
/// arcsec of the output at a ratio of 100.
const TOGETHER_RAD: f64 = 0.02;
/// … and this share of the larger. *Guess*: a column that is frozen moves by nothing.
const TOGETHER: f64 = 0.3;
/// Rows before and after, for what is usual there. *Guess*: few, so that the pace is the same.
pub(super) const AROUND: usize = 3;
/// Rows at the end of a session and at the beginning of the next whose medians are compared. *Guess*: a median of eight
/// is not moved by two bad rows.
const LEVEL_ROWS: usize = 8;
/// A zero is another one if it is off by this beside what the load winds up, rad at the output: beyond any clearance.
/// *Guess*.
const OTHER_ZERO_RAD: f64 = 1500.0 * ARCSEC;
/// A jump that is off whole tooth pitches by this share of one, or less, is left to the diagnosis: teeth may have
/// skipped. *Guess*: wind-up that changes meanwhile is smaller.
const NEAR_PITCHES: f64 = 0.05;
/// A wrong ratio makes the error grow with the angle, between sessions too: by more than a tenth of this in a generator
/// turn, rad. *Guess*: 21 arcsec a turn, more than drifts and encoders do.
const SLOPE: f64 = 1e-3;

/// Change of a column into a row.
pub(super) fn moved(values: &[f64], row: usize) -> f64 {
    values[row] - values[row - 1]
}

/// Moves of a column in the rows around one, which is left out.
pub(super) fn moves_around(log: &Log, values: &[f64], row: usize) -> Vec<f64> {
    let near = row.saturating_sub(AROUND).max(1)..(row + AROUND + 1).min(values.len());
    near.filter(|k| *k != row && log.continues(*k)).map(|k| moved(values, k)).collect()
}

/// Finds rows into which the generator's angle leaps by whole turns, and takes these out.
pub(in crate::measurement) fn check(log: &mut Log, gear: &Gear, findings: &mut Findings) {
    let (Some(generator), Some(output)) = (log.get(Quantity::Generator), log.get(Quantity::Output)) else { return };
    let of_row = |row: usize| {
        let turns = whole_turns(moved(generator, row) - moved(output, row) * gear.ratio)?;
        let beyond_usual = |values: &[f64]| (moved(values, row) - median_of(&mut moves_around(log, values, row))).abs();
        let (by_generator, by_output) = (beyond_usual(generator), beyond_usual(output) * gear.ratio.abs());
        // A generator that was frozen leaps to where it is: before a leap both go on together.
        let before = |values: &[f64]| {
            let rows = row.saturating_sub(AROUND).max(1)..row;
            median_of(&mut rows.map(|k| moved(values, k)).collect::<Vec<f64>>())
        };
        let (psi, delta) = (before(generator), before(output) * gear.ratio);
        let together = (psi - delta).abs() <= TOGETHER_RAD + TOGETHER * psi.abs().max(delta.abs());
        (together && by_generator > LEAPS_MORE * by_output).then_some((row, turns))
    };
    let leaps: Vec<Turns> = log.continued().filter_map(of_row).collect();
    let times = if leaps.len() == 1 { "once".to_owned() } else { format!("in {} rows", leaps.len()) };
    take_turns_out(log, &leaps, FaultName::PositionJump, gear, findings, |largest| {
        format!(
            "the generator's angle leaps by whole turns ({largest:+.0} at most), {times}, while the output goes on: \
             the turns are taken out"
        )
    });
}

/// Sessions or turns that a message lists; of more it lists the first ones.
const LISTED: usize = 6;

fn listed(all: impl IntoIterator<Item = String>) -> String {
    let mut all = all.into_iter();
    let first: Vec<String> = all.by_ref().take(LISTED).collect();
    first.join(", ") + if all.next().is_some() { ", …" } else { "" }
}

/// A row, and the turns by which the generator's angle is off from it on.
type Turns = (usize, f64);

/// The whole motor turns, at least one, that an angle is, rad.
fn whole_turns(angle_rad: f64) -> Option<f64> {
    let turns = angle_rad / TAU;
    let whole = turns.abs() >= 1.0 - NEAR_TURNS && (turns - turns.round()).abs() <= NEAR_TURNS;
    whole.then_some(turns.round())
}

/// Takes turns out of the generator's angle, and reports them; `what` is said of the largest of them.
fn take_turns_out(
    log: &mut Log,
    leaps: &[Turns],
    name: FaultName,
    gear: &Gear,
    findings: &mut Findings,
    what: impl FnOnce(f64) -> String,
) {
    let largest = farthest(leaps.iter().map(|(_, turns)| *turns));
    let fault = log.fault(name, leaps.iter().map(|(row, _)| *row));
    findings.add(fault, Quantity::Generator, Treatment::Repaired, |fault| {
        fault.size_arcsec = Some(-largest * TAU / gear.ratio / ARCSEC);
        fault.measures.turns = Some(largest as i64);
        what(largest)
    });
    log.get_mut(Quantity::Generator).into_iter().for_each(|generator| add_steps(generator, leaps, -TAU));
}

/// Two sessions one after the other, and by how much a series changes from the last rows of one to the first of the
/// next.
fn between(sessions: &[Range<usize>]) -> impl Iterator<Item = (usize, impl Fn(&[f64]) -> f64)> {
    sessions.windows(2).map(|pair| {
        let (before, after) = (&pair[0], &pair[1]);
        let before = before.end.saturating_sub(LEVEL_ROWS).max(before.start)..before.end;
        let after = after.start..(after.start + LEVEL_ROWS).min(after.end);
        (after.start, move |values: &[f64]| level(values, after.clone()) - level(values, before.clone()))
    })
}

/// Finds sessions before which the generator's counter began anew, and puts the turns back; and those whose zero is
/// another one, by no whole turns or pitches, which is taken off.
pub(in crate::measurement) fn between_sessions(log: &mut Log, gear: &Gear, findings: &mut Findings) {
    let sessions: Vec<Range<usize>> = log.sessions().collect();
    let Some(error) = error_of(log, gear).filter(|_| sessions.len() > 1) else { return };
    let grows = grows(log.get(Quantity::Generator).unwrap_or_default(), &error, &sessions);
    let mut restarts: Vec<Turns> = Vec::new();
    // The rows at which sessions of another zero begin, with its change, rad.
    let mut others: Vec<(usize, f64)> = Vec::new();
    let torque = log.get(Quantity::Torque);
    let changes: Vec<(usize, f64, f64)> =
        between(&sessions).map(|(start, change)| (start, change(&error), torque.map_or(0.0, &change))).collect();
    let gives_way = gives_way(&changes);
    for (start, jump, load) in changes {
        let jump = jump - gives_way * load;
        if let Some(turns) = whole_turns(-jump * gear.ratio) {
            restarts.push((start, turns));
        } else if !grows && jump.abs() > OTHER_ZERO_RAD && whole_pitches(jump, gear, NEAR_PITCHES, 0.0).is_none() {
            others.push((start, jump));
        }
    }
    // One turn of the motor is two tooth pitches: alone it may be teeth that have skipped, and is left to the
    // diagnosis.
    if gear.tooth_pitch_rad.is_some() && restarts.iter().all(|(_, turns)| turns.abs() < 2.0) {
        for (start, _) in restarts.drain(..) {
            findings.notes.push(format!(
                "line {}: the error changes by one turn of the motor between two sessions: a counter that began anew, \
                 or teeth that have skipped, which these data do not tell",
                log.line[start]
            ));
        }
    }
    take_turns_out(log, &restarts, FaultName::CounterRestart, gear, findings, |_| {
        format!(
            "the generator's counter begins anew before {} of {} sessions, by {} turns of the motor: they are put back",
            restarts.len(),
            sessions.len(),
            listed(restarts.iter().map(|(_, turns)| format!("{turns:+.0}")))
        )
    });
    let largest_arcsec = farthest(others.iter().map(|(_, jump)| *jump)) / ARCSEC;
    let fault = log.fault(FaultName::PositionJump, others.iter().map(|(row, _)| *row));
    findings.add(fault, None::<Quantity>, Treatment::Repaired, |fault| {
        fault.size_arcsec = Some(largest_arcsec);
        format!(
            "the zero of {} sessions ({}) is another one, by up to {largest_arcsec:.0} arcsec, which is no whole \
             number of motor turns or tooth pitches: the zero of each is fitted on its own",
            others.len(),
            listed(others.iter().map(|(row, _)| (log.number(*row) + 1).to_string()))
        )
    });
    log.get_mut(Quantity::Output).into_iter().for_each(|output| add_steps(output, &others, -1.0));
    let taken_off = |off: &mut f64, (row, jump): &(usize, f64)| {
        *off += jump;
        Some((log.number(*row), *off))
    };
    log.zeros = others.iter().scan(0.0, taken_off).collect();
}

/// Output less generator over ratio; none where the error was recorded.
fn error_of(log: &Log, gear: &Gear) -> Option<Vec<f64>> {
    let rows = log.get(Quantity::Output)?.iter().zip(log.get(Quantity::Generator)?);
    Some(rows.map(|(output, psi)| output - psi / gear.ratio).collect())
}

/// What the error changes by between sessions with a newton metre of load, rad, where that alone is what it changes by
/// from session to session, as a drive winds up; else 0. Changes are those of a row, of the error, and of the load.
fn gives_way(changes: &[(usize, f64, f64)]) -> f64 {
    let most = farthest(changes.iter().map(|(.., load)| *load)).abs();
    let loaded = || changes.iter().filter(|(.., load)| load.abs() > 0.5 * most);
    let gives_way = median_of(&mut loaded().map(|(_, jump, load)| jump / load).collect::<Vec<f64>>());
    let alone = changes.iter().all(|(_, jump, load)| (jump - gives_way * load).abs() < OTHER_ZERO_RAD);
    if loaded().count() > 1 && alone && gives_way.abs() * most < MOST_ERROR_RAD { gives_way } else { 0.0 }
}

/// Whether the error grows with the angle within sessions, beyond what a drive does.
fn grows(generator: &[f64], error: &[f64], sessions: &[Range<usize>]) -> bool {
    let of = |(turned, changed): (f64, f64)| (turned > TAU).then_some(changed / turned);
    let mut slopes: Vec<f64> = sessions.iter().filter_map(|rows| of(extent(generator, error, rows.clone())?)).collect();
    median_of(&mut slopes).abs() > SLOPE / TAU / 10.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::fault::Fault;

    /// Ratio of the made-up drive. *Guess*: a round one; any would do.
    const RATIO: f64 = 100.0;

    /// A drive that turns on and on; `change` moves generator and output from row 500 on.
    fn log(gap: bool, by_generator: f64, by_output: f64) -> Log {
        let mut log = Log::default();
        log.line = (0..1000).collect();
        log.session = (0..1000).map(|k| u32::from(gap && k >= 500)).collect();
        let late = |k: i32| f64::from(u8::from(k >= 500));
        log.put(Quantity::Generator, (0..1000).map(|k| 0.1 * f64::from(k) + by_generator * late(k)).collect());
        let output = |k: i32| 0.001 * f64::from(k) + 3.0 * ARCSEC * f64::from(k % 3) + by_output * late(k);
        log.put(Quantity::Output, (0..1000).map(output).collect());
        log
    }

    fn found(log: &mut Log) -> (Vec<Fault>, Vec<(u32, f64)>) {
        let gear = Gear { tooth_pitch_rad: Some(TAU / 200.0), ..Gear::of_ratio(RATIO) };
        let mut findings = Findings::default();
        check(log, &gear, &mut findings);
        between_sessions(log, &gear, &mut findings);
        (findings.faults, log.zeros.clone())
    }

    fn generator_goes_on(log: &Log) -> bool {
        let generator = log.get(Quantity::Generator).unwrap();
        (1..1000).all(|row| (moved(generator, row) - 0.1).abs() < 1e-9)
    }

    #[test]
    fn a_count_that_leaps_by_turns_is_put_right_and_teeth_that_skip_are_not() {
        let mut leapt = log(false, -16.0 * TAU, 0.0);
        let (faults, _) = found(&mut leapt);
        assert_eq!((faults.len(), faults[0].name, faults[0].measures.turns), (1, FaultName::PositionJump, Some(-16)));
        assert!(generator_goes_on(&leapt));
        // Two pitches are one turn of the motor; here the output moves.
        assert!(found(&mut log(false, 0.0, TAU / RATIO)).0.is_empty());
        assert!(found(&mut log(false, 0.0, 0.0)).0.is_empty());
    }

    #[test]
    fn between_sessions_turns_are_put_back_pitches_stay_and_any_other_zero_is_told() {
        let mut restarted = log(true, 7.0 * TAU, 0.0);
        let (faults, others) = found(&mut restarted);
        assert_eq!((faults.len(), faults[0].name, faults[0].measures.turns), (1, FaultName::CounterRestart, Some(7)));
        assert!(generator_goes_on(&restarted) && others.is_empty());
        assert!(found(&mut log(true, 0.0, TAU / 200.0)).0.is_empty(), "one pitch");
        let (faults, others) = found(&mut log(true, 0.0, 0.0123));
        assert_eq!((faults.len(), faults[0].name, others.len(), others[0].0), (1, FaultName::PositionJump, 1, 1));
        assert!(faults[0].what.starts_with("the zero of 1 sessions (2) is another one"), "{}", faults[0].what);
        // Eight rows of motion are between the levels that are compared.
        assert!((others[0].1 - 0.0123).abs() < 1e-4, "{others:?}");
        // Of three sessions each has another load than the one before: the drive winds up.
        let mut loaded = log(true, 0.0, 0.0);
        let load = |k: u32| if k / 350 == 1 { 20.0 } else { -20.0 };
        loaded.session = (0..1000).map(|k| k / 350).collect();
        loaded.put(Quantity::Torque, (0..1000).map(load).collect());
        loaded.put(Quantity::Output, (0..1000).map(|k| 0.001 * f64::from(k) + 3e-4 * load(k)).collect());
        assert_eq!(found(&mut loaded), (vec![], vec![]));
        // Without them that is another zero of each.
        loaded.take(Quantity::Torque);
        assert_eq!(found(&mut loaded).1.len(), 2);
    }
}
