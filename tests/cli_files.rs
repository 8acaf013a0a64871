//! Files to start from, suggestions, and `--json` of every command.

use std::fs;

use flexspline_tests::command::{Desk, Output, names, samples};

/// The commands that a result says to type next.
fn next(run: &Output) -> Vec<&str> {
    run.stdout.lines().filter_map(|line| line.strip_prefix("next: flexspline ")).collect()
}

#[test]
fn a_new_drive_file_is_the_drive_it_was_made_from_and_is_not_lost() {
    let desk = Desk::new();
    let hash = |line: &str| desk.line(line).done().json()["drive_hash"].as_str().unwrap().to_owned();
    for (made, same) in [
        ("new a.toml", "--drive HHD-95"),
        ("new b.toml --drive HHD-95-typical", "--drive HHD-95-typical"),
        (
            "new c.toml --drive HHD-95-typical --set generator.w0_mm=0.49",
            "--drive HHD-95-typical --set generator.w0_mm=0.49",
        ),
        ("new d.toml --drive c.toml", "--drive c.toml"),
    ] {
        let file = made.split(' ').nth(1).unwrap();
        let made_hash = hash(&format!("{made} --json"));
        assert_eq!(hash(&format!("drive --drive {file} --json")), made_hash, "{made}");
        assert_eq!(hash(&format!("drive {same} --json")), made_hash, "{made}");
        // It says of each field what it is and what is allowed: a range, or words.
        let text = desk.read(file);
        let shown = desk.line(&format!("drive --drive {file}")).done().stdout;
        let sheet = text.strip_prefix(shown.as_str()).expect("the drive as `drive` shows it");
        // Behind it what a catalogue may state, to be filled in.
        assert!(
            sheet.contains("[data_sheet]") && sheet.lines().all(|line| line.is_empty() || line.starts_with('#')),
            "{sheet}"
        );
        let numbers = text.lines().filter(|line| line.contains(" = ") && !line.starts_with(['#', ' ']));
        // The comment of a list stands behind its last line.
        for line in numbers.filter(|line| !line.starts_with("name") && !line.ends_with('[')) {
            assert!(line.contains(" # ") && (line.contains(" to ") || line.contains("\", \"")), "{line}");
        }
    }
    desk.write("mine.toml", "my own work");
    let refused = desk.line("new mine.toml");
    assert_eq!(refused.code, 2);
    assert_eq!(refused.stderr, "error: mine.toml: is there already; give another name, or --force to replace it\n");
    assert_eq!(desk.read("mine.toml"), "my own work");
    let run = desk.line("new mine.toml --force").done();
    assert!(run.stdout.starts_with("wrote mine.toml"), "{}", run.stdout);
    assert_eq!(next(&run), ["drive --check --drive mine.toml", "tables --drive mine.toml"]);
    assert_eq!(next(&desk.line(next(&run)[0]).done()), ["tables --drive mine.toml"]);
    for (line, said) in [
        ("new out.d/x.toml", "out.d/x.toml: there is no folder out.d"),
        ("new x.svg", "x.svg: is where the sketch goes"),
        ("new .", ".: is a folder"),
        ("new x.toml --drive HHD-9", "--drive: found \"HHD-9\""),
        ("new x.toml --set flanks.friction_coefficent=0.1", "did you mean `flanks.friction_coefficient`?"),
        ("new", "FILE"),
    ] {
        desk.refused(line, said);
    }
    let pair = |name: &str| [format!("{name}.svg"), format!("{name}.toml")];
    assert_eq!(names(&desk.path(".")), ["a", "b", "c", "d", "mine"].map(pair).concat());
}

#[test]
#[ignore = "long: tests/run slow"]
fn a_drive_from_a_few_numbers_clears_its_teeth_and_says_how_it_was_made() {
    let desk = Desk::new();
    for (line, teeth, module_mm) in [
        ("--teeth 200 --module 0.32 --ratio 100 --bore 62 --generator cam", 200.0, 0.32),
        ("--ratio 101 --module 0.32", 202.0, 0.32),
        ("--like CSF-25-100 --set flexspline.rim_thickness_mm=0.7", 200.0, 0.3175),
        ("--teeth 60 --module 1 --generator double-disc", 60.0, 1.0),
    ] {
        let made = desk.line(&format!("new own.toml --force {line}")).done().stdout;
        // The rated torque of a CSF is not at hand.
        assert_eq!(made.contains("to be filled in: rated_torque_n_m"), line.contains("CSF"), "{line}: {made}");
        let checked = desk.line("drive --check --drive own.toml --json").done().json();
        let wheel = &checked["drive"]["flexspline"];
        assert_eq!(wheel["teeth"].as_f64(), Some(teeth), "{line}");
        assert_eq!(wheel["module_mm"].as_f64(), Some(module_mm), "{line}");
        let text = desk.read("own.toml");
        assert!(text.contains("+ 1.75 modules\nroot_radius_mm"), "{line}: {text}");
        assert!(text.contains("arcmin with the"), "{line}: {text}");
        // The rim follows from the bore, or from the radius, or was set.
        let rim_mm = wheel["rim_thickness_mm"].as_f64().unwrap();
        let bore = line.contains("--bore");
        assert_eq!(text.contains("half the bore of 62\nrim_thickness_mm"), bore, "{line}");
        assert!(!bore || (wheel["root_radius_mm"].as_f64().unwrap() - rim_mm - 31.0).abs() < 1e-3, "{line}");
        assert_eq!(text.contains("as HHD-95\nrim_thickness_mm"), !bore && !line.contains("--set"), "{line}");
    }
    // A size that is at hand brings its data sheet; cup and balls are guessed.
    let made = desk.line("new like.toml --like CSG-25-80 --json").done().json();
    assert_eq!(made["data_sheet"]["k2_n_m_per_rad"], 50e3);
    assert!(made["caution"].is_null() && desk.read("like.toml").contains("\nkind = \"cup\""), "{made}");
    assert_eq!(made["teeth"]["clear"].as_array().unwrap().len(), 4);
    assert!(desk.read("like.toml").contains("\nratcheting_torque_n_m = 880.0\n"), "{}", desk.read("like.toml"));
    // The share of the empirical term goes with its table.
    let short = "--mesh coarse --temperatures-c=20 --positions 4 --most-nodes 5 --torque-n-m 30 --no-report --out like";
    desk.line(&format!("tables --generator cam --drive like.toml {short}")).done();
    let info = desk.read("like/cam.json");
    let flown = desk.line("fly camera --tables like/cam.fxt --no-report --out like --json").done().json();
    let percent = flown["empirical_percent"].as_f64().unwrap();
    assert!((30.0..60.0).contains(&percent) && info.contains(&format!(" {percent} % are empirical")), "{percent}");
    // What was set is not guessed.
    let own = "new wide.toml --like CSG-25-80 --bore 62.4 --no-run --set flexspline.width_mm=40 --set \
               generator.bearing_stiffness_n_per_mm3=5000";
    desk.line(own).done();
    let wide = desk.line("drive --drive wide.toml --json").done().json()["drive"].clone();
    assert_eq!((&wide["flexspline"]["width_mm"], &wide["sleeve"]["kind"]), (&40.0.into(), &"cup".into()));
    assert_eq!(wide["generator"]["bearing_stiffness_n_per_mm3"], 5000.0);
    assert_eq!(wide["output"]["contact_compliance"], 5.8);
    assert!(desk.read("wide.toml").contains("half the bore of 62.4"));
    // The plane drive says how stiff it is; a ratio between 50 and 80 has nobody's figures.
    let plane = desk.line("new plane.toml --like CSF-25-60 --plane --json").done().json();
    assert!(plane["caution"]["words"].as_str().unwrap().contains("5 to 8 times") && plane["data_sheet"].is_null());
    // Teeth that bind name the number that lets them clear.
    let binds = "new steep.toml --force --teeth 200 --module 0.3 --no-run --json --set \
                 flexspline.pressure_angle_deg=15,circular_spline.pressure_angle_deg=15";
    let clears_with = desk.line(binds).done().json()["clears_with"].as_str().unwrap().to_owned();
    let mended = desk.line(&format!("{binds},{clears_with}")).done().json();
    assert!(mended["teeth"]["clear"].as_array().unwrap().len() == 4 && mended["clears_with"].is_null(), "{mended}");
    // S-shaped teeth are drawn for the cam.
    let s = desk.line("new s.toml --like CSG-25-80 --set flexspline.profile=s --json").done().json();
    assert_eq!(s["teeth"]["clear"], serde_json::json!(["cam"]));
    assert!(s["teeth"]["interfere_um"]["double-disc"].as_f64().unwrap() > 0.5, "{s}");
    assert!(s["next"][0].as_str().unwrap().ends_with("--generator cam"), "{s}");

    // It can be solved, and its load is that of its size.
    desk.line("tables --generator cam --mesh coarse --temperatures-c=20 --positions 4 --most-nodes 8 --drive own.toml")
        .done();
    for (line, said) in [
        ("--teeth 200 --module 0.32 --ratio 90", "--ratio: found 90, allowed: 100 (circular spline held) or 101"),
        ("--teeth 201 --module 0.32", "--teeth: found 201, allowed: an even number"),
        ("--module 0.32", "--module: found alone"),
        ("--like CSF25", "--like: found \"CSF25\""),
        ("--like CSX-25-100", "did you mean `CSF`?"),
        ("--like CSF-25-100 --ratio 80", "--ratio: found 80.0, allowed: 100, as CSF-25-100 has it"),
        (
            "--teeth 160 --module 0.3 --generator double-disc --set flexspline.profile=s",
            "--generator: found double-disc",
        ),
        ("--teeth 60 --module 1 --set flexspline.profile=s", "S-shaped teeth have no room in this drive of 60 teeth"),
        ("--bore 62", "add --module and --teeth or --ratio, or --like"),
        ("--teeth 200 --module 0.32 --bore 66", "--bore: found 66: the root circle has the diameter 65.12"),
        ("--teeth 200 --module 0.32 --drive HHD-95-typical", "--drive: found it beside --teeth"),
    ] {
        desk.refused(&format!("new other.toml {line}"), said);
    }
    assert!(!desk.path("other.toml").exists());
}

#[test]
fn a_new_catalogue_model_is_read_and_the_commands_it_names_run() {
    let desk = Desk::new();
    let run = desk.line("new nominal.toml").done();
    assert!(desk.read("nominal.toml").contains("backlash_arcsec"));
    let mut commands = next(&run).into_iter();
    desk.line(&(commands.next().unwrap().to_owned() + " --rows 400 --sessions 4 --seed 3")).done();
    let diagnosed = desk.line(commands.next().unwrap()).done();
    assert!(
        diagnosed.stdout.contains("report.html") && desk.path("try/diagnosis.json").exists(),
        "{}",
        diagnosed.stdout
    );
    assert_eq!(desk.line("new other.toml --kind nominal --json").done().json()["kind"], "nominal");
    assert_eq!(desk.read("other.toml"), desk.read("nominal.toml"));
    assert_eq!(desk.line("new my-nominal.toml --kind drive --json").done().json()["kind"], "drive");
}

/// The names of the commands, from the first page of help.
fn commands(desk: &Desk) -> Vec<String> {
    let page = desk.line("help").done().stdout;
    let listed = page.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let first = listed.filter_map(|line| line.split_whitespace().next());
    first
        .filter(|word| word.bytes().all(|b| b.is_ascii_lowercase()) && !["flexspline", "help"].contains(word))
        .map(str::to_owned)
        .collect()
}

#[test]
#[ignore = "long: tests/run slow"]
fn every_command_prints_one_json_object_and_nothing_else() {
    let desk = Desk::new();
    desk.write("path.csv", "generator_rad\n0\n");
    desk.write("samples.csv", &samples(&[-10, 10]));
    desk.write("measured.csv", "generator_rad,output_rad\n0,0\n1,0.0105\n2,0.021\n");
    desk.write("tolerances.toml", include_str!("../examples/sweep/teeth.toml"));
    let lines = [
        "new nominal.toml",
        "new drive.toml",
        "drive",
        "drive --check",
        "simulate --generator cam --mesh coarse --path path.csv",
        "export --generator cam --format csv",
        "tables --generator cam --from-samples samples.csv --no-report",
        "replay --tables out/cam.fxt measured.csv",
        "bundle --tables out --no-core --out bundle",
        "export --format fmu --tables out/cam.fxt",
        "export --format cfs --tables out/cam.fxt",
        "export --format csv --tables out/cam.fxt",
        "validate --tables out --mesh coarse --solver fast --torques 2 --positions 1 --temperatures 1 --no-report",
        "synthesize --list",
        "synthesize --model nominal.toml --rows 300 --sessions 4 --seed 1",
        "diagnose out/data.csv --model nominal.toml --no-report",
        "sleeve --drive CUP-95",
        "sweep --generator cam --vary generator.w0_mm=0.5 --positions 4 --out sheet",
        "look out/data.csv",
        "calibrate out/data.csv --model nominal.toml",
        "fly camera --example",
        "fly camera --no-report",
        "sweep --example",
        "sweep plan --tolerances tolerances.toml --draws 64 --out sweep",
        "sweep run sweep",
        "sweep reduce sweep",
    ];
    for line in lines {
        let run = desk.line(&format!("{line} --json"));
        // A table of few samples need not meet the FEM.
        assert!(run.code == 0 || (line.starts_with("validate") && run.code == 1), "{line}: {}", run.stderr);
        assert!(run.json().is_object(), "{line}: {:.80}", run.stdout);
        // On a slow machine it is said that it still computes.
        let said = run.stderr.lines().filter(|line| !line.contains(" s so far"));
        assert!(run.code == 1 || said.count() == 0, "{line}: {}", run.stderr);
    }
    for command in commands(&desk) {
        // These take minutes, or go on until they are stopped: what they print is tested beside their code.
        let long = ["reproduce", "serve"].contains(&&*command);
        let tried = lines.iter().any(|line| line.split(' ').next() == Some(&command));
        assert!(tried != long, "{command} is not tried with --json");
    }
}

#[test]
fn misspelt_names_get_a_suggestion_and_garbage_gets_none() {
    let desk = Desk::new();
    desk.line("new nominal.toml").done();
    desk.line("new my-drive.toml").done();
    desk.write("flat.toml", "base = \"HHD-95\"\n[flank]\nfriction_coefficient = 0.1\n[sleeve]\nlateral = 1\n");
    desk.write("data.csv", "generater_rad,output_rad\n0,0\n1,0.01\n");
    desk.write("short.csv", "generator_rad,torque_nm\n0,1\n");
    desk.write("wrong.toml", &desk.read("nominal.toml").replace("backlash_arcsec", "backlash_arcsecs"));
    let cases = [
        ("drive --drive HHD95", Some("HHD-95")),
        ("drive --drive my-drvie.toml", Some("my-drive.toml")),
        ("drive --drive other.txt", None),
        ("drive --set flank.friction_coefficient=0.1", Some("flanks.friction_coefficient")),
        ("drive --set viscosity=0.1", None),
        ("drive --drive flat.toml", Some("flanks")),
        ("drive --drive flat.toml", Some("sleeve.lateral_stiffness_n_per_mm")),
        ("simulate --generator camm", Some("cam")),
        ("simulate --generator gears", None),
        ("tables --generator two_roller", Some("two-roller")),
        ("tables --generator al", Some("all")),
        ("tables --generator cam --mesh course", Some("coarse")),
        ("tables --generator cam --mesh huge", None),
        ("tables --generator cam --solver refrence", Some("reference")),
        ("synthesize --effect circular_spline_excentricity", Some("circular_spline_eccentricity")),
        ("synthesize --effect wear:growth=3", Some("growth_arcsec")),
        ("synthesize --effect sunspots", None),
        ("diagnose data.csv --model nominal.toml", Some("generater_rad")),
        ("diagnose data.csv --model nominal.toml --columns genrator=a:rad", Some("generator")),
        ("diagnose data.csv --model nominal.toml --columns generator=a:degs", Some("deg")),
        ("diagnose data.csv --model nominal.toml --columns generator=a:furlong", None),
        ("diagnose data.csv --model wrong.toml", Some("nominal.backlash_arcsec")),
        ("simulate --generator cam --path short.csv", Some("torque_n_m")),
        ("tables --generator cam --from-samples short.csv", Some("torque_nm")),
    ];
    for (line, meant) in cases {
        let run = desk.line(line);
        assert_eq!(run.code, 2, "{line}: {}", run.stderr);
        match meant {
            Some(meant) => assert!(run.stderr.contains(&format!("did you mean `{meant}`?")), "{line}: {}", run.stderr),
            None => assert!(!run.stderr.contains("did you mean"), "{line}: {}", run.stderr),
        }
    }
    // Each where it stands, and all of them at once.
    let both = desk.line("drive --drive flat.toml").stderr;
    assert!(both.contains("flat.toml:2: flank: ") && both.contains("flat.toml:5: sleeve.lateral: "), "{both}");
    assert!(fs::read_dir(desk.path("out")).is_err());
}
