//! Torque by wind-up: the load at which a table has the error that was measured.
//!
//! ```text
//! e = (1 − s)/2 · e₊(T) + (1 + s)/2 · e₋(T)      e₊, e₋: error of the table moving forward, backward
//! ```
//! `s` from −1 to 1 is where the output rests inside its play. It follows the generator by the play operator of the
//! core, under the torques found before. Both errors rise with `T`, so that halving finds it. Where they leap, inside a
//! dead zone, the torque is known to its ends.

use flexspline::{Direction, GeneratorAngle, PlayState, Table};

/// Halvings of the range of a table: to a millionth of it. *Guess*.
const HALVINGS: u32 = 20;
/// Share of the newest torque in that by which the play is moved: the noise of one row would move the output from flank
/// to flank. *Guess*.
const NEWEST: f64 = 0.2;

/// The load in a range at which an error that rises with it has a value; an end where it has it nowhere.
pub(crate) fn load_of(error: impl Fn(f64) -> f64, [mut low, mut high]: [f64; 2], value: f64) -> f64 {
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        if error(middle) < value { low = middle } else { high = middle }
    }
    f64::midpoint(low, high)
}

/// Readings of two encoders as torques.
#[derive(Debug, Clone)]
pub struct WindUpCurve<'t> {
    table: &'t Table<'t>,
    play: PlayState,
    torque_n_m: f64,
}

impl<'t> WindUpCurve<'t> {
    /// By a table, from where a drive rests in its play.
    #[must_use]
    pub fn new(table: &'t Table<'t>, play: PlayState) -> Self {
        Self { table, play, torque_n_m: 0.0 }
    }

    /// Torque of the next reading with its least and its most, N·m, where the error (output less generator over ratio,
    /// on the zero of the table) and what the table has are right to `half_width_rad`; within the table's range. NaN
    /// where a reading is not finite.
    pub fn read(&mut self, generator_rad: f64, error_rad: f64, temperature_c: f64, half_width_rad: f64) -> [f64; 3] {
        let Some(generator) = GeneratorAngle::from_rad(generator_rad) else { return [f64::NAN; 3] };
        let steady = |torque_n_m: f64, way: Direction| {
            let error = self.table.steady_error_rad(generator, torque_n_m as f32, temperature_c as f32, way);
            error.map_or(f64::NAN, f64::from)
        };
        let [forward, backward] = [Direction::Forward, Direction::Backward].map(|way| steady(self.torque_n_m, way));
        if !(error_rad + forward + backward + half_width_rad).is_finite() {
            return [f64::NAN; 3];
        }
        let _ = self.table.forward(&mut self.play, generator, self.torque_n_m as f32, temperature_c as f32);
        let half = 0.5 * (backward - forward).abs().max(f64::MIN_POSITIVE);
        let (offset, doubt) = (f64::from(self.play.offset_rad()), f64::from(self.play.uncertainty_rad()));
        let range = self.table.torque_range_n_m().map(f64::from);
        let load = |error: f64, offset: f64| {
            let s = (offset / half).clamp(-1.0, 1.0);
            // Both flanks are asked only where the output rests between them.
            let at = |torque: f64| {
                let of = |share: f64, way: Direction| if share > 0.0 { share * steady(torque, way) } else { 0.0 };
                0.5 * (of(1.0 - s, Direction::Forward) + of(1.0 + s, Direction::Backward))
            };
            load_of(at, range, error)
        };
        let torque = load(error_rad, offset);
        let low = load(error_rad - half_width_rad, offset + doubt);
        let high = load(error_rad + half_width_rad, offset - doubt);
        self.torque_n_m += NEWEST * (torque - self.torque_n_m);
        [torque, low, high]
    }
}
