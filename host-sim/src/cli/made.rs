//! A drive made of a few numbers, before it is written: S-shaped teeth, guesses of cup and balls, under which
//! generators its teeth clear, and the formulas above its fields.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{Context, Failure, bad_input};
use flexspline_mechanics::bearing::Balls;
use flexspline_mechanics::drive::{Drive, DriveError, GeneratorKind, MadeDrive, RigidMesh};

/// Length of a cup and its wall over the pitch diameter, thickness of its bottom over the wall, hub over the pitch
/// radius: guesses, as in `catalogue_budget`. A cup is about half as long as wide, its wall about a hundredth.
const CUP: [f64; 4] = [0.5, 0.011, 2.0, 0.5];
/// Shortest tube of a cup, over the pitch diameter: a guess. Of a face wider than usual the cup is longer, not without
/// a tube.
const SHORTEST_TUBE: f64 = 0.1;
/// Load of a ball for its stiffness, N, of a drive with a pitch diameter of 63.5 mm (size 25): between the 46 N below
/// T1 and the 154 N above T2 that contact FEM has there (docs/explanation/third_dimension.md). Forces go with the
/// square of the size.
const BALL_N: f64 = 100.0;
const BALL_N_AT_MM: f64 = 63.5;
/// Preload of S-shaped teeth, µm, as of S-95. A guess: drives of catalogues have no play, and how much deeper their
/// teeth mesh is not published.
const PRELOAD_UM: f64 = 1.0;
/// Teeth that have room for the S shape (tested): of fewer they are made lower, until they do not reach into one
/// another. Those that still fit are taken.
const S_TEETH: u32 = 100;
/// Teeth of the ratios 50 to 160, of which catalogues bear [`Drive::CATALOGUE_CONTACT`] out but for K1 at 160.
const CONTACT_TEETH: std::ops::RangeInclusive<u32> = 100..=320;
/// Above a part of cup or balls.
const GUESSED: &str = "a guess in proportion to the pitch diameter: no catalogue prints it";
/// Above `output.contact_compliance`.
const CONTACT: &str = "what all sizes of a catalogue have in addition to teeth, cup and balls: a regularity with a \
                       form that Hertz gives, not a derivation; exponent and ratio power were chosen; 5.8 fitted on \
                       sizes 17 to 40, i = 50 and 80, unseen 45 to 90 within 16 %; at i = 160 K1 is 21 to 28 % too \
                       stiff, sizes 11 and 14 are up to 46 % off";
/// Tip roundings of S-shaped teeth, modules, as of S-95.
const S_TIP_ROUNDING: f64 = 0.1;

/// Stiffness of the balls of a generator in proportion, N/mm³.
pub(super) fn balls_n_per_mm3(drive: &Drive) -> f64 {
    let pitch_mm = 2.0 * drive.flexspline.pitch_radius_mm();
    let bore_mm = 2.0 * drive.flexspline.bore_radius_mm();
    let load_n = BALL_N * (pitch_mm / BALL_N_AT_MM).powi(2);
    Balls::in_proportion(bore_mm).bedding_n_per_mm3(load_n, bore_mm, drive.flexspline.width_mm).round()
}

/// The drive with S-shaped teeth for the cam, preloaded, on balls: between rigid parts a micrometre of preload is
/// kilonewtons.
pub(super) fn with_s_teeth(made: MadeDrive) -> Result<MadeDrive, Failure> {
    let MadeDrive { drive, mut formulas } = made;
    let mut drive = drive.with_s_teeth(PRELOAD_UM);
    let rounding_mm = (1e4 * S_TIP_ROUNDING * drive.flexspline.module_mm).round() / 1e4;
    (drive.flexspline.tip_rounding_mm, drive.circular_spline.tip_rounding_mm) = (rounding_mm, rounding_mm);
    drive.generator.bearing_stiffness_n_per_mm3 = Some(balls_n_per_mm3(&drive));
    let anew = [
        ("flexspline.profile_shift", "S-shaped teeth: pitch circle half way along the teeth that mesh".to_owned()),
        ("flexspline.tip_rounding_mm", format!("{S_TIP_ROUNDING} modules, as S-95")),
        ("circular_spline.tip_rounding_mm", format!("{S_TIP_ROUNDING} modules, as S-95")),
        (
            "generator.bearing_stiffness_n_per_mm3",
            "a guess: balls in proportion to the bore; on a rigid generator the preload would be kilonewtons"
                .to_owned(),
        ),
        ("flanks.preload_um", "a guess, as S-95: teeth that touch without play, and a little deeper".to_owned()),
    ];
    // The space is drawn by its tooth: its shift is without meaning.
    formulas.retain(|(path, _)| *path != "circular_spline.profile_shift" && anew.iter().all(|(new, _)| new != path));
    formulas.extend(anew);
    drive.check().map_err(|error| {
        Failure::BadInput(format!(
            "--set flexspline.profile=s: S-shaped teeth have no room in this drive of {} teeth ({error}); allowed: \
             more teeth, {S_TEETH} have it",
            drive.flexspline.teeth
        ))
    })?;
    Ok(MadeDrive { drive, formulas })
}

/// Guesses of cup and balls in proportion: fields and their values.
pub(super) fn cup_and_balls(drive: &Drive) -> [(&'static str, String); 7] {
    let [length, wall, bottom, hub] = CUP;
    let pitch_mm = 2.0 * drive.flexspline.pitch_radius_mm();
    let wall_mm = wall * pitch_mm;
    let tube_mm = (length * pitch_mm - drive.flexspline.width_mm).max(SHORTEST_TUBE * pitch_mm);
    [
        ("sleeve.kind", "cup".to_owned()),
        ("sleeve.bottom", "plate".to_owned()),
        ("sleeve.wall_mm", format!("{wall_mm:.3}")),
        ("sleeve.bottom_side_mm", format!("{tube_mm:.1}")),
        ("sleeve.bottom_thickness_mm", format!("{:.3}", bottom * wall_mm)),
        ("sleeve.hub_radius_mm", format!("{:.1}", 0.5 * hub * pitch_mm)),
        ("generator.bearing_stiffness_n_per_mm3", balls_n_per_mm3(drive).to_string()),
    ]
}

/// The drive with guesses of cup and balls, of what is not set, and the compliance that catalogues have beside them for
/// the ratios that they bear out.
pub(super) fn as_sold(context: &Context, made: MadeDrive) -> Result<MadeDrive, Failure> {
    let MadeDrive { drive, mut formulas } = made;
    let guessed = cup_and_balls(&context.with_sets(drive.clone())?).map(|(path, value)| (path, value, GUESSED));
    let kappa = (CONTACT_TEETH.contains(&drive.flexspline.teeth))
        .then(|| ("output.contact_compliance", Drive::CATALOGUE_CONTACT.to_string(), CONTACT));
    let open = guessed.into_iter().chain(kappa).filter(|(path, ..)| context.set_to(path).is_none());
    let mut sets = Vec::new();
    for (path, value, why) in open {
        sets.push(format!("{path}={value}"));
        formulas.retain(|(known, _)| *known != path);
        formulas.push((path, why.to_owned()));
    }
    let drive = drive.with_sets(sets.iter().map(String::as_str)).map_err(bad_input)?;
    Ok(MadeDrive { drive, formulas })
}

/// Under which generators rigid teeth clear one another.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Clearance {
    /// Where no tooth interferes.
    pub clear: Vec<GeneratorKind>,
    /// Where teeth interfere, and by how much, µm.
    pub interfere_um: BTreeMap<GeneratorKind, f64>,
}

impl Clearance {
    pub(super) fn of(drive: &Drive) -> Result<Clearance, DriveError> {
        let interfering = RigidMesh::interfering(drive)?;
        let interfere_um: BTreeMap<_, _> =
            interfering.into_iter().map(|(kind, least)| (kind, -1e3 * least.gap_mm)).collect();
        let clear = GeneratorKind::ALL.into_iter().filter(|kind| !interfere_um.contains_key(kind)).collect();
        Ok(Clearance { clear, interfere_um })
    }

    /// In words.
    pub(super) fn text(&self) -> String {
        let clear: Vec<&str> = self.clear.iter().map(|kind| kind.name()).collect();
        let binds: Vec<String> = self.interfere_um.iter().map(|(kind, um)| format!("{kind} (by {um:.1} um)")).collect();
        match (clear.as_slice(), binds.as_slice()) {
            (clear, []) => format!("teeth clear one another under {}", clear.join(", ")),
            ([], binds) => format!("teeth interfere under {}, all four: this drive binds", binds.join(", ")),
            (clear, binds) => {
                format!("teeth clear one another under {}; they interfere under {}", clear.join(", "), binds.join(", "))
            }
        }
    }

    /// Refuses S-shaped teeth that have no room under the cam, for which they are drawn.
    pub(super) fn check_s_teeth(&self) -> Result<(), Failure> {
        match self.interfere_um.get(&GeneratorKind::Cam) {
            None => Ok(()),
            Some(um) => Err(Failure::BadInput(format!(
                "--set flexspline.profile=s: the S-shaped teeth of this drive interfere by {um:.1} um under the cam, \
                 for which they are drawn; allowed: more teeth, or no change of radii, shift and w0_mm by --set"
            ))),
        }
    }
}

/// The drive's file with a formula above every field that was derived and not set to something else.
pub(super) fn with_formulas(made: &MadeDrive, drive: &Drive) -> String {
    let derived: BTreeMap<String, String> = fields(&made.drive.to_toml()).collect();
    let mut text = String::new();
    let file = drive.to_toml();
    let mut known = fields(&file).peekable();
    for line in file.lines() {
        if let Some((path, _)) = known.next_if(|(_, field)| field == line) {
            let formula = made.formulas.iter().find(|(of, _)| *of == path);
            if let Some((_, formula)) = formula.filter(|_| derived.get(&path).is_some_and(|old| old == line)) {
                text += &format!("# {formula}\n");
            }
        }
        text += line;
        text.push('\n');
    }
    text
}

/// Path and line of every field of a drive file.
fn fields(file: &str) -> impl Iterator<Item = (String, String)> {
    let mut section = String::new();
    file.lines().filter_map(move |line| {
        if let Some((name, _)) = line.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
            section = name.to_owned();
        }
        let (key, _) = line.split_once(" = ").filter(|_| !line.starts_with('#'))?;
        Some((format!("{section}.{key}"), line.to_owned()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::drive::FewNumbers;

    fn made(teeth: u32, module_mm: f64) -> MadeDrive {
        let few = FewNumbers { teeth, module_mm, bore_mm: None, generator: GeneratorKind::Cam };
        few.drive("d").unwrap()
    }

    /// The remarks on the teeth agree with the rigid mesh: the space of S-shaped teeth is cut for the cam.
    #[test]
    fn s_shaped_teeth_clear_under_the_cam_and_involutes_under_all() {
        let involutes = made(160, 0.254);
        assert_eq!(Clearance::of(&involutes.drive).unwrap().clear, GeneratorKind::ALL);
        let Err(Failure::BadInput(why)) = with_s_teeth(made(60, 1.0)) else { panic!("60 teeth have room") };
        assert!(why.contains("of 60 teeth") && why.contains("allowed: more teeth, 100"), "{why}");
        for (teeth, module_mm) in [(S_TEETH, 0.7), (200, 0.3175)] {
            let s = with_s_teeth(made(teeth, module_mm)).unwrap();
            let clearance = Clearance::of(&s.drive).unwrap();
            assert!(clearance.check_s_teeth().is_ok() && clearance.clear == [GeneratorKind::Cam], "{clearance:?}");
            let said = clearance.text();
            assert!(said.contains("clear one another under cam; they interfere under two-roller (by"), "{said}");
            let file = with_formulas(&s, &s.drive);
            assert!(
                !file.contains("under all four") && file.contains("# a guess, as S-95: teeth that touch"),
                "{file}"
            );
            // What is set otherwise has no formula.
            let other = s.drive.with_set("flanks.preload_um=2").unwrap();
            assert!(!with_formulas(&s, &other).contains("# a guess, as S-95: teeth that touch"));
        }
    }

    #[test]
    fn cup_and_balls_fit_any_face() {
        let sets = |drive: &Drive| cup_and_balls(drive).map(|(path, value)| format!("{path}={value}"));
        // A face of the usual width, and one that is wider than a cup is long.
        for width in ["flexspline.width_mm=17.5", "flexspline.width_mm=60"] {
            let plain = made(160, 0.508).drive.with_set(width).unwrap();
            let whole = plain.with_sets(sets(&plain).iter().map(String::as_str)).unwrap();
            whole.check().unwrap();
        }
        // Size 25, as its parts were taken one by one in third_dimension.md: a wall of 0.7 mm.
        let size_25 = made(200, 0.3175).drive;
        assert!(sets(&size_25).contains(&"sleeve.wall_mm=0.699".to_owned()), "{:?}", sets(&size_25));
    }
}
