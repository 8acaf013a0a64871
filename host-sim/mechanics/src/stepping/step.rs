//! Out-of-balance forces, and the step that takes them away.

use crate::{condense::dot, fem::largest};

use super::slip::NodalField;
use super::state::State;
use super::waves::MOST_WAVES;

/// Rows of the border: output angle, mean rotation of the bore, anchor, then where there are any lateral x and y,
/// forces of the waves of the bore, and where teeth lean the amplitudes of these waves.
pub(super) const OUTPUT: usize = 0;
pub(super) const SLEEVE: usize = 1;
pub(super) const ANCHORED: usize = 2;
pub(super) const LATERAL: usize = 3;
pub(super) const BORDERS: usize = LATERAL + 2 + 2 * MOST_WAVES;

/// Out-of-balance forces at a configuration.
pub(super) struct Unbalance {
    /// On the free nodes.
    pub force: Vec<f64>,
    /// On the rows of the border; those of the waves are always in balance.
    pub border: [f64; BORDERS],
    /// Largest contact force on a node.
    pub scale: f64,
    pub torque_scale: f64,
    pub flank_contacts: usize,
    pub generator_contacts: usize,
    pub generator_moment: f64,
    /// Along the major axis, on the half of the bore at 0°.
    pub lobe_force: f64,
    pub flank_torque: f64,
    pub drag_torque: f64,
    /// Largest error of the torque by rounding of the output angle.
    pub torque_round_off: f64,
    /// Largest pressure on the bore, MPa.
    pub bore_peak: f64,
    /// Largest load for the width anywhere along the face of a flank, N/mm; of that flank peak over mean, and the share
    /// that bears.
    pub line_load: f64,
    pub peak_over_mean: f64,
    pub face_share: f64,
    /// Neither flank nor drag holds the output.
    pub free_output: bool,
}

impl Unbalance {
    pub(crate) fn zero(unknowns: usize) -> Unbalance {
        Unbalance {
            force: vec![0.0; unknowns],
            border: [0.0; BORDERS],
            scale: 1e-3,
            torque_scale: 1e-3,
            flank_contacts: 0,
            generator_contacts: 0,
            generator_moment: 0.0,
            lobe_force: 0.0,
            flank_torque: 0.0,
            drag_torque: 0.0,
            torque_round_off: 0.0,
            bore_peak: 0.0,
            line_load: 0.0,
            peak_over_mean: 1.0,
            face_share: 1.0,
            free_output: false,
        }
    }

    /// Relative to the contact forces; the torque, which everything serves, ten times as strictly.
    pub(crate) fn relative(&self) -> f64 {
        let force = largest(&self.force) / self.scale;
        let torque = (self.border[OUTPUT].abs() - self.torque_round_off).max(0.0);
        force.max(10.0 * torque / self.torque_scale)
    }
}

/// A Newton step.
impl NodalField {
    /// Work of the out-of-balance forces along the step.
    pub(crate) fn work(&self, residual: &Unbalance) -> f64 {
        dot(&residual.force, &self.free) + residual.border[OUTPUT] * self.border[OUTPUT]
    }

    /// How much of this step another has in it, by displacements, the turn of the output counted at a radius.
    fn share_in(&self, other: &NodalField) -> f64 {
        const RADIUS: f64 = 50.0;
        let turns = |step: &NodalField| RADIUS * RADIUS * self.border[OUTPUT] * step.border[OUTPUT];
        let (mut along, mut square) = (0.0, 0.0);
        for (x, y) in self.free.iter().zip(&other.free) {
            along += x * y;
            square += x * x;
        }
        (along + turns(other)) / (square + turns(self))
    }

    /// Largest displacement, mm.
    pub fn largest(&self) -> f64 {
        largest(&self.free).max(1e-30)
    }

    /// A state further along by a share of the step; nodes of the circular spline that are `held` stay.
    pub(crate) fn applied_to(&self, state: &State, length: f64, held: &[bool]) -> State {
        let mut next = state.clone();
        let (u, v) = self.free.split_at(next.u.len());
        next.u.iter_mut().zip(u).for_each(|(x, d)| *x += length * d);
        let nodes = next.v.as_chunks_mut::<2>().0.iter_mut().zip(held).filter(|(_, held)| !**held);
        for ([x, y], d) in nodes.map(|(node, _)| node).zip(v.as_chunks::<2>().0) {
            *x += length * d[0];
            *y += length * d[1];
        }
        next.output_rad += length * self.border[OUTPUT];
        next.sleeve_moment += length * self.border[SLEEVE];
        next.lateral_force[0] += length * self.border[LATERAL];
        next.lateral_force[1] += length * self.border[LATERAL + 1];
        next
    }
}

/// Broyden's update of an old tangent by the steps that were taken with it (Kelley, Iterative Methods for Linear and
/// Nonlinear Equations, 1995, section 7.3): `step` is the old tangent's.
pub(super) fn improve(step: &mut NodalField, taken: &[NodalField]) {
    for pair in taken.windows(2) {
        let part = pair[0].share_in(step);
        step.free.iter_mut().zip(&pair[1].free).for_each(|(x, y)| *x += part * y);
        step.border.iter_mut().zip(&pair[1].border).for_each(|(x, y)| *x += part * y);
    }
    if let Some(last) = taken.last() {
        let part = last.share_in(step);
        // Beyond this the secant says more about the contact than about the tangent.
        if part.abs() < 0.5 {
            let more = part / (1.0 - part);
            step.free.iter_mut().chain(&mut step.border).for_each(|x| *x += more * *x);
        }
    }
}
