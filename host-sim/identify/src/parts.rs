//! The parts that a unit may have beside its nominal model: smooth, periodic where the drive is, each linear in its
//! coefficients.
//!
//! Every column is of the order of one, so that a penalty means the same in all parts. The weight of a column within
//! its part rises with its order: smooth curves cost little, wrinkles much.

use std::ops::Range;

use flexspline_base::units::ARCSEC_PER_RAD;

/// Which part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PartName {
    /// Wind-up by torque: a polynomial, and a bend at light loads.
    WindUp,
    /// Play: by direction of motion, and by the flank that the load bears on.
    Play,
    /// Periodic in the generator angle.
    GeneratorAngle,
    /// Periodic in the generator angle against the output.
    MaterialAngle,
    /// Periodic in a tooth pitch.
    ToothPitch,
    /// Periodic in the output angle.
    OutputAngle,
    /// Effects of temperature: zero, wind-up and play.
    Temperature,
    /// One angle is read after the other in this log: what goes with the speed. It is the logger's, and no table holds
    /// it.
    ReadingDelay(usize),
    /// All waves of generator and output in proportion to the load: none is fitted, all are asked of what is an
    /// encoder's, which knows no load.
    WavesByLoad,
    /// The same by the flank that bears.
    WavesByFlank,
}

impl PartName {
    /// All that a table holds, in the order in which they are shown.
    pub(crate) const ALL: [PartName; 7] = [
        PartName::WindUp,
        PartName::Play,
        PartName::GeneratorAngle,
        PartName::MaterialAngle,
        PartName::ToothPitch,
        PartName::OutputAngle,
        PartName::Temperature,
    ];

    /// Its name in files.
    pub const fn as_str(self) -> &'static str {
        match self {
            PartName::WindUp => "wind_up",
            PartName::Play => "play",
            PartName::GeneratorAngle => "generator_angle",
            PartName::MaterialAngle => "material_angle",
            PartName::ToothPitch => "tooth_pitch",
            PartName::OutputAngle => "output_angle",
            PartName::Temperature => "temperature",
            PartName::ReadingDelay(_) => "reading_delay",
            PartName::WavesByLoad => "waves_by_load",
            PartName::WavesByFlank => "waves_by_flank",
        }
    }
}

/// Waves of a curve over the generator's turn, or over that against the output: what a table holds.
pub(crate) const GENERATOR_ORDERS: u16 = 8;
/// Waves of the curve over the output's turn: an encoder's two, the weight of an arm that swings through angles and
/// winds up a spring that hardens (up to three times its order), and some more. Chosen on the two records of
/// `examples/`.
pub(crate) const OUTPUT_ORDERS: u16 = 6;
/// Waves of the curve over a tooth pitch: eight nodes of a table hold them.
pub(crate) const TOOTH_ORDERS: u16 = 3;
/// Degree of the wind-up over the torques recorded.
pub(crate) const WIND_UP_DEGREE: usize = 6;
/// Load, of the largest recorded, at which half of what light loads do is done: clearance that closes, teeth that come
/// into contact. A polynomial has no such bend, and swings between the loads recorded instead. A guess, between the
/// dead zone and the first loads of a plan.
const LIGHT_LOAD: f64 = 0.05;
/// How the weight of a wave rises with its order: between the energies of a slope (second power) and of a curvature
/// (fourth). Chosen on halves of the record of `examples/csf17_100`.
const WAVE_POWER: i32 = 3;
/// Weight of the lag against that of the flank: what moves the output against the motion on one flank is the friction
/// in the mesh, a third of the play. A guess.
const LAG_WEIGHT: f64 = 9.0;
/// How the weight of a degree of the wind-up rises with the degree: a guess.
const DEGREE_POWER: i32 = 4;

/// Where the drive is, as the parts see it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State {
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Nominal output angle, rad.
    pub output_rad: f64,
    /// Load torque, N·m.
    pub torque_n_m: f64,
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Direction of the output: 1, −1; 0 if not known.
    pub way: f64,
    /// Speed of the output, rad/s; 0 of a table, which knows none.
    pub speed_rad_s: f64,
    /// Which log has it: the delay between the angles is its own.
    pub log: usize,
}

/// Scales of the columns.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scales {
    /// Least and largest torque recorded, N·m.
    pub torque_n_m: [f64; 2],
    /// Load beyond which it decides the flank, N·m.
    pub friction_n_m: f64,
    /// Least and highest temperature recorded, °C.
    pub temperature_c: [f64; 2],
    /// Tooth pitches in a turn of the generator.
    pub teeth: f64,
    /// Speed of the output that a tenth of the rows exceed, rad/s; 0 where no time was recorded.
    pub speed_rad_s: f64,
    /// Standard deviation of the delay between the two angles before anything says how large it is, s.
    pub late_s: f64,
    /// Parts of the output's turn far from rows, of `PARTS_OF_A_TURN`, a bit each.
    pub unrecorded: u64,
}

impl Scales {
    pub(crate) fn most_torque(&self) -> f64 {
        self.torque_n_m[0].abs().max(self.torque_n_m[1].abs()).max(1e-9)
    }
}

/// −1 to 1 over what was recorded.
fn share(value: f64, [low, high]: [f64; 2]) -> f64 {
    2.0 * (value.clamp(low, high) - low) / (high - low).max(1e-9) - 1.0
}

/// Puts the columns of a part in a state at the end of `to`.
pub(crate) fn columns(part: PartName, at: &State, scales: &Scales, to: &mut Vec<f64>) {
    // Beyond the loads recorded nothing grows further.
    let [low, high] = scales.torque_n_m;
    let load = at.torque_n_m.clamp(low.min(0.0), high.max(0.0)) / scales.most_torque();
    let lag = -at.way;
    let of_waves = |to: &mut Vec<f64>| {
        let angles = wave_angles(part, at.generator_rad, at.output_rad, scales);
        angles.for_each(|(angle, orders)| waves(angle, orders, to));
    };
    match part {
        PartName::WindUp => {
            let ends = chebyshev(share(at.torque_n_m, scales.torque_n_m));
            // No wind-up without a load, where that was recorded.
            let zero = chebyshev(share(0.0, scales.torque_n_m));
            to.extend(ends.iter().zip(zero).map(|(value, zero)| value - zero));
            let load = at.torque_n_m.clamp(low, high) / scales.most_torque();
            to.push(load / (load.abs() + LIGHT_LOAD));
        }
        PartName::Play => {
            let flank = flank(at, scales.friction_n_m);
            // The lag without load, the lag under the largest, and the flank: none of them is negative.
            to.extend([lag * (1.0 - load.abs()), lag * load.abs(), flank]);
        }
        PartName::GeneratorAngle | PartName::MaterialAngle | PartName::ToothPitch | PartName::OutputAngle => {
            of_waves(to)
        }
        PartName::Temperature => {
            let warm = share(at.temperature_c, scales.temperature_c);
            to.extend([warm, warm * load, warm * lag]);
        }
        PartName::ReadingDelay(log) => {
            let own = at.speed_rad_s / scales.speed_rad_s.max(f64::MIN_POSITIVE);
            to.push(if log == at.log { own } else { 0.0 });
        }
        PartName::WavesByLoad | PartName::WavesByFlank => {
            let by_load = part == PartName::WavesByLoad;
            let factor = if by_load { share(at.torque_n_m, scales.torque_n_m) } else { flank(at, scales.friction_n_m) };
            let begin = to.len();
            of_waves(to);
            to[begin..].iter_mut().for_each(|wave| *wave *= factor);
        }
    }
}

/// The angles that a part has waves of, with their orders, where generator and output stand so.
pub(crate) fn wave_angles(
    part: PartName,
    generator_rad: f64,
    output_rad: f64,
    scales: &Scales,
) -> impl Iterator<Item = (f64, u16)> {
    let (of_generator, of_output) = ((generator_rad, GENERATOR_ORDERS), (output_rad, OUTPUT_ORDERS));
    let angles = match part {
        PartName::GeneratorAngle => [Some(of_generator), None],
        PartName::MaterialAngle => [Some((generator_rad - output_rad, GENERATOR_ORDERS)), None],
        PartName::ToothPitch => [Some((scales.teeth * generator_rad, TOOTH_ORDERS)), None],
        PartName::OutputAngle => [Some(of_output), None],
        PartName::WavesByLoad | PartName::WavesByFlank => [Some(of_generator), Some(of_output)],
        PartName::WindUp | PartName::Play | PartName::Temperature | PartName::ReadingDelay(_) => [None, None],
    };
    angles.into_iter().flatten()
}

/// The flank that bears: 1 where the load turns the output forward, or it lags without one; else -1.
pub(crate) fn flank(at: &State, friction_n_m: f64) -> f64 {
    if at.torque_n_m.abs() > friction_n_m { at.torque_n_m.signum() } else { -at.way }
}

/// The weights of a part's columns in its penalty.
pub(crate) fn weights(part: PartName) -> Vec<f64> {
    match part {
        PartName::WindUp => {
            // A straight line is no wrinkle: where loads are few, what they leave open is straight.
            let degrees = (2..=WIND_UP_DEGREE).map(|k| (k as f64).powi(DEGREE_POWER));
            std::iter::once(0.0).chain(degrees).chain(std::iter::once(1.0)).collect()
        }
        PartName::Play => vec![LAG_WEIGHT, LAG_WEIGHT, 1.0],
        PartName::Temperature => vec![1.0; 3],
        PartName::ReadingDelay(_) => vec![1.0],
        PartName::WavesByLoad | PartName::WavesByFlank => {
            vec![1.0; 2 * usize::from(GENERATOR_ORDERS + OUTPUT_ORDERS)]
        }
        of_one_angle => wave_angles(of_one_angle, 0.0, 0.0, &Scales::default())
            .flat_map(|(_, orders)| 1..=orders)
            .flat_map(|k| [f64::from(k).powi(WAVE_POWER); 2])
            .collect(),
    }
}

/// How many columns some parts have.
pub(crate) fn width_of(parts: &[PartName]) -> usize {
    parts.iter().map(|part| weights(*part).len()).sum()
}

/// All columns of some parts in a state.
pub(crate) fn row(parts: &[PartName], at: &State, scales: &Scales) -> Vec<f64> {
    let mut x = Vec::new();
    parts.iter().for_each(|part| columns(*part, at, scales, &mut x));
    x
}

/// Where the columns of a part stand among those of some parts.
pub(crate) fn place(parts: impl IntoIterator<Item = PartName>, part: PartName) -> Option<Range<usize>> {
    let mut end = 0;
    parts.into_iter().find_map(|other| {
        let begin = end;
        end += weights(other).len();
        (other == part).then_some(begin..end)
    })
}

/// How far from a straight line the wind-up is before loads between say it, of the straight part: a spring of the
/// catalogue is softer at light loads by a tenth of all that it winds up (K1 to K3 of CSF-25-100), and half as much
/// again stands for other drives. Partly a guess.
const BENDS: f64 = 0.15;

/// Standard deviation of a part's coefficients before the rows say anything, arcsec, of a column of weight one; of the
/// straight part of the wind-up, that of any. `coefficients` are those found: a part is as large as its largest.
pub(crate) fn expected_arcsec(part: PartName, scales: &Scales, coefficients: &[f64]) -> f64 {
    let sizes = coefficients.iter().zip(weights(part)).map(|(value, weight)| value.abs() * weight.sqrt());
    let largest = sizes.fold(0.0, f64::max);
    match part {
        PartName::WindUp => largest.max(BENDS * coefficients.first().map_or(0.0, |straight| straight.abs())),
        // Noise alone does not say how large it may be: a delay goes with it.
        PartName::Play => largest.max(HALF_A_LOST_MOTION_ARCSEC),
        PartName::ReadingDelay(_) => scales.late_s * scales.speed_rad_s * ARCSEC_PER_RAD,
        _ => largest,
    }
}

/// The same of a drive that nobody has measured. Wind-up: of 200 arcsec at either end of the loads, as a drive of the
/// catalogue at its rated torque has. Play: its lost motion is less than an arc-minute. Waves: its transmission error
/// is less than an arc-minute from peak to peak, of an encoder's mounting as much. *Guesses* in between.
pub(crate) fn usual_arcsec(part: PartName, scales: &Scales) -> f64 {
    match part {
        PartName::WindUp => BENDS * 200.0,
        PartName::Play => HALF_A_LOST_MOTION_ARCSEC,
        PartName::ToothPitch => 3.0,
        PartName::Temperature => 10.0,
        PartName::ReadingDelay(_) => expected_arcsec(part, scales, &[]),
        _ => 15.0,
    }
}

/// Half of an arc-minute, which the lost motion of the catalogue's drives stays below.
pub(crate) const HALF_A_LOST_MOTION_ARCSEC: f64 = 30.0;

/// Sine and cosine of each order, each turned on from the one before.
fn waves(angle: f64, orders: u16, to: &mut Vec<f64>) {
    let (sine, cosine) = angle.sin_cos();
    let (mut s, mut c) = (sine, cosine);
    for _ in 0..orders {
        to.extend([s, c]);
        (s, c) = (s * cosine + c * sine, c * cosine - s * sine);
    }
}

/// Chebyshev's polynomials from the first degree on.
fn chebyshev(x: f64) -> [f64; WIND_UP_DEGREE] {
    let (mut before, mut now) = (1.0, x);
    std::array::from_fn(|_| {
        let value = now;
        (before, now) = (now, 2.0 * x * now - before);
        value
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn parts_repeat_where_the_drive_does_and_have_a_weight_for_each_column() {
        let scales = Scales {
            torque_n_m: [-10.0, 30.0],
            friction_n_m: 1.0,
            temperature_c: [10.0, 30.0],
            teeth: 200.0,
            speed_rad_s: 0.2,
            late_s: 1e-3,
            unrecorded: 0,
        };
        let at = State {
            generator_rad: 1.3,
            output_rad: 0.4,
            torque_n_m: 5.0,
            temperature_c: 20.0,
            way: 1.0,
            speed_rad_s: 0.1,
            log: 0,
        };
        let of = |part, at: &State| {
            let mut to = Vec::new();
            columns(part, at, &scales, &mut to);
            to
        };
        for part in PartName::ALL.into_iter().chain([PartName::ReadingDelay(0)]) {
            assert_eq!(of(part, &at).len(), weights(part).len(), "{}", part.as_str());
        }
        let same = |part, other: &State| of(part, &at).iter().zip(of(part, other)).all(|(a, b)| (a - b).abs() < 1e-9);
        let turned = State { generator_rad: 1.3 + TAU, ..at };
        assert!(same(PartName::GeneratorAngle, &turned) && same(PartName::ToothPitch, &turned));
        assert!(same(PartName::ToothPitch, &State { generator_rad: 1.3 + TAU / 200.0, ..at }));
        assert!(!same(PartName::MaterialAngle, &State { output_rad: 1.4, ..at }));
        assert!(same(PartName::OutputAngle, &State { output_rad: 0.4 - TAU, ..at }));
        // No wind-up without load; Chebyshev's polynomials are the cosines of multiples.
        assert!(of(PartName::WindUp, &State { torque_n_m: 0.0, ..at }).iter().all(|value| *value == 0.0));
        for (k, value) in chebyshev(0.3).iter().enumerate() {
            assert!((value - ((k + 1) as f64 * 0.3_f64.acos()).cos()).abs() < 1e-12);
        }
    }
}
