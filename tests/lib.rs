//! Helpers shared by the claim tests.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The command `flexspline`, built in the profile that the tests were built in.
pub fn flexspline() -> &'static Path {
    static BINARY: OnceLock<PathBuf> = OnceLock::new();
    BINARY.get_or_init(|| {
        let mut build = Command::new(env!("CARGO"));
        build
            .args(["build", "--package", "flexspline-sim", "--bin", "flexspline"])
            .arg("--message-format=json-render-diagnostics")
            .current_dir(env!("CARGO_MANIFEST_DIR"));
        if !cfg!(debug_assertions) {
            build.arg("--release");
        }
        let built = build.output().expect("cargo can be run");
        let log = String::from_utf8_lossy(&built.stderr);
        assert!(built.status.success(), "the command does not build:\n{log}");
        let messages = serde_json::Deserializer::from_slice(&built.stdout);
        messages
            .into_iter::<serde_json::Value>()
            .map(|message| message.expect("cargo writes JSON"))
            .find_map(|message| Some(PathBuf::from(message["executable"].as_str()?)))
            .expect("cargo names the program it built")
    })
}
