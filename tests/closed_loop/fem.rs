//! Contact FEM in the loop: the check of the dense map and of its law of play.
//!
//! The FEM goes on by an increment whenever the generator or the load has moved by more than a window, with its own
//! Coulomb drag and its own contact, and its output angle is what the loop sees. Between two increments the output
//! moves as the dense map does, set to the FEM at the last of them. How far the map had drifted from the FEM each time
//! is kept: that is what the map misses, with its law of play.

use flexspline_sim::motion::Motion;
use flexspline_sim::stepping::{Problem, SolveError};

use flexspline_sim::closed_loop::flight::RigidPlant;
use flexspline_sim::closed_loop::flight::gear::{DenseGear, GearMap};

/// How far the FEM may lag behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Windows {
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Load torque, as a share of itself.
    pub torque_share: f64,
    /// And at least, N·m.
    pub torque_n_m: f64,
}

impl Default for Windows {
    fn default() -> Self {
        Windows { generator_rad: 0.005, torque_share: 0.1, torque_n_m: 0.05 }
    }
}

/// Flank torques lighter than this are not solved for, N·m: the FEM waits until the load has passed.
const LIGHTEST_N_M: f64 = 1e-3;
/// A generator that turns back further than this from the last increment makes one there, rad: 1″ at the output.
const TURNING_POINT_RAD: f64 = 5e-4;

/// What the map missed at an increment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Missed {
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Load torque, N·m.
    pub torque_n_m: f64,
    /// Output of map less FEM, rad.
    pub map_less_fem_rad: f64,
}

/// The drive by FEM.
pub struct FemPlant<'p> {
    motion: Motion<'p>,
    gear: DenseGear<'p>,
    offset_rad: f64,
    /// Generator angle and load of the last two ticks.
    last: [(f64, f64); 2],
    drag_n_m: f64,
    windows: Windows,
    /// What the map missed, at every increment.
    pub missed: Vec<Missed>,
    /// An increment that found no equilibrium; the map goes on alone from there.
    pub failed: Option<SolveError>,
}

impl<'p> FemPlant<'p> {
    /// Deformed at generator angle zero, unloaded.
    pub fn new(
        problem: &'p Problem,
        map: GearMap<'p>,
        temperature_c: f64,
        windows: Windows,
    ) -> Result<Self, SolveError> {
        Ok(Self {
            motion: Motion::deformed(problem, 0.0)?,
            gear: DenseGear::new(map, temperature_c),
            offset_rad: 0.0,
            last: [(0.0, 0.0); 2],
            drag_n_m: problem.drive.output.drag_torque_n_m,
            windows,
            missed: Vec::new(),
            failed: None,
        })
    }

    fn solvable(&self, torque_n_m: f64) -> bool {
        let heavy = |flank: f64| flank.abs() > LIGHTEST_N_M;
        self.failed.is_none() && heavy(torque_n_m + self.drag_n_m) && heavy(torque_n_m - self.drag_n_m)
    }

    fn due(&self, generator_rad: f64, torque_n_m: f64) -> bool {
        let Windows { generator_rad: angle, torque_share, torque_n_m: least } = self.windows;
        let window = (torque_share * self.motion.state().torque_n_m.abs()).max(least);
        (generator_rad - self.motion.state().generator_rad).abs() >= angle
            || (torque_n_m - self.motion.state().torque_n_m).abs() >= window
    }

    /// An increment; the output by the FEM there.
    fn advance(&mut self, generator_rad: f64, torque_n_m: f64) {
        if !self.solvable(torque_n_m) {
            return;
        }
        if let Err(error) = self.motion.to(generator_rad, torque_n_m) {
            self.failed = Some(error);
        }
    }
}

impl RigidPlant for FemPlant<'_> {
    fn go(&mut self, generator_rad: f64, torque_n_m: f64) -> f64 {
        let [(before, _), (turned_at, load)] = self.last;
        let turned = (generator_rad - turned_at) * (turned_at - before) < 0.0;
        if turned && (turned_at - self.motion.state().generator_rad).abs() > TURNING_POINT_RAD {
            self.advance(turned_at, load);
        }
        self.last = [self.last[1], (generator_rad, torque_n_m)];
        let by_map = self.gear.go(generator_rad, torque_n_m);
        if self.due(generator_rad, torque_n_m) {
            self.advance(generator_rad, torque_n_m);
            if self.motion.state().generator_rad == generator_rad && self.motion.state().torque_n_m == torque_n_m {
                self.offset_rad = self.motion.state().output_rad - by_map;
                self.missed.push(Missed { generator_rad, torque_n_m, map_less_fem_rad: -self.offset_rad });
            }
        }
        by_map + self.offset_rad
    }

    fn carried_n_m(&self, torque_n_m: f64) -> f64 {
        torque_n_m
    }

    /// The FEM stays at the temperature of its problem.
    fn set_temperature(&mut self, _: f64) {}
}
