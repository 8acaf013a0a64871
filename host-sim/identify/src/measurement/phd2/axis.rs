//! Where the hour axis of the mount stands in each section of a guide log, and so its generator.
//!
//! ```text
//! axis (turns) = hour angle / 24 h + half a turn on the west side of the pier
//! ```
//!
//! While the mount tracks, the axis follows the sidereal clock: axis less clock is one number for each target. Hour
//! angles are written to 0.01 h, which is a good part of a generator turn; the clock is known to a second. So sections
//! whose hour angles agree with the clock within what is written are of one target, and the mean of them says where it
//! is. A slew is another target, with the hour angles of its own sections.

use super::SIDEREAL_DAY_S;
use super::text::WrittenNumber;

/// Hours of a turn, by definition.
const HOURS: f64 = 24.0;
/// Two hour angles that are rounded differ by up to one step of what is written; and a clock by a second, which is 0.03
/// of one. *Source*.
const STEPS_APART: f64 = 1.1;

/// Where the mount points, as a section says it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pointing {
    /// When it begins, s.
    pub begins_s: f64,
    /// Hours.
    pub hour_angle: Option<WrittenNumber>,
    /// Whether the tube is west of the pier.
    pub west: bool,
}

/// A target: axis less clock, turns, as the mean of n sections, known to `within`.
struct Target {
    offset: f64,
    sections: f64,
    within: f64,
}

/// A part of a turn, the shorter way.
fn shorter(turns: f64) -> f64 {
    turns - turns.round()
}

/// Where the axis stands as each section begins, turns; and what has to be said of it.
pub(super) fn stands(sections: &[Pointing], ratio: f64) -> (Vec<f64>, Vec<String>) {
    let clock = |section: &Pointing| section.begins_s / SIDEREAL_DAY_S;
    let mut targets: Vec<Target> = Vec::new();
    let target_of = |section: &Pointing| {
        let WrittenNumber { value, decimals } = section.hour_angle?;
        let axis = value / HOURS + if section.west { 0.5 } else { 0.0 };
        let within = 10f64.powi(-decimals) / HOURS;
        let apart = |target: &Target| shorter(axis - clock(section) - target.offset);
        let same = targets.iter().position(|t| apart(t).abs() <= STEPS_APART * within.max(t.within));
        let place = same.unwrap_or_else(|| {
            targets.push(Target { offset: axis - clock(section), sections: 0.0, within });
            targets.len() - 1
        });
        let target = &mut targets[place];
        target.sections += 1.0;
        target.offset += shorter(axis - clock(section) - target.offset) / target.sections;
        Some((place, axis))
    };
    let of: Vec<Option<(usize, f64)>> = sections.iter().map(target_of).collect();
    let said = |(section, of): (&Pointing, &Option<(usize, f64)>)| {
        of.map(|(place, axis)| axis + shorter(targets[place].offset - (axis - clock(section))))
    };
    let said: Vec<Option<f64>> = sections.iter().zip(&of).map(said).collect();
    // What says nothing goes on with the section before it; what comes before all that say something, with the first of
    // them.
    let known = said.iter().position(Option::is_some);
    let first = sections.get(known.unwrap_or(0)).map_or(0.0, clock);
    let mut last = (known.and_then(|known| said[known]).unwrap_or(first.rem_euclid(1.0)), first);
    let stand = |(section, said): (&Pointing, Option<f64>)| {
        let here = said.unwrap_or(last.0 + clock(section) - last.1);
        last = said.map_or(last, |said| (said, clock(section)));
        here
    };
    let stands = sections.iter().zip(said).map(stand).collect();
    let mut notes = Vec::new();
    if known.is_none() {
        notes.push(
            "no hour angle is said: the generator's angle follows the clock, as that of a mount that tracks on \
             without a slew"
                .to_owned(),
        );
    } else if targets.len() > 1 {
        let half = targets.iter().map(|target| 0.5 * target.within).fold(0.0, f64::max);
        let flipped = sections.iter().any(|s| s.west) && !sections.iter().all(|s| s.west);
        notes.push(format!(
            "the mount points at {} targets: where its generator stands for each is taken from the hour angle, which \
             is written so that this is known to {:.0} deg{}",
            targets.len(),
            (360.0 * ratio * half).abs().min(180.0),
            if flipped { "; on the other side of the pier the axis is taken half a turn farther" } else { "" }
        ));
    }
    (stands, notes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(begins_s: f64, hours: Option<f64>, west: bool) -> Pointing {
        Pointing { begins_s, hour_angle: hours.map(|value| WrittenNumber { value, decimals: 2 }), west }
    }

    fn turns(sections: &[Pointing]) -> Vec<f64> {
        stands(sections, 100.0).0
    }

    const DAY: f64 = SIDEREAL_DAY_S;

    #[test]
    fn a_mount_that_tracks_on_follows_the_clock_whatever_hour_angles_are_rounded_to() {
        let true_hours = |t: f64| -1.304 + HOURS * t / DAY;
        let begins = [1e9, 1e9 + 700.0, 1e9 + 4321.0];
        let rounded = |t: &f64| at(*t, Some((100.0 * true_hours(t - 1e9)).round() / 100.0), false);
        let sections: Vec<Pointing> = begins.iter().map(rounded).collect();
        let found = turns(&sections);
        for (k, t) in begins.iter().enumerate() {
            // 1e9 s are 1e4 turns, of which a double resolves 2e-12.
            assert!((found[k] - found[0] - (t - 1e9) / DAY).abs() < 1e-11, "{found:?}");
        }
        // The mean of three is nearer to the truth than a step.
        assert!((found[0] - true_hours(0.0) / HOURS).abs() < 0.005 / HOURS, "{found:?}");
        assert_eq!(stands(&sections, 100.0).1, Vec::<String>::new());
    }

    #[test]
    fn a_slew_a_flip_and_the_way_back_are_seen() {
        let sections = [
            at(0.0, Some(-2.0), false),
            at(3600.0, Some(3.0), false),
            at(7200.0, Some(7200.0 / DAY * HOURS - 2.0), false),
            at(9000.0, Some(9000.0 / DAY * HOURS - 2.0), true),
        ];
        let found = turns(&sections);
        let due = [-2.0 / HOURS, 3.0 / HOURS, 7200.0 / DAY - 2.0 / HOURS, 9000.0 / DAY - 2.0 / HOURS + 0.5];
        assert!(found.iter().zip(due).all(|(found, due)| (found - due).abs() < 1e-6), "{found:?}");
        let (_, notes) = stands(&sections, 100.0);
        assert!(notes[0].contains("3 targets") && notes[0].contains("8 deg") && notes[0].contains("half a turn"));
    }

    #[test]
    fn sections_without_an_hour_angle_go_on_with_those_beside_them() {
        let found = turns(&[at(0.0, None, false), at(1000.0, Some(1.0), false), at(3000.0, None, false)]);
        assert!((found[0] - (1.0 / HOURS - 1000.0 / DAY)).abs() < 1e-12, "{found:?}");
        assert!((found[2] - (1.0 / HOURS + 2000.0 / DAY)).abs() < 1e-12, "{found:?}");
        // The clock alone: two files of a night agree.
        let night = [at(10.0 * DAY + 500.0, None, false), at(10.0 * DAY + 2500.0, None, false)];
        let (found, notes) = stands(&night, 100.0);
        assert!((found[1] - turns(&night[1..])[0]).abs() < 1e-9, "{found:?}");
        assert!(notes[0].contains("no hour angle"));
        assert!(turns(&[]).is_empty());
    }
}
