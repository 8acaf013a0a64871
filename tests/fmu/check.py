"""FMUs in FMPy, compared with `flexspline replay`:

    check.py FLEXSPLINE TABLE COMPENSATION.fmu JOINT.fmu FLOWN.fmu

Ends with "test result: ..." as cargo's tests do.
"""

import csv
import os
import subprocess
import sys
import tempfile
import traceback
import zipfile

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from lxml import etree

FLEXSPLINE, TABLE, COMPENSATION, JOINT, FLOWN = sys.argv[1:6]
ALL = (COMPENSATION, JOINT, FLOWN)
TICK = 1e-3


def no_findings():
    """FMPy's validator: schema, names, structure, starts, units."""
    for fmu in ALL:
        assert validate_fmu(fmu) == [], (fmu, validate_fmu(fmu))


def as_the_schema_says():
    """modelDescription.xml against the schema of the standard, as FMPy brings it; and a wrong one is refused."""
    folder = os.path.join(os.path.dirname(fmpy.__file__), "schema", "fmi2")
    schema = etree.XMLSchema(etree.parse(os.path.join(folder, "fmi2ModelDescription.xsd")))
    for fmu in ALL:
        with zipfile.ZipFile(fmu) as file:
            xml = file.read("modelDescription.xml")
            assert file.testzip() is None
            assert {i.compress_type for i in file.infolist()} == {zipfile.ZIP_DEFLATED}
            names = file.namelist()
        schema.assertValid(etree.fromstring(xml))
        assert not schema.validate(etree.fromstring(xml.replace(b"causality", b"causalities", 1)))
        for wanted in ("documentation/index.html", "documentation/licenses/license.txt", "resources/table.fxt", "binaries/linux64/"):
            assert any(name.startswith(wanted) for name in names), names


def ports_stand_alone():
    """Each number has a unit that is defined, each port says what it is and, where it can be negative, which way."""
    for fmu in (COMPENSATION, JOINT):
        description = fmpy.read_model_description(fmu)
        units = {unit.name for unit in description.unitDefinitions}
        for variable in description.modelVariables:
            assert variable.type != "Real" or variable.unit in units, variable.name
        ports = [variable for variable in description.modelVariables if variable.causality in ("input", "output")]
        for port in ports:
            assert "_" in port.name or port.name == "heat", f"{port.name} is one word: of what?"
            assert len(port.description) > 15 and not port.description.startswith("its "), port.name
            quantity = port.unit in ("rad", "N.m") and "rate" not in port.name
            assert not quantity or "positive" in port.description, port.name


def swept(rows=4000):
    """Inputs: slews both ways under a load that changes its sign."""
    time = TICK * np.arange(rows)
    kinds = [(name, float) for name in ("time", "output_angle_command", "output_rate_command", "output_torque", "drive_temperature")]
    signals = np.zeros(rows, dtype=kinds)
    signals["time"] = time
    signals["output_angle_command"] = 0.08 * np.sin(0.8 * time)
    signals["output_rate_command"] = 0.08 * 0.8 * np.cos(0.8 * time)
    signals["output_torque"] = np.where(time < 2.0, 20.0, -12.0)
    signals["drive_temperature"] = 20.0
    return signals


OUTPUTS = ["generator_angle_command", "transmission_error_predicted", "output_angle_correction", "correction_quality", "not_corrected"]


def compensated():
    """The FMU over those inputs."""
    return fmpy.simulate_fmu(COMPENSATION, stop_time=4.0, step_size=TICK, output_interval=TICK, input=swept(), output=OUTPUTS)


def the_core_is_replayed():
    """`flexspline replay` over the same rows predicts what the FMU does, and with its prediction the command leaves nothing of the error."""
    signals, result = swept(), compensated()
    # Row 0 is before the first tick; row k has tick k, whose generator is where the tick before commanded it.
    with tempfile.TemporaryDirectory() as folder:
        rows = os.path.join(folder, "rows.csv")
        noise = np.random.default_rng(1).normal(0.0, 1.0, len(result))
        with open(rows, "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["generator_rad", "torque_n_m", "temperature_c", "error_arcsec"])
            for k in range(1, len(result)):
                # As a bench would read it: with noise.
                error = float(result["transmission_error_predicted"][k]) + noise[k]
                writer.writerow([repr(float(result["generator_angle_command"][k - 1])), signals["output_torque"][k - 1], 20.0, error])
        command = [FLEXSPLINE, "replay", "-q", "--tables", TABLE, rows, "--out", folder]
        subprocess.run(command, check=True)
        with open(os.path.join(folder, "replay.csv"), newline="") as file:
            predicted = np.array([float(row["predicted_arcsec"]) for row in csv.DictReader(file)])
    # Replay reads the table as it is, the joint its copies in memory, which are rounded to a count (0.0003") once more.
    off = np.abs(predicted - result["transmission_error_predicted"][1:]).max()
    # Tick k commands for the target at its beginning; what the drive of the table then does is the prediction of row k + 1.
    output = result["generator_angle_command"][1:-1] / 95.0 + predicted[1:] * np.pi / 648000.0
    left = (output - signals["output_angle_command"][: len(output)]) * 648000.0 / np.pi
    settled = np.r_[500:1900, 2500:3900]
    rms, before = (float(np.sqrt(np.mean(values[settled] ** 2))) for values in (left, predicted))
    print(f'  {before:.1f}" before, {rms:.4f}" left; off replay by {off:.1e}"')
    assert len(predicted) == 4000 and off < 1e-3, off
    assert before > 30.0 and rms < 0.01, (before, rms)
    assert not result["not_corrected"].any()


def steps_of_another_size():
    """A constant input: communication steps of 1, 2.5 and 10 ticks end in the same bits."""
    ends = []
    for step in (TICK, 2.5 * TICK, 10 * TICK):
        start = {"output_angle_command": 0.01, "output_torque": 8.0}
        result = fmpy.simulate_fmu(COMPENSATION, stop_time=1.0, step_size=step, output_interval=step, start_values=start, output=OUTPUTS)
        ends.append(tuple(result[name][-1] for name in OUTPUTS))
    assert ends[0] == ends[1] == ends[2], ends


class Slave:
    """An instance, unzipped and ready."""

    def __init__(self, fmu, name):
        self.folder = tempfile.TemporaryDirectory(prefix="an fmu %41 ")
        fmpy.extract(fmu, unzipdir=self.folder.name)
        self.description = fmpy.read_model_description(self.folder.name)
        self.places = {v.name: v.valueReference for v in self.description.modelVariables}
        identifier = self.description.coSimulation.modelIdentifier
        self.slave = FMU2Slave(
            guid=self.description.guid, modelIdentifier=identifier, unzipDirectory=self.folder.name, instanceName=name
        )
        self.slave.instantiate()
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.time = 0.0

    def run(self, ticks, inputs):
        rows = []
        for k in range(ticks):
            for name, value in inputs(self.time).items():
                self.slave.setReal([self.places[name]], [value])
            self.slave.doStep(self.time, TICK)
            self.time += TICK
            rows.append(tuple(self.slave.getReal(list(self.places[name] for name in self.read))))
        return rows

    def free(self):
        self.slave.terminate()
        self.slave.freeInstance()
        self.folder.cleanup()


def moving(time):
    return {"output_angle_command": 0.02 * np.sin(time), "output_rate_command": 0.02 * np.cos(time), "load_torque": 5.0 * np.sin(3.0 * time)}


def energy_is_conserved():
    """The motor pushes the joint of a scenario to and fro: what goes in is heat or stored."""
    time = TICK * np.arange(4000)
    signals = np.zeros(len(time), dtype=[("time", float), ("motor_torque_command", float), ("load_torque", float)])
    signals["time"], signals["motor_torque_command"] = time, 0.5 * np.sin(5.0 * time)
    signals["load_torque"] = 4.0 * np.sin(9.0 * time)
    outputs = ["energy_error", "heat", "motor_work", "output_angle", "mesh_torque"]
    result = fmpy.simulate_fmu(
        FLOWN, stop_time=4.0, step_size=TICK, output_interval=TICK, input=signals, start_values={"servo": False}, output=outputs
    )
    heat, missing = result["heat"][-1], np.abs(result["energy_error"]).max()
    print(f"  {heat:.3f} J of heat, {missing:.1e} J missing")
    assert heat > 0.05 and missing < 1e-8 * heat, (heat, missing)
    assert np.abs(result["mesh_torque"]).max() > 1.0


def the_table_helps_the_joint():
    """A slow turn under a steady load, with and without compensation."""
    time = TICK * np.arange(6000)
    signals = np.zeros(len(time), dtype=[(name, float) for name in ("time", "output_angle_command", "output_rate_command", "load_torque")])
    signals["time"], signals["output_angle_command"], signals["output_rate_command"], signals["load_torque"] = time, 0.01 * time, 0.01, 10.0
    left = []
    for compensate in (False, True):
        start = {"compensate": compensate, "gravity_torque": 0.0, "torque_noise": 0.0, "friction_known": 1.0}
        result = fmpy.simulate_fmu(
            JOINT, stop_time=6.0, step_size=TICK, output_interval=TICK, input=signals, start_values=start, output=["output_angle"]
        )
        error = (result["output_angle"] - 0.01 * result["time"])[3000:] * 648000.0 / np.pi
        left.append(float(np.sqrt(np.mean(error**2))))
    print(f'  {left[0]:.1f}" without, {left[1]:.2f}" with')
    assert left[0] > 25.0 and left[1] < 0.1 * left[0], left


def refusals():
    """A wrong call is an exception with a line in the log, and the instance goes on."""
    said = []
    one = Slave(COMPENSATION, "one")
    one.read = ["generator_angle_command"]
    one.slave.terminate()
    try:
        one.slave.doStep(0.0, TICK)
    except Exception as error:
        said.append(str(error))
    one.slave.reset()
    one.slave.setupExperiment(startTime=0.0)
    one.slave.enterInitializationMode()
    one.slave.exitInitializationMode()
    assert len(one.run(5, lambda time: {"output_angle_command": 0.01})) == 5
    one.free()
    assert len(said) == 1 and "DoStep" in said[0], said


def main():
    passed, failed = 0, 0
    checks = [
        no_findings,
        as_the_schema_says,
        ports_stand_alone,
        the_core_is_replayed,
        steps_of_another_size,
        energy_is_conserved,
        the_table_helps_the_joint,
        refusals,
    ]
    for check in checks:
        print(f"{check.__name__}: {check.__doc__}", flush=True)
        try:
            check()
            passed += 1
        except Exception:
            traceback.print_exc()
            failed += 1
    print(f"test result: {'FAILED' if failed else 'ok'}. {passed} passed; {failed} failed;")
    return failed > 0


if __name__ == "__main__":
    sys.exit(main())
