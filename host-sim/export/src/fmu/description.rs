//! `modelDescription.xml` (section 2.2 of FMI 2.0, 2.4 of FMI 3.0) and the page of an FMU.

use std::fmt::Write as _;

use flexspline::Table;
use flexspline_fmu::FmiVersion;
use flexspline_fmu::instance::CATEGORIES;
use flexspline_fmu::resources::Resources;
use flexspline_fmu::variables::{Choices, Kind, ModelKind, Role, UNITS, Variable};

/// Licences of what is in the library; `license.txt` is where readers begin.
pub(super) const LICENCES: [(&str, &str); 3] = [
    ("license.txt", "flexspline is licensed under MIT or Apache-2.0, at your choice: LICENSE-MIT, LICENSE-APACHE.\n"),
    ("LICENSE-MIT", include_str!("../../shipped/LICENSE-MIT")),
    ("LICENSE-APACHE", include_str!("../../shipped/LICENSE-APACHE")),
];

/// Time of the experiment that is proposed, s, and its steps.
const STOP_S: f64 = 10.0;

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn about(kind: ModelKind) -> &'static str {
    match kind {
        ModelKind::Compensation => {
            "Compensation of a strain wave drive: where to turn its generator so that the output comes to where it is \
             wanted"
        }
        ModelKind::Joint => {
            "A joint with mass: motor, servo, strain wave drive and load, with and without compensation"
        }
    }
}

/// What a co-simulation of each version can do: a state is kept, read and set; steps are of any length.
const ABILITIES: [&str; 2] = [
    r#"canInterpolateInputs="true" canRunAsynchronuously="false" canNotUseMemoryManagementFunctions="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="false""#,
    r#"providesIntermediateUpdate="false" mightReturnEarlyFromDoStep="false" hasEventMode="false" canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="false" providesAdjointDerivatives="false""#,
];

/// The whole file.
pub(super) fn xml(resources: &Resources, fmi: FmiVersion) -> String {
    let kind = resources.kind;
    let tick_s = resources.start("tick");
    let (token, more) = match fmi {
        FmiVersion::Two => ("guid", " numberOfEventIndicators=\"0\""),
        FmiVersion::Three => ("instantiationToken", ""),
    };
    let mut xml = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="{fmi}" modelName="flexspline {name}" {token}="{guid}" description="{about}" version="{version}" license="MIT OR Apache-2.0" generationTool="flexspline {version}" variableNamingConvention="flat"{more}>
  <CoSimulation modelIdentifier="{identifier}" needsExecutionTool="false" canBeInstantiatedOnlyOncePerProcess="false" canHandleVariableCommunicationStepSize="true" maxOutputDerivativeOrder="0" {abilities}/>
  <UnitDefinitions>
"#,
        name = kind.name(),
        guid = resources.guid,
        about = about(kind),
        version = env!("CARGO_PKG_VERSION"),
        identifier = kind.identifier(),
        fmi = fmi.name(),
        abilities = ABILITIES[fmi as usize],
    );
    for (name, exponents, factor, offset) in UNITS {
        let used = kind.variables().iter().any(|variable| variable.kind == Kind::Real(name));
        if used {
            let _ = writeln!(xml, "    <Unit name=\"{name}\">{}</Unit>", base_unit(exponents, factor, offset));
        }
    }
    xml += "  </UnitDefinitions>\n  <TypeDefinitions>\n";
    for choices in lists(kind) {
        let (open, close) = match fmi {
            FmiVersion::Two => ("SimpleType", "</Enumeration></SimpleType>"),
            FmiVersion::Three => ("EnumerationType", "</EnumerationType>"),
        };
        let inner = if fmi == FmiVersion::Two { "<Enumeration>" } else { "" };
        let _ = writeln!(xml, "    <{open} name=\"{}\">{inner}", choices.name);
        for (value, (name, says)) in choices.items.iter().enumerate() {
            let says = escaped(says);
            let _ = writeln!(xml, "      <Item name=\"{name}\" value=\"{value}\" description=\"{says}\"/>");
        }
        let _ = writeln!(xml, "    {close}");
    }
    xml += "  </TypeDefinitions>\n  <LogCategories>\n";
    for category in CATEGORIES {
        let _ = writeln!(xml, "    <Category name=\"{category}\"/>");
    }
    let _ = write!(
        xml,
        "  </LogCategories>\n  <DefaultExperiment startTime=\"0\" stopTime=\"{STOP_S}\" stepSize=\"{tick_s}\"/>\n  \
         <ModelVariables>\n"
    );
    for (place, variable) in kind.variables().iter().enumerate() {
        xml += &described(place, variable, resources, fmi);
    }
    xml += "  </ModelVariables>\n  <ModelStructure>\n";
    // Outputs change in steps alone, so none of them depends on an input at the same point.
    for (group, depends) in [("Output", " dependencies=\"\""), ("InitialUnknown", "")] {
        let outputs = kind.variables().iter().enumerate().filter(|(_, variable)| variable.is_output());
        // Indices of FMI 2.0 count from one.
        let unknowns: String = match fmi {
            FmiVersion::Two => {
                outputs.map(|(k, _)| format!("      <Unknown index=\"{}\"{depends}/>\n", k + 1)).collect()
            }
            FmiVersion::Three => {
                outputs.map(|(k, _)| format!("    <{group} valueReference=\"{k}\"{depends}/>\n")).collect()
            }
        };
        xml += &match fmi {
            FmiVersion::Two => format!("    <{group}s>\n{unknowns}    </{group}s>\n"),
            FmiVersion::Three => unknowns,
        };
    }
    xml + "  </ModelStructure>\n</fmiModelDescription>\n"
}

fn base_unit(exponents: [i8; 5], factor: f64, offset: f64) -> String {
    let mut text = "<BaseUnit".to_owned();
    for (name, exponent) in ["kg", "m", "s", "K", "rad"].iter().zip(exponents).filter(|(_, exponent)| *exponent != 0) {
        let _ = write!(text, " {name}=\"{exponent}\"");
    }
    if factor != 1.0 {
        let _ = write!(text, " factor=\"{factor}\"");
    }
    if offset != 0.0 {
        let _ = write!(text, " offset=\"{offset}\"");
    }
    text + "/>"
}

/// The lists that variables choose from, each once.
fn lists(kind: ModelKind) -> Vec<&'static Choices> {
    let mut lists: Vec<&Choices> = Vec::new();
    for variable in kind.variables() {
        if let Kind::Choice(choices) = variable.kind
            && !lists.contains(&choices)
        {
            lists.push(choices);
        }
    }
    lists
}

/// Causality, variability and initial (section 2.2.7).
fn attributes(variable: &Variable) -> [&'static str; 3] {
    let real = matches!(variable.kind, Kind::Real(_));
    match variable.role {
        Role::Parameter => ["parameter", "fixed", "exact"],
        Role::Tunable => ["parameter", "tunable", "exact"],
        Role::Input => ["input", if real { "continuous" } else { "discrete" }, ""],
        Role::Output => ["output", "discrete", "calculated"],
        Role::Motion => ["output", "continuous", "calculated"],
        Role::Constant => ["local", "constant", "exact"],
        Role::Independent => ["independent", "continuous", ""],
    }
}

fn start(place: usize, variable: &Variable, resources: &Resources) -> Option<String> {
    let value = resources.starts[place];
    if variable.is_output() || variable.role == Role::Independent {
        return None;
    }
    Some(match variable.kind {
        Kind::Text => resources.table_id.to_string(),
        Kind::Boolean => (value != 0.0).to_string(),
        Kind::Real(_) | Kind::Integer | Kind::Choice(_) => value.to_string(),
    })
}

/// The element of a variable.
fn described(place: usize, variable: &Variable, resources: &Resources, fmi: FmiVersion) -> String {
    let [causality, variability, initial] = attributes(variable);
    let mut general = format!(
        "name=\"{}\" valueReference=\"{place}\" description=\"{}\" causality=\"{causality}\" variability=\"{variability}\"",
        variable.name,
        escaped(variable.says)
    );
    if !initial.is_empty() {
        let _ = write!(general, " initial=\"{initial}\"");
    }
    let (elements, mut own) = match variable.kind {
        Kind::Real(unit) => (["Real", "Float64"], format!(" unit=\"{unit}\"")),
        Kind::Integer => (["Integer", "Int32"], String::new()),
        Kind::Boolean => (["Boolean"; 2], String::new()),
        Kind::Choice(choices) => (["Enumeration"; 2], format!(" declaredType=\"{}\"", choices.name)),
        Kind::Text => (["String"; 2], String::new()),
    };
    let element = elements[fmi as usize];
    let [least, most] = variable.range;
    if matches!(variable.kind, Kind::Real(_) | Kind::Integer) && least.is_finite() && most.is_finite() {
        let _ = write!(own, " min=\"{least}\" max=\"{most}\"");
    }
    let start = start(place, variable, resources);
    if let (Some(text), FmiVersion::Three, Kind::Text) = (&start, fmi, variable.kind) {
        return format!("    <{element} {general}><Start value=\"{text}\"/></{element}>\n");
    }
    if let Some(start) = start {
        let _ = write!(own, " start=\"{start}\"");
    }
    match fmi {
        FmiVersion::Two => format!("    <ScalarVariable {general}><{element}{own}/></ScalarVariable>\n"),
        FmiVersion::Three => format!("    <{element} {general}{own}/>\n"),
    }
}

/// `documentation/index.html`.
pub(super) fn page(resources: &Resources, fmi: FmiVersion) -> String {
    let kind = resources.kind;
    let table = Table::check(&resources.image).ok();
    let range = table.map_or(String::new(), |table| {
        let ([low, high], [cold, warm]) = (table.torque_range_n_m(), table.temperature_range_c());
        format!(", for {low} to {high} N.m and {cold} to {warm} degrees C")
    });
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>flexspline \
         {name}</title>\n<style>body{{font:15px system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 \
         1rem}}td,th{{text-align:left;padding:.15rem .6rem;vertical-align:top}}</style></head><body>\n<h1>flexspline \
         {name}</h1>\n<p>{about}. Ratio {ratio}, table <code>{id}</code>{range}.</p>\n<p>Angles are radians, positive \
         counter-clockwise for generator and output, seen from the same side. A positive torque turns the output \
         forward. An error is output less generator over the ratio, positive where the output leads.</p>\n<p>FMI \
         {fmi} for co-simulation. The model has ticks of <code>tick</code>. A communication step does all ticks that end \
         within it, and carries what is left over to the \
         next.</p>\n<table><tr><th>variable<th>unit<th>is<th>start<th>what\n",
        name = kind.name(),
        about = about(kind),
        ratio = resources.start("ratio"),
        fmi = fmi.name(),
        id = resources.table_id,
    );
    for (place, variable) in kind.variables().iter().enumerate() {
        let unit = match variable.kind {
            Kind::Real(unit) => unit.to_owned(),
            Kind::Choice(choices) => {
                let items: Vec<String> =
                    choices.items.iter().enumerate().map(|(k, (name, _))| format!("{k} {name}")).collect();
                items.join(", ")
            }
            Kind::Integer | Kind::Boolean | Kind::Text => String::new(),
        };
        let [causality, variability, _] = attributes(variable);
        let is = if variable.role == Role::Tunable { variability } else { causality };
        let start = start(place, variable, resources).unwrap_or_default();
        let _ = writeln!(page, "<tr><td>{}<td>{unit}<td>{is}<td>{start}<td>{}", variable.name, escaped(variable.says));
    }
    page + "</table>\n</body></html>\n"
}
