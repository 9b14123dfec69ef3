"""The lists of slow, long and serial tests name tests that there are, in modules of different names."""

from __future__ import annotations

import pytest
from running import ROOT

LISTS = ("SLOW", "LONG", "LONGEST", "SERIAL")


@pytest.mark.parametrize("name", LISTS)
def test_every_entry_names_a_test(name: str, pytestconfig: pytest.Config) -> None:
    plugin = pytestconfig.pluginmanager.get_plugin(str(ROOT / "tests" / "conftest.py"))
    places = getattr(plugin, name)
    assert list(places) == list(dict.fromkeys(places))
    for place in places:
        path, _, test = place.partition("::")
        file = ROOT / "tests" / path
        assert file.is_dir() if path.endswith("/") else file.is_file(), place
        function, bracket, _ = test.partition("[")
        assert not test or f"def {function}{'(' if bracket else ''}" in file.read_text(), place


def test_every_module_of_tests_has_a_name_of_its_own() -> None:
    """Modules of one name cannot be collected together: `pytest tests` would end in an error."""
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))
