"""Reading a rig from a file, a Python function or a dict, and setting single keys of it."""

from __future__ import annotations

import importlib.util
import os
import re
import sys
import traceback
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError, RubError
from rubhpc.input.messages import brief, nearest, place
from rubhpc.input.reading import build, read_toml, replace_keys
from rubhpc.models import ABSENT
from rubhpc.rig.rig import Rig

if TYPE_CHECKING:
    from os import PathLike

_FORM = re.compile(r"(?P<path>.+\.py):(?P<function>[A-Za-z_]\w*)")


def python_function(name: str) -> tuple[str, str] | None:
    """Return path and function of "my_rig.py:build"; None for another form."""
    found = _FORM.fullmatch(name)
    return (found["path"], found["function"]) if found else None


def call_rig_function(path: Path, function: str, where: str) -> Any:
    """Call a function of a Python file without arguments and return its result.

    Its folder is first on the module search path meanwhile, as for a script.
    """
    named = place(f"{where}: {path}" if where else str(path))
    if not path.is_file():
        raise InputError(f"{named}: no such file; check the path")
    spec = importlib.util.spec_from_file_location(f"rubhpc_rig_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"{named}: cannot be read as Python; check the file")
    module = importlib.util.module_from_spec(spec)
    folder = str(path.resolve().parent)
    sys.path.insert(0, folder)
    try:
        spec.loader.exec_module(module)
        build = getattr(module, function, None)
        if not callable(build):
            raise InputError(f"{named}: has no function {function}; name the function that returns the rig")
        return build()
    except RubError as error:
        raise InputError(str(error) if str(error).startswith(named) else f"{named}: {error}") from error
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # sys.exit() included, which would end the program as if it were done
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == module.__file__]
        line = getattr(error, "lineno", None) or (lines[-1] if lines else None)
        at = f"line {line}: " if line else ""
        texts = (type(error).__name__, " ".join(str(error).split())[:200])
        raise InputError(f"{named}: {at}{': '.join(filter(None, texts))}; fix the rig file") from error
    finally:
        sys.path.remove(folder)


PACKAGED = Path(__file__).parents[1] / "rigs"


def rig_from_dict(table: Mapping[str, Any], where: str = "rig") -> Rig:
    """Return the rig that `Rig.as_dict` described; `where` starts error messages."""
    return build(Rig, table, where).with_geometry(ABSENT["geometry"])


def packaged_name(name_or_path: str | PathLike[str]) -> str | None:
    """Return the name of a packaged rig; None of a file or a function."""
    name = str(name_or_path)
    return name if name in packaged_rigs() else None


def read_rig(
    name_or_path: str | PathLike[str],
    relative_to: Path | None = None,
    where: str = "rig",
    *,
    trust_rig: bool = False,
) -> Rig:
    """Return a packaged rig by its name, the rig of a TOML file, or the one that a Python function returns.

    Parameters
    ----------
    name_or_path : str or Path
        "mokhtar2017", the path of a rig file, or "my_rig.py:build", a function called without arguments.
    relative_to : Path, optional
        Folder from which a relative path counts; the working directory by default.
    where : str
        Start of error messages: the file and key that name the rig.
    trust_rig : bool
        Whether Python code may be run.

    Raises
    ------
    InputError
        When there is no such rig, its file is invalid, or it is code that is not trusted.
    """
    name = str(name_or_path)
    if code := python_function(name):
        if not trust_rig:
            problem = f"{place(name)} is Python code, which runs only if you trust it"
            raise InputError(f"{where}: {problem}; add --trust-rig (in Python, pass the Rig itself)")
        rig = call_rig_function((relative_to or Path()) / code[0], code[1], where)
        if not isinstance(rig, Rig):
            raise InputError(f"{where}: {place(name)} returned a {type(rig).__name__}; return a rubhpc.Rig")
        return rig
    if packaged_name(name):
        return _packaged(PACKAGED / f"{name}.toml")
    path = (relative_to or Path()) / name
    if not name.endswith(".toml") and "/" not in name and not os.path.exists(path):
        fix = nearest(name, packaged_rigs())
        raise InputError(f"{where}: neither a packaged rig nor a file {place(str(path))}; {fix}")
    table = read_toml(path, where)
    if "grid" in table or "rig" in table:
        rig = brief(table.get("rig", "mokhtar2017"))
        raise InputError(f"{place(str(path))}: is a study, not a rig; give a rig, as this study does: {rig}")
    return build(Rig, table, str(path))


@cache
def packaged_rigs() -> tuple[str, ...]:
    """Return the names of the packaged rigs, found once."""
    return tuple(sorted(p.stem for p in PACKAGED.glob("*.toml")))


@cache
def _packaged(path: Path) -> Rig:
    """Read a packaged rig, once."""
    return build(Rig, read_toml(path), path.name)


def with_keys(rig: Rig, values: object) -> Rig:
    """Return the rig with the dotted keys of a mapping set, in SI units or as text with a unit.

    Only the result has to be valid. "stator.youngs_modulus" sets it in all stators, "stator.1.angle" in the
    first. Keys with the same meaning are replaced: `kyy` splits a bearing's common `stiffness`, and
    `stiffness` replaces `kyy` and `kzz`.

    Raises
    ------
    InputError
        When the values are no mapping, there is no such key, or the rig with them is invalid.
    """
    if not isinstance(values, Mapping):
        fix = 'give one such as {"stator.youngs_modulus": "30 GPa"}'
        raise InputError(f"overrides: {brief(values)} is not a dict; {fix}")
    return replace_keys(rig, values)
