//! Files that firmware developers add to a project: tables, a reader in C99, the core as static libraries, vectors, and
//! what their build systems ask for.
//!
//! [`BundledTable`]s and [`BundleLibrary`]s to the files of a folder ([`Bundle::files`]); [`libraries`] finds or builds
//! the libraries. The sources in C and what is the same in every bundle are in this program; names, versions and lists
//! are put in where a template has `@NAME@`.

mod archive;
pub mod libraries;
mod vectors;

use std::collections::BTreeMap;
use std::fmt::Write as _;

use flexspline::Table;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use archive::tar_gz;
use flexspline_design::tables::{generator_of, put_bytes};
use flexspline_mechanics::drive::GeneratorKind;
use libraries::BundleLibrary;

/// Version of what is bundled: that of the workspace.
pub(crate) const VERSION: &str = env!("CARGO_PKG_VERSION");
/// File that identifies a bundle's folder.
pub const MANIFEST: &str = "manifest.json";
/// Steps of each table in the vectors.
const STEPS: usize = 400;

/// Path and text of what is the same in every bundle.
const FIXED: [(&str, &str); 8] = [
    ("c99/flexspline_table.c", include_str!("../../shipped/flexspline_table.c")),
    ("c99/flexspline_table.h", include_str!("../../shipped/flexspline_table.h")),
    ("include/flexspline.h", libraries::HEADER),
    ("vectors/check.c", include_str!("templates/check.c")),
    ("zephyr/module.yml", include_str!("templates/zephyr/module.yml")),
    ("zephyr/Kconfig", include_str!("templates/zephyr/Kconfig")),
    ("LICENSE-MIT", include_str!("../../shipped/LICENSE-MIT")),
    ("LICENSE-APACHE", include_str!("../../shipped/LICENSE-APACHE")),
];

/// Path and text of what names tables and versions.
const TEMPLATES: [(&str, &str); 7] = [
    ("CMakeLists.txt", include_str!("templates/CMakeLists.txt")),
    ("zephyr/CMakeLists.txt", include_str!("templates/zephyr/CMakeLists.txt")),
    ("idf_component.yml", include_str!("templates/idf_component.yml")),
    ("library.json", include_str!("templates/library.json")),
    ("library.properties", include_str!("templates/library.properties")),
    ("README.md", include_str!("templates/readme.in")),
    ("example.c", include_str!("templates/example.c")),
];

/// Faults of a bundle's tables.
#[derive(Debug, Error)]
pub enum BundleError {
    /// No table.
    #[error("{0}: holds no .fxt file")]
    NoTable(String),
    /// An image that the core refuses.
    #[error("{file}: {error}")]
    Image {
        /// The file.
        file: String,
        /// Error of the core.
        error: flexspline::ImageError,
    },
    /// Two files whose names are one in C.
    #[error("{first} and {second}: both are {name} in C; rename one of them")]
    Name {
        /// One file.
        first: String,
        /// The other.
        second: String,
        /// The name in C.
        name: String,
    },
}

/// A table to be bundled: checked.
#[derive(Debug)]
pub struct BundledTable {
    /// Name of its file without `.fxt`, and what it is in C: `two_roller`.
    stem: String,
    name: String,
    image: Vec<u8>,
}

impl BundledTable {
    /// Of a file's name and contents.
    ///
    /// # Errors
    /// Checks the image with the core.
    pub fn new(file: &str, stem: &str, image: Vec<u8>) -> Result<BundledTable, BundleError> {
        flexspline::Table::check(&image).map_err(|error| BundleError::Image { file: file.to_owned(), error })?;
        let letter = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
        Ok(BundledTable { stem: stem.to_owned(), name: stem.chars().map(letter).collect(), image })
    }

    /// The table in it.
    fn checked(&self) -> flexspline::Table<'_> {
        flexspline::Table::check(&self.image).expect("checked when it was taken up")
    }

    fn array(&self) -> String {
        format!("flexspline_{}_table", self.name)
    }

    /// Description, in one line.
    fn about(&self) -> String {
        let table = self.checked();
        let [torque_least, torque_most] = table.torque_range_n_m();
        let [least, most] = table.temperature_range_c();
        format!(
            "table {} of a {} generator, ratio {}, {torque_least} to {torque_most} N.m, {least} to {most} degrees C",
            table.id(),
            generator(&table),
            table.drive().exact_ratio()
        )
    }

    fn header(&self) -> String {
        let (name, array) = (self.name.to_uppercase(), self.array());
        format!(
            "/* {about}.\n * The image for fxt_open or flexspline_store_activate; the second is the same at another \
             address, as the core wants it. */\n#ifndef FLEXSPLINE_{name}_TABLE_H\n#define \
             FLEXSPLINE_{name}_TABLE_H\n\n#include <stdint.h>\n\n#define FLEXSPLINE_{name}_TABLE_ID \"{id}\"\n#define \
             FLEXSPLINE_{name}_TABLE_BYTES {bytes}u\n\n#ifdef __cplusplus\nextern \"C\" {{\n#endif\n\nextern const \
             uint8_t {array}[FLEXSPLINE_{name}_TABLE_BYTES];\nextern const uint8_t \
             {array}_second[FLEXSPLINE_{name}_TABLE_BYTES];\n\n#ifdef __cplusplus\n}}\n#endif\n\n#endif\n",
            about = self.about(),
            id = self.checked().id(),
            bytes = self.image.len(),
        )
    }

    /// The image as an array; `second` is the one at another address.
    fn source(&self, second: bool) -> String {
        let (suffix, section) =
            if second { ("_second", "FLEXSPLINE_SECOND_SECTION") } else { ("", "FLEXSPLINE_TABLE_SECTION") };
        let mut text = format!(
            "/* {about}. */\n#include \"flexspline_{name}.h\"\n\n/* A section of its own if {section} names one; at a \
             multiple of four. */\n#if defined(__GNUC__) && defined({section})\n__attribute__((section({section}), \
             aligned(4), used))\n#elif defined(__GNUC__)\n__attribute__((aligned(4)))\n#endif\nconst uint8_t \
             {array}{suffix}[{bytes}] = {{\n",
            about = self.about(),
            name = self.name,
            array = self.array(),
            bytes = self.image.len(),
        );
        put_bytes(&mut text, &self.image);
        text + "};\n"
    }
}

/// The generator of a table as the command line names it.
fn generator(table: &flexspline::Table<'_>) -> &'static str {
    generator_of(table).map_or("other", GeneratorKind::name)
}

/// `manifest.json`.
#[derive(Debug, Serialize, Deserialize)]
pub struct Manifest {
    /// `flexspline`: what the folder is a bundle of.
    pub bundle: String,
    /// Version of the program that wrote it, of the reader and of the libraries.
    pub version: String,
    /// Format of the images.
    pub table_format: u16,
    /// The tables.
    pub tables: Vec<TableEntry>,
    /// Targets of the static libraries.
    pub targets: Vec<String>,
    /// Every other file.
    pub files: Vec<FileEntry>,
}

/// A table of a bundle.
#[derive(Debug, Serialize, Deserialize)]
pub struct TableEntry {
    /// Its image.
    pub file: String,
    /// Its array in C.
    pub array: String,
    /// Its id.
    pub table_id: String,
    /// Kind of wave generator.
    pub generator: String,
    /// BLAKE3 of the drive it was made from.
    pub drive_blake3: String,
}

/// A file of a bundle.
#[derive(Debug, Serialize, Deserialize)]
pub struct FileEntry {
    /// From the top of the bundle.
    pub path: String,
    /// Its size.
    pub bytes: usize,
    /// Its BLAKE3.
    pub blake3: String,
}

/// Tables, at least one, each with a name of its own.
#[derive(Debug)]
pub struct Bundle {
    tables: Vec<BundledTable>,
}

impl Bundle {
    /// Of tables, at least one; `place` is where they were looked for.
    ///
    /// # Errors
    /// No table, or two of one name.
    pub fn new(tables: Vec<BundledTable>, place: &str) -> Result<Bundle, BundleError> {
        if tables.is_empty() {
            return Err(BundleError::NoTable(place.to_owned()));
        }
        for (number, table) in tables.iter().enumerate() {
            if let Some(other) = tables[..number].iter().find(|other| other.name == table.name) {
                let (first, second) = (format!("{}.fxt", other.stem), format!("{}.fxt", table.stem));
                return Err(BundleError::Name { first, second, name: table.name.clone() });
            }
        }
        Ok(Bundle { tables })
    }

    /// Path and contents of every file with these static libraries, the manifest last.
    pub fn files(&self, libraries: &[BundleLibrary]) -> (Vec<(String, Vec<u8>)>, Manifest) {
        let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
        let mut put = |path: String, contents: Vec<u8>| drop(files.insert(path, contents));
        FIXED.iter().for_each(|(path, text)| put((*path).to_owned(), (*text).into()));
        TEMPLATES.iter().for_each(|(path, text)| put((*path).to_owned(), self.filled_in(text, libraries).into()));
        put("include/flexspline_table.h".to_owned(), "#include \"../c99/flexspline_table.h\"\n".into());
        put("vectors/vectors.h".to_owned(), vectors::header(&self.tables).into());
        // Arduino compiles what is below src, and nothing else.
        put("src/flexspline_table.h".to_owned(), "#include \"../c99/flexspline_table.h\"\n".into());
        put("src/flexspline_reader.c".to_owned(), "#include \"../c99/flexspline_table.c\"\n".into());
        for table in &self.tables {
            let BundledTable { stem, name, image } = table;
            let checked = table.checked();
            put(format!("include/flexspline_{name}.h"), table.header().into());
            put(format!("src/flexspline_{name}.h"), format!("#include \"../include/flexspline_{name}.h\"\n").into());
            put(format!("tables/{stem}.fxt"), image.clone());
            for suffix in ["", "_second"] {
                let file = format!("flexspline_{name}{suffix}.c");
                put(format!("tables/{file}"), table.source(!suffix.is_empty()).into());
                put(format!("src/{file}"), format!("#include \"../tables/{file}\"\n").into());
            }
            put(format!("vectors/{name}.csv"), vectors::csv(&checked, STEPS).into());
            put(format!("vectors/{name}_vectors.h"), vectors::array(name, &checked, STEPS).into());
        }
        for library in libraries {
            put(format!("lib/{}/libflexspline.a", library.target), library.archive.clone());
        }
        let manifest = self.manifest(&files, libraries);
        let mut files: Vec<(String, Vec<u8>)> = files.into_iter().collect();
        let text = serde_json::to_string_pretty(&manifest).expect("names and numbers");
        files.push((MANIFEST.to_owned(), (text + "\n").into_bytes()));
        (files, manifest)
    }

    fn manifest(&self, files: &BTreeMap<String, Vec<u8>>, libraries: &[BundleLibrary]) -> Manifest {
        let table = |table: &BundledTable| {
            let checked = table.checked();
            TableEntry {
                file: format!("tables/{}.fxt", table.stem),
                array: table.array(),
                table_id: checked.id().to_string(),
                generator: generator(&checked).to_owned(),
                drive_blake3: blake3::Hash::from(checked.drive_hash()).to_hex().to_string(),
            }
        };
        let file = |(path, bytes): (&String, &Vec<u8>)| FileEntry {
            path: path.clone(),
            bytes: bytes.len(),
            blake3: blake3::hash(bytes).to_hex().to_string(),
        };
        Manifest {
            bundle: "flexspline".to_owned(),
            version: VERSION.to_owned(),
            table_format: Table::FORMAT_VERSION,
            tables: self.tables.iter().map(table).collect(),
            targets: libraries.iter().map(|library| library.target.clone()).collect(),
            files: files.iter().map(file).collect(),
        }
    }

    /// A template with its names, versions and lists.
    fn filled_in(&self, template: &str, libraries: &[BundleLibrary]) -> String {
        let sources = |around: &dyn Fn(String) -> String| {
            let both = self.tables.iter().flat_map(|table| {
                ["", "_second"].map(|suffix| around(format!("tables/flexspline_{}{suffix}.c", table.name)))
            });
            both.collect::<Vec<_>>().join(" ")
        };
        let mut table_list = String::new();
        for table in &self.tables {
            let _ = writeln!(table_list, "- `tables/{}.fxt`: {}", table.stem, table.about());
        }
        let targets: Vec<String> = libraries.iter().map(|library| format!("`{}`", library.target)).collect();
        let target_list = if targets.is_empty() { "none".to_owned() } else { targets.join(", ") };
        template
            .replace("@VERSION@", VERSION)
            .replace("@TABLE_SOURCES_QUOTED@", &sources(&|path| format!("\"{path}\"")))
            .replace("@TABLE_SOURCES@", &sources(&|path| path))
            .replace("@ZEPHYR_SOURCES@", &sources(&|path| format!("${{flexspline_folder}}/{path}")))
            .replace("@TABLE_LIST@", table_list.trim_end())
            .replace("@TARGET_LIST@", &target_list)
            .replace("@FIRST@", &self.tables[0].name)
    }
}
