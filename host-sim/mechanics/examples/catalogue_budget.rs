//! Which part of a drive gives how much of its torsion and hysteresis, next to a catalogue:
//! `catalogue_budget [cone | map] [SIZE …]`
//!
//! Sizes 17, 25 and 40, i = 100 (Harmonic Drive CSF). Module and teeth follow from the catalogue's pitch diameter; rim,
//! width, clearance and tooth form are those of HHD-95 in proportion, cup and balls are guesses in proportion
//! (`Guess`): no maker publishes them. Nothing is fitted to the catalogue.
//!
//! Without a word: the same drive by contact FEM with one part more at a time: teeth, rim and cam alone; the cup; the
//! balls of the generator bearing, each range of torque with the stiffness that the balls have under its mean load. A
//! difference of compliances is the part's. Then the loop: what flank friction makes of it by contact FEM, with and
//! without preload, and bounds in closed form of what is not in the FEM (`race_on_bore`, `seal`).
//!
//! `cone`: everything at once, the teeth leaning with the cup (`flexspline.face = "slices"`). Involutes and S-shaped
//! teeth, straight, crowned, and tapered for the cone, each drawn just free of play (`free_of_play`) or deeper, with
//! its loop and the torque that turns its generator without load.
//!
//! `map`: S-shaped crowned teeth free of play, one guess changed at a time.

use std::f64::consts::PI;
use std::process::ExitCode;

use flexspline_base::units::{ARCMIN_PER_RAD, ARCSEC_PER_RAD};
use flexspline_mechanics::bearing::Balls;
use flexspline_mechanics::contact::{Configuration, FlankLaw};
use flexspline_mechanics::drive::{Drive, FewNumbers, GeneratorKind};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Face, Method, Problem, SolveError, SolverSettings};

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

/// Numbers that no maker publishes.
#[derive(Clone, Copy)]
struct Guess {
    /// Length and wall of the cup over its pitch diameter: about half as long as wide, the wall about a hundredth.
    length: f64,
    wall: f64,
    /// Balls, and their diameter over that of [`Balls::in_proportion`].
    balls: u32,
    ball: f64,
    /// Face width over that of HHD-95 in proportion.
    width: f64,
    /// How far both ends of a flank stand back, modules. The skew of the cone moves them by 0.14.
    crowning: f64,
    /// How much deeper the flanks mesh than where they come free of play, µm.
    deeper_um: f64,
}

const GUESS: Guess =
    Guess { length: 0.5, wall: 0.011, balls: 23, ball: 1.0, width: 1.0, crowning: 0.1, deeper_um: 0.0 };
/// Thickness of the cup's bottom over its wall, hub over the pitch radius. Guesses.
const BOTTOM: [f64; 2] = [2.0, 0.5];
/// Flank friction: greased steel.
const FRICTION: f64 = 0.08;
/// Load at which the width of the loop is reported, over the rated one: above the drag, below T1.
const LOOP_SHARE: f64 = 0.04;
/// Pairs of flanks nearer than this are looked at, mm.
const NEAR_MM: f64 = 0.02;
/// Preloads between which flanks come free of play, µm: what a drive may have; and how closely that place is found.
const PRELOAD_RANGE_UM: [f64; 2] = [-50.0, 50.0];
const PLAY_UM: f64 = 0.25;
/// Preloads of S-shaped teeth, µm: drives of the catalogue have no play, and how much deeper their teeth mesh is not
/// published.
const PRELOADS_UM: [f64; 2] = [1.0, 3.0];
/// How much deeper than free of play coned teeth mesh, µm.
const DEEPER_UM: [f64; 4] = [0.0, 1.0, 3.0, 10.0];
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
    /// Load along the face of the flank that bears most, there: peak over mean, and the share that bears.
    peak_over_mean: [f64; 3],
    share_of_face: [f64; 3],
    /// Sum of all ball loads without load, N.
    sum_n: f64,
    /// Tilt under the last load of the teeth that bear, mean by their load, mrad.
    bearing_tilt_mrad: f64,
}

fn solver() -> SolverSettings {
    SolverSettings { method: Method::Fast, mesh: MeshLevel::Coarse, ..SolverSettings::default() }
}

fn problem(drive: &Drive) -> Result<Problem, SolveError> {
    Problem::new(drive, GeneratorKind::Cam, drive.temperature.reference_c, solver())
}

/// Tilt of the teeth that bear, mean by their load, mrad: the rim tilts as it is oval, by the cosine of twice the angle
/// from the major axis.
fn bearing_tilt_mrad(motion: &Motion<'_>) -> f64 {
    let (problem, state) = (motion.problem(), motion.state());
    let flanks = problem.flanks();
    let at = Configuration { u: &state.u, v: &state.v, output_rad: state.output_rad, leans: &state.leans };
    let law = FlankLaw { stiffness: problem.settings.flank_penalty, stick_stiffness: 0.0, friction: 0.0 };
    let mut sums = [0.0; 2];
    for pair in flanks.near_pairs(at, NEAR_MM) {
        let load = flanks.evaluate(pair, at, law, &flanks.layout(pair, at).points).map_or(0.0, |found| found.load);
        let from_axis = problem.flexspline.sector_angle(pair.tooth) - state.generator_rad;
        sums = [sums[0] + load, sums[1] + load * (2.0 * from_axis).cos()];
    }
    1e3 * motion.last().face.tilt_rad * sums[1] / sums[0]
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
        let Face { peak_over_mean, share, .. } = motion.last().face;
        (found.peak_over_mean[range], found.share_of_face[range]) = (peak_over_mean, share);
        from = to;
    }
    found.bearing_tilt_mrad = bearing_tilt_mrad(&motion);
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

/// Torque that turns the generator without load, N·m: what flank friction makes of the forces between flanks.
fn turning_n_m(drive: &Drive) -> Result<f64, SolveError> {
    const INCREMENTS: usize = 8;
    let problem = problem(&rough(drive))?;
    let mut motion = Motion::deformed(&problem, 0.0)?;
    let pitch = motion.pitch();
    motion.settle(pitch / INCREMENTS as f64)?;
    let places = motion.turn_in(pitch, INCREMENTS)?;
    Ok(places.iter().map(|place| place.increment.generator_torque_n_m).sum::<f64>() / INCREMENTS as f64)
}

/// The drive with its flanks as deep as they go without touching while there is no load, and `deeper_um` more; nothing
/// where they touch with the most clearance that a drive may have.
fn free_of_play(drive: &Drive, deeper_um: f64) -> Result<Option<Drive>, SolveError> {
    let mut drive = drive.clone();
    let mut touches = |preload_um: f64| {
        drive.flanks.preload_um = preload_um;
        Ok::<_, SolveError>(Motion::deformed(&problem(&drive)?, 0.0)?.last().flank_contacts > 0)
    };
    let [mut free, mut binds] = PRELOAD_RANGE_UM;
    if touches(free)? {
        return Ok(None);
    }
    while binds - free > PLAY_UM {
        let middle = 0.5 * (free + binds);
        *(if touches(middle)? { &mut binds } else { &mut free }) = middle;
    }
    drive.flanks.preload_um = free + deeper_um;
    Ok(Some(drive))
}

fn row(what: &str, values: [f64; 3], unit: &str) {
    println!("  {what:<46} {:>9.3} {:>9.3} {:>9.3}  {unit}", values[0], values[1], values[2]);
}

/// A drive as in the catalogue by its plane slice, and in its cup.
fn plane_and_cup(entry: &Catalogue, guess: &Guess) -> Result<[Drive; 2], Box<dyn std::error::Error>> {
    let pitch_mm = 2.54 * f64::from(entry.size);
    let numbers = FewNumbers { teeth: 200, module_mm: pitch_mm / 200.0, bore_mm: None, generator: GeneratorKind::Cam };
    let name = format!("size {}", entry.size);
    let drive = numbers.drive(&name)?.drive;
    let width = format!("flexspline.width_mm={}", guess.width * drive.flexspline.width_mm);
    let plane = drive.with_sets([width.as_str(), "sleeve.kind=none"])?;
    let wall_mm = guess.wall * pitch_mm;
    let [bottom, hub] = BOTTOM;
    let sets = [
        "sleeve.kind=cup".to_owned(),
        "sleeve.bottom=plate".to_owned(),
        format!("sleeve.wall_mm={wall_mm:.4}"),
        format!("sleeve.bottom_side_mm={:.3}", guess.length * pitch_mm - plane.flexspline.width_mm),
        format!("sleeve.bottom_thickness_mm={:.4}", bottom * wall_mm),
        format!("sleeve.hub_radius_mm={:.3}", 0.5 * hub * pitch_mm),
    ];
    let cup = plane.with_sets(sets.iter().map(String::as_str))?;
    Ok([plane, cup])
}

/// A drive on balls that are as stiff as they are under a load.
fn on_balls(drive: &Drive, guess: &Guess, load_n: f64) -> Drive {
    let bore_mm = 2.0 * drive.flexspline.bore_radius_mm();
    let balls = Balls::in_proportion(bore_mm);
    let balls = Balls { count: guess.balls, diameter_mm: guess.ball * balls.diameter_mm };
    let mut drive = drive.clone();
    drive.generator.bearing_stiffness_n_per_mm3 =
        Some(balls.bedding_n_per_mm3(load_n, bore_mm, drive.flexspline.width_mm));
    drive
}

/// A drive loaded on balls: each range on such as it has in its middle.
fn loaded_on_balls(drive: &Drive, guess: &Guess, ball_n: [f64; 3], loads_n_m: [f64; 3]) -> Result<Loaded, SolveError> {
    let mut all = Loaded::default();
    for range in 0..3 {
        let one = loaded(&on_balls(drive, guess, ball_n[range]), &loads_n_m[..=range])?;
        all.k[range] = one.k[range];
        all.share_in_contact[range] = one.share_in_contact[range];
        all.peak_over_mean[range] = one.peak_over_mean[range];
        all.share_of_face[range] = one.share_of_face[range];
        all.bearing_tilt_mrad = one.bearing_tilt_mrad;
        if range == 0 {
            all.sum_n = one.sum_n;
        }
    }
    Ok(all)
}

/// The teeth lean with the cup, tapered against it and crowned.
fn leaning(drive: &Drive, taper_mrad: f64, crowning_um: f64) -> Result<Drive, Box<dyn std::error::Error>> {
    Ok(drive.with_sets([
        "flexspline.face=slices",
        &format!("flexspline.taper_mrad={taper_mrad:.2}"),
        &format!("flexspline.crowning_um={crowning_um:.2}"),
    ])?)
}

/// A line of the cone: stiffness, what is missing of the compliance, and the load along the face.
fn line(what: &str, entry: &Catalogue, found: &Loaded) {
    let three = |x: [f64; 3], digits: usize| x.map(|x| format!("{x:.digits$}")).join(" ");
    let missing = [0, 1, 2].map(|i| 100.0 * (1.0 - entry.k_n_m_per_rad[i] / found.k[i]));
    println!(
        "  {what:<44} {:>14}  {:.2}:{:.2}:1  {:>9}  {:>8}  {:>14}  {:>14}  {:>5.0}  {:>5.1}",
        three(found.k.map(|k| 1e-4 * k), 1),
        found.k[0] / found.k[2],
        found.k[1] / found.k[2],
        three(missing, 0),
        three(found.share_in_contact.map(|share| 100.0 * share), 0),
        three(found.peak_over_mean, 1),
        three(found.share_of_face, 2),
        0.5 * found.sum_n,
        found.bearing_tilt_mrad,
    );
}

fn heading(entry: &Catalogue) {
    println!(
        "size {}: secants K1 K2 K3, 1e4 N·m/rad (catalogue {:?});",
        entry.size,
        entry.k_n_m_per_rad.map(|k| 1e-4 * k)
    );
    println!("  K1:K2:1; missing, %; flanks in contact, % of the teeth; peak over mean along the face and share of it");
    println!("  that bears, at T1 T2 rated; load of half the balls without load, N; tilt of what bears, rated, mrad");
}

/// Everything at once, the teeth leaning with the cup.
fn cone(entry: &Catalogue) -> Result<(), Box<dyn std::error::Error>> {
    let guess = GUESS;
    let [_, cup] = plane_and_cup(entry, &guess)?;
    let (loads, rated) = (entry.loads_n_m, entry.loads_n_m[2]);
    let ball_n = loaded(&cup, &loads)?.ball_n;
    let crowning_um = 1e3 * guess.crowning * cup.flexspline.module_mm;
    let tell = |what: &str, drive: Option<Drive>| -> Result<Loaded, Box<dyn std::error::Error>> {
        let Some(drive) = drive else {
            println!("  {what}: binds with {:.0} µm of clearance", -PRELOAD_RANGE_UM[0]);
            return Ok(Loaded::default());
        };
        let found = loaded_on_balls(&drive, &guess, ball_n, loads)?;
        line(&format!("{what}, {:+.1} µm", drive.flanks.preload_um), entry, &found);
        Ok(found)
    };
    let free = |drive: &Drive, deeper_um: f64| free_of_play(&on_balls(drive, &guess, ball_n[0]), deeper_um);
    heading(entry);
    for (name, teeth) in [("involutes", cup.clone()), ("S-shaped", cup.clone().with_s_teeth(0.0))] {
        let even = tell(&format!("{name}, even"), free(&teeth, 0.0)?)?;
        tell(&format!("{name}, straight, as drawn"), Some(leaning(&teeth, 0.0, 0.0)?))?;
        let crowned = leaning(&teeth, 0.0, crowning_um)?;
        for deeper_um in DEEPER_UM {
            let Some(drive) = free(&crowned, deeper_um)? else { continue };
            let [looped, turning] = [loop_arcsec(&drive, rated, 0.0)?, turning_n_m(&drive)?];
            tell(&format!("{name}, crowned {crowning_um:.0} µm"), Some(drive))?;
            println!("    flank friction {FRICTION}: loop {looped:.2}″; the generator turns with {turning:.4} N·m");
        }
        let taper_mrad = even.bearing_tilt_mrad;
        let tapered = free(&leaning(&teeth, taper_mrad, crowning_um)?, 0.0)?;
        tell(&format!("{name}, crowned, tapered {taper_mrad:.1} mrad"), tapered)?;
    }
    Ok(())
}

/// One guess changed at a time.
fn map(entry: &Catalogue) -> Result<(), Box<dyn std::error::Error>> {
    heading(entry);
    for (what, guess) in [
        ("as guessed", GUESS),
        ("wall 0.7 times", Guess { wall: 0.7 * GUESS.wall, ..GUESS }),
        ("wall 0.5 times", Guess { wall: 0.5 * GUESS.wall, ..GUESS }),
        ("cup 0.8 times as long", Guess { length: 0.8 * GUESS.length, ..GUESS }),
        ("cup 1.6 times as long", Guess { length: 1.6 * GUESS.length, ..GUESS }),
        ("17 balls", Guess { balls: 17, ..GUESS }),
        ("balls 0.8 times", Guess { ball: 0.8, ..GUESS }),
        ("balls 1.2 times", Guess { ball: 1.2, ..GUESS }),
        ("face 0.7 times", Guess { width: 0.7, ..GUESS }),
        ("face 0.5 times", Guess { width: 0.5, ..GUESS }),
        ("crowned 0.06 modules", Guess { crowning: 0.06, ..GUESS }),
        ("crowned 0.15 modules", Guess { crowning: 0.15, ..GUESS }),
        ("3 µm deeper", Guess { deeper_um: 3.0, ..GUESS }),
    ] {
        let [_, cup] = plane_and_cup(entry, &guess)?;
        let ball_n =
            loaded(&cup, &entry.loads_n_m)?.ball_n.map(|n| n * f64::from(GUESS.balls) / f64::from(guess.balls));
        let crowned = leaning(&cup.clone().with_s_teeth(0.0), 0.0, 1e3 * guess.crowning * cup.flexspline.module_mm)?;
        let Some(drive) = free_of_play(&on_balls(&crowned, &guess, ball_n[0]), guess.deeper_um)? else { continue };
        line(what, entry, &loaded_on_balls(&drive, &guess, ball_n, entry.loads_n_m)?);
    }
    Ok(())
}

fn budget(entry: &Catalogue) -> Result<(), Box<dyn std::error::Error>> {
    let [plane, cup] = plane_and_cup(entry, &GUESS)?;
    let pitch_mm = 2.54 * f64::from(entry.size);
    let bore_mm = 2.0 * plane.flexspline.bore_radius_mm();
    let alone = loaded(&plane, &entry.loads_n_m)?;
    let in_cup = loaded(&cup, &entry.loads_n_m)?;
    let with_balls = loaded_on_balls(&cup, &GUESS, in_cup.ball_n, entry.loads_n_m)?.k;
    // S-shaped teeth in the same cup, on balls as stiff as they are in the lowest range.
    let s_shaped = |preload_um: f64, load_n: f64| on_balls(&cup.clone().with_s_teeth(preload_um), &GUESS, load_n);
    let preloaded = loaded_on_balls(&cup.clone().with_s_teeth(PRELOADS_UM[0]), &GUESS, in_cup.ball_n, entry.loads_n_m)?;
    let (with_s, contacts) = (preloaded.k, preloaded.share_in_contact);

    println!(
        "size {}, i = 100: 200 teeth, module {:.4} mm, cup {:.1} x {:.2} mm (guess)",
        entry.size,
        plane.flexspline.module_mm,
        GUESS.length * pitch_mm,
        GUESS.wall * pitch_mm
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
    let mut asked: Vec<String> = std::env::args().skip(1).collect();
    let work = match asked.first().map(String::as_str) {
        Some("cone") => cone,
        Some("map") => map,
        _ => budget,
    };
    if asked.first().is_some_and(|word| ["cone", "map"].contains(&word.as_str())) {
        asked.remove(0);
    }
    let known: Vec<String> = CATALOGUE.iter().map(|entry| entry.size.to_string()).collect();
    if let Some(wrong) = asked.iter().find(|size| !known.contains(size)) {
        eprintln!("catalogue_budget [cone | map] [SIZE …]: found {wrong}, allowed: {}", known.join(", "));
        return ExitCode::from(2);
    }
    for entry in CATALOGUE.iter().filter(|entry| asked.is_empty() || asked.contains(&entry.size.to_string())) {
        if let Err(error) = work(entry) {
            eprintln!("size {}: {error}", entry.size);
            return ExitCode::from(1);
        }
    }
    ExitCode::SUCCESS
}
