//! The core's step over numpy arrays: the crate `flexspline` row by row, without the GIL.

use std::ops::Deref;
use std::sync::{Mutex, PoisonError};

use flexspline::{Approach, Direction, GeneratorAngle, OutputAngle, PlayState as CoreState, Table as CoreTable};
use flexspline_base::units::ARCSEC_PER_RAD;
use flexspline_design::tables::{dead_zone_n_m, generator_of};
use flexspline_identify::measurement::{ColumnMap, bytes_of};
use flexspline_identify::replay::{MeasuredRow, ReplayedRow, RowsRead, read, replay};
use flexspline_identify::wind_up::{Hysteresis, WindUpCurve};
use flexspline_mechanics::drive::GeneratorKind;
use numpy::{IntoPyArray, PyReadonlyArray1, PyReadwriteArray1};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use self_cell::self_cell;

use crate::failure::bad;

/// Rows between two looks for Ctrl-C: a few hundredths of a second.
const ROWS_AT_ONCE: usize = 1 << 18;
/// Angles are turned to counts of 2⁻³² turn in 64 bits; beyond this, rad, they do not fit.
const LARGEST_ANGLE_RAD: f64 = 1e10;

self_cell!(
    /// An image, and the table that reads it in place.
    struct ReadImage {
        owner: Vec<u8>,
        #[covariant]
        dependent: CoreTable,
    }
);

/// Where a drive rests inside its play.
#[pyclass(frozen, module = "flexspline._native")]
pub struct PlayState(Mutex<CoreState>);

impl PlayState {
    fn get(&self) -> CoreState {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set(&self, state: CoreState) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = state;
    }
}

#[pymethods]
impl PlayState {
    /// Anywhere inside the play, or after motion in a direction through all of it.
    #[new]
    #[pyo3(signature = (direction = None))]
    fn new(direction: Option<i32>) -> PyResult<PlayState> {
        let state = direction.map_or(Ok(CoreState::unknown()), |sign| direction_of(sign).map(CoreState::after_motion));
        Ok(PlayState(Mutex::new(state?)))
    }

    /// A state that was saved.
    #[staticmethod]
    fn restore(saved: &[u8]) -> PyResult<PlayState> {
        let bytes: Option<&[u8; CoreState::SAVED_BYTES]> = saved.try_into().ok();
        let state = bytes.and_then(CoreState::restore);
        let state = state.ok_or_else(|| {
            bad(format!(
                "play state: found {} bytes that are no whole saved state, allowed: the {} of save()",
                saved.len(),
                CoreState::SAVED_BYTES
            ))
        })?;
        Ok(PlayState(Mutex::new(state)))
    }

    fn save<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.get().save())
    }

    fn copy(&self) -> PlayState {
        PlayState(Mutex::new(self.get()))
    }

    #[getter]
    fn is_known(&self) -> bool {
        self.get().is_known()
    }

    #[getter]
    fn offset_rad(&self) -> f32 {
        self.get().offset_rad()
    }

    #[getter]
    fn uncertainty_rad(&self) -> f32 {
        self.get().uncertainty_rad()
    }
}

pub(crate) fn direction_of(sign: i32) -> PyResult<Direction> {
    match sign {
        1 => Ok(Direction::Forward),
        -1 => Ok(Direction::Backward),
        other => Err(bad(format!("direction: found {other}, allowed: 1 or -1"))),
    }
}

/// A column of input: a value for each row, or one for all.
#[derive(Clone, Copy)]
struct Column<V> {
    values: V,
    /// 0 where one value is for all rows.
    step: usize,
}

impl<T: Copy, V: Deref<Target = [T]>> Column<V> {
    fn new(name: &str, values: V, rows: usize) -> PyResult<Column<V>> {
        match values.len() {
            found if found == rows => Ok(Column { values, step: 1 }),
            1 => Ok(Column { values, step: 0 }),
            found => Err(bad(format!("{name}: found {found} values, allowed: one, or {rows} as there are rows"))),
        }
    }

    #[inline(always)]
    fn at(&self, row: usize) -> T {
        self.values[row * self.step]
    }
}

type In<'py, T = f64> = PyReadonlyArray1<'py, T>;
type Out<'py, T> = PyReadwriteArray1<'py, T>;

fn input<'a, T: numpy::Element>(name: &str, array: &'a In<'_, T>) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|error| bad(format!("{name}: {error}")))
}

fn output<'a, T: numpy::Element>(name: &str, array: &'a mut Out<'_, T>, rows: usize) -> PyResult<&'a mut [T]> {
    let slice = array.as_slice_mut().map_err(|error| bad(format!("out.{name}: {error}")))?;
    match slice.len() {
        found if found == rows => Ok(slice),
        found => Err(bad(format!("out.{name}: found {found} values, allowed: {rows}, as there are rows"))),
    }
}

/// Refuses angles that are no angles before anything is computed.
fn angles(name: &str, values: &[f64]) -> PyResult<()> {
    match values.iter().position(|angle| angle.is_nan() || angle.abs() > LARGEST_ANGLE_RAD) {
        None => Ok(()),
        Some(row) => Err(bad(format!(
            "{name}[{row}]: found {}, allowed: a finite angle, at most {LARGEST_ANGLE_RAD:e} rad either way",
            values[row]
        ))),
    }
}

/// Goes through the rows without the GIL, and lets Python handle signals now and then.
fn for_rows(py: Python<'_>, rows: usize, mut row: impl FnMut(usize) + Send) -> PyResult<()> {
    let mut begin = 0;
    while begin < rows {
        let end = rows.min(begin + ROWS_AT_ONCE);
        py.detach(|| (begin..end).for_each(&mut row));
        py.check_signals()?;
        begin = end;
    }
    Ok(())
}

/// A table that passed every check of its image.
#[pyclass(frozen, module = "flexspline._native")]
pub struct Table(ReadImage);

impl Table {
    fn table(&self) -> &CoreTable<'_> {
        self.0.borrow_dependent()
    }
}

#[pymethods]
impl Table {
    /// Checks all of an image; `name` stands in messages.
    #[staticmethod]
    fn check(name: &str, image: Vec<u8>) -> PyResult<Table> {
        ReadImage::try_new(image, |image| CoreTable::check(image))
            .map(Table)
            .map_err(|error| bad(format!("{name}: {error}")))
    }

    #[getter]
    fn image<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, self.0.borrow_owner())
    }

    /// The header, for `flexspline.Table`.
    fn header<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let table = self.table();
        let drive = table.drive();
        let header = PyDict::new(py);
        header.set_item("table_id", table.id().to_string())?;
        header.set_item("generator", generator_of(table).map_or("other", GeneratorKind::name))?;
        header.set_item("ratio", drive.exact_ratio())?;
        header.set_item("flexspline_teeth", drive.flexspline_teeth())?;
        header.set_item("circular_spline_teeth", drive.circular_spline_teeth())?;
        let fixed = match drive.fixed() {
            flexspline::FixedMember::Flexspline => "flexspline",
            flexspline::FixedMember::CircularSpline => "circular_spline",
        };
        header.set_item("fixed", fixed)?;
        header.set_item("torque_range_n_m", table.torque_range_n_m())?;
        header.set_item("temperature_range_c", table.temperature_range_c())?;
        let nodes = |nodes: &mut dyn Iterator<Item = f32>| nodes.map(f64::from).collect::<Vec<f64>>().into_pyarray(py);
        header.set_item("torque_nodes_n_m", nodes(&mut table.torque_nodes_n_m()))?;
        header.set_item("temperature_nodes_c", nodes(&mut table.temperature_nodes_c()))?;
        header.set_item("dead_zone_n_m", dead_zone_n_m(table))?;
        header.set_item("drive_hash", blake3::Hash::from_bytes(table.drive_hash()).to_hex().to_string())?;
        header.set_item("tool_version", table.tool_version())?;
        header.set_item("mesh_level", table.mesh_level())?;
        header.set_item("error_limit_rad", table.error_limit_rad())?;
        header.set_item("projection_rms_rad", table.projection_rms_rad())?;
        header.set_item("projection_worst_rad", table.projection_worst_rad())?;
        Ok(header)
    }

    /// `Table::forward` of the core. With `direction` each row for itself, in steady motion; else in row order from
    /// `state`, which follows.
    #[expect(clippy::too_many_arguments, reason = "each is a column")]
    fn forward(
        &self,
        py: Python<'_>,
        generator_rad: In<'_>,
        torque_n_m: In<'_>,
        temperature_c: In<'_>,
        direction: Option<In<'_, i8>>,
        state: Option<&PlayState>,
        mut output_rad: Out<'_, f64>,
        mut transmission_error_rad: Out<'_, f32>,
        mut uncertainty_rad: Out<'_, f32>,
        mut quality: Out<'_, u8>,
    ) -> PyResult<()> {
        let table = self.table();
        let generator = input("generator_rad", &generator_rad)?;
        let rows = generator.len();
        let torque = Column::new("torque_n_m", input("torque_n_m", &torque_n_m)?, rows)?;
        let temperature = Column::new("temperature_c", input("temperature_c", &temperature_c)?, rows)?;
        let out = output("output_rad", &mut output_rad, rows)?;
        let error = output("transmission_error_rad", &mut transmission_error_rad, rows)?;
        let uncertainty = output("uncertainty_rad", &mut uncertainty_rad, rows)?;
        let quality = output("quality", &mut quality, rows)?;
        angles("generator_rad", generator)?;
        let mut put = |row: usize, said: flexspline::Prediction| {
            out[row] = said.output.to_rad();
            error[row] = said.transmission_error_rad;
            uncertainty[row] = said.uncertainty_rad;
            quality[row] = said.quality as u8;
        };
        let at = |row: usize, play: &mut CoreState| {
            let angle = GeneratorAngle::from_rad(generator[row]).unwrap_or(GeneratorAngle::ZERO);
            table.forward(play, angle, torque.at(row) as f32, temperature.at(row) as f32)
        };
        if let Some(sides) = directions(direction.as_ref(), rows)? {
            return for_rows(py, rows, |row| put(row, at(row, &mut CoreState::after_motion(sides.at(row)))));
        }
        let mut play = state.map_or(CoreState::unknown(), PlayState::get);
        for_rows(py, rows, |row| put(row, at(row, &mut play)))?;
        state.iter().for_each(|state| state.set(play));
        Ok(())
    }

    /// `Table::inverse` of the core: each row for itself, in steady motion in `direction`, or from where `state` rests.
    #[expect(clippy::too_many_arguments, reason = "each is a column")]
    fn inverse(
        &self,
        py: Python<'_>,
        target_rad: In<'_>,
        torque_n_m: In<'_>,
        temperature_c: In<'_>,
        direction: Option<In<'_, i8>>,
        state: Option<&PlayState>,
        mut generator_rad: Out<'_, f64>,
        mut predicted_error_rad: Out<'_, f32>,
        mut uncertainty_rad: Out<'_, f32>,
        mut quality: Out<'_, u8>,
    ) -> PyResult<()> {
        let table = self.table();
        let target = input("output_rad", &target_rad)?;
        let rows = target.len();
        let torque = Column::new("torque_n_m", input("torque_n_m", &torque_n_m)?, rows)?;
        let temperature = Column::new("temperature_c", input("temperature_c", &temperature_c)?, rows)?;
        let generator = output("generator_rad", &mut generator_rad, rows)?;
        let error = output("predicted_error_rad", &mut predicted_error_rad, rows)?;
        let uncertainty = output("uncertainty_rad", &mut uncertainty_rad, rows)?;
        let quality = output("quality", &mut quality, rows)?;
        angles("output_rad", target)?;
        let mut put = |row: usize, approach: Approach<'_>| {
            let angle = OutputAngle::from_rad(target[row]).unwrap_or(OutputAngle::ZERO);
            let said = table.inverse(angle, torque.at(row) as f32, temperature.at(row) as f32, approach);
            generator[row] = said.generator.to_rad();
            error[row] = said.predicted_error_rad;
            uncertainty[row] = said.uncertainty_rad;
            quality[row] = said.quality as u8;
        };
        if let Some(sides) = directions(direction.as_ref(), rows)? {
            return for_rows(py, rows, |row| put(row, Approach::Moving(sides.at(row))));
        }
        let play = state.map_or(CoreState::unknown(), PlayState::get);
        for_rows(py, rows, |row| put(row, Approach::From(&play)))
    }

    /// Torques by wind-up. With `direction` each row for itself, in steady motion, without `hysteresis`: what springs
    /// hold is of the loads before. Else in row order from `state`, which stays.
    #[expect(clippy::too_many_arguments, reason = "each is a column")]
    fn torque(
        &self,
        py: Python<'_>,
        generator_rad: In<'_>,
        output_rad: In<'_>,
        temperature_c: In<'_>,
        half_width_rad: In<'_>,
        direction: Option<In<'_, i8>>,
        state: Option<&PlayState>,
        hysteresis: Option<&str>,
        mut torque_n_m: Out<'_, f64>,
        mut low_n_m: Out<'_, f64>,
        mut high_n_m: Out<'_, f64>,
    ) -> PyResult<()> {
        let table = self.table();
        let generator = input("generator_rad", &generator_rad)?;
        let rows = generator.len();
        let reading = Column::new("output_rad", input("output_rad", &output_rad)?, rows)?;
        let temperature = Column::new("temperature_c", input("temperature_c", &temperature_c)?, rows)?;
        let half_width = Column::new("half_width_arcsec", input("half_width_arcsec", &half_width_rad)?, rows)?;
        let torque = output("torque_n_m", &mut torque_n_m, rows)?;
        let low = output("low_n_m", &mut low_n_m, rows)?;
        let high = output("high_n_m", &mut high_n_m, rows)?;
        angles("generator_rad", generator)?;
        let ratio = table.drive().exact_ratio();
        let sides = directions(direction.as_ref(), rows)?;
        let hysteresis = hysteresis.map_or(Ok(Hysteresis::default()), serde_json::from_str).map_err(bad)?;
        let mut wind_up = WindUpCurve::new(table, state.map_or(CoreState::unknown(), PlayState::get), hysteresis);
        for_rows(py, rows, |row| {
            if let Some(sides) = &sides {
                wind_up = WindUpCurve::new(table, CoreState::after_motion(sides.at(row)), Hysteresis::default());
            }
            let error = reading.at(row) - generator[row] / ratio;
            [torque[row], low[row], high[row], _] =
                wind_up.next([generator[row], error, temperature.at(row), half_width.at(row), f64::NAN]);
        })
    }

    /// The core over measured rows, as the command `replay` runs it: the columns of `replay.csv` and the text of
    /// `summary.json`.
    fn replay<'py>(
        &self,
        py: Python<'py>,
        generator_rad: In<'_>,
        error_arcsec: In<'_>,
        torque_n_m: In<'_>,
        temperature_c: In<'_>,
    ) -> PyResult<(Bound<'py, PyDict>, String)> {
        let generator = input("generator_rad", &generator_rad)?;
        let rows = generator.len();
        let error = Column::new("error_arcsec", input("error_arcsec", &error_arcsec)?, rows)?;
        let torque = Column::new("torque_n_m", input("torque_n_m", &torque_n_m)?, rows)?;
        let temperature = Column::new("temperature_c", input("temperature_c", &temperature_c)?, rows)?;
        angles("generator_rad", generator)?;
        let rows: Vec<MeasuredRow> = generator
            .iter()
            .enumerate()
            .map(|(row, generator)| MeasuredRow {
                generator_rad: *generator,
                error_arcsec: error.at(row),
                torque_n_m: torque.at(row),
                temperature_c: temperature.at(row),
                session: 0,
            })
            .collect();
        self.replayed(py, RowsRead { rows, faults: Vec::new(), notes: Vec::new() })
    }

    /// The same of a CSV.
    fn replay_file<'py>(
        &self,
        py: Python<'py>,
        file: &str,
        temperature_c: f64,
    ) -> PyResult<(Bound<'py, PyDict>, String)> {
        let (_, bytes) = bytes_of(std::path::Path::new(file)).map_err(bad)?;
        let read = read(file, &bytes[..], &ColumnMap::default(), self.table(), temperature_c, true).map_err(bad)?;
        self.replayed(py, read)
    }

    /// Arc-seconds in a radian, as every number here is converted.
    #[classattr]
    #[allow(non_upper_case_globals)]
    const arcsec_per_rad: f64 = ARCSEC_PER_RAD;
}

impl Table {
    fn replayed<'py>(
        &self,
        py: Python<'py>,
        RowsRead { rows, faults, notes }: RowsRead,
    ) -> PyResult<(Bound<'py, PyDict>, String)> {
        let (replayed, mut summary) = py.detach(|| replay(self.table(), &rows, None));
        (summary.data_faults, summary.notes) = (faults, notes);
        let columns = PyDict::new(py);
        let numbers = |of: fn(&ReplayedRow) -> f64| replayed.iter().map(of).collect::<Vec<f64>>().into_pyarray(py);
        columns.set_item("generator_rad", numbers(|row| row.generator_rad))?;
        columns.set_item("torque_n_m", numbers(|row| row.torque_n_m))?;
        columns.set_item("temperature_c", numbers(|row| row.temperature_c))?;
        columns.set_item("measured_arcsec", numbers(|row| row.measured_arcsec))?;
        columns.set_item("predicted_arcsec", numbers(|row| row.predicted_arcsec))?;
        columns.set_item("residual_arcsec", numbers(|row| row.residual_arcsec))?;
        columns.set_item("uncertainty_arcsec", numbers(|row| row.uncertainty_arcsec))?;
        let names = ["in range", "uncertain", "extrapolated"];
        let quality = |row: &ReplayedRow| names.iter().position(|name| *name == row.quality).unwrap_or(3) as u8;
        columns.set_item("quality", replayed.iter().map(quality).collect::<Vec<u8>>().into_pyarray(py))?;
        columns.set_item("torque_from_wind_up_n_m", numbers(|row| row.torque_from_wind_up_n_m))?;
        columns.set_item("torque_from_wind_up_low_n_m", numbers(|row| row.torque_from_wind_up_low_n_m))?;
        columns.set_item("torque_from_wind_up_high_n_m", numbers(|row| row.torque_from_wind_up_high_n_m))?;
        Ok((columns, serde_json::to_string(&summary).map_err(bad)?))
    }
}

/// The direction of each row, or one for all, if it is given.
fn directions(signs: Option<&In<'_, i8>>, rows: usize) -> PyResult<Option<Column<Vec<Direction>>>> {
    let Some(signs) = signs else { return Ok(None) };
    let Column { values, step } = Column::new("direction", input("direction", signs)?, rows)?;
    let values = values.iter().map(|sign| direction_of(i32::from(*sign))).collect::<PyResult<_>>()?;
    Ok(Some(Column { values, step }))
}
