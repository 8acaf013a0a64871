//! Figures 10 and 11, and the ranking of the stresses in the discussion.

use super::super::claim::{Claim, Verdict, claim};
use super::super::rank::SPREADS;
use super::{Evidence, least, most};
use flexspline_mechanics::drive::GeneratorKind;

/// A stress this near to an axis is at it, degrees: the height of a tooth seen from the centre is about one.
const AT_AXIS_DEG: f64 = 10.0;

pub(super) fn claims(evidence: &Evidence<'_>) -> Vec<Claim> {
    let peak = |kind| evidence.runs.measure(kind, 0.0, |m| Some(m.peak_mpa));
    let two = peak(GeneratorKind::TwoRoller);
    let others = [GeneratorKind::FourRoller, GeneratorKind::DoubleDisc, GeneratorKind::Cam];
    let gap = least(others.map(|kind| two.gap_in_spreads(&peak(kind))));
    let highest = claim(
        "stress-two-roller",
        "Fig. 10; section 5",
        "The highest stress occurs in the rim of the flexspline with the two-roller generator.",
    )
    .metric(
        "Largest von Mises stress on the unloaded path; gap to each other generator over the larger discretisation \
         spread",
    )
    .ours_each(GeneratorKind::ALL, "", |kind| peak(kind).value, "MPa");
    let spread = most(GeneratorKind::ALL.map(|kind| peak(kind).spread));
    let highest =
        highest.at_least("least gap to another generator, in spreads", gap, "", SPREADS).because(
            |verdict| match verdict {
                Verdict::Reproduced => "Two rollers bend the rim tightest, at the major axis.".into(),
                _ if two.value > most(others.map(|kind| peak(kind).value)) => format!(
                    "Two rollers have the largest stress on every mesh, but a notch at the tooth root moves by up to \
                     {spread:.0} MPa from mesh to mesh, which is too much to call it decided."
                ),
                _ => "Another generator has the largest stress.".into(),
            },
        );

    let place = |kind| evidence.unloaded(kind).map_or(f64::NAN, |s| s.peak_from_major_deg);
    let off_axis = |kind| f64::min(place(kind), 90.0 - place(kind));
    let axes = claim(
        "stress-at-axes",
        "Figs. 10 and 11",
        "In all variants stresses are increased at the major (D) and the minor (M) axis, where the deformation is \
         largest.",
    )
    .metric("Angle of the largest von Mises stress from the nearer axis of the generator")
    .ours_each(GeneratorKind::ALL, ", from the major axis", place, "°");
    let axes = axes
        .at_most("largest angle from an axis", most(GeneratorKind::ALL.map(off_axis)), "°", AT_AXIS_DEG)
        .because(|verdict| match verdict {
            Verdict::Reproduced => "Every peak lies at one of the two axes.".into(),
            _ => "The peak of at least one generator lies where its rollers or discs end, not at an axis.".into(),
        });

    let allowable = claim(
        "stress-allowable",
        "Section 4, below Fig. 11",
        "In none of the models were the allowable stresses exceeded.",
    )
    .metric("Largest von Mises stress against the allowable one")
    .ours("largest of all", most(GeneratorKind::ALL.map(|kind| peak(kind).value)), "MPa")
    .missing("the steel, its allowable stress and the stresses found")
    .because(|_| "Neither the material nor a stress is given.".into());
    vec![highest, axes, allowable]
}
