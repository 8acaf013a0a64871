//! Flights side by side: every combination of some values of a scenario's fields.

use flexspline_base::toml_file::Problem;
use flexspline_design::sweep::{Vary, grid};
use serde::Serialize;

use super::{Flown, FlyError, Results, read, results};

/// Fields of a scenario, each with the value it got.
pub(crate) type Varied = Vec<(String, String)>;

/// One of the flights.
#[derive(Debug, Clone, Serialize)]
pub struct Flight {
    /// What makes it this one.
    pub varied: Varied,
    /// What was found; none where it was not flown.
    pub results: Option<Results>,
    /// Why it was not flown: a load that its generator does not carry, a joint that runs away.
    pub not_flown: Option<String>,
}

/// Every combination of the values, on a scenario's file.
///
/// # Errors
/// [`FlyError::Scenario`], [`FlyError::Vary`]: file, field, value and what is allowed.
pub fn every(name: &str, text: &str, vary: &[Vary]) -> Result<Vec<(Varied, Flown)>, FlyError> {
    for (at, Vary { path, .. }) in vary.iter().enumerate() {
        if vary[..at].iter().any(|before| before.path == *path) {
            let (field, found) = (path.clone(), "twice".to_owned());
            return Err(FlyError::Vary { field, found, allowed: "once, its values with commas" });
        }
    }
    let named = |values: Vec<String>| vary.iter().map(|vary| vary.path.clone()).zip(values).collect();
    let flown = |varied: Varied| changed(name, text, &varied).map(|flown| (varied, flown));
    grid(vary).into_iter().map(named).map(flown).collect()
}

/// A scenario's file with some values changed.
fn changed(name: &str, text: &str, varied: &[(String, String)]) -> Result<Flown, FlyError> {
    if varied.is_empty() {
        return read(name, text);
    }
    // What is wrong with the file itself is told with its own lines.
    read(name, text)?;
    let mut whole: toml::Table = text.parse().map_err(|error: toml::de::Error| not_toml(name, error.to_string()))?;
    for (field, value) in varied {
        let parsed = format!("value = {value}").parse::<toml::Table>().ok().and_then(|mut table| table.remove("value"));
        let value = parsed.unwrap_or_else(|| toml::Value::String(value.clone()));
        let mut at = &mut whole;
        let mut parts = field.split('.').peekable();
        while let Some(part) = parts.next() {
            if parts.peek().is_none() {
                at.insert(part.to_owned(), value);
                break;
            }
            let room = at.entry(part).or_insert_with(|| toml::Value::Table(toml::Table::new()));
            let toml::Value::Table(inner) = room else {
                let (field, found) = (field.clone(), format!("a field of `{part}`"));
                return Err(FlyError::Vary { field, found, allowed: "fields of a scenario file" });
            };
            at = inner;
        }
    }
    let text = toml::to_string(&whole).map_err(|error| not_toml(name, error.to_string()))?;
    let values: Vec<String> = varied.iter().map(|(field, value)| format!("{field}={value}")).collect();
    let name = format!("{name} with {}", values.join(" "));
    read(&name, &text).map_err(|error| match error {
        // No line of this text is one that anybody wrote.
        FlyError::Scenario(problem) => FlyError::Scenario(Problem { place: name, ..problem }),
        other => other,
    })
}

fn not_toml(name: &str, what: String) -> FlyError {
    FlyError::Scenario(Problem { place: name.to_owned(), ..Problem::of("", what) })
}

/// Flies one of them; `told` is called for each second that one of its joints flew.
///
/// What cannot be flown, or runs away, says why and takes no other flight with it.
pub fn fly_varied(varied: Vec<(String, String)>, flown: &Flown, told: &(dyn Fn() + Sync)) -> Flight {
    match flown.carries().and_then(|()| flown.fly_told(told)) {
        Ok(flight) => Flight { varied, results: results(flown, &flight), not_flown: None },
        Err(why) => Flight { varied, results: None, not_flown: Some(why.to_string()) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_is_made_and_brackets_hold_their_commas() {
        let vary: Vec<Vary> =
            ["table=nominal,calibrated", "legs=[[2.0,0.0],[3.0,0.01]],[[4.0,0.0]]", "load.bias_n_m=2"]
                .map(|text| text.parse().unwrap())
                .to_vec();
        let found = every("camera", "base = \"camera\"\n", &vary).unwrap();
        assert_eq!(found.len(), 4);
        let (varied, flown) = &found[2];
        assert_eq!(varied[0], ("table".to_owned(), "calibrated".to_owned()));
        assert_eq!((flown.scenario.legs.len(), flown.scenario.load.bias_n_m), (2, 2.0));
        assert_eq!(found[3].1.scenario.legs.len(), 1);
        let range = every("camera", "base = \"camera\"\n", &["load.bias_n_m=1..2:3".parse().unwrap()]).unwrap();
        assert_eq!(range.iter().map(|(_, flown)| flown.scenario.load.bias_n_m).collect::<Vec<_>>(), [1.0, 1.5, 2.0]);
    }

    #[test]
    fn what_cannot_be_varied_is_named() {
        let said =
            |text: &str| every("camera", "base = \"camera\"\n", &[text.parse().unwrap()]).unwrap_err().to_string();
        let twice = every("camera", "base = \"camera\"\n", &["seed=1", "seed=2"].map(|text| text.parse().unwrap()))
            .unwrap_err()
            .to_string();
        assert!(twice.starts_with("--vary seed: found twice"), "{twice}");
        assert!(said("tabel=nominal").contains("did you mean `table`?"), "{}", said("tabel=nominal"));
        assert!(said("table=best").contains("camera with table=best: table: found \"best\""), "{}", said("table=best"));
        assert!(said("seed.more=1").contains("seed"), "{}", said("seed.more=1"));
        for wrong in ["table", "table=", "=1", "table=a,,b"] {
            assert!(wrong.parse::<Vary>().is_err(), "{wrong}");
        }
    }
}
