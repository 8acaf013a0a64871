//! Drive files: reading with every mistake named at its line, overriding one field, writing with units.
//!
//! ```toml
//! base = "HHD-95"              # start from a built-in drive; without it every field must be there
//! name = "thicker rim"
//! [flexspline]
//! rim_thickness_mm = 2.0
//! [sleeve]
//! torsion_stiffness_n_m_per_rad = "rigid"
//! [as_built]                   # what is not said is ideal
//! circular_spline_eccentricity_um = 10.0
//! flexspline_pitch_harmonics = [{ order = 2, amplitude_um = 5.0, phase_deg = 30.0 }]
//! damaged_teeth = [{ wheel = "flexspline", tooth = 12, flank = "plus", depth_um = 30.0 }]
//! ```

use super::as_built::{DamagedFlank, DamagedTooth, Harmonic, Wheel};
use super::error::DriveError;
use super::fields::{self, DEPTH, Field, ORDER, PHASE, Slot, TOOTH};
use super::ring::GeneratorKind;
use super::spec::{Drive, ThermalState};
use crate::suggest::{did_you_mean, likeliest, likeliest_path, question};
use crate::toml_file::{Entries, Problem, Refused, TomlFile, each_of, number, one_of, real, shown, text, whole};
use std::collections::{BTreeSet, HashMap};
use std::fmt::Write as _;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The first lines of a written file.
const HEAD: &str = "\
# A harmonic drive: flexspline fixed, circular spline the output, two waves.
# Each line: key = value  # what it is, unit, sign; allowed values. Sizes hold at temperature.reference_c.
# A shorter file starts from a built-in drive and gives what differs: base = \"HHD-95\" above the first section.
# Angles count counter-clockwise, on the part that they are on. \"rigid\" is a stiffness without end.
";

impl Drive {
    /// Reads a drive file. Every unknown key, wrong type, value out of range and missing field of the file is
    /// reported; if there is none, the parts are fitted to one another ([`Drive::check`]).
    pub fn from_toml(file_name: &str, text: &str) -> Result<Drive, DriveError> {
        let mut reader = DriveReader { file: TomlFile::new(file_name, text), lines: HashMap::new() };
        match reader.file.parse() {
            Some(table) => reader.read(&table),
            None => Err(reader.finish()),
        }
    }

    /// This drive with one field changed, `flexspline.rim_thickness_mm=2`, and checked.
    pub fn with_set(&self, assignment: &str) -> Result<Drive, DriveError> {
        self.with_sets([assignment])
    }

    /// This drive with several fields changed, checked once all of them are; one text may hold several, with commas
    /// between them.
    pub fn with_sets<'a>(&self, assignments: impl IntoIterator<Item = &'a str>) -> Result<Drive, DriveError> {
        self.with_sets_for(&GeneratorKind::ALL, assignments)
    }

    /// The same for these generators alone, whatever the others lack.
    pub fn with_sets_for<'a>(
        &self,
        kinds: &[GeneratorKind],
        assignments: impl IntoIterator<Item = &'a str>,
    ) -> Result<Drive, DriveError> {
        let mut drive = self.clone();
        let mut problems = Vec::new();
        for assignment in assignments.into_iter().flat_map(apart) {
            if let Err(problem) = drive.set(assignment) {
                problems.push(Problem { place: format!("--set {assignment}"), ..problem });
            }
        }
        if !problems.is_empty() {
            return Err(DriveError { problems });
        }
        drive.check_with(kinds).map_err(|mut refused| {
            for problem in &mut refused.problems {
                problem.place = "--set".to_owned();
            }
            refused
        })?;
        Ok(drive)
    }

    /// How many fields such assignments set, each counted once.
    pub fn fields_set<'a>(assignments: impl IntoIterator<Item = &'a str>) -> usize {
        let path = |assignment: &'a str| assignment.split('=').next().unwrap_or_default().trim();
        assignments.into_iter().flat_map(apart).map(path).collect::<BTreeSet<_>>().len()
    }

    fn set(&mut self, assignment: &str) -> Result<(), Problem> {
        let Some((path, text)) = assignment.split_once('=') else {
            return Err(Problem::of("", "expected PATH=VALUE, for instance flexspline.rim_thickness_mm=2"));
        };
        let (path, text) = (path.trim(), text.trim());
        if path == "name" {
            self.name = text.trim_matches('"').to_owned();
            return Ok(());
        }
        let field =
            fields::all().find(|field| field.path == path).ok_or_else(|| Problem::of(path, unknown_path(path)))?;
        // a bare word is a string
        match DeValue::parse(text) {
            Ok(value) => field.put(self, &value),
            Err(_) => field.put(self, &Spanned::new(0..0, DeValue::String(text.into()))),
        }
        .map_err(|refused| refused.of(path))
    }

    /// The drive as a complete file, with units and meanings; reads back as the same drive.
    pub fn to_toml(&self) -> String {
        // a drive at another temperature is written by its sizes at reference temperature
        let cold;
        let drive = if self.thermal_state == ThermalState::default() {
            self
        } else {
            cold = self.as_dimensioned();
            &cold
        };
        let mut text = String::from(HEAD);
        let _ = writeln!(
            text,
            "{:<44} # what results call it",
            format!("name = {}", toml::Value::String(drive.name.clone()))
        );
        let mut open = "";
        fields::for_each(drive, |field, slot| {
            let (section, key) = field.split();
            if section != open {
                let about =
                    fields::SECTIONS.iter().find(|known| known.name == section).map_or("", |known| known.contents);
                let _ = writeln!(text, "\n[{section}]  # {about}");
                open = section;
            }
            let value = match &slot {
                Slot::Real(number) => format!("{number:?}"),
                Slot::RealOrRigid(number) => number.map_or("\"rigid\"".to_owned(), |number| format!("{number:?}")),
                Slot::Count(number) => number.to_string(),
                Slot::Word(word) => format!("{:?}", word.chosen()),
                Slot::List(list) => {
                    // ten to a line: as many as there are teeth
                    let lines: Vec<String> = list
                        .chunks(10)
                        .map(|line| line.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(", "))
                        .collect();
                    if lines.is_empty() { "[]".to_owned() } else { format!("[\n    {},\n]", lines.join(",\n    ")) }
                }
                Slot::Harmonics(list) => array(list.iter().map(|harmonic| {
                    let Harmonic { order, amplitude_um, phase_deg } = harmonic;
                    format!("{{ order = {order}, amplitude_um = {amplitude_um:?}, phase_deg = {phase_deg:?} }}")
                })),
                Slot::Damage(list) => array(list.iter().map(|damaged| {
                    let DamagedTooth { wheel, tooth, flank, depth_um } = damaged;
                    let (wheel, flank) = (wheel.name(), flank.name());
                    format!("{{ wheel = \"{wheel}\", tooth = {tooth}, flank = \"{flank}\", depth_um = {depth_um:?} }}")
                })),
            };
            let _ = writeln!(text, "{:<44} # {}", format!("{key} = {value}"), field.comment(&slot));
        });
        text
    }
}

impl Field {
    /// Stores `value` in `drive` if its type and range are right; says what is wrong otherwise.
    fn put(&self, drive: &mut Drive, value: &Spanned<DeValue>) -> Result<(), Refused> {
        match self.slot(drive) {
            Slot::RealOrRigid(slot) => {
                *slot = match value.get_ref() {
                    DeValue::String(word) if word == "rigid" => None,
                    other if number(other).is_some() => Some(real(&self.range, value)?),
                    _ => return Err(Refused::found(value, format!("{} or \"rigid\"", self.range))),
                }
            }
            Slot::Real(slot) => *slot = real(&self.range, value)?,
            Slot::Count(slot) => *slot = whole(&self.range, value)?,
            Slot::Word(slot) => {
                let known: Vec<(&str, &str)> = slot.names().into_iter().map(|name| (name, name)).collect();
                slot.choose(one_of(&known, value)?);
            }
            Slot::List(slot) => {
                let each = format!("an array of numbers, {} each", self.range);
                *slot = each_of(value, &each, |entry| real(&self.range, entry))?;
            }
            Slot::Harmonics(slot) => {
                *slot = each_of(value, "an array of { order, amplitude_um, phase_deg }", |entry| {
                    let entry = Entries::of(entry, &["order", "amplitude_um", "phase_deg"])?;
                    Ok(Harmonic {
                        order: entry.needed("order", |v| whole(&ORDER, v))?,
                        amplitude_um: entry.needed("amplitude_um", |v| real(&self.range, v))?,
                        phase_deg: entry.given("phase_deg", |v| real(&PHASE, v))?.unwrap_or(0.0),
                    })
                })?;
            }
            Slot::Damage(slot) => {
                *slot = each_of(value, "an array of { wheel, tooth, flank, depth_um }", |entry| {
                    let entry = Entries::of(entry, &["wheel", "tooth", "flank", "depth_um"])?;
                    let wheels: Vec<_> = Wheel::ALL.iter().map(|wheel| (wheel.name(), *wheel)).collect();
                    let flanks: Vec<_> = DamagedFlank::ALL.iter().map(|flank| (flank.name(), *flank)).collect();
                    Ok(DamagedTooth {
                        wheel: entry.needed("wheel", |v| one_of(&wheels, v))?,
                        tooth: entry.needed("tooth", |v| whole(&TOOTH, v))?,
                        flank: entry.given("flank", |v| one_of(&flanks, v))?.unwrap_or(DamagedFlank::Both),
                        depth_um: entry.needed("depth_um", |v| real(&DEPTH, v))?,
                    })
                })?;
            }
        }
        Ok(())
    }
}

/// A TOML array of tables, one to a line where there are several.
fn array(entries: impl Iterator<Item = String>) -> String {
    let entries: Vec<String> = entries.collect();
    match entries.len() {
        0 => "[]".to_owned(),
        1 => format!("[{}]", entries[0]),
        _ => format!("[\n    {},\n]", entries.join(",\n    ")),
    }
}

/// One pass over a file.
struct DriveReader<'a> {
    file: TomlFile<'a>,
    /// line of every field that the file sets
    lines: HashMap<&'static str, usize>,
}

impl DriveReader<'_> {
    fn finish(self) -> DriveError {
        DriveError { problems: self.file.problems() }
    }

    fn read(mut self, table: &DeTable) -> Result<Drive, DriveError> {
        let base = self.text_of(table, "base").and_then(|(at, name)| {
            let drive = Drive::built_in(&name);
            if drive.is_none() {
                let what = format!("found {name:?}, allowed: {}", Drive::BUILT_IN.join(", "));
                self.file.refuse(at, "base", what + &did_you_mean("; ", &name, Drive::BUILT_IN));
            }
            drive
        });
        let has_base = table.contains_key("base");
        // without a base every number is required, so the values started from do not matter
        let mut drive = base.unwrap_or_else(Drive::hhd_95);
        drive.name = match self.text_of(table, "name") {
            Some((_, name)) => name,
            None => {
                self.file.name().rsplit(['/', '\\']).next().unwrap_or_default().trim_end_matches(".toml").to_owned()
            }
        };
        for (key, value) in table {
            let section = key.get_ref().as_ref();
            // [extension] holds findings of a diagnosis that are no fields, [data_sheet] values of a catalogue:
            // others read them.
            if ["base", "name", "extension", "data_sheet"].contains(&section) {
                continue;
            }
            let sections = || fields::SECTIONS.iter().map(|section| section.name);
            if !sections().any(|known| known == section) {
                let known = || sections().chain(["base", "name", "data_sheet"]);
                let keys: Vec<&str> = fields::all().map(|field| field.path).collect();
                let meant = likeliest(section, known()).or_else(|| likeliest_path(section, &keys));
                let hint = meant.map_or_else(String::new, |name| format!("; {}", question(name)));
                let allowed = known().collect::<Vec<_>>().join(", ");
                self.file.refuse(key.span(), section, format!("unknown key{hint}; allowed: {allowed}"));
                continue;
            }
            match value.get_ref().as_table() {
                Some(entries) => self.read_section(section, entries, &mut drive),
                None => {
                    let what = format!("found {}, allowed: a table [{section}]", shown(value.get_ref()));
                    self.file.refuse(value.span(), section, what);
                }
            }
        }
        if !has_base {
            self.refuse_missing(&drive);
        }
        if !self.file.is_sound() {
            return Err(self.finish());
        }
        drive.check().map_err(|mut refused| {
            for problem in &mut refused.problems {
                let field = problem.field.split('[').next().unwrap_or_default();
                problem.place = match self.lines.get(field) {
                    Some(line) => format!("{}:{line}", self.file.name()),
                    None => self.file.name().to_owned(),
                };
            }
            refused
        })?;
        Ok(drive)
    }

    fn read_section(&mut self, section: &str, entries: &DeTable, drive: &mut Drive) {
        for (key, value) in entries {
            let name = key.get_ref().as_ref();
            let path = format!("{section}.{name}");
            match fields::all().find(|field| field.path == path) {
                None => self.file.refuse(key.span(), &path, unknown_path(&path)),
                Some(field) => {
                    self.lines.insert(field.path, self.file.line(key.span().start));
                    self.file.take(&path, field.put(drive, value));
                }
            }
        }
    }

    /// A top-level string and where it stands; refuses another type.
    fn text_of(&mut self, table: &DeTable, key: &str) -> Option<(Range<usize>, String)> {
        let value: &Spanned<DeValue> = table.get(key)?;
        self.file.take(key, text(value)).map(|text| (value.span(), text))
    }

    fn refuse_missing(&mut self, drive: &Drive) {
        for field in fields::all() {
            if !field.is_optional(drive) && !self.lines.contains_key(field.path) {
                let what = format!("missing ({}); give it, or a base = \"HHD-95\" to start from", field.meaning);
                self.file.refuse_whole(field.path, what);
            }
        }
    }
}

/// The assignments of one text: a comma outside brackets and quotes ends one where another, `section.key=`, begins.
fn apart(text: &str) -> Vec<&str> {
    let begins_another = |rest: &str| {
        let path = rest.split('=').next().unwrap_or_default().trim();
        rest.contains('=')
            && path.contains('.')
            && path.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '.')
    };
    let (mut parts, mut start, mut depth, mut quoted) = (Vec::new(), 0, 0_i32, false);
    for (at, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '[' | '{' if !quoted => depth += 1,
            ']' | '}' if !quoted => depth -= 1,
            ',' if !quoted && depth == 0 && begins_another(&text[at + 1..]) => {
                parts.push(&text[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[start..]);
    parts
}

/// Message for a path that is no field.
fn unknown_path(path: &str) -> String {
    let section = path.split_once('.').map_or("", |(section, _)| section);
    let paths: Vec<&str> = fields::all().map(|field| field.path).collect();
    let hint = likeliest_path(path, &paths).map_or_else(String::new, |path| format!("; {}", question(path)));
    let known: Vec<&str> = fields::all().map(Field::split).filter(|(s, _)| *s == section).map(|(_, key)| key).collect();
    if known.is_empty() {
        let sections: Vec<&str> = fields::SECTIONS.iter().map(|section| section.name).collect();
        return format!("unknown key{hint}; allowed: SECTION.KEY, sections are {}", sections.join(", "));
    }
    format!("unknown key{hint}; allowed: {}", known.join(", "))
}

#[cfg(test)]
mod tests {
    use super::super::sleeve::SleeveKind;
    use super::*;

    /// A file on top of the default drive.
    fn refused(body: &str) -> String {
        let text = format!("base = \"HHD-95\"\n{body}\n");
        match Drive::from_toml("wrong.toml", &text) {
            Ok(_) => "accepted".to_owned(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn what_is_written_reads_back() {
        for name in Drive::BUILT_IN {
            let drive = Drive::built_in(name).unwrap();
            let text = drive.to_toml();
            let again = Drive::from_toml("again.toml", &text).unwrap();
            assert_eq!(again, drive);
            assert_eq!(again.hash(), drive.hash());
            assert_eq!(again.to_toml(), text);
        }
        let warm = Drive::hhd_95().at_temperature(60.0);
        let again = Drive::from_toml("again.toml", &warm.to_toml()).unwrap();
        assert!((again.flexspline.tip_radius_mm - 48.825).abs() < 1e-12);
    }

    #[test]
    fn a_base_is_overridden_and_the_hash_follows_the_physics_alone() {
        let plain = Drive::from_toml("a.toml", "base = \"HHD-95\"").unwrap();
        assert_eq!(plain.name, "a");
        assert_eq!(plain.hash(), Drive::hhd_95().hash());
        let text =
            "base = 'HHD-95' # as built\nname = \"b\"\ngenerator.w0_mm = 5_00e-3\nmaterial = { poissons_ratio = 0.29 }";
        let drive = Drive::from_toml("b.toml", text).unwrap();
        assert_eq!((drive.name.as_str(), drive.material.poissons_ratio), ("b", 0.29));
        assert_ne!(drive.hash(), plain.hash());
        let same = plain.with_set("material.poissons_ratio=0.29").unwrap();
        assert_eq!(same.hash(), drive.hash());
        assert_ne!(plain.at_temperature(30.0).hash(), plain.hash());
        assert_ne!(Drive::hhd_95_typical().hash(), plain.hash());
    }

    #[test]
    fn imperfections_are_read_written_and_hashed_and_none_is_the_ideal_drive() {
        let ideal = Drive::hhd_95();
        // The hash of the ideal drive from before there were imperfections: tables made then are of this drive still.
        let hash = blake3::Hash::from_bytes(ideal.hash()).to_hex();
        assert_eq!(hash.as_str(), "137827daaec6b8161369acdb8b4a3d4f1cd1392483cc42d2d990f2a92df89bd6");
        let list: Vec<String> = (0..190).map(|k| format!("{:.1}", 0.1 * f64::from(k % 7))).collect();
        let text = format!(
            "base = \"HHD-95\"\n[as_built]\ncircular_spline_eccentricity_um = 10\ncircular_spline_pitch_error_um = \
             [{}]\nflexspline_pitch_harmonics = [{{ order = 2, amplitude_um = 5.0, phase_deg = 30.0 }}, {{ order = 1, \
             amplitude_um = 3 }}]\n[[as_built.damaged_teeth]]\nwheel = \"circular_spline\"\ntooth = 189\ndepth_um = \
             20.5\n",
            list.join(", ")
        );
        let drive = Drive::from_toml("d.toml", &text).unwrap();
        let built = &drive.as_built;
        assert_eq!(built.circular_spline_eccentricity_um, 10.0);
        assert_eq!((built.circular_spline_pitch_error_um.len(), built.circular_spline_pitch_error_um[6]), (190, 0.6));
        assert_eq!(built.flexspline_pitch_harmonics[1], Harmonic { order: 1, amplitude_um: 3.0, phase_deg: 0.0 });
        let damaged =
            DamagedTooth { wheel: Wheel::CircularSpline, tooth: 189, flank: DamagedFlank::Both, depth_um: 20.5 };
        assert_eq!(built.damaged_teeth, [damaged]);
        let written = drive.to_toml();
        let again = Drive::from_toml("d.toml", &written).unwrap();
        assert_eq!((&again, again.to_toml()), (&drive, written));
        assert_eq!(again.hash(), drive.hash());
        // Every part of it is in the hash.
        let sets = [
            "as_built.circular_spline_eccentricity_um=0",
            "as_built.circular_spline_pitch_error_um=[]",
            "as_built.flexspline_pitch_harmonics=[{order=2,amplitude_um=5,phase_deg=30}]",
            "as_built.flexspline_pitch_harmonics=[{order=2,amplitude_um=5,phase_deg=31},{order=1,amplitude_um=3}]",
            "as_built.damaged_teeth=[]",
            "as_built.damaged_teeth=[{wheel='circular_spline',tooth=189,flank='plus',depth_um=20.5}]",
            "as_built.damaged_teeth=[{wheel='flexspline',tooth=187,depth_um=20.5}]",
            "as_built.generator_warmer_k=1",
        ];
        let mut hashes = std::collections::HashSet::from([drive.hash(), ideal.hash()]);
        for set in sets {
            assert!(hashes.insert(drive.with_set(set).unwrap().hash()), "{set} is not in the hash");
        }
        // At another temperature it is written by the sizes of its file.
        let uneven = drive.with_set("as_built.circular_spline_warmer_k=-30").unwrap();
        let warm = uneven.at_temperature(60.0);
        let again = Drive::from_toml("d.toml", &warm.to_toml()).unwrap();
        assert!((again.circular_spline.tip_radius_mm - 48.65).abs() < 1e-12);
    }

    #[test]
    fn fields_that_are_set_are_counted_each_once() {
        let count = |sets: &[&str]| Drive::fields_set(sets.iter().copied());
        assert_eq!(count(&[]), 0);
        let pitch = "as_built.flexspline_pitch_harmonics=[{order=2,amplitude_um=5},{order=1,amplitude_um=3}]";
        assert_eq!(count(&["generator.w0_mm=0.5,flexspline.rim_thickness_mm=1", pitch, "generator.w0_mm = 0.49"]), 3);
    }

    /// A wrong number of teeth is reported, and nothing of fillets, which the radii were not drawn for.
    #[test]
    fn teeth_that_are_not_two_apart_are_all_that_is_told() {
        let refused = Drive::hhd_95().with_set("flexspline.teeth=122").unwrap_err();
        let fields: Vec<&str> = refused.problems.iter().map(|problem| problem.field.as_str()).collect();
        assert_eq!(fields, ["circular_spline.teeth"], "{refused}");
    }

    #[test]
    fn rigid_is_a_value() {
        let text = "base = \"HHD-95-typical\"\n[sleeve]\ntorsion_stiffness_n_m_per_rad = \"rigid\"";
        let drive = Drive::from_toml("c.toml", text).unwrap();
        assert_eq!(drive.sleeve.torsion_stiffness_n_m_per_rad, None);
        assert_eq!(drive.generator.bearing_stiffness_n_per_mm3, Some(170.0));
        let soft = Drive::hhd_95().with_set("sleeve.torsion_stiffness_n_m_per_rad = 4.6e5").unwrap();
        assert_eq!(soft.sleeve.torsion_stiffness_n_m_per_rad, Some(4.6e5));
        let back = soft.with_set("sleeve.torsion_stiffness_n_m_per_rad=rigid").unwrap();
        assert_eq!(back, Drive::hhd_95());
    }

    #[test]
    fn every_wrong_file_gets_its_own_message() {
        // On top of base = "HHD-95" (line 1): table, line in it, and what is said of its key.
        let fields: &[(&str, &str, &str)] = &[
            ("flexspline", "teeth = 187", "found 187, allowed: an even number"),
            ("flexspline", "teeth = 188.0", "found 188.0, allowed: a whole number, 20 to 2000"),
            ("circular_spline", "teeth = 192", "found 192, allowed: 190, two more"),
            ("flexspline", "module_mm = \"0.5 mm\"", "found \"0.5 mm\", allowed: 0.05 to 10"),
            (
                "flexspline",
                "module = 0.5",
                "unknown key; did you mean `flexspline.module_mm`?; allowed: teeth, module_mm",
            ),
            ("flexspline", "width_mm = inf", "found inf, allowed: above 0 to 1000"),
            ("flexspline", "width_mm = 0", "found 0, allowed: above 0 to 1000"),
            ("flexspline", "pressure_angle_deg = 0.349", "found 0.349, allowed: 10 to 35"),
            ("flexspline", "tip_radius_mm = 47.5", "found 47.5, allowed: above root_radius_mm = 47.875"),
            (
                "flexspline",
                "tip_radius_mm = 48.96",
                "found 48.96: with w0_mm = 0.5 the tip would stand in the circular-spline root",
            ),
            ("flexspline", "rim_thickness_mm = 12", "found 12, allowed: up to 9.575"),
            ("flexspline", "root_fillet_mm = 0.3", "0.3 mm does not fit: the root land would be -"),
            ("flexspline", "tip_rounding_mm = 0.4", "0.4 mm does not fit: the tooth would be -"),
            ("circular_spline", "tip_radius_mm = 49.6", "found 49.6, allowed: below root_radius_mm = 49.45"),
            (
                "circular_spline",
                "tip_radius_mm = 48.3",
                "found 48.3: with w0_mm = 0.5 the tip would stand in the flexspline root",
            ),
            ("circular_spline", "outer_radius_mm = 49.5", "found 49.5, allowed: at least 49.95"),
            ("circular_spline", "module_mm = 0.6", "found 0.6, allowed: within 1 % of the flexspline's 0.5"),
            ("material", "poissons_ratio = 0.5", "found 0.5, allowed: 0 to 0.49"),
            ("material", "youngs_modulus_gpa = 206", "unknown key; did you mean `material.youngs_modulus_mpa`?"),
            ("generator", "w0_mm = 0.05", "found 0.05: with the two-roller generator the tips meet at the minor axis"),
            ("generator", "w0_mm = 3.0", "found 3, allowed: up to 2.3638"),
            ("generator", "roller_diameter_mm = 40", "40 mm is too large for the four-roller generator"),
            ("generator", "four_roller_angle_deg = 41", "found 41, allowed: 15 to 38"),
            ("generator", "bearing_stiffness_n_per_mm3 = 0", "found 0, allowed: above 0"),
            (
                "generator",
                "bearing_stiffness_n_per_mm3 = \"soft\"",
                "found \"soft\", allowed: above 0 to 1e7 or \"rigid\"",
            ),
            ("flanks", "friction_coefficient = true", "found true, allowed: 0 to 0.5"),
            ("flanks", "friction_coefficient = [0.1]", "found an array, allowed: 0 to 0.5"),
            ("output", "drag_torque_n_m = -0.1", "found -0.1, allowed: 0 to 10000"),
            ("temperature", "minimum_c = 90", "found 90, allowed: below maximum_c = 80"),
            ("temperature", "reference_c = 293.15", "found 293.15, allowed: -60 to 80"),
            ("temperature", "flexspline_expansion_per_k = 11.5", "found 11.5, allowed: -0.00001 to 0.0001"),
            ("as_built", "flexspline_runout_um = -1", "found -1, allowed: 0 to 100"),
            ("as_built", "flexspline_wear_um = inf", "found inf, allowed: 0 to 200"),
            (
                "as_built",
                "flexspline_pitch_error_um = [1.0, 2.0]",
                "found 2 numbers, allowed: none, or 188, one for each tooth",
            ),
            ("as_built", "circular_spline_pitch_error_um = [1.0, \"2\"]", "[1]: found \"2\", allowed: -100 to 100"),
            (
                "as_built",
                "flexspline_pitch_error_um = 3.0",
                "found 3.0, allowed: an array of numbers, -100 to 100 each",
            ),
            (
                "as_built",
                "flexspline_pitch_harmonics = [{ order = 2, amplitude_um = 1 }, { order = 95, amplitude_um = 1 }]",
                "[1].order: found 95, allowed: 1 to 94 (two teeth",
            ),
            ("as_built", "flexspline_pitch_harmonics = [{ order = 2 }]", "[0].amplitude_um: missing"),
            (
                "as_built",
                "cam_form_harmonics = [{ order = 2, amplitude = 1.0 }]",
                "[0].amplitude: unknown key; did you mean `amplitude_um`?",
            ),
            ("as_built", "cam_form_harmonics = [2, 1.0]", "[0]: found 2, allowed: { order, amplitude_um, phase_deg }"),
            (
                "as_built",
                "rim_thickness_harmonics = [{ order = 2, amplitude_um = 150 }, { order = 3, amplitude_um = 100 }]",
                "found 250.0 µm in all, allowed: up to 240.0 µm",
            ),
            (
                "as_built",
                "damaged_teeth = [{ wheel = \"generator\", tooth = 1, depth_um = 1 }]",
                "[0].wheel: found \"generator\", allowed: \"flexspline\", \"circular_spline\"",
            ),
            (
                "as_built",
                "damaged_teeth = [{ wheel = \"flexspline\", tooth = 188, depth_um = 1 }]",
                "[0].tooth: found 188, allowed: 0 to 187",
            ),
            (
                "sleeve",
                "kind = \"hermetc\"",
                "found \"hermetc\", allowed: \"hermetic\", \"cup\", \"hat\", \"springs\", \"none\"; did you mean \
                 `hermetic`?",
            ),
            ("sleeve", "flange = 2", "found 2, allowed: \"rigid\", \"diaphragm\""),
        ];
        // Other bodies, and the start of the whole message.
        let others: &[(&str, &str)] = &[
            (
                "[temperature]\nminimum_c = 30",
                "wrong.toml: temperature.reference_c: found 20, allowed: 30 to 80, the operating range",
            ),
            (
                "[as_built]\ncircular_spline_pitch_error_um = [1.0,\n nan]",
                "wrong.toml:4: as_built.circular_spline_pitch_error_um[1]: found NaN, allowed: -100 to 100",
            ),
            (
                "[[as_built.damaged_teeth]]\nwheel = \"flexspline\"\ntooth = 1\ndepth_um = 501",
                "wrong.toml:5: as_built.damaged_teeth[0].depth_um: found 501, allowed: 0 to 500",
            ),
            ("as_built = 3", "wrong.toml:2: as_built: found 3, allowed: a table [as_built]"),
            ("[flexpline]\nteeth = 188", "wrong.toml:2: flexpline: unknown key; did you mean `flexspline`?"),
            ("[qqq]\nteeth = 188", "wrong.toml:2: qqq: unknown key"),
            (
                "friction_coefficient = 0.1",
                "wrong.toml:2: friction_coefficient: unknown key; did you mean `flanks.friction_coefficient`?",
            ),
            (
                "[sleeve]\nkind = \"cup\"\nwall_mm = 5",
                "wrong.toml:4: sleeve.wall_mm: found 5, allowed: up to 4.7275 (a tenth of the neutral radius: a thin \
                 shell)",
            ),
            (
                "[sleeve]\nkind = \"hermetic\"\nflange_side_mm = 0.9",
                "wrong.toml:4: sleeve.flange_side_mm: found 0.9, allowed: at least 1 (two walls: a tube)",
            ),
            (
                "[sleeve]\nkind = \"cup\"\nlateral_stiffness_n_per_mm = 500",
                "wrong.toml:4: sleeve.lateral_stiffness_n_per_mm: found 500, allowed with kind = \"cup\": 0",
            ),
            (
                "[sleeve]\nkind = \"cup\"\nbottom = \"plate\"\nbottom_thickness_mm = 20",
                "wrong.toml:5: sleeve.bottom_thickness_mm: found 20, allowed: up to 9.4550",
            ),
            (
                "[sleeve]\nkind = \"cup\"\nbottom = \"plate\"\nhub_radius_mm = 47",
                "wrong.toml:5: sleeve.hub_radius_mm: found 47, allowed: up to 44.9112 (inside the tube)",
            ),
            ("sleeve = 4.6e5", "wrong.toml:2: sleeve: found 4.6e5, allowed: a table [sleeve]"),
            ("name = 95", "wrong.toml:2: name: found 95, allowed: a string"),
            ("[flexspline]\nteeth = 188\nteeth = 188", "wrong.toml:4: not TOML: duplicate key"),
            ("[flexspline\nteeth = 188", "wrong.toml:2: not TOML: unclosed table"),
            ("[flexspline]\nteeth = ", "wrong.toml:3: not TOML: "),
        ];
        let mut seen = std::collections::HashSet::new();
        let mut wrong = Vec::new();
        let fields = fields.iter().map(|(table, line, said)| {
            let colon = if said.starts_with('[') { "" } else { ": " };
            let key = line.split_once(" = ").unwrap().0;
            (format!("[{table}]\n{line}"), format!("wrong.toml:3: {table}.{key}{colon}{said}"))
        });
        let others = others.iter().map(|(body, start)| ((*body).to_owned(), (*start).to_owned()));
        for (body, start) in fields.chain(others) {
            let message = refused(&body);
            if !message.starts_with(&start) || !seen.insert(message.clone()) {
                wrong.push(format!("{body}\n  gave     {message}\n  expected {start}"));
            }
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    }

    #[test]
    fn a_wrong_base_is_named() {
        let message = Drive::from_toml("d.toml", "base = \"HHD95\"").unwrap_err().to_string();
        assert_eq!(
            message,
            "d.toml:1: base: found \"HHD95\", allowed: HHD-95, HHD-95-typical, CUP-95, HHD-95-hermetic, HHD-95-plane, \
             S-95; did you mean `HHD-95`?"
        );
        let message = Drive::from_toml("d.toml", "base = 95").unwrap_err().to_string();
        assert_eq!(message, "d.toml:1: base: found 95, allowed: a string");
    }

    #[test]
    fn without_a_base_every_missing_field_is_named() {
        let text = Drive::hhd_95().to_toml();
        let error =
            Drive::from_toml("e.toml", &text.replace("rim_thickness_mm", "# ").replace("w0_mm", "# ")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "e.toml: flexspline.rim_thickness_mm: missing (rim under the root circle, mm); give it, or a base = \
             \"HHD-95\" to start from\ne.toml: generator.w0_mm: missing (radial displacement of the neutral layer on \
             the major axis, outward, mm); give it, or a base = \"HHD-95\" to start from"
        );
        let empty = Drive::from_toml("f.toml", "").unwrap_err();
        let count = |of: &dyn Fn(&Field) -> bool| fields::all().filter(|field| of(field)).count();
        let optional = count(&|field| field.is_optional(&Drive::hhd_95()));
        // Two stiffnesses that may be rigid, what springs have not, what straight teeth have not, and what involutes
        // have not.
        let not_there = [Field::is_imperfection, Field::is_of_shells, Field::is_of_the_face, Field::is_of_the_profile];
        assert_eq!(optional, 2 + not_there.iter().map(|of| count(&|field| of(field))).sum::<usize>());
        assert_eq!(empty.problems.len(), fields::all().count() - optional);
        // a stiffness that is not there is rigid
        let text = text.replace("bearing_stiffness_n_per_mm3", "# ").replace("torsion_stiffness_n_m_per_rad", "# ");
        assert_eq!(Drive::from_toml("g.toml", &text).unwrap(), Drive::hhd_95());
    }

    #[test]
    fn all_problems_are_told_in_the_order_of_the_file() {
        let error = refused("[material]\npoissons_ratio = 0.7\n[flexspline]\nteeths = 188\nwidth_mm = 0");
        let lines: Vec<&str> = error.lines().collect();
        assert_eq!(lines.len(), 3, "{error}");
        assert!(lines[0].starts_with("wrong.toml:3: material.poissons_ratio"));
        assert!(lines[1].starts_with("wrong.toml:5: flexspline.teeths: unknown key; did you mean `flexspline.teeth`?"));
        assert!(lines[2].starts_with("wrong.toml:6: flexspline.width_mm"));
    }

    #[test]
    fn wrong_overrides_are_named() {
        let set = |assignment: &str| Drive::hhd_95().with_set(assignment).unwrap_err().to_string();
        assert!(set("teeth").starts_with("--set teeth: expected PATH=VALUE"));
        assert!(
            set("flexspline.teeths=3").contains("flexspline.teeths: unknown key; did you mean `flexspline.teeth`?")
        );
        assert!(set("w0_mm=0.4").contains("w0_mm: unknown key; did you mean `generator.w0_mm`?"));
        assert!(set("generator.w0_mm=abc").ends_with("generator.w0_mm: found \"abc\", allowed: above 0 to 20"));
        assert!(set("flexspline.teeth=186").starts_with("--set: circular_spline.teeth: found 190, allowed: 188"));
        assert!(
            set("as_built.cam_form_harmonics=[{order=0,amplitude_um=1}]")
                .ends_with("as_built.cam_form_harmonics[0].order: found 0, allowed: 1 to 1000")
        );
        let both = ["flexspline.teeth=186", "circular_spline.teeth=190"];
        assert!(Drive::hhd_95().with_sets(both).unwrap_err().to_string().contains("found 190, allowed: 188"));
        assert_eq!(Drive::hhd_95().with_set("name=mine").unwrap().name, "mine");
    }

    #[test]
    fn one_text_may_set_several_fields() {
        let drive = Drive::hhd_95()
            .with_set("sleeve.kind=hermetic,sleeve.wall_mm=0.7, as_built.cam_form_harmonics=[{order=2,amplitude_um=1}]")
            .unwrap();
        assert_eq!((drive.sleeve.kind, drive.sleeve.wall_mm), (SleeveKind::Hermetic, 0.7));
        assert_eq!(drive.as_built.cam_form_harmonics.len(), 1);
        assert_eq!(Drive::hhd_95().with_set("name=mine, not yours").unwrap().name, "mine, not yours");
        let wrong = Drive::hhd_95().with_set("sleeve.wall_mm=0.7,sleeve.wal_mm=1").unwrap_err().to_string();
        assert!(wrong.starts_with("--set sleeve.wal_mm=1: sleeve.wal_mm: unknown key"), "{wrong}");
    }

    /// Without a base a drive needs the sizes of the sleeve that it has, and no others.
    #[test]
    fn a_sleeve_needs_its_own_sizes() {
        let without = |name: &str, kind: &str, keys: &[&str]| {
            let mut text = Drive::hhd_95().to_toml().replace("kind = \"springs\"", &format!("kind = \"{kind}\""));
            for key in keys {
                text = text.replace(&format!("\n{key} ="), "\n# ");
            }
            Drive::from_toml(name, &text).map_err(|error| error.to_string())
        };
        let sizes = ["wall_mm", "flange_side_mm", "bottom_side_mm", "lateral_stiffness_n_per_mm"];
        let missing = |kind: &str| {
            let said = without("a.toml", kind, &sizes).err().unwrap_or_default();
            let keys = sizes.into_iter().filter(move |key| said.contains(&format!("sleeve.{key}: missing")));
            keys.collect::<Vec<_>>()
        };
        assert_eq!(missing("hermetic"), sizes[..3]);
        assert_eq!(missing("cup"), ["wall_mm", "bottom_side_mm"]);
        assert_eq!(missing("hat"), ["wall_mm", "flange_side_mm"]);
        assert_eq!(missing("springs"), ["lateral_stiffness_n_per_mm"]);
        assert!(without("b.toml", "none", &sizes).is_ok());
        let optional = ["flange", "bottom", "bottom_thickness_mm", "diaphragm_thickness_mm", "hub_radius_mm"];
        assert!(without("c.toml", "hermetic", &optional).is_ok());
    }
}
