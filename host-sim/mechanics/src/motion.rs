//! Quasi-static motion of a drive: deformed by its generator, loaded, turned until it has settled, looked at.
//!
//! *When a drive has settled* is one rule for everything that samples steady motion. Since the generator last turned
//! back, and since the load last changed,
//!
//! * the output has followed: in some increment it turned by more than half of what the ratio says. Before that it
//!   stands, or creeps, while the clearance is crossed;
//! * if there is friction between the flanks, the generator has gone on for two flexspline pitches: every tooth that
//!   bore when the motion began has by then slipped as far as those that came after it do.
//!
//! Without friction nothing else remembers where the drive came from. Contact is elastic, and the drag of the output is
//! at its limit as soon as the output moves: the drive is in steady motion at the end of the increment in which it
//! follows.

use std::f64::consts::TAU;

use crate::stepping::{Increment, Problem, SolveError, Solver, State};
use crate::units::ARCSEC_PER_RAD;

/// Share of its nominal rate at which an output follows: it stands while clearance is crossed, then moves on at about
/// the whole.
const FOLLOWS: f64 = 0.5;
/// Pitches of motion after which flanks with friction have settled.
const PITCHES_WITH_FRICTION: f64 = 2.0;
/// Pitches after which a drive that has not settled never will. Of HHD-95 this is a clearance of 48′ at the output,
/// fifty times its own.
const MOST_PITCHES: f64 = 40.0;
/// Where else a drive is deformed that finds no equilibrium in its place, flexspline pitches before it.
const BESIDE_PITCHES: [f64; 3] = [0.3, -0.3, 1.4];

/// Pitches that a drive must at least move on before it has settled.
pub fn settling_pitches(friction_coefficient: f64) -> f64 {
    if friction_coefficient > 0.0 { PITCHES_WITH_FRICTION } else { 0.0 }
}

/// A drive in motion, with the solver that takes it along.
pub struct Motion<'p> {
    problem: &'p Problem,
    solver: Solver<'p>,
    state: State,
    last: Increment,
    travel: Travel,
}

/// One place on the way.
#[derive(Debug, Clone)]
pub struct SettledPlace {
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Output angle minus generator angle over the ratio, arc-seconds; positive when the output leads.
    pub error_arcsec: f64,
    /// The solver's report on the increment that ended here.
    pub increment: Increment,
}

/// Motion since it last began: since a reversal, a standstill or a change of load.
#[derive(Debug, Clone, Copy, Default)]
pub struct Travel {
    /// +1 forward, −1 backward, 0 at rest.
    sense: f64,
    travelled_rad: f64,
    /// Turn of the output in the last increment, as a share of what the ratio says.
    rate: f64,
    followed: bool,
}

impl<'p> Motion<'p> {
    /// The drive deformed with its generator at an angle, without load, its output in the middle of the clearance.
    ///
    /// # Errors
    /// No equilibrium.
    pub fn deformed(problem: &'p Problem, generator_rad: f64) -> Result<Motion<'p>, SolveError> {
        let mut solver = Solver::new(problem);
        let (state, last) = solver.deform(generator_rad)?;
        Ok(Motion { problem, solver, state, last, travel: Travel::default() })
    }

    /// The drive deformed at an angle where both flanks may come to bear at once, as they do of an eccentric drive:
    /// there Newton may go round in a circle, and the drive is deformed nearby and turned in. The output then need not
    /// be in the middle of its clearance.
    ///
    /// # Errors
    /// No equilibrium, neither there nor nearby.
    pub fn deformed_or_turned_in(problem: &'p Problem, generator_rad: f64) -> Result<Motion<'p>, SolveError> {
        let first = match Motion::deformed(problem, generator_rad) {
            Err(error) => error,
            done => return done,
        };
        let pitch = problem.flexspline.pitch();
        let turned_in = |pitches: &f64| {
            let mut motion = Motion::deformed(problem, generator_rad - pitches * pitch).ok()?;
            motion.to(generator_rad, 0.0).ok().map(|()| motion)
        };
        BESIDE_PITCHES.iter().find_map(turned_in).ok_or(first)
    }

    /// A state that was reached otherwise, by the increment `last`, and goes on from there.
    pub fn taken_over(problem: &'p Problem, state: State, last: Increment) -> Motion<'p> {
        Motion { problem, solver: Solver::new(problem), state, last, travel: Travel::default() }
    }

    /// The mechanical problem.
    pub fn problem(&self) -> &'p Problem {
        self.problem
    }

    /// Where the drive stands.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The increment that ended here, or the deforming.
    pub fn last(&self) -> &Increment {
        &self.last
    }

    /// Where the drive stands, as a place on its way.
    pub fn place(&self) -> SettledPlace {
        SettledPlace {
            generator_rad: self.state.generator_rad,
            error_arcsec: self.error_arcsec(),
            increment: self.last.clone(),
        }
    }

    /// Output angle minus generator angle over the ratio, rad; positive when the output leads.
    pub fn error_rad(&self) -> f64 {
        self.problem.error_rad(&self.state)
    }

    /// Error of the output in arc-seconds, positive when the output leads.
    pub fn error_arcsec(&self) -> f64 {
        self.error_rad() * ARCSEC_PER_RAD
    }

    /// Pitch of the flexspline, rad: the period of a drive that repeats from tooth to tooth.
    pub fn pitch(&self) -> f64 {
        TAU / f64::from(self.problem.drive.flexspline.teeth)
    }

    /// Deforms the drive anew, at another angle. What the solver remembers stays.
    ///
    /// # Errors
    /// No equilibrium.
    pub fn deform(&mut self, generator_rad: f64) -> Result<(), SolveError> {
        (self.state, self.last) = self.solver.deform(generator_rad)?;
        self.travel = Travel::default();
        Ok(())
    }

    /// Goes on from a state of this drive that was passed before. What the solver remembers stays.
    pub fn go_back(&mut self, state: State) {
        self.state = state;
        self.travel = Travel::default();
    }

    /// A solver that remembers nothing goes on from here.
    pub fn forget(&mut self) {
        self.solver = Solver::new(self.problem);
    }

    /// One increment to a generator angle and a load.
    ///
    /// # Errors
    /// No equilibrium; the drive stays where it was.
    pub fn to(&mut self, generator_rad: f64, torque_n_m: f64) -> Result<(), SolveError> {
        let (state, increment) = self.solver.increment(&self.state, generator_rad, torque_n_m)?;
        let turned = [state.generator_rad - self.state.generator_rad, state.output_rad - self.state.output_rad];
        let same_load = state.torque_n_m == self.state.torque_n_m;
        self.travel = self.travel.on(turned, same_load, self.problem.drive.ratio());
        (self.state, self.last) = (state, increment);
        Ok(())
    }

    /// Brings the load to a torque, the generator held.
    ///
    /// # Errors
    /// No equilibrium.
    pub fn load(&mut self, torque_n_m: f64) -> Result<(), SolveError> {
        self.to(self.state.generator_rad, torque_n_m)
    }

    /// Turns the generator to an angle under the load there is, in one increment.
    ///
    /// # Errors
    /// No equilibrium.
    pub fn turn_to(&mut self, generator_rad: f64) -> Result<(), SolveError> {
        self.to(generator_rad, self.state.torque_n_m)
    }

    /// Turns the generator on under the load there is, in one increment.
    ///
    /// # Errors
    /// No equilibrium.
    pub fn turn(&mut self, turn_rad: f64) -> Result<(), SolveError> {
        self.turn_to(self.state.generator_rad + turn_rad)
    }

    /// Turns the generator on by whole flexspline pitches ([`Solver::jump`]).
    ///
    /// # Errors
    /// No equilibrium; the drive stays where it was.
    pub fn jump(&mut self, generator_rad: f64) -> Result<(), SolveError> {
        (self.state, self.last) = self.solver.jump(&self.state, generator_rad)?;
        self.travel = Travel::default();
        Ok(())
    }

    /// Turns the generator on by `turn_rad` in equal increments; the place at the end of each.
    ///
    /// # Errors
    /// No equilibrium.
    pub fn turn_in(&mut self, turn_rad: f64, increments: usize) -> Result<Vec<SettledPlace>, SolveError> {
        let start = self.state.generator_rad;
        let at = |k: usize| start + turn_rad * k as f64 / increments as f64;
        (1..=increments)
            .map(|k| {
                self.turn_to(at(k))?;
                Ok(self.place())
            })
            .collect()
    }

    /// Whether the drive has settled, whichever way it goes.
    pub fn settled(&self) -> bool {
        self.travel.settled(settling_pitches(self.problem.drive.flanks.friction_coefficient) * self.pitch())
    }

    /// One more increment of `step_rad` towards steady motion in its sense; false and none once the drive has settled.
    ///
    /// # Errors
    /// No equilibrium; or the drive does not settle.
    pub fn settle_on(&mut self, step_rad: f64) -> Result<bool, SolveError> {
        let Travel { sense, travelled_rad, .. } = self.travel;
        if sense == step_rad.signum() {
            if self.settled() {
                return Ok(false);
            }
            let pitches = travelled_rad / self.pitch();
            if pitches > MOST_PITCHES {
                return Err(self.not_settled(pitches));
            }
        }
        let before = self.state.generator_rad;
        self.turn(step_rad)?;
        // A step that round-off swallows leads nowhere, however many there are.
        if self.state.generator_rad == before {
            return Err(self.not_settled(0.0));
        }
        Ok(true)
    }

    fn not_settled(&self, pitches: f64) -> SolveError {
        let State { generator_rad, torque_n_m, .. } = self.state;
        SolveError::NotSettled { generator_rad, torque_n_m, pitches, rate: self.travel.rate }
    }

    /// Moves on by increments of `step_rad` until the drive has settled.
    ///
    /// # Errors
    /// No equilibrium; or the drive does not settle.
    pub fn settle(&mut self, step_rad: f64) -> Result<(), SolveError> {
        while self.settle_on(step_rad)? {}
        Ok(())
    }
}

impl Travel {
    /// The motion after an increment that turned generator and output by these angles.
    pub fn on(self, [turn_rad, output_turn_rad]: [f64; 2], same_load: bool, ratio: f64) -> Travel {
        if turn_rad == 0.0 {
            return Travel::default();
        }
        let goes_on = same_load && turn_rad.signum() == self.sense;
        let before = if goes_on { self } else { Travel::default() };
        let rate = output_turn_rad * ratio / turn_rad;
        Travel {
            sense: turn_rad.signum(),
            travelled_rad: before.travelled_rad + turn_rad.abs(),
            rate,
            followed: before.followed || rate > FOLLOWS,
        }
    }

    /// Whether the drive has settled, which must at least have moved on by this angle.
    pub fn settled(&self, least_rad: f64) -> bool {
        self.followed && self.travelled_rad >= least_rad * (1.0 - 1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, FewNumbers, GeneratorKind};
    use crate::mesh::MeshLevel;
    use crate::stepping::SolverSettings;

    fn problem(change: impl FnOnce(&mut Drive)) -> Problem {
        let mut drive = Drive::hhd_95();
        change(&mut drive);
        let settings = SolverSettings::fast(MeshLevel::Coarse);
        Problem::new(&drive, GeneratorKind::Cam, drive.temperature.reference_c, settings).unwrap()
    }

    /// Errors where the drive has just settled, and where it stands five whole pitches further, arcsec.
    fn at_once_and_later(problem: &Problem, torque_n_m: f64, sense: f64) -> (f64, f64) {
        let mut motion = Motion::deformed(problem, 0.0).unwrap();
        motion.load(torque_n_m).unwrap();
        let step = sense * motion.pitch() / 8.0;
        motion.settle(step).unwrap();
        let at_once = motion.error_arcsec();
        let later = motion.turn_in(40.0 * step, 40).unwrap();
        (at_once, later[39].error_arcsec)
    }

    /// A perfect drive repeats every pitch: what has settled is the same any number of pitches later.
    #[test]
    #[ignore = "long: tests/run slow"]
    fn what_has_settled_stays_as_it_is() {
        let smooth = problem(|_| ());
        let rough = problem(|drive| drive.flanks.friction_coefficient = 0.08);
        for (what, problem, torque, bound) in [
            ("no load", &smooth, 0.0, 1e-3),
            ("50 N·m", &smooth, 50.0, 1e-3),
            ("no load, friction", &rough, 0.0, 0.02),
            ("50 N·m, friction", &rough, 50.0, 0.02),
        ] {
            for sense in [1.0, -1.0] {
                let (at_once, later) = at_once_and_later(problem, torque, sense);
                println!(
                    "{what}, sense {sense}: {at_once:.5}\" as soon as it has settled, {later:.5}\" five pitches later"
                );
                assert!((at_once - later).abs() < bound, "{what}: {at_once} and {later}");
            }
        }
    }

    /// Under no load the output stands until the generator has crossed the clearance, and again after a reversal.
    #[test]
    fn a_drive_that_crosses_its_clearance_has_not_settled() {
        let problem = problem(|_| ());
        let mut motion = Motion::deformed(&problem, 0.0).unwrap();
        let step = motion.pitch() / 8.0;
        motion.turn(step).unwrap();
        assert!(!motion.settled());
        motion.settle(step).unwrap();
        let forward = motion.error_arcsec();
        // Half of the clearance, 0.987' / 2, is 0.41 pitches of the generator.
        let travelled = motion.state().generator_rad / motion.pitch();
        assert!((0.4..0.7).contains(&travelled), "{travelled}");
        assert!(!motion.settle_on(step).unwrap());
        motion.turn(-step).unwrap();
        assert!(!motion.settled());
        motion.settle(-step).unwrap();
        let backlash = motion.error_arcsec() - forward;
        assert!((54.0..64.0).contains(&backlash), "{backlash}");
    }

    /// Flanks worn by 0.2 mm leave 62′ of clearance, 51 pitches: what did not settle, where and by how much.
    #[test]
    fn a_drive_that_does_not_settle_is_an_error_that_says_so() {
        let problem = problem(|drive| {
            drive.as_built.flexspline_wear_um = 200.0;
            drive.as_built.circular_spline_wear_um = 200.0;
        });
        let mut motion = Motion::deformed(&problem, 0.0).unwrap();
        let step = motion.pitch() / 2.0;
        motion.settle(-step).unwrap();
        let from = motion.state().generator_rad;
        let error = motion.settle(step).unwrap_err();
        println!("{error}");
        let SolveError::NotSettled { generator_rad, torque_n_m, pitches, rate } = error else { panic!("{error}") };
        assert!((pitches - 40.5).abs() < 1e-6 && torque_n_m == 0.0 && rate.abs() < 0.01);
        assert!((generator_rad - from - 81.0 * step).abs() < 1e-9);
    }

    /// Two rollers in a soft bearing creep to where they stand: of a CSG-32-120 with cup and balls in proportion, with
    /// a rim of 1.05 mm, where 0.8 and 1.3 mm take half of the iterations.
    #[test]
    fn a_drive_that_creeps_is_deformed_with_patience() {
        let few =
            FewNumbers { teeth: 240, module_mm: 2.54 * 32.0 / 240.0, bore_mm: None, generator: GeneratorKind::Cam };
        let sets = [
            "sleeve.kind=cup",
            "sleeve.bottom=plate",
            "sleeve.wall_mm=0.894",
            "sleeve.bottom_side_mm=23.3",
            "sleeve.bottom_thickness_mm=1.788",
            "sleeve.hub_radius_mm=20.3",
            "generator.bearing_stiffness_n_per_mm3=181",
            "flexspline.rim_thickness_mm=1.05",
        ];
        let drive = few.drive("creeps").unwrap().drive.with_sets(sets).unwrap();
        let settings = SolverSettings::fast(MeshLevel::Coarse);
        let problem = Problem::new(&drive, GeneratorKind::TwoRoller, drive.temperature.reference_c, settings).unwrap();
        let motion = Motion::deformed(&problem, 0.0).unwrap();
        println!("{} iterations", motion.last().iterations);
        assert!(motion.last().iterations > settings.max_iterations);
        assert!(motion.error_arcsec().abs() < 1.0, "{}", motion.error_arcsec());
    }

    /// Two rollers in a hat leave the teeth of this drive no play: they bear before there is a load. Softened they
    /// would wedge.
    #[test]
    fn teeth_that_bind_without_load_take_a_light_touch() {
        let kind = GeneratorKind::TwoRoller;
        let few = FewNumbers { teeth: 164, module_mm: 0.186, bore_mm: None, generator: kind };
        let sets = [
            "flexspline.rim_thickness_mm=0.2926",
            "sleeve.kind=hat",
            "sleeve.wall_mm=0.1623",
            "sleeve.flange_side_mm=19.4706",
            "sleeve.bottom_side_mm=19.4706",
            "sleeve.bottom_thickness_mm=0.649",
            "sleeve.hub_radius_mm=6.4902",
        ];
        let drive = few.drive("binds").unwrap().drive.with_sets(sets).unwrap();
        let settings = SolverSettings { max_halvings: 0, ..SolverSettings::fast(MeshLevel::Coarse) };
        let problem = Problem::new(&drive, kind, drive.temperature.reference_c, settings).unwrap();
        let mut motion = Motion::deformed(&problem, 0.0).unwrap();
        assert_eq!(motion.last().flank_contacts, 4);
        motion.load(2.0 * drive.output.drag_torque_n_m).unwrap();
        assert!((0.01..0.5).contains(&motion.error_arcsec()), "{}", motion.error_arcsec());
    }
}
