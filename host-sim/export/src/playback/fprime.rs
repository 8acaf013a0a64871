//! F´: the image of the core as parameters, for `fprime-prm-write` of fprime-gds, and the FPP that declares them.
//!
//! A parameter has to fit the framework's buffer (`FW_PARAM_BUFFER_MAX_SIZE`: 506 bytes by default), so the image comes
//! in parts of one size, the last filled with zeros; the image says its own length (docs/reference/fxt.md).

use super::{Made, SIGN, Section, word};

/// Default of `PRMDB_NUM_DB_ENTRIES`.
const DATABASE: usize = 25;
/// Sizes of a part: a word, and far beyond what a database of parameters is for.
const PART_BYTES: std::ops::RangeInclusive<u32> = 4..=65_536;

/// The values and the model, of an accepted image, for a component instance by its full name with dots.
///
/// # Errors
/// The name or the size of a part cannot be.
pub fn fprime(section: Section<'_>, image: &[u8], component: &str, part_bytes: u32) -> Result<Made, String> {
    if !component.split('.').all(word) {
        return Err(format!(
            "--component: found {component}; allowed: the full name of a component instance, as Ref.joint"
        ));
    }
    if !PART_BYTES.contains(&part_bytes) {
        let [least, most] = [PART_BYTES.start(), PART_BYTES.end()];
        return Err(format!("--part-bytes: found {part_bytes}; allowed: {least} to {most}"));
    }
    let mut fpp = section.comment("# ", SIGN);
    fpp += &format!(
        "@ A part of an image of the core, {} bytes in all\narray FlexsplinePart = [{part_bytes}] U8\n\n# In the \
         component of {component}:\n",
        image.len()
    );
    let mut values = serde_json::Map::new();
    for (k, part) in image.chunks(part_bytes as usize).enumerate() {
        let mut bytes = part.to_vec();
        bytes.resize(part_bytes as usize, 0);
        values.insert(format!("FLEXSPLINE_{k}"), bytes.into());
        fpp += &format!("# param FLEXSPLINE_{k}: FlexsplinePart\n");
    }
    let parts = values.len();
    let json = serde_json::json!({ component: values }).to_string() + "\n";
    let mut notes = vec![format!(
        "FW_PARAM_BUFFER_MAX_SIZE has to be {part_bytes} or more (506 by default); the parts one after the other are \
         the image"
    )];
    if parts > DATABASE {
        notes.push(format!("PRMDB_NUM_DB_ENTRIES has to be {parts} or more ({DATABASE} by default)"));
    }
    let files = vec![("flexspline_prm.json", json.into_bytes()), ("flexspline.fpp", fpp.into_bytes())];
    Ok((files, notes))
}
