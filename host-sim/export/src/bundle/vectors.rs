//! Steps of a table with what the core says of them: for people as CSV, for a port as C.

use std::fmt::Write as _;

use flexspline::{Command, GeneratorAngle, OutputAngle, PlayState, Prediction, Table};

/// Columns of the CSV, in the order of the fields of `flexspline_vector`; `_bits` are those of a `float`.
const COLUMNS: &str = "measured_counts,target_counts,torque_bits,temperature_bits,output_counts,error_bits,\
                       uncertainty_bits,quality,command_counts,predicted_error_bits,command_uncertainty_bits,\
                       command_quality,torque_n_m,temperature_c,error_rad";

/// A step: what it is asked, and what it answers.
struct TestStep {
    measured: GeneratorAngle,
    target: OutputAngle,
    torque: f32,
    temperature: f32,
    now: Prediction,
    next: Command,
}

/// Steps from a play that is not known: both directions, standing, reversals inside the play, torques and temperatures
/// in the range, at nodes, beyond, and not finite.
fn steps(table: &Table<'_>, count: usize) -> Vec<TestStep> {
    let mut random = fastrand::Rng::with_seed(3);
    let torques: Vec<f32> = table.torque_nodes_n_m().collect();
    let mut play = PlayState::unknown();
    let (mut measured, mut speed) = (GeneratorAngle::ZERO, 0i64);
    let ([torque_least, torque_most], [least, most]) = (table.torque_range_n_m(), table.temperature_range_c());
    let (mut torque, mut temperature) = (0.0f32, 20.0f32);
    let mut steps = Vec::new();
    for number in 0..count {
        if number % 8 == 0 {
            speed = random.i64(-(1i64 << 36)..1i64 << 36) >> random.u32(0..24);
            torque = match random.u32(0..8) {
                0 => torques[random.usize(0..torques.len())],
                1 => torque_most + 1.0,
                2 if number > 100 => f32::NAN,
                _ => torque_least + (torque_most - torque_least) * random.f32(),
            };
            // Some way beyond both ends.
            temperature = least + (most - least) * (1.2 * random.f32() - 0.1);
        }
        measured = measured.offset_counts(speed);
        let target = play
            .output()
            .unwrap_or(OutputAngle::ZERO)
            .offset_counts(random.i64(-(1i64 << 24)..1i64 << 24) >> random.u32(0..24));
        let (now, next) = table.step(&mut play, measured, target, torque, temperature);
        steps.push(TestStep { measured, target, torque, temperature, now, next });
    }
    steps
}

impl TestStep {
    /// The fields of a `flexspline_vector`; `counts` writes an angle.
    fn fields(&self, counts: impl Fn(i64) -> String) -> String {
        let TestStep { measured, target, torque, temperature, now, next } = self;
        let bits = |number: f32| format!("0x{:08x}", number.to_bits());
        [
            counts(measured.counts()),
            counts(target.counts()),
            bits(*torque),
            bits(*temperature),
            counts(now.output.counts()),
            bits(now.transmission_error_rad),
            bits(now.uncertainty_rad),
            (now.quality as u32).to_string(),
            counts(next.generator.counts()),
            bits(next.predicted_error_rad),
            bits(next.uncertainty_rad),
            (next.quality as u32).to_string(),
        ]
        .join(",")
    }
}

/// The steps of a table for people and other programs.
pub(super) fn csv(table: &Table<'_>, count: usize) -> String {
    let mut text = format!("{COLUMNS}\n");
    for step in steps(table, count) {
        let (fields, TestStep { torque, temperature, now, .. }) = (step.fields(|counts| counts.to_string()), &step);
        let _ = writeln!(text, "{fields},{torque},{temperature},{:e}", now.transmission_error_rad);
    }
    text
}

/// The same as an array in C.
pub(super) fn array(name: &str, table: &Table<'_>, count: usize) -> String {
    let mut text = format!("/* Steps of {name}.fxt, table {}: see vectors.h. */\n", table.id());
    let _ = writeln!(text, "static const flexspline_vector flexspline_{name}_vectors[{count}] = {{");
    for step in steps(table, count) {
        let fields = step.fields(|counts| format!("INT64_C({counts})"));
        let _ = writeln!(text, "    {{{}}},", fields.replace(',', ", "));
    }
    text + "};\n"
}

/// Definition of a vector, and all vectors of a bundle.
pub(super) fn header(tables: &[super::BundledTable]) -> String {
    let mut text = "\
/* What the core says of steps with each table: made with the tables, so a port that gives the same bits is right. */
#ifndef FLEXSPLINE_VECTORS_H
#define FLEXSPLINE_VECTORS_H

#include \"flexspline_table.h\"

/* A call of fxt_step and its answers, in the order of the columns of the .csv; torque, temperature and errors are the \
                    bits of a float. */
typedef struct flexspline_vector {
    int64_t measured, target;
    uint32_t torque, temperature;
    int64_t output;
    uint32_t error, uncertainty, quality;
    int64_t command;
    uint32_t predicted, command_uncertainty, command_quality;
} flexspline_vector;

"
    .to_owned();
    for table in tables {
        let _ = writeln!(text, "#include \"flexspline_{0}.h\"\n#include \"{0}_vectors.h\"", table.name);
    }
    text.push_str(
        "\n/* Each table from a play that is not known. */\nstatic const struct {\n    const uint8_t *image;\n    \
         uint32_t bytes;\n    const flexspline_vector *vectors;\n    uint32_t steps;\n} flexspline_cases[] = {\n",
    );
    for table in tables {
        let (name, array) = (&table.name, table.array());
        let _ = writeln!(
            text,
            "    {{{array}, sizeof {array}, flexspline_{name}_vectors, sizeof flexspline_{name}_vectors / sizeof \
             flexspline_{name}_vectors[0]}},"
        );
    }
    text + "};\n\n#endif\n"
}
