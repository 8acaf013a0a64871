//! A smooth ring takes the shape, and presses with the force, that the closed forms give for each generator.
//!
//! ```text
//!            w(phi) = displacement of the neutral layer, outward +
//!        .--''''--.
//!      /   .----.   \        cam        w0 cos 2 phi                                two-roller  F -> <- F
//!     |   ( o  o )   |       double disc, two-roller, four-roller: RingShape
//!      \   '----'   /        c = second-order shortening that keeps the length (-5.3 um at w0 = 0.5)
//!        '--....--'
//! ```
//!
//! Loads: w0 = 0.005 mm on a rim of 0.4 mm, where second-order terms (w0/R = 1e-4) and stretch ((s/R)^2 = 7e-5) are
//! gone; then w0 = 0.5 mm on the rim of HHD-95 (1.2 mm). Mesh: 752 by 2 elements.
//! References: RingShape, NeutralCurve and RingBending (Timoshenko and Gere, Theory of Elastic Stability, ch. 7); force
//! of the two-roller 13.443 E' I w0 / R^3.
//! Physics wrong if this fails: bending stiffness of the element, place or size of a generator, large rotations.

use std::f64::consts::{FRAC_PI_2, PI};

use flexspline_mechanics::contact::{BoreContact, BoreLaw, OpenEdges};
use flexspline_mechanics::drive::{Drive, GeneratorKind, NeutralCurve, RingShape};
use flexspline_mechanics::mesh::MeshLevel;
use flexspline_mechanics::stepping::{Problem, Solver, SolverSettings, State};
use flexspline_tests::motion::on;

/// The bending of a smooth ring without teeth, all per unit width. The ring bends by M = E' I (w + w'') / R² (moment
/// taken positive where the curvature falls) and is inextensible: an arc without load has the shear M'/R, so a radial
/// force is the jump of E' I (w + w'')' / R³ over its point, and a pressed arc of constant curvature carries its normal
/// force as a uniform pressure. E' = E / (1 - nu²) (plane strain), I = s³/12.
#[derive(Debug, Clone)]
struct RingBending {
    kind: GeneratorKind,
    shape: RingShape,
    radius_mm: f64,
    thickness_mm: f64,
    /// `E'`, MPa
    modulus_mpa: f64,
}

/// Load of the generator, outward, per mm of width.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ContactLoads {
    /// Each concentrated radial force, N/mm: at the two rollers, the four rollers, or the four ends of the disc arcs.
    force_n_per_mm: f64,
    /// Angle of the force from the nearest end of the major axis, rad.
    force_angle_rad: f64,
    /// Uniform pressure on the disc arcs, MPa (zero for rollers).
    pressure_mpa: f64,
}

impl RingBending {
    /// The rim of `drive`, as if it had no teeth, under the generator of `kind`.
    fn of_rim(drive: &Drive, kind: GeneratorKind) -> Self {
        RingBending {
            kind,
            shape: drive.generator.shape(kind),
            radius_mm: drive.flexspline.neutral_radius_mm(),
            thickness_mm: drive.flexspline.rim_thickness_mm,
            modulus_mpa: drive.material.plane_strain_modulus_mpa(),
        }
    }

    /// Bending stiffness `E' I` per width, N·mm.
    fn stiffness_n_mm(&self) -> f64 {
        self.modulus_mpa * self.thickness_mm.powi(3) / 12.0
    }

    /// Loads of the generator; `None` for the cam, whose pressure is spread over its whole circumference.
    fn contact_loads(&self) -> Option<ContactLoads> {
        let unit = self.stiffness_n_mm() / self.radius_mm.powi(3);
        let w0 = self.shape.w0_mm();
        let b = self.shape.break_angle();
        let (force, pressure) = match self.kind {
            GeneratorKind::Cam => return None,
            GeneratorKind::TwoRoller => (4.0 * w0 / (FRAC_PI_2 - 4.0 / PI), 0.0),
            GeneratorKind::FourRoller => {
                let a = b.sin() + (FRAC_PI_2 - b) * b.cos();
                (2.0 * w0 / (a - 4.0 / PI), 0.0)
            }
            GeneratorKind::DoubleDisc => {
                // w + w'' = a + 2 D sin phi beyond the arc
                let two_d = (self.shape.bending(FRAC_PI_2) - self.shape.bending(b)) / (1.0 - b.sin());
                (two_d * b.cos(), two_d * b.sin() / self.radius_mm)
            }
        };
        Some(ContactLoads { force_n_per_mm: unit * force, force_angle_rad: b, pressure_mpa: unit * pressure })
    }
}

/// HHD-95 with other teeth on the circular spline, so that any small deflection is a possible drive; the ring does not
/// see them.
fn with_rim(w0_mm: f64, rim_thickness_mm: f64) -> Drive {
    let mut drive = Drive::hhd_95();
    drive.generator.w0_mm = w0_mm;
    drive.flexspline.rim_thickness_mm = rim_thickness_mm;
    if w0_mm < 0.2 {
        drive.circular_spline.tip_radius_mm = 48.9;
    }
    drive
}

/// Enough points on the bore for the narrow contact of a roller under a light load.
fn settings() -> SolverSettings {
    SolverSettings { bore_points: Some(32), ..on(MeshLevel::Coarse) }
}

/// A node of the neutral layer: undeformed angle, and deformed polar radius and angle.
struct Neutral {
    phi: f64,
    radius: f64,
    angle: f64,
}

fn neutral_layer(problem: &Problem, state: &State) -> Vec<Neutral> {
    let radius = problem.drive.flexspline.neutral_radius_mm();
    let mut layer: Vec<Neutral> = problem
        .flexspline
        .nodes
        .iter()
        .enumerate()
        .filter(|(_, x)| (x[0].hypot(x[1]) - radius).abs() < 1e-9)
        .map(|(n, x)| {
            let p = [x[0] + state.u[2 * n], x[1] + state.u[2 * n + 1]];
            let phi = x[1].atan2(x[0]);
            // Angle near that of the node, whatever the branch.
            let turned = (x[0] * p[1] - x[1] * p[0]).atan2(x[0] * p[0] + x[1] * p[1]);
            Neutral { phi, radius: p[0].hypot(p[1]), angle: phi + turned }
        })
        .collect();
    layer.sort_by(|a, b| a.phi.total_cmp(&b.phi));
    layer
}

/// Bore and force of the generator: sum of contact forces in the quadrant of positive x and y (both rollers of the
/// two-roller stand half in it).
fn quadrant_force(problem: &Problem, settings: &SolverSettings, state: &State) -> f64 {
    let bore = BoreContact::new(&problem.flexspline, settings.bore_points(problem.kind));
    let law = BoreLaw::new(settings.bore_penalty(problem.kind), None);
    let mut sum = 0.0;
    bore.evaluate(law, &problem.outline, 0.0, &state.u, &mut OpenEdges::default(), |edge| {
        let angle = bore.middle_angles[edge.edge].rem_euclid(std::f64::consts::TAU);
        if angle < std::f64::consts::FRAC_PI_2 {
            let [x, y] = [0, 1].map(|k| edge.force[k] + edge.force[2 + k] + edge.force[4 + k]);
            sum += x.hypot(y);
        }
    });
    sum
}

fn ring(drive: &Drive, kind: GeneratorKind, settings: SolverSettings) -> (Problem, State) {
    let problem = Problem::smooth_ring(drive, kind, settings, 376, 2).unwrap();
    let (state, _) = Solver::new(&problem).deform(0.0).unwrap_or_else(|error| panic!("{kind}: {error}"));
    (problem, state)
}

/// Force in a quadrant by the closed form; `None` for the cam, which takes part everywhere.
fn closed_form_force(drive: &Drive, kind: GeneratorKind) -> Option<f64> {
    let bending = RingBending::of_rim(drive, kind);
    let loads = bending.contact_loads()?;
    Some(match kind {
        GeneratorKind::TwoRoller => 0.5 * loads.force_n_per_mm,
        _ => loads.force_n_per_mm + loads.pressure_mpa * drive.flexspline.neutral_radius_mm() * loads.force_angle_rad,
    })
}

fn small_deflection(kind: GeneratorKind) {
    let drive = with_rim(0.005, 0.4);
    // A roller is pressed with a thousandth of a newton here: its contact needs many points, and a softer law, to be
    // wide enough to be integrated.
    let settings = SolverSettings { bore_points: Some(64), bore_penalty: Some(1e5), ..settings() };
    let (problem, state) = ring(&drive, kind, settings);
    let shape = drive.generator.shape(kind);
    let radius = drive.flexspline.neutral_radius_mm();
    let w0 = drive.generator.w0_mm;
    let (mut in_w, mut in_v) = (0.0_f64, 0.0_f64);
    let layer = neutral_layer(&problem, &state);
    assert!(layer.len() >= 752, "{} nodes on the neutral layer", layer.len());
    for node in &layer {
        in_w = in_w.max((node.radius - radius - shape.w(node.phi)).abs() / w0);
        in_v = in_v.max((radius * (node.angle - node.phi) - shape.v(node.phi)).abs() / w0);
    }
    let force = quadrant_force(&problem, &settings, &state);
    let expected = closed_form_force(&drive, kind);
    assert!(in_w <= 1e-3 && in_v <= 1e-3, "{kind}: w off by {in_w}, v by {in_v} of w0");
    if let Some(expected) = expected {
        assert!((force / expected - 1.0).abs() <= 2e-3, "{kind}: force {force}, closed form {expected}");
    }
}

#[test]
fn a_small_deflection_is_that_of_the_thin_ring() {
    GeneratorKind::ALL.into_iter().for_each(small_deflection);
}

fn design_deflection(kind: GeneratorKind) {
    let drive = with_rim(0.5, 1.2);
    let settings = settings();
    let (problem, state) = ring(&drive, kind, settings);
    let radius = drive.flexspline.neutral_radius_mm();
    let curve = NeutralCurve::new(drive.generator.shape(kind), radius);
    let w0 = drive.generator.w0_mm;
    let layer = neutral_layer(&problem, &state);
    // Against the curve of constant length, at the polar angle where the node has come to stand.
    let from_curve = layer.iter().map(|n| (n.radius - curve.polar(n.angle)[0]).abs()).fold(0.0, f64::max);
    // Mean over the polar angle, by the trapezoidal rule around the closed ring.
    let count = layer.len();
    let mean: f64 = (0..count)
        .map(|k| {
            let (a, b) = (&layer[k], &layer[(k + 1) % count]);
            let step = (b.angle - a.angle).rem_euclid(std::f64::consts::TAU);
            0.5 * (a.radius + b.radius - 2.0 * radius) * step
        })
        .sum::<f64>()
        / std::f64::consts::TAU;
    let force = quadrant_force(&problem, &settings, &state);
    // The load, spread over the ring, pulls it: the one part of the shortening that inextensible theory leaves out.
    let tension = force / std::f64::consts::FRAC_PI_2;
    let stretch = tension * radius / (drive.material.plane_strain_modulus_mpa() * drive.flexspline.rim_thickness_mm);
    let c = curve.constant_mm();
    println!(
        "{kind}, w0 {w0} mm: neutral layer within {:.2} um of R + w + c ({:.2} % of w0); mean {:.3} um, c {:.3} um, \
         with stretch {:.3} um",
        1e3 * from_curve,
        100.0 * from_curve / w0,
        1e3 * mean,
        1e3 * c,
        1e3 * (c + stretch)
    );
    assert!((-6.8e-3..=-4.8e-3).contains(&c), "{kind}: c {c} mm");
    assert!(from_curve <= 0.01 * w0, "{kind}: the neutral layer is {from_curve} mm from its curve");
    assert!((mean - c - stretch).abs() <= 6e-5, "{kind}: mean displacement {mean} mm, c + stretch {}", c + stretch);
    if let Some(expected) = closed_form_force(&drive, kind) {
        // Second order: the disc lifts where its arc ends, four rollers stand at a finite angle to the ring.
        let allowed = if kind == GeneratorKind::TwoRoller { 0.01 } else { 0.08 };
        println!("{kind}: force in a quadrant {force:.4} N/mm, first order {expected:.4}");
        assert!((force / expected - 1.0).abs() <= allowed, "{kind}: force {force}, first order {expected}");
    }
}

#[test]
fn the_deflection_of_the_design_keeps_the_length_of_the_ring() {
    GeneratorKind::ALL.into_iter().for_each(design_deflection);
}
