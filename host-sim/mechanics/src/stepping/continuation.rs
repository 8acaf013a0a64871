//! The way to a new place or load: in parts, and with contact that is soft at first.

use crate::contact::{BoreLaw, FlankLaw};

use super::problem::{Problem, SolverSettings};
use super::state::State;

/// Factors on the penalties while the way to a new load is found.
pub(super) const LOADING_SOFTNESS: [f64; 2] = [1e-3, 3e-2];
/// Factors on the penalties on the way to a far place: of 0.1, 0.03, 0.01, (0.001, 0.03) and none this takes the fewest
/// iterations where most are needed (20 to 30; cam, 5 µm of eccentricity and pitch errors, 4 and 100 N·m).
pub(super) const JUMPING_SOFTNESS: [f64; 1] = [1e-2];
/// Soft stages of further ways to deform a drive whose usual way ends, each with patience. Rollers in a soft bearing
/// creep: a CSG-32-120 with cup and balls and a rim of 1.05 mm takes 97 iterations, of 0.8 and 1.3 mm 34 and 43.
pub(super) const DEFORMING_SOFTNESS: [&[f64]; 3] = [&[1e-3], &[1e-3, 3e-2], &[1e-2, 1e-1]];
/// Relative residual at which a stage with soft contact is done: it only finds the way. Drives of all four generators
/// to their rated load and over a tooth pitch (HHD-95, coarse) take 1002 iterations with the tolerance of the last
/// stage, 877 with 1e-2, 825 with 1e-1, and end within 1e-5″ of one another.
const FOUND_THE_WAY: f64 = 0.1;
/// Share of the new load from which on the load that there is shows the way by itself, and contact need not be softened
/// first: the same drives then take 716 iterations. A guess: between the loads of a data sheet it is 0.19 and more,
/// from its light touch on 0.005.
const SHOWS_THE_WAY: f64 = 0.03;
/// Stiffness of the bore (N/mm³) below which it is not softened: the softest penalty on the way to a new load.
const SOFTEST_BORE: f64 = 1e3;
/// Iterations after which the next part of an increment may be twice as large.
const EASY: usize = 10;
/// Halvings after which Newton is given this multiple of the iterations. Heavily loaded rollers creep along their way,
/// and halving does not shorten it: of nine drives that failed with 60 iterations at 63 % of their rated load and more,
/// eight converge with 200, in less time than failing took.
const PATIENT_AFTER: usize = 2;
const PATIENCE: usize = 4;

/// How hard contact is, and how far Newton goes with it.
#[derive(Clone, Copy, Default)]
pub(super) struct ContactStage {
    /// Factor on the penalties, below 1 only while the way to a new shape or load is found; none where contact is as
    /// hard as it is.
    pub softening: Option<f64>,
    /// While the drive is assembled its flanks slip freely.
    pub assembling: bool,
    /// Soft stages end early.
    pub hurries: bool,
    /// Newton has [`PATIENCE`].
    pub patient: bool,
}

impl ContactStage {
    pub(crate) fn bore_law(self, law: BoreLaw) -> BoreLaw {
        // A bearing that yields is soft enough as it is.
        let soft = |factor: f64| law.stiffness.min((factor * law.stiffness).max(SOFTEST_BORE));
        BoreLaw { stiffness: self.softening.map_or(law.stiffness, soft) }
    }

    pub(crate) fn flank_law(self, law: FlankLaw) -> FlankLaw {
        let softening = self.softening.unwrap_or(1.0);
        FlankLaw {
            stiffness: softening * law.stiffness,
            stick_stiffness: softening * law.stick_stiffness,
            friction: if self.assembling { 0.0 } else { law.friction },
        }
    }

    pub(crate) fn tolerance(self, settings: &SolverSettings) -> f64 {
        let finds_the_way = self.hurries && self.softening.is_some();
        if finds_the_way { FOUND_THE_WAY.max(settings.tolerance) } else { settings.tolerance }
    }

    pub(crate) fn most_iterations(self, settings: &SolverSettings) -> usize {
        settings.max_iterations * if self.patient { PATIENCE } else { 1 }
    }
}

/// An equilibrium that is looked for.
#[derive(Clone, Copy)]
pub(super) struct Sought<'a> {
    /// Slip and drag are counted from this state.
    pub from: &'a State,
    pub generator_rad: f64,
    pub torque_n_m: f64,
    pub stage: ContactStage,
}

impl<'a> Sought<'a> {
    /// At a stage of the way that begins at `guess`. A drive that is assembled remembers nothing from before it.
    pub fn at(self, stage: ContactStage, guess: &'a State) -> Sought<'a> {
        Sought { from: if stage.assembling { guess } else { self.from }, stage, ..self }
    }
}

/// How a new load is brought on.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Way {
    /// With contact as hard as it is.
    Directly,
    /// With soft contact first, which only finds the way.
    Softly,
    /// With soft contact first, each stage brought to its end.
    Carefully,
}

impl Way {
    /// The ways to a load, the likeliest first. A load that changes has no predictor: unless the load that there is
    /// shows the way, a soft contact finds it first. Where one does not lead there the other may: teeth that bind
    /// without load sink into one another while they are soft, and wedge (two rollers in a hat, loaded to twice the
    /// drag). Last of all each soft stage is brought to its end.
    pub(crate) fn to_load(from_n_m: f64, torque_n_m: f64) -> [Way; 3] {
        if (SHOWS_THE_WAY..=SHOWS_THE_WAY.recip()).contains(&(from_n_m / torque_n_m)) {
            [Way::Directly, Way::Softly, Way::Carefully]
        } else {
            [Way::Softly, Way::Directly, Way::Carefully]
        }
    }

    /// Factors on the penalties before contact is as hard as it is.
    pub(crate) fn softness(self) -> &'static [f64] {
        if self == Way::Directly { &[] } else { &LOADING_SOFTNESS }
    }
}

/// An increment in parts: halved where Newton does not converge, doubled where it is easy.
pub(super) struct Continuation {
    from: [f64; 2],
    change: [f64; 2],
    /// Shares of the increment: done, and of the next part.
    done: f64,
    part: f64,
    halvings: usize,
    /// Newton needs patience.
    pub patient: bool,
    /// Newton's iterations so far.
    pub iterations: usize,
}

impl Continuation {
    /// A load is at first brought on in parts of `largest_n_m` at most.
    pub fn new(from: &State, generator_rad: f64, torque_n_m: f64, largest_n_m: f64) -> Continuation {
        let load = torque_n_m - from.torque_n_m;
        Continuation {
            from: [from.generator_rad, from.torque_n_m],
            change: [generator_rad - from.generator_rad, load],
            done: 0.0,
            part: (largest_n_m / load.abs()).min(1.0),
            halvings: 0,
            patient: false,
            iterations: 0,
        }
    }

    fn next_share(&self) -> f64 {
        (self.done + self.part).min(1.0)
    }

    /// Generator angle (rad) and load (N m) at the end of the next part.
    pub fn next(&self) -> [f64; 2] {
        [0, 1].map(|k| self.from[k] + self.change[k] * self.next_share())
    }

    pub(crate) fn changes_load(&self) -> bool {
        self.change[1] != 0.0
    }

    /// Whether a part that failed may be halved.
    pub(crate) fn may_halve(&self, problem: &Problem) -> bool {
        self.halvings < problem.settings.max_halvings && self.change != [0.0; 2]
    }

    /// The next part takes half the way.
    pub(crate) fn halve(&mut self, iterations: usize) {
        self.iterations += iterations;
        self.part *= 0.5;
        self.halvings += 1;
        self.patient = self.halvings >= PATIENT_AFTER;
    }

    /// Goes on from the end of a part; whether that is the end of the increment.
    pub(crate) fn advance(&mut self, iterations: usize) -> bool {
        self.iterations += iterations;
        self.done = self.next_share();
        if iterations <= EASY {
            self.part *= 2.0;
            self.halvings = self.halvings.saturating_sub(1);
        }
        self.done >= 1.0
    }
}
