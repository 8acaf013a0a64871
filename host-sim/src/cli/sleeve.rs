//! `flexspline sleeve`: the third dimension of the flexspline alone.

use std::fmt::Write;

use clap::Args;
use rayon::prelude::*;
use serde::Serialize;

use super::{Context, Failure, bad_input};
use flexspline_mechanics::drive::{Drive, Sleeve, SleeveKind};
use flexspline_mechanics::sleeve::{Flexspline3d, RimHarmonic, Rollers};

/// The even harmonics of two waves that a sleeve of ordinary length still feels.
const HARMONICS: [u32; 6] = [2, 4, 6, 8, 10, 12];

/// What the sleeve or cup of the flexspline adds in three dimensions: stiffness by harmonic, tilt, torsion
///
/// A generator that makes the rim of a cup oval bends it; the cup cones and hardly resists. The rim in the middle of a
/// closed (hermetic) sleeve cannot cone to both sides: the walls stretch, and forces grow from tens of newtons to
/// thousands. Computed with thin shells, one Fourier harmonic at a time; docs/explanation/third_dimension.md says how.
/// The sizes are those of [sleeve] in the drive file: kind (hermetic, cup, hat, springs, none), wall_mm,
/// flange_side_mm, bottom_side_mm, flange (rigid, diaphragm), bottom (disc, plate, clamped).
///
/// K is the amplitude of the reaction over that of the displacement, full circle. `line`: pressed on the middle line of
/// the rim; `band`: by a generator five eighths as wide as the teeth, which tilts with the rim. A tilt is positive
/// where the displacement grows away from the flange (of a cup: from its bottom).
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline sleeve --drive CUP-95
  flexspline sleeve --set sleeve.kind=hermetic,sleeve.wall_mm=0.7,sleeve.flange_side_mm=80
  flexspline sleeve --no-teeth --set sleeve.bottom=plate --json")]
pub(super) struct SleeveCommand {
    /// A smooth rim: without the teeth, which stiffen it as ribs along the axis and by their roots around it
    #[arg(long)]
    no_teeth: bool,
}

/// Result with `--json`.
#[derive(Serialize)]
struct SleeveResult<'a> {
    schema_version: u32,
    drive_hash: String,
    sleeve: &'a Sleeve,
    teeth: bool,
    /// Width of the band under the generator.
    band_mm: f64,
    harmonics: Vec<RimHarmonic>,
    torsion_n_m_per_rad: f64,
    lateral_n_per_mm: f64,
    two_rollers: Rollers,
}

impl SleeveCommand {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let drive = context.drive()?;
        let flexspline = Flexspline3d::of(&drive, !self.no_teeth).map_err(bad_input)?;
        let result = SleeveResult {
            schema_version: 1,
            drive_hash: blake3::Hash::from_bytes(drive.hash()).to_hex().to_string(),
            sleeve: &drive.sleeve,
            teeth: !self.no_teeth,
            band_mm: flexspline.band_mm,
            harmonics: HARMONICS.into_par_iter().map(|n| flexspline.harmonic(n)).collect(),
            torsion_n_m_per_rad: flexspline.torsion_n_m_per_rad(),
            lateral_n_per_mm: flexspline.lateral_n_per_mm(),
            two_rollers: flexspline.two_rollers(),
        };
        context.print(&result, || table(&drive, &result))
    }
}

fn table(drive: &Drive, result: &SleeveResult) -> String {
    let mut text = format!("{}: {}\n", drive.name, described(&drive.sleeve));
    let _ = writeln!(text, "{:>4} {:>14} {:>14} {:>14}", "n", "K line N/mm", "K band N/mm", "tilt mrad/mm");
    for harmonic in &result.harmonics {
        let _ = writeln!(
            text,
            "{:>4} {:>14.1} {:>14.1} {:>14.3}",
            harmonic.n,
            harmonic.k_line_n_per_mm,
            harmonic.k_band_n_per_mm,
            1e3 * harmonic.tilt_rad_per_mm
        );
    }
    let w0 = drive.generator.w0_mm;
    let two = &result.harmonics[0];
    let _ = writeln!(
        text,
        "at w0 = {w0} mm: {:.0} N of cos 2 theta, tilt {:.2} mrad\ntorsion {:.0} N·m/rad, lateral {:.0} N/mm\ntwo \
         rollers: w(45°) {:+.3}, w(90°) {:+.3} of w0",
        two.k_band_n_per_mm * w0,
        1e3 * two.tilt_rad_per_mm * w0,
        result.torsion_n_m_per_rad,
        result.lateral_n_per_mm,
        result.two_rollers.w45,
        result.two_rollers.w90
    );
    text
}

/// The sleeve in words.
fn described(sleeve: &Sleeve) -> String {
    let Sleeve { wall_mm, flange_side_mm, bottom_side_mm, .. } = sleeve;
    let (flange, bottom) = (sleeve.flange.name(), sleeve.bottom.name());
    let hermetic = format!(
        "wall {wall_mm} mm, {flange_side_mm} mm to the flange ({flange}), {bottom_side_mm} mm to the bottom ({bottom})"
    );
    match sleeve.kind {
        SleeveKind::Hermetic => format!("hermetic sleeve, {hermetic}"),
        SleeveKind::Cup => format!("cup, wall {wall_mm} mm, {bottom_side_mm} mm to the bottom ({bottom})"),
        SleeveKind::Hat => format!("hat, wall {wall_mm} mm, {flange_side_mm} mm to the flange ({flange})"),
        SleeveKind::Springs => {
            format!(
                "runs with springs in place of its sleeve (kind = \"springs\"); as a hermetic sleeve of its sizes, \
                 {hermetic}"
            )
        }
        SleeveKind::None => "the bare rim (kind = \"none\")".to_owned(),
    }
}
