//! Tables for the playback of others: a table resampled for a device's own lookup, written as the device reads it, and
//! what that lookup leaves.
//!
//! A device corrects by less than a table says: by the position alone, in steps, at one load. So each format fits by
//! least squares what its device interpolates, rounds it as the device stores it, and then looks it up as the device's
//! source or manual says ([`Player`]). The figures are those of that lookup, not of the fit.
//!
//! The zero of the output is the machine's own: the mean error is left out of every file, and every figure is about its
//! mean.
#![forbid(unsafe_code)]

mod beckhoff;
mod cfs;
mod eqmod;
mod fprime;
mod hats;
mod linuxcnc;
mod moteus;
mod onstepx;
mod ros2;
mod section;
mod track;

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use flexspline::{Direction, Table};
use serde::Serialize;
use thiserror::Error;

pub use beckhoff::{Cnc, Nc};
pub use cfs::{Cfs, MAX_TABLE_BYTES};
pub use eqmod::{Eqmod, Mount as EqmodMount};
pub use fprime::Fprime;
pub use linuxcnc::{CompType, LinuxCnc, MAX_TRIPLETS};
pub use moteus::Moteus;
pub use onstepx::OnStepX;
pub use ros2::Ros2;
pub use section::{BOTH, Sample, Section};

use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_identify::replay::{MeasuredRow, ReplayedRow};

/// Points of a section that a fit sees in each direction: prime, see [`Section::samples`], and 7 to each ripple of 188
/// teeth at ratio 95.
const FIT_POINTS: u32 = 131_071;
/// Points at which a lookup is judged, in each direction: prime, and none of those of the fit but the first.
const JUDGE_POINTS: u32 = 32_749;
/// Loads of the table at which a lookup is judged.
const JUDGE_LOADS: usize = 5;
/// A file that leaves more than this share of the error is refused: a guess of what is not worth the risk of a wrong
/// one.
pub(crate) const POINTLESS: f64 = 0.7;
/// Fewer rows of a unit's data than this are not judged by: some to each half wave of order 2 over a few generator
/// turns, a guess.
pub const FEWEST_ROWS: usize = 32;
/// Loads of the data that lie further from the section's than this share of the table's range are told: a guess.
const NEAR_LOAD: f64 = 0.1;
/// Rounds in which a corrected command is met: a correction changes by less than its place does, so each is a digit or
/// more.
const MEET_ROUNDS: usize = 60;

/// Why there is no file.
#[derive(Debug, Error)]
pub enum Refusal {
    /// It would not help; can be written all the same.
    #[error("{0}")]
    Pointless(String),
    /// It cannot be.
    #[error("{0}")]
    Impossible(String),
}

/// A file to write.
#[derive(Debug, Clone)]
pub struct Written {
    /// Its name.
    pub name: String,
    /// What is in it.
    pub bytes: Vec<u8>,
}

impl Written {
    fn text(name: &str, text: String) -> Written {
        Written { name: name.to_owned(), bytes: text.into_bytes() }
    }

    /// Whether what stands in its place was written by this program, as far as can be told: it has the mark that this
    /// file has, or, where the format takes no comment, no line of another kind.
    pub fn replaces(&self, old: &[u8]) -> bool {
        let has = |bytes: &[u8], mark: &str| bytes.windows(mark.len()).any(|window| window == mark.as_bytes());
        if let Some(mark) = ["table_id", "flexspline ", "FLEXSPLINE"].into_iter().find(|mark| has(&self.bytes, mark)) {
            return has(old, mark);
        }
        let kinds = |bytes: &[u8]| -> BTreeSet<String> {
            let kind = |line: &str| {
                let key = line.rsplit_once(' ').map_or(line, |(key, _)| key);
                key.chars().filter(|letter| !letter.is_ascii_digit() && *letter != '-').collect()
            };
            String::from_utf8_lossy(bytes).lines().map(kind).collect()
        };
        kinds(old).is_subset(&kinds(&self.bytes))
    }
}

/// Who made the file, for its header.
#[derive(Debug, Clone)]
pub struct Origin {
    /// Table.
    pub table_id: String,
    /// Load and temperature of the section.
    pub torque_n_m: f64,
    /// See `torque_n_m`.
    pub temperature_c: f64,
}

impl Origin {
    /// Lines for a comment: table, tool, load, sign.
    fn lines(&self, sign: &str) -> [String; 4] {
        [
            format!("flexspline {} table_id {}", env!("CARGO_PKG_VERSION"), self.table_id),
            format!("load {} N.m, {} degrees C", self.torque_n_m, self.temperature_c),
            format!("sign: {sign}"),
            "simulated from its source or manual, not tried on hardware".to_owned(),
        ]
    }
}

/// A device's own lookup, bit for bit where its source says how.
pub trait Player {
    /// What the device adds to the output that it is asked for, rad, when it has led the generator to `led_rad` times
    /// the ratio and the output moves in this direction. The error that is left is the error there plus this.
    fn correction_rad(&self, led_rad: f64, direction: Direction) -> f64;

    /// Directions in which it plays.
    fn directions(&self) -> &[Direction] {
        &BOTH
    }

    /// Travel of the output in which it plays, rad; all of it if none.
    fn travel(&self) -> Option<[f64; 2]> {
        None
    }

    /// Whether it can be made for one direction of the output alone.
    fn takes_a_side(&self) -> bool {
        false
    }

    /// What its points are, for the reason of a refusal: "256 points over 360 deg, 2.7 to a generator turn".
    fn points(&self) -> String;

    /// The files.
    fn files(&self, origin: &Origin) -> Vec<Written>;

    /// What a user has to know of this file.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

/// What a position-indexed lookup adds when the output it has led to is `led_rad`: it was asked for `y` and led to
/// `y + lookup(y)`.
fn met(led_rad: f64, lookup: impl Fn(f64) -> f64) -> f64 {
    let mut correction = lookup(led_rad);
    for _ in 0..MEET_ROUNDS {
        let next = lookup(led_rad - correction);
        let moved = next - correction;
        correction = next;
        if moved.abs() < 1e-14 {
            break;
        }
    }
    correction
}

/// The wanted correction at each output that is asked for: where the generator stands at ψ, the output is at ψ/N + e,
/// so that is what had to be asked for to get it there. Pairs of output (rad) and correction (rad), the mean error
/// taken out.
fn wanted(samples: &[Sample]) -> Vec<(f64, f64)> {
    let mean = mean(samples.iter().map(|sample| sample.error_rad));
    let of = |sample: &Sample| {
        let error = sample.error_rad - mean;
        (sample.led_rad + error, -error)
    };
    samples.iter().map(of).collect()
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}

/// Root mean square about `zero`.
fn rms(values: &[f64], zero: f64) -> f64 {
    (values.iter().map(|value| (value - zero).powi(2)).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// What is left on the table's own model at one load.
#[derive(Debug, Clone, Serialize)]
pub struct LoadFigures {
    /// Load, N·m.
    pub torque_n_m: f64,
    /// Error without playback, arcsec, about its mean at the nominal load: a shift from load to load counts.
    pub rms_uncorrected_arcsec: f64,
    /// With it, likewise.
    pub rms_played_arcsec: f64,
}

/// What is left on the table's own model: steady motion in every direction in which the device plays.
#[derive(Debug, Clone, Serialize)]
pub struct ModelFigures {
    /// Nominal load, N·m.
    pub torque_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Mean error at the nominal load, arcsec, left out of all figures and of what a controller's own lookup is given:
    /// a constant shift, which homing holds.
    pub mean_left_out_arcsec: f64,
    /// Error without playback at the nominal load, arcsec, about its mean.
    pub rms_uncorrected_arcsec: f64,
    /// With it.
    pub rms_played_arcsec: f64,
    /// Largest that is left.
    pub max_played_arcsec: f64,
    /// Part of it that differs from one direction to the other: play that the lookup does not know.
    pub rms_left_by_play_arcsec: f64,
    /// The same at loads of the table.
    pub loads: Vec<LoadFigures>,
}

impl ModelFigures {
    /// The loads of the table at which this file leaves more than none does.
    pub fn note(&self) -> Option<String> {
        let worse = self.loads.iter().filter(|load| load.rms_played_arcsec > load.rms_uncorrected_arcsec);
        let at: Vec<String> = worse
            .map(|load| {
                let (played, none) = (load.rms_played_arcsec, load.rms_uncorrected_arcsec);
                format!("{} N.m ({played:.1} arcsec, {none:.1} without)", load.torque_n_m)
            })
            .collect();
        (!at.is_empty()).then(|| {
            format!(
                "made for {} N.m, this file leaves more than none at {}; a playback does not know the load: give \
                 --torque-n-m the load that the joint has",
                self.torque_n_m,
                at.join(", ")
            )
        })
    }
}

/// What is left on the data of a unit.
#[derive(Debug, Clone, Serialize)]
pub struct DataFigures {
    /// Rows in which the device plays.
    pub rows: usize,
    /// Of them, those at which load or temperature lie beyond the table: the core takes the value at its edge.
    pub rows_extrapolated: usize,
    /// Least, mean and largest load of these rows, N·m.
    pub loads_n_m: [f64; 3],
    /// Those whose load is further from the section's than a tenth of the table's range.
    pub rows_off_load: usize,
    /// Mean of the measured error, arcsec, left out of the figures.
    pub mean_left_out_arcsec: f64,
    /// Measured error, arcsec, about its mean.
    pub rms_uncorrected_arcsec: f64,
    /// Left by the device.
    pub rms_played_arcsec: f64,
    /// Left by the core with the same table.
    pub rms_core_arcsec: f64,
    /// Left by the core if the measured error had the other sign.
    #[serde(skip)]
    rms_core_turned_arcsec: f64,
}

/// Error left at these points, arcsec: without a player nothing is added.
fn left(player: Option<&dyn Player>, samples: &[Sample]) -> Vec<f64> {
    let of = |sample: &Sample| {
        let added = player.map_or(0.0, |player| player.correction_rad(sample.led_rad, sample.direction));
        (sample.error_rad + added) * ARCSEC_PER_RAD
    };
    samples.iter().map(of).collect()
}

/// Loads at which a table is judged: evenly over its range.
fn loads(table: &Table<'_>) -> Vec<f64> {
    let [least, most] = table.torque_range_n_m().map(f64::from);
    let count = if most > least { JUDGE_LOADS } else { 1 };
    (0..count).map(|k| least + (most - least) * k as f64 / (count.max(2) - 1) as f64).collect()
}

/// What a player leaves on the model of the table it was made from.
pub fn on_model(table: &Table<'_>, torque_n_m: f64, temperature_c: f64, player: &dyn Player) -> ModelFigures {
    let directions = player.directions();
    let at = |torque: f64| {
        let samples = Section::new(table, torque, temperature_c).samples(player.travel(), JUDGE_POINTS, directions);
        [left(None, &samples), left(Some(player), &samples)]
    };
    let nominal = at(torque_n_m);
    let zeros = nominal.each_ref().map(|values| mean(values.iter().copied()));
    let figures = |values: &[Vec<f64>; 2]| [rms(&values[0], zeros[0]), rms(&values[1], zeros[1])];
    let [uncorrected, played] = figures(&nominal);
    let half = nominal[1].len() / 2;
    let by_play: Vec<f64> = (0..half).map(|k| 0.5 * (nominal[1][k] - nominal[1][k + half])).collect();
    let loads = loads(table).into_iter().map(|torque| {
        let [rms_uncorrected_arcsec, rms_played_arcsec] = figures(&at(torque));
        LoadFigures { torque_n_m: torque, rms_uncorrected_arcsec, rms_played_arcsec }
    });
    ModelFigures {
        torque_n_m,
        temperature_c,
        mean_left_out_arcsec: zeros[0],
        rms_uncorrected_arcsec: uncorrected,
        rms_played_arcsec: played,
        max_played_arcsec: nominal[1].iter().fold(0.0, |most, value| f64::max(most, (value - zeros[1]).abs())),
        rms_left_by_play_arcsec: if directions.len() == 2 { rms(&by_play, 0.0) } else { 0.0 },
        loads: loads.collect(),
    }
}

/// What the core leaves on the model of its own table: nothing beyond what its inverse may leave.
pub fn core_on_model(table: &Table<'_>, torque_n_m: f64, temperature_c: f64) -> ModelFigures {
    let bound = f64::from(table.inverse_error_bound_rad()) * ARCSEC_PER_RAD;
    let figures = |torque: f64, zero: Option<f64>| {
        let samples = Section::new(table, torque, temperature_c).samples(None, JUDGE_POINTS, &BOTH);
        let values = left(None, &samples);
        let zero = zero.unwrap_or_else(|| mean(values.iter().copied()));
        (rms(&values, zero), zero)
    };
    let (rms_uncorrected_arcsec, zero) = figures(torque_n_m, None);
    let of = |torque: f64| LoadFigures {
        torque_n_m: torque,
        rms_uncorrected_arcsec: figures(torque, Some(zero)).0,
        rms_played_arcsec: bound,
    };
    ModelFigures {
        torque_n_m,
        temperature_c,
        mean_left_out_arcsec: zero,
        rms_uncorrected_arcsec,
        rms_played_arcsec: bound,
        max_played_arcsec: bound,
        rms_left_by_play_arcsec: 0.0,
        loads: loads(table).into_iter().map(of).collect(),
    }
}

/// What a player leaves on measured rows, beside what the core left of them; without a player the core plays.
/// `torque_n_m` is the load of the section.
pub fn on_data(
    table: &Table<'_>,
    torque_n_m: f64,
    rows: &[MeasuredRow],
    replayed: &[ReplayedRow],
    player: Option<&dyn Player>,
) -> Result<DataFigures, Refusal> {
    let ratio = table.drive().exact_ratio();
    let mut kept: [Vec<f64>; 4] = Default::default();
    let mut loads_n_m = Vec::new();
    let mut rows_extrapolated = 0;
    for (k, direction) in directions_of(rows, ratio).into_iter().enumerate() {
        let row = &rows[k];
        let led_rad = row.generator_rad / ratio;
        let plays = player.is_none_or(|player| {
            let inside = player.travel().is_none_or(|[from, to]| (from..=to).contains(&led_rad));
            inside && player.directions().contains(&direction)
        });
        if plays {
            let core = replayed[k].residual_arcsec;
            let added = player.map(|player| player.correction_rad(led_rad, direction) * ARCSEC_PER_RAD);
            kept[0].push(row.error_arcsec);
            kept[1].push(added.map_or(core, |added| row.error_arcsec + added));
            kept[2].push(core);
            kept[3].push(row.error_arcsec + replayed[k].predicted_arcsec);
            loads_n_m.push(row.torque_n_m);
            rows_extrapolated += usize::from(replayed[k].quality == "extrapolated");
        }
    }
    if kept[0].is_empty() {
        return Err(Refusal::Impossible(
            "no row of the data lies where this device plays: look at the travel and the direction".to_owned(),
        ));
    }
    let means = kept.each_ref().map(|values| mean(values.iter().copied()));
    let [rms_uncorrected_arcsec, rms_played_arcsec, rms_core_arcsec, rms_core_turned_arcsec] =
        std::array::from_fn(|k| rms(&kept[k], means[k]));
    let near_n_m = near_load_n_m(table);
    Ok(DataFigures {
        rows: kept[0].len(),
        rows_extrapolated,
        loads_n_m: [
            loads_n_m.iter().copied().fold(f64::INFINITY, f64::min),
            mean(loads_n_m.iter().copied()),
            loads_n_m.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        ],
        rows_off_load: loads_n_m.iter().filter(|load| (**load - torque_n_m).abs() > near_n_m).count(),
        mean_left_out_arcsec: means[0],
        rms_uncorrected_arcsec,
        rms_played_arcsec,
        rms_core_arcsec,
        rms_core_turned_arcsec,
    })
}

/// How far a load may be from the section's before it is told, N·m; a table of one load holds for that alone, to a
/// single precision's rounding.
fn near_load_n_m(table: &Table<'_>) -> f64 {
    let [least, most] = table.torque_range_n_m().map(f64::from);
    (NEAR_LOAD * (most - least)).max(1e-6 * most.abs())
}

impl DataFigures {
    /// What a reader of the figures has to know of the data: loads beside the section, rows beyond the table.
    pub fn notes(&self, table: &Table<'_>, torque_n_m: f64) -> Vec<String> {
        let [least, mean, most] = self.loads_n_m;
        let off = (self.rows_off_load > 0).then(|| {
            format!(
                "{} of {} rows of the data have a load more than {:.3} N.m from the {torque_n_m} N.m that the file is \
                 made for (loads of the data: {least} to {most} N.m, mean {mean:.3}); a playback does not know the \
                 load",
                self.rows_off_load,
                self.rows,
                near_load_n_m(table)
            )
        });
        let beyond = (self.rows_extrapolated > 0).then(|| {
            let [low, high] = table.torque_range_n_m();
            let [cold, warm] = table.temperature_range_c();
            format!(
                "{} of {} rows of the data are extrapolated by the core: the table holds from {low} to {high} N.m and \
                 from {cold} to {warm} degrees C",
                self.rows_extrapolated, self.rows
            )
        });
        off.into_iter().chain(beyond).collect()
    }

    /// Refuses a file that would not help this unit, and says whether the table is that of the data at all.
    pub fn worth_it(&self) -> Result<(), Refusal> {
        let (all, played, core) = (self.rms_uncorrected_arcsec, self.rms_played_arcsec, self.rms_core_arcsec);
        if played <= POINTLESS * all {
            return Ok(());
        }
        let turned = self.rms_core_turned_arcsec;
        let why = if core <= POINTLESS * all {
            format!(
                "the core leaves {core:.2} with the same table, so the data belong to it, and hold what this playback \
                 does not know: other loads, or play"
            )
        } else if turned <= POINTLESS * all {
            format!(
                "the core leaves {core:.2} too, but {turned:.2} if the error had the other sign: turn that of the \
                 error in --columns (error=NAME:-arcsec)"
            )
        } else {
            format!(
                "the core leaves {core:.2} too, so the data do not belong to this table: another unit, another zero \
                 or sign of the generator or the output, another ratio"
            )
        };
        Err(Refusal::Pointless(format!(
            "the unit's data: of {all:.2} arcsec rms this playback leaves {played:.2}, more than {:.0} %. {why}",
            100.0 * POINTLESS
        )))
    }
}

/// Direction of the output at each row: that of the step to it; where it stands, the one before; at the start, the
/// first there is.
fn directions_of(rows: &[MeasuredRow], ratio: f64) -> Vec<Direction> {
    let step = |k: usize| {
        let moved = (rows[k].generator_rad - rows[k - 1].generator_rad) / ratio;
        (moved != 0.0).then_some(if moved > 0.0 { Direction::Forward } else { Direction::Backward })
    };
    let mut now = (1..rows.len()).find_map(step).unwrap_or(Direction::Forward);
    (0..rows.len())
        .map(|k| {
            if let Some(direction) = (k > 0).then(|| step(k)).flatten() {
                now = direction;
            }
            now
        })
        .collect()
}

/// Refuses what leaves nearly all of the error, and says by what.
pub fn worth_it(section: &Section<'_>, figures: &ModelFigures, player: &dyn Player) -> Result<(), Refusal> {
    let (all, played) = (figures.rms_uncorrected_arcsec, figures.rms_played_arcsec);
    if played <= POINTLESS * all {
        return Ok(());
    }
    let by_play = figures.rms_left_by_play_arcsec;
    let why = if 2.0 * by_play * by_play > played * played {
        let side = if player.takes_a_side() {
            "; where the joint always comes from one side, say --direction forward or backward"
        } else {
            ""
        };
        format!(
            "play dominates: the two directions differ by ±{by_play:.2} arcsec rms, and this lookup holds one value \
             for both{side}"
        )
    } else {
        let samples = section.samples(player.travel(), JUDGE_POINTS, player.directions());
        let (order, amplitude) = section.strongest_order(&samples);
        format!(
            "{}; the strongest part of this table repeats {order} times a generator turn, {:.0} times an output turn, \
             with {:.2} arcsec",
            player.points(),
            f64::from(order) * section.ratio().abs(),
            amplitude * ARCSEC_PER_RAD
        )
    };
    Err(Refusal::Pointless(format!("pointless: of {all:.2} arcsec rms it leaves {played:.2}. {why}")))
}

/// Travel of the output in degrees, as text.
fn degrees([from, to]: [f64; 2]) -> String {
    format!("{} deg", ((to - from) * 360.0 / TAU * 1e6).round() / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correction_is_met_at_the_place_it_led_to() {
        let lookup = |y: f64| 0.3 * (2.0 * y).sin();
        for k in 0..100 {
            let y = 0.1 * f64::from(k);
            assert!((met(y + lookup(y), lookup) - lookup(y)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_row_that_stands_keeps_its_direction() {
        let row =
            |generator_rad| MeasuredRow { generator_rad, error_arcsec: 0.0, torque_n_m: 0.0, temperature_c: 20.0 };
        let rows = [0.0, 0.0, 1.0, 1.0, 0.5, 0.5].map(row);
        use Direction::{Backward, Forward};
        assert_eq!(directions_of(&rows, 95.0), [Forward, Forward, Forward, Forward, Backward, Backward]);
        assert_eq!(directions_of(&rows, -94.0), [Backward, Backward, Backward, Backward, Forward, Forward]);
    }
}
