//! The state of a simulation as words of 64 bits: to go on from there later, or elsewhere, with the same bits.

use flexspline::{Direction, GeneratorAngle, JOINT_STATE_WORDS, JointState, TorquePath};

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

impl Kept for Direction {
    fn keep(&self, to: &mut Vec<u64>) {
        u32::from(*self == Direction::Backward).keep(to);
    }

    fn take(&mut self, from: &mut dyn Iterator<Item = u64>) -> Option<()> {
        let mut backward = 0_u32;
        backward.take(from)?;
        *self = if backward == 0 { Direction::Forward } else { Direction::Backward };
        Some(())
    }
}

impl Kept for JointState {
    fn keep(&self, to: &mut Vec<u64>) {
        self.words()[..].keep(to);
    }

    fn take(&mut self, from: &mut dyn Iterator<Item = u64>) -> Option<()> {
        let mut words = [0_u32; JOINT_STATE_WORDS];
        words[..].take(from)?;
        *self = JointState::of_words(&words)?;
        Some(())
    }
}

impl Kept for TorquePath {
    fn keep(&self, to: &mut Vec<u64>) {
        self.kept()[..].keep(to);
    }

    fn take(&mut self, from: &mut dyn Iterator<Item = u64>) -> Option<()> {
        let mut bits = self.kept();
        bits[..].take(from)?;
        self.go_on(bits);
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
