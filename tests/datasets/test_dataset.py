"""Data sets: windows against the motion that they are cut from, labels, splits, bytes and refusals."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
import synthetic_store
from pyarrow import parquet

import rubhpc
from postproc.datasets.dataset import write_dataset
from postproc.datasets.splits import SPLITS, keys_of, split_cases
from rubhpc.cli import commands
from rubhpc.errors import InputError
from rubhpc.schema import REGIME
from rubhpc.study.study import read_study

if TYPE_CHECKING:
    from pathlib import Path


SMALL = {"n_sample": 64, "n_draw": 2}
FREE = 1.7  # speed ratio without contact


@pytest.fixture(scope="module")
def store():
    """The synthetic store: 60 cases, 57 with a result; those at the highest speed touch nothing."""
    made = synthetic_store.make()
    for name in ("contact_force", "peak_contact_force", "contact_fraction", "friction_work"):
        made[name] = made[name].where((made["speed_ratio"] != FREE) | made[name].isnull(), 0.0)
    return made


def read(folder: Path) -> pd.DataFrame:
    found = {
        name: pd.read_parquet(folder / f"{name}.parquet")
        for name in SPLITS
        if (folder / f"{name}.parquet").exists()
    }
    return pd.concat([frame.assign(split=name) for name, frame in found.items()], ignore_index=True)


def digests(folder: Path) -> dict[str, str]:
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in folder.iterdir()}


def motion(turns: np.ndarray) -> np.ndarray:
    return sum(a * np.cos(2 * np.pi * order * turns) for order, a in synthetic_store.AMPLITUDES.items())


def test_a_window_is_the_motion_seen_at_its_place(store, tmp_path):
    write_dataset(store, tmp_path / "d", levels=(0.0,), **SMALL)
    found = read(tmp_path / "d")
    assert len(found) == 57 * 2
    assert found["case"].nunique() == 57
    assert found["start"].nunique() > 70
    for _, row in found.iterrows():
        turns = (row["start"] + np.arange(64) / row["rate"]) * row["spin_speed"] / (2 * np.pi)
        inside = (turns > 0.3) & (turns < 7.7)  # the filters lack samples at the ends of a record
        assert row["vertical"][inside] == pytest.approx(motion(turns)[inside], abs=1e-6)
        fine = np.floor(np.linspace(turns[0], turns[-1], 10_000) * 32) / 32  # beginnings of intervals
        is_touching = (20 * np.cos(2 * np.pi * fine) > 15) & (row["speed_ratio"] != FREE)
        assert row["contact"] == is_touching.any()
        error = 2 / (32 * (turns[-1] - turns[0]))  # of an interval at each end
        assert row["window_contact_fraction"] == pytest.approx(is_touching.mean(), abs=error)
        pulses = np.flatnonzero(np.diff(row["key_phasor"]) > 0) + 1
        assert (turns[pulses] % 1 < 32 / 32 / 20).all()


def test_a_row_has_the_parameters_and_labels_of_its_case(store, tmp_path):
    write_dataset(store, tmp_path / "d", **SMALL)
    found = read(tmp_path / "d").drop_duplicates("case")
    for _, row in found.iterrows():
        axes = ("speed_ratio", "clearance", "friction", "stator_youngs_modulus")
        case = store.sel({axis: row[axis] for axis in axes})
        assert row["peak_contact_force"] == pytest.approx(float(case["peak_contact_force"].item()))
        assert row["period"] == int(case["period"])
        assert row["regime"] == REGIME[int(case["regime"])]
        assert ("slip" in row["out_of_range"]) == (row["speed_ratio"] > 1.4)
    schema = parquet.read_schema(tmp_path / "d" / "train.parquet")
    assert schema.field("clearance").metadata[b"units"] == b"m"
    assert schema.field("vertical").type.list_size == 64
    assert b'"title": "synthetic"' in schema.metadata[b"study"]
    text = (tmp_path / "d" / "README.md").read_text()
    for name in schema.names:
        assert f"| `{name}` |" in text
    assert "have no result: 3" in " ".join(text.split())


def test_noise_has_its_level_and_each_draw_is_another(store, tmp_path):
    """The rms of all signals about zero, whose median over the cases is that of every case here."""
    write_dataset(store, tmp_path / "d", levels=(0.0, 0.1), signals=["vertical"], n_sample=64, n_draw=40)
    found = read(tmp_path / "d")
    size = np.sqrt(sum(a**2 for a in synthetic_store.AMPLITUDES.values()) / 2)
    noise = []
    for _, row in found[found["noise"] == 0.1].iterrows():
        turns = (row["start"] + np.arange(64) / row["rate"]) * row["spin_speed"] / (2 * np.pi)
        noise.append((row["vertical"] - motion(turns))[(turns > 0.3) & (turns < 7.7)])
    assert np.concatenate(noise).std() == pytest.approx(0.1 * size, rel=0.01)
    assert abs(np.corrcoef(noise[0][:40], noise[1][:40])[0, 1]) < 0.5


def test_equal_arguments_give_equal_bytes_and_a_case_does_not_depend_on_others(store, tmp_path):
    sensors = tmp_path / "sensors.toml"
    sensors.write_text('[vertical]\nwhite = "2 um"\nstep = "1 um"\nrun_out = [[1, "4 um", "40 deg"]]')
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        write_dataset(store, tmp_path / name, sensors=sensors, seed=seed, **SMALL)
    assert digests(tmp_path / "a") == digests(tmp_path / "b")
    assert not set(digests(tmp_path / "a").values()) & set(digests(tmp_path / "c").values())
    few = store.isel(speed_ratio=slice(3, None)).chunk(friction=1)  # other places in the grid, other blocks
    write_dataset(few, tmp_path / "few", sensors=sensors, shares=(0, 0, 1), rate=756.0, **SMALL)
    write_dataset(store, tmp_path / "all", sensors=sensors, rate=756.0, **SMALL)
    by = ["speed_ratio", "clearance", "friction", "stator_youngs_modulus", "draw"]
    part, whole = (read(tmp_path / name).set_index(by).sort_index() for name in ("few", "all"))
    assert np.array_equal(np.stack(part["vertical"]), np.stack(whole.loc[part.index, "vertical"]))
    assert np.stack(part["vertical"]) * 1e6 == pytest.approx(
        np.rint(np.stack(part["vertical"]) * 1e6), abs=1e-3
    )
    assert "noise" not in whole


def test_no_case_and_no_motion_is_in_two_splits(store, tmp_path):
    write_dataset(store, tmp_path / "d", shares=(0.5, 0.25, 0.25), **SMALL)
    found = read(tmp_path / "d")
    assert (found.groupby("case")["split"].nunique() == 1).all()
    free = found[found["speed_ratio"] == FREE]
    assert free["split"].nunique() == 1  # they differ in clearance, friction and stator alone
    counts = found[found["speed_ratio"] != FREE].groupby("split")["case"].nunique()
    assert counts.to_dict() == {"train": 22, "validation": 12, "test": 11}


def test_groups_and_shares_of_splits():
    n = 400
    rng = np.random.default_rng(1)
    parameters = {
        "speed": np.repeat(np.arange(n / 2), 2),
        "direction": np.tile(["up", "down"], n // 2),
        "initial_vertical": rng.random(n),
    }
    touches = np.repeat(rng.random(n // 2) < 0.3, 2)
    keys, groups = keys_of(parameters, touches)
    assert len(set(keys)) == n
    assert groups[::2] == groups[1::2]
    assert len(set(groups)) == n / 2
    split = split_cases(groups, touches, (0.7, 0.2, 0.1), 1)
    for kind in (False, True):
        shares = np.bincount(split[touches == kind]) / (touches == kind).sum()
        assert shares == pytest.approx((0.7, 0.2, 0.1), abs=0.01)
    assert (split != split_cases(groups, touches, (0.7, 0.2, 0.1), 2)).any()
    order = rng.permutation(n)
    again = split_cases([groups[i] for i in order], touches[order], (0.7, 0.2, 0.1), 1)
    assert (again == split[order]).all()


def test_an_interrupted_run_leaves_nothing_and_the_next_is_whole(store, tmp_path):
    def stop(text: str) -> None:
        if text == "40/57 cases":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_dataset(store, tmp_path / "d", say=stop, **SMALL)
    assert not list(tmp_path.iterdir())
    (tmp_path / ".d.part").mkdir()  # of a process that was killed
    (tmp_path / ".d.part" / "train.parquet").write_text("half")
    write_dataset(store, tmp_path / "d", **SMALL)
    write_dataset(store, tmp_path / "e", **SMALL)
    assert digests(tmp_path / "d") == digests(tmp_path / "e")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["d", "e"]


def test_the_card_is_valid_and_reads_the_files(store, tmp_path):
    import mlcroissant

    write_dataset(store, tmp_path / "d", **SMALL)
    data = mlcroissant.Dataset(jsonld=tmp_path / "d" / "croissant.json")
    assert not data.metadata.issues.errors
    first = next(iter(data.records("validation")))
    row = pd.read_parquet(tmp_path / "d" / "validation.parquet").iloc[0]
    assert first["validation/vertical"] == pytest.approx(row["vertical"])
    assert first["validation/case"] == row["case"]
    assert len(first) == len(row)


def test_each_of_several_stators_has_its_columns(tmp_path):
    write_dataset(synthetic_store.make(n_stator=2), tmp_path / "d", signals=["stator_lateral"], **SMALL)
    found = read(tmp_path / "d")
    assert {"stator_lateral_stator_1", "stator_lateral_stator_2", "peak_contact_force_stator_2"} <= set(found)
    assert "stator_lateral" not in found


RUN_UPS = """
rig = "mokhtar2017"
[run_up]
start = "1200 rpm"
stop = "1500 rpm"
[grid]
"run_up.time" = ["0.4 s", "0.8 s"]
clearance = ["100 um", "5 mm"]
friction = 0.1
[record]
samples_per_revolution = 32
[[record.probe]]
name = "left"
node = 3
"""


def test_windows_of_run_ups_have_labels_of_their_own(tmp_path):
    (tmp_path / "run_up.toml").write_text(RUN_UPS)
    rubhpc.run(read_study(tmp_path / "run_up.toml", tmp_path / "r.zarr"), quiet=True)
    arguments = ["--samples", "128", "--split", "1", "0", "0", "--noise", "0"]
    command = ["dataset", str(tmp_path / "r.zarr"), "--output", str(tmp_path / "d"), *arguments]
    commands.main(command, standalone_mode=False)
    found = read(tmp_path / "d")
    assert len(found) == 40
    assert np.isfinite(np.stack(found["probe_left"])).all()
    near, free = found[found["clearance"] < 1e-3], found[found["clearance"] > 1e-3]
    assert not free["contact"].any()
    before, after = near[~near["contact"]], near[near["contact"]]  # the first touch is within the run-up
    assert 0 < len(before) < len(after)
    assert before["spin_speed"].max() < after["spin_speed"].median()
    assert (after["friction_work"] > 0).all()
    assert (free["friction_work"] == 0).all()
    middle = found["start"] + 64 / found["rate"]
    speed = (1200 + 300 * middle / found["run_up_time"]) * np.pi / 30
    assert found["spin_speed"].to_numpy() == pytest.approx(speed.to_numpy(), rel=2e-3)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"n_sample": 4096}, "take longer than the shortest record, 0.149 s; use at most --samples 112"),
        ({"signals": ["vertcal"]}, "vertcal: no such signal; there are vertical, horizontal"),
        ({"shares": (0.5, 0.2, 0.2)}, "split: 0.5 0.2 0.2: are not three shares with the sum 1"),
        ({"shares": (0.999, 0.001, 0)}, "split: a share of 0.001 of 57 cases leaves validation without one"),
        ({"rate": -1.0}, "rate: -1 Hz is out of range"),
        ({"sensors": "[vertcal]"}, "vertcal: unknown key; did you mean vertical?"),
        ({"sensors": "[vertical]\nwhit = 1"}, "vertical] whit: unknown key; did you mean white?"),
        ({"sensors": '[vertical]\nwhite = "1 V"'}, 'vertical] white: "1 V"'),
        ({"sensors": "[vertical]\nwhite = -1"}, "vertical]: sensor: white: -1.0 is out of range; give 0 or"),
        (
            {"sensors": "[vertical]\nrun_out = 3"},
            "run_out: 3 is no list of order, amplitude and phase; write [[",
        ),
        ({"sensors": "", "levels": (0.1,)}, "sensors: have noise of their own; remove --noise, or --sensors"),
        ({"sensors": "vertical = 3"}, "vertical]: 3 is not a table; write [vertical] and its keys"),
    ],
)
def test_what_cannot_be_is_refused(store, tmp_path, arguments, says):
    if "sensors" in arguments:
        (tmp_path / "s.toml").write_text(arguments["sensors"])
        arguments = arguments | {"sensors": tmp_path / "s.toml"}
    with pytest.raises(InputError) as refused:
        write_dataset(store, tmp_path / "d", **(SMALL | arguments))
    assert says in str(refused.value)
    assert not (tmp_path / "d").exists()


def test_another_data_set_is_not_overwritten(store, tmp_path):
    write_dataset(store, tmp_path / "d", **SMALL)
    before = digests(tmp_path / "d")
    with pytest.raises(InputError, match=r"/d: exists already; choose another --output, or remove it"):
        write_dataset(store, tmp_path / "d", seed=2, **SMALL)
    assert digests(tmp_path / "d") == before
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="/file: exists already"):
        write_dataset(store, tmp_path / "file", **SMALL)
    with pytest.raises(InputError, match=r"no directory .*/none; make it first"):
        write_dataset(store, tmp_path / "none" / "d", **SMALL)
