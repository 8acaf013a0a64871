//! The figures of a drive by kernels: linear in the errors of its teeth, by interpolation in how far its axes stand
//! apart, by parabolas in uniform changes.
//!
//! Over a turn of the output, at [`places`](Model::places) evenly apart, with `ψ` the angle of the generator,
//! `α = ψ (1 − 1/ratio)` that on the circular spline, and `s` the displacement of the axis of the circular spline from
//! that of the flexspline, seen from the major axis:
//!
//! ```text
//! e(ψ, T) = wave(ψ, T) + Σ p_k w_F(2πk/z_F − ψ, T) + Σ p_k w_C(2πk/z_C − α, T) + oval(α, T) + d(s(ψ), T)
//! s(ψ)    = offset at −ψ + eccentricity at −α − runout at −ψ − eccentricity of the generator
//! ```
//!
//! `wave` is settled motion over a tooth pitch of the drive that is alike everywhere; `w`, `oval` and `d` are those of
//! [`crate::kernels`]. Errors of teeth, displaced axes and uniform changes are assumed not to change each other's
//! effect.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::tolerance::{FieldTolerance, ToleranceActs};
use crate::kernels::{EccentricField, Gain, Kernels, PlaceOfLoad};
use crate::tables::places_that_tell_apart;
use flexspline_base::robust::{least_and_most, rms};
use flexspline_base::statistics::mean;
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_mechanics::drive::{AsBuilt, Wheel};

/// The figures of a drive by kernels, in the order of the columns of results.
pub const FIGURES: [&str; 12] = [
    "error_pp_arcsec",
    "error_rms_arcsec",
    "lost_motion_arcsec",
    "most_lost_motion_arcsec",
    "backlash_arcsec",
    "k1_n_m_per_rad",
    "k2_n_m_per_rad",
    "k3_n_m_per_rad",
    "wind_up_arcsec",
    "max_von_mises_mpa",
    "axes_apart_um",
    CLOSED,
];
/// Share of the places, %, without play between the flanks: lost motion there is the elastic wind-up alone.
pub(super) const CLOSED: &str = "play_closed_percent";
/// Figures of a data sheet that follow uniform changes.
pub(super) const SHEET: [&str; 6] =
    ["backlash_arcsec", "k1_n_m_per_rad", "k2_n_m_per_rad", "k3_n_m_per_rad", "wind_up_arcsec", "max_von_mises_mpa"];
/// Samples of the wave over a tooth pitch.
pub(super) const WAVE: usize = 8;
/// Numbers of the state of a drive without deviations: the wave under the load and under a light one, the sheet.
pub(super) const STATE: usize = 2 * WAVE + SHEET.len();
/// Samples of a wheel's error over its pitch. Kernels have a multiple.
const SAMPLES: usize = 4;
/// Places over a turn of the output, at least and at most.
const PLACES: [usize; 2] = [1009, 4001];
/// Orders that the places keep apart: of the generator, of the generator on the circular spline, of the output.
const ORDERS: [usize; 3] = [8, 8, 6];
/// How far apart orders stay where places fold them.
const APART: f64 = 0.9;

/// Response of the drive to uniform changes, by FEM.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Response {
    /// State of the middle drive: the wave under the load, the wave under the light load, the sheet; arcsec, N·m/rad,
    /// MPa.
    pub middle: Vec<f64>,
    /// Effect of each field that changes the drive uniformly.
    pub parabolas: Vec<Parabola>,
}

/// A parabola through three drives, for every number of the state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parabola {
    /// The field.
    pub field: String,
    /// Values of the field: below, of the middle drive, above.
    pub at: [f64; 3],
    /// Change of the state at the first.
    pub below: Vec<f64>,
    /// Change of the state at the last.
    pub above: Vec<f64>,
}

impl Response {
    /// Whether its sizes are such that evaluation cannot fail.
    pub(super) fn fits(&self) -> bool {
        let all = self.parabolas.iter().flat_map(|p| [&p.below, &p.above]).chain([&self.middle]);
        all.into_iter().all(|list| list.len() == STATE)
    }

    /// State of a drive whose fields of the parabolas have these values.
    fn at(&self, values: &[f64]) -> Vec<f64> {
        let mut state = self.middle.clone();
        for (parabola, value) in self.parabolas.iter().zip(values) {
            let [a, m, b] = parabola.at;
            let below = (value - m) * (value - b) / ((a - m) * (a - b));
            let above = (value - a) * (value - m) / ((b - a) * (b - m));
            for ((x, low), high) in state.iter_mut().zip(&parabola.below).zip(&parabola.above) {
                *x += below * low + above * high;
            }
        }
        state
    }
}

/// Kernels of a wheel's teeth, as they are summed: by load, by sample within a pitch, twice around for sums in one
/// piece.
struct WheelSums {
    wheel: Wheel,
    teeth: usize,
    /// Teeth after which the state repeats.
    period: usize,
    weights: Vec<[Vec<f64>; SAMPLES]>,
}

impl WheelSums {
    fn new(kernels: &Kernels, wheel: Wheel, torques: &[f64]) -> WheelSums {
        let teeth = kernels.teeth[usize::from(wheel == Wheel::CircularSpline)] as usize;
        let period = teeth / kernels.repeats;
        let place = |k: usize, b: usize| TAU * (k as f64 - b as f64 / SAMPLES as f64) / teeth as f64;
        let of = |torque: f64| {
            std::array::from_fn(|b| {
                (0..2 * period).map(|k| kernels.displaced(wheel, place(k, b), torque)).collect::<Vec<f64>>()
            })
        };
        WheelSums { wheel, teeth, period, weights: torques.iter().map(|torque| of(*torque)).collect() }
    }

    /// Position errors of the teeth, µm, summed over the teeth that bear alike.
    fn positions(&self, built: &AsBuilt) -> Vec<f64> {
        let (list, harmonics) = match self.wheel {
            Wheel::Flexspline => (&built.flexspline_pitch_error_um, &built.flexspline_pitch_harmonics),
            Wheel::CircularSpline => (&built.circular_spline_pitch_error_um, &built.circular_spline_pitch_harmonics),
        };
        let mut all = if list.is_empty() { vec![0.0; self.teeth] } else { list.clone() };
        for harmonic in harmonics {
            for (k, error) in all.iter_mut().enumerate() {
                let angle = TAU * k as f64 / self.teeth as f64 - harmonic.phase_deg.to_radians();
                *error += harmonic.amplitude_um * libm::cos(f64::from(harmonic.order) * angle);
            }
        }
        let (first, rest) = all.split_at_mut(self.period);
        for other in rest.chunks(self.period) {
            first.iter_mut().zip(other).for_each(|(sum, error)| *sum += error);
        }
        all.truncate(self.period);
        all
    }

    /// Error by the angle of the wave on the wheel, `SAMPLES` to a pitch, over a period.
    fn field(&self, load: usize, positions: &[f64]) -> Vec<f64> {
        let n = self.period;
        (0..n * SAMPLES)
            .map(|c| {
                let (a, b) = (c / SAMPLES, c % SAMPLES);
                let from = (n - a) % n;
                dot(positions, &self.weights[load][b][from..from + n])
            })
            .collect()
    }
}

/// Four sums at once, always in the same order.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    for (x, y) in a.chunks(4).zip(b.chunks(4)) {
        for ((sum, x), y) in sums.iter_mut().zip(x).zip(y) {
            *sum += x * y;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// A periodic curve between its samples; `turns` of its period.
fn along(samples: &[f64], turns: f64) -> f64 {
    let n = samples.len();
    let place = (turns - turns.floor()) * n as f64;
    let k = (place as usize).min(n - 1);
    let part = place - k as f64;
    (1.0 - part) * samples[k] + part * samples[(k + 1) % n]
}

/// Where the drive stands: angles of the generator and of the wave on the circular spline.
#[derive(Debug, Clone, Copy)]
struct DriveAngles {
    turns: [f64; 2],
    /// Cosine and sine of both.
    directions: [[f64; 2]; 2],
}

impl DriveAngles {
    fn at(generator_turns: f64, ratio: f64) -> DriveAngles {
        let turns = [generator_turns, generator_turns * (1.0 - 1.0 / ratio)];
        let direction = |turns: f64| vector(1.0, TAU * (turns - turns.floor()));
        DriveAngles { turns, directions: turns.map(direction) }
    }
}

/// A vector of a part, turned back by the angle of the wave on it.
fn turned([x, y]: [f64; 2], [c, s]: [f64; 2]) -> [f64; 2] {
    [c * x + s * y, c * y - s * x]
}

fn vector(size: f64, angle: f64) -> [f64; 2] {
    [size * libm::cos(angle), size * libm::sin(angle)]
}

/// The curves of one drive.
struct Curves {
    /// Of the teeth of both wheels, by load.
    wheels: [Vec<Vec<f64>>; 2],
    oval: [f64; 2],
    /// Displacements: on the flexspline, on the circular spline, on the generator.
    apart: [[f64; 2]; 3],
    waves: [Vec<f64>; 2],
}

/// Evaluates drives with one generator.
pub(super) struct KernelModel {
    teeth: [u32; 2],
    pub response: Response,
    wheels: [WheelSums; 2],
    ovals: Vec<Gain>,
    apart: Vec<(f64, EccentricField)>,
    loads: [PlaceOfLoad; 2],
    /// The light load, N·m.
    light_n_m: f64,
    places: Vec<DriveAngles>,
}

/// Loads of the model: +T, −T, +t, −t.
const SIGNS: [(usize, bool); 4] = [(0, false), (0, true), (1, false), (1, true)];

impl KernelModel {
    /// `torques_n_m`: the load, and the light load of lost motion.
    pub(super) fn new(kernels: &Kernels, response: Response, torques_n_m: [f64; 2]) -> KernelModel {
        let signed = SIGNS.map(|(load, negative)| if negative { -torques_n_m[load] } else { torques_n_m[load] });
        let ratio = kernels.ratio;
        let kept_apart = ORDERS.into_iter().zip([ratio, ratio - 1.0, 1.0]);
        let orders: Vec<f64> = kept_apart.flat_map(|(waves, of)| (1..=waves).map(move |k| k as f64 * of)).collect();
        let count = places_that_tell_apart(&orders, PLACES, APART);
        KernelModel {
            teeth: kernels.teeth,
            response,
            wheels: [Wheel::Flexspline, Wheel::CircularSpline].map(|wheel| WheelSums::new(kernels, wheel, &signed)),
            ovals: signed.iter().map(|torque| kernels.ovality(*torque)).collect(),
            apart: kernels.eccentric.sizes_um.iter().map(|size| (*size, kernels.eccentric_field(*size))).collect(),
            loads: torques_n_m.map(|torque| kernels.place_of_load(torque)),
            light_n_m: torques_n_m[1],
            places: (0..count).map(|j| DriveAngles::at(ratio * j as f64 / count as f64, ratio)).collect(),
        }
    }

    fn curves(&self, built: &AsBuilt, state: &[f64]) -> Curves {
        let of_wheel = |wheel: &WheelSums| {
            let positions = wheel.positions(built);
            (0..SIGNS.len()).map(|load| wheel.field(load, &positions)).collect()
        };
        let part = |size_um: f64, phase_deg: f64| vector(size_um, phase_deg.to_radians());
        let offset = part(built.circular_spline_offset_um, built.circular_spline_offset_direction_deg);
        let runout = part(-built.flexspline_runout_um, built.flexspline_runout_phase_deg);
        Curves {
            wheels: self.wheels.each_ref().map(of_wheel),
            oval: part(built.circular_spline_ovality_um, 2.0 * built.circular_spline_ovality_phase_deg),
            apart: [
                [offset[0] + runout[0], offset[1] + runout[1]],
                part(built.circular_spline_eccentricity_um, built.circular_spline_eccentricity_phase_deg),
                part(-built.generator_eccentricity_um, built.generator_eccentricity_phase_deg),
            ],
            waves: [state[..WAVE].to_vec(), state[WAVE..2 * WAVE].to_vec()],
        }
    }

    /// Displacement of the axis of the circular spline from that of the flexspline, µm, and its direction from the
    /// major axis.
    fn apart_at(apart: &[[f64; 2]; 3], place: &DriveAngles) -> (f64, f64) {
        let [[x, y], [u, v]] = [0, 1].map(|part| turned(apart[part], place.directions[part]));
        let [x, y] = [x + u + apart[2][0], y + v + apart[2][1]];
        ((x * x + y * y).sqrt(), libm::atan2(y, x))
    }

    /// Errors at a place under each of the [`SIGNS`], arcsec.
    fn errors(&self, curves: &Curves, place: &DriveAngles) -> [f64; 4] {
        let in_pitch = place.turns[0] * f64::from(self.teeth[0]);
        // cos 2(α − crest) and sin 2(α − crest), α the angle of the wave on the circular spline.
        let ([c, s], oval) = (place.directions[1], curves.oval);
        let (c2, s2) = (c * c - s * s, 2.0 * c * s);
        let (distance, direction) = KernelModel::apart_at(&curves.apart, place);
        std::array::from_fn(|load| {
            let (size, negative) = SIGNS[load];
            let wave = &curves.waves[size];
            // Mirrored, the drive stands on the other side of its place and errs the other way.
            let mut error = if negative { -along(wave, -in_pitch) } else { along(wave, in_pitch) };
            for ((wheel, fields), turns) in self.wheels.iter().zip(&curves.wheels).zip(place.turns) {
                error += along(&fields[load], turns * (wheel.teeth / wheel.period) as f64);
            }
            let [g, h] = self.ovals[load];
            error += g * (c2 * oval[0] + s2 * oval[1]) - h * (s2 * oval[0] - c2 * oval[1]);
            error + self.eccentric(distance, direction, negative, self.loads[size])
        })
    }

    /// Between sizes linear, as [`Kernels::eccentric_field`].
    fn eccentric(&self, size_um: f64, direction: f64, negative: bool, load: PlaceOfLoad) -> f64 {
        let above = self.apart.iter().position(|(size, _)| *size >= size_um).unwrap_or(self.apart.len() - 1);
        let at = |k: usize| self.apart[k].1.at(direction, negative, load);
        let (low, below) = if above == 0 { (0.0, 0.0) } else { (self.apart[above - 1].0, at(above - 1)) };
        below + (at(above) - below) * (size_um - low) / (self.apart[above].0 - low)
    }

    /// The figures of a drive, in the order of [`FIGURES`]; `values` are those of the fields of the parabolas.
    pub(super) fn figures(&self, built: &AsBuilt, values: &[f64]) -> Vec<f64> {
        let state = self.response.at(values);
        let curves = self.curves(built, &state);
        let errors: Vec<[f64; 4]> = self.places.iter().map(|place| self.errors(&curves, place)).collect();
        let loaded: Vec<f64> = errors.iter().map(|e| e[0]).collect();
        let wind_up = least_wind_up(&state, self.light_n_m);
        let by_kernels = errors.iter().map(|e| e[2] - e[3]);
        let closed = by_kernels.clone().filter(|lost| *lost < wind_up).count();
        let lost: Vec<f64> = by_kernels.map(|lost| lost.max(wind_up)).collect();
        let (pp, rms) = spread(&loaded);
        let apart = |place| KernelModel::apart_at(&curves.apart, place).0;
        let apart = self.places.iter().map(apart).fold(0.0, f64::max);
        let mut all = vec![pp, rms, mean(&lost), least_and_most(lost.iter().copied()).1];
        all.extend_from_slice(&state[2 * WAVE..]);
        all.extend([apart, 100.0 * closed as f64 / lost.len() as f64]);
        all
    }
}

/// Lost motion without play, arcsec: the wind-up between the light loads at the stiffest of K1, K2 and K3.
///
/// Kernels add up how far each deviation reduces the play. Without play flanks bear on both sides, and nothing is left
/// to reduce.
fn least_wind_up(state: &[f64], light_n_m: f64) -> f64 {
    let sheet = SHEET.iter().zip(&state[2 * WAVE..]);
    let stiffest = sheet.filter(|(name, _)| name.starts_with('k')).map(|(_, k)| *k).fold(0.0, f64::max);
    if stiffest > 0.0 { 2.0 * light_n_m / stiffest * ARCSEC_PER_RAD } else { 0.0 }
}

/// Peak to peak, and root mean square about the mean.
fn spread(values: &[f64]) -> (f64, f64) {
    let (middle, (low, high)) = (mean(values), least_and_most(values.iter().copied()));
    (high - low, rms(&values.iter().map(|e| e - middle).collect::<Vec<f64>>()))
}

/// Whether a tolerance needs kernels of displaced axes.
pub(super) fn displaces(tolerance: &FieldTolerance) -> bool {
    tolerance.acts == ToleranceActs::Directed && tolerance.field != "as_built.circular_spline_ovality_um"
}

#[cfg(test)]
impl KernelModel {
    /// Error of a drive without uniform changes under the load, at a place of the generator in turns, arcsec.
    pub(super) fn error_at(&self, built: &AsBuilt, generator: f64, ratio: f64) -> f64 {
        let curves = self.curves(built, &self.response.middle);
        self.errors(&curves, &DriveAngles::at(generator, ratio))[0]
    }
}
