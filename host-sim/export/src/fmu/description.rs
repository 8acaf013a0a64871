//! `modelDescription.xml` (section 2.2) and the page of an FMU.

use std::fmt::Write as _;

use flexspline::Table;
use flexspline_design::tables::empirical_percent;
use flexspline_fmu::instance::CATEGORIES;
use flexspline_fmu::resources::Resources;
use flexspline_fmu::variables::{Choices, FmiRole, FmiType, ModelKind, UNITS, Variable};

/// Licences of the library's parts; `license.txt` is where readers begin.
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

fn about(resources: &Resources) -> String {
    let model = match resources.kind {
        ModelKind::Compensation => {
            "Compensation of a strain wave drive: where to turn its generator so that the output comes to where it is \
             wanted"
        }
        ModelKind::Joint => {
            "A joint with mass: motor, servo, strain wave drive and load, with and without compensation"
        }
    };
    let percent = Table::check(&resources.image).ok().and_then(|table| empirical_percent(&table));
    let part = percent.map(|percent| format!("; {percent} % of the wind-up of its table are empirical, not FEM"));
    model.to_owned() + &part.unwrap_or_default()
}

/// The whole file. A state is kept, read and set; steps are of any length.
pub(super) fn xml(resources: &Resources) -> String {
    let kind = resources.kind;
    let tick_s = resources.start("tick");
    let mut xml = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="flexspline {name}" guid="{guid}"
  description="{about}" version="{version}"
  license="MIT OR Apache-2.0" generationTool="flexspline {version}" variableNamingConvention="flat"
  numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="{identifier}" needsExecutionTool="false"
    canBeInstantiatedOnlyOncePerProcess="false" canHandleVariableCommunicationStepSize="true"
    maxOutputDerivativeOrder="0" canInterpolateInputs="true" canRunAsynchronuously="false"
    canNotUseMemoryManagementFunctions="true" canGetAndSetFMUstate="false" canSerializeFMUstate="false"
    providesDirectionalDerivative="false"/>
  <UnitDefinitions>
"#,
        name = kind.name(),
        guid = resources.guid,
        about = about(resources),
        version = env!("CARGO_PKG_VERSION"),
        identifier = kind.identifier(),
    );
    for (name, exponents, factor, offset) in UNITS {
        let used = kind.variables().iter().any(|variable| variable.kind == FmiType::Real(name));
        if used {
            let _ = writeln!(xml, "    <Unit name=\"{name}\">{}</Unit>", base_unit(exponents, factor, offset));
        }
    }
    xml += "  </UnitDefinitions>\n  <TypeDefinitions>\n";
    for choices in lists(kind) {
        let _ = writeln!(xml, "    <SimpleType name=\"{}\"><Enumeration>", choices.name);
        for (value, (name, says)) in choices.items.iter().enumerate() {
            let says = escaped(says);
            let _ = writeln!(xml, "      <Item name=\"{name}\" value=\"{value}\" description=\"{says}\"/>");
        }
        xml += "    </Enumeration></SimpleType>\n";
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
        xml += &described(place, variable, resources);
    }
    xml += "  </ModelVariables>\n  <ModelStructure>\n";
    // Outputs change in steps alone, so none of them depends on an input at the same point.
    for (group, depends) in [("Outputs", " dependencies=\"\""), ("InitialUnknowns", "")] {
        let _ = writeln!(xml, "    <{group}>");
        // Indices count from one.
        for (index, _) in (1..).zip(kind.variables()).filter(|(_, variable)| variable.is_output()) {
            let _ = writeln!(xml, "      <Unknown index=\"{index}\"{depends}/>");
        }
        let _ = writeln!(xml, "    </{group}>");
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
        if let FmiType::Choice(choices) = variable.kind
            && !lists.contains(&choices)
        {
            lists.push(choices);
        }
    }
    lists
}

/// Causality, variability and initial (section 2.2.7).
fn attributes(variable: &Variable) -> [&'static str; 3] {
    let real = matches!(variable.kind, FmiType::Real(_));
    match variable.role {
        FmiRole::Parameter => ["parameter", "fixed", "exact"],
        FmiRole::Tunable => ["parameter", "tunable", "exact"],
        FmiRole::Input => ["input", if real { "continuous" } else { "discrete" }, ""],
        FmiRole::Output => ["output", "discrete", "calculated"],
        FmiRole::Motion => ["output", "continuous", "calculated"],
        FmiRole::Constant => ["local", "constant", "exact"],
    }
}

fn start(place: usize, variable: &Variable, resources: &Resources) -> Option<String> {
    let value = resources.starts[place];
    if variable.is_output() {
        return None;
    }
    Some(match variable.kind {
        FmiType::Text => resources.table_id.to_string(),
        FmiType::Boolean => (value != 0.0).to_string(),
        FmiType::Real(_) | FmiType::Integer | FmiType::Choice(_) => value.to_string(),
    })
}

/// The element of a variable.
fn described(place: usize, variable: &Variable, resources: &Resources) -> String {
    let [causality, variability, initial] = attributes(variable);
    let mut general =
        format!("name=\"{}\" valueReference=\"{place}\" description=\"{}\"", variable.name, escaped(variable.says));
    let _ = write!(general, " causality=\"{causality}\" variability=\"{variability}\"");
    if !initial.is_empty() {
        let _ = write!(general, " initial=\"{initial}\"");
    }
    let (element, mut own) = match variable.kind {
        FmiType::Real(unit) => ("Real", format!(" unit=\"{unit}\"")),
        FmiType::Integer => ("Integer", String::new()),
        FmiType::Boolean => ("Boolean", String::new()),
        FmiType::Choice(choices) => ("Enumeration", format!(" declaredType=\"{}\"", choices.name)),
        FmiType::Text => ("String", String::new()),
    };
    let [least, most] = variable.range;
    if matches!(variable.kind, FmiType::Real(_) | FmiType::Integer) && least.is_finite() && most.is_finite() {
        let _ = write!(own, " min=\"{least}\" max=\"{most}\"");
    }
    if let Some(start) = start(place, variable, resources) {
        let _ = write!(own, " start=\"{start}\"");
    }
    format!("    <ScalarVariable {general}><{element}{own}/></ScalarVariable>\n")
}

/// `documentation/index.html`.
pub(super) fn page(resources: &Resources) -> String {
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
         forward. An error is output less generator over the ratio, positive where the output leads.</p>\n<p>FMI 2.0 \
         for co-simulation. The model has ticks of <code>tick</code>. A communication step does all ticks that end \
         within it, and carries the rest over to the \
         next.</p>\n<table><tr><th>variable<th>unit<th>is<th>start<th>what\n",
        name = kind.name(),
        about = about(resources),
        ratio = resources.start("ratio"),
        id = resources.table_id,
    );
    for (place, variable) in kind.variables().iter().enumerate() {
        let unit = match variable.kind {
            FmiType::Real(unit) => unit.to_owned(),
            FmiType::Choice(choices) => {
                let items: Vec<String> =
                    choices.items.iter().enumerate().map(|(k, (name, _))| format!("{k} {name}")).collect();
                items.join(", ")
            }
            FmiType::Integer | FmiType::Boolean | FmiType::Text => String::new(),
        };
        let [causality, variability, _] = attributes(variable);
        let is = if variable.role == FmiRole::Tunable { variability } else { causality };
        let start = start(place, variable, resources).unwrap_or_default();
        let _ = writeln!(page, "<tr><td>{}<td>{unit}<td>{is}<td>{start}<td>{}", variable.name, escaped(variable.says));
    }
    page + "</table>\n</body></html>\n"
}
