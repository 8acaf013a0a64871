//! What the tests of the crates next to this one share. No part of the interface.

#![allow(missing_docs)]

pub use crate::table::reseal;
pub use crate::upset::{Upset, upsets};
pub use std::string::String;

pub mod fixture {
    pub use crate::fixture::*;
}
