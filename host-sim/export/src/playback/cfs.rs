//! NASA core Flight System: the image of the core as a table file that table services load, as `elf2cfetbl` would write
//! it, and the sources of a table app's own build.
//!
//! cFE file header (64 bytes) and table file header (52 bytes) big-endian, with the default lengths of names
//! (`CFE_FS_HDR_DESC_MAX_LEN` 32, `CFE_MISSION_TBL_MAX_FULL_NAME_LEN` 40); then the image as it is.

use thiserror::Error;

use super::{Made, SIGN, TableSection, word};

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

/// The table file, its sources, the function that the app registers to validate it, and the reader that this calls; of
/// an accepted image, under a name `APP.TABLE`, for a spacecraft and a processor.
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
    let mut source = String::from(
        "#include \"cfe_tbl_filedef.h\"\n#include \"flexspline_tbl.h\"\n\nFLEXSPLINE_Table_t FLEXSPLINE_Table = {\n    \
         {",
    );
    for (k, byte) in image.iter().enumerate() {
        source += if k % 16 == 0 { "\n        " } else { " " };
        source += &format!("0x{byte:02x},");
    }
    source +=
        &format!("\n    }}\n}};\n\nCFE_TBL_FILEDEF(FLEXSPLINE_Table, {full_name}, {description}, flexspline.tbl)\n");
    let header = format!(
        "/*\n{} */\n#ifndef FLEXSPLINE_TBL_H\n#define FLEXSPLINE_TBL_H\n\n#include \"common_types.h\"\n\n#define \
         FLEXSPLINE_TABLE_BYTES {}\n\n/* An image of the core, little-endian on every target, read in place. \
         */\ntypedef struct\n{{\n    uint8 Image[FLEXSPLINE_TABLE_BYTES];\n}} FLEXSPLINE_Table_t;\n\n/* For \
         CFE_TBL_Register: 0 if the image is whole. */\nint32 FLEXSPLINE_ValidateTable(void *Table);\n\n#endif\n",
        section.comment(" * ", SIGN),
        image.len()
    );
    let files = vec![
        ("flexspline.tbl", file),
        ("flexspline_tbl.c", source.into_bytes()),
        ("flexspline_tbl.h", header.into_bytes()),
        ("flexspline_tbl_validate.c", VALIDATE.into()),
        ("flexspline_table.c", include_bytes!("../../shipped/flexspline_table.c").into()),
        ("flexspline_table.h", include_bytes!("../../shipped/flexspline_table.h").into()),
    ];
    let mut notes = vec![format!(
        "CFE_TBL_Register(&handle, \"{table}\", sizeof(FLEXSPLINE_Table_t), CFE_TBL_OPT_DEFAULT, \
         FLEXSPLINE_ValidateTable) in app {app}; compile flexspline_table.c with -ffp-contract=off"
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

/// For `CFE_TBL_Register`: the checks of the C99 reader, as the core has them; 0 or minus the `fxt_reason`.
const VALIDATE: &str = "\
#include \"flexspline_tbl.h\"
#include \"flexspline_table.h\"

int32 FLEXSPLINE_ValidateTable(void *Table)
{
    const uint8 *Image  = ((const FLEXSPLINE_Table_t *)Table)->Image;
    uint32       Length = (uint32)Image[12] | (uint32)Image[13] << 8 |
                          (uint32)Image[14] << 16 | (uint32)Image[15] << 24;
    fxt_table    Opened;

    return Length > FLEXSPLINE_TABLE_BYTES ? -(int32)FXT_LENGTH : -(int32)fxt_open(&Opened, Image, Length).reason;
}
";
