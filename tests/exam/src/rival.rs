//! Look-alikes: causes that these data cannot tell from the one that is there. Every rival is refitted with the plant's own
//! law, all base parameters floating.

use crate::bench::{Bench, LEAST_D, difference, tangents};
use crate::cause::Cause;
use crate::chance::Chance;
use crate::drive::Drive;
use crate::effect::{Effect, Family, What};

/// Draws of a rival's numbers that span its signatures for the first, linear, look.
const DRAWS: usize = 6;
/// The linear look is not the whole family of a law's signatures; a rival closer than this is refitted in earnest.
const LOOK_CLOSER: f64 = 3.0 * LEAST_D;
/// Gauss-Newton steps of the refit.
const STEPS: usize = 7;

/// Rivals within `LEAST_D` of a contribution, nearest first, with the distance left.
pub fn look_alikes(
    bench: &mut Bench,
    drive: &Drive,
    cause: Option<Cause>,
    family: Family,
    contribution: &[f64],
    chance: &mut Chance,
) -> Vec<(Cause, f64)> {
    let mut found = Vec::new();
    for &rival in Cause::ALL {
        // A jump of teeth is no smooth law, and nothing else is like it.
        if Some(rival) == cause || rival == Cause::Ratcheting {
            continue;
        }
        let d = distance(bench, drive, What::Cause(rival), family, contribution, chance);
        if d < LEAST_D {
            found.push((rival, d));
        }
    }
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    found
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
        effect.size = (low * high).sqrt().copysign(if at % 2 == 0 { 1.0 } else { effect.size });
        let signature = bench.signature(&effect);
        draws.push((effect, signature));
    }
    let span: Vec<_> = draws.iter().map(|(_, signature)| (signature.clone(), 0.0)).collect();
    let linear = bench.weigh_beside(contribution, &span).0.d;
    if linear > LOOK_CLOSER {
        return linear;
    }
    // From the draws that come nearest by their size alone.
    let mut starts: Vec<_> = draws
        .into_iter()
        .map(|(effect, signature)| {
            let (weight, by) = bench.weigh_beside(contribution, &[(signature, 0.0)]);
            (weight.d, effect.sized(effect.size * by[0]))
        })
        .collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    starts.truncate(2);
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
            if d < LEAST_D || gained < 1e-2 * d {
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
