//! A pair of flanks across the face: teeth that lean or are askew along their width, and flanks that are crowned.
//!
//! The plane slice carries the mean over the face. Slices beside it stand further apart or nearer by an offset o(x):
//! the tooth's tilt and skew times x, along the normal of the flank, and the crowning. Each slice gives way by itself,
//! C mm for 1 N/mm beyond the mean (thin slices, as in ISO 6336 for the load along a face), so with a level L the load
//! at x is
//!
//! `q(x) = <L - o(x)> / C`, and the plane slice meets the other flank earlier by `d = C q̄ - L`,
//!
//! q̄ the mean of q. While nothing touches, d is the largest `-o`; once all of the face bears, the mean of `-o`, and
//! nothing is softer than without. Pressures p of the plane slice give `sum p(d) = q̄`: one number L for each pair,
//! found within its contact law.
//!
//! All of it is the slope of one energy. Beside the forces on the plane slice it gives the load's moment along the
//! face, `mean of q x`, which acts on what makes the teeth lean.

use super::flank::FlankLaw;
use crate::drive::{ActiveFlank, Side};

/// Stations along the face between which offsets are straight: exact for tilt; 8 times as many move the load of a
/// crowned pair by less than 1e-3 (a test).
const STATIONS: usize = 33;
/// Iterations for the level of a pair: Newton within a bracket.
const MOST_ITERATIONS: usize = 100;
/// Step of a level, relative to its bracket, at which it is found.
const LEVEL_FOUND: f64 = 1e-15;

/// Parameters of the load distribution along the face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FaceLaw {
    /// Face width, mm.
    pub width_mm: f64,
    /// How far both ends of the face stand back from a straight flank, mm; a parabola.
    pub crowning_mm: f64,
    /// Normal approach of a slice beyond the mean for 1 N/mm, mm²/N.
    pub compliance: f64,
    /// Unit normal out of the plus flank of a flexspline tooth half way up, in the frame of the tooth.
    normal: [f64; 2],
}

/// How a tooth leans: change of its displacement along the face, radial and around (rad).
pub(crate) type Lean = [f64; 2];

/// Offsets of one pair along its face, mm; positive: further apart.
#[derive(Debug, Clone, Copy)]
pub struct Across {
    offsets: [f64; STATIONS],
    width_mm: f64,
    compliance: f64,
}

/// Load of one pair along its face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bearing {
    /// By how much the plane slice meets the other flank later than where the face is nearest, mm.
    pub later_mm: f64,
    /// Change of that with the mean load, mm²/N; 0 or more.
    pub softness: f64,
    /// Peak load over mean load.
    pub peak_over_mean: f64,
    /// Share of the face that bears.
    pub share: f64,
    /// Mean of load times place along the face, N.
    pub moment: f64,
    /// How much later for a unit of slope of the offsets, the plane slice standing, mm.
    pub later_by_slope: f64,
    /// How much less moment for that, N.
    pub moment_by_slope: f64,
    /// A slice with an offset below this bears, mm.
    pub level_mm: f64,
}

impl Bearing {
    /// An even load.
    pub(crate) const EVEN: Bearing = Bearing {
        later_mm: 0.0,
        softness: 0.0,
        peak_over_mean: 1.0,
        share: 1.0,
        moment: 0.0,
        later_by_slope: 0.0,
        moment_by_slope: 0.0,
        level_mm: 0.0,
    };
}

impl FaceLaw {
    /// For the plus flank of a flexspline tooth.
    pub fn new(flank: &ActiveFlank, width_mm: f64, crowning_mm: f64, compliance: f64) -> FaceLaw {
        let [a, b] = [flank.start_radius, flank.junction_radius].map(|radius| flank.point(radius));
        let along = [b[0] - a[0], b[1] - a[1]];
        let length = along[0].hypot(along[1]);
        FaceLaw { width_mm, crowning_mm, compliance, normal: [-along[1] / length, along[0] / length] }
    }

    /// Offset for a unit of x, of a flank of a tooth that leans.
    pub fn slope(&self, lean: Lean, side: Side) -> f64 {
        -(self.normal[0] * lean[0] + self.normal[1] * side.sign() * lean[1])
    }

    /// The offsets of a flank of a tooth that leans; `None` where all are zero.
    pub(crate) fn across(&self, lean: Lean, side: Side) -> Option<Across> {
        let slope = self.slope(lean, side);
        if slope == 0.0 && self.crowning_mm == 0.0 {
            return None;
        }
        let offset = |k: usize| {
            let along = place(k);
            slope * 0.5 * self.width_mm * along + self.crowning_mm * along * along
        };
        Some(Across { offsets: std::array::from_fn(offset), width_mm: self.width_mm, compliance: self.compliance })
    }
}

/// Place of a station in the face, -1 to 1.
fn place(k: usize) -> f64 {
    2.0 * k as f64 / (STATIONS - 1) as f64 - 1.0
}

/// Load at a level: mean, its slope with the level times C (the share that bears), and the mean of load times place;
/// means of place and of its square over what bears.
struct LevelLoad {
    mean: f64,
    share: f64,
    moment: f64,
    place: f64,
    square: f64,
}

impl Across {
    /// How much nearer than the plane slice the face comes somewhere, mm.
    pub(crate) fn early_mm(&self) -> f64 {
        -self.lowest()
    }

    /// Load over its mean at equal steps along the face, at a bearing of this pair.
    pub(crate) fn load_over_mean(&self, bearing: &Bearing) -> Vec<f64> {
        let mean = self.load(bearing.level_mm).mean * self.compliance;
        self.offsets.iter().map(|offset| (bearing.level_mm - offset).max(0.0) / mean).collect()
    }

    fn lowest(&self) -> f64 {
        self.offsets.iter().copied().fold(f64::INFINITY, f64::min)
    }

    fn load(&self, level: f64) -> LevelLoad {
        let mut load = LevelLoad { mean: 0.0, share: 0.0, moment: 0.0, place: 0.0, square: 0.0 };
        let part = 1.0 / (STATIONS - 1) as f64;
        for (k, pair) in self.offsets.windows(2).enumerate() {
            let [a, b] = [level - pair[0], level - pair[1]];
            if a <= 0.0 && b <= 0.0 {
                continue;
            }
            // The part of the straight piece that bears, from s to t of it, with depths p and q at its ends.
            let root = if a == b { 0.0 } else { a / (a - b) };
            let (s, t) = (if a > 0.0 { 0.0 } else { root }, if b > 0.0 { 1.0 } else { root });
            let (p, q) = (a.max(0.0), b.max(0.0));
            let bears = (t - s) * part;
            let [from, to] = [s, t].map(|s| 0.5 * self.width_mm * (place(k) + 2.0 * s * part));
            load.share += bears;
            load.mean += bears * 0.5 * (p + q);
            // Integral of a straight load times a straight place.
            load.place += bears * 0.5 * (from + to);
            load.square += bears * (from * from + from * to + to * to) / 3.0;
            load.moment += bears * (p * (2.0 * from + to) + q * (from + 2.0 * to)) / 6.0;
        }
        load.mean /= self.compliance;
        load.moment /= self.compliance;
        load
    }

    /// The bearing of a pair whose points have these gaps where the face is nearest, with weights; `None` while nothing
    /// touches.
    pub(crate) fn bearing(&self, law: FlankLaw, points: &[(f64, f64)]) -> Option<Bearing> {
        // Load of the plane slice that meets the other flank later by so much.
        let plane = |later: f64| {
            points.iter().fold((0.0, 0.0), |(load, slope), (gap, weight)| {
                let (depth, stiffness) = (-(gap + later), law.stiffness * weight);
                if depth > 0.0 { (load + stiffness * depth, slope + stiffness) } else { (load, slope) }
            })
        };
        let lowest = self.lowest();
        let (most, _) = plane(0.0);
        if most <= 0.0 {
            return None;
        }
        // What later is: the difference of levels that the mean load leaves.
        let later = |level: f64, load: &LevelLoad| (level - lowest) - self.compliance * load.mean;
        // The face bears no more than what the plane slice has at its nearest.
        let mut low = lowest;
        let mut high =
            lowest + self.compliance * most + 2.0 * self.offsets.iter().map(|o| o - lowest).fold(0.0, f64::max);
        let reach = high - lowest;
        let mut level = lowest + (2.0 * self.compliance * most * (high - lowest)).sqrt().min(0.5 * (high - lowest));
        for _ in 0..MOST_ITERATIONS {
            let load = self.load(level);
            let (carried, stiffness) = plane(later(level, &load));
            let rest = carried - load.mean;
            if rest > 0.0 {
                low = level;
            } else {
                high = level;
            }
            let slope = -stiffness * (1.0 - load.share) - load.share / self.compliance;
            let step = -rest / slope;
            // First: a step of nothing ends on the bracket, which would send the level half way to its other end.
            if step.abs() <= LEVEL_FOUND * reach {
                break;
            }
            let newton = level + step;
            level = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        }
        let load = self.load(level);
        // All that changes at once: the level, with it d, and with that the load of the plane slice.
        let (_, stiffness) = plane(later(level, &load));
        let stiffer = self.compliance * stiffness;
        let common = load.place / (stiffer * (1.0 - load.share) + load.share);
        (load.mean > 0.0).then(|| Bearing {
            later_by_slope: common,
            moment_by_slope: (load.square + (stiffer - 1.0) * load.place * common) / self.compliance,
            later_mm: later(level, &load),
            softness: self.compliance * (1.0 - load.share) / load.share,
            peak_over_mean: (level - lowest) / (self.compliance * load.mean),
            share: load.share,
            moment: load.moment,
            level_mm: level,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Drive, ToothFlank};

    const LAW: FlankLaw = FlankLaw { stiffness: 5e7, stick_stiffness: 0.0, friction: 0.0 };
    const C: f64 = 3e-5;

    fn face(crowning_mm: f64) -> FaceLaw {
        let drive = Drive::hhd_95();
        let flank = ToothFlank::external(&drive).unwrap();
        FaceLaw::new(&ActiveFlank::new(&flank), 20.0, crowning_mm, C)
    }

    /// A single point, so stiff that its depth is nothing beside the offsets.
    fn of(across: &Across, mean_load: f64) -> Bearing {
        let gap = |gap: f64| across.bearing(LAW, &[(gap, 0.5)]);
        let carried =
            |bearing: Option<Bearing>, gap: f64| bearing.map_or(0.0, |b| -LAW.stiffness * 0.5 * (gap + b.later_mm));
        let (mut low, mut high) = (-0.2, 0.0);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if carried(gap(middle), middle) > mean_load { low = middle } else { high = middle }
        }
        gap(low).unwrap()
    }

    /// A straight offset: the load is a triangle of length `sqrt(2 C q̄ b/s)`, its peak twice the mean of it.
    #[test]
    fn a_leaning_tooth_bears_on_a_triangle() {
        let face = face(0.0);
        for side in Side::BOTH {
            let lean = [2e-3, 0.0];
            let slope = face.slope(lean, side);
            assert!(slope < 0.0, "what leans out comes nearer");
            let across = face.across(lean, side).unwrap();
            let mean = 6.0;
            let bearing = of(&across, mean);
            let length = (2.0 * C * mean * 20.0 / slope.abs()).sqrt();
            assert!(length < 20.0 && (bearing.share * 20.0 / length - 1.0).abs() < 1e-6, "{bearing:?}");
            assert!((bearing.peak_over_mean / (40.0 / length) - 1.0).abs() < 1e-6);
            // Early by what is left of the reach of its end.
            let early = across.early_mm() - bearing.later_mm;
            let expected = 10.0 * slope.abs() - slope.abs() * length + C * mean;
            assert!((early - expected).abs() < 1e-9, "{early} {expected}");
            assert!((bearing.moment / (mean * (10.0 - length / 3.0)) - 1.0).abs() < 1e-6);
        }
        let skew = face.across([0.0, 1e-3], Side::Plus).unwrap();
        let other = face.across([0.0, -1e-3], Side::Minus).unwrap();
        assert_eq!(skew.offsets, other.offsets, "mirrored");
    }

    /// With all of the face in contact the plane slice meets the other flank where it would without lean.
    #[test]
    fn a_heavy_load_bears_on_all_of_the_face() {
        let across = face(0.0).across([1e-4, 0.0], Side::Plus).unwrap();
        let bearing = of(&across, 400.0);
        assert!((bearing.share - 1.0).abs() < 1e-12 && bearing.softness == 0.0);
        assert!((across.early_mm() - bearing.later_mm).abs() < 1e-12, "{bearing:?}");
        assert!(bearing.peak_over_mean > 1.0 && bearing.peak_over_mean < 1.2);
    }

    /// Crowned by c: `q ~ 1 - (x/a)²`, with the level over the middle `c (2a/b)²`; peak over mean is 3 b/(4 a).
    #[test]
    fn a_crowned_flank_bears_in_the_middle_and_stations_are_enough() {
        let across = face(0.02).across([0.0; 2], Side::Plus).unwrap();
        let mean = 100.0;
        let bearing = of(&across, mean);
        let half = (mean * C * 20.0_f64.powi(3) * 3.0 / (16.0 * 0.02)).cbrt();
        assert!((bearing.share * 10.0 / half - 1.0).abs() < 2e-3, "{bearing:?}, {half}");
        assert!((bearing.peak_over_mean / (15.0 / half) - 1.0).abs() < 2e-3 && bearing.moment.abs() < 1e-9);
    }

    /// The mean load over the face is what the plane slice carries, of pairs that bear on a hair of their face as of
    /// those that bear on all of it, however stiff their contact is.
    #[test]
    fn the_face_bears_what_the_plane_slice_carries() {
        let face = face(0.0);
        let mut random = fastrand::Rng::with_seed(23);
        for _ in 0..20_000 {
            let law = FlankLaw { stiffness: 5e7 * 10f64.powf(-3.0 * random.f64()), ..LAW };
            let lean = 10f64.powf(-6.0 + 4.0 * random.f64());
            let across = face.across([lean, 0.0], Side::Plus).unwrap();
            let depth = across.early_mm() * 10f64.powf(-4.0 * random.f64());
            let points = [(-depth, 0.2 * random.f64()), (-depth * random.f64(), 0.3 * random.f64())];
            let Some(bearing) = across.bearing(law, &points) else { continue };
            let carried: f64 =
                points.iter().map(|(gap, weight)| law.stiffness * weight * (-gap - bearing.later_mm).max(0.0)).sum();
            let level = across.lowest() + bearing.later_mm + C * carried;
            let borne = across.load(level).mean;
            assert!((borne / carried - 1.0).abs() < 1e-3, "{borne} of {carried}, {lean}, {depth}: {bearing:?}");
        }
    }

    /// Softness is the slope of what it says, and energy has one slope: a lean that grows does the work of the moment.
    #[test]
    fn the_bearing_is_the_slope_of_an_energy() {
        let face = face(0.003);
        let points = [(-0.019, 0.2), (-0.021, 0.3), (-0.0195, 0.2), (-0.01, 0.3)];
        let lean = [1.5e-3, 4e-4];
        // Energy of the slices and of the plane slice: q̄ d - C q̄²/2 + A(L) beside the penalty's.
        let energy = |lean: Lean, shift: f64| -> (f64, Bearing) {
            let across = face.across(lean, Side::Plus).unwrap();
            let early = across.early_mm();
            let near: Vec<(f64, f64)> =
                points.iter().map(|(gap, weight)| (gap + shift - early + 0.025, *weight)).collect();
            let bearing = across.bearing(LAW, &near).unwrap();
            let depth = |gap: f64| (-(gap + bearing.later_mm)).max(0.0);
            let plane: f64 = near.iter().map(|(gap, weight)| 0.5 * LAW.stiffness * weight * depth(*gap).powi(2)).sum();
            let mean: f64 = near.iter().map(|(gap, weight)| LAW.stiffness * weight * depth(*gap)).sum();
            let level = bearing.peak_over_mean * C * mean + across.lowest();
            // A(L) by fine midpoints between the stations.
            let fine = 4000;
            let slices: f64 = (0..fine)
                .map(|k| {
                    let at = (k as f64 + 0.5) / fine as f64 * (STATIONS - 1) as f64;
                    let (k, t) = (at as usize, at.fract());
                    let offset = across.offsets[k] * (1.0 - t) + across.offsets[k + 1] * t;
                    (level - offset).max(0.0).powi(2) / (2.0 * C * fine as f64)
                })
                .sum();
            (plane - C * mean * mean / 2.0 + slices, bearing)
        };
        let (_, bearing) = energy(lean, 0.0);
        let step = 1e-6;
        let [after, before] = [1.0, -1.0].map(|s| energy([lean[0] + s * step, lean[1]], 0.0).0);
        let force = bearing.moment * face.slope([1.0, 0.0], Side::Plus);
        // The mean of the crowning is no part of the lean; the force is minus the slope.
        assert!(
            (-(after - before) / (2.0 * step) / force - 1.0).abs() < 1e-3,
            "{} {force}",
            (after - before) / (2.0 * step)
        );
        let mean = |shift: f64| -> (f64, f64) {
            let (_, b) = energy(lean, shift);
            let across = face.across(lean, Side::Plus).unwrap();
            let early = across.early_mm();
            let load = points
                .iter()
                .map(|(gap, weight)| LAW.stiffness * weight * (-(gap + shift - early + 0.025 + b.later_mm)).max(0.0))
                .sum();
            (load, b.later_mm)
        };
        let ((a, later_a), (b, later_b)) = (mean(1e-7), mean(-1e-7));
        assert!(((later_b - later_a) / (b - a) / bearing.softness - 1.0).abs() < 1e-4);
        // By a slope, the plane slice standing: where the face is nearest moves too.
        let leaning = |step: f64| {
            let lean = [lean[0] + step, lean[1]];
            let early = face.across(lean, Side::Plus).unwrap().early_mm();
            let near: Vec<(f64, f64)> = points.iter().map(|(gap, weight)| (gap - early + 0.025, *weight)).collect();
            let bearing = face.across(lean, Side::Plus).unwrap().bearing(LAW, &near).unwrap();
            (bearing.later_mm - early, bearing.moment)
        };
        let (after, before) = (leaning(step), leaning(-step));
        let slope = 2.0 * step * face.slope([1.0, 0.0], Side::Plus);
        assert!(
            ((after.0 - before.0) / slope / bearing.later_by_slope - 1.0).abs() < 1e-3,
            "{after:?} {before:?} {bearing:?}"
        );
        assert!(
            ((before.1 - after.1) / slope / bearing.moment_by_slope - 1.0).abs() < 1e-3,
            "{after:?} {before:?} {bearing:?}"
        );
    }

    #[test]
    fn straight_teeth_have_nothing_across() {
        assert!(face(0.0).across([0.0; 2], Side::Plus).is_none());
        let across = face(0.0).across([1e-3, 0.0], Side::Plus).unwrap();
        assert!(across.bearing(LAW, &[(1e-6, 1.0)]).is_none(), "open");
    }
}
