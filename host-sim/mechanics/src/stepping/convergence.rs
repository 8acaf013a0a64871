//! When Newton is done: the residual of each iteration, what is enough, and how many there may be.

use super::problem::SolverSettings;

/// Layouts of the contact in one increment.
const MOST_LAYOUTS: usize = 3;
/// Iterations of one increment, all its parts and ways together.
pub(super) struct WorkLimit {
    done: usize,
    most: usize,
}

impl WorkLimit {
    pub fn new(settings: &SolverSettings) -> WorkLimit {
        WorkLimit { done: 0, most: settings.max_work }
    }

    pub(crate) fn is_left(&self) -> bool {
        self.done < self.most
    }
}

/// The residuals of Newton's iterations, relative to the contact forces.
pub(super) struct Convergence {
    pub history: Vec<f64>,
    /// Residual that is enough.
    tolerance: f64,
    /// Iterations for each layout of the contact, the last one that there may be, and layouts so far.
    most_iterations: usize,
    last_iteration: usize,
    layouts: usize,
    /// Every pair that was taken for open was looked at.
    pub looked_at_all: bool,
}

impl Convergence {
    pub fn new(tolerance: f64, most_iterations: usize) -> Convergence {
        Convergence {
            history: Vec::new(),
            tolerance,
            most_iterations,
            last_iteration: most_iterations,
            layouts: 0,
            looked_at_all: false,
        }
    }

    pub(crate) fn goes_on(&self) -> bool {
        self.history.len() <= self.last_iteration
    }

    /// Takes in the residual of an iteration.
    ///
    /// # Errors
    /// Why there is no going on with it.
    pub fn push(&mut self, relative: f64, work: &mut WorkLimit) -> Result<(), &'static str> {
        self.history.push(relative);
        work.done += 1;
        if work.done > work.most {
            return Err("the increment takes more work than it may");
        }
        if relative.is_finite() { Ok(()) } else { Err("the residual is not finite") }
    }

    pub(crate) fn relative(&self) -> f64 {
        self.history.last().copied().unwrap_or(f64::INFINITY)
    }

    pub(crate) fn is_met(&self) -> bool {
        self.relative() <= self.tolerance
    }

    /// How far the last iteration brought the residual down.
    pub fn gain(&self) -> f64 {
        match self.history[..] {
            [.., before, after] => after / before,
            _ => 1.0,
        }
    }

    /// A new layout of the contact is a new start, up to a few times.
    pub(crate) fn start_again(&mut self) {
        self.layouts += 1;
        if self.layouts <= MOST_LAYOUTS {
            self.last_iteration = self.history.len() + self.most_iterations;
        }
    }
}
