//! `flexspline synthesize`: measured-looking data of a drive with known effects.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use flexspline::Table;
use serde::Serialize;
use serde_json::{Value, json};

use super::context::{Context, quoted, table_image, table_of};
use super::tables::coarse_table;
use super::{Failure, bad_input, say, within};
use flexspline_base::output::Outputs;
use flexspline_identify::causes::{ParameterSpec, Usual};
use flexspline_identify::extension::{self, CauseEntry};
use flexspline_identify::measurement::{self, ColumnMap, Session, bytes_of};
use flexspline_identify::nominal::Nominal;
use flexspline_identify::synthesize::{
    Definition, DrawnUnit, Effect, MotionPlan, RATE_HZ, Sensors, Sizes, completed, effects, parse, synthesize, to_csv,
    within_temperatures,
};
use flexspline_mechanics::drive::{Drive, GeneratorKind};

/// Make synthetic measurements: a simulated drive with effects, noise and sensors of your choice
///
/// Writes data.csv, which `flexspline diagnose` reads, and truth.json, which holds the effects and their values. The
/// drive is a table made by FEM (--tables; without one it is made on the coarse mesh first) or a model from a catalogue
/// (--model). Its unit is drawn from the spread between units. --list shows every effect with its parameters.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline synthesize --list
  flexspline synthesize --effect circular_spline_eccentricity:amplitude_um=8,phase_rad=0.7
  flexspline synthesize --effect sensor_latency:delay_s=0.001 --effect wear --tables out --seed 7
  flexspline synthesize --effect gravity_torque --model nominal.toml --like measured.csv --out try
  flexspline synthesize --effect encoder_index_jump:size_arcsec=53 --noise-arcsec 1 --rows 5000

Without --effect the data are those of a drive within its spread, in which nothing is to be found.")]
pub(super) struct Synthesize {
    /// An effect, optionally with parameters: NAME:parameter=value,...; may be repeated
    #[arg(long = "effect", value_name = "NAME[:param=value,...]", allow_hyphen_values = true)]
    effects: Vec<String>,
    /// List the effects with their parameters, units, ranges and defaults
    #[arg(long)]
    list: bool,
    /// Folder of tables made by `flexspline tables`
    #[arg(long, value_name = "DIR", conflicts_with = "model")]
    tables: Option<PathBuf>,
    /// Wave generator of the drive: two-roller, four-roller, double-disc or cam
    #[arg(long, value_name = "G", default_value = "cam")]
    generator: GeneratorKind,
    /// Nominal model from the catalogue, or one that `flexspline diagnose` has extended
    #[arg(long, value_name = "nominal.toml")]
    model: Option<PathBuf>,
    /// The drive as drawn, not a unit drawn at random from the spread between units
    #[arg(long)]
    no_spread: bool,
    /// White noise of the output angle, arcsec
    #[arg(long, value_name = "ARCSEC", default_value_t = 2.0, allow_negative_numbers = true, help_heading = "Sensors")]
    noise_arcsec: f64,
    /// Slow drift of the output angle, arcsec rms
    #[arg(long, value_name = "ARCSEC", default_value_t = 0.8, allow_negative_numbers = true, help_heading = "Sensors")]
    wander_arcsec: f64,
    /// Seed of all random draws [default: a random one, printed]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    excitation: ExcitationOptions,
}

/// Motion, load and temperature.
#[derive(Debug, Args)]
#[command(next_help_heading = "Excitation")]
struct ExcitationOptions {
    /// Number of sessions
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=100))]
    sessions: u16,
    /// Rows per session
    #[arg(long, value_name = "N", default_value_t = 3000)]
    #[arg(value_parser = clap::value_parser!(u32).range(50..=1_000_000))]
    rows: u32,
    /// Largest speed of the generator, rad/s
    #[arg(long, value_name = "RAD/S", default_value_t = 6.0, allow_negative_numbers = true)]
    speed: f64,
    /// Largest torque, N·m
    #[arg(long, value_name = "N.M", default_value_t = 40.0, allow_negative_numbers = true)]
    torque: f64,
    /// Temperatures, degrees C
    #[arg(long, value_name = "LOW,HIGH", default_value = "-20,50", allow_hyphen_values = true)]
    temperature_c: String,
    /// Take motion, load, temperature and time from this file
    #[arg(long, value_name = "DATA.csv")]
    like: Option<PathBuf>,
    /// Names and units of the columns of that file, as for `flexspline diagnose` [default: the usual names]
    #[arg(long, value_name = "MAP", default_value = "", hide_default_value = true, requires = "like")]
    columns: String,
}

/// Source of the drive's prediction.
#[derive(Debug, Serialize)]
struct NominalSource {
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    table_id: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    generator: Option<String>,
    drive: String,
}

/// `truth.json`.
#[derive(Debug, Serialize)]
struct Truth {
    schema_version: u32,
    command: String,
    seed: u64,
    effects: Vec<Effect>,
    data_faults: Vec<Effect>,
    nominal: NominalSource,
    unit: DrawnUnit,
    #[serde(flatten)]
    sensors: Sensors,
    sessions: usize,
    rows: usize,
}

impl Synthesize {
    pub(super) fn run(&self, context: &Context) -> Result<(), Failure> {
        if self.list {
            let all: Vec<Value> = effects().iter().map(listed).collect();
            return context.print_data(&json!({ "schema_version": 1, "effects": all }), list);
        }
        let chosen = self.effects.iter().map(|text| parse(text)).collect::<Result<Vec<_>, _>>();
        let chosen = chosen.map_err(|error| Failure::BadInput(format!("--effect: {error}")))?;
        let (sensors, temperatures) = self.check()?;
        let seed = self.seed.unwrap_or_else(|| fastrand::u64(..1 << 32));
        let mut random = fastrand::Rng::with_seed(seed);
        let drive = context.drive()?;
        let mut known = Vec::new();
        if let Some((file, text)) = context.drive_file() {
            known = extension::causes_in(file, &text).map_err(bad_input)?;
        }
        // Before there is much work.
        context.out()?;
        let (image, nominal, causes, source) = self.nominal(context, &drive)?;
        known.extend(causes);
        let table = image
            .as_deref()
            .map(|image| Table::check(image).map_err(|error| Failure::Failed(error.to_string())))
            .transpose()?;
        let chosen: Vec<Effect> = known.iter().filter_map(CauseEntry::effect).chain(chosen).collect();
        let mut motion = self.motion(&nominal, &mut random)?;
        if self.excitation.like.is_none() {
            within_temperatures(&mut motion, temperatures);
        }
        let unit = if self.no_spread { DrawnUnit::nominal(&nominal) } else { DrawnUnit::draw(&nominal, &mut random) };
        let sizes = Sizes::of(&drive);
        let drive = (&nominal, table.as_ref());
        let made = synthesize(drive, sizes, &chosen, motion, &sensors, &unit, &mut random)
            .map_err(|error| Failure::BadInput(format!("--effect: {error}")))?;
        let csv = to_csv(&made.sessions, nominal.ratio, &made.effects, &mut random);
        let (data_faults, effects) = made.effects.into_iter().partition(|effect| effect.definition.cause.is_none());
        let truth = Truth {
            schema_version: 1,
            command: context.command.clone(),
            seed,
            effects,
            data_faults,
            nominal: source,
            unit,
            sensors,
            sessions: made.sessions.len(),
            rows: made.sessions.iter().map(Session::len).sum(),
        };
        let out = context.out()?;
        let mut outputs = Outputs::new();
        outputs.file(&out.join("data.csv"), |file| file.write_all(csv.as_bytes()))?;
        outputs.json(&out.join("truth.json"), &truth)?;
        outputs.finish()?;
        context.print(&truth, || text(&truth, out) + &say::next(&self.next(context, out)))
    }

    /// Sensors and temperatures, in range.
    fn check(&self) -> Result<(Sensors, [f64; 2]), Failure> {
        within("--speed", self.excitation.speed, 1e-3, 1e3)?;
        within("--torque", self.excitation.torque, 1e-3, 1e5)?;
        let range: Vec<f64> = self.excitation.temperature_c.split(',').filter_map(|t| t.trim().parse().ok()).collect();
        let temperatures = match range[..] {
            [one] if self.excitation.temperature_c.split(',').count() == 1 => [one, one],
            [low, high] if low <= high => [low, high],
            _ => {
                return Err(Failure::BadInput(format!(
                    "--temperature-c: found \"{}\"; allowed: LOW,HIGH in degrees C, for instance -20,50, or one \
                     temperature",
                    self.excitation.temperature_c
                )));
            }
        };
        for t in temperatures {
            within("--temperature-c", t, -200.0, 300.0)?;
        }
        Ok((
            Sensors {
                white_arcsec: within("--noise-arcsec", self.noise_arcsec, 0.0, 1e5)?,
                wander_arcsec: within("--wander-arcsec", self.wander_arcsec, 0.0, 1e5)?,
                ..Sensors::USUAL
            },
            temperatures,
        ))
    }

    /// Motion, load and surroundings: sessions without an error.
    fn motion(&self, nominal: &Nominal, random: &mut fastrand::Rng) -> Result<Vec<Session>, Failure> {
        let Some(path) = &self.excitation.like else {
            let plan = MotionPlan {
                sessions: usize::from(self.excitation.sessions),
                rows: self.excitation.rows as usize,
                rate_hz: RATE_HZ,
                speed_rad_s: self.excitation.speed,
                torque_n_m: self.excitation.torque,
            };
            return Ok(plan.excite(random));
        };
        let map = ColumnMap::of_options(&self.excitation.columns, None, None).map_err(bad_input)?;
        let (file, bytes) = bytes_of(path).map_err(bad_input)?;
        let recording = measurement::parse(&file, bytes, &map, &nominal.gear()).map_err(bad_input)?;
        Ok(completed(&recording.sessions, RATE_HZ, nominal.temperature_c))
    }

    /// How to diagnose what was made.
    fn next(&self, context: &Context, out: &Path) -> Vec<String> {
        let shown = |path: &Path| quoted(&path.display().to_string());
        let diagnose = format!("diagnose {} --out {}", shown(&out.join("data.csv")), shown(out));
        match (&self.model, &self.tables) {
            (Some(model), _) => vec![context.next(&format!("{diagnose} --model {}", shown(model)))],
            (None, Some(tables)) => {
                vec![context.next(&format!("{diagnose} --tables {} --generator {}", shown(tables), self.generator))]
            }
            // The table that these data were made from is the one of the coarse mesh.
            (None, None) => vec![
                context.next(&format!("tables --generator {} --mesh coarse --out {}", self.generator, shown(out))),
                context.next(&format!("{diagnose} --tables {} --generator {}", shown(out), self.generator)),
            ],
        }
    }

    /// The nominal drive: the image of a table if there is one, its model, and the causes that a model holds.
    #[allow(clippy::type_complexity)]
    fn nominal(
        &self,
        context: &Context,
        drive: &Drive,
    ) -> Result<(Option<Vec<u8>>, Nominal, Vec<CauseEntry>, NominalSource), Failure> {
        if let Some(file) = &self.model {
            let model = extension::Model::read(file).map_err(bad_input)?;
            let (file, drive) = (Some(file.display().to_string()), drive.name.clone());
            let source = NominalSource { kind: "model", file, table_id: None, generator: None, drive };
            return Ok((None, model.nominal, model.causes, source));
        }
        let (image, file) = match &self.tables {
            Some(folder) => {
                let (path, image) = table_image(folder, self.generator)?;
                table_of(&path, &image)?;
                (image, Some(path.display().to_string()))
            }
            None => (coarse_table(context, drive, self.generator)?.image, None),
        };
        let table = Table::check(&image).map_err(|error| Failure::Failed(error.to_string()))?;
        let nominal = Nominal::of_table(&table);
        let source = NominalSource {
            kind: "table",
            file,
            table_id: Some(table.id().to_string()),
            generator: Some(self.generator.to_string()),
            drive: drive.name.clone(),
        };
        Ok((Some(image), nominal, Vec::new(), source))
    }
}

fn text(truth: &Truth, out: &std::path::Path) -> String {
    let mut text = format!("{} rows in {} sessions, seed {}\n", truth.rows, truth.sessions, truth.seed);
    if let Some(id) = &truth.nominal.table_id {
        let _ = writeln!(text, "drive {}, table {id}", truth.nominal.drive);
    }
    for effect in truth.effects.iter().chain(&truth.data_faults) {
        let _ = writeln!(text, "  {}", effect.definition.name);
        for ParameterSpec { name, .. } in effect.definition.parameters {
            let _ = writeln!(text, "    {name:<32} {:>14.6}", effect.given(*name).unwrap_or(f64::NAN));
        }
    }
    if truth.effects.is_empty() && truth.data_faults.is_empty() {
        text.push_str("  no effect: a drive within its spread\n");
    }
    let _ = write!(text, "wrote {} and {}", out.join("data.csv").display(), out.join("truth.json").display());
    text
}

/// An effect of `--list` with `--json`.
fn listed(effect: &Definition) -> Value {
    let parameter = |of: &ParameterSpec| {
        json!({
            "name": of.name.as_str(), "meaning": of.meaning, "range": of.range, "allowed": of.allowed(),
            "usual": usual(of),
        })
    };
    let parameters: Vec<Value> = effect.parameters.iter().map(parameter).collect();
    json!({
        "name": effect.name, "meaning": effect.meaning, "data_fault": effect.cause.is_none(),
        "parameters": parameters,
    })
}

/// Default of a parameter.
fn usual(parameter: &ParameterSpec) -> String {
    match parameter.usual {
        Usual::Value(value) => match parameter.words.get(value as usize) {
            Some(word) => format!("default {word}"),
            None => format!("default {value:.6}").trim_end_matches('0').trim_end_matches('.').to_owned(),
        },
        Usual::OfLoad(share) => format!("default {share} of the largest torque"),
        Usual::Drawn(low, high) => format!("default drawn from {low:.4} to {high:.4}"),
        Usual::Instant(..) => "default drawn within the data".to_owned(),
        Usual::ToothPitch => "default one tooth pitch".to_owned(),
        Usual::Follows => "instead of the one above".to_owned(),
    }
}

/// Every effect.
fn list() -> String {
    let mut text = String::from("Causes:\n");
    let all = effects();
    let faults_from = all.iter().position(|effect| effect.cause.is_none());
    for (k, effect) in all.iter().enumerate() {
        if Some(k) == faults_from {
            text.push_str("\nFaults of the data:\n");
        }
        let _ = writeln!(text, "  {}: {}", effect.name, effect.meaning);
        for parameter in effect.parameters {
            let _ = writeln!(
                text,
                "    {:<28} {}; {}, allowed {}",
                parameter.name,
                parameter.meaning,
                usual(parameter),
                parameter.allowed()
            );
        }
    }
    text
}
