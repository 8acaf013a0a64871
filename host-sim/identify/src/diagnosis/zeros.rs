//! A bench that sets its zero anew in each session: reported as a fault of the data, with what each session's zero is.

use super::report::{FittedFault, Parameter};
use crate::measurement::{Fault, FaultName, Measures, Quantity, Recording, Treatment, throughout};
use flexspline_base::units::ARCSEC_PER_RAD;

/// The remedy where the zero is set anew.
const ADVICE: &str = "home to one mark before each session, or log the offset that is set";
/// Sessions whose offsets are printed, at most. *Guess*: they fill a line.
const SAID: usize = 12;

/// Tells a fault of the data that was found beside the causes, and takes it out of the error.
pub(super) fn tell_fitted(recording: &mut Recording, found: &FittedFault) {
    let Parameter { value, std } = found.size;
    let sessions = &mut recording.sessions;
    let fault = if found.name == FaultName::Drift {
        let times = || sessions.iter().flat_map(|session| session.time_s.iter().flatten().copied());
        let [Some(begin), Some(end)] = [times().next(), times().last()] else { return };
        let size_arcsec = value * (end - begin) / 3600.0;
        let Some(all) = throughout(sessions, found.name) else { return };
        let what = format!(
            "the zero of the error drifts by {size_arcsec:.1} arcsec in all, {value:.1} an hour (standard deviation \
             {std:.2}), or a load that is not recorded changes: a straight line in time is taken out"
        );
        for session in sessions {
            let rows = session.error_rad.iter_mut().zip(session.time_s.iter().flatten());
            rows.for_each(|(error, time)| *error -= value / 3600.0 * (time - 0.5 * (begin + end)) / ARCSEC_PER_RAD);
        }
        let measures = Measures { arcsec_per_hour: Some(value), ..Measures::default() };
        let (channel, treatment) = (Some(Quantity::Error), Treatment::Repaired);
        Fault { size_arcsec: Some(size_arcsec), measures, what, channel, treatment, ..all }
    } else {
        let session = &sessions[found.session];
        let begins = |row: &usize| match &session.time_s {
            Some(time) => time[*row] - time[0] >= found.since_s,
            None => *row as f64 >= found.since_s,
        };
        let Some(row) = (0..session.len()).find(begins) else { return };
        let then = format!("; the step (standard deviation {std:.1}) is taken out");
        let fault = Fault::lost_index(session, row, value, &then);
        let behind = sessions[found.session..].iter_mut().flat_map(|session| &mut session.error_rad).skip(row);
        behind.for_each(|error| *error -= value / ARCSEC_PER_RAD);
        fault
    };
    recording.faults.push(fault);
    recording.faults.sort_by_key(|fault| (fault.first_line, fault.name));
}

/// Tells the `zeros` of sessions, each less that of the first, and has them count as zeros of their own from here on. A
/// fault that was reported for some of them when the rows were read gives way to this one, which has them all.
pub(super) fn tell(recording: &mut Recording, zeros: &[Parameter]) {
    let of_some = |fault: &Fault| fault.name == FaultName::PositionJump && fault.measures.turns.is_none();
    let known = recording.faults.iter().any(of_some);
    let by_notes = recording.sessions.iter().skip(1).all(|session| session.own_zero) && !known;
    if zeros.len() < 2 || zeros.len() != recording.sessions.len() || by_notes {
        return;
    }
    recording.faults.retain(|fault| !of_some(fault));
    let all: Vec<f64> = (recording.sessions.iter().zip(zeros))
        .map(|(session, zero)| zero.value + session.zero_off_rad * ARCSEC_PER_RAD)
        .collect();
    let std = zeros.iter().map(|zero| zero.std).fold(0.0, f64::max);
    let largest = all.iter().map(|zero| zero - all[0]).fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
    let said: Vec<String> = all[1..].iter().take(SAID).map(|zero| format!("{:+.1}", zero - all[0])).collect();
    let more = if all.len() - 1 > said.len() { ", …" } else { "" };
    let sessions = if all.len() == 2 { "session 2".to_owned() } else { format!("sessions 2 to {}", all.len()) };
    let what = format!(
        "the zero of the error is another one in each session: that of {sessions} lies {}{more} arcsec (± {std:.1} at \
         most) beside that of the first, by no whole number of motor turns or tooth pitches, or a load that is not \
         recorded is another; the zero of each is fitted on its own",
        said.join(", ")
    );
    for session in recording.sessions.iter_mut().skip(1) {
        session.own_zero = true;
    }
    let Some(all) = throughout(&recording.sessions[1..], FaultName::PositionJump) else { return };
    let (size_arcsec, treatment) = (Some(largest), Treatment::Repaired);
    recording.faults.push(Fault { size_arcsec, treatment, what, advice: ADVICE, ..all });
    recording.faults.sort_by_key(|fault| (fault.first_line, fault.name));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Session;

    fn recording() -> Recording {
        let session = |k: u64| Session {
            line: (100 * k..100 * k + 50).collect(),
            generator_rad: vec![0.0; 50],
            error_rad: vec![0.0; 50],
            ..Session::default()
        };
        Recording::made("made.csv", (0..3).map(session).collect())
    }

    fn zeros(values: [f64; 3]) -> Vec<Parameter> {
        values.map(|value| Parameter { value, std: 0.4 }).to_vec()
    }

    #[test]
    fn the_zero_of_every_session_is_told_with_what_was_taken_off_it_before() {
        let mut two_far = recording();
        two_far.sessions[2].own_zero = true;
        two_far.sessions[2].zero_off_rad = 2000.0 / ARCSEC_PER_RAD;
        tell(&mut two_far, &zeros([0.0, 120.5, -3.25]));
        let [fault] = two_far.faults.as_slice() else { panic!("{:?}", two_far.faults) };
        assert_eq!((fault.name, fault.first_line, fault.last_line), (FaultName::PositionJump, 100, 249));
        assert!(fault.what.contains("+120.5, +1996.8 arcsec"), "{}", fault.what);
        assert!((fault.size_arcsec.unwrap() - 1996.75).abs() < 1e-9);
        assert!(two_far.sessions[1].own_zero && !two_far.sessions[0].own_zero);
    }

    #[test]
    fn zeros_that_a_log_says_itself_are_no_fault() {
        let mut guided = recording();
        guided.sessions[1].own_zero = true;
        guided.sessions[2].own_zero = true;
        tell(&mut guided, &zeros([0.0, 120.5, -3.25]));
        assert!(guided.faults.is_empty());
        let mut none = recording();
        tell(&mut none, &[]);
        assert!(none.faults.is_empty() && !none.sessions[1].own_zero);
    }
}
