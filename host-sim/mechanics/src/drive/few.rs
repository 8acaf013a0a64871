//! A drive from a few numbers: teeth, module, bore.
//!
//! The rest is the toothing of [`Drive::hhd_95`] in modules, whose teeth clear one another from 90 to 800 teeth. Fewer
//! teeth leave no room at the root of the circular spline, so they are made lower there. One number has no formula: the
//! profile shift of the circular spline, which sets the clearance. It is solved for a rigid backlash of one arc-minute,
//! more only where teeth would interfere under one of the four generators.

use super::error::DriveError;
use super::interference::RigidMesh;
use super::ring::GeneratorKind;
use super::spec::Drive;
use crate::toml_file::Problem;
use crate::units::ARCMIN_PER_RAD;

/// The numbers that make a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FewNumbers {
    /// Teeth of the flexspline: even, `FewNumbers::TEETH`.
    pub teeth: u32,
    /// Module, mm.
    pub module_mm: f64,
    /// Diameter of the flexspline's bore, undeformed, mm; without it the rim is as thick for its radius as that of
    /// HHD-95.
    pub bore_mm: Option<f64>,
    /// Generator under which the backlash is set.
    pub generator: GeneratorKind,
}

/// A drive and where its numbers come from.
#[derive(Debug, Clone)]
pub struct MadeDrive {
    /// The drive; it passes [`Drive::check`], and no tooth of it interferes under any generator.
    pub drive: Drive,
    /// Path of a field (`flexspline.root_radius_mm`) and its formula, for every field that was derived.
    pub formulas: Vec<(&'static str, String)>,
}

/// Heights of the teeth from the pitch circles outward, modules: tip of the flexspline, root of the circular spline.
///
/// Lower from step to step, each with the clearance of HHD-95 (a quarter of a module) between tip and root.
const HEIGHTS: [[f64; 2]; 4] = [[3.65, 3.9], [3.5, 3.75], [3.35, 3.6], [3.2, 3.45]];
/// Root of the flexspline outward of its pitch circle, modules.
const ROOT: f64 = 1.75;
/// Tip of the circular spline outward of its pitch circle, modules.
const TIP: f64 = 2.3;
/// Profile shift of the flexspline, modules: where the involutes of both wheels lie along the path of a tooth.
const SHIFT: f64 = 3.0;
/// Profile shifts of the circular spline that are tried, modules: from teeth that bind to half a module of clearance.
const SHIFTS: [f64; 2] = [2.9, 3.5];
/// Rigid backlash, as of HHD-95.
const BACKLASH_RAD: f64 = 1.0 / ARCMIN_PER_RAD;
/// Halvings of the range of the shift: to 1e-4 modules, half a percent of the backlash.
const HALVINGS: usize = 13;

impl MadeDrive {
    /// Sets a length, mm, and says how it was found.
    fn put(&mut self, path: &'static str, value_mm: f64, formula: impl Into<String>) {
        *self.drive.number_mut(path).expect("the path of a number") = rounded(value_mm);
        self.formulas.push((path, formula.into()));
    }
}

impl FewNumbers {
    /// Teeth of the flexspline that can be asked for.
    pub(crate) const TEETH: [u32; 2] = [60, 800];

    /// The drive.
    ///
    /// # Errors
    /// A number out of its range, a bore that leaves no rim or too thick a one, or teeth that have no room.
    pub fn drive(&self, name: &str) -> Result<MadeDrive, DriveError> {
        let refuse = |field: &str, what: String| Err(DriveError::from(Problem::of(field, what)));
        let [fewest, most] = FewNumbers::TEETH;
        let (z, m) = (self.teeth, self.module_mm);
        if !z.is_multiple_of(2) || !(fewest..=most).contains(&z) {
            return refuse("teeth", format!("found {z}, allowed: an even number (two waves), {fewest} to {most}"));
        }
        if !(0.05..=10.0).contains(&m) {
            return refuse("module", format!("found {m}, allowed: 0.05 to 10 mm"));
        }
        self.with_heights(name, HEIGHTS[0]).or_else(|error| {
            let lower = HEIGHTS[1..].iter().find_map(|heights| self.with_heights(name, *heights).ok());
            lower.ok_or(error)
        })
    }

    /// The drive with these heights of its teeth, modules: tip of the flexspline, root of the circular spline.
    fn with_heights(&self, name: &str, [tip, root]: [f64; 2]) -> Result<MadeDrive, DriveError> {
        let m = self.module_mm;
        let [inner, outer] = [self.teeth, self.teeth + 2].map(|teeth| 0.5 * m * f64::from(teeth));
        let like = Drive::hhd_95();
        let pitch_radius_mm = like.flexspline.pitch_radius_mm();
        let scale = inner / pitch_radius_mm;
        let mut made = MadeDrive { drive: Drive { name: name.to_owned(), ..like.clone() }, formulas: Vec::new() };

        let f = &mut made.drive.flexspline;
        (f.teeth, f.module_mm, f.profile_shift) = (self.teeth, m, SHIFT);
        let circles = format!("pitch radius: module x teeth / 2 = {}", rounded(inner));
        made.put("flexspline.root_radius_mm", inner + ROOT * m, format!("{circles}; + {ROOT} modules"));
        made.put("flexspline.tip_radius_mm", inner + tip * m, format!("pitch radius + {tip} modules"));
        let root_mm = made.drive.flexspline.root_radius_mm;
        let (rim_mm, why) = match self.bore_mm {
            Some(bore) => (root_mm - 0.5 * bore, format!("root radius - half the bore of {bore}")),
            None => (like.flexspline.rim_thickness_mm * scale, "0.02553 pitch radii, as HHD-95".to_owned()),
        };
        if !(rim_mm >= 0.005 * inner && rim_mm <= 0.2 * root_mm) {
            let bore = |rim: f64| rounded(2.0 * (root_mm - rim));
            let what = format!(
                "found {}: the root circle has the diameter {}, so the rim would be {} mm thick; allowed: {} to {}",
                self.bore_mm.unwrap_or_default(),
                rounded(2.0 * root_mm),
                rounded(rim_mm),
                bore(0.2 * root_mm),
                bore(0.005 * inner),
            );
            return Err(Problem::of("bore", what).into());
        }
        made.put("flexspline.rim_thickness_mm", rim_mm, why);
        made.put("flexspline.width_mm", like.flexspline.width_mm * scale, "0.4255 pitch radii, as HHD-95");
        made.put("flexspline.root_fillet_mm", 0.24 * m, "0.24 modules");
        made.put("flexspline.tip_rounding_mm", 0.06 * m, "0.06 modules");

        let c = &mut made.drive.circular_spline;
        (c.teeth, c.module_mm) = (self.teeth + 2, m);
        let circles = format!("pitch radius: module x teeth / 2 = {}", rounded(outer));
        made.put("circular_spline.root_radius_mm", outer + root * m, format!("{circles}; + {root} modules"));
        made.put("circular_spline.tip_radius_mm", outer + TIP * m, format!("pitch radius + {TIP} modules"));
        let outer_mm = outer * like.circular_spline.outer_radius_mm / (pitch_radius_mm + like.flexspline.module_mm);
        // Fewer teeth are larger in proportion to the ring.
        let outer_mm = outer_mm.max(made.drive.circular_spline.root_radius_mm + 4.0 * m);
        let why = "1.126 pitch radii, as HHD-95; at least 4 modules outside the root";
        made.put("circular_spline.outer_radius_mm", outer_mm, why);
        made.put("circular_spline.root_fillet_mm", 0.16 * m, "0.16 modules");
        made.put("circular_spline.tip_rounding_mm", 0.06 * m, "0.06 modules");

        made.put("generator.w0_mm", m, "half the difference of the pitch diameters: one module");
        let bore_radius_mm = made.drive.flexspline.bore_radius_mm();
        let roller_mm = like.generator.roller_diameter_mm * bore_radius_mm / like.flexspline.bore_radius_mm();
        made.put("generator.roller_diameter_mm", roller_mm, "0.557 bore radii, as HHD-95");
        // Not rounded as sizes are: the drag of a small drive would be none, and nothing would hold its output.
        made.drive.output.drag_torque_n_m = three_digits(like.output.drag_torque_n_m * scale.powi(3));
        made.formulas.push(("output.drag_torque_n_m", "0.02 N·m of HHD-95, with the cube of the diameter".to_owned()));
        made.drive.circular_spline.profile_shift = self.shift(&made.drive)?;
        let why = format!(
            "solved: a rigid backlash of 1 arcmin with the {} generator, and teeth that clear under all four",
            self.generator
        );
        made.formulas.push(("circular_spline.profile_shift", why));
        made.drive.check()?;
        Ok(made)
    }

    /// Least profile shift of the circular spline, modules, with which the rigid backlash is at least `BACKLASH_RAD`
    /// and no tooth interferes under any of the four generators.
    ///
    /// # Errors
    /// There is none.
    pub fn shift(&self, drive: &Drive) -> Result<f64, DriveError> {
        let with = |shift: f64| {
            let mut drive = drive.clone();
            drive.circular_spline.profile_shift = shift;
            drive.check().map(|()| drive)
        };
        let has_play = |shift| {
            let (backlash_rad, _) = RigidMesh::new(&with(shift)?, self.generator)?.room();
            Ok((BACKLASH_RAD..f64::INFINITY).contains(&backlash_rad))
        };
        let clears = |shift| Ok(RigidMesh::interfering(&with(shift)?)?.is_empty());
        let [low, high] = SHIFTS;
        let shift = least(low, high, &has_play)?;
        let shift = if clears(shift)? { shift } else { least(shift, high, &clears)? };
        if has_play(shift)? && clears(shift)? {
            return Ok(shift);
        }
        let what = format!("found {}: no clearance of one arc-minute was found; allowed: more teeth", self.teeth);
        Err(Problem::of("teeth", what).into())
    }
}

/// Least number from `low` to `high` that `holds`, where all above it do: rounded upward to what a drawing has.
fn least(mut low: f64, mut high: f64, holds: &impl Fn(f64) -> Result<bool, DriveError>) -> Result<f64, DriveError> {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if holds(middle)? { high = middle } else { low = middle }
    }
    Ok(rounded(high + 5e-5))
}

/// Rounded to three significant digits.
fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Rounded to a tenth of a micrometre: what a drawing has.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    fn few(teeth: u32, module_mm: f64) -> FewNumbers {
        FewNumbers { teeth, module_mm, bore_mm: None, generator: GeneratorKind::Cam }
    }

    /// Its own numbers make HHD-95 again, but for the shift, which was chosen for a little less backlash.
    #[test]
    fn hhd_95_comes_back() {
        let made = few(188, 0.5).drive("HHD-95").unwrap().drive;
        let like = Drive::hhd_95();
        let shift = made.circular_spline.profile_shift;
        assert!((shift - like.circular_spline.profile_shift).abs() < 2e-3, "{shift}");
        let circular_spline = super::super::CircularSpline { profile_shift: shift, ..like.circular_spline.clone() };
        assert_eq!(made.to_toml(), Drive { circular_spline, ..like }.to_toml());
    }

    /// From 60 to 400 teeth and modules of 0.1 to 1 no tooth interferes under any generator.
    #[test]
    fn teeth_clear_one_another() {
        // The ends and what is usual; `FLEXSPLINE_LONG` makes two between them too.
        let count = if std::env::var_os("FLEXSPLINE_LONG").is_some() { 5 } else { 3 };
        let sizes = [(60, 1.0), (400, 0.1), (200, 0.3175), (70, 0.3), (100, 0.2)];
        for (teeth, module_mm) in sizes.into_iter().take(count) {
            let made = few(teeth, module_mm).drive("d").unwrap();
            for kind in GeneratorKind::ALL {
                let report = RigidMesh::new(&made.drive, kind).unwrap().report(kind).unwrap();
                assert_eq!(report.interferences, [], "{teeth} {module_mm} {kind}");
                assert!(
                    (0.3..2.5).contains(&(report.backlash_rad * ARCMIN_PER_RAD)),
                    "{teeth} {kind}: {}",
                    report.backlash_rad
                );
            }
        }
    }

    /// A thousandth of the volume has a thousandth of the drag, not none.
    #[test]
    fn a_small_drive_has_drag() {
        let drag = few(60, 0.1).drive("d").unwrap().drive.output.drag_torque_n_m;
        let expected = 0.02 * (0.5 * 0.1 * 60.0 / 47.0_f64).powi(3);
        assert!((drag / expected - 1.0).abs() < 5e-3, "{drag} N·m, expected {expected}");
    }

    #[test]
    fn a_number_that_makes_no_drive_is_named() {
        let said = |few: FewNumbers| few.drive("d").unwrap_err().to_string();
        assert!(said(few(201, 0.5)).starts_with("teeth: found 201, allowed: an even number"));
        assert!(said(few(20, 0.5)).starts_with("teeth: found 20,"));
        assert!(said(few(200, 0.0)).starts_with("module: found 0,"));
        let wide = FewNumbers { bore_mm: Some(102.0), ..few(200, 0.5) };
        assert!(
            said(wide)
                .starts_with("bore: found 102: the root circle has the diameter 101.75, so the rim would be -0.125")
        );
        let bore = FewNumbers { bore_mm: Some(62.0), ..few(200, 0.32) };
        let made = bore.drive("d").unwrap().drive;
        assert!((2.0 * made.flexspline.bore_radius_mm() - 62.0).abs() < 1e-3);
    }
}
