//! The picture before the verdict: what a residual (measured less model) looks like, before anybody says why.
//!
//! Its orders over the angle of each wheel with their uncertainty. Everything is in arc-seconds at the output, angles
//! in radians, and can be written as JSON.
//!
//! Three angles matter in a strain wave gear. The contact passes the flexspline once in a generator turn (ψ), the
//! circular spline once in ψ−δ, which is 94/95 of it for a ratio of 95, and whatever sits on the output turns with δ.

mod orders;
mod rows;
mod spectrum;

pub use orders::{Line, NamedOrder, harmonics, named_orders};
pub use rows::{Axis, SizeMismatch};
pub use spectrum::{OrderSpectrum, Peak, order_spectrum};
pub(crate) use spectrum::{is_no_noise, strongest};

use rayon::prelude::*;
use serde::Serialize;

use crate::diagnosis::rows::Rows;
use crate::measurement::rms;
use rows::centred_by_direction;

/// The picture of a residual.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picture {
    /// Rows.
    pub rows: usize,
    /// Root mean square about zero, arcsec.
    pub rms_arcsec: f64,
    /// Orders in ψ, ψ−δ and δ.
    pub spectra: Vec<OrderSpectrum>,
}

impl Picture {
    /// The picture of a residual over the rows of a drive with this ratio: arcsec, one value for each row.
    ///
    /// # Errors
    /// There are more values than rows, or fewer.
    pub fn of(rows: &Rows, residual_arcsec: &[f64], ratio: f64) -> Result<Picture, SizeMismatch> {
        let (found, needed) = (residual_arcsec.len(), rows.len());
        if found != needed {
            return Err(SizeMismatch { found, needed });
        }
        let centred = centred_by_direction(rows, residual_arcsec);
        let spectrum = |axis: Axis| order_spectrum(axis, &axis.angles(rows), &centred, ratio);
        let spectra = Axis::ALL.into_par_iter().map(spectrum).collect();
        Ok(Picture { rows: needed, rms_arcsec: rms(residual_arcsec), spectra })
    }
}
