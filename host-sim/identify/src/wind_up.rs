//! Torque by wind-up: the load at which a table has the error that was measured.
//!
//! ```text
//! e = (1 − s)/2 · e₊(T) + (1 + s)/2 · e₋(T) + h(T)      e₊, e₋: error of the table moving forward, backward
//! h(T) = g₀·T + Σ gᵢ·clamp(zᵢ + ν·(T − T₀), −wᵢ, wᵢ)    zᵢ: what the springs held under the load T₀ before
//! ```
//! `s` from −1 to 1 is where the output rests inside its play. It follows the generator by the play operator of the
//! core, under the torques found before, as the springs of the [hysteresis](Hysteresis) do: with a share `ν` of the
//! newest, as a spring that sticks would take the noise of a row for a load. The error rises with `T`, so that
//! narrowing finds it. Where it leaps, inside a dead zone, the torque is known to its ends.

use flexspline::{Direction, GeneratorAngle, PlayState, Table};
use flexspline_design::tables::SlipSpring;
use serde::{Deserialize, Serialize};

use crate::replay::{MeasuredRow, by_core};
use flexspline_base::statistics::mean;
use flexspline_base::units::ARCSEC_PER_RAD;

/// Halvings of the range of a table: to a millionth of it. *Guess*.
const HALVINGS: u32 = 20;
/// Share of the newest torque in that by which play and springs are moved: the noise of one row would move the output
/// from flank to flank, and take springs to and fro. *Guess*.
const NEWEST: f64 = 0.2;

/// The load in a range at which an error that rises with it has a value; an end where it has it nowhere. A chord meets
/// the value at once where the error is straight, and halving makes an end of it where it is not.
pub(crate) fn load_of(error: impl Fn(f64) -> f64, [mut low, mut high]: [f64; 2], value: f64) -> f64 {
    let [mut below, mut above] = [low, high].map(|load| error(load) - value);
    if below >= 0.0 || above <= 0.0 {
        return if below >= 0.0 { low } else { high };
    }
    let (near, same) = ((high - low) * 0.5_f64.powi(HALVINGS as i32), 1e-6 * (above - below));
    for step in 0..2 * HALVINGS {
        let share = if step % 2 == 0 { below / (below - above) } else { 0.5 };
        let load = low + share * (high - low);
        let off = error(load) - value;
        if off.abs() < same {
            return load;
        }
        if off < 0.0 {
            (low, below) = (load, off)
        } else {
            (high, above) = (load, off)
        }
        if high - low < near {
            break;
        }
    }
    f64::midpoint(low, high)
}

/// Wind-up that does not come back the way it went: springs that slip one after the other (Maxwell slip,
/// Prandtl-Ishlinskii), in addition to what a table has.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Hysteresis {
    /// In proportion to the load, rad/(N·m): the wind-up of a table is the middle of loops, with springs in them.
    pub gain_rad_per_n_m: f64,
    /// The springs.
    pub springs: Vec<SlipSpring>,
}

impl Hysteresis {
    /// Error under a load that comes after others, rad.
    pub(crate) fn error_rad(&self, held: &HeldTorques, torque_n_m: f64) -> f64 {
        let springs = self.springs.iter().enumerate();
        springs.fold(self.gain_rad_per_n_m * torque_n_m, |sum, (k, spring)| {
            sum + spring.gain_rad_per_n_m * held.under(torque_n_m, k, spring.width_n_m)
        })
    }
}

/// What springs hold after the loads so far, N·m; at first nothing, as after strokes that died away.
#[derive(Debug, Clone, Default)]
pub(crate) struct HeldTorques {
    pub by_spring: Vec<f64>,
    /// Load, smooth.
    torque_n_m: f64,
}

impl HeldTorques {
    fn under(&self, torque_n_m: f64, spring: usize, width_n_m: f64) -> f64 {
        let before = self.by_spring.get(spring).copied().unwrap_or(0.0);
        (before + NEWEST * (torque_n_m - self.torque_n_m)).max(-width_n_m).min(width_n_m)
    }

    /// Goes on to another load.
    pub fn follow(&mut self, torque_n_m: f64, widths_n_m: impl IntoIterator<Item = f64>) {
        let held = widths_n_m.into_iter().enumerate().map(|(k, width_n_m)| self.under(torque_n_m, k, width_n_m));
        self.by_spring = held.collect();
        self.torque_n_m += NEWEST * (torque_n_m - self.torque_n_m);
    }
}

/// Readings of two encoders as torques.
#[derive(Debug, Clone)]
pub struct WindUpCurve<'t> {
    table: &'t Table<'t>,
    play: PlayState,
    hysteresis: Hysteresis,
    held: HeldTorques,
}

impl<'t> WindUpCurve<'t> {
    /// By a table, from where a drive rests in its play.
    #[must_use]
    pub fn new(table: &'t Table<'t>, play: PlayState) -> Self {
        Self { table, play, hysteresis: Hysteresis::default(), held: HeldTorques::default() }
    }

    /// With springs that hold nothing yet.
    #[must_use]
    pub fn with(self, hysteresis: Hysteresis) -> Self {
        Self { hysteresis, ..self }
    }

    /// Torque of the next reading with its least and its most, N·m, where the error (output less generator over ratio,
    /// on the zero of the table) and what the table has are right to `half_width_rad`; within the table's range. NaN
    /// where a reading is not finite.
    pub fn read(&mut self, generator_rad: f64, error_rad: f64, temperature_c: f64, half_width_rad: f64) -> [f64; 3] {
        let range = self.table.torque_range_n_m().map(f64::from);
        self.next(generator_rad, temperature_c, |error_at| {
            [0.0, -1.0, 1.0].map(|end| load_of(|load| error_at(load, -end), range, error_rad + end * half_width_rad))
        })
    }

    /// The same, and in place of the ends the half width that an interval needs to hold a torque that is known, rad.
    pub(crate) fn needs(&mut self, row: &MeasuredRow, error_rad: f64) -> [f64; 2] {
        let range = self.table.torque_range_n_m().map(f64::from);
        self.next(row.generator_rad, row.temperature_c, |error_at| {
            let [below, above] = [1.0, -1.0].map(|end| end * (error_rad - error_at(row.torque_n_m, end)));
            [load_of(|load| error_at(load, 0.0), range, error_rad), below.max(above).max(0.0)]
        })
    }

    /// What is read at the next angle of the generator, the torque first, by the error there under a load; the output
    /// rests where it is taken to, or at an end, -1 or 1, of where it may.
    fn next<const N: usize>(
        &mut self,
        generator_rad: f64,
        temperature_c: f64,
        read: impl FnOnce(&dyn Fn(f64, f64) -> f64) -> [f64; N],
    ) -> [f64; N] {
        let Some(generator) = GeneratorAngle::from_rad(generator_rad) else { return [f64::NAN; N] };
        let steady = |torque_n_m: f64, way: Direction| {
            let error = self.table.steady_error_rad(generator, torque_n_m as f32, temperature_c as f32, way);
            error.map_or(f64::NAN, f64::from)
        };
        let before = self.held.torque_n_m;
        let [forward, backward] = [Direction::Forward, Direction::Backward].map(|way| steady(before, way));
        let _ = self.table.forward(&mut self.play, generator, before as f32, temperature_c as f32);
        let half = 0.5 * (backward - forward).abs().max(f64::MIN_POSITIVE);
        let (at_rest, doubt) = (f64::from(self.play.offset_rad()), f64::from(self.play.uncertainty_rad()));
        let found = read(&|torque: f64, end: f64| {
            let s = ((at_rest + end * doubt) / half).clamp(-1.0, 1.0);
            // Both flanks are asked only where the output rests between them.
            let of = |share: f64, way: Direction| if share > 0.0 { share * steady(torque, way) } else { 0.0 };
            0.5 * (of(1.0 - s, Direction::Forward) + of(1.0 + s, Direction::Backward))
                + self.hysteresis.error_rad(&self.held, torque)
        });
        if !found.iter().all(|value| value.is_finite()) || !(forward + backward).is_finite() {
            return [f64::NAN; N];
        }
        self.held.follow(found[0], self.hysteresis.springs.iter().map(|spring| spring.width_n_m));
        found
    }
}

/// Reads the error of rows by a curve, each session from a state that is not known, on its zero of the output: the mean
/// of what table and hysteresis leave under the torques recorded; without any, that of all rows.
pub(crate) fn along<R>(
    table: &Table<'_>,
    rows: &[MeasuredRow],
    hysteresis: &Hysteresis,
    mut read: impl FnMut(&mut WindUpCurve<'_>, &MeasuredRow, f64) -> R,
) -> Vec<R> {
    let has_torque = rows.iter().any(|row| row.torque_n_m != 0.0);
    let mut all = Vec::with_capacity(rows.len());
    for rows in rows.chunk_by(|row, next| !has_torque || row.session == next.session) {
        let mut held = HeldTorques::default();
        let states = rows.iter().map(|row| [row.generator_rad, row.torque_n_m, row.temperature_c]);
        let left = rows.iter().zip(by_core(table, states)).map(|(row, said)| {
            let lags = hysteresis.error_rad(&held, row.torque_n_m);
            held.follow(row.torque_n_m, hysteresis.springs.iter().map(|spring| spring.width_n_m));
            row.error_arcsec / ARCSEC_PER_RAD - f64::from(said.transmission_error_rad) - lags
        });
        let zero = mean(&left.collect::<Vec<f64>>());
        let mut curve = WindUpCurve::new(table, PlayState::unknown()).with(hysteresis.clone());
        all.extend(rows.iter().map(|row| read(&mut curve, row, row.error_arcsec / ARCSEC_PER_RAD - zero)));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_is_where_an_error_has_its_value_or_leaps_over_it() {
        // Slopes of 1 and 3, and between them a leap from 4 to 10 at a load of 4.
        let error = |load: f64| if load < 4.0 { load } else { 10.0 + 3.0 * (load - 4.0) };
        for (value, load) in [(-9.0, -8.0), (2.5, 2.5), (7.0, 4.0), (9.999, 4.0), (13.0, 5.0), (99.0, 8.0)] {
            let found = load_of(error, [-8.0, 8.0], value);
            assert!((found - load).abs() < 2e-5, "{value}: {found}");
        }
    }

    /// A spring that slips at 4 N·m in a drive of 30 µrad/(N·m): on the large loop the table alone is off by what it
    /// holds, to either side; with the spring by no more than the smooth load lags, before and after a turn.
    #[test]
    fn a_load_comes_back_along_its_loop() {
        const STIFF: f64 = 3e-5;
        let spring = SlipSpring { width_n_m: 4.0, gain_rad_per_n_m: -8e-6 };
        let with = Hysteresis { gain_rad_per_n_m: 1e-6, springs: vec![spring] };
        let step: f64 = 0.01;
        let path = [30.0, -30.0, 12.0, 2.0].windows(2).flat_map(|ends| {
            let steps = ((ends[1] - ends[0]) / step).abs();
            (0..steps as usize).map(|k| ends[0] + (ends[1] - ends[0]) * k as f64 / steps).collect::<Vec<f64>>()
        });
        let (mut z, mut before) = (4.0, 30.0);
        let mut held = HeldTorques { by_spring: vec![4.0], torque_n_m: 30.0 };
        for torque in path {
            z = f64::clamp(z + torque - before, -4.0, 4.0);
            before = torque;
            let read = (STIFF + 1e-6) * torque - 8e-6 * z;
            let found = load_of(|load| STIFF * load + with.error_rad(&held, load), [-40.0, 40.0], read);
            held.follow(found, [spring.width_n_m]);
            let lag = 2.0 * step / NEWEST * 8e-6 / (STIFF - 8e-6);
            assert!((found - torque).abs() < lag, "{torque}: {found}");
            if z.abs() == 4.0 {
                let without = load_of(|load| STIFF * load + 1e-6 * load, [-40.0, 40.0], read);
                assert!((without - torque + z * 8e-6 / (STIFF + 1e-6)).abs() < 1e-3, "{torque}: {without}");
            }
        }
    }
}
