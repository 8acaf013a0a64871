//! FMUs for co-simulation with FMI 2.0: description, resources, page and libraries in one zip (section 2.3).
//!
//! The libraries are those of `flexspline-fmu`, the same in every FMU. What is simulated is in the resources, so nobody
//! needs a compiler.

mod description;
mod error;
mod libraries;

use std::io::{self, Write};

use flate2::Compression;
use flate2::write::DeflateEncoder;
use flexspline::Table;
use flexspline_fmu::joint::starts_of;
use flexspline_fmu::resources::{DESIGNED_FILE, DRIVE_FILE, MODEL_FILE, Resources, TABLE_FILE, drive_file};
use flexspline_fmu::variables::ModelKind;
use flexspline_motion::flight::{JointUnit, table_image};
use flexspline_motion::gear::Gear;
use rawzip::{CompressionMethod, ZipArchiveWriter};

use flexspline_fly::fly::{Flown, gear_at, unit};

pub use error::FmuExportError;
pub use libraries::{Library, Platform, find_libraries};

/// Temperature at which an FMU starts, as far as its table goes, °C.
const USUAL_C: f64 = 20.0;

/// An FMU but for its libraries.
#[derive(Debug, Clone)]
pub struct Fmu {
    resources: Resources,
    description: String,
}

/// The core's joint over a table.
///
/// # Errors
/// [`FmuExportError`].
pub fn compensation(image: Vec<u8>) -> Result<Fmu, FmuExportError> {
    let table = Table::check(&image)?;
    let [coldest, warmest] = table.temperature_range_c().map(f64::from);
    Fmu::new(ModelKind::Compensation, &[("drive_temperature", USUAL_C.clamp(coldest, warmest))], image, None)
}

/// A joint with mass: the drive that a table describes, compensated with that table; without one the scenario's unit
/// and table, as [`flexspline_fly::fly`] flies them.
///
/// # Errors
/// [`FmuExportError`].
pub fn joint(flown: &Flown, image: Option<Vec<u8>>) -> Result<Fmu, FmuExportError> {
    let scenario = &flown.scenario;
    let Some(image) = image else {
        let unit = unit(flown.kind, scenario.temperature_c);
        let image = table_image(scenario, &unit, table_id)?;
        let JointUnit { built, nominal, .. } = unit;
        return Fmu::new(ModelKind::Joint, &starts_of(scenario), image, Some([built, nominal]));
    };
    let table = Table::check(&image)?;
    let gear = gear_at(&table, scenario.temperature_c)?;
    Fmu::new(ModelKind::Joint, &starts_of(scenario), image, Some([gear.clone(), gear]))
}

impl Fmu {
    fn new(
        kind: ModelKind,
        starts: &[(&str, f64)],
        image: Vec<u8>,
        gears: Option<[Gear; 2]>,
    ) -> Result<Fmu, FmuExportError> {
        // Through the reader of the FMU itself: what it would refuse is refused here.
        let mut model = format!("model = {}\nguid = none\n", kind.name());
        for (name, start) in starts {
            model += &format!("{name} = {start}\n");
        }
        let drives = gears.as_ref().map(|gears| gears.each_ref().map(drive_file));
        let [built, designed] = drives.as_ref().map_or([None; 2], |[a, b]| [Some(&a[..]), Some(&b[..])]);
        let mut resources = Resources::parse(&model, image, [built, designed])?;
        resources.guid = guid(&resources);
        let description = description::xml(&resources);
        Ok(Fmu { resources, description })
    }

    /// The resources that its libraries read.
    pub fn resources(&self) -> &Resources {
        &self.resources
    }

    /// Writes it as a zip, the same bytes from the same parts.
    ///
    /// # Errors
    /// Of the writer.
    pub fn write(&self, out: &mut dyn Write, libraries: &[Library]) -> io::Result<()> {
        let mut zip = ZipArchiveWriter::new(Vec::new());
        let mut file = |name: &str, bytes: &[u8]| -> io::Result<()> {
            let file = zip.new_file(name).compression_method(CompressionMethod::DEFLATE).unix_permissions(0o644);
            let (mut entry, config) = file.start().map_err(io::Error::other)?;
            let mut content = config.wrap(DeflateEncoder::new(&mut entry, Compression::default()));
            content.write_all(bytes)?;
            let (encoder, check) = content.finish().map_err(io::Error::other)?;
            encoder.finish()?;
            entry.finish(check).map_err(io::Error::other)?;
            Ok(())
        };
        file("modelDescription.xml", self.description.as_bytes())?;
        for (name, bytes) in self.resource_files() {
            file(&format!("resources/{name}"), &bytes)?;
        }
        for library in libraries {
            let Platform { folder, extension, .. } = library.platform;
            let name = format!("binaries/{folder}/{}.{extension}", self.resources.kind.identifier());
            file(&name, &library.bytes)?;
        }
        file("documentation/index.html", description::page(&self.resources).as_bytes())?;
        for (name, text) in description::LICENCES {
            file(&format!("documentation/licenses/{name}"), text.as_bytes())?;
        }
        out.write_all(&zip.finish().map_err(io::Error::other)?)
    }

    /// The files of its resources, by name.
    pub(crate) fn resource_files(&self) -> Vec<(&'static str, Vec<u8>)> {
        let Resources { image, gears, .. } = &self.resources;
        let mut files = vec![(MODEL_FILE, self.resources.model_file().into_bytes()), (TABLE_FILE, image.clone())];
        if let Some([built, designed]) = gears {
            files.push((DRIVE_FILE, drive_file(built)));
            if built != designed {
                files.push((DESIGNED_FILE, drive_file(designed)));
            }
        }
        files
    }
}

/// Of all that the description and the resources say: the same for the same model, table and start values.
fn guid(resources: &Resources) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(flexspline_fmu::MARK.as_bytes());
    hasher.update(description::xml(resources).as_bytes());
    hasher.update(&resources.image);
    for gear in resources.gears.iter().flatten() {
        hasher.update(&drive_file(gear));
    }
    let hex = hasher.finalize().to_hex();
    let parts = [&hex[0..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..32]];
    format!("{{{}}}", parts.join("-"))
}

/// The id of a table by what is hashed for it.
fn table_id(hashed: &[u8]) -> [u8; 8] {
    let mut id = [0; 8];
    id.copy_from_slice(&blake3::hash(hashed).as_bytes()[..8]);
    id
}
