//! Wrong sample files and table images: each is refused with its own clear message, exit code 2, and nothing is left
//! behind. Drive files stand in `tests/cli.rs`.
//!
//! The messages themselves are held by the tests beside the readers; here a user meets them at the command.

use std::collections::BTreeSet;
use std::fs;

use flexspline_tests::command::{Desk, names, samples};

use crate::fxt_format::crc32;

/// Runs a command that must be refused; the message, without the name of the file.
#[track_caller]
fn refused(desk: &Desk, line: &str, said: &str) -> String {
    let before = names(&desk.path("."));
    let message = desk.refused(line, said);
    assert_eq!(names(&desk.path(".")), before, "{line} left something behind");
    message
}

/// The file keeps its content, and the message names it and what would have taken its place.
#[test]
fn no_command_replaces_a_file_that_it_reads() {
    let desk = Desk::new();
    fs::create_dir(desk.path("mine")).unwrap();
    for (line, file) in [
        ("replay mine/replay.csv --tables cam.fxt", "replay.csv"),
        ("synthesize --effect backlash_growth --like mine/data.csv", "data.csv"),
        ("simulate --generator cam --path=mine/results.csv", "results.csv"),
        ("diagnose mine/diagnosis.json --model model.toml", "diagnosis.json"),
        ("calibrate mine/../mine/calibration.json --ratio 50", "calibration.json"),
    ] {
        let file = format!("mine/{file}");
        desk.write(&file, "generator_rad,output_rad\n0,0\n");
        let said = refused(&desk, &format!("{line} --out mine"), "which this run reads; allowed: another --out");
        assert_eq!(said.matches(file.trim_start_matches("mine")).count(), 2, "{line}: {said}");
        assert_eq!(desk.read(&file), "generator_rad,output_rad\n0,0\n", "{line}");
    }
}

#[test]
fn wrong_sample_files_are_refused() {
    let desk = Desk::new();
    let header = "generator_rad,torque_n_m,temperature_c,direction,output_rad\n";
    // Forward motion alone; a torque with too few positions; directions exchanged; a jump of a whole turn.
    let rows = |directions: &[i32], positions: usize, lag: f64| {
        let mut text = header.to_owned();
        for torque in [-10, 10] {
            for direction in directions {
                for k in 0..positions {
                    let psi = k as f64 * 0.033_421_2 / 8.0;
                    let output = psi / 95.0 - lag * f64::from(*direction);
                    text.push_str(&format!("{psi},{torque},20,{direction},{output}\n"));
                }
            }
        }
        text
    };
    let cases = [
        (String::new(), "column generator_rad is missing"),
        (header.to_owned(), "no samples"),
        (header.replace("torque_n_m", "torque"), "column torque_n_m is missing"),
        (format!("output_rad,{header}"), "column output_rad is there twice"),
        (format!("{header}0,0,inf,1,0\n"), "line 2: temperature_c is inf"),
        (format!("{header}0,0,5000,1,0\n"), "line 2: temperature_c is 5000 °C"),
        (format!("{header}0,0,20,1,0\n0,x,20,1,0\n"), "line 3: torque_n_m is \"x\", not a number"),
        (format!("{header}0,0,20,1\n"), "line 2: 4 fields"),
        (format!("{header}0,0,20,1,zero\n"), "output_rad is \"zero\", not a number"),
        (format!("{header}0,0,20,1,inf\n"), "output_rad is inf"),
        (format!("{header}0,0,20,2,0\n"), "direction is 2; allowed are 1 and -1"),
        (format!("{header}0,0,20,1,1e9\n"), "output_rad is 1000000000 rad"),
        (format!("{header}0,1e7,20,1,0\n"), "torque_n_m is 10000000 N·m"),
        (rows(&[1], 8, 1e-4), "no Backward samples"),
        (rows(&[1, -1], 8, -1e-4), "half"),
        (rows(&[1, -1], 8, 0.4), "rad"),
    ];
    let mut messages = BTreeSet::new();
    for (text, said) in &cases {
        desk.write("wrong.csv", text);
        let message = refused(&desk, "tables --generator cam --from-samples wrong.csv --out wrong", said);
        assert!(message.contains("wrong.csv"), "{message}");
        messages.insert(message);
    }
    assert_eq!(messages.len(), cases.len(), "two mistakes got the same message: {messages:#?}");
    desk.write("good.csv", &rows(&[1, -1], 8, 1e-4));
    refused(&desk, "tables --from-samples good.csv --out wrong", "--generator");
    refused(&desk, "tables --generator cam --from-samples missing.csv --out wrong", "missing.csv");
    refused(&desk, "tables --generator cam --from-samples good.csv --half-width-arcsec -1 --out wrong", "-1");
    desk.line("tables --generator cam --from-samples good.csv").done();
}

#[test]
fn wrong_table_images_are_refused() {
    let desk = Desk::new();
    desk.write("good.csv", &samples(&[0]));
    desk.line("tables --generator cam --from-samples good.csv --out good").done();
    desk.write("measured.csv", "generator_rad,output_rad\n0,0\n1,0.0105\n");
    let good = fs::read(desk.path("good/cam.fxt")).unwrap();
    let damage = |f: &dyn Fn(&mut Vec<u8>)| {
        let mut image = good.clone();
        f(&mut image);
        image
    };
    let images: Vec<(&str, Vec<u8>)> = vec![
        ("empty", Vec::new()),
        ("a text", b"generator_rad,output_rad".to_vec()),
        ("a byte short", damage(&|i| i.truncate(good.len() - 1))),
        ("half", damage(&|i| i.truncate(good.len() / 2))),
        ("a byte long", damage(&|i| i.push(0))),
        ("other magic", damage(&|i| i[0] ^= 0x20)),
        ("other version", damage(&|i| i[8] = 99)),
        ("one bit in the header", damage(&|i| i[40] ^= 1)),
        ("one bit in the numbers", damage(&|i| i[good.len() - 60] ^= 0x80)),
        ("one bit in the check sum", damage(&|i| i[good.len() - 1] ^= 1)),
        ("bytes swapped", damage(&|i| i.chunks_exact_mut(4).for_each(<[u8]>::reverse))),
    ];
    fs::create_dir(desk.path("wrong")).unwrap();
    for (name, image) in &images {
        fs::write(desk.path("wrong/cam.fxt"), image).unwrap();
        let message = refused(&desk, "replay --tables wrong/cam.fxt measured.csv --out nothing", "cam.fxt");
        assert!(message.len() > "error: wrong/cam.fxt: ".len() + 8, "{name}: {message}");
        refused(&desk, "validate --tables wrong --out nothing", "cam.fxt");
    }
    // Changed, with its sums corrected: the id detects it.
    let other = damage(&|image| {
        let body = 4 * u32::from_le_bytes(image[196..200].try_into().unwrap()) as usize;
        image[56] ^= 1;
        let page = crc32(&image[..256]);
        image[body..body + 4].copy_from_slice(&page.to_le_bytes());
        let end = image.len() - 4;
        let all = crc32(&image[..end]);
        image[end..].copy_from_slice(&all.to_le_bytes());
    });
    fs::write(desk.path("wrong/cam.fxt"), other).unwrap();
    for command in [
        "replay --tables wrong/cam.fxt measured.csv",
        "diagnose measured.csv --tables wrong",
        "validate --tables wrong",
    ] {
        refused(&desk, &format!("{command} --out nothing"), "changed after it was made");
    }
    refused(&desk, "replay --tables wrong measured.csv --out nothing", "FILE.fxt");
    refused(&desk, "diagnose measured.csv --tables nowhere --out nothing", "flexspline tables");
    refused(&desk, "validate --tables good --drive HHD-95-typical --out nothing", "BLAKE3");
    refused(&desk, "validate --tables . --out nothing", "--tables");
    refused(&desk, "diagnose measured.csv --tables good/cam.fxt --out nothing", "--tables good --generator cam");
    refused(&desk, "diagnose measured.csv --tables good --generator two-roller --out nothing", "--generator cam");
    for (rows, said) in [
        ("generator_rad,torque_n_m\n1,2\n", "neither column output_rad nor error_arcsec"),
        ("output_rad,generator_rad\n0,x\n", "generator_rad: found \"x\""),
        ("output_rad,generator_rad\n0,1\n", "1 row after the header; at least 2 are needed"),
        ("generator_rad,output_rad\n1,nan\n2,0\n", "1 rows have all that is needed"),
    ] {
        desk.write("measured.csv", rows);
        refused(&desk, "replay --tables good/cam.fxt measured.csv --out nothing", said);
    }
}
