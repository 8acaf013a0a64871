//! The third dimension of the flexspline: its rim in a closed sleeve, at the end of a cup or of a hat, as thin shells.
//!
//! A cup lets its rim become oval almost without force: it cones, `W ~ x`, and nothing stretches. A rim in
//! the **middle** of a closed sleeve cannot. Two tubes that taper in opposite senses want opposite axial displacements
//! where they meet, so their walls stretch, and n = 2 becomes 20 to 260 times as stiff as the ring alone.
//!
//! One Fourier harmonic at a time (`shell`): each tube is condensed, from its far end on, onto the edge of the rim
//! (`tube`, `plate`); the rim is a band of shell with its teeth as ribs (`rim`, `ribs`), and what is asked of it is
//! what the lines under the generator do ([`Flexspline3d`]). `coupling` says what of it the plane model has not.
//!
//! Not in it: change of the shape by load beyond first order (it relieves nothing: 0.1 %), holes, corrugations, the
//! step between the middle surfaces of rim and tube (bores flush: 5 % stiffer).

mod coupling;
mod matrix;
mod model;
mod plate;
mod ribs;
mod rim;
mod shape;
mod shell;
mod tooth;
mod tube;

pub(crate) use coupling::Addition;
pub use model::{Flexspline3d, RimHarmonic, Rollers};
pub use plate::PlateEdge;
pub use shape::Station;
pub(crate) use tooth::pair_compliance;
pub use tube::End;
