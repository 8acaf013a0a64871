//! Hostile input for the core: what each target feeds it, and what must hold whatever comes.
//!
//! A target is a function of bytes. `tests/run fuzz` lets libFuzzer look for bytes that break a promise; what it once
//! found lies in `corpus/` and is played again by `cargo test` here, without libFuzzer.
//!
//! | target | what is hostile | what must hold |
//! |---|---|---|
//! | [`image`] | the image: any bytes, wrong numbers under right checksums | an error, or a table as stated |
//! | [`upload`] | chunks: lost, repeated, out of order, too long | nothing but the whole image is accepted |
//! | [`store`] | bits of copies and images while ticks run | every output is a sound store's, or is flagged |
//! | [`c_interface`] | pointers, lengths, enumerations, order of calls | a status; what is not `Ok` changed nothing |
//! | [`saved`] | saved states | `None`, or a state that keeps the limits from the first tick on |
//! | [`runtime`] | settings, samples, torque, missed ticks, modes | rate and acceleration within their limits |

pub mod c_interface;
pub mod image;
pub mod runtime;
pub mod saved;
pub mod store;
pub mod tables;
pub mod upload;

/// Bytes that name what to do next; zeros when they have run out.
pub struct Choices<'a>(arbitrary::Unstructured<'a>);

impl<'a> Choices<'a> {
    /// Of the bytes of one run.
    pub fn new(data: &'a [u8]) -> Self {
        Self(arbitrary::Unstructured::new(data))
    }

    /// Whether all bytes were used.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Any value.
    pub fn any<T: arbitrary::Arbitrary<'a>>(&mut self) -> T {
        self.0.arbitrary().expect("numbers can be made of anything")
    }

    /// Below `limit`, which is at most 2¹⁶.
    pub fn below(&mut self, limit: usize) -> usize {
        if limit <= 256 { usize::from(self.any::<u8>()) % limit } else { usize::from(self.any::<u16>()) % limit }
    }

    /// −1 to 1.
    pub fn part(&mut self) -> f64 {
        f64::from(self.any::<i16>()) / 32_767.0
    }

    /// A number of any size and sign, now and then one that is none.
    pub fn wild(&mut self) -> f32 {
        match self.below(8) {
            0 => self.any(),
            1 => [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, -0.0, 1e-40, 0.0]
                [self.below(8)],
            _ => (self.part() * 10f64.powi(self.below(14) as i32 - 7)) as f32,
        }
    }

    /// Up to `most` bytes.
    pub fn bytes(&mut self, most: usize) -> &'a [u8] {
        let length = self.below(most.min(65_535) + 1).min(self.0.len());
        self.0.bytes(length).unwrap_or_default()
    }

    /// All bytes that are left.
    pub fn rest(self) -> &'a [u8] {
        self.0.take_rest()
    }
}
