//! The figures that a catalogue prints of a drive, by contact FEM: backlash, stiffness in three ranges of torque, lost
//! motion, transmission error, stresses.
//!
//! The generator is held at angle 0, without load, and the output is loaded step by step to [`Loads::largest_n_m`];
//! then the drive turns on by a tooth pitch under that load. Stiffness is defined as in catalogues (Harmonic Drive,
//! CSF/CSG, "torsional stiffness"): K1 from the first contact to T1, K2 from T1 to T2, K3 above T2, secants of the
//! torsion of the output. The clearance of the teeth is no part of it. An ideal drive is its own mirror image and is
//! loaded one way; any other is loaded both ways where the clearance counts.

use flexspline::{Direction, GeneratorAngle, Table};
use serde::Serialize;

use crate::cautions::{LookedAt, rigid_gap_um, room_as_built_arcsec};
use crate::pitch_wave::peak_to_peak;
use crate::simulate::{TipContact, judged_fillet_mpa, peak_stress};
use flexspline_base::robust::least_and_most;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{Drive, GeneratorKind, Generators};
use flexspline_mechanics::motion::Motion;
use flexspline_mechanics::stepping::{Problem, SolveError, SolverSettings};

/// T1 and T2 over the largest load: of a CSF-25-100 they are 14 and 48 of 67 N·m.
const RANGES: [f64; 2] = [0.21, 0.72];
/// Share of the largest load, either way, between which lost motion is stated (Harmonic Drive AG, glossary, "lost
/// motion").
const LOST_MOTION_SHARE: f64 = 0.04;
/// A light touch, over the largest load: it closes the clearance and winds nothing up.
const TOUCH_SHARE: f64 = 2e-4;
/// An ideal drive whose output stands further than this (rad) from the middle when deformed has teeth that bind: it
/// went to one side.
const TO_ONE_SIDE_RAD: f64 = 1e-8;
/// A touch overcomes the drag of the output by this factor.
const TOUCH_OVER_DRAG: f64 = 2.0;

/// The torques at which a sheet states stiffness, N·m, all positive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Loads {
    /// End of the first range of stiffness.
    pub t1_n_m: f64,
    /// End of the second.
    pub t2_n_m: f64,
    /// End of the third: the rated load.
    pub largest_n_m: f64,
}

impl Loads {
    /// T1 and T2 where a catalogue has them for this rated load.
    pub fn up_to(largest_n_m: f64) -> Loads {
        let [t1_n_m, t2_n_m] = RANGES.map(|share| share * largest_n_m);
        Loads { t1_n_m, t2_n_m, largest_n_m }
    }
}

/// Torsional stiffness in the three ranges of torque, N·m/rad: secants of the output's torsion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stiffness {
    /// Where the ranges end.
    #[serde(flatten)]
    pub loads: Loads,
    /// From first contact to T1.
    pub k1_n_m_per_rad: f64,
    /// From T1 to T2.
    pub k2_n_m_per_rad: f64,
    /// Above T2.
    pub k3_n_m_per_rad: f64,
}

impl Stiffness {
    /// That of a table of `drive`, forward loads up to the table's largest, at reference temperature, in the middle
    /// between both directions of motion; none where the table does not reach beyond the drag.
    pub fn of_table(drive: &Drive, table: &Table<'_>) -> Option<Stiffness> {
        let largest_n_m = f64::from(table.torque_nodes_n_m().last()?);
        let loads = Loads::up_to(largest_n_m);
        let touch = touch_n_m(drive, loads);
        let torsion = |torque: f64| torsion_rad(drive, table, torque);
        let secant = |from: f64, to: f64| Some((to - from) / (torsion(to)? - torsion(from)?)).filter(|k| k.is_finite());
        (touch < loads.t1_n_m).then_some(())?;
        Some(Stiffness {
            loads,
            k1_n_m_per_rad: secant(touch, loads.t1_n_m)?,
            k2_n_m_per_rad: secant(loads.t1_n_m, loads.t2_n_m)?,
            k3_n_m_per_rad: secant(loads.t2_n_m, largest_n_m)?,
        })
    }
}

/// Torsion of the output by a table at reference temperature, rad: in the middle between both directions of motion.
pub(crate) fn torsion_rad(drive: &Drive, table: &Table<'_>, torque_n_m: f64) -> Option<f64> {
    let [forward, backward] = either_way_rad(drive, table, torque_n_m)?;
    Some(0.5 * (forward + backward))
}

/// Error by a table at reference temperature in forward and in backward motion, rad.
pub(crate) fn either_way_rad(drive: &Drive, table: &Table<'_>, torque_n_m: f64) -> Option<[f64; 2]> {
    let temperature = drive.temperature.reference_c as f32;
    let at = |direction| table.steady_error_rad(GeneratorAngle::default(), torque_n_m as f32, temperature, direction);
    Some([at(Direction::Forward)?, at(Direction::Backward)?].map(f64::from))
}

/// A part of the wind-up of the output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WindUpPart {
    /// Which.
    pub part: &'static str,
    /// The wind-up that it adds, arcsec; positive: the output turns forward.
    pub arcsec: f64,
    /// Of all of it.
    pub percent: f64,
}

/// What to know of a wind-up that is empirical in part.
pub fn empirical_in_words(wind_up_arcsec: f64, torque_n_m: f64, percent: f64) -> String {
    format!(
        "of the wind-up of {wind_up_arcsec:.1} arcsec at {torque_n_m} N·m {percent:.0} % are empirical \
         (output.contact_compliance), not FEM"
    )
}

/// The wind-up of a drive at rest from first contact to a load, part by part: teeth and rim alone; what sleeve and
/// balls add, in this order; and the empirical part ([`Drive::contact_wind_up_rad`]).
///
/// # Errors
/// No equilibrium, of the drive or of one without a part.
pub fn wind_up_parts(
    drive: &Drive,
    kind: GeneratorKind,
    temperature_c: f64,
    torque_n_m: f64,
    settings: SolverSettings,
) -> Result<Vec<WindUpPart>, SolveError> {
    let no_balls =
        Drive { generator: Generators { bearing_stiffness_n_per_mm3: None, ..drive.generator }, ..drive.clone() };
    let bare = Drive { sleeve: Drive::hhd_95_plane().sleeve, ..no_balls.clone() };
    let touch = touch_n_m(drive, Loads::up_to(torque_n_m.abs())).copysign(torque_n_m);
    let wind_up = |drive: &Drive| -> Result<[f64; 2], SolveError> {
        let problem = Problem::new(drive, kind, temperature_c, settings)?;
        let mut motion = Motion::deformed_or_turned_in(&problem, 0.0)?;
        let at = [touch, torque_n_m].map(|torque| motion.load(torque).map(|()| motion.error_rad()));
        let [touched, loaded] = at;
        let beside_fem = |torque| problem.drive.contact_wind_up_rad(torque);
        let empirical = beside_fem(torque_n_m) - beside_fem(touch);
        Ok([loaded? - touched? - empirical, empirical])
    };
    let (teeth, (cup, balls)) =
        rayon::join(|| wind_up(&bare), || rayon::join(|| wind_up(&no_balls), || wind_up(drive)));
    let ([teeth, _], [cup, _], [balls, empirical]) = (teeth?, cup?, balls?);
    let whole = balls + empirical;
    let parts = [
        ("teeth and rim", teeth),
        ("cup or sleeve", cup - teeth),
        ("balls", balls - cup),
        ("empirical part", empirical),
    ];
    let of = |(part, rad): (&'static str, f64)| WindUpPart {
        part,
        arcsec: rad * ARCSEC_PER_RAD,
        percent: 100.0 * rad / whole,
    };
    Ok(parts.map(of).to_vec())
}

/// A light touch, N·m.
pub(crate) fn touch_n_m(drive: &Drive, loads: Loads) -> f64 {
    (TOUCH_SHARE * loads.largest_n_m).max(TOUCH_OVER_DRAG * drive.output.drag_torque_n_m)
}

/// Values of a catalogue. A figure is missing where the drive was not brought so far.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct DataSheet {
    /// Least gap between the rigid teeth of the drawing over a mesh cycle, µm; negative where they interfere. Missing
    /// where they never meet.
    pub rigid_gap_um: Option<f64>,
    /// Free rotation of the output with rigid teeth as built, at the tightest place of its turn, arcsec; missing of a
    /// drive as drawn.
    pub room_as_built_arcsec: Option<f64>,
    /// Turn of the output between light touches either way, arcsec.
    pub backlash_arcsec: Option<f64>,
    /// Turn of the output between 4 % of the largest load either way, arcsec; the clearance is part of it.
    pub lost_motion_arcsec: Option<f64>,
    /// Stiffness from first contact to T1, N·m/rad.
    pub k1_n_m_per_rad: Option<f64>,
    /// Stiffness from T1 to T2, N·m/rad.
    pub k2_n_m_per_rad: Option<f64>,
    /// Stiffness above T2, N·m/rad.
    pub k3_n_m_per_rad: Option<f64>,
    /// Turn of the output from first contact to the largest load, arcsec.
    pub wind_up_arcsec: Option<f64>,
    /// Kinematic error over a tooth pitch under the largest load, peak to peak, arcsec: of the wave through the
    /// positions, of a drive that repeats with the pitch.
    pub kinematic_error_pp_arcsec: Option<f64>,
    /// Largest von Mises stress under the largest load, MPa: a nodal value, which grows with the mesh at roots and
    /// contacts.
    pub max_von_mises_mpa: Option<f64>,
    /// Largest von Mises stress in the root fillets of the flexspline, MPa, by the strain of their surface, as cautions
    /// judge it: `simulate --stress` says what it tends to with the mesh.
    pub root_fillet_mpa: Option<f64>,
    /// The same on the mesh of the run, and as cautions judge it.
    #[serde(skip)]
    pub judged_fillet_mpa: Option<[f64; 2]>,
    /// The largest on the bore, MPa, nodal.
    pub bore_mpa: Option<f64>,
    /// Largest pressure between flanks, MPa.
    pub peak_flank_pressure_mpa: Option<f64>,
    /// Largest pressure between generator and bore, MPa.
    pub peak_generator_pressure_mpa: Option<f64>,
    /// Largest force of the generator along its major axis on one half of the rim, outward, N.
    pub lobe_force_n: Option<f64>,
    /// Largest tilt of a tooth along its face, outward, mrad: the coning of the rim in its sleeve.
    pub tilt_mrad: Option<f64>,
    /// Load along the face of the flank that bears most anywhere: peak over mean.
    pub load_across_face_peak_over_mean: Option<f64>,
    /// Teeth of the flexspline that carry the largest load, percent.
    pub teeth_in_contact_percent: Option<f64>,
    /// Share of the largest load that bears on tips outside the main zones, percent, at the worst position: 0 of a
    /// sound drive.
    pub tips_bear_percent: Option<f64>,
    /// Largest load at which equilibrium was found, N·m.
    pub last_stable_n_m: Option<f64>,
    /// Contact at the tips; missing where there is none.
    #[serde(skip)]
    pub tip_contact: Option<TipContact>,
}

impl DataSheet {
    /// What cautions look at.
    pub fn looked(&self) -> LookedAt {
        LookedAt {
            rigid_gap_um: self.rigid_gap_um,
            room_as_built_arcsec: self.room_as_built_arcsec,
            max_von_mises_mpa: self.max_von_mises_mpa,
            root_fillet_mpa: self.judged_fillet_mpa,
            peak_flank_pressure_mpa: self.peak_flank_pressure_mpa,
            tip_contact: self.tip_contact,
            slope_bound: None,
        }
    }
}

/// A figure by name.
pub type FigureOf = (&'static str, fn(&DataSheet) -> Option<f64>);

/// The figures that can be asked for by name, as the fields are called.
pub const FIGURES: [FigureOf; 20] = [
    ("rigid_gap_um", |s| s.rigid_gap_um),
    ("room_as_built_arcsec", |s| s.room_as_built_arcsec),
    ("backlash_arcsec", |s| s.backlash_arcsec),
    ("lost_motion_arcsec", |s| s.lost_motion_arcsec),
    ("k1_n_m_per_rad", |s| s.k1_n_m_per_rad),
    ("k2_n_m_per_rad", |s| s.k2_n_m_per_rad),
    ("k3_n_m_per_rad", |s| s.k3_n_m_per_rad),
    ("wind_up_arcsec", |s| s.wind_up_arcsec),
    ("kinematic_error_pp_arcsec", |s| s.kinematic_error_pp_arcsec),
    ("max_von_mises_mpa", |s| s.max_von_mises_mpa),
    ("root_fillet_mpa", |s| s.root_fillet_mpa),
    ("bore_mpa", |s| s.bore_mpa),
    ("peak_flank_pressure_mpa", |s| s.peak_flank_pressure_mpa),
    ("peak_generator_pressure_mpa", |s| s.peak_generator_pressure_mpa),
    ("lobe_force_n", |s| s.lobe_force_n),
    ("tilt_mrad", |s| s.tilt_mrad),
    ("load_across_face_peak_over_mean", |s| s.load_across_face_peak_over_mean),
    ("teeth_in_contact_percent", |s| s.teeth_in_contact_percent),
    ("tips_bear_percent", |s| s.tips_bear_percent),
    ("last_stable_n_m", |s| s.last_stable_n_m),
];

/// The sheet of a drive with one generator at a temperature. `positions` over the tooth pitch, 4 or more.
///
/// Where no equilibrium is found the sheet has what was found until then, and the error says where it ended.
pub fn data_sheet(
    drive: &Drive,
    kind: GeneratorKind,
    temperature_c: f64,
    loads: Loads,
    positions: usize,
    settings: SolverSettings,
) -> (DataSheet, Result<(), SolveError>) {
    let mut sheet = DataSheet {
        rigid_gap_um: rigid_gap_um(drive, kind),
        room_as_built_arcsec: room_as_built_arcsec(drive, kind),
        ..DataSheet::default()
    };
    let done = Problem::new(drive, kind, temperature_c, settings)
        .and_then(|problem| fill(&mut sheet, &problem, loads, positions));
    if let (Err(SolveError::NotConverged { reached_n_m, .. }), Some(last)) = (&done, &mut sheet.last_stable_n_m) {
        *last = last.max(*reached_n_m);
    }
    // It was found whole pitches away from angle 0.
    let at = (0.0, loads.largest_n_m);
    sheet.judged_fillet_mpa =
        sheet.root_fillet_mpa.map(|by_run| judged_fillet_mpa(drive, kind, temperature_c, at, settings, by_run));
    sheet.root_fillet_mpa = sheet.judged_fillet_mpa.map(|[_, judged]| judged);
    (sheet, done)
}

fn fill(sheet: &mut DataSheet, problem: &Problem, loads: Loads, positions: usize) -> Result<(), SolveError> {
    let drive = &problem.drive;
    let mut motion = Motion::deformed_or_turned_in(problem, 0.0)?;
    sheet.last_stable_n_m = Some(0.0);
    let unloaded = motion.state().clone();
    let touch = touch_n_m(drive, loads);
    let lightly = (LOST_MOTION_SHARE * loads.largest_n_m).max(touch);

    let mirrored = drive.as_built.first_not_uniform().is_none() && motion.error_rad().abs() < TO_ONE_SIDE_RAD;
    let backward = if mirrored {
        None
    } else {
        motion.load(-touch)?;
        let touched = motion.error_rad();
        motion.load(-lightly)?;
        let loaded = motion.error_rad();
        motion.go_back(unloaded);
        Some([touched, loaded])
    };

    motion.load(touch)?;
    let touched = motion.error_rad();
    motion.load(lightly)?;
    let loaded = motion.error_rad();
    let [back_touched, back_loaded] = backward.unwrap_or([-touched, -loaded]);
    sheet.backlash_arcsec = Some((touched - back_touched) * ARCSEC_PER_RAD);
    sheet.lost_motion_arcsec = Some((loaded - back_loaded) * ARCSEC_PER_RAD);
    sheet.last_stable_n_m = Some(lightly);

    let mut from = (touch, touched);
    let ranges = [
        (loads.t1_n_m, &mut sheet.k1_n_m_per_rad),
        (loads.t2_n_m, &mut sheet.k2_n_m_per_rad),
        (loads.largest_n_m, &mut sheet.k3_n_m_per_rad),
    ];
    for (torque, stiffness) in ranges {
        motion.load(torque)?;
        let to = (torque, motion.error_rad());
        *stiffness = Some((to.0 - from.0) / (to.1 - from.1));
        sheet.last_stable_n_m = Some(torque);
        from = to;
    }
    sheet.wind_up_arcsec = Some((from.1 - touched) * ARCSEC_PER_RAD);

    motion.settle(motion.pitch() / positions as f64)?;
    let mut tips = Vec::new();
    let start = motion.state().generator_rad;
    let mut places = Vec::with_capacity(positions);
    for k in 1..=positions {
        motion.turn_to(start + motion.pitch() * k as f64 / positions as f64)?;
        places.push(motion.place());
        tips.extend(TipContact::at(problem, motion.state()));
    }
    sheet.tips_bear_percent = Some(100.0 * tips.iter().map(|tips| tips.share).fold(0.0, f64::max));
    sheet.tip_contact = TipContact::worst(tips.into_iter());
    let errors: Vec<f64> = places.iter().map(|place| place.error_arcsec).collect();
    let most = |of: fn(&flexspline_mechanics::stepping::Increment) -> f64| {
        places.iter().map(|place| of(&place.increment)).fold(0.0, f64::max)
    };
    sheet.kinematic_error_pp_arcsec = Some(if drive.as_built.first_not_uniform().is_none() {
        peak_to_peak(&errors)
    } else {
        let (low, high) = least_and_most(errors);
        high - low
    });
    sheet.peak_flank_pressure_mpa = Some(most(|increment| increment.peak_pressure_mpa[0]));
    sheet.peak_generator_pressure_mpa = Some(most(|increment| increment.peak_pressure_mpa[1]));
    sheet.lobe_force_n = Some(most(|increment| increment.lobe_force_n));
    sheet.tilt_mrad = Some(most(|increment| 1e3 * increment.face.tilt_rad));
    sheet.load_across_face_peak_over_mean = Some(most(|increment| increment.face.peak_over_mean));
    let in_contact = most(|increment| increment.flank_contacts as f64);
    sheet.teeth_in_contact_percent = Some(100.0 * in_contact / f64::from(drive.flexspline.teeth));
    let peak = peak_stress(problem, motion.state());
    let [root_fillet, bore, _] = peak.by_place_mpa;
    sheet.max_von_mises_mpa = Some(peak.von_mises_mpa);
    (sheet.root_fillet_mpa, sheet.bore_mpa) = (Some(root_fillet), Some(bore));
    Ok(())
}
