//! A target in legs of constant rate, joined by constant acceleration.

/// A stretch of time in which the target goes to a rate and keeps it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// How long, with the change of rate at its beginning, s.
    pub seconds: f64,
    /// Rate of the target at the output, rad/s.
    pub rate_rad_s: f64,
}

/// A rate held for this long is steady, s.
const STEADY_S: f64 = 0.5;

/// Target and torque from outside at one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// Time, s.
    pub time_s: f64,
    /// Target of the output, rad, and its rate and acceleration.
    pub target_rad: f64,
    /// rad/s.
    pub rate_rad_s: f64,
    /// rad/s².
    pub acceleration_rad_s2: f64,
    /// Whether the target has moved at this rate for half a second.
    pub steady: bool,
    /// Torque on the load at the beginning of the tick, without gravity's, N·m, and at its end.
    pub outside_n_m: [f64; 2],
}

/// Where it is on its legs, tick by tick.
#[derive(Clone, Debug, Default)]
pub struct Walk {
    leg: usize,
    leg_ends: f64,
    pub(crate) tick: u32,
    target_rad: f64,
    rate_rad_s: f64,
    even_s: f64,
}

impl Walk {
    /// The next tick, without a torque from outside; `None` beyond the last leg.
    pub fn next(&mut self, legs: &[Leg], acceleration_rad_s2: f64, tick_s: f64) -> Option<Moment> {
        let time_s = f64::from(self.tick) * tick_s;
        while time_s >= self.leg_ends - 0.5 * tick_s {
            self.leg_ends += legs.get(self.leg)?.seconds;
            self.leg += 1;
        }
        let wanted = legs.get(self.leg - 1)?.rate_rad_s;
        let most = acceleration_rad_s2 * tick_s;
        let change = (wanted - self.rate_rad_s).clamp(-most, most);
        let moment = Moment {
            time_s,
            target_rad: self.target_rad,
            rate_rad_s: self.rate_rad_s,
            acceleration_rad_s2: change / tick_s,
            steady: self.rate_rad_s != 0.0 && self.even_s >= STEADY_S,
            outside_n_m: [0.0; 2],
        };
        self.target_rad += (self.rate_rad_s + 0.5 * change) * tick_s;
        self.rate_rad_s += change;
        self.even_s = if change == 0.0 { self.even_s + tick_s } else { 0.0 };
        self.tick += 1;
        Some(moment)
    }
}
