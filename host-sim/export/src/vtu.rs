//! VTK unstructured grids (`.vtu`) and their series (`.pvd`), for ParaView and anything else that reads VTK XML.
//!
//! Both wheels stand where they are: points are the deformed positions in the global frame. Cells are
//! `VTK_QUADRATIC_QUAD` (23), whose node order is ours: four corners counter-clockwise, then the midsides of edges 0-1,
//! 1-2, 2-3, 3-0.
//!
//! | field | on | what |
//! |---|---|---|
//! | `displacement` | points | from the undeformed wheel (circular spline: turned with the output), mm |
//! | `von_mises` | points | averaged at nodes, MPa |
//! | `wheel` | cells | 0 flexspline, 1 circular spline |
//! | `sector` | cells | tooth of the flexspline, space of the circular spline |
//! | `generator_rad`, `output_rad`, `torque_n_m` | the whole | where the drive stands |
//!
//! Arrays are inline base64 of little-endian values with a 64-bit length before them, positions and fields in single
//! precision (4 nm at the teeth: for looking, not for reading errors off).

use std::f64::consts::TAU;
use std::io::{self, Write};

use flexspline_design::simulate::stress::nodal_von_mises;
use flexspline_mechanics::mesh::rotate;
use flexspline_mechanics::stepping::{Problem, State};

/// Type number of the 8-node quadrilateral.
const VTK_QUADRATIC_QUAD: u8 = 23;

/// A file of a series.
#[derive(Debug, Clone, PartialEq)]
pub struct VtuFrame {
    /// Its place in the series.
    pub step: usize,
    /// File name, relative to the `.pvd`.
    pub file: String,
}

/// Writes the drive in a state.
pub fn write_vtu(out: &mut dyn Write, problem: &Problem, state: &State) -> io::Result<()> {
    let state = &*problem.whole_state(state);
    let whole =
        [("generator_rad", state.generator_rad), ("output_rad", state.output_rad), ("torque_n_m", state.torque_n_m)];
    let mut grid = CellGrid { whole: whole.to_vec(), part: "wheel", ..CellGrid::default() };
    let wheels = [
        (&problem.flexspline, &state.u, 0.0, 0),
        // Turned into the global frame.
        (&problem.circular_spline, &state.v, state.output_rad, 1),
    ];
    for (mesh, field, turn_rad, id) in wheels {
        let first = grid.points.len() / 3;
        let turn = (turn_rad % TAU).sin_cos();
        let global = |p: [f64; 2]| {
            let [x, y] = rotate(p, turn);
            [x as f32, y as f32, 0.0]
        };
        let (moved, _) = field.as_chunks::<2>();
        grid.points.extend(mesh.nodes.iter().zip(moved).flat_map(|(x, d)| global([x[0] + d[0], x[1] + d[1]])));
        grid.displacements.extend(moved.iter().flat_map(|d| global(*d)));
        grid.von_mises.extend(nodal_von_mises(mesh, &problem.material, field).into_iter().map(|s| s as f32));
        for (e, element) in mesh.elements.iter().enumerate() {
            grid.cell(&element.map(|n| first + n as usize), VTK_QUADRATIC_QUAD, id);
            grid.sectors.push((e / mesh.elements_per_sector) as i32);
        }
    }
    grid.write(out)
}

/// A grid with its fields; those that it does not have are empty.
#[derive(Default)]
pub(super) struct CellGrid {
    /// Numbers of the whole, by name.
    pub whole: Vec<(&'static str, f64)>,
    /// Deformed positions and displacements, three numbers to a point, mm.
    pub points: Vec<f32>,
    pub displacements: Vec<f32>,
    /// By point, MPa.
    pub von_mises: Vec<f32>,
    pub connectivity: Vec<i32>,
    pub offsets: Vec<i32>,
    pub types: Vec<u8>,
    /// The part of each cell, and the name of the field.
    pub parts: Vec<u8>,
    pub part: &'static str,
    pub sectors: Vec<i32>,
}

impl CellGrid {
    /// Adds a cell of a VTK type.
    pub fn cell(&mut self, nodes: &[usize], kind: u8, part: u8) {
        self.connectivity.extend(nodes.iter().map(|n| *n as i32));
        self.offsets.push(self.connectivity.len() as i32);
        self.types.push(kind);
        self.parts.push(part);
    }

    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let (points, cells) = (self.points.len() / 3, self.types.len());
        let whole = |numbers: &[i32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        writeln!(out, r#"<?xml version="1.0"?>"#)?;
        writeln!(
            out,
            r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#
        )?;
        writeln!(out, "<UnstructuredGrid>")?;
        if !self.whole.is_empty() {
            writeln!(out, "<FieldData>")?;
            for (name, value) in &self.whole {
                let attributes = format!(r#"type="Float64" Name="{name}" NumberOfTuples="1""#);
                array(out, &attributes, value.to_le_bytes())?;
            }
            writeln!(out, "</FieldData>")?;
        }
        writeln!(out, r#"<Piece NumberOfPoints="{points}" NumberOfCells="{cells}">"#)?;
        writeln!(out, "<Points>")?;
        vectors(out, "Points", &self.points)?;
        let shown = if self.von_mises.is_empty() { "" } else { r#"Scalars="von_mises" "# };
        writeln!(out, "</Points>\n<PointData {shown}Vectors=\"displacement\">")?;
        vectors(out, "displacement", &self.displacements)?;
        if !self.von_mises.is_empty() {
            let bytes = self.von_mises.iter().flat_map(|x| x.to_le_bytes());
            array(out, r#"type="Float32" Name="von_mises""#, bytes)?;
        }
        writeln!(out, "</PointData>\n<Cells>")?;
        array(out, r#"type="Int32" Name="connectivity""#, whole(&self.connectivity))?;
        array(out, r#"type="Int32" Name="offsets""#, whole(&self.offsets))?;
        array(out, r#"type="UInt8" Name="types""#, self.types.iter().copied())?;
        writeln!(out, "</Cells>\n<CellData Scalars=\"{}\">", self.part)?;
        array(out, &format!(r#"type="UInt8" Name="{}""#, self.part), self.parts.iter().copied())?;
        if !self.sectors.is_empty() {
            array(out, r#"type="Int32" Name="sector""#, whole(&self.sectors))?;
        }
        writeln!(out, "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>")
    }
}

/// Writes the list of a series. Its time is the step: the generator angle of a reversing run comes back to where it
/// was.
pub fn write_pvd(out: &mut dyn Write, frames: &[VtuFrame]) -> io::Result<()> {
    writeln!(out, r#"<?xml version="1.0"?>"#)?;
    writeln!(out, r#"<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">"#)?;
    writeln!(out, "<Collection>")?;
    for VtuFrame { step, file } in frames {
        writeln!(out, r#"<DataSet timestep="{step}" part="0" file="{file}"/>"#)?;
    }
    writeln!(out, "</Collection>\n</VTKFile>")
}

fn vectors(out: &mut dyn Write, name: &str, values: &[f32]) -> io::Result<()> {
    let attributes = format!(r#"type="Float32" Name="{name}" NumberOfComponents="3""#);
    array(out, &attributes, values.iter().flat_map(|x| x.to_le_bytes()))
}

/// A data array: its length in bytes, then the bytes, in base64.
fn array(out: &mut dyn Write, attributes: &str, bytes: impl IntoIterator<Item = u8>) -> io::Result<()> {
    let mut payload = vec![0; 8];
    payload.extend(bytes);
    let length = payload.len() as u64 - 8;
    payload[..8].copy_from_slice(&length.to_le_bytes());
    writeln!(out, r#"<DataArray {attributes} format="binary">"#)?;
    out.write_all(&base64(&payload))?;
    writeln!(out, "\n</DataArray>")
}

/// Standard base64 with padding (RFC 4648, section 4).
pub fn base64(bytes: &[u8]) -> Vec<u8> {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = Vec::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let group = chunk.iter().fold(0_u32, |group, &b| group << 8 | u32::from(b));
        let group = group << (8 * (3 - chunk.len()));
        for digit in 0..4 {
            text.push(if digit <= chunk.len() { DIGITS[(group >> (18 - 6 * digit) & 63) as usize] } else { b'=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use flexspline_mechanics::drive::{Drive, GeneratorKind};
    use flexspline_mechanics::fem::element::shape;
    use flexspline_mechanics::mesh::MeshLevel;
    use flexspline_mechanics::stepping::SolverSettings;

    fn unbase64(text: &str) -> Vec<u8> {
        let value = |b: u8| match b {
            b'A'..=b'Z' => b - b'A',
            b'a'..=b'z' => b - b'a' + 26,
            b'0'..=b'9' => b - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => panic!("not a digit: {b}"),
        };
        assert_eq!(text.trim().len() % 4, 0, "padded");
        let digits: Vec<u8> = text.trim().trim_end_matches('=').bytes().map(value).collect();
        let mut bytes = Vec::new();
        for chunk in digits.chunks(4) {
            let group = chunk.iter().fold(0_u32, |g, &d| g << 6 | u32::from(d)) << (6 * (4 - chunk.len()));
            bytes.extend(&group.to_be_bytes()[1..chunk.len()]);
        }
        bytes
    }

    /// Payload of the array of that name; checks its length.
    fn payload(text: &str, name: &str) -> Vec<u8> {
        let tag = text.find(&format!("Name=\"{name}\"")).unwrap_or_else(|| panic!("no {name}"));
        let start = tag + text[tag..].find('>').unwrap() + 1;
        let end = start + text[start..].find('<').unwrap();
        let bytes = unbase64(&text[start..end]);
        let length = u64::from_le_bytes(bytes[..8].try_into().unwrap());
        assert_eq!(length as usize, bytes.len() - 8, "{name}");
        bytes[8..].to_vec()
    }

    fn floats(text: &str, name: &str) -> Vec<f32> {
        let bytes = payload(text, name);
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    /// Opening and closing tags match, one root.
    fn assert_well_formed(text: &str) {
        let mut open = Vec::new();
        for tag in text.split('<').skip(1).map(|t| t.split('>').next().unwrap()) {
            match tag.as_bytes()[0] {
                b'?' => (),
                b'/' => assert_eq!(open.pop(), Some(&tag[1..])),
                _ if tag.ends_with('/') => (),
                _ => open.push(tag.split(' ').next().unwrap()),
            }
        }
        assert!(open.is_empty(), "left open: {open:?}");
    }

    #[test]
    fn a_frame_reads_back_as_the_mesh_it_was_made_from() {
        let settings = SolverSettings { mesh: MeshLevel::Coarse, ..Default::default() };
        let problem = Problem::new(&Drive::hhd_95(), GeneratorKind::Cam, 20.0, settings).unwrap();
        let mut state = problem.starting_shape(0.3);
        state.output_rad = 0.01;
        state.v[7] = 0.003;
        let mut file = Vec::new();
        write_vtu(&mut file, &problem, &state).unwrap();
        let text = String::from_utf8(file).unwrap();
        assert_well_formed(&text);

        let (fs, cs) = (&problem.flexspline, &problem.circular_spline);
        let (nodes, cells) = (fs.nodes.len() + cs.nodes.len(), fs.elements.len() + cs.elements.len());
        assert!(text.contains(&format!("NumberOfPoints=\"{nodes}\" NumberOfCells=\"{cells}\"")));
        let points = floats(&text, "Points");
        let displacement = floats(&text, "displacement");
        assert_eq!((points.len(), displacement.len()), (3 * nodes, 3 * nodes));
        assert_eq!(floats(&text, "von_mises").len(), nodes);

        // A flexspline node stands at X + u; a circular-spline node at the turned X + v.
        let n = 12_345 % fs.nodes.len();
        assert_eq!(points[3 * n], (fs.nodes[n][0] + state.u[2 * n]) as f32);
        assert_eq!(displacement[3 * n + 1], state.u[2 * n + 1] as f32);
        let (s, c) = 0.01_f64.sin_cos();
        let [x, y] = [cs.nodes[3][0], cs.nodes[3][1] + 0.003];
        let k = 3 * (fs.nodes.len() + 3);
        assert_eq!(points[k..k + 3], [(c * x - s * y) as f32, (s * x + c * y) as f32, 0.0]);
        assert_eq!(displacement[k..k + 2], [(-s * 0.003) as f32, (c * 0.003) as f32]);

        let integers = |name: &str| -> Vec<i32> {
            let bytes = payload(&text, name);
            bytes.chunks_exact(4).map(|b| i32::from_le_bytes(b.try_into().unwrap())).collect()
        };
        let connectivity = integers("connectivity");
        assert_eq!(connectivity.len(), 8 * cells);
        assert!(connectivity.iter().all(|&n| (0..nodes as i32).contains(&n)));
        assert_eq!(integers("offsets").last(), Some(&(8 * cells as i32)));
        assert_eq!(payload(&text, "types"), vec![23; cells]);
        let sector = integers("sector");
        assert_eq!((sector[0], sector[fs.elements.len() - 1], sector[cells - 1]), (0, 187, 189));
        let wheel = payload(&text, "wheel");
        assert_eq!((wheel[fs.elements.len() - 1], wheel[fs.elements.len()]), (0, 1));

        // Order of VTK_QUADRATIC_QUAD: corners counter-clockwise, then each midside between its two corners.
        for cell in connectivity.chunks_exact(8) {
            let at = |n: i32| [f64::from(points[3 * n as usize]), f64::from(points[3 * n as usize + 1])];
            let p: Vec<[f64; 2]> = cell.iter().map(|&n| at(n)).collect();
            let area: f64 = (0..4).map(|i| p[i][0] * p[(i + 1) % 4][1] - p[(i + 1) % 4][0] * p[i][1]).sum();
            assert!(area > 0.0);
            for edge in 0..4 {
                let (a, b, m) = (p[edge], p[(edge + 1) % 4], p[4 + edge]);
                let length = (b[0] - a[0]).hypot(b[1] - a[1]);
                let off = (m[0] - 0.5 * (a[0] + b[0])).hypot(m[1] - 0.5 * (a[1] + b[1]));
                assert!(off < 0.25 * length, "midside {edge} is {off} mm off an edge of {length} mm");
            }
        }
        let own_order = [(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)];
        for (i, (xi, eta)) in own_order.into_iter().enumerate() {
            assert_eq!(shape(xi, eta)[4 + i], 1.0);
        }
        let value = f64::from_le_bytes(payload(&text, "generator_rad").try_into().unwrap());
        assert_eq!(value, 0.3);
    }

    #[test]
    fn a_series_lists_its_frames_in_order() {
        let frames: Vec<VtuFrame> =
            (0..3).map(|step| VtuFrame { step, file: format!("frame-{step:04}.vtu") }).collect();
        let mut file = Vec::new();
        write_pvd(&mut file, &frames).unwrap();
        let text = String::from_utf8(file).unwrap();
        assert_well_formed(&text);
        assert_eq!(text.matches("<DataSet ").count(), 3);
        assert!(text.find("frame-0000.vtu").unwrap() < text.find("frame-0002.vtu").unwrap());
        assert!(text.contains("timestep=\"2\" part=\"0\" file=\"frame-0002.vtu\""));
    }
}
