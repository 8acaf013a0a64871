//! Style sheet and script of a page, from the files of `web/`.
//!
//! The sources are plain ES modules that refer to one another; in a page they stand as one module, in the order below,
//! so the lines that import and the words that export are left out. Names are therefore unique among the files, which a
//! test holds them to.

use std::fmt::Write as _;
use std::sync::LazyLock;

use sha2::{Digest, Sha256};

use flexspline_export::base64;

/// Modules, each after those that it imports.
pub const MODULES: [(&str, &str); 10] = [
    ("pack.js", include_str!("../web/pack.js")),
    ("quantities.js", include_str!("../web/quantities.js")),
    ("theme.js", include_str!("../web/theme.js")),
    ("charts.js", include_str!("../web/charts.js")),
    ("fields.js", include_str!("../web/fields.js")),
    ("motion.js", include_str!("../web/motion.js")),
    ("paint.js", include_str!("../web/paint.js")),
    ("drive.js", include_str!("../web/drive.js")),
    ("sleeve.js", include_str!("../web/sleeve.js")),
    ("page.js", include_str!("../web/page.js")),
];
/// The chart library, for its global name `uPlot`.
pub const UPLOT: &str = include_str!("../web/vendor/uPlot.iife.min.js");
const UPLOT_LICENCE: &str = include_str!("../web/vendor/uPlot.LICENSE");
const UPLOT_STYLE: &str = include_str!("../web/vendor/uPlot.min.css");
const OWN_STYLE: &str = include_str!("../web/report.css");

/// The style sheet, after the one of the chart library.
pub static STYLE: LazyLock<String> = LazyLock::new(|| format!("{UPLOT_STYLE}\n{OWN_STYLE}"));

/// The script, a module.
pub(super) static SCRIPT: LazyLock<String> = LazyLock::new(|| {
    let mut script = format!("/*! uPlot 1.6.32\n{UPLOT_LICENCE}*/\n{UPLOT}\n");
    for (name, source) in MODULES {
        let _ = writeln!(script, "// ---- {name}\n{}", without_linkage(source));
    }
    script
});

/// A module without its imports and the word `export`.
fn without_linkage(source: &str) -> String {
    let mut inside_import = false;
    let mut text = String::with_capacity(source.len());
    for line in source.lines() {
        inside_import |= line.starts_with("import ");
        if inside_import {
            inside_import = !line.ends_with(';');
            continue;
        }
        text.push_str(line.strip_prefix("export ").unwrap_or(line));
        text.push('\n');
    }
    text
}

/// The content security policy of a page: this style sheet, this script, pictures from its own data, and nothing from
/// anywhere. A script that found its way into the text would not run.
pub(super) fn policy(style: &str, script: &str) -> String {
    let hash = |text: &str| String::from_utf8(base64(&Sha256::digest(text))).expect("base64 is ASCII");
    format!(
        "default-src 'none'; script-src 'sha256-{}'; style-src 'sha256-{}'; img-src data: blob:",
        hash(script),
        hash(style)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn what_is_vendored_is_what_its_readme_says() {
        let readme = include_str!("../web/vendor/README.md");
        for (name, content) in [("uPlot.iife.min.js", UPLOT), ("uPlot.min.css", UPLOT_STYLE)] {
            let hash: String = Sha256::digest(content).iter().map(|b| format!("{b:02x}")).collect();
            assert!(readme.contains(&format!("| `{name}` | `{hash}` |")), "{name}: {hash}");
        }
        assert!(SCRIPT.contains("Copyright (c) 2022 Leon Sorokin"));
    }

    #[test]
    fn modules_can_stand_in_one_another() {
        let mut owner = HashMap::new();
        for (name, source) in MODULES {
            for line in without_linkage(source).lines() {
                assert!(!line.starts_with("import ") && !line.starts_with("export "), "{name}: {line}");
                let declared = ["function ", "async function ", "class ", "const ", "let "]
                    .iter()
                    .find_map(|word| line.strip_prefix(word));
                let Some(rest) = declared else { continue };
                let word: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                if let Some(other) = owner.insert(word.clone(), name) {
                    panic!("{word} is declared in {other} and in {name}");
                }
            }
        }
        assert!(owner.contains_key("unpack"));
    }

    #[test]
    fn neither_style_nor_script_can_end_its_element_or_ask_for_anything() {
        let everywhere = ["</script", "</style", "<!--"];
        let in_style = ["@import", "url("];
        let in_script = ["fetch(", "xmlhttprequest", "import(", "websocket", "sendbeacon"];
        for (text, own) in [(STYLE.as_str(), &in_style[..]), (SCRIPT.as_str(), &in_script[..])] {
            let lower = text.to_ascii_lowercase();
            for bad in everywhere.iter().chain(own) {
                assert!(!lower.contains(bad), "{bad}");
            }
        }
    }
}
