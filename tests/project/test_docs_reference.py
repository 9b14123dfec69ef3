"""The reference pages cover every key, with meaning and example, command, stored variable and public name."""

from __future__ import annotations

import dataclasses
import sys
import tomllib
from pathlib import Path

import click
import pytest

import rubhpc
from rubhpc.cli import commands
from rubhpc.input.fields import check_value, key_of, parse_field
from rubhpc.schema import VARIABLES

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS / "site"))

import github_markdown  # noqa: E402
import reference_tables as tables  # noqa: E402

TABLES = tables.STUDY_TABLES | tables.rig_tables()
ALL_TABLES = [*TABLES.items(), *tables.MEASURED_TABLES.items()]
KEYS = [(table, field) for table, owner in ALL_TABLES for field in dataclasses.fields(owner)]
DECLARED = [(table, field) for table, field in KEYS if "kind" in field.metadata]


@pytest.mark.parametrize(("table", "key"), DECLARED, ids=[f"{table} {key.name}" for table, key in DECLARED])
def test_every_key_has_a_meaning_and_an_example_that_it_takes(
    table: str, key: dataclasses.Field[object]
) -> None:
    meaning, example = key.metadata["doc"], key.metadata["example"]
    assert meaning.endswith(".")
    assert "\n" not in meaning
    value = tomllib.loads(f"key = {example}")["key"]
    if key.metadata["kind"] != "pairs":  # read as the table that they are
        assert check_value(key, parse_field(key, value, table)) == ""


def test_tables_of_keys_are_complete() -> None:
    text = tables.key_tables(TABLES) + tables.axis_table() + tables.key_tables(tables.MEASURED_TABLES)
    for _, key in DECLARED:
        assert f"| `{key_of(key)}` |" in text
    for axis in ("speed_ratio", "speed", "clearance_ratio", "clearance", "friction"):
        assert f"| `{axis}` |" in text


def test_commands_show_all_their_options() -> None:
    text = tables.command_sections()
    context = click.Context(commands)
    for name in commands.list_commands(context):
        command = commands.get_command(context, name)
        assert command is not None
        section = text.split(f"## `rubhpc {name}`\n")[1].split("\n## ")[0]
        for option in (p for p in command.params if isinstance(p, click.Option)):
            assert option.opts[0] in section


def test_variables_are_those_of_the_schema() -> None:
    text = tables.variable_sections()
    assert all(f"| `{name}` |" in text for name in VARIABLES)


@pytest.mark.parametrize("page", sorted((DOCS / "reference").glob("*.md")), ids=lambda page: page.stem)
def test_pages_in_the_repository_are_as_generated(page: Path) -> None:
    text = page.read_text()
    assert tables.refreshed(text) == text, "run python docs/site/reference_tables.py"


def test_public_names_are_documented() -> None:
    text = tables.python_names()
    assert all(f":: rubhpc.{name}\n" in text for name in rubhpc.__all__)
    assert all(getattr(rubhpc, name).__doc__ for name in rubhpc.__all__)
    assert "autofunction:: postproc.signals.contacts." in tables.postproc_names()


def test_formulas_and_links_are_rewritten(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("[a](docs/b.md#c) [d](jobs/e.toml)")
    text = "```{include} ../README.md\n```\n[f](../../README.md#g) $`x_1`$\n\n```math\ny\n\\tag{1}\n```\n"
    assert github_markdown.for_sphinx(text, tmp_path) == (
        "[a](b.md#c) [d](../jobs/e.toml)\n[f](../index.md#g) $x_1$\n\n"
        "```{math}\n:no-wrap:\n\n\\[\ny\n\\tag{1}\n\\]\n```\n"
    )
