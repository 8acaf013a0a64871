//! `calibrate --split`: what of an error is the output encoder's, the generator encoder's and the gear's.
//!
//! ```text
//!  generator --encoder off its axis--> reading      gear: a displaced flexspline, wind-up, play
//!  output    --encoder off its axis, unlike signals--> counts
//! ```
//!
//! The plant has none of the waves that are fitted: encoders are made of their geometry, the gear errs by the sine of
//! a flank without its sign.

use std::f64::consts::TAU;

use flexspline::{Direction, GeneratorAngle, Table};
use flexspline_base::statistics::std_dev;
use flexspline_tests::command::Desk;
use serde_json::Value;

const RATIO: f64 = 101.0;
const ARCSEC: f64 = TAU / 1_296_000.0;
const COUNTS: f64 = 67_108_864.0;
const COLUMNS: &str = "generator=motor:rad,output=joint:count/67108864,torque=load:N.m";
/// Where the output's encoder reads zero, rad.
const ZERO_RAD: f64 = 0.9;
/// The disc of the output's encoder off its axis, and the gain of one of its two signals over the other.
const OFF_AXIS: f64 = 60.0 * ARCSEC;
const UNLIKE: f64 = 30.0 * ARCSEC;
/// The magnet of the motor's encoder off its axis: 12 arcsec at the output.
const MOTOR_OFF_AXIS: f64 = 12.0 * RATIO * ARCSEC;

/// A row: angles, and what output encoder, generator encoder and gear add at the output, arcsec.
struct Row {
    motor_rad: f64,
    output_rad: f64,
    torque_n_m: f64,
    adds: [f64; 3],
}

/// What the output's encoder reads too far at its own reading, rad.
fn output_encoder(turned_rad: f64) -> f64 {
    let (sine, cosine) = (turned_rad - 0.7).sin_cos();
    let eccentric = (OFF_AXIS * sine).atan2(1.0 + OFF_AXIS * cosine);
    let (sine, cosine) = turned_rad.sin_cos();
    eccentric + (sine * (1.0 + UNLIKE)).atan2(cosine) - sine.atan2(cosine)
}

/// There and back through 1.2 turns of the output under a load.
fn rows(load: impl Fn(f64, f64) -> f64, back: bool) -> Vec<Row> {
    const ROWS: usize = 5000;
    let there = if back { ROWS / 2 } else { ROWS };
    let row = |k: usize| {
        let forward = k < there;
        let generator = if forward { k } else { ROWS - k } as f64 * 1.2 * RATIO * TAU / there as f64;
        let output = generator / RATIO;
        let torque_n_m = load(k as f64, output);
        let flank = if torque_n_m.abs() > 1.0 {
            torque_n_m.signum()
        } else if forward {
            -1.0
        } else {
            1.0
        };
        // A displaced wheel: 20 arcsec of two waves in a turn of the generator, with another phase on each flank.
        let displaced = -47.0 * ((generator - 0.4 + flank * 0.35).sin()).abs();
        let gear = displaced + 1.3 * torque_n_m + 20.0 * (torque_n_m / 15.0).tanh() + 6.0 * flank;
        let motor = (MOTOR_OFF_AXIS * (generator + 0.2).sin()).atan2(1.0 + MOTOR_OFF_AXIS * (generator + 0.2).cos());
        let adds = [output_encoder(output + ZERO_RAD) / ARCSEC, -motor / RATIO / ARCSEC, gear];
        let output_rad = output + ZERO_RAD + (adds[0] + gear) * ARCSEC;
        Row { motor_rad: generator + motor, output_rad, torque_n_m, adds }
    };
    (0..ROWS).map(row).collect()
}

fn swinging(k: f64, _: f64) -> f64 {
    25.0 * (k / 61.0).sin()
}

/// The log, with noise of two arc-seconds at the output.
fn log(rows: &[Row]) -> String {
    let mut random = fastrand::Rng::with_seed(7);
    let mut text = "motor,joint,load\n".to_owned();
    for row in rows {
        let noise = 2.0 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
        let counts = ((row.output_rad + noise * ARCSEC) / TAU * COUNTS).round();
        text += &format!("{:.9},{counts:.0},{:.4}\n", row.motor_rad, row.torque_n_m);
    }
    text
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Runs the command over a log; the parts it says. What it writes adds up to the one table, to 0.1 arcsec.
#[track_caller]
fn split(desk: &Desk, text: &str, options: &str) -> [Value; 3] {
    desk.write("log.csv", text);
    let line = format!("calibrate log.csv --ratio 101 --split --no-report --out out --json {options}");
    let said: Value = serde_json::from_str(&desk.line(&line).done().stdout).unwrap();
    let parts: [Value; 3] = std::array::from_fn(|k| said["split"]["parts"][k].clone());
    let images = ["calibrated", "gear"].map(|name| std::fs::read(desk.path(&format!("out/{name}.fxt"))).unwrap());
    let [whole, gear] = [0, 1].map(|k| Table::check(&images[k]).unwrap());
    let mut off = Vec::new();
    for k in 0..2000 {
        let generator_rad = 0.31 * f64::from(k);
        let [low, high] = whole.torque_range_n_m();
        let torque = low + (high - low) * (k % 17) as f32 / 16.0;
        let direction = if k % 2 == 0 { Direction::Forward } else { Direction::Backward };
        let says = |table: &Table<'_>| {
            let generator = GeneratorAngle::from_rad(generator_rad).unwrap();
            f64::from(table.steady_error_rad(generator, torque, 20.0, direction).unwrap()) / ARCSEC
        };
        let wave = |share: &Value| {
            let turn = if share["turn"] == "output" { RATIO } else { 1.0 };
            let angle = number(&share["order"]) * generator_rad / turn;
            number(&share["amplitude_arcsec"]) * (angle - number(&share["phase_deg"]).to_radians()).cos()
        };
        let encoders = parts[..2].iter().flat_map(|part| part["shares"].as_array().unwrap()).map(wave).sum::<f64>();
        off.push(says(&whole) - says(&gear) - encoders);
    }
    // The constant is nobody's.
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    let most = off.iter().fold(0.0, |most: f64, off| most.max((off - mean).abs()));
    println!("sum off by {most:.4} and {mean:.4} arcsec");
    assert!(most < 0.1, "{most}");
    parts
}

/// Orders of a turn that a part has.
fn orders(part: &Value, turn: &str) -> Vec<u64> {
    let shares = part["shares"].as_array().unwrap().iter();
    shares.filter(|share| share["turn"] == turn).map(|share| share["order"].as_u64().unwrap()).collect()
}

#[test]
fn encoders_and_gear_get_what_is_theirs() {
    let rows = rows(swinging, true);
    let desk = Desk::new();
    let parts = split(&desk, &log(&rows), &format!("--columns {COLUMNS} --encoder-table 64"));
    for (k, part) in parts.iter().enumerate() {
        let truth = std_dev(&rows.iter().map(|row| row.adds[k]).collect::<Vec<_>>());
        println!("{}: {} of {truth}, ± {}", part["of"], part["rms_arcsec"], part["half_width_arcsec"]);
        assert!((number(&part["rms_arcsec"]) / truth - 1.0).abs() < 0.1, "{part:#}, {truth}");
        assert!((number(&part["rms_arcsec"]) - truth).abs() < number(&part["half_width_arcsec"]), "{part:#}, {truth}");
    }
    let [output, generator, gear] = &parts;
    assert!(orders(output, "output").starts_with(&[1, 2]) && orders(generator, "generator") == [1], "{parts:#?}");
    // Two waves of the generator may be the encoder's as well, which is said.
    let two = gear["shares"].as_array().unwrap().iter().find(|share| share["order"] == 2).unwrap();
    assert_eq!(two["of_encoder"], serde_json::json!([0.0, 1.0]));
    assert!(two["why"].as_str().unwrap().contains("by 90 deg"), "{two}");
    // The tables, at the readings of the encoders.
    let entries = |file: &str| -> Vec<Vec<f64>> {
        let text = desk.read(&format!("out/{file}.csv"));
        assert_eq!(text.lines().next(), Some("entry,reading_deg,error_arcsec,counts"));
        text.lines()
            .skip(1)
            .map(|line| line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect())
            .collect()
    };
    let of_output = entries("encoder_output");
    assert_eq!(of_output.len(), 64);
    for entry in of_output {
        let truth = output_encoder(entry[1].to_radians()) / ARCSEC;
        assert!((entry[2] - truth).abs() < 2.0, "{entry:?}, {truth}");
        assert_eq!(entry[3], (-entry[2] * ARCSEC / TAU * COUNTS).round());
    }
    for entry in entries("encoder_generator") {
        let truth = MOTOR_OFF_AXIS * (entry[1].to_radians() + 0.2).sin() / ARCSEC;
        assert!((entry[2] - truth).abs() < 1.0 * RATIO && entry[3].is_nan(), "{entry:?}, {truth}");
    }
}

/// Where the data tell nothing apart all stays with the gear, and what to record is said.
#[test]
fn what_a_log_cannot_split_stays_whole() {
    let desk = Desk::new();
    let no_torque = COLUMNS.split(",torque").next().unwrap();
    for (rows, columns, said) in [
        // An arm whose weight is the load: the same wave of the output by the wind-up.
        (rows(|_, output| 25.0 * output.sin(), true), COLUMNS, "at the same angles"),
        // The weight may be there, and is not recorded.
        (rows(|_, _| 0.0, true), no_torque, "record the torque"),
        // One way under one load.
        (rows(|_, _| 12.0, false), COLUMNS, "record both directions"),
        (rows(|_, _| 0.0, false), no_torque, "record the torque"),
    ] {
        let [output, _, gear] = split(&desk, &log(&rows), &format!("--columns {columns}"));
        assert_eq!(orders(&output, "output"), Vec::<u64>::new(), "{output:#}");
        // Nothing is its own for certain, and all of what stays with the gear may be.
        assert_eq!(number(&output["rms_arcsec"]), 0.0);
        assert!(number(&output["half_width_arcsec"]) > 2.0, "{output:#}");
        let shares = gear["shares"].as_array().unwrap();
        let once = shares.iter().find(|share| share["turn"] == "output" && share["order"] == 1).unwrap();
        assert!(once["why"].as_str().unwrap().contains(said) && number(&once["of_encoder"][0]) < 0.5, "{once}");
        assert!(desk.read("out/encoder_output.csv").lines().nth(1).unwrap().starts_with("0,0.0,0.0,"));
    }
}

#[test]
fn slips_of_the_pen_leave_nothing_behind() {
    let desk = Desk::new();
    desk.write("log.csv", &log(&rows(swinging, true)));
    let columns = COLUMNS.replace("count/67108864", "turn*1.4901161193847656e-8");
    for (options, said) in [
        (format!("--columns {COLUMNS} --split --encoder-table 0"), "2 to 65536"),
        (format!("--columns {COLUMNS} --split --encoder-table 32:0"), "2 to 65536"),
        (format!("--columns {COLUMNS} --encoder-table 32"), "--split"),
        (format!("--columns {COLUMNS} --plan --split"), "--plan"),
        ("--columns generator=motor:rad,error=joint:arcsec --split --encoder-table 32".to_owned(), "32:COUNTS"),
    ] {
        desk.refused(&format!("calibrate log.csv --ratio 101 --out out {options}"), said);
        assert!(!desk.path("out").exists());
    }
    desk.line(&format!("calibrate log.csv --ratio 101 --out out --no-report --columns {columns}")).done();
    assert!(!desk.path("out/gear.fxt").exists());
}
