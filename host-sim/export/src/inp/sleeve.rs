//! The flexspline alone in three dimensions as a deck for CalculiX and Abaqus: what `flexspline sleeve --no-teeth`
//! says, by solids.
//!
//! A quarter of it, `C3D20R`, with a smooth rim; rim and tubes share their middle surface. A generator of
//! `w0 cos 2 theta` holds the rim on the same five lines as the shells ([`flexspline_mechanics::sleeve`]) and tilts as
//! it will: linear equations tie the radial displacement of each node on them to the node `BAND`, whose first degree of
//! freedom is the amplitude W and whose second is the tilt (rad, along z). The force on the first is a quarter of what
//! makes w0 by the shells; K of the band is four times that force over W.
//!
//! | end | in the deck |
//! |---|---|
//! | flange `rigid` | all nodes held |
//! | bottom `disc` | held in its plane, free along the axis |
//! | bottom `clamped` | all nodes held |
//!
//! Equations stand in place of coordinates transformed at nodes, which CalculiX 2.20 gets wrong on shells; solids need
//! none.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::io::{self, Write};

use super::{DeckError, EquationTerm, equation, list, short};
use flexspline_mechanics::drive::{Bottom, Drive, Flange};
use flexspline_mechanics::sleeve::Flexspline3d;

/// Elements around a quarter, through a tube, and between two lines of the rim. 20 around and twice as many between the
/// lines move K2 of CUP-95 and of HHD-95-hermetic by less than 0.01 %.
const AROUND: usize = 14;
const THROUGH: usize = 2;
const BETWEEN_LINES: usize = 1;
/// First element of a tube at either end, in decay lengths `sqrt(R t)`; how much longer each next one may be; the
/// longest, in radii.
const FIRST: f64 = 0.4;
const GROWTH: f64 = 1.6;
const LONGEST: f64 = 0.25;
/// Elements along half a tube: a tube of 250 radii has 1000.
const MOST_ELEMENTS: usize = 1000;
/// Lines under the generator.
const LINES: usize = 5;

/// A place of a node: along, through, around, in halves of elements.
type Place = (usize, usize, usize);

/// The deck before it is written.
#[derive(Debug, Clone)]
pub struct SleeveDeck<'d> {
    drive: &'d Drive,
    /// Number of each node by its place; they count from 1.
    numbers: BTreeMap<Place, usize>,
    elements: Vec<[usize; 20]>,
    /// Places along the axis, through the wall and around, by halves of elements.
    along: Vec<f64>,
    through: Vec<f64>,
    around: Vec<f64>,
    /// Index along of the lines.
    lines: Vec<usize>,
    middle: usize,
    force_n: f64,
    clamped: Vec<usize>,
    in_plane: Vec<usize>,
}

impl<'d> SleeveDeck<'d> {
    /// The deck of a drive with a sleeve of shells.
    ///
    /// # Errors
    /// Ends that the deck has not.
    pub fn new(drive: &'d Drive) -> Result<SleeveDeck<'d>, DeckError> {
        let sleeve = &drive.sleeve;
        if sleeve.has_flange() && sleeve.flange != Flange::Rigid {
            return Err(DeckError::End { field: "flange", found: sleeve.flange.name(), allowed: "rigid" });
        }
        if sleeve.has_bottom() && sleeve.bottom == Bottom::Plate {
            return Err(DeckError::End { field: "bottom", found: sleeve.bottom.name(), allowed: "disc, clamped" });
        }
        let shells = Flexspline3d::of(drive, false).map_err(DeckError::Mesh)?;
        let radius = shells.rim.radius_mm;
        let half = 0.5 * shells.width_mm;
        let lines: Vec<f64> = (0..LINES).map(|k| shells.band_mm * (k as f64 / (LINES - 1) as f64 - 0.5)).collect();

        // Corners along the axis, and the wall between each and the next.
        let mut corners: Vec<f64> = Vec::new();
        let mut walls: Vec<f64> = Vec::new();
        let mut add = |places: Vec<f64>, wall: f64| {
            if corners.is_empty() {
                corners.push(places[0]);
            }
            walls.extend(std::iter::repeat_n(wall, places.len() - 1));
            corners.extend(&places[1..]);
        };
        if let Some((tube, _)) = &shells.flange {
            let wall = tube.shell.thickness_mm;
            add(graded(-half - tube.length_mm, -half, (radius * wall).sqrt(), radius), wall);
        }
        let stops = [vec![-half], lines.clone(), vec![half]].concat();
        for pair in stops.windows(2).filter(|pair| pair[1] - pair[0] > 1e-9) {
            add(even(pair[0], pair[1], BETWEEN_LINES), shells.rim.thickness_mm);
        }
        if let Some((tube, _)) = &shells.bottom {
            let wall = tube.shell.thickness_mm;
            add(graded(half, half + tube.length_mm, (radius * wall).sqrt(), radius), wall);
        }

        // Corners through the wall: every wall's faces, and the middle.
        let mut depths: Vec<f64> = Vec::new();
        for wall in &walls {
            depths.extend((0..=THROUGH).map(|k| wall * (k as f64 / THROUGH as f64 - 0.5)));
        }
        depths.sort_by(f64::total_cmp);
        depths.dedup_by(|a, b| (*a - *b).abs() < 1e-9);

        let halves = |corners: &[f64]| -> Vec<f64> {
            let mut all = vec![corners[0]];
            corners.windows(2).for_each(|pair| all.extend([0.5 * (pair[0] + pair[1]), pair[1]]));
            all
        };
        let around: Vec<f64> = even(0.0, FRAC_PI_2, 2 * AROUND);
        let (along, through) = (halves(&corners), halves(&depths));
        let mut deck = SleeveDeck {
            drive,
            numbers: BTreeMap::new(),
            elements: Vec::new(),
            lines: lines.iter().filter_map(|line| along.iter().position(|x| (x - line).abs() < 1e-9)).collect(),
            middle: through.iter().position(|z| z.abs() < 1e-9).unwrap_or(0),
            force_n: 0.25 * drive.generator.w0_mm * shells.harmonic(2).k_band_n_per_mm,
            clamped: Vec::new(),
            in_plane: Vec::new(),
            through: through.iter().map(|z| radius + z).collect(),
            along,
            around,
        };
        deck.fill(&depths, &walls);
        let (first, last) = (0, deck.along.len() - 1);
        if sleeve.has_flange() {
            deck.clamped.extend(deck.at(first));
        }
        if sleeve.has_bottom() {
            match sleeve.bottom {
                Bottom::Clamped => deck.clamped.extend(deck.at(last)),
                _ => deck.in_plane = deck.at(last),
            }
        }
        Ok(deck)
    }

    /// Numbers the nodes and makes the elements.
    fn fill(&mut self, depths: &[f64], walls: &[f64]) {
        for (k, wall) in walls.iter().enumerate() {
            for (j, pair) in depths.windows(2).enumerate() {
                if pair[0] < -0.5 * wall - 1e-9 || pair[1] > 0.5 * wall + 1e-9 {
                    continue;
                }
                for i in 0..AROUND {
                    let element = std::array::from_fn(|node| {
                        let ((first, c), next) = (BRICK[node / 4], self.numbers.len() + 1);
                        let [a, b] = FACE[first + node % 4];
                        *self.numbers.entry((2 * k + c, 2 * j + a, 2 * i + b)).or_insert(next)
                    });
                    self.elements.push(element);
                }
            }
        }
    }

    /// Nodes at a place along the axis.
    fn at(&self, along: usize) -> Vec<usize> {
        self.numbers.range((along, 0, 0)..(along + 1, 0, 0)).map(|(_, n)| *n).collect()
    }

    /// Unknowns, before any is held.
    pub fn unknowns(&self) -> usize {
        3 * self.numbers.len()
    }

    /// Writes the deck.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "*HEADING\n{}: a quarter of the flexspline, smooth rim, a band of cos 2 theta", self.drive.name)?;
        writeln!(out, "** mm, N, MPa; z along the axis, from the flange to the bottom, 0 in the middle of the rim")?;
        let mut nodes: Vec<(usize, [f64; 3])> = Vec::with_capacity(self.numbers.len());
        for ((k, j, i), number) in &self.numbers {
            let (sin, cos) = self.around[*i].sin_cos();
            nodes.push((*number, [self.through[*j] * cos, self.through[*j] * sin, self.along[*k]]));
        }
        nodes.sort_by_key(|(number, _)| *number);
        let band = nodes.len() + 1;
        writeln!(out, "*NODE, NSET=ALL_NODES")?;
        for (number, [x, y, z]) in &nodes {
            writeln!(out, "{number}, {}, {}, {}", short(*x), short(*y), short(*z))?;
        }
        writeln!(out, "*NODE, NSET=BAND\n{band}, 0., 0., 0.")?;
        writeln!(out, "*ELEMENT, TYPE=C3D20R, ELSET=FLEXSPLINE")?;
        for (number, element) in (1..).zip(&self.elements) {
            let words: Vec<String> = element.iter().map(usize::to_string).collect();
            // At most 16 numbers stand in a line.
            writeln!(out, "{number}, {},\n{}", words[..10].join(", "), words[10..].join(", "))?;
        }
        let last = self.around.len() - 1;
        let plane = |at: usize| self.numbers.iter().filter(move |((_, _, i), _)| *i == at).map(|(_, n)| *n);
        let sets = [
            ("MAJOR_PLANE", plane(0).collect::<Vec<_>>()),
            ("MINOR_PLANE", plane(last).collect()),
            ("CLAMPED", self.clamped.clone()),
            ("IN_PLANE", self.in_plane.clone()),
        ];
        for (name, nodes) in sets.iter().filter(|(_, nodes)| !nodes.is_empty()) {
            writeln!(out, "*NSET, NSET={name}")?;
            list(out, nodes.iter().copied())?;
        }
        self.write_band(out, band)?;
        let material = &self.drive.material;
        writeln!(
            out,
            "*MATERIAL, NAME=STEEL\n*ELASTIC\n{}, {}",
            short(material.youngs_modulus_mpa),
            short(material.poissons_ratio)
        )?;
        writeln!(out, "*SOLID SECTION, ELSET=FLEXSPLINE, MATERIAL=STEEL")?;
        writeln!(out, "*BOUNDARY")?;
        // A node of a plane of symmetry that an end holds is held once.
        let ends: std::collections::BTreeSet<usize> = self.clamped.iter().chain(&self.in_plane).copied().collect();
        for (name, nodes, dof) in [("MAJOR_PLANE", &sets[0].1, 2), ("MINOR_PLANE", &sets[1].1, 1)] {
            debug_assert!(!nodes.is_empty(), "{name}");
            for node in nodes.iter().filter(|node| !ends.contains(node)) {
                writeln!(out, "{node}, {dof}, {dof}")?;
            }
        }
        if !self.clamped.is_empty() {
            writeln!(out, "CLAMPED, 1, 3")?;
        }
        if !self.in_plane.is_empty() {
            writeln!(out, "IN_PLANE, 1, 2")?;
        }
        if self.clamped.is_empty() {
            // What nothing holds along the axis: a body's motion; of a cup the bottom's edge stands on the shaft.
            let node = self.in_plane.first().copied().unwrap_or(1);
            writeln!(out, "{node}, 3, 3")?;
        }
        writeln!(out, "*STEP\n*STATIC\n*CLOAD\n{band}, 1, {}", short(self.force_n))?;
        writeln!(out, "*NODE PRINT, NSET=BAND\nU\n*END STEP")
    }

    /// `u_r = (w0 + tilt z) cos 2 theta` at every node of the lines, on the middle surface.
    fn write_band(&self, out: &mut dyn Write, band: usize) -> io::Result<()> {
        for &line in &self.lines {
            let z = self.along[line];
            for (i, angle) in self.around.iter().enumerate() {
                let Some(node) = self.numbers.get(&(line, self.middle, i)) else { continue };
                let (sin, cos) = angle.sin_cos();
                let shape = (2.0 * angle).cos();
                // The larger of both is the dependent one; on a plane of symmetry the other is held.
                let mut terms = vec![(*node, 1, cos), (*node, 2, sin)];
                terms.sort_by(|a, b| b.2.total_cmp(&a.2));
                if i == 0 || i + 1 == self.around.len() {
                    terms.truncate(1);
                }
                terms.extend([(band, 1, -shape), (band, 2, -shape * z)]);
                terms.retain(|(_, _, factor)| factor.abs() > 1e-12);
                equation(
                    out,
                    terms.into_iter().map(|(node, dof, coefficient)| EquationTerm { node, dof, coefficient }),
                )?;
            }
        }
        Ok(())
    }
}

/// Corners of a face of a brick, then the middles of its edges, by halves through and around.
const FACE: [[usize; 2]; 8] = [[0, 0], [2, 0], [2, 2], [0, 2], [1, 0], [2, 1], [1, 2], [0, 1]];
/// Nodes of a brick, four at a time: where they begin in [`FACE`], and halves along. Corners of the near face and of
/// the far, middles of both, and between.
const BRICK: [(usize, usize); 5] = [(0, 0), (0, 2), (4, 0), (4, 2), (0, 1)];

fn even(from: f64, to: f64, parts: usize) -> Vec<f64> {
    (0..=parts).map(|k| from + (to - from) * k as f64 / parts as f64).collect()
}

/// Corners of a tube: short at both ends, where edges bend, longer between.
fn graded(from: f64, to: f64, decay: f64, radius: f64) -> Vec<f64> {
    let length = to - from;
    let (mut steps, mut covered, mut step) = (Vec::new(), 0.0, FIRST * decay);
    for _ in 0..MOST_ELEMENTS {
        if covered + step >= 0.5 * length {
            break;
        }
        steps.push(step);
        covered += step;
        step = (step * GROWTH).min(LONGEST * radius);
    }
    steps.push((0.5 * length - covered).max(0.0));
    // A last one that is short joins the one before.
    if steps.len() > 1 && steps[steps.len() - 1] < 0.5 * steps[steps.len() - 2] {
        let last = steps.pop().unwrap_or(0.0);
        if let Some(step) = steps.last_mut() {
            *step += last;
        }
    }
    let mut corners = vec![from];
    for step in steps.iter().chain(steps.iter().rev()) {
        corners.push(corners[corners.len() - 1] + step);
    }
    if let Some(last) = corners.last_mut() {
        *last = to;
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tube_is_finer_at_its_ends_and_whole() {
        let places = graded(10.0, 150.0, 4.9, 47.0);
        assert_eq!((places[0], places[places.len() - 1]), (10.0, 150.0));
        let steps: Vec<f64> = places.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!((steps[0] - 1.96).abs() < 1e-9 && steps.iter().all(|s| (1.9..18.0).contains(s)), "{steps:?}");
        assert!((steps[0] - steps[steps.len() - 1]).abs() < 1e-9);
    }

    #[test]
    fn bricks_have_positive_volume_and_the_band_is_tied() {
        let drive = Drive::cup_95();
        let deck = SleeveDeck::new(&drive).unwrap();
        let place: BTreeMap<usize, Place> = deck.numbers.iter().map(|(place, n)| (*n, *place)).collect();
        for element in &deck.elements {
            let at = element.map(|n| {
                let (k, j, i) = place[&n];
                [deck.through[j] * deck.around[i].cos(), deck.through[j] * deck.around[i].sin(), deck.along[k]]
            });
            let arm = |n: usize| -> [f64; 3] { std::array::from_fn(|k| at[n][k] - at[0][k]) };
            let ([a, b, c], [d, e, f], [g, h, l]) = (arm(1), arm(3), arm(4));
            let volume = a * (e * l - f * h) - b * (d * l - f * g) + c * (d * h - e * g);
            assert!(volume > 0.0);
            for (mid, [from, to]) in [(8, [0, 1]), (11, [3, 0]), (14, [6, 7]), (17, [1, 5])] {
                let off = (0..3).map(|k| (at[mid][k] - 0.5 * (at[from][k] + at[to][k])).powi(2)).sum::<f64>().sqrt();
                assert!(off < 0.1, "midside {mid}: {off}");
            }
        }
        assert_eq!((deck.lines.len(), deck.in_plane.is_empty(), deck.clamped.is_empty()), (5, false, true));
        let mut text = Vec::new();
        deck.write(&mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(text.matches("*EQUATION").count(), 5 * (2 * AROUND + 1));
        assert!(text.lines().all(|line| line.len() < 200));
    }

    #[test]
    fn ends_that_a_deck_has_not_are_refused() {
        let error =
            |set: &str| SleeveDeck::new(&Drive::hhd_95_hermetic().with_set(set).unwrap()).unwrap_err().to_string();
        assert!(error("sleeve.bottom=plate").contains("sleeve.bottom: found \"plate\""));
        assert!(error("sleeve.bottom=disc,sleeve.flange=diaphragm").contains("sleeve.flange"));
    }
}
