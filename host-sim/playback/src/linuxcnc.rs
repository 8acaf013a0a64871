//! LinuxCNC screw compensation: `COMP_FILE`, read by `usrmotLoadComp` (src/emc/motion/usrmotintf.cc), kept by
//! `EMCMOT_SET_JOINT_COMP` (command.c), looked up by `compute_screw_comp` (control.c).
//!
//! Triplets of nominal position and, for each direction, the actual position (type 0) or the trim that is added to the
//! command (type 1). Linear between triplets from the left edge, the end values beyond; trims and slopes are kept as
//! `float`. The ramp of a reversal is left out: steady motion.

use std::fmt::Write;

use flexspline::Direction;

use super::hats::Hats;
use super::{FIT_POINTS, Origin, Player, Refusal, Section, Written, degrees, met, wanted};

/// Triplets that LinuxCNC holds for a joint: `EMCMOT_COMP_SIZE`.
pub const MAX_TRIPLETS: u32 = 256;

/// `COMP_FILE_TYPE`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CompType {
    /// Nominal, actual forward, actual backward.
    Actual,
    /// Nominal, trim forward, trim backward.
    Trim,
}

/// A triplet as it is kept.
#[derive(Debug, Clone, Copy)]
struct Triplet {
    nominal: f64,
    trims: [f32; 2],
    slopes: [f32; 2],
}

/// A compensation file and its lookup. Positions are degrees of the joint, whose zero is that of the table's output.
#[derive(Debug, Clone)]
pub struct LinuxCnc {
    kind: CompType,
    travel: [f64; 2],
    turns_per_point: f64,
    /// The numbers of the file.
    triplets: Vec<[f64; 3]>,
    entries: Vec<Triplet>,
}

impl LinuxCnc {
    /// Fits `points` triplets over a travel of the output, rad.
    pub fn fit(section: &Section<'_>, travel: [f64; 2], points: u32, kind: CompType) -> Result<LinuxCnc, Refusal> {
        if !(2..=MAX_TRIPLETS).contains(&points) {
            return Err(Refusal::Impossible(format!(
                "--points: found {points}; allowed: 2 to {MAX_TRIPLETS} triplets for a joint"
            )));
        }
        let step = (travel[1] - travel[0]) / f64::from(points - 1);
        let samples = section.samples(Some(travel), FIT_POINTS, &super::BOTH);
        let pairs = wanted(&samples);
        let (forward, backward) = pairs.split_at(pairs.len() / 2);
        let [forward, backward] = [forward, backward].map(|pairs| {
            let mut hats = Hats::new(points as usize, travel[0], step, false);
            pairs.iter().for_each(|(place, value)| hats.add(*place, *value));
            hats.solve()
        });
        let triplet = |k: usize| {
            let nominal = printed((travel[0] + step * k as f64).to_degrees());
            let trims = [forward[k], backward[k]].map(f64::to_degrees);
            match kind {
                CompType::Trim => [nominal, printed(trims[0]), printed(trims[1])],
                CompType::Actual => [nominal, printed(nominal - trims[0]), printed(nominal - trims[1])],
            }
        };
        let triplets: Vec<[f64; 3]> = (0..points as usize).map(triplet).collect();
        let entries = kept(&triplets, kind);
        Ok(LinuxCnc {
            kind,
            travel,
            turns_per_point: step * section.ratio().abs() / std::f64::consts::TAU,
            triplets,
            entries,
        })
    }

    /// `compute_screw_comp`: degrees for degrees.
    fn lookup_deg(&self, position: f64, direction: Direction) -> f64 {
        let side = usize::from(direction == Direction::Backward);
        let above = self.entries.partition_point(|entry| entry.nominal <= position);
        // Below the first the firmware has an entry at minus infinity: the first trims, without slope.
        let Some(entry) = above.checked_sub(1).map(|below| self.entries[below]) else {
            return f64::from(self.entries[0].trims[side]);
        };
        f64::from(entry.trims[side]) + f64::from(entry.slopes[side]) * (position - entry.nominal)
    }
}

/// As the file says it: nine decimals of a degree, 4e-6 arcsec.
fn printed(degrees: f64) -> f64 {
    (degrees * 1e9).round() / 1e9
}

/// What LinuxCNC keeps of a file.
fn kept(triplets: &[[f64; 3]], kind: CompType) -> Vec<Triplet> {
    let trims = |[nominal, forward, backward]: [f64; 3]| match kind {
        CompType::Trim => [forward as f32, backward as f32],
        CompType::Actual => [(nominal - forward) as f32, (nominal - backward) as f32],
    };
    let mut entries: Vec<Triplet> =
        triplets.iter().map(|row| Triplet { nominal: row[0], trims: trims(*row), slopes: [0.0; 2] }).collect();
    for k in 1..entries.len() {
        let width = entries[k].nominal - entries[k - 1].nominal;
        let slope = |side: usize| (f64::from(entries[k].trims[side] - entries[k - 1].trims[side]) / width) as f32;
        entries[k - 1].slopes = [slope(0), slope(1)];
    }
    entries
}

impl Player for LinuxCnc {
    fn correction_rad(&self, led_rad: f64, direction: Direction) -> f64 {
        met(led_rad, |output| self.lookup_deg(output.to_degrees(), direction).to_radians())
    }

    fn travel(&self) -> Option<[f64; 2]> {
        Some(self.travel)
    }

    fn points(&self) -> String {
        format!(
            "{} triplets over {} are {:.1} to a generator turn",
            self.triplets.len(),
            degrees(self.travel),
            1.0 / self.turns_per_point
        )
    }

    fn files(&self, origin: &Origin) -> Vec<Written> {
        let mut text = String::new();
        for [nominal, forward, backward] in &self.triplets {
            let _ = writeln!(text, "{nominal:.9} {forward:.9} {backward:.9}");
        }
        // LinuxCNC stops reading at the first line that is no triplet: a comment can only stand at the end.
        let (kind, what) = match self.kind {
            CompType::Actual => (0, "nominal, actual forward, actual backward; degrees"),
            CompType::Trim => (1, "nominal, trim forward, trim backward, added to the command; degrees"),
        };
        for line in origin.lines(what) {
            let _ = writeln!(text, "# {line}");
        }
        let _ = writeln!(text, "# [JOINT_n] COMP_FILE = flexspline.comp, COMP_FILE_TYPE = {kind}");
        vec![Written::text("flexspline.comp", text)]
    }

    fn notes(&self) -> Vec<String> {
        vec!["BACKLASH of the joint is not used beside a COMP_FILE; the two columns hold the play".to_owned()]
    }
}
