//! Compensation of strain wave (harmonic) drives on a microcontroller.
#![cfg_attr(not(feature = "std"), no_std)]
#![forbid(unsafe_code)]
