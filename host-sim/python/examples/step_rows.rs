//! The core's step over rows of a file, as the Python package runs it over arrays: what its bits and its speed are held
//! against.
//!
//! `step_rows TABLE.fxt ROWS.f64 OUT.bin`: rows of generator angle (rad), torque (N·m) and temperature (°C), each three
//! little-endian doubles. Forward runs in row order from an unknown play; inverse asks for each output that forward
//! gave, in forward motion. Written are, row by row, output (f64), transmission error, uncertainty (f32), quality (u8),
//! then generator (f64), error, uncertainty (f32), quality (u8). Printed are the seconds of either loop.

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use flexspline::{Approach, Direction, GeneratorAngle, OutputAngle, PlayState, Table};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let [table, rows, out] = arguments()?;
    let image = std::fs::read(table)?;
    let table = Table::check(&image).map_err(|error| error.to_string())?;
    // Columns, as arrays have them.
    let numbers: Vec<f64> = std::fs::read(rows)?
        .chunks_exact(8)
        .filter_map(|bytes| Some(f64::from_le_bytes(bytes.try_into().ok()?)))
        .collect();
    let column = |of: usize| numbers.iter().skip(of).step_by(3).copied().collect::<Vec<f64>>();
    let [generator, torque, temperature] = [0, 1, 2].map(column);
    let count = generator.len();

    let mut output = vec![0.0f64; count];
    let (mut error, mut uncertainty, mut quality) = (vec![0.0f32; count], vec![0.0f32; count], vec![0u8; count]);
    let clock = Instant::now();
    let mut play = PlayState::unknown();
    for row in 0..count {
        let angle = GeneratorAngle::from_rad(generator[row]).unwrap_or(GeneratorAngle::ZERO);
        let said = table.forward(&mut play, angle, torque[row] as f32, temperature[row] as f32);
        output[row] = said.output.to_rad();
        error[row] = said.transmission_error_rad;
        uncertainty[row] = said.uncertainty_rad;
        quality[row] = said.quality as u8;
    }
    black_box((&output, &error, &uncertainty, &quality));
    let forward_s = clock.elapsed().as_secs_f64();

    let mut command = vec![0.0f64; count];
    let (mut expected, mut doubt, mut trust) = (vec![0.0f32; count], vec![0.0f32; count], vec![0u8; count]);
    let clock = Instant::now();
    for row in 0..count {
        let target = OutputAngle::from_rad(output[row]).unwrap_or(OutputAngle::ZERO);
        let approach = Approach::Moving(Direction::Forward);
        let said = table.inverse(target, torque[row] as f32, temperature[row] as f32, approach);
        command[row] = said.generator.to_rad();
        expected[row] = said.predicted_error_rad;
        doubt[row] = said.uncertainty_rad;
        trust[row] = said.quality as u8;
    }
    black_box((&command, &expected, &doubt, &trust));
    let inverse_s = clock.elapsed().as_secs_f64();

    let mut bytes = Vec::with_capacity(34 * count);
    for row in 0..count {
        bytes.extend(output[row].to_le_bytes());
        bytes.extend(error[row].to_le_bytes());
        bytes.extend(uncertainty[row].to_le_bytes());
        bytes.push(quality[row]);
        bytes.extend(command[row].to_le_bytes());
        bytes.extend(expected[row].to_le_bytes());
        bytes.extend(doubt[row].to_le_bytes());
        bytes.push(trust[row]);
    }
    std::fs::write(out, bytes)?;
    println!("{count} rows: forward {forward_s:.6} s, inverse {inverse_s:.6} s");
    Ok(())
}

fn arguments() -> Result<[PathBuf; 3], String> {
    let given: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    <[PathBuf; 3]>::try_from(given)
        .map_err(|given| format!("found {} arguments, allowed: TABLE.fxt ROWS.f64 OUT.bin", given.len()))
}
