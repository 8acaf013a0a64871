//! Numbers in a page: quantised, as differences, byte plane by byte plane, deflated, in base64.
//!
//! A field that varies smoothly along its last axis has small differences, whose high bytes are nearly all zero;
//! collected in a plane of their own they cost almost nothing. A browser inflates them without a library
//! (`DecompressionStream`, format `deflate-raw`); `web/pack.js` undoes each step.
//!
//! | kind | stored | error at most |
//! |---|---|---|
//! | [`Packed::floats`] | the bytes of `f32`, four planes | that of `f32` |
//! | [`Packed::steps`] | multiples of `scale` from `offset`, 16-bit zigzag differences, two planes | half of `scale` |

use std::io::Write;

use flate2::Compression;
use flate2::write::DeflateEncoder;

use flexspline_base::robust::least_and_most;
use flexspline_export::base64;

/// An array as it stands in the page.
#[derive(Debug, Clone, PartialEq)]
pub struct Packed {
    /// Its name, by which it is looked up.
    pub name: String,
    /// `f32` or `i16`.
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
        let scale = scale.max(largest / f64::from(i16::MAX - 1));
        // On the grid, so that whole numbers stay whole.
        let offset = (offset / scale).round() * scale;
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
    pub(crate) fn shape_text(&self) -> String {
        self.shape.iter().map(usize::to_string).collect::<Vec<_>>().join(",")
    }
}

fn middle_and_reach(values: &[f64]) -> (f64, f64) {
    let (least, most) = least_and_most(values.iter().copied());
    if least > most { (0.0, 0.0) } else { (0.5 * (least + most), 0.5 * (most - least)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    /// The bytes of an array, by another base64 than the one that wrote them.
    fn inflated(packed: &Packed) -> Vec<u8> {
        const DIGITS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let text = packed.text.trim_end_matches('=');
        let bits: Vec<u32> = text.chars().map(|c| DIGITS.find(c).unwrap() as u32).collect();
        let mut bytes = Vec::new();
        for group in bits.chunks(4) {
            let joined = group.iter().fold(0, |all, six| all << 6 | six) << (6 * (4 - group.len()));
            bytes.extend(joined.to_be_bytes()[1..group.len()].iter());
        }
        let mut out = Vec::new();
        flate2::read::DeflateDecoder::new(bytes.as_slice()).read_to_end(&mut out).unwrap();
        out
    }

    fn steps_back(packed: &Packed) -> Vec<f64> {
        let bytes = inflated(packed);
        let count = bytes.len() / 2;
        let mut now = 0_i16;
        let value = |k: usize| {
            let z = u16::from_le_bytes([bytes[k], bytes[count + k]]);
            now = now.wrapping_add(((z >> 1) as i16) ^ -((z & 1) as i16));
            f64::from(now) * packed.scale + packed.offset
        };
        (0..count).map(value).collect()
    }

    #[test]
    fn steps_come_back_to_half_a_step_and_whole_numbers_whole() {
        let mut random = fastrand::Rng::with_seed(7);
        let values: Vec<f64> = (0..2000).map(|_| 5.0 * (random.f64() - 0.4)).collect();
        let packed = Packed::steps("x", &[40, 50], 1e-3, &values);
        assert_eq!(packed.scale, 1e-3);
        for (found, value) in steps_back(&packed).iter().zip(&values) {
            assert!((found - value).abs() <= 0.5001e-3, "{found} {value}");
        }
        let whole: Vec<f64> = (0..336).map(f64::from).collect();
        assert_eq!(steps_back(&Packed::steps("whole", &[336], 1.0, &whole)), whole);
    }

    #[test]
    fn a_range_too_wide_for_its_step_takes_a_coarser_one() {
        let values = [-1000.0, 0.0, 1000.0];
        let packed = Packed::steps("wide", &[3], 1e-4, &values);
        assert!(packed.scale > 1e-2, "{}", packed.scale);
        for (found, value) in steps_back(&packed).iter().zip(&values) {
            assert!((found - value).abs() <= 0.51 * packed.scale, "{found} {value}");
        }
    }

    #[test]
    fn smooth_fields_become_small() {
        let values: Vec<f64> = (0..10_000).map(|k| 0.3 * (f64::from(k) * 0.01).sin()).collect();
        let packed = Packed::steps("smooth", &[10_000], 1e-4, &values);
        assert!(packed.text.len() < 10_000, "{} characters for 80000 bytes", packed.text.len());
    }

    #[test]
    #[should_panic(expected = "as many values as its shape has places")]
    fn a_shape_that_does_not_fit_is_a_mistake() {
        Packed::floats("x", &[2, 2], [1.0]);
    }
}
