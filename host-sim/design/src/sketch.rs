//! A dimensioned sketch of a drive: half of a section along its axis, undeformed and to scale.

use flexspline_mechanics::drive::{Drive, SleeveKind};
use flexspline_mechanics::mesh::MeshError;
use flexspline_mechanics::sleeve::{End, Flexspline3d, PlateEdge};

/// Longer side of the section, px. *Chosen* by looking.
const SECTION_PX: f64 = 360.0;
/// Room around it, px. *Chosen* by looking.
const ROOM_PX: f64 = 24.0;
/// Width of the words beside it, px. *Chosen* by looking.
const WORDS_PX: f64 = 250.0;
/// From one line of them to the next, px. *Chosen* by looking.
const LINE_PX: f64 = 18.0;

/// A piece of the section: from and to along the axis, inner and outer radius, mm.
type Piece = [f64; 4];

/// The sketch as SVG, in the colour of the text around it.
///
/// # Errors
/// The drive has no mesh.
pub fn sketch(drive: &Drive) -> Result<String, MeshError> {
    let (wheel, ring) = (&drive.flexspline, &drive.circular_spline);
    let shape = Flexspline3d::of(drive, false)?;
    let (width, middle) = (wheel.width_mm, wheel.neutral_radius_mm());
    let mut pieces: Vec<Piece> = vec![
        [0.0, width, ring.tip_radius_mm, ring.outer_radius_mm],
        [0.0, width, wheel.bore_radius_mm(), wheel.tip_radius_mm],
    ];
    let mut lengths = vec![(0.0, width)];
    // A tube on either side, away from the rim, and the plate that ends it.
    for (side, from, sign) in [(&shape.flange, 0.0, -1.0), (&shape.bottom, width, 1.0)] {
        let Some((tube, end)) = side else { continue };
        let (half, at) = (0.5 * tube.shell.thickness_mm, from + sign * tube.length_mm);
        pieces.push([from.min(at), from.max(at), middle - half, middle + half]);
        lengths.push((from.min(at), from.max(at)));
        if let End::Plate(plate) = end {
            let to = if let PlateEdge::Clamped(radius) = plate.to { radius } else { 0.0 };
            let past = at + sign * plate.wall.thickness_mm;
            pieces.push([at.min(past), at.max(past), to.min(middle - half), to.max(middle + half)]);
        }
    }
    let least = pieces.iter().map(|[from, ..]| *from).fold(0.0, f64::min);
    let most = pieces.iter().map(|[_, to, ..]| *to).fold(0.0, f64::max);
    let outer = pieces.iter().map(|[.., outer]| *outer).fold(0.0, f64::max);
    let px_per_mm = SECTION_PX / outer.max(most - least);
    let x = |mm: f64| ROOM_PX + px_per_mm * (mm - least);
    let y = |mm: f64| ROOM_PX + px_per_mm * (outer - mm);
    let rectangle = |[from, to, inner, outer]: &Piece| {
        let (width, height) = (px_per_mm * (to - from), px_per_mm * (outer - inner));
        format!("<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>", x(*from), y(*outer))
    };
    let filled: String = pieces.iter().map(rectangle).collect();
    let mut drawn = vec![format!("<g fill=\"currentColor\" fill-opacity=\".12\">{filled}</g>")];
    let end = x(most) + ROOM_PX;
    drawn.push(format!("<path d=\"M{ROOM_PX} {:.1}H{end:.1}\" stroke-dasharray=\"12 3 2 3\"/>", y(0.0)));
    let mut words = Vec::new();
    let mut diameters = vec![
        ("circular spline, outside", ring.outer_radius_mm),
        ("circular spline, root circle", ring.root_radius_mm),
        ("flexspline, tip circle", wheel.tip_radius_mm),
        ("circular spline, tip circle", ring.tip_radius_mm),
        ("flexspline, root circle", wheel.root_radius_mm),
        ("flexspline, bore", wheel.bore_radius_mm()),
    ];
    if drive.sleeve.kind == SleeveKind::Cup {
        diameters.push(("hub", drive.sleeve.hub_radius_mm));
    }
    let mut line = 0.0;
    for (what, radius) in diameters {
        line = y(radius).max(line + LINE_PX);
        let leads = format!("M{:.1} {:.1}H{end:.1}L{:.1} {line:.1}", x(width), y(radius), end + ROOM_PX);
        drawn.push(format!("<path d=\"{leads}\" stroke-opacity=\".4\"/>"));
        words.push((end + ROOM_PX + 4.0, line + 4.0, format!("⌀ {:.3} {what}", 2.0 * radius)));
    }
    let below = y(0.0) + ROOM_PX;
    for (from, to) in lengths {
        let [from, to, length] = [x(from), x(to), to - from];
        drawn.push(format!("<path d=\"M{from:.1} {0:.1}v12m0 -6H{to:.1}m0 -6v12\"/>", below - 6.0));
        words.push((from + 2.0, below + LINE_PX, format!("{length:.2}")));
    }
    let rest = format!(
        "{} and {} teeth of module {}; rim {:.3}, wall {:.3}, w0 {:.4}; mm, undeformed",
        wheel.teeth, ring.teeth, wheel.module_mm, wheel.rim_thickness_mm, drive.sleeve.wall_mm, drive.generator.w0_mm
    );
    words.push((ROOM_PX, below + 2.5 * LINE_PX, rest));
    let text = |(x, y, words): &(f64, f64, String)| format!("<text x=\"{x:.1}\" y=\"{y:.1}\">{words}</text>");
    Ok(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0} {:.0}\" font-family=\"sans-serif\" \
         font-size=\"13\"><g fill=\"none\" stroke=\"currentColor\">{}</g><g fill=\"currentColor\">{}</g></svg>\n",
        end + ROOM_PX + WORDS_PX,
        below + 3.5 * LINE_PX,
        drawn.concat(),
        words.iter().map(text).collect::<String>()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_to_scale_and_sizes_are_in_words() {
        let (drive, svg) = (Drive::cup_95(), sketch(&Drive::cup_95()).unwrap());
        let widths = svg.split("<rect").skip(1).map(|piece| piece.split("width=\"").nth(1).unwrap());
        let widths: Vec<f64> = widths.map(|width| width.split('"').next().unwrap().parse().unwrap()).collect();
        let tube_over_rim = drive.sleeve.bottom_side_mm / drive.flexspline.width_mm;
        assert!(widths.len() == 3 && (widths[2] / widths[1] / tube_over_rim - 1.0).abs() < 0.01, "{widths:?}");
        assert!(svg.contains(&format!("⌀ {:.3} flexspline, bore", 2.0 * drive.flexspline.bore_radius_mm())), "{svg}");
    }
}
