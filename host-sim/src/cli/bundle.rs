//! `flexspline bundle`: what firmware people add to a project.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::context::{Context, image_file};
use super::{Failure, bad_file};
use flexspline_base::output::{Outputs, WholeFolder, prepare_folder};
use flexspline_base::suggest::did_you_mean;
use flexspline_export::bundle::libraries::{BundleLibrary, LibraryError, Places, TARGETS};
use flexspline_export::bundle::{Bundle, BundledTable, MANIFEST, Manifest, TableEntry, tar_gz};

/// Pack tables, a C99 reader, the core as static libraries, test vectors and build files into one firmware folder
///
/// CMake, Zephyr, PlatformIO, ESP-IDF and Arduino can use the folder as it is: c99/ (the reader), include/, tables/ (as
/// .fxt and as C), lib/<target>/ (the core), vectors/ (expected outputs for a port) and manifest.json. An unmodified
/// bundle is replaced; any other existing folder is left alone.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline bundle --tables out --out firmware/flexspline
  flexspline bundle --tables out/cam.fxt --target thumbv7em-none-eabihf --out bundle --archive
  flexspline bundle --tables out --no-core --out bundle")]
pub(super) struct BundleCommand {
    /// Folder with table images, or one image
    #[arg(long, value_name = "DIR|FILE.fxt")]
    tables: PathBuf,
    /// Targets of the static library, separated by commas or repeated; default: all that are available
    #[arg(long = "target", value_name = "TARGET", value_delimiter = ',')]
    targets: Vec<String>,
    /// No static libraries, only the reader in C99
    #[arg(long, conflicts_with_all = ["targets", "libraries"])]
    no_core: bool,
    /// Folder with TARGET/libflexspline.a; default: those in a program that was released, or a build of these sources
    #[arg(long, value_name = "DIR")]
    libraries: Option<PathBuf>,
    /// Also write the folder as one file, DIR.tar.gz
    #[arg(long)]
    archive: bool,
}

/// So that a line of them has some hundred characters.
const TARGETS_A_LINE: usize = 4;

/// Report that `--json` prints.
#[derive(Debug, Serialize)]
struct Bundled {
    folder: String,
    archive: Option<String>,
    tables: Vec<TableEntry>,
    targets: Vec<String>,
    missing: Vec<Missing>,
    files: Vec<String>,
}

/// A target without a library.
#[derive(Debug, Serialize)]
struct Missing {
    target: String,
    why: String,
}

impl BundleCommand {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        let out = self.out(context)?;
        let tables = self.read_tables()?;
        let bundle = Bundle::new(tables, &self.tables.display().to_string()).map_err(bad_input)?;
        let (libraries, missing) = self.libraries(context)?;
        let (files, manifest) = bundle.files(&libraries);
        let archive = self.write(&out, &files)?;
        let bundled = Bundled {
            folder: out.display().to_string(),
            archive: archive.map(|path| path.display().to_string()),
            tables: manifest.tables,
            targets: manifest.targets,
            missing,
            files: files.into_iter().map(|(path, _)| path).collect(),
        };
        context.print(&bundled, || text(&bundled))
    }

    /// The folder, which is not there, is empty, or is a bundle.
    fn out(&self, context: &Context) -> Result<PathBuf, Failure> {
        if !context.has_out() {
            return Err(Failure::BadInput(
                "--out: found none; say which folder the bundle is to be, for instance --out bundle".to_owned(),
            ));
        }
        let out =
            std::path::absolute(context.out_path()).map_err(|error| Failure::BadInput(format!("--out: {error}")))?;
        // Without a slash at its end, which would lead through a link.
        let out: PathBuf = out.components().collect();
        may_be_replaced(&out)?;
        let parent = out.parent().ok_or_else(|| refused(&out, "is no folder of its own"))?;
        prepare_folder(parent).map_err(|error| Failure::BadInput(format!("--out: {error}")))?;
        Ok(out)
    }

    fn read_tables(&self) -> Result<Vec<BundledTable>, Failure> {
        let place = &self.tables;
        let mut paths = vec![place.clone()];
        if place.is_dir() {
            let entries = fs::read_dir(place).map_err(bad_file(place))?;
            paths = entries.filter_map(Result::ok).map(|entry| entry.path()).collect();
            paths.retain(|path| path.extension().is_some_and(|kind| kind == "fxt"));
            paths.sort();
        }
        let table = |path: PathBuf| {
            let image = image_file(&path)?;
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            BundledTable::new(&path.display().to_string(), &stem, image).map_err(bad_input)
        };
        paths.into_iter().map(table).collect()
    }

    /// The libraries that were asked for; without `--target` all that can be had, and what the others lack.
    fn libraries(&self, context: &Context) -> Result<(Vec<BundleLibrary>, Vec<Missing>), Failure> {
        if self.no_core {
            return Ok((Vec::new(), Vec::new()));
        }
        let known = TARGETS.map(|(target, _)| target);
        for asked in &self.targets {
            if !known.contains(&asked.as_str()) {
                let hint = did_you_mean("; ", asked, known);
                return Err(Failure::BadInput(format!(
                    "--target: found {asked:?}; allowed: {}{hint}",
                    known.join(", ")
                )));
            }
        }
        let places = Places::new(self.libraries.as_deref());
        let all = self.targets.is_empty();
        let (mut libraries, mut to_build, mut missing) = (Vec::new(), Vec::new(), Vec::new());
        for target in known.into_iter().filter(|target| all || self.targets.iter().any(|asked| asked == target)) {
            match places.find(target) {
                Ok(Some(library)) => libraries.push(library),
                Ok(None) => to_build.push(target),
                Err(LibraryError::Missing { target, why }) if all => missing.push(Missing { target, why }),
                Err(error) => return Err(Failure::BadInput(format!("--target: {error}"))),
            }
        }
        let progress = context.progress("libraries");
        for (done, target) in to_build.iter().enumerate() {
            progress.set(done, to_build.len(), target);
            libraries.push(places.build(target).map_err(|error| Failure::Failed(error.to_string()))?);
        }
        libraries.sort_by_key(|library| known.iter().position(|target| *target == library.target));
        Ok((libraries, missing))
    }

    /// All of it or nothing.
    fn write(&self, out: &Path, files: &[(String, Vec<u8>)]) -> Result<Option<PathBuf>, Failure> {
        let folder = WholeFolder::new(out)?;
        for (path, contents) in files {
            let path = folder.path().join(path);
            let put = || {
                fs::create_dir_all(path.parent().unwrap_or(&path))?;
                fs::write(&path, contents)
            };
            put().map_err(|error| Failure::Failed(format!("cannot write {}: {error}", path.display())))?;
        }
        let mut outputs = Outputs::new();
        let mut archive = None;
        if self.archive {
            let name = out.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let path = out.with_file_name(format!("{name}.tar.gz"));
            outputs.file(&path, |file| tar_gz(file, &name, files))?;
            archive = Some(path);
        }
        // Libraries take minutes, and files may have come meanwhile.
        may_be_replaced(out)?;
        outputs.folder(folder);
        outputs.finish()?;
        Ok(archive)
    }
}

fn refused(out: &Path, found: &str) -> Failure {
    Failure::BadInput(format!(
        "--out: {} {found}; allowed: a new folder, an empty one, or a bundle as it was written, to be replaced",
        out.display()
    ))
}

/// Whether a folder can go: it is not there, is empty, or each of its files is the one of its manifest.
fn may_be_replaced(out: &Path) -> Result<(), Failure> {
    let Ok(about) = fs::symlink_metadata(out) else { return Ok(()) };
    if about.is_symlink() {
        return Err(refused(out, "is a symbolic link; name the folder itself"));
    }
    let mut entries = fs::read_dir(out).map_err(|error| refused(out, &format!("is no folder ({error})")))?;
    if entries.next().is_none() {
        return Ok(());
    }
    let manifest = fs::read(out.join(MANIFEST)).ok().and_then(|text| serde_json::from_slice::<Manifest>(&text).ok());
    let Some(manifest) = manifest.filter(|manifest| manifest.bundle == "flexspline") else {
        return Err(refused(out, "has files that are no bundle"));
    };
    match foreign(out, out, &manifest) {
        Ok(None) => Ok(()),
        Ok(Some(found)) => Err(refused(out, &found)),
        Err(error) => Err(refused(out, &format!("cannot be read in full ({error})"))),
    }
}

/// First file in a bundle's folder, by name, that is none of the manifest's files as they were written.
fn foreign(top: &Path, folder: &Path, manifest: &Manifest) -> io::Result<Option<String>> {
    let mut entries = fs::read_dir(folder)?.collect::<io::Result<Vec<_>>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let path = entry.path();
        let inside = path.strip_prefix(top).unwrap_or(&path);
        let kind = entry.file_type()?;
        if inside == Path::new(MANIFEST) && kind.is_file() {
            continue;
        }
        if kind.is_dir() {
            if let Some(found) = foreign(top, &path, manifest)? {
                return Ok(Some(found));
            }
            if manifest.files.iter().any(|file| Path::new(&file.path).starts_with(inside)) {
                continue;
            }
        }
        let Some(file) = manifest.files.iter().find(|file| kind.is_file() && Path::new(&file.path) == inside) else {
            return Ok(Some(format!("has {}, which is not of the bundle", inside.display())));
        };
        if blake3::hash(&fs::read(&path)?).to_hex().as_str() != file.blake3 {
            return Ok(Some(format!("has {}, which was changed since", inside.display())));
        }
    }
    Ok(None)
}

fn bad_input(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(format!("--tables: {error}"))
}

fn text(bundled: &Bundled) -> String {
    let mut lines = Vec::new();
    for TableEntry { file, table_id, generator, .. } in &bundled.tables {
        lines.push(format!("table {table_id}, {generator} ({file})"));
    }
    for target in &bundled.targets {
        let what = TARGETS.iter().find(|(known, _)| known == target).map_or("", |(_, what)| *what);
        lines.push(format!("  core for {target:<30} {what}"));
    }
    lines.extend(without_core(&bundled.missing));
    lines.push(format!("wrote {} files to {}", bundled.files.len(), bundled.folder));
    lines.extend(bundled.archive.as_ref().map(|archive| format!("wrote {archive}")));
    lines.push(format!("first steps: {}/README.md", bundled.folder));
    lines.join("\n")
}

/// Targets without a library: each reason once, with all targets that have it.
fn without_core(missing: &[Missing]) -> Vec<String> {
    let mut reasons: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for Missing { target, why } in missing {
        reasons.entry(why.replace(target.as_str(), "TARGET")).or_default().push(target);
    }
    let mut lines = Vec::new();
    for (why, targets) in reasons {
        if let [target] = targets[..] {
            lines.push(format!("  no core for {target}: {}", why.replace("TARGET", target)));
        } else {
            lines.push(format!("  no core for {} targets: {why}", targets.len()));
            lines.extend(targets.chunks(TARGETS_A_LINE).map(|some| format!("    {}", some.join(", "))));
        }
    }
    lines
}
