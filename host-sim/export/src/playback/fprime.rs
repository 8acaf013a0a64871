//! F´: the image of the core as parameters, for `fprime-prm-write` of fprime-gds, and the FPP that declares them.
//!
//! A parameter has to fit the framework's buffer (`FW_PARAM_BUFFER_MAX_SIZE`: 506 bytes by default), so the image comes
//! in parts of one size, the last filled with zeros; the image says its own length (docs/reference/fxt.md).

use super::{Files, NameError, TableSection, word};

/// Bytes of a part: what the default buffer holds.
const PART_BYTES: usize = 500;

/// The values and the model, of an accepted image, for a component instance by its full name with dots.
///
/// # Errors
/// The name is another one.
pub fn fprime(section: TableSection<'_>, image: &[u8], component: &str) -> Result<Files, NameError> {
    if !component.split('.').all(word) {
        let allowed = "the full name of a component instance, as Ref.joint";
        return Err(NameError { option: "--component", found: component.to_owned(), allowed });
    }
    let mut fpp = section.comment("that of the core: actual less nominal");
    fpp += &format!(
        "@ A part of an image of the core, {} bytes in all\narray FlexsplinePart = [{PART_BYTES}] U8\n\n# In the \
         component of {component}:\n",
        image.len()
    );
    let mut values = serde_json::Map::new();
    for (k, part) in image.chunks(PART_BYTES).enumerate() {
        let mut bytes = part.to_vec();
        bytes.resize(PART_BYTES, 0);
        values.insert(format!("FLEXSPLINE_{k}"), bytes.into());
        fpp += &format!("# param FLEXSPLINE_{k}: FlexsplinePart\n");
    }
    let json = serde_json::json!({ component: values }).to_string() + "\n";
    Ok(vec![("flexspline_prm.json", json.into_bytes()), ("flexspline.fpp", fpp.into_bytes())])
}
