"""Whatever the source imports is declared in pyproject.toml; what happens to be installed is no promise."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_every_import_is_a_declared_dependency() -> None:
    extras = [item for group in PROJECT["optional-dependencies"].values() for item in group]
    declared = {_normal(item) for item in (*PROJECT["dependencies"], *extras)}
    homes = packages_distributions()
    missing = {
        name
        for name in _imported()
        if not declared & {_normal(home) for home in homes.get(name, [name])}
        and _normal(name) not in declared
    }
    assert not missing


def _imported() -> set[str]:
    names: set[str] = set()
    for package in ("rubhpc", "postproc"):
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Import):
                    names |= {alias.name.partition(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                    names.add(node.module.partition(".")[0])
    return names - set(sys.stdlib_module_names) - {"rubhpc", "postproc"}


def _normal(requirement: str) -> str:
    """Name of a requirement, as package indexes compare names."""
    name = re.match(r"[A-Za-z0-9._-]+", requirement)
    return re.sub(r"[-_.]+", "-", name[0]).lower() if name else ""
