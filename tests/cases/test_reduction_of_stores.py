"""Reductions of a store: against xarray on loaded data, in bounded memory, and on workers of a cluster."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import many_cases
import numpy as np
import pytest
import synthetic_store
import xarray as xr
from running import run

from postproc.cases.reduction import computed, envelope, histogram, mean_spectrum, open_in_pieces, quantiles
from postproc.store.open import open_store
from postproc.store.select import select
from rubhpc.cli import main
from rubhpc.errors import InputError, StoreError
from rubhpc.schema import DONE

ROOT = Path(__file__).parents[2]
SPECTRUM = "spectrum_torsion"
# What a Slurm user has on PATH, made of scripts: a job runs here and now, in the background, from a
# copy, since its script is removed once it is submitted.
SBATCH = """#!/bin/sh
cp "$1" "$0.job"
bash "$0.job" > "$0.log" 2>&1 &
echo $! >> "$0.pids"
echo "Submitted batch job $!"
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A store of 4 x 10 x 6 cases, of which those at every seventh clearance have diverged."""
    return many_cases.write(tmp_path_factory.mktemp("stores") / "few.zarr", (4, 10, 6), revolutions=2)


@pytest.fixture(scope="module")
def loaded(path):
    return open_store(path).load()


@pytest.mark.parametrize("over", [[], ["friction"], ["speed_ratio", "clearance_ratio"], ["clearance_ratio"]])
@pytest.mark.parametrize("n_byte", [1, 20_000, 1e9])
def test_spectra_are_reduced_as_in_memory(path, loaded, over, n_byte):
    store = open_in_pieces(path, n_byte)
    axes = over or list(many_cases.case_grid_of((4, 10, 6), 2, path).dims)
    mean = computed(mean_spectrum(store, "torsion", over), show_progress=False)
    worst = computed(envelope(store, "torsion", over), show_progress=False)
    expected = loaded[SPECTRUM].astype(float)
    done = (loaded["status"] == DONE).sum(axes)
    total = expected.fillna(0).sum(axes)
    np.testing.assert_allclose(mean[SPECTRUM], total.where(done > 0) / done.where(done > 0), rtol=1e-12)
    np.testing.assert_array_equal(worst[SPECTRUM], expected.fillna(-1).max(axes).where(done > 0))
    np.testing.assert_array_equal(mean["cases"], done)
    assert mean[SPECTRUM].attrs["units"] == "rad"
    assert mean[SPECTRUM].attrs["long_name"].startswith("mean over cases of the amplitude")
    assert ("frequency" in mean.coords) == ("speed_ratio" not in axes)


@pytest.mark.parametrize("n_byte", [1, 20_000, 1e9])
def test_pieces_are_whole_chunks_within_their_size(path, n_byte):
    stored = open_store(path)[SPECTRUM].data.chunksize
    data = open_in_pieces(path, n_byte)[SPECTRUM].data
    lengths = zip(data.chunksize, stored, data.shape, strict=True)
    assert all(piece % chunk == 0 or piece == n for piece, chunk, n in lengths)
    assert np.prod(data.chunksize) * 4 <= max(n_byte, np.prod(stored) * 4)


def test_selection_is_reduced_alone(path, loaded):
    choice = {"friction": 0.5, "clearance_ratio": slice(0.55, 0.7)}
    found = mean_spectrum(select(open_in_pieces(path), choice), "torsion").compute()
    mine = select(loaded, choice)[SPECTRUM].astype(float).mean(["speed_ratio", "clearance_ratio"])
    np.testing.assert_allclose(found[SPECTRUM], mine, rtol=1e-12)


def test_worst_case_is_found_along_an_axis_that_is_kept(path):
    over = ["speed_ratio", "clearance_ratio"]
    found = envelope(open_in_pieces(path), "torsion", over)[SPECTRUM].compute()
    assert float(found.idxmax("friction").sel(order=1.0)) == 0.5  # the line's height is 1 + friction


@pytest.mark.parametrize("over", [[], ["clearance_ratio"], ["speed_ratio", "friction"]])
def test_quantiles_and_histogram_are_those_of_the_cases_that_are_done(path, loaded, over):
    axes = over or list(loaded["status"].dims)
    peaks = loaded["peak_torsion"].where(loaded["status"] == DONE).stack(case=axes)
    others = [d for d in loaded["status"].dims if d not in axes]
    rows = peaks.transpose(*others, "case").values.reshape(-1, peaks.sizes["case"])
    found = quantiles(open_in_pieces(path), "peak_torsion", [0.1, 0.5, 1.0], over)
    counts = histogram(open_in_pieces(path), "peak_torsion", [0.0, 0.25, 0.5, 0.75, 1.0], over)
    levels = found["peak_torsion"].transpose(*others, "quantile").values.reshape(-1, 3)
    count = counts["count"].values.reshape(-1, 4)
    for row, level, bins, n in zip(rows, levels, count, found["cases"].values.ravel(), strict=True):
        row = row[np.isfinite(row)]
        assert row.size == n
        np.testing.assert_array_equal(bins, np.histogram(row, [0.0, 0.25, 0.5, 0.75, 1.0])[0])
        if n:
            np.testing.assert_allclose(level, np.quantile(row, [0.1, 0.5, 1.0]))
        else:
            assert np.isnan(level).all()


def test_histogram_leaves_out_what_lies_beyond_its_edges(path):
    found = histogram(open_in_pieces(path), "peak_torsion", [0.2, 0.4])
    assert int(found["count"].sum()) < int(found["cases"])
    whole = histogram(open_in_pieces(path), "peak_torsion", 7)
    assert int(whole["count"].sum()) == int(whole["cases"]) == 4 * 8 * 6


def test_waveforms_and_stators_are_reduced_too(tmp_path):
    whole = synthetic_store.make(keep=("waveform",), n_stator=2)
    synthetic_store.write(tmp_path / "study.zarr", whole)
    store = open_in_pieces(tmp_path / "study.zarr")
    found = envelope(store, "vertical").compute()
    for order, height in synthetic_store.AMPLITUDES.items():
        assert float(found["spectrum_vertical"].sel(order=order)) == pytest.approx(height, rel=1e-5)
    each = mean_spectrum(store, "contact_force", ["speed_ratio", "clearance"]).compute()
    both = mean_spectrum(store, "contact_force", ["speed_ratio", "clearance", "stator"]).compute()
    np.testing.assert_allclose(
        both["spectrum_contact_force"], each["spectrum_contact_force"].mean("stator"), rtol=1e-12
    )


def test_damaged_chunk_is_noticed(tmp_path):
    damaged = many_cases.write(tmp_path / "few.zarr", (2, 2, 2), revolutions=2)
    file = next(file for file in (damaged / SPECTRUM / "c").rglob("*") if file.is_file())
    content = bytearray(file.read_bytes())
    content[-20] ^= 1
    file.write_bytes(content)
    with pytest.raises(StoreError, match=r"(?i)checksum|crc"):
        mean_spectrum(open_in_pieces(damaged), "torsion").compute()
    file.unlink()
    os.mkfifo(file)
    with pytest.raises(StoreError, match="not a regular file"):
        mean_spectrum(open_in_pieces(damaged), "torsion").compute()


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda store: mean_spectrum(store, "twist"), "twist: no such signal"),
        (lambda store: mean_spectrum(store, "torsion", ["frction"]), "did you mean friction?"),
        (lambda store: mean_spectrum(store, "torsion", ["stator"]), "does not depend on stator"),
        (lambda store: mean_spectrum(store.drop_vars(SPECTRUM), "torsion"), "keeps neither"),
        (lambda store: quantiles(store, "status", [0.5]), "status: is not a measure; choose"),
        (
            lambda store: histogram(store.assign(status=store["status"] * 0), "peak_torsion"),
            "no selected case has a value",
        ),
    ],
)
def test_bad_input_is_one_line(path, call, said):
    with pytest.raises(InputError) as refusal:
        call(open_in_pieces(path))
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), **more}


@pytest.mark.long
def test_a_hundred_thousand_cases_take_little_memory(tmp_path):
    store = many_cases.write(tmp_path / "many.zarr")
    script = [sys.executable, many_cases.__file__, store]
    done = subprocess.run(script, env=environment(), capture_output=True, text=True, check=True, timeout=300)
    reported = json.loads(done.stdout.splitlines()[-1])
    assert reported["bytes"] > 3e9
    # Pieces of 64 MB at most, each four times: 1 GB; two cores took 0.4 GB.
    assert reported["memory"] < 1500
    assert reported["cases"] == reported["counted"] == 84_000
    assert reported["mean"] == pytest.approx(1.3)
    assert reported["worst"] == pytest.approx(1.5)
    assert reported["median"] == pytest.approx(0.5)


@pytest.fixture
def slurm(tmp_path):
    """Environment with commands of Slurm that run a job here; ends what is left of jobs."""
    commands = tmp_path / "bin"
    commands.mkdir()
    for name, text in (("sbatch", SBATCH), ("scancel", "#!/bin/sh\nkill $@ 2>/dev/null\nexit 0\n")):
        (commands / name).write_text(text)
        (commands / name).chmod(0o755)
    yield environment(PATH=f"{commands}:{os.environ['PATH']}", DASK_CONFIG=str(tmp_path))
    pids = commands / "sbatch.pids"
    for pid in pids.read_text().split() if pids.exists() else []:
        subprocess.run(["kill", pid], capture_output=True, check=False)


COMMAND = [sys.executable, "-m", "rubhpc", "reduce"]


@pytest.mark.parametrize(
    "on", ["threads", *(pytest.param(on, marks=pytest.mark.long) for on in ("slurm", "mpi"))]
)
def test_command_reduces_and_draws(on, path, loaded, slurm, tmp_path):
    command = [*COMMAND, path, "--what", "envelope", "--on", on]
    if on == "mpi":
        command = [Path(sys.executable).with_name("mpirun"), "-n", "3", *command]
    options = ["--workers", "1", "--memory", "1 GB", "--queue", "short", "--select", "friction=0.1"]
    done = subprocess.run(
        [*command, *options],
        cwd=tmp_path,
        env=slurm,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    said = done.stdout.splitlines()
    assert said[-2:] == ["few_envelope.nc", "few_envelope.png"]
    assert on != "threads" or len(said) == 2
    with xr.open_dataset(tmp_path / "few_envelope.nc") as found:
        expected = loaded[SPECTRUM].isel(friction=0).max(["speed_ratio", "clearance_ratio"])
        np.testing.assert_array_equal(found[SPECTRUM], expected)
    if on == "slurm":
        assert "#SBATCH -p short" in (tmp_path / "bin" / "sbatch.job").read_text()


@pytest.mark.parametrize("on_ranks", [False, pytest.param(True, marks=pytest.mark.long)])
def test_command_refuses_bad_input_in_a_line(on_ranks, path):
    arguments = ["reduce", path, "--over", "sped_ratio"]
    done = run(*arguments, "--on", "mpi", ranks=3) if on_ranks else run(*arguments)
    assert done.returncode == 2
    reported = [line for line in done.stderr.splitlines() if line.startswith("rubhpc:")]
    assert reported == [f"rubhpc: {path}: no axis sped_ratio; did you mean speed_ratio?"]


def test_command_takes_measures(path, tmp_path, capsys):
    data = tmp_path / "levels.nc"
    arguments = ["reduce", str(path), "--what", "quantiles", "--level", "0.5", "--over", "friction"]
    with pytest.raises(SystemExit) as end:
        main([*arguments, "--measure", "peak_torsion", "--data", str(data)])
    assert not end.value.code
    with xr.open_dataset(data) as found:
        expected = quantiles(open_in_pieces(path), "peak_torsion", [0.5], ["friction"])
        xr.testing.assert_equal(found["peak_torsion"], expected["peak_torsion"])
    with pytest.raises(SystemExit) as end:
        main([*arguments, "--signal", "torsion"])
    assert end.value.code == 2
    assert "--what quantiles: takes no --signal; give --measure" in capsys.readouterr().err


def test_job_asks_for_its_store():
    job = ROOT / "jobs" / "cluster" / "reduce.sh"
    subprocess.run(["bash", "-n", job], check=True)
    done = subprocess.run(["bash", job], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
