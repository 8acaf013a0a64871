//! Cautions on figures that converged as well as any: that they are not to be built, or not to be
//! believed.
//!
//! The model is elastic and plane and does not mind teeth that interfere on the drawing, steel that yields, or an error
//! so steep that no command undoes it. Each of these is one [`Caution`], with the value found and its limit.

use serde::Serialize;

use crate::catalogue::UNIT_SCATTER_PERCENT;
use crate::simulate::zones::MOST_TIP_SHARE;
use crate::simulate::{PlaceStress, TipContact};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{Drive, GeneratorKind, RigidMesh, SleeveKind};

/// Von Mises stress above which steel of a flexspline yields, MPa. A guess in the middle: quenched and tempered
/// nickel-chromium-molybdenum steels (34CrNiMo6, EN 10083-3: 900 to 1000 MPa of yield strength in thin sections;
/// precipitation-hardened ones have more).
pub(crate) const YIELD_MPA: f64 = 1000.0;
/// Pressure between flanks that no steel bears for long, MPa. A guess below what ISO 76 allows once of rolling bearings
/// (4000 to 4600 MPa).
pub(crate) const MOST_FLANK_PRESSURE_MPA: f64 = 3000.0;
/// Slope of the error over the generator's motion from which on the inverse is in doubt; at 1 there is none. A guess:
/// half way.
pub(crate) const MOST_SLOPE: f64 = 0.5;

/// Room of rigid teeth as built, arcsec, below which they wedge more than rim and sleeve give way. A guess: three times
/// what `HHD-95-typical` lacks (94 arcsec), whose teeth bear it at 1150 MPa.
pub(crate) const LEAST_ROOM_ARCSEC: f64 = -300.0;

/// One thing to know before figures are used.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Caution {
    /// Which figure.
    pub figure: &'static str,
    /// Its value.
    pub value: f64,
    /// Where caution begins.
    pub limit: f64,
    /// Meaning, in words.
    pub words: String,
}

/// Stress and pressure this many times above where caution begins are none of any steel: 3000 and 9000 MPa. A guess:
/// the strongest maraging steels break at 2400 MPa (18Ni-350), and 9000 MPa indents bearing steel, whose hardness of
/// 700 HV is 7000 MPa.
const BEYOND_STEEL: f64 = 3.0;

/// A load is beyond what drives bear from this many times the rated one on. A guess: a catalogue's momentary peak is
/// three to five times the rated torque.
const MOST_OF_RATED: f64 = 5.0;

/// Ratios at which catalogues bear out FEM, cup, balls and [`Drive::CATALOGUE_CONTACT`] within 19 %: measured at 50,
/// 80, 100 and 120. At 160 K1 is up to 28 % too stiff; on a line from the 17 % of 120 it leaves these 19 % near 130.
const BORNE_OUT_RATIOS: [f64; 2] = [50.0, 130.0];
/// Pitch diameter of the least size that they bear out, 17, mm, less rounding.
const LEAST_BORNE_OUT_MM: f64 = 43.0;
/// How many times stiffer than cups that are sold FEM is, least and most of K1 to K3, without cup (1), balls (2) and
/// the compliance that catalogues have beside them (4). Measured of `new --like CSF-25-50` and `CSF-25-100`.
const TIMES_STIFFER: [[f64; 2]; 8] =
    [[0.8, 1.2], [1.1, 1.2], [1.2, 1.5], [1.4, 1.8], [1.5, 2.7], [2.2, 3.0], [2.4, 4.8], [5.0, 8.0]];

impl Caution {
    /// Whether a drive or a load with this caution is none of which anybody wants a table: teeth that bind on the
    /// drawing, tips that clash, forces that no steel bears.
    pub fn rules_out_tables(&self) -> bool {
        // Of a root fillet one mesh may have three times what finer ones end at.
        let is_of_strength = [NODAL, OVER_MESHES, FLANK_PRESSURE].contains(&self.figure);
        let is_beyond = self.value.is_nan() || self.value > BEYOND_STEEL * self.limit;
        [RIGID_GAP, TIP_CONTACT].contains(&self.figure) || is_of_strength && is_beyond
    }

    /// That a load is far beyond the rated one, or above that at which teeth skip, where a data sheet has it.
    pub fn of_load(load_n_m: f64, rated_n_m: f64, ratcheting_n_m: Option<f64>) -> Option<Caution> {
        let (load, value) = (load_n_m.abs(), load_n_m.abs() / rated_n_m);
        let skips = ratcheting_n_m.filter(|least| load > *least);
        let above = skips.map_or_else(String::new, |least| {
            format!(
                ", above the ratcheting torque of the data sheet ({least} N·m): the teeth of such a drive have skipped"
            )
        });
        (skips.is_some() || value > MOST_OF_RATED).then(|| Caution {
            figure: "load",
            value,
            limit: skips.map_or(MOST_OF_RATED, |least| least / rated_n_m),
            words: format!("the load of {load} N·m is {value:.1} times the rated torque of {rated_n_m} N·m{above}"),
        })
    }

    /// That the stiffness is not that of cups that are sold, and by how much, as measured of the sizes of a catalogue
    /// (`tests/evidence catalogue`). Nothing where the sleeve is another, or its compliance is stated.
    pub fn of_stiffness(drive: &Drive) -> Option<Caution> {
        let sleeve = &drive.sleeve;
        if sleeve.kind == SleeveKind::Hermetic || sleeve.torsion_stiffness_n_m_per_rad.is_some() {
            return None;
        }
        let (ratio, pitch_mm) = (drive.ratio() - 1.0, 2.0 * drive.flexspline.pitch_radius_mm());
        let kappa = drive.output.contact_compliance / Drive::CATALOGUE_CONTACT;
        let balls = drive.generator.bearing_stiffness_n_per_mm3.is_some();
        let parts = [("cup", sleeve.is_shell()), ("balls", balls), ("contact_compliance", kappa > 0.5)];
        let lacking: Vec<&str> = parts.iter().filter(|(_, there)| !there).map(|(part, _)| *part).collect();
        let [least, most] = TIMES_STIFFER[(0..3).map(|k| usize::from(!parts[k].1) << k).sum::<usize>()];
        let [low, high] = BORNE_OUT_RATIOS;
        let stiff = format!("without {} this drive is {least} to {most}", lacking.join(", "));
        let soft = "at 30 cups that are sold are another 1.7 to 4 times softer";
        let too_stiff = "with contact_compliance K1 is 21 to 28 % too stiff at i = 160, and nothing is known beyond";
        let small = "at sizes 11 and 14 K1 to K3 are 0.76 to 1.46 times those of cups that are sold";
        let all = [
            (most, 1.0 + 1e-2 * UNIT_SCATTER_PERCENT, stiff + " times stiffer than cups that are sold"),
            (kappa, 2.0, format!("contact_compliance is {kappa:.1} times that of catalogues")),
            (-ratio, -low, format!("i = {ratio:.0} is below {low}: {soft}")),
            (ratio, high, format!("i = {ratio:.0} is above {high}: {too_stiff}")),
            (-pitch_mm, -LEAST_BORNE_OUT_MM, format!("a pitch diameter of {pitch_mm:.1} mm: {small}")),
        ];
        let said: Vec<_> = all.into_iter().filter(|(value, limit, _)| value > limit).collect();
        let (value, limit) = said.first().map(|(value, limit, _)| (value.abs(), limit.abs()))?;
        let words = said.into_iter().map(|(.., words)| words).collect::<Vec<_>>().join("; ");
        Some(Caution { figure: "stiffness", value, limit, words })
    }
}

/// The figures that are looked at, those that are known.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LookedAt {
    /// Least gap of the rigid teeth of the drawing, µm.
    pub rigid_gap_um: Option<f64>,
    /// Free rotation of the output with rigid teeth as built, at the tightest place of its turn, arcsec; missing of a
    /// drive that is as drawn.
    pub room_as_built_arcsec: Option<f64>,
    /// Largest von Mises stress at a node, MPa.
    pub max_von_mises_mpa: Option<f64>,
    /// Largest von Mises stress in the root fillets by the strain of their surface, MPa: on the mesh of the run, and
    /// what judges it, of a finer one near the limit. In a fillet the nodal value of a mesh is too low, by a third and
    /// more; on bore and flanks it is all there is. So the larger of both is looked at.
    pub root_fillet_mpa: Option<[f64; 2]>,
    /// Largest pressure between flanks, MPa, as Hertz has it and the limit means it.
    pub peak_flank_pressure_mpa: Option<f64>,
    /// Contact of tips outside the main zones.
    pub tip_contact: Option<TipContact>,
    /// Bound of the slope of the error over the generator's motion.
    pub slope_bound: Option<f64>,
}

impl LookedAt {
    /// Cautions on these figures; none for a sound drive.
    pub fn cautions(&self) -> Vec<Caution> {
        let mut cautions = Vec::new();
        let (stress, place) = self.largest_stress();
        // `wrong` is the side of the limit that asks for caution: 1 above, -1 below. What is not a number is on either.
        let mut say = |figure, value: Option<f64>, wrong: f64, limit: f64, words: &dyn Fn(f64) -> String| {
            if let Some(value) = value.filter(|value| value.is_nan() || wrong * (value - limit) > 0.0) {
                cautions.push(Caution { figure, value, limit, words: words(value) });
            }
        };
        say(RIGID_GAP, self.rigid_gap_um, -1.0, -1e3 * RigidMesh::TOUCHES_MM, &|gap| {
            format!(
                "the teeth of the drawing interfere by {:.1} um when rigid: such a drive binds; drive --check says \
                 where",
                -gap
            )
        });
        say("room_as_built_arcsec", self.room_as_built_arcsec, -1.0, LEAST_ROOM_ARCSEC, &|room| {
            format!(
                "the teeth as built lack {:.0} arcsec of room at the tightest place of a turn, more than {} arcsec: \
                 rim and sleeve have to give way",
                -room, -LEAST_ROOM_ARCSEC
            )
        });
        say(place, stress, 1.0, YIELD_MPA, &|stress| match self.root_fillet_mpa {
            Some([one, judged]) if place == ROOT_FILLET => format!(
                "a root fillet has {one:.0} MPa on this mesh and {} on a finer one; {YIELD_MPA} MPa are where steel \
                 yields: simulate --stress judges it over three meshes",
                if one == judged { "no equilibrium".to_owned() } else { format!("{judged:.0}") }
            ),
            _ => above_yield(stress, ""),
        });
        say(FLANK_PRESSURE, self.peak_flank_pressure_mpa, 1.0, MOST_FLANK_PRESSURE_MPA, &|pressure| {
            format!(
                "a flank pressure of {pressure:.0} MPa is above {MOST_FLANK_PRESSURE_MPA} MPa, which no steel bears \
                 for long"
            )
        });
        say("slope_bound", self.slope_bound, 1.0, MOST_SLOPE, &|slope| {
            format!(
                "the error changes by up to {slope:.2} of the motion; from 1 on no command undoes it, from \
                 {MOST_SLOPE} on it is in doubt"
            )
        });
        // What makes the others what they are comes first.
        if let Some(tips) = self.tip_contact.filter(TipContact::counts) {
            let (value, words) = (tips.share, tips.in_words());
            cautions.insert(0, Caution { figure: TIP_CONTACT, value, limit: MOST_TIP_SHARE, words });
        }
        cautions
    }

    /// The larger of the two stresses, and the name of its figure. One that is not a number is the larger.
    fn largest_stress(&self) -> (Option<f64>, &'static str) {
        match (self.max_von_mises_mpa, self.root_fillet_mpa.map(|[_, judged]| judged)) {
            (Some(nodal), Some(fillet)) if nodal.is_nan() || fillet <= nodal => (Some(nodal), NODAL),
            (nodal, None) => (nodal, NODAL),
            (_, fillet) => (fillet, ROOT_FILLET),
        }
    }
}

/// Teeth of the drawing that interfere.
const RIGID_GAP: &str = "rigid_gap_um";
/// The figure of the pressure between flanks.
const FLANK_PRESSURE: &str = "peak_flank_pressure_mpa";
/// Tips that bear outside the mesh.
const TIP_CONTACT: &str = "tip_contact";
/// The figure of nodal stress.
const NODAL: &str = "max_von_mises_mpa";
/// The figure of stress by the strain of a surface.
const ROOT_FILLET: &str = "root_fillet_mpa";
/// The figure of stress over three meshes.
const OVER_MESHES: &str = "stress";

fn above_yield(stress_mpa: f64, place: &str) -> String {
    format!(
        "a stress of {stress_mpa:.0} MPa{place} is above {YIELD_MPA} MPa, where steel yields, which the model does \
         not do"
    )
}

/// Adds what is to be said of stress over three meshes, in the place of what one mesh says, which is worse known.
pub fn add_stress(cautions: &mut Vec<Caution>, stress: &[PlaceStress]) {
    let Some(worst) = stress.iter().max_by(|a, b| a.von_mises_mpa.total_cmp(&b.von_mises_mpa)) else { return };
    let value = worst.von_mises_mpa;
    if value.is_nan() || value > YIELD_MPA {
        cautions.retain(|caution| ![NODAL, ROOT_FILLET, OVER_MESHES].contains(&caution.figure));
        let place = format!(", {}, over three meshes", worst.place.in_words());
        cautions.push(Caution { figure: OVER_MESHES, value, limit: YIELD_MPA, words: above_yield(value, &place) });
    }
    let tired = stress.iter().filter_map(|of| of.fatigue).find(|fatigue| fatigue.safety < 1.0);
    cautions.extend(tired.map(|fatigue| {
        let words = format!("safety against fatigue {:.2} {}", fatigue.safety, fatigue.in_words().0);
        Caution { figure: "fatigue", value: fatigue.safety, limit: 1.0, words }
    }));
}

/// Least gap between the rigid teeth of the drawing over a mesh cycle, µm; negative where they interfere. Missing where
/// they never meet.
pub(crate) fn rigid_gap_um(drive: &Drive, kind: GeneratorKind) -> Option<f64> {
    let least = RigidMesh::new(drive, kind).ok()?.least()?;
    Some(1e3 * least.gap_mm)
}

/// Free rotation of the output of a drive as built, with rigid teeth, at the tightest place of its turn, arcsec;
/// negative where they bind. Missing of a drive that is as drawn: [`rigid_gap_um`] says all of it.
pub(crate) fn room_as_built_arcsec(drive: &Drive, kind: GeneratorKind) -> Option<f64> {
    drive.as_built.first_not_uniform()?;
    let room = RigidMesh::new(drive, kind).ok()?.room_as_built(drive, kind)?;
    Some(room.least_rad * ARCSEC_PER_RAD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::Place;
    use flexspline_mechanics::drive::FewNumbers;

    #[test]
    fn each_limit_is_said_and_nothing_within_them() {
        let sound = LookedAt {
            rigid_gap_um: Some(0.0),
            room_as_built_arcsec: Some(LEAST_ROOM_ARCSEC),
            max_von_mises_mpa: Some(YIELD_MPA),
            root_fillet_mpa: Some([YIELD_MPA; 2]),
            peak_flank_pressure_mpa: Some(MOST_FLANK_PRESSURE_MPA),
            tip_contact: None,
            slope_bound: Some(MOST_SLOPE),
        };
        assert_eq!(sound.cautions(), []);
        let figures =
            |looked: LookedAt| looked.cautions().into_iter().map(|caution| caution.figure).collect::<Vec<_>>();
        assert_eq!(figures(LookedAt { rigid_gap_um: Some(-0.11), ..sound }), ["rigid_gap_um"]);
        assert_eq!(figures(LookedAt { room_as_built_arcsec: Some(-301.0), ..sound }), ["room_as_built_arcsec"]);
        assert_eq!(figures(LookedAt { max_von_mises_mpa: Some(f64::NAN), ..sound }), ["max_von_mises_mpa"]);
        assert_eq!(figures(LookedAt { peak_flank_pressure_mpa: Some(3001.0), ..sound }), ["peak_flank_pressure_mpa"]);
        assert_eq!(figures(LookedAt { slope_bound: Some(0.6), ..sound }), ["slope_bound"]);
        let load = |load, sheet| Caution::of_load(load, 82.0, sheet).map(|caution| (caution.value, caution.words));
        assert_eq!((load(-400.0, None), load(82.0, Some(880.0))), (None, None));
        assert!(load(-820.0, Some(880.0)).is_some_and(|(times, words)| times == 10.0 && !words.contains("ratchet")));
        let (_, words) = load(8200.0, Some(880.0)).unwrap();
        assert!(words.contains("100.0 times the rated torque of 82 N·m, above the ratcheting torque"), "{words}");
        // What yields a little has a table yet; what binds, or what no steel bears, has none.
        let none = |looked: LookedAt| looked.cautions().iter().any(Caution::rules_out_tables);
        assert!(none(LookedAt { rigid_gap_um: Some(-0.11), ..sound }));
        for (pressure, rules_out) in [(3001.0, false), (44_275.0, true), (f64::NAN, true)] {
            assert_eq!(none(LookedAt { peak_flank_pressure_mpa: Some(pressure), ..sound }), rules_out, "{pressure}");
        }
        assert!(!none(LookedAt { max_von_mises_mpa: Some(1150.0), slope_bound: Some(0.9), ..sound }));
        assert!(!none(LookedAt { root_fillet_mpa: Some([3205.0; 2]), ..sound }));
    }

    /// Where catalogues bear the stiffness out nothing is said; elsewhere what it is off by.
    #[test]
    fn stiffness_that_no_catalogue_bears_out_is_said() {
        let few = |teeth: u32, pitch_mm: f64| {
            let module_mm = pitch_mm / f64::from(teeth);
            let few = FewNumbers { teeth, module_mm, bore_mm: None, generator: GeneratorKind::Cam };
            few.drive("d").unwrap().drive
        };
        let cup = |drive: &Drive| {
            let mut drive = Drive { sleeve: Drive::cup_95().sleeve, ..drive.clone() };
            drive.generator.bearing_stiffness_n_per_mm3 = Some(200.0);
            drive.output.contact_compliance = Drive::CATALOGUE_CONTACT;
            drive
        };
        let said = |drive: &Drive| Caution::of_stiffness(drive).map_or_else(String::new, |of| of.words);
        let plane = few(200, 60.0);
        assert!(said(&plane).contains("5 to 8 times stiffer than cups that are sold"));
        assert_eq!(said(&cup(&plane)), "");
        for (set, words) in [
            ("output.contact_compliance=0", "without contact_compliance this drive is 1.5 to 2.7 times stiffer"),
            ("generator.bearing_stiffness_n_per_mm3=rigid", "without balls this drive is 1.2 to 1.5"),
            ("output.contact_compliance=100", "contact_compliance is 17.2 times"),
            ("sleeve.kind=none", ""),
        ] {
            assert!(said(&cup(&plane).with_set(set).unwrap()).starts_with(words), "{words}");
        }
        assert!(said(&few(60, 60.0)).contains("cups that are sold; i = 30 is below 50"));
        for (teeth, pitch_mm, words) in [
            (60, 60.0, "i = 30 is below 50: at 30"),
            (400, 60.0, "i = 200 is above 130"),
            (200, 35.6, "35.6 mm: at sizes 11 and 14"),
        ] {
            assert!(said(&cup(&few(teeth, pitch_mm))).contains(words), "{words}");
        }
    }

    /// A nodal value of 664 MPa beside 1204 in a root fillet: the larger is reported, once, under its name.
    #[test]
    fn stress_is_judged_by_the_larger_of_nodal_and_root_fillet() {
        let reported = |nodal, fillet: Option<f64>| {
            let root_fillet_mpa = fillet.map(|judged| [1777.0, judged]);
            let looked = LookedAt { max_von_mises_mpa: nodal, root_fillet_mpa, ..LookedAt::default() };
            looked.cautions().into_iter().map(|caution| (caution.figure, caution.value)).collect::<Vec<_>>()
        };
        assert_eq!(reported(Some(664.0), Some(1204.0)), [("root_fillet_mpa", 1204.0)]);
        assert_eq!(reported(Some(1300.0), Some(1204.0)), [("max_von_mises_mpa", 1300.0)]);
        assert_eq!(reported(Some(1300.0), None), [("max_von_mises_mpa", 1300.0)]);
        assert_eq!(reported(None, Some(1204.0)), [("root_fillet_mpa", 1204.0)]);
        assert_eq!(reported(Some(664.0), Some(900.0)), []);
        assert_eq!(reported(Some(664.0), Some(f64::NAN)).len(), 1);
        assert_eq!(reported(Some(f64::NAN), Some(900.0)).len(), 1);
    }

    #[test]
    fn stress_over_three_meshes_takes_the_place_of_that_of_one() {
        let at = |place, von_mises_mpa| PlaceStress {
            place,
            von_mises_mpa,
            interval_mpa: [0.97 * von_mises_mpa, 1.03 * von_mises_mpa],
            by_mesh_mpa: [von_mises_mpa; 3],
            tooth: 0,
            fatigue: None,
        };
        let mut cautions =
            LookedAt { root_fillet_mpa: Some([1010.0; 2]), slope_bound: Some(0.9), ..LookedAt::default() }.cautions();
        let before = cautions.clone();
        add_stress(&mut cautions, &[at(Place::RootFillet, 990.0), at(Place::Bore, 500.0)]);
        assert_eq!(cautions, before);
        add_stress(&mut cautions, &[at(Place::RootFillet, 1205.0), at(Place::Bore, 500.0)]);
        let figures: Vec<_> = cautions.iter().map(|caution| (caution.figure, caution.value)).collect();
        assert_eq!(figures, [("slope_bound", 0.9), ("stress", 1205.0)]);
        assert!(cautions[1].words.contains("root fillet, over three meshes"), "{}", cautions[1].words);
    }

    /// The drawing is as sound as ever; the axis of the spline is not where it should be.
    #[test]
    fn teeth_that_bind_as_built_alone_are_told() {
        let sound = Drive::hhd_95();
        assert_eq!(room_as_built_arcsec(&sound, GeneratorKind::Cam), None);
        let beside = sound.with_set("as_built.circular_spline_offset_um=60").unwrap();
        let looked = |drive: &Drive| LookedAt {
            rigid_gap_um: rigid_gap_um(drive, GeneratorKind::Cam),
            room_as_built_arcsec: room_as_built_arcsec(drive, GeneratorKind::Cam),
            ..LookedAt::default()
        };
        assert_eq!(looked(&beside).cautions()[0].figure, "room_as_built_arcsec");
        assert_eq!(looked(&sound.with_set("as_built.circular_spline_offset_um=5").unwrap()).cautions(), []);
    }
}
