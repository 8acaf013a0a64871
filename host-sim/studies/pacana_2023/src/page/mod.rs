//! The page of `reproduce`: the paper's results beside ours, claim by claim, and where numbers like the paper's come
//! from.

mod charts;
mod tables;

use serde_json::{Map, json};

use crate::Reproduction;
use crate::claim::Verdict;
use crate::experiments::Experiment;
use crate::paper;
use flexspline_base::units::ARCMIN_PER_RAD;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_report::animation::{Animation, AnimationError, FRAMES};
use flexspline_report::page::{
    Axis, Block, Choice, Detail, EVERY_CHOICE, Figure, FigureBody, Headline, Lines, Page, PageQuantity, Section,
    Status, Text,
};

/// What the page is made from.
pub struct Sources<'a> {
    /// All there is to say.
    pub reproduction: &'a Reproduction,
    /// The command line.
    pub command: &'a str,
    /// The drives in motion, without load.
    pub animations: Vec<Result<Animation, AnimationError>>,
}

/// A figure of curves.
fn lines(id: &str, title: &str, caption: &str, x: Axis, y: Axis, charts: Vec<(String, Lines)>) -> Block {
    Block::Figure(Figure {
        id: id.into(),
        title: title.into(),
        caption: Text::new(caption),
        alt: title.into(),
        body: FigureBody::Lines { x, y, charts },
    })
}

/// One chart, shown whichever generator is chosen.
fn every(chart: Lines) -> Vec<(String, Lines)> {
    vec![(EVERY_CHOICE.to_owned(), chart)]
}

/// A chart to each generator.
fn by_generator(of: impl Fn(GeneratorKind) -> Option<Lines>) -> Vec<(String, Lines)> {
    GeneratorKind::ALL.into_iter().filter_map(|kind| Some((kind.to_string(), of(kind)?))).collect()
}

fn generator_axis() -> Axis {
    Axis::new("Generator", PageQuantity::Degree)
}

fn error_axis() -> Axis {
    Axis::new("Output error", PageQuantity::Error)
}

/// The page.
pub fn page(sources: Sources<'_>) -> Page {
    let Sources { reproduction: r, command, animations } = sources;
    let (status, remarks) = judge(r, &animations);
    let animations: Vec<Animation> = animations.into_iter().flatten().collect();
    let sections = vec![
        glance(r),
        motion(r, &animations),
        claims(r),
        sources_of_errors(r),
        path_and_stress(r),
        load_and_reversal(r),
        spread(r),
        judged(r),
        reading(),
    ];
    let mut results = Map::new();
    results.insert("reproduce".into(), json!(r.record(command)));
    let hash = blake3::Hash::from(r.drive.hash()).to_hex().to_string();
    let mut provenance = vec![
        ("Command".to_owned(), command.to_owned()),
        ("Program".to_owned(), format!("flexspline {}", env!("CARGO_PKG_VERSION"))),
        ("Drive".to_owned(), r.drive.name.clone()),
        ("BLAKE3 of the drive".to_owned(), hash),
        (
            "Paper".to_owned(),
            "Pacana et al., Numerical Analysis of the Kinematic Accuracy of the Hermetic Harmonic Drive in Space \
             Vehicles, Appl. Sci. 13 (2023)"
                .to_owned(),
        ),
        ("Runs of the protocol".to_owned(), format!("{} in all, {:.0} s", r.runs.0.len(), r.wall_s)),
    ];
    for kind in GeneratorKind::ALL {
        if let Some(solved) = r.runs.get(kind, 0.0) {
            provenance.push((
                format!("FEM, {}", kind.in_words()),
                format!(
                    "fast solver, {} mesh, {} degrees of freedom, residual at most {:.1e}",
                    r.settings.mesh, solved.degrees_of_freedom, solved.residual
                ),
            ));
        }
    }
    Page {
        title: format!("The paper's protocol with {}", r.drive.name),
        command_name: "reproduce",
        status,
        also: Vec::new(),
        remarks,
        choices: [GeneratorKind::FourRoller, GeneratorKind::TwoRoller, GeneratorKind::DoubleDisc, GeneratorKind::Cam]
            .map(|kind| Choice { id: kind.to_string(), name: kind.in_words().to_owned() })
            .into(),
        choice_is: "Generator",
        headlines: vec![headline(r)],
        sections,
        animations,
        provenance,
        results,
    }
}

fn judge(r: &Reproduction, animations: &[Result<Animation, AnimationError>]) -> (Status, Vec<String>) {
    let mut status = if r.not_converged.is_empty() { Status::Good } else { Status::NotConverged };
    let mut remarks: Vec<String> = r.not_converged.iter().map(|what| format!("No equilibrium: {what}.")).collect();
    if !r.changes_without_equilibrium.is_empty() {
        status = status.max(Status::Remark);
        let told = r.changes_without_equilibrium.iter();
        remarks.extend(told.map(|what| format!("A changed model has no equilibrium, which is its result: {what}.")));
    }
    for error in animations.iter().filter_map(|a| a.as_ref().err()) {
        let worse = match error {
            AnimationError::NotPeriodic { .. } => Status::Remark,
            AnimationError::Simulate(_) => Status::NotConverged,
        };
        status = status.max(worse);
        remarks.push(format!("A drive is not shown in motion: {error}."));
    }
    if r.settings.quick {
        status = status.max(Status::Remark);
        remarks.push(
            "Quick form: coarse mesh, one other discretisation and few changes of the model. Ranks may be called \
             decided that the whole form leaves open."
                .into(),
        );
    }
    (status, remarks)
}

/// Largest unloaded error of all generators, arcsec.
fn largest_error(r: &Reproduction) -> f64 {
    GeneratorKind::ALL
        .into_iter()
        .filter_map(|kind| r.runs.get(kind, 0.0))
        .map(|s| s.metrics.largest_out_arcsec.max(s.metrics.largest_back_arcsec))
        .fold(0.0, f64::max)
}

/// “19.4′ to 20.7′”, of an experiment.
fn span(experiment: &Experiment) -> Option<String> {
    let sizes = || experiment.effects.iter().filter_map(|e| e.largest_arcmin);
    let (low, high) = (sizes().reduce(f64::min)?, sizes().reduce(f64::max)?);
    Some(format!("{low:.1}′ to {high:.1}′"))
}

fn headline(r: &Reproduction) -> Headline {
    let n = |verdict| r.count(verdict);
    let largest = largest_error(r);
    let four = paper::ERROR_FOUR_ROLLER_RAD * ARCMIN_PER_RAD;
    let cam = paper::ERROR_CAM_RAD * ARCMIN_PER_RAD;
    let mut answer = format!(
        "Of {} claims of the paper {} are reproduced, {} are not, {} contradict the paper itself and {} cannot be \
         tested: unloaded, a sound drive is off by half its clearance, {:.1}′, not by {cam:.0}′ to {four:.0}′",
        r.claims.len(),
        n(Verdict::Reproduced),
        n(Verdict::NotReproduced),
        n(Verdict::Inconsistent),
        n(Verdict::NotTestable),
        largest / 60.0
    );
    if let Some((nearest, sizes)) = r.nearest().and_then(|e| Some((e, span(e)?))) {
        answer += &if nearest.reaches {
            format!("; {} gives {sizes}", nearest.subject)
        } else {
            format!("; nearest of all that was tried comes {}, with {sizes}", nearest.subject)
        };
    }
    let answer = Text::new(answer + ".");
    Headline {
        choice: None,
        answer,
        number: Text::default().error(largest, 3),
        number_is: format!("largest error of any of the four drives without load; the paper has up to {four:.1}′"),
    }
}

fn glance(r: &Reproduction) -> Section {
    let mut blocks = vec![Block::Table { choice: None, table: tables::by_part(r) }];
    blocks.push(Block::paragraph(
        "Each claim of the paper has a metric and a criterion, and the verdict follows from the numbers alone. The \
         paper gives no tooth sizes: sizes count as reproduced within a quarter, ranks where the gap exceeds three \
         times what mesh, increment and penalty move it by.",
    ));
    if let Some(nearest) = r.nearest() {
        blocks.push(Block::Paragraph { choice: None, text: Text::default().strong(nearest.takeaway.clone()) });
    }
    Section { id: "glance".into(), title: "At a glance".into(), detail: Detail::Summary, blocks }
}

fn motion(r: &Reproduction, animations: &[Animation]) -> Section {
    let mut blocks = Vec::new();
    if !animations.is_empty() {
        blocks.push(Block::Figure(Figure {
            id: "drive".into(),
            title: "The drive to scale, as in the paper's figures 8 to 11".into(),
            caption: Text::new(
                "Contact FEM, plane strain, no load, turning forward, both wheels meshed as computed, coloured by von \
                 Mises stress. The flexspline stands and is deformed by the generator (grey), the circular spline \
                 turns: the red dot is on tooth 0, the blue one on space 0. Move along figure 2 to turn the generator.",
            ),
            alt: "Cross section of the drive: circular spline outside, deformed flexspline inside it, wave generator \
                  in the middle, coloured by von Mises stress, and an enlargement of the teeth at the major axis"
                .into(),
            body: FigureBody::Drive,
        }));
        blocks.push(lines(
            "ripple",
            "Error over one tooth pitch, after start-up",
            "Figure 1's states, forward, no load. This repeats with every tooth pitch, 59.8 times in the paper's 2 \
             rad: the scale is all that a sound drive has to show.",
            Axis::linked("Generator from the beginning of a pitch"),
            error_axis(),
            animations.iter().map(|a| (a.kind.to_string(), charts::ripple(a))).collect(),
        ));
    }
    blocks.push(lines(
        "errors",
        "Kinematic error of the four generators: the paper's figure 13",
        "Output angle less generator angle over the ratio, from where the drive was deformed, the output in the \
         middle of its clearance: forward to +1 rad, then back to −1 rad (dashed). The paper has 10.3′ (cam), 14.2′ \
         (double disc), 21.4′ (four-roller) on this scale.",
        generator_axis(),
        error_axis(),
        every(charts::errors(r)),
    ));
    blocks.push(lines(
        "travel",
        "Output over generator: the paper's figure 12",
        "The output angle of the selected generator with the nominal line, generator over 95. The error is a \
         seventieth of the travel and can hardly be seen: drag across to zoom, double-click to come back.",
        generator_axis(),
        Axis::new("Output angle", PageQuantity::Error),
        by_generator(|kind| charts::travel(r, kind)),
    ));
    if animations.iter().any(|a| a.sleeve.is_some()) {
        blocks.push(Block::Figure(flexspline_report::drive_figures::sleeve_figure()));
    }
    Section { id: "motion".into(), title: "The protocol".into(), detail: Detail::Summary, blocks }
}

fn claims(r: &Reproduction) -> Section {
    let blocks = tables::parts(r).into_iter().map(|part| Block::Table { choice: None, table: tables::claims(r, part) });
    Section { id: "claims".into(), title: "Claim by claim".into(), detail: Detail::Summary, blocks: blocks.collect() }
}

fn sources_of_errors(r: &Reproduction) -> Section {
    let mut blocks = vec![Block::paragraph(
        "The paper's errors are 20 to 40 times what a sound drive shows. Each suspect was put into the model alone \
         and run through the same protocol, on the coarse mesh, without load.",
    )];
    blocks.push(lines(
        "sources",
        "What each change of the model does to the error",
        "The way out with the selected generator and, where it is more than 5′, the way back (dashed). What stays at \
         zero here is in the table. The paper's size is marked.",
        generator_axis(),
        error_axis(),
        by_generator(|kind| charts::sources(r, kind)),
    ));
    for kind in GeneratorKind::ALL {
        if let Some(table) = tables::experiments(r, kind) {
            blocks.push(Block::Table { choice: Some(kind.to_string()), table });
        }
    }
    blocks.push(Block::Table { choice: None, table: tables::takeaways(r) });
    blocks.push(Block::paragraph(format!(
        "How the rim is kept from turning matters because the rim is deformed: a point of it moves along the \
         circumference by v, twice around in each turn of the generator, by a quarter of a millimetre and more at the \
         bore. The mean of the whole bore does not move. One point that is held still makes the whole flexspline turn \
         by v over the radius instead, and the output with it. The paper says that rotation of the flexspline “was \
         blocked” and that it was tied to a point on the axis “using rigid links”, not which of its nodes were. That \
         its numbers come from there is a suspicion: {}. A hard brake on the output gives delays in the first phase \
         and after each reversal, as the paper has them, but no equality at 1 rad. What was held, and at which nodes, \
         would tell.",
        fit_of_one_point(r)
    )));
    Section {
        id: "sources-of-errors".into(),
        title: "Where errors of 10′ to 21′ come from".into(),
        detail: Detail::Summary,
        blocks,
    }
}

/// How the errors of a rim held at one point compare with the paper's, in words.
fn fit_of_one_point(r: &Reproduction) -> String {
    let Some(experiment) = r.experiments.iter().find(|e| e.id == "one-point") else {
        return "it was not tried".into();
    };
    let mut pairs: Vec<(f64, f64)> =
        experiment.effects.iter().filter_map(|e| e.paper_arcmin.zip(e.largest_arcmin)).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = if experiment.reaches { "the size fits" } else { "the size does not fit" };
    let ordered = pairs.windows(2).all(|two| two[0].1 < two[1].1);
    let (Some(first), Some(last)) = (pairs.first(), pairs.last()) else { return size.into() };
    if ordered {
        format!(
            "{size}, and the generators stand in the paper's order, but {:.1}′ apart where the paper has {:.1}′",
            last.1 - first.1,
            last.0 - first.0
        )
    } else {
        format!("{size}, the order of the generators does not")
    }
}

fn path_and_stress(r: &Reproduction) -> Section {
    let blocks = vec![
        lines(
            "tip-path",
            "Path of a tooth tip: the paper's figure 6",
            "From the minor axis (right, below) into the space at the major axis (left, above), seen from the tooth \
             of the circular spline that is met at the minor axis: formulas (7) and (9), and the tips of the FEM, \
             deformed, no load, one dot to each tooth of a quarter.",
            Axis::new("Around, v, mm", PageQuantity::Count),
            Axis::new("Outward, w, mm", PageQuantity::Count),
            by_generator(|kind| charts::tip_path(r, kind)),
        ),
        lines(
            "tip-difference",
            "Formulas less FEM",
            "The formulas are of first order in the displacement. Outward they are off by the second-order shortening \
             of the rim, 5 µm and more; the flanks clear each other by 7 µm.",
            Axis::new("Tooth from the major axis", PageQuantity::Degree),
            Axis::new("Formula less FEM, µm", PageQuantity::Count),
            by_generator(|kind| charts::tip_difference(r, kind)),
        ),
        lines(
            "stress",
            "Largest stress in each tooth sector: the paper's figures 10 and 11",
            "Von Mises stress of the flexspline, deformed, no load, by angle from the major axis (D at 0°, M at \
             ±90°). Averaged at nodes; the notch at the tooth root is as sharp as the mesh.",
            Axis::new("Sector from the major axis", PageQuantity::Degree),
            Axis::new("Von Mises stress", PageQuantity::Stress),
            every(charts::stress(r)),
        ),
    ];
    Section { id: "path".into(), title: "Path of the teeth and stress".into(), detail: Detail::Engineering, blocks }
}

fn load_and_reversal(r: &Reproduction) -> Section {
    let load = |id: &str, number: u32, kind: GeneratorKind| {
        lines(
            id,
            &format!("Under load, {}: the paper's figure {number}", kind.in_words()),
            "Error under +200, 0 and −200 N·m (10 N·m to the millimetre of width), forward (lines) and back (dashed). \
             The paper shows the output angle, in which this is hard to see.",
            generator_axis(),
            error_axis(),
            every(charts::load(r, kind)),
        )
    };
    let blocks = vec![
        load("load-double-disc", 14, GeneratorKind::DoubleDisc),
        load("load-cam", 15, GeneratorKind::Cam),
        lines(
            "reversal",
            "Reversal: the paper's figures 16 and 17",
            "From 0 to A forward; at A the generator turns back and the output stands (A to B) while the error grows \
             by the backlash; from B to C it follows. The paper reads its backlash from A–B and leaves out the \
             distance of 0–A and B–C, which is what a joint loses. The paper has double disc and cam.",
            generator_axis(),
            error_axis(),
            by_generator(|kind| charts::reversal(r, kind)),
        ),
        Block::Table { choice: None, table: tables::metrics(r) },
    ];
    Section { id: "load".into(), title: "Load and reversal".into(), detail: Detail::Engineering, blocks }
}

fn spread(r: &Reproduction) -> Section {
    let mut blocks = vec![Block::paragraph(
        "Every metric that ranks generators was computed again with other meshes, increments and penalties. A rank \
         holds where the gap between two generators exceeds three times the spread of that gap. Kendall's tau \
         compares with the paper's order four-roller ≥ two-roller > double disc > cam.",
    )];
    blocks.push(Block::Table { choice: None, table: tables::rankings(r) });
    Section {
        id: "spread".into(),
        title: "What the discretisation leaves open".into(),
        detail: Detail::Engineering,
        blocks,
    }
}

fn judged(r: &Reproduction) -> Section {
    let blocks = vec![
        Block::paragraph(
            "A failed check of the paper's own numbers makes a claim inconsistent; else what is missing, or a run \
             without equilibrium, leaves it untestable; else the checks of the model decide.",
        ),
        Block::Table { choice: None, table: tables::checks(r) },
    ];
    Section { id: "judged".into(), title: "How each claim was judged".into(), detail: Detail::Full, blocks }
}

fn reading() -> Section {
    Section::reading(vec![
        Block::paragraph(
            "Error: output angle less generator angle over the ratio; positive when the output leads. Mean lag: its \
             mean over whole tooth pitches after start-up. Ripple: its range in that time. Half-width at reversal: \
             half of what is lost between forward and backward; the whole is the backlash. Dwell: generator travel \
             while the output stands. They are different things, and a claim is held against one of them.",
        ),
        Block::paragraph(format!(
            "The drive is built in: 188 and 190 teeth of module 0.5 mm, 20 mm wide, ideal, without friction, drag of \
             0.02 N·m on the output. Its clearance was chosen to give the cam a backlash near 1′, so that the size of \
             the paper's backlash is no evidence. {FRAMES} states of one pitch show it in motion. Plane strain, \
             quasi-static: speed, inertia and the third dimension are left out, in the paper too.",
        )),
    ])
}
