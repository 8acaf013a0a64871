//! The page of `reproduce`: the table of the claims, and pictures of the errors of the four generators.

use serde_json::{Map, json};

use crate::Reproduction;
use crate::claims::{ClaimVerdict, ERROR_CAM, ERROR_DOUBLE_DISC, ERROR_FOUR_ROLLER, JudgedClaim, Number, largest};
use crate::runs::{ONE_POINT, both_ways, standard};
use flexspline_design::simulate::Row;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_report::animation::{Animation, AnimationError};
use flexspline_report::drive_figures::{drive_figure, less_mean, sleeve_figure};
use flexspline_report::page::{
    ChartAxis, ChartSeries, Choice, Headline, Lines, Mark, Page, PageBlock, PageQuantity, PageSection, RichText,
    Status, significant,
};

/// The page; `animations` are the drives in motion, without load.
pub fn page(r: &Reproduction, animations: Vec<Result<Animation, AnimationError>>) -> Page {
    let (status, remarks) = judge(r, &animations);
    let animations: Vec<Animation> = animations.into_iter().flatten().collect();
    let provenance = [
        ("Command", r.command.clone()),
        ("Program", format!("flexspline {}", r.tool_version)),
        ("Drive", r.drive.clone()),
        ("BLAKE3 of the drive", r.drive_blake3.clone()),
        ("Paper", "Pacana et al., Appl. Sci. 13 (2023)".to_owned()),
        ("FEM", format!("fast solver, {} mesh, {} runs in {:.0} s", r.mesh, r.runs.len(), r.wall_s)),
    ];
    Page {
        title: format!("The paper's protocol with {}", r.drive),
        command_name: "reproduce",
        status,
        remarks,
        choices: GeneratorKind::ALL
            .map(|kind| Choice { id: kind.to_string(), name: kind.in_words().to_owned() })
            .into(),
        choice_is: "Generator",
        headlines: vec![headline(r)],
        sections: vec![errors(r, &animations), claims(r)],
        animations,
        provenance: provenance.map(|(name, value)| (name.to_owned(), value)).into(),
        results: Map::from_iter([("reproduce".to_owned(), json!(r))]),
        ..Page::default()
    }
}

fn judge(r: &Reproduction, animations: &[Result<Animation, AnimationError>]) -> (Status, Vec<String>) {
    let mut status = if r.not_converged.is_empty() { Status::Good } else { Status::NotConverged };
    let mut remarks: Vec<String> = r.not_converged.iter().map(|run| format!("No equilibrium: {run}.")).collect();
    for error in animations.iter().filter_map(|animation| animation.as_ref().err()) {
        status = status.max(match error {
            AnimationError::NotPeriodic { .. } => Status::Remark,
            AnimationError::Simulate(_) => Status::NotConverged,
        });
        remarks.push(format!("A drive is not shown in motion: {error}."));
    }
    if r.quick {
        status = status.max(Status::Remark);
        remarks.push("Quick form: coarse mesh; it may decide ranks that the whole form leaves open.".to_owned());
    }
    (status, remarks)
}

fn headline(r: &Reproduction) -> Headline {
    let [reproduced, not, inconsistent, untestable] = ClaimVerdict::ALL.map(|verdict| r.counts[verdict.into()]);
    let unloaded = GeneratorKind::ALL.into_iter().filter_map(|kind| standard(&r.runs, kind, 0.0)?.metrics.as_ref());
    let largest_arcmin = unloaded.map(largest).fold(0.0, f64::max);
    let answer = format!(
        "Of {} claims of the paper {reproduced} are reproduced, {not} are not, {inconsistent} contradict the paper \
         itself and {untestable} cannot be tested: unloaded, a sound drive is off by half its clearance, \
         {largest_arcmin:.1}′, not by {ERROR_CAM:.0}′ to {ERROR_FOUR_ROLLER:.0}′.",
        r.claims.len()
    );
    let number_is =
        format!("largest error of any of the four drives without load; the paper has up to {ERROR_FOUR_ROLLER:.1}′");
    Headline::new(answer.into(), RichText::arcsec(60.0 * largest_arcmin, 3), number_is)
}

/// Numbers with their bounds.
fn numbers(of: &[Number]) -> RichText {
    let words = |number: &Number| {
        let value = |value| format!("{} {}", significant(value, 3), number.unit);
        let low = number.at_least.map_or_else(String::new, |bound| format!(", at least {}", value(bound)));
        let high = number.at_most.map_or_else(String::new, |bound| format!(", at most {}", value(bound)));
        format!("{} {}{low}{high}{}", number.name, value(number.value), if number.passes() { "" } else { ": fails" })
    };
    RichText::new(of.iter().map(words).collect::<Vec<_>>().join("; "))
}

fn claims(r: &Reproduction) -> PageSection {
    let row = |JudgedClaim { claim, paper, ours, verdict }: &JudgedClaim| {
        vec![
            RichText::new(claim.id),
            RichText::new(format!("{} [{}]", claim.says, claim.place)),
            RichText::default().strong(<&str>::from(*verdict)),
            numbers(paper),
            numbers(ours),
            RichText::new(claim.metric),
        ]
    };
    let header = ["Claim", "The paper", "Verdict", "Its numbers", "Our numbers", "Metric"];
    let table = PageBlock::table("Claims of the paper in its order", &header, r.claims.iter().map(row).collect());
    let blocks = vec![
        PageBlock::paragraph(
            "The verdict follows from the bounds alone. The paper gives no tooth sizes: sizes count as reproduced \
             within a quarter, ranks where the gap exceeds three times what mesh, increment and penalty move it by. A \
             number of the paper out of its bounds is an inconsistency.",
        ),
        table,
        PageBlock::paragraph(
            "A sound drive repeats its error with every tooth pitch and loses half its clearance, whatever deforms the \
             rim. The clearance of HHD-95 was chosen to give the cam a backlash near 1′: that its size is the paper's \
             is no evidence, the difference of the generators is.",
        ),
    ];
    PageSection::folded("claims", "Claim by claim", blocks)
}

/// Error of the unloaded runs over the generator angle, degrees and arcsec, each in a colour.
fn along(r: &Reproduction) -> Lines {
    let mut lines = Lines::default();
    for (colour, kind) in GeneratorKind::ALL.into_iter().enumerate() {
        let (out, back) = standard(&r.runs, kind, 0.0).map_or(Default::default(), |run| both_ways(&run.rows));
        for (way, mark, rows) in [("forward", Mark::Line, out), ("back", Mark::Dashed, back)] {
            let point = |row: &Row| [row.generator_rad.to_degrees(), row.error_arcsec];
            let name = format!("{}, {way}", kind.in_words());
            lines.series.push(ChartSeries::sorted(name, mark, colour, rows.iter().map(point).collect()));
        }
    }
    lines.series.retain(|series| !series.points.is_empty());
    lines
}

fn errors(r: &Reproduction, animations: &[Animation]) -> PageSection {
    let error = || ChartAxis::new("Output error", PageQuantity::Error);
    let mut blocks = Vec::new();
    if !animations.is_empty() {
        let ripple = |a: &Animation| {
            let series = ChartSeries::new("no load, forward", Mark::Line, 0, less_mean(a));
            (a.kind.to_string(), Lines::of(vec![series]))
        };
        blocks.push(PageBlock::Figure(drive_figure("no load, turning forward")));
        blocks.push(PageBlock::lines(
            "ripple",
            "Error over one tooth pitch, less its mean",
            "The states of figure 1, after start-up. This repeats with every tooth pitch, 59.8 times in the paper's 2 \
             rad.",
            [ChartAxis::over_pitch(), error()],
            animations.iter().map(ripple).collect(),
        ));
    }
    blocks.push(PageBlock::lines(
        "errors",
        "Error of the four generators: the paper's figures 12 and 13",
        format!(
            "Output angle less generator angle over the ratio, no load, zero where the drive was deformed, the output \
             in the middle of its clearance: forward to +1 rad, then back to −1 rad (dashed). The paper has \
             {ERROR_CAM:.1}′ (cam), {ERROR_DOUBLE_DISC:.1}′ (double disc), {ERROR_FOUR_ROLLER:.1}′ (four-roller).",
        ),
        [ChartAxis::new("Generator", PageQuantity::Degree), error()],
        along(r).for_every_choice(),
    ));
    blocks.extend(animations.iter().any(|a| a.sleeve.is_some()).then(|| PageBlock::Figure(sleeve_figure())));
    let held = r
        .runs
        .iter()
        .filter(|run| run.variant == ONE_POINT)
        .filter_map(|run| Some(format!("{} {:.1}′", run.generator.in_words(), largest(run.metrics.as_ref()?))));
    blocks.push(PageBlock::paragraph(format!(
        "A rim that is kept from turning at one point of its bore has errors of the paper's size: {}. The deformed rim \
         moves along its circumference twice in each turn of the generator; the mean of the bore does not move, one \
         point does. The paper says that rotation of the flexspline “was blocked” by “rigid links”, not at which \
         nodes: that its errors come from there is a suspicion.",
        held.collect::<Vec<_>>().join(", ")
    )));
    PageSection::new("errors-of-generators", "The errors", blocks)
}
