"""Reference tables from the declarations themselves: keys of files, commands, variables, Python names.

A page asks for one by a comment, `<!-- generated: study -->`. Tables of keys and variables are in the pages
themselves, up to `<!-- end -->`, for readers of the repository; `python docs/site/reference_tables.py` writes
them there, and a test holds them to the code.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re
import typing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import postproc
import rubhpc
from postproc.measured.keys import MeasuredKeys, SignalKeys, SlowRoll, SpeedKeys, TimeKeys
from rubhpc.cli import commands
from rubhpc.input.fields import key_of
from rubhpc.rig.probes import Probe
from rubhpc.rig.rig import Rig
from rubhpc.schema import VARIABLES
from rubhpc.study.axes import CLEARANCE_AXES, SPEED_AXES, OwnAxes
from rubhpc.study.branch_keys import BranchKeys
from rubhpc.study.contact_keys import Contact
from rubhpc.study.drive_keys import DriveKeys
from rubhpc.study.initial import Initial
from rubhpc.study.refine import Refine
from rubhpc.study.run_up_keys import RunUpKeys
from rubhpc.study.tables import Integrator, Recording, Run, Sample

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_ASKED = re.compile(r"^<!-- generated: (\w+) -->$(?:\n\n.*?\n<!-- end -->$)?", re.MULTILINE | re.DOTALL)
_READABLE = (
    "axes",
    "study",
    "rig",
    "measured",
    "variables",
)  # commands have --help, the others are Sphinx's directives
# Table of a file -> the dataclass that declares its keys, in the order of the pages.
STUDY_TABLES = {
    "[contact]": Contact,
    "[initial]": Initial,
    "[integrator]": Integrator,
    "[record]": Recording,
    "[[record.probe]]": Probe,
    "[sample]": Sample,
    "[refine]": Refine,
    "[branch]": BranchKeys,
    "[run_up]": RunUpKeys,
    "[drive]": DriveKeys,
    "[run]": Run,
}
MEASURED_TABLES = {
    "Top of the file": MeasuredKeys,
    "[time]": TimeKeys,
    "[speed]": SpeedKeys,
    "[signal.NAME]": SignalKeys,
    "[slow_roll]": SlowRoll,
}
ROOMS = (
    "store",
    "signals",
    "measured",
    "cases",
    "figures",
)  # of postproc, whose functions the reference shows


def rig_tables() -> dict[str, type]:
    """Return the tables of a rig file with their dataclasses, found from the fields of the rig."""
    found: dict[type, list[str]] = {Rig: ["Top of the file"]}
    _walk(Rig, "", found)
    names = [head for heads in found.values() for head in heads]
    return {
        ", ".join(f"{head} ({kind.__name__})" if names.count(head) > 1 else head for head in heads): kind
        for kind, heads in found.items()
    }


def _walk(owner: type, above: str, found: dict[type, list[str]]) -> None:
    """Add the dataclasses in the fields of one, and the tables of the file that hold them."""
    hints = typing.get_type_hints(owner)
    for field in dataclasses.fields(owner):
        if "kind" in field.metadata:
            continue
        for kind in _dataclasses_in(hints[field.name]):
            path = f"{above}{field.name}"
            head = f"[[{path}]]" if typing.get_origin(hints[field.name]) is tuple else f"[{path}]"
            if kind not in found:
                found[kind] = [head]
                _walk(kind, f"{path}.", found)
            if head not in found[kind]:
                found[kind].append(head)


def _dataclasses_in(hint: Any) -> list[type]:
    if dataclasses.is_dataclass(hint):
        return [hint] if isinstance(hint, type) else []
    return [kind for part in typing.get_args(hint) for kind in _dataclasses_in(part)]


def expand(text: str) -> str:
    """Return a page with the tables that it asks for, for the site."""
    return _ASKED.sub(lambda found: _TABLES[found[1]](), text)


def refreshed(text: str) -> str:
    """Return a page of the repository with its tables as the code declares them."""
    return _ASKED.sub(
        lambda found: (
            f"<!-- generated: {found[1]} -->\n\n{_TABLES[found[1]]().rstrip()}\n\n<!-- end -->"
            if found[1] in _READABLE
            else found[0]
        ),
        text,
    )


def key_tables(tables: dict[str, type]) -> str:
    """Return a section for each table of a file, with a row for each key."""
    sections = []
    for title, owner in tables.items():
        about = (inspect.getdoc(owner) or "").split("\n\n")[0].replace("\n", " ")
        refused = getattr(owner, "REFUSED", ())
        fields = [field for field in dataclasses.fields(owner) if field.name not in refused]
        rows = [_key_row(field) for field in fields if "kind" in field.metadata]
        head = f"## {title}" if "[" not in title else "## " + re.sub(r"(\[+[\w.]+\]+)", r"`\1`", title)
        sections.append(f"{head}\n\n{about}\n\n{_table(_KEY_HEAD, rows)}")
    return "\n\n".join(sections)


def axis_table() -> str:
    """Return the table of the axes that are no keys of the rig."""
    rows = [_key_row(field) for field in dataclasses.fields(OwnAxes)]
    either = {f"`{name}`" for name in (*SPEED_AXES, *CLEARANCE_AXES)}
    return _table(_KEY_HEAD, [(*r[:3], "**one of the two**", *r[4:]) if r[0] in either else r for r in rows])


_KEY_HEAD = ("key", "type", "unit", "default", "meaning", "example")


def _key_row(field: dataclasses.Field[Any]) -> tuple[str, ...]:
    meta = field.metadata
    example = meta.get("example")
    return (
        f"`{key_of(field)}`",
        _kind(meta),
        " ".join(f"`{unit}`" for unit in (meta.get("units") or (meta.get("unit"),)) if unit),
        _default(field),
        meta.get("doc", ""),
        f"`{example}`" if example else "",
    )


def _kind(meta: Any) -> str:
    """Return the type of a key and its bounds, in words."""
    names = {
        "quantity": "number",
        "count": "whole number",
        "flag": "`true` or `false`",
        "text": "text",
        "words": "list of words",
        "pairs": "table of numbers",
        "matrix": "matrix",
        "degrees": "list of node and name",
        "series": "list of numbers",
        "selection": "table of axes and values",
        "criteria": "list of flags and `{ measure = share }`",
    }
    kind = meta["kind"]
    if kind in ("choice", "choices"):
        listed = ", ".join(f'`"{word}"`' for word in meta["of"])
        return f"list of {listed}" if kind == "choices" else listed.replace(", ", " or ")
    bounds = [
        f"{word} {meta[key]:g}"
        for key, word in (
            ("above", "above"),
            ("at_least", "at least"),
            ("below", "below"),
            ("at_most", "at most"),
        )
        if meta.get(key) is not None
    ]
    unlike = "".join(f', or `"{word}"`' for word in meta.get("or_words", ()))
    return ", ".join([names.get(kind, kind), *bounds]) + unlike


def _default(field: dataclasses.Field[Any]) -> str:
    if field.default is dataclasses.MISSING:
        return "**required**"
    value = field.default
    if value is None or value == ():
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`'
    if isinstance(value, tuple):
        words = (word if isinstance(word, str | float) else word[0] for word in value)
        return "`[" + ", ".join(f"{w:g}" if isinstance(w, float) else f'"{w}"' for w in words) + "]`"
    return f"`{value:g}`"


def command_sections() -> str:
    """Return a section for each command: what it does, its arguments and its options."""
    context = click.Context(commands)
    sections = []
    for name in commands.list_commands(context):
        command = commands.get_command(context, name)
        assert command is not None
        own = click.Context(command, info_name=name, parent=click.Context(commands, info_name="rubhpc"))
        usage = " ".join([own.command_path, *command.collect_usage_pieces(own)])
        options = [p for p in command.params if isinstance(p, click.Option) and not p.hidden]
        rows = [
            (
                "`" + ", ".join([*p.opts, *p.secondary_opts]) + "`",
                "" if p.is_flag else f"`{p.make_metavar(own)}`",
                _option_default(p),
                _as_code(p.help or "")
                + (" May be repeated." if p.multiple and "repeat" not in (p.help or "") else ""),
            )
            for p in options
        ]
        sections.append(
            f"## `rubhpc {name}`\n\n```text\n{usage}\n```\n\n{_as_code(_prose(command.help or ''))}\n\n"
            + (_table(("option", "value", "default", "meaning"), rows) if rows else "")
        )
    return "\n\n".join(sections)


def _as_code(text: str) -> str:
    """Return help with its options, `--part`, as code."""
    return re.sub(r"(?<![`\w-])--[a-z][\w-]*", r"`\g<0>`", text)


def _option_default(option: click.Option) -> str:
    value = option.to_info_dict()["default"]
    if (
        option.is_flag
        or value is None
        or value in ((), "")
        or option.default.__class__.__name__ == "Sentinel"
    ):
        return ""
    return f"`{', '.join(map(str, value)) if isinstance(value, tuple | list) else value}`"


def _prose(text: str) -> str:
    return inspect.cleandoc(text).replace("\b\n", "")


_VARIABLE_SECTIONS = {
    "Signals": "waveform",
    "Spectra": "spectrum",
    "Poincaré sections": "section",
    "Settings": "setting",
    "Flags": "flag",
    "Measures": "measure",
    "Final state": "state",
}


def variable_sections() -> str:
    """Return a section for each role that a stored variable has, with its variables."""
    sections = []
    for title, role in _VARIABLE_SECTIONS.items():
        rows = []
        for variable in (v for v in VARIABLES.values() if v.role == role):
            dims = ("the axes that set it",) if role == "setting" else ("axes", *variable.dims)
            flags = ", ".join(f"{i} {flag}" for i, flag in enumerate(variable.flags))
            meaning = variable.long_name + (f"; {flags}" if flags else "")
            rows.append((f"`{variable.name}`", ", ".join(dims), variable.dtype, variable.unit, meaning))
        sections.append(
            f"## {title}\n\n{_table(('variable', 'dimensions', 'type', 'unit', 'meaning'), rows)}"
        )
    return "\n\n".join(sections)


def python_names() -> str:
    """Return autodoc directives for the public names of `rubhpc`: functions, classes, errors."""
    found = {name: getattr(rubhpc, name) for name in rubhpc.__all__}
    errors = [
        name for name, value in found.items() if inspect.isclass(value) and issubclass(value, Exception)
    ]
    classes = [name for name, value in found.items() if inspect.isclass(value) and name not in errors]
    functions = [name for name in found if name not in errors and name not in classes]
    first = [name for name in ("simulate", "run", "open") if name in functions]
    functions = first + [name for name in functions if name not in first]
    return "\n\n".join(
        f"## {title}\n\n" + _autodoc("rubhpc", names)
        for title, names in (("Functions", functions), ("Classes", classes), ("Errors", errors))
    )


def postproc_names() -> str:
    """Return autodoc directives for the public functions of `postproc`, room by room and module by module."""
    sections = []
    for room in ROOMS:
        package = importlib.import_module(f"postproc.{room}")
        sections.append(f"## `postproc.{room}`\n\n{inspect.getdoc(package)}")
        for name, module in _modules(package):
            names = [
                key
                for key, value in vars(module).items()
                if not key.startswith("_")
                and (inspect.isfunction(value) or inspect.isclass(value))
                and value.__module__ == name
                and not (inspect.isclass(value) and issubclass(value, Exception))
            ]
            if names:
                about = (inspect.getdoc(module) or "").split("\n\n")[0].replace("\n", " ")
                sections.append(f"### `{name}`\n\n{about}\n\n{_autodoc(name, names)}")
    return "\n\n".join(sections)


def _modules(package: Any) -> Iterator[tuple[str, Any]]:
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not found.name.rpartition(".")[2].startswith("_"):
            yield found.name, importlib.import_module(found.name)


def _autodoc(module: str, names: Iterable[str]) -> str:
    home = importlib.import_module(module)
    lines = []
    for name in names:
        is_class = inspect.isclass(getattr(home, name))
        lines.append(f".. auto{'class' if is_class else 'function'}:: {module}.{name}")
        if is_class and not issubclass(getattr(home, name), Exception):
            lines.append("   :members:")
        lines.append("")
    return "```{eval-rst}\n" + "\n".join(lines) + "```"


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a Markdown table."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


_TABLES = {
    "axes": axis_table,
    "study": lambda: key_tables(STUDY_TABLES),
    "rig": lambda: key_tables(rig_tables()),
    "measured": lambda: key_tables(MEASURED_TABLES),
    "commands": command_sections,
    "variables": variable_sections,
    "python": python_names,
    "postproc": postproc_names,
}
assert postproc  # its rooms are imported by name

if __name__ == "__main__":
    for page in (Path(__file__).parents[1] / "reference").glob("*.md"):
        page.write_text(refreshed(page.read_text()))
