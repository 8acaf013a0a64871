//! The output's inertia on the drive's spring.

use super::{Law, Now};
use crate::effect::Family;
use std::f64::consts::TAU;

/// A mode driven by the motion of the mesh. Between points the mesh moves straight; the mode then swings freely, which is
/// solved exactly, and each change of speed is a kick.
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
            Family::A => vec![swing(frequency_hz, damping, 1.0)],
            // A second mode of the structure; friction that grows with the swing.
            Family::B => vec![swing(frequency_hz, 0.6 * damping, 0.85), swing(2.3 * frequency_hz, damping, 0.15)],
        };
        Self { participation, swings, family, mesh: None }
    }
}

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
            let extra = match self.family {
                Family::A => 0.0,
                Family::B => 0.02 * (swing.speed.abs() / swing.omega / 10.0).min(3.0),
            };
            let decay = (swing.damping + extra) * swing.omega;
            let omega = (swing.omega * swing.omega - decay * decay).sqrt();
            let (sin, cos) = (omega * step).sin_cos();
            let fade = (-decay * step).exp();
            let (x, v) = (swing.position, swing.speed);
            swing.position = fade * (x * cos + (v + decay * x) / omega * sin);
            swing.speed = fade * (v * cos - (decay * v + swing.omega * swing.omega * x) / omega * sin);
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
}
