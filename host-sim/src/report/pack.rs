//! Numbers in a page: quantised, as differences, byte plane by byte plane, deflated, in base64.
//!
//! A field that varies smoothly along its last axis has small differences, whose high bytes are nearly all zero; collected in a
//! plane of their own they cost almost nothing. A browser inflates them without a library (`DecompressionStream`,
//! format `deflate-raw`); `web/pack.js` undoes each step.
//!
//! | kind | stored | error at most |
//! |---|---|---|
//! | [`Packed::floats`] | the bytes of `f32`, four planes | that of `f32` |
//! | [`Packed::steps`] | multiples of `scale` from `offset`, 16 bits, zigzag differences, two planes | half of `scale` |
//! | [`Packed::levels`] | multiples of `scale` from `offset`, 8 bits, zigzag differences | half of `scale` |

use std::io::Write;

use flate2::Compression;
use flate2::write::DeflateEncoder;

use crate::export::base64;

/// An array as it stands in the page.
#[derive(Debug, Clone, PartialEq)]
pub struct Packed {
    /// What it is looked up by.
    pub name: String,
    /// `f32`, `i16` or `u8`.
    pub kind: &'static str,
    /// Lengths of its axes, the last one running fastest.
    pub shape: Vec<usize>,
    /// Value of a unit of what is stored.
    pub scale: f64,
    /// Value of a stored zero.
    pub offset: f64,
    /// The bytes, base64 of raw deflate.
    pub text: String,
}

impl Packed {
    /// Every value to single precision. Values that are not finite come back as they are.
    pub fn floats(name: impl Into<String>, shape: &[usize], values: impl IntoIterator<Item = f64>) -> Packed {
        let bytes: Vec<[u8; 4]> = values.into_iter().map(|x| (x as f32).to_le_bytes()).collect();
        let planes = (0..4).flat_map(|plane| bytes.iter().map(move |b| b[plane])).collect();
        Packed::of(name.into(), "f32", shape, (1.0, 0.0), bytes.len(), planes)
    }

    /// Values on a grid of `scale`, or of a coarser one that 16 bits can span. Values must be finite.
    pub fn steps(name: impl Into<String>, shape: &[usize], scale: f64, values: &[f64]) -> Packed {
        let (offset, largest) = middle_and_reach(values);
        let scale = scale.max(largest / f64::from(i16::MAX));
        let mut before = 0_i16;
        let bytes: Vec<[u8; 2]> = values
            .iter()
            .map(|x| {
                let now = ((x - offset) / scale).round() as i16;
                let step = now.wrapping_sub(before);
                before = now;
                ((step << 1) ^ (step >> 15)).to_le_bytes()
            })
            .collect();
        let planes = (0..2).flat_map(|plane| bytes.iter().map(move |b| b[plane])).collect();
        Packed::of(name.into(), "i16", shape, (scale, offset), bytes.len(), planes)
    }

    /// Values between 0 and `largest` in 255 levels; what lies outside is moved to the nearer end.
    pub fn levels(name: impl Into<String>, shape: &[usize], largest: f64, values: &[f64]) -> Packed {
        let scale = largest / 255.0;
        let mut before = 0_u8;
        let bytes: Vec<u8> = values
            .iter()
            .map(|x| {
                let now = (x / scale).round() as u8;
                let step = now.wrapping_sub(before) as i8;
                before = now;
                ((step << 1) ^ (step >> 7)) as u8
            })
            .collect();
        Packed::of(name.into(), "u8", shape, (scale, 0.0), bytes.len(), bytes)
    }

    fn of(
        name: String,
        kind: &'static str,
        shape: &[usize],
        (scale, offset): (f64, f64),
        count: usize,
        bytes: Vec<u8>,
    ) -> Packed {
        assert_eq!(shape.iter().product::<usize>(), count, "{name}: as many values as its shape has places");
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
        let deflated = encoder.write_all(&bytes).and_then(|()| encoder.finish()).expect("memory can be written to");
        let text = String::from_utf8(base64(&deflated)).expect("base64 is ASCII");
        Packed { name, kind, shape: shape.to_vec(), scale, offset, text }
    }

    /// The shape as the page has it.
    pub fn shape_text(&self) -> String {
        self.shape.iter().map(usize::to_string).collect::<Vec<_>>().join(",")
    }
}

fn middle_and_reach(values: &[f64]) -> (f64, f64) {
    let (least, most) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    if least > most { (0.0, 0.0) } else { (0.5 * (least + most), 0.5 * (most - least)) }
}
