"""One case again, held against the store bit for bit, and the store left alone."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from running import array_of, write_study

from rubhpc.errors import InputError, RubError, StoreError
from rubhpc.running import worker
from rubhpc.running.driver import run
from rubhpc.running.recompute import reproduce
from rubhpc.storage.store import Store
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import Study, read_study


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Study:
    folder = tmp_path_factory.mktemp("finished")
    study = read_study(write_study(folder))
    run(study, quiet=True)
    return study


def files(store: Path) -> dict[str, tuple[int, bytes]]:
    return {str(p): (p.stat().st_mtime_ns, p.read_bytes()) for p in store.rglob("*") if p.is_file()}


def test_a_case_comes_out_again_to_the_last_bit_and_the_store_is_not_touched(finished):
    before = files(finished.output)
    for flat in (0, 5, 11):
        name = Store(finished.output).manifest.case_id(flat)
        reported = reproduce(finished, name[:10].upper())
        assert reported.id == name
        assert reported.case == Store(finished.output).manifest.name_case(flat)
        assert reported.status == "done"
        assert "holds the same, bit for bit" in reported.verdict
        assert f"case{' ' * 21}" in reported.text()
    assert files(finished.output) == before


@pytest.mark.parametrize("name", ["torsion", "section_vertical"])
def test_what_differs_is_named(finished, tmp_path, name):
    study = replace(finished, output=Path(shutil.copytree(finished.output, tmp_path / "copy.zarr")))
    store = Store(study.output)
    array = array_of(store.path, name)
    array[1, 0, 2, 0] = array[1, 0, 2, 0] + 1e-7
    with pytest.raises(StoreError, match=rf"differs from what is stored in {name}; rubhpc verify"):
        reproduce(study, store.manifest.case_id(8))
    store.chunk_files((1, 0, 2))[0].unlink()
    with pytest.raises(StoreError, match="its files are damaged"):
        reproduce(study, store.manifest.case_id(8))


def test_a_case_that_is_not_stored_is_computed_all_the_same(finished, tmp_path):
    grown = replace(
        finished, axes=(*finished.axes[:2], replace(finished.axes[2], values=(0.1, 0.2, 0.3, 0.5)))
    )
    name = CaseGrid(grown).case((0, 0, 1)).id
    assert "does not contain it yet" in reproduce(grown, name).verdict
    elsewhere = replace(finished, output=tmp_path / "none.zarr")
    assert "does not exist yet" in reproduce(elsewhere, CaseGrid(finished).case((0, 0, 0)).id).verdict
    assert list(tmp_path.iterdir()) == []
    assert "bit for bit" in reproduce(grown, CaseGrid(finished).case((1, 1, 2)).id).verdict  # it has moved


@pytest.mark.parametrize(("name", "message"), [("12345", "too short"), ("zzzzzz", "no case has such an id")])
def test_an_id_that_names_no_case_is_refused(finished, name, message):
    with pytest.raises(InputError, match=message):
        reproduce(finished, name)


def test_a_case_that_fails_shows_why(finished, monkeypatch):
    def burst(*_: object, **__: object) -> None:
        raise ZeroDivisionError("by\nzero")

    monkeypatch.setattr(worker, "run_case", burst)
    with pytest.raises(RubError, match=r"friction=0.1: ZeroDivisionError: by zero"):
        reproduce(finished, Store(finished.output).manifest.case_id(0))
