//! Tables for others' playback hold what their devices play: each file is read here by a parser of its own, written
//! from the description of the format (docs/how-to/export_to_controllers.md), and looked up by a simulation of its own,
//! forward from the command or through time, where the program goes backward from the generator.
//!
//! The unit: HHD-95 with the cam by its table of contact FEM, with a pitch error, two eccentricities and wider
//! clearance, calibrated under 12 N.m from one log and judged on another. Nothing here was tried on hardware.
//! Wrong if this fails: a sign, half a bin, a direction, a unit, an entry played a second early, a byte order.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::process::Command;
use std::sync::LazyLock;

use flexspline::{Direction, GeneratorAngle, Table};
use flexspline_tests::command::Desk;
use serde_json::Value;

const ARCSEC: f64 = 206_264.806_247_096_36;
const RATIO: f64 = 95.0;
const LOAD_N_M: f32 = 12.0;
const TEMPERATURE_C: f32 = 20.0;
const EFFECTS: &str = "--effect flexspline_pitch_error:amplitude_arcsec=20,phase_rad=0.4 --effect \
                       generator_eccentricity:amplitude_arcsec=8,phase_rad=1.1 --effect \
                       circular_spline_eccentricity:amplitude_arcsec=6,phase_rad=0.7 --effect \
                       backlash_growth:growth_arcsec=20";
const BOTH: [Direction; 2] = [Direction::Forward, Direction::Backward];
/// Points in a direction: enough for 1 % of a root mean square.
const POINTS: u32 = 20_011;

/// A folder with the table of the unit, `cal/calibrated.fxt`, a log of it, `run/data.csv`, and the nominal table,
/// `cam.fxt`.
struct Unit {
    desk: Desk,
    image: Vec<u8>,
}

/// There and back through an output turn of a joint under load.
fn motion(from: f64, step: f64, rows: u32) -> String {
    let mut text = String::from("time_s,generator_rad,torque_n_m,temperature_c,output_rad\n");
    for (k, place) in (0..rows).chain((0..rows - 1).rev()).enumerate() {
        let generator = from + step * f64::from(place);
        let _ =
            writeln!(text, "{:.2},{generator:.6},{LOAD_N_M},{TEMPERATURE_C},{:.9}", 0.05 * k as f64, generator / RATIO);
    }
    text
}

static UNIT: LazyLock<Unit> = LazyLock::new(|| {
    let desk = Desk::new();
    let samples = format!("{}/firmware/samples/cam.samples.csv", env!("CARGO_MANIFEST_DIR"));
    desk.line(&format!("tables --no-report --generator cam --from-samples {samples} --out .")).done();
    for (name, seed, motion) in [("learn", 5, motion(0.05, 0.1437, 4150)), ("run", 6, motion(0.0, 0.15, 3980))] {
        desk.write("motion.csv", &motion);
        let like = format!("--tables . --no-spread --seed {seed} --like motion.csv --noise-arcsec 0.5 --out {name}");
        desk.line(&format!("synthesize {EFFECTS} {like}")).done();
    }
    desk.line("calibrate learn/data.csv --tables . --generator cam --no-report --out cal").done();
    let image = std::fs::read(desk.path("cal/calibrated.fxt")).unwrap();
    Unit { desk, image }
});

/// What the program says of a format, for the load of the unit; the files are in the folder `out`.
fn export(format: &str, out: &str) -> Value {
    let line = format!(
        "export --tables cal/calibrated.fxt --torque-n-m {LOAD_N_M} --temperature-c {TEMPERATURE_C} --out {out}"
    );
    UNIT.desk.line(&format!("{line} --data run/data.csv --json --format {format}")).done().json()
}

fn number(value: &Value, path: &str) -> f64 {
    value.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {path} in {value}"))
}

/// Error of the unit's table at an output that the generator was led to, rad.
fn error(table: &Table<'_>, led_rad: f64, direction: Direction) -> f64 {
    let generator = GeneratorAngle::from_rad(led_rad * RATIO).unwrap();
    f64::from(table.steady_error_rad(generator, LOAD_N_M, TEMPERATURE_C, direction).unwrap())
}

/// Root mean square about the mean, arcsec.
fn rms(left_rad: &[f64]) -> f64 {
    let count = left_rad.len() as f64;
    let mean = left_rad.iter().sum::<f64>() / count;
    (left_rad.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt() * ARCSEC
}

/// Left when the joint is asked for each place of a travel and its controller adds `added` (rad) to it.
fn left_by_position(travel: [f64; 2], directions: &[Direction], added: impl Fn(f64, Direction) -> f64) -> f64 {
    let table = Table::check(&UNIT.image).unwrap();
    let mut left = Vec::new();
    for direction in directions {
        for k in 0..POINTS {
            let asked = travel[0] + (travel[1] - travel[0]) * (f64::from(k) + 0.5) / f64::from(POINTS);
            let led = asked + added(asked, *direction);
            left.push(led + error(&table, led, *direction) - asked);
        }
    }
    rms(&left)
}

/// The program's figure is the one found here, and the same lookup with the wrong sign or half a bin off is another.
fn same(what: &str, said: &Value, found: f64, relative: f64) {
    let said = number(said, "/model/rms_played_arcsec");
    assert!((said - found).abs() < relative * found, "{what}: the program says {said}, its file leaves {found}");
}

/// On the unit's data a playback leaves little more than the core does.
fn helps(what: &str, said: &Value, most: f64) {
    let [uncorrected, played, core] =
        ["uncorrected", "played", "core"].map(|name| number(said, &format!("/playback/rms_{name}_arcsec")));
    assert!((12.0..17.0).contains(&uncorrected), "{what}: {uncorrected}");
    assert!(core < 1.0 && core <= played && played < most, "{what}: core {core}, played {played}, at most {most}");
    println!("{what}: {uncorrected:.2} uncorrected, {played:.2} played, {core:.2} core");
}

/// Linear interpolation over rows that increase; beyond the ends the end value.
fn between(rows: &[[f64; 2]], place: f64) -> f64 {
    let above = rows.iter().position(|row| row[0] > place);
    match above {
        Some(0) => rows[0][1],
        None => rows[rows.len() - 1][1],
        Some(above) => {
            let [low, high] = [rows[above - 1], rows[above]];
            low[1] + (high[1] - low[1]) * (place - low[0]) / (high[0] - low[0])
        }
    }
}

#[test]
fn linuxcnc_triplets_leave_what_is_said_in_both_types() {
    let travel = [0.0, 20f64.to_radians()];
    for (kind, type_option) in [(1, ""), (0, "--comp-type 0")] {
        let out = format!("linuxcnc{kind}");
        let said = export(&format!("linuxcnc --to-deg 20 {type_option}"), &out);
        let mut columns = [Vec::new(), Vec::new()];
        // Like the loader: up to the first line that is no triplet.
        for line in UNIT.desk.read(&format!("{out}/flexspline.comp")).lines() {
            let row: Vec<f64> = line.split(' ').map_while(|word| word.parse().ok()).collect();
            let [nominal, forward, backward] = row[..] else { break };
            let trim = |value: f64| if kind == 0 { nominal - value } else { value };
            columns[0].push([nominal, trim(forward)]);
            columns[1].push([nominal, trim(backward)]);
        }
        assert_eq!(columns[0].len(), 256);
        let lookup =
            |degrees: f64, direction| between(&columns[usize::from(direction == Direction::Backward)], degrees);
        let added = |asked: f64, direction| lookup(asked.to_degrees(), direction).to_radians();
        same(&out, &said, left_by_position(travel, &BOTH, added), 0.02);
        helps(&out, &said, 1.0);
        // What this test would not see otherwise.
        let turned = left_by_position(travel, &BOTH, |asked, direction| -added(asked, direction));
        let half = 0.5 * 20.0 / 255.0;
        let shifted = left_by_position(travel, &BOTH, |asked, direction| {
            lookup(asked.to_degrees() + half, direction).to_radians()
        });
        let right = number(&said, "/model/rms_played_arcsec");
        assert!(turned > 20.0 * right && shifted > 2.0 * right, "{right}, turned {turned}, shifted {shifted}");
    }
}

/// The numbers after a name, as `Name := 1.5`.
fn named(text: &str, name: &str) -> Vec<f64> {
    let name = format!("{name} := ");
    let after = text.split(&name).skip(1);
    after.map(|rest| rest.split([',', ')', ';']).next().unwrap().parse().unwrap()).collect()
}

#[test]
fn beckhoff_tables_leave_what_is_said_on_nc_and_on_cnc() {
    let turn = [0.0, TAU];
    let said = export("beckhoff", "nc");
    let text = UNIT.desk.read("nc/flexspline_compensation.TcGVL.st");
    let rows: Vec<[f64; 2]> = std::iter::zip(named(&text, "(Position"), named(&text, " Compensation"))
        .map(|(position, compensation)| [position, compensation])
        .collect();
    assert_eq!(named(&text, "NoOfTableElements"), [rows.len() as f64]);
    assert!(
        text.contains("Modulo := TRUE") && rows[0][1] == rows[rows.len() - 1][1] && rows[rows.len() - 1][0] == 360.0
    );
    let step = 360.0 / (rows.len() - 1) as f64;
    // Equidistant: the place is the index.
    let evenly = |values: &dyn Fn(usize) -> f64, last: usize, step: f64, degrees: f64| {
        let at = (degrees.rem_euclid(360.0) / step).min(last as f64 - 1e-9);
        values(at as usize) * (1.0 - at.fract()) + values(at as usize + 1) * at.fract()
    };
    let added = |asked: f64, _| evenly(&|k| rows[k][1], rows.len() - 1, step, asked.to_degrees()).to_radians();
    same("nc", &said, left_by_position(turn, &BOTH, added), 0.02);
    helps("nc", &said, 0.9);
    let turned = left_by_position(turn, &BOTH, |asked, direction| -added(asked, direction));
    assert!(turned > 20.0, "{turned}");

    let said = export("beckhoff --controller cnc", "cnc");
    let mut list: BTreeMap<String, i64> = BTreeMap::new();
    for line in UNIT.desk.read("cnc/achskw.lis").lines().filter(|line| !line.starts_with('#')) {
        let (name, value) = line.split_once(' ').unwrap();
        assert!(list.insert(name.to_owned(), value.parse().unwrap()).is_none(), "{name} twice");
    }
    let get = |name: &str| list[&format!("kw.ssfk.{name}")];
    let entries = get("kw_nr_max");
    assert!(get("unit") == 1 && get("bilateral") == 1 && get("modulo") == 1 && entries < 1500);
    assert_eq!(get("interval") * (entries - 1), 3_600_000, "0.0001 degrees, all around");
    assert_eq!(list.len() as i64, 6 + 2 * entries);
    let added = |asked: f64, direction| {
        let column = if direction == Direction::Forward { "pos" } else { "neg" };
        // The list holds actual less setpoint: 19856.5 measured for 19866.7 um is -102.
        let value = |k: usize| -get(&format!("table[{k}].{column}")) as f64 * 1e-4;
        evenly(&value, entries as usize - 1, get("interval") as f64 * 1e-4, asked.to_degrees()).to_radians()
    };
    same("cnc", &said, left_by_position(turn, &BOTH, added), 0.02);
    helps("cnc", &said, 1.0);
}

#[test]
fn moteus_bytes_leave_what_is_said() {
    let said = export("moteus --source 1 --cpr 16384", "moteus");
    let text = UNIT.desk.read("moteus/moteus.cfg");
    let value = |name: String| {
        let start = format!("conf set motor_position.sources.1.compensation_{name} ");
        let lines: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix(start.as_str())).collect();
        assert_eq!(lines.len(), 1, "{name}");
        lines[0].to_owned()
    };
    let scale: f32 = value("scale".to_owned()).parse().unwrap();
    let bytes: Vec<i8> = (0..256).map(|k| value(format!("table.{k}")).parse().unwrap()).collect();
    assert_eq!(text.lines().count(), 257);
    assert!(bytes.contains(&127) || bytes.contains(&-127), "the whole range is used");
    let table = Table::check(&UNIT.image).unwrap();
    // What the loop believes is the reading with the correction; the output stands elsewhere by what it does not hold.
    let left = |shift: f32, sign: f32| {
        let mut left = Vec::new();
        for direction in BOTH {
            for k in 0..POINTS {
                let led = TAU * f64::from(k) / f64::from(POINTS);
                let turns = led * RATIO / TAU;
                let count = (turns.fract() * 16_384.0).floor() as f32;
                let place = (count / 16_384.0 * 256.0 + shift).rem_euclid(256.0);
                let (low, share) = (place as usize % 256, place.fract());
                let [low, high] = [low, (low + 1) % 256].map(|at| f32::from(bytes[at]) * (scale / 127.0));
                let believed = f64::from(sign * (low + (high - low) * share));
                left.push(error(&table, led, direction) - believed / RATIO * TAU);
            }
        }
        rms(&left)
    };
    same("moteus", &said, left(0.0, 1.0), 0.005);
    helps("moteus", &said, 1.6);
    let right = left(0.0, 1.0);
    // The comment in the firmware says the middle of a bin, its code the left edge.
    assert!(left(0.5, 1.0) > 1.02 * right && left(-0.5, 1.0) > 1.02 * right && left(0.0, -1.0) > 10.0 * right);
}

/// Rms of what is left over time, about the straight line that fits it best.
fn left_in_time(mut left: Vec<f64>) -> f64 {
    let middle = 0.5 * (left.len() - 1) as f64;
    let (mut along, mut all) = (0.0, 0.0);
    for (k, value) in left.iter().enumerate() {
        along += value * (k as f64 - middle);
        all += (k as f64 - middle).powi(2);
    }
    left.iter_mut().enumerate().for_each(|(k, value)| *value -= along / all * (k as f64 - middle));
    rms(&left)
}

#[test]
fn onstepx_seconds_leave_what_is_said_and_a_short_buffer_is_refused() {
    let table = Table::check(&UNIT.image).unwrap();
    let short = UNIT.desk.line("export --format onstepx --tables cal/calibrated.fxt");
    assert!(short.code == 2 && short.stderr.contains("PEC_BUFFER_SIZE_LIMIT to 912"), "{}", short.stderr);
    for (direction, option, steps_per_degree) in
        [(Direction::Forward, "", 12_800.0), (Direction::Backward, "--direction backward", 20_000.0)]
    {
        let out = format!("onstepx{steps_per_degree}");
        let said = export(&format!("onstepx --buffer-s 912 --steps-per-degree {steps_per_degree} {option}"), &out);
        let rate = steps_per_degree / 240.0;
        let worm = (steps_per_degree * 360.0 / RATIO).round();
        let size = (worm / rate).round() as usize;
        let mut buffer = vec![0i32; size];
        let text = UNIT.desk.read(&format!("{out}/onstepx_pec.txt"));
        let commands: Vec<&str> = text.lines().map(|line| line.strip_suffix('#').unwrap()).collect();
        assert!(commands[0] == ":$QZZ" && commands[size + 1] == ":$QZ!" && commands.len() == size + 2);
        for command in &commands[1..=size] {
            let (entry, steps) = command.strip_prefix(":WR").unwrap().split_once(',').unwrap();
            buffer[entry.parse::<usize>().unwrap()] = steps.parse::<i8>().unwrap().into();
        }
        // The controller's loop, every 10 ms of an output turn of sidereal seconds, with the entries so many seconds
        // late.
        let left = |late: usize| {
            let (mut motor, mut index, mut began, mut last) = (0.0f64, 0usize, 0u32, -1.0);
            let mut left = Vec::new();
            for poll in 0..8_640_000u32 {
                let place = motor.floor().rem_euclid(worm);
                if place < last {
                    (index, began) = (0, poll);
                }
                last = place;
                if poll - began >= 100 {
                    (index, began) = ((index + 1) % size, poll);
                }
                let added = f64::from(buffer[(index + size - late) % size]);
                if poll % 100 == 50 {
                    let led = motor / (steps_per_degree * 360.0) * TAU;
                    let tracked = f64::from(poll) / 8_640_000.0 * TAU;
                    let sign = f64::from(direction.sign());
                    left.push(led - tracked + sign * error(&table, sign * led, direction));
                }
                motor += (rate + added) / 100.0;
            }
            left_in_time(left)
        };
        // A second plays the entry before its own.
        let right = left(1);
        same(&out, &said, right, 0.03);
        let gap = |found: f64| (number(&said, "/model/rms_played_arcsec") - found).abs();
        assert!(gap(right) < gap(left(0)) && gap(right) < gap(left(2)), "{right}, {}, {}", left(0), left(2));
        helps(&out, &said, 1.6);
    }
}

#[test]
fn eqmod_curves_leave_what_is_said() {
    const SIDEREAL: f64 = 15.041_067;
    let table = Table::check(&UNIT.image).unwrap();
    for (direction, option) in [(Direction::Forward, ""), (Direction::Backward, "--direction backward")] {
        let out = format!("eqmod{}", option.len());
        let said = export(&format!("eqmod {option}"), &out);
        let text = UNIT.desk.read(&format!("{out}/eqmod_pec.txt"));
        assert!(text.starts_with('#'), "the first line is skipped");
        let header = |name: &str| -> f64 {
            text.lines().find_map(|line| line.strip_prefix(name)).unwrap().trim_start_matches('=').parse().unwrap()
        };
        let (period, worm) = (header("!WormPeriod") as usize, header("!StepsPerWorm"));
        let rows: Vec<Vec<f64>> = text
            .lines()
            .filter(|line| !line.starts_with(['#', '!']))
            .map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect())
            .collect();
        assert!(period == 907 && rows.len() == period && worm == (9_024_000.0 / RATIO).round());
        let steps_a_second = SIDEREAL * 9_024_000.0 / 1_296_000.0;
        assert!(
            rows.iter()
                .enumerate()
                .all(|(k, row)| row[0] == k as f64 && (row[1] - steps_a_second * k as f64).abs() <= 1.0)
        );
        // Rates: differences of the error, that over the seam the mean of its neighbours, without their mean, as
        // dividers.
        let value = |k: usize| rows[k][2];
        let drift = (value(period - 1) - value(0)) / (period as f64 + 1.0);
        let mut rates: Vec<f64> = (1..period).map(|k| value(k - 1) - value(k) + drift).collect();
        rates.insert(0, 0.5 * (rates[0] + rates[period - 2]));
        let mean = rates.iter().sum::<f64>() / period as f64;
        rates.iter_mut().for_each(|rate| *rate -= mean);
        let mut carried = 0.0;
        for k in 0..3 * period {
            let wanted = SIDEREAL + rates[k % period] + carried;
            let given = 9_325.461_54 / (9_325.461_54 / wanted + 0.5).floor();
            carried = wanted - given;
            rates[k % period] = given - SIDEREAL;
        }
        // Once a second, wherever in its second the first tick lies; which rate it is goes by the place in the worm
        // turn.
        let mut all = Vec::new();
        for phase in [0.1, 0.3, 0.5, 0.7, 0.9] {
            let mut led = -SIDEREAL * phase;
            let start = led;
            let mut left = Vec::new();
            let mut index = 0;
            for tick in 0..period * 94 {
                if tick % period == 0 {
                    let place = (led / 1_296_000.0 * 9_024_000.0).rem_euclid(worm) / worm * period as f64;
                    index = place.ceil() as usize % period;
                }
                let rad = led / ARCSEC;
                let sign = f64::from(direction.sign());
                let tracked = start + SIDEREAL * tick as f64;
                left.push((led - tracked) / ARCSEC + sign * error(&table, sign * rad, direction));
                led += SIDEREAL + rates[index];
                index = (index + 1) % period;
            }
            all.push(left_in_time(left));
        }
        let mean = (all.iter().map(|value| value * value).sum::<f64>() / all.len() as f64).sqrt();
        same(&out, &said, mean, 0.05);
        helps(&out, &said, 1.6);
    }
}

#[test]
fn cfs_and_fprime_hold_the_image_itself() {
    let said = export("cfs --table-name JOINT.FLEX_1 --spacecraft-id 66 --processor-id 1", "cfs");
    let file = std::fs::read(UNIT.desk.path("cfs/flexspline.tbl")).unwrap();
    let word = |at: usize| u32::from_be_bytes(file[at..at + 4].try_into().unwrap());
    let text = |at: usize, length: usize| {
        let field = &file[at..at + length];
        let end = field.iter().position(|byte| *byte == 0).expect("a field ends with a zero");
        assert!(field[end..].iter().all(|byte| *byte == 0));
        String::from_utf8(field[..end].to_vec()).unwrap()
    };
    let header: Vec<u32> = (0..8).map(|k| word(4 * k)).collect();
    assert_eq!(header, [0x6346_4531, 8, 64, 66, 1, 0, 0, 0]);
    assert_eq!(text(32, 32), format!("flexspline {}", said["table_id"].as_str().unwrap()));
    assert_eq!([word(64), word(68), word(72)], [0, 0, UNIT.image.len() as u32]);
    assert_eq!(text(76, 40), "JOINT.FLEX_1");
    assert_eq!(file[116..], UNIT.image);
    let core = number(&said, "/playback/rms_core_arcsec");
    assert_eq!(number(&said, "/playback/rms_played_arcsec"), core);
    validates_on_board();

    let said = export("fprime --component Ref.joint --part-bytes 300", "fprime");
    let json: Value = serde_json::from_str(&UNIT.desk.read("fprime/flexspline_prm.json")).unwrap();
    let parts = json["Ref.joint"].as_object().unwrap();
    let mut bytes = Vec::new();
    for k in 0..parts.len() {
        let part = parts[&format!("FLEXSPLINE_{k}")].as_array().unwrap();
        assert_eq!(part.len(), 300);
        bytes.extend(part.iter().map(|byte| u8::try_from(byte.as_u64().unwrap()).unwrap()));
    }
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    assert!(
        bytes[..length] == UNIT.image && bytes[length..].iter().all(|byte| *byte == 0) && bytes.len() - length < 300
    );
    assert!(UNIT.desk.read("fprime/flexspline.fpp").contains("array FlexsplinePart = [300] U8"));
    assert_eq!(number(&said, "/playback/rms_played_arcsec"), core);
}

/// The C that is written compiles without warnings beside the types of cFE, and its function takes the table of its own
/// object and refuses it with a bit turned.
fn validates_on_board() {
    let folder = UNIT.desk.path("cfs");
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write(
        "common_types.h",
        "#include <stdint.h>\ntypedef uint8_t uint8; typedef uint32_t uint32; typedef int32_t int32;\n",
    );
    write(
        "cfe_tbl_filedef.h",
        "#include \"common_types.h\"\ntypedef struct { char ObjectName[64], TableName[40], Description[32], \
         TgtFilename[20]; uint32 ObjectSize; } CFE_TBL_FileDef_t;\n#define CFE_TBL_FILEDEF(O, T, D, F) \
         CFE_TBL_FileDef_t CFE_TBL_FileDef = {#O \"\\0\", #T \"\\0\", #D \"\\0\", #F \"\\0\", sizeof(O)};\n",
    );
    write(
        "main.c",
        "#include <string.h>\n#include \"cfe_tbl_filedef.h\"\n#include \"flexspline_tbl.h\"\nextern \
         FLEXSPLINE_Table_t FLEXSPLINE_Table; extern CFE_TBL_FileDef_t CFE_TBL_FileDef;\nint main(void) {\nif \
         (strcmp(CFE_TBL_FileDef.TableName, \"JOINT.FLEX_1\") || CFE_TBL_FileDef.ObjectSize != \
         FLEXSPLINE_TABLE_BYTES) return 1;\nif (FLEXSPLINE_ValidateTable(&FLEXSPLINE_Table) != 0) return 2;\nfor \
         (unsigned k = 0; k < FLEXSPLINE_TABLE_BYTES; k += 97) {\nFLEXSPLINE_Table.Image[k] ^= 4; if \
         (FLEXSPLINE_ValidateTable(&FLEXSPLINE_Table) == 0) return 3; FLEXSPLINE_Table.Image[k] ^= 4;\n}\nreturn 0; \
         }\n",
    );
    let built = Command::new("cc")
        .args([
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-o",
            "validate",
            "main.c",
            "flexspline_tbl.c",
            "flexspline_tbl_validate.c",
        ])
        .current_dir(&folder)
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    let run = Command::new(folder.join("validate")).status().unwrap();
    assert_eq!(run.code(), Some(0));
}

#[test]
fn what_is_pointless_is_refused_with_the_reason_and_options_that_do_not_fit_too() {
    let desk = &UNIT.desk;
    let unit = "--tables cal/calibrated.fxt --torque-n-m 12 --out refused";
    for (line, reasons) in [
        // 256 triplets over a turn are fewer than three to a generator turn.
        (format!("{unit} --format linuxcnc"), &["2.7 to a generator turn", "190 times an output turn", "--force"][..]),
        (
            "--tables cam.fxt --torque-n-m 0 --out refused --format moteus".to_owned(),
            &["play dominates", "--direction"],
        ),
        (format!("{unit} --format ros2"), &["no curve", "--force"]),
        (format!("{unit} --format odrive"), &["anticogging", "torque"]),
        (format!("{unit} --format odrive --force"), &["--force"]),
        (format!("{unit} --format moteus --points 12"), &["--points", "linuxcnc, beckhoff"]),
        (format!("{unit} --format eqmod --direction both"), &["--direction both"]),
        (format!("{unit} --format linuxcnc --to-deg 20 --points 257"), &["257", "256"]),
        (format!("{unit} --format moteus --mesh coarse"), &["--mesh", "--tables"]),
        (format!("{unit} --format csv"), &["--tables"]),
        ("--format csv --generator cam --cpr 3".to_owned(), &["--cpr", "moteus"]),
        ("--format csv".to_owned(), &["--generator"]),
        ("--format moteus --generator cam".to_owned(), &["--tables"]),
        ("--tables cal/calibrated.fxt --format moteus --torque-n-m 1e4".to_owned(), &["--torque-n-m", "10000"]),
        (format!("{unit} --format cfs --table-name TABLE"), &["APP.TABLE"]),
        (format!("{unit} --format onstepx --buffer-s 40000"), &["--buffer-s", "30000"]),
    ] {
        let run = desk.line(&format!("export {line}"));
        assert_eq!(run.code, 2, "{line}: {}", run.stdout);
        for reason in reasons {
            assert!(run.stderr.contains(reason), "{line}: no {reason} in {}", run.stderr);
        }
    }
    assert!(!desk.path("refused").exists(), "nothing is written");
    let said = export("ros2 --force", "ros2");
    let [uncorrected, played] =
        ["uncorrected", "played"].map(|name| number(&said, &format!("/playback/rms_{name}_arcsec")));
    assert!((uncorrected - played).abs() < 1e-9, "an offset changes nothing about the mean: {uncorrected}, {played}");
    let xml = desk.read("ros2/transmission.xml");
    assert!(xml.contains("<mechanical_reduction>95</mechanical_reduction>"), "{xml}");
}

/// A table of commas without its header, each row changed.
fn changed(name: &str, rows: usize, change: impl Fn(&str, &mut f64)) -> String {
    let text = UNIT.desk.read(name);
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().unwrap();
    let mut changed = format!("{header}\n");
    for line in lines.take(rows) {
        let values = header.split(',').zip(line.split(',')).map(|(column, value)| {
            let Ok(mut value) = value.parse::<f64>() else { return value.to_owned() };
            change(column, &mut value);
            format!("{value:.9}")
        });
        changed += &(values.collect::<Vec<_>>().join(",") + "\n");
    }
    changed
}

#[test]
fn data_that_the_playback_makes_worse_are_refused_and_say_whether_the_table_is_theirs() {
    let desk = &UNIT.desk;
    let export = |data: &str, more: &str, out: &str| {
        desk.line(&format!(
            "export --format moteus --tables cal/calibrated.fxt --torque-n-m {LOAD_N_M} --temperature-c 20 --data \
             {data} --out {out} --json {more}"
        ))
    };
    // Both angles turned over, a generator zero a third of a turn off.
    desk.write(
        "turned.csv",
        &changed("run/data.csv", usize::MAX, |column, value| {
            if matches!(column, "generator_rad" | "output_rad" | "error_arcsec") {
                *value = -*value;
            }
        }),
    );
    desk.write(
        "shifted.csv",
        &changed("run/data.csv", usize::MAX, |column, value| match column {
            "generator_rad" => *value += 2.0,
            "output_rad" => *value += 2.0 / RATIO,
            _ => {}
        }),
    );
    for data in ["turned.csv", "shifted.csv"] {
        let run = export(data, "", "worse");
        assert_eq!(run.code, 2, "{data}: {}", run.stdout);
        for reason in ["the unit's data", "more than 70 %", "the core leaves", "do not belong to this table", "--force"]
        {
            assert!(run.stderr.contains(reason), "{data}: no {reason} in {}", run.stderr);
        }
        let forced = export(data, "--force", &format!("forced_{data}")).done().json();
        assert!(forced["notes"].to_string().contains("written by --force. the unit's data"), "{forced}");
    }
    // No error of this drive at all: the reader says what turns otherwise, and --force does not help.
    desk.write(
        "ratio.csv",
        &changed("run/data.csv", usize::MAX, |column, value| {
            if column == "generator_rad" {
                *value *= 1.01;
            }
        }),
    );
    for more in ["", "--force"] {
        let run = export("ratio.csv", more, "worse");
        assert_eq!(run.code, 2, "{}", run.stdout);
        assert!(
            run.stderr.contains("found 95, but the generator turns 95.9") && run.stderr.contains("allowed: 96"),
            "{}",
            run.stderr
        );
    }
    assert!(!desk.path("worse").exists(), "nothing is written");
    // The error alone turned over: the other sign would do.
    let mut rows = String::from("generator_rad,error_arcsec,torque_n_m\n");
    for line in desk.read("run/data.csv").lines().skip_while(|line| !line.starts_with("time_s")).skip(1) {
        let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
        let [generator, output] = [values[1], values[2]];
        let _ = writeln!(rows, "{generator},{:.6},{LOAD_N_M}", -(output - generator / RATIO) * ARCSEC);
    }
    desk.write("sign.csv", &rows);
    let run = export("sign.csv", "", "worse");
    assert!(run.code == 2 && run.stderr.contains("if the error had the other sign"), "{}", run.stderr);
    // A handful of rows judges nothing.
    desk.write("few.csv", &changed("run/data.csv", 7, |_, _| {}));
    let few = export("few.csv", "", "few").done().json();
    assert!(few["playback"].is_null() && few["notes"].to_string().contains("not judged by the data: 7 rows"), "{few}");
    // How data are read, without data.
    for option in ["--columns generator=#1:rad", "--rate 10", "--torque-constant 2"] {
        let run = desk
            .line(&format!("export --format moteus --tables cal/calibrated.fxt --torque-n-m 12 --out worse {option}"));
        let name = option.split(' ').next().unwrap();
        assert!(
            run.code == 2 && run.stderr.contains(name) && run.stderr.contains("--data"),
            "{option}: {}",
            run.stderr
        );
    }
}

#[test]
fn loads_beside_the_section_and_what_was_left_out_are_said() {
    let desk = &UNIT.desk;
    desk.write(
        "heavy.csv",
        &changed("run/data.csv", usize::MAX, |column, value| {
            if column == "torque_n_m" {
                *value = 5000.0;
            }
        }),
    );
    let line = format!(
        "export --format moteus --tables cal/calibrated.fxt --torque-n-m {LOAD_N_M} --data heavy.csv --force --out \
         heavy --json"
    );
    let said = desk.line(&line).done().json();
    let notes = said["notes"].to_string();
    assert!(notes.contains("loads of the data: 5000 to 5000 N.m") && notes.contains("12 N.m that the file"), "{notes}");
    assert!(notes.contains("7959 of 7959 rows of the data are extrapolated by the core"), "{notes}");
    let written: Value = serde_json::from_str(&desk.read("heavy/playback.json")).unwrap();
    assert_eq!(number(&written, "/playback/rows_extrapolated"), 7959.0);
    let near = export("moteus", "near");
    assert!(!near["notes"].to_string().contains("of the data"), "{near}");
    // The mean of the table at its load, as it is found here.
    let table = Table::check(&UNIT.image).unwrap();
    let led = |k: u32| TAU * f64::from(k) / f64::from(POINTS);
    let both = BOTH.map(|direction| (0..POINTS).map(|k| error(&table, led(k), direction)).sum::<f64>());
    let mean = (both[0] + both[1]) / f64::from(2 * POINTS) * ARCSEC;
    let left_out = number(&near, "/model/mean_left_out_arcsec");
    assert!((left_out - mean).abs() < 0.01 * mean.abs() && mean.abs() > 1.0, "{left_out}, {mean}");
}

/// A file for one load makes others worse: that is said, with the load, and not where none is worse.
#[test]
fn loads_that_a_file_makes_worse_are_named() {
    let desk = &UNIT.desk;
    let line = |more: &str| format!("export --format linuxcnc --tables cam.fxt --out worse --json {more}");
    let said = desk.line(&line("")).done().json();
    let (at, of) = (said["model"]["loads"].as_array().unwrap(), said["notes"].to_string());
    let worse = |load: &&Value| number(load, "/rms_played_arcsec") > number(load, "/rms_uncorrected_arcsec");
    assert!(at.iter().any(|load| worse(&load)) && at.iter().any(|load| !worse(&load)), "{at:?}");
    for load in at {
        let named = of.contains(&format!(" {} N.m (", load["torque_n_m"]).replace(".0 N", " N"));
        assert_eq!(named, worse(&load), "{load} in {of}");
    }
    assert!(of.contains("--torque-n-m"), "{of}");
    let near = export("moteus", "near_all");
    let any = near["model"]["loads"].as_array().unwrap().iter().any(|load| worse(&load));
    assert_eq!(near["notes"].to_string().contains("leaves more than none"), any, "{near}");
}

#[test]
fn a_foreign_file_stays_and_the_program_writes_over_its_own() {
    let desk = &UNIT.desk;
    for (format, file, foreign) in [
        ("moteus", "moteus.cfg", "conf set servo.pid_position.kp 4\nconf set motor_position.sources.0.type 1\n"),
        ("onstepx --buffer-s 912", "onstepx_pec.txt", ":WR0,3#\n:GVP#\n"),
        ("eqmod", "eqmod_pec.txt", "# my curve\n0 0 1.5\n"),
        ("fprime", "flexspline_prm.json", "{}\n"),
        ("linuxcnc --to-deg 20", "playback.json", "{}\n"),
    ] {
        let out = format!("kept_{file}");
        let line = format!("export --tables cal/calibrated.fxt --torque-n-m {LOAD_N_M} --out {out} --format {format}");
        std::fs::create_dir(desk.path(&out)).unwrap();
        desk.write(&format!("{out}/{file}"), foreign);
        let run = desk.line(&line);
        assert!(
            run.code == 2 && run.stderr.contains("--force") && run.stderr.contains(file),
            "{format}: {}",
            run.stderr
        );
        assert_eq!(desk.read(&format!("{out}/{file}")), foreign);
        desk.line(&format!("{line} --force")).done();
        // Of its own, for another load.
        desk.line(&format!("{line} --temperature-c 20")).done();
    }
}

#[test]
fn a_zero_that_costs_is_told_and_so_is_another_number_of_points() {
    let desk = &UNIT.desk;
    let line = "export --tables cal/calibrated.fxt --torque-n-m 12 --json --out zeros --format";
    let played = |zero: i64| {
        let said = desk.line(&format!("{line} eqmod --motor-zero {zero}")).done().json();
        (number(&said, "/model/rms_played_arcsec"), said["notes"].to_string())
    };
    let (good, notes) = played(0);
    assert!(!notes.contains("--motor-zero"), "{notes}");
    let mut told = 0;
    for zero in [-120, -60, -20, -5] {
        let (bad, notes) = played(zero);
        println!("{zero}: {bad:.2}, at 0 {good:.2}");
        if bad > 2.0 * good {
            let better = notes.split("; --motor-zero ").nth(1).unwrap_or_else(|| panic!("{zero}: {notes}"));
            let better: i64 = better.split(' ').next().unwrap().parse().unwrap();
            assert!(played(better).0 < 0.5 * bad, "{zero}: {better} is said to be better");
            told += 1;
        }
    }
    assert!(told > 0, "no zero costs");
    for asked in [5000, 14] {
        let run = desk.line(&format!("{line} beckhoff --controller cnc --force --points {asked}")).done().json();
        let text = desk.read("zeros/achskw.lis");
        let entries = text.lines().find_map(|line| line.strip_prefix("kw.ssfk.kw_nr_max ")).unwrap();
        let notes = run["notes"].to_string();
        assert!(notes.contains(&format!("--points {asked}: {entries} entries were written")), "{notes}");
    }
}
