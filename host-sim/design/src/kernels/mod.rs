//! Influence kernels: how a deviation at one tooth, at one place of the generator, or of a whole axis moves the output,
//! at each place in the wave and each load, from the contact FEM of the drive without deviations.
//!
//! # First order: load sharing
//!
//! Let `V(T; p)` be the stationary value of elastic and contact energy less `T δ`, with the generator held, load `T`,
//! output angle `δ` and a small deviation `p` of some surface. Then `∂V/∂T = −δ` and `∂V/∂p = f`, the force conjugate
//! to the deviation: the contact force in its direction. The mixed derivative is the same either way,
//!
//! ```text
//! ∂δ/∂p = − ∂f/∂T
//! ```
//!
//! so that what a deviation of any tooth does to the output is read from how the contact force *on that tooth* changes
//! as the load changes (Maxwell's reciprocity). One run under a few loads holds the kernels of all teeth, all spaces
//! and the whole generator. For a rigid pair of wheels this is `e = −(1/r) Σ share · p`. It holds without friction, for
//! deviations that are small against how far the contact patches give way.
//!
//! # Eccentricity
//!
//! Two lobes share the load evenly, so that to first order the push of an axis displaced by `s` cancels. What is left
//! is how one lobe closes up while the other opens: not linear in `s`, and the stronger the lighter the load. It is
//! computed by the FEM of the drive with the circular spline displaced, at a few sizes, directions and loads
//! ([`Eccentric`]). To this order a displaced axis of the flexspline's teeth is the same as the opposite displacement
//! of the circular spline.
//!
//! # Conventions
//!
//! Angles in rad, counter-clockwise; `place` is the angle of a tooth or space from the major axis of the generator
//! (from lobe 0). A position error is counter-clockwise along the pitch at half the height of the teeth
//! ([`flexspline_mechanics::drive::AsBuilt`]). Kernels are arc-seconds at the output for one micrometre. Loads are
//! positive; those of the other sign follow by mirror symmetry, which is applied here.

mod make;

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use flexspline_base::toml_file::Problem;
use flexspline_mechanics::drive::{DamagedFlank, GeneratorKind, Wheel};

pub use make::{KernelError, KernelPlan, KernelProgress, make};

/// Version of `<G>.kernels.json`.
pub(crate) const KERNELS_SCHEMA: u32 = 1;

/// A response to a harmonic `cos(k angle)` of a deviation: in phase with it and a quarter behind, arcsec per µm.
pub type Gain = [f64; 2];

/// Kernels of one generator in one drive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kernels {
    /// Version of this form.
    pub schema_version: u32,
    /// Which generator.
    pub generator: GeneratorKind,
    /// BLAKE3 of the drive, as tables of it carry it.
    pub drive_blake3: String,
    /// Mesh of the FEM.
    pub mesh: String,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Generator turns to one output turn.
    pub ratio: f64,
    /// Teeth of flexspline and circular spline.
    pub teeth: [u32; 2],
    /// Samples to a pitch of either wheel.
    pub positions: usize,
    /// Samples of each kernel cover this part of a turn: 2 where the state repeats after half a turn, else 1.
    pub repeats: usize,
    /// First-order kernels, lightest load first.
    pub loads: Vec<LoadKernels>,
    /// Effect of a displaced axis.
    pub eccentric: Eccentric,
}

/// First-order kernels under one load. Sample `c` belongs to the place `c · pitch / positions`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadKernels {
    /// Load, N m.
    pub torque_n_m: f64,
    /// Of flexspline teeth.
    pub flexspline: WheelKernels,
    /// Of circular-spline spaces.
    pub circular_spline: WheelKernels,
    /// Generator standing further out under one flexspline tooth, over one pitch of the bore.
    pub generator: Vec<f64>,
}

/// First-order kernels of the teeth of a wheel, arcsec per µm.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WheelKernels {
    /// Tooth (or space) displaced along the pitch.
    pub along: Vec<f64>,
    /// Tooth (or space) displaced outward.
    pub outward: Vec<f64>,
    /// Tooth (or space) turned about its middle, counter-clockwise, by 1 µm over the radius of the middle.
    pub turned: Vec<f64>,
    /// Material missing on its plus flank.
    pub plus_flank: Vec<f64>,
    /// Material missing on its minus flank.
    pub minus_flank: Vec<f64>,
}

/// Error of a drive whose circular spline stands beside the axis, less that of the ideal drive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Eccentric {
    /// Displacements, µm, ascending.
    pub sizes_um: Vec<f64>,
    /// Loads, N m, ascending.
    pub torques_n_m: Vec<f64>,
    /// Directions of the displacement from the major axis, evenly over half a turn (over a turn where `repeats` is 1),
    /// from 0.
    pub directions: usize,
    /// arcsec, `[size][load][direction]`.
    pub deviation_arcsec: Vec<Vec<Vec<f64>>>,
}

impl Kernels {
    /// Samples around a whole wheel.
    fn around(&self, wheel: Wheel) -> usize {
        self.positions * self.teeth[usize::from(wheel == Wheel::CircularSpline)] as usize
    }

    /// Value of a kernel at a place, rad from the major axis; linear between samples.
    fn at(&self, kernel: &[f64], wheel: Wheel, place_rad: f64) -> f64 {
        let n = kernel.len();
        let along = (place_rad / TAU * self.around(wheel) as f64).rem_euclid(n as f64);
        let below = along as usize % n;
        let part = along.fract();
        (1.0 - part) * kernel[below] + part * kernel[(below + 1) % n]
    }

    /// Neighbouring loads of a torque and the weight of the heavier: linear in the root of the load, held beyond the
    /// ends.
    fn between(torques: impl ExactSizeIterator<Item = f64> + Clone, load_n_m: f64) -> (usize, usize, f64) {
        let count = torques.len();
        let above = torques.clone().position(|t| t > load_n_m).unwrap_or(count);
        if above == 0 || above == count {
            let end = above.min(count - 1);
            return (end, end, 0.0);
        }
        let root = |k: usize| torques.clone().nth(k).unwrap_or(0.0).sqrt();
        let (low, high) = (root(above - 1), root(above));
        (above - 1, above, (load_n_m.sqrt() - low) / (high - low))
    }

    /// `value` at a load of either sign: by mirror symmetry (`mirrored` for a negative one), between the loads.
    fn under<const N: usize>(
        &self,
        torque_n_m: f64,
        value: impl Fn(&LoadKernels) -> [f64; N],
        mirrored: impl Fn(&LoadKernels) -> [f64; N],
    ) -> [f64; N] {
        let (low, high, part) = Self::between(self.loads.iter().map(|l| l.torque_n_m), torque_n_m.abs());
        let of = |k: usize| if torque_n_m < 0.0 { mirrored(&self.loads[k]) } else { value(&self.loads[k]) };
        let (low, high) = (of(low), of(high));
        std::array::from_fn(|k| (1.0 - part) * low[k] + part * high[k])
    }

    /// Response to a harmonic of a kernel, arcsec per µm: to `cos(k α)` on the wheel answers
    /// `g₀ cos(k θ) − g₁ sin(k θ)`, θ the angle of the generator as seen from the wheel.
    fn transfer(&self, kernel: &[f64], wheel: Wheel, order: f64) -> Gain {
        let around = self.around(wheel) as f64;
        // Only harmonics that repeat as the state does come through.
        let lobes = self.repeats as f64;
        if (order / lobes).fract() != 0.0 {
            return [0.0; 2];
        }
        let scale = lobes / self.positions as f64;
        kernel.iter().enumerate().fold([0.0; 2], |[c, s], (k, w)| {
            let angle = order * TAU * k as f64 / around;
            [c + scale * w * angle.cos(), s + scale * w * angle.sin()]
        })
    }

    /// Response to a cumulative pitch error `cos(order α)` µm of a wheel, α the angle on its body.
    pub fn pitch_error(&self, wheel: Wheel, order: u32, torque_n_m: f64) -> Gain {
        let gain = |l: &LoadKernels| self.transfer(&l.wheel(wheel).along, wheel, f64::from(order));
        self.under(torque_n_m, gain, |l| conjugate(gain(l)))
    }

    /// Error (arcsec) for each µm that one tooth (or space) at `place_rad` from the major axis is displaced along the
    /// pitch.
    pub(crate) fn displaced(&self, wheel: Wheel, place_rad: f64, torque_n_m: f64) -> f64 {
        let at = |l: &LoadKernels, place: f64| [self.at(&l.wheel(wheel).along, wheel, place)];
        // Mirrored, place, displacement and error all change their sign.
        let [error] = self.under(torque_n_m, |l| at(l, place_rad), |l| at(l, -place_rad));
        error
    }

    /// Response to an oval circular spline, `cos(2 α)` µm outward, with the displacement along the ring and the
    /// rotation of a ring that keeps its length.
    pub fn ovality(&self, torque_n_m: f64) -> Gain {
        let wheel = Wheel::CircularSpline;
        let gain = |l: &LoadKernels| {
            let k = l.wheel(wheel);
            let [out, along, turned] = [&k.outward, &k.along, &k.turned].map(|w| self.transfer(w, wheel, 2.0));
            // −½ sin 2α aside, 3/2 sin 2α turned; a move aside is one along the pitch less the turn that comes with it.
            // The response to sin is that to cos, a quarter behind.
            let quarter = |g: Gain| [g[1], -g[0]];
            let (along, turned) = (quarter(along), quarter(turned));
            [0, 1].map(|i| out[i] - 0.5 * along[i] + 2.0 * turned[i])
        };
        self.under(torque_n_m, gain, |l| conjugate(gain(l)).map(|x| -x))
    }

    /// Error (arcsec) for each µm that a flank lacks, its tooth (or, for the circular spline, its space) at `place_rad`
    /// from the major axis.
    pub fn missing(&self, wheel: Wheel, flank: DamagedFlank, place_rad: f64, torque_n_m: f64) -> f64 {
        let plus = |l: &LoadKernels, place: f64| self.at(&l.wheel(wheel).plus_flank, wheel, place);
        let minus = |l: &LoadKernels, place: f64| self.at(&l.wheel(wheel).minus_flank, wheel, place);
        let (p, m) = match flank {
            DamagedFlank::Plus => (1.0, 0.0),
            DamagedFlank::Minus => (0.0, 1.0),
            DamagedFlank::Both => (1.0, 1.0),
        };
        let value = |l: &LoadKernels| [p * plus(l, place_rad) + m * minus(l, place_rad)];
        let mirrored = |l: &LoadKernels| [-(p * minus(l, -place_rad) + m * plus(l, -place_rad))];
        let [error] = self.under(torque_n_m, value, mirrored);
        error
    }

    /// Error (arcsec) for each µm that the generator stands further out over one pitch of the bore at `place_rad`.
    pub fn generator(&self, place_rad: f64, torque_n_m: f64) -> f64 {
        let at = |l: &LoadKernels, place: f64| self.at(&l.generator, Wheel::Flexspline, place);
        let [error] = self.under(torque_n_m, |l| [at(l, place_rad)], |l| [-at(l, -place_rad)]);
        error
    }

    /// Where a load lies between those of the eccentricity: for [`EccentricField::at`].
    pub fn place_of_load(&self, torque_n_m: f64) -> PlaceOfLoad {
        let (low, high, part) = Self::between(self.eccentric.torques_n_m.iter().copied(), torque_n_m.abs());
        PlaceOfLoad { low, high, part }
    }

    /// Error of a circular spline whose axis stands `size_um` beside the generator's, in every direction and under
    /// every load. Between sizes linear, from nothing at nothing; beyond the largest along the last slope.
    pub fn eccentric_field(&self, size_um: f64) -> EccentricField {
        let e = &self.eccentric;
        let above = e.sizes_um.iter().position(|s| *s >= size_um).unwrap_or(e.sizes_um.len() - 1);
        let (low, high) = (if above == 0 { 0.0 } else { e.sizes_um[above - 1] }, e.sizes_um[above]);
        let part = (size_um - low) / (high - low);
        let at = |load: usize, direction: usize| {
            let of = |size: usize| e.deviation_arcsec[size][load][direction];
            let value_low = if above == 0 { 0.0 } else { of(above - 1) };
            value_low + (of(above) - value_low) * part
        };
        let n = e.directions;
        let by_load = (0..e.torques_n_m.len())
            .map(|load| {
                // Cubic in between (Catmull-Rom): the curve has a crest of a few tens of degrees.
                (0..n * FINER)
                    .map(|j| {
                        let (k, x) = (j / FINER, (j % FINER) as f64 / FINER as f64);
                        let [a, b, c, d] = [n - 1, 0, 1, 2].map(|i| at(load, (k + i) % n));
                        b + 0.5 * x * (c - a + x * (2.0 * a - 5.0 * b + 4.0 * c - d + x * (3.0 * (b - c) + d - a)))
                    })
                    .collect()
            })
            .collect();
        EccentricField { by_load, per_rad: (n * FINER * self.repeats) as f64 / TAU }
    }

    /// Error (arcsec) of a circular spline whose axis stands `size_um` beside the generator's, in the direction
    /// `direction_rad` from the major axis.
    pub fn eccentricity(&self, size_um: f64, direction_rad: f64, torque_n_m: f64) -> f64 {
        self.eccentric_field(size_um).at(direction_rad, torque_n_m < 0.0, self.place_of_load(torque_n_m))
    }

    /// Reads `<G>.kernels.json`.
    ///
    /// # Errors
    /// The [`Problem`] of the text: field, value found and what is allowed.
    pub fn from_json(text: &str) -> Result<Kernels, Problem> {
        let kernels: Kernels = serde_json::from_str(text).map_err(|error| Problem::of("", error.to_string()))?;
        if kernels.schema_version != KERNELS_SCHEMA {
            let what = format!("found {}, allowed: {KERNELS_SCHEMA}", kernels.schema_version);
            return Err(Problem::of("schema_version", what));
        }
        kernels.check().map(|()| kernels)
    }

    /// Whether sizes fit one another, so that evaluation cannot fail.
    pub(crate) fn check(&self) -> Result<(), Problem> {
        let ascending = |of: &[f64]| !of.is_empty() && of[0] > 0.0 && of.windows(2).all(|w| w[0] < w[1]);
        let torques: Vec<f64> = self.loads.iter().map(|l| l.torque_n_m).collect();
        let e = &self.eccentric;
        let lists = [
            ("loads: torque_n_m", &torques),
            ("eccentric.sizes_um", &e.sizes_um),
            ("eccentric.torques_n_m", &e.torques_n_m),
        ];
        for (what, list) in lists {
            if !ascending(list) {
                return Err(Problem::of(what, format!("found {list:?}, allowed: positive numbers, ascending")));
            }
        }
        if self.positions == 0 || !(1..=2).contains(&self.repeats) || self.teeth.contains(&0) {
            return Err(Problem::of("positions, repeats, teeth", "allowed: positive, repeats 1 or 2"));
        }
        for load in &self.loads {
            for wheel in [Wheel::Flexspline, Wheel::CircularSpline] {
                let (k, n) = (load.wheel(wheel), self.around(wheel) / self.repeats);
                let mut all = vec![&k.along, &k.outward, &k.turned, &k.plus_flank, &k.minus_flank];
                if wheel == Wheel::Flexspline {
                    all.push(&load.generator);
                }
                if let Some(wrong) = all.into_iter().find(|list| list.len() != n || list.iter().any(|x| !x.is_finite()))
                {
                    let field = format!("a kernel at {} N m", load.torque_n_m);
                    return Err(Problem::of(&field, format!("found {} numbers, allowed: {n}, finite", wrong.len())));
                }
            }
        }
        let shape = e.deviation_arcsec.len() == e.sizes_um.len()
            && e.deviation_arcsec.iter().all(|s| {
                s.len() == e.torques_n_m.len() && s.iter().all(|d| d.len() == e.directions && e.directions > 3)
            });
        let refused = || Problem::of("eccentric.deviation_arcsec", "allowed: [size][load][direction]");
        if shape { Ok(()) } else { Err(refused()) }
    }
}

/// Finer steps of direction in an [`EccentricField`] than in the file.
const FINER: usize = 8;

/// Where a load lies between those of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceOfLoad {
    low: usize,
    high: usize,
    part: f64,
}

/// Error of an eccentricity of one size by direction and load.
#[derive(Debug, Clone, PartialEq)]
pub struct EccentricField {
    by_load: Vec<Vec<f64>>,
    per_rad: f64,
}

impl EccentricField {
    /// Error (arcsec) with the axis displaced in a direction from the major axis, rad, under a load of either sign.
    pub fn at(&self, direction_rad: f64, negative_load: bool, load: PlaceOfLoad) -> f64 {
        let (sign, direction) = if negative_load { (-1.0, -direction_rad) } else { (1.0, direction_rad) };
        let n = self.by_load[load.low].len();
        let along = (direction * self.per_rad).rem_euclid(n as f64);
        let (k, x) = (along as usize % n, along.fract());
        let of = |load: usize| {
            let field = &self.by_load[load];
            (1.0 - x) * field[k] + x * field[(k + 1) % n]
        };
        sign * ((1.0 - load.part) * of(load.low) + load.part * of(load.high))
    }
}

impl LoadKernels {
    fn wheel(&self, wheel: Wheel) -> &WheelKernels {
        match wheel {
            Wheel::Flexspline => &self.flexspline,
            Wheel::CircularSpline => &self.circular_spline,
        }
    }
}

fn conjugate([c, s]: Gain) -> Gain {
    [c, -s]
}
