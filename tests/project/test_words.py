"""Source, messages and documents use the standard terms, not words of the project's own."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from running import ROOT

FOLDERS = ("rubhpc", "postproc", "docs", "jobs", "tests")
ENDINGS = {".py", ".md", ".toml", ".js", ".html", ".css", ".sh"}
FILES = [
    path
    for folder in FOLDERS
    for path in sorted((ROOT / folder).rglob("*"))
    if path.suffix in ENDINGS
    and "site" not in path.relative_to(ROOT).parts
    and path.name != Path(__file__).name
] + [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "pyproject.toml", "Makefile")]

INSTEAD_OF = {
    r"mend(s|ed|ing)?": "fix",
    r"stands? twice": "is duplicated",
    r"stands? beside": "conflicts with",
    r"foreign bod(y|ies)": "user-supplied matrices",
    r"static answers?": "residual attachment modes",
    r"blind steps?": "event-search step",
    r"proved times?": "event-free interval",
    r"tells?|told": "report, give, show, state",
    r"unless told": "by default",
    r"in hand": "in progress",
    r"tall(y|ies)": "accumulator",
    r"yields to": "is replaced by",
    r"no fault can lose": "fault tolerance",
    r"in vain": "without success",
    r"dear(er|est)": "longer, longest (of cases), expensive",
    r"foretells?": "predict",
    r"lest": "so that ... not",
    r"rub that stays": "sustained rub",
}
# Where a word is meant in its usual sense: file and line, as far as both are needed.
ALLOWED = {
    ("rubhpc/storage/layout.py", "status tells why"),  # an attribute of every store there is
}


@pytest.mark.parametrize("word", INSTEAD_OF)
def test_a_word_of_our_own_does_not_come_back(word: str) -> None:
    pattern = re.compile(rf"(?<![a-z])({word})(?![a-z])", re.IGNORECASE)
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in FILES
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        if pattern.search(line) and not is_allowed(str(path.relative_to(ROOT)), line)
    ]
    assert not found, f"rather {INSTEAD_OF[word]!r}:\n" + "\n".join(found)


def is_allowed(path: str, line: str) -> bool:
    return any(path == file and part in line for file, part in ALLOWED)
