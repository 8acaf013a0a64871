//! Contact of the wave generator with the bore, and of the flexspline's flanks with those of the circular spline.
//!
//! Surfaces are smooth: a point of a surface is its exact undeformed position (circle, involute, rounding) plus the
//! interpolated displacement, and gaps are measured to exact outlines, not to facets. 0.05″ at the output is 12 nm at
//! the flank, which facets would drown.
//!
//! Signs: `gap > 0` open; `pressure >= 0` compressive. A penalty law `pressure = stiffness * <-gap>` with a stiffness
//! (N/mm³) so high that the answer does not depend on it; a generator bearing of finite stiffness acts in series. The
//! pressure itself does depend on it where a corner bears: the reported pressure of flanks is that of two elastic
//! bodies under the force that was found (`hertz`).

mod bore;
mod face;
mod flank;
mod hertz;
mod quadrature;

pub use bore::{BoreContact, BoreLaw, BorePressure, OpenEdges};
pub(crate) use face::{Across, Bearing, FaceLaw, Lean};
pub use flank::{
    AlongFace, BearingPlace, Configuration, FlankContact, FlankLaw, FlankLayout, FlankPair, FlankPlace, FlankPoint,
    FrictionHistory, PairAt, PairContribution, SlipPoint,
};
pub use quadrature::gauss_legendre;
