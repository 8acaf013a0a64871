//! The picture before the verdict: what a residual (measured less model) looks like, before anybody says why.
//!
//! Over the angle of each wheel, by direction; its orders with their uncertainty; pulses that stay in one position;
//! what moves with time; and the noise under all that. Everything is in arc-seconds at the output, angles in radians,
//! and can be written as JSON.
//!
//! Three angles matter in a strain wave gear. The contact passes the flexspline once in a generator turn (ψ), the
//! circular spline once in ψ−δ, which is 94/95 of it for a ratio of 95, and whatever sits on the output turns with δ.

mod map;
mod noise;
mod orders;
mod pulses;
mod rows;
mod spectrum;
mod time;

pub use map::{AngleMap, Bin};
pub use noise::Noise;
pub use orders::{Line, NamedOrder, Wheel, harmonics, named_orders};
pub(crate) use pulses::Pulse;
pub use rows::{Axis, Direction, SizeMismatch};
pub(crate) use spectrum::sampled_twice;
pub use spectrum::{OrderSpectrum, Peak, order_spectrum};
pub(crate) use time::SessionDrift;

use serde::Serialize;

use crate::measurement::{Gear, Session, rms};
use rows::Rows;

/// The picture of a residual.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picture {
    /// Rows.
    pub rows: usize,
    /// Root mean square about zero, arcsec.
    pub rms_arcsec: f64,
    /// Noise under it.
    pub noise: Noise,
    /// Medians over the angles, for each direction.
    pub maps: Vec<AngleMap>,
    /// Orders in ψ, ψ−δ and δ.
    pub spectra: Vec<OrderSpectrum>,
    /// Pulses that stay in one position.
    pub pulses: Vec<Pulse>,
    /// How each session moves with time, or from row to row where time was not recorded.
    pub drift: Vec<SessionDrift>,
}

impl Picture {
    /// The picture of `residual_rad`, one value for each row of each session.
    pub fn of(sessions: &[Session], residual_rad: &[Vec<f64>], gear: &Gear) -> Result<Picture, SizeMismatch> {
        let rows = Rows::new(sessions, residual_rad, gear.ratio)?;
        let ((spectra, noise), (pulses, rest)) = rayon::join(
            || {
                let centred = rows.centred_by_direction();
                let spectra: Vec<OrderSpectrum> = Axis::ALL
                    .into_iter()
                    .map(|axis| order_spectrum(axis, &rows.angle(axis), &centred, gear.ratio))
                    .collect();
                let explained = spectra.first().map_or_else(Vec::new, |spectrum| spectrum.lines());
                let noise = noise::of(&rows, &centred, &explained);
                (spectra, noise)
            },
            || (pulses::find(&rows), (map::of(&rows), time::of(&rows))),
        );
        let (maps, drift) = rest;
        let count = rows.value.len();
        Ok(Picture { rows: count, rms_arcsec: rms(&rows.value), noise, maps, spectra, pulses, drift })
    }
}
