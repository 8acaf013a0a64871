//! What an effect does to the error, the load and the clearance: one law each, in the form of this plant and in a
//! changed one.

use std::f64::consts::{PI, TAU};

use super::catalogue::{Chosen, Setting};
#[cfg(test)]
use super::effect::Strange;
use super::excitation::Excitation;
use super::plant::Plant;
use crate::causes::{CauseName, ParameterName};
use crate::nominal::{Fixed, Nominal};
use flexspline_base::units::ARCSEC_PER_RAD;

/// Flank angle where teeth bear, rad: the phase of a rectified sine on the flank that carries. A guess of its own: the
/// diagnosis, which must not share its laws, expects 0.39.
const FLANK_ANGLE_RAD: f64 = 0.36;
/// Half the arc in which a cracked tooth carries over the half width of what is felt of it, which is stated as the
/// deviation of a bell curve: the square of a parabola comes closest to one (least squares) at this.
const CARRYING_HALF_ARC: f64 = 2.38;
/// The largest first wave of a reading under signals of unlike size, rad of theirs: beyond, it is this shape made
/// larger.
const MOST_UNLIKE: f64 = 0.25;
/// Steps to a row where a state is followed.
const STEPS: u32 = 40;

/// Which angle an error is locked to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Angle {
    /// The wave on the flexspline.
    Flexspline,
    /// The wave on the circular spline.
    CircularSpline,
    /// The wave against gravity.
    Gravity,
}

/// A channel of the data, or both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoder {
    /// At the output.
    Output,
    /// At the generator; amplitudes are at the output.
    Generator,
}

/// A law with its numbers. Amplitudes are arcsec at the output unless their name says otherwise.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Law {
    /// A toothing or an axis beside its place, rectified by the clearance: `-+A |sin(angle - direction +- a)|` on the
    /// flank that carries, less where more teeth share the load.
    Displaced { angle: Angle, amplitude: f64, direction_rad: f64, half_load_n_m: f64 },
    /// With `y` twice the angle on the circular spline plus a phase, `A (cos y -+ radial sin y)` on either flank,
    /// normalised to `A`: teeth that an oval ring moves along, and spaces that its radius opens.
    Oval { amplitude: f64, phase_rad: f64, radial: f64 },
    /// Lines `(order, amplitude, phase)`, `A cos(order angle + phase)`.
    Pitch { angle: Angle, lines: Vec<(f64, f64, f64)> },
    /// One lobe is deeper: it takes clearance at either flank, and shows order 1 of the teeth of both wheels. A load
    /// presses it in. Wheels without such errors (`amplitude` 0) show the clearance alone, as in contact FEM.
    Lobes { amplitude: f64, phase_rad: f64, deeper: f64, half_load_n_m: f64 },
    /// The tooth mesh and its first overtone.
    CamForm { amplitude: f64, phase_rad: f64 },
    /// A pulse where a lobe meets the tooth.
    Damage { angle: Angle, amplitude: f64, place_rad: f64, half_width_rad: f64, both_flanks: bool },
    /// A tooth of the circular spline bends more than its neighbours: the wind-up is more by this at the full load, in
    /// the middle of the arc in which it carries.
    Crack { at_full_load: f64, full_load_n_m: f64, place_rad: f64, half_width_rad: f64 },
    /// The clearance is wider by this, whole width.
    Wider { growth: f64 },
    /// The clearance widens with travel, by this in all.
    Wear { growth: f64 },
    /// Whole width per kelvin, followed with a lag.
    Breathing { per_k: f64, lag_s: f64 },
    /// The wind-up falls short by this at the full load, as the power of it.
    Hardening { at_full_load: f64, exponent: f64, full_load_n_m: f64 },
    /// Wind-up more than nominal, relative.
    Softer { relative: f64 },
    /// Wind-up more than nominal for each kelvin, relative.
    SofterWarm { relative_per_k: f64 },
    /// Springs that slip one after the other.
    Slip { half_width: f64, slip_n_m: f64 },
    /// Drag that is seen as a lag.
    #[cfg(test)]
    DragLag { largest: f64 },
    /// Drag as a load: at `speed_rad_s` of the generator and the nominal temperature.
    Drag { drag_n_m: f64, speed_rad_s: f64, speed_exponent: f64, per_k: f64 },
    /// `m g l sin(output + orientation + phase)`.
    Unbalance { torque_n_m: f64, phase_rad: f64 },
    /// The load's inertia on the drive's spring.
    Resonance { frequency_hz: f64, damping_ratio: f64 },
    /// `A sin(angle + phase)` in a reading.
    Disc { encoder: Encoder, amplitude: f64, phase_rad: f64 },
    /// A reading that is an angle `x` under two signals of unlike size, `atan2((1 + a) sin nx, cos nx) / n`: order 2n
    /// of the angle, of this amplitude, and little of its multiples.
    Unlike { encoder: Encoder, order: f64, amplitude: f64, phase_rad: f64 },
    /// The output's reading is older by this.
    Latency { delay_s: f64 },
    /// Error in proportion to the output angle.
    Ratio { relative: f64 },
    /// From a row on the output is elsewhere.
    Jump { row: usize, by: f64 },
    /// No cause of the library.
    #[cfg(test)]
    Strange { name: Strange, size: f64, phase: f64 },
}

/// When a law acts: loads wind the drive up, the load's inertia follows all that the drive does, sensors read what
/// comes of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stage {
    Mesh,
    Inertia,
    Reading,
}

/// What the laws act on.
pub(super) struct Now<'a> {
    pub plant: &'a Plant<'a>,
    pub on: &'a Excitation,
    /// Torque on the flanks, N·m.
    pub torque: &'a [f64],
    /// Changed form of the laws.
    pub changed: bool,
}

impl Now<'_> {
    fn nominal(&self) -> &Nominal {
        self.plant.nominal
    }

    /// The largest torque, N·m.
    fn top(&self) -> f64 {
        largest(self.torque)
    }

    fn output(&self, k: usize) -> f64 {
        self.on.generator[k] / self.nominal().ratio
    }

    fn angle(&self, of: Angle, k: usize) -> f64 {
        // The wheel that stands sees the generator turn, the one that is the output turns with it.
        let stands = match self.nominal().teeth.map(|teeth| teeth.fixed) {
            Some(Fixed::CircularSpline) => Angle::CircularSpline,
            Some(Fixed::Flexspline) | None => Angle::Flexspline,
        };
        match of {
            Angle::Gravity => self.on.generator[k] + self.on.orientation[k],
            wheel if wheel == stands => self.on.generator[k],
            Angle::Flexspline | Angle::CircularSpline => self.on.generator[k] - self.output(k),
        }
    }

    /// The flank that carries.
    fn side(&self, k: usize) -> f64 {
        if self.torque[k] >= 0.0 { 1.0 } else { -1.0 }
    }
}

/// What a load leaves of what one zone of teeth does alone.
fn faded(load_n_m: f64, half_load_n_m: f64, changed: bool) -> f64 {
    let x = load_n_m.abs() / half_load_n_m;
    if changed { (-0.7 * x).exp() * 0.8 + 0.2 } else { 1.0 / (1.0 + x) }
}

/// Largest size, never zero.
pub(super) fn largest(torque: &[f64]) -> f64 {
    torque.iter().fold(1e-9, |m: f64, t| m.max(t.abs()))
}

/// Flank angle by which the radius of an oval opens its spaces, rad: where teeth of HHD-95 bear.
pub(super) const OVAL_FLANK_RAD: f64 = 0.4;

impl Law {
    /// The law of a cause, with the parameters of a completed effect.
    pub fn of(cause: CauseName, effect: &Chosen, setting: &Setting<'_>) -> Law {
        use ParameterName as Name;
        let v = |name: Name| effect.value(name);
        let phase = || v(Name::PhaseRad);
        let displaced = |angle| Law::Displaced {
            angle,
            amplitude: v(Name::AmplitudeArcsec),
            direction_rad: phase(),
            half_load_n_m: v(Name::HalfLoadNM),
        };
        let pitch = |angle| Law::Pitch {
            angle,
            lines: vec![(v(Name::Harmonic), v(Name::AmplitudeArcsec), -v(Name::Harmonic) * phase())],
        };
        match cause {
            CauseName::CircularSplineEccentricity => displaced(Angle::CircularSpline),
            CauseName::FlexsplineRunout => displaced(Angle::Flexspline),
            CauseName::GravitySideLoad => displaced(Angle::Gravity),
            CauseName::CircularSplineOvality => Law::Oval {
                amplitude: v(Name::AmplitudeArcsec),
                phase_rad: -2.0 * phase(),
                radial: 2.0 * OVAL_FLANK_RAD.tan(),
            },
            CauseName::FlexsplinePitchError => pitch(Angle::Flexspline),
            CauseName::CircularSplinePitchError => pitch(Angle::CircularSpline),
            CauseName::GeneratorEccentricity => Law::Lobes {
                amplitude: v(Name::AmplitudeArcsec),
                phase_rad: -phase(),
                deeper: v(Name::DeeperArcsec),
                half_load_n_m: v(Name::HalfLoadNM),
            },
            CauseName::CamFormError => Law::CamForm { amplitude: v(Name::AmplitudeArcsec), phase_rad: phase() },
            CauseName::DamagedTooth => Law::Damage {
                angle: if v(Name::Wheel) == 0.0 { Angle::Flexspline } else { Angle::CircularSpline },
                amplitude: v(Name::AmplitudeArcsec),
                place_rad: v(Name::AngleRad),
                half_width_rad: v(Name::WidthRad),
                both_flanks: false,
            },
            CauseName::CrackedToothRoot => Law::Crack {
                at_full_load: v(Name::AmplitudeArcsec),
                full_load_n_m: v(Name::FullLoadNM),
                place_rad: v(Name::AngleRad),
                half_width_rad: v(Name::WidthRad),
            },
            CauseName::BacklashGrowth => Law::Wider { growth: v(Name::GrowthArcsec) },
            CauseName::Wear => Law::Wear { growth: v(Name::GrowthArcsec) },
            CauseName::StiffnessHardening => Law::Hardening {
                at_full_load: v(Name::HardeningArcsec),
                exponent: v(Name::HardeningExponent),
                full_load_n_m: v(Name::FullLoadNM),
            },
            CauseName::StiffnessError => Law::Softer { relative: 1.0 / v(Name::StiffnessRatio) - 1.0 },
            CauseName::TorsionalHysteresis => Law::Slip {
                half_width: v(Name::HalfWidthArcsec),
                // Four springs slip at 0.4, 0.9, 1.4 and 1.9 of this.
                slip_n_m: v(Name::SlipTorqueNM) / 1.15,
            },
            CauseName::ThermalClearance => Law::Breathing { per_k: v(Name::ClearanceArcsecPerK), lag_s: v(Name::LagS) },
            CauseName::ThermalStiffness => Law::SofterWarm { relative_per_k: -v(Name::StiffnessRelativePerK) },
            CauseName::LubricantViscosity => Law::Drag {
                drag_n_m: v(Name::DragNM),
                speed_rad_s: setting.mean_speed_rad_s(),
                speed_exponent: v(Name::SpeedExponent),
                per_k: -v(Name::RelativeDragPerK),
            },
            CauseName::GravityTorque => Law::Unbalance { torque_n_m: v(Name::TorqueNM), phase_rad: phase() },
            CauseName::TorsionalResonance => {
                Law::Resonance { frequency_hz: v(Name::FrequencyHz), damping_ratio: v(Name::DampingRatio) }
            }
            CauseName::OutputEncoderEccentricity => {
                Law::Disc { encoder: Encoder::Output, amplitude: v(Name::AmplitudeArcsec), phase_rad: phase() }
            }
            CauseName::GeneratorEncoderEccentricity => {
                Law::Disc { encoder: Encoder::Generator, amplitude: v(Name::AmplitudeArcsec), phase_rad: phase() }
            }
            CauseName::OutputEncoderTilt => Law::Unlike {
                encoder: Encoder::Output,
                order: 2.0,
                amplitude: v(Name::AmplitudeArcsec),
                phase_rad: phase(),
            },
            CauseName::GeneratorEncoderTilt => Law::Unlike {
                encoder: Encoder::Generator,
                order: 2.0,
                amplitude: v(Name::AmplitudeArcsec),
                phase_rad: phase(),
            },
            CauseName::EncoderSubdivision => Law::Unlike {
                encoder: if v(Name::Encoder) > 0.5 { Encoder::Output } else { Encoder::Generator },
                order: v(Name::Harmonic),
                amplitude: v(Name::AmplitudeArcsec),
                phase_rad: phase(),
            },
            CauseName::SensorLatency => Law::Latency { delay_s: v(Name::DelayS) },
            CauseName::RatioError => Law::Ratio { relative: v(Name::RatioRelativeError) },
            CauseName::Ratcheting => {
                Law::Jump { row: setting.on.time.partition_point(|t| *t < v(Name::TimeS)), by: v(Name::JumpArcsec) }
            }
        }
    }

    /// When it acts.
    pub(crate) fn stage(&self) -> Stage {
        match self {
            Law::Resonance { .. } => Stage::Inertia,
            Law::Disc { .. } | Law::Unlike { .. } | Law::Latency { .. } | Law::Ratio { .. } => Stage::Reading,
            _ => Stage::Mesh,
        }
    }

    /// Torque that the torque column does not hold.
    pub(crate) fn add_torque(&self, nominal: &Nominal, on: &Excitation, torque: &mut [f64]) {
        match *self {
            Law::Unbalance { torque_n_m, phase_rad } => {
                for k in 0..torque.len() {
                    torque[k] += torque_n_m * (on.generator[k] / nominal.ratio + on.orientation[k] + phase_rad).sin();
                }
            }
            Law::Drag { drag_n_m, speed_rad_s, speed_exponent, per_k } => {
                for (k, speed) in on.speeds().into_iter().enumerate() {
                    let thick = (per_k * (nominal.temperature_c - on.temperature[k])).exp();
                    let grade = (speed / speed_rad_s).abs().powf(speed_exponent) * speed.signum() * thick;
                    torque[k] -= drag_n_m * grade * nominal.ratio.signum();
                }
            }
            _ => {}
        }
    }

    /// Adds to half the clearance, arcsec, row by row.
    pub(crate) fn add_half_clearance(&self, nominal: &Nominal, on: &Excitation, changed: bool, half: &mut [f64]) {
        let n = half.len();
        match *self {
            Law::Wider { growth } => half.iter_mut().for_each(|h| *h += 0.5 * growth),
            Law::Lobes { deeper, half_load_n_m, .. } => {
                for (h, load) in half.iter_mut().zip(&on.torque) {
                    *h -= deeper * faded(*load, half_load_n_m, changed);
                }
            }
            Law::Wear { growth } => {
                let mut travel = vec![0.0; n];
                for session in &on.sessions {
                    for k in session.clone() {
                        let step = if k > session.start { (on.generator[k] - on.generator[k - 1]).abs() } else { 0.0 };
                        let load = if changed { 0.3 + on.torque[k].abs() / 50.0 } else { 1.0 };
                        travel[k] = if k > 0 { travel[k - 1] } else { 0.0 } + step * load;
                    }
                }
                let all = travel[n - 1].max(1e-9);
                for k in 0..n {
                    half[k] += 0.5 * growth * travel[k] / all;
                }
            }
            Law::Breathing { per_k, lag_s } => {
                for session in &on.sessions {
                    let mut felt = on.temperature[session.start];
                    for k in session.clone() {
                        let dt = if k > session.start { on.time[k] - on.time[k - 1] } else { 0.0 };
                        felt += (on.temperature[k] - felt) * if lag_s > 0.0 { (dt / lag_s).min(1.0) } else { 1.0 };
                        half[k] += 0.5 * per_k * (felt - nominal.temperature_c);
                    }
                }
            }
            _ => {}
        }
    }

    /// Adds what it does to the error, arcsec.
    pub(crate) fn add_error(&self, now: &Now<'_>, error: &mut [f64]) {
        let n = error.len();
        let (on, torque, changed) = (now.on, now.torque, now.changed);
        match self {
            Law::Displaced { angle, amplitude, direction_rad, half_load_n_m } => (0..n).for_each(|k| {
                let side = now.side(k);
                let s = (now.angle(*angle, k) - direction_rad + FLANK_ANGLE_RAD * side).sin();
                let shape = if changed { (s * s + 0.03).sqrt() } else { s.abs() };
                error[k] -= side * amplitude * shape * faded(torque[k], *half_load_n_m, changed);
            }),
            Law::Oval { amplitude, phase_rad, radial } => (0..n).for_each(|k| {
                let more = if changed { 1.0 + 0.15 * now.side(k) } else { 1.0 };
                let (sin, cos) = (2.0 * now.angle(Angle::CircularSpline, k) + phase_rad).sin_cos();
                error[k] += more * amplitude * (cos - radial * now.side(k) * sin) / 1f64.hypot(*radial);
            }),
            Law::Pitch { angle, lines } => (0..n).for_each(|k| {
                let x = now.angle(*angle, k);
                error[k] += lines.iter().map(|(o, a, p)| a * (o * x + p).cos()).sum::<f64>();
            }),
            Law::Lobes { amplitude, phase_rad, half_load_n_m, .. } => (0..n).for_each(|k| {
                let (psi, theta) = (now.angle(Angle::Flexspline, k), now.angle(Angle::CircularSpline, k));
                let share = if changed { 0.3 } else { 0.7 };
                let one = (psi + phase_rad).cos() + share * (theta + 2.0 * phase_rad).cos();
                error[k] += amplitude * faded(torque[k], *half_load_n_m, changed) * one;
            }),
            Law::CamForm { amplitude, phase_rad } => {
                // Every tooth meets the same generator: nothing repeats less often than the teeth, and the clearance is
                // another.
                let teeth = f64::from(now.nominal().teeth_or_of_two_waves().flexspline);
                let (top, overtone, wider) =
                    (now.top(), if changed { 0.25 } else { 0.1 }, if changed { 0.4 } else { 0.0 });
                (0..n).for_each(|k| {
                    let mesh = teeth * now.angle(Angle::Flexspline, k) + phase_rad + 0.4 * now.side(k);
                    let load = 1.0 + 0.2 * torque[k].abs() / top;
                    let waves = mesh.cos() + overtone * (2.0 * mesh + 1.0).cos();
                    error[k] += amplitude * (waves * load + wider * now.side(k));
                });
            }
            Law::Damage { angle, amplitude, place_rad, half_width_rad, both_flanks } => {
                let top = now.top();
                for k in 0..n {
                    let away = (now.angle(*angle, k) - place_rad + 0.5 * PI).rem_euclid(PI) - 0.5 * PI;
                    let pulse = if changed {
                        (1.0 - (away / (1.6 * half_width_rad)).abs()).max(0.0)
                    } else {
                        (-0.5 * (away / half_width_rad).powi(2)).exp()
                    };
                    let load = if changed { torque[k].abs() / top } else { (torque[k].abs() / top).sqrt() };
                    if torque[k] > 0.0 || *both_flanks {
                        error[k] -= now.side(k) * amplitude * pulse * load;
                    }
                }
            }
            Law::Crack { at_full_load, full_load_n_m, place_rad, half_width_rad } => (0..n).for_each(|k| {
                let away = (now.angle(Angle::CircularSpline, k) - place_rad + 0.5 * PI).rem_euclid(PI) - 0.5 * PI;
                let x = away / (CARRYING_HALF_ARC * half_width_rad);
                // The tooth carries a parabola over its arc, and bends by what it carries: its share counts twice.
                let share = (1.0 - x * x).max(0.0);
                let felt = if changed { share.powf(1.5) } else { share * share };
                let opens = if changed { 1.0 + 0.15 * now.side(k) } else { 1.0 };
                error[k] += at_full_load * torque[k] / full_load_n_m * felt * opens;
            }),
            // Clearance and torque carry these.
            Law::Wider { .. } | Law::Wear { .. } | Law::Breathing { .. } | Law::Drag { .. } | Law::Unbalance { .. } => {
            }
            Law::Hardening { at_full_load, exponent, full_load_n_m } => (0..n).for_each(|k| {
                let u: f64 = torque[k] / full_load_n_m;
                let less = if changed { (u.abs() - 0.3).max(0.0) * 1.4 } else { u.abs().powf(*exponent) };
                error[k] -= at_full_load * u.signum() * less;
            }),
            Law::Softer { relative } => {
                (0..n).for_each(|k| error[k] += relative * now.nominal().wind_up_arcsec(torque[k]));
            }
            Law::SofterWarm { relative_per_k } => (0..n).for_each(|k| {
                let dt = on.temperature[k] - now.nominal().temperature_c;
                let factor = if changed { (1.3 * relative_per_k * dt).exp() - 1.0 } else { relative_per_k * dt };
                error[k] += factor * now.nominal().wind_up_arcsec(torque[k]);
            }),
            Law::Slip { half_width, slip_n_m } => slip(now, *half_width, *slip_n_m, error),
            #[cfg(test)]
            Law::DragLag { largest } => {
                let speeds = on.speeds();
                let fastest = speeds.iter().fold(1e-9, |m: f64, w| m.max(w.abs()));
                for k in 0..n {
                    let t = on.temperature[k];
                    let thick = if changed {
                        // Vogel, 1 at 20 °C.
                        (420.0 / (t + 110.0) - 420.0 / 130.0).exp()
                    } else {
                        (-0.035 * (t - 20.0)).exp()
                    };
                    let power = if changed { 0.9 } else { 2.0 / 3.0 };
                    let w = speeds[k];
                    error[k] -= largest * (w / fastest).abs().powf(power) * w.signum() * thick.powf(power.max(0.7));
                }
            }
            Law::Resonance { frequency_hz, damping_ratio } => resonance(now, *frequency_hz, *damping_ratio, error),
            Law::Disc { encoder, amplitude, phase_rad } => (0..n).for_each(|k| {
                let x = phase_rad + if *encoder == Encoder::Output { now.output(k) } else { on.generator[k] };
                error[k] += amplitude * (x.sin() + if changed { 0.1 * (2.0 * x + 1.0).sin() } else { 0.0 });
            }),
            Law::Unlike { encoder, order, amplitude, phase_rad } => {
                // Signals of a circle pressed to an ellipse: the reading runs ahead and behind twice in a period of
                // theirs. One arcsec of the angle that they turn by is this much of it at the output.
                let at_output = if *encoder == Encoder::Output { 1.0 } else { 1.0 / now.nominal().ratio.abs() };
                let signals = 0.5 * order;
                let per_signal = ARCSEC_PER_RAD * at_output / signals;
                // The first wave of what follows is m, its overtones m²/2, m³/3, ..., for signals that are unlike by 2m
                // / (1 - m).
                let first = (amplitude / per_signal).clamp(1e-9, MOST_UNLIKE);
                let unlike = 2.0 * first / (1.0 - first);
                let scale = amplitude / first;
                (0..n).for_each(|k| {
                    let angle = if *encoder == Encoder::Output { now.output(k) } else { on.generator[k] };
                    // sin(order angle + phase) is sin 2x of the signals' angle x.
                    let x = signals * angle + 0.5 * phase_rad;
                    let (sin, cos) = x.sin_cos();
                    let ahead = (unlike * sin * cos).atan2(1.0 + unlike * sin * sin);
                    error[k] += scale * ahead * if changed { 1.0 + 0.1 * (2.0 * x).sin() } else { 1.0 };
                });
            }
            Law::Latency { delay_s } => {
                let per_speed = delay_s / now.nominal().ratio * ARCSEC_PER_RAD;
                error.iter_mut().zip(on.speeds()).for_each(|(e, speed)| *e -= per_speed * speed);
            }
            Law::Ratio { relative } => (0..n).for_each(|k| error[k] += relative * now.output(k) * ARCSEC_PER_RAD),
            Law::Jump { row, by } => error.iter_mut().skip(*row).for_each(|e| *e += by),
            #[cfg(test)]
            Law::Strange { name, size, phase } => name.add_error(now, [*size, *phase], error),
        }
    }
}

/// Torsional hysteresis.
fn slip(now: &Now<'_>, half_width: f64, slip_n_m: f64, error: &mut [f64]) {
    let torque = now.torque;
    for session in &now.on.sessions {
        let mut z = 0.0;
        let mut springs = [0.0; 4];
        for k in session.clone() {
            let step = if k > session.start { torque[k] - torque[k - 1] } else { torque[k] };
            if now.changed {
                // Bouc-Wen at a fiftieth of the step.
                for _ in 0..50 {
                    let d = step / 50.0 / slip_n_m;
                    z += d - 0.5 * d.abs() * z - 0.5 * d * f64::abs(z);
                }
                error[k] -= half_width * z;
            } else {
                for (j, z) in springs.iter_mut().enumerate() {
                    let slip = slip_n_m * (0.4 + 0.5 * j as f64);
                    *z = f64::clamp(*z + step, -slip, slip);
                    error[k] -= half_width * *z / slip / 4.0;
                }
            }
        }
    }
}

/// Load on the drive's spring.
fn resonance(now: &Now<'_>, frequency_hz: f64, damping_ratio: f64, error: &mut [f64]) {
    let time = &now.on.time;
    let (omega, zeta) = (TAU * frequency_hz, damping_ratio);
    let driven: Vec<f64> = error.to_vec();
    for session in &now.on.sessions {
        let first = session.start;
        let (mut x, mut v) = (driven[first], 0.0);
        for k in first + 1..session.end {
            let dt = (time[k] - time[k - 1]) / f64::from(STEPS);
            for j in 0..STEPS {
                let u = driven[k - 1] + (driven[k] - driven[k - 1]) * (f64::from(j) + 0.5) / f64::from(STEPS);
                let slope = (driven[k] - driven[k - 1]) / (f64::from(STEPS) * dt);
                let damper = v - if now.changed { 0.0 } else { slope };
                let a = omega * omega * (u - x) - 2.0 * zeta * omega * damper;
                v += a * dt;
                x += v * dt;
            }
            error[k] = x;
        }
    }
}
