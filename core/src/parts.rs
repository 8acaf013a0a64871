//! The parts of [`Joint::tick`] one by one, so that `tests/firmware` can count what each takes. Not for flight.

use crate::drive::Drive;
use crate::play::PlayState;
use crate::store::Store;
pub use crate::table::OperatingPoint;
use crate::table::{Doubt, TableModel};
use crate::{GeneratorAngle, Joint, OutputAngle};

fn model<'s>(drive: &'s Drive, store: &'s Store) -> TableModel<'s, Store> {
    TableModel { memory: store, drive }
}

/// Locates a torque.
pub fn locate(store: &Store, torque_n_m: f32) -> OperatingPoint {
    store.locate(torque_n_m, 0, 0)
}

/// Nominal output, ripple and play; the error, counts.
pub fn forward(
    joint: &Joint,
    store: &Store,
    point: &OperatingPoint,
    play: &mut PlayState,
    generator: GeneratorAngle,
) -> i32 {
    model(joint.drive(), store).estimate(point, play, generator).error
}

/// The play operator alone, in the middle of a play of ±0.1 mrad.
pub fn play(play: &mut PlayState, nominal: OutputAngle) -> i32 {
    play.update(nominal, 0, 68_357, true)
}

/// The error on one side of the play where it brings the output to `target`, counts.
pub fn inverse(joint: &Joint, store: &Store, point: &OperatingPoint, target: OutputAngle, backward: bool) -> i32 {
    model(joint.drive(), store).solve(point, target, backward, &mut Doubt::default()).0
}
