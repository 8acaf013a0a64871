//! The drive of a bench while somebody moves its sliders: its fields, what is wrong with them, and a drawing to scale.
//!
//! This is geometry, some milliseconds, and is computed here; all that takes longer is a job.

use std::panic::catch_unwind;

use serde::Serialize;

use crate::folder::{Folder, FolderError};
use crate::work::DriveAsked;
use flexspline_export::outlines;
use flexspline_mechanics::drive::{
    Drive, DriveError, GeneratorKind, GeneratorOutline, ListedField, Problem, RigidMesh,
};

/// Bytes of a drive file, at most: those with an error for each of 2000 teeth have 50 kB.
const LARGEST_DRIVE: u64 = 1 << 20;
/// Intervals to a piece of a tooth outline: 0.1 mm, a pixel of a close view (a guess).
const POINTS_PER_PIECE: usize = 6;
/// Intervals of a curve of the generator: a guess, some 1 mm.
const POINTS_OF_A_CURVE: usize = 48;
/// Stations around the rim at which the wave is given; a browser draws straight lines between. A guess.
const STATIONS: usize = 720;

/// A drive that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// No such file.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The fault.
    #[error(transparent)]
    Drive(#[from] DriveError),
}

/// A built-in drive, or a drive file of the folder.
pub fn read(folder: &Folder, name: &str) -> Result<Drive, ReadError> {
    if let Some(drive) = Drive::built_in(name) {
        return Ok(drive);
    }
    let bytes = folder.read(name, Some(LARGEST_DRIVE))?;
    Ok(Drive::from_toml(name, &String::from_utf8_lossy(&bytes))?)
}

/// A drive as a page shows it.
#[derive(Debug, Serialize)]
pub struct DriveShown {
    /// Its name.
    pub name: String,
    /// Turns of the generator for one of the output; of a drive that is whole.
    pub ratio: Option<f64>,
    /// Load that is usual with the generator, N·m.
    pub rated_torque_n_m: Option<f64>,
    /// Its fields.
    pub fields: Vec<ListedField>,
    /// Its faults; none of a drive that is whole.
    pub problems: Vec<Problem>,
    /// Cautions on a drive that is whole.
    pub cautions: Vec<String>,
    /// Its drawing; none of a drive that is not whole.
    pub drawing: Option<Drawing>,
}

/// Rigid teeth on the neutral curve that the generator makes, at generator angle 0; mm.
#[derive(Debug, Serialize)]
pub struct Drawing {
    /// A tooth of the flexspline, around +x, from root to root.
    pub tooth: Vec<[f64; 2]>,
    /// A space of the circular spline, around +x, from tip to tip.
    pub space: Vec<[f64; 2]>,
    /// Curves of the generator.
    pub generator: Vec<Vec<[f64; 2]>>,
    /// Teeth of the flexspline and of the circular spline.
    pub teeth: [u32; 2],
    /// Radius of the undeformed neutral layer of the rim.
    pub neutral_radius_mm: f64,
    /// Radius of the bore, undeformed.
    pub bore_radius_mm: f64,
    /// Outer radius of the circular spline.
    pub outer_radius_mm: f64,
    /// Where the material at equal angles around the neutral layer stands: x, y, direction of the outward normal (rad).
    pub wave: Vec<[f64; 3]>,
    /// Whether the gaps were looked for.
    pub gaps: bool,
    /// Least gap between rigid teeth over the mesh cycle, µm, negative where they interfere; none where they never
    /// meet.
    pub least_gap_um: Option<f64>,
    /// Backlash of the rigid teeth, arcsec at the output.
    pub backlash_arcsec: Option<f64>,
}

/// The drive that a page asks for; with the gaps of its teeth, a tenth of a second, or without.
///
/// # Errors
/// The drive that it starts from cannot be read.
pub fn show(folder: &Folder, asked: &DriveAsked, kind: GeneratorKind, gaps: bool) -> Result<DriveShown, ReadError> {
    let from = read(folder, &asked.drive)?;
    let sets: Vec<String> = asked.sets.iter().map(|(path, value)| format!("{path}={value}")).collect();
    // One field after another, so that each says what is wrong with it whatever the others are.
    let (mut problems, mut good) = (Vec::new(), Vec::new());
    for (set, path) in sets.iter().zip(asked.sets.keys()) {
        // A comma would begin another field.
        let one = if set.contains([',', '[', '{']) && !set.contains('[') {
            Err(format!("found {:?}, allowed: one value", asked.sets[path]))
        } else {
            from.with_set(set).map(drop).map_err(|error| words(&error, path))
        };
        match one {
            Ok(()) => good.push(set.as_str()),
            // Two fields that fit one another alone, as teeth of both wheels do.
            Err(_) if from.with_sets(sets.iter().map(String::as_str)).is_ok() => good.push(set.as_str()),
            Err(what) => problems.push(Problem::of(path, what)),
        }
    }
    let drive = from.with_sets(good.iter().copied()).map_err(|error| problems.extend(error.problems)).ok();
    let whole = drive.as_ref().filter(|_| problems.is_empty());
    // Geometry at the edge of what is allowed is the one thing here that could go wrong unforeseen.
    let unforeseen = || DriveError { problems: vec![Problem::of("", "these sizes make no drawing")] };
    let drawn = |drive| catch_unwind(|| draw(drive, kind, gaps)).unwrap_or_else(|_| Err(unforeseen()));
    let drawing = whole.and_then(|drive| drawn(drive).map_err(|error| problems.extend(error.problems)).ok());
    let mut cautions = Vec::new();
    if let Some(gap) = drawing.as_ref().and_then(|drawing| drawing.least_gap_um).filter(|gap| *gap < 0.0)
        && drive.as_ref().is_some_and(|drive| drive.flanks.preload_um == 0.0)
    {
        cautions.push(format!("rigid teeth interfere by {:.1} µm under this generator: the drive binds", -gap));
    }
    Ok(DriveShown {
        name: from.name.clone(),
        ratio: whole.map(Drive::ratio),
        rated_torque_n_m: whole.map(|drive| drive.rated_torque_n_m(kind)),
        fields: drive.as_ref().unwrap_or(&from).fields(),
        problems,
        cautions,
        drawing,
    })
}

/// Fault of one field; of a whole drive that does not fit, all of it.
fn words(error: &DriveError, path: &str) -> String {
    let of = |p: &Problem| {
        if p.field.is_empty() || p.field == path { p.what.clone() } else { format!("{}: {}", p.field, p.what) }
    };
    error.problems.iter().map(of).collect::<Vec<_>>().join("; ")
}

fn draw(drive: &Drive, kind: GeneratorKind, gaps: bool) -> Result<Drawing, DriveError> {
    let points = outlines(drive, kind, POINTS_PER_PIECE)?;
    let of = |part: &str| points.iter().filter(|p| p.part == part).map(|p| [p.x_mm, p.y_mm]).collect::<Vec<_>>();
    let outline = GeneratorOutline::new(drive, kind)?;
    let closed = |mut curve: Vec<[f64; 2]>| {
        curve.extend(curve.first().copied());
        curve
    };
    let generator = outline.polyline(POINTS_OF_A_CURVE).into_iter().map(closed).collect();
    let wave = (0..STATIONS)
        .map(|k| {
            let ([x, y], normal) = outline.neutral().position(std::f64::consts::TAU * k as f64 / STATIONS as f64);
            [x, y, normal]
        })
        .collect();
    let report = if gaps { RigidMesh::new(drive, kind)?.report(kind) } else { None };
    Ok(Drawing {
        tooth: of("flexspline_tooth"),
        space: of("circular_spline_space"),
        generator,
        teeth: [drive.flexspline.teeth, drive.circular_spline.teeth],
        neutral_radius_mm: drive.flexspline.neutral_radius_mm(),
        bore_radius_mm: drive.flexspline.bore_radius_mm(),
        outer_radius_mm: drive.circular_spline.outer_radius_mm,
        wave,
        gaps,
        least_gap_um: report.as_ref().map(|report| 1e3 * report.least.gap_mm),
        backlash_arcsec: report.map(|report| report.backlash_rad.to_degrees() * 3600.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(sets: &[(&str, &str)]) -> DriveShown {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::new(place.path()).unwrap();
        let sets = sets.iter().map(|(path, value)| ((*path).to_owned(), (*value).to_owned())).collect();
        show(&folder, &DriveAsked { drive: "HHD-95".to_owned(), sets }, GeneratorKind::Cam, true).unwrap()
    }

    #[test]
    fn a_whole_drive_is_drawn_as_it_stands() {
        let drive = Drive::hhd_95();
        let shown = shown(&[]);
        assert!(shown.problems.is_empty() && shown.cautions.is_empty(), "{:?}", shown.problems);
        let drawing = shown.drawing.unwrap();
        assert_eq!(drawing.teeth, [188, 190]);
        let radius = |[x, y, _]: [f64; 3]| x.hypot(y);
        // The wave is w0 high on the major axis, and as low on the minor one to first order.
        let [high, low] = [radius(drawing.wave[0]), radius(drawing.wave[STATIONS / 4])];
        assert!((high - low - 2.0 * drive.generator.w0_mm).abs() < 0.02, "{high} {low}");
        // That of contact FEM is 0.987'; rigid teeth on the neutral curve have it within 3 %.
        assert!((drawing.backlash_arcsec.unwrap() - 59.2).abs() < 1.8, "{:?}", drawing.backlash_arcsec);
        assert_eq!(drawing.generator.len(), 1);
    }

    #[test]
    fn what_is_wrong_stands_at_its_field() {
        let found = shown(&[("generator.w0_mm", "400"), ("flexspline.width_mm", "20"), ("flexspline.nothing", "1")]);
        let at: Vec<&str> = found.problems.iter().map(|p| p.field.as_str()).collect();
        assert_eq!(at, ["flexspline.nothing", "generator.w0_mm"]);
        assert!(found.problems[1].what.contains("allowed: above 0 to 20"), "{:?}", found.problems);
        assert!(found.drawing.is_none());
        // Two that fit each other and not the drive alone are no mistake.
        let both = shown(&[("flexspline.teeth", "186"), ("circular_spline.teeth", "188")]);
        let alone = shown(&[("flexspline.teeth", "186")]);
        assert!(!alone.problems.is_empty());
        assert!(both.problems.iter().all(|p| !p.what.contains("teeth, ")), "{:?}", both.problems);
    }

    #[test]
    fn teeth_that_interfere_are_a_caution() {
        let found = shown(&[("generator.w0_mm", "0.56")]);
        assert!(found.problems.is_empty(), "{:?}", found.problems);
        assert!(found.cautions.iter().any(|words| words.contains("interfere")), "{:?}", found.cautions);
    }
}
