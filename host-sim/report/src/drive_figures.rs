//! Figures and tables of a drive that more than one page shows: the drive in motion, its stress, how its teeth share
//! the load, its data sheet.

use std::f64::consts::TAU;

use super::animation::{Animation, FRAMES};
use super::page::{
    ChartAxis, ChartSeries, Figure, FigureBody, Lines, Mark, PageBlock, PageQuantity, PageSection, RichText,
    significant,
};
use flexspline_design::cautions::Caution;
use flexspline_design::simulate::Row;
use flexspline_design::sketch::sketch;
use flexspline_design::stated::{Beside, SheetBeside};
use flexspline_mechanics::drive::Drive;
use flexspline_mechanics::mesh::MeshError;

/// A value of a row, by what a legend calls it.
pub(super) type OfRow = (&'static str, fn(&Row) -> f64);

/// Stress and pressures of a row, MPa.
pub(super) const STRESSES: [OfRow; 3] = [
    ("von Mises stress, both wheels", |row| row.max_von_mises_mpa),
    ("pressure between flanks", |row| row.peak_flank_pressure_mpa),
    ("pressure of generator on bore", |row| row.peak_generator_pressure_mpa),
];
/// Their definition, for captions.
pub(super) const STRESSES_ARE: &str = "Von Mises stress is averaged at nodes; pressures are those of the contact. \
                                       Plane strain: no bending over the length of the sleeve, and no stress raiser \
                                       finer than the mesh.";

/// A tooth pitch of the flexspline, rad.
fn pitch(animation: &Animation) -> f64 {
    TAU / animation.flexspline.sectors as f64
}

/// Generator angle of a frame from the beginning of a pitch, degrees.
fn degrees(animation: &Animation, frame: i64) -> f64 {
    (pitch(animation) * frame as f64 / FRAMES as f64).to_degrees()
}

/// Points in ascending order, those at one place a hair apart: they would hide one another in a table.
pub(super) fn apart(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    for k in 1..points.len() {
        if points[k][0] <= points[k - 1][0] {
            points[k][0] = points[k - 1][0] + 1e-5 * points[k - 1][0].abs().max(1e-3);
        }
    }
    points
}

/// A caution as a page has it.
pub(super) fn caution_words(caution: &Caution) -> String {
    caution.words.replace(" um", " µm")
}

/// Mean error over the frames of a pitch, arcsec.
pub(super) fn mean_arcsec(animation: &Animation) -> f64 {
    animation.error_arcsec.iter().sum::<f64>() / FRAMES as f64
}

/// Error over the frames of a pitch, less its mean: degrees from the beginning of the pitch, arcsec.
pub fn less_mean(animation: &Animation) -> Vec<[f64; 2]> {
    let (e, mean) = (&animation.error_arcsec, mean_arcsec(animation));
    (0..=FRAMES).map(|k| [degrees(animation, k as i64), e[k % FRAMES] - mean]).collect()
}

/// The drive to scale; `state` says under what load it turns, and which way.
pub fn drive_figure(state: &str) -> Figure {
    let caption = format!(
        "Contact FEM, plane strain, {state}; both wheels meshed as computed. The flexspline stands and is \
             deformed by the generator (grey); the circular spline turns: the red dot is on tooth 0, the blue one on \
             space 0, which meet on the major axis at generator angle 0. Arrows push on the flexspline: red from the \
             circular spline, at the flanks, blue from the generator. What is seen at one angle is seen again a tooth \
             pitch later, one tooth on; between computed positions, an eighth of a pitch apart, the picture \
             interpolates. Move along figure 2 to turn the generator.",
    );
    let alt = "Cross section of the drive: circular spline outside, deformed flexspline inside it, wave generator in \
               the middle, coloured by von Mises stress, and an enlargement of the teeth at the major axis";
    Figure { alt: alt.into(), ..Figure::of("drive", "The drive to scale", caption, FigureBody::Drive) }
}

/// The flexspline with its sleeve.
pub fn sleeve_figure() -> Figure {
    let caption = "Its middle surface, the wave of the generator in the state of the figure above: each harmonic of \
                   the rim by contact FEM, extended along rim and tubes by the theory of shells. Displacements are \
                   drawn larger than they are, by the factor below; colours are their outward part as it is. The \
                   toothed rim is outlined. The sleeve stands, the wave turns with the generator. In the corner, \
                   where the drive is computed with face = \"slices\": how the load lies along the face of the flank \
                   that bears most.";
    let alt = "The flexspline as a tube in perspective, deformed by the wave generator, coloured by its outward \
               displacement";
    let figure = Figure::of("sleeve", "The flexspline in three dimensions", caption, FigureBody::Sleeve);
    Figure { alt: alt.into(), ..figure }
}

/// The sizes of a drive, drawn.
///
/// # Errors
/// The drive has no mesh.
pub(super) fn sizes_section(drive: &Drive) -> Result<PageSection, MeshError> {
    let caption = "Half of a section along the axis, undeformed and to scale.";
    let figure = Figure::of("sizes", "Sizes of the drive", caption, FigureBody::Svg(sketch(drive)?));
    Ok(PageSection::folded("sizes", "Sizes", vec![PageBlock::Figure(figure)]))
}

/// Stress and pressures over a pitch.
pub(super) fn stress_lines(animation: &Animation) -> Lines {
    let frame = |row: &Row| {
        let frame = (row.generator_rad * FRAMES as f64 / pitch(animation)).round() as i64;
        frame.rem_euclid(FRAMES as i64) as usize
    };
    let mut rows: Vec<(usize, &Row)> = animation.rows.iter().map(|row| (frame(row), row)).collect();
    rows.sort_by_key(|(frame, _)| *frame);
    let series = |(colour, (name, of)): (usize, OfRow)| {
        let point = |k: usize| {
            let (_, row) = rows.iter().find(|(frame, _)| *frame == k % FRAMES)?;
            Some([degrees(animation, k as i64), of(row)])
        };
        ChartSeries::new(name, Mark::Line, colour, (0..=FRAMES).filter_map(point).collect())
    };
    Lines::of(STRESSES.into_iter().enumerate().map(series).collect())
}

/// Stress and pressures over a pitch, a chart to each choice.
pub(super) fn stress_figure(charts: Vec<(String, Lines)>) -> PageBlock {
    let axes = [ChartAxis::over_pitch(), ChartAxis::new("Stress, pressure", PageQuantity::Stress)];
    let caption = format!("At the load of figure 1. {STRESSES_ARE}");
    PageBlock::lines("stress", "Largest stress and pressures over a pitch", caption, axes, charts)
}

/// Names of the forces on a tooth in a legend: either flank, the generator.
pub(super) const BEARS: [&str; 3] =
    ["flank towards growing angles", "flank towards falling angles", "generator on bore, per tooth"];

/// How the load is shared among the teeth.
pub(super) fn sharing_lines(animation: &Animation) -> Lines {
    let samples = animation.flexspline.samples;
    let force = |row: usize, s: usize| {
        let at = |row: usize| animation.forces[row * samples + s];
        at(row).hypot(at(row + 1))
    };
    let half = samples as i64 / 2;
    let series = |(colour, (mark, row)): (usize, (Mark, usize))| {
        let points =
            (-half..half).map(|k| [degrees(animation, k), force(row, k.rem_euclid(samples as i64) as usize)]).collect();
        ChartSeries::new(BEARS[colour], mark, colour, points)
    };
    let rows = [(Mark::Line, 0), (Mark::Line, 4), (Mark::Dashed, 8)];
    Lines::of(rows.into_iter().enumerate().map(series).collect())
}

/// The axes of [`sharing_figure`].
pub(super) fn sharing_axes() -> [ChartAxis; 2] {
    [ChartAxis::new("Tooth from the major axis", PageQuantity::Degree), ChartAxis::new("Force", PageQuantity::Force)]
}

/// How the load is shared among the teeth, a chart to each choice.
pub(super) fn sharing_figure(charts: Vec<(String, Lines)>) -> PageBlock {
    let caption = "Force on a flexspline tooth by its angle from the major axis, at the load of figure 1: of each \
                   flank, and of the generator on the piece of bore under the tooth. The other lobe carries the same.";
    PageBlock::lines("sharing", "How the teeth share the load", caption, sharing_axes(), charts)
}

/// The data sheets and what is computed of them, by choice; nothing where there is none.
pub(super) fn sheet_section(sheets: Vec<(String, SheetBeside)>) -> Option<PageSection> {
    let source = sheets.first()?.1.stated.source.clone().unwrap_or_else(|| "the data sheet".to_owned());
    let mut blocks = Vec::new();
    for (id, sheet) in sheets {
        let number = |value: Option<f64>| RichText::new(value.map_or_else(|| "–".to_owned(), |v| significant(v, 3)));
        let row = |row: &Beside| {
            let (name, unit) = row.in_words();
            let numbers = [Some(row.stated), row.computed, row.ratio].map(number);
            [vec![RichText::new(format!("{name}, {unit}"))], numbers.into(), vec![RichText::new(row.remark(&sheet))]]
                .concat()
        };
        let caption = format!("{source} and contact FEM; {} N·m", sheet.loads_in_words());
        let header = ["Figure", "stated", "computed", "ratio", "what is computed"];
        let table = PageBlock::table(caption, &header, sheet.beside.iter().map(row).collect());
        let loads = sheet.assumed_in_words().map(|what| PageBlock::paragraph(format!("Loads: {what}.")));
        let why = sheet.why.as_ref().map(|why| PageBlock::paragraph(format!("Not all of it was computed: {why}.")));
        blocks.extend([Some(table), loads, why].into_iter().flatten().map(|block| block.of_choice(id.clone())));
    }
    Some(PageSection::new("data-sheet", "The data sheet and the model", blocks))
}
