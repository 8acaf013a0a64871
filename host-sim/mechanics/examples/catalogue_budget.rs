//! Which part of a drive gives how much of its torsion and hysteresis, next to a catalogue:
//! `catalogue_budget [SIZE …]`
//!
//! Sizes 17, 25 and 40, i = 100 (Harmonic Drive CSF). Module and teeth follow from the catalogue's pitch diameter; rim,
//! width, clearance and tooth form are those of HHD-95 in proportion, cup and balls are guesses in proportion
//! (`CUP`): no maker publishes them. Nothing is fitted to the catalogue.
//!
//! The same drive by contact FEM with one part more at a time: teeth, rim and cam alone; the cup; the
//! balls of the generator bearing, each range of torque with the stiffness that the balls have under its mean load. A
//! difference of compliances is the part's. Then the loop: what flank friction makes of it by contact FEM, with and
//! without preload, and bounds in closed form of what is not in the FEM (`race_on_bore`, `seal`).

use std::f64::consts::PI;
use std::process::ExitCode;

use flexspline_base::units::{ARCMIN_PER_RAD, ARCSEC_PER_RAD};
use flexspline_mechanics::bearing::Balls;
use flexspline_mechanics::drive::{Drive, FewNumbers, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Method, Problem, SolveError, SolverSettings};

/// Values of the catalogue (Harmonic Drive CSF/CSG, i = 100; rated torque CSG over 1.3; starting torque of Schaeffler's
/// RT1, same sizes).
struct Catalogue {
    size: u32,
    /// T1, T2 and the rated torque, N·m.
    loads_n_m: [f64; 3],
    k_n_m_per_rad: [f64; 3],
    start_n_m: Option<f64>,
}

const CATALOGUE: [Catalogue; 3] = [
    Catalogue { size: 17, loads_n_m: [3.9, 12.0, 24.0], k_n_m_per_rad: [1.0e4, 1.4e4, 1.6e4], start_n_m: Some(0.029) },
    Catalogue { size: 25, loads_n_m: [14.0, 48.0, 67.0], k_n_m_per_rad: [3.1e4, 5.0e4, 5.7e4], start_n_m: Some(0.069) },
    Catalogue { size: 40, loads_n_m: [54.0, 196.0, 265.0], k_n_m_per_rad: [1.3e5, 2.0e5, 2.3e5], start_n_m: None },
];

/// Length and wall of the cup over its pitch diameter: about half as long as wide, the wall about a hundredth. Guesses.
const CUP: [f64; 2] = [0.5, 0.011];
/// Thickness of the cup's bottom over its wall, hub over the pitch radius. Guesses.
const BOTTOM: [f64; 2] = [2.0, 0.5];
/// Flank friction: greased steel.
const FRICTION: f64 = 0.08;
/// Load at which the width of the loop is reported, over the rated one: above the drag, below T1.
const LOOP_SHARE: f64 = 0.04;
/// Preloads of S-shaped teeth, µm: drives of the catalogue have no play, and how much deeper their teeth mesh is not
/// published.
const PRELOADS_UM: [f64; 2] = [1.0, 3.0];
/// Friction of the bearing's outer race in the bore: greased steel, as on the flanks.
const RACE_FRICTION: f64 = 0.08;
/// Friction of a seal's lip for each mm around, N: a lip pressed on with 0.1 N/mm (radial shaft seals: DIN 3760 sizes,
/// maker's charts of lip loads reach from 0.05 to 0.15) and rubber on greased steel, 0.3. A guess; component sets have
/// no seal at all.
const SEAL_N_PER_MM: f64 = 0.03;

/// Widest loop, arcsec at the output, that the outer race can make by slipping in the bore. All its normal force held
/// by friction is a torque `mu F r` on the rim. It stays behind on the rim when the load goes, which gives it up over
/// the torsional stiffness of what holds it; both ways, twice. A bound: the race may turn with the rim, since nothing
/// but its balls holds it back.
fn race_on_bore(force_n: f64, bore_mm: f64, k_n_m_per_rad: f64) -> f64 {
    2.0 * 1e-3 * RACE_FRICTION * force_n * 0.5 * bore_mm / k_n_m_per_rad * ARCSEC_PER_RAD
}

/// Loop by the lip of an output seal as wide as the pitch circle, arcsec: its torque holds back a wind-up either way.
fn seal(pitch_mm: f64, k_n_m_per_rad: f64) -> f64 {
    2.0 * 1e-3 * SEAL_N_PER_MM * PI * pitch_mm * 0.5 * pitch_mm / k_n_m_per_rad * ARCSEC_PER_RAD
}

/// Torsion and generator load of a drive that is loaded step by step, its generator held.
#[derive(Clone, Copy, Default)]
struct Loaded {
    /// Secants in the three ranges, N·m/rad.
    k: [f64; 3],
    /// Load of one ball in the middle of each range, N; without balls what they would carry.
    ball_n: [f64; 3],
    /// Flanks in contact at the end of each range, over the number of teeth.
    share_in_contact: [f64; 3],
    /// Sum of all ball loads without load, N.
    sum_n: f64,
}

fn solver() -> SolverSettings {
    SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() }
}

fn problem(drive: &Drive) -> Result<Problem, SolveError> {
    Problem::new(drive, GeneratorKind::Cam, drive.temperature.reference_c, solver())
}

fn loaded(drive: &Drive, loads_n_m: &[f64]) -> Result<Loaded, SolveError> {
    let problem = problem(drive)?;
    let edges = problem.flexspline.base_edges.len() * problem.flexspline.teeth;
    let balls = Balls::in_proportion(2.0 * drive.flexspline.bore_radius_mm());
    let mut motion = Motion::deformed(&problem, 0.0)?;
    // Balls under the part of the bore that the generator touches; along the axis of the lobe a load counts by its
    // cosine, about its mean.
    let carried = |motion: &Motion<'_>| {
        let last = motion.last();
        let share = last.generator_contacts as f64 / edges as f64;
        let half_angle = 0.5 * PI * share;
        let mean_cosine = if half_angle > 0.0 { half_angle.sin() / half_angle } else { 1.0 };
        let sum_n = 2.0 * last.lobe_force_n / mean_cosine;
        (sum_n / (share * f64::from(balls.count)).max(2.0), sum_n)
    };
    let mut found = Loaded { sum_n: carried(&motion).1, ..Loaded::default() };
    let touch = 2.0 * drive.output.drag_torque_n_m;
    motion.load(touch)?;
    let mut from = (touch, motion.error_rad(), carried(&motion).0);
    for (range, torque) in loads_n_m.iter().copied().enumerate() {
        motion.load(torque)?;
        let to = (torque, motion.error_rad(), carried(&motion).0);
        found.k[range] = (to.0 - from.0) / (to.1 - from.1);
        found.ball_n[range] = 0.5 * (from.2 + to.2);
        found.share_in_contact[range] = motion.last().flank_contacts as f64 / f64::from(drive.flexspline.teeth);
        from = to;
    }
    Ok(found)
}

/// Width of the loop by flank friction, arcsec: at a light load, or none, coming from the rated load and from the
/// opposite one.
fn loop_arcsec(drive: &Drive, rated_n_m: f64, share: f64) -> Result<f64, SolveError> {
    let problem = problem(&rough(drive))?;
    let mut motion = Motion::deformed(&problem, 0.0)?;
    let light = share * rated_n_m;
    let mut errors_rad = [0.0; 2];
    for (error_rad, before) in errors_rad.iter_mut().zip([rated_n_m, -rated_n_m]) {
        motion.load(before)?;
        motion.load(light)?;
        *error_rad = motion.error_rad();
    }
    Ok((errors_rad[0] - errors_rad[1]) * ARCSEC_PER_RAD)
}

fn rough(drive: &Drive) -> Drive {
    let mut rough = drive.clone();
    rough.flanks.friction_coefficient = FRICTION;
    rough
}

fn row(what: &str, values: [f64; 3], unit: &str) {
    println!("  {what:<46} {:>9.3} {:>9.3} {:>9.3}  {unit}", values[0], values[1], values[2]);
}

/// A drive as in the catalogue by its plane slice, and in its cup.
fn plane_and_cup(entry: &Catalogue) -> Result<[Drive; 2], Box<dyn std::error::Error>> {
    let pitch_mm = 2.54 * f64::from(entry.size);
    let numbers = FewNumbers { teeth: 200, module_mm: pitch_mm / 200.0, bore_mm: None, generator: GeneratorKind::Cam };
    let name = format!("size {}", entry.size);
    let plane = numbers.drive(&name)?.drive.with_set("sleeve.kind=none")?;
    let ([length, wall], [bottom, hub]) = (CUP, BOTTOM);
    let wall_mm = wall * pitch_mm;
    let sets = [
        "sleeve.kind=cup".to_owned(),
        "sleeve.bottom=plate".to_owned(),
        format!("sleeve.wall_mm={wall_mm:.4}"),
        format!("sleeve.bottom_side_mm={:.3}", length * pitch_mm - plane.flexspline.width_mm),
        format!("sleeve.bottom_thickness_mm={:.4}", bottom * wall_mm),
        format!("sleeve.hub_radius_mm={:.3}", 0.5 * hub * pitch_mm),
    ];
    let cup = plane.with_sets(sets.iter().map(String::as_str))?;
    Ok([plane, cup])
}

/// A drive on balls that are as stiff as they are under a load.
fn on_balls(drive: &Drive, load_n: f64) -> Drive {
    let bore_mm = 2.0 * drive.flexspline.bore_radius_mm();
    let balls = Balls::in_proportion(bore_mm);
    let mut drive = drive.clone();
    drive.generator.bearing_stiffness_n_per_mm3 =
        Some(balls.bedding_n_per_mm3(load_n, bore_mm, drive.flexspline.width_mm));
    drive
}

/// A drive loaded on balls: each range on such as it has in its middle.
fn loaded_on_balls(drive: &Drive, ball_n: [f64; 3], loads_n_m: [f64; 3]) -> Result<Loaded, SolveError> {
    let mut all = Loaded::default();
    for range in 0..3 {
        let one = loaded(&on_balls(drive, ball_n[range]), &loads_n_m[..=range])?;
        all.k[range] = one.k[range];
        all.share_in_contact[range] = one.share_in_contact[range];
        if range == 0 {
            all.sum_n = one.sum_n;
        }
    }
    Ok(all)
}

fn budget(entry: &Catalogue) -> Result<(), Box<dyn std::error::Error>> {
    let [plane, cup] = plane_and_cup(entry)?;
    let pitch_mm = 2.54 * f64::from(entry.size);
    let bore_mm = 2.0 * plane.flexspline.bore_radius_mm();
    let alone = loaded(&plane, &entry.loads_n_m)?;
    let in_cup = loaded(&cup, &entry.loads_n_m)?;
    let with_balls = loaded_on_balls(&cup, in_cup.ball_n, entry.loads_n_m)?.k;
    // S-shaped teeth in the same cup, on balls as stiff as they are in the lowest range.
    let s_shaped = |preload_um: f64, load_n: f64| on_balls(&cup.clone().with_s_teeth(preload_um), load_n);
    let preloaded = loaded_on_balls(&cup.clone().with_s_teeth(PRELOADS_UM[0]), in_cup.ball_n, entry.loads_n_m)?;
    let (with_s, contacts) = (preloaded.k, preloaded.share_in_contact);

    println!(
        "size {}, i = 100: 200 teeth, module {:.4} mm, cup {:.1} x {:.2} mm (guess)",
        entry.size,
        plane.flexspline.module_mm,
        CUP[0] * pitch_mm,
        CUP[1] * pitch_mm
    );
    println!("  {:<46} {:>9} {:>9} {:>9}", "", "K1", "K2", "K3");
    row("catalogue (single units ±30 %)", entry.k_n_m_per_rad.map(|k| 1e-4 * k), "1e4 N·m/rad");
    row("teeth, rim, rigid cam", alone.k.map(|k| 1e-4 * k), "");
    row("and the cup", in_cup.k.map(|k| 1e-4 * k), "");
    row("and the balls", with_balls.map(|k| 1e-4 * k), "");
    let part = |k: [f64; 3], before: Option<[f64; 3]>| -> [f64; 3] {
        std::array::from_fn(|i| 100.0 * entry.k_n_m_per_rad[i] * (k[i].recip() - before.map_or(0.0, |b| b[i].recip())))
    };
    println!("  share of the catalogue's compliance, percent");
    row("teeth, rim, rigid cam", part(alone.k, None), "%");
    row("cup", part(in_cup.k, Some(alone.k)), "%");
    row("balls", part(with_balls, Some(in_cup.k)), "%");
    row("missing", part(entry.k_n_m_per_rad, Some(with_balls)), "%");
    row("load of a ball, mid range", in_cup.ball_n, "N");
    row(
        "flanks in contact, involutes, end of range",
        in_cup.share_in_contact.map(|share| 100.0 * share),
        "% of the teeth",
    );
    println!("  S-shaped teeth, preloaded by {} µm, cup and balls", PRELOADS_UM[0]);
    row("", with_s.map(|k| 1e-4 * k), "1e4 N·m/rad");
    row("missing", part(entry.k_n_m_per_rad, Some(with_s)), "%");
    row("flanks in contact, end of range", contacts.map(|share| 100.0 * share), "% of the teeth");

    let rated = entry.loads_n_m[2];
    let flanks = [loop_arcsec(&plane, rated, LOOP_SHARE)?, loop_arcsec(&cup, rated, LOOP_SHARE)?];
    println!(
        "  loop at {:.1} N·m by flank friction {FRICTION}: {:.2}″ plane, {:.2}″ in the cup; catalogue about 60″",
        LOOP_SHARE * rated,
        flanks[0],
        flanks[1]
    );
    for preload_um in PRELOADS_UM {
        let drive = s_shaped(preload_um, in_cup.ball_n[0]);
        println!(
            "  the same of S-shaped teeth preloaded by {preload_um} µm, on balls: {:.2}″, without load {:.2}″",
            loop_arcsec(&drive, rated, LOOP_SHARE)?,
            loop_arcsec(&drive, rated, 0.0)?
        );
    }
    println!(
        "  at most by the race in the bore, {:.0} N on it: {:.1}″; by an output seal: {:.1}″",
        in_cup.sum_n,
        race_on_bore(in_cup.sum_n, bore_mm, in_cup.k[0]),
        seal(pitch_mm, in_cup.k[0])
    );
    if let Some(start) = entry.start_n_m {
        let reflected = 2.0 * 100.0 * start / entry.k_n_m_per_rad[2] * ARCMIN_PER_RAD;
        println!("  loop by the catalogue's starting torque through the ratio, 2 i T_start/K3: {reflected:.2}′");
    }
    Ok(())
}

fn main() -> ExitCode {
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let known: Vec<String> = CATALOGUE.iter().map(|entry| entry.size.to_string()).collect();
    if let Some(wrong) = asked.iter().find(|size| !known.contains(size)) {
        eprintln!("catalogue_budget [SIZE …]: found {wrong}, allowed: {}", known.join(", "));
        return ExitCode::from(2);
    }
    for entry in CATALOGUE.iter().filter(|entry| asked.is_empty() || asked.contains(&entry.size.to_string())) {
        if let Err(error) = budget(entry) {
            eprintln!("size {}: {error}", entry.size);
            return ExitCode::from(1);
        }
    }
    ExitCode::SUCCESS
}
