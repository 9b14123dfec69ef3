"""Rigs built by a Python function, "my_rig.py:build": user code, run only if trusted."""

from __future__ import annotations

import importlib.util
import re
import sys
import traceback
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError, RubError
from rubhpc.input.messages import place

if TYPE_CHECKING:
    from pathlib import Path

_FORM = re.compile(r"(?P<path>.+\.py):(?P<function>[A-Za-z_]\w*)")


def python_function(name: str) -> tuple[str, str] | None:
    """Return path and function of "my_rig.py:build"; None for another form."""
    found = _FORM.fullmatch(name)
    return (found["path"], found["function"]) if found else None


def call_rig_function(path: Path, function: str, where: str) -> Any:
    """Call a function of a Python file without arguments and return its result.

    Its folder is first on the module search path meanwhile, as for a script.

    Raises
    ------
    InputError
        When there is no such file or function, or it raises; the message names the line.
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
