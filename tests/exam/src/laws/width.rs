//! A clearance of another width: grown, wearing, or following the temperature.

use super::{Law, Mesh, Now, Setting};
use crate::effect::Family;

/// Wider from the first row to the last.
pub struct Growth {
    pub size: f64,
    pub phase: f64,
    pub family: Family,
}

impl Law for Growth {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        mesh.clearance += match self.family {
            Family::A => self.size,
            // Uneven around the circular spline.
            Family::B => self.size * (1.0 + 0.1 * (2.0 * now.on_circular_spline_rad + self.phase).sin()),
            // The flexspline was worn more on one side: one zone has more room than the other, and the tighter one
            // holds.
            Family::C => {
                let more = 0.2 * 0.5 * self.size * (now.on_flexspline_rad + self.phase).cos();
                for (zone, more) in [more, -more].into_iter().enumerate() {
                    mesh.zones.upper[zone] += more;
                    mesh.zones.lower[zone] -= more;
                }
                self.size
            }
        };
    }
}

/// Wider with use.
pub struct Wear {
    size: f64,
    running_in: f64,
    family: Family,
    ratio: f64,
    all_work: f64,
    work: f64,
}

impl Wear {
    pub fn new(size: f64, running_in: f64, family: Family, setting: Setting) -> Self {
        let (motion, ratio) = (setting.motion, setting.drive.ratio().abs());
        let rates = motion.torque_n_m.iter().zip(&motion.speed_rad_s).map(|(t, v)| rate(*t, *v, ratio, family));
        let all_work = rates.sum::<f64>() * motion.step_s;
        Self { size, running_in, family, ratio, all_work: all_work.max(1e-12), work: 0.0 }
    }
}

/// Work of the load on the sliding teeth, W; a tenth of a N m is there without load. In family C their path alone,
/// rad/s at the output: what presses them together is the generator.
fn rate(torque_n_m: f64, speed_rad_s: f64, ratio: f64, family: Family) -> f64 {
    let presses = if family == Family::C { 1.0 } else { torque_n_m.abs() + 0.1 };
    presses * speed_rad_s.abs() / ratio
}

impl Law for Wear {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        self.work += rate(now.torque_n_m, now.speed_rad_s, self.ratio, self.family) * now.step_s;
        let done = match self.family {
            // Archard: depth as the work done.
            Family::A => self.work / self.all_work,
            // Running in, then steady, while the drive goes on turning between the recordings.
            Family::B => {
                let t = now.elapsed;
                let quick = |t: f64| 1.0 - (-t / self.running_in).exp();
                0.6 * quick(t) / quick(1.0) + 0.4 * t
            }
            // Archard with a coefficient that changes along the path: slow while a film holds, quickest at
            // `running_in`, slow again on conforming flanks. An S, as curves of running-in are (Blau 1989); the
            // logistic form is derived here.
            Family::C => {
                let grown = |path: f64| (1.0 + (-(path - self.running_in) / 0.2).exp()).recip();
                (grown(self.work / self.all_work) - grown(0.0)) / (grown(1.0) - grown(0.0))
            }
        };
        mesh.clearance += self.size * done;
    }
}

/// Wider or narrower with temperature.
pub struct ThermalClearance {
    per_k: f64,
    lag_s: f64,
    family: Family,
    slow_c: Option<f64>,
    slower_c: f64,
}

impl ThermalClearance {
    pub fn new(per_k: f64, lag_s: f64, family: Family) -> Self {
        Self { per_k, lag_s, family, slow_c: None, slower_c: 0.0 }
    }
}

impl Law for ThermalClearance {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let warmer = now.temperature_c - 20.0;
        if self.slow_c.is_none() {
            self.slower_c = now.temperature_c;
        }
        let slow = self.slow_c.get_or_insert(now.temperature_c);
        let since = now.gap_s.unwrap_or(now.step_s);
        // Family C: two stages, each of half the lag.
        let lag_s = if self.family == Family::C { 0.5 * self.lag_s } else { self.lag_s };
        let nears = 1.0 - (-since / lag_s).exp();
        *slow += (now.temperature_c - *slow) * nears;
        self.slower_c += (*slow - self.slower_c) * nears;
        mesh.clearance += match self.family {
            Family::A => self.per_k * warmer,
            // The generator warms first; the housing, of another metal, follows.
            Family::B => self.per_k * (0.6 * (*slow - 20.0) + 0.4 * warmer + 0.8 * (now.temperature_c - *slow)),
            // The sensor sits on the housing, the teeth follow through flange and rim (second order); and metals expand
            // more as they warm.
            Family::C => self.per_k * (self.slower_c - 20.0) * (1.0 + 0.002 * (self.slower_c - 20.0)),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;
    use crate::drive::{Drive, Unit};
    use crate::motion::Motion;

    #[test]
    fn wear_grows_from_nothing_to_its_size_and_never_back() {
        let drive = Drive::draw(&mut Chance::new(1, "drive", 0));
        let motion = Motion::draw(&drive, &[], &mut Chance::new(1, "motion", 0));
        let unit = Unit::nominal(&drive);
        let (first, last) = (motion.time_s[0], *motion.time_s.last().unwrap());
        for family in Family::ALL {
            let mut wear = Wear::new(80.0, 0.3, family, Setting { drive: &drive, unit: &unit, motion: &motion });
            let mut wider = Vec::new();
            for at in 0..motion.time_s.len() {
                let mut mesh = Mesh::default();
                let now = Now {
                    step_s: motion.step_s,
                    elapsed: (motion.time_s[at] - first) / (last - first),
                    torque_n_m: motion.torque_n_m[at],
                    speed_rad_s: motion.speed_rad_s[at],
                    ..Now::default()
                };
                wear.mesh(&now, &mut mesh);
                wider.push(mesh.clearance);
            }
            assert!(wider.windows(2).all(|pair| pair[1] >= pair[0]), "{family:?}");
            assert!(wider[0] < 0.01 && (wider.last().unwrap() - 80.0).abs() < 0.01, "{family:?}: {:?}", wider.last());
        }
    }

    /// A step of temperature through two equal stages: 1 - (1 + t/τ) exp(-t/τ), with τ half the lag.
    #[test]
    fn the_teeth_follow_the_sensor_through_two_stages() {
        let mut law = ThermalClearance::new(1.0, 100.0, Family::C);
        let mut wider = 0.0;
        for at in 0..=600 {
            let temperature_c = if at == 0 { 20.0 } else { 30.0 };
            let mut mesh = Mesh::default();
            law.mesh(&Now { step_s: 0.1, temperature_c, ..Now::default() }, &mut mesh);
            wider = mesh.clearance;
        }
        let (t, tau) = (60.0, 50.0);
        let warmer = 10.0 * (1.0 - (1.0 + t / tau) * f64::exp(-t / tau));
        assert!((wider - warmer * (1.0 + 0.002 * warmer)).abs() < 0.02, "{wider} {warmer}");
    }
}
