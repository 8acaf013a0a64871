//! NASA core Flight System: the image of the core as a table file that table services load, as `elf2cfetbl` would write
//! it.
//!
//! cFE file header (64 bytes) and table file header (52 bytes) big-endian, with the default lengths of names
//! (`CFE_FS_HDR_DESC_MAX_LEN` 32, `CFE_MISSION_TBL_MAX_FULL_NAME_LEN` 40); then the image as it is.

use thiserror::Error;

use super::{Made, TableSection, word};

/// `CFE_FS_FILE_CONTENT_ID`: 'cFE1'.
const CONTENT: u32 = 0x6346_4531;
/// `CFE_FS_SubType_TBL_IMG`.
const TABLE_IMAGE: u32 = 8;
/// Length of the file header.
const FILE_HEADER: u32 = 64;
/// Length of its description, the last byte zero.
const DESCRIPTION: usize = 32;
/// Length of a full table name, the last byte zero; of its two halves.
const FULL_NAME: usize = 40;
const APP_NAME: usize = 20;
const TABLE_NAME: usize = 16;
/// Default of `CFE_PLATFORM_TBL_MAX_SNGL_TABLE_SIZE`.
pub const MAX_TABLE_BYTES: usize = 16_384;

/// A name that is none of a table.
#[derive(Debug, Error)]
#[error(
    "--table-name: found {found}; allowed: APP.TABLE, letters, digits and _, at most {} and {} of them",
    APP_NAME - 1,
    TABLE_NAME - 1
)]
pub struct TableNameError {
    found: String,
}

/// The table file of an accepted image, under a name `APP.TABLE`, for a spacecraft and a processor.
///
/// # Errors
/// The name is another one.
pub fn cfs(section: TableSection<'_>, image: &[u8], full_name: &str, ids: [u32; 2]) -> Result<Made, TableNameError> {
    let fits = |name: &str, field: usize| word(name) && name.len() < field;
    let Some((app, table)) =
        full_name.split_once('.').filter(|(app, table)| fits(app, APP_NAME) && fits(table, TABLE_NAME))
    else {
        return Err(TableNameError { found: full_name.to_owned() });
    };
    let description = format!("flexspline {}", section.table.id());
    // Time is left at zero: the same table is the same file.
    let words = [CONTENT, TABLE_IMAGE, FILE_HEADER, ids[0], ids[1], 0, 0, 0];
    let mut file: Vec<u8> = words.into_iter().flat_map(u32::to_be_bytes).collect();
    file.extend(padded(&description, DESCRIPTION));
    file.extend([0, 0, image.len() as u32].into_iter().flat_map(u32::to_be_bytes));
    file.extend(padded(full_name, FULL_NAME));
    file.extend(image);
    let files = vec![("flexspline.tbl", file)];
    let mut notes = vec![format!(
        "CFE_TBL_Register(&handle, \"{table}\", {}, CFE_TBL_OPT_DEFAULT, validate) in app {app}",
        image.len()
    )];
    if ids.contains(&0) {
        let checked = "CFE_PLATFORM_TBL_VALID_SCID_COUNT or _PRID_COUNT is not 0";
        notes.push(format!("spacecraft or processor id is 0: refused where {checked}"));
    }
    Ok((files, notes))
}

/// A text in a field of zeros.
fn padded(text: &str, length: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(length, 0);
    bytes
}
