//! Slower rate groups of the firmware.

/// Ticks in which a slower group runs: every `divisor`-th, from `offset` on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RateGroup {
    divisor: u32,
    offset: u32,
}

impl RateGroup {
    /// A group; `None` unless 1 ≤ `divisor` and `offset` < `divisor`.
    #[must_use]
    pub const fn new(divisor: u32, offset: u32) -> Option<Self> {
        if divisor == 0 || offset >= divisor { None } else { Some(Self { divisor, offset }) }
    }

    /// Whether it runs in tick number `tick`.
    #[must_use]
    pub fn is_due(self, tick: u32) -> bool {
        tick.checked_rem(self.divisor) == Some(self.offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_groups_run_when_they_are_due() {
        let group = RateGroup::new(10, 3).unwrap();
        assert!((0..100).filter(|&tick| group.is_due(tick)).eq((0..10).map(|i| 10 * i + 3)));
        assert_eq!((RateGroup::new(0, 0), RateGroup::new(5, 5)), (None, None));
    }
}
