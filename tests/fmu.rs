//! FMUs of `flexspline export --format fmu`, imported as a simulator does it: the zip, its description, and the library
//! through `dlopen`.
//!
//! Wrong if these fail: an FMU that is not the core or not the flight, an importer's mistake that ends its program.

mod importer;

use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr::null_mut;

use flexspline::*;
use flexspline_fly::fly::{built_in, unit};
use flexspline_motion::flight::{COMPENSATED, START_UP_S, fly_one};
use flexspline_tests::command::Desk;
use importer::{DISCARD, ERROR, FUNCTIONS, Imported, Instance, OK, WARNING};

/// A desk with the table of the cam.
fn desk() -> Desk {
    let desk = Desk::new();
    let samples = concat!(env!("CARGO_MANIFEST_DIR"), "/firmware/samples/cam.samples.csv");
    desk.line(&format!("tables -q --no-report --generator cam --from-samples {samples} --out .")).done();
    desk
}

/// An FMU made by these options, imported into a folder whose name has to be escaped in a URI.
fn imported(desk: &Desk, options: &str) -> Imported {
    let exported = desk.line(&format!("export --format fmu --json --out fmu {options}")).done().json();
    let file = desk.path(exported["written"][0].as_str().unwrap());
    let folder = desk.path(&format!("100 % {}", exported["model"].as_str().unwrap()));
    let imported = Imported::new(&file, &folder);
    assert_eq!(exported["guid"], imported.guid());
    assert_eq!((exported["platforms"][0].as_str(), exported["fmi"].as_str()), (Some("linux64"), Some("2.0")));
    imported
}

/// Target, rate, torque and temperature of a tick: slews both ways, a load that changes its sign, warming in steps.
fn asked(tick: u32) -> [f64; 4] {
    let time = f64::from(tick) * 1e-3;
    let (swing, rate) = (0.05 * (0.9 * time).sin(), 0.05 * 0.9 * (0.9 * time).cos());
    [swing, rate, 30.0 * (2.3 * time).sin(), 15.0 + f64::from(tick / 400)]
}

const NAMES: [&str; 4] = ["output_angle_command", "output_rate_command", "output_torque", "drive_temperature"];
const OUTPUTS: [&str; 7] = [
    "generator_angle_command",
    "generator_rate_command",
    "output_angle_correction",
    "correction_held_back",
    "output_angle_predicted",
    "transmission_error_predicted",
    "prediction_uncertainty",
];

fn bits<const N: usize>(values: [f64; N]) -> [u64; N] {
    values.map(f64::to_bits)
}

/// A tick of the FMU: all it gives.
fn ticked(instance: &Instance<'_>, tick: u32) -> ([u64; 7], [c_int; 4]) {
    for (name, value) in NAMES.iter().zip(asked(tick)) {
        instance.set(name, value);
    }
    assert_eq!(instance.step(1e-3), OK, "{:?}", instance.log());
    (
        bits(instance.reals(OUTPUTS)),
        ["correction_quality", "tick_flags", "mode_active", "not_corrected"].map(|name| instance.number(name)),
    )
}

#[test]
fn the_fmu_of_a_table_gives_the_bits_of_the_core() {
    let desk = desk();
    let fmu = imported(&desk, "--tables cam.fxt");
    let instance = fmu.ready("one", &[("drive_temperature", asked(0)[3])]);
    let image = std::fs::read(desk.path("cam.fxt")).unwrap();
    let twin = image.clone();
    let images = Images::new(&image, &twin);
    let drive = *Table::check(&image).unwrap().drive();
    assert_eq!(instance.text("table_id"), Table::check(&image).unwrap().id().to_string());
    let limits = Limits {
        tick_s: 1e-3,
        rate_rad_s: 0.05,
        acceleration_rad_s2: 5.0,
        generator_rate_rad_s: 600.0,
        debounce_ticks: 5,
        deadband_rad: 2.4e-6,
    };
    let joint = Joint::new(drive, limits, Overrun::SkipAndCount).unwrap();
    let (mut store, mut state) = (Store::new(), JointState::new());
    store.activate(&images, &drive, asked(0)[3] as f32).unwrap();
    state.request(Mode::Tracking).unwrap();
    let mut command = GeneratorAngle::ZERO;
    let arcsec = |rad: f32| f64::from(rad) * 206_264.806_247_096_36;
    let mut corrected = 0.0_f64;
    for tick in 0..3000 {
        let [target, rate, torque, temperature] = asked(tick);
        if tick > 0 && temperature != asked(tick - 1)[3] {
            assert!(store.set_temperature(&images, temperature as f32));
            store.check_images(&images, store.used_words());
        }
        let target = OutputAngle::from_rad(target).unwrap();
        let input = Input {
            generator: Some(command),
            target,
            torque_n_m: torque as f32,
            missed_ticks: 0,
            adjustment: Adjustment::default(),
        };
        let ahead = joint.rate_ahead(&store, target, rate as f32, torque as f32, 4e-3);
        let out = joint.tick(&images, &mut store, &mut state, &input);
        command = out.command;
        let wanted = bits([
            out.command.to_rad(),
            f64::from(ahead),
            arcsec(out.correction_rad),
            arcsec(out.held_back_rad),
            out.output.to_rad(),
            arcsec(out.transmission_error_rad),
            arcsec(out.uncertainty_rad),
        ]);
        let not_corrected = out.flags.contains(Flags::NOT_CORRECTED);
        let numbers = [out.quality as c_int, c_int::from(out.flags.bits()), 1, c_int::from(not_corrected)];
        assert_eq!(ticked(&instance, tick), (wanted, numbers), "tick {tick}");
        corrected = corrected.max(arcsec(out.correction_rad).abs());
    }
    // It did correct, and the temperature did come through.
    assert!(corrected > 20.0, "{corrected}");
}

#[test]
fn steps_of_any_size_make_whole_ticks_and_carry_the_rest() {
    let desk = desk();
    let fmu = imported(&desk, "--tables cam.fxt");
    let inputs = [("output_angle_command", 0.02), ("output_torque", 12.0)];
    let after = |steps: &[f64]| {
        let instance = fmu.ready("one", &inputs);
        for step in steps {
            assert_eq!(instance.step(*step), OK, "{:?}", instance.log());
        }
        bits(instance.reals(OUTPUTS))
    };
    let ticks = |count: usize| after(&vec![1e-3; count]);
    assert_eq!(after(&[0.4e-3]), after(&[0.9e-3]));
    assert_ne!(after(&[0.4e-3]), ticks(1));
    assert_eq!(after(&[0.4e-3, 0.4e-3, 0.4e-3]), ticks(1));
    assert_eq!(after(&[2.5e-3, 2.5e-3]), ticks(5));
    assert_eq!(after(&[0.005 / 3.0; 3]), ticks(5));
    assert_ne!(ticks(4), ticks(5));
    assert_eq!(after(&[0.1]), ticks(100));

    let instance = fmu.instance("stops");
    assert_eq!((instance.set_up(Some(1.0)), instance.enter()), (OK, OK));
    assert_eq!(instance.call("ExitInitializationMode"), OK);
    for bad in [0.0, -1e-3, f64::NAN, f64::INFINITY, 1e9, 1.1] {
        assert_eq!(instance.step(bad), ERROR, "{bad}");
    }
    assert_eq!(instance.step_from(0.5, 1e-3), ERROR);
    assert_eq!((instance.step(0.7), instance.step(0.3), instance.step(0.1)), (OK, OK, ERROR));
}

#[test]
fn instances_do_not_know_of_each_other() {
    let desk = desk();
    let fmu = imported(&desk, "--tables cam.fxt");
    let alone: Vec<_> = {
        let instance = fmu.ready("alone", &[]);
        (0..400).map(|tick| ticked(&instance, tick)).collect()
    };
    let (one, two) = (fmu.ready("one", &[]), fmu.ready("two", &[("mode", 0.0), ("correction_rate_limit", 0.001)]));
    for (tick, wanted) in (0..).zip(&alone) {
        assert_eq!(&ticked(&one, tick), wanted);
        assert_ne!(ticked(&two, tick).1, wanted.1);
    }
    std::thread::scope(|threads| {
        for _ in 0..3 {
            threads.spawn(|| {
                let instance = fmu.ready("in a thread", &[]);
                for (tick, wanted) in (0..).zip(&alone) {
                    assert_eq!(&ticked(&instance, tick), wanted);
                }
            });
        }
    });
}

#[test]
fn the_joint_flies_as_fly_does() {
    let desk = Desk::new();
    let fmu = imported(&desk, "--model joint --scenario camera");
    let mut flown = built_in("camera").unwrap();
    flown.scenario.legs.truncate(3);
    let unit = unit(flown.kind, flown.scenario.temperature_c);
    let flight = fly_one(&flown.scenario, &unit, COMPENSATED).unwrap();
    let instance = fmu.ready("joint", &[]);
    let [mut worst, mut most] = [0.0_f64; 2];
    let mut errors = flight.errors.iter();
    let tick_s = flown.scenario.servo.tick_s;
    let mut output = 0.0;
    for moment in flown.scenario.moments() {
        if moment.time_s >= START_UP_S {
            let wanted = f64::from(*errors.next().unwrap());
            let found = (output - moment.target_rad) * 206_264.806_247_096_36;
            worst = worst.max((found - wanted).abs());
            most = most.max(wanted.abs());
        }
        let [first, last] = moment.outside_n_m;
        let inputs = [
            ("output_angle_command", moment.target_rad),
            ("output_rate_command", moment.rate_rad_s),
            ("output_acceleration_command", moment.acceleration_rad_s2),
            ("load_torque", first),
        ];
        for (name, value) in inputs {
            instance.set(name, value);
        }
        instance.slope("load_torque", (last - first) / tick_s);
        assert_eq!(instance.step(tick_s), OK, "{:?}", instance.log());
        [output] = instance.reals(["output_angle"]);
    }
    assert_eq!(errors.next(), None);
    println!("off the flight by {worst:.2e}\" where it errs by {most:.2}\"");
    // The load's slope is rounded once more on its way through the interface.
    assert!(worst < 1e-4 && most > 5.0, "{worst} of {most}");
}

#[test]
fn the_joint_keeps_its_books_and_the_table_takes_its_error_out() {
    let desk = desk();
    let fmu = imported(&desk, "--tables cam.fxt --model joint --scenario camera");
    let pushed = fmu.ready("pushed", &[("servo", 0.0), ("gravity_torque", 0.0), ("drag", 0.1)]);
    for tick in 0..5000 {
        pushed.set("motor_torque_command", 0.4 * (0.01 * f64::from(tick)).sin());
        pushed.set("load_torque", 4.0 * (0.017 * f64::from(tick)).cos());
        assert_eq!(pushed.step(1e-3), OK, "{:?}", pushed.log());
    }
    let [missing, work, heat, stored] = pushed.reals(["energy_error", "motor_work", "heat", "stored_energy"]);
    println!("motor {work:.3} J, heat {heat:.3} J, stored {stored:.2e} J, missing {missing:.1e} J");
    assert!(heat > 0.1 && missing.abs() < 1e-8 * heat, "{missing} of {heat}");

    // A slow turn under a steady load, compensated and not.
    let left = |compensate: f64| {
        let set = [("compensate", compensate), ("gravity_torque", 0.0), ("torque_noise", 0.0), ("friction_known", 1.0)];
        let instance = fmu.ready("turns", &set);
        let (mut squares, mut count, mut target) = (0.0, 0.0, 0.0);
        let rate = 0.01;
        for tick in 0..6000 {
            instance.set("output_angle_command", target);
            instance.set("output_rate_command", rate);
            instance.set("load_torque", 10.0);
            assert_eq!(instance.step(1e-3), OK, "{:?}", instance.log());
            target += rate * 1e-3;
            if tick >= 3000 {
                let [output] = instance.reals(["output_angle"]);
                squares += ((output - target) * 206_264.8_f64).powi(2);
                count += 1.0;
            }
        }
        let rms: f64 = squares / count;
        rms.sqrt()
    };
    let [without, with] = [0.0, 1.0].map(left);
    println!("left without {without:.1}\", with {with:.2}\"");
    assert!(without > 25.0 && with < 0.1 * without, "{without} {with}");
}

#[test]
fn calls_in_a_wrong_state_and_wrong_arguments_are_refused_with_a_line_in_the_log() {
    let desk = desk();
    let fmu = imported(&desk, "--tables cam.fxt");
    // Nothing comes of the wrong model, description, kind or folder, and it is said why.
    let (guid, location) = (fmu.guid(), fmu.location());
    for (name, kind, guid, location, why) in [
        ("one", 0, &*guid, &*location, "model exchange"),
        ("one", 1, "{0}", &location, "guid"),
        ("", 1, &guid, &location, "instance name"),
        ("one", 1, &guid, "file:///nowhere%20at%20100%25", "/nowhere at 100%/model.txt"),
        ("one", 1, &guid, "http://x/resources", "allowed: file:///folder"),
    ] {
        let Err(log) = fmu.instance_with(name, kind, guid, location) else { panic!("{why} was made") };
        let [line] = &log[..] else { panic!("{why}: {log:?}") };
        assert!(line.message.contains(why) && line.status == ERROR && line.instance == name, "{why}: {line:?}");
    }

    let instance = fmu.instance("one");
    let refused = |instance: &Instance<'_>, status: c_int, why: &str| {
        let log = instance.log();
        assert_eq!(status, ERROR, "{why}");
        assert!(log.last().is_some_and(|line| line.message.contains(why)), "{why}: {log:?}");
        assert_eq!(log.last().unwrap().category, "logStatusError");
    };
    refused(&instance, instance.call("ExitInitializationMode"), "\"instantiated\"");
    refused(&instance, instance.call("Terminate"), "Terminate");
    refused(&instance, instance.step(1e-3), "DoStep");
    refused(&instance, instance.get_reals(&[0], &mut [0.0]), "fmi2GetReal");
    // Without an experiment it starts at 0, with a warning.
    assert_eq!(instance.enter(), WARNING);
    refused(&instance, instance.set_up(None), "\"initialization mode\"");
    refused(&instance, instance.step(1e-3), "DoStep");
    instance.set("output_angle_command", 0.1);
    let [command, ratio] = instance.reals(["generator_angle_command", "ratio"]);
    assert_eq!((command, ratio), (0.1 * 95.0, 95.0));
    assert_eq!(instance.call("ExitInitializationMode"), OK);
    refused(&instance, instance.try_set("tick", 2e-3), "after the initialisation");
    refused(&instance, instance.try_set("ratio", 2e-3), "at all");
    refused(&instance, instance.try_set("output_angle_correction", 2e-3), "at all");
    refused(&instance, instance.try_set("mode", 7.0), "mode: found 7, allowed: 0 to 3");
    refused(&instance, instance.get_reals(&[4_000_000_000], &mut [0.0]), "value reference 4000000000");
    refused(&instance, instance.get_reals(&[fmu.reference("tick_flags")], &mut [0.0]), "of another type");
    // A legal call is a mode that cannot follow: warned of, and the mode stays.
    instance.set("mode", 3.0);
    assert_eq!(instance.step(1e-3), OK);
    instance.set("mode", 1.0);
    assert_eq!((instance.step(1e-3), instance.number("mode_active")), (OK, 3));
    assert_eq!(instance.log().last().unwrap().message, "mode: no transition from Safe to Tracking");
    // What is no angle ends the model, not the program; a reset begins anew.
    instance.set("output_angle_command", f64::NAN);
    refused(&instance, instance.step(1e-3), "output_angle_command: found NaN");
    refused(&instance, instance.step(1e-3), "\"step failed\"");
    assert_eq!(instance.call("Reset"), OK);
    assert_eq!((instance.set_up(None), instance.enter()), (OK, OK));
    assert_eq!((instance.call("ExitInitializationMode"), instance.step_from(0.0, 1e-3)), (OK, OK));
    assert_eq!(instance.call("Terminate"), OK);
    refused(&instance, instance.enter(), "\"terminated\"");

    // Parameters that no joint can have.
    let odd = fmu.instance("odd");
    assert_eq!(odd.set_up(None), OK);
    odd.set("tick", 1e-6);
    odd.set("correction_rate_limit", 1e-9);
    assert_eq!(odd.enter(), OK);
    refused(&odd, odd.call("ExitInitializationMode"), "rate_rad_s");
}

/// Every function with zeros and null pointers for all its arguments, in every state, on components that live, are
/// null, were freed, or never were.
#[test]
fn no_function_falls_over_null_pointers_and_strange_components() {
    let desk = desk();
    let fmu = imported(&desk, "--tables cam.fxt");
    let freed = fmu.instance("freed").component;
    let strange =
        [null_mut(), freed, std::ptr::without_provenance_mut(1), std::ptr::without_provenance_mut(usize::MAX)];
    // Without a component, or with real numbers, which go another way than pointers and counts.
    let plain = ["GetTypesPlatform", "GetVersion", "FreeInstance", "DoStep"];
    let plain = |name: &str| plain.contains(&&name[4..]) || name.contains("Instantiate");
    for name in FUNCTIONS.into_iter().filter(|name| !plain(name)) {
        for component in strange {
            let status = unsafe { fmu.any(name)(component, 0, 0, 0, 0, 0, 0) };
            assert_eq!(status, ERROR, "{name} {component:?}");
        }
    }
    for component in strange {
        unsafe { fmu.function::<unsafe extern "C" fn(*mut c_void)>("FreeInstance")(component) };
    }
    for ready in [false, true] {
        let instance = if ready { fmu.ready("one", &[]) } else { fmu.instance("one") };
        for name in FUNCTIONS.into_iter().filter(|name| !plain(name)) {
            // The count is the third argument of what takes lists: null pointers to one value.
            let status = unsafe { fmu.any(name)(instance.component, 0, 1, 0, 0, 0, 0) };
            let fine = [
                "EnterInitializationMode",
                "ExitInitializationMode",
                "SetupExperiment",
                "Reset",
                "Terminate",
                "SetTime",
            ];
            let other = ["GetStatus", "GetRealStatus", "GetIntegerStatus", "GetBooleanStatus", "GetStringStatus"];
            let wanted = match name {
                name if other.contains(&&name[4..]) => DISCARD,
                name if fine.contains(&&name[4..]) && status != ERROR => status,
                _ => ERROR,
            };
            assert_eq!(status, wanted, "{name}");
        }
    }
    let said = fmu.function::<unsafe extern "C" fn() -> *const c_char>("GetVersion");
    assert_eq!(unsafe { CStr::from_ptr(said()) }, c"2.0");
}

#[test]
fn a_joint_says_how_far_its_core_trusts_the_table_and_refuses_targets_that_no_angle_holds() {
    let desk = desk();
    let fmu = imported(&desk, "--tables cam.fxt --model joint --scenario camera");
    let quality = |set: &[(&str, f64)], load: f64| {
        let instance = fmu.ready("one", set);
        assert_eq!(instance.number("correction_quality"), 3, "disabled before the first tick");
        for tick in 0..300 {
            instance.set("output_angle_command", 1e-5 * f64::from(tick));
            instance.set("output_rate_command", 0.01);
            instance.set("load_torque", load);
            assert_eq!(instance.step(1e-3), OK, "{:?}", instance.log());
        }
        instance.number("correction_quality")
    };
    let quiet = [("gravity_torque", 0.0), ("torque_noise", 0.0)];
    assert_eq!(quality(&quiet, 10.0), 0);
    // Everywhere in the table (30 N·m were refused before, 200 is its range), and a little beyond.
    for (load, expected) in [(30.0, 0), (-30.0, 0), (120.0, 0), (195.0, 0), (-195.0, 0), (220.0, 2)] {
        assert_eq!(quality(&quiet, load), expected, "{load} N·m");
    }
    assert_eq!(quality(&quiet, 5000.0), 3, "a reading that no sensor has");
    let instance = fmu.ready("told", &quiet);
    instance.set("load_torque", 5000.0);
    for _ in 0..50 {
        assert_eq!(instance.step(1e-3), OK);
    }
    let told = |entry: &&importer::Line| entry.message.contains("not corrected: the torque reads 5000");
    assert_eq!(instance.log().iter().filter(told).count(), 1, "{:?}", instance.log());
    assert_eq!(quality(&[("compensate", 0.0)], 10.0), 3);
    assert_eq!(quality(&[("servo", 0.0)], 0.0), 3);
    for target in [1e30, -1e30, 1e9 * std::f64::consts::TAU] {
        let instance = fmu.ready("far", &[]);
        instance.set("output_angle_command", target);
        assert_eq!(instance.step(1e-3), ERROR, "{target}");
        let log = instance.log();
        assert!(log.last().unwrap().message.contains("output_angle_command: found"), "{log:?}");
    }
    let pushed = fmu.ready("pushed", &[("servo", 0.0)]);
    pushed.set("output_angle_command", 1e30);
    assert_eq!(pushed.step(1e-3), OK, "not read: {:?}", pushed.log());
}
