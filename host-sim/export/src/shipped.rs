//! Libraries that a released program has in it.

/// Names of the files and their contents; none where nobody named a folder of them when the program was built.
const SHIPPED: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/shipped.rs"));

/// The library of this name.
pub(crate) fn shipped(name: &str) -> Option<&'static [u8]> {
    SHIPPED.iter().find(|(file, _)| *file == name).map(|(_, bytes)| *bytes)
}
