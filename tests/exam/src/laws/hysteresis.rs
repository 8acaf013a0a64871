//! Rate-independent friction inside the torsional spring: the deflection lags behind the load.

use super::{Law, Mesh, Now, Setting};

const BLOCKS: usize = 16;

/// Blocks that stick and slip, each on its own spring, beside the drive's spring (Maxwell-slip).
pub struct MaxwellSlip {
    compliance: f64,
    /// Wind-up, arcsec.
    deflection: f64,
    /// Force of each block over the drive's stiffness, arcsec.
    force: [f64; BLOCKS],
    /// Slip limit of each, arcsec.
    limit: f64,
    /// Stiffness of each relative to the drive.
    stiffness: [f64; BLOCKS],
    begun: bool,
}

impl MaxwellSlip {
    pub fn new(half_width_arcsec: f64, yield_share: f64, setting: Setting) -> Self {
        let largest = setting.drive.rated_n_m * setting.compliance();
        let limit = half_width_arcsec / BLOCKS as f64;
        let mut stiffness = [0.0; BLOCKS];
        for (at, k) in stiffness.iter_mut().enumerate() {
            // Slip begins between 3 % of the largest deflection and the yield share, evenly in the logarithm.
            let x = at as f64 / (BLOCKS - 1) as f64;
            let slips_at = largest * 0.03 * (yield_share / 0.03_f64).powf(x);
            *k = limit / slips_at;
        }
        Self { compliance: setting.compliance(), deflection: 0.0, force: [0.0; BLOCKS], limit, stiffness, begun: false }
    }
}

impl Law for MaxwellSlip {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let free = now.load_n_m * self.compliance;
        if !self.begun {
            // A run starts from rest without load.
            self.begun = true;
            self.deflection = 0.0;
        }
        // Balance of the drive's spring and the blocks: event by event along the deflection.
        for _ in 0..BLOCKS + 1 {
            let missing = free - self.deflection - self.force.iter().sum::<f64>();
            if missing.abs() < 1e-9 {
                break;
            }
            let sense = missing.signum();
            let (mut stiffness, mut next) = (1.0, f64::INFINITY);
            for (force, k) in self.force.iter().zip(&self.stiffness) {
                let room = self.limit - sense * force;
                if room > 1e-12 {
                    stiffness += k;
                    next = f64::min(next, room / k);
                }
            }
            let move_by = (missing.abs() / stiffness).min(next);
            self.deflection += sense * move_by;
            for (force, k) in self.force.iter_mut().zip(&self.stiffness) {
                *force = (*force + sense * k * move_by).clamp(-self.limit, self.limit);
            }
        }
        mesh.wind_up += self.deflection - free;
    }
}

/// Bouc-Wen in the load: the hysteretic part saturates over a load of `yields_n_m`.
pub struct BoucWen {
    half_width: f64,
    yields_n_m: f64,
    z: f64,
    last_n_m: f64,
}

impl BoucWen {
    pub fn new(half_width_arcsec: f64, yield_share: f64, setting: Setting) -> Self {
        Self {
            half_width: half_width_arcsec,
            yields_n_m: 0.5 * yield_share * setting.drive.rated_n_m,
            z: 0.0,
            last_n_m: 0.0,
        }
    }
}

impl Law for BoucWen {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let total = (now.load_n_m - self.last_n_m) / self.yields_n_m;
        self.last_n_m = now.load_n_m;
        // z' = x' (1 - |z|^n (β + γ sign(x' z))), n = 1.4, β + γ = 1; steps no longer than 0.02.
        let parts = (total.abs() / 0.02).ceil().clamp(1.0, 500.0);
        let step = total / parts;
        for _ in 0..parts as usize {
            let slope = |z: f64| 1.0 - z.abs().powf(1.4) * (0.65 + 0.35 * (step * z).signum());
            let half = self.z + 0.5 * step * slope(self.z);
            self.z = (self.z + step * slope(half)).clamp(-1.0, 1.0);
        }
        mesh.wind_up -= self.half_width * self.z;
    }
}

/// Partial slip between pressed surfaces (Mindlin 1949): a ring of slip grows inwards, so the compliance grows as
/// (1 - Q/Q*)^(-1/3) until all slides at Q*. As plays on the load (Prandtl-Ishlinskii) with the density of thresholds
/// that gives this curve; and the friction of teeth grows with the load that presses them.
pub struct PartialSlip {
    half_width: f64,
    rated_n_m: f64,
    slips: [Slip; SLIPS],
}

const SLIPS: usize = 24;
/// Half width at rated load over that at zero load, less one.
const WIDER_WITH_LOAD: f64 = 0.25;

/// One play.
#[derive(Clone, Copy, Default)]
struct Slip {
    /// Half its width, N m.
    threshold_n_m: f64,
    /// Share of the loop.
    share: f64,
    /// Where it rests, N m.
    at_n_m: f64,
}

impl PartialSlip {
    pub fn new(half_width_arcsec: f64, yield_share: f64, setting: Setting) -> Self {
        let rated_n_m = setting.drive.rated_n_m;
        // Reversed from its largest load, a joint slides as a whole after twice the load at which a new one does
        // (Masing 1926).
        let all_slides_n_m = 0.5 * yield_share * rated_n_m;
        let mut slips = [Slip::default(); SLIPS];
        for (at, slip) in slips.iter_mut().enumerate() {
            let q = (at as f64 + 0.5) / SLIPS as f64;
            slip.threshold_n_m = q * all_slides_n_m;
            slip.share = q * (1.0 - q).powf(-4.0 / 3.0);
        }
        let all: f64 = slips.iter().map(|slip| slip.share).sum();
        slips.iter_mut().for_each(|slip| slip.share /= all);
        Self { half_width: half_width_arcsec, rated_n_m, slips }
    }
}

impl Law for PartialSlip {
    fn mesh(&mut self, now: &Now, mesh: &mut Mesh) {
        let load = now.load_n_m;
        let mut behind = 0.0;
        for slip in &mut self.slips {
            slip.at_n_m = slip.at_n_m.clamp(load - slip.threshold_n_m, load + slip.threshold_n_m);
            behind += slip.share * (load - slip.at_n_m) / slip.threshold_n_m;
        }
        mesh.wind_up -= self.half_width * (1.0 + WIDER_WITH_LOAD * load.abs() / self.rated_n_m) * behind;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;
    use crate::drive::{Drive, Unit};
    use crate::motion::Motion;

    /// Area of the loop in load and wind-up over one cycle of this amplitude, and the half width where the load is
    /// zero.
    fn cycle(law: &mut dyn Law, amplitude_n_m: f64, steps: usize, step_s: f64) -> (f64, f64) {
        let (mut area, mut width, mut last) = (0.0, 0.0, None);
        for at in 0..3 * steps {
            let load = amplitude_n_m * (std::f64::consts::TAU * at as f64 / steps as f64).sin();
            let mut mesh = Mesh::default();
            law.mesh(&Now { load_n_m: load, step_s, ..Now::default() }, &mut mesh);
            if at >= 2 * steps
                && let Some((l, w)) = last
            {
                let (l, w): (f64, f64) = (l, w);
                area += 0.5 * (load + l) * (mesh.wind_up - w);
                if l.signum() != load.signum() {
                    width = f64::max(width, mesh.wind_up.abs());
                }
            }
            last = Some((load, mesh.wind_up));
        }
        (area.abs(), width)
    }

    fn laws(drive: &Drive) -> [Box<dyn Law>; 3] {
        let (unit, motion) = (Unit::nominal(drive), Motion::default());
        let setting = Setting { drive, unit: &unit, motion: &motion };
        [
            Box::new(MaxwellSlip::new(10.0, 0.4, setting)),
            Box::new(BoucWen::new(10.0, 0.4, setting)),
            Box::new(PartialSlip::new(10.0, 0.4, setting)),
        ]
    }

    #[test]
    fn the_loop_does_not_depend_on_rate_and_grows_with_amplitude() {
        let drive = Drive::draw(&mut Chance::new(1, "drive", 0));
        for which in 0..3 {
            let run =
                |share: f64, steps, step_s| cycle(&mut *laws(&drive)[which], share * drive.rated_n_m, steps, step_s);
            let (slow, fast) = (run(0.8, 4000, 0.1), run(0.8, 400, 0.001));
            assert!((slow.0 / fast.0 - 1.0).abs() < 0.01, "law {which}: {slow:?} {fast:?}");
            assert!((slow.1 / 10.0 - 1.0).abs() < 0.05, "law {which}: half width {}", slow.1);
            let small = run(0.1, 4000, 0.1);
            assert!(small.0 < 0.1 * slow.0, "law {which}: a small loop loses little");
        }
    }

    #[test]
    fn energy_is_lost_never_won() {
        // Loss per cycle of a saturated loop is at most four half widths times the amplitude; the third law's mean half
        // width is larger by half of what the load adds.
        let drive = Drive::draw(&mut Chance::new(2, "drive", 0));
        let wider = [1.0, 1.0, 1.0 + 0.5 * WIDER_WITH_LOAD];
        for (law, wider) in laws(&drive).iter_mut().zip(wider) {
            let (area, _) = cycle(&mut **law, drive.rated_n_m, 4000, 0.01);
            assert!(area > 0.5 * 40.0 * drive.rated_n_m && area < 40.0 * wider * drive.rated_n_m, "{area}");
        }
    }

    /// A new joint follows the curve of Mindlin: its slip is 1 - (1 - Q/Q*)^(2/3) less the elastic part 2Q/3Q*.
    #[test]
    fn a_new_joint_slips_as_mindlin_has_it() {
        let drive = Drive::draw(&mut Chance::new(1, "drive", 0));
        let (unit, motion) = (Unit::nominal(&drive), Motion::default());
        let mut law = PartialSlip::new(10.0, 0.4, Setting { drive: &drive, unit: &unit, motion: &motion });
        let all_slides_n_m = 0.2 * drive.rated_n_m;
        let mut slipped = |q: f64| {
            let load_n_m = q * all_slides_n_m;
            law.mesh(&Now { load_n_m, ..Now::default() }, &mut Mesh::default());
            // What the plays have moved, each by its stiffness.
            law.slips.iter().map(|slip| slip.share / slip.threshold_n_m * slip.at_n_m).sum::<f64>()
        };
        let curve = |q: f64| 1.0 - (1.0 - q).powf(2.0 / 3.0) - 2.0 / 3.0 * q;
        let first = slipped(0.4) / curve(0.4);
        for q in [0.5, 0.6, 0.7, 0.8] {
            let ratio = slipped(q) / curve(q) / first;
            assert!((ratio - 1.0).abs() < 0.05, "{ratio} at {q}");
        }
    }
}
