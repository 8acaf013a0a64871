//! A joint with mass: motor, servo, strain wave drive and load, in fixed steps that give the same bits on every
//! machine.
//!
//! [`gear`] is the drive as a potential, [`plant`] what moves, [`friction`] what rubs, [`servo`] the motor's loops and
//! what they measure, [`keep`] its state as words, [`loops`] the theory of the loops that close over all of it.
#![forbid(unsafe_code)]

pub mod dish;
pub mod flight;
pub mod friction;
pub mod gear;
pub mod keep;
pub mod loops;
pub mod on_board;
pub mod plant;
pub mod scenario;
pub mod servo;
pub mod table;
