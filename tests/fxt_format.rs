//! `docs/reference/fxt.md` says what is in a table image: a parser that takes offsets and types from the tables on that
//! page, and evaluates what they hold by its formulas, agrees with the core in every number.
//!
//! Nothing of the core's reader is used to read: bytes, page and arithmetic in `f64` are this file's own. References:
//! the numbers that an image was written from, and what [`Table`] says of it. Wrong if this fails: the page, or the
//! format changed without its version.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

use flexspline::{Drive, FixedMember, GeneratorAngle, GeneratorKind, PlayState, Quality, Table};
use flexspline_design::tables::samples;
use flexspline_design::tables::{SampleOptions, from_samples};
use flexspline_make::{Provenance, TableData, image_bytes, write_image};
use flexspline_mechanics::drive::{Drive as HostDrive, GeneratorKind as HostKind};

const PAGE: &str = include_str!("../docs/reference/fxt.md");
/// Rad in a count.
const COUNT: f64 = TAU / 4_294_967_296.0;

/// A field of the header as the page has it.
#[derive(Debug, Clone, PartialEq)]
struct Field {
    offset: usize,
    kind: String,
    elements: usize,
}

impl Field {
    fn bytes(&self) -> usize {
        self.elements
            * match self.kind.as_str() {
                "bytes" | "text" | "u8" => 1,
                "u16" => 2,
                "u32" | "f32" => 4,
                other => panic!("docs/reference/fxt.md: type {other}"),
            }
    }
}

/// The table "Header and axes" of the page.
fn header() -> BTreeMap<String, Field> {
    let (_, section) = PAGE.split_once("## Header and axes").expect("the page has a header");
    let section = section.split("\n## ").next().unwrap();
    let mut fields = BTreeMap::new();
    let mut next = 0;
    for row in section.lines().filter(|line| line.starts_with("| ")).skip(1) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let (kind, elements) = match cells[2].split_once('[') {
            Some((kind, rest)) => (kind, rest.trim_end_matches(']').parse().unwrap()),
            None => (cells[2], 1),
        };
        let field = Field { offset: cells[1].parse().unwrap(), kind: kind.to_owned(), elements };
        assert_eq!(field.offset, next, "{}: no gap and no overlap", cells[3]);
        next += field.bytes();
        assert!(fields.insert(cells[3].to_owned(), field).is_none(), "{} twice", cells[3]);
    }
    assert_eq!(next, 544, "the axes end where the page says the body goes on");
    fields
}

/// An image read by the page.
struct Image<'a> {
    bytes: &'a [u8],
    fields: BTreeMap<String, Field>,
}

impl<'a> Image<'a> {
    fn field(&self, name: &str) -> &Field {
        self.fields.get(name).unwrap_or_else(|| panic!("docs/reference/fxt.md has no {name}"))
    }
    fn raw(&self, name: &str) -> &'a [u8] {
        let field = self.field(name);
        &self.bytes[field.offset..field.offset + field.bytes()]
    }
    fn integer(&self, name: &str) -> usize {
        assert!(self.field(name).kind.starts_with('u'), "{name} is an integer");
        self.raw(name).iter().rev().fold(0, |number, byte| number << 8 | usize::from(*byte))
    }
    fn reals(&self, name: &str) -> Vec<f32> {
        assert_eq!(self.field(name).kind, "f32");
        self.raw(name).chunks(4).map(|word| f32::from_le_bytes(word.try_into().unwrap())).collect()
    }
    fn text(&self, name: &str) -> &'a str {
        assert_eq!(self.field(name).kind, "text");
        std::str::from_utf8(self.raw(name)).unwrap().trim_end_matches('\0')
    }
    fn word(&self, at: usize) -> [u8; 4] {
        self.bytes[4 * at..4 * at + 4].try_into().unwrap()
    }
    fn real(&self, at: usize) -> f64 {
        f64::from(f32::from_le_bytes(self.word(at)))
    }
    /// Stored coefficients of A, B or C, rad.
    fn curve(&self, name: &str) -> Vec<f64> {
        let nodes = self.integer(&format!("{name}_nodes"));
        let at = self.integer(&format!("{name}_at"));
        let stored = if nodes == 0 { 0 } else { nodes + 3 };
        (0..stored).map(|i| f64::from(i32::from_le_bytes(self.word(at + i))) * 0.5 * COUNT).collect()
    }
    /// D, slope, H and whether the interval above is a jump.
    fn node(&self, temperature: usize, torque: usize) -> ([f64; 3], bool) {
        let at = self.integer("nodes_at") + temperature * self.integer("nodes_step") + 3 * torque;
        let jump = self.word(at + 2)[0] & 1 == 1;
        ([0, 1, 2].map(|i| self.real(at + i) * COUNT), jump)
    }
    /// Stored ripple, rad: of forward or of backward motion.
    fn ripple(&self, temperature: usize, torque: usize, backward: bool) -> Vec<f64> {
        let nodes = self.integer("ripple_nodes");
        let row = if nodes == 0 { 0 } else { (nodes + 4).next_multiple_of(2) };
        let at = self.integer("records_at")
            + temperature * self.integer("records_step")
            + torque * self.integer("record_step");
        let unit = self.integer("ripple_unit") as f64 / 524_288.0 * COUNT;
        let first = 4 * at + if backward { 2 * row } else { 0 };
        let half = |i: usize| i16::from_le_bytes(self.bytes[first + 2 * i..first + 2 * i + 2].try_into().unwrap());
        (0..row).map(|i| f64::from(half(i)) * unit).collect()
    }
    fn ratio(&self) -> f64 {
        let (f, c) = (self.integer("flexspline_teeth") as f64, self.integer("circular_spline_teeth") as f64);
        if self.integer("fixed_member") == 0 { c / (c - f) } else { -f / (c - f) }
    }
    fn fixed_teeth(&self) -> f64 {
        let name = if self.integer("fixed_member") == 0 { "flexspline_teeth" } else { "circular_spline_teeth" };
        self.integer(name) as f64
    }

    /// The error after steady motion of the output, rad: the formulas of the page.
    fn error(&self, generator: f64, torque: f64, temperature: f64, backward: bool) -> f64 {
        let axis = |name: &str, count: &str| -> Vec<f64> {
            self.reals(name)[..self.integer(count)].iter().map(|node| f64::from(*node)).collect()
        };
        let (torques, temperatures) =
            (axis("torque_nodes", "torque_count"), axis("temperature_nodes", "temperature_count"));
        let ((i, w), (j, v)) = (place(&torques, torque), place(&temperatures, temperature));
        let tooth = (generator * self.fixed_teeth() / TAU).rem_euclid(1.0);
        let sign = if backward { 1.0 } else { -1.0 };
        let at = |theta: usize| {
            let ([low, slope, half], jump) = self.node(theta, i);
            if torques.len() == 1 {
                assert_eq!(self.node(theta, 1), self.node(theta, 0), "a node alone is stored twice");
                return low + sign * half + spline(&self.ripple(theta, i, backward), tooth);
            }
            let ([high, slope_above, half_above], _) = self.node(theta, i + 1);
            let (b, r) = (torques[i + 1] - torques[i], high - low);
            let bend = w * (1.0 - w) * ((1.0 - w) * (b * slope - r) + w * (r - b * slope_above));
            let mean = low + w * r + if jump { 0.0 } else { bend };
            let ripple = [i, i + 1].map(|node| spline(&self.ripple(theta, node, backward), tooth));
            mean + sign * (half + w * (half_above - half)) + ripple[0] + w * (ripple[1] - ripple[0])
        };
        let loaded = if temperatures.len() == 1 { at(j) } else { at(j) + v * (at(j + 1) - at(j)) };
        let x = generator / self.ratio();
        let turn = |angle: f64| (angle / TAU).rem_euclid(1.0);
        loaded
            + spline(&self.curve("a"), turn(generator))
            + spline(&self.curve("b"), turn(generator - x))
            + spline(&self.curve("c"), turn(x))
    }
}

/// Interval and weight on an axis, the ends holding beyond it.
fn place(nodes: &[f64], value: f64) -> (usize, f64) {
    if nodes.len() == 1 {
        return (0, 0.0);
    }
    let i = nodes[1..nodes.len() - 1].iter().filter(|node| **node <= value).count();
    (i, ((value - nodes[i]) / (nodes[i + 1] - nodes[i])).clamp(0.0, 1.0))
}

/// A stored curve at a phase.
fn spline(stored: &[f64], phase: f64) -> f64 {
    if stored.is_empty() {
        return 0.0;
    }
    // Stored are n + 3 values, or for a ripple n + 4 or n + 5: n is where the first one comes again.
    let n = (4..=stored.len() - 3).find(|n| (0..stored.len() - n).all(|i| stored[i] == stored[i + n]));
    let u = n.expect("stored closed") as f64 * phase + 0.5;
    let (k, t) = (u.floor() as usize, u.fract());
    0.5 * (1.0 - t) * (1.0 - t) * stored[k] + (0.5 + t * (1.0 - t)) * stored[k + 1] + 0.5 * t * t * stored[k + 2]
}

/// CRC-32/ISO-HDLC, bit by bit.
pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

/// Everything that an image holds, against the core.
fn compare(bytes: &[u8]) {
    let image = Image { bytes, fields: header() };
    let table = Table::check(bytes).unwrap();

    // Envelope.
    assert_eq!(image.raw("magic"), b"\x89FXT\r\n\x1a\n");
    assert_eq!(image.integer("version"), usize::from(flexspline::Table::FORMAT_VERSION));
    assert!(PAGE.contains(&format!("format version: {}", flexspline::Table::FORMAT_VERSION)));
    assert_eq!(image.integer("byte_order"), 0xfeff);
    assert_eq!(image.integer("length"), bytes.len());
    let body = 4 * image.integer("body_words");
    let pages: Vec<&[u8]> = bytes[..body].chunks(256).collect();
    assert_eq!(pages.len(), table.page_count());
    let sum = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    for (page, contents) in pages.iter().enumerate() {
        assert_eq!(crc32(contents), sum(body + 4 * page), "page {page}");
    }
    assert_eq!(bytes.len(), body + 4 * pages.len() + 4);
    assert_eq!(crc32(&bytes[..bytes.len() - 4]), sum(bytes.len() - 4));

    // Identity.
    assert_eq!(image.raw("drive_hash"), table.drive_hash());
    let mut nameless = bytes[..body].to_vec();
    nameless[image.field("table_id").offset..][..8].fill(0);
    assert_eq!(image.raw("table_id"), &blake3::hash(&nameless).as_bytes()[..8]);
    assert_eq!(image.raw("table_id"), table.id().0);
    assert_eq!(image.text("tool_version"), table.tool_version());
    assert_eq!(image.text("mesh_level"), table.mesh_level());
    assert_eq!(image.integer("generator_kind"), usize::from(table.generator_kind().code()));
    let drive = table.drive();
    assert_eq!(image.integer("flexspline_teeth"), usize::from(drive.flexspline_teeth()));
    assert_eq!(image.integer("circular_spline_teeth"), usize::from(drive.circular_spline_teeth()));
    let fixed = [FixedMember::Flexspline, FixedMember::CircularSpline][image.integer("fixed_member")];
    assert_eq!((fixed, image.ratio()), (drive.fixed(), drive.exact_ratio()));
    assert!(image.raw("reserved").iter().all(|byte| *byte == 0));

    // What holds, and how well.
    assert_eq!(image.reals("torque_range"), table.torque_range_n_m());
    assert_eq!(image.reals("temperature_range"), table.temperature_range_c());
    assert_eq!(image.reals("solver_residual"), [table.solver_residual()]);
    assert_eq!(image.reals("projection_worst"), [table.projection_worst_rad()]);
    assert_eq!(image.reals("projection_rms"), [table.projection_rms_rad()]);
    assert_eq!(image.reals("error_limit"), [table.error_limit_rad()]);
    let limit = f64::from(table.error_limit_rad()) / COUNT * 1.001 + 16.0;
    assert_eq!(image.integer("limit_counts"), limit as usize);
    assert_eq!(image.integer("iterations"), usize::from(table.inverse_iterations()));
    let left = (f64::from(table.inverse_error_bound_rad()) / COUNT) as usize;
    assert_eq!(image.integer("hold"), left + 8);

    // Axes.
    let (torques, temperatures) = (image.integer("torque_count"), image.integer("temperature_count"));
    let axes = [("torque_nodes", torques), ("temperature_nodes", temperatures)];
    for ((name, count), core) in
        axes.into_iter().zip([table.torque_nodes_n_m().collect::<Vec<_>>(), table.temperature_nodes_c().collect()])
    {
        let nodes = image.reals(name);
        assert_eq!(nodes[..count], core);
        assert!(nodes[count..].iter().all(|node| node.to_bits() == 0x7f7f_ffff), "{name} are padded");
    }
    assert_eq!(image.integer("last_torque_interval"), torques.saturating_sub(2));
    assert_eq!(image.integer("last_temperature_interval"), temperatures.saturating_sub(2));

    // Parts follow one another without gaps.
    let ripple = image.integer("ripple_count");
    assert_eq!((ripple, image.integer("ripple_nodes")), (table.ripple_axis().len(), ripple));
    let mut at = 544 / 4;
    for name in ["a", "b", "c"] {
        assert_eq!(image.integer(&format!("{name}_at")), at);
        assert_eq!(image.integer(&format!("{name}_nodes")), image.integer(&format!("{name}_count")));
        at += image.curve(name).len();
    }
    assert_eq!(image.integer("nodes_at"), at);
    at += temperatures * torques.max(2) * 3;
    assert_eq!(image.integer("records_at"), at);
    at += temperatures * torques * image.ripple(0, 0, false).len();
    assert_eq!(4 * at, body);
    let along = |count: usize, step: usize| if count > 1 { step } else { 0 };
    assert_eq!(image.integer("nodes_step"), along(temperatures, 3 * torques.max(2)));
    let record = image.ripple(0, 0, false).len();
    assert_eq!(image.integer("record_step"), along(torques, record));
    assert_eq!(image.integer("records_step"), along(temperatures, record * torques));
    let width = if ripple == 0 { 1.0 } else { 4_294_967_296.0 / (ripple as f64 * image.ratio() * image.fixed_teeth()) };
    let stored = f64::from(image.reals("cell_width")[0]);
    assert!((stored / width - 1.0).abs() < 1e-6, "cell width {stored}, by the page {width}");
    for node in 0..torques {
        assert_eq!(image.node(0, node).1, table.is_torque_jump(node), "jump above node {node}");
    }

    // What the numbers mean: the error at every node and between, both ways, everywhere in the turns.
    let mut random = fastrand::Rng::with_seed(7);
    let nodes: Vec<f64> = table.torque_nodes_n_m().map(f64::from).collect();
    let inside_jump = |torque: f64| {
        nodes.windows(2).enumerate().any(|(i, ends)| {
            table.is_torque_jump(i) && torque as f32 > ends[0] as f32 && (torque as f32) < ends[1] as f32
        })
    };
    let [least, most] = table.torque_range_n_m().map(f64::from);
    let [coldest, hottest] = table.temperature_range_c().map(f64::from);
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    let points = nodes.iter().copied().chain((0..3000).map(|_| least + (most - least) * random.f64()));
    let ratio = image.ratio();
    for torque in points.collect::<Vec<_>>() {
        let torque = f64::from(torque as f32);
        if inside_jump(torque) {
            continue;
        }
        let temperature = f64::from((coldest + (hottest - coldest) * random.f64()) as f32);
        let (x, backward) = (TAU * (6.0 * random.f64() - 3.0), random.bool());
        let before = x + if backward { 0.1 } else { -0.1 };
        let mut play = PlayState::unknown();
        let mut said = None;
        for output in [before, x] {
            let generator = GeneratorAngle::from_rad(output * ratio).unwrap();
            said = Some((generator, table.forward(&mut play, generator, torque as f32, temperature as f32)));
        }
        let (generator, said) = said.unwrap();
        assert_eq!(said.quality, Quality::InRange);
        let by_page = image.error(generator.to_rad(), torque, temperature, backward);
        worst = worst.max((f64::from(said.transmission_error_rad) - by_page).abs());
        largest = largest.max(by_page.abs());
    }
    // Single precision of what the core says, and what its integers of 15 bits round.
    let rounding = f64::from(table.bounds().rounding_rad) + 8.0 * COUNT + largest * 2e-7;
    println!("{} bytes: {worst:.1e} rad apart, rounding {rounding:.1e}, largest error {largest:.1e}", bytes.len());
    assert!(worst <= rounding, "{worst:e} rad, rounding is {rounding:e}");
    assert!(largest > 100.0 * rounding, "nothing was compared");
}

/// Table of FEM samples, as the command makes it.
#[test]
fn a_table_of_contact_fem() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("firmware/samples/cam.samples.csv");
    let samples = samples::read(&path).unwrap();
    let drive = HostDrive::hhd_95();
    let made = from_samples(&drive, HostKind::Cam, &samples, "cam.samples.csv", b"", SampleOptions::default()).unwrap();
    compare(&made.image);
}

/// Torque nodes, temperature nodes, ripple nodes, nodes of A, B, C.
type Shape<'a> = (&'a [f32], &'a [f32], usize, [usize; 3], FixedMember);

/// Numbers drawn at random, in the shapes that an image can have.
#[test]
fn tables_of_every_shape() {
    let mut random = fastrand::Rng::with_seed(11);
    let jumps = [-40.0_f32, -12.0, -1.01, -0.99, 0.0, 0.99, 1.01, 15.0, 44.0];
    let smooth = [-30.0_f32, -10.0, 5.0, 22.0, 60.0];
    let shapes: [Shape<'_>; 6] = [
        (&jumps, &[-40.0, 20.0, 80.0], 7, [8, 12, 5], FixedMember::Flexspline),
        (&jumps, &[-10.0, 40.0], 8, [0, 6, 0], FixedMember::CircularSpline),
        (&smooth, &[20.0], 4, [0; 3], FixedMember::Flexspline),
        (&smooth[..2], &[20.0], 0, [4, 0, 9], FixedMember::CircularSpline),
        (&[3.0], &[0.0, 50.0], 5, [16, 0, 0], FixedMember::Flexspline),
        (&[0.0], &[20.0], 0, [0; 3], FixedMember::Flexspline),
    ];
    for (torques, temperatures, ripple, curves, fixed) in shapes {
        let records = torques.len() * temperatures.len();
        let mut numbers = |count: usize, from: f32, to: f32| -> Vec<f32> {
            (0..count).map(|_| from + (to - from) * random.f32()).collect()
        };
        // A rough rise: what falls with the load is refused.
        let rise = torques.iter().cycle().map(|torque| 2e-5 * torque);
        let mean: Vec<f32> = rise.zip(numbers(records, -2e-6, 2e-6)).map(|(rise, rough)| rise + rough).collect();
        let half = numbers(records, 1.8e-4, 1.85e-4);
        let (ripples, half_ripples) = (numbers(records * ripple, -3e-6, 3e-6), numbers(records * ripple, -2e-6, 2e-6));
        // The slope of a curve counts as often as it comes in an output turn.
        let [a, b, c] = [(curves[0], 4e-5), (curves[1], 4e-5), (curves[2], 1e-3)]
            .map(|(count, size): (usize, f32)| numbers(count, -size, size));
        let data = TableData {
            drive: Drive::new(188, 190, fixed).unwrap(),
            torque_nodes_n_m: torques,
            temperature_nodes_c: temperatures,
            ripple_nodes: ripple,
            mean_rad: &mean,
            half_width_rad: &half,
            mean_ripple_rad: &ripples,
            half_width_ripple_rad: &half_ripples,
            generator_curve_rad: &a,
            material_curve_rad: &b,
            output_curve_rad: &c,
            projection_worst_rad: 3e-7,
            projection_rms_rad: 1e-7,
        };
        let [first, last] = [torques[0], torques[torques.len() - 1]];
        let provenance = Provenance {
            generator_kind: GeneratorKind::DoubleDisc,
            drive_hash: std::array::from_fn(|i| i as u8),
            tool_version: "a page, exactly as long.",
            mesh_level: "drawn",
            solver_residual: 2e-9,
            torque_range_n_m: if first == last { [first - 1.0, first + 1.0] } else { [first, last] },
            temperature_range_c: [temperatures[0], temperatures[temperatures.len() - 1]],
            error_limit_rad: 0.04,
        };
        let mut bytes = vec![0; image_bytes(torques.len(), temperatures.len(), ripple, curves)];
        let id = |body: &[u8]| blake3::hash(body).as_bytes()[..8].try_into().unwrap();
        write_image(&data, &provenance, &mut bytes, id).unwrap();
        compare(&bytes);

        // The numbers themselves, at a node in the middle.
        let image = Image { bytes: &bytes, fields: header() };
        let (j, i) = (temperatures.len() / 2, torques.len() / 2);
        let at = j * torques.len() + i;
        let ([d, _, h], _) = image.node(j, i);
        assert!((d - f64::from(mean[at])).abs() < 1e-9 && (h - f64::from(half[at])).abs() < 1e-9);
        for (stored, written) in [("a", &a), ("b", &b), ("c", &c)].map(|(name, written)| (image.curve(name), written)) {
            for (k, coefficient) in stored.iter().enumerate() {
                let written = f64::from(written[(k + written.len() - 1) % written.len()]);
                assert!((coefficient - written).abs() <= 0.26 * COUNT, "{coefficient:e} {written:e}");
            }
        }
        for (backward, sign) in [(false, -1.0), (true, 1.0)] {
            let unit = image.integer("ripple_unit") as f64 / 524_288.0 * COUNT;
            for (k, coefficient) in image.ripple(j, i, backward).iter().enumerate() {
                let node = at * ripple + (k + ripple - 1) % ripple;
                let written = f64::from(ripples[node]) + sign * f64::from(half_ripples[node]);
                assert!((coefficient - written).abs() <= 0.51 * unit, "{coefficient:e} {written:e}");
            }
        }
    }
}
