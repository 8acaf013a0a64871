//! F´: the image of the core as parameters, for `fprime-prm-write` of fprime-gds, and the FPP that declares them.
//!
//! A parameter has to fit the framework's buffer (`FW_PARAM_BUFFER_MAX_SIZE`: 506 bytes by default), so the image comes
//! in parts of one size, the last filled with zeros; the image says its own length (docs/reference/fxt.md).

use thiserror::Error;

use super::{Made, SIGN, TableSection, word};

/// Default of `PRMDB_NUM_DB_ENTRIES`.
const DATABASE: usize = 25;
/// Bytes of a part: what the default buffer holds.
const PART_BYTES: usize = 500;

/// A name that is none of a component instance.
#[derive(Debug, Error)]
#[error("--component: found {0}; allowed: the full name of a component instance, as Ref.joint")]
pub struct ComponentError(String);

/// The values and the model, of an accepted image, for a component instance by its full name with dots.
///
/// # Errors
/// The name is another one.
pub fn fprime(section: TableSection<'_>, image: &[u8], component: &str) -> Result<Made, ComponentError> {
    if !component.split('.').all(word) {
        return Err(ComponentError(component.to_owned()));
    }
    let mut fpp = section.comment("# ", SIGN);
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
    let parts = values.len();
    let json = serde_json::json!({ component: values }).to_string() + "\n";
    let mut notes = vec![format!(
        "FW_PARAM_BUFFER_MAX_SIZE has to be {PART_BYTES} or more (506 by default); the parts one after the other are \
         the image"
    )];
    if parts > DATABASE {
        notes.push(format!("PRMDB_NUM_DB_ENTRIES has to be {parts} or more ({DATABASE} by default)"));
    }
    let files = vec![("flexspline_prm.json", json.into_bytes()), ("flexspline.fpp", fpp.into_bytes())];
    Ok((files, notes))
}
