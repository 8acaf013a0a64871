//! Torque by wind-up: the load at which a table has the error that was measured.
//!
//! ```text
//! e = e₋(T) − (h − p), T > 0;  e₊(T) + (h + p), T ≤ 0;  within e₊(T) to e₋(T), and in addition
//! H(T) = Σ gₖ·Tᵏ + Σ gᵢ·clamp(zᵢ + T₁ − T₀, −wᵢ, wᵢ)       zᵢ: what the springs held under the load T₀ before
//! ```
//! `e₊`, `e₋` are the errors of the table moving forward and backward, `h` is half of their distance without load, `p`
//! from −h to h where the output rests inside its play: it follows the generator by the play operator of the core, and
//! a load takes it to the flank that it leans on. Play and springs go by the load `T₁` that readings prove, as a spring
//! that sticks would take the noise of a row for a load. The error rises with `T`, so that narrowing finds it. Where it
//! leaps, inside a dead zone, the torque is known to its ends, and no better than beside.

use flexspline::{Direction, GeneratorAngle, PlayState, Table};
use flexspline_design::tables::{SlipSpring, was_recorded};
use serde::{Deserialize, Serialize};

use crate::replay::{MeasuredRow, by_core, has_torque};
use flexspline_base::statistics::mean;
use flexspline_base::units::ARCSEC_PER_RAD;

/// Halvings of the range of a table: to a millionth of it. *Guess*.
const HALVINGS: u32 = 20;

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

/// Share of the newest torque in the load that play and springs go by, where a reading proves no more: the noise of one
/// row would take them to and fro. *Guess*.
const NEWEST: f64 = 0.2;

/// Wind-up that does not come back the way it went: springs that slip one after the other (Maxwell slip,
/// Prandtl-Ishlinskii), in addition to what a table has.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Hysteresis {
    /// By the load and its powers, rad/(N·m)ᵏ: the wind-up of a table is the middle of loops, with springs in them, and
    /// bends where loops end.
    pub by_load: Vec<f64>,
    /// The springs.
    pub springs: Vec<SlipSpring>,
}

impl Hysteresis {
    /// Error under a load that comes after others, rad.
    pub(crate) fn error_rad(&self, held: &HeldTorques, torque_n_m: f64) -> f64 {
        let springs = self.springs.iter().enumerate();
        let by_load = self.by_load.iter().rev().fold(0.0, |sum, gain| (sum + gain) * torque_n_m);
        springs.fold(by_load, |sum, (k, spring)| {
            sum + spring.gain_rad_per_n_m * held.under(torque_n_m, k, spring.width_n_m)
        })
    }
}

/// What springs hold after the loads so far, N·m; at first nothing, as after strokes that died away.
#[derive(Debug, Clone, Default)]
pub(crate) struct HeldTorques {
    pub by_spring: Vec<f64>,
    pub session: usize,
    pub torque_n_m: f64,
    /// To which torques are right; 0 for those that are known.
    pub half_width_n_m: f64,
}

impl HeldTorques {
    /// Goes on to a row of a session: what was held before another is not known.
    pub fn begin(&mut self, session: usize) {
        if session != self.session {
            *self = Self { session, half_width_n_m: self.half_width_n_m, ..Self::default() };
        }
    }

    /// The load after another torque: a share of the way, and as far as its interval proves.
    fn after(&self, torque_n_m: f64) -> f64 {
        let slow = self.torque_n_m + NEWEST * (torque_n_m - self.torque_n_m);
        slow.max(torque_n_m - self.half_width_n_m).min(torque_n_m + self.half_width_n_m)
    }

    fn under(&self, torque_n_m: f64, spring: usize, width_n_m: f64) -> f64 {
        let before = self.by_spring.get(spring).copied().unwrap_or(0.0);
        (before + self.after(torque_n_m) - self.torque_n_m).max(-width_n_m).min(width_n_m)
    }

    /// Goes on to another load.
    pub fn follow(&mut self, torque_n_m: f64, widths_n_m: impl IntoIterator<Item = f64>) {
        let held = widths_n_m.into_iter().enumerate().map(|(k, width_n_m)| self.under(torque_n_m, k, width_n_m));
        self.by_spring = held.collect();
        self.torque_n_m = self.after(torque_n_m);
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
    /// By a table, from where a drive rests in its play, with springs that hold nothing yet.
    pub fn new(table: &'t Table<'t>, play: PlayState, hysteresis: Hysteresis) -> Self {
        Self { table, play, hysteresis, held: HeldTorques::default() }
    }

    /// Torque of the next reading with its least and its most, N·m, where the error (output less generator over ratio,
    /// on the zero of the table) and what the table has are right to a half width, rad; of a row also the half width
    /// that its interval needs to hold the torque recorded. The torque is within the table's range; a least or a most
    /// that is beyond is infinite. NaN where a reading is not finite.
    pub fn next(&mut self, [psi_rad, error_rad, temperature_c, half_rad, known_n_m]: [f64; 5]) -> [f64; 4] {
        let Some(generator) = GeneratorAngle::from_rad(psi_rad) else { return [f64::NAN; 4] };
        let steady = |torque_n_m: f64| {
            [Direction::Forward, Direction::Backward].map(|way| {
                let error = self.table.steady_error_rad(generator, torque_n_m as f32, temperature_c as f32, way);
                error.map_or(f64::NAN, f64::from)
            })
        };
        let range @ [least_n_m, most_n_m] = self.table.torque_range_n_m().map(f64::from);
        let per_n_m = (steady(most_n_m)[0] - steady(least_n_m)[0]) / (most_n_m - least_n_m);
        self.held.half_width_n_m = half_rad / per_n_m;
        let before = self.held.torque_n_m;
        let [half, left] = [0.0, before].map(steady).map(|[forward, backward]| 0.5 * (backward - forward));
        let _ = self.table.forward(&mut self.play, generator, before as f32, temperature_c as f32);
        // A load takes the output to the flank that it leans on, and leaves it less play there.
        let rests = f64::from(self.play.offset_rad()) + (half - left).copysign(before);
        let doubt = f64::from(self.play.uncertainty_rad());
        let error_at = |torque: f64, end: f64| {
            let ([forward, backward], at) = (steady(torque), rests + end * doubt);
            let middle = if torque > 0.0 { backward - half } else { forward + half };
            let at = if at.abs() + f64::from(f32::EPSILON) < half { middle + at } else { f64::INFINITY.copysign(at) };
            at.max(forward).min(backward) + self.hysteresis.error_rad(&self.held, torque)
        };
        let [torque, low, high] =
            [0.0, -1.0, 1.0].map(|end| load_of(|load| error_at(load, -end), range, error_rad + end * half_rad));
        let [below, above] = [1.0, -1.0].map(|end| end * (error_rad - error_at(known_n_m, end)));
        let needs = below.max(above).max(0.0).min((torque - known_n_m).abs() * per_n_m);
        if !(torque + half + left + error_rad).is_finite() {
            return [f64::NAN; 4];
        }
        // Of loads beyond its own, and where nothing was recorded, a table says nothing: an interval has no end.
        let recorded = was_recorded(self.table, psi_rad);
        let low = if recorded && low > least_n_m { low } else { f64::NEG_INFINITY };
        let high = if recorded && high < most_n_m { high } else { f64::INFINITY };
        self.held.follow(torque, self.hysteresis.springs.iter().map(|spring| spring.width_n_m));
        let [below, above] = [-1.0, 1.0].map(|end| torque + end * self.held.half_width_n_m);
        [torque, low.min(below), high.max(above), needs]
    }
}

/// Reads the error of rows by a curve, each session from a state that is not known, on its zero of the output: the mean
/// of what table and hysteresis leave under the torques recorded; without any, that of all rows. Rows where the table
/// was not recorded say nothing of it, unless there are no others.
pub(crate) fn along<R>(
    table: &Table<'_>,
    rows: &[MeasuredRow],
    hysteresis: &Hysteresis,
    mut read: impl FnMut(&mut WindUpCurve<'_>, &MeasuredRow, f64) -> R,
) -> Vec<R> {
    let has_torque = has_torque(rows);
    let mut all = Vec::with_capacity(rows.len());
    for rows in rows.chunk_by(|row, next| !has_torque || row.session == next.session) {
        let mut held = HeldTorques::default();
        let states = rows.iter().map(|row| [row.generator_rad, row.torque_n_m, row.temperature_c]);
        let there = rows.iter().any(|row| was_recorded(table, row.generator_rad));
        let left = rows.iter().zip(by_core(table, states)).filter_map(|(row, said)| {
            let lags = hysteresis.error_rad(&held, row.torque_n_m);
            held.follow(row.torque_n_m, hysteresis.springs.iter().map(|spring| spring.width_n_m));
            let left = row.error_arcsec / ARCSEC_PER_RAD - f64::from(said.transmission_error_rad) - lags;
            (!there || was_recorded(table, row.generator_rad)).then_some(left)
        });
        let zero = mean(&left.collect::<Vec<f64>>());
        let mut curve = WindUpCurve::new(table, PlayState::unknown(), hysteresis.clone());
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

    #[test]
    fn a_load_moves_at_once_as_far_as_its_reading_proves() {
        let mut held = HeldTorques { half_width_n_m: 2.0, ..HeldTorques::default() };
        for (torque, load) in [(30.0, 28.0), (29.0, 28.2), (0.0, 2.0)] {
            held.follow(torque, [4.0]);
            assert!((held.torque_n_m - load).abs() < 1e-9, "{torque}: {held:?}");
        }
    }

    /// A spring that slips at 4 N·m in a drive of 30 µrad/(N·m): on the large loop the table alone is off by what it
    /// holds, to either side; with the spring by nothing, before and after a turn.
    #[test]
    fn a_load_comes_back_along_its_loop() {
        const STIFF: f64 = 3e-5;
        let spring = SlipSpring { width_n_m: 4.0, gain_rad_per_n_m: -8e-6 };
        let with = Hysteresis { by_load: vec![1e-6, 2e-8], springs: vec![spring] };
        let step: f64 = 0.01;
        let path = [30.0, -30.0, 12.0, 2.0].windows(2).flat_map(|ends| {
            let steps = ((ends[1] - ends[0]) / step).abs();
            (0..steps as usize).map(|k| ends[0] + (ends[1] - ends[0]) * k as f64 / steps).collect::<Vec<f64>>()
        });
        let (mut z, mut before) = (4.0, 30.0);
        let mut held = HeldTorques { by_spring: vec![4.0], torque_n_m: 30.0, ..HeldTorques::default() };
        for torque in path {
            z = f64::clamp(z + torque - before, -4.0, 4.0);
            before = torque;
            let read = STIFF * torque + 1e-6 * torque + 2e-8 * torque * torque - 8e-6 * z;
            let found = load_of(|load| STIFF * load + with.error_rad(&held, load), [-40.0, 40.0], read);
            held.follow(found, [spring.width_n_m]);
            assert!((found - torque).abs() < 1e-3, "{torque}: {found}");
            if z.abs() == 4.0 {
                let by_load = |load: f64| STIFF * load + 1e-6 * load + 2e-8 * load * load;
                let without = load_of(by_load, [-40.0, 40.0], read);
                assert!((by_load(without) - by_load(torque) + z * 8e-6).abs() < 1e-8, "{torque}: {without}");
            }
        }
    }
}
