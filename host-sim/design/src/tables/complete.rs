//! Completion by a data sheet: the compliance that the FEM of a drive lacks, as a spring of its own in series with it,
//! and the loss as springs that slip.
//!
//! ```text
//! torsion(T) = FEM(T) + spring(T),    slope of the spring in a range = 1/K of the sheet - 1/K of the FEM there
//! ```
//!
//! Both K are secants over the same range: from first contact to T1, to T2, to the end of the table. Where the FEM is
//! the softer of the two no spring in series mends it, and no scatter of units is as large as the difference: such a
//! drive is refused. The sheet speaks of a series, a unit may be off by its scatter `s`: a
//! softer unit winds up `1 / (1 - s)` times as far, so that the table may be off by `s / (1 - s)` of its wind-up.
//!
//! The loss is the width of the loop at no load after the largest torque either way. What the clearance of the FEM does
//! not have of it becomes springs that slip with the torque (Iwan 1966; `MaxwellSlip` of flexspline-estimation), which
//! take back part of the wind-up after each reversal.

use flexspline::Table;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::data_sheet::{Loads, either_way_rad, torsion_rad, touch_n_m};
use crate::stated::{Stated, short};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::Drive;

/// Torques at which springs that slip do so, over the largest torque: all of them from end to end while it is taken
/// off, as the loss is measured. How a loop opens is in no catalogue: a guess.
const SLIP_SHARES: [f64; 3] = [0.125, 0.25, 0.5];

/// Stiffnesses that differ by less are the same: what K of a completed table differs by from its sheet, as measured.
const SAME: f64 = 0.01;

/// Torque nodes at a knee, over its torque: a cubic through wide intervals rounds it off by seconds (2.9" of CSF-25-100
/// between 14 and 30 N·m, with the knee alone for a node).
const KNEE: [f64; 3] = [0.85, 1.0, 1.18];
/// Torque nodes on each side that the knees take at most, by definition.
pub(super) const KNEE_NODES: usize = 2 * KNEE.len();

/// Why a data sheet does not complete a table.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CompletionError {
    /// The drive file has no sheet.
    #[error(
        "the drive's file has no [data_sheet]; allowed: a file with one, or --like with a size of a catalogue, {sizes}"
    )]
    NoSheet {
        /// Sizes at hand.
        sizes: String,
    },
    /// Figures without which the stiffness is not known.
    #[error("data_sheet: found no {}; allowed: T1, T2, K1, K2 and K3, all five", keys.join(", "))]
    Missing {
        /// By their keys.
        keys: Vec<&'static str>,
    },
    /// The table has no torque beyond first contact.
    #[error("the table ends at {ends_n_m} N·m, which only closes the clearance: allowed are more than {touch_n_m} N·m")]
    TooShort {
        /// Its largest torque.
        ends_n_m: f64,
        /// First contact.
        touch_n_m: f64,
    },
    /// A drive that is softer than its sheet.
    #[error(
        "data_sheet.k{}_n_m_per_rad: found {}, and the FEM has {} N·m/rad there, from {} to {} N·m: a spring in series \
         makes no drive stiffer, and the table would be off by the difference beside what units scatter by; allowed: \
         a drive that is as stiff as its sheet in all ranges (catalogues rate a cam), or tables without the sheet",
        range + 1, short(*stated), short(*fem), short(between_n_m[0]), short(between_n_m[1])
    )]
    Softer {
        /// Which of the three.
        range: usize,
        /// K as stated, N m/rad.
        stated: f64,
        /// K of the FEM.
        fem: f64,
        /// Torques between which, N m.
        between_n_m: [f64; 2],
    },
    /// A loop that the wind-up has no room for.
    #[error(
        "data_sheet.hysteresis_loss_arcmin: found {loss_arcmin}, allowed: at most {most_arcmin:.2} beside the \
         stiffness of this sheet, or the output would turn against its load after a reversal"
    )]
    LoopTooWide {
        /// As stated.
        loss_arcmin: f64,
        /// Largest value that fits.
        most_arcmin: f64,
    },
}

/// Values of a series' sheet that complete a table.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetStiffness {
    source: Option<String>,
    t1_n_m: f64,
    t2_n_m: f64,
    k_n_m_per_rad: [f64; 3],
    scatter_percent: f64,
    loss_arcmin: Option<f64>,
}

impl SheetStiffness {
    /// Of a sheet that states all of it. Scatter that it does not state is that of the catalogues.
    ///
    /// # Errors
    /// [`CompletionError::Missing`].
    pub fn of(stated: &Stated) -> Result<SheetStiffness, CompletionError> {
        let figures = [
            ("t1_n_m", stated.t1_n_m),
            ("t2_n_m", stated.t2_n_m),
            ("k1_n_m_per_rad", stated.k1_n_m_per_rad),
            ("k2_n_m_per_rad", stated.k2_n_m_per_rad),
            ("k3_n_m_per_rad", stated.k3_n_m_per_rad),
        ];
        let [Some(t1_n_m), Some(t2_n_m), Some(k1), Some(k2), Some(k3)] = figures.map(|(_, figure)| figure) else {
            let missing = figures.into_iter().filter(|(_, figure)| figure.is_none());
            return Err(CompletionError::Missing { keys: missing.map(|(key, _)| key).collect() });
        };
        Ok(SheetStiffness {
            source: stated.source.clone(),
            t1_n_m,
            t2_n_m,
            k_n_m_per_rad: [k1, k2, k3],
            // Whole percent are written into the image: rounded to the safe side.
            scatter_percent: stated.scatter_percent().ceil(),
            loss_arcmin: stated.hysteresis_loss_arcmin,
        })
    }

    /// Torque nodes with T1 and T2 and one on each side of them, either sign, where the stiffness changes; one that is
    /// next to a node already is not put in twice.
    pub(super) fn with_knees(&self, nodes_n_m: &[f32]) -> Vec<f32> {
        /// A node so near to a knee, over its torque, stands for it. A guess.
        const NEXT_TO: f32 = 0.05;
        let mut nodes = nodes_n_m.to_vec();
        let ends = nodes.last().copied().unwrap_or(0.0);
        let around = |knee: f64| KNEE.map(|share| (share * knee) as f32);
        for knee in around(self.t1_n_m).into_iter().chain(around(self.t2_n_m)) {
            if knee < ends && nodes.iter().all(|node| (node - knee).abs() > NEXT_TO * knee) {
                nodes.extend([-knee, knee]);
            }
        }
        nodes.sort_by(f32::total_cmp);
        nodes
    }

    /// The part of this sheet's stiffness that the table of a drive's FEM lacks.
    pub(super) fn completes(&self, drive: &Drive, table: &Table<'_>) -> Result<Completed, CompletionError> {
        let ends_n_m = f64::from(table.torque_range_n_m()[1]);
        let (t1_n_m, t2_n_m) = (self.t1_n_m, self.t2_n_m);
        let touch_n_m = touch_n_m(drive, Loads { t1_n_m, t2_n_m, largest_n_m: ends_n_m });
        if touch_n_m >= t1_n_m.min(ends_n_m) {
            return Err(CompletionError::TooShort { ends_n_m, touch_n_m });
        }
        let ranges = [[touch_n_m, t1_n_m], [t1_n_m, t2_n_m], [t2_n_m, f64::INFINITY]]
            .map(|range| range.map(|torque| torque.min(ends_n_m)));
        let fem = ranges.map(|[from, to]| {
            let secant = (to - from) / (torsion_rad(drive, table, to)? - torsion_rad(drive, table, from)?);
            Some(secant).filter(|k| from < to && k.is_finite())
        });
        let spring = self.spring(ranges, fem)?;
        let scatter = 1e-2 * self.scatter_percent;
        let by_fem = torsion_rad(drive, table, ends_n_m).zip(torsion_rad(drive, table, touch_n_m));
        let wind_up_rad = by_fem.map_or(0.0, |(end, touch)| end - touch) + spring.torsion_rad(ends_n_m);
        let play_arcmin = self.loss_arcmin.map_or(0.0, |_| backlash_arcmin(drive, table));
        Ok(Completed {
            source: self.source.clone(),
            scatter_percent: self.scatter_percent,
            stated_n_m_per_rad: self.k_n_m_per_rad,
            fem_n_m_per_rad: fem,
            spring,
            uncertainty_arcsec: scatter / (1.0 - scatter) * wind_up_rad.abs() * ARCSEC_PER_RAD,
            slip: self.slip(ends_n_m, play_arcmin)?,
        })
    }

    /// The spring that makes stiffnesses of the FEM those of the sheet, by range; none beyond the end of the table.
    fn spring(&self, ranges: [[f64; 2]; 3], fem: [Option<f64>; 3]) -> Result<MissingSpring, CompletionError> {
        let mut compliance_rad_per_n_m = [0.0; 3];
        for range in 0..3 {
            let (stated, Some(fem)) = (self.k_n_m_per_rad[range], fem[range]) else { continue };
            if fem < (1.0 - SAME) * stated {
                return Err(CompletionError::Softer { range, stated, fem, between_n_m: ranges[range] });
            }
            compliance_rad_per_n_m[range] = (1.0 / stated - 1.0 / fem).max(0.0);
        }
        Ok(MissingSpring { t1_n_m: self.t1_n_m, t2_n_m: self.t2_n_m, compliance_rad_per_n_m })
    }

    /// Springs that slip for the loss beyond a play; none where the play has all of it, or no loss is stated.
    fn slip(&self, largest_n_m: f64, play_arcmin: f64) -> Result<Vec<SlipSpring>, CompletionError> {
        let Some(loss_arcmin) = self.loss_arcmin.filter(|loss| *loss > play_arcmin) else { return Ok(Vec::new()) };
        // Each opens the loop by 2 gain width, and takes gain off the slope after a reversal.
        let half_rad = 0.5 * (loss_arcmin - play_arcmin) * 60.0 / ARCSEC_PER_RAD / SLIP_SHARES.len() as f64;
        let springs = SLIP_SHARES.map(|share| {
            let width_n_m = share * largest_n_m;
            SlipSpring { width_n_m, gain_rad_per_n_m: -half_rad / width_n_m }
        });
        let taken: f64 = springs.iter().map(|spring| -spring.gain_rad_per_n_m).sum();
        let stiffest = self.k_n_m_per_rad.iter().copied().fold(0.0, f64::max);
        if taken * stiffest > 1.0 {
            let most_arcmin = play_arcmin + (loss_arcmin - play_arcmin) / (taken * stiffest);
            return Err(CompletionError::LoopTooWide { loss_arcmin, most_arcmin });
        }
        Ok(springs.to_vec())
    }

    /// End of the image's mesh level; firmware reads it by `Table::sheet_scatter`.
    pub(super) fn mark(&self) -> String {
        format!(", sheet +-{} %", self.scatter_percent)
    }
}

/// The clearance at no load, arcmin.
fn backlash_arcmin(drive: &Drive, table: &Table<'_>) -> f64 {
    let between = |[forward, backward]: [f64; 2]| (backward - forward).abs() * ARCSEC_PER_RAD / 60.0;
    either_way_rad(drive, table, 0.0).map_or(0.0, between)
}

/// A spring in series with the drive of the FEM, softer or stiffer by range of torque.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MissingSpring {
    /// End of the first range, N m.
    pub t1_n_m: f64,
    /// End of the second, N m.
    pub t2_n_m: f64,
    /// Its compliance up to T1, to T2 and above, rad/(N m).
    pub compliance_rad_per_n_m: [f64; 3],
}

impl MissingSpring {
    /// Rotation of the output, rad, in the sense of the torque, N m.
    pub fn torsion_rad(&self, torque_n_m: f64) -> f64 {
        let load = torque_n_m.abs();
        let ranges = [[0.0, self.t1_n_m], [self.t1_n_m, self.t2_n_m], [self.t2_n_m, f64::INFINITY]];
        let within = |[from, to]: [f64; 2]| (load.min(to) - from).max(0.0);
        let parts = ranges.into_iter().zip(self.compliance_rad_per_n_m).map(|(range, slope)| slope * within(range));
        parts.sum::<f64>() * torque_n_m.signum()
    }
}

/// A spring that slips with the load torque, as `TorqueSlipElement` of flexspline-estimation has it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SlipSpring {
    /// Torque from its middle at which it slips, N m.
    pub width_n_m: f64,
    /// Error by torque while it sticks, rad/(N m); negative: after a reversal it takes wind-up back.
    pub gain_rad_per_n_m: f64,
}

/// A data sheet's additions to a table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Completed {
    /// Which sheet.
    pub source: Option<String>,
    /// How far units scatter about its stiffness, ± percent.
    pub scatter_percent: f64,
    /// K1, K2, K3 of the sheet, N m/rad.
    pub stated_n_m_per_rad: [f64; 3],
    /// The same of the FEM, secants over the ranges of the sheet; null beyond the end of the table.
    pub fem_n_m_per_rad: [Option<f64>; 3],
    /// The spring in series.
    pub spring: MissingSpring,
    /// Uncertainty of the table at its largest torque with this scatter of units, ± arcsec: s / (1 - s) of wind-up.
    pub uncertainty_arcsec: f64,
    /// Springs that slip, for the loss: settings of the core's `MaxwellSlip`, beside the table. None where the sheet
    /// states no loss, or the clearance of the FEM has it all.
    pub slip: Vec<SlipSpring>,
}

impl Completed {
    /// In one sentence.
    pub fn in_words(&self) -> String {
        let source = self.source.as_deref().unwrap_or("the data sheet");
        let added = |(range, slope): (&str, f64)| match slope {
            0.0 => format!("nothing {range}"),
            slope => format!("{} N·m/rad {range}", short(1.0 / slope)),
        };
        let [a, b, c] = self.spring.compliance_rad_per_n_m;
        let (t1, t2) = (short(self.spring.t1_n_m), short(self.spring.t2_n_m));
        let ranges = [(&*format!("to {t1} N·m"), a), (&format!("to {t2}"), b), ("above", c)].map(added).join(", ");
        let slip = if self.slip.is_empty() { "" } else { ", and springs that slip for its loss" };
        format!(
            "completed by {source}: the compliance that the FEM lacks is a spring in series ({ranges}){slip}; a unit \
             may be {}\" off at the largest torque, as units scatter by {} %",
            short(self.uncertainty_arcsec.round()),
            self.scatter_percent
        )
    }

    /// As comments of a drive file.
    pub fn to_toml(&self, generator: &str) -> String {
        let MissingSpring { t1_n_m, t2_n_m, compliance_rad_per_n_m: [a, b, c] } = self.spring;
        let mut text = format!(
            "# {generator}: added {a:.4e} rad/(N·m) to {t1_n_m} N·m, {b:.4e} to {t2_n_m} N·m, {c:.4e} above; +-{} % of \
             stiffness\n",
            self.scatter_percent
        );
        for SlipSpring { width_n_m, gain_rad_per_n_m } in &self.slip {
            text +=
                &format!("# {generator}: a spring that slips at {width_n_m} N·m, {gain_rad_per_n_m:.4e} rad/(N·m)\n");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_estimation::{MaxwellSlip, SlipState, TorqueSlipElement};

    fn sheet(loss_arcmin: Option<f64>) -> SheetStiffness {
        let stated = crate::catalogue::sheet("CSF", 25.0, 100).unwrap();
        SheetStiffness::of(&Stated { hysteresis_loss_arcmin: loss_arcmin, ..stated }).unwrap()
    }

    #[test]
    fn a_spring_bends_at_its_knees_and_is_odd() {
        let spring = MissingSpring { t1_n_m: 10.0, t2_n_m: 40.0, compliance_rad_per_n_m: [3e-5, 2e-5, 1e-5] };
        let due = [(5.0, 15e-5), (10.0, 30e-5), (20.0, 50e-5), (40.0, 90e-5), (60.0, 110e-5)];
        for (torque, torsion) in due {
            assert!((spring.torsion_rad(torque) - torsion).abs() < 1e-12);
            assert!((spring.torsion_rad(-torque) + torsion).abs() < 1e-12);
        }
    }

    #[test]
    fn what_a_sheet_lacks_is_named() {
        let stated = Stated { k1_n_m_per_rad: Some(3e4), t2_n_m: Some(48.0), ..Stated::default() };
        let keys = vec!["t1_n_m", "k2_n_m_per_rad", "k3_n_m_per_rad"];
        assert_eq!(SheetStiffness::of(&stated), Err(CompletionError::Missing { keys }));
        assert_eq!(sheet(None).mark(), ", sheet +-30 %");
    }

    /// CSF-25-100 with two rollers: 14 300 N·m/rad where the sheet has 50 000. What is softer by less than a percent,
    /// or beyond the table, is as good as the sheet.
    #[test]
    fn a_drive_that_is_softer_than_its_sheet_is_not_completed() {
        let ranges = [[0.05, 14.0], [14.0, 48.0], [48.0, 62.0]];
        let spring = |fem| sheet(None).spring(ranges, fem);
        let why = spring([Some(62e3), Some(14.3e3), Some(60e3)]).unwrap_err();
        assert_eq!(why, CompletionError::Softer { range: 1, stated: 50e3, fem: 14.3e3, between_n_m: [14.0, 48.0] });
        let said = why.to_string();
        assert!(said.starts_with("data_sheet.k2_n_m_per_rad: found 50000, and the FEM has 14300 N·m/rad"), "{said}");
        assert_eq!(spring([Some(31e3), Some(49.6e3), None]).unwrap().compliance_rad_per_n_m, [0.0; 3]);
        assert!((spring([Some(62e3), None, None]).unwrap().compliance_rad_per_n_m[0] - 1.0 / 62e3).abs() < 1e-12);
    }

    /// Knees become nodes, in their order, and not beside a node that is there.
    #[test]
    fn knees_are_nodes_once() {
        let nodes = [-60.0, -14.2, -1.0, 1.0, 14.2, 60.0];
        let positive = |nodes: &[f32]| -> Vec<f32> {
            let all = sheet(None).with_knees(nodes);
            let (low, high) = all.split_at(all.len() / 2);
            assert!(low.iter().rev().zip(high).all(|(low, high)| -low == *high) && all.is_sorted());
            high.to_vec()
        };
        assert_eq!(positive(&nodes), [1.0, 11.9, 14.2, 16.52, 40.8, 48.0, 56.64, 60.0]);
        assert_eq!(positive(&[-15.0, -1.0, 1.0, 15.0]), [1.0, 11.9, 14.0, 15.0]);
    }

    /// The core's bank of these springs, loaded either way and let go: its loop is as wide as stated, less the play.
    #[test]
    fn the_loop_of_the_springs_is_the_stated_loss() {
        let springs = sheet(Some(1.5)).slip(66.0, 0.5).unwrap();
        let elements: [TorqueSlipElement; 3] = std::array::from_fn(|k| TorqueSlipElement {
            width_n_m: springs[k].width_n_m as f32,
            gain_rad_per_n_m: springs[k].gain_rad_per_n_m as f32,
        });
        let bank = MaxwellSlip::of_torque(elements).unwrap();
        let mut state = SlipState::relaxed();
        let mut after = |torque: f32| {
            bank.update(&mut state, torque);
            f64::from(bank.update(&mut state, 0.0).error_rad) * ARCSEC_PER_RAD / 60.0
        };
        after(-66.0);
        let (up, down) = (after(66.0), after(-66.0));
        // After a load the output stays behind on its side.
        assert!((up - down - 1.0).abs() < 1e-3 && up > 0.0, "{up} {down}");
        assert_eq!(sheet(Some(0.5)).slip(66.0, 0.6), Ok(Vec::new()));
        assert_eq!(sheet(None).slip(66.0, 0.0), Ok(Vec::new()));
        let Err(CompletionError::LoopTooWide { most_arcmin, .. }) = sheet(Some(30.0)).slip(66.0, 0.0) else { panic!() };
        assert!(sheet(Some(0.999 * most_arcmin)).slip(66.0, 0.0).is_ok());
    }
}
