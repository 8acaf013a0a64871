//! `flexspline bundle`: whole or not at all, over its own and nothing else; every file is the one of the manifest; a
//! library that was asked for is there or the reason is said.
//!
//! `tests/run bundle` checks the bundle with a compiler, CMake and others.

use std::fs;

use flexspline_export::bundle::libraries::TARGETS;
use flexspline_tests::command::{Desk, samples};

/// A desk with the table `out/cam.fxt`.
fn desk() -> Desk {
    let desk = Desk::new();
    desk.write("samples.csv", &samples(&[-10, 10]));
    desk.line("tables --generator cam --from-samples samples.csv --no-report").done();
    desk
}

/// Writes a file and the folders that it is in.
fn put(desk: &Desk, name: &str, text: &str) {
    let path = desk.path(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

#[test]
fn every_file_is_the_one_of_the_manifest() {
    let desk = desk();
    let report = desk.line("bundle --tables out --no-core --out made/bundle --archive --json").done().json();
    let manifest: serde_json::Value = serde_json::from_str(&desk.read("made/bundle/manifest.json")).unwrap();
    let entries = manifest["files"].as_array().unwrap();
    assert_eq!(report["files"].as_array().unwrap().len(), entries.len() + 1);
    for entry in entries {
        let bytes = fs::read(desk.path("made/bundle").join(entry["path"].as_str().unwrap())).unwrap();
        assert_eq!(entry["bytes"], bytes.len());
        assert_eq!(entry["blake3"], blake3::hash(&bytes).to_hex().as_str(), "{entry}");
        let text = String::from_utf8_lossy(&bytes);
        let names = ["@VERSION@", "@TABLE", "@ZEPHYR", "@FIRST@", "@TARGET"];
        assert!(names.iter().all(|name| !text.contains(name)), "{entry}");
    }
    let image = fs::read(desk.path("out/cam.fxt")).unwrap();
    let table = flexspline::Table::check(&image).unwrap();
    assert_eq!(fs::read(desk.path("made/bundle/tables/cam.fxt")).unwrap(), image);
    for tables in [&report["tables"], &manifest["tables"]] {
        assert_eq!(tables[0]["table_id"], table.id().to_string());
        assert_eq!(tables[0]["array"], "flexspline_cam_table");
    }
    for path in ["include/flexspline_cam.h", "tables/flexspline_cam.c", "vectors/cam_vectors.h", "README.md"] {
        assert!(desk.read(&format!("made/bundle/{path}")).contains(&table.id().to_string()), "{path}");
    }
    // The vectors distinguish the two directions, an unknown play, an extrapolation and values that are not finite.
    let csv = desk.read("made/bundle/vectors/cam.csv");
    let qualities: std::collections::BTreeSet<&str> =
        csv.lines().skip(1).filter_map(|line| line.split(',').nth(7)).collect();
    assert_eq!(qualities.into_iter().collect::<Vec<_>>(), ["0", "1", "2", "3"]);
    assert!(fs::read(desk.path("made/bundle.tar.gz")).unwrap().starts_with(&[0x1f, 0x8b]));
    assert_eq!(report["targets"].as_array().map(Vec::len), Some(0));
}

#[test]
fn a_bundle_replaces_a_bundle_and_nothing_else() {
    let desk = desk();
    let bundle = |out: &str| desk.line(&format!("bundle --tables out --no-core --out {out}"));
    bundle("made").done();
    bundle("made").done();
    bundle("made/").done();
    // Its own files and nothing else: what came since, or was changed, stays, and so does all the rest.
    let before = desk.read("made/manifest.json");
    let refused = |out: &str, said: &str| {
        desk.refused(&format!("bundle --tables out --no-core --out {out}"), said);
        assert_eq!(desk.read("made/manifest.json"), before);
    };
    for (name, part) in [
        ("app/main.c", "app"),
        (".git/refs/heads/main", ".git"),
        ("tables/note.txt", "tables/note.txt"),
        ("manifest.json.old", "manifest.json.old"),
    ] {
        put(&desk, &format!("made/{name}"), "mine");
        refused("made", &format!("made has {name}, which is not of the bundle"));
        assert_eq!(desk.read(&format!("made/{name}")), "mine");
        let part = desk.path("made").join(part);
        if part.is_dir() { fs::remove_dir_all(part) } else { fs::remove_file(part) }.unwrap();
    }
    bundle("made").done();
    let example = desk.read("made/example.c");
    desk.write("made/example.c", "int main(void);");
    refused("made", "made has example.c, which was changed since");
    assert_eq!(desk.read("made/example.c"), "int main(void);");
    desk.write("made/example.c", &example);
    #[cfg(unix)]
    for (link, to) in [("link", "made"), ("dangling", "absent")] {
        std::os::unix::fs::symlink(desk.path(to), desk.path(link)).unwrap();
        for out in [link.to_owned(), format!("{link}/")] {
            refused(&out, "is a symbolic link");
        }
        assert!(desk.path(link).is_symlink());
        assert!(!desk.path("absent").exists());
    }
    bundle("made").done();
    // A folder with other files, even where one of them is called as ours.
    put(&desk, "mine/main.c", "int main(void);");
    for name in ["README.md", "manifest.json"] {
        put(&desk, &format!("mine/{name}"), "{}");
        refused("mine", "has files that are no bundle");
    }
    assert_eq!(desk.read("mine/main.c"), "int main(void);");
    assert_eq!(desk.line("bundle --tables out --no-core").code, 2, "without --out");
}

#[test]
fn what_is_wrong_is_said_before_anything_is_written() {
    let desk = desk();
    put(&desk, "none/readme.txt", "");
    let mut image = fs::read(desk.path("out/cam.fxt")).unwrap();
    fs::create_dir_all(desk.path("twice")).unwrap();
    for name in ["a-b.fxt", "a_b.fxt"] {
        fs::write(desk.path("twice").join(name), &image).unwrap();
    }
    image[300] ^= 1;
    fs::write(desk.path("torn.fxt"), &image).unwrap();
    put(&desk, "libraries/thumbv7m-none-eabi/libflexspline.a", "no archive");
    put(&desk, "libraries/thumbv6m-none-eabi/libflexspline.a", "!<arch>\nof another library");
    for (line, said) in [
        ("--tables absent.fxt", "absent.fxt"),
        ("--tables none", "none: holds no .fxt file"),
        ("--tables torn.fxt", "torn.fxt: CRC-32"),
        ("--tables twice", "both are a_b in C"),
        ("--tables out --target thumbv7em-none-eabihg", "found \"thumbv7em-none-eabihg\"; allowed: thumbv6m-none-eabi"),
        (
            "--tables out --libraries libraries --target thumbv7em-none-eabihf",
            "no thumbv7em-none-eabihf/libflexspline.a in libraries",
        ),
        ("--tables out --libraries libraries --target thumbv7m-none-eabi", "is no static library"),
        ("--tables out --libraries libraries --target thumbv6m-none-eabi", "has no flexspline_tick"),
    ] {
        desk.refused(&format!("bundle {line} --out made"), said);
        assert!(!desk.path("made").exists(), "{line}");
    }
}

#[test]
fn libraries_are_taken_from_a_folder_and_those_that_lack_are_named() {
    let desk = desk();
    let archive = "!<arch>\nwith flexspline_tick in it";
    put(&desk, "libraries/thumbv7m-none-eabi/libflexspline.a", archive);
    let all = desk.line("bundle --tables out --libraries libraries --out made --json").done().json();
    assert_eq!(all["targets"], serde_json::json!(["thumbv7m-none-eabi"]));
    let missing = all["missing"].as_array().unwrap();
    assert_eq!(missing.len(), 7);
    assert!(
        missing.iter().all(|missing| missing["why"].as_str().unwrap().contains("libflexspline.a in libraries")),
        "{missing:?}"
    );
    assert_eq!(desk.read("made/lib/thumbv7m-none-eabi/libflexspline.a"), archive);
    assert!(desk.read("made/README.md").contains("`thumbv7m-none-eabi`"));
    let text = desk.line("bundle --tables out --libraries libraries --out made").done().stdout;
    // One reason, reported once.
    assert_eq!(text.matches("no core for").count(), 1, "{text}");
    assert!(text.contains("no core for 7 targets: no TARGET/libflexspline.a in libraries"), "{text}");
    assert!(TARGETS.iter().all(|(target, _)| text.contains(target)), "{text}");
    assert!(text.lines().filter(|line| line.starts_with("    ")).all(|line| line.len() <= 120), "{text}");
}
