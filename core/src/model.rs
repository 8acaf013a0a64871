//! Forward and inverse: what the output does, and what to command so that it does what is wanted.
//!
//! Signs: `transmission_error = actual − ideal` at the output; the command correction is its negative times the ratio
//! ([`Drive::command_correction_counts`](crate::Drive::command_correction_counts)). Positive load torque turns the
//! output forward.
//!
//! Both calls do the same work whatever the data: no search that depends on them, no heap, no panic, no libm.

use crate::angle::{GeneratorAngle, OutputAngle, RAD_PER_COUNT};
use crate::hysteresis::{Direction, PlayState};
use crate::table::{OperatingPoint, Play, Quality, Table};

/// Table reads of one inverse: the error left is at most `slope³·periodic_rad` of [`Table::bounds`].
pub const INVERSE_ITERATIONS: u32 = 3;

/// What the output is expected to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Actual output angle: nominal plus transmission error.
    pub output: OutputAngle,
    /// Nominal output angle: generator over ratio.
    pub nominal: OutputAngle,
    /// Actual minus nominal, rad; 0 when disabled.
    pub transmission_error_rad: f32,
    /// The error lies within ± this of the value given, as far as play and jumps go, rad. What the table itself missed of
    /// its samples comes on top: [`Table::projection_worst_rad`].
    pub uncertainty_rad: f32,
    /// How far to trust it.
    pub quality: Quality,
}

/// What to command for a wanted output angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Generator angle to go to.
    pub generator: GeneratorAngle,
    /// The transmission error expected there, rad; 0 when disabled.
    pub predicted_error_rad: f32,
    /// As in [`Prediction`].
    pub uncertainty_rad: f32,
    /// How far to trust it.
    pub quality: Quality,
}

/// From which side of the play a target is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Approach<'s> {
    /// Steady motion in this direction.
    Moving(Direction),
    /// From where the drive rests now: forward if the target is ahead of the output, backward if behind it. A reversal
    /// takes up the whole play at once; limiting the rate of that is the caller's part. A target within
    /// [`Table::inverse_error_bound_rad`] plus 8 counts (1.2e-8 rad) of where the output is holds the generator still, so
    /// that rounding cannot make it cross the play to and fro.
    ///
    /// A state that was never updated gives the middle of the play, with its half-width as uncertainty.
    From(&'s PlayState),
}

/// Targets this close to the output leave the generator where it is: the rounding of forward and inverse.
const HOLD_RAD: f32 = 8.0 * RAD_PER_COUNT;

/// Which side of the play the output will be on: e = centre − sign·half-width.
#[derive(Clone, Copy)]
enum Side {
    Steady(Direction),
    Middle,
}

/// How a target is reached from where the drive rests.
enum Departure {
    Hold(Command),
    Move { side: Side, uncertainty_rad: f32 },
}

impl Side {
    fn error_rad(self, play: Play) -> f32 {
        match self {
            Self::Steady(direction) => play.centre_rad - direction.sign() * play.half_width_rad,
            Self::Middle => play.centre_rad,
        }
    }
}

impl Table<'_> {
    /// Output angle for a generator angle, with the play followed in `state`.
    ///
    /// Call it once for every measured generator angle, in order: the play lives on the turning points. If torque or
    /// temperature is not finite the answer is `Disabled` with no error, and `state` follows the motion with the half-width
    /// of the last good step.
    #[must_use]
    pub fn forward(
        &self,
        state: &mut PlayState,
        generator: GeneratorAngle,
        torque_n_m: f32,
        temperature_c: f32,
    ) -> Prediction {
        let nominal = self.drive.nominal_output(generator);
        let located = self.operating_point(torque_n_m, temperature_c);
        let phases = self.drive.phases(generator, nominal);
        let Some((point, play)) =
            located.and_then(|point| Some((point, self.play_at(&point, phases)?)))
        else {
            state.coast(nominal);
            return Prediction {
                output: nominal,
                nominal,
                transmission_error_rad: 0.0,
                uncertainty_rad: self.error_limit_rad,
                quality: Quality::Disabled,
            };
        };
        state.update(nominal, play.half_width_rad);
        let transmission_error_rad = play.centre_rad + state.offset_rad();
        Prediction {
            output: nominal.offset_rad(transmission_error_rad),
            nominal,
            transmission_error_rad,
            uncertainty_rad: state.uncertainty_rad() + point.jump_rad,
            quality: if state.is_known() {
                point.quality
            } else {
                point.quality.max(Quality::Uncertain)
            },
        }
    }

    /// Transmission error in steady motion in `direction`, rad; `None` if an input is not finite.
    #[must_use]
    pub fn steady_error_rad(
        &self,
        generator: GeneratorAngle,
        torque_n_m: f32,
        temperature_c: f32,
        direction: Direction,
    ) -> Option<f32> {
        let point = self.operating_point(torque_n_m, temperature_c)?;
        self.error_at(&point, generator, Side::Steady(direction))
    }

    /// Generator angle that brings the output to `target`.
    ///
    /// Solves `nominal(ψ) + e(ψ) = target` by [`INVERSE_ITERATIONS`] fixed-point steps from the mean error; that they
    /// contract was checked when the table was accepted. If an input is not finite the ideal command is given and marked
    /// `Disabled`.
    #[must_use]
    pub fn inverse(
        &self,
        target: OutputAngle,
        torque_n_m: f32,
        temperature_c: f32,
        approach: Approach<'_>,
    ) -> Command {
        self.solve(target, torque_n_m, temperature_c, approach)
            .unwrap_or(Command {
                generator: self.drive.nominal_generator(target),
                predicted_error_rad: 0.0,
                uncertainty_rad: self.error_limit_rad,
                quality: Quality::Disabled,
            })
    }

    /// Largest error that the fixed number of iterations leaves in the inverse, rad at the output, beyond the rounding of
    /// angles (2 counts, 3e-9 rad).
    #[must_use]
    pub fn inverse_error_bound_rad(&self) -> f32 {
        (0..INVERSE_ITERATIONS).fold(self.bounds.periodic_rad, |error, _| {
            error * self.bounds.slope
        })
    }

    fn solve(
        &self,
        target: OutputAngle,
        torque_n_m: f32,
        temperature_c: f32,
        approach: Approach<'_>,
    ) -> Option<Command> {
        let point = self.operating_point(torque_n_m, temperature_c)?;
        let (side, uncertainty_rad) = match approach {
            Approach::Moving(direction) => (Side::Steady(direction), 0.0),
            Approach::From(state) => match self.departure(target, &point, state)? {
                Departure::Hold(command) => return Some(command),
                Departure::Move {
                    side,
                    uncertainty_rad,
                } => (side, uncertainty_rad),
            },
        };
        let mut error_rad = side.error_rad(Play {
            centre_rad: point.mean_rad,
            half_width_rad: point.half_width_rad,
        });
        for _ in 0..INVERSE_ITERATIONS {
            error_rad = self.error_at(&point, self.command_for(target, error_rad), side)?;
        }
        Some(Command {
            generator: self.command_for(target, error_rad),
            predicted_error_rad: error_rad,
            uncertainty_rad: uncertainty_rad + point.jump_rad,
            quality: if uncertainty_rad > 0.0 {
                point.quality.max(Quality::Uncertain)
            } else {
                point.quality
            },
        })
    }

    fn command_for(&self, target: OutputAngle, predicted_error_rad: f32) -> GeneratorAngle {
        let correction = self.drive.command_correction_counts(predicted_error_rad);
        self.drive
            .nominal_generator(target)
            .offset_counts(correction)
    }

    fn error_at(
        &self,
        point: &OperatingPoint,
        generator: GeneratorAngle,
        side: Side,
    ) -> Option<f32> {
        let phases = self
            .drive
            .phases(generator, self.drive.nominal_output(generator));
        Some(side.error_rad(self.play_at(point, phases)?))
    }

    /// Whether and to which side the play must be taken up on the way from `state` to `target`.
    fn departure(
        &self,
        target: OutputAngle,
        point: &OperatingPoint,
        state: &PlayState,
    ) -> Option<Departure> {
        let Some(nominal) = state.nominal() else {
            return Some(Departure::Move {
                side: Side::Middle,
                uncertainty_rad: point.half_width_rad,
            });
        };
        let generator = self.drive.nominal_generator(nominal);
        let play = self.play_at(point, self.drive.phases(generator, nominal))?;
        let predicted_error_rad = play.centre_rad + state.offset_rad();
        let ahead_rad = target.minus_rad(nominal.offset_rad(predicted_error_rad));
        if ahead_rad.abs() <= self.inverse_error_bound_rad() + HOLD_RAD {
            let uncertainty_rad = state.uncertainty_rad() + point.jump_rad;
            let quality = if state.is_known() {
                point.quality
            } else {
                point.quality.max(Quality::Uncertain)
            };
            return Some(Departure::Hold(Command {
                generator,
                predicted_error_rad,
                uncertainty_rad,
                quality,
            }));
        }
        let direction = if ahead_rad > 0.0 {
            Direction::Forward
        } else {
            Direction::Backward
        };
        // A target inside the interval may lie on the other side of the output: then the whole play is in doubt.
        let guess = ahead_rad.abs() <= state.uncertainty_rad();
        let uncertainty_rad = if guess {
            2.0 * play.half_width_rad
        } else {
            0.0
        };
        Some(Departure::Move {
            side: Side::Steady(direction),
            uncertainty_rad,
        })
    }
}
