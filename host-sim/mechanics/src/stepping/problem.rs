//! The drive as a mechanical problem: meshes, contact, holding, at one temperature. Immutable while it is solved.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use crate::contact::{BoreContact, BoreLaw, FaceLaw, FlankContact, FlankLaw, Lean};
use crate::drive::{
    ActiveFlank, Drive, FaceLoad, FlankDeviations, GeneratorKind, GeneratorOutline, RimVariation, Side, ToothFlank,
};
use crate::fem::material::PlaneStrain;
use crate::mesh::{MeshLevel, WheelMesh, rotate};
use crate::sleeve::pair_compliance;
use crate::suggest::UnknownName;

use super::error::SolveError;
use super::fast::CondensedDrive;
use super::state::State;
use super::step::LATERAL;
use super::waves::{LeanWave, Third};

/// Which solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// Every node of both wheels in one sparse matrix.
    Reference,
    /// Teeth condensed onto the nodes that touch something, in frames that turn with them.
    Fast,
}

impl Method {
    /// Names of the solvers.
    pub const NAMES: [&'static str; 2] = ["reference", "fast"];
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::NAMES[*self as usize])
    }
}

impl FromStr for Method {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        let unknown = || UnknownName { what: "solver", found: text.to_owned(), known: &Self::NAMES };
        let methods = [Method::Reference, Method::Fast];
        methods.into_iter().find(|method| Self::NAMES[*method as usize] == text).ok_or_else(unknown)
    }
}

/// Part of the bore that may not turn.
///
/// A rim that is deformed by its generator turns locally by `v/R`, two waves around it: the mean of the whole bore does
/// not see that, a single point carries it whole to the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Holding {
    /// The mean rotation of the whole bore: what a sleeve holds.
    #[default]
    WholeBore,
    /// The rotation of one point of the bore, on the axis of tooth 0. To show the error that this makes.
    OnePoint,
}

/// Settings of the numerical method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverSettings {
    /// Which solver.
    pub method: Method,
    /// Mesh of both wheels.
    pub mesh: MeshLevel,
    /// Multiple of the elements of that mesh in each direction. A finer mesh of the same level has its nodes, and
    /// more: what the interval of a stress is taken from.
    pub refine: usize,
    /// Contact penalty on the bore, N/mm³; `None` chooses by generator: 1e7 under rollers, whose contact is narrow and
    /// hard pressed, 1e6 under discs and cam, which conform to the bore. Ten times more moves the output of HHD-95 at
    /// 50 N·m by 0.02″ (cam), 0.01″ (double disc), 0.07″ (two-roller).
    pub bore_penalty: Option<f64>,
    /// Contact penalty on the flanks, N/mm³. Twice as much moves the output of HHD-95 at 50 N·m by 0.01″ (cam) to 0.04″
    /// (two-roller).
    pub flank_penalty: f64,
    /// Integration points in each bore edge; `None` chooses by generator: 48 under rollers (a point every 4 µm; 16
    /// leave 0.07″ of false ripple and a rim that may slip along the roller by steps), 8 under discs and cam.
    pub bore_points: Option<usize>,
    /// Constraint on the rotation of the flexspline.
    pub holding: Holding,
    /// Residual force, relative to the largest contact force, at which an increment is done.
    pub tolerance: f64,
    /// Largest first step of a load that comes on, N m: by default one of a table comes on in few. What only has to be
    /// found may come on at once, as Newton's method halves what is too far.
    pub load_step_n_m: f64,
    /// Newton iterations before an increment is halved.
    pub max_iterations: usize,
    /// Halvings of an increment before giving up.
    pub max_halvings: usize,
    /// Newton iterations of one increment, all its parts and ways together, before giving up; by default far more than
    /// increments that converge take (a guess).
    pub max_work: usize,
}

impl SolverSettings {
    /// The solver `fast` on a mesh.
    pub fn fast(mesh: MeshLevel) -> SolverSettings {
        SolverSettings { method: Method::Fast, mesh, ..SolverSettings::default() }
    }

    /// Penalty on the bore for a generator, N/mm³.
    pub fn bore_penalty(&self, kind: GeneratorKind) -> f64 {
        self.bore_penalty.unwrap_or(if kind.has_rollers() { 1e7 } else { 1e6 })
    }

    /// Integration points in each bore edge for a generator.
    pub fn bore_points(&self, kind: GeneratorKind) -> usize {
        self.bore_points.unwrap_or(if kind.has_rollers() { 48 } else { 8 })
    }
}

impl Default for SolverSettings {
    fn default() -> Self {
        SolverSettings {
            method: Method::Reference,
            mesh: MeshLevel::Standard,
            refine: 1,
            bore_penalty: None,
            flank_penalty: 5e7,
            bore_points: None,
            holding: Holding::default(),
            tolerance: 1e-6,
            load_step_n_m: 100.0,
            max_iterations: 60,
            max_halvings: 8,
            max_work: 6000,
        }
    }
}

/// Torsional stiffness of the drag while the output sticks, N mm/rad per mm of width: 0.02 N·m on 20 mm is reached
/// after 1e-9 rad (0.0002″), which is invisible.
const DRAG_STICK_STIFFNESS: f64 = 1e9;

/// A drive with one generator at one temperature.
pub struct Problem {
    /// The drive at this temperature.
    pub drive: Drive,
    /// Which generator.
    pub kind: GeneratorKind,
    /// Outline of the generator.
    pub outline: GeneratorOutline,
    /// Mesh of the flexspline.
    pub flexspline: WheelMesh,
    /// Mesh of the circular spline.
    pub circular_spline: WheelMesh,
    /// Material of both wheels.
    pub material: PlaneStrain,
    /// Settings of the method.
    pub settings: SolverSettings,
    /// The wheels condensed, for [`Method::Fast`].
    pub(super) condensed: Option<CondensedDrive>,
    pub(super) bore: BoreContact,
    pub(super) bore_law: BoreLaw,
    pub(super) flank_law: FlankLaw,
    tooth: ActiveFlank,
    space: ActiveFlank,
    deviations: FlankDeviations,
    /// Weights of the mean rotation of the bore by unknown of the flexspline: rotation = rotation_weights . u.
    pub(super) rotation_weights: Vec<(usize, f64)>,
    /// Weights of the mean displacement of the bore in x; that in y follows by symmetry of the nodes.
    pub(super) mean_weights: Vec<f64>,
    /// 1 / torsional stiffness of the sleeve per mm of width (rad mm / N mm); zero when rigid.
    pub(super) sleeve_compliance: f64,
    /// Lateral stiffness of the sleeve per mm of width (N/mm²).
    pub(super) lateral_stiffness: f64,
    /// Stiffness that shells in the third dimension add to the slice.
    third: Third,
    /// The waves on the bore of the meshes of this problem.
    pub(super) waves: Vec<LeanWave>,
    /// The load along the face, where it is not even.
    face: Option<FaceLaw>,
    /// Coulomb drag of the output per mm of width (N mm/mm).
    pub(super) drag: f64,
    pub(super) drag_stiffness: f64,
    /// Circular-spline nodes held by the housing.
    pub(super) held: Vec<bool>,
    /// Their radial displacement, mm.
    pub(super) seat_displacement: f64,
    degrees_of_freedom: usize,
}

impl Problem {
    /// Angle of the output under its load, rad: that of the circular spline, and the wind-up that is not of the FEM.
    pub fn output_rad(&self, state: &State) -> f64 {
        state.output_rad + self.drive.contact_wind_up_rad(state.torque_n_m)
    }

    /// Output angle minus generator angle over the ratio, rad; positive when the output leads.
    pub fn error_rad(&self, state: &State) -> f64 {
        self.output_rad(state) - state.generator_rad / self.drive.ratio()
    }

    /// Sets up the drive with generator `kind` at a temperature.
    pub fn new(
        drive: &Drive,
        kind: GeneratorKind,
        temperature_c: f64,
        settings: SolverSettings,
    ) -> Result<Problem, SolveError> {
        drive.check_with(&[kind])?;
        let drive = drive.at_temperature(temperature_c);
        let outline = GeneratorOutline::new(&drive, kind)?;
        let [of_flexspline, of_circular_spline] =
            [settings.mesh.flexspline(), settings.mesh.circular_spline()].map(|density| density.times(settings.refine));
        let flexspline = WheelMesh::flexspline_as_fine_as(&drive, &of_flexspline)?;
        let circular_spline = WheelMesh::circular_spline_as_fine_as(&drive, &of_circular_spline)?;
        let material = PlaneStrain::new(drive.material.youngs_modulus_mpa, drive.material.poissons_ratio);
        let width = drive.flexspline.width_mm;
        let tooth = ActiveFlank::new(&ToothFlank::external(&drive)?);
        let space = ActiveFlank::new(&ToothFlank::internal(&drive)?);
        let deviations = FlankDeviations::new(&drive);
        let outer = drive.circular_spline.outer_radius_mm;
        let mut held: Vec<bool> = circular_spline.nodes.iter().map(|p| p[0].hypot(p[1]) > outer - 1e-6).collect();
        let free = held.iter().filter(|held| !**held).count();
        let degrees_of_freedom = 2 * (flexspline.nodes.len() + free) + 1;
        let condensed = (settings.method == Method::Fast)
            .then(|| CondensedDrive::new(&flexspline, &circular_spline, &material, |n| held[n as usize]));
        let mut fs = &flexspline;
        if let Some(condensed) = &condensed {
            fs = &condensed.flexspline.skin.mesh;
            held = vec![false; condensed.circular_spline.skin.mesh.nodes.len()];
        }
        let bore = BoreContact::new(fs, settings.bore_points(kind));
        let (rotation_weights, mean_weights) = bore_averages(fs, &bore, settings.holding);
        let third = Third::of(&drive)?;
        let waves = third.waves(&drive, fs, &bore);
        let wheel = &drive.flexspline;
        let face = (wheel.face == FaceLoad::Slices)
            .then(|| {
                Ok::<_, SolveError>(FaceLaw::new(&tooth, width, 1e-3 * wheel.crowning_um, pair_compliance(&drive)?))
            })
            .transpose()?;
        let thermal = &drive.thermal_state;
        Ok(Problem {
            bore_law: BoreLaw::new(settings.bore_penalty(kind), drive.generator.bearing_stiffness_n_per_mm3),
            flank_law: FlankLaw {
                stiffness: settings.flank_penalty,
                stick_stiffness: 0.1 * settings.flank_penalty,
                friction: drive.flanks.friction_coefficient,
            },
            sleeve_compliance: third.torsion_n_m_per_rad.map_or(0.0, |k| width / (1e3 * k)),
            lateral_stiffness: third.lateral_n_per_mm / width,
            drag: drive.output.drag_torque_n_m * 1e3 / width,
            drag_stiffness: DRAG_STICK_STIFFNESS,
            seat_displacement: outer * (thermal.housing_scale / thermal.circular_spline_scale - 1.0),
            degrees_of_freedom,
            rotation_weights,
            mean_weights,
            third,
            waves,
            face,
            held,
            condensed,
            bore,
            tooth,
            space,
            deviations,
            outline,
            flexspline,
            circular_spline,
            material,
            settings,
            kind,
            drive,
        })
    }

    /// This problem with a smooth ring, of the rim's bore and thickness, in place of the toothed flexspline: what the
    /// closed forms of [`crate::reference`] describe. Nothing but the generator touches it.
    pub fn smooth_ring(
        drive: &Drive,
        kind: GeneratorKind,
        settings: SolverSettings,
        sectors: usize,
        rows: usize,
    ) -> Result<Problem, SolveError> {
        let settings = SolverSettings { method: Method::Reference, ..settings };
        let mut problem = Problem::new(drive, kind, drive.temperature.reference_c, settings)?;
        let bore_radius = drive.flexspline.bore_radius_mm();
        problem.flexspline = WheelMesh::smooth_ring(bore_radius, drive.flexspline.rim_thickness_mm, sectors, rows)?
            .with_rim(RimVariation::of(drive), drive.flexspline.root_radius_mm)?;
        problem.bore = BoreContact::new(&problem.flexspline, settings.bore_points(kind));
        (problem.rotation_weights, problem.mean_weights) =
            bore_averages(&problem.flexspline, &problem.bore, settings.holding);
        problem.waves = problem.third.waves(&problem.drive, &problem.flexspline, &problem.bore);
        Ok(problem)
    }

    /// Contact between the flanks.
    pub fn flanks(&self) -> FlankContact<'_> {
        let (fs, cs) = self.wheels();
        self.flanks_on(fs, cs)
    }

    /// Contact between the flanks as other meshes carry them, of the same sectors and flanks.
    pub fn flanks_on<'a>(&'a self, flexspline: &'a WheelMesh, circular_spline: &'a WheelMesh) -> FlankContact<'a> {
        FlankContact::new(flexspline, circular_spline, self.tooth.clone(), self.space.clone(), &self.deviations)
            .with_face(self.face)
    }

    /// Has the teeth lean as the waves of the rim make them, less their taper.
    pub(super) fn lean(&self, state: &mut State) {
        if self.face.is_none() {
            return;
        }
        let taper = 1e-3 * self.drive.flexspline.taper_mrad;
        let mut leans = std::mem::take(&mut state.leans);
        leans.clear();
        leans.resize(self.flexspline.teeth, [-taper, 0.0]);
        for wave in &self.waves {
            wave.add_lean(wave.amplitude(&state.u), &mut leans);
        }
        state.leans = leans;
    }

    /// The waves of the rim that adjoining shells hold, in a state: harmonic, and amplitude a (mm) of `cos n theta` and
    /// of `sin n theta`.
    pub fn rim_waves(&self, state: &State) -> Vec<(u32, [f64; 2])> {
        let pairs = self.third.additions.iter().zip(self.waves.chunks_exact(2));
        pairs.map(|(addition, waves)| (addition.n, [0, 1].map(|k| waves[k].amplitude(&state.u)))).collect()
    }

    /// Motion of an end of the face against its middle for displacements of 1 mm, at most.
    pub(super) fn leans_within(&self) -> f64 {
        if self.face.is_none() {
            return 0.0;
        }
        0.5 * self.drive.flexspline.width_mm * self.waves.iter().map(LeanWave::largest_lean).sum::<f64>()
    }

    /// Row of the border where the waves begin.
    pub(super) fn first_wave(&self) -> usize {
        if self.lateral_stiffness > 0.0 { LATERAL + 2 } else { LATERAL }
    }

    /// Row of the border where the amplitudes of the waves begin, by which the teeth lean; none where the load along
    /// the face is even.
    pub(super) fn first_amplitude(&self) -> Option<usize> {
        (self.face.is_some() && !self.waves.is_empty()).then(|| self.first_wave() + self.waves.len())
    }

    /// Slope of the offsets of a flank along its face, for a tooth that leans.
    pub(super) fn face_slope(&self, lean: Lean, side: Side) -> f64 {
        self.face.map_or(0.0, |face| face.slope(lean, side))
    }

    /// Modulus of two flanks that touch, MPa.
    pub fn contact_modulus_mpa(&self) -> f64 {
        0.5 * self.drive.material.plane_strain_modulus_mpa()
    }

    /// Drag torque on the output (N mm/mm) at a displacement from its anchor, and the stiffness with which it holds.
    pub(super) fn drag_torque(&self, displacement_rad: f64) -> (f64, f64) {
        let trial = -self.drag_stiffness * displacement_rad;
        if trial.abs() <= self.drag { (trial, self.drag_stiffness) } else { (trial.signum() * self.drag, 0.0) }
    }

    /// Torque per mm of width (N mm/mm) of a torque on the drive (N m).
    pub fn per_width(&self, torque_n_m: f64) -> f64 {
        torque_n_m * 1e3 / self.drive.flexspline.width_mm
    }

    /// Refuses a state in which wheels touch where no contact is modelled: a tooth of the flexspline in the root of a
    /// space.
    pub(super) fn check_range(&self, state: &State) -> Result<(), SolveError> {
        let (mesh, _) = self.wheels();
        // As built, some root of a space may stand further in, and tooth and axis off their places.
        let further_in = self.deviations.spaces.iter().map(|space| -space.translation[0]).fold(0.0, f64::max);
        let root = self.drive.circular_spline.root_radius_mm - further_in;
        let axis = self.deviations.axis;
        for tooth in 0..mesh.teeth {
            for flank in &mesh.flanks {
                let Some(&tip) = flank.nodes.last() else { continue };
                let n = mesh.node(tooth as isize, tip);
                let x = mesh.nodes[n];
                let offset = rotate(self.deviations.teeth[tooth].translation, mesh.sector_angle(tooth).sin_cos());
                let [dx, dy] = [offset[0] - axis[0], offset[1] - axis[1]];
                let radius = (x[0] + state.u[2 * n] + dx).hypot(x[1] + state.u[2 * n + 1] + dy);
                if radius > root {
                    return Err(SolveError::OutOfRange {
                        generator_rad: state.generator_rad,
                        torque_n_m: state.torque_n_m,
                        what: format!(
                            "the tip of flexspline tooth {tooth} reaches radius {radius:.3} mm, the root circle of \
                             the circular spline is at {root:.3} mm, and contact of tip and root is not modelled"
                        ),
                    });
                }
            }
        }
        Ok(())
    }

    /// The meshes on whose nodes the displacements of a [`State`] live: flexspline, circular spline.
    pub fn wheels(&self) -> (&WheelMesh, &WheelMesh) {
        match &self.condensed {
            Some(condensed) => (&condensed.flexspline.skin.mesh, &condensed.circular_spline.skin.mesh),
            None => (&self.flexspline, &self.circular_spline),
        }
    }

    /// Number of each circular-spline node among the free nodes of both wheels, those of the flexspline first.
    pub(super) fn free_circular_spline_nodes(&self) -> Vec<Option<u32>> {
        let mut next = self.wheels().0.nodes.len() as u32;
        let mut number = |held: &bool| {
            (!held).then(|| {
                next += 1;
                next - 1
            })
        };
        self.held.iter().map(&mut number).collect()
    }

    /// A state of this problem on all nodes of both wheels ([`Problem::flexspline`], [`Problem::circular_spline`]):
    /// itself, or, from the fast solver, with the nodes that were condensed away.
    pub fn whole_state<'s>(&self, state: &'s State) -> Cow<'s, State> {
        match &self.condensed {
            Some(condensed) => Cow::Owned(condensed.recover(self, state)),
            None => Cow::Borrowed(state),
        }
    }

    /// Displaces the circular-spline nodes that the housing holds, where a [`State`] has them.
    pub fn seat_state(&self, v: &mut [f64]) {
        if self.condensed.is_none() {
            self.seat(v);
        }
    }

    /// Displaces the circular-spline nodes that the housing holds, in a field of all its nodes.
    pub(super) fn seat(&self, v: &mut [f64]) {
        let outer = self.drive.circular_spline.outer_radius_mm;
        for (n, x) in self.circular_spline.nodes.iter().enumerate() {
            if x[0] * x[0] + x[1] * x[1] > (outer - 1e-6).powi(2) {
                let r = x[0].hypot(x[1]);
                let stretch = self.seat_displacement / r;
                v[2 * n] = x[0] * stretch;
                v[2 * n + 1] = x[1] * stretch;
            }
        }
    }

    /// Unknowns of the whole model: flexspline nodes, circular-spline nodes that are not held, two each, and the output
    /// angle.
    pub fn degrees_of_freedom(&self) -> usize {
        self.degrees_of_freedom
    }

    /// Where the search for the deformed drive starts: every normal of the rim placed on the exact constant-length
    /// neutral curve of this generator, the circular spline undeformed, `generator_rad` and nominal output angle.
    pub fn starting_shape(&self, generator_rad: f64) -> State {
        let (fs, cs) = self.wheels();
        let neutral = self.outline.neutral();
        let scale = self.drive.thermal_state.flexspline_scale;
        let neutral_radius = neutral.radius_mm() * scale;
        // The rim follows its generator sideways.
        let turn = generator_rad.sin_cos();
        let [cx, cy] = rotate(self.outline.centre(), turn);
        let mut u = Vec::with_capacity(2 * fs.nodes.len());
        for x in &fs.nodes {
            let (r, phi) = (x[0].hypot(x[1]), x[1].atan2(x[0]));
            let (p, normal) = neutral.position(phi - generator_rad);
            let [x1, y1] = rotate(p, turn);
            let p = [scale * x1 + cx, scale * y1 + cy];
            let (sn, cn) = (normal + generator_rad).sin_cos();
            let above = r - neutral_radius;
            u.extend([p[0] + above * cn - x[0], p[1] + above * sn - x[1]]);
        }
        let mut v = vec![0.0; 2 * cs.nodes.len()];
        self.seat_state(&mut v);
        let output_rad = generator_rad / self.drive.ratio();
        let mut state = State {
            u,
            v,
            generator_rad,
            torque_n_m: 0.0,
            output_rad,
            drag_anchor_rad: output_rad,
            sleeve_moment: 0.0,
            lateral_force: [0.0; 2],
            friction: Default::default(),
            leans: Vec::new(),
            output_rate: 1.0 / self.drive.ratio(),
            travel: 0.0,
        };
        self.lean(&mut state);
        state
    }
}

/// Linear functionals of the bore displacement: rotation of what is held, and mean x displacement.
fn bore_averages(mesh: &WheelMesh, bore: &BoreContact, holding: Holding) -> (Vec<(usize, f64)>, Vec<f64>) {
    let mut rotation = vec![0.0; 2 * mesh.nodes.len()];
    let mut mean = vec![0.0; 2 * mesh.nodes.len()];
    let share = 1.0 / bore.edges.len() as f64;
    for edge in &bore.edges {
        for (node, simpson) in edge.iter().zip([1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0]) {
            let n = *node as usize;
            let x = mesh.nodes[n];
            let r2 = x[0] * x[0] + x[1] * x[1];
            rotation[2 * n] -= simpson * share * x[1] / r2;
            rotation[2 * n + 1] += simpson * share * x[0] / r2;
            mean[2 * n] += simpson * share;
        }
    }
    if holding == Holding::OnePoint {
        rotation.fill(0.0);
        let along = |n: &u32| mesh.nodes[*n as usize][0];
        let nearest = bore.edges.iter().map(|edge| edge[0]).max_by(|a, b| along(a).total_cmp(&along(b)));
        let n = nearest.expect("a bore has edges") as usize;
        let [x, y] = mesh.nodes[n];
        let r2 = x * x + y * y;
        rotation[2 * n] = -y / r2;
        rotation[2 * n + 1] = x / r2;
    }
    (rotation.into_iter().enumerate().filter(|(_, w)| *w != 0.0).collect(), mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever is held measures a rotation as a rotation; what the wave does along the circumference only the whole
    /// bore leaves out.
    #[test]
    fn what_is_held_turns_with_the_rim() {
        let drive = Drive::hhd_95();
        let shape = drive.generator.shape(GeneratorKind::Cam);
        for (holding, sense) in [(Holding::WholeBore, 0.0), (Holding::OnePoint, -1.0)] {
            let settings = SolverSettings { holding, ..SolverSettings::fast(MeshLevel::Coarse) };
            let problem = Problem::new(&drive, GeneratorKind::Cam, 20.0, settings).unwrap();
            let (mesh, _) = problem.wheels();
            let rotation = |of: &dyn Fn([f64; 2]) -> [f64; 2]| -> f64 {
                let field: Vec<f64> = mesh.nodes.iter().flat_map(|&x| of(x)).collect();
                problem.rotation_weights.iter().map(|(k, w)| w * field[*k]).sum()
            };
            let turned = rotation(&|[x, y]| [-1e-3 * y, 1e-3 * x]);
            assert!((turned - 1e-3).abs() < 1e-12, "{holding:?}: {turned}");
            let wave = rotation(&|[x, y]| {
                let r = x.hypot(y);
                // The generator 45° ahead of the point.
                let v = shape.v(y.atan2(x) - std::f64::consts::FRAC_PI_4);
                [-v * y / r, v * x / r]
            });
            // v = -(w0/2) sin 2 phi at the bore, and half a node off.
            let expected = -sense * 0.25 / drive.flexspline.bore_radius_mm();
            assert!((wave - expected).abs() < 2e-5, "{holding:?}: {wave}, expected {expected}");
        }
    }
}
