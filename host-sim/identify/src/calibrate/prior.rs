//! Knowledge of a unit before it is measured: a nominal model, a table, or the ratio alone.

use std::f64::consts::TAU;
use std::path::Path;

use flexspline::Table;

use super::CalibrationError;
use super::parts::{State, flank};
use super::rows::Recorded;
use super::zero::steady;
use crate::extension::Model;
use crate::nominal::{Nominal, Spread, USUAL_TEMPERATURE_C};
use flexspline_design::tables::{PARTS_OF_A_TURN, was_recorded};
use flexspline_mechanics::drive::{DriveError, GeneratorKind};

/// Knowledge before a measurement.
#[derive(Clone)]
pub struct Prior<'a> {
    /// The nominal model; beside a table its ratio, teeth and temperature are used.
    pub nominal: Nominal,
    /// The table that takes its place.
    pub table: Option<&'a Table<'a>>,
    /// Name of the drive.
    pub drive: String,
    /// BLAKE3 of what the prior was read from.
    pub hash: [u8; 32],
    /// Generator that the table is marked with.
    pub kind: GeneratorKind,
    /// Generator angle of the logs where that of `table` is zero, rad.
    pub zero_rad: f64,
    /// Least load that is believed to decide the flank, N·m: a smaller one is lost in the noise of the logs' torque.
    pub least_friction_n_m: f64,
}

impl<'a> Prior<'a> {
    /// A drive known by a nominal model, called `drive`; the hash is that of the name.
    pub fn of_nominal(nominal: Nominal, drive: &str, kind: GeneratorKind) -> Prior<'a> {
        let hash = *blake3::hash(drive.as_bytes()).as_bytes();
        let drive = drive.to_owned();
        Prior { nominal, table: None, drive, hash, kind, zero_rad: 0.0, least_friction_n_m: 0.0 }
    }

    /// A drive known by a file, `nominal.toml` or `drive-extended.toml`, with the model that stands there.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_file(path: &Path, kind: GeneratorKind) -> Result<(Prior<'a>, Model), DriveError> {
        let (model, hash) = Model::read_hashed(path)?;
        let known = Prior::of_nominal(model.nominal.clone(), &path.display().to_string(), kind);
        Ok((Prior { hash, ..known }, model))
    }

    /// A drive known by its ratio alone: no wind-up, no play, no waves.
    pub fn of_ratio(ratio: f64, kind: GeneratorKind) -> Prior<'a> {
        let none = Spread { stiffness: 0.0, backlash: 0.0, harmonic: 0.0, harmonic_phase_rad: 0.0 };
        let nominal = Nominal {
            ratio,
            teeth: None,
            // Infinitely stiff.
            stiffness: vec![[0.0, f64::INFINITY]],
            backlash_arcsec: 0.0,
            friction_torque_n_m: 0.0,
            temperature_c: USUAL_TEMPERATURE_C,
            harmonics: Vec::new(),
            spread: none,
            kernels: None,
        };
        Prior::of_nominal(nominal, &format!("ratio {ratio}"), kind)
    }

    /// The same of a ratio that somebody gives.
    ///
    /// # Errors
    /// No gear of this kind has it.
    pub fn of_given_ratio(ratio: f64, kind: GeneratorKind) -> Result<Prior<'a>, CalibrationError> {
        if (2.0..=1e4).contains(&ratio.abs()) {
            return Ok(Prior::of_ratio(ratio, kind));
        }
        Err(CalibrationError::Known(format!("--ratio: found {ratio}, allowed: 2 to 10000, or negative")))
    }

    /// A drive known by a table.
    pub fn of_table(table: &'a Table<'a>, kind: GeneratorKind) -> Prior<'a> {
        let hash = *blake3::hash(table.image()).as_bytes();
        let drive = format!("table {}", table.id());
        Prior { table: Some(table), hash, ..Prior::of_nominal(Nominal::of_table(table), &drive, kind) }
    }

    /// Whether nothing but the ratio is known.
    pub fn is_empty(&self) -> bool {
        let n = &self.nominal;
        self.table.is_none()
            && n.harmonics.is_empty()
            && n.backlash_arcsec == 0.0
            && n.stiffness.iter().all(|[_, k]| k.is_infinite())
    }

    /// The drive as the core knows it.
    ///
    /// # Errors
    /// No pair of wheels has this ratio.
    pub(crate) fn core_drive(&self) -> Result<flexspline::Drive, CalibrationError> {
        if let Some(table) = self.table {
            return Ok(*table.drive());
        }
        self.nominal.core_drive().map_err(|error| CalibrationError::Known(error.to_string()))
    }

    /// Parts of the output's turn that rows were recorded at, and those of the logs that the table is of.
    pub(super) fn parts(&self, recorded: &Recorded) -> u64 {
        let of_logs = self.table.filter(|table| table.solver_residual() == 0.0);
        let middle_rad = |part: usize| TAU * self.nominal.ratio * (part as f64 + 0.5) / PARTS_OF_A_TURN as f64;
        let there = |part: &usize| of_logs.is_some_and(|table| was_recorded(table, middle_rad(*part) - self.zero_rad));
        (0..PARTS_OF_A_TURN).filter(there).fold(recorded.parts, |parts, part| parts | 1 << part)
    }

    /// Tooth pitches of the fixed wheel in a turn of the generator.
    pub(super) fn tooth_pitches(&self) -> f64 {
        self.core_drive().map_or(1.0, |drive| f64::from(drive.ripple_order()))
    }

    /// Load beyond which it decides the flank, N·m.
    pub(super) fn friction_n_m(&self) -> f64 {
        self.nominal.friction_torque_n_m.max(self.least_friction_n_m)
    }

    /// Error in steady motion, arcsec.
    pub(super) fn steady_arcsec(&self, at: &State) -> f64 {
        if let Some(table) = self.table {
            // Too small a load leaves the flank to the direction, as none does.
            let torque_n_m = if at.torque_n_m.abs() < self.least_friction_n_m { 0.0 } else { at.torque_n_m };
            return steady(table, &State { torque_n_m, ..*at }, self.zero_rad);
        }
        let n = &self.nominal;
        let play = 0.5 * flank(at, self.friction_n_m()) * n.backlash_arcsec;
        n.harmonics_arcsec(at.generator_rad) + n.wind_up_arcsec(at.torque_n_m) + play
    }
}
