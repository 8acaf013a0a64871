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
pub use noise::ResidualNoise;
pub use orders::{Line, NamedOrder, Wheel, harmonics, named_orders};
pub(crate) use pulses::Pulse;
pub use rows::{Axis, Direction, SizeMismatch};
pub use spectrum::{OrderSpectrum, Peak, order_spectrum};
pub(crate) use time::SessionDrift;

use serde::Serialize;

use crate::diagnosis::rows::Rows;
use crate::measurement::rms;
use rows::ResidualRows;

/// The picture of a residual.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picture {
    /// Rows.
    pub rows: usize,
    /// Root mean square about zero, arcsec.
    pub rms_arcsec: f64,
    /// Noise under it.
    pub noise: ResidualNoise,
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
    /// The picture of a residual over the rows of a drive with this ratio: arcsec, one value for each row.
    ///
    /// # Errors
    /// There are more values than rows, or fewer.
    pub fn of(rows: &Rows, residual_arcsec: &[f64], ratio: f64) -> Result<Picture, SizeMismatch> {
        let residual = ResidualRows::new(rows, residual_arcsec)?;
        let ((spectra, noise), (pulses, rest)) = rayon::join(
            || {
                let centred = residual.centred_by_direction();
                let spectra: Vec<OrderSpectrum> = Axis::ALL
                    .into_iter()
                    .map(|axis| order_spectrum(axis, &residual.angle(axis), &centred, ratio))
                    .collect();
                let explained = spectra.first().map_or_else(Vec::new, |spectrum| spectrum.lines());
                let noise = noise::of(rows, &centred, &explained);
                (spectra, noise)
            },
            || (pulses::find(&residual), (map::of(&residual), time::of(&residual))),
        );
        let (maps, drift) = rest;
        Ok(Picture { rows: rows.len(), rms_arcsec: rms(residual_arcsec), noise, maps, spectra, pulses, drift })
    }
}
