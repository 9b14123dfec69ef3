"""The page itself: its texts, the library that draws, and the data that it contains or fetches."""

from __future__ import annotations

import json
import math
import time
import zlib
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.report.cases import Cases
from postproc.report.facts import (
    axis_rows,
    counts,
    drawn_rows,
    failures,
    free_axes,
    run_rows,
    study_rows,
    validity_rows,
)
from postproc.report.grid import Measures, described_axes, validity_text
from postproc.report.packing import as_text
from postproc.report.pictures import branch_facts, design_facts, run_up_facts, whirl_facts
from postproc.report.rig_views import description, end_view, side_view
from postproc.store.attributes import table_of
from postproc.store.axes import source
from postproc.store.branch_points import check_points
from postproc.store.rig_of_case import natural_frequencies, rig_axes, rig_of, stator_places
from postproc.store.run_ups import is_run_up, measures_alone
from rubhpc.errors import RubError
from rubhpc.integrate.measuring.orbit_measures import LONGEST_PERIOD
from rubhpc.version import __version__

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from postproc.store.rig_of_case import Place

_ASSETS = files("postproc.report") / "assets"
_SCRIPTS = ("data.js", "chart.js", "map.js", "panels.js", "page.js")


class Page:
    """A page on the current state of a store; `measures` and `cases` are what it shows."""

    def __init__(self, store: xr.Dataset) -> None:
        check_points(store)
        self._whole = store
        self.is_run_up = is_run_up(store)
        if self.is_run_up:  # the maps show measures, pictures the revolutions
            store = measures_alone(store)
        self._store = store
        self.measures = Measures(store)
        self.cases = Cases(store)
        self._axes = described_axes(store)

    def html(
        self,
        values: Mapping[str, bytes] | None = None,
        records: Mapping[int, bytes] | None = None,
        notes: list[str] | None = None,
    ) -> str:
        """Return the page: with data in it, or, without `values`, one that fetches them from its server."""
        is_served = values is None
        names = list(self.measures.names) if values is None else list(values)
        data = {
            "facts": self._embedded_facts(names, is_served=is_served),
            "values": {name: as_text(packed) for name, packed in (values or {}).items()},
            "records": {str(flat): as_text(packed) for flat, packed in (records or {}).items()},
        }
        template = _environment().get_template("page.html")
        text: str = template.render(
            **self._facts(),
            notes=notes or [],
            is_served=is_served,
            style=_asset("report.css"),
            library=_library(),
            script="\n".join(_asset(name) for name in _SCRIPTS),
            data={name: _in_script(content) for name, content in data.items()},
        )
        return text

    def _facts(self) -> dict[str, Any]:
        store, axes = self._store, self._axes
        drawing = {"side": "", "end": "", "text": ""}
        try:
            rig = rig_of(store)
            drawing = {"side": side_view(rig), "end": end_view(rig), "text": description(rig)}
        except RubError as error:  # a copy of a store may lack its rig
            drawing["text"] = str(error)
        counted = counts(self.cases.status)
        return {
            "title": str(store.attrs.get("title") or Path(source(store)).stem),
            "store": source(store),
            "made": time.strftime("%Y-%m-%d %H:%M"),
            "version": __version__,
            "running": store.attrs.get("running", ""),
            "counts": counted,
            "n_case": sum(c["n"] for c in counted),
            "rig_name": table_of(store, "rig").get("name", ""),
            "drawing": drawing,
            "rig_axes": list(rig_axes(store).values()),
            "axis_rows": [*axis_rows(axes), *drawn_rows(store)],
            "study_rows": study_rows(store),
            "run_rows": run_rows(store, self.measures),
            "validity_rows": validity_rows(store, self.measures, axes, len(self.cases.done)),
            "failures": failures(store, axes),
            "n_done": len(self.cases.done),
            "design": design_facts(store),
            "whirl": whirl_facts(store),
            "branches": branch_facts(store),
            "run_ups": run_up_facts(self._whole),
        }

    def _embedded_facts(self, names: list[str], *, is_served: bool) -> dict[str, Any]:
        """Return what the scripts have to know."""
        store = self._store
        described = {variable["name"]: variable for variable in self.measures.described()}
        codes = [c["code"] for c in described["validity"]["categories"]]
        return {
            "isServed": is_served,
            "store": source(store),
            "axes": self._axes,
            "free": free_axes(store),
            "variables": [described[name] for name in names],
            "nStator": store.sizes.get("stator", 1),
            "signals": self.measures.described_signals(store),
            "kept": self.cases.kept,
            "isRunUp": self.is_run_up,
            "places": self._places(),
            "frequencies": self._frequencies(),
            "longestPeriod": LONGEST_PERIOD,
            "validity": {code: validity_text(code) for code in codes},
            "reasons": {str(i): text for i, text in store.attrs.get("reasons", {}).items()},
        }

    def _places(self) -> list[Place]:
        try:
            return stator_places(self._store)
        except RubError:
            return []

    def _frequencies(self) -> dict[str, float]:
        """Return the rotor's natural frequencies, Hz, where all cases share them."""
        if rig_axes(self._store):
            return {}
        try:
            return {name: float(f) for name, f in natural_frequencies(self._store).items()}
        except RubError:
            return {}


def least_size(page: Page) -> int:
    """Return the bytes of a page without any data."""
    return len(page.html(values={}).encode())


def text_size(data: bytes) -> int:
    """Return the bytes that data take on a page, their name included."""
    return 4 * math.ceil(len(data) / 3) + 16


def _in_script(content: object) -> str:
    """Return JSON that cannot end the script element around it."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


@cache
def _asset(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8")


@cache
def _library() -> str:
    """Return BokehJS, compressed: a third of its 1.4 MB."""
    folder = files("bokeh") / "server" / "static" / "js"
    scripts = [(folder / name).read_bytes() for name in ("bokeh.min.js", "bokeh-api.min.js")]
    return as_text(zlib.compress(b"\n;".join(scripts), 9))


@cache
def _environment() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("postproc.report", "assets")
    return Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
