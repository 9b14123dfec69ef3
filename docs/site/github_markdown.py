"""Markdown as code hosts render it, rewritten for Sphinx: formulas, and files of the repository's root."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

_INCLUDE = re.compile(r"^```\{include\} \.\./(\w+\.md)\n```$", re.MULTILINE)
_BLOCK = re.compile(r"^( *)```math\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"\$`([^`]+)`\$")
_LINK = re.compile(r"\]\((?!https?:|#|mailto:)([^)\s]+)\)")
_PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}


def for_sphinx(text: str, root: Path) -> str:
    r"""Return the Markdown of a page in docs/ as MyST reads it.

    Files included from the root have their links turned towards docs/; formulas become directives, whose
    content MathJax takes as it stands (Sphinx would wrap lines in an environment that knows no \tag).
    """
    text = _INCLUDE.sub(lambda found: _turned((root / found[1]).read_text()), text)
    text = _LINK.sub(_to_page, text)
    text = _BLOCK.sub(lambda b: f"{b[1]}```{{math}}\n{b[1]}:no-wrap:\n\n\\[\n{b[2]}\\]\n{b[1]}```", text)
    return _INLINE.sub(r"$\1$", text)


def _turned(text: str) -> str:
    """Return the text of a file in the root with its links as from docs/."""

    def turn(found: re.Match[str]) -> str:
        target = found[1]
        return f"]({target.removeprefix('docs/') if target.startswith('docs/') else '../' + target})"

    return _LINK.sub(turn, text)


def _to_page(found: re.Match[str]) -> str:
    """Return a link to a file of the root that is a page of the site, `../README.md`, as one to the page."""
    file, mark, anchor = found[1].partition("#")
    folder, _, name = file.rpartition("/")
    if folder.endswith("..") and name in _PAGES:
        depth = folder.count("..") - 1
        return f"]({'../' * depth}{_PAGES[name]}{mark}{anchor})"
    return found[0]
