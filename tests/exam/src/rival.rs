//! Look-alikes: causes that these data cannot tell from the one that is there. Every rival is refitted with the plant's
//! own law, all base parameters floating.

use crate::bench::{Bench, LEAST_D, difference, tangents};
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::Drive;
use crate::effect::{Effect, Family, What};

/// Draws of a rival's numbers that span its signatures for the first, linear, look.
const DRAWS: usize = 8;
/// The linear look is not the whole family of a law's signatures: a rival that takes up this share of the distance, or
/// comes this near, is refitted in earnest.
const TAKES_UP: f64 = 0.4;
const NEAR: f64 = 3.0 * LEAST_D;
/// Phases tried before a refit: errors of a wheel repeat in half a turn where both flanks clash, with a narrow valley.
const PHASES: usize = 24;
/// Draws from which the refit sets out.
const STARTS: usize = 3;
/// Gauss-Newton steps of the refit.
const STEPS: usize = 16;

/// Rivals within `LEAST_D` of a contribution, nearest first, with the distance left.
pub fn look_alikes(
    bench: &mut Bench,
    drive: &Drive,
    hidden: &Effect,
    contribution: &[f64],
    chance: &mut Chance,
) -> Vec<(Cause, f64)> {
    let mut found = Vec::new();
    for &rival in Cause::ALL {
        // A jump of teeth is no smooth law, and nothing else is like it.
        if What::Cause(rival) == hidden.what || rival == Cause::Ratcheting {
            continue;
        }
        let what = What::Cause(rival);
        let mut d = distance(bench, drive, what, hidden.family, contribution, chance);
        // Numbers that mean the same: the valley of a displacement beyond the clearance is too narrow to be met by
        // chance.
        let twin = twin(what, hidden, drive, chance);
        for turned in bench.orientations_rad() {
            if d >= LEAST_D
                && let Some(mut twin) = twin.clone()
            {
                twin.shape[0] += turned;
                d = d.min(refit(bench, drive, twin, contribution));
            }
        }
        if d < LEAST_D {
            found.push((rival, d));
        }
    }
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    found
}

/// The rival with the size and the leading phase of what is hidden, where both have those.
fn twin(rival: What, hidden: &Effect, drive: &Drive, chance: &mut Chance) -> Option<Effect> {
    let (its, own) = (rival.spec(drive), hidden.what.spec(drive));
    let same = its.size == own.size && its.shape.first()? == own.shape.first()?;
    let mut twin = Effect::draw(rival, hidden.family, drive, chance);
    twin.size = hidden.size;
    *twin.shape.first_mut()? = *hidden.shape.first()?;
    same.then_some(twin)
}

/// Distance of a contribution from the nearest signature of a rival.
pub fn distance(
    bench: &mut Bench,
    drive: &Drive,
    rival: What,
    family: Family,
    contribution: &[f64],
    chance: &mut Chance,
) -> f64 {
    let alone = bench.weigh(contribution).d;
    if alone < LEAST_D {
        return alone;
    }
    let mut draws: Vec<(Effect, Vec<f64>)> = Vec::new();
    for at in 0..DRAWS {
        let mut effect = Effect::draw(rival, family, drive, chance);
        let (low, high) = rival.spec(drive).range;
        // Phases spread evenly: the first number of most shapes.
        if let Some((_, crate::effect::Range::Phase)) = rival.spec(drive).shape.first() {
            effect.shape[0] = std::f64::consts::TAU * (at as f64 + 0.5) / DRAWS as f64;
        }
        effect.size = (low * high).sqrt().copysign(if at % 2 == 0 { 1.0 } else { effect.size });
        let mut signature = bench.signature(&effect);
        // As far from nothing as the contribution: laws that saturate look different at another size.
        for _ in 0..2 {
            let ratio = alone / bench.weigh(&signature).d.max(1e-3);
            if (0.8..1.25).contains(&ratio) {
                break;
            }
            effect.size = (effect.size.abs() * ratio.clamp(0.05, 20.0)).clamp(0.1 * low, high).copysign(effect.size);
            signature = bench.signature(&effect);
        }
        draws.push((effect, signature));
    }
    let span: Vec<_> = draws.iter().map(|(_, signature)| (signature.clone(), 0.0)).collect();
    let linear = bench.weigh_beside(contribution, &span).0.d;
    if linear > NEAR.max((1.0 - TAKES_UP) * alone) {
        return linear;
    }
    // From the draws that come nearest by their size alone, each turned around the wheel.
    let turned = matches!(rival.spec(drive).shape.first(), Some((_, crate::effect::Range::Phase)));
    for turn in 0..if turned { PHASES } else { 0 } {
        let mut effect = draws[turn % DRAWS].0.clone();
        effect.shape[0] = std::f64::consts::TAU * turn as f64 / PHASES as f64;
        let signature = bench.signature(&effect);
        draws.push((effect, signature));
    }
    let mut starts: Vec<_> = draws
        .into_iter()
        .map(|(effect, signature)| {
            let (weight, by) = bench.weigh_beside(contribution, &[(signature, 0.0)]);
            (weight.d, effect.sized(effect.size * by[0]))
        })
        .collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    starts.truncate(STARTS);
    let mut best = alone;
    for (_, start) in starts {
        best = best.min(refit(bench, drive, start, contribution));
        if best < LEAST_D {
            break;
        }
    }
    best
}

/// Gauss-Newton on size and shape, damped where a step does not help.
fn refit(bench: &mut Bench, drive: &Drive, start: Effect, contribution: &[f64]) -> f64 {
    let spec = start.what.spec(drive);
    let mut now = held(start, &spec);
    let mut left = difference(contribution, &bench.signature(&now));
    let mut d = bench.weigh(&left).d;
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let at = difference(contribution, &left);
        let moved = tangents(&now, drive);
        let beside: Vec<_> = moved
            .iter()
            .map(|other| {
                let column = difference(&bench.signature(other), &at);
                let power: f64 = column.iter().map(|x| x * x).sum();
                (column, damping * power)
            })
            .collect();
        let (_, by) = bench.weigh_beside(&left, &beside);
        let mut next = now.clone();
        for (other, step) in moved.iter().zip(&by) {
            next.size += step.clamp(-20.0, 40.0) * (other.size - now.size);
            for (value, (from, to)) in next.shape.iter_mut().zip(now.shape.iter().zip(&other.shape)) {
                *value += step.clamp(-50.0, 50.0) * (to - from);
            }
        }
        let next = held(next, &spec);
        let next_left = difference(contribution, &bench.signature(&next));
        let next_d = bench.weigh(&next_left).d;
        if next_d < d {
            let gained = d - next_d;
            (now, left, d) = (next, next_left, next_d);
            damping *= 0.2;
            if d < 0.5 * LEAST_D || gained < 3e-4 * d {
                break;
            }
        } else {
            damping *= 30.0;
        }
    }
    d
}

fn held(mut effect: Effect, spec: &crate::effect::Spec) -> Effect {
    let (low, high) = (0.1 * spec.range.0, 1.5 * spec.range.1);
    let size = if spec.signed { effect.size.abs() } else { effect.size }.clamp(low, high);
    effect.size = if spec.signed { size.copysign(effect.size) } else { size };
    for (value, (_, range)) in effect.shape.iter_mut().zip(&spec.shape) {
        *value = range.held(*value);
    }
    effect
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Fixed, Unit};
    use crate::motion::{Motion, Poor};
    use crate::noise::Sensors;

    fn found(cause: Cause, family: Family, poor: &[Poor], still: bool) -> Vec<Cause> {
        let mut chance = Chance::new(3, "rival", 0);
        let mut drive = Drive::draw(&mut chance);
        drive.fixed = Fixed::Flexspline;
        let unit = Unit { family, ..Unit::nominal(&drive) };
        let mut motion = Motion::draw(&drive, poor, &mut chance);
        let sensors = Sensors::draw(&drive, &mut chance);
        for (at, orientation) in motion.orientation_rad.iter_mut().enumerate() {
            *orientation = if still { 0.0 } else { 1.5 * (at > motion.time_s.len() / 2) as u8 as f64 };
        }
        let mut bench = Bench::new(&drive, &unit, &motion, &sensors, &[]);
        let mut effect = Effect::draw(What::Cause(cause), family, &drive, &mut chance);
        effect.size = if cause == Cause::GravityTorque { 0.1 * drive.rated_n_m } else { 30.0 };
        let contribution = bench.signature(&effect);
        look_alikes(&mut bench, &drive, &effect, &contribution, &mut chance)
            .into_iter()
            .map(|(cause, _)| cause)
            .collect()
    }

    #[test]
    fn a_push_of_gravity_is_a_runout_until_the_housing_is_turned() {
        for (cause, other) in
            [(Cause::FlexsplineRunout, Cause::GravitySideLoad), (Cause::GravitySideLoad, Cause::FlexsplineRunout)]
        {
            for family in [Family::A, Family::C] {
                assert!(found(cause, family, &[], true).contains(&other), "{cause:?} {family:?}");
                assert!(!found(cause, family, &[], false).contains(&other), "{cause:?} {family:?}");
            }
        }
    }

    #[test]
    fn an_unbalance_is_an_encoder_off_its_axis_until_the_spring_is_loaded_otherwise() {
        let like = found(Cause::GravityTorque, Family::A, &[Poor::ConstantTorque], true);
        assert!(like.contains(&Cause::OutputEncoderEccentricity), "{like:?}");
        assert!(found(Cause::GravityTorque, Family::A, &[], true).is_empty());
    }
}
