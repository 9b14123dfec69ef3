"""Opening and selecting: lazily, and with one readable line where something is amiss."""

import numpy as np
import pytest
import synthetic_store
import zarr

from postproc.cases.maps import map_data
from postproc.signals.cascade import cascade
from postproc.store.open import open_store
from postproc.store.select import first_of_rest, narrow, select
from rubhpc.errors import InputError, StoreError

ONE = {"speed_ratio": 0.75, "clearance": "84 um", "friction": 0.3, "stator.youngs_modulus": "30 GPa"}


@pytest.fixture
def store(synthetic_path):
    return open_store(synthetic_path)


@pytest.fixture
def chunks_read(monkeypatch):
    """Names of the chunk files that zarr reads from here on."""
    read = []
    get = zarr.storage.LocalStore.get

    async def counting(self, key, *args, **kwargs):
        if "/c/" in key:
            read.append(key)
        return await get(self, key, *args, **kwargs)

    monkeypatch.setattr(zarr.storage.LocalStore, "get", counting)
    return read


def test_a_store_opens_lazily(synthetic_path, chunks_read):
    store = open_store(synthetic_path)
    assert store["vertical"].chunks is not None
    assert not [key for key in chunks_read if key.split("/")[0] in store.data_vars]


def test_durations_stay_numbers(store):
    assert store["wall_time"].dtype == np.float64


def test_a_selection_reads_its_own_chunks_only(store, chunks_read):
    case = select(store, ONE)
    chunks_read.clear()
    wave = case["vertical"].load()
    assert wave.dims == ("sample",)
    assert chunks_read == ["vertical/c/0/1/0/1/0"]


def test_a_cascade_reads_one_chunk_a_speed(store, chunks_read):
    chosen = select(store, {k: v for k, v in ONE.items() if k != "speed_ratio"})
    spectra = cascade(chosen.drop_vars("period"))
    chunks_read.clear()
    spectra.load()
    assert sorted(chunks_read) == [f"spectrum_torsion/c/{i}/1/0/1/0" for i in range(5)]


def test_a_map_reads_only_its_scalar_the_status_and_the_monitors(store, chunks_read):
    chosen = select(store, {"friction": 0.1, "stator.youngs_modulus": 3e9})
    chunks_read.clear()
    map_data(chosen, "peak_contact_force", ["speed_ratio", "clearance"])
    monitors = {"minimum_slip_speed", "force_over_euler_load", "tip_deflection_ratio", "settled"}
    monitors |= {"foreshortening_ratio", "normal_angle", "force_over_strength", "bearing_clearance_ratio"}
    assert {key.split("/")[0] for key in chunks_read} == {"peak_contact_force", "status", *monitors}


def test_values_may_carry_units_and_axes_their_dotted_names(store):
    case = select(store, ONE)
    assert float(case["clearance"]) == 84e-6
    assert float(case["stator_youngs_modulus"]) == 30e9


def test_a_rounded_value_finds_its_grid_value(store):
    assert float(select(store, {"speed_ratio": 1.7000000001})["speed_ratio"]) == 1.7


def test_several_values_and_ranges_keep_the_axis(store):
    assert select(store, {"friction": "0.1,0.3"}).sizes["friction"] == 2
    assert select(store, {"speed_ratio": "1..1.5"})["speed_ratio"].values == pytest.approx([1, 1.25, 1.5])
    assert select(store, {"clearance": "80 um.."})["clearance"].values == pytest.approx([84e-6, 100e-6])


@pytest.mark.parametrize(
    ("choice", "parts"),
    [
        ({"frction": 0.3}, ["no axis frction", "did you mean friction?"]),
        ({"nonsense": 1}, ["no axis nonsense", "speed_ratio, clearance, friction"]),
        ({"friction": 0.2}, ["friction = 0.2", "not on the grid", "0.1, 0.3"]),
        ({"clearance": "85 um"}, ["clearance = 85 um", "70 um, 84 um, 100 um"]),
        ({"clearance": "84 kg"}, ["clearance", "84 kg", "is not in m"]),
        ({"speed_ratio": "2..3"}, ["no value in that range", "0.75"]),
        ({"stator": 2}, ["stator = 2: not on the grid"]),
    ],
)
def test_a_wrong_selection_is_refused_in_one_line(store, choice, parts):
    with pytest.raises(InputError) as refusal:
        select(store, choice)
    message = str(refusal.value)
    assert "\n" not in message
    for part in parts:
        assert part in message


def test_an_axis_is_not_selected_twice(store):
    with pytest.raises(InputError, match="selected already"):
        select(select(store, {"friction": 0.3}), {"friction": 0.3})


def test_what_must_be_selected_is_asked_for_with_its_values(store):
    chosen = select(store, {"speed_ratio": 1.0, "clearance": 84e-6})
    with pytest.raises(InputError) as refusal:
        narrow(chosen, ["vertical"])
    message = str(refusal.value)
    assert "friction (one of 0.1, 0.3)" in message
    assert "stator_youngs_modulus (one of 3 GPa, 30 GPa)" in message
    assert "\n" not in message


def test_a_stator_is_chosen_only_for_its_own_signals(tmp_path):
    synthetic_store.write(tmp_path / "two.zarr", synthetic_store.make(keep=("waveform",), n_stator=2))
    case = select(open_store(tmp_path / "two.zarr"), ONE)
    assert "stator" not in narrow(case, ["vertical"]).coords
    assert int(narrow(case, ["contact_force"])["stator"]) == 1
    with pytest.raises(InputError, match=r"stator \(one of 1, 2\)"):
        narrow(case.drop_vars("peak_contact_force"), ["contact_force"])
    assert narrow(select(case, {"stator": 2}), ["contact_force"])["contact_force"].dims == ("sample",)


def test_what_is_not_kept_says_how_to_keep_it(tmp_path):
    synthetic_store.write(tmp_path / "bare.zarr", synthetic_store.make(keep=()))
    with pytest.raises(InputError, match=r'does not contain vertical; run the study with "waveform"'):
        narrow(open_store(tmp_path / "bare.zarr"), ["vertical"])


def test_the_first_value_of_the_rest_is_announced(store):
    chosen, notes = first_of_rest(store, ["speed_ratio", "clearance"], "peak_contact_force")
    assert set(chosen["peak_contact_force"].dims) == {"speed_ratio", "clearance"}
    assert len(notes) == 2
    assert notes[0] == "friction = 0.1: the first of 2; change with --select friction=VALUE"


def test_what_is_no_store_is_a_store_error_as_it_is_to_status(tmp_path):
    with pytest.raises(StoreError, match="no such store"):
        open_store(tmp_path / "absent.zarr")
    (tmp_path / "empty.zarr").mkdir()
    with pytest.raises(StoreError, match="cannot be read as a zarr store"):
        open_store(tmp_path / "empty.zarr")
    zarr.create_group(tmp_path / "other.zarr", zarr_format=3)
    with pytest.raises(StoreError, match="is not a rubhpc store"):
        open_store(tmp_path / "other.zarr")
