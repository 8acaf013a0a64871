//! The claims of the paper in its order: text, its numbers, ours, bounds. A verdict follows from the numbers alone.
//!
//! Sizes are reproduced within `SHARE` of the paper's: it gives no tooth sizes, so nothing finer can be asked. A rank
//! of two generators holds where the gap exceeds `SPREADS` times what mesh, increment and penalty move it by. Charts
//! without numbers in the text are not read off.

use std::f64::consts::{FRAC_PI_2, PI};

use serde::Serialize;

use crate::runs::{ONE_POINT, PaperRun, RunMetrics, standard};
use ClaimVerdict::{Inconsistent, NotReproduced, NotTestable, Reproduced};
use flexspline_base::units::ARCMIN_PER_RAD;
use flexspline_design::simulate::Row;
use flexspline_mechanics::drive::GeneratorKind::{self, Cam, DoubleDisc, FourRoller, TwoRoller};
use flexspline_mechanics::drive::{Drive, RigidMesh};
use flexspline_mechanics::reference::ToothPath;

/// Gear ratio: section 4.
const RATIO: f64 = 95.0;
/// Load of the circular spline, N·m ("about"): before figure 14.
pub(crate) const TORQUE_N_M: f64 = 200.0;
/// Largest errors, arc-minutes: figure 13 and the text below, converted from rad.
pub(crate) const ERROR_FOUR_ROLLER: f64 = 0.006_224_7 * ARCMIN_PER_RAD;
pub(crate) const ERROR_DOUBLE_DISC: f64 = 0.004_134_4 * ARCMIN_PER_RAD;
pub(crate) const ERROR_CAM: f64 = 0.003 * ARCMIN_PER_RAD;
/// Kinematic error that makers recommend, arc-minutes: below figure 13.
const RECOMMENDED: Bounds = [Some(1.0), Some(9.0)];
/// Backlash, arc-minutes: below figure 17.
const BACKLASH_DOUBLE_DISC: f64 = 1.16;
const BACKLASH_CAM: f64 = 0.98;
/// A size counts as the paper's within this share of it.
const SHARE: f64 = 0.25;
/// Number of spreads that a gap must exceed.
const SPREADS: f64 = 3.0;

const ALL: [GeneratorKind; 4] = GeneratorKind::ALL;
const ROLLERS: [GeneratorKind; 2] = [TwoRoller, FourRoller];
/// The generators that the paper loads and reverses.
const LOADED: [GeneratorKind; 2] = [DoubleDisc, Cam];

/// Lower and upper bound.
type Bounds = [Option<f64>; 2];

/// Any number.
const ANY: Bounds = [None, None];
/// Rounding of a conversion, arc-minutes.
const ROUNDED: Bounds = [Some(-0.5), Some(0.5)];

const fn at_least(bound: f64) -> Bounds {
    [Some(bound), None]
}

const fn at_most(bound: f64) -> Bounds {
    [None, Some(bound)]
}

const fn within(paper: f64, share: f64) -> Bounds {
    [Some(paper * (1.0 - share)), Some(paper * (1.0 + share))]
}

/// Outcome of a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(into = "&'static str")]
pub enum ClaimVerdict {
    /// Every number keeps its bounds.
    Reproduced,
    /// A number of ours is out of its bounds.
    NotReproduced,
    /// A number of the paper is out of its bounds.
    Inconsistent,
    /// The paper gives too little, or a run that the claim needs failed.
    NotTestable,
}

impl ClaimVerdict {
    /// All of them.
    pub const ALL: [ClaimVerdict; 4] = [Reproduced, NotReproduced, Inconsistent, NotTestable];
}

impl From<ClaimVerdict> for &'static str {
    fn from(verdict: ClaimVerdict) -> &'static str {
        match verdict {
            Reproduced => "reproduced",
            NotReproduced => "not reproduced",
            Inconsistent => "inconsistent in the paper",
            NotTestable => "not testable",
        }
    }
}

/// A number and its bounds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Number {
    /// Name, for instance a generator.
    pub name: String,
    /// The value; NaN, in JSON `null`, where a run did not converge.
    pub value: f64,
    /// Its unit; empty for a plain number.
    pub unit: &'static str,
    /// Lower bound.
    pub at_least: Option<f64>,
    /// Upper bound.
    pub at_most: Option<f64>,
}

impl Number {
    /// Whether the number keeps its bounds.
    pub fn passes(&self) -> bool {
        self.at_least.is_none_or(|bound| self.value >= bound) && self.at_most.is_none_or(|bound| self.value <= bound)
    }
}

/// A claim of the paper.
#[derive(Debug, Serialize)]
pub struct Claim {
    /// Looked up by.
    pub id: &'static str,
    /// Figure, formula or section.
    pub place: &'static str,
    /// The claim.
    pub says: &'static str,
    /// Definition of our numbers.
    pub metric: &'static str,
    #[serde(skip)]
    numbers: for<'a> fn(Evidence<'a>) -> Evidence<'a>,
}

/// A claim, its numbers and its verdict.
#[derive(Debug, Serialize)]
pub struct JudgedClaim {
    /// The claim.
    #[serde(flatten)]
    pub claim: &'static Claim,
    /// The paper's numbers.
    pub paper: Vec<Number>,
    /// Ours.
    pub ours: Vec<Number>,
    /// The verdict.
    pub verdict: ClaimVerdict,
}

/// All claims, judged.
pub(crate) fn judged(drive: &Drive, runs: &[PaperRun]) -> Vec<JudgedClaim> {
    let judge = |claim: &'static Claim| {
        let evidence = (claim.numbers)(Evidence { drive, runs, paper: Vec::new(), ours: Vec::new() });
        JudgedClaim { claim, verdict: evidence.verdict(), paper: evidence.paper, ours: evidence.ours }
    };
    CLAIMS.iter().map(judge).collect()
}

/// A number of a run.
type Metric = fn(&RunMetrics) -> f64;

/// Arc-minutes.
pub(crate) fn largest(m: &RunMetrics) -> f64 {
    m.largest_out_arcsec.max(m.largest_back_arcsec) / 60.0
}

/// Arc-minutes.
fn backlash(m: &RunMetrics) -> f64 {
    2.0 * m.half_width_arcsec / 60.0
}

/// Arc-minutes.
fn lag(m: &RunMetrics) -> f64 {
    m.lag_forward_arcsec / 60.0
}

/// Degrees.
fn dwell(m: &RunMetrics) -> f64 {
    m.dwell_rad.to_degrees()
}

/// The runs that claims are judged by, and the numbers of one claim.
struct Evidence<'a> {
    drive: &'a Drive,
    runs: &'a [PaperRun],
    paper: Vec<Number>,
    ours: Vec<Number>,
}

impl<'a> Evidence<'a> {
    fn paper(mut self, name: &str, value: f64, unit: &'static str, [at_least, at_most]: Bounds) -> Self {
        self.paper.push(Number { name: name.to_owned(), value, unit, at_least, at_most });
        self
    }

    fn ours(mut self, name: &str, value: f64, unit: &'static str, [at_least, at_most]: Bounds) -> Self {
        self.ours.push(Number { name: name.to_owned(), value, unit, at_least, at_most });
        self
    }

    /// A number of ours for each of some generators.
    fn each(
        self,
        kinds: impl IntoIterator<Item = GeneratorKind>,
        unit: &'static str,
        bounds: Bounds,
        of: impl Fn(&Self, GeneratorKind) -> f64,
    ) -> Self {
        kinds.into_iter().fold(self, |e, kind| {
            let value = of(&e, kind);
            e.ours(kind.in_words(), value, unit, bounds)
        })
    }

    /// A metric of the unloaded run for each of some generators.
    fn run<const N: usize>(self, kinds: [GeneratorKind; N], unit: &'static str, bounds: Bounds, of: Metric) -> Self {
        self.each(kinds, unit, bounds, |e, kind| e.of(kind, of))
    }

    /// A size of one generator, arc-minutes, which must be the paper's.
    fn size(self, kind: GeneratorKind, paper: f64, metric: Metric) -> Self {
        self.paper(kind.in_words(), paper, "′", ANY).run([kind], "′", within(paper, SHARE), metric)
    }

    /// A metric under a load (N·m), of which each generator of `more` must have more than each of `less`.
    fn more(mut self, [more, less]: [&[GeneratorKind]; 2], unit: &'static str, torque_n_m: f64, of: Metric) -> Self {
        self = self.each([more, less].concat(), unit, ANY, |e, kind| e.under(kind, torque_n_m, of)[0]);
        for (first, second) in more.iter().flat_map(|first| less.iter().map(move |second| (*first, *second))) {
            let gap = gap_in_spreads(&self.under(first, torque_n_m, of), &self.under(second, torque_n_m, of));
            let name = format!("{} less {}", first.in_words(), second.in_words());
            self = self.ours(&name, gap, "spreads", at_least(SPREADS));
        }
        self
    }

    /// A number of the paper out of bounds is an inconsistency; without bounds, or with a number that no run gave, a
    /// claim is untestable; else our numbers decide.
    fn verdict(&self) -> ClaimVerdict {
        if !self.paper.iter().all(Number::passes) {
            return Inconsistent;
        }
        let bounded = || self.ours.iter().filter(|number| number.at_least.or(number.at_most).is_some());
        if bounded().count() == 0 || bounded().any(|number| number.value.is_nan()) {
            return NotTestable;
        }
        if bounded().all(Number::passes) { Reproduced } else { NotReproduced }
    }

    /// A metric of the unloaded standard run.
    fn of(&self, kind: GeneratorKind, metric: Metric) -> f64 {
        self.under(kind, 0.0, metric)[0]
    }

    /// A metric under a load (N·m), of the standard run first, then of each other discretisation; NaN where a run
    /// failed.
    fn under(&self, kind: GeneratorKind, torque_n_m: f64, metric: Metric) -> Vec<f64> {
        let runs = self.runs.iter().filter(|run| run.generator == kind && run.torque_n_m == torque_n_m);
        let discretised = runs.filter(|run| run.variant != ONE_POINT);
        discretised.map(|run| run.metrics.as_ref().map_or(f64::NAN, metric)).collect()
    }

    /// By how many spreads a metric differs from zero, unloaded.
    fn in_spreads(&self, kind: GeneratorKind, metric: Metric) -> f64 {
        let values = self.under(kind, 0.0, metric);
        gap_in_spreads(&values, &vec![0.0; values.len()]).abs()
    }

    fn tips(&self, kind: GeneratorKind) -> &'a [[f64; 3]] {
        standard(self.runs, kind, 0.0).map_or(&[], |run| &run.tip_path)
    }

    /// The point of the tip path at which coordinate `k` is largest.
    fn tip(&self, kind: GeneratorKind, k: usize) -> [f64; 3] {
        self.tips(kind).iter().copied().max_by(|a, b| a[k].total_cmp(&b[k])).unwrap_or([f64::NAN; 3])
    }

    /// Mean |output under load less output without| over settled rows of one way, arc-minutes; and its range over its
    /// mean.
    fn shift(&self, kind: GeneratorKind, torque_n_m: f64, forward: bool) -> [f64; 2] {
        let rows = |torque| standard(self.runs, kind, torque).map_or(&[][..], |run| &run.rows);
        let pick = |row: &&Row| row.settled && (row.turn_rad > 0.0) == forward;
        let unloaded: Vec<&Row> = rows(0.0).iter().filter(pick).collect();
        let difference = |loaded: &Row| {
            let same = unloaded.iter().find(|row| (row.generator_rad - loaded.generator_rad).abs() < 1e-6)?;
            Some((loaded.error_arcsec - same.error_arcsec) / 60.0)
        };
        let differences: Vec<f64> = rows(torque_n_m).iter().filter(pick).filter_map(difference).collect();
        let mean = differences.iter().sum::<f64>() / differences.len() as f64;
        [mean.abs(), range(&differences) / mean.abs()]
    }
}

/// Largest less smallest of the finite values.
fn range(values: &[f64]) -> f64 {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    finite().fold(f64::MIN, f64::max) - finite().fold(f64::MAX, f64::min)
}

/// Gap of two metrics over the spread of that gap, signed; the standard value first, then the other discretisations.
/// The spread is that of the difference: what moves both alike does not count.
fn gap_in_spreads(ours: &[f64], other: &[f64]) -> f64 {
    let gaps: Vec<f64> = ours.iter().zip(other).map(|(a, b)| a - b).collect();
    // A spread below a thousandth of the value says nothing about other uncertainties.
    let floor = 1e-3 * ours[0].abs().max(other[0].abs()).max(f64::MIN_POSITIVE);
    gaps[0] / range(&gaps).max(floor)
}

const LARGEST_ERROR: &str = "Largest |error| of the unloaded path, zero where the drive was deformed";
const BACKLASH: &str = "Mean error backward less mean error forward over whole pitches, no load but the drag";

/// All claims.
const CLAIMS: &[Claim] = &[
    Claim {
        id: "tip-path",
        place: "Fig. 6, (7) and (9)",
        says: "The tip of a flexspline tooth moves along the path of formulas (7) and (9).",
        metric: "Largest distance from the path of the tip in the FEM, unloaded, over the working depth",
        numbers: |e| {
            let Drive { flexspline, circular_spline, generator, .. } = e.drive;
            let depth_mm = flexspline.tip_radius_mm + generator.w0_mm - circular_spline.tip_radius_mm;
            e.each(ALL, "", at_most(0.02), |e, kind| {
                let path = ToothPath::new(e.drive, kind);
                let distances = e.tips(kind).iter().map(|&[phi, w, v]| {
                    let formula = path.flexspline_tip(phi);
                    (formula.w_mm - w).abs().max((formula.v_mm - v).abs())
                });
                distances.reduce(f64::max).unwrap_or(f64::NAN) / depth_mm
            })
        },
    },
    Claim {
        id: "tip-path-phase",
        place: "(5), (6) and text of Fig. 6",
        says: "Formula (5) begins at φ = π/2 for t = 0; the text has the tooth fully in mesh in the initial moment, φ \
               = 0.",
        metric: "φ at the initial moment by formula less φ by the text",
        numbers: |e| e.paper("by (5), less 0", ToothPath::angle_after(0.0), "rad", [Some(0.0); 2]),
    },
    Claim {
        id: "full-depth",
        place: "Fig. 6, text",
        says: "At φ = 0 the tooth enters the space as far as it goes, at φ = 90° it has left it.",
        metric: "Angle of the tip that is farthest out; its clearance to the other tip circle at 90°",
        numbers: |e| {
            let room =
                |e: &Evidence<'_>, kind| ToothPath::new(e.drive, kind).circular_spline_tip().w_mm - e.tip(kind, 0)[1];
            let e = e.each(ALL, "°", at_most(1.0), |e, kind| e.tip(kind, 1)[0].to_degrees());
            e.each(ALL, "mm", at_least(0.0), room)
        },
    },
    Claim {
        id: "no-interference",
        place: "Section 2, below Fig. 6; section 3",
        says: "In a well designed drive the teeth pass one another without interference, with each of the four \
               generators.",
        metric: "Least gap between the tooth outlines over the whole mesh cycle, both flanks, rigid teeth",
        numbers: |e| {
            e.each(ALL, "µm", at_least(0.0), |e, kind| {
                let mesh = RigidMesh::new(e.drive, kind).ok();
                mesh.and_then(|mesh| mesh.report(kind)).map_or(f64::NAN, |report| 1e3 * report.least.gap_mm)
            })
        },
    },
    Claim {
        id: "ratio",
        place: "Section 4; (6)",
        says: "The ratio is 95; a tooth goes from tooth on tooth to the middle of a space in a quarter turn.",
        metric: "Circular-spline teeth of the drive less the π / ((π/2)/i) of (6); its ratio less 95",
        numbers: |e| {
            let teeth = f64::from(e.drive.circular_spline.teeth) - PI / (FRAC_PI_2 / RATIO);
            let ratio = e.drive.ratio() - RATIO;
            e.ours("teeth", teeth, "", [Some(-1e-6), Some(1e-6)]).ours("ratio", ratio, "", [Some(-1e-9), Some(1e-9)])
        },
    },
    Claim {
        id: "stress-two-roller",
        place: "Fig. 10; section 5",
        says: "The highest stress occurs in the rim of the flexspline with the two-roller generator.",
        metric: "Largest von Mises stress on the unloaded path",
        numbers: |e| e.more([&[TwoRoller], &[FourRoller, DoubleDisc, Cam]], "MPa", 0.0, |m| m.peak_mpa),
    },
    Claim {
        id: "stress-at-axes",
        place: "Figs. 10 and 11",
        says: "In all variants stresses are increased at the major (D) and the minor (M) axis, where the deformation \
               is largest.",
        metric: "Angle of the largest von Mises stress from the nearer axis; a tooth spans about a degree",
        numbers: |e| e.run(ALL, "°", at_most(10.0), |m| m.peak_from_major_deg.min(90.0 - m.peak_from_major_deg)),
    },
    Claim {
        id: "stress-allowable",
        place: "Section 4, below Fig. 11",
        says: "In none of the models were the allowable stresses exceeded.",
        metric: "Largest von Mises stress; the steel, its allowable stress and the stresses found are not given",
        numbers: |e| e.run(ALL, "MPa", ANY, |m| m.peak_mpa),
    },
    Claim {
        id: "not-nominal",
        place: "Fig. 12, text",
        says: "With none of the generators the output follows the nominal line.",
        metric: "|Mean lag| over whole tooth pitches after start-up, forward, no load",
        numbers: |e| {
            e.run(ALL, "′", ANY, lag).each(ALL, "spreads", at_least(SPREADS), |e, kind| e.in_spreads(kind, lag))
        },
    },
    Claim {
        id: "rollers-delayed",
        place: "Fig. 12 (a), (b)",
        says: "With rollers the output is delayed in the first phase of motion.",
        metric: "Mean lag forward, negative when the output is late",
        numbers: |e| e.run(ROLLERS, "′", at_most(0.0), lag),
    },
    Claim {
        id: "equal-at-one-radian",
        place: "Fig. 12, text",
        says: "After 1 rad the output of the roller drives is equal to the nominal value; therefore the motion is \
               reversed there.",
        metric: "Error at +1 rad over the largest error up to there, no load",
        numbers: |e| e.run(ROLLERS, "", at_most(0.1), |m| m.error_at_turn_arcsec.abs() / m.largest_out_arcsec),
    },
    Claim {
        id: "return-greater",
        place: "Fig. 12, text",
        says: "On the way back the delay of the roller drives is even greater.",
        metric: "Largest |error| on the way back over that on the way there, no load",
        numbers: |e| e.run(ROLLERS, "", at_least(1.1), |m| m.largest_back_arcsec / m.largest_out_arcsec),
    },
    Claim {
        id: "return-approaches",
        place: "Fig. 12, text",
        says: "On the way back the output of the roller drives approaches the theoretical values after the first \
               phase.",
        metric: "Error at −1 rad over the largest on the way back, no load",
        numbers: |e| e.run(ROLLERS, "", at_most(0.5), |m| m.error_at_end_arcsec.abs() / m.largest_back_arcsec),
    },
    Claim {
        id: "disc-and-cam-closer",
        place: "Fig. 12 (c), (d)",
        says: "With double disc and cam the curve is much closer to the nominal one than with rollers.",
        metric: LARGEST_ERROR,
        numbers: |e| {
            // Much: half as much again.
            let ratio =
                |e: &Evidence<'_>, kind| e.of(kind, largest) / e.of(DoubleDisc, largest).max(e.of(Cam, largest));
            e.more([&ROLLERS, &LOADED], "′", 0.0, largest).each(ROLLERS, "of the others", at_least(1.5), ratio)
        },
    },
    Claim {
        id: "cam-slight-delay",
        place: "Text before Fig. 12",
        says: "The cam drive too has a slight delay, from clearance, stiffness or “tooth arrangement” at the start.",
        metric: "Delay forward over half the clearance found at the reversal, no load",
        numbers: |e| e.run([Cam], "", within(1.0, 0.05), |m| -m.lag_forward_arcsec / m.half_width_arcsec),
    },
    Claim {
        id: "error-four-roller",
        place: "Fig. 13",
        says: "The largest error is that of the four-roller drive, 0.0062247 rad, 21′.",
        metric: LARGEST_ERROR,
        numbers: |e| {
            let e = e.paper("0.0062247 rad less 21′", ERROR_FOUR_ROLLER - 21.0, "′", ROUNDED);
            e.size(FourRoller, ERROR_FOUR_ROLLER, largest)
        },
    },
    Claim {
        id: "error-two-roller",
        place: "Fig. 13",
        says: "The two-roller drive has values similar to those of the four-roller drive.",
        metric: "Largest |error| of the two-roller drive over that of the four-roller drive, unloaded path",
        numbers: |e| {
            e.each([TwoRoller], "", within(1.0, SHARE), |e, kind| e.of(kind, largest) / e.of(FourRoller, largest))
        },
    },
    Claim {
        id: "error-double-disc",
        place: "Fig. 13",
        says: "The error of the double-disc drive is 0.0041344 rad.",
        metric: LARGEST_ERROR,
        numbers: |e| e.size(DoubleDisc, ERROR_DOUBLE_DISC, largest),
    },
    Claim {
        id: "error-cam",
        place: "Fig. 13",
        says: "The error of the cam drive is 0.003 rad.",
        metric: LARGEST_ERROR,
        numbers: |e| e.size(Cam, ERROR_CAM, largest),
    },
    Claim {
        id: "error-cam-converted",
        place: "Below Fig. 13",
        says: "An error of 0.003 rad is about 4 arc-minutes.",
        metric: "0.003 rad in arc-minutes less the 4′ of the text",
        numbers: |e| e.paper("0.003 rad", ERROR_CAM, "′", ANY).paper("less 4′", ERROR_CAM - 4.0, "′", ROUNDED),
    },
    Claim {
        id: "error-cam-in-range",
        place: "Below Fig. 13",
        says: "The cam drive is within the 1′ to 9′ that makers recommend; rollers are not.",
        metric: "The paper's 0.003 rad against its own range",
        numbers: |e| e.paper("cam", ERROR_CAM, "′", RECOMMENDED),
    },
    Claim {
        id: "high-accuracy",
        place: "Section 4 and section 5",
        says: "Roller drives still have high kinematic accuracy; disc and cam are classified above the standard.",
        metric: "Errors of Fig. 13 against the range of 1′ to 9′; 21.4′ are 59 % of all that the output turns in 1 rad",
        numbers: |e| {
            e.paper("double disc", ERROR_DOUBLE_DISC, "′", RECOMMENDED).paper("cam", ERROR_CAM, "′", RECOMMENDED)
        },
    },
    Claim {
        id: "error-order",
        place: "Fig. 13",
        says: "Errors rank four-roller ≥ two-roller > double disc > cam.",
        metric: LARGEST_ERROR,
        numbers: |e| e.more([&ROLLERS, &LOADED], "′", 0.0, largest).more([&[DoubleDisc], &[Cam]], "′", 0.0, largest),
    },
    Claim {
        id: "load-with-motion",
        place: "Figs. 14 and 15, text",
        says: "A torque with the motion makes no clear difference to the unloaded output; the curves almost overlap.",
        metric: "Mean |output under load less output without| over settled rows at the same generator angle",
        numbers: |e| e.each(LOADED, "′", at_most(BACKLASH_CAM), |e, kind| e.shift(kind, TORQUE_N_M, true)[0]),
    },
    Claim {
        id: "load-against-larger",
        place: "Figs. 14 and 15, text",
        says: "Discrepancies are larger when the torque is opposite to the motion.",
        metric: "The same shift under −200 N·m over that under +200 N·m, forward",
        numbers: |e| {
            e.each(LOADED, "", at_least(1.0), |e, kind| {
                e.shift(kind, -TORQUE_N_M, true)[0] / e.shift(kind, TORQUE_N_M, true)[0]
            })
        },
    },
    Claim {
        id: "load-after-reversal",
        place: "Figs. 14 and 15, text",
        says: "With the torque against the first motion the largest differences come after the reversal at 1 rad.",
        metric: "The shift under −200 N·m after the reversal less that before it, over the backlash at no load",
        numbers: |e| {
            e.each(LOADED, "", at_least(0.9), |e, kind| {
                let [after, before] = [false, true].map(|forward| e.shift(kind, -TORQUE_N_M, forward)[0]);
                (after - before) / e.of(kind, backlash)
            })
        },
    },
    Claim {
        id: "load-parallel",
        place: "Figs. 14 and 15, text",
        says: "On the way back the loaded curve is mostly parallel to the unloaded one; the deceleration does not \
               grow.",
        metric: "Range over mean of the shift under −200 N·m on the way back, settled rows",
        numbers: |e| e.each(LOADED, "", at_most(0.05), |e, kind| e.shift(kind, -TORQUE_N_M, false)[1]),
    },
    Claim {
        id: "load-cam-better",
        place: "Below Fig. 15",
        says: "The cam drive is more accurate under load too.",
        metric: "Size of the mean lag forward under −200 N·m",
        numbers: |e| e.more([&[DoubleDisc], &[Cam]], "′", -TORQUE_N_M, |m| lag(m).abs()),
    },
    Claim {
        id: "load-significant",
        place: "Section 4 against section 5",
        says: "Section 4: the load had a significant impact on the accuracy. Section 5: no negative effect of the \
               torque on the error was observed, regardless of its direction.",
        metric: "Mean lag under −200 N·m over the largest unloaded error",
        numbers: |e| {
            let ratio = |e: &Evidence<'_>, kind| e.under(kind, -TORQUE_N_M, lag)[0].abs() / e.of(kind, largest);
            e.paper("sections that agree", 0.0, "", at_least(1.0)).each(LOADED, "", ANY, ratio)
        },
    },
    Claim {
        id: "load-labels",
        place: "Figs. 14 and 15",
        says: "The loaded curves are labelled (2), green, and (2), red.",
        metric: "Labels of two different curves",
        numbers: |e| e.paper("labels that differ", 0.0, "", at_least(1.0)),
    },
    Claim {
        id: "load-width",
        place: "Section 3; before Fig. 14",
        says: "The plane model has unit thickness and carries about 200 N·m.",
        metric: "Tangential line load of 200 N·m; the membrane stress of the rim from it on 1 mm",
        numbers: |e| {
            let rim = &e.drive.flexspline;
            let unit = 2e3 * TORQUE_N_M / (rim.tip_radius_mm + e.drive.circular_spline.tip_radius_mm);
            e.paper("on 1 mm", unit, "N/mm", ANY)
                .paper("face widths given", 0.0, "", at_least(1.0))
                .ours("on the width of the drive", unit / rim.width_mm, "N/mm", ANY)
                // Two lobes, each held from both sides: a quarter of the force runs through a section of the rim.
                .ours("on 1 mm", 0.25 * unit / rim.rim_thickness_mm, "MPa", ANY)
        },
    },
    Claim {
        id: "dwell",
        place: "Figs. 16 and 17",
        says: "After the reversal the output stands (A–B) because of the backlash.",
        metric: "Generator travel after the reversal while the output stays within 0.05″; over ratio and backlash",
        numbers: |e| {
            e.run(LOADED, "°", ANY, dwell).each(LOADED, "", within(1.0, 0.05), |e, kind| {
                60.0 * e.of(kind, dwell) / e.drive.ratio() / e.of(kind, backlash)
            })
        },
    },
    Claim {
        id: "dwell-disc-longer",
        place: "Figs. 16 and 17",
        says: "A–B is longer with the double disc.",
        metric: "Dwell of the generator",
        numbers: |e| e.more([&[DoubleDisc], &[Cam]], "°", 0.0, dwell),
    },
    Claim {
        id: "backlash-double-disc",
        place: "Below Fig. 17",
        says: "The backlash with the double disc is 1.16′.",
        metric: BACKLASH,
        numbers: |e| e.size(DoubleDisc, BACKLASH_DOUBLE_DISC, backlash),
    },
    Claim {
        id: "backlash-cam",
        place: "Below Fig. 17",
        says: "The backlash with the cam is 0.98′.",
        metric: BACKLASH,
        numbers: |e| e.size(Cam, BACKLASH_CAM, backlash),
    },
    Claim {
        id: "backlash-order",
        place: "Below Fig. 17",
        says: "The double disc has more backlash than the cam.",
        metric: BACKLASH,
        numbers: |e| e.more([&[DoubleDisc], &[Cam]], "′", 0.0, backlash),
    },
    Claim {
        id: "backlash-difference",
        place: "Below Fig. 17",
        says: "The two differ by 0.18′.",
        metric: BACKLASH,
        numbers: |e| {
            let (paper, ours) = (BACKLASH_DOUBLE_DISC - BACKLASH_CAM, e.of(DoubleDisc, backlash) - e.of(Cam, backlash));
            e.paper("difference", paper, "′", ANY).ours("difference", ours, "′", within(paper, SHARE))
        },
    },
    Claim {
        id: "path-differs",
        place: "Figs. 16 and 17",
        says: "The first motion 0–A does not follow the same curve as the return B–C.",
        metric: "Lost motion: mean |e(B–C) − e(0–A)| at the same generator angles, no load",
        numbers: |e| {
            let lost: Metric = |m| m.lost_motion_arcsec / 60.0;
            e.run(LOADED, "′", ANY, lost).each(LOADED, "spreads", at_least(SPREADS), |e, kind| e.in_spreads(kind, lost))
        },
    },
    Claim {
        id: "backlash-limits",
        place: "Below Fig. 17",
        says: "Both backlashes are below what makers allow: 2.5′ standard, 1.5′ special.",
        metric: BACKLASH,
        numbers: |e| e.paper("special", 1.5, "′", ANY).run(LOADED, "′", at_most(1.5), backlash),
    },
    Claim {
        id: "recurring-error",
        place: "Below Fig. 17",
        says: "The recurring error is lower with the cam than with the double disc.",
        metric: "Ripple after start-up, peak to peak, no load",
        numbers: |e| e.more([&[DoubleDisc], &[Cam]], "″", 0.0, |m| m.ripple_pp_arcsec),
    },
    Claim {
        id: "cam-most-accurate",
        place: "Abstract; end of sections 4 and 5",
        says: "Of the four, the cam allows the highest accuracy, in reversing motion too.",
        metric: BACKLASH,
        numbers: |e| e.more([&[TwoRoller, FourRoller, DoubleDisc], &[Cam]], "′", 0.0, backlash),
    },
    Claim {
        id: "model-data",
        place: "Section 3",
        says: "The calculations can be followed: Abaqus, plane strain, quadrilaterals, denser at the flanks.",
        metric: "Not given: tooth sizes, materials, mesh, contact, friction, time step, how the rim was held",
        numbers: |e| e,
    },
];

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use super::*;

    static DRIVE: LazyLock<Drive> = LazyLock::new(Drive::hhd_95);

    fn ours(value: f64, bounds: Bounds) -> Evidence<'static> {
        Evidence { drive: &DRIVE, runs: &[], paper: Vec::new(), ours: Vec::new() }.ours("x", value, "", bounds)
    }

    #[test]
    fn the_verdict_follows_from_the_bounds() {
        assert_eq!(ours(1.0, within(1.16, 0.25)).verdict(), Reproduced);
        assert_eq!(ours(0.5, within(21.4, 0.25)).verdict(), NotReproduced);
        assert_eq!(ours(2.9, at_least(3.0)).verdict(), NotReproduced);
        assert_eq!(ours(3.1, at_least(3.0)).ours("y", 2.0, "", at_most(1.0)).verdict(), NotReproduced);
        assert_eq!(ours(0.9, at_most(1.0)).verdict(), Reproduced);
        assert_eq!(ours(0.9, ANY).verdict(), NotTestable);
    }

    #[test]
    fn the_papers_own_arithmetic_comes_first() {
        let converted = |value| ours(1.0, at_least(0.0)).paper("converted", value, "′", [Some(20.5), Some(21.5)]);
        assert_eq!(converted(10.3).verdict(), Inconsistent);
        assert_eq!(converted(21.4).verdict(), Reproduced);
    }

    #[test]
    fn a_run_that_failed_leaves_a_claim_untestable() {
        assert_eq!(ours(f64::NAN, at_most(1.0)).verdict(), NotTestable);
        let runs = crate::runs::planned(flexspline_mechanics::mesh::MeshLevel::Coarse, true);
        let of_the_drive = ["no-interference", "ratio"];
        for JudgedClaim { claim, verdict, .. } in judged(&DRIVE, &runs) {
            let expected = if of_the_drive.contains(&claim.id) { [Reproduced; 2] } else { [NotTestable, Inconsistent] };
            assert!(expected.contains(&verdict), "{}: {verdict:?}", claim.id);
        }
    }

    #[test]
    fn the_papers_numbers_in_arc_minutes() {
        assert!((ERROR_FOUR_ROLLER - 21.40).abs() < 0.005 && (ERROR_DOUBLE_DISC - 14.21).abs() < 0.005);
        // Not 4.
        assert!((ERROR_CAM - 10.31).abs() < 0.005);
    }

    #[test]
    fn a_gap_must_exceed_three_spreads() {
        let a = [10.0, 10.4, 9.9];
        assert!(gap_in_spreads(&[12.0; 3], &a) > SPREADS);
        assert!(gap_in_spreads(&[11.4; 3], &a) < SPREADS);
        assert!(gap_in_spreads(&[8.0; 3], &a) < -SPREADS);
        assert!(gap_in_spreads(&[f64::NAN, 12.0], &[1.0, 1.0]).is_nan());
        assert!(gap_in_spreads(&[12.0, f64::NAN, 12.0], &a) > SPREADS, "a variant that failed does not count");
    }

    /// A notch that every mesh sees larger moves both generators, and not their order.
    #[test]
    fn a_common_change_does_not_count() {
        assert!(gap_in_spreads(&[200.0, 240.0], &[160.0, 200.0]) > SPREADS);
    }
}
