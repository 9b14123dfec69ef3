"""The documentation site, built by `make docs`."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "site")]

import github_markdown  # noqa: E402
import reference_tables  # noqa: E402

from rubhpc import __version__  # noqa: E402

project = "rubhpc"
author = "the rubhpc authors"
release = version = __version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",  # formulas without a network
    "sphinx_copybutton",
]
exclude_patterns = ["site"]
default_role = "code"

html_theme = "pydata_sphinx_theme"
html_title = f"rubhpc {release}"
html_static_path = ["site/static"]
html_css_files = ["rubhpc.css"]
html_show_sourcelink = False
html_theme_options = {
    "show_toc_level": 2,
    "navbar_align": "left",
    "navbar_persistent": [],
    "navbar_end": ["search-button", "theme-switcher"],
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": ["sphinx-version"],
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": True,
}
html_sidebars = {"index": [], "gallery": [], "changelog": [], "glossary": [], "claims": []}

myst_enable_extensions = ["dollarmath", "deflist", "attrs_inline"]
myst_dmath_double_inline = True
myst_heading_anchors = 4
myst_links_external_new_tab = False
nb_execution_mode = "off"  # a test runs the notebook; its outputs are stored with it

napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_rtype = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
# Words of types, such as "name", are attributes of several classes: none of them is meant.
suppress_warnings = ["ref.python"]
copybutton_exclude = ".linenos, .gp, .go"


def setup(app: object) -> None:
    """Rewrite every page from what a code host renders, and put the generated tables in."""

    def rewrite(_: object, page: str, source: list[str]) -> None:
        if not page.startswith("notebook/"):
            source[0] = github_markdown.for_sphinx(reference_tables.expand(source[0]), ROOT)

    app.connect("source-read", rewrite)  # type: ignore[attr-defined]
