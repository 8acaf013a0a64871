//! A smooth curve of circular arcs: what a flank without a closed form is kept as.
//!
//! Two arcs lead from one point and direction to the next (a biarc: Bolton 1975, "Biarc curves", Computer-Aided Design
//! 7), so that the direction never jumps. The distance from a point to an arc is a closed form; which arc is nearest is
//! a search over the joints.

use super::placement::rotate;

/// One arc; straight where its curvature is zero.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Arc {
    start: [f64; 2],
    /// Unit tangent at its start.
    tangent: [f64; 2],
    /// 1/mm, positive where it turns left.
    curvature: f64,
    /// Arc length of the chain at its start, mm.
    from: f64,
    length: f64,
}

/// Arcs one after the other, each beginning where the one before ends and in its direction. Beyond its ends the chain
/// goes on as the first and the last arc do.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ArcChain {
    arcs: Vec<Arc>,
}

/// Foot of a point on a chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ChainFoot {
    /// Distance, positive to the left, mm.
    pub left: f64,
    /// Arc length of the foot, mm.
    pub arc: f64,
    /// Unit tangent there.
    pub tangent: [f64; 2],
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

impl Arc {
    /// From a point and a unit tangent to another point.
    fn to(start: [f64; 2], tangent: [f64; 2], end: [f64; 2], from: f64) -> Arc {
        let chord = minus(end, start);
        let squared = dot(chord, chord);
        let curvature = 2.0 * cross(tangent, chord) / squared;
        // Half the angle that the arc turns through is that between chord and tangent.
        let half = cross(tangent, chord).atan2(dot(tangent, chord));
        let stretch = if half.abs() < 1e-4 { 1.0 + half * half / 6.0 } else { half / half.sin() };
        Arc { start, tangent, curvature, from, length: squared.sqrt() * stretch }
    }

    fn point(&self, s: f64) -> [f64; 2] {
        let half = 0.5 * self.curvature * s;
        let chord = if half.abs() < 1e-4 { s * (1.0 - half * half / 6.0) } else { s * half.sin() / half };
        let [x, y] = rotate(self.tangent, half.sin_cos());
        [self.start[0] + chord * x, self.start[1] + chord * y]
    }

    fn tangent_at(&self, s: f64) -> [f64; 2] {
        rotate(self.tangent, (self.curvature * s).sin_cos())
    }

    fn foot(&self, p: [f64; 2]) -> ChainFoot {
        let d = minus(p, self.start);
        let (along, left, k) = (dot(d, self.tangent), cross(self.tangent, d), self.curvature);
        // The circle has its centre at (0, 1/k): (1 - |k d - (0, 1)|)/k, in a form that a straight line has too.
        let (sin, cos) = (k * along, 1.0 - k * left);
        let reach = sin.hypot(cos).max(1e-12);
        let turn = sin.atan2(cos);
        let arc = if turn.abs() < 1e-6 { along / reach } else { turn / k };
        ChainFoot {
            left: (2.0 * left - k * (along * along + left * left)) / (1.0 + reach),
            arc: self.from + arc,
            tangent: rotate(self.tangent, (sin / reach, cos / reach)),
        }
    }
}

impl ArcChain {
    /// Through points, in these directions (unit vectors), by biarcs with equal tangents at both ends.
    pub fn through(nodes: &[([f64; 2], [f64; 2])]) -> ArcChain {
        let mut chain = ArcChain { arcs: Vec::with_capacity(2 * nodes.len()) };
        for pair in nodes.windows(2) {
            let ([(p, t), (q, u)], from) = ([pair[0], pair[1]], chain.length());
            let v = minus(q, p);
            // |q - d u - (p + d t)| = 2 d
            let (a, b, c) = (2.0 * (dot(t, u) - 1.0), -2.0 * (dot(v, t) + dot(v, u)), dot(v, v));
            let d = 2.0 * c / (-b + (b * b - 4.0 * a * c).max(0.0).sqrt());
            let joint = std::array::from_fn(|k| 0.5 * (p[k] + d * t[k] + q[k] - d * u[k]));
            let first = Arc::to(p, t, joint, from);
            let second = Arc::to(joint, first.tangent_at(first.length), q, from + first.length);
            chain.arcs.extend([first, second]);
        }
        chain
    }

    /// This chain with a straight line of that length before it, tangent to it.
    pub(crate) fn with_lead(self, length: f64) -> ArcChain {
        let first = self.arcs[0];
        let start = [0, 1].map(|k| first.start[k] - length * first.tangent[k]);
        let lead = Arc { start, curvature: 0.0, from: 0.0, length, ..first };
        let rest = self.arcs.into_iter().map(|arc| Arc { from: arc.from + length, ..arc });
        ArcChain { arcs: std::iter::once(lead).chain(rest).collect() }
    }

    /// This chain with a straight line after it, tangent to it: its last direction goes on.
    pub(crate) fn with_tail(mut self, length: f64) -> ArcChain {
        let (end, from) = (self.length(), self.length());
        let (start, tangent) = (self.point(end), self.tangent(end));
        self.arcs.push(Arc { start, tangent, curvature: 0.0, from, length });
        self
    }

    /// All lengths times `factor`.
    pub(crate) fn scaled(&self, factor: f64) -> ArcChain {
        let scaled = |arc: &Arc| Arc {
            start: arc.start.map(|x| factor * x),
            tangent: arc.tangent,
            curvature: arc.curvature / factor,
            from: factor * arc.from,
            length: factor * arc.length,
        };
        ArcChain { arcs: self.arcs.iter().map(scaled).collect() }
    }

    /// mm.
    pub fn length(&self) -> f64 {
        self.arcs.last().map_or(0.0, |arc| arc.from + arc.length)
    }

    fn arc(&self, s: f64) -> &Arc {
        let after = self.arcs.partition_point(|arc| arc.from <= s);
        &self.arcs[after.saturating_sub(1)]
    }

    /// Point at an arc length.
    pub fn point(&self, s: f64) -> [f64; 2] {
        let arc = self.arc(s);
        arc.point(s - arc.from)
    }

    /// Unit tangent at an arc length.
    pub(crate) fn tangent(&self, s: f64) -> [f64; 2] {
        let arc = self.arc(s);
        arc.tangent_at(s - arc.from)
    }

    /// Curvature at an arc length, 1/mm, positive where it turns left.
    pub(crate) fn curvature(&self, s: f64) -> f64 {
        self.arc(s).curvature
    }

    /// Foot of a point that is nearer to the chain than its radii of curvature: the first arc whose end the point does
    /// not lie beyond.
    pub(crate) fn foot(&self, p: [f64; 2]) -> ChainFoot {
        let beyond = |arc: &Arc| dot(minus(p, arc.start), arc.tangent) > 0.0;
        let after = 1 + self.arcs[1..].partition_point(beyond);
        self.arcs[after - 1].foot(p)
    }

    /// Arc length at a distance from the origin, for a chain on which that distance grows; where its ends going on do
    /// not reach so far, as near as they come.
    pub(crate) fn arc_at_radius(&self, radius: f64) -> f64 {
        let within = |arc: &Arc| dot(arc.start, arc.start) <= radius * radius;
        let arc = &self.arcs[self.arcs.partition_point(within).saturating_sub(1)];
        let mut s = arc.from + 0.5 * arc.length;
        for _ in 0..8 {
            let (p, t) = (self.point(s), self.tangent(s));
            let r = dot(p, p).sqrt();
            s -= (r - radius) / (dot(p, t) / r).max(0.1);
        }
        s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wave about the x axis shifted out to 48 mm: a curve that turns both ways and grows in radius.
    fn wave(t: f64) -> ([f64; 2], [f64; 2]) {
        let (s, c) = (2.0 * t).sin_cos();
        let slope = 0.6 * c;
        let length = 1f64.hypot(slope);
        ([48.0 + t, 0.3 * s], [1.0 / length, slope / length])
    }

    fn chain(nodes: u32) -> ArcChain {
        ArcChain::through(&(0..=nodes).map(|k| wave(f64::from(k) / f64::from(nodes))).collect::<Vec<_>>())
    }

    #[test]
    fn arcs_join_in_one_direction_and_come_near_the_curve_as_the_cube_of_their_length() {
        for chain in [chain(6), chain(6).with_lead(0.2).with_tail(0.3)] {
            for pair in chain.arcs.windows(2) {
                let (end, t) = (pair[0].point(pair[0].length), pair[0].tangent_at(pair[0].length));
                assert!(minus(end, pair[1].start).iter().all(|x| x.abs() < 1e-12));
                assert!(minus(t, pair[1].tangent).iter().all(|x| x.abs() < 1e-12));
                assert!((pair[0].from + pair[0].length - pair[1].from).abs() < 1e-14);
            }
        }
        let off = |nodes| {
            let chain = chain(nodes);
            (0..200).map(|k| chain.foot(wave(f64::from(k) / 200.0).0).left.abs()).fold(0.0, f64::max)
        };
        let (coarse, fine) = (off(8), off(16));
        assert!(fine < 5e-6 && (6.0..12.0).contains(&(coarse / fine)), "{coarse} {fine}");
    }

    #[test]
    fn the_foot_of_a_point_beside_the_chain_is_where_it_was_set_off() {
        for chain in [chain(8).with_lead(0.2).with_tail(0.2), chain(8).scaled(1.01)] {
            for k in -4..=44 {
                let s = chain.length() * f64::from(k) / 40.0;
                for d in [-0.2, -0.01, 0.0, 1e-5, 0.2] {
                    let (p, t) = (chain.point(s), chain.tangent(s));
                    let foot = chain.foot([p[0] - d * t[1], p[1] + d * t[0]]);
                    assert!((foot.left - d).abs() < 1e-12 && (foot.arc - s).abs() < 1e-11, "{s} {d}: {foot:?}");
                    assert!((foot.tangent[0] - t[0]).abs() + (foot.tangent[1] - t[1]).abs() < 1e-11);
                }
                let p = chain.point(s);
                assert!((chain.arc_at_radius(p[0].hypot(p[1])) - s).abs() < 1e-10);
            }
        }
    }
}
