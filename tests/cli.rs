//! The command as a user meets it: what it writes, what it says, how it ends.
//!
//! Every run here is the real program in a folder of its own. Runs that solve anything use the coarse mesh and few
//! points.

use std::fs;

use flexspline_tests::command::{Desk, names};
use serde_json::Value;

/// Columns of `results.csv` that others rely on, in this order.
const COLUMNS: &str = "step,generator_rad,output_rad,error_arcsec,torque_n_m,flank_contacts,generator_contacts,\
                       max_von_mises_mpa,iterations";
/// Fields of `summary.json` that others rely on.
const SUMMARY: [&str; 10] = [
    "generator",
    "torque_n_m",
    "backlash_arcsec",
    "kinematic_error_pp_arcsec",
    "wind_up_arcsec",
    "max_von_mises_mpa",
    "degrees_of_freedom",
    "increments",
    "iterations",
    "wall_s",
];

const SHORT_PATH: &str = "generator_rad,torque_n_m\n0,0\n0.01,0\n0.02,0\n0.02,5\n";

/// A table of a result file: header, then rows of numbers (`true` is 1).
fn table(text: &str) -> (String, Vec<Vec<f64>>) {
    let mut lines = text.lines();
    let header = lines.next().unwrap().to_owned();
    let number = |cell: &str| match cell {
        "true" => 1.0,
        "false" => 0.0,
        _ => cell.parse().unwrap(),
    };
    (header, lines.map(|line| line.split(',').map(number).collect()).collect())
}

#[test]
fn a_run_writes_the_columns_and_fields_that_others_rely_on() {
    let desk = Desk::new();
    desk.write("path.csv", SHORT_PATH);
    let run = desk.line("simulate --generator cam --mesh coarse --path path.csv --json --frames").done();
    assert_eq!(run.stderr, "");
    assert_eq!(names(&desk.path("out")), ["frames", "report.html", "results.csv", "summary.json"]);

    let (header, rows) = table(&desk.read("out/results.csv"));
    assert!(header.starts_with(&format!("{COLUMNS},")), "{header}");
    assert_eq!(rows.len(), 4);
    for (k, row) in rows.iter().enumerate() {
        assert_eq!(row.len(), header.split(',').count());
        assert_eq!(row[0], k as f64);
        // error = output - generator / 95, in arc-seconds
        let error = (row[2] - row[1] / 95.0).to_degrees() * 3600.0;
        assert!((row[3] - error).abs() < 1e-6, "{row:?}");
    }
    assert_eq!(rows.iter().map(|row| row[1]).collect::<Vec<_>>(), [0.0, 0.01, 0.02, 0.02]);
    assert_eq!(rows.iter().map(|row| row[4]).collect::<Vec<_>>(), [0.0, 0.0, 0.0, 5.0]);
    // At no load the output lags by half the clearance, under a forward load it leads.
    assert!(rows[2][3] < -20.0 && rows[3][3] > 20.0, "{rows:?}");
    let pressure = header.split(',').position(|name| name == "peak_flank_pressure_mpa").unwrap();
    assert!(rows[3][5] >= 2.0 && rows[3][pressure] > 1.5 * rows[2][pressure], "{rows:?}");

    let summary: Value = serde_json::from_str(&desk.read("out/summary.json")).unwrap();
    assert_eq!(run.json(), summary, "--json prints what it writes");
    for field in SUMMARY {
        assert!(summary.get(field).is_some(), "no {field}");
    }
    assert_eq!(summary["schema_version"], 1);
    assert!(summary["wall_s"].as_f64().unwrap() > 0.0 && summary["processor_s"].as_f64().unwrap() > 0.0);
    assert_eq!(summary["generator"], "cam");
    assert_eq!(summary["solver"], "fast", "the solver that ran");
    assert_eq!(summary["torque_n_m"], Value::Null, "the load changes along this path");
    assert!(summary["degrees_of_freedom"].as_u64().unwrap() > 30_000);
    let worst = rows.iter().map(|row| row[7]).fold(0.0, f64::max);
    assert_eq!(summary["max_von_mises_mpa"].as_f64().unwrap(), worst);
    let iterations: f64 = rows.iter().map(|row| row[8]).sum();
    assert_eq!(summary["iterations"].as_f64().unwrap(), iterations);
    assert_eq!(summary["drive_hash"].as_str().unwrap().len(), 64);
    assert!(summary["command"].as_str().unwrap().starts_with("flexspline simulate --generator cam"));

    let frames = names(&desk.path("out/frames"));
    assert_eq!(frames.len(), 5);
    let series = desk.read("out/frames/frames.pvd");
    for name in frames.iter().filter(|name| name.ends_with(".vtu")) {
        assert!(series.contains(name.as_str()));
        assert!(desk.read(&format!("out/frames/{name}")).trim_end().ends_with("</VTKFile>"));
    }
}

#[test]
fn a_result_file_is_a_path_that_gives_the_same_result() {
    let desk = Desk::new();
    desk.write("path.csv", SHORT_PATH);
    desk.line("simulate --generator double-disc --mesh coarse --path path.csv --out first -q").done();
    let again = "simulate --generator double-disc --mesh coarse --path first/results.csv --out second -q";
    desk.line(again).done();
    let errors = |name: &str| -> Vec<f64> { table(&desk.read(name)).1.iter().map(|row| row[3]).collect() };
    assert_eq!(errors("first/results.csv"), errors("second/results.csv"));
}

#[test]
fn quiet_is_silent_and_verbose_speaks_on_stderr() {
    let desk = Desk::new();
    desk.write("path.csv", "generator_rad\n0\n");
    let base = "simulate --generator cam --mesh coarse --path path.csv";
    let quiet = desk.line(&format!("{base} -q")).done();
    assert_eq!((quiet.stdout.as_str(), quiet.stderr.as_str()), ("", ""));
    let plain = desk.line(base).done();
    assert!(plain.stdout.contains("largest von Mises stress") && plain.stderr.is_empty());
    let verbose = desk.line(&format!("{base} -v --json")).done();
    assert!(verbose.stderr.contains("deforming"), "{}", verbose.stderr);
    assert!(verbose.json().is_object());
}

#[test]
fn bad_input_is_refused_with_its_place_and_leaves_nothing() {
    let desk = Desk::new();
    desk.write("angle.csv", "angle\n0\n");
    desk.write("short.csv", "generator_rad,torque_n_m\n0,1\n0.1\n");
    desk.write("nan.csv", "# from the bench\ngenerator_rad\n0\nNaN\n");
    desk.write("hot.csv", "generator_rad,temperature_c\n0,20\n0,500\n");
    desk.write("loaded.csv", "generator_rad,torque_n_m\n0,1\n");
    desk.write("empty.csv", "");
    desk.write("wrong.toml", "base = \"HHD-95\"\n[flexspline]\nteeth = 187\n");
    desk.write("broken.toml", "base = \n");
    desk.write("file", "");
    fs::write(desk.path("binary.csv"), [0xff, 0xfe, 0x00]).unwrap();
    let cases: &[(&str, &str)] = &[
        ("", "Usage"),
        ("solve", "unrecognized subcommand 'solve'"),
        ("simulate", "--generator"),
        ("simulate --generator cog", "allowed: two-roller, four-roller, double-disc, cam"),
        ("simulate --generator cam --mesh huge", "allowed are coarse, standard, fine"),
        ("simulate --generator cam --speed 3", "unexpected argument '--speed'"),
        ("simulate --generator cam --solver magic", "reference"),
        ("simulate --generator cam --path absent.csv", "--path: found \"absent.csv\""),
        ("simulate --generator cam --path angle.csv", "angle.csv:1: found columns \"angle\", required: generator_rad"),
        ("simulate --generator cam --path short.csv", "short.csv:3: found 1 fields, allowed: 2"),
        ("simulate --generator cam --path nan.csv", "nan.csv:4: generator_rad: found \"NaN\""),
        (
            "simulate --generator cam --path hot.csv",
            "hot.csv:3: temperature_c: found \"500\", allowed: a number from -60 to 80",
        ),
        ("simulate --generator cam --path empty.csv", "required: generator_rad"),
        ("simulate --generator cam --path binary.csv", "binary.csv"),
        ("simulate --generator cam --path loaded.csv --torque-n-m 3", "give one of the two"),
        ("simulate --generator cam --path loaded.csv --increment 0.01", "increment: found 0.01"),
        ("simulate --generator cam --path paper --direction backward", "--direction"),
        ("simulate --generator cam --path pitch --direction up", "forward, backward"),
        ("simulate --generator cam --torque-n-m much", "'much'"),
        ("simulate --generator cam --torque-n-m NaN", "torque: found NaN, allowed: -100000 to 100000"),
        ("simulate --generator cam --torque-n-m=-inf", "torque: found -inf"),
        ("simulate --generator cam --temperature-c 500", "temperature: found 500, allowed: -60 to 80"),
        ("simulate --generator cam --increment 0", "increment: found 0, allowed: 0.00001 to 0.5"),
        ("simulate --generator cam --increment -0.1", "increment: found -0.1"),
        ("simulate --generator cam --flank-penalty -1", "flank penalty: found -1"),
        ("simulate --generator cam --max-iterations 0", "iterations: found 0"),
        ("simulate --generator cam --set flexspline.teth=188", "did you mean `flexspline.teeth`?"),
        ("simulate --generator cam --set flexspline.teeth", "expected PATH=VALUE"),
        ("simulate --generator cam --set flexspline.width_mm=nan", "flexspline.width_mm: found"),
        ("simulate --generator cam --set flexspline.teeth=190", "circular_spline.teeth: found 190, allowed: 192"),
        ("simulate --generator cam --drive absent.toml", "--drive: found \"absent.toml\""),
        (
            "simulate --generator cam --drive wrong.toml",
            "wrong.toml:3: flexspline.teeth: found 187, allowed: an even number",
        ),
        ("simulate --generator cam --drive broken.toml", "broken.toml:1: not TOML"),
        ("simulate --generator cam --out file/out", "--out: cannot write file/out"),
        ("simulate --generator cam --threads 0", "--threads"),
        ("simulate --generator cam -q -v", "cannot be used with"),
        ("look angle.csv --drive S-95", "--drive: logs say which drive"),
        ("replay --tables cam.fxt angle.csv --set flexspline.teeth=188", "--set: the drive is that of the table"),
        ("calibrate angle.csv --ratio 95 --drive S-95", "--drive: a calibration has the drive of --tables"),
        ("drive --drive HHD-96", "HHD-95, HHD-95-typical"),
        ("export --generator cam", "--format"),
        ("export --generator cam --format stl", "vtu, csv, inp"),
        (
            "export --generator cam --format csv --increments 3",
            "--increments: --format csv has no use for it; allowed with --format inp",
        ),
        (
            "export --generator cam --format vtu --last-torque-n-m 3",
            "--last-torque-n-m: --format vtu has no use for it; allowed with --format inp",
        ),
        (
            "export --generator cam --format inp --generator-rad 0.1",
            "--generator-rad: --format inp has no use for it; allowed with --format vtu",
        ),
        ("export --generator cam --format inp --step-rad 0", "--step-rad: found 0"),
        ("export --generator cam --format inp --last-torque-n-m nan", "--last-torque-n-m: found NaN"),
        ("export --generator cam --format inp --mesh coarse", "output.drag_torque_n_m: found 0.02"),
        (
            "export --generator cam --format csv --generator-rad 1",
            "--generator-rad: --format csv has no use for it; allowed with --format vtu",
        ),
        ("export --generator cam --format vtu --generator-rad inf", "generator angle: found inf"),
    ];
    let before = names(&desk.path("."));
    for (line, expected) in cases {
        desk.refused(line, expected);
        assert!(names(&desk.path("out")).is_empty(), "{line} left {:?}", names(&desk.path("out")));
    }
    assert_eq!(names(&desk.path(".")), before);
}

#[test]
fn a_run_that_does_not_converge_ends_with_1_and_touches_no_file() {
    let desk = Desk::new();
    desk.write("path.csv", "generator_rad\n0\n");
    let base = "simulate --generator cam --mesh coarse --path path.csv --frames --json";
    desk.line(base).done();
    let before = (desk.read("out/results.csv"), desk.read("out/summary.json"), names(&desk.path("out/frames")));
    let run = desk.line(&format!("{base} --max-iterations 2"));
    assert_eq!(run.code, 1, "{}", run.stderr);
    assert_eq!(run.stdout, "");
    assert!(run.stderr.starts_with("error: not solved at generator angle 0.000000 rad"), "{}", run.stderr);
    assert!(!run.stderr.contains("residual"), "{}", run.stderr);
    let told = desk.line(&format!("{base} --max-iterations 2 -v"));
    assert!(told.stderr.contains("relative residual by iteration: "), "{}", told.stderr);
    let after = (desk.read("out/results.csv"), desk.read("out/summary.json"), names(&desk.path("out/frames")));
    assert_eq!(before, after);
    assert_eq!(names(&desk.path("out")), ["frames", "report.html", "results.csv", "summary.json"]);
}

/// A drive of 12 mm under a load for one of 100 mm: how far it came is told, and what it did until then is in a file.
#[test]
#[ignore = "long: tests/run slow"]
fn a_load_beyond_the_last_stable_one_leaves_the_loads_before_it() {
    let desk = Desk::new();
    desk.line("new small.toml --teeth 60 --module 0.2 -q").done();
    let base = "simulate --drive small.toml --generator cam --mesh coarse --path pitch --max-iterations 5";
    let run = desk.line(&format!("{base} --torque-n-m 300"));
    assert_eq!(run.code, 1, "{}", run.stderr);
    assert_eq!(names(&desk.path("out")), ["results.partial.csv"]);
    let (header, rows) = table(&desk.read("out/results.partial.csv"));
    let column = |name: &str| {
        let at = header.split(',').position(|column| column == name).unwrap();
        rows.iter().map(|row| row[at]).collect::<Vec<f64>>()
    };
    let (torque, error) = (column("torque_n_m"), column("error_arcsec"));
    assert!(torque.len() > 3 && torque[0] == 0.0, "{torque:?}");
    assert!(torque.windows(2).all(|pair| pair[0] < pair[1]) && error.windows(2).all(|pair| pair[0] < pair[1]));
    let last = format!("the last equilibrium is at {:.4} N·m", torque[torque.len() - 1]);
    let wound_up = format!("wound up by {:.2} arcsec", error[error.len() - 1]);
    for words in
        [last.as_str(), &wound_up, "finer steps were tried", &format!("wrote the {} rows so far", torque.len())]
    {
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
    // What it bears gives all results, and nothing of the run before is left.
    desk.line(&format!("{base} --torque-n-m 0.1 --no-report")).done();
    assert_eq!(names(&desk.path("out")), ["results.csv", "summary.json"]);
}

/// A drive that converges as well as any other, and is not to be built.
#[test]
#[ignore = "long: tests/run slow"]
fn teeth_that_interfere_and_stress_that_no_steel_bears_are_said() {
    let desk = Desk::new();
    let base = "simulate --generator cam --mesh coarse --path pitch --torque-n-m 20";
    assert_eq!(desk.line(&format!("{base} --json")).done().json()["cautions"].as_array().unwrap().len(), 1);
    let binds = format!("{base} --set circular_spline.profile_shift=2.95");
    let cautions = desk.line(&format!("{binds} --json")).done().json()["cautions"].clone();
    let figures: Vec<&str> = cautions.as_array().unwrap().iter().map(|c| c["figure"].as_str().unwrap()).collect();
    assert_eq!(figures, ["stiffness", "rigid_gap_um", "max_von_mises_mpa"]);
    let text = desk.line(&binds).done().stdout;
    assert!(text.contains("caution: the teeth of the drawing interfere by 8.9 um"), "{text}");
    let tables = "tables --generator cam --mesh coarse --torque-n-m 20 --most-nodes 5 --positions 4 --temperatures-c \
                  20 --set circular_spline.profile_shift=2.95";
    let page = desk.read("out/report.html");
    let run = desk.line(tables).done();
    let said = &run.stdout;
    assert!(said.contains("cam: caution: the teeth of the drawing interfere"), "{said}");
    // The page of another command is kept.
    let kept = desk.read("out/report-simulate.html");
    assert!(kept == page && kept.contains("HHD-95 along a path, with 1 field changed"), "another page is kept");
    assert!(desk.read("out/report.html").contains("class=\"stamp caution\""));
    // A sound drive, in root fillets, on bore and flanks, over three meshes.
    let sound = "tables --generator cam --mesh coarse --torque-n-m 20 --most-nodes 5 --positions 4 --temperatures-c \
                 20 --stress --no-report";
    let stressed = desk.line(&format!("{sound} --json")).done().json()["tables"][0].clone();
    assert_eq!(stressed["stress"].as_array().unwrap().len(), 3, "{stressed}");
    assert!(stressed.get("no_stress").is_none(), "{stressed}");
}

#[test]
fn a_drive_whose_teeth_interfere_ends_with_1_and_says_where() {
    let desk = Desk::new();
    let sound = desk.line("drive --check --json").done().json();
    let generators: Vec<&str> =
        sound["mesh"].as_array().unwrap().iter().map(|m| m["generator"].as_str().unwrap()).collect();
    assert_eq!(generators, ["two-roller", "four-roller", "double-disc", "cam"]);
    let shallow = desk.line("drive --check --set generator.w0_mm=0.45");
    assert_eq!(shallow.code, 1);
    assert!(shallow.stdout.contains("interferes by"), "{}", shallow.stdout);
    assert!(shallow.stderr.contains("teeth interfere with"), "{}", shallow.stderr);
}

#[test]
fn export_writes_what_it_says() {
    let desk = Desk::new();
    let outlines = desk.line("export --format csv --generator two-roller --json").done().json();
    assert_eq!(outlines["written"][0], "out/two-roller-outlines.csv");
    let text = desk.read("out/two-roller-outlines.csv");
    assert!(text.starts_with("part,piece,x_mm,y_mm\nflexspline_tooth,root land,"), "{text:.80}");
    for part in ["circular_spline_space", "generator"] {
        assert!(text.contains(part));
    }
    let mesh = "export --format vtu --generator cam --mesh coarse --generator-rad 0.3 --torque-n-m -5";
    desk.line(mesh).done();
    assert!(desk.read("out/cam.vtu").trim_end().ends_with("</VTKFile>"));
    let deck = "export --format inp --generator cam --mesh coarse --torque-n-m 50 --increments 3 --step-rad -0.02";
    let deck = desk.line(&format!("{deck} --set output.drag_torque_n_m=0 --json")).done().json();
    assert_eq!(deck["written"][0], "out/cam.inp");
    let deck = desk.read("out/cam.inp");
    assert!(deck.starts_with("*HEADING\nHHD-95, cam generator, 50.000 N.m"), "{deck:.80}");
    // Form, bearing, load, and three rotations.
    assert_eq!(deck.matches("*STEP").count(), 6);
    assert!(deck.contains("** step 6: generator at -0.06 rad") && deck.trim_end().ends_with("*END STEP"));
    assert_eq!(names(&desk.path("out")), ["cam.inp", "cam.vtu", "two-roller-outlines.csv"]);
}

#[test]
fn help_and_version_are_no_errors() {
    let desk = Desk::new();
    for line in ["--help", "help", "simulate --help", "drive --help", "export --help", "--version"] {
        let run = desk.line(line).done();
        assert!(!run.stdout.is_empty() && run.stderr.is_empty(), "{line}");
    }
    assert!(desk.line("--version").stdout.starts_with("flexspline "));
}

/// The data sheet of a sweep agrees with the table of the same drive, and a variant that makes no drive has its reason.
#[test]
fn a_sweep_agrees_with_the_table_of_the_same_drive_and_reports_every_variant() {
    let desk = Desk::new();
    let run = desk
        .line(
            "sweep --generator cam --vary generator.w0_mm=0.5,-1 --torque-n-m 200 --keep backlash_arcsec=..100 --json",
        )
        .done();
    let json = run.json();
    assert_eq!(
        (json["converged"].as_u64(), json["refused"].as_u64(), json["meet"].as_u64()),
        (Some(1), Some(1), Some(1))
    );
    let written = ["plan.csv", "plan.json", "report.html", "results", "sweep.csv", "sweep.json"];
    assert_eq!(names(&desk.path("out")), written);
    let rows = desk.read("out/sweep.csv");
    assert!(rows.contains(",200,converged,true,true,"), "{rows}");
    assert!(rows.starts_with("variant,generator,generator.w0_mm,t1_n_m,"), "{rows}");
    assert_eq!(rows.lines().count(), 3);
    assert!(rows.lines().last().unwrap().contains("refused") && rows.matches("generator.w0_mm").count() > 1, "{rows}");
    let cells: Vec<&str> = rows.lines().nth(1).unwrap().split(',').collect();
    let sheet = |name: &str| -> f64 {
        cells[rows.lines().next().unwrap().split(',').position(|column| column == name).unwrap()].parse().unwrap()
    };

    let tables = desk.line("tables --generator cam --mesh coarse --no-report --json --out tables").done().json();
    let stiffness = &tables["tables"][0]["stiffness"];
    for name in ["k1_n_m_per_rad", "k2_n_m_per_rad", "k3_n_m_per_rad"] {
        let (sheet, table) = (sheet(name), stiffness[name].as_f64().unwrap());
        // One place of the generator there, the mean of a pitch and of both directions here.
        assert!((sheet / table - 1.0).abs() < 0.04, "{name}: {sheet} in the sweep, {table} of the table");
    }
    let backlash = tables["tables"][0]["backlash_arcsec"].as_f64().unwrap();
    assert!((sheet("backlash_arcsec") - backlash).abs() < 0.5);

    for (wrong, due) in [
        ("sweep --vary generator.w0=0.5", "did you mean `generator.w0_mm`?"),
        ("sweep --vary generator.w0_mm=0.5..x", "allowed: PATH=FROM..TO"),
        ("sweep --vary generator.w0_mm=0.5 --keep backlash=..3", "did you mean `backlash_arcsec`?"),
        ("sweep --vary generator.w0_mm=0.5 --least stress", "max_von_mises_mpa"),
        ("sweep --vary generator.w0_mm=0.5 --torque-n-m -3", "allowed: above 0"),
        ("new own.toml --teeth 200 --module -0.32", "--module: found -0.32, allowed"),
        ("sweep --vary generator.w0_mm=0.5,0.49,0.50", "found the value 0.50 twice"),
        ("sweep --vary generator.w0_mm=0.5..0.5", "found the value 0.5 twice"),
        ("sweep --vary generator.w0_mm=0.5 --least bore_mpa --most bore_mpa", "found bore_mpa twice"),
        ("sweep --vary generator.w0_mm=0.5 --tolerances t.toml --draws 9", "cannot be used with"),
        ("sweep", "--vary <PATH=VALUES>"),
    ] {
        desk.refused(&format!("{wrong} --out nothing"), due);
        assert!(!desk.path("nothing").exists());
    }
}
