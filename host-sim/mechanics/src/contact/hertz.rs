//! The pressure between two flanks from the force that they bear with and the shape of their gap: what a penalty cannot
//! say.
//!
//! The pressure of a penalty law is as high as the penalty is stiff where flanks bear with a corner: only the force is
//! a result, and where it acts. Two elastic bodies that touch along a line with a gap `x²/(2R)` and bear with F' for
//! the width press one another with
//!
//! `p0 = sqrt(F' E* / (π R))`, `1/E* = (1 - ν²)/E + (1 - ν²)/E`
//!
//! at most (Hertz; Johnson, Contact Mechanics, 1985, chapter 4). A gap that is no parabola, as beside the joint of
//! flank and tip rounding, which has a radius on one side and hardly any curvature on the other, has no such closed
//! form. It is taken for a foundation (Johnson, section 4.3) whose stiffness for the length is E* over half the width
//! of contact b,
//!
//! `p = c (E*/b) <L - g(x)>`, `∫ p dx = F'`,
//!
//! with L found from the force, and `c = 8/(3π)`, for which a parabola has the p0 of Hertz exactly. *The rest is
//! derived here:* the foundation has no more length in it than the gap, so that drives that are one another's image at
//! another scale have the same pressures.

use crate::drive::halved;

/// For which a parabola has the pressure of Hertz.
const FOUNDATION: f64 = 8.0 / (3.0 * std::f64::consts::PI);
/// Doublings of the first guess of a level, which is that of a flat gap, a factor of four from that of a wedge.
const MOST_DOUBLINGS: usize = 64;

/// Gap of two flanks at a place along them, mm, and the force that they bear with there, N/mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FacePoint {
    pub arc: f64,
    pub gap: f64,
    pub force: f64,
}

/// Largest pressure of flanks that bear at these places, in growing arc, with this multiple of the force; MPa. Where
/// they bear in several places, as at both of their tips, each is a contact of its own, up to where the gap between
/// them is widest. `least_radius` (mm) is that of both roundings together, tip on tip: no gap is more curved, and no
/// pressure larger than what Hertz has with it. It counts where flanks bear on a rounding beyond the last of the
/// places, where a gap seems to end in an edge.
pub(super) fn peak_pressure_mpa(places: &[FacePoint], times: f64, modulus_mpa: f64, least_radius: f64) -> f64 {
    let bears = |k: usize| places[k].force > 0.0;
    // The first and the last place of each contact.
    let mut contacts: Vec<[usize; 2]> = Vec::new();
    for k in (0..places.len()).filter(|k| bears(*k)) {
        match contacts.last_mut() {
            Some(last) if last[1] + 1 == k => last[1] = k,
            _ => contacts.push([k, k]),
        }
    }
    let widest = |from: usize, to: usize| {
        (from..=to).max_by(|a, b| places[*a].gap.total_cmp(&places[*b].gap)).expect("from one contact to the next")
    };
    let peak = |(n, &[first, last]): (usize, &[usize; 2])| {
        let from = if n == 0 { 0 } else { widest(contacts[n - 1][1], first) };
        let to = contacts.get(n + 1).map_or(places.len() - 1, |next| widest(last, next[0]));
        let force: f64 = places[first..=last].iter().map(|place| place.force).sum();
        let most = (times * force * modulus_mpa / (std::f64::consts::PI * least_radius)).sqrt();
        peak_of_one(&places[from..=to], times * force, modulus_mpa).min(most)
    };
    contacts.iter().enumerate().map(peak).fold(0.0, f64::max)
}

/// Largest pressure of one contact, MPa.
fn peak_of_one(places: &[FacePoint], force: f64, modulus_mpa: f64) -> f64 {
    let lowest = places.iter().map(|place| place.gap).fold(f64::INFINITY, f64::min);
    // Area between the gap and a level above its lowest, and half the width there.
    let below = |depth: f64| {
        let level = lowest + depth;
        let (mut area, mut half) = (0.0, 0.0);
        for pair in places.windows(2) {
            let (length, [a, b]) = (pair[1].arc - pair[0].arc, [level - pair[0].gap, level - pair[1].gap]);
            let (low, high) = (a.min(b), a.max(b));
            if high <= 0.0 {
                continue;
            }
            let share = if low >= 0.0 { 1.0 } else { high / (high - low) };
            area += share * length * 0.5 * (low.max(0.0) + high);
            half += 0.5 * share * length;
        }
        (area, half)
    };
    let borne = |depth: f64| {
        let (area, half) = below(depth);
        if half > 0.0 { FOUNDATION * modulus_mpa * area / half } else { 0.0 }
    };
    // A flat gap bears with 2 c E* L, a parabola with two thirds of that, a wedge with half.
    let mut high = 2.0 * force / (FOUNDATION * modulus_mpa);
    for _ in 0..MOST_DOUBLINGS {
        if !(borne(high) < force && high.is_finite() && high > 0.0) {
            break;
        }
        high *= 2.0;
    }
    let [_, high] = halved(0.0, high, |depth| borne(depth) < force);
    let (area, _) = below(high);
    if area > 0.0 { force * high / area } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODULUS: f64 = 113_187.0;

    /// Places along a gap, closer near 0, all of them that are below a level bearing alike.
    fn places(gap: impl Fn(f64) -> f64, level: f64, force: f64) -> Vec<FacePoint> {
        let at = |k: i32| f64::from(k).powi(3) * 1e-8;
        let all: Vec<f64> = (-200..=200).map(at).collect();
        let bearing = all.iter().filter(|x| gap(**x) < level).count() as f64;
        let force = |x: f64| if gap(x) < level { force / bearing } else { 0.0 };
        all.iter().map(|&arc| FacePoint { arc, gap: gap(arc), force: force(arc) }).collect()
    }

    #[test]
    fn a_parabola_has_the_pressure_of_hertz() {
        for (radius, force) in [(0.03_f64, 5.0), (0.03, 20.0), (1.0, 20.0), (5.0, 20.0)] {
            let places = places(|x| x * x / (2.0 * radius), 1e-6, force);
            let found = peak_pressure_mpa(&places, 1.0, MODULUS, 1e-3);
            let hertz = (force * MODULUS / (std::f64::consts::PI * radius)).sqrt();
            assert!((found / hertz - 1.0).abs() < 0.01, "{radius} {force}: {found} {hertz}");
            let twice = peak_pressure_mpa(&places, 2.0, MODULUS, 1e-3);
            assert!((twice / found - 2.0_f64.sqrt()).abs() < 0.01);
        }
    }

    /// A flank beside its rounding: between a cylinder of that radius and one of which the other half is flat.
    #[test]
    fn a_corner_bears_less_than_a_cylinder_of_its_radius() {
        let (radius, force) = (0.03, 10.0);
        let corner =
            |slope: f64| places(move |x| if x > 0.0 { x * x / (2.0 * radius) } else { -slope * x }, 1e-6, force);
        let hertz = (force * MODULUS / (std::f64::consts::PI * radius)).sqrt();
        let found = [0.05, 0.02, 0.01].map(|slope| peak_pressure_mpa(&corner(slope), 1.0, MODULUS, 1e-3));
        assert!(found[0] > found[1] && found[1] > found[2] && found[2] > 0.2 * hertz, "{found:?} of {hertz}");
    }

    /// A gap that is cut off where it is steep is no edge.
    #[test]
    fn a_rounding_is_no_edge_where_places_end() {
        let (radius, force) = (0.03, 10.0);
        let mut places = places(|x| x * x / (2.0 * radius), 1e-6, 0.0);
        places.retain(|place| place.arc < -0.01);
        places.last_mut().unwrap().force = force;
        let hertz = (force * MODULUS / (std::f64::consts::PI * radius)).sqrt();
        let found = peak_pressure_mpa(&places, 1.0, MODULUS, radius);
        assert!((found / hertz - 1.0).abs() < 1e-9, "{found} {hertz}");
    }

    /// Two ends of a flank that bear are two contacts, each with its own force.
    #[test]
    fn two_contacts_do_not_mix() {
        let (radius, half) = (0.05, 0.03);
        let gap = |x: f64| ((x.abs() - half).powi(2)) / (2.0 * radius);
        let count = 3000;
        let arcs = (0..=count).map(|k| -0.08 + 0.16 * f64::from(k) / f64::from(count));
        let mut places: Vec<FacePoint> = arcs.map(|arc| FacePoint { arc, gap: gap(arc), force: 0.0 }).collect();
        for (place, force) in [(half, 10.0), (-half, 4.0)] {
            let nearest = places.iter_mut().min_by(|a, b| (a.arc - place).abs().total_cmp(&(b.arc - place).abs()));
            nearest.unwrap().force = force;
        }
        let hertz = (10.0 * MODULUS / (std::f64::consts::PI * radius)).sqrt();
        let found = peak_pressure_mpa(&places, 1.0, MODULUS, 1e-3);
        assert!((found / hertz - 1.0).abs() < 0.02, "{found} {hertz}");
        assert_eq!(peak_pressure_mpa(&[], 1.0, MODULUS, 1e-3), 0.0);
    }
}
