//! Figures 14 and 15: double disc and cam under +200, 0 and −200 N·m.

use super::super::claim::{Claim, Verdict, claim};
use super::super::paper;
use super::super::rank::SPREADS;
use super::{Evidence, least, most};
use flexspline_design::simulate::Row;
use flexspline_mechanics::drive::GeneratorKind::{self, Cam, DoubleDisc};

const LOADED: [GeneratorKind; 2] = [DoubleDisc, Cam];
/// How flat a difference must be to count as parallel: range over mean.
const PARALLEL: f64 = 0.05;

/// Mean |output under load less output without| over settled rows of one way, arc-minutes; and its range over its mean.
fn shift(evidence: &Evidence<'_>, kind: GeneratorKind, torque_n_m: f64, forward: bool) -> [f64; 2] {
    let rows = |torque| evidence.runs.get(kind, torque).map(|s| s.rows.as_slice()).unwrap_or_default();
    let pick = |row: &&Row| row.settled && (row.turn_rad > 0.0) == forward;
    let unloaded: Vec<&Row> = rows(0.0).iter().filter(pick).collect();
    let differences: Vec<f64> = rows(torque_n_m)
        .iter()
        .filter(pick)
        .filter_map(|loaded| {
            let same = unloaded.iter().find(|row| (row.generator_rad - loaded.generator_rad).abs() < 1e-6)?;
            Some((loaded.error_arcsec - same.error_arcsec) / 60.0)
        })
        .collect();
    if differences.is_empty() {
        return [f64::NAN; 2];
    }
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    let range =
        differences.iter().copied().fold(f64::MIN, f64::max) - differences.iter().copied().fold(f64::MAX, f64::min);
    [mean.abs(), range / mean.abs()]
}

pub(super) fn claims(evidence: &Evidence<'_>) -> Vec<Claim> {
    let torque = paper::TORQUE_N_M;
    let with = |kind, forward| shift(evidence, kind, torque, forward)[0];
    let against = |kind, forward| shift(evidence, kind, -torque, forward)[0];
    const METRIC: &str =
        "Mean |output under load less output without load| over settled rows at the same generator angle";

    let same = claim(
        "load-with-motion",
        "Figs. 14 and 15, text",
        "A torque with the motion makes no clear difference to the unloaded output; the curves almost overlap.",
    )
    .metric(METRIC)
    .ours_each(LOADED, ", +200 N·m, forward", |kind| with(kind, true), "′");
    let same = same
        .at_most(
            "largest shift, against the smallest difference that the paper reads from its charts",
            most(LOADED.map(|kind| with(kind, true))),
            "′",
            paper::BACKLASH_CAM_ARCMIN,
        )
        .because(|verdict| match verdict {
            Verdict::Reproduced => "The shift would not be seen.".into(),
            _ => "A load with the motion pushes the output across its whole clearance and winds the drive up.".into(),
        });

    let more = least(LOADED.map(|kind| against(kind, true) / with(kind, true)));
    let opposite = claim(
        "load-against-larger",
        "Figs. 14 and 15, text",
        "Discrepancies are larger when the torque is opposite to the motion.",
    )
    .metric("The same shift under −200 N·m over that under +200 N·m, forward")
    .ours_each(LOADED, ", −200 N·m, forward", |kind| against(kind, true), "′");
    let opposite = opposite.at_least("least ratio of the two", more, "", 1.0).because(|verdict| match verdict {
        Verdict::Reproduced => "They are larger.".into(),
        _ => "The other way round: without load the output already lies on the flank that a load against the motion \
              presses, so that only the wind-up shows; a load with the motion adds the clearance."
            .into(),
    });

    let grows =
        least(LOADED.map(|kind| (against(kind, false) - against(kind, true)) / evidence.backlash(kind).value * 60.0));
    let mut after = claim(
        "load-after-reversal",
        "Figs. 14 and 15, text",
        "With the torque against the first motion the largest differences come after the reversal at 1 rad.",
    )
    .metric("The shift under −200 N·m after the reversal less that before it, over the backlash at no load");
    for kind in LOADED {
        after = after.ours(format!("{}, after", kind.in_words()), against(kind, false), "′");
        after = after.ours(format!("{}, before", kind.in_words()), against(kind, true), "′");
    }
    let after = after.at_least("least growth, in backlashes", grows, "", 0.9).because(|verdict| match verdict {
        Verdict::Reproduced => {
            "It grows by the backlash, because the unloaded output changes its flank and the loaded does not.".into()
        }
        _ => "The shift does not grow by the backlash.".into(),
    });

    let flat = most(LOADED.map(|kind| shift(evidence, kind, -torque, false)[1]));
    let parallel = claim(
        "load-parallel",
        "Figs. 14 and 15, text",
        "On the way back the loaded curve is mostly parallel to the unloaded one; the deceleration does not grow.",
    )
    .metric("Range over mean of the shift under −200 N·m on the way back, settled rows")
    .ours("largest range over mean", flat, "")
    .at_most("largest range over mean", flat, "", PARALLEL)
    .because(|verdict| match verdict {
        Verdict::Reproduced => "Wind-up does not change from tooth to tooth.".into(),
        _ => "The curves are not parallel.".into(),
    });

    let loaded_error = |kind| evidence.runs.measure(kind, -torque, |m| Some(m.lag_forward_arcsec?.abs()));
    let gap = loaded_error(DoubleDisc).gap_in_spreads(&loaded_error(Cam));
    let better = claim("load-cam-better", "Below Fig. 15", "The cam drive is more accurate under load too.")
        .metric("Mean lag forward under −200 N·m: double disc less cam, in spreads")
        .ours_each(LOADED, "", |kind| loaded_error(kind).value / 60.0, "′");
    let better = better.at_least("gap, in spreads", gap, "", SPREADS).because(|verdict| match verdict {
        Verdict::Reproduced => format!(
            "The cam holds the rim all around; the discs let it go between their arcs, and it winds up {:.1} times as \
             far.",
            loaded_error(DoubleDisc).value / loaded_error(Cam).value
        ),
        _ => "The gap is within the discretisation.".into(),
    });

    let significant = least(LOADED.map(|kind| loaded_error(kind).value / evidence.largest(kind).value));
    let words = claim(
        "load-significant",
        "Section 4 against section 5",
        "Section 4: the load had a significant impact on the accuracy. Section 5: no negative effect of the torque on \
         the error was observed, regardless of its direction.",
    )
    .metric("Whether sections 4 and 5 say the same; ours: mean lag under −200 N·m over the largest unloaded error")
    .ours("least ratio", significant, "")
    .paper_keeps(
        "both sections say the same (1) or not (0)",
        f64::from(u8::from(paper::LOAD_MATTERS[0] == paper::LOAD_MATTERS[1])),
        "",
        [Some(1.0), None],
    )
    .because(|_| {
        format!(
            "The two sections contradict each other; with us 200 N·m makes the error {significant:.1} times as large \
             or more."
        )
    });

    let [_, forward, backward] = paper::LOAD_LABELS;
    let labels = claim("load-labels", "Figs. 14 and 15", "The loaded curves are labelled (2), green, and (2), red.")
        .paper("label of the load with the motion", f64::from(forward), "")
        .paper("label of the load against it", f64::from(backward), "")
        .metric("Difference of the labels of two different curves")
        .paper_keeps("difference of the two labels", f64::from(forward.abs_diff(backward)), "", [Some(1.0), None])
        .because(|_| "Two curves bear the same label.".into());

    let radius = 0.5 * (evidence.drive.flexspline.tip_radius_mm + evidence.drive.circular_spline.tip_radius_mm);
    let unit = paper::line_load_n_per_mm(radius, paper::MODEL_THICKNESS_MM);
    let ours = paper::line_load_n_per_mm(radius, evidence.drive.flexspline.width_mm);
    // Two lobes, each held from both sides: a quarter of the force runs through a section of the rim.
    let membrane = 0.25 * unit / evidence.drive.flexspline.rim_thickness_mm;
    let width = claim(
        "load-width",
        "Section 3; before Fig. 14",
        "The plane model has unit thickness and carries about 200 N·m.",
    )
    .paper("on 1 mm at the radius of the teeth", unit, "N/mm")
    .metric(
        "Tangential line load of 200 N·m on a model of 1 mm, and what it stretches the built-in rim by; ours with the \
         width of the drive",
    )
    .ours(format!("on {} mm", evidence.drive.flexspline.width_mm), ours, "N/mm")
    .ours("membrane stress of the rim on 1 mm", membrane, "MPa")
    .paper_keeps("face widths given", f64::from(u8::from(paper::FACE_WIDTH_MM.is_some())), "", [Some(1.0), None])
    .because(|_| {
        format!(
            "No width is given: on unit thickness 200 N·m are {unit:.0} N/mm and stretch a 1.2 mm rim by \
             {membrane:.0} MPa. All runs here spread it over {} mm.",
            evidence.drive.flexspline.width_mm
        )
    });
    vec![same, opposite, after, parallel, better, words, labels, width]
}
