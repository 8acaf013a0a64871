//! `flexspline reproduce`: the paper's protocol, and its claims judged.

use clap::Args;

use super::simulate::refused_or_failed;
use super::{Context, Failure, report};
use flexspline_base::output::Outputs;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::SolverSettings;
use flexspline_pacana_2023::claims::{ClaimVerdict, JudgedClaim};
use flexspline_pacana_2023::{Reproduction, page, reproduce};

/// Run the protocol of the paper with all four generators and compare with the paper's results
///
/// Deform, then turn +1 rad and -2 rad in increments of 0.01 rad, without load and, for double disc and cam, under
/// +-200 N·m, as Pacana et al. (Appl. Sci. 13, 2023) did. Each result of the paper is compared with ours and gets a
/// verdict from the numbers. The runs are repeated with other meshes, increments and penalties, and with a rim that is
/// held at one point, which has errors of the paper's size. Writes reproduce.json and report.html.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline reproduce
  flexspline reproduce --quick --out quick
  flexspline reproduce --json > claims.json

A claim that is not reproduced is a result, not a failure. Exit code 1: a run of the drive found no
equilibrium, or the page is not sound; 2: bad input.")]
pub(super) struct Reproduce {
    /// Coarse mesh and one other discretisation: about a minute on two cores instead of several
    #[arg(long, conflicts_with = "mesh")]
    quick: bool,
    /// Mesh of the standard runs: coarse, standard or fine [default: standard]
    #[arg(long, value_name = "LEVEL")]
    mesh: Option<MeshLevel>,
}

impl Reproduce {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let drive = context.drive()?;
        let out = context.out()?;
        let mesh = if self.quick { MeshLevel::Coarse } else { self.mesh.unwrap_or(MeshLevel::Standard) };
        let progress = context.progress("reproduce");
        let result = reproduce(&drive, mesh, self.quick, &context.command, &|done, total, note| {
            progress.set(done, total, note);
        })
        .map_err(refused_or_failed)?;
        drop(progress);
        let solver = SolverSettings { mesh, ..SolverSettings::default() };
        let animations = report::in_motion(context, &drive, &GeneratorKind::ALL.map(|kind| (kind, 0.0)), solver);
        let page = page(&result, animations);
        let mut outputs = Outputs::new();
        outputs.json(&out.join("reproduce.json"), &result)?;
        report::write(&page, out, &mut outputs)?;
        outputs.finish()?;
        context.print(&result, || text(&result, out))?;
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
    for JudgedClaim { claim, verdict, .. } in &result.claims {
        let verdict: &str = (*verdict).into();
        text.push_str(&format!("{verdict:<26} {:<22} {}\n", claim.id, claim.place));
    }
    let counts: Vec<String> = ClaimVerdict::ALL
        .into_iter()
        .map(<&str>::from)
        .map(|verdict| format!("{} {verdict}", result.counts[verdict]))
        .collect();
    text.push_str(&format!("{} claims: {}\n", result.claims.len(), counts.join(", ")));
    text.push_str(&format!("wrote {} and {}", out.join("reproduce.json").display(), out.join("report.html").display()));
    text
}
