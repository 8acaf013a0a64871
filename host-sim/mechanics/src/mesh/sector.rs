//! The half sector of a wheel: three structured blocks between the tooth axis and the space axis.
//!
//! Blocks are mapped by transfinite interpolation (Gordon and Hall 1973) on a grid twice as fine as the elements, so
//! that the midside nodes come out of the same mapping and lie exactly on the outline.

use super::density::MeshDensity;
use crate::drive::DriveError;
use thiserror::Error;

/// A point in the plane, mm.
pub type Point = [f64; 2];

/// The shape that a half sector is meshed from, in the frame whose +x axis is the tooth axis, the half sector lying on
/// the side of positive angles. Radii in mm.
pub(crate) struct HalfOutline<'a> {
    /// Half the angular pitch: the angle of the space axis, rad.
    pub half_pitch: f64,
    /// Bore of an external wheel, outer radius of an internal one.
    pub base_radius: f64,
    /// Interface circle between rim and teeth.
    pub interface_radius: f64,
    /// Root land and fillet, from the space axis (0) over the foot of the fillet (1) to its end at the flank (2).
    pub root: &'a dyn Fn(f64) -> Point,
    /// Flank by radius, valid from the end of the fillet to the tip circle.
    pub flank: &'a dyn Fn(f64) -> Point,
    /// Radius at which the fillet ends and the flank begins.
    pub flank_start_radius: f64,
    /// Radius of the tip circle.
    pub tip_radius: f64,
}

/// Why a wheel could not be meshed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MeshError {
    /// The outline of the teeth is impossible.
    #[error(transparent)]
    Outline(#[from] DriveError),
    /// An element came out folded.
    #[error(
        "the {wheel} cannot be meshed: an element at radius {radius_mm:.3} mm is folded (Jacobian {jacobian:.3e}); \
         check root radius, fillet, tip thickness and rim of the drive"
    )]
    Folded {
        /// Which wheel.
        wheel: &'static str,
        /// Where, mm from the axis.
        radius_mm: f64,
        /// The Jacobian found.
        jacobian: f64,
    },
}

/// Boundary that an element edge of the half sector lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum EdgeTag {
    /// Bore or outer circle, numbered from the tooth axis.
    Base(usize),
    /// Flank, numbered from the root.
    Flank(usize),
}

/// Elements of the half sector by the coordinates of their eight nodes.
pub(crate) struct HalfSector {
    /// Node coordinates of each element.
    pub elements: Vec<[Point; 8]>,
    /// Tagged edges: element, local edge (from corner i to corner i+1), what it lies on.
    pub edges: Vec<(usize, usize, EdgeTag)>,
}

fn lerp(a: Point, b: Point, t: f64) -> Point {
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t]
}

fn polar(radius: f64, angle: f64) -> Point {
    [radius * angle.cos(), radius * angle.sin()]
}

/// A side of a block, sampled at twice the element count plus one.
type SidePoints = Vec<Point>;

fn sample(elements: usize, f: impl Fn(f64) -> Point) -> SidePoints {
    let n = 2 * elements;
    (0..=n).map(|i| f(i as f64 / n as f64)).collect()
}

fn join(first: SidePoints, second: &[Point]) -> SidePoints {
    let mut joined = first;
    joined.extend_from_slice(&second[1..]);
    joined
}

/// Transfinite interpolation between four sides; `bottom` and `top` run the same way, as do `left` and `right`, which
/// lead from bottom to top.
fn transfinite(bottom: &[Point], top: &[Point], left: &[Point], right: &[Point]) -> Vec<Vec<Point>> {
    let (nx, ny) = (bottom.len() - 1, left.len() - 1);
    let (c00, c10, c01, c11) = (bottom[0], bottom[nx], top[0], top[nx]);
    (0..=ny)
        .map(|j| {
            let t = j as f64 / ny as f64;
            (0..=nx)
                .map(|i| {
                    let s = i as f64 / nx as f64;
                    std::array::from_fn(|k| {
                        (1.0 - t) * bottom[i][k] + t * top[i][k] + (1.0 - s) * left[j][k] + s * right[j][k]
                            - (1.0 - s) * (1.0 - t) * c00[k]
                            - s * (1.0 - t) * c10[k]
                            - (1.0 - s) * t * c01[k]
                            - s * t * c11[k]
                    })
                })
                .collect()
        })
        .collect()
}

impl HalfSector {
    /// Meshes the half sector.
    pub fn new(outline: &HalfOutline, density: &MeshDensity) -> HalfSector {
        let MeshDensity([tooth_columns, space_columns, rim_rows, root_rows, fillet_elements, flank_elements]) =
            *density;
        let columns = tooth_columns + space_columns;

        // The fillet is cut in its middle, where a line normal to it leads down to the interface circle.
        let cut = (outline.root)(1.5);
        let step = 1e-6;
        let (before, after) = ((outline.root)(1.5 - step), (outline.root)(1.5 + step));
        let tangent = [after[0] - before[0], after[1] - before[1]];
        let mut normal = [tangent[1], -tangent[0]];
        let length = normal[0].hypot(normal[1]);
        let inward = if outline.base_radius < outline.tip_radius { -1.0 } else { 1.0 };
        let towards = inward * (normal[0] * cut[0] + normal[1] * cut[1]).signum() / length;
        normal = normal.map(|x| x * towards);
        let foot = line_to_circle(cut, normal, outline.interface_radius);
        let foot_angle = foot[1].atan2(foot[0]).clamp(0.3 * outline.half_pitch, 0.9 * outline.half_pitch);
        let foot = polar(outline.interface_radius, foot_angle);

        // Sides shared by the blocks.
        let interface_tooth = sample(tooth_columns, |t| polar(outline.interface_radius, foot_angle * t));
        let interface_space = sample(space_columns, |t| {
            polar(outline.interface_radius, foot_angle + (outline.half_pitch - foot_angle) * t)
        });
        let riser = sample(root_rows, |t| lerp(foot, cut, t));

        // A: rim, from base to interface.
        let base = sample(columns, |t| polar(outline.base_radius, outline.half_pitch * t));
        let interface = join(interface_tooth.clone(), &interface_space);
        let rim_side = |angle: f64| {
            sample(rim_rows, move |t| {
                polar(outline.base_radius + (outline.interface_radius - outline.base_radius) * t, angle)
            })
        };
        let rim = transfinite(&base, &interface, &rim_side(0.0), &rim_side(outline.half_pitch));

        // B: tooth, from interface to tip.
        let fillet = sample(fillet_elements, |t| (outline.root)(1.5 + 0.5 * t));
        let flank = sample(flank_elements, |t| {
            (outline.flank)(outline.flank_start_radius + (outline.tip_radius - outline.flank_start_radius) * t)
        });
        let tooth_right = join(join(riser.clone(), &fillet), &flank);
        let tip_corner = tooth_right[tooth_right.len() - 1];
        let tip_angle = tip_corner[1].atan2(tip_corner[0]);
        let tip = sample(tooth_columns, |t| polar(outline.tip_radius, tip_angle * t));
        let tooth_left: SidePoints = tooth_right.iter().map(|p| [p[0].hypot(p[1]), 0.0]).collect();
        let tooth = transfinite(&interface_tooth, &tip, &tooth_left, &tooth_right);

        // C: foot of the fillet and root land, from interface to outline.
        let half_fillet_columns = if space_columns > 1 { space_columns / 2 } else { 0 };
        let root_top = if half_fillet_columns == 0 {
            // One element carries half the fillet and the land; its midside node sits at the joint.
            vec![cut, (outline.root)(1.0), (outline.root)(0.0)]
        } else {
            join(
                sample(half_fillet_columns, |t| (outline.root)(1.5 - 0.5 * t)),
                &sample(space_columns - half_fillet_columns, |t| (outline.root)(1.0 - t)),
            )
        };
        let land = root_top[root_top.len() - 1];
        let space_side = sample(root_rows, |t| lerp(polar(outline.interface_radius, outline.half_pitch), land, t));
        let space = transfinite(&interface_space, &root_top, &riser, &space_side);

        let mut sector = HalfSector { elements: Vec::new(), edges: Vec::new() };
        sector.add_block(&rim, outline, |_, _| None, |i| Some(EdgeTag::Base(i)));
        let first_flank_row = root_rows + fillet_elements;
        sector.add_block(
            &tooth,
            outline,
            |i, j| (i + 1 == tooth_columns && j >= first_flank_row).then(|| EdgeTag::Flank(j - first_flank_row)),
            |_| None,
        );
        sector.add_block(&space, outline, |_, _| None, |_| None);
        sector
    }

    /// Adds the elements of a block grid (indexed row, column at half-element spacing), with tags for right and bottom
    /// edges.
    fn add_block(
        &mut self,
        grid: &[Vec<Point>],
        outline: &HalfOutline,
        right_tag: impl Fn(usize, usize) -> Option<EdgeTag>,
        bottom_tag: impl Fn(usize) -> Option<EdgeTag>,
    ) {
        // With the base inside the tip (external wheel) columns run with positive angle while rows run outwards: the
        // pair is right-handed only when flipped.
        let external = outline.base_radius < outline.tip_radius;
        for j in 0..(grid.len() - 1) / 2 {
            for i in 0..(grid[0].len() - 1) / 2 {
                let at = |a: usize, b: usize| grid[2 * j + b][2 * i + a];
                let element = self.elements.len();
                let (nodes, right_edge, bottom_edge) = if external {
                    // Corners in order: inner-left, outer-left, outer-right, inner-right.
                    ([at(0, 0), at(0, 2), at(2, 2), at(2, 0), at(0, 1), at(1, 2), at(2, 1), at(1, 0)], 2, 3)
                } else {
                    ([at(0, 0), at(2, 0), at(2, 2), at(0, 2), at(1, 0), at(2, 1), at(1, 2), at(0, 1)], 1, 0)
                };
                self.elements.push(nodes);
                if let Some(tag) = right_tag(i, j) {
                    self.edges.push((element, right_edge, tag));
                }
                if j == 0
                    && let Some(tag) = bottom_tag(i)
                {
                    self.edges.push((element, bottom_edge, tag));
                }
            }
        }
    }
}

/// Where the ray from `start` along the unit vector `direction` meets the circle of `radius` about the origin, nearest
/// first.
fn line_to_circle(start: Point, direction: Point, radius: f64) -> Point {
    let b = start[0] * direction[0] + start[1] * direction[1];
    let c = start[0] * start[0] + start[1] * start[1] - radius * radius;
    let root = (b * b - c).max(0.0).sqrt();
    let t = if (-b - root) > 0.0 { -b - root } else { -b + root };
    [start[0] + direction[0] * t, start[1] + direction[1] * t]
}
