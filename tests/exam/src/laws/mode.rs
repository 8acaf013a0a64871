//! The output's inertia on the drive's spring.

use super::{Law, Now};
use crate::effect::Family;
use std::f64::consts::TAU;

/// A mode driven by the motion of the mesh. Between points the mesh moves straight; the mode then swings freely, which
/// is solved exactly, and each change of speed is a kick.
pub struct Mode {
    participation: f64,
    swings: Vec<Swing>,
    family: Family,
    /// Last position of the mesh, arcsec, and its speed, arcsec/s.
    mesh: Option<(f64, f64)>,
}

struct Swing {
    omega: f64,
    damping: f64,
    share: f64,
    position: f64,
    speed: f64,
}

impl Mode {
    pub fn new(participation: f64, frequency_hz: f64, damping: f64, family: Family) -> Self {
        let swing = |hz: f64, damping, share| Swing { omega: TAU * hz, damping, share, position: 0.0, speed: 0.0 };
        let swings = match family {
            Family::A | Family::C => vec![swing(frequency_hz, damping, 1.0)],
            // A second mode of the structure; friction that grows with the swing.
            Family::B => vec![swing(frequency_hz, 0.6 * damping, 0.85), swing(2.3 * frequency_hz, damping, 0.15)],
        };
        Self { participation, swings, family, mesh: None }
    }
}

/// Swing at which half of the hardening is there, arcsec.
const HARDENS_ARCSEC: f64 = 30.0;
/// Swing at which dry friction damps about as much as the rest, arcsec.
const RUBS_ARCSEC: f64 = 6.0;

impl Law for Mode {
    fn output(&mut self, now: &Now, deviation_arcsec: f64) -> f64 {
        let mesh = now.driven_arcsec + deviation_arcsec;
        let step = now.step_s;
        if now.gap_s.is_some() {
            self.mesh = None;
        }
        let speed = match self.mesh {
            Some((last, _)) => (mesh - last) / step,
            None => 0.0,
        };
        let kick = self.mesh.map_or(0.0, |(_, before)| speed - before);
        let at_rest = self.mesh.is_none();
        self.mesh = Some((mesh, speed));
        let mut sum = 0.0;
        for swing in &mut self.swings {
            if at_rest {
                (swing.position, swing.speed) = (0.0, 0.0);
            }
            swing.speed -= kick;
            let (damping, natural) = match self.family {
                Family::A => (swing.damping, swing.omega),
                Family::B => (swing.damping + 0.02 * (swing.speed.abs() / swing.omega / 10.0).min(3.0), swing.omega),
                // Harmonic balance (Krylov and Bogoliubov 1937), by the amplitude of the swing: a spring that hardens
                // (Duffing) is quicker, and dry friction damps large swings less.
                Family::C => {
                    let amplitude = swing.position.hypot(swing.speed / swing.omega);
                    let hardens = amplitude * amplitude / (amplitude * amplitude + HARDENS_ARCSEC * HARDENS_ARCSEC);
                    let rubs = RUBS_ARCSEC / (amplitude + 0.3 * RUBS_ARCSEC);
                    (swing.damping * (0.6 + 0.4 * rubs), swing.omega * (1.0 + 0.05 * hardens))
                }
            };
            let decay = damping * natural;
            let omega = (natural * natural - decay * decay).sqrt();
            let (sin, cos) = (omega * step).sin_cos();
            let fade = (-decay * step).exp();
            let (x, v) = (swing.position, swing.speed);
            swing.position = fade * (x * cos + (v + decay * x) / omega * sin);
            swing.speed = fade * (v * cos - (decay * v + natural * natural * x) / omega * sin);
            sum += swing.share * swing.position;
        }
        self.participation * sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_rings_at_its_frequency_and_dies() {
        let mut mode = Mode::new(1.0, 8.0, 0.03, Family::A);
        let step_s = 1.0 / 800.0;
        let mut trace = Vec::new();
        for at in 0..2400 {
            let deviation = if at < 10 { 0.0 } else { 10.0 };
            let now = Now { step_s, gap_s: (at == 0).then_some(0.0), ..Now::default() };
            trace.push(mode.output(&now, deviation));
        }
        let crossings: Vec<usize> = (20..1000).filter(|&at| trace[at - 1] < 0.0 && trace[at] >= 0.0).collect();
        let period = (crossings[5] - crossings[0]) as f64 * step_s / 5.0;
        assert!((1.0 / period - 8.0).abs() < 0.1, "{}", 1.0 / period);
        let start = trace[..80].iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        assert!((9.0..10.5).contains(&start), "overshoot {start}");
        assert!(trace[2300..].iter().all(|x| x.abs() < 0.2));
    }

    /// Time of one swing, s, and the share of amplitude that is left after it, where a step of this size set it off.
    fn swing(step_arcsec: f64) -> (f64, f64) {
        let mut mode = Mode::new(1.0, 8.0, 0.03, Family::C);
        let step_s = 1.0 / 3200.0;
        let trace: Vec<f64> = (0..1400)
            .map(|at| {
                let deviation = if at < 10 { 0.0 } else { step_arcsec };
                mode.output(&Now { step_s, gap_s: (at == 0).then_some(0.0), ..Now::default() }, deviation)
            })
            .collect();
        let peaks: Vec<usize> =
            (12..1399).filter(|&at| trace[at] > trace[at - 1] && trace[at] >= trace[at + 1]).collect();
        ((peaks[1] - peaks[0]) as f64 * step_s, trace[peaks[1]] / trace[peaks[0]])
    }

    #[test]
    fn a_large_swing_of_a_hardening_spring_is_quicker_and_dry_friction_stops_a_small_one_sooner() {
        let (small, large) = (swing(1.0), swing(100.0));
        assert!((1.0 / small.0 - 8.0).abs() < 0.1 && 1.0 / large.0 > 8.2, "{small:?} {large:?}");
        assert!(small.1 < large.1 && large.1 < 0.95, "{small:?} {large:?}");
    }
}
