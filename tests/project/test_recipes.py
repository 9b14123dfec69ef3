"""The recipes of CONTRIBUTING, "To add a ...", name files and tests that exist, in few steps."""

from __future__ import annotations

import re

import pytest
from running import ROOT

CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()
RECIPES = dict(re.findall(r"^## (To add an? .*)\n((?:(?!## ).*\n?)*)", CONTRIBUTING, re.MULTILINE))
FILE = re.compile(r"`((?:rubhpc|postproc|tests|docs|jobs)/[^`<>*\s]*)`")


def test_there_are_recipes() -> None:
    assert {"To add a body", "To add a force at a node", "To add a measure"} <= RECIPES.keys()


@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_names_what_exists_in_few_steps(name: str) -> None:
    assert [file for file in FILE.findall(RECIPES[name]) if not (ROOT / file).exists()] == []
    steps = re.findall(r"^\d+\. .*(?:\n(?!\d+\. |\n).*)*", RECIPES[name], re.MULTILINE)
    changed = [step for step in steps if not step.split(". ", 1)[1].startswith("A test")]
    assert 2 <= len(changed) <= 4
    assert all(FILE.search(step) for step in steps)
