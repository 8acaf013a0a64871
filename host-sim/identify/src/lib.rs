//! A drive that was measured: from the rows of a log to the causes of its error and to the table that corrects it.
//!
//! [`look`] says what a file holds, [`measurement`] reads it, [`calibrate`] makes the table of this unit, [`residual`]
//! is the error less a model, [`diagnosis`] names causes ([`causes`]) and [`extension`] puts them into the model.
//! [`synthesize`] makes rows with a hidden cause, [`replay`] runs the core over measured rows, [`wind_up`] reads a
//! torque from two encoders, [`nominal`] is a drive known from a catalogue alone.
#![forbid(unsafe_code)]

/// An enum whose variants each have a row of properties, which its method `row` gives; `ALL` has each in its order.
/// Behind a semicolon a variant may stand that holds another enum, of which a method gives the row; it is not in `ALL`.
macro_rules! table {
    ($(#[$meta:meta])* $vis:vis enum $Name:ident: $Row:ty {
        $($(#[$doc:meta])* $variant:ident = $row:expr,)*
        $(; $(#[$other_doc:meta])* $other:ident($Inner:ty) = $method:ident)?
    }) => {
        $(#[$meta])*
        $vis enum $Name {
            $($(#[$doc])* $variant,)*
            $($(#[$other_doc])* $other($Inner),)?
        }

        impl $Name {
            /// Each of them.
            #[allow(dead_code, reason = "not every table is gone through")]
            $vis const ALL: [$Name; [$($Name::$variant),*].len()] = [$($Name::$variant),*];

            pub(crate) const fn row(self) -> $Row {
                match self {
                    $($Name::$variant => $row,)*
                    $($Name::$other(of) => of.$method(),)?
                }
            }
        }
    };
}

/// A type is shown by its name, which a method gives.
macro_rules! shown_by_name {
    ($Name:ident::$name:ident) => {
        impl std::fmt::Display for $Name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.$name())
            }
        }
    };
}

pub mod calibrate;
pub mod causes;
pub mod diagnosis;
pub mod extension;
pub mod known_rows;
mod least_squares;
mod linear;
pub mod look;
pub mod measurement;
mod misfit;
pub mod nominal;
mod parts;
pub mod replay;
pub mod residual;
pub mod synthesize;
pub mod wind_up;
