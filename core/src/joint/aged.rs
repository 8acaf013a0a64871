//! Values measured more slowly than ticks: the last value, no older than a given number of ticks.

/// A measurement with its age, kept twice.
///
/// Call [`Self::tick`] once in every tick and give what it says to [`Input::torque_n_m`](crate::Input::torque_n_m): a
/// torque that is too old then is none, the joint keeps its correction for `debounce_ticks` ticks, fades it out, and
/// says so by [`Flags::NOT_CORRECTED`](crate::Flags::NOT_CORRECTED). For a temperature once for every
/// [`Store::set_temperature`](crate::Store::set_temperature), which takes no NaN; [`Self::is_stale`] then asks for the
/// sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Aged {
    /// Bits of the value, its age and the largest age, ticks; and the [`twin`] of each.
    words: [u32; 3],
    again: [u32; 3],
}

/// A word once more: each bit inverted, and 16 places further, so that the same bit of all words in a row is not the
/// same change of both.
const fn twin(word: u32) -> u32 {
    !word.rotate_left(16)
}

impl Aged {
    /// Nothing measured yet; what is older than `most_ticks` is not used.
    #[must_use]
    pub const fn new(most_ticks: u16) -> Self {
        Self::of(f32::NAN.to_bits(), (most_ticks as u32).wrapping_add(1), most_ticks as u32)
    }

    const fn of(value: u32, age: u32, most: u32) -> Self {
        Self { words: [value, age, most], again: [twin(value), twin(age), twin(most)] }
    }

    /// Whether there is no value that may be used.
    #[must_use]
    pub fn is_stale(&self) -> bool {
        let [_, age, most] = self.words;
        self.is_torn() | (age > most)
    }

    fn is_torn(&self) -> bool {
        self.words.into_iter().zip(self.again).any(|(one, other)| twin(one) != other)
    }

    /// A tick: what was measured in it, if anything; the value to use, or NaN if it is too old, or was hit by an upset
    /// since.
    ///
    /// Where the largest age was hit nothing is used until it is made anew.
    #[must_use]
    pub fn tick(&mut self, measured: Option<f32>) -> f32 {
        let [value, age, most] = self.words;
        let [_, _, most_again] = self.again;
        // The largest age is not measured anew.
        let known = twin(most) == most_again;
        let (value, age) = match measured {
            Some(measured) if known => (measured.to_bits(), 0),
            _ if self.is_torn() => (f32::NAN.to_bits(), most.saturating_add(1)),
            _ => (value, if age > most { age } else { age.wrapping_add(1) }),
        };
        if known {
            *self = Self::of(value, age, most);
        }
        if self.is_stale() { f32::NAN } else { f32::from_bits(value) }
    }
}

bits_of!(Aged { words, again });

#[cfg(test)]
mod tests {
    use super::*;
    use crate::upset::Upset;
    use std::string::String;

    #[test]
    fn a_measurement_is_used_until_it_is_too_old() {
        let mut torque = Aged::new(3);
        assert!(torque.is_stale() && torque.tick(None).is_nan());
        assert_eq!(torque.tick(Some(5.0)), 5.0);
        for _ in 0..3 {
            assert_eq!(torque.tick(None), 5.0);
        }
        for _ in 0..100_000 {
            assert!(torque.tick(None).is_nan() && torque.is_stale());
        }
        assert_eq!((torque.tick(Some(-1.0)), torque.is_stale()), (-1.0, false));
        // What is no number is none, however new.
        assert!(torque.tick(Some(f32::NAN)).is_nan());
        // With none allowed to be old each tick needs its own.
        let mut each = Aged::new(0);
        assert_eq!(each.tick(Some(2.0)), 2.0);
        assert!(each.tick(None).is_nan());
        let mut long = Aged::new(u16::MAX);
        assert!(long.tick(None).is_nan());
        assert_eq!((0..=u16::MAX).map(|i| long.tick((i == 0).then_some(1.0))).last(), Some(1.0));
    }

    /// Any bit: nothing is used until it is measured again, and no other age ever.
    #[test]
    fn an_upset_of_a_measurement_is_never_used() {
        let mut sound = Aged::new(3);
        let _ = sound.tick(Some(5.0));
        for bit in 0..sound.bits() {
            let mut hit = sound;
            hit.flip(bit, &mut String::new());
            assert!(hit.is_stale(), "{bit}");
            assert!(hit.tick(None).is_nan() && hit.is_stale(), "{bit}");
            let again = hit.tick(Some(6.0));
            assert!(again == 6.0 || again.is_nan(), "{bit}");
            (0..3).for_each(|_| assert!([6.0f32.to_bits(), f32::NAN.to_bits()].contains(&hit.tick(None).to_bits())));
            assert!(hit.tick(None).is_nan(), "{bit}");
        }
    }

    /// The same bit of any words in a row.
    #[test]
    fn a_column_of_a_measurement_is_never_used() {
        let mut sound = Aged::new(3);
        let _ = sound.tick(Some(5.0));
        let words = sound.bits() / 32;
        for (bit, first) in (0..32).flat_map(|bit| (0..words).map(move |first| (bit, first))) {
            let mut hit = sound;
            for word in first..words {
                hit.flip(32 * word + bit, &mut String::new());
                let mut asked = hit;
                assert!(hit.is_stale() && asked.tick(None).is_nan(), "{bit} {first} {word}");
            }
        }
    }
}
