//! `flexspline kernels`: what a deviation of any tooth, of the generator or of an axis does to the output.

use std::ops::ControlFlow;
use std::sync::Mutex;

use clap::Args;
use serde::Serialize;

use super::context::{Context, quoted};
use super::names::{self, GeneratorNames};
use super::{Failure, say};
use flexspline_base::output::Outputs;
use flexspline_design::kernels::{KernelError, KernelPlan, make};
use flexspline_mechanics::drive::Wheel;
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Method, SolverSettings};

/// Compute influence kernels: the response of the output to a deviation of a tooth, of the generator or of an axis
///
/// For each generator the contact FEM of the ideal drive gives the response to one micrometre on any flexspline tooth,
/// any circular-spline space and any point of the generator, for loads up to the rated one (from the change of the
/// contact forces with the load). The response to an eccentric circular spline comes from FEM of such drives. Writes
/// <G>.kernels.json. `diagnose --tables` uses it for the signatures of geometric causes if it lies in the folder of the
/// table.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline kernels --generator cam
  flexspline kernels --drive my-drive.toml --mesh coarse --out tables")]
pub(super) struct KernelsCommand {
    /// Wave generator: two-roller, four-roller, double-disc, cam, or all
    #[arg(short, long, value_name = "G", default_value = "all", value_parser = names::generators(), hide_possible_values = true)]
    generator: GeneratorNames,
    /// Mesh: coarse, standard or fine
    #[arg(long, value_name = "LEVEL", default_value = "standard", value_parser = names::mesh(), hide_possible_values = true)]
    mesh: MeshLevel,
    /// Solver: reference or fast
    #[arg(long, value_name = "SOLVER", default_value = "fast", value_parser = names::solver(), hide_possible_values = true)]
    solver: Method,
}

/// What `--json` prints.
#[derive(Serialize)]
struct KernelsReport {
    schema_version: u32,
    kernels: Vec<GeneratorReport>,
}

impl KernelsReport {
    fn of(kernels: Vec<GeneratorReport>) -> KernelsReport {
        KernelsReport { schema_version: 1, kernels }
    }
}

/// What the command says of one generator.
#[derive(Serialize)]
struct GeneratorReport {
    generator: String,
    file: String,
    /// Response to a second harmonic of the pitch of either wheel at the lightest and the heaviest load, arcsec per µm.
    second_harmonic_arcsec_per_um: [[f64; 2]; 2],
    /// p-p response to an eccentricity of the first size at the lightest and the heaviest load, arcsec.
    eccentricity_pp_arcsec: [f64; 2],
    eccentricity_um: f64,
    torque_n_m: [f64; 2],
}

impl KernelsCommand {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let drive = context.drive()?;
        let kinds = self.generator.0.as_slice();
        let settings = SolverSettings { method: self.solver, mesh: self.mesh, ..SolverSettings::default() };
        let out = context.out()?;
        let progress = Mutex::new(context.progress("kernels"));
        let plans: Vec<KernelPlan> = kinds.iter().map(|kind| KernelPlan::for_drive(&drive, *kind)).collect();
        let steps: usize = plans.iter().map(KernelPlan::steps).sum();
        let mut before = 0;
        let mut told = Vec::new();
        let mut outputs = Outputs::new();
        for (&kind, plan) in kinds.iter().zip(&plans) {
            let kernels = make(&drive, kind, plan, settings, &|done| {
                if let Ok(mut bar) = progress.lock() {
                    bar.set(before + done, steps, &kind.to_string());
                }
                ControlFlow::Continue(())
            })
            .map_err(|error| match error {
                KernelError::NotIdeal { .. } => Failure::BadInput(error.to_string()),
                KernelError::Stopped => Failure::Failed("stopped; nothing was written".into()),
                KernelError::Solve(_) | KernelError::Displaced { .. } => Failure::Failed(format!("{kind}: {error}")),
            })?;
            let path = out.join(format!("{kind}.kernels.json"));
            outputs.json(&path, &kernels)?;
            before += plan.steps();
            let ends = [plan.torques_n_m[0], plan.torques_n_m[plan.torques_n_m.len() - 1]];
            let size = |g: [f64; 2]| g[0].hypot(g[1]);
            let swing = |torque: f64| {
                let around =
                    (0..180).map(|d| kernels.eccentricity(plan.sizes_um[0], f64::from(d).to_radians(), torque));
                let (low, high) = around.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), e| (l.min(e), h.max(e)));
                high - low
            };
            told.push(GeneratorReport {
                generator: kind.to_string(),
                file: path.display().to_string(),
                second_harmonic_arcsec_per_um: [Wheel::Flexspline, Wheel::CircularSpline]
                    .map(|wheel| ends.map(|torque| size(kernels.pitch_error(wheel, 2, torque)))),
                eccentricity_pp_arcsec: ends.map(swing),
                eccentricity_um: plan.sizes_um[0],
                torque_n_m: ends,
            });
        }
        drop(progress);
        outputs.finish()?;
        let told = KernelsReport::of(told);
        context.print(&told, || {
            let texts: Vec<String> = told.kernels.iter().map(text).collect();
            let next =
                format!("diagnose DATA.csv --tables {} --generator {}", quoted(&out.display().to_string()), kinds[0]);
            let tables = out.join(format!("{}.fxt", kinds[0])).exists();
            let table = format!("tables --generator {} --out {}", kinds[0], quoted(&out.display().to_string()));
            let table = (!tables).then(|| context.next(&table));
            texts.join("\n") + &say::next(&table.into_iter().chain([context.next(&next)]).collect::<Vec<_>>())
        })
    }
}

fn text(told: &GeneratorReport) -> String {
    let [light, heavy] = told.torque_n_m;
    let [fs, cs] = told.second_harmonic_arcsec_per_um;
    let [at_light, at_heavy] = told.eccentricity_pp_arcsec;
    format!(
        "{}: arcsec of error at {light} and {heavy} N.m\n  1 um second harmonic of the flexspline's pitch: {:.2}, \
         {:.2}; of the circular spline's: {:.2}, {:.2}\n  circular spline {} um beside the axis: {at_light:.1}, \
         {at_heavy:.1} p-p\nwrote {}",
        told.generator, fs[0], fs[1], cs[0], cs[1], told.eccentricity_um, told.file
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_one_object_with_an_entry_for_each_generator() {
        let told = GeneratorReport {
            generator: "cam".into(),
            file: "out/cam.kernels.json".into(),
            second_harmonic_arcsec_per_um: [[4.2; 2]; 2],
            eccentricity_pp_arcsec: [1.0, 2.0],
            eccentricity_um: 5.0,
            torque_n_m: [2.0, 100.0],
        };
        let json = serde_json::to_value(KernelsReport::of(vec![told])).unwrap();
        assert!(json.is_object());
        assert_eq!((json["schema_version"].as_u64(), json["kernels"][0]["generator"].as_str()), (Some(1), Some("cam")));
    }
}
