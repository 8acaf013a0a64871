//! `flexspline reproduce`: the paper's protocol beside the paper's results.

use std::ops::ControlFlow;
use std::sync::Mutex;

use clap::Args;

use super::simulate::refused_or_failed;
use super::{Context, Failure, names, report};
use flexspline_base::output::Outputs;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::SolverSettings;
use flexspline_pacana_2023::claim::Verdict;
use flexspline_pacana_2023::page::{Sources, page};
use flexspline_pacana_2023::{ReproduceSettings, Reproduction, reproduce};

/// Run the protocol of the paper with all four generators and compare with the paper's results
///
/// Deform, then turn +1 rad and -2 rad in increments of 0.01 rad, without load and, for double disc and cam, under
/// +-200 N.m, as Pacana et al. (Appl. Sci. 13, 2023) did. Each result of the paper is compared with ours and gets a
/// verdict from the numbers. The runs are repeated with other meshes, increments and penalties, and with changes of the
/// model that might explain the paper's errors of 10 to 21 arc-minutes. Writes reproduce.json and report.html.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline reproduce
  flexspline reproduce --quick --out quick
  flexspline reproduce --json > claims.json

A claim that is not reproduced is a result, not a failure, and so is a changed model without
equilibrium. Exit code 1: a run of the drive as it is found none, or the page is not sound;
2: bad input.")]
pub(super) struct Reproduce {
    /// Coarse mesh, one other discretisation and few changes of the model: about a minute on two cores instead of
    /// several
    #[arg(long, conflicts_with = "mesh")]
    quick: bool,
    /// Mesh of the standard runs: coarse, standard or fine [default: standard]
    #[arg(long, value_name = "LEVEL", value_parser = names::mesh(), hide_possible_values = true)]
    mesh: Option<MeshLevel>,
}

impl Reproduce {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let drive = context.drive()?;
        let out = context.out()?;
        report::before(context, out, "reproduce", Some(&drive));
        let mesh = if self.quick { MeshLevel::Coarse } else { self.mesh.unwrap_or(MeshLevel::Standard) };
        let settings = ReproduceSettings { mesh, quick: self.quick };
        let progress = Mutex::new(context.progress("reproduce"));
        let result = reproduce(&drive, settings, &|done, total, note| {
            if let Ok(mut bar) = progress.lock() {
                bar.set(done, total, note);
            }
            ControlFlow::Continue(())
        })
        .map_err(refused_or_failed)?;
        drop(progress);
        let solver = SolverSettings { mesh, ..SolverSettings::default() };
        let animations = report::in_motion(context, &drive, &GeneratorKind::ALL.map(|kind| (kind, 0.0)), solver);
        let record = result.record(&context.command);
        let page = page(Sources { reproduction: &result, command: &context.command, animations });
        let mut outputs = Outputs::new();
        outputs.json(&out.join("reproduce.json"), &record)?;
        report::write(&page, out, &mut outputs)?;
        outputs.finish()?;
        context.print(&record, || text(&result, out))?;
        match result.not_converged.first() {
            Some(first) => Err(Failure::Failed(format!(
                "{} of the runs found no equilibrium; the first: {first}",
                result.not_converged.len()
            ))),
            None if page.status.is_failure() => Err(Failure::Failed(page.remarks.join(" "))),
            None => Ok(()),
        }
    }
}

/// The verdicts for reading.
fn text(result: &Reproduction, out: &std::path::Path) -> String {
    let mut text = String::new();
    for claim in &result.claims {
        text.push_str(&format!("{:<26} {:<22} {}\n", claim.verdict.name(), claim.id, claim.place));
    }
    let counts: Vec<String> =
        Verdict::ALL.into_iter().map(|verdict| format!("{} {}", result.count(verdict), verdict.name())).collect();
    text.push_str(&format!("{} claims: {}\n", result.claims.len(), counts.join(", ")));
    for told in &result.changes_without_equilibrium {
        text.push_str(&format!("changed model without equilibrium, a result: {told}\n"));
    }
    if let Some(nearest) = result.nearest() {
        text.push_str(&format!("{}\n", nearest.takeaway));
    }
    text.push_str(&format!("wrote {} and {}", out.join("reproduce.json").display(), out.join("report.html").display()));
    text
}
