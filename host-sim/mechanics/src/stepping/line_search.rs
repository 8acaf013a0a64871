//! How far along a Newton step: halved while the forces along it turn round.

use super::continuation::ContactStage;
use super::convergence::Convergence;
use super::problem::Problem;
use super::slip::NodalField;
use super::step::Unbalance;

/// Share of the force along a step that may act back at its end. Where contact opens and closes with each step,
/// iterations that give back nearly all they took go round in a circle: after this number they may give back less.
/// (Straight teeth that wedge in a cup, loaded to 24 N·m.)
const RETURNS: f64 = 0.9;
const RETURNS_LITTLE: f64 = 0.3;
const GOES_ROUND_AFTER: usize = 25;

/// Largest change of a displacement that an undamped Newton step may make, modules: a drive twice as large goes the
/// same way.
const LARGEST_STEP: f64 = 0.2;

/// Halvings of a step after which the pairs that were open are looked at again before it is made shorter still: far
/// from equilibrium a flank may come past the tip of a space, where its gap changes by more than it moves, and bear in
/// a state that took it for open. Not while the drive is assembled: from so far off a step that took in all that bears
/// may carry every flank out of reach, and then nothing holds an output without drag.
const LOOKS_BACK_AT: usize = 5;

/// Relative residual below which steps are taken whole: what is left is near round-off.
const ROUND_OFF: f64 = 1e-6;

/// Halvings of a step along which forces turn round: it is taken then as it is.
pub(super) const MOST_TRIALS: usize = 10;

/// A step that is tried.
pub(super) struct LineSearch {
    /// Largest displacement of an undamped step, mm.
    largest_mm: f64,
    may_look_back: bool,
    /// Share of the step that is tried, and that of the last one taken.
    pub length: f64,
    last_length: f64,
    /// Force along the step at its beginning, and the least one that is allowed at its end.
    before: f64,
    least: f64,
    /// The step is taken however forces turn.
    near_round_off: bool,
    /// The step is that of a tangent of an earlier pitch.
    pub recalled: bool,
    /// Pairs were looked at again.
    pub looked_back: bool,
}

/// Verdict on a step that was tried.
pub(super) enum Trial {
    Taken,
    Halved,
    /// Its tangent knows the wrong contact.
    Mistaken,
}

impl LineSearch {
    pub fn new(problem: &Problem, stage: ContactStage) -> LineSearch {
        LineSearch {
            largest_mm: LARGEST_STEP * problem.drive.flexspline.module_mm,
            may_look_back: !stage.assembling,
            length: 1.0,
            last_length: 1.0,
            before: 0.0,
            least: 0.0,
            near_round_off: false,
            recalled: false,
            looked_back: false,
        }
    }

    /// Begins with a step. The force along it falls to nothing at the end of a perfect one; far beyond, halve it.
    pub fn begin(&mut self, step: &NodalField, residual: &Unbalance, convergence: &Convergence) {
        self.before = step.work(residual);
        let goes_round = convergence.history.len() > GOES_ROUND_AFTER;
        self.least = -(if goes_round { RETURNS_LITTLE } else { RETURNS }) * self.before;
        self.near_round_off = convergence.relative() < ROUND_OFF;
        self.length = (self.largest_mm / step.largest()).min(1.0).min(8.0 * self.last_length);
    }

    /// Verdict on the step by the residual at its end.
    pub(crate) fn judge(&mut self, trial: usize, step: &NodalField, residual: &Unbalance) -> Trial {
        let overshoot = self.before > 0.0 && step.work(residual) < self.least;
        if !overshoot || self.near_round_off || trial == MOST_TRIALS {
            self.last_length = self.length;
            self.looked_back = false;
            return Trial::Taken;
        }
        if self.recalled || (trial == LOOKS_BACK_AT && !self.looked_back && self.may_look_back) {
            self.looked_back = !self.recalled;
            self.recalled = false;
            return Trial::Mistaken;
        }
        self.length *= 0.5;
        Trial::Halved
    }
}
