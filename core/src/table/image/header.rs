//! The header of an image: what it is, what made it, and for which drive.

use super::layout::{
    BYTE_ORDER_MARK, FORMAT_VERSION, HEADER_BYTES, ID_OFFSET, MAGIC, PAGE_BYTES, RESERVED, TEXT_BYTES, image_bytes,
};
use super::sums::{page_intact, page_of};
use crate::angle::RAD_PER_COUNT;
use crate::drive::{Drive, FixedMember};
use crate::error::{Field, ImageError};
use crate::table::{Table, TableId};

/// End of the mesh level of a table that a data sheet completed, before the percent that units scatter.
const SHEET_MARK: &[u8] = b", sheet +-";

/// Reads fields of the header; the offsets are all inside it.
#[derive(Clone, Copy)]
pub(super) struct ImageHeader<'a>(&'a [u8; HEADER_BYTES]);

impl<'a> ImageHeader<'a> {
    fn bytes<const N: usize>(self, offset: usize) -> [u8; N] {
        self.0.get(offset..).and_then(|rest| rest.first_chunk::<N>()).copied().unwrap_or([0; N])
    }

    pub fn u8(self, offset: usize) -> u8 {
        u8::from_le_bytes(self.bytes(offset))
    }

    fn u16(self, offset: usize) -> u16 {
        u16::from_le_bytes(self.bytes(offset))
    }

    fn u32(self, offset: usize) -> u32 {
        u32::from_le_bytes(self.bytes(offset))
    }

    pub fn f32(self, offset: usize) -> f32 {
        f32::from_le_bytes(self.bytes(offset))
    }

    /// The text at `offset` without its padding.
    fn text(self, offset: usize, field: Field) -> Result<&'a str, ImageError> {
        let bytes = self.0.get(offset..offset.saturating_add(TEXT_BYTES)).unwrap_or_default();
        let length = bytes.iter().position(|byte| *byte == 0).unwrap_or(TEXT_BYTES);
        let (text, padding) = bytes.split_at_checked(length).unwrap_or_default();
        let printable = text.iter().all(|byte| (0x20..0x7f).contains(byte)) && padding.iter().all(|byte| *byte == 0);
        match core::str::from_utf8(text) {
            Ok(text) if printable => Ok(text),
            _ => Err(ImageError::Text { field }),
        }
    }
}

impl<'a> Table<'a> {
    fn header(&self) -> ImageHeader<'a> {
        ImageHeader(self.image.first_chunk().unwrap_or(&[0; HEADER_BYTES]))
    }

    /// The table id: printed by tools, matched with devices in the field.
    #[must_use]
    pub fn id(&self) -> TableId {
        TableId(self.header().bytes(ID_OFFSET))
    }

    /// The bytes hashed into the [id](Self::id), one part after another: the body with zeros where the id is.
    ///
    /// [`IdentityCheck`](crate::IdentityCheck) hashes it on board; on the host any BLAKE3 takes these parts, and the
    /// first eight bytes are compared.
    #[must_use]
    pub fn hashed(&self) -> [&'a [u8]; 3] {
        let body = self.image.get(..self.body_bytes).unwrap_or_default();
        let (before, rest) = body.split_at_checked(ID_OFFSET).unwrap_or_default();
        [before, &[0; 8], rest.get(8..).unwrap_or_default()]
    }

    /// BLAKE3 of the drive description the table was made from.
    #[must_use]
    pub fn drive_hash(&self) -> [u8; 32] {
        self.header().bytes(16)
    }

    /// The largest error the image states it may give, rad.
    #[must_use]
    pub fn error_limit_rad(&self) -> f32 {
        self.header().f32(152)
    }

    /// Program that made the table.
    #[must_use]
    pub fn tool_version(&self) -> &'a str {
        self.header().text(56, Field::ToolVersion).unwrap_or_default()
    }

    /// Mesh or data the samples came from.
    #[must_use]
    pub fn mesh_level(&self) -> &'a str {
        self.header().text(80, Field::MeshLevel).unwrap_or_default()
    }

    /// How far units scatter about a table that a data sheet completed, as a share of their stiffness: what ends its
    /// [mesh level](Self::mesh_level), `, sheet +-30 %`, as 0.3. `None` of a table that holds what its samples had.
    #[must_use]
    pub fn sheet_scatter(&self) -> Option<f32> {
        let text = self.mesh_level().as_bytes().strip_suffix(b" %")?;
        let digits = text.iter().rev().take_while(|byte| byte.is_ascii_digit()).take(2).count();
        let (mark, digits) = text.split_at_checked(text.len().saturating_sub(digits))?;
        let percent = digits.iter().fold(0u8, |sum, byte| {
            let digit = byte.saturating_sub(b'0');
            sum.saturating_mul(10).saturating_add(digit)
        });
        (percent > 0 && mark.ends_with(SHEET_MARK)).then(|| 0.01 * f32::from(percent))
    }

    /// How far wind-up may be off at a torque and temperature where units scatter about a data sheet, ± rad: of a unit
    /// that is softer by the [scatter](Self::sheet_scatter) `s`, the part `s / (1 - s)` of the wind-up from first
    /// contact on. 0 of a table that no data sheet completed, or where torque or temperature are no numbers.
    ///
    /// Beside a tick, not in it: to be added to the uncertainty that a tick states.
    #[must_use]
    pub fn sheet_uncertainty_rad(&self, torque_n_m: f32, temperature_c: f32) -> f32 {
        let scatter = self.sheet_scatter().unwrap_or(0.0);
        let mean = |torque: f32| self.at(torque, temperature_c).map_or(0, |point| point.mean);
        // What the mean jumps by is the play that a load takes up.
        let touch = self.first_contact_n_m(torque_n_m);
        let wind_up = mean(torque_n_m).saturating_sub(touch.map_or(0, mean));
        scatter / (1.0 - scatter) * (wind_up as f32 * RAD_PER_COUNT).abs()
    }

    /// The torque node beyond the last jump on the way from zero to a torque: where the flanks touch. The torque itself
    /// inside a jump about zero; `None` where there is no jump on the way.
    fn first_contact_n_m(&self, torque_n_m: f32) -> Option<f32> {
        let back = torque_n_m < 0.0;
        let jumps = self.torque_nodes_n_m().zip(self.torque_nodes_n_m().skip(1)).enumerate();
        let beyond = jumps.filter(|(node, _)| self.is_torque_jump(*node)).map(|(_, (low, high))| {
            let far = if back { -low } else { high };
            far.min(torque_n_m.abs())
        });
        let touch = beyond.filter(|far| *far > 0.0).fold(0.0, f32::max);
        (touch > 0.0).then_some(if back { -touch } else { touch })
    }

    /// Relative residual the solver reached; 0 for measured samples.
    #[must_use]
    pub fn solver_residual(&self) -> f32 {
        self.header().f32(124)
    }

    /// Largest deviation of the table from the samples it was made of, rad.
    #[must_use]
    pub fn projection_worst_rad(&self) -> f32 {
        self.header().f32(128)
    }

    /// Root mean square deviation of the table from the samples it was made of, rad.
    #[must_use]
    pub fn projection_rms_rad(&self) -> f32 {
        self.header().f32(132)
    }

    /// The image the table is read from.
    #[must_use]
    pub const fn image(&self) -> &'a [u8] {
        self.image
    }

    /// Number of `PAGE_BYTES` pages in the body.
    #[must_use]
    pub const fn page_count(&self) -> usize {
        self.body_bytes.div_ceil(PAGE_BYTES)
    }

    /// The bytes of one page; `None` beyond the last.
    #[must_use]
    pub fn page(&self, page: usize) -> Option<&'a [u8]> {
        page_of(self.image, self.body_bytes, page)
    }

    /// Whether a page still matches its CRC-32; false beyond the last. At most 256 bytes, 1400 instructions.
    #[must_use]
    pub fn is_page_intact(&self, page: usize) -> bool {
        page_intact(self.image, self.body_bytes, page)
    }
}

/// The body and the id of an image that need not have passed any check.
pub(crate) struct Laid<'a> {
    pub body: &'a [u8],
    pub id: TableId,
}

impl<'a> Laid<'a> {
    /// `None` if there is no header, or not the body that it states.
    pub fn of(image: &'a [u8]) -> Option<Self> {
        let header = ImageHeader(image.first_chunk()?);
        let body = image.get(..(header.u32(196) as usize).checked_mul(4)?)?;
        (body.len() >= HEADER_BYTES).then(|| Self { body, id: TableId(header.bytes(ID_OFFSET)) })
    }
}

/// Everything about an image that needs no knowledge of tables, but its checksum.
pub(super) fn check_envelope(image: &[u8]) -> Result<ImageHeader<'_>, ImageError> {
    let needed = image_bytes(1, 1, 0, [0; 3]);
    let found = image.len();
    let too_short = ImageError::TooShort { found, needed };
    let header = ImageHeader(image.first_chunk().ok_or(too_short)?);
    if found < needed {
        return Err(too_short);
    }
    if header.bytes(0) != MAGIC {
        return Err(ImageError::Magic);
    }
    // The mark before the version: swapped bytes would make the version look wrong.
    if header.u16(10) != BYTE_ORDER_MARK {
        return Err(ImageError::ByteOrder { found: header.u16(10) });
    }
    if header.u16(8) != FORMAT_VERSION {
        return Err(ImageError::Version { found: header.u16(8), allowed: FORMAT_VERSION });
    }
    let stated = header.u32(12) as usize;
    if stated != found {
        return Err(ImageError::Length { stated, found });
    }
    Ok(header)
}

/// Reserved bytes, texts, and the drive.
pub(super) fn check_identity(header: ImageHeader<'_>) -> Result<Drive, ImageError> {
    let reserved = header.0.get(RESERVED).unwrap_or_default();
    if let Some(at) = reserved.iter().position(|byte| *byte != 0) {
        return Err(ImageError::Reserved { offset: at.saturating_add(RESERVED.start) });
    }
    header.text(56, Field::ToolVersion)?;
    header.text(80, Field::MeshLevel)?;
    let fixed = match header.u8(105) {
        0 => FixedMember::Flexspline,
        1 => FixedMember::CircularSpline,
        found => return Err(ImageError::FixedMember { found }),
    };
    Drive::new(header.u16(106), header.u16(108), fixed).map_err(ImageError::Teeth)
}
