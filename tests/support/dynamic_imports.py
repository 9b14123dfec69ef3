"""Imports that grimp does not see: by `import_module`, through tables of names, and from a lazy package.

Each is a pair of modules, importer and imported, such as `("rubhpc.cli", "rubhpc.commands.run")`.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator
    from pathlib import Path

IMPORTERS = ("import_module", "__import__", "spec_from_file_location", "iter_modules", "walk_packages")
# "package.module" or "package.module:name"; of f"package.{name}" what comes before the name.
_NAME = re.compile(r"(?P<module>\w+(?:\.\w+)+)(?::\w+)?|(?P<package>\w+(?:\.\w+)*\.)")


def modules_of(root: Path, packages: tuple[str, ...]) -> dict[str, Path]:
    """Return the files of all modules below some packages, by their full names."""
    found = {}
    for package in packages:
        for path in (root / package).rglob("*.py"):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def nodes_of(path: Path) -> list[ast.AST]:
    """Return all nodes of a module's syntax tree."""
    return list(ast.walk(ast.parse(path.read_text())))


def dynamic_imports(root: Path, packages: tuple[str, ...]) -> set[tuple[str, str]]:
    """Return the pairs of importer and imported module that strings, and names of lazy packages, make."""
    modules = modules_of(root, packages)
    nodes = {name: nodes_of(path) for name, path in modules.items()}
    homes = {name: _homes(nodes[name], modules) for name, path in modules.items() if path.stem == "__init__"}
    pairs = set()
    for name in modules:
        imported = {module for text in _strings(nodes[name]) for module in _named_by(text, modules)}
        imported |= {argument for argument in _arguments(nodes[name]) if argument in modules}
        imported |= {homes[door][used] for door, used in _used(nodes[name]) if used in homes.get(door, {})}
        pairs |= {(name, module) for module in imported - {name}}
    return pairs


def unreadable_imports(root: Path, packages: tuple[str, ...]) -> set[str]:
    """Return the modules that import by a name which is not a string at that place."""
    modules = modules_of(root, packages)
    return {name for name, path in modules.items() if None in _arguments(nodes_of(path))}


def _arguments(nodes: Iterable[ast.AST]) -> set[str | None]:
    """Names given to functions that import; None where a name is made up."""
    calls = [node for node in nodes if isinstance(node, ast.Call) and node.args]
    names = [
        call.args[0]
        for call in calls
        if getattr(call.func, "attr", getattr(call.func, "id", "")) in IMPORTERS
    ]
    return {next(iter(_strings(ast.walk(name))), None) for name in names}


def _strings(nodes: Iterable[ast.AST]) -> list[str]:
    """Strings among the nodes, docstrings aside; of an f-string what comes before its first value."""
    nodes = list(nodes)
    aside: set[ast.AST] = {node.value for node in nodes if isinstance(node, ast.Expr)}
    aside.update(part for node in nodes if isinstance(node, ast.JoinedStr) for part in node.values[1:])
    constants = [node for node in nodes if isinstance(node, ast.Constant) and node not in aside]
    return [node.value for node in constants if isinstance(node.value, str)]


def _named_by(text: str, modules: Collection[str]) -> Iterator[str]:
    """Modules that a string names: one, or all of a package where the string ends in a dot."""
    match = _NAME.fullmatch(text)
    if match and match["package"]:
        yield from (name for name in modules if name.startswith(match["package"]))
    elif match and match["module"] in modules:
        yield match["module"]


def _homes(nodes: Iterable[ast.AST], modules: Collection[str]) -> dict[str, str]:
    """Names that a package hands on, by a table such as {"open": "postproc.accessor:open"} or an import."""
    homes: dict[str, str] = {}
    for node in nodes:
        if isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values, strict=True):
                if isinstance(key, ast.Constant) and isinstance(value, ast.Constant):
                    homes.update((key.value, module) for module in _named_by(str(value.value), modules))
        elif isinstance(node, ast.ImportFrom) and node.module in modules:
            homes.update((alias.asname or alias.name, str(node.module)) for alias in node.names)
    return homes


def _used(nodes: Iterable[ast.AST]) -> Iterator[tuple[str, str]]:
    """Packages and the names taken from them: `from rubhpc import open`, `rubhpc.open`."""
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            yield node.value.id, node.attr
