//! Section 2: the path of a tooth, formulas (1)–(10), figure 6; the ratio.

use super::super::claim::{Claim, Verdict, claim};
use super::super::paper;
use super::{Evidence, least, most};
use flexspline_mechanics::drive::{GeneratorKind, RigidMesh};
use flexspline_mechanics::reference::ToothPath;

/// Largest distance of the formulas from the FEM that counts as agreement, of the working depth.
const OF_WORKING_DEPTH: f64 = 0.02;

/// Largest distance of the path by the formulas from that of the FEM, µm: outward and around.
pub(crate) fn path_differences_um(evidence: &Evidence<'_>, kind: GeneratorKind) -> [f64; 2] {
    let Some(snapshot) = evidence.unloaded(kind).and_then(|s| s.snapshot.as_ref()) else { return [f64::NAN; 2] };
    let path = ToothPath::new(evidence.drive, kind);
    snapshot.tip_path.iter().fold([0.0, 0.0], |[outward, around], &[phi, w, v]| {
        let formula = path.flexspline_tip(phi);
        [f64::max(outward, 1e3 * (formula.w_mm - w).abs()), f64::max(around, 1e3 * (formula.v_mm - v).abs())]
    })
}

pub(super) fn claims(evidence: &Evidence<'_>) -> Vec<Claim> {
    let drive = evidence.drive;
    let all = GeneratorKind::ALL;
    let depth_mm = drive.flexspline.tip_radius_mm + drive.generator.w0_mm - drive.circular_spline.tip_radius_mm;
    let differences = all.map(|kind| path_differences_um(evidence, kind));
    let worst = most(differences.iter().flatten().copied());
    let mut path = claim(
        "tip-path",
        "Fig. 6, (7) and (9)",
        "The tip of a flexspline tooth moves along the path of formulas (7) and (9).",
    )
    .metric(
        "Largest distance of that path from the path of the tooth tip in the FEM, deformed, no load, over a quarter \
         turn",
    );
    for (kind, [outward, around]) in all.iter().zip(differences) {
        path = path.ours(kind.in_words(), outward.max(around), "µm");
    }
    let path = path
        .at_most("largest distance over the working depth", worst / (1e3 * depth_mm), "", OF_WORKING_DEPTH)
        .because(|verdict| match verdict {
            Verdict::Reproduced => format!(
                "The formulas are first order in the displacement and stay within {worst:.1} µm; good for a drawing, \
                 while the flanks clear each other by 7 µm."
            ),
            _ => format!("The formulas are off by up to {worst:.1} µm."),
        });

    let phase = claim(
        "tip-path-phase",
        "(5), (6) and text of Fig. 6",
        "Formula (5) begins at φ = π/2 for t = 0; the text has the tooth fully in mesh in the initial moment, φ = 0.",
    )
    .paper("by (5)", paper::PHI_AT_START_BY_FORMULA, "rad")
    .paper("by the text", paper::PHI_AT_START_BY_TEXT, "rad")
    .metric("φ at the initial moment by formula less φ by the text")
    .paper_keeps(
        "difference of both",
        ToothPath::angle_after(0.0) - paper::PHI_AT_START_BY_TEXT,
        "rad",
        [Some(0.0), Some(0.0)],
    )
    .because(|_| {
        "The two are a quarter turn apart; the formulas make sense only with φ from the major axis and t = 0 at the \
         minor axis."
            .into()
    });

    // Where the tip reaches farthest out, in teeth from the major axis.
    let deepest = most(all.iter().map(|&kind| {
        evidence.unloaded(kind).and_then(|s| s.snapshot.as_ref()).map_or(f64::NAN, |snapshot| {
            let far = snapshot.tip_path.iter().max_by(|a, b| a[1].total_cmp(&b[1]));
            far.map_or(f64::NAN, |[phi, ..]| phi.to_degrees())
        })
    }));
    let full = claim(
        "full-depth",
        "Fig. 6, text",
        "At φ = 0 the tooth enters the space as far as it goes, at φ = 90° it has left it.",
    )
    .metric(
        "Angle from the major axis at which the tip is farthest out; height of the tip below the tip circle of the \
         other wheel at 90°",
    )
    .ours("farthest out at", deepest, "°")
    .at_most("angle of the deepest tooth from the major axis", deepest, "°", 1.0)
    .at_least(
        "clearance of the tips at the minor axis, least of all",
        least(all.iter().map(|&kind| {
            let path = ToothPath::new(drive, kind);
            evidence.unloaded(kind).and_then(|s| s.snapshot.as_ref()).map_or(f64::NAN, |snapshot| {
                let last = snapshot.tip_path.iter().max_by(|a, b| a[0].total_cmp(&b[0]));
                last.map_or(f64::NAN, |[_, w, _]| path.circular_spline_tip().w_mm - w)
            })
        })),
        "mm",
        0.0,
    )
    .because(|verdict| match verdict {
        Verdict::Reproduced => "So it is with all four generators.".into(),
        _ => "Not with every generator.".into(),
    });

    let gaps = all.map(|kind| {
        RigidMesh::new(drive, kind).ok().and_then(|mesh| mesh.report(kind)).map_or(f64::NAN, |r| 1e3 * r.least.gap_mm)
    });
    let mut clear = claim(
        "no-interference",
        "Section 2, below Fig. 6; section 3",
        "In a well designed drive the teeth pass one another without interference, with each of the four generators.",
    )
    .metric("Least gap between the tooth outlines over the whole mesh cycle, both flanks, rigid teeth");
    for (kind, gap) in all.iter().zip(gaps) {
        clear = clear.ours(kind.in_words(), gap, "µm");
    }
    let clear = clear.at_least("least gap", least(gaps), "µm", 0.0).because(|verdict| match verdict {
        Verdict::Reproduced => "One pair of wheels clears under all four generators.".into(),
        _ => "Teeth interfere.".into(),
    });

    let teeth = claim(
        "ratio",
        "Section 4; (6)",
        "The ratio is 95; a tooth goes from tooth on tooth to the middle of a space in a quarter turn.",
    )
    .paper("i", paper::RATIO, "")
    .metric("Circular-spline teeth that (6) asks for, π / ((π/2)/i), against the drive's; settled rate of the output")
    .ours("teeth by (6)", paper::circular_spline_teeth(), "")
    .ours("teeth of the drive", f64::from(drive.circular_spline.teeth), "")
    .at_most(
        "difference of both",
        (paper::circular_spline_teeth() - f64::from(drive.circular_spline.teeth)).abs(),
        "",
        1e-6,
    )
    .at_most("|i − 95|", (drive.ratio() - paper::RATIO).abs(), "", 1e-9)
    .because(|verdict| match verdict {
        Verdict::Reproduced => {
            format!(
                "With the flexspline fixed only 188 and 190 teeth do: (6) asks for {} on the output.",
                paper::circular_spline_teeth().round()
            )
        }
        _ => "The drive given has another ratio.".into(),
    });
    vec![path, phase, full, clear, teeth]
}
