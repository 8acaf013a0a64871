//! Reports: one HTML file that works offline, on a phone, on paper, in light and dark.
//!
//! [`page`] holds what pages are made of, [`drive_report()`] fills one in for `tables` and `validate`,
//! `diagnosis_report` for `diagnose`, `calibration_report` for `calibrate`, `simulation_report` for `simulate`,
//! `sweep_report` for `sweep`; another command makes its own [`page::Page`] from the same parts, and writes
//! [`page::Page::html`]. `animation` takes the drive down in motion, `pack` makes numbers small. The browser's half is
//! in `web/`: `pack.js` undoes `pack`, `motion.js` places the drive of `animation`, `charts.js` and `fields.js` draw
//! figures.
#![forbid(unsafe_code)]

pub mod animation;
pub mod assets;
pub mod calibration_report;
pub mod diagnosis_report;
pub mod drive_figures;
mod drive_report;
pub mod flight_report;
pub(crate) mod pack;
pub mod page;
mod simulation_report;
mod sleeve_view;
pub mod sweep_report;

pub use animation::{Animation, AnimationError};
pub use drive_report::{DriveSources, DriveSubject, drive_report, shown_torque_n_m};
pub use pack::Packed;
pub use simulation_report::{MotionSeen, simulation_report};
