//! State of the drive: everything that changes as the generator turns.

use std::collections::BTreeMap;

use crate::contact::{FrictionHistory, Lean};
use crate::drive::Side;

/// Configuration and history after a converged increment.
#[derive(Debug, Clone)]
pub struct State {
    /// Displacements of the flexspline, global frame, x and y of each node (mm).
    pub u: Vec<f64>,
    /// Displacements of the circular spline in the frame that turns with it (mm).
    pub v: Vec<f64>,
    /// Generator angle, rad.
    pub generator_rad: f64,
    /// Load torque on the output, N m (positive turns it forward).
    pub torque_n_m: f64,
    /// Output angle, rad.
    pub output_rad: f64,
    /// Output angle at which the drag of the output would vanish, rad.
    pub drag_anchor_rad: f64,
    /// Moment of the sleeve on the bore, per mm of width (N mm/mm).
    pub sleeve_moment: f64,
    /// Lateral force of the sleeve on the bore (N/mm).
    pub lateral_force: [f64; 2],
    /// Tangential tractions on the flanks of flexspline teeth (only with friction).
    pub friction: BTreeMap<(usize, Side), FrictionHistory>,
    /// How each flexspline tooth leans along its face, outward and around, away from what holds the flexspline (rad): by the waves of the
    /// rim and its taper. Empty where the load along the face is even.
    pub leans: Vec<Lean>,
    /// Output turn per generator turn of the last increment: what the predictor expects to go on.
    pub output_rate: f64,
    /// Sense in which the generator last turned: +1, −1, or 0 before it moved.
    pub travel: f64,
}

/// How far an equilibrium was from what was predicted of it. A drive that is nearly the same, on meshes of the same numbers of nodes, adds it
/// to its own prediction.
#[derive(Debug, Clone)]
pub struct Change {
    u: Vec<f64>,
    v: Vec<f64>,
    output_rad: f64,
    sleeve_moment: f64,
    lateral_force: [f64; 2],
    generator_rad: f64,
}

impl Change {
    /// From the prediction to the equilibrium.
    pub fn between(predicted: &State, found: &State) -> Change {
        let less = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
        Change {
            u: less(&found.u, &predicted.u),
            v: less(&found.v, &predicted.v),
            output_rad: found.output_rad - predicted.output_rad,
            sleeve_moment: found.sleeve_moment - predicted.sleeve_moment,
            lateral_force: [0, 1].map(|k| found.lateral_force[k] - predicted.lateral_force[k]),
            generator_rad: found.generator_rad,
        }
    }

    /// The sum of the changes of several drives in the same place, each times its weight; none where they are not of one place and mesh.
    pub fn mixed(parts: &[(f64, &Change)]) -> Option<Change> {
        let (_, first) = parts.first()?;
        let same = |(_, part): &(f64, &Change)| {
            part.u.len() == first.u.len() && part.v.len() == first.v.len() && part.generator_rad == first.generator_rad
        };
        parts.iter().all(same).then(|| {
            let sum = |of: fn(&Change) -> &[f64]| -> Vec<f64> {
                let mut sum = vec![0.0; of(first).len()];
                for (weight, part) in parts {
                    sum.iter_mut().zip(of(part)).for_each(|(sum, x)| *sum += weight * x);
                }
                sum
            };
            let number = |of: fn(&Change) -> f64| parts.iter().map(|(weight, part)| weight * of(part)).sum();
            Change {
                u: sum(|part| &part.u),
                v: sum(|part| &part.v),
                output_rad: number(|part| part.output_rad),
                sleeve_moment: number(|part| part.sleeve_moment),
                lateral_force: [number(|part| part.lateral_force[0]), number(|part| part.lateral_force[1])],
                generator_rad: first.generator_rad,
            }
        })
    }

    /// A prediction with this change; none where it is of another place, or on other meshes.
    pub(super) fn added_to(&self, predicted: &State) -> Option<State> {
        let same = self.u.len() == predicted.u.len()
            && self.v.len() == predicted.v.len()
            && self.generator_rad == predicted.generator_rad;
        let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + b).collect();
        same.then(|| State {
            u: sum(&predicted.u, &self.u),
            v: sum(&predicted.v, &self.v),
            output_rad: predicted.output_rad + self.output_rad,
            sleeve_moment: predicted.sleeve_moment + self.sleeve_moment,
            lateral_force: [0, 1].map(|k| predicted.lateral_force[k] + self.lateral_force[k]),
            ..predicted.clone()
        })
    }
}
