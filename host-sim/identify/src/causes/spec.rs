//! The properties of a cause. Each stands in one file with its law, and in one line of the list in [`super`].

pub(crate) use super::parameter::{ARCSECONDS, ENCODERS, HALF_LOAD, HARMONIC, WHEELS, microns, phase};
pub(crate) use super::{CauseName, Factor, InTable, Kin, Need, ParameterSpec, TIME, Usual, number};

use super::ParameterName as Name;
use crate::diagnosis::candidate::{Excitation, Law, Simulated, Values};
use crate::extension::Placing;

/// The properties of a cause.
pub(crate) struct CauseSpec {
    /// Its name in files, snake case.
    pub name: &'static str,
    /// Its name in a sentence.
    pub words: &'static str,
    /// Its effect on the error, in a few words.
    pub does: &'static str,
    /// The laws that its misfit resembles.
    pub kin: Kin,
    /// The conditions that data have to meet before it is considered.
    pub needs: &'static [Need],
    /// Whether a table can hold it.
    pub in_table: InTable,
    /// Sets the fields of a drive file that hold it; nothing where none does.
    pub place: fn(&mut Placing<'_>),
    /// Its parameters as they may be given, under the names that the diagnosis reports.
    pub parameters: &'static [ParameterSpec],
    /// Pairs of parameters of which one follows from the other, with the factor from the first to the second.
    pub twins: &'static [(Name, Name, Factor)],
    /// Whether a load on the output makes much the same error, one that goes with the speed, the direction or the angle
    /// of the output.
    pub made_by_loads: bool,
    /// Whether something outside the library makes the same error, whatever is recorded: a shaft that is bent or
    /// misaligned before the output's encoder makes two waves in a turn, as a tilted encoder does.
    pub double_outside: bool,
    /// The models of it that are fitted to these rows.
    pub laws: fn(&Excitation<'_>) -> Vec<Law>,
    /// The cause with known parameters, as its law makes it.
    pub simulated: fn(&Excitation<'_>, Values<'_>) -> Simulated,
}

/// A cause without texts and parameters, like no other law, which a table can hold and no field of a drive.
pub(crate) const fn plain() -> CauseSpec {
    CauseSpec {
        name: "",
        words: "",
        does: "",
        kin: Kin::Unlike,
        needs: &[],
        in_table: InTable::Yes,
        place: |_| {},
        parameters: &[],
        twins: &[],
        made_by_loads: false,
        double_outside: false,
        laws: |_| Vec::new(),
        simulated: |_, _| unreachable!("each cause has its own"),
    }
}

/// Why a table holds no error of the output's encoder.
pub(crate) const OF_THE_OUTPUT_ENCODER: &str = "the output's encoder is wrong here, not the joint";
