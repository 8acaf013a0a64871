//! Records as numpy columns, named and ordered as in the CSV that the command writes.

use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::failure::bad;

/// The columns of records: whole numbers as int64, truth values as bool, other numbers as float64 (absent ones as NaN),
/// text as a list.
pub fn columns<'py, R: Serialize>(py: Python<'py>, records: &[R]) -> PyResult<Bound<'py, PyDict>> {
    let result = PyDict::new(py);
    let Some(first) = records.first() else { return Ok(result) };
    let maps = records
        .iter()
        .map(|record| match serde_json::to_value(record) {
            Ok(Value::Object(map)) => Ok(map),
            other => Err(bad(format!("a record is no object: {other:?}"))),
        })
        .collect::<PyResult<Vec<Map<String, Value>>>>()?;
    for name in header(first)? {
        let column: Vec<&Value> = maps.iter().map(|map| map.get(&name).unwrap_or(&Value::Null)).collect();
        result.set_item(&name, array(py, &column)?)?;
    }
    Ok(result)
}

/// The header of the CSV.
fn header(record: &impl Serialize) -> PyResult<Vec<String>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.serialize(record).map_err(bad)?;
    let bytes = writer.into_inner().map_err(bad)?;
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    Ok(reader.headers().map_err(bad)?.iter().map(str::to_owned).collect())
}

fn array<'py>(py: Python<'py>, column: &[&Value]) -> PyResult<Bound<'py, PyAny>> {
    if let Some(values) = column.iter().map(|value| value.as_bool()).collect::<Option<Vec<bool>>>() {
        return Ok(values.into_pyarray(py).into_any());
    }
    if let Some(values) = column.iter().map(|value| value.as_i64()).collect::<Option<Vec<i64>>>() {
        return Ok(values.into_pyarray(py).into_any());
    }
    if column.iter().any(|value| value.is_string()) {
        let texts = column.iter().map(|value| value.as_str().unwrap_or_default());
        return Ok(PyList::new(py, texts)?.into_any());
    }
    let values: Vec<f64> = column.iter().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect();
    Ok(values.into_pyarray(py).into_any())
}
