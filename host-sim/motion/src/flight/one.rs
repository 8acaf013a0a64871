//! One joint of a flight, ticked from outside, by a simulator of something larger.

use super::{COMPENSATED, Commanded, FlightError, JointController, JointLane, JointUnit, LaneParts, made};
use crate::on_board::{OnBoardInput, OnBoardOutput, OnBoardSettings};
use crate::plant::JointPlant;
use crate::scenario::{Moment, Scenario};
use flexspline::Quality;

/// A joint with mass, its servo, and what commands it; as [`super::fly_watched`] flies it, tick by tick.
pub struct OneJoint {
    made: LaneParts,
    lane: JointLane,
    started_j: f64,
}

/// Command and flags of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ticked {
    /// Commanded generator angle, rad.
    pub command_rad: f64,
    /// The correction in it, rad at the output: target less command over ratio.
    pub correction_rad: f64,
    /// The motor gives all it has.
    pub saturated: bool,
    /// The limiter held the correction back.
    pub held_back: bool,
    /// The table could not be used.
    pub not_corrected: bool,
    /// How far the core trusts estimate and correction; none without the core.
    pub quality: Option<Quality>,
}

impl OneJoint {
    /// At rest at zero; with the image of a table that was made before, or one made for the scenario; with the core or
    /// with none.
    ///
    /// # Errors
    /// [`FlightError`].
    pub fn new(
        scenario: &Scenario,
        unit: &JointUnit,
        image: Option<Vec<u8>>,
        compensated: bool,
    ) -> Result<Self, FlightError> {
        let made = made(scenario, unit, image)?;
        let lane = JointLane::new(&made, if compensated { COMPENSATED } else { 0 })?;
        let started_j = lane.plant.stored_j();
        Ok(Self { made, lane, started_j })
    }

    /// One tick of the servo: the target at its beginning, the torque on the load at both ends.
    pub fn tick(&mut self, now: &Moment) -> Ticked {
        let Commanded { command, held_back, not_corrected, quality, .. } = self.lane.tick(&self.made, now);
        let command_rad = command.to_rad();
        Ticked {
            command_rad,
            correction_rad: now.target_rad - command_rad / self.made.unit.nominal.ratio,
            saturated: self.lane.servo.saturated(),
            held_back,
            not_corrected,
            quality,
        }
    }

    /// As long as a tick without the servo: the motor's torque (N·m at the motor), and the torque on the load at both
    /// ends.
    pub fn push(&mut self, motor_n_m: f64, [first, last]: [f64; 2]) {
        let servo = &self.made.scenario.servo;
        let (motor_n_m, step_s) = (motor_n_m * self.made.unit.nominal.ratio, servo.tick_s / servo.steps as f64);
        for step in 0..servo.steps {
            let share = (step as f64 + 0.5) / servo.steps as f64;
            self.lane.plant.step(step_s, motor_n_m, first + (last - first) * share);
        }
    }

    /// Settings that the core has, or would have.
    pub fn on_board_settings(&self) -> OnBoardSettings {
        self.made.on_board_settings()
    }

    /// Input and output of the core in the last tick; `None` without it.
    pub fn on_board(&self) -> Option<&(OnBoardInput, OnBoardOutput)> {
        match &self.lane.controller {
            JointController::Core(core) => core.last.as_ref(),
            _ => None,
        }
    }

    /// Motor, drive and load.
    pub fn plant(&self) -> &JointPlant {
        &self.lane.plant
    }

    /// Torque that the servo's motor gives, N·m at the motor.
    pub fn motor_n_m(&self) -> f64 {
        self.lane.servo.motor_n_m()
    }

    /// Generator over output.
    pub fn ratio(&self) -> f64 {
        self.made.unit.nominal.ratio
    }

    /// Energy put in less heat and energy stored, J since the start: 0 but for rounding.
    pub fn missing_j(&self) -> f64 {
        let energy = self.plant().energy;
        energy.motor + energy.outside - energy.heat - (self.plant().stored_j() - self.started_j)
    }
}
