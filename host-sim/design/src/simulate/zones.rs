//! Which teeth bear, and where: the zones of a mesh.
//!
//! Beside each lobe of the generator teeth bear in a run of neighbours, the main zone. Where the drive gives way under
//! its load, teeth elsewhere may come to bear as well: tips that pass one another on their way in or out, 40° to 60°
//! from the major axis. Few pairs, on edges, carry what they must; that converges as well as any contact, and what it
//! does to error and stress looks like a property of the drive.

use std::f64::consts::{PI, TAU};

use serde::Serialize;

use flexspline_mechanics::contact::{BearingPlace, Configuration, FlankLaw};
use flexspline_mechanics::drive::{Flexspline, Profile, Side};
use flexspline_mechanics::stepping::{Problem, State};

/// Pairs that are nearer than this are looked at, mm. A guess: a pair that bears has no gap.
const NEAR_MM: f64 = 1e-3;
/// Places of teeth by which neighbours in a zone may be apart. A guess: one tooth between two that bear may be open.
const NEXT: usize = 2;

/// Share of the load on tips outside the main zones up to which nothing is said. A guess: what a thousandth of the load
/// does to an output that is wound up by minutes is some hundredths of an arc-second.
pub(crate) const MOST_TIP_SHARE: f64 = 1e-3;

/// Largest relief of tips in all, modules. A guess: of the working depth of 1.35 modules it leaves more than half. A
/// CSG-20-160 takes 0.5, the most of 27 sizes. Tips that reach further past those of the other wheel are in mesh.
pub(crate) const MOST_MODULES: f64 = 0.6;

/// Relief of clashing tips in one step, modules. A guess: the sizes of a catalogue need 0.1 to 0.5 in all, more
/// the larger their ratio, as what gives way is in proportion to the size and not to the module ([`crate::relief`]).
const RELIEF_MODULES: f64 = 0.1;

/// What to change where tips of S-shaped teeth bear.
const S_SHAPED: &str = "lower tips of the flexspline do not help S-shaped teeth, whose spaces they cut; higher \
                        circular_spline.tip_radius_mm and tip_rounding_mm ease it; of involutes `new` lowers the tips";
/// Where they bear deep in mesh: seen of rollers, which leave a thin rim to bend between them.
const IN_MESH: &str = "so deep, lower tips may not help (`new` tries them); a thicker rim or another generator may";
/// Elsewhere.
const LOWER: &str = "lower flexspline.tip_radius_mm, STEP mm at a time, until none bears";

/// A run of neighbouring teeth that bear on the same flank beside one lobe.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Zone {
    /// Whether it carries most beside its lobe.
    pub is_main: bool,
    /// Flank of the flexspline teeth.
    pub side: Side,
    /// Angles of its first and last tooth on the flexspline from the axis of the lobe, degrees, positive
    /// counter-clockwise.
    pub from_deg: f64,
    /// See there.
    pub to_deg: f64,
    /// Teeth that bear.
    pub teeth: usize,
    /// Sum of their normal forces, N, and its share in that of all teeth.
    pub force_n: f64,
    /// See there.
    pub share: f64,
    /// The largest force of one of them, N.
    pub largest_n: f64,
    /// The largest pressure between its flanks, MPa.
    pub peak_mpa: f64,
    /// Share of its force that lies on tips, of one wheel or the other.
    pub on_tips: f64,
    /// How far its teeth reach past the tips of the circular spline at least, mm.
    pub reach_mm: f64,
}

/// Contact of tips outside the main zones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TipContact {
    /// Share of the load, of all teeth's normal forces.
    pub share: f64,
    /// Where, from the axis of a lobe: the tooth with the largest pressure of them, degrees.
    pub at_deg: f64,
    /// The largest force of a pair there and in the main zones, N.
    pub largest_n: [f64; 2],
    /// The largest pressure there and in the main zones, MPa.
    pub peak_mpa: [f64; 2],
    /// How far the teeth there reach past the tips of the circular spline, mm: tips that are lower by this do not bear
    /// at that place, but teeth nearer to the axis may.
    pub reach_mm: f64,
    /// A step by which to lower them, mm; 0 of S-shaped teeth: their spaces are cut by the tips, and as low.
    pub relief_step_mm: f64,
    /// What to change.
    #[serde(skip)]
    pub remedy: &'static str,
}

/// A pair that bears.
struct BearingPair {
    tooth: usize,
    side: Side,
    lobe: i64,
    from_lobe_rad: f64,
    place: BearingPlace,
}

/// The zones of a state that has all nodes near the flanks, those with the largest force first.
pub fn zones(problem: &Problem, state: &State) -> Vec<Zone> {
    let mut pairs = pairs(problem, state);
    let width_mm = problem.drive.flexspline.width_mm;
    let total: f64 = pairs.iter().map(|pair| pair.place.load).sum();
    // Along each flank beside each lobe, in the order of the angle.
    pairs.sort_by(|a, b| (a.side, a.lobe).cmp(&(b.side, b.lobe)).then(a.from_lobe_rad.total_cmp(&b.from_lobe_rad)));
    let pitch = problem.flexspline.pitch();
    let goes_on = |a: &BearingPair, b: &BearingPair| {
        (a.side, a.lobe) == (b.side, b.lobe) && b.from_lobe_rad - a.from_lobe_rad < (NEXT as f64 + 0.5) * pitch
    };
    let mut found: Vec<(i64, Zone)> = pairs
        .chunk_by(goes_on)
        .map(|run| {
            let most = |of: fn(&BearingPair) -> f64| run.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
            let load: f64 = run.iter().map(|pair| pair.place.load).sum();
            let tips = |pair: &BearingPair| pair.place.load * pair.place.on_tips[0].max(pair.place.on_tips[1]);
            let zone = Zone {
                is_main: false,
                side: run[0].side,
                from_deg: run[0].from_lobe_rad.to_degrees(),
                to_deg: run[run.len() - 1].from_lobe_rad.to_degrees(),
                teeth: run.len(),
                force_n: load * width_mm,
                share: load / total,
                largest_n: most(|pair| pair.place.load) * width_mm,
                peak_mpa: most(|pair| pair.place.peak_mpa),
                on_tips: run.iter().map(tips).sum::<f64>() / load,
                reach_mm: most(|pair| pair.place.reach_mm),
            };
            (run[0].lobe, zone)
        })
        .collect();
    found.sort_by(|(_, a), (_, b)| b.force_n.total_cmp(&a.force_n));
    let mut seen = Vec::new();
    for (lobe, zone) in &mut found {
        zone.is_main = !seen.contains(lobe);
        seen.push(*lobe);
    }
    found.into_iter().map(|(_, zone)| zone).collect()
}

fn pairs(problem: &Problem, state: &State) -> Vec<BearingPair> {
    let flanks = problem.flanks();
    let at = Configuration { u: &state.u, v: &state.v, output_rad: state.output_rad, leans: &state.leans };
    let law = FlankLaw { stiffness: problem.settings.flank_penalty, stick_stiffness: 0.0, friction: 0.0 };
    let modulus_mpa = problem.contact_modulus_mpa();
    let of_pair = |pair: flexspline_mechanics::contact::FlankPair| {
        let layout = flanks.layout(pair, at);
        let place = flanks.bearing_place((pair, at), law, &layout.points, modulus_mpa)?;
        let phi = (problem.flexspline.sector_angle(pair.tooth) - state.generator_rad).rem_euclid(TAU);
        let lobe = (phi / PI).round();
        Some(BearingPair {
            tooth: pair.tooth,
            side: pair.side,
            lobe: lobe as i64 % 2,
            from_lobe_rad: phi - PI * lobe,
            place,
        })
    };
    let mut pairs: Vec<BearingPair> = flanks.near_pairs(at, NEAR_MM).into_iter().filter_map(of_pair).collect();
    pairs.sort_by_key(|pair| pair.tooth);
    pairs
}

impl TipContact {
    /// Contact of tips in a state that has all nodes near the flanks.
    pub fn at(problem: &Problem, state: &State) -> Option<TipContact> {
        TipContact::of(&zones(problem, state), &problem.drive.flexspline)
    }

    /// The worst of some states: the one with the largest pressure on tips.
    pub(crate) fn worst(all: impl Iterator<Item = TipContact>) -> Option<TipContact> {
        all.max_by(|a, b| a.peak_mpa[0].total_cmp(&b.peak_mpa[0]))
    }

    /// Whether it bears so much that error and stress are its, not those of the mesh.
    pub fn counts(&self) -> bool {
        self.share > MOST_TIP_SHARE
    }

    /// Where, how much, what it means and what to change.
    pub fn in_words(&self) -> String {
        let ([tip_n, mesh_n], [tip_mpa, mesh_mpa]) = (self.largest_n, self.peak_mpa);
        format!(
            "tips bear on one another {:.0} deg from the major axis, outside the teeth in mesh: {:.1} % of the load, \
             up to {tip_n:.0} N on a pair ({mesh_n:.0} N in mesh) at {tip_mpa:.0} MPa ({mesh_mpa:.0} MPa in mesh); \
             kinematic error, stiffness and pressure are those of this contact: {}",
            self.at_deg.abs(),
            100.0 * self.share,
            self.remedy.replace("STEP", &format!("{:.3}", self.relief_step_mm))
        )
    }

    /// Of the zones of a state of a drive with this flexspline: those beside the main ones that bear on tips for the
    /// most part.
    pub fn of(zones: &[Zone], flexspline: &Flexspline) -> Option<TipContact> {
        let outside = || zones.iter().filter(|zone| !zone.is_main && zone.on_tips > 0.5);
        let main = || zones.iter().filter(|zone| zone.is_main);
        let worst = outside().max_by(|a, b| a.peak_mpa.total_cmp(&b.peak_mpa))?;
        let most = |of: fn(&Zone) -> f64| [outside().map(of).fold(0.0, f64::max), main().map(of).fold(0.0, f64::max)];
        let reach_mm = outside().map(|zone| zone.reach_mm).fold(0.0, f64::max);
        let (relief_modules, remedy) = match flexspline.profile {
            Profile::S => (0.0, S_SHAPED),
            Profile::Involute if reach_mm > MOST_MODULES * flexspline.module_mm => (RELIEF_MODULES, IN_MESH),
            Profile::Involute => (RELIEF_MODULES, LOWER),
        };
        Some(TipContact {
            share: outside().map(|zone| zone.share).sum(),
            at_deg: if worst.from_deg.abs() < worst.to_deg.abs() { worst.from_deg } else { worst.to_deg },
            largest_n: most(|zone| zone.largest_n),
            peak_mpa: most(|zone| zone.peak_mpa),
            reach_mm,
            relief_step_mm: relief_modules * flexspline.module_mm,
            remedy,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::drive::Drive;

    fn zone(is_main: bool, share: f64, on_tips: f64, at_deg: f64) -> Zone {
        let side = Side::Minus;
        let (force_n, largest_n, peak_mpa) = (100.0 * share, 10.0 * share, 1e4 * on_tips);
        let (from_deg, to_deg, reach_mm) = (at_deg - 1.0, at_deg + 1.0, 0.02);
        Zone { is_main, side, from_deg, to_deg, teeth: 3, force_n, share, largest_n, peak_mpa, on_tips, reach_mm }
    }

    /// Flank contact next to the main zone is a second place of contact, as four rollers have it; contact of
    /// tips is a clash, reported with the angle that is nearer to the axis, from some share on.
    #[test]
    fn tips_outside_the_main_zone_clash_and_flanks_do_not() {
        let [main, flanks] = [zone(true, 0.9, 0.6, 0.0), zone(false, 0.1, 0.2, 30.0)];
        let [involute, s_shaped] = ["HHD-95", "S-95"].map(|name| Drive::built_in(name).unwrap().flexspline);
        assert_eq!(TipContact::of(&[main, flanks], &involute), None);
        let zones = [main, zone(false, 0.1, 1.0, -52.0)];
        let tips = TipContact::of(&zones, &involute).unwrap();
        assert!((tips.at_deg + 51.0).abs() < 1e-9 && tips.share == 0.1 && tips.counts(), "{tips:?}");
        assert_eq!(tips.peak_mpa, [1e4, 6e3]);
        assert!(tips.in_words().contains("tips bear on one another 51 deg") && tips.in_words().contains("0.050 mm"));
        let deep = TipContact::of(&[main, Zone { reach_mm: 0.4, ..zones[1] }], &involute).unwrap();
        assert!(deep.in_words().ends_with(IN_MESH));
        let s_shaped = TipContact::of(&zones, &s_shaped).unwrap().in_words();
        assert!(s_shaped.contains("S-shaped teeth, whose spaces they cut") && !s_shaped.contains("until none bears"));
        assert!(!TipContact { share: 0.5 * MOST_TIP_SHARE, ..tips }.counts());
    }
}
