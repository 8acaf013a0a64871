//! F´: the image of the core as parameters, for `fprime-prm-write` of fprime-gds, and the FPP that declares them.
//!
//! A parameter has to fit the framework's buffer (`FW_PARAM_BUFFER_MAX_SIZE`: 506 bytes by default), so the image comes
//! in parts of one size, the last filled with zeros; the image says its own length (docs/reference/fxt.md).

use std::fmt::Write;

use super::{Origin, Refusal, Written};

/// Default of `PRMDB_NUM_DB_ENTRIES`.
const DATABASE: usize = 25;
/// Sizes of a part: a word, and far beyond what a database of parameters is for.
const PART_BYTES: std::ops::RangeInclusive<u32> = 4..=65_536;

/// Parameters that hold the core's image.
#[derive(Debug, Clone)]
pub struct Fprime {
    image: Vec<u8>,
    component: String,
    part_bytes: usize,
}

impl Fprime {
    /// An accepted image for a component instance, its full name with dots.
    pub fn new(image: &[u8], component: &str, part_bytes: u32) -> Result<Fprime, Refusal> {
        let word = |text: &str| {
            let plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
            plain && text.as_bytes().first().is_some_and(|byte| !byte.is_ascii_digit())
        };
        if !component.split('.').all(word) {
            return Err(Refusal::Impossible(format!(
                "--component: found {component}; allowed: the full name of a component instance, as Ref.joint"
            )));
        }
        if !PART_BYTES.contains(&part_bytes) {
            return Err(Refusal::Impossible(format!(
                "--part-bytes: found {part_bytes}; allowed: {} to {}",
                PART_BYTES.start(),
                PART_BYTES.end()
            )));
        }
        Ok(Fprime { image: image.to_vec(), component: component.to_owned(), part_bytes: part_bytes as usize })
    }

    fn parts(&self) -> impl Iterator<Item = (String, Vec<u8>)> {
        self.image.chunks(self.part_bytes).enumerate().map(|(k, part)| {
            let mut bytes = part.to_vec();
            bytes.resize(self.part_bytes, 0);
            (format!("FLEXSPLINE_{k}"), bytes)
        })
    }

    /// The files: the values, and the model.
    pub fn files(&self, origin: &Origin) -> Vec<Written> {
        let values: serde_json::Map<_, _> = self.parts().map(|(name, bytes)| (name, bytes.into())).collect();
        let mut json = serde_json::Map::new();
        json.insert(self.component.clone(), values.into());
        let mut fpp = String::new();
        for line in origin.lines("that of the core: actual less nominal") {
            let _ = writeln!(fpp, "# {line}");
        }
        let _ = writeln!(fpp, "@ A part of an image of the core, {} bytes in all", self.image.len());
        let _ = writeln!(
            fpp,
            "array FlexsplinePart = [{}] U8\n\n# In the component of {}:",
            self.part_bytes, self.component
        );
        for (name, _) in self.parts() {
            let _ = writeln!(fpp, "# param {name}: FlexsplinePart");
        }
        vec![
            Written::text("flexspline_prm.json", serde_json::Value::from(json).to_string() + "\n"),
            Written::text("flexspline.fpp", fpp),
        ]
    }

    /// What a user has to know.
    pub fn notes(&self) -> Vec<String> {
        let parts = self.image.len().div_ceil(self.part_bytes);
        let mut notes = vec![format!(
            "FW_PARAM_BUFFER_MAX_SIZE has to be {} or more (506 by default); the parts one after the other are the \
             image",
            self.part_bytes
        )];
        if parts > DATABASE {
            notes.push(format!("PRMDB_NUM_DB_ENTRIES has to be {parts} or more ({DATABASE} by default)"));
        }
        notes
    }
}
