//! The playback of a table: its CSV, what the scripts of examples/playback make of it for other controllers, and its
//! image for cFS and F Prime. Each file is read here by a parser of its own and looked up forward from the command or
//! through time, where the program goes backward from the generator.
//!
//! The unit: HHD-95 with the cam by its table of contact FEM, with a pitch error, two eccentricities and wider
//! clearance, calibrated under 12 N·m from one log and judged on another. Nothing here was tried on hardware.
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

/// The result of a format, for the load of the unit; the files are in the folder `out`.
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

/// No curve over the generator's turn, one for these directions and all turns of it, leaves less: the scatter about the
/// mean in each of 512 parts of that turn, arcsec.
fn least_by_generator(directions: &[Direction]) -> f64 {
    let table = Table::check(&UNIT.image).unwrap();
    let mut parts = vec![Vec::new(); 512];
    for direction in directions {
        for k in 0..POINTS {
            let led = TAU * f64::from(k) / f64::from(POINTS);
            let part = ((led * RATIO / TAU).fract() * 512.0) as usize;
            parts[part].push(error(&table, led, *direction));
        }
    }
    let squares = parts.iter().map(|part| rms(part).powi(2) * part.len() as f64).sum::<f64>();
    (squares / (directions.len() as f64 * f64::from(POINTS))).sqrt()
}

/// The program's figure is the one found here.
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
}

/// The columns of a playback.csv after the two angles, in rad, and the angles.
struct Columns {
    angles: Vec<[f64; 2]>,
    names: Vec<String>,
    corrections: Vec<Vec<f64>>,
}

impl Columns {
    fn read(file: &str) -> Columns {
        let text = UNIT.desk.read(file);
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let names: Vec<String> = lines.next().unwrap().split(',').map(str::to_owned).collect();
        assert_eq!(names[..2], ["output_rad", "generator_rad"]);
        let rows: Vec<Vec<f64>> =
            lines.map(|line| line.split(',').map(|word| word.parse().unwrap()).collect()).collect();
        let column = |k: usize| rows.iter().map(|row| row[k] / ARCSEC).collect();
        Columns {
            angles: rows.iter().map(|row| [row[0], row[1]]).collect(),
            corrections: (2..names.len()).map(column).collect(),
            names: names[2..].to_vec(),
        }
    }

    /// Linear between rows, around the turn.
    fn at(&self, column: usize, output_rad: f64) -> f64 {
        let values = &self.corrections[column];
        let at = output_rad.rem_euclid(TAU) / TAU * values.len() as f64;
        let (low, high) = (at as usize % values.len(), (at as usize + 1) % values.len());
        values[low] + (values[high] - values[low]) * at.fract()
    }

    /// Mean of both directions.
    fn both(&self, output_rad: f64) -> f64 {
        0.5 * (self.at(0, output_rad) + self.at(1, output_rad))
    }
}

fn side(direction: Direction) -> usize {
    usize::from(direction == Direction::Backward)
}

#[test]
fn the_csv_leaves_what_is_said_in_each_direction() {
    let turn = [0.0, TAU];
    let said = export("csv", "both");
    let csv = Columns::read("both/playback.csv");
    // As many to a generator turn as the table has nodes: 8 to each of 188 pitches.
    let points = 8 * 188;
    assert_eq!((csv.angles.len(), csv.names.join(",").as_str()), (points * 95, "forward_arcsec,backward_arcsec"));
    assert!(csv.angles.iter().all(|[output, generator]| (generator - RATIO * output).abs() < 1e-6));
    let left = |sign: f64, late: f64| {
        left_by_position(turn, &BOTH, |asked, direction| sign * csv.at(side(direction), asked + late))
    };
    same("both", &said, left(1.0, 0.0), 0.02);
    helps("both", &said, 1.0);
    let (right, half) = (number(&said, "/model/rms_played_arcsec"), 0.5 * TAU / (points as f64 * RATIO));
    assert!(left(-1.0, 0.0) > 20.0 * right && left(1.0, half) > 2.0 * right, "{right}");
    for (option, name, direction) in
        [("+", "forward_arcsec", Direction::Forward), ("-", "backward_arcsec", Direction::Backward)]
    {
        let said = export(&format!("csv --points-per-turn 16 --direction {option}"), name);
        let csv = Columns::read(&format!("{name}/playback.csv"));
        assert_eq!((csv.angles.len(), csv.names), (16 * 95, vec![name.to_owned()]));
        let csv = Columns::read(&format!("{name}/playback.csv"));
        same(name, &said, left_by_position(turn, &[direction], |asked, _| csv.at(0, asked)), 0.02);
        helps(name, &said, 1.3);
        let rows = number(&said, "/playback/rows");
        assert!((3900.0..4000.0).contains(&rows), "those of one direction: {rows}");
    }
    // Of a table of a tooth's ripple alone the points that are usual leave a part.
    let fem = "export --format csv --tables cam.fxt --torque-n-m 12 --temperature-c 20 --out fem --json";
    let fem = UNIT.desk.line(fem).done().json();
    let [uncorrected, played] =
        ["uncorrected", "played"].map(|name| number(&fem, &format!("/model/rms_{name}_arcsec")));
    assert!(played < 0.1 * uncorrected && uncorrected > 0.1, "{played} of {uncorrected}");
    // The mean of the table at its load, as it is found here.
    let table = Table::check(&UNIT.image).unwrap();
    let led = |k: u32| TAU * f64::from(k) / f64::from(POINTS);
    let both = BOTH.map(|direction| (0..POINTS).map(|k| error(&table, led(k), direction)).sum::<f64>());
    let mean = (both[0] + both[1]) / f64::from(2 * POINTS) * ARCSEC;
    let left_out = number(&said, "/model/mean_left_out_arcsec");
    assert!((left_out - mean).abs() < 0.01 * mean.abs() && mean.abs() > 1.0, "{left_out}, {mean}");
}

/// A script of examples/playback, run.
fn ran(name: &str, arguments: &str) -> std::process::Output {
    let script = format!("{}/../examples/playback/{name}.py", env!("CARGO_MANIFEST_DIR"));
    let words = arguments.split(' ').filter(|word| !word.is_empty());
    Command::new("python3").arg("-B").arg(script).args(words).current_dir(UNIT.desk.path(".")).output().unwrap()
}

/// Output of a script of examples/playback.
fn script(name: &str, arguments: &str) -> String {
    let run = ran(name, arguments);
    assert!(run.status.success(), "{name} {arguments}: {}", String::from_utf8_lossy(&run.stderr));
    String::from_utf8(run.stdout).unwrap()
}

/// Rms of a residual over time, about the straight line that fits it best.
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

/// The numbers after a name, as `Name := 1.5`.
fn named(text: &str, name: &str) -> Vec<f64> {
    let name = format!("{name} := ");
    let after = text.split(&name).skip(1);
    after.map(|rest| rest.split([',', ')', ';']).next().unwrap().parse().unwrap()).collect()
}

/// Every script's file holds the correction of the CSV as its controller plays it, within the controller's limits.
#[test]
fn scripts_make_the_csv_what_controllers_play() {
    if Command::new("python3").arg("--version").output().is_err() {
        println!("there is no python3 here: not tested");
        return;
    }
    for (folder, direction) in [("csv", "both"), ("plus", "+"), ("minus", "-")] {
        export(&format!("csv --points-per-turn 64 --direction {direction}"), folder);
    }
    let csv = Columns::read("csv/playback.csv");
    let close = |what: &str, found: f64, wanted: f64, arcsec: f64| {
        assert!((found - wanted).abs() * ARCSEC < arcsec, "{what}: {found}, wanted {wanted}");
    };

    // LinuxCNC: the loader stops at the first line that is no triplet, and takes 256.
    let text = script("linuxcnc", "csv/playback.csv -3 17");
    let row = |line: &str| line.split(' ').map_while(|word| word.parse().ok()).collect::<Vec<f64>>();
    let triplets: Vec<Vec<f64>> = text.lines().map(row).take_while(|row| row.len() == 3).collect();
    assert!(triplets.len() == 256 && triplets[0][0] == -3.0 && (triplets[255][0] - 17.0).abs() < 1e-8);
    for pair in triplets.windows(2) {
        for (column, share) in [(0, 0.0), (0, 0.5), (1, 0.0), (1, 0.5)] {
            let between = |k: usize| pair[0][k] + share * (pair[1][k] - pair[0][k]);
            let wanted = csv.at(column, between(0).to_radians());
            close("linuxcnc", between(column + 1).to_radians(), wanted, 0.4);
        }
    }

    // TwinCAT NC: equidistant over a turn, the mean of both directions, the last entry that of the first.
    let text = script("beckhoff", "csv/playback.csv");
    let [positions, values] = ["(Position", " Compensation"].map(|name| named(&text, name));
    assert!(positions.len() == 64 * 95 + 1 && named(&text, "NoOfTableElements") == [positions.len() as f64]);
    assert!(positions[positions.len() - 1] == 360.0 && values[0] == values[values.len() - 1]);
    for (position, value) in positions.iter().zip(&values) {
        close("nc", value.to_radians(), csv.both(position.to_radians()), 1e-3);
    }

    // TwinCAT CNC: errors in 0.0001 degrees, fewer than 1500 entries, a column for each direction.
    let text = script("beckhoff_cnc", "csv/playback.csv");
    let lines = text.lines().filter(|line| !line.starts_with('#')).map(|line| line.split_once(' ').unwrap());
    let list: BTreeMap<&str, i64> = lines.map(|(name, value)| (name, value.parse().unwrap())).collect();
    let get = |name: &str| list[format!("kw.ssfk.{name}").as_str()];
    let entries = get("kw_nr_max");
    assert!(get("unit") == 1 && get("bilateral") == 1 && get("modulo") == 1 && entries < 1500);
    assert_eq!((get("interval") * (entries - 1), list.len() as i64), (3_600_000, 6 + 2 * entries));
    for (column, name) in ["pos", "neg"].into_iter().enumerate() {
        for k in 0..entries {
            let place = (k * get("interval")) as f64 * 1e-4;
            let added = -(get(&format!("table[{k}].{name}")) as f64 * 1e-4).to_radians();
            close("cnc", added, csv.at(column, place.to_radians()), 0.19);
        }
    }

    moteus(&script("moteus", "csv/playback.csv 1"));
    for (folder, direction) in [("plus", Direction::Forward), ("minus", Direction::Backward)] {
        onstepx(&script("onstepx", &format!("{folder}/playback.csv 12800")), direction);
        eqmod(&script("eqmod", &format!("{folder}/playback.csv")), direction);
    }

    // ODrive: set points of the motion, in motor turns.
    let text = script("odrive", "csv/playback.csv 0 10 -10 0.25");
    let turns: Vec<f64> = text.lines().map(|line| line.strip_prefix("p 0 ").unwrap().parse().unwrap()).collect();
    assert_eq!(turns.len(), 81);
    for (k, turns) in turns.iter().enumerate() {
        let asked = (10.0 - 0.25 * k as f64).to_radians();
        close("odrive", turns / RATIO * TAU - asked, csv.at(1, asked), 1e-3);
    }

    let xml = script("ros2", "csv/playback.csv");
    assert!(xml.contains("<mechanical_reduction>95</mechanical_reduction>") && xml.contains("<offset>"), "{xml}");

    // A file that was cut, and a wrong argument, end in one line.
    let whole = UNIT.desk.read("csv/playback.csv");
    let lines: Vec<&str> = whole.split_inclusive('\n').collect();
    UNIT.desk.write("cut.csv", &whole[..whole.len() / 2]);
    UNIT.desk.write("half.csv", &lines[..3000].concat());
    UNIT.desk.write("lost.csv", &[&lines[..99], &lines[100..]].concat().concat());
    for (name, arguments, due) in [
        ("ros2", "cut.csv", "the line was cut off"),
        ("beckhoff_cnc", "half.csv", "half.csv:3000: the last angle is "),
        ("moteus", "lost.csv", "lost.csv:100: found "),
        ("ros2", "absent.csv", "absent.csv: "),
        ("beckhoff", "", "found 0 arguments; allowed: python3 beckhoff.py playback.csv"),
        ("linuxcnc", "csv/playback.csv a 2", "found 'a'; allowed: a number"),
        ("linuxcnc", "plus/playback.csv 0 2", "plus/playback.csv:6: a triplet has both directions"),
        ("onstepx", "plus/playback.csv", "found 1 arguments"),
        ("eqmod", "plus/playback.csv 0", "found 0.0 steps"),
        ("odrive", "csv/playback.csv 0 1 2 inf", "found 'inf'"),
    ] {
        let run = ran(name, arguments);
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(run.status.code() == Some(2) && said.contains(due), "{name} {arguments}: {said}");
        assert!(said.starts_with("error: ") && said.lines().count() == 1 && run.stdout.is_empty(), "{said}");
    }
}

/// 256 bytes over a turn of the encoder on the generator, at the left edges; what the loop believes is the reading with
/// the correction.
fn moteus(text: &str) {
    let value = |name: String| {
        let start = format!("conf set motor_position.sources.1.compensation_{name} ");
        let lines: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix(start.as_str())).collect();
        assert_eq!(lines.len(), 1, "{name}");
        lines[0].to_owned()
    };
    let scale: f32 = value("scale".to_owned()).parse().unwrap();
    let bytes: Vec<i8> = (0..256).map(|k| value(format!("table.{k}")).parse().unwrap()).collect();
    assert!(text.lines().count() == 257 && (bytes.contains(&127) || bytes.contains(&-127)));
    let table = Table::check(&UNIT.image).unwrap();
    let left = |shift: f32, sign: f32| {
        let mut left = Vec::new();
        for direction in BOTH {
            for k in 0..POINTS {
                let led = TAU * f64::from(k) / f64::from(POINTS);
                let count = ((led * RATIO / TAU).fract() * 16_384.0).floor() as f32;
                let place = (count / 16_384.0 * 256.0 + shift).rem_euclid(256.0);
                let (low, share) = (place as usize % 256, place.fract());
                let [low, high] = [low, (low + 1) % 256].map(|at| f32::from(bytes[at]) * (scale / 127.0));
                let believed = f64::from(sign * (low + (high - low) * share));
                left.push(error(&table, led, direction) - believed / RATIO * TAU);
            }
        }
        rms(&left)
    };
    let [right, late, early, wrong] =
        [(0.0, 1.0), (0.5, 1.0), (-0.5, 1.0), (0.0, -1.0)].map(|(at, sign)| left(at, sign));
    let least = least_by_generator(&BOTH);
    let beyond = |left: f64| left.powi(2) - least.powi(2);
    let all = [least, right, late, early, wrong];
    assert!(right < 1.01 * least && wrong > 5.0 * right, "{all:?}");
    assert!(beyond(late) > 2.0 * beyond(right) && beyond(early) > 2.0 * beyond(right), "{all:?}");
}

/// The loop of the controller, every 10 ms of an output turn of sidereal seconds; a second plays the entry before its
/// own.
fn onstepx(text: &str, direction: Direction) {
    const STEPS_PER_DEGREE: f64 = 12_800.0;
    let table = Table::check(&UNIT.image).unwrap();
    let rate = STEPS_PER_DEGREE / 240.0;
    let worm = (STEPS_PER_DEGREE * 360.0 / RATIO).round();
    let size = (worm / rate).round() as usize;
    let mut buffer = vec![0i32; size];
    let commands: Vec<&str> = text.lines().map(|line| line.strip_suffix('#').unwrap()).collect();
    assert!(commands[0] == ":$QZZ" && commands[size + 1] == ":$QZ!" && commands.len() == size + 2);
    for command in &commands[1..=size] {
        let (entry, steps) = command.strip_prefix(":WR").unwrap().split_once(',').unwrap();
        buffer[entry.parse::<usize>().unwrap()] = steps.parse::<i8>().unwrap().into();
    }
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
                let led = motor / (STEPS_PER_DEGREE * 360.0) * TAU;
                let tracked = f64::from(poll) / 8_640_000.0 * TAU;
                let sign = f64::from(direction.sign());
                left.push(led - tracked + sign * error(&table, sign * led, direction));
            }
            motor += (rate + added) / 100.0;
        }
        left_in_time(left)
    };
    let right = left(1);
    let all = [least_by_generator(&[direction]), right, left(0), left(2)];
    assert!(right < 1.05 * all[0] && right < all[2] && right < all[3], "{all:?}");
}

/// Rates of EQMOD: differences of the error, that over the seam the mean of its neighbours, without their mean, as
/// dividers with the remainder carried on; once a second, wherever in its second the first tick lies.
fn eqmod(text: &str, direction: Direction) {
    const SIDEREAL: f64 = 15.041_067;
    let table = Table::check(&UNIT.image).unwrap();
    assert!(text.starts_with('#'), "the first line is skipped");
    let header = |name: &str| -> f64 {
        text.lines().find_map(|line| line.strip_prefix(name)).unwrap().trim_start_matches('=').parse().unwrap()
    };
    let (period, worm) = (header("!WormPeriod") as usize, header("!StepsPerWorm"));
    let rows = text.lines().filter(|line| !line.starts_with(['#', '!']));
    let rows: Vec<Vec<f64>> = rows.map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect()).collect();
    assert!(period == 907 && rows.len() == period && worm == (9_024_000.0 / RATIO).round());
    let steps_a_second = SIDEREAL * 9_024_000.0 / 1_296_000.0;
    let whole = |(k, row): (usize, &Vec<f64>)| row[0] == k as f64 && (row[1] - steps_a_second * k as f64).abs() <= 1.0;
    assert!(rows.iter().enumerate().all(whole));
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
    let mut all = 0.0;
    for phase in [0.1, 0.3, 0.5, 0.7, 0.9] {
        let mut led = -SIDEREAL * phase;
        let (start, mut left, mut index) = (led, Vec::new(), 0);
        for tick in 0..period * 94 {
            if tick % period == 0 {
                let place = (led / 1_296_000.0 * 9_024_000.0).rem_euclid(worm) / worm * period as f64;
                index = place.ceil() as usize % period;
            }
            let sign = f64::from(direction.sign());
            let tracked = start + SIDEREAL * tick as f64;
            left.push((led - tracked) / ARCSEC + sign * error(&table, sign * led / ARCSEC, direction));
            led += SIDEREAL + rates[index];
            index = (index + 1) % period;
        }
        all += left_in_time(left).powi(2) / 5.0;
    }
    let least = least_by_generator(&[direction]);
    assert!(all.sqrt() < 1.05 * least, "{}, the best curve {least}", all.sqrt());
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

    let said = export("fprime --component Ref.joint", "fprime");
    let json: Value = serde_json::from_str(&UNIT.desk.read("fprime/flexspline_prm.json")).unwrap();
    let parts = json["Ref.joint"].as_object().unwrap();
    let mut bytes = Vec::new();
    for k in 0..parts.len() {
        let part = parts[&format!("FLEXSPLINE_{k}")].as_array().unwrap();
        assert_eq!(part.len(), 500);
        bytes.extend(part.iter().map(|byte| u8::try_from(byte.as_u64().unwrap()).unwrap()));
    }
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    assert!(
        bytes[..length] == UNIT.image && bytes[length..].iter().all(|byte| *byte == 0) && bytes.len() - length < 500
    );
    assert!(UNIT.desk.read("fprime/flexspline.fpp").contains("array FlexsplinePart = [500] U8"));
    assert_eq!(number(&said, "/playback/rms_played_arcsec"), core);
}

#[test]
fn options_that_do_not_fit_and_old_formats_are_refused() {
    let desk = &UNIT.desk;
    let unit = "--tables cal/calibrated.fxt --torque-n-m 12 --out refused";
    for (line, reasons) in [
        (format!("{unit} --format linuxcnc"), &["--format csv", "examples/playback/linuxcnc.py"][..]),
        (format!("{unit} --format odrive"), &["--format csv", "examples/playback/odrive.py"]),
        (format!("{unit} --format csv --points-per-turn 7"), &["--points-per-turn", "8..=4096"]),
        (format!("{unit} --format csv --direction backward"), &["--direction"]),
        (format!("{unit} --format csv --component A.b"), &["--component", "fprime"]),
        (format!("{unit} --format csv --generator-rad 1"), &["--generator-rad", "--tables"]),
        (format!("{unit} --format csv --mesh coarse"), &["--mesh", "--tables"]),
        (format!("{unit} --format vtu --generator cam"), &["--tables"]),
        (format!("{unit} --format fmu"), &["--torque-n-m"]),
        ("--format csv --generator cam --direction +".to_owned(), &["--direction", "csv of a table"]),
        ("--format csv".to_owned(), &["generator"]),
        ("--format cfs".to_owned(), &["--tables"]),
        ("--tables cal/calibrated.fxt --format csv --torque-n-m 1e4".to_owned(), &["--torque-n-m", "10000"]),
        (format!("{unit} --format cfs --table-name TABLE"), &["APP.TABLE"]),
        (format!("{unit} --format csv --columns generator=#1:rad"), &["--data"]),
        (format!("{unit} --format csv --rate 10"), &["--data"]),
    ] {
        let said = desk.refused(&format!("export {line}"), reasons[0]);
        assert!(reasons.iter().all(|reason| said.contains(reason)), "{line}: {reasons:?} in {said}");
    }
    assert!(!desk.path("refused").exists(), "nothing is written");
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
            "export --format csv --tables cal/calibrated.fxt --torque-n-m {LOAD_N_M} --temperature-c 20 --data \
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
        for reason in
            ["the unit's data", "more than 70 %", "in the core it is", "do not belong to this table", "--force"]
        {
            assert!(run.stderr.contains(reason), "{data}: no {reason} in {}", run.stderr);
        }
        let forced = export(data, "--force", &format!("forced_{data}")).done().json();
        assert!(forced["notes"].to_string().contains("written by --force: the unit's data"), "{forced}");
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
    // A handful of rows judges nothing.
    desk.write("few.csv", &changed("run/data.csv", 7, |_, _| {}));
    let few = export("few.csv", "", "worse");
    assert!(
        few.code == 2 && few.stderr.contains("found 7 rows") && few.stderr.contains("at least 32"),
        "{}",
        few.stderr
    );
    assert!(!desk.path("worse").exists(), "nothing is written");
    // Rows beyond the table are counted.
    desk.write(
        "heavy.csv",
        &changed("run/data.csv", usize::MAX, |column, value| {
            if column == "torque_n_m" {
                *value = 5000.0;
            }
        }),
    );
    let notes = export("heavy.csv", "--force", "heavy").done().json()["notes"].to_string();
    assert!(notes.contains("7959 of 7959 rows lie beyond the loads or temperatures of the table"), "{notes}");
}

#[test]
fn a_foreign_file_stays_and_the_program_writes_over_its_own() {
    let desk = &UNIT.desk;
    for (format, file, foreign) in [
        ("csv", "playback.csv", "output_rad,mine\n0,1\n"),
        ("fprime", "flexspline_prm.json", "{}\n"),
        ("csv", "playback.json", "{}\n"),
    ] {
        let out = format!("kept_{file}");
        let line = format!("export --tables cal/calibrated.fxt --torque-n-m {LOAD_N_M} --out {out} --format {format}");
        std::fs::create_dir(desk.path(&out)).unwrap();
        desk.write(&format!("{out}/{file}"), foreign);
        assert!(desk.refused(&line, "--force").contains(file), "{format}");
        assert_eq!(desk.read(&format!("{out}/{file}")), foreign);
        desk.line(&format!("{line} --force")).done();
        // Of its own, for another load.
        desk.line(&format!("{line} --temperature-c 20")).done();
    }
}
