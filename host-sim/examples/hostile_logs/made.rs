//! Files that nobody means: drives at work written down by loggers of any habit, degenerate in any way, and damaged. A
//! pure function of the seed.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

use fastrand::Rng;

/// Ratio of the drive.
const RATIO: f64 = -94.0;
const ARCSEC: f64 = PI / 648_000.0;

/// The model that the files are held against.
pub const MODEL: &str = "[drive]\nflexspline_teeth = 188\ncircular_spline_teeth = 190\nfixed = \
                         \"circular_spline\"\n[nominal]\nstiffness_n_m_per_rad = 30000.0\nbacklash_arcsec = \
                         60.0\nfriction_torque_n_m = 1.5\ntemperature_c = 20.0\n";

/// Texts that stand where a number is meant.
const CELLS: [&str; 22] = [
    "NaN",
    "nan",
    "inf",
    "-Infinity",
    "1e400",
    "1e-320",
    "-0",
    "",
    " ",
    "--",
    "OVER",
    "9.9E37",
    "1,234.5",
    "1.234,5",
    "0x10",
    "1D-3",
    "null",
    "\"",
    "abc",
    "12:00:00",
    "2026-11-22T14:05:00Z",
    "5 N.m",
];
/// Lines that do not belong.
const LINES: [&str; 8] =
    ["", "# remark", ",,,,", "END", "time_s,generator_rad,output_rad", "Average;;;", "\u{feff}", "-----"];

/// One of some.
fn one<'a, T: ?Sized>(random: &mut Rng, of: &[&'a T]) -> &'a T {
    of[random.usize(..of.len())]
}

fn chance(random: &mut Rng, share: f64) -> bool {
    random.f64() < share
}

/// The log of a seed.
pub fn log(seed: u64) -> Vec<u8> {
    let mut random = Rng::with_seed(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x10_65);
    let random = &mut random;
    let text = if chance(random, 0.06) { guide_log(random) } else { table(random) };
    let mut bytes = encoded(random, &text);
    damage(random, &mut bytes);
    bytes
}

/// How many rows: most are few, so that many files are tried; some are as many as a diagnosis needs, and as its slowest
/// search.
fn rows(random: &mut Rng) -> usize {
    match random.u32(..1000) {
        0..=49 => random.usize(..4),
        50..=349 => random.usize(4..40),
        350..=929 => random.usize(40..200),
        930..=989 => random.usize(200..420),
        _ => random.usize(2000..2300),
    }
}

/// A channel: constant, straight, wave, to and fro, random, with leaps, huge, tiny or missing in part.
fn channel(random: &mut Rng, rows: usize, size: f64) -> Vec<f64> {
    let size = size * [1.0, 1.0, 1.0, 1.0, 1e-12, 1e-3, 1e4, 1e9][random.usize(..8)];
    let kind = random.u32(..9);
    let period = 3.0 + 200.0 * random.f64();
    let mut walk = 0.0;
    let mut values: Vec<f64> = (0..rows)
        .map(|k| {
            let x = k as f64 / period;
            walk += random.f64() - 0.5;
            size * match kind {
                0 => 0.0,
                1 => 1.0,
                2 => x,
                3 => (TAU * x).sin(),
                4 => (x % 2.0 - 1.0).abs(),
                5 => random.f64() - 0.5,
                6 => walk,
                7 => x.floor(),
                _ => x % 1.0,
            }
        })
        .collect();
    if chance(random, 0.06) {
        let share = random.f64();
        values.iter_mut().for_each(|value| {
            if random.f64() < share {
                *value = [f64::NAN, f64::INFINITY, f64::MAX, f64::MIN_POSITIVE][random.usize(..4)];
            }
        });
    }
    values
}

fn generator(random: &mut Rng, rows: usize) -> Vec<f64> {
    let pace = [0.02, 0.05, 0.3, 2.0, 1e-6][random.usize(..5)];
    let turn = 10 + random.usize(..300);
    let mut psi = if chance(random, 0.1) { 1e5 } else { 0.0 };
    match random.u32(..8) {
        0 => channel(random, rows, 10.0),
        1 | 2 => (0..rows).map(|k| pace * k as f64).collect(),
        _ => (0..rows)
            .map(|k| {
                psi += if (k / turn).is_multiple_of(2) { pace } else { -pace };
                psi
            })
            .collect(),
    }
}

/// A table of numbers with a header.
fn table(random: &mut Rng) -> String {
    let rows = rows(random);
    let psi = generator(random, rows);
    let torque = channel(random, rows, 20.0);
    let noise = [0.0, 0.0, 1e-6, 1.0, 30.0, 3000.0][random.usize(..6)];
    let more = if chance(random, 0.4) { channel(random, rows, 100.0) } else { vec![0.0; rows] };
    let spur = if chance(random, 0.1) { 2560.0 } else { 0.0 };
    let error: Vec<f64> = (0..rows)
        .map(|k| {
            let wave = 10.0 * (2.0 * psi[k] + 0.4).sin() + spur * (psi[k] / 7.0).sin().signum();
            torque[k] / 30_000.0 / ARCSEC + 30.0 * torque[k].signum() + wave + more[k] + noise * (random.f64() - 0.5)
        })
        .collect();
    let exact = chance(random, 0.2);
    let error = if exact { error.iter().map(|_| 0.0).collect() } else { error };
    let output: Vec<f64> = (0..rows).map(|k| psi[k] / RATIO + error[k] * ARCSEC).collect();
    let mut columns: Vec<(&str, Vec<f64>)> = Vec::new();
    if chance(random, 0.85) {
        let time: Vec<f64> = match random.u32(..10) {
            0 => channel(random, rows, 1.0),
            1 => (0..rows).rev().map(|k| 0.01 * k as f64).collect(),
            2 => (0..rows).map(|k| 0.01 * (k / 3) as f64).collect(),
            3 => (0..rows).map(|k| 1.79e9 + 0.01 * k as f64 + 0.004 * random.f64()).collect(),
            _ => (0..rows).map(|k| 0.01 * k as f64).collect(),
        };
        columns.push(("time_s", time));
    }
    columns.push(("generator_rad", psi));
    columns.push(if chance(random, 0.7) { ("output_rad", output) } else { ("error_arcsec", error) });
    for (name, share, size) in
        [("torque_n_m", 0.75, 0.0), ("temperature_c", 0.3, 30.0), ("orientation_rad", 0.2, 3.0), ("spare", 0.2, 1.0)]
    {
        if chance(random, share) {
            columns.push((name, if name == "torque_n_m" { torque.clone() } else { channel(random, rows, size) }));
        }
    }
    if chance(random, 0.1) {
        random.shuffle(&mut columns);
    }
    if chance(random, 0.05) {
        // Twice the same, or one that is gone.
        let k = random.usize(..columns.len());
        let twice = columns[k].clone();
        if chance(random, 0.5) { columns.push(twice) } else { drop(columns.remove(k)) }
    }
    let separator = if chance(random, 0.7) { "," } else { one(random, &[";", "\t", " ", "|", ", ", "  "]) };
    let decimals = [6, 9, 12, 3, 0][random.usize(..5)];
    let comma = separator != "," && chance(random, 0.3);
    let mut names: Vec<String> = columns.iter().map(|(name, _)| (*name).to_owned()).collect();
    if chance(random, 0.08) {
        let k = random.usize(..names.len());
        names[k] =
            one(random, &["", "generator", "Output [deg]", "torque", "\"name", "generator_rad", "1.5", "\u{3b8}"])
                .to_owned();
    }
    let mut text = String::new();
    if chance(random, 0.1) {
        text += one(random, &["# made by a logger\n", "Sample rate: 100 Hz\n\n", "sep=;\n", "\n\n"]);
    }
    if chance(random, 0.93) {
        text += &(names.join(separator) + "\n");
    }
    for row in 0..rows {
        let separator = if chance(random, 0.001) { one(random, &[";", ",", "\t"]) } else { separator };
        for (k, (_, values)) in columns.iter().enumerate() {
            text += if k > 0 { separator } else { "" };
            let number = format!("{:.decimals$}", values[row]);
            // The largest number has 300 digits.
            let number = if number.len() > 40 { format!("{:e}", values[row]) } else { number };
            text += &if comma { number.replace('.', ",") } else { number };
        }
        text.push('\n');
    }
    text
}

/// A guide log of some sections.
fn guide_log(random: &mut Rng) -> String {
    let mut text = "PHD2 version 2.6.13, Log version 2.5. Log enabled at 2026-10-01 20:00:00\n".to_owned();
    for section in 0..random.u32(..4) {
        let hour = 20 + random.u32(..4);
        let _ = write!(
            text,
            "Guiding Begins at 2026-10-0{} {hour}:{:02}:00\nPixel scale = {} arc-sec/px\nMount = M, xAngle = 30.0, \
             xRate = {}, yRate = 4.9\n{}{}\n",
            1 + section % 2,
            random.u32(..60),
            one(random, &["1.50", "1,50", "0", "-1", "nan", "1e300"]),
            one(random, &["4.096", "4,096", "0", "Unknown"]),
            one(random, &["RA = 5 hr, ", "", "Cal "]),
            one(
                random,
                &[
                    "Dec = 35.0 deg, Hour angle = -1.05 hr, Pier side = West",
                    "Dec = 88.0 deg, Hour angle = N/A hr",
                    "Dec = 1e9 deg, Hour angle = 1e300 hr"
                ]
            ),
        );
        text += "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,RADuration,\
                 RADirection,ErrorCode\n";
        for k in 0..rows(random) {
            let t = [2.0, 0.0, -1.0, 1e8][if chance(random, 0.97) { 0 } else { random.usize(..4) }] * k as f64;
            let ms = random.u32(..900);
            let raw = random.f64() - 0.5;
            let _ = writeln!(
                text,
                "{k},{t:.3},\"Mount\",0.1,0.2,{raw:.3},0.1,0.0,0.0,{ms},{},0",
                one(random, &["W", "E", ""])
            );
        }
        text += one(random, &["Guiding Ends at 2026-10-01 23:59:59\n", "INFO: DITHER by 1, 2\n", ""]);
    }
    text
}

/// As bytes, with one of the ends of lines and encodings there are.
fn encoded(random: &mut Rng, text: &str) -> Vec<u8> {
    let text = match random.u32(..20) {
        0 | 1 => text.replace('\n', "\r\n"),
        2 => text.replace('\n', "\r"),
        3 => text.trim_end().to_owned(),
        4 => "\u{feff}".to_owned() + text,
        _ => text.to_owned(),
    };
    match random.u32(..40) {
        0 => [0xFF, 0xFE].into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect(),
        1 => text.encode_utf16().flat_map(u16::to_be_bytes).collect(),
        2 => text.chars().map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?')).collect(),
        _ => text.into_bytes(),
    }
}

/// Damage: half of the files have none.
fn damage(random: &mut Rng, bytes: &mut Vec<u8>) {
    let times = [0, 0, 0, 1, 1, 3][random.usize(..6)];
    for _ in 0..times {
        if bytes.is_empty() {
            return;
        }
        let at = random.usize(..bytes.len());
        let far = random.usize(at..bytes.len().min(at + 400) + 1).min(bytes.len());
        let line_at = bytes[..at].iter().rposition(|b| *b == b'\n').map_or(0, |at| at + 1);
        match random.u32(..9) {
            0 => bytes[at] = random.u8(..),
            1 => drop(bytes.drain(at..far)),
            2 => bytes.truncate(at),
            3 => bytes[at..far].fill(0),
            4 => {
                let copy = bytes[at..far].to_vec();
                drop(bytes.splice(at..at, copy));
            }
            5 => {
                let line = one(random, &LINES).to_owned() + "\n";
                drop(bytes.splice(line_at..line_at, line.into_bytes()));
            }
            6 => {
                let whole: Vec<u8> = bytes.clone();
                if whole.len() < 100_000 {
                    bytes.extend(whole);
                }
            }
            _ => {
                // A cell that is no number, or none that one would mean; often a whole column of them.
                let cell = one(random, &CELLS).as_bytes().to_vec();
                let often = if random.bool() { 1 } else { 40 };
                for _ in 0..often {
                    let at = random.usize(..bytes.len());
                    let begin = bytes[..at].iter().rposition(|b| b",;\t\n|".contains(b)).map_or(0, |at| at + 1);
                    let end =
                        bytes[at..].iter().position(|b| b",;\t\n|".contains(b)).map_or(bytes.len(), |end| at + end);
                    if begin <= end {
                        drop(bytes.splice(begin..end, cell.iter().copied()));
                    }
                    if bytes.is_empty() {
                        return;
                    }
                }
            }
        }
    }
}
