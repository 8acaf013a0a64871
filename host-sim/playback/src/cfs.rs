//! NASA core Flight System: the image of the core as a table file that table services load, as `elf2cfetbl` would write
//! it, and the sources of a table app's own build.
//!
//! cFE file header (64 bytes) and table file header (52 bytes) big-endian, with the default lengths of names
//! (`CFE_FS_HDR_DESC_MAX_LEN` 32, `CFE_MISSION_TBL_MAX_FULL_NAME_LEN` 40); then the image as it is.

use std::fmt::Write;

use super::{Origin, Refusal, Written};

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

/// A table file for the core.
#[derive(Debug, Clone)]
pub struct Cfs {
    image: Vec<u8>,
    app: String,
    table: String,
    spacecraft: u32,
    processor: u32,
}

impl Cfs {
    /// An accepted image under a name `APP.TABLE`.
    pub fn new(image: &[u8], name: &str, spacecraft: u32, processor: u32) -> Result<Cfs, Refusal> {
        let word = |text: &str, most: usize| {
            let plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
            let begins = text.as_bytes().first().is_some_and(|byte| !byte.is_ascii_digit());
            plain && begins && text.len() < most
        };
        match name.split_once('.') {
            Some((app, table)) if word(app, APP_NAME) && word(table, TABLE_NAME) => {
                let [app, table] = [app, table].map(str::to_owned);
                Ok(Cfs { image: image.to_vec(), app, table, spacecraft, processor })
            }
            _ => Err(Refusal::Impossible(format!(
                "--table-name: found {name}; allowed: APP.TABLE, letters, digits and _, at most {} and {} of them",
                APP_NAME - 1,
                TABLE_NAME - 1
            ))),
        }
    }

    /// The files: the table, its source, the function that the app registers to validate it.
    pub fn files(&self, origin: &Origin) -> Vec<Written> {
        vec![
            Written { name: "flexspline.tbl".to_owned(), bytes: self.table_file(origin) },
            Written::text("flexspline_tbl.c", self.source(origin)),
            Written::text("flexspline_tbl.h", self.header(origin)),
            Written::text("flexspline_tbl_validate.c", VALIDATE.to_owned()),
        ]
    }

    /// What a user has to know.
    pub fn notes(&self) -> Vec<String> {
        let register = format!(
            "CFE_TBL_Register(&handle, \"{}\", sizeof(FLEXSPLINE_Table_t), CFE_TBL_OPT_DEFAULT, \
             FLEXSPLINE_ValidateTable) in app {}",
            self.table, self.app
        );
        let ids = (self.spacecraft == 0 || self.processor == 0).then(|| {
            "spacecraft or processor id is 0: refused where CFE_PLATFORM_TBL_VALID_SCID_COUNT or _PRID_COUNT is not 0"
                .to_owned()
        });
        std::iter::once(register).chain(ids).collect()
    }

    fn description(origin: &Origin) -> String {
        format!("flexspline {}", origin.table_id)
    }

    fn table_file(&self, origin: &Origin) -> Vec<u8> {
        // Time is left at zero: the same table is the same file.
        let words = [CONTENT, TABLE_IMAGE, FILE_HEADER, self.spacecraft, self.processor, 0, 0, 0];
        let mut bytes: Vec<u8> = words.into_iter().flat_map(u32::to_be_bytes).collect();
        bytes.extend(padded(&Self::description(origin), DESCRIPTION));
        bytes.extend([0, 0, self.image.len() as u32].into_iter().flat_map(u32::to_be_bytes));
        bytes.extend(padded(&format!("{}.{}", self.app, self.table), FULL_NAME));
        bytes.extend(&self.image);
        bytes
    }

    fn header(&self, origin: &Origin) -> String {
        let mut text = String::from("/*\n");
        for line in origin.lines("that of the core: actual less nominal") {
            let _ = writeln!(text, " * {line}");
        }
        text + &format!(
            " */\n#ifndef FLEXSPLINE_TBL_H\n#define FLEXSPLINE_TBL_H\n\n#include \"common_types.h\"\n\n#define \
             FLEXSPLINE_TABLE_BYTES {}\n\n/* An image of the core, little-endian on every target, read in place. \
             */\ntypedef struct\n{{\n    uint8 Image[FLEXSPLINE_TABLE_BYTES];\n}} FLEXSPLINE_Table_t;\n\n/* For \
             CFE_TBL_Register: 0 if the image is whole. */\nint32 FLEXSPLINE_ValidateTable(void *Table);\n\n#endif\n",
            self.image.len()
        )
    }

    fn source(&self, origin: &Origin) -> String {
        let mut text = String::from(
            "#include \"cfe_tbl_filedef.h\"\n#include \"flexspline_tbl.h\"\n\nFLEXSPLINE_Table_t FLEXSPLINE_Table = \
             {\n    {",
        );
        for (k, byte) in self.image.iter().enumerate() {
            text += if k % 16 == 0 { "\n        " } else { " " };
            let _ = write!(text, "0x{byte:02x},");
        }
        text + &format!(
            "\n    }}\n}};\n\nCFE_TBL_FILEDEF(FLEXSPLINE_Table, {}.{}, {}, flexspline.tbl)\n",
            self.app,
            self.table,
            Self::description(origin)
        )
    }
}

/// A text in a field of zeros.
fn padded(text: &str, length: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(length, 0);
    bytes
}

/// What `CFE_TBL_Register` is given: the image is of this format, as long as it says, and its CRC-32
/// (docs/reference/fxt.md) holds. The core checks the rest when it accepts the image.
const VALIDATE: &str = r#"#include "flexspline_tbl.h"

static uint32 FLEXSPLINE_Word(const uint8 *At)
{
    return (uint32)At[0] | (uint32)At[1] << 8 | (uint32)At[2] << 16 | (uint32)At[3] << 24;
}

/* CRC-32/ISO-HDLC, bit by bit: it runs once for a load. */
static uint32 FLEXSPLINE_Crc(const uint8 *At, uint32 Length)
{
    uint32 Crc = 0xffffffffU;
    uint32 k;
    int    Bit;

    for (k = 0; k < Length; ++k)
    {
        Crc ^= At[k];
        for (Bit = 0; Bit < 8; ++Bit)
        {
            Crc = (Crc >> 1) ^ ((Crc & 1U) ? 0xedb88320U : 0U);
        }
    }
    return ~Crc;
}

int32 FLEXSPLINE_ValidateTable(void *Table)
{
    static const uint8 Magic[8] = {0x89, 'F', 'X', 'T', '\r', '\n', 0x1a, '\n'};
    const uint8       *Image    = ((const FLEXSPLINE_Table_t *)Table)->Image;
    uint32             Length   = FLEXSPLINE_Word(Image + 12);
    int                k;

    for (k = 0; k < 8; ++k)
    {
        if (Image[k] != Magic[k])
        {
            return -1;
        }
    }
    if (Length < 16 || Length > FLEXSPLINE_TABLE_BYTES)
    {
        return -2;
    }
    if (FLEXSPLINE_Crc(Image, Length - 4) != FLEXSPLINE_Word(Image + Length - 4))
    {
        return -3;
    }
    return 0;
}
"#;
