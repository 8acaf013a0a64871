//! Curves of the page.

use crate::experiments::{LARGE_ARCMIN, curves};
use crate::{Reproduction, paper};
use flexspline_base::units::ARCMIN_PER_RAD;
use flexspline_design::simulate::Row;
use flexspline_mechanics::drive::GeneratorKind;
use flexspline_mechanics::reference::ToothPath;
use flexspline_report::animation::{Animation, FRAMES};
use flexspline_report::page::{Limit, Lines, Mark, Series, Upright};
use std::f64::consts::TAU;

fn series(name: impl Into<String>, mark: Mark, colour: usize, points: Vec<[f64; 2]>) -> Series {
    Series { name: name.into(), mark, colour, points }
}

/// x in degrees.
fn degrees(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    points.iter().map(|[x, y]| [x.to_degrees(), *y]).collect()
}

/// Way out and way back of a run as two series.
fn both_ways(name: &str, colour: usize, rows: &[Row]) -> [Series; 2] {
    let [out, back] = curves(rows).map(|curve| degrees(&curve));
    [
        series(format!("{name}, forward"), Mark::Line, colour, out),
        series(format!("{name}, back"), Mark::Dashed, colour, back),
    ]
}

/// The error over one pitch.
pub(super) fn ripple(a: &Animation) -> Lines {
    let pitch = (TAU / a.flexspline.sectors as f64).to_degrees();
    let points = (0..=FRAMES).map(|k| [pitch * k as f64 / FRAMES as f64, a.error_arcsec[k % FRAMES]]).collect();
    Lines { series: vec![series("no load, forward", Mark::Line, 0, points)], ..Lines::default() }
}

/// Figure 13.
pub(super) fn errors(r: &Reproduction) -> Lines {
    let runs = GeneratorKind::ALL.into_iter().enumerate();
    let series =
        runs.filter_map(|(colour, kind)| Some(both_ways(kind.in_words(), colour, &r.runs.get(kind, 0.0)?.rows)));
    Lines { series: series.flatten().collect(), ..Lines::default() }
}

/// Figure 12.
pub(super) fn travel(r: &Reproduction, kind: GeneratorKind) -> Option<Lines> {
    let rows = &r.runs.get(kind, 0.0)?.rows;
    let arcsec = |rad: f64| rad.to_degrees() * 3600.0;
    let turn = rows.iter().position(|row| row.turn_rad < 0.0)?;
    let line = |rows: &[Row]| {
        let mut points: Vec<[f64; 2]> =
            rows.iter().map(|row| [row.generator_rad.to_degrees(), arcsec(row.output_rad)]).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points
    };
    let nominal = [-1.0, 1.0_f64].map(|x| [x.to_degrees(), arcsec(x / r.drive.ratio())]);
    Some(Lines {
        series: vec![
            series("nominal", Mark::Line, 5, nominal.into()),
            series("forward", Mark::Line, 0, line(&rows[..turn])),
            series("back", Mark::Dashed, 1, line(&rows[turn - 1..])),
        ],
        ..Lines::default()
    })
}

/// What the changes of the model do.
pub(super) fn sources(r: &Reproduction, kind: GeneratorKind) -> Option<Lines> {
    let mut lines = Lines::default();
    for (colour, experiment) in r.experiments.iter().enumerate() {
        let Some(effect) = experiment.effects.iter().find(|e| e.generator == kind.name() && e.metrics.is_some()) else {
            continue;
        };
        let [out, back] = &effect.curves;
        lines.series.push(series(experiment.name, Mark::Line, colour % 6, degrees(out)));
        if effect.largest_arcmin.is_some_and(|largest| largest > LARGE_ARCMIN) {
            lines.series.push(series(format!("{}, back", experiment.name), Mark::Dashed, colour % 6, degrees(back)));
        }
    }
    if let Some(size) = paper::error_rad(kind) {
        let arcsec = 60.0 * size * ARCMIN_PER_RAD;
        let name = format!("the paper's {:.1}′", size * ARCMIN_PER_RAD);
        lines.limits.extend([arcsec, -arcsec].map(|y| Limit { name: name.clone(), y }));
    }
    (!lines.series.is_empty()).then_some(lines)
}

/// Figure 6.
pub(super) fn tip_path(r: &Reproduction, kind: GeneratorKind) -> Option<Lines> {
    let snapshot = r.runs.get(kind, 0.0)?.snapshot.as_ref()?;
    let path = ToothPath::new(&r.drive, kind);
    let mut formula: Vec<[f64; 2]> = (0..=90)
        .map(|k| {
            let point = path.flexspline_tip(f64::from(k).to_radians());
            [point.v_mm, point.w_mm]
        })
        .collect();
    let mut fem: Vec<[f64; 2]> = snapshot.tip_path.iter().map(|[_, w, v]| [*v, *w]).collect();
    for points in [&mut formula, &mut fem] {
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    }
    let limits =
        [("tip of the circular spline", path.circular_spline_tip()), ("its root", path.circular_spline_root())];
    Some(Lines {
        series: vec![series("formulas (7) and (9)", Mark::Line, 0, formula), series("FEM", Mark::Points, 1, fem)],
        limits: limits.map(|(name, point)| Limit { name: name.into(), y: point.w_mm }).into(),
        ..Lines::default()
    })
}

/// Formulas less FEM.
pub(super) fn tip_difference(r: &Reproduction, kind: GeneratorKind) -> Option<Lines> {
    let snapshot = r.runs.get(kind, 0.0)?.snapshot.as_ref()?;
    let path = ToothPath::new(&r.drive, kind);
    let mut differences: Vec<[f64; 3]> = snapshot
        .tip_path
        .iter()
        .map(|&[phi, w, v]| {
            let formula = path.flexspline_tip(phi);
            [phi.to_degrees(), 1e3 * (formula.w_mm - w), 1e3 * (formula.v_mm - v)]
        })
        .collect();
    differences.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let of = |k: usize| differences.iter().map(|d| [d[0], d[k]]).collect();
    Some(Lines {
        series: vec![series("outward", Mark::Line, 0, of(1)), series("around", Mark::Line, 1, of(2))],
        ..Lines::default()
    })
}

/// Figures 10 and 11 as curves.
pub(super) fn stress(r: &Reproduction) -> Lines {
    let runs = GeneratorKind::ALL.into_iter().enumerate();
    let curves = runs.filter_map(|(colour, kind)| {
        let snapshot = r.runs.get(kind, 0.0)?.snapshot.as_ref()?;
        Some(series(kind.in_words(), Mark::Line, colour, snapshot.stress.clone()))
    });
    let uprights = [("M", -90.0), ("D", 0.0), ("M", 90.0)].map(|(name, x)| Upright { name: name.into(), x });
    Lines { series: curves.collect(), uprights: uprights.into(), ..Lines::default() }
}

/// Figures 14 and 15.
pub(super) fn load(r: &Reproduction, kind: GeneratorKind) -> Lines {
    let torque = paper::TORQUE_N_M;
    let runs = [(torque, "+200 N·m"), (0.0, "no load"), (-torque, "−200 N·m")].into_iter().enumerate();
    let curves =
        runs.filter_map(|(colour, (torque, name))| Some(both_ways(name, colour, &r.runs.get(kind, torque)?.rows)));
    Lines { series: curves.flatten().collect(), ..Lines::default() }
}

/// Figures 16 and 17.
pub(super) fn reversal(r: &Reproduction, kind: GeneratorKind) -> Option<Lines> {
    let solved = r.runs.get(kind, 0.0)?;
    let [out, back] = curves(&solved.rows).map(|curve| degrees(&curve));
    let a = 1.0_f64.to_degrees();
    let b = a - solved.metrics.dwell_rad?.to_degrees();
    // The stretch A-B is a part of the way back.
    let stands: Vec<[f64; 2]> = back.iter().copied().filter(|p| p[0] >= b - 1.0).collect();
    let follows: Vec<[f64; 2]> = back.into_iter().filter(|p| p[0] <= b + 1e-9).collect();
    let uprights = [("B", b), ("A", a), ("C", -a)].map(|(name, x)| Upright { name: name.into(), x });
    Some(Lines {
        series: vec![
            series("0 to A", Mark::Line, 0, out),
            series("A to B, the output stands", Mark::Line, 2, stands),
            series("B to C", Mark::Line, 1, follows),
        ],
        uprights: uprights.into(),
        ..Lines::default()
    })
}
