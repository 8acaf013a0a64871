//! A joint under control: motor, servo, strain wave drive and load, in fixed steps that give the same bits on every
//! machine.
//!
//! [`gear`] is the drive as a potential, [`plant`] what moves, [`friction`] what rubs, [`servo`] the motor's loops and
//! their sensors, [`loops`] the theory of the loops that close over all of it.
//! `tests/firmware` compiles [`on_board`] for the target, and flies there the tapes of flights on this machine.
#![forbid(unsafe_code)]

pub mod flight;
pub mod friction;
pub mod gear;
pub mod legs;
pub mod loops;
pub mod noise;
pub mod on_board;
pub mod plant;
pub mod scenario;
pub mod score;
pub mod servo;
pub mod table;
