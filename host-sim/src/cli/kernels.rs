//! `flexspline tables --kernels`: response of the output to a deviation of a tooth, of the generator or of an axis.

use serde::Serialize;

use super::context::{Context, quoted};
use super::{Failure, say};
use flexspline_base::output::Outputs;
use flexspline_base::robust::least_and_most;
use flexspline_design::kernels::{KernelError, KernelPlan, make};
use flexspline_mechanics::drive::{GeneratorKind, Wheel};
use flexspline_mechanics::stepping::SolverSettings;

/// Result with `--json`.
#[derive(Serialize)]
struct KernelsReport {
    schema_version: u32,
    kernels: Vec<GeneratorReport>,
}

/// Responses of one generator.
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

/// Computes the kernels of these generators and writes `<G>.kernels.json` for each.
pub(super) fn run(context: &Context, kinds: &[GeneratorKind], settings: SolverSettings) -> Result<(), Failure> {
    let drive = context.drive()?;
    let out = context.out()?;
    let progress = context.progress("kernels");
    let plans: Vec<KernelPlan> = kinds.iter().map(|kind| KernelPlan::for_drive(&drive, *kind)).collect();
    let steps: usize = plans.iter().map(KernelPlan::steps).sum();
    let mut before = 0;
    let mut made = Vec::new();
    let mut outputs = Outputs::new();
    for (&kind, plan) in kinds.iter().zip(&plans) {
        let kernels = make(&drive, kind, plan, settings, &|done| {
            progress.set(before + done, steps, &kind.to_string());
        })
        .map_err(|error| match error {
            KernelError::NotIdeal { .. } => Failure::BadInput(error.to_string()),
            KernelError::Solve(_) | KernelError::Displaced { .. } => Failure::Failed(format!("{kind}: {error}")),
        })?;
        let path = out.join(format!("{kind}.kernels.json"));
        outputs.json(&path, &kernels)?;
        before += plan.steps();
        let ends = [plan.torques_n_m[0], plan.torques_n_m[plan.torques_n_m.len() - 1]];
        let size = |g: [f64; 2]| g[0].hypot(g[1]);
        let swing = |torque: f64| {
            let around = (0..180).map(|d| kernels.eccentricity(plan.sizes_um[0], f64::from(d).to_radians(), torque));
            let (low, high) = least_and_most(around);
            high - low
        };
        made.push(GeneratorReport {
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
    let made = KernelsReport { schema_version: 1, kernels: made };
    context.print(&made, || {
        let texts: Vec<String> = made.kernels.iter().map(text).collect();
        let next =
            format!("diagnose DATA.csv --tables {} --generator {}", quoted(&out.display().to_string()), kinds[0]);
        let tables = out.join(format!("{}.fxt", kinds[0])).exists();
        let table = format!("tables --generator {} --out {}", kinds[0], quoted(&out.display().to_string()));
        let table = (!tables).then(|| context.next(&table));
        texts.join("\n") + &say::next(&table.into_iter().chain([context.next(&next)]).collect::<Vec<_>>())
    })
}

fn text(made: &GeneratorReport) -> String {
    let [light, heavy] = made.torque_n_m;
    let [fs, cs] = made.second_harmonic_arcsec_per_um;
    let [at_light, at_heavy] = made.eccentricity_pp_arcsec;
    format!(
        "{}: arcsec of error at {light} and {heavy} N·m\n  1 um second harmonic of the flexspline's pitch: {:.2}, \
         {:.2}; of the circular spline's: {:.2}, {:.2}\n  circular spline {} um beside the axis: {at_light:.1}, \
         {at_heavy:.1} p-p\nwrote {}",
        made.generator, fs[0], fs[1], cs[0], cs[1], made.eccentricity_um, made.file
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_one_object_with_an_entry_for_each_generator() {
        let made = GeneratorReport {
            generator: "cam".into(),
            file: "out/cam.kernels.json".into(),
            second_harmonic_arcsec_per_um: [[4.2; 2]; 2],
            eccentricity_pp_arcsec: [1.0, 2.0],
            eccentricity_um: 5.0,
            torque_n_m: [2.0, 100.0],
        };
        let json = serde_json::to_value(KernelsReport { schema_version: 1, kernels: vec![made] }).unwrap();
        assert!(json.is_object());
        assert_eq!((json["schema_version"].as_u64(), json["kernels"][0]["generator"].as_str()), (Some(1), Some("cam")));
    }
}
