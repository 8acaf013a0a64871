//! `flexspline study`: variants of a drive side by side.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::time::Instant;

use clap::Args;
use serde::Serialize;

use super::names::{self, GeneratorNames};
use super::{Context, Failure, report, say};
use flexspline_base::output::Outputs;
use flexspline_design::data_sheet::{FIGURES, FigureOf};
use flexspline_design::stated::short;
use flexspline_design::study::{
    Asked, Basis, Constraint, LAST_STABLE, Nearest, RunStatus, Sense, Study, StudyEffect, StudyError, StudyRun,
    StudySettings, StudyTarget, Trust, VariedValues, Vary, asked, effects, errors_of_making, figure,
    is_error_of_making, is_idle, nearest, study,
};
use flexspline_mechanics::drive::{Drive, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolverSettings};
use flexspline_report::page::Page;
use flexspline_report::study_report;

/// Targets where none are given: an exact drive, a stiff one, one that lasts.
const USUAL_TARGETS: [(&str, Sense); 3] =
    [("kinematic_error_pp_arcsec", Sense::Least), ("k2_n_m_per_rad", Sense::Most), ("root_fillet_mpa", Sense::Least)];
/// Lines of the text for one generator.
const SHOWN: usize = 5;

/// Vary fields of a drive, and see what a catalogue would print of each variant
///
/// Every variant is deformed by each generator, loaded and turned by a tooth pitch, by contact FEM: backlash, lost
/// motion, stiffness K1, K2, K3, wind-up, transmission error, stresses, teeth in contact. Written are study.csv (a row
/// for each variant and generator), study.json and report.html: curves or maps, the front of what nothing beats, what
/// each field does.
///
/// A drive with imperfections is looked at in one place of its turns, and the gap of its rigid teeth is that of the
/// drawing. A field of as_built that varies is an error of making and no choice: variants are compared with those made
/// alike.
///
/// Of many variants (more than 48; with four fields or more, 12 for each and 12) so many are computed that cover all
/// ranges, and what nothing beats; a surface through them estimates the others. The column `basis` says which a row is,
/// and what estimates are off by is measured, leaving out each computed variant in turn, and told. --compute-all
/// computes every one.
///
/// A variant that finds no equilibrium has the figures until then, its last stable load and the reason; one whose
/// fields make no drive has the reason.
#[derive(Debug, Args)]
#[command(after_help = format!("\
Examples:
  flexspline study --vary flexspline.rim_thickness_mm=1.2..2.6:8
  flexspline study -g cam --vary flexspline.rim_thickness_mm=1.2..2 --vary generator.w0_mm=0.46..0.5
  flexspline study --vary generator.w0_mm=0.46..0.5 --variants 50 --keep backlash_arcsec=30..70
  flexspline study --vary generator.w0_mm=0.46..0.5 --least root_fillet_mpa --most k2_n_m_per_rad

Figures:
{}
T1 and T2, where the ranges of stiffness end, are those of the drive's [data_sheet], or 21 and 72 %
of the largest load.", figures()))]
pub(super) struct StudyCommand {
    /// A field and its values: PATH=FROM..TO (5 values), PATH=FROM..TO:N, or PATH=VALUE,VALUE,...; repeat for more
    /// fields
    #[arg(long, value_name = "PATH=VALUES", required = true, allow_hyphen_values = true)]
    vary: Vec<Vary>,
    /// So many variants spread over all ranges at once (Sobol) [default: every combination of the values]
    #[arg(long, value_name = "N")]
    variants: Option<u32>,
    /// Which spread
    #[arg(long, value_name = "N", default_value_t = 1, requires = "variants")]
    seed: u32,
    /// Wave generator: two-roller, four-roller, double-disc, cam, or all
    #[arg(short, long, value_name = "G", default_value = "all", value_parser = names::generators(), hide_possible_values = true)]
    generator: GeneratorNames,
    /// Largest load, N.m [default: the rated torque of the drive's [data_sheet]; else what a table of that generator
    /// spans: 200; four-roller 100, two-roller 20; by the size of the drive]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    torque_n_m: Option<f64>,
    /// What a variant has to keep to, FIGURE=LEAST..MOST, either end may be left out [default: teeth that clear one
    /// another]
    #[arg(long, value_name = "FIGURE=RANGE", allow_hyphen_values = true)]
    keep: Vec<Constraint>,
    /// A figure of which less is better [default: kinematic_error_pp_arcsec, root_fillet_mpa]
    #[arg(long, value_name = "FIGURE")]
    least: Vec<String>,
    /// A figure of which more is better [default: k2_n_m_per_rad]
    #[arg(long, value_name = "FIGURE")]
    most: Vec<String>,
    /// Positions over the tooth pitch, 4 to 32: fewer take less time, and see less of the transmission error
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u8).range(4..=32))]
    positions: u8,
    /// Compute every variant, however many there are [default: estimate most of many]
    #[arg(long)]
    compute_all: bool,
    /// Mesh: coarse, standard or fine
    #[arg(long, value_name = "LEVEL", default_value = "coarse", value_parser = names::mesh(), hide_possible_values = true)]
    mesh: MeshLevel,
}

/// The names of the figures, three on a line.
fn figures() -> String {
    let line = |names: &[FigureOf]| names.iter().map(|(name, _)| format!("  {name:<32}")).collect::<String>();
    FIGURES.chunks(3).map(|names| line(names).trim_end().to_owned()).collect::<Vec<_>>().join("\n")
}

/// What `--json` prints, and `study.json`.
#[derive(Serialize)]
struct StudyReport<'a> {
    schema_version: u32,
    tool_version: &'static str,
    command: &'a str,
    drive: &'a str,
    drive_hash: String,
    /// Runs by how they ended.
    converged: usize,
    failed: usize,
    refused: usize,
    /// Runs whose figures are estimated.
    estimated: usize,
    /// Runs that meet every constraint.
    meet: usize,
    /// What is asked, each alone.
    asked: &'a [Asked],
    /// The variant that comes nearest, of generators where none meets.
    nearest: &'a [Nearest],
    /// What else has to be known.
    remarks: &'a [String],
    effects: &'a [StudyEffect],
    #[serde(flatten)]
    study: &'a Study,
    wall_s: f64,
}

impl StudyCommand {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let clock = Instant::now();
        let drive = context.drive()?;
        let settings = self.settings(context)?;
        if let Some(field) = settings.vary.iter().find(|field| context.sets_field(&field.path)) {
            return Err(Failure::BadInput(format!(
                "--set {0}: found it beside --vary {0}, which says otherwise; give one of the two",
                field.path
            )));
        }
        let out = context.out()?;
        report::before(context, out, "study", Some(&drive));
        let progress = Mutex::new(context.progress("study"));
        let made = study(&drive, &settings, &|done, of, run| {
            if let Ok(mut bar) = progress.lock() {
                if context.verbose() {
                    bar.line(&line(run));
                }
                bar.set(done, of, &format!("variant {} {}", run.variant, run.generator));
            }
            ControlFlow::Continue(())
        })
        .map_err(|error| match error {
            StudyError::Stopped => Failure::Failed("stopped; nothing was written".into()),
            error => Failure::BadInput(error.to_string()),
        })?;
        drop(progress);

        let fields_do: Vec<StudyEffect> = settings
            .generators
            .iter()
            .flat_map(|kind| FIGURES.iter().filter_map(|(name, _)| effects(&made, *kind, name)))
            .collect();
        let keep = &settings.constraints;
        let asked_of: Vec<Asked> = settings.generators.iter().flat_map(|kind| asked(&made.runs, keep, *kind)).collect();
        let nearest_of: Vec<Nearest> =
            settings.generators.iter().filter_map(|kind| nearest(&made.runs, keep, *kind)).collect();
        let remarks = remarks(&drive, &settings, &made);
        let count = |status| made.runs.iter().filter(|run| run.status == status).count();
        let told = StudyReport {
            schema_version: 1,
            tool_version: env!("CARGO_PKG_VERSION"),
            command: &context.command,
            drive: &drive.name,
            drive_hash: blake3::Hash::from_bytes(drive.hash()).to_hex().to_string(),
            converged: count(RunStatus::Converged),
            failed: count(RunStatus::Failed),
            refused: count(RunStatus::Refused),
            estimated: made.runs.iter().filter(|run| run.basis == Basis::Estimated).count(),
            meet: made.runs.iter().filter(|run| run.meets).count(),
            asked: &asked_of,
            nearest: &nearest_of,
            remarks: &remarks,
            effects: &fields_do,
            study: &made,
            wall_s: clock.elapsed().as_secs_f64(),
        };
        let page = study_report::page(study_report::StudySources {
            drive: &drive,
            command: &context.command,
            settings: &settings,
            study: &made,
            effects: &fields_do,
            asked: &asked_of,
            nearest: &nearest_of,
            remarks: &remarks,
        });
        let page = Page { title: context.titled(&page.title), ..page };
        let mut outputs = Outputs::new();
        outputs.file(&out.join("study.csv"), |file| file.write_all(csv(&made).as_bytes()))?;
        outputs.json(&out.join("study.json"), &told)?;
        report::write(&page, out, &mut outputs)?;
        outputs.finish()?;
        context.print(&told, || {
            let mut text = text(&told, &settings);
            let _ = write!(
                text,
                "wrote study.csv, study.json and report.html to {}/ in {}",
                out.display(),
                context.spent().in_words()
            );
            text + &say::next(&best_next(context, &drive, &settings, &made))
        })?;
        if told.converged == 0 {
            let why = made.runs.iter().find_map(|run| run.why.as_deref()).unwrap_or_default();
            return Err(Failure::Failed(format!("no variant converged; the first: {why}")));
        }
        Ok(())
    }

    fn settings(&self, context: &Context) -> Result<StudySettings, Failure> {
        if let Some(torque) = self.torque_n_m
            && !(torque > 0.0 && torque.is_finite())
        {
            return Err(Failure::BadInput(format!("--torque-n-m: found {torque}, allowed: above 0")));
        }
        let named = |option: &str, names: &[String], sense| {
            names
                .iter()
                .map(|name| {
                    StudyTarget::new(name, sense).map_err(|error| Failure::BadInput(format!("{option}: {error}")))
                })
                .collect::<Result<Vec<_>, _>>()
        };
        let mut targets = named("--least", &self.least, Sense::Least)?;
        targets.extend(named("--most", &self.most, Sense::Most)?);
        if let Some(k) = (1..targets.len()).find(|k| targets[..*k].iter().any(|t| t.figure == targets[*k].figure)) {
            return Err(Failure::BadInput(format!(
                "--least, --most: found {} twice, allowed: each figure once",
                targets[k].figure
            )));
        }
        if targets.is_empty() {
            targets.extend(USUAL_TARGETS.iter().filter_map(|(name, sense)| StudyTarget::new(name, *sense).ok()));
        }
        Ok(StudySettings {
            vary: self.vary.clone(),
            spread: self.variants,
            seed: self.seed,
            generators: self.generator.0.clone(),
            torque_n_m: self.torque_n_m,
            stated: context.stated()?,
            positions: usize::from(self.positions),
            constraints: self.keep.clone(),
            targets,
            compute_all: self.compute_all,
            solver: SolverSettings { method: Method::Fast, mesh: self.mesh, ..SolverSettings::default() },
        })
    }
}

fn csv(study: &Study) -> String {
    let cell = |text: &str| {
        if text.contains([',', '"', '\n']) {
            format!("\"{}\"", text.replace('"', "\"\"").replace('\n', " "))
        } else {
            text.to_owned()
        }
    };
    let fixed = ["variant", "generator"];
    let loads = ["t1_n_m", "t2_n_m", "largest_n_m"];
    let end = ["last_stable_is", "status", "basis", "meets", "front", "why", "cautions"];
    let figures = FIGURES.map(|(name, _)| name);
    let fields = study.fields.iter().map(String::as_str);
    let header: Vec<&str> = fixed.into_iter().chain(fields).chain(loads).chain(figures).chain(end).collect();
    let mut text = header.join(",") + "\n";
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value}"));
    for run in &study.runs {
        let mut row = vec![run.variant.to_string(), run.generator.to_string()];
        row.extend(run.values.iter().map(|value| cell(value)));
        row.extend(
            [run.loads.map(|l| l.t1_n_m), run.loads.map(|l| l.t2_n_m), run.loads.map(|l| l.largest_n_m)].map(number),
        );
        row.extend(FIGURES.iter().map(|(_, of)| number(of(&run.sheet))));
        let bound = match run.sheet.last_stable_n_m {
            None => "",
            Some(_) if run.bears_all() => "at_least",
            Some(_) => "found",
        };
        row.extend([
            bound.to_owned(),
            run.status.name().to_owned(),
            run.basis.name().to_owned(),
            run.meets.to_string(),
            run.front.to_string(),
        ]);
        row.push(cell(run.why.as_deref().unwrap_or("")));
        row.push(cell(&run.cautions.iter().map(|caution| caution.words.as_str()).collect::<Vec<_>>().join("; ")));
        text += &(row.join(",") + "\n");
    }
    text
}

fn line(run: &StudyRun) -> String {
    let figures: Vec<String> =
        FIGURES.iter().filter_map(|(name, of)| of(&run.sheet).map(|value| format!("{name} {value:.4}"))).collect();
    format!(
        "variant {} {} [{}]: {} {}",
        run.variant,
        run.generator,
        run.values.join(", "),
        run.status.name(),
        figures.join(", ")
    )
}

/// The front of each generator, best first in the first target.
fn text(told: &StudyReport<'_>, settings: &StudySettings) -> String {
    let study = told.study;
    let mut text = format!(
        "{}: {} runs, {} of them estimated; {} converged, {} failed, {} refused; {} meet what has to be kept\n",
        told.drive,
        study.runs.len(),
        told.estimated,
        told.converged,
        told.failed,
        told.refused,
        told.meet
    );
    for remark in told.remarks {
        let _ = writeln!(text, "remark: {remark}");
    }
    for kind in &settings.generators {
        let front = study.front(*kind, &settings.targets);
        let _ = match front.len() {
            0 => writeln!(text, "{kind}: no variant meets what has to be kept"),
            count => writeln!(text, "{kind}: {count} that nothing beats"),
        };
        for run in front.iter().take(SHOWN) {
            let values: Vec<String> =
                study.fields.iter().zip(&run.values).map(|(path, value)| format!("{path}={value}")).collect();
            let figures: Vec<String> = settings
                .targets
                .iter()
                .map(|target| format!("{} {}", target.figure, figure_of(run, target.figure)))
                .collect();
            let basis = if run.basis == Basis::Estimated { " (estimated)" } else { "" };
            let caution = if run.cautions.is_empty() { "" } else { " (caution)" };
            let _ =
                writeln!(text, "  {:>4}  {}: {}{basis}{caution}", run.variant, values.join(" "), figures.join(", "));
        }
        let more = front.len().saturating_sub(SHOWN);
        if more > 0 {
            let _ = writeln!(text, "  and {more} more in study.csv");
        }
        text += &what_is_asked(told, settings, *kind);
        text += &firsts(&study.runs, *kind);
        text += &how_far_to_trust(told, settings, *kind);
    }
    text
}

/// The first variant that did not converge, and the first whose fields make no drive, each with its reason.
fn firsts(runs: &[StudyRun], kind: GeneratorKind) -> String {
    let first = |status, what: &str| {
        let run = runs.iter().find(|run| run.generator == kind && run.status == status)?;
        Some(format!("  {what}, variant {}: {}\n", run.variant, run.why.as_ref()?))
    };
    let ends = [
        first(RunStatus::Failed, "the first that did not converge"),
        first(RunStatus::Refused, "the first that makes no drive"),
    ];
    ends.into_iter().flatten().collect()
}

/// What estimates of the targets are off by, and which rank nothing.
fn how_far_to_trust(told: &StudyReport<'_>, settings: &StudySettings, kind: GeneratorKind) -> String {
    let of = |target: &StudyTarget| {
        told.study.trust.iter().find(|trust| trust.generator == kind && trust.figure == target.figure)
    };
    let of_targets: Vec<&Trust> = settings.targets.iter().filter_map(of).collect();
    if of_targets.is_empty() {
        return String::new();
    }
    let words = of_targets.iter().map(|trust| {
        let share = trust.share_of_spread_percent.map_or_else(String::new, |share| format!(" ({} %)", short(share)));
        format!("{} {}{share}", trust.figure, short(trust.median_off))
    });
    let words = words.collect::<Vec<_>>().join(", ");
    let mut text = format!("  estimates are off by, median (share of how far variants differ): {words}\n");
    for trust in of_targets.iter().filter(|trust| trust.useless) {
        let _ = writeln!(
            text,
            "  estimates of {} rank nothing: the middle value of all variants is as good; --compute-all computes it",
            trust.figure
        );
    }
    text
}

/// A figure of a run as it is told; a bound with its sign.
fn figure_of(run: &StudyRun, name: &str) -> String {
    let value = figure(name).ok().and_then(|(_, of)| of(&run.sheet));
    let bound = if name == LAST_STABLE && run.bears_all() { ">= " } else { "" };
    value.map_or_else(|| "-".to_owned(), |value| format!("{bound}{}", short(value)))
}

/// Where not every variant has all that is asked: how many have each thing alone, and the variant that comes nearest if
/// none has all.
fn what_is_asked(told: &StudyReport<'_>, settings: &StudySettings, kind: GeneratorKind) -> String {
    let of_kind = || told.asked.iter().filter(|asked| asked.generator == kind);
    if settings.constraints.is_empty() && of_kind().all(|asked| asked.meet_alone == asked.of) {
        return String::new();
    }
    let each = of_kind().map(|asked| {
        let found =
            asked.found.map_or_else(String::new, |[low, high]| format!(" (found {} to {})", short(low), short(high)));
        format!("{} {}{found}", asked.what, asked.meet_alone)
    });
    let of = of_kind().next().map_or(0, |asked| asked.of);
    let mut text = format!("  of {of}, each alone: {}\n", each.collect::<Vec<_>>().join(", "));
    if let Some(nearest) = told.nearest.iter().find(|nearest| nearest.generator == kind) {
        let run = told.study.runs.iter().find(|run| run.generator == kind && run.variant == nearest.variant);
        let values: Vec<String> = run.map_or_else(Vec::new, |run| {
            told.study.fields.iter().zip(&run.values).map(|(path, value)| format!("{path}={value}")).collect()
        });
        let misses: Vec<String> = nearest
            .misses
            .iter()
            .map(|miss| {
                let value = miss.value.map_or_else(|| "-".to_owned(), short);
                format!("{} {value}, asked is {} {}", miss.figure, miss.side(), short(miss.limit))
            })
            .collect();
        let basis = if run.is_some_and(|run| run.basis == Basis::Estimated) { " (estimated)" } else { "" };
        let _ = writeln!(
            text,
            "  nearest is variant {}, {}: {}{basis}",
            nearest.variant,
            values.join(" "),
            misses.join("; ")
        );
    }
    text
}

/// What has to be known beside the figures: loads of the data sheet that are beyond what a table of a generator spans,
/// fields that have one value, and fields that do nothing with a generator.
fn remarks(drive: &Drive, settings: &StudySettings, study: &Study) -> Vec<String> {
    let beyond = settings.generators.iter().filter_map(|kind| {
        let sheet_n_m = settings.sheet_beyond_table_n_m(drive, *kind)?;
        let computed = || study.runs.iter().filter(|run| run.generator == *kind && run.basis == Basis::Computed);
        let bear = computed().filter(|run| run.bears_all()).count();
        let found = match computed().count() - bear {
            0 => format!("every variant computed bears it; tables --torque-n-m {sheet_n_m} asks for it"),
            fewer => {
                format!("{fewer} of {} variants computed do not come to it; --torque-n-m says otherwise", bear + fewer)
            }
        };
        Some(format!(
            "{kind} is loaded to {} N.m by the data sheet, and a table of it spans {} N.m by default: {found}",
            short(sheet_n_m),
            short(drive.rated_torque_n_m(*kind))
        ))
    });
    let mut remarks: Vec<String> = beyond.collect();
    remarks.extend(as_made(drive, settings));
    remarks.extend(settings.generators.iter().filter_map(|kind| cautioned(&study.runs, *kind)));
    for (k, field) in settings.vary.iter().enumerate() {
        if field.is_constant(settings.spread.is_some()) {
            remarks.push(format!("{} has one value, so nothing is said of what it does; --set would do", field.path));
            continue;
        }
        let idle = settings.generators.iter().filter(|kind| is_idle(study, **kind, k));
        let idle: Vec<&str> = idle.map(|kind| kind.name()).collect();
        if !idle.is_empty() {
            remarks.push(format!("{} changes no figure with {}", field.path, idle.join(", ")));
        } else {
            remarks.extend(at_an_end(drive, settings, study, k));
        }
    }
    remarks
}

/// That the best variant has the first or last value of a range, beyond which a better one may be.
fn at_an_end(drive: &Drive, settings: &StudySettings, study: &Study, k: usize) -> Option<String> {
    let (field, (run, _)) = (&settings.vary[k], best(drive, settings, study)?);
    let VariedValues::Range { .. } = field.values else { return None };
    let value = |run: &StudyRun| run.values[k].parse::<f64>().ok();
    let (at, all) = (value(run)?, || study.runs.iter().filter_map(value));
    let is_choice = !is_error_of_making(&field.path);
    let is_end = all().all(|other| other <= at) || all().all(|other| other >= at);
    (is_choice && is_end).then(|| {
        format!(
            "the best variant, {}, is at the end of the range of {}, {}: a better one may be beyond",
            run.variant,
            field.path,
            short(at)
        )
    })
}

/// How many of the variants that meet what has to be kept are not to be built for all that, and why.
fn cautioned(runs: &[StudyRun], kind: GeneratorKind) -> Option<String> {
    let meet = || runs.iter().filter(|run| run.generator == kind && run.meets);
    let with = meet().filter(|run| !run.cautions.is_empty()).count();
    let mut counts: Vec<(&'static str, f64, usize)> = Vec::new();
    for caution in meet().flat_map(|run| &run.cautions) {
        match counts.iter_mut().find(|(figure, ..)| *figure == caution.figure) {
            Some((_, _, count)) => *count += 1,
            None => counts.push((caution.figure, caution.limit, 1)),
        }
    }
    let each = counts.iter().map(|(figure, limit, count)| format!("{figure} beyond {} ({count})", short(*limit)));
    (with > 0).then(|| {
        format!(
            "{kind}: of {} that meet what has to be kept, {with} with a caution: {}",
            meet().count(),
            each.collect::<Vec<_>>().join(", ")
        )
    })
}

/// What has to be known of errors of making: that they are no choice, and that one place of a turn does not say what
/// they do.
fn as_made(drive: &Drive, settings: &StudySettings) -> Vec<String> {
    let errors: Vec<&Vary> = settings.vary.iter().filter(|field| is_error_of_making(&field.path)).collect();
    let mut remarks: Vec<String> = errors
        .iter()
        .map(|field| {
            format!(
                "{} is an error of making and no choice: variants are compared with those made alike, and the next \
                 command leaves it out",
                field.path
            )
        })
        .collect();
    let uneven = |drive: &Drive| drive.as_built.first_not_uniform().is_some();
    let made = |field: &&Vary| {
        let sets = field.grid().into_iter().map(|value| format!("{}={value}", field.path));
        sets.into_iter().any(|set| drive.with_set(&set).is_ok_and(|made| uneven(&made)))
    };
    if uneven(drive) || errors.iter().any(made) {
        remarks.push(
            "a drive with errors of teeth, axes or generator is looked at in one place of its turns, which does not \
             say what they do: tables looks at whole turns, and campaign at what tolerances do"
                .to_owned(),
        );
    }
    remarks
}

/// Tables of the best variant of all generators, in the first target, under the loads that were studied. Errors of
/// making are no part of it: of variants that differ in them those count that are made as the drive is.
fn best_next(context: &Context, drive: &Drive, settings: &StudySettings, study: &Study) -> Vec<String> {
    let Some((run, words)) = best(drive, settings, study) else { return Vec::new() };
    let torque = match (settings.torque_n_m, settings.sheet_beyond_table_n_m(drive, run.generator)) {
        (Some(largest_n_m), _) | (None, Some(largest_n_m)) => format!(" --torque-n-m {largest_n_m}"),
        (None, None) => String::new(),
    };
    vec![context.next(&format!("tables --generator {}{torque}{words}", run.generator))]
}

/// The best variant to make tables of, and the fields that it sets.
fn best<'a>(drive: &Drive, settings: &StudySettings, study: &'a Study) -> Option<(&'a StudyRun, String)> {
    let errors = errors_of_making(&study.fields);
    let set = |run: &StudyRun, k: usize| format!("{}={}", study.fields[k], run.values[k]);
    let as_given = |run: &&StudyRun| {
        let sets: Vec<String> = (0..study.fields.len()).map(|k| set(run, k)).collect();
        drive.with_sets(sets.iter().map(String::as_str)).is_ok_and(|made| made.as_built == drive.as_built)
    };
    let cost = |run: &StudyRun| settings.targets.first().map_or(0.0, |first| first.cost(&run.sheet));
    let front = || study.runs.iter().filter(|run| run.front);
    let cheapest = |a: &&StudyRun, b: &&StudyRun| cost(a).total_cmp(&cost(b));
    let choices: Vec<usize> = (0..study.fields.len()).filter(|k| !errors.contains(k)).collect();
    // Where nothing but errors varies every variant is the same design.
    let any = || choices.is_empty().then(|| front().min_by(cheapest)).flatten();
    let run = front().filter(as_given).min_by(cheapest).or_else(any)?;
    Some((run, choices.iter().map(|k| format!(" --set {}", set(run, *k))).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_design::data_sheet::DataSheet;
    use flexspline_design::stated::Stated;

    /// A variant under the cam that meets all that is asked, with this stress in its root fillets.
    pub(super) fn variant(number: usize, values: &[&str], root_fillet_mpa: f64) -> StudyRun {
        let sheet = DataSheet {
            kinematic_error_pp_arcsec: Some(1.0),
            root_fillet_mpa: Some(root_fillet_mpa),
            ..DataSheet::default()
        };
        StudyRun {
            variant: number,
            generator: GeneratorKind::Cam,
            values: values.iter().map(|value| (*value).to_owned()).collect(),
            status: RunStatus::Converged,
            basis: Basis::Computed,
            why: None,
            cautions: sheet.looked().cautions(),
            loads: None,
            sheet,
            meets: true,
            front: true,
        }
    }

    #[test]
    fn variants_that_meet_and_are_not_to_be_built_are_counted_by_what_is_wrong() {
        let mut runs = vec![variant(1, &[], 1313.0), variant(2, &[], 900.0), variant(3, &[], 1204.0)];
        assert_eq!(
            cautioned(&runs, GeneratorKind::Cam).as_deref(),
            Some("cam: of 3 that meet what has to be kept, 2 with a caution: root_fillet_mpa beyond 1000 (2)")
        );
        assert_eq!(cautioned(&runs, GeneratorKind::TwoRoller), None);
        runs.retain(|run| run.variant == 2);
        assert_eq!(cautioned(&runs, GeneratorKind::Cam), None);
    }

    #[test]
    fn what_makes_no_drive_is_not_told_as_what_did_not_converge() {
        let mut runs = vec![variant(1, &[], 900.0), variant(2, &[], 900.0)];
        assert_eq!(firsts(&runs, GeneratorKind::Cam), "");
        (runs[0].status, runs[0].why) = (RunStatus::Refused, Some("a shorter tooth".to_owned()));
        assert_eq!(firsts(&runs, GeneratorKind::Cam), "  the first that makes no drive, variant 1: a shorter tooth\n");
        (runs[1].status, runs[1].why) = (RunStatus::Failed, Some("no equilibrium".to_owned()));
        assert!(
            firsts(&runs, GeneratorKind::Cam).starts_with("  the first that did not converge, variant 2: no equil")
        );
    }

    #[test]
    fn by_default_the_stress_in_root_fillets_is_to_be_small() {
        assert!(USUAL_TARGETS.contains(&("root_fillet_mpa", Sense::Least)));
        assert!(USUAL_TARGETS.iter().all(|(name, _)| figure(name).is_ok()));
    }

    fn studied(vary: &[&str], runs: Vec<StudyRun>) -> (StudySettings, Study) {
        let vary: Vec<Vary> = vary.iter().map(|text| text.parse().unwrap()).collect();
        let fields = vary.iter().map(|field| field.path.clone()).collect();
        let settings = StudySettings {
            vary,
            spread: None,
            seed: 1,
            generators: vec![GeneratorKind::Cam],
            torque_n_m: None,
            stated: None,
            positions: 4,
            constraints: Vec::new(),
            targets: vec![StudyTarget::new("root_fillet_mpa", Sense::Least).unwrap()],
            compute_all: false,
            solver: SolverSettings::default(),
        };
        (settings, Study { fields, runs, trust: Vec::new() })
    }

    /// The variant made worse looks better, and is not what is recommended: the drive as drawn is.
    #[test]
    fn a_drive_made_worse_is_not_recommended_and_one_place_of_a_turn_is_said() {
        let drive = Drive::hhd_95();
        let eccentricity = "as_built.circular_spline_eccentricity_um=0,10";
        let (settings, study) = studied(&[eccentricity], vec![variant(1, &["0"], 380.0), variant(2, &["10"], 324.0)]);
        let (run, sets) = best(&drive, &settings, &study).unwrap();
        assert_eq!((run.variant, sets.as_str()), (1, ""));
        let remarks = as_made(&drive, &settings);
        assert!(remarks[0].contains("no choice") && remarks[1].contains("one place of its turns"), "{remarks:?}");

        let rims = ["flexspline.rim_thickness_mm=1.0,1.2", eccentricity];
        let runs =
            vec![variant(1, &["1.0", "0"], 380.0), variant(2, &["1.0", "10"], 300.0), variant(3, &["1.2", "0"], 350.0)];
        let (settings, study) = studied(&rims, runs);
        let (run, sets) = best(&drive, &settings, &study).unwrap();
        assert_eq!((run.variant, sets.as_str()), (3, " --set flexspline.rim_thickness_mm=1.2"));

        // Worn evenly, all places are alike.
        let (settings, _) = studied(&["as_built.flexspline_wear_um=0,10"], Vec::new());
        assert_eq!(as_made(&drive, &settings).len(), 1);
        let (settings, _) = studied(&["flexspline.rim_thickness_mm=1.0,1.2"], Vec::new());
        assert_eq!(as_made(&drive, &settings), [""; 0]);
        assert_eq!(as_made(&Drive::built_in("HHD-95-typical").unwrap(), &settings).len(), 1);
    }

    /// The end of a range is no best; a value within it is, and so is the end of a list, which is all there is.
    #[test]
    fn a_best_variant_at_the_end_of_a_range_is_told() {
        let told = |vary: &str, stresses: [f64; 3]| {
            let values = ["0.9", "1.0", "1.1"].iter().zip(stresses).enumerate();
            let runs = values.map(|(k, (value, stress))| variant(k + 1, &[value], stress)).collect();
            let (settings, study) = studied(&[vary], runs);
            remarks(&Drive::hhd_95(), &settings, &study).into_iter().find(|remark| remark.contains("at the end"))
        };
        let range = "flexspline.rim_thickness_mm=0.9..1.1:3";
        let said = told(range, [330.0, 320.0, 310.0]).unwrap();
        assert!(said.starts_with("the best variant, 3, is at the end of the range of flexspline.rim"), "{said}");
        assert!(told(range, [310.0, 320.0, 330.0]).is_some_and(|said| said.contains("_mm, 0.9:")));
        assert_eq!(told(range, [330.0, 310.0, 320.0]), None);
        assert_eq!(told("flexspline.rim_thickness_mm=0.9,1.0,1.1", [330.0, 320.0, 310.0]), None);
    }

    /// What a sheet loads beyond the span of a table is told with what was found there.
    #[test]
    fn loads_beyond_the_span_of_a_table_are_told_with_what_was_found() {
        let drive = Drive::hhd_95();
        let runs = vec![variant(1, &["1.0"], 300.0), variant(2, &["1.2"], 300.0)];
        let (mut settings, mut study) = studied(&["flexspline.rim_thickness_mm=1.0,1.2"], runs);
        // The table of a cam spans what the sheet rates.
        settings.stated = Some(Stated { rated_torque_n_m: Some(250.0), ..Stated::default() });
        assert_eq!(settings.sheet_beyond_table_n_m(&drive, GeneratorKind::Cam), None);
        settings.generators = vec![GeneratorKind::FourRoller];
        study.runs.iter_mut().for_each(|run| run.generator = GeneratorKind::FourRoller);
        let told = |study: &Study| remarks(&drive, &settings, study)[0].clone();
        let all = told(&study);
        assert!(all.contains("250 N.m") && all.contains("every variant computed bears it"), "{all}");
        study.runs[1].status = RunStatus::Failed;
        let fewer = told(&study);
        assert!(fewer.contains("1 of 2 variants computed do not come to it"), "{fewer}");
    }
}
