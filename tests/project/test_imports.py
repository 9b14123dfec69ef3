"""Imports point down: the contracts of import-linter in pyproject.toml, held against dynamic imports too."""

from __future__ import annotations

import tomllib
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import grimp
import pytest
from dynamic_imports import dynamic_imports, modules_of, unreadable_imports
from importlinter.configuration import configure
from importlinter.contracts.acyclic_siblings import AcyclicSiblingsContract
from importlinter.contracts.forbidden import ForbiddenContract
from importlinter.contracts.layers import LayersContract

ROOT = Path(__file__).parents[2]
PACKAGES = ("rubhpc", "postproc")
configure()  # what import-linter's command does first
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
MODULES = modules_of(ROOT, PACKAGES)


def placed_in(contract: dict[str, Any]) -> set[str]:
    """Full names of the layers of a contract."""
    names = {name.strip(" ()") for layer in contract["layers"] for name in layer.replace("|", ":").split(":")}
    return {f"{box}.{name}" for box in contract.get("containers", []) for name in names} or names


LAYERS = [contract for contract in CONTRACTS if contract["type"] == "layers"]
(ROOMS,) = (placed_in(contract) for contract in LAYERS if contract["name"].endswith(": rooms"))


def room_of(module: str) -> str:
    """Layer of the rooms' contract in which a module is; the packages themselves are on top of all."""
    return next((room for room in ROOMS if f"{module}.".startswith(f"{room}.")), module)


@pytest.fixture(scope="module")
def dynamic() -> set[tuple[str, str]]:
    """Those that grimp does not see."""
    return dynamic_imports(ROOT, PACKAGES)


@pytest.fixture(scope="module")
def graph(dynamic: set[tuple[str, str]]) -> grimp.ImportGraph:
    """Every import there is, dynamic ones included."""
    graph = grimp.build_graph(*PACKAGES, include_external_packages=True, cache_dir=None)
    for importer, imported in dynamic:
        graph.add_import(importer=importer, imported=imported)
    return graph


@pytest.mark.parametrize("contract", CONTRACTS, ids=lambda contract: contract["name"])
def test_imports_keep_the_contract(graph: grimp.ImportGraph, contract: dict[str, Any]) -> None:
    kinds = {
        "layers": LayersContract,
        "forbidden": ForbiddenContract,
        "acyclic_siblings": AcyclicSiblingsContract,
    }
    options = {key: value for key, value in contract.items() if key not in ("name", "type")}
    session = {"root_packages": PACKAGES, "include_external_packages": True}
    check = kinds[contract["type"]](contract["name"], session, options).check(graph, verbose=False)
    assert check.kept, check.metadata


def test_rooms_form_no_circle(graph: grimp.ImportGraph) -> None:
    imports: dict[str, set[str]] = {}
    for module in MODULES:
        imported = {
            room_of(name) for name in graph.find_modules_directly_imported_by(module) if name in MODULES
        }
        imports.setdefault(room_of(module), set()).update(imported - {room_of(module)})
    TopologicalSorter(imports).prepare()


def test_dynamic_imports_can_be_read_from_the_source(dynamic: set[tuple[str, str]]) -> None:
    """A module that makes up the name of what it imports would escape the contracts."""
    tables_in_themselves = {"rubhpc", "rubhpc.cli"}
    file_of_a_user = {"rubhpc.rig.reading"}
    assert unreadable_imports(ROOT, PACKAGES) <= tables_in_themselves | file_of_a_user
    assert {("rubhpc", "postproc.accessor"), ("rubhpc.cli", "rubhpc.commands.run")} <= dynamic


def test_every_module_has_its_layer() -> None:
    """Each of the rooms, and each module of a room whose modules a contract puts in order."""
    assert {room for room in ROOMS if room not in MODULES} == set()
    placed = set.union(*(placed_in(contract) for contract in LAYERS))
    ordered = {name.rpartition(".")[0] for name in placed}
    assert {name for name in MODULES if name.rpartition(".")[0] in ordered} - placed == {"rubhpc.__main__"}
    acyclic = {name for contract in CONTRACTS for name in contract.get("ancestors", ())}
    packages = {name.rpartition(".")[0] for name in MODULES} - {"", *PACKAGES}
    assert packages - ordered - acyclic == set(), "each package has a contract of its own"


def test_kernels_and_postproc_have_a_contract_of_their_own() -> None:
    forbidden = {
        c["source_modules"][0]: set(c["forbidden_modules"]) for c in CONTRACTS if c["type"] == "forbidden"
    }
    assert {"mpi4py", "zarr", "rubhpc.rig", "rubhpc.fem"} <= forbidden["rubhpc.kernels"]
    assert {"mpi4py", "rubhpc.kernels", "rubhpc.running"} <= forbidden["postproc"]


@pytest.mark.parametrize(
    "text",
    [
        'importlib.import_module("high")',
        '__import__("high.room")',
        'import_module(f"high.{name}")',
        'TABLE = {"room": "high.room:door"}',
        'TABLE = ["high.room:door"]',
    ],
)
def test_a_dynamic_import_that_points_up_is_found(tmp_path: Path, text: str) -> None:
    for name, body in (("low", f"{text}\n"), ("high", "")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(body)
        (tmp_path / name / "room.py").write_text("")
    found = dynamic_imports(tmp_path, ("high", "low"))
    assert ("low", "high.room") in found or ("low", "high") in found


def test_a_name_that_a_package_hands_on_is_an_import_of_its_home(tmp_path: Path) -> None:
    files = {
        "high": 'HOMES = {"door": "high.room:door"}',
        "low": "from high import door",
        "deep": "import high\nhigh.door()",
    }
    for name, body in files.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"{body}\n")
        (tmp_path / name / "room.py").write_text("")
    found = dynamic_imports(tmp_path, tuple(files))
    assert found == {(name, "high.room") for name in files}


def test_a_circle_is_found() -> None:
    with pytest.raises(CycleError):
        TopologicalSorter({"a": {"b"}, "b": {"a"}}).prepare()
