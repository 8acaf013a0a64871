//! The C header that is checked in is the one that cbindgen makes of the C interface, and what it once promised stays
//! until the version changes.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

fn core() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../core")
}

fn kept_header() -> String {
    fs::read_to_string(core().join("include/flexspline.h")).unwrap()
}

#[test]
fn the_header_is_up_to_date() {
    let config = cbindgen::Config::from_file(core().join("c_api/cbindgen.toml")).unwrap();
    // It finds the modules of the crate by itself.
    let builder = cbindgen::Builder::new()
        .with_config(config)
        .with_src(core().join("c_api/src/lib.rs"))
        .with_src(core().join("estimation/src/two_mass_observer.rs"))
        .with_src(core().join("src/joint/start_up.rs"));
    let mut made = Vec::new();
    builder.generate().expect("cbindgen reads the C interface").write(&mut made);
    let made = String::from_utf8(made).unwrap();
    if std::env::var_os("FLEXSPLINE_KEEP_HEADER").is_some() {
        fs::write(core().join("include/flexspline.h"), &made).unwrap();
    }
    let kept = kept_header();
    let line = made.lines().zip(kept.lines()).position(|(made, kept)| made != kept);
    assert!(
        made == kept,
        "core/include/flexspline.h differs from what cbindgen makes, from line {}: run this test with \
         FLEXSPLINE_KEEP_HEADER=1",
        line.map_or(made.lines().count().min(kept.lines().count()), |line| line + 1)
    );
}

/// Names that a program in C relies on: functions with their parameters, structures with their fields, enumerations
/// with their values, constants. The version is none of it.
fn promises(header: &str) -> BTreeMap<String, String> {
    let body = header.split("#endif  /* FLEXSPLINE_H */").next().unwrap();
    let code: String =
        body.lines().map(|line| line.split("//").next().unwrap().trim_end()).fold(String::new(), |mut code, line| {
            let _ = writeln!(code, "{line}");
            code
        });
    let mut found = BTreeMap::new();
    for line in code.lines() {
        if let [name, value] = line.strip_prefix("#define ").unwrap_or_default().split(' ').collect::<Vec<_>>()[..]
            && value.parse::<i64>().is_ok()
            && !name.starts_with("FLEXSPLINE_VERSION")
        {
            found.insert(name.to_owned(), format!("constant {name} {value}"));
        }
    }
    let plain: String =
        code.lines().filter(|line| !line.starts_with('#') && !line.ends_with('\\')).collect::<Vec<_>>().join(" ");
    let plain = plain.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in plain.split("typedef ").skip(1) {
        let (inside, rest) = part.split_once('}').unwrap();
        let name = rest.split(';').next().unwrap().trim();
        let (head, fields) = inside.split_once('{').unwrap();
        found.insert(name.to_owned(), format!("{} {{{} }}", head.trim(), fields.trim_end().trim_end_matches(',')));
    }
    let functions = plain.rsplit_once("extern \"C\" {").unwrap().1;
    for statement in functions.split(';') {
        let Some((head, _)) = statement.split_once('(') else { continue };
        let name = head.rsplit([' ', '*']).next().unwrap();
        found.insert(name.to_owned(), statement.trim().to_owned());
    }
    found
}

/// The size of an opaque object or of saved bytes, with its name.
fn size(text: &str) -> Option<(&str, u64)> {
    let (name, value) = text.strip_prefix("constant ")?.split_once(' ')?;
    let is_size = name.ends_with("_WORDS") || (name.starts_with("FLEXSPLINE_SAVED_") && name.ends_with("_BYTES"));
    Some((name, value.parse().ok()?)).filter(|_| is_size)
}

/// Promises of `before` that are broken. An enumeration may go on, and an object may grow: its room is the caller's by
/// the name of its size, and `flexspline_layout` finds a program that was compiled for the smaller one.
fn broken(before: &BTreeMap<String, String>, now: &BTreeMap<String, String>) -> Vec<String> {
    let grew = |text: &str, now: &str| size(text).zip(size(now)).is_some_and(|(a, b)| a.0 == b.0 && a.1 <= b.1);
    let goes_on = |text: &str, now: &str| text.starts_with("enum ") && now.starts_with(text.trim_end_matches(" }"));
    let stays = |text: &str, now: &str| text == now || goes_on(text, now) || grew(text, now);
    let gone = before.iter().filter(|(name, text)| !now.get(*name).is_some_and(|now| stays(text, now)));
    gone.map(|(name, text)| format!("was:  {text}\nnow:  {}", now.get(name).map_or("nothing", |t| t))).collect()
}

/// The list that is checked in: a version, then a promise on each line.
fn kept_list() -> (String, BTreeMap<String, String>) {
    let text = fs::read_to_string(core().join("include/flexspline.abi")).unwrap_or_default();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let version = lines.next().unwrap_or_default().to_owned();
    let named = |line: &str| line.split_once(": ").map(|(name, text)| (name.to_owned(), text.to_owned()));
    (version, lines.filter_map(named).collect())
}

#[test]
fn nothing_that_the_header_promised_changes_without_the_version() {
    let now = promises(&kept_header());
    let (version, kept) = kept_list();
    let here = env!("CARGO_PKG_VERSION");
    let wrong = if version == here { broken(&kept, &now) } else { Vec::new() };
    assert!(
        wrong.is_empty(),
        "programs in C for {version} break; take it back, or raise the version:\n{}",
        wrong.join("\n")
    );
    if std::env::var_os("FLEXSPLINE_KEEP_ABI").is_some() {
        let mut text = "# What flexspline.h promises in this version: tests/c_header.rs. FLEXSPLINE_KEEP_ABI=1 adds \
                        what is new.\n"
            .to_owned();
        let _ = writeln!(text, "{here}");
        for (name, promise) in &now {
            let _ = writeln!(text, "{name}: {promise}");
        }
        fs::write(core().join("include/flexspline.abi"), text).unwrap();
    }
    assert!(
        kept_list() == (here.to_owned(), now),
        "core/include/flexspline.abi: run this test with FLEXSPLINE_KEEP_ABI=1"
    );
}

/// The sum over all sizes leaves none out.
#[test]
fn the_layout_holds_every_type() {
    let header = kept_header();
    let types: Vec<_> = promises(&header).into_keys().filter(|name| name.starts_with("Flexspline")).collect();
    assert!(types.len() > 40);
    for name in types {
        assert!(header.contains(&format!("  FLEXSPLINE_AND_SIZE_({name})")), "core/c_api/cbindgen.toml: {name}");
    }
}
