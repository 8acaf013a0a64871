//! The drive between motor and load as a potential: what it stores is a function of both angles, so it can make no
//! energy.
//!
//! ```text
//! x  = δ − ψ/N − e(ψ, δ)              twist beyond the kinematic error e
//! V  = U(x, Zψ)                       energy stored; F = ∂U/∂x the torque in the mesh
//! on the load:   −∂V/∂δ = −F·(1 − ∂e/∂δ)
//! on the motor:  −∂V/∂ψ =  F/N·(1 + N·∂e/∂ψ) − ∂U/∂ψ
//! ```
//! A drive that pulled at its motor with F/N alone would make energy from every line of its error, most of it at
//! resonance.

use core::f64::consts::TAU;

/// A line of the kinematic error: `amplitude·sin(generator·ψ + output·δ + phase)`, rad at the output.
///
/// An error of the flexspline's teeth of order k has `generator = k`; one of the circular spline, which is met at ψ −
/// δ, `k` and `−k`; of the encoder at the output, `0` and `k`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GearLine {
    /// Periods in a generator turn, the output held.
    pub generator: f64,
    /// Periods in an output turn, the generator held.
    pub output: f64,
    /// Amplitude at the output, rad.
    pub amplitude_rad: f64,
    /// Phase, rad.
    pub phase_rad: f64,
}

impl GearLine {
    /// Of its periods, amplitude and phase, in the order of its fields.
    pub(crate) fn of(&[generator, output, amplitude_rad, phase_rad]: &[f64; 4]) -> Self {
        GearLine { generator, output, amplitude_rad, phase_rad }
    }

    /// Sine and cosine at two angles.
    fn turned(&self, generator_rad: f64, output_rad: f64) -> (f64, f64) {
        libm::sincos(self.generator * generator_rad + self.output * output_rad + self.phase_rad)
    }
}

/// Twist, and sines and cosines of everything that turns, at one place. Near it they are found by adding angles, which
/// costs a third of asking for each anew, and does not round what is near to the last digit of a large angle: times the
/// stiffness that would be 4e-10 N·m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Near {
    error_rad: f64,
    twist_rad: f64,
    /// Of the tooth pitch, and of each line.
    pitch: (f64, f64),
    lines: Vec<(f64, f64)>,
}

/// Up to this angle the series below are exact to rounding.
const SMALL_RAD: f64 = 0.03;

/// Sine and cosine, turned on by an angle.
fn turned_on((s, c): (f64, f64), by: f64) -> (f64, f64) {
    let (sine, cosine) = if by.abs() < SMALL_RAD {
        let square = by * by;
        (
            by * (1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))),
            1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0)),
        )
    } else {
        libm::sincos(by)
    };
    (s * cosine + c * sine, c * cosine - s * sine)
}

/// How many harmonics of the tooth pitch a sampled spring keeps.
pub(crate) const PITCH_HARMONICS: usize = 4;
/// Curves of a sampled spring: the mean, and cosine and sine of each harmonic.
const CURVES: usize = 1 + 2 * PITCH_HARMONICS;
/// Intervals of a sampled spring.
const INTERVALS: usize = 512;
/// Phases at which a spring is sampled.
const PHASES: usize = 16;
/// Halvings in which a torque or a twist is found: to 2⁻⁴⁰ of the range.
const HALVINGS: usize = 40;
/// Doublings that take a twist from a millionth of a radian to a radian.
const DOUBLINGS: usize = 20;

/// One interval of a curve: the energy at its beginning, and the torque as a cubic of the place in it, from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Piece {
    energy: f64,
    torque: [f64; 4],
}

/// A spring sampled from a map or a table: a cubic for each interval of the twist and each harmonic of the tooth pitch.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledSpring {
    /// By interval, then curve.
    pieces: Vec<[Piece; CURVES]>,
    width_rad: f64,
    teeth: f64,
}

/// The wind-up: what torque goes with what twist.
#[derive(Clone, Debug, PartialEq)]
pub enum Spring {
    /// `k·y + h·y³` for a twist `y` beyond the clearance.
    Cubic {
        /// Half of the clearance, rad.
        half_clearance_rad: f64,
        /// Stiffness where the flanks begin to touch, N·m/rad.
        stiffness: f64,
        /// Hardening, N·m/rad³.
        hardening: f64,
    },
    /// From a map or a table.
    Sampled(Box<SampledSpring>),
}

/// Torque and stiffness of a spring at a twist.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sprung {
    /// Energy stored, J.
    pub energy_j: f64,
    /// Torque in the mesh, N·m, positive where it turns the motor forward and the load back.
    pub torque_n_m: f64,
    /// Its slope, N·m/rad.
    pub stiffness: f64,
    /// Slope of the energy over the generator angle, the twist held, N·m.
    pub by_generator: f64,
}

impl SampledSpring {
    /// From an error law: `error(phase, flank)` is the error (rad) under a positive flank torque at a phase of the
    /// tooth pitch from 0 to 1, rising with the torque. Negative torques are its mirror image.
    pub fn of_law(teeth: f64, largest_n_m: f64, error: impl Fn(f64, f64) -> f64) -> Self {
        let phase = |k: usize| k as f64 / PHASES as f64;
        let most = (0..PHASES).map(|k| error(phase(k), largest_n_m)).fold(f64::INFINITY, f64::min);
        let width_rad = most / INTERVALS as f64;
        let torque = |k: usize, twist: f64| {
            if error(phase(k), 0.0) >= twist {
                return 0.0;
            }
            let (mut low, mut high) = (0.0, largest_n_m);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                if error(phase(k), middle) < twist {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            0.5 * (low + high)
        };
        let mut nodes = vec![[0.0; CURVES]; INTERVALS + 1];
        for (at, node) in nodes.iter_mut().enumerate() {
            let found: [f64; PHASES] = core::array::from_fn(|k| torque(k, width_rad * at as f64));
            node[0] = found.iter().sum::<f64>() / PHASES as f64;
            for harmonic in 1..=PITCH_HARMONICS {
                let (mut cosine, mut sine) = (0.0, 0.0);
                for (k, value) in found.iter().enumerate() {
                    let (s, c) = libm::sincos(TAU * harmonic as f64 * phase(k));
                    cosine += value * c;
                    sine += value * s;
                }
                node[2 * harmonic - 1] = 2.0 * cosine / PHASES as f64;
                node[2 * harmonic] = 2.0 * sine / PHASES as f64;
            }
        }
        Self { pieces: pieces(&nodes, width_rad), width_rad, teeth }
    }

    /// Stiffer by a factor, and with so much more clearance on each side: what a unit has beside the nominal drive.
    pub fn as_built(&self, stiffer: f64, wider_rad: f64) -> Self {
        let scaled = |twist: f64| {
            let inner = ((twist - wider_rad) * stiffer).max(0.0);
            let (index, along) = self.place(inner);
            core::array::from_fn(|curve| cubic(&self.pieces[index][curve].torque, along))
        };
        let width_rad = self.width_rad / stiffer + wider_rad / INTERVALS as f64;
        let nodes: Vec<[f64; CURVES]> = (0..=INTERVALS).map(|k| scaled(width_rad * k as f64)).collect();
        Self { pieces: pieces(&nodes, width_rad), width_rad, teeth: self.teeth }
    }

    /// Its mean over the tooth pitch.
    pub(crate) fn without_ripple(&self) -> Self {
        let mean = |curves: &[Piece; CURVES]| {
            let [mean, ..] = curves;
            core::array::from_fn(|curve| if curve == 0 { *mean } else { Piece::default() })
        };
        Self { pieces: self.pieces.iter().map(mean).collect(), ..*self }
    }

    fn place(&self, twist: f64) -> (usize, f64) {
        let place = twist / self.width_rad;
        let index = (place as usize).min(self.pieces.len() - 1);
        (index, place - index as f64)
    }

    /// At a twist of zero or more, the pitch turned by `(cos Zψ, sin Zψ)`.
    fn at(&self, twist: f64, pitch: (f64, f64)) -> Sprung {
        let (index, along) = self.place(twist);
        let within = along.min(1.0);
        // Beyond the last node the torque goes on straight.
        let beyond = along - within;
        let width = self.width_rad;
        let mut out = Sprung::default();
        let (mut c, mut s) = (1.0, 0.0);
        for harmonic in 0..=PITCH_HARMONICS {
            let curves = &self.pieces[index];
            let mut add = |curve: usize, weight: f64, turning: f64| {
                let Piece { energy, torque } = &curves[curve];
                let slope = slope(torque, within);
                let at = cubic(torque, within);
                let energy = energy + width * (integral(torque, within) + beyond * (at + 0.5 * beyond * slope));
                out.energy_j += weight * energy;
                out.torque_n_m += weight * (at + beyond * slope);
                out.stiffness += weight * slope / width;
                out.by_generator += turning * energy;
            };
            let order = harmonic as f64 * self.teeth;
            if harmonic == 0 {
                add(0, 1.0, 0.0);
            } else {
                add(2 * harmonic - 1, c, -order * s);
                add(2 * harmonic, s, order * c);
            }
            (c, s) = (c * pitch.0 - s * pitch.1, s * pitch.0 + c * pitch.1);
        }
        out
    }
}

/// Cubics through nodes: monotone in the mean, so that there is no torque where there is none, smooth in the rest.
fn pieces(nodes: &[[f64; CURVES]], width_rad: f64) -> Vec<[Piece; CURVES]> {
    let slope = |k: usize, curve: usize| {
        let at = |k: usize| nodes[k][curve];
        match k {
            0 => 0.0,
            k if k + 1 == nodes.len() => at(k) - at(k - 1),
            k => {
                let (before, after) = (at(k) - at(k - 1), at(k + 1) - at(k));
                if curve > 0 {
                    0.5 * (before + after)
                } else if before * after <= 0.0 {
                    0.0
                } else {
                    2.0 * before * after / (before + after)
                }
            }
        }
    };
    let torque = |k: usize, curve: usize| {
        let (a, b) = (nodes[k][curve], nodes[k + 1][curve]);
        let (u, v) = (slope(k, curve), slope(k + 1, curve));
        [a, u, 3.0 * (b - a) - 2.0 * u - v, 2.0 * (a - b) + u + v]
    };
    let mut energies = [0.0; CURVES];
    let interval = |k: usize| {
        core::array::from_fn(|curve| {
            let torque = torque(k, curve);
            let energy = energies[curve];
            energies[curve] += width_rad * integral(&torque, 1.0);
            Piece { energy, torque }
        })
    };
    (0..nodes.len() - 1).map(interval).collect()
}

fn cubic(c: &[f64; 4], x: f64) -> f64 {
    c[0] + x * (c[1] + x * (c[2] + x * c[3]))
}

fn slope(c: &[f64; 4], x: f64) -> f64 {
    c[1] + x * (2.0 * c[2] + x * 3.0 * c[3])
}

fn integral(c: &[f64; 4], x: f64) -> f64 {
    x * (c[0] + x * (c[1] / 2.0 + x * (c[2] / 3.0 + x * c[3] / 4.0)))
}

/// A drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Gear {
    /// Generator over output.
    pub ratio: f64,
    /// Its kinematic error.
    pub lines: Vec<GearLine>,
    /// Its wind-up and clearance.
    pub spring: Spring,
}

/// Torques of a drive at a generator and an output angle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Meshed {
    /// Energy stored, J.
    pub energy_j: f64,
    /// Torque in the mesh, N·m.
    pub torque_n_m: f64,
    /// Its slope over the twist, N·m/rad.
    pub stiffness: f64,
    /// Twist beyond the kinematic error, rad.
    pub twist_rad: f64,
    /// Slope of the twist over generator/ratio, and over the output.
    pub twist_by: [f64; 2],
    /// Slope of the energy over generator/ratio, and over the output, N·m.
    pub energy_by: [f64; 2],
}

impl Gear {
    /// The kinematic error, and its slopes over generator and output angle.
    pub fn error(&self, generator_rad: f64, output_rad: f64) -> [f64; 3] {
        self.summed(self.lines.iter().map(|line| line.turned(generator_rad, output_rad)))
    }

    /// Of sine and cosine of each line.
    fn summed(&self, turned: impl Iterator<Item = (f64, f64)>) -> [f64; 3] {
        let mut out = [0.0; 3];
        for (GearLine { generator, output, amplitude_rad, .. }, (s, c)) in self.lines.iter().zip(turned) {
            out[0] += amplitude_rad * s;
            out[1] += amplitude_rad * c * generator;
            out[2] += amplitude_rad * c * output;
        }
        out
    }

    /// All of it as numbers, for a file: ratio, how many lines, the lines, and the spring.
    pub fn numbers(&self) -> Vec<f64> {
        let mut numbers = vec![self.ratio, self.lines.len() as f64];
        for GearLine { generator, output, amplitude_rad, phase_rad } in &self.lines {
            numbers.extend([generator, output, amplitude_rad, phase_rad]);
        }
        match &self.spring {
            Spring::Cubic { half_clearance_rad, stiffness, hardening } => {
                numbers.extend([0.0, *half_clearance_rad, *stiffness, *hardening]);
            }
            Spring::Sampled(sampled) => {
                numbers.extend([1.0, sampled.width_rad, sampled.teeth]);
                for Piece { energy, torque } in sampled.pieces.iter().flatten() {
                    numbers.push(*energy);
                    numbers.extend(torque);
                }
            }
        }
        numbers
    }

    /// From [`Self::numbers`]; `None` if numbers are missing, too many, or not finite.
    pub fn of_numbers(numbers: &[f64]) -> Option<Self> {
        if !numbers.iter().all(|number| number.is_finite()) {
            return None;
        }
        let ([ratio, count], rest) = numbers.split_first_chunk::<2>()?;
        // More than there are numbers is refused by the split.
        let (lines, rest) = rest.split_at_checked((*count as usize).checked_mul(4)?)?;
        let lines = lines.as_chunks::<4>().0.iter().map(GearLine::of).collect();
        let (kind, rest) = rest.split_first()?;
        let spring = if *kind == 0.0 {
            let &[half_clearance_rad, stiffness, hardening] = rest else { return None };
            Spring::Cubic { half_clearance_rad, stiffness, hardening }
        } else {
            let (&[width_rad, teeth], rest) = rest.split_first_chunk::<2>()?;
            let (numbers, left) = rest.as_chunks::<{ 5 * CURVES }>();
            if numbers.len() != INTERVALS || !left.is_empty() || width_rad <= 0.0 {
                return None;
            }
            let curve = |numbers: &[f64], k: usize| {
                let at = |n: usize| numbers[5 * k + n];
                Piece { energy: at(0), torque: [at(1), at(2), at(3), at(4)] }
            };
            let pieces = numbers.iter().map(|numbers| core::array::from_fn(|k| curve(numbers, k))).collect();
            Spring::Sampled(Box::new(SampledSpring { pieces, width_rad, teeth }))
        };
        (*ratio != 0.0).then_some(Self { ratio: *ratio, lines, spring })
    }

    /// Sine and cosine of the tooth pitch.
    fn pitch(&self, generator_rad: f64) -> (f64, f64) {
        match &self.spring {
            Spring::Cubic { .. } => (0.0, 1.0),
            Spring::Sampled(sampled) => libm::sincos(sampled.teeth * generator_rad),
        }
    }

    fn sprung(&self, (s, c): (f64, f64), twist: f64) -> Sprung {
        match &self.spring {
            Spring::Cubic { half_clearance_rad, stiffness, hardening } => {
                let beyond = (twist.abs() - half_clearance_rad).max(0.0);
                let square = beyond * beyond;
                let slope = if beyond > 0.0 { stiffness + 3.0 * hardening * square } else { 0.0 };
                Sprung {
                    energy_j: square * (0.5 * stiffness + 0.25 * hardening * square),
                    torque_n_m: libm::copysign(beyond * (stiffness + hardening * square), twist),
                    stiffness: slope,
                    by_generator: 0.0,
                }
            }
            Spring::Sampled(sampled) => {
                // A drive is its own mirror image.
                if twist < 0.0 {
                    let mirrored = sampled.at(-twist, (c, -s));
                    Sprung { torque_n_m: -mirrored.torque_n_m, by_generator: -mirrored.by_generator, ..mirrored }
                } else {
                    sampled.at(twist, (c, s))
                }
            }
        }
    }

    /// Its torques at a generator angle over the ratio, and an output angle.
    pub fn at(&self, motor_rad: f64, output_rad: f64) -> Meshed {
        let generator_rad = motor_rad * self.ratio;
        let error = self.error(generator_rad, output_rad);
        let [error_rad, ..] = error;
        self.meshed(output_rad - motor_rad - error_rad, error, self.pitch(generator_rad))
    }

    /// Makes a place to ask near of.
    pub(crate) fn nearby(&self, near: &mut Near, motor_rad: f64, output_rad: f64) {
        let generator_rad = motor_rad * self.ratio;
        near.pitch = self.pitch(generator_rad);
        near.lines.clear();
        near.lines.extend(self.lines.iter().map(|line| line.turned(generator_rad, output_rad)));
        [near.error_rad, ..] = self.summed(near.lines.iter().copied());
        near.twist_rad = output_rad - motor_rad - near.error_rad;
    }

    /// As [`Self::at`], so much further than a place: generator angle over ratio, and output.
    pub(crate) fn at_near(&self, near: &Near, motor_by_rad: f64, output_by_rad: f64) -> Meshed {
        let (generator, output) = (motor_by_rad * self.ratio, output_by_rad);
        let turned =
            |(line, at): (&GearLine, &(f64, f64))| turned_on(*at, line.generator * generator + line.output * output);
        let error = self.summed(self.lines.iter().zip(&near.lines).map(turned));
        let pitch = match &self.spring {
            Spring::Cubic { .. } => near.pitch,
            Spring::Sampled(sampled) => turned_on(near.pitch, sampled.teeth * generator),
        };
        let [error_rad, ..] = error;
        self.meshed(near.twist_rad + (output_by_rad - motor_by_rad - (error_rad - near.error_rad)), error, pitch)
    }

    /// At a twist, with the error's slopes and the pitch turned so far.
    fn meshed(&self, twist_rad: f64, error: [f64; 3], pitch: (f64, f64)) -> Meshed {
        let [_, by_generator, by_output] = error;
        let Sprung { energy_j, torque_n_m, stiffness, by_generator: turning } = self.sprung(pitch, twist_rad);
        let twist_by = [-(1.0 + self.ratio * by_generator), 1.0 - by_output];
        let energy_by = [torque_n_m * twist_by[0] + self.ratio * turning, torque_n_m * twist_by[1]];
        Meshed { energy_j, torque_n_m, stiffness, twist_rad, twist_by, energy_by }
    }

    /// Error of the output at rest (rad: output less generator over ratio) with this torque in the mesh; for none, on
    /// the side of `sign`.
    pub(crate) fn error_under_rad(&self, generator_rad: f64, mesh_n_m: f64, sign: f64) -> f64 {
        let side = if mesh_n_m == 0.0 { sign } else { mesh_n_m };
        let pitch = self.pitch(generator_rad);
        let torque = |twist: f64| self.sprung(pitch, libm::copysign(twist, side)).torque_n_m.abs();
        let (mut low, mut high) = (0.0, 1e-6);
        for _ in 0..DOUBLINGS {
            if !(torque(high) <= mesh_n_m.abs() && high < 1.0) {
                break;
            }
            high *= 2.0;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if torque(middle) <= mesh_n_m.abs() {
                low = middle;
            } else {
                high = middle;
            }
        }
        let twist = libm::copysign(0.5 * (low + high), side);
        // Lines over the output angle are gentle.
        let mut output = generator_rad / self.ratio + twist;
        for _ in 0..2 {
            output = generator_rad / self.ratio + twist + self.error(generator_rad, output)[0];
        }
        output - generator_rad / self.ratio
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A law with a clearance, a corner in the wind-up and a ripple that changes with the load.
    fn law(phase: f64, flank: f64) -> f64 {
        1.5e-4 + 3e-6 * flank + 4e-5 * flank / (1.0 + 0.2 * flank) + 2e-6 * libm::cos(TAU * phase + 0.3)
    }

    fn gear() -> Gear {
        let lines = vec![
            GearLine { generator: 2.0, output: 0.0, amplitude_rad: 1e-4, phase_rad: 0.3 },
            GearLine { generator: 2.0, output: -2.0, amplitude_rad: 5e-5, phase_rad: 1.0 },
        ];
        Gear { ratio: 95.0, lines, spring: Spring::Sampled(Box::new(SampledSpring::of_law(188.0, 50.0, law))) }
    }

    #[test]
    fn a_sampled_spring_is_the_law_that_it_was_sampled_from() {
        let plain = Gear { lines: Vec::new(), ..gear() };
        for flank in [0.5, 3.0, 20.0, 45.0] {
            for k in 0..7 {
                let phase = f64::from(k) / 7.0;
                let found = plain.error_under_rad(TAU / 188.0 * phase, flank, 1.0);
                assert!((found - law(phase, flank)).abs() < 2e-7, "{flank} {phase}: {found} {}", law(phase, flank));
                // Its own mirror image.
                let mirrored = plain.error_under_rad(-TAU / 188.0 * phase, -flank, -1.0);
                assert!((mirrored + found).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_gear_of_numbers_is_the_same_and_damaged_ones_are_refused() {
        let gear = gear();
        let numbers = gear.numbers();
        assert_eq!(Gear::of_numbers(&numbers), Some(gear));
        let cubic = Spring::Cubic { half_clearance_rad: 1e-4, stiffness: 4e5, hardening: 2e12 };
        let cubic = Gear { ratio: -94.0, lines: Vec::new(), spring: cubic };
        assert_eq!(Gear::of_numbers(&cubic.numbers()), Some(cubic));
        assert_eq!(Gear::of_numbers(&numbers[..numbers.len() - 1]), None);
        for (at, value) in [(0, 0.0), (1, 1e300), (1, 1.0), (7, f64::NAN)] {
            let mut damaged = numbers.clone();
            damaged[at] = value;
            assert_eq!(Gear::of_numbers(&damaged), None, "{at} {value}");
        }
    }

    #[test]
    fn near_a_place_and_far_from_it_everything_is_as_asked_for_anew() {
        let gear = gear();
        let mut near = Near::default();
        gear.nearby(&mut near, 0.3, 0.3004);
        for by in [0.0, 1e-7, 1e-6, 3e-5, 4e-4, 0.2] {
            let [exact, found] = [gear.at(0.3 + by, 0.3003 + by), gear.at_near(&near, by, by - 1e-4)];
            // What is asked for anew is rounded to the last digit of the angles.
            let rounding = 2e-16;
            assert!((found.twist_rad - exact.twist_rad).abs() < rounding, "{by}: {found:?} {exact:?}");
            let torque = rounding * exact.stiffness + 1e-15 * exact.torque_n_m.abs();
            assert!((found.torque_n_m - exact.torque_n_m).abs() < torque, "{by}: {found:?} {exact:?}");
            assert!((found.energy_by[0] - exact.energy_by[0]).abs() < 3.0 * torque, "{by}: {found:?} {exact:?}");
        }
    }

    #[test]
    fn torques_are_the_slopes_of_the_energy() {
        let gear = gear();
        for (motor, twist) in [(0.01, 2.5e-4), (0.3, -3e-4), (0.7, 1.0e-4), (1.1, 4.5e-4)] {
            let output = motor + twist;
            let h = 1e-9;
            let energy = |motor: f64, output: f64| gear.at(motor, output).energy_j;
            let found = gear.at(motor, output).energy_by;
            let slopes = [
                (energy(motor + h, output) - energy(motor - h, output)) / (2.0 * h),
                (energy(motor, output + h) - energy(motor, output - h)) / (2.0 * h),
            ];
            for k in 0..2 {
                assert!((found[k] - slopes[k]).abs() < 1e-4 * (1.0 + slopes[k].abs()), "{motor}: {found:?} {slopes:?}");
            }
        }
    }

    #[test]
    fn a_stiffer_unit_with_more_clearance_differs_by_that() {
        let Spring::Sampled(nominal) = gear().spring else { unreachable!() };
        let unit = Gear { lines: Vec::new(), spring: Spring::Sampled(Box::new(nominal.as_built(1.1, 1e-5))), ..gear() };
        let plain = Gear { lines: Vec::new(), spring: Spring::Sampled(nominal), ..gear() };
        for flank in [1.0, 10.0, 40.0] {
            let [a, b] = [&plain, &unit].map(|gear| gear.error_under_rad(0.2, flank, 1.0));
            assert!((b - (a / 1.1 + 1e-5)).abs() < 2e-7, "{flank}: {a} {b}");
        }
    }
}
