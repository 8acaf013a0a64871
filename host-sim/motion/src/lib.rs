//! A joint under control: motor, servo, strain wave drive and load, in fixed steps that give the same bits on every
//! machine.
//!
//! [`gear`] is the drive as a potential, [`plant`] what moves, [`friction`] what rubs, [`servo`] the motor's loops and
//! what they measure, [`keep`] its state as words, [`loops`] the theory of the loops that close over all of it.
//! [`rigid`] is the joint whose load has no mass: what it points at, its drive and its controllers. Servo, legs of the
//! target, noise and score are those of the joint with mass; `tests/firmware` compiles them for the target with it.
#![forbid(unsafe_code)]

pub mod dish;
pub mod flight;
pub mod friction;
pub mod gear;
pub mod keep;
pub mod legs;
pub mod loops;
pub mod noise;
pub mod on_board;
pub mod plant;
pub mod rigid;
pub mod scenario;
pub mod score;
pub mod servo;
pub mod table;
