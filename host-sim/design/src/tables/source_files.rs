//! A table's image as source to link: a Rust file and a C header.

use std::fmt::Write as _;

use super::info::MadeTable;
use flexspline_mechanics::drive::GeneratorKind;

/// The image as a Rust source file: a constant to link.
pub fn rust_source(table: &MadeTable) -> String {
    let name = constant_name(table.kind);
    let mut text = header_comment(table, "//!");
    let _ =
        writeln!(text, "\n/// Identity of the table.\npub const {name}_TABLE_ID: &str = \"{}\";", table.info.table_id);
    let _ = writeln!(text, "/// The `.fxt` image, for `flexspline::Table::check`.");
    let _ = writeln!(text, "pub static {name}_TABLE: [u8; {}] = [", table.image.len());
    put_bytes(&mut text, &table.image);
    text.push_str("];\n");
    let list = |springs: usize| {
        format!(
            "\n/// Springs that slip, for the loss of the data sheet: width in N m and gain in rad/(N m), for \
             `flexspline_estimation::MaxwellSlip::of_torque`.\npub const {name}_SLIP: [(f32, f32); {springs}] = [\n"
        )
    };
    put_slip(&mut text, table, list, ["(", "", ")", "];\n"]);
    text
}

/// Puts the springs that slip beside a table, if there are any, as a list: what opens it, and what stands before,
/// within, behind a pair and at the end.
fn put_slip(text: &mut String, table: &MadeTable, list: impl Fn(usize) -> String, pair: [&str; 4]) {
    let Some(completed) = table.info.completed.as_ref().filter(|completed| !completed.slip.is_empty()) else { return };
    let [open, unit, close, end] = pair;
    text.push_str(&list(completed.slip.len()));
    for s in &completed.slip {
        let [width, gain] = [s.width_n_m as f32, s.gain_rad_per_n_m as f32];
        let _ = writeln!(text, "    {open}{width:?}{unit}, {gain:?}{unit}{close},");
    }
    text.push_str(end);
}

/// The image as a C header.
pub fn c_header(table: &MadeTable) -> String {
    let name = constant_name(table.kind);
    let lower = name.to_lowercase();
    let mut text = header_comment(table, "//");
    let _ = writeln!(
        text,
        "\n#ifndef FLEXSPLINE_{name}_TABLE_H\n#define FLEXSPLINE_{name}_TABLE_H\n\n#include <stdint.h>\n"
    );
    let _ = writeln!(text, "#define FLEXSPLINE_{name}_TABLE_ID \"{}\"", table.info.table_id);
    let _ = writeln!(text, "#define FLEXSPLINE_{name}_TABLE_BYTES {}u\n", table.image.len());
    let _ = writeln!(text, "static const uint8_t flexspline_{lower}_table[FLEXSPLINE_{name}_TABLE_BYTES] = {{");
    put_bytes(&mut text, &table.image);
    text.push_str("};\n");
    let list = |springs: usize| {
        format!(
            "\n// Springs that slip, for the loss of the data sheet: width in N m and gain in rad/(N m), for \
             flexspline_slip_set.\nstatic const float flexspline_{lower}_slip[{springs}][2] = {{\n"
        )
    };
    put_slip(&mut text, table, list, ["{", "f", "}", "};\n"]);
    text.push_str("\n#endif\n");
    text
}

fn constant_name(kind: GeneratorKind) -> String {
    kind.to_string().replace('-', "_").to_uppercase()
}

fn header_comment(table: &MadeTable, mark: &str) -> String {
    let info = &table.info;
    let mut text = String::new();
    let mut line = |words: String| {
        let _ = writeln!(text, "{mark} {words}");
    };
    line(format!("Compensation table {} of drive {}, {} generator.", info.table_id, info.drive, info.generator));
    line(format!("Made by {}; drive BLAKE3 {}.", info.tool, info.drive_blake3));
    line(format!(
        "Holds for {} to {} N.m, {} to {} degrees C; worst deviation from its samples {:.4} arcsec.",
        info.torque_nodes_n_m[0],
        info.torque_nodes_n_m[info.torque_nodes_n_m.len() - 1],
        info.temperature_nodes_c[0],
        info.temperature_nodes_c[info.temperature_nodes_c.len() - 1],
        info.projection_worst_arcsec
    ));
    let read = flexspline::Table::check(&table.image);
    let room = read.as_ref().map_or(flexspline::Store::ROOM, flexspline::Store::room_for);
    line(format!("FLEXSPLINE_STORE_WORDS of a store that holds no larger one: {room}."));
    if let Some(completed) = &info.completed {
        line(format!("{}.", completed.in_words()));
    }
    text
}

/// The bytes of an image, sixteen to a line, for Rust and C.
pub fn put_bytes(text: &mut String, bytes: &[u8]) {
    for row in bytes.chunks(16) {
        text.push_str("   ");
        for byte in row {
            let _ = write!(text, " 0x{byte:02x},");
        }
        text.push('\n');
    }
}
