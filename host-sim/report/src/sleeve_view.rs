//! The flexspline in three dimensions, small enough for a page: each harmonic of the rim with its shape along the axis.
//!
//! In steady motion the rim keeps its form in the frame of the generator, so that one state shows a whole turn:
//! amplitudes of `cos n theta` and `sin n theta`, theta from the major axis, and for each a shape of U, V and W at
//! stations along the axis. A page adds them up.

use serde::Serialize;

use flexspline_export::station_at;
use flexspline_mechanics::contact::{Configuration, FlankLaw};
use flexspline_mechanics::mesh::MeshError;
use flexspline_mechanics::sleeve::{Flexspline3d, Station};
use flexspline_mechanics::stepping::{Face, Problem, State};

/// Stations along the axis that a page is given, about.
const STATIONS: usize = 36;
/// Harmonics whose amplitude is less than this share of the largest are left out: a tenth of a percent is not seen.
const LEAST_SHARE: f64 = 1e-3;
/// Flanks closer than this (mm) may touch between the points that the search looks at.
const NEAR_MM: f64 = 0.01;

/// A harmonic of the rim, in the frame of the generator.
#[derive(Debug, Clone, Serialize)]
pub struct DrawnWave {
    /// Its number around.
    pub n: u32,
    /// Amplitudes of `cos n theta` and of `sin n theta` in the middle of the rim, mm.
    pub amplitudes_mm: [f64; 2],
    /// For an amplitude of 1, at each station: along the axis (`cos n theta`), around it (`sin n theta`), outward
    /// (`cos n theta`).
    pub along: Vec<f64>,
    /// See `along`.
    pub around: Vec<f64>,
    /// See `along`.
    pub outward: Vec<f64>,
}

/// A flexspline with its sleeve, deformed.
#[derive(Debug, Clone, Serialize)]
pub struct SleeveView {
    /// Radius of the middle surface, mm.
    pub radius_mm: f64,
    /// Half the face width, mm: the toothed rim lies between minus and plus this.
    pub half_face_mm: f64,
    /// Number of teeth.
    pub teeth: u32,
    /// Stations along the axis, mm from the middle of the rim, from the flange's end to the bottom's.
    pub stations_mm: Vec<f64>,
    /// What stands at the first and at the last station: `flange`, `bottom`, or `open`.
    pub ends: [&'static str; 2],
    /// Harmonics.
    pub waves: Vec<DrawnWave>,
    /// Largest tilt and skew of a tooth along its face, mrad.
    pub tilt_mrad: f64,
    /// See `tilt_mrad`.
    pub skew_mrad: f64,
    /// Load along the face of the flank that bears most, over its mean, from the flange's end to the bottom's; empty
    /// where it is even.
    pub load_over_mean: Vec<f64>,
}

impl SleeveView {
    /// That of a state; `None` where the drive has no shells beside its rim.
    pub fn of(problem: &Problem, state: &State, face: &Face) -> Result<Option<SleeveView>, MeshError> {
        let rim = problem.rim_waves(state);
        if !problem.drive.sleeve.is_shell() || rim.is_empty() {
            return Ok(None);
        }
        let shells = Flexspline3d::of(&problem.drive, true)?;
        let half_face_mm = 0.5 * shells.width_mm;
        let stations_mm = stations(&shells.shape(2), half_face_mm);
        let largest = rim.iter().map(|(_, [a, b])| a.hypot(*b)).fold(0.0, f64::max);
        let waves = rim
            .into_iter()
            .filter(|(_, [a, b])| a.hypot(*b) > LEAST_SHARE * largest)
            .map(|(n, [a, b])| {
                let shape = shells.shape(n);
                let read = |of: fn(&Station) -> f64| {
                    stations_mm.iter().map(|x| rounded(of(&station_at(&shape, *x)))).collect()
                };
                let (sin, cos) = (f64::from(n) * state.generator_rad).sin_cos();
                DrawnWave {
                    n,
                    // theta = angle - generator
                    amplitudes_mm: [a * cos + b * sin, b * cos - a * sin].map(rounded),
                    along: read(|at| at.along),
                    around: read(|at| at.around),
                    outward: read(|at| at.outward),
                }
            })
            .collect();
        let sleeve = &problem.drive.sleeve;
        Ok(Some(SleeveView {
            radius_mm: rounded(shells.rim.radius_mm),
            half_face_mm,
            teeth: problem.drive.flexspline.teeth,
            stations_mm: stations_mm.iter().map(|x| rounded(*x)).collect(),
            ends: [
                if sleeve.has_flange() { "flange" } else { "open" },
                if sleeve.has_bottom() { "bottom" } else { "open" },
            ],
            waves,
            tilt_mrad: rounded(1e3 * face.tilt_rad),
            skew_mrad: rounded(1e3 * face.skew_rad),
            load_over_mean: load_across_face(problem, state),
        }))
    }
}

/// Four digits after the first: what a picture shows.
fn rounded(x: f64) -> f64 {
    format!("{x:.4e}").parse().unwrap_or(x)
}

/// Places along the axis: those of the shape, thinned, and both ends of the face.
fn stations(shape: &[Station], half_face: f64) -> Vec<f64> {
    let step = shape.len().div_ceil(STATIONS).max(1);
    let mut places: Vec<f64> = shape.iter().step_by(step).map(|at| at.x_mm).collect();
    places.extend([-half_face, 0.0, half_face]);
    places.extend(shape.last().map(|at| at.x_mm));
    let (low, high) = (shape.first().map_or(0.0, |at| at.x_mm), shape.last().map_or(0.0, |at| at.x_mm));
    places.retain(|x| (low..=high).contains(x));
    places.sort_by(f64::total_cmp);
    places.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    places
}

fn load_across_face(problem: &Problem, state: &State) -> Vec<f64> {
    let flanks = problem.flanks();
    let at = Configuration { u: &state.u, v: &state.v, output_rad: state.output_rad, leans: &state.leans };
    let law = FlankLaw { stiffness: problem.settings.flank_penalty, stick_stiffness: 0.0, friction: 0.0 };
    let loads = flanks.near_pairs(at, NEAR_MM).into_iter().filter_map(|pair| {
        let layout = flanks.layout(pair, at);
        let load = flanks.evaluate((pair, at), law, &layout.points)?.load;
        Some((load, flanks.load_over_mean((pair, at), law, &layout.points)))
    });
    let most = loads.max_by(|a, b| a.0.total_cmp(&b.0));
    let along = most.map_or_else(Vec::new, |(_, along)| along.into_iter().map(rounded).collect::<Vec<_>>());
    // The face follows from where the flexspline is held: of a cup that is its bottom, at the far end of the axis.
    if problem.drive.sleeve.has_flange() { along } else { along.into_iter().rev().collect() }
}
