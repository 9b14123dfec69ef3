"""Imports point down: the contracts of import-linter in pyproject.toml, and that they leave no module out."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]


def lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [
        sys.executable,
        "-c",
        "from importlinter.cli import lint_imports_command as c; c()",
        "--no-cache",
    ]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_imports_keep_the_contracts() -> None:
    done = lint_imports(ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def placed_in(layers: list[str]) -> set[str]:
    return {name.strip(" ()") for layer in layers for name in layer.replace("|", ":").split(":")}


def test_every_module_has_its_layer() -> None:
    whole, within = (contract for contract in CONTRACTS if contract["type"] == "layers")
    placed = placed_in(whole["layers"])
    modules = {path.stem for path in (ROOT / "rubhpc").glob("*.py")} - {"__init__", "__main__"}
    packages = {path.parent.name for path in (ROOT / "rubhpc").glob("*/__init__.py")}
    assert {f"rubhpc.{name}" for name in modules | packages} == placed - {"postproc"}

    folders = [ROOT / name.replace(".", "/") for name in within["containers"]]
    modules = {path.stem for folder in folders for path in folder.glob("*.py")} - {"__init__"}
    assert modules == placed_in(within["layers"])


def test_kernels_and_postproc_have_a_contract_of_their_own() -> None:
    forbidden = {
        c["source_modules"][0]: set(c["forbidden_modules"]) for c in CONTRACTS if c["type"] == "forbidden"
    }
    assert {"mpi4py", "zarr", "rubhpc.rig.rig"} <= forbidden["rubhpc.kernels"]
    assert {"mpi4py", "rubhpc.kernels"} <= forbidden["postproc"]


def test_an_import_that_points_up_is_found(tmp_path: Path) -> None:
    for name, text in (("low", "import high\n"), ("high", "")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(text)
    contract = 'name = "x"\ntype = "layers"\nlayers = ["high", "low"]\n'
    packages = 'root_packages = ["high", "low"]'
    text = f"[tool.importlinter]\n{packages}\n[[tool.importlinter.contracts]]\n{contract}"
    (tmp_path / "pyproject.toml").write_text(text)
    done = lint_imports(tmp_path)
    assert done.returncode == 1
    assert "low is not allowed to import high" in done.stdout
