"""A record: variables by name, one line to print, a dataset with units; and the state it ends in."""

import ast
import inspect
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig

from rubhpc.fem.assemble import assemble
from rubhpc.integrate.measuring.divergence import diverged_record
from rubhpc.integrate.record import Record, RecordVariables, State
from rubhpc.schema import DIVERGED, VARIABLES
from rubhpc.study.study import Recording

N_STATOR, REVOLUTIONS, PER_REVOLUTION = 2, 3, 8
N_SAMPLE = REVOLUTIONS * PER_REVOLUTION
MODEL = assemble(read_rig("mokhtar2017"))


@pytest.fixture
def record():
    return Record(
        samples_per_revolution=PER_REVOLUTION,
        signals={"vertical": np.arange(float(N_SAMPLE)), "contact_force": np.ones((N_STATOR, N_SAMPLE))},
        spectra={"spectrum_vertical": np.zeros(N_SAMPLE // 2 + 1)},
        sections={"section_vertical": np.arange(3.0)},
        measures={"period": 2, "peak_contact_force": np.array([1.0, 2.0])},
        settings={"spin_speed": 100.0, "clearance": 1e-4},
        final=State.at_rest(MODEL),
    )


def test_variables_are_attributes(record):
    assert record.period == 2
    assert record.spin_speed == 100.0
    assert record.vertical[5] == 5.0
    assert record.section_vertical.size == 3
    assert not hasattr(record, "horizontal")
    with pytest.raises(AttributeError, match="contains no torsion"):
        _ = record.torsion


def test_a_record_lists_its_variables(record):
    names = dir(record)
    assert {"vertical", "peak_contact_force", "clearance", "to_dataset"} <= set(names)
    assert "horizontal" not in names  # this one does not hold it


def test_types_of_variables_are_those_of_the_schema():
    """Editors and type checkers read these; at run time they are no attributes of the class."""
    tree = ast.parse(inspect.getsource(RecordVariables))
    typed = {a.target.id: a.annotation.id for a in ast.walk(tree) if isinstance(a, ast.AnnAssign)}
    expected = {
        variable.name: "Floats" if variable.dims else "int" if variable.dtype.startswith("int") else "float"
        for variable in VARIABLES.values()
        if variable.role != "state" and variable.name != "status"
    }
    assert typed == expected
    assert not hasattr(RecordVariables, "vertical")


def test_one_line_says_what_it_holds(record):
    assert repr(record) == "<Record: done; vertical, contact_force, spectrum_vertical, section_vertical>"


@pytest.mark.parametrize(
    ("scheme", "residual", "remark"),
    [
        (0, 9e-3, ""),
        (2, 0.25, "its energy balance is off by 25 %; use a shorter step"),
        (4, 0.011, "its energy balance is off by 1.1 %; use a smaller accuracy"),
    ],
)
def test_a_poor_energy_balance_is_remarked_on(record, scheme, residual, remark):
    measures = record.measures | {"scheme": scheme, "energy_residual": residual}
    assert replace(record, measures=measures).remark == remark


def test_dataset_is_laid_out_like_a_store(record):
    dataset = record.to_dataset()
    for name, array in dataset.data_vars.items():
        assert array.dims == VARIABLES[name].dims
        assert array.attrs == {"units": VARIABLES[name].unit, "long_name": VARIABLES[name].long_name}
    assert dataset.sizes == {"stator": 2, "sample": N_SAMPLE, "order": N_SAMPLE // 2 + 1, "section": 3}
    assert dataset["revolution"].dims == ("sample",)
    assert dataset["revolution"].values == pytest.approx(np.arange(N_SAMPLE) / PER_REVOLUTION)
    # 3 revolutions: lines a third of an order apart, up to half the samples of a revolution
    assert dataset["order"].values == pytest.approx(np.arange(N_SAMPLE // 2 + 1) / REVOLUTIONS)
    assert dataset["section"].values.tolist() == [0, 1, 2]
    assert dataset.attrs == {"status": "done", "reason": ""}
    assert dataset["peak_contact_force"].values.tolist() == [1.0, 2.0]


def test_diverged_record_holds_what_was_reached(record):
    recording = Recording(transient=1, revolutions=REVOLUTIONS, samples_per_revolution=PER_REVOLUTION * 2)
    reached = {"vertical": np.arange(2.0 * PER_REVOLUTION + 3), "contact_force": np.ones((N_STATOR, 5))}
    diverged = diverged_record("it left", N_STATOR, recording, {}, record.final, reached)
    n_reached = 2 * PER_REVOLUTION + 3
    assert diverged.vertical[:n_reached].tolist() == reached["vertical"].tolist()
    assert np.isnan(diverged.vertical[n_reached:]).all()
    assert diverged.section_vertical[:2].tolist() == [0.0, 2.0 * PER_REVOLUTION]
    assert np.isnan(diverged.section_vertical[2:]).all()
    assert np.isfinite(diverged.contact_force).sum() == 5 * N_STATOR
    assert np.isnan(diverged.horizontal).all()
    assert np.isnan(diverged.spectrum_vertical).all()


@pytest.mark.parametrize("keep", [(), ("waveform",), ("spectrum", "section")])
def test_diverged_record_is_not_a_number_of_the_usual_shape(record, keep):
    recording = Recording(
        transient=1, revolutions=REVOLUTIONS, samples_per_revolution=PER_REVOLUTION * 2, keep=keep
    )
    diverged = diverged_record("it left", N_STATOR, recording, {"clearance": 1e-4}, record.final)
    assert diverged.status == DIVERGED
    assert repr(diverged).startswith("<Record: diverged (it left); ")
    length = {"stator": 2, "sample": 2 * N_SAMPLE, "order": N_SAMPLE + 1, "section": REVOLUTIONS}
    dataset = diverged.to_dataset()
    for variable in VARIABLES.values():
        is_kept = variable.role == "measure" or variable.role in keep
        assert (variable.name in dataset) == (is_kept or variable.name in ("clearance", "regime"))
        if is_kept:
            array = dataset[variable.name]
            assert array.shape == tuple(length[dim] for dim in variable.dims)
            if variable.dtype.startswith("float"):
                assert np.isnan(array).all()
    assert dataset["regime"] == -1
    assert dataset["period"] == -1
