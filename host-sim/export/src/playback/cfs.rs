//! NASA core Flight System: the image of the core as a table file that table services load, as `elf2cfetbl` would write
//! it.
//!
//! cFE file header (64 bytes) and table file header (52 bytes) big-endian, with the default lengths of names
//! (`CFE_FS_HDR_DESC_MAX_LEN` 32, `CFE_MISSION_TBL_MAX_FULL_NAME_LEN` 40); then the image as it is.

use super::{Files, NameError, TableSection, word};

/// `CFE_FS_FILE_CONTENT_ID`: 'cFE1'.
const CONTENT: u32 = 0x6346_4531;
/// `CFE_FS_SubType_TBL_IMG`.
const TABLE_IMAGE: u32 = 8;
/// Length of the file header.
const FILE_HEADER: u32 = 64;
/// Length of both headers; each ends with a text in a field of zeros.
const HEADERS: usize = 116;
/// Lengths of the two halves of a full table name, the last byte zero.
const APP_NAME: usize = 20;
const TABLE_NAME: usize = 16;
/// Default of `CFE_PLATFORM_TBL_MAX_SNGL_TABLE_SIZE`.
pub const MAX_TABLE_BYTES: usize = 16_384;

/// Names that `--table-name` takes.
const FULL_NAME: &str = "APP.TABLE, letters, digits and _, at most 19 and 15 of them";

/// The table file of an accepted image, under a name `APP.TABLE`, for a spacecraft and a processor.
///
/// # Errors
/// The name is another one.
pub fn cfs(section: TableSection<'_>, image: &[u8], full_name: &str, ids: [u32; 2]) -> Result<Files, NameError> {
    let fits = |name: &str, field: usize| word(name) && name.len() < field;
    if full_name.split_once('.').is_none_or(|(app, table)| !fits(app, APP_NAME) || !fits(table, TABLE_NAME)) {
        return Err(NameError { option: "--table-name", found: full_name.to_owned(), allowed: FULL_NAME });
    }
    // Time is left at zero: the same table is the same file.
    let words = [CONTENT, TABLE_IMAGE, FILE_HEADER, ids[0], ids[1], 0, 0, 0];
    let mut file: Vec<u8> = words.into_iter().flat_map(u32::to_be_bytes).collect();
    file.extend(format!("flexspline {}", section.table.id()).bytes());
    file.resize(FILE_HEADER as usize, 0);
    file.extend([0, 0, image.len() as u32].into_iter().flat_map(u32::to_be_bytes));
    file.extend(full_name.bytes());
    file.resize(HEADERS, 0);
    file.extend(image);
    Ok(vec![("flexspline.tbl", file)])
}
