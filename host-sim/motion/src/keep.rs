//! What changes while something moves, as words of 64 bits: to go on from there later, or elsewhere, with the same
//! bits.

use flexspline::GeneratorAngle;

/// Can be kept, and taken up again by one that is made of the same.
pub trait Kept {
    /// Adds all that changes.
    fn keep(&self, to: &mut Vec<u64>);

    /// Takes up what was kept; `None` if words are missing or impossible, and then it is of no use any more.
    fn take(&mut self, from: &mut dyn Iterator<Item = u64>) -> Option<()>;
}

impl Kept for f64 {
    fn keep(&self, to: &mut Vec<u64>) {
        to.push(self.to_bits());
    }

    fn take(&mut self, from: &mut dyn Iterator<Item = u64>) -> Option<()> {
        *self = f64::from_bits(from.next()?);
        Some(())
    }
}

impl Kept for u32 {
    fn keep(&self, to: &mut Vec<u64>) {
        to.push(u64::from(*self));
    }

    fn take(&mut self, from: &mut dyn Iterator<Item = u64>) -> Option<()> {
        *self = u32::try_from(from.next()?).ok()?;
        Some(())
    }
}

impl Kept for GeneratorAngle {
    fn keep(&self, to: &mut Vec<u64>) {
        to.push(self.counts() as u64);
    }

    fn take(&mut self, from: &mut dyn Iterator<Item = u64>) -> Option<()> {
        *self = GeneratorAngle::from_counts(from.next()? as i64);
        Some(())
    }
}

impl<T: Kept> Kept for [T] {
    fn keep(&self, to: &mut Vec<u64>) {
        self.iter().for_each(|part| part.keep(to));
    }

    fn take(&mut self, from: &mut dyn Iterator<Item = u64>) -> Option<()> {
        self.iter_mut().try_for_each(|part| part.take(from))
    }
}

/// Keeps these fields of a type, in this order; lists as `field[..]`.
macro_rules! kept {
    ($name:ty { $($field:ident $([$all:tt])?),+ $(,)? }) => {
        impl $crate::keep::Kept for $name {
            fn keep(&self, to: &mut Vec<u64>) {
                $(self.$field$([$all])?.keep(to);)+
            }

            fn take(&mut self, from: &mut dyn Iterator<Item = u64>) -> Option<()> {
                $(self.$field$([$all])?.take(from)?;)+
                Some(())
            }
        }
    };
}
pub(crate) use kept;
