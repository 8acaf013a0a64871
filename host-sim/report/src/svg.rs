//! Pictures for readers whose program runs no script: plain SVG, in arc-seconds.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use super::animation::{Animation, FRAMES, WheelMotion};
use super::page::{Axis, Lines, Mark, significant};

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 84.0;
const BOTTOM: f64 = 45.0;
const TOP: f64 = 12.0;
const RIGHT: f64 = 12.0;
/// Points of a line at most; a sketch has no use for more.
const MOST_POINTS: usize = 100;
/// Points at most of a line that values which are not finite break, and of a cloud.
const MOST_DOTS: usize = 150;
/// Height of a line of the legend.
const LEGEND: f64 = 18.0;
/// Width of a letter of it, about.
const LETTER: f64 = 6.6;
/// Width of a mark of it with the space around it.
const MARK: f64 = 40.0;
const COLOURS: [&str; 6] = ["#0063a6", "#b3470c", "#00725a", "#8a3f8f", "#6b5b00", "#555555"];

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (a, b) =
        values.filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if a < b {
        (a, b)
    } else if a == b {
        (a - 1.0, b + 1.0)
    } else {
        (0.0, 1.0)
    }
}

/// Points of a line, thinned to about `most`: of each group the least and the largest, so that no peak is lost, and a
/// place that is not finite where it has one.
fn thinned(points: &[[f64; 2]], most: usize) -> Vec<[f64; 2]> {
    if points.len() <= most {
        return points.to_vec();
    }
    let of_group = |group: &[[f64; 2]]| {
        let finite = || group.iter().enumerate().filter(|(_, point)| point[1].is_finite());
        let by_y = |a: &(usize, &[f64; 2]), b: &(usize, &[f64; 2])| a.1[1].total_cmp(&b.1[1]);
        let mut kept: Vec<usize> =
            [finite().min_by(by_y), finite().max_by(by_y)].into_iter().flatten().map(|(k, _)| k).collect();
        kept.extend(group.iter().position(|point| !point[1].is_finite()));
        kept.sort_unstable();
        kept.dedup();
        kept.into_iter().map(|k| group[k]).collect::<Vec<_>>()
    };
    points.chunks(2 * points.len().div_ceil(most)).flat_map(of_group).collect()
}

/// Where the entries of a legend stand: from the left, and in which line.
fn legend_places(names: &[&str]) -> Vec<(f64, usize)> {
    let (mut x, mut line) = (0.0, 0);
    names
        .iter()
        .map(|name| {
            let width = MARK + LETTER * name.chars().count() as f64;
            if x > 0.0 && x + width > WIDTH - LEFT {
                (x, line) = (0.0, line + 1);
            }
            x += width;
            (x - width, line)
        })
        .collect()
}

/// A chart.
pub(super) fn lines(x: &Axis, y: &Axis, chart: &Lines) -> String {
    let points = || chart.series.iter().flat_map(|s| s.points.iter());
    let (x0, x1) = span(points().map(|p| p[0]));
    let (y0, y1) = span(points().map(|p| p[1]).chain(chart.limits.iter().map(|l| l.y)));
    let px = |v: f64| LEFT + (v - x0) / (x1 - x0) * (WIDTH - LEFT - RIGHT);
    let py = |v: f64| HEIGHT - BOTTOM - (v - y0) / (y1 - y0) * (HEIGHT - BOTTOM - TOP);
    let names: Vec<&str> =
        if chart.series.len() > 1 { chart.series.iter().map(|s| s.name.as_str()).collect() } else { vec![] };
    let legend = legend_places(&names);
    let height = HEIGHT + legend.last().map_or(0.0, |(_, line)| LEGEND * (line + 1) as f64);
    let mut svg = format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" role="img" font-size="12" fill="currentColor">"##
    );
    for k in 0..=4 {
        let share = f64::from(k) / 4.0;
        // What rounding leaves of zero is zero.
        let at = |a: f64, b: f64| Some(a + share * (b - a)).filter(|v| v.abs() > 1e-9 * (b - a)).unwrap_or(0.0);
        let (vx, vy) = (at(x0, x1), at(y0, y1));
        let _ = write!(
            svg,
            r##"<path d="M{LEFT} {1:.1}H{2}" stroke="#8884"/><text x="{3}" y="{1:.1}" text-anchor="end" dy="4">{4}</text><text x="{0:.1}" y="{5}" text-anchor="middle">{6}</text>"##,
            px(vx),
            py(vy),
            WIDTH - RIGHT,
            LEFT - 6.0,
            significant(vy, 3),
            HEIGHT - BOTTOM + 16.0,
            significant(vx, 3),
        );
    }
    for limit in &chart.limits {
        let _ = write!(
            svg,
            r##"<path d="M{LEFT} {:.1}H{}" stroke="#c00000" stroke-dasharray="2 3"><title>{}</title></path>"##,
            py(limit.y),
            WIDTH - RIGHT,
            escape(&limit.name)
        );
    }
    for upright in chart.uprights.iter().filter(|u| (x0..=x1).contains(&u.x)) {
        let _ = write!(
            svg,
            r##"<path d="M{:.1} {TOP}V{}" stroke="#888" stroke-dasharray="2 3"><title>{}</title></path>"##,
            px(upright.x),
            HEIGHT - BOTTOM,
            escape(&upright.name)
        );
    }
    for series in &chart.series {
        let colour = COLOURS[series.colour % COLOURS.len()];
        if matches!(series.mark, Mark::Points | Mark::Dots) {
            let r = if series.mark == Mark::Points { 2.5 } else { 1.2 };
            let finite: Vec<&[f64; 2]> = series.points.iter().filter(|p| p[1].is_finite()).collect();
            for [vx, vy] in finite.iter().step_by(finite.len().div_ceil(MOST_DOTS).max(1)) {
                let _ = write!(svg, r##"<circle cx="{:.1}" cy="{:.1}" r="{r}" fill="{colour}"/>"##, px(*vx), py(*vy));
            }
            continue;
        }
        let broken = series.mark == Mark::Broken;
        let mut d = String::new();
        let mut pen_is_up = true;
        for [vx, vy] in thinned(&series.points, if broken { MOST_DOTS } else { MOST_POINTS }) {
            if vy.is_finite() {
                let _ = write!(d, "{}{:.1} {:.1}", if pen_is_up { "M" } else { "L" }, px(vx), py(vy));
                pen_is_up = false;
            } else {
                pen_is_up |= broken;
            }
        }
        let dash = if series.mark == Mark::Dashed { r#" stroke-dasharray="6 4""# } else { "" };
        let _ = write!(
            svg,
            r##"<path d="{d}" fill="none" stroke="{colour}" stroke-width="1.5"{dash}><title>{}</title></path>"##,
            escape(&series.name)
        );
    }
    for (series, (x, line)) in chart.series.iter().zip(&legend) {
        let colour = COLOURS[series.colour % COLOURS.len()];
        let (x, y) = (LEFT + x, HEIGHT + LEGEND * *line as f64 + 4.0);
        let mark = match series.mark {
            Mark::Points => format!(r##"<circle cx="{:.1}" cy="{y}" r="2.5" fill="{colour}"/>"##, x + 12.0),
            Mark::Dots => format!(r##"<circle cx="{:.1}" cy="{y}" r="1.2" fill="{colour}"/>"##, x + 12.0),
            of_line => {
                let dash = if of_line == Mark::Dashed { r#" stroke-dasharray="6 4""# } else { "" };
                format!(r##"<path d="M{x:.1} {y}h24" stroke="{colour}" stroke-width="1.5"{dash}/>"##)
            }
        };
        let _ = write!(svg, r##"{mark}<text x="{:.1}" y="{}">{}</text>"##, x + 29.0, y + 4.0, escape(&series.name));
    }
    let _ = write!(
        svg,
        r##"<text x="{}" y="{}" text-anchor="middle">{}</text><text transform="translate(12 {}) rotate(-90)" text-anchor="middle">{}</text></svg>"##,
        0.5 * (LEFT + WIDTH - RIGHT),
        HEIGHT - 8.0,
        escape(&x.title()),
        0.5 * (TOP + HEIGHT - BOTTOM),
        escape(&y.title()),
    );
    svg
}

/// Outlines of both wheels and the generator at generator angle 0.
pub(super) fn drive(animation: &Animation) -> String {
    let reach = animation.circular_spline.nodes.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max) + 1.0;
    let mut svg = format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="{0:.1} {0:.1} {1:.1} {1:.1}" width="480" role="img" fill="none" stroke="currentColor" stroke-width="0.12">"##,
        -reach,
        2.0 * reach
    );
    for wheel in [&animation.flexspline, &animation.circular_spline] {
        let _ = write!(svg, r##"<path d="{}"/>"##, outline(wheel));
    }
    for curve in &animation.generator {
        let points: String = curve.iter().step_by(2).map(|[x, y]| format!("{x:.2},{:.2} ", -y)).collect();
        let _ = write!(svg, r##"<polygon points="{}"/>"##, points.trim_end());
    }
    svg.push_str("</svg>");
    svg
}

/// The edges of a wheel that belong to one element: its outline, corner to corner.
fn outline(wheel: &WheelMotion) -> String {
    let mut d = String::new();
    for edge in wheel.outline() {
        for sector in 0..wheel.sectors {
            let at = |(node, offset): (usize, usize)| {
                let sector = sector + offset;
                let s = (FRAMES * sector) % wheel.samples;
                let x = wheel.nodes[node][0] + wheel.displacement_mm[2 * node * wheel.samples + s];
                let y = wheel.nodes[node][1] + wheel.displacement_mm[(2 * node + 1) * wheel.samples + s];
                let (sin, cos) = (TAU * sector as f64 / wheel.sectors as f64).sin_cos();
                (cos * x - sin * y, -(sin * x + cos * y))
            };
            let ((x0, y0), (x1, y1)) = (at(edge[0]), at(edge[2]));
            let _ = write!(d, "M{x0:.2} {y0:.2}L{x1:.2} {y1:.2}");
        }
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::{PageQuantity, Series};

    /// One high point of a thousand, and one place where nothing is.
    #[test]
    fn a_sketch_loses_neither_peak_nor_gap() {
        let mut points: Vec<[f64; 2]> = (0..1000).map(|k| [f64::from(k), 0.0]).collect();
        points[537][1] = 7.0;
        points[700][1] = f64::NAN;
        let kept = thinned(&points, MOST_POINTS);
        assert!(kept.contains(&[537.0, 7.0]) && kept.iter().any(|point| point[1].is_nan()), "{kept:?}");
        assert!(kept.len() <= MOST_POINTS + 1 && kept.windows(2).all(|pair| pair[0][0] < pair[1][0]), "{}", kept.len());
        assert_eq!(thinned(&points[..50], MOST_POINTS), points[..50], "few stay as they are");
    }

    #[test]
    fn a_sketch_of_several_series_names_them_with_their_marks() {
        let series =
            |name: &str, mark, colour| Series { name: name.into(), mark, colour, points: vec![[0.0, 0.0], [1.0, 1.0]] };
        let of = |series: Vec<Series>| {
            let axis = Axis::new("x", PageQuantity::Count);
            lines(&axis, &axis, &Lines { series, ..Lines::default() })
        };
        let both = of(vec![series("there & on", Mark::Line, 0), series("back", Mark::Dashed, 1)]);
        assert!(both.contains(">there &amp; on</text>") && both.contains(">back</text>"), "{both}");
        assert_eq!(both.matches(r#"stroke-dasharray="6 4""#).count(), 2, "the dashed line, and its entry");
        assert!(!of(vec![series("alone", Mark::Line, 0)]).contains(">alone</text>"), "its axis says what it is");
        // As many lines as the names need, and none beyond the right end.
        let long = "a name that is rather long, as some are";
        let places = legend_places(&[long, long, "short"]);
        assert_eq!(places.iter().map(|(_, line)| *line).collect::<Vec<_>>(), [0, 1, 1]);
    }
}
