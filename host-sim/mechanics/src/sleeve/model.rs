//! A flexspline as shells, and what it answers.

use serde::Serialize;

use super::plate::{Plate, PlateEdge};
use super::rim::Rim;
use super::shell::{Ribs, Shell, V, W};
use super::tube::{Edge, End, Tube};
use crate::drive::{Bottom, Drive, Flange, SleeveKind};
use crate::mesh::MeshError;

/// Width of the band that a generator presses on, relative to the face width: a bearing of 12.5 mm under teeth of 20
/// mm.
const BAND: f64 = 0.625;
/// Highest harmonic of two rollers. Twice as many move w(45°)/w0 of a closed sleeve by less than 0.002 (a test).
const HIGHEST: u32 = 48;

/// A flexspline in three dimensions: the rim, and a tube with its end on either side of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Flexspline3d {
    /// The rim.
    pub rim: Shell,
    /// Its width, mm.
    pub width_mm: f64,
    /// Width of the band under the generator, mm.
    pub band_mm: f64,
    /// The tube to the flange, and what holds its end in every harmonic.
    pub flange: Option<(Tube, End)>,
    /// The tube to the bottom, and its bottom.
    pub bottom: Option<(Tube, End)>,
    /// Whether the bottom stands on a shaft: that of a cup. Else it goes where the tube takes it as a body (n = 0 and
    /// 1).
    pub on_shaft: bool,
}

/// Stiffness against one harmonic of a radial load. Stiffness is the amplitude of the reaction, full circle, over the
/// amplitude of the displacement: twice the energy over the amplitude squared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RimHarmonic {
    /// Waves around the rim.
    pub n: u32,
    /// Of a load on the middle line of the rim, N/mm.
    pub k_line_n_per_mm: f64,
    /// Of a generator on its band, which stays straight and tilts as it will, N/mm.
    pub k_band_n_per_mm: f64,
    /// Tilt of that band for 1 mm in its middle, rad/mm; positive: it grows away from what holds the flexspline.
    pub tilt_rad_per_mm: f64,
}

/// Deflection of the rim by two rollers that press outward at 0° and 180°: radial displacement over that under the
/// rollers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rollers {
    /// At 45°.
    pub w45: f64,
    /// At 90°.
    pub w90: f64,
}

impl Flexspline3d {
    /// The flexspline of a drive, with its teeth as ribs or as a smooth rim. Springs have no shape: for a drive that
    /// has them in place of a sleeve it is the hermetic sleeve of the sizes given; for `none` the bare rim.
    pub fn of(drive: &Drive, with_teeth: bool) -> Result<Flexspline3d, MeshError> {
        let (wheel, sleeve, material) = (&drive.flexspline, &drive.sleeve, &drive.material);
        let wall = |thickness_mm: f64, ribs: Ribs| Shell {
            radius_mm: wheel.neutral_radius_mm(),
            thickness_mm,
            youngs_modulus_mpa: material.youngs_modulus_mpa,
            poissons_ratio: material.poissons_ratio,
            ribs,
        };
        let kind = sleeve.kind;
        let has_flange = matches!(kind, SleeveKind::Hermetic | SleeveKind::Hat | SleeveKind::Springs);
        let has_bottom = matches!(kind, SleeveKind::Hermetic | SleeveKind::Cup | SleeveKind::Springs);
        let tube = |length_mm: f64| Tube { shell: wall(sleeve.wall_mm, Ribs::NONE), length_mm };
        let flange = || match sleeve.flange {
            Flange::Rigid => End::Clamped,
            Flange::Diaphragm => End::Plate(Plate {
                wall: wall(sleeve.diaphragm_thickness_mm, Ribs::NONE),
                to: PlateEdge::Clamped(wheel.neutral_radius_mm() + sleeve.diaphragm_width_mm),
            }),
        };
        let on_shaft = kind == SleeveKind::Cup;
        // A plate stands inside the end of the tube: its inner face is where the tube begins to be free.
        let (inside, bottom) = match sleeve.bottom {
            Bottom::Disc => (0.0, End::InPlane),
            Bottom::Clamped => (0.0, End::Clamped),
            Bottom::Plate => {
                let to = if on_shaft { PlateEdge::Clamped(sleeve.hub_radius_mm) } else { PlateEdge::Centre };
                let wall = wall(sleeve.bottom_thickness_mm, Ribs::NONE);
                (sleeve.bottom_thickness_mm, End::Plate(Plate { wall, to }))
            }
        };
        Ok(Flexspline3d {
            rim: wall(wheel.rim_thickness_mm, if with_teeth { Ribs::of_teeth(drive)? } else { Ribs::NONE }),
            width_mm: wheel.width_mm,
            band_mm: BAND * wheel.width_mm,
            flange: has_flange.then(|| (tube(sleeve.flange_side_mm), flange())),
            bottom: has_bottom.then(|| (tube(sleeve.bottom_side_mm - inside), bottom)),
            on_shaft,
        })
    }

    /// The rim at harmonic n with the tubes on its edges.
    pub(super) fn at(&self, n: u32) -> Rim {
        let flange = self.flange.map(|(tube, end)| tube.edge(n, end));
        let bottom: Option<Edge> = self.bottom.map(|(tube, end)| match end {
            // As a body a bottom is held by nothing but its tube, unless it stands on a shaft.
            End::InPlane | End::Clamped if n < 2 && !self.on_shaft => tube.edge(n, End::Free),
            _ => tube.edge(n, end),
        });
        Rim::new(&self.rim, self.width_mm, self.band_mm, n, [flange, bottom])
    }

    /// Away from the flange is along the axis; away from the bottom of a cup against it.
    pub(super) fn away(&self) -> f64 {
        if self.flange.is_none() && self.bottom.is_some() { -1.0 } else { 1.0 }
    }

    /// Stiffness against a radial load of n waves.
    pub fn harmonic(&self, n: u32) -> RimHarmonic {
        let rim = self.at(n);
        let band = rim.band();
        let tilts = band.at(1, 1) > 0.0;
        RimHarmonic {
            n,
            k_line_n_per_mm: rim.middle(&[W]).at(0, 0),
            k_band_n_per_mm: band.condensed(&[0], &[]).at(0, 0),
            tilt_rad_per_mm: if tilts { -self.away() * band.at(0, 1) / band.at(1, 1) } else { 0.0 },
        }
    }

    /// Torque over turn of the middle of the rim, N·m/rad; zero where nothing holds it.
    pub fn torsion_n_m_per_rad(&self) -> f64 {
        let around = self.at(0).middle(&[V]).at(0, 0).max(0.0);
        around * self.rim.radius_mm * self.rim.radius_mm / 1e3
    }

    /// Force over displacement of the middle of the rim, moved sideways as a body, N/mm; zero where nothing holds it.
    pub fn lateral_n_per_mm(&self) -> f64 {
        let middle = self.at(1).middle(&[W, V]);
        (middle.at(0, 0) - 2.0 * middle.at(0, 1) + middle.at(1, 1)).max(0.0)
    }

    /// The rim under two rollers.
    pub fn two_rollers(&self) -> Rollers {
        self.two_rollers_to(HIGHEST)
    }

    fn two_rollers_to(&self, highest: u32) -> Rollers {
        let mut w = [0.0; 3];
        for n in (0..=highest).step_by(2) {
            let compliance = 1.0 / self.harmonic(n).k_band_n_per_mm;
            for (w, eighths) in w.iter_mut().zip([0.0, 1.0, 2.0]) {
                *w += compliance * (f64::from(n) * eighths * std::f64::consts::FRAC_PI_4).cos();
            }
        }
        Rollers { w45: w[1] / w[0], w90: w[2] / w[0] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// HHD-95 with a smooth rim and these fields set.
    fn smooth(sets: &[&str]) -> Flexspline3d {
        Flexspline3d::of(&Drive::hhd_95().with_sets(sets.iter().copied()).unwrap(), false).unwrap()
    }

    fn closed(wall: f64, side: f64) -> Flexspline3d {
        closed_with(wall, side, &[])
    }

    fn closed_with(wall: f64, side: f64, more: &[&str]) -> Flexspline3d {
        let sizes = [
            "sleeve.kind=hermetic".to_owned(),
            format!("sleeve.wall_mm={wall}"),
            format!("sleeve.flange_side_mm={side}"),
            format!("sleeve.bottom_side_mm={side}"),
        ];
        smooth(&sizes.iter().map(String::as_str).chain(more.iter().copied()).collect::<Vec<_>>())
    }

    fn cup() -> Flexspline3d {
        Flexspline3d::of(&Drive::cup_95(), false).unwrap()
    }

    fn near(found: f64, expected: f64, part: f64, what: &str) {
        assert!((found / expected - 1.0).abs() < part, "{what}: {found}, expected {expected}");
    }

    /// Fourier shells and solid elements of CalculiX 2.20, computed apart from this program, agree on these numbers to
    /// 0.2 % (n of 4 and more 0.5 %, bands 1 %): K2, K4, K6 of a line, K2 of the band, tilt at w0 0.5 mm in mrad,
    /// w(45°) and w(90°) over w0 under two rollers.
    #[test]
    fn stiffness_tilt_and_rollers_are_those_of_solid_elements() {
        let free = smooth(&["sleeve.kind=none"]);
        for (name, flexspline, line, band, tilt, rollers) in [
            ("free ring", free, [165.8, 4196.0, 22_590.0], 167.9, 0.0, [-0.035, -0.918]),
            ("0.7, 80 + 80", closed(0.7, 80.0), [24_338.0, 9979.0, 31_576.0], 26_442.0, 0.47, [-0.463, 0.206]),
            ("0.5, 140 + 140", closed(0.5, 140.0), [6518.0, 6458.0, 26_988.0], 6660.0, 0.72, [-0.388, -0.063]),
            ("cup", cup(), [236.5, 5289.0, 25_764.0], 236.9, 5.55, [-0.039, -0.907]),
        ] {
            for (n, expected) in [2, 4, 6].into_iter().zip(line) {
                near(flexspline.harmonic(n).k_line_n_per_mm, expected, 0.007, &format!("{name}, line, n = {n}"));
            }
            let two = flexspline.harmonic(2);
            near(two.k_band_n_per_mm, band, 0.013, &format!("{name}, band"));
            let mrad = 500.0 * two.tilt_rad_per_mm;
            assert!((mrad - tilt).abs() <= 0.02 * tilt + 1e-6, "{name}: tilt {mrad}");
            let Rollers { w45, w90 } = flexspline.two_rollers();
            assert!((w45 - rollers[0]).abs() < 0.01 && (w90 - rollers[1]).abs() < 0.01, "{name}: {w45} {w90}");
        }
    }

    #[test]
    fn torsion_and_lateral_stiffness_are_those_of_solid_elements() {
        for (flexspline, torsion, lateral) in
            [(closed(0.7, 80.0), 428_738.0, 64_958.0), (closed(0.5, 140.0), 182_337.0, 17_504.0)]
        {
            near(flexspline.torsion_n_m_per_rad(), torsion, 0.003, "torsion");
            near(flexspline.lateral_n_per_mm(), lateral, 0.003, "lateral");
        }
        let free = smooth(&["sleeve.kind=none"]);
        assert!(free.torsion_n_m_per_rad() < 1e-3 && free.lateral_n_per_mm() < 1e-3);
    }

    /// Solid elements give for other ends, of K2: a bottom of 2 mm adds 1 to 1.5 %, a thin one takes 2 %; a flange
    /// on a diaphragm takes 29 to 41 %, and nearly all of the lateral stiffness.
    #[test]
    fn other_ends_change_what_they_are_known_to() {
        for (wall, side, diaphragm) in [(0.7, 80.0, -0.29), (0.5, 140.0, -0.41)] {
            let line = |more: &[&str]| closed_with(wall, side, more).harmonic(2).k_line_n_per_mm;
            let disc = line(&[]);
            let change = |more: &[&str]| line(more) / disc - 1.0;
            let thick = change(&["sleeve.bottom=plate"]);
            assert!((0.01..0.015).contains(&thick), "a bottom of 2 mm: {thick}");
            assert!(change(&["sleeve.bottom=clamped"]) > 0.2);
            let softer = change(&["sleeve.flange=diaphragm"]);
            assert!((softer - diaphragm).abs() < 0.01, "{softer}");
            let sideways = closed_with(wall, side, &["sleeve.flange=diaphragm"]).lateral_n_per_mm();
            assert!(sideways < 0.1 * closed(wall, side).lateral_n_per_mm(), "{sideways}");
        }
        let disc = closed(0.7, 80.0).harmonic(2).k_line_n_per_mm;
        let thin = closed_with(0.7, 80.0, &["sleeve.bottom=plate", "sleeve.bottom_thickness_mm=0.6"]);
        let change = thin.harmonic(2).k_line_n_per_mm / disc - 1.0;
        assert!((-0.025..-0.015).contains(&change), "a thin bottom: {change}");
    }

    /// A long sleeve is a beam on two supports, `12 B (a+b)³/(a³ b² (3 (a+b) + b))` with `B = pi E t R³/n⁴`: without
    /// shear it is an upper bound that is approached.
    #[test]
    fn a_long_sleeve_approaches_the_beam_of_the_closed_form() {
        let beam = |t: f64, a: f64, b: f64| {
            let stiffness = std::f64::consts::PI * 206_000.0 * t * 47.275_f64.powi(3) / 16.0;
            12.0 * stiffness * (a + b).powi(3) / (a.powi(3) * b * b * (3.0 * (a + b) + b))
        };
        let ring = smooth(&["sleeve.kind=none"]).harmonic(2).k_line_n_per_mm;
        let ratios = [140.0, 280.0, 560.0].map(|side: f64| {
            // The ring and the tubes also bend around, in parallel: what the sleeve adds is above the ring's.
            let added = closed(0.5, side).harmonic(2).k_line_n_per_mm - ring;
            added / beam(0.5, side + 10.0, side + 10.0)
        });
        assert!(ratios[0] < ratios[1] && (0.8..1.1).contains(&ratios[1]), "{ratios:?}");
    }

    /// A cup cones about its bottom: `W ~ x`.
    #[test]
    fn a_cup_cones() {
        let tilt = cup().harmonic(2).tilt_rad_per_mm;
        near(tilt, 1.0 / 90.0, 0.005, "tilt");
        let hat =
            smooth(&["sleeve.kind=hat", "sleeve.wall_mm=0.7", "sleeve.flange_side_mm=80", "sleeve.flange=diaphragm"]);
        let hat = hat.harmonic(2);
        assert!(hat.tilt_rad_per_mm > 0.008 && hat.k_line_n_per_mm < 400.0, "{hat:?}");
    }

    /// Two equal sides: no tilt, and the same from either side.
    #[test]
    fn a_symmetric_flexspline_does_not_tilt() {
        let mut both = closed(0.7, 80.0);
        both.bottom = both.bottom.map(|(tube, _)| (tube, End::Clamped));
        let found = both.harmonic(2);
        assert!(found.tilt_rad_per_mm.abs() < 1e-9 && found.k_band_n_per_mm > 26_000.0, "{found:?}");
        let mut one = closed(0.7, 80.0);
        let (flange, bottom) = (one.flange, one.bottom);
        let there = one.harmonic(4);
        (one.flange, one.bottom) = (bottom, flange);
        let back = one.harmonic(4);
        near(back.k_band_n_per_mm, there.k_band_n_per_mm, 1e-9, "turned around");
        near(back.tilt_rad_per_mm, -there.tilt_rad_per_mm, 1e-7, "turned around");
    }

    #[test]
    fn harmonics_of_the_rollers_are_enough() {
        let sleeve = closed(0.7, 80.0);
        let [some, more] = [HIGHEST, 2 * HIGHEST].map(|highest| sleeve.two_rollers_to(highest));
        assert!((some.w45 - more.w45).abs() < 2e-3 && (some.w90 - more.w90).abs() < 2e-3, "{some:?} {more:?}");
    }
}
