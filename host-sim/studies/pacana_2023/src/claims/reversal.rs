//! Figures 16 and 17: the reversal of double disc and cam, backlash, and what the abstract makes of it.

use super::super::claim::{Claim, Verdict, claim};
use super::super::paper;
use super::super::rank::SPREADS;
use super::{Evidence, SHARE, least, most};
use flexspline_mechanics::drive::GeneratorKind::{self, Cam, DoubleDisc};

const REVERSED: [GeneratorKind; 2] = [DoubleDisc, Cam];

pub(super) fn claims(evidence: &Evidence<'_>) -> Vec<Claim> {
    let dwell = |kind| evidence.runs.measure(kind, 0.0, |m| m.dwell_rad);
    let by_dwell = |kind| evidence.arcmin(kind, |m| m.dwell_arcsec);
    let backlash = |kind: GeneratorKind| evidence.backlash(kind);

    let stands =
        claim("dwell", "Figs. 16 and 17", "After the reversal the output stands (A–B) because of the backlash.")
            .metric(
                "Generator travel from the reversal while the output stays within 0.05″, over the ratio, against the \
                 backlash of both ways",
            )
            .ours_each(REVERSED, ", generator", |kind| dwell(kind).value.to_degrees(), "°");
    let agreement = most(REVERSED.map(|kind| (by_dwell(kind) * 60.0 / backlash(kind).value - 1.0).abs()));
    let stands = stands
        .at_most("dwell over the ratio against the backlash, largest deviation", agreement, "", 0.05)
        .because(|verdict| match verdict {
            Verdict::Reproduced => {
                "The output stands until the generator has crossed the clearance 95 times enlarged.".into()
            }
            _ => "Dwell and backlash differ.".into(),
        });

    let longer = claim("dwell-disc-longer", "Figs. 16 and 17", "A–B is longer with the double disc.")
        .metric("Dwell of the generator: double disc less cam, in spreads")
        .ours("double disc", dwell(DoubleDisc).value.to_degrees(), "°")
        .ours("cam", dwell(Cam).value.to_degrees(), "°")
        .at_least("gap, in spreads", dwell(DoubleDisc).gap_in_spreads(&dwell(Cam)), "", SPREADS)
        .because(|verdict| match verdict {
            Verdict::Reproduced => {
                "A disc of the same deflection flattens the rim beside the axis and leaves a little more room.".into()
            }
            _ => "Not beyond the discretisation.".into(),
        });

    let size = |id, kind, place, says: &str, paper_arcmin| {
        let ours = backlash(kind).value / 60.0;
        claim(id, place, says)
            .paper(kind.in_words(), paper_arcmin, "′")
            .metric("Mean error backward less mean error forward over whole pitches, no load but the drag of 0.02 N·m")
            .ours(kind.in_words(), ours, "′")
            .within("backlash", ours, "′", paper_arcmin, SHARE)
            .because(move |verdict| match verdict {
                Verdict::Reproduced => "Of the same size, but that is no evidence: the clearance of the built-in \
                                        drive was chosen to give the cam about 1′; only the difference of the two \
                                        generators is."
                    .into(),
                _ => "Another clearance between the teeth.".into(),
            })
    };
    let disc = size(
        "backlash-double-disc",
        DoubleDisc,
        "Below Fig. 17",
        "The backlash with the double disc is 1.16′.",
        paper::BACKLASH_DOUBLE_DISC_ARCMIN,
    );
    let cam =
        size("backlash-cam", Cam, "Below Fig. 17", "The backlash with the cam is 0.98′.", paper::BACKLASH_CAM_ARCMIN);

    let gap = backlash(DoubleDisc).gap_in_spreads(&backlash(Cam));
    let order = claim("backlash-order", "Below Fig. 17", "The double disc has more backlash than the cam.")
        .metric("Backlash at no load: double disc less cam, in spreads; same teeth, same deflection")
        .ours("double disc", backlash(DoubleDisc).value / 60.0, "′")
        .ours("cam", backlash(Cam).value / 60.0, "′")
        .at_least("gap, in spreads", gap, "", SPREADS)
        .because(|verdict| match verdict {
            Verdict::Reproduced => "It has, by the shape of the rim alone.".into(),
            _ => "Not beyond the discretisation.".into(),
        });

    let theirs = paper::BACKLASH_DOUBLE_DISC_ARCMIN - paper::BACKLASH_CAM_ARCMIN;
    let ours = (backlash(DoubleDisc).value - backlash(Cam).value) / 60.0;
    let difference = claim("backlash-difference", "Below Fig. 17", "The two differ by 0.18′.")
        .paper("double disc less cam", theirs, "′")
        .metric("Backlash at no load, double disc less cam")
        .ours("double disc less cam", ours, "′")
        .within("difference", ours, "′", theirs, SHARE)
        .because(|verdict| match verdict {
            Verdict::Reproduced => "Within a quarter.".into(),
            _ => format!(
                "Ours is {ours:.2}′: the sign is the paper's, the size is not; 1 µm of deflection more or less moves \
                 a backlash by 0.05′, and the paper does not say how equal its generators are."
            ),
        });

    let paths = claim(
        "path-differs",
        "Figs. 16 and 17",
        "The first motion 0–A does not follow the same curve as the return B–C.",
    )
    .metric("Lost motion: mean |e(B–C) − e(0–A)| at the same generator angles, no load; over the backlash")
    .paper("difference of the two, not given", f64::NAN, "′")
    .ours_each(REVERSED, "", |kind| evidence.arcmin(kind, |m| m.lost_motion_arcsec), "′");
    let apart = least(REVERSED.map(|kind| {
        let lost = evidence.runs.measure(kind, 0.0, |m| m.lost_motion_arcsec);
        lost.value / lost.spread.max(1e-3 * lost.value)
    }));
    let paths = paths.at_least("least lost motion, in spreads", apart, "", SPREADS).because(|verdict| match verdict {
        Verdict::Reproduced => "They are a backlash apart all the way. The paper leaves this number out; in its \
                                charts it would be what the joint really loses."
            .into(),
        _ => "They coincide.".into(),
    });

    let [standard, special] = paper::BACKLASH_LIMITS_ARCMIN;
    let limits = claim(
        "backlash-limits",
        "Below Fig. 17",
        "Both backlashes are below what makers allow: 2.5′ standard, 1.5′ special.",
    )
    .paper("standard", standard, "′")
    .paper("special", special, "′")
    .metric("Largest backlash at no load of double disc and cam")
    .ours("largest", most(REVERSED.map(|kind| backlash(kind).value / 60.0)), "′")
    .at_most("largest", most(REVERSED.map(|kind| backlash(kind).value / 60.0)), "′", special)
    .because(|verdict| match verdict {
        Verdict::Reproduced => "They are; the clearance of the built-in drive was chosen so.".into(),
        _ => "They are not.".into(),
    });

    let ripple = |kind| evidence.runs.measure(kind, 0.0, |m| m.ripple_pp_arcsec);
    let recurring = claim(
        "recurring-error",
        "Below Fig. 17",
        "The recurring error is lower with the cam than with the double disc.",
    )
    .metric("Ripple after start-up, peak to peak, no load: double disc less cam, in spreads")
    .ours("double disc", ripple(DoubleDisc).value, "″")
    .ours("cam", ripple(Cam).value, "″")
    .at_least("gap, in spreads", ripple(DoubleDisc).gap_in_spreads(&ripple(Cam)), "", SPREADS)
    .because(|verdict| match verdict {
        Verdict::Reproduced => "It is.".into(),
        _ => "It is not: both are below half an arc-second, and the cam has the larger one.".into(),
    });

    let others = GeneratorKind::ALL.into_iter().filter(|kind| *kind != Cam);
    let best = least(others.map(|kind| backlash(kind).gap_in_spreads(&backlash(Cam))));
    let winner = claim(
        "cam-most-accurate",
        "Abstract; end of sections 4 and 5",
        "Of the four, the cam allows the highest accuracy, in reversing motion too.",
    )
    .metric("Backlash at no load of each other generator less that of the cam, least of them, in spreads")
    .ours_each(GeneratorKind::ALL, "", |kind| backlash(kind).value / 60.0, "′");
    let winner = winner.at_least("least gap, in spreads", best, "", SPREADS).because(|verdict| match verdict {
        Verdict::Reproduced => "It loses least.".into(),
        _ => "Without load the two-roller drive has slightly less backlash, and all are within 0.07′; under load the \
              cam is best by far."
            .into(),
    });

    let data = claim(
        "model-data",
        "Section 3",
        "The calculations can be followed: Abaqus, plane strain, quadrilaterals, denser at the flanks.",
    )
    .metric("Whether the same model can be built from what is given")
    .missing("tooth sizes, materials, mesh, contact law, friction, time step, how the rim was kept from turning")
    .because(|_| {
        "Tooth sizes, mesh, contact, friction, time step and how the rim was kept from turning are not given: only the \
         protocol can be repeated, not the model."
            .into()
    });
    vec![stands, longer, disc, cam, order, difference, paths, limits, recurring, winner, data]
}
