//! Tips that pass one another freely under load.
//!
//! Teeth drawn to clear one another when rigid may clash when the drive is loaded. The rim turns in its cup, the lobes
//! give way on their balls, and beside the teeth in mesh, where tips of both wheels just pass one another 40° to 60°
//! from the major axis, these displacements add up: the clearance there, a few micrometres, is gone before the load is
//! all there. Tips that are lower reach past one another later, nearer to the major axis, where the spaces are wide.
//! How much lower follows from the contact FEM of the drive itself: by what the tips that bear reach past one another,
//! and by how the load on them falls from run to run.

use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Increment, Problem, SolveError, SolverSettings, State};

use crate::simulate::TipContact;
use crate::simulate::zones::MOST_MODULES;

/// Places over a tooth pitch at which tips are looked at, where one tooth after another comes by. A guess.
const PLACES: usize = 6;
/// Times that tips are lowered at most: the sizes of a catalogue take 2 to 4. A guess.
const MOST_STEPS: usize = 6;
/// Extra relief beyond the overlap of the tips, modules. A guess: half a tip rounding, for the places
/// between those that are looked at (a CSG-25-100 lowered by 0.006 more than needed at four places bears at a fifth).
const MORE_MODULES: f64 = 0.03;
/// Largest relief from two runs together, modules. A guess: the load on tips is not everywhere in
/// proportion to what they reach (of a CSG-40-120 0.45 modules were taken off at once where 0.2 do).
const MOST_AT_ONCE_MODULES: f64 = 0.1;
/// Share of their load as drawn that lower tips leave at most, or they stay as drawn. A guess: half. With two rollers
/// 0.6 modules leave nine tenths of it (100 teeth of module 0.6), with four a fortieth (200 of 0.32).
const HELPS: f64 = 0.5;
/// Newton iterations for the load under which tips are looked at, before the drive counts as one that does not bear it.
/// *Chosen*: loads that 23 drives of one's own bear took 103 at most; one that none bears took 80 s of processor
/// without this limit, and takes 6.
const MOST_WORK: usize = 300;

/// Result of the relief of a drive's tips.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relief {
    /// Radius of the flexspline's tip circle with which they were looked at last, mm.
    pub tip_radius_mm: f64,
    /// Relief, mm; 0 where they passed freely as drawn.
    pub lowered_mm: f64,
    /// Remaining contact of tips.
    pub left: Option<TipContact>,
}

/// Lowers the tips of a drive's flexspline until they pass those of the circular spline freely under a load; they are
/// only looked at where `may_lower` is false or it does not help ([`TipContact::relief_step_mm`]). `report` is called
/// before each run with what is done.
///
/// # Errors
/// No equilibrium.
pub fn relieve_tips(
    drive: &Drive,
    kind: GeneratorKind,
    torque_n_m: f64,
    may_lower: bool,
    report: &mut dyn FnMut(&str),
) -> Result<Relief, SolveError> {
    let module_mm = drive.flexspline.module_mm;
    let mut drive = drive.clone();
    let drawn_mm = drive.flexspline.tip_radius_mm;
    let (mut drawn, mut left, mut loaded) = (None, None, None);
    // Tips and the share of the load on them, one run ago.
    let mut before: Option<(f64, f64)> = None;
    for step in 0..=MOST_STEPS {
        let tip_radius_mm = drive.flexspline.tip_radius_mm;
        report(&format!("{torque_n_m} N·m, tips at {tip_radius_mm} mm"));
        left = tips_that_bear(&drive, kind, torque_n_m, &mut loaded)?;
        drawn = drawn.or(left);
        let Some(tips) = left.filter(|tips| may_lower && tips.relief_step_mm > 0.0 && step < MOST_STEPS) else { break };
        // The share falls in proportion to what is taken off: two runs say where it ends.
        let to_none_mm = before
            .filter(|(_, share)| *share > tips.share)
            .map_or(0.0, |(from_mm, share)| (from_mm - tip_radius_mm) * tips.share / (share - tips.share));
        before = Some((tip_radius_mm, tips.share));
        let lower_mm = tips.reach_mm.max(to_none_mm.min(MOST_AT_ONCE_MODULES * module_mm)) + MORE_MODULES * module_mm;
        let to_mm = (1e4 * (tip_radius_mm - lower_mm).max(drawn_mm - MOST_MODULES * module_mm)).floor() / 1e4;
        if to_mm >= tip_radius_mm {
            break;
        }
        drive.flexspline.tip_radius_mm = to_mm;
    }
    let helps = left.zip(drawn).is_none_or(|(left, drawn)| left.share < HELPS * drawn.share);
    let (tip_radius_mm, left) = if helps { (drive.flexspline.tip_radius_mm, left) } else { (drawn_mm, drawn) };
    Ok(Relief { tip_radius_mm, lowered_mm: drawn_mm - tip_radius_mm, left })
}

/// Contact of tips outside the teeth in mesh over a tooth pitch under a load, on a coarse mesh; the first place that
/// has it. `loaded` is where the drive stands under its load at first; of one that was looked at before, with other
/// tips, that shows the way to it.
///
/// # Errors
/// No equilibrium.
pub(crate) fn tips_that_bear(
    drive: &Drive,
    kind: GeneratorKind,
    torque_n_m: f64,
    loaded: &mut Option<(State, Increment)>,
) -> Result<Option<TipContact>, SolveError> {
    let fast = SolverSettings::fast(MeshLevel::Coarse);
    let settings = SolverSettings { load_step_n_m: f64::INFINITY, max_work: MOST_WORK, ..fast };
    let problem = Problem::new(drive, kind, drive.temperature.reference_c, settings)?;
    let before = loaded.take().and_then(|(state, last)| {
        let mut motion = Motion::taken_over(&problem, state, last);
        motion.load(torque_n_m).ok().map(|()| motion)
    });
    let mut motion = before.map_or_else(|| Motion::deformed_or_turned_in(&problem, 0.0), Ok)?;
    motion.load(torque_n_m)?;
    *loaded = Some((motion.state().clone(), motion.last().clone()));
    for place in 0..PLACES {
        motion.turn_to(motion.pitch() * place as f64 / PLACES as f64)?;
        let found = TipContact::at(&problem, motion.state()).filter(TipContact::counts);
        if found.is_some() {
            return Ok(found);
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive whose tips pass one another freely keeps them.
    #[test]
    fn tips_that_pass_freely_stay_as_drawn() {
        let drive = Drive::hhd_95();
        let mut runs = 0;
        let relief = relieve_tips(&drive, GeneratorKind::Cam, 100.0, true, &mut |_| runs += 1).unwrap();
        assert_eq!((relief.lowered_mm, relief.left, runs), (0.0, None, 1));
    }

    /// Tips that are a tenth of a module too high clash under a load; those that may not be lowered are reported,
    /// others are lowered until they pass.
    #[test]
    fn tips_that_clash_are_lowered_or_told() {
        let drive = Drive::cup_95().with_set("generator.bearing_stiffness_n_per_mm3=150").unwrap();
        let mut high = drive.clone();
        high.flexspline.tip_radius_mm += 0.1 * drive.flexspline.module_mm;
        let run = |may_lower| relieve_tips(&high, GeneratorKind::Cam, 200.0, may_lower, &mut |_| ()).unwrap();
        let relief = run(false);
        assert!(relief.lowered_mm == 0.0 && relief.left.is_some_and(|tips| tips.share > 0.0 && tips.reach_mm > 0.0));
        let lowered = run(true);
        assert!(lowered.left.is_none() && lowered.lowered_mm > 0.0);
    }
}
