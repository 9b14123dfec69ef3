"""A browser, and pages of small stores to open in it; what the console complains of fails the test."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
import synthetic_store
import xarray as xr
from browsers import find_browser

from postproc.report.budget import write_report
from postproc.report.page import Page as ReportPage
from postproc.report.page import least_size
from postproc.store.open import open_store
from rubhpc.schema import MISSING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Page


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        # Containers run as root and have little shared memory.
        options = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
        opened = playwright.chromium.launch(executable_path=find_browser(), args=options)
        yield opened
        opened.close()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Open a page by its address, in a window of some width, and wait until it has drawn itself."""
    complaints: list[str] = []
    contexts = []

    def open_page(address: str, width: int = 1280, **settings: Any) -> Page:
        context = browser.new_context(viewport={"width": width, "height": 900}, **settings)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "console",
            lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None,
        )
        page.on("requestfailed", lambda request: complaints.append(f"failed: {request.url}"))
        page.goto(address)
        page.wait_for_selector("body[data-ready]")
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert complaints == []


@pytest.fixture(scope="session")
def stores(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Stores of four axes and two stators, of a ring, of one axis or case, of measures alone, without any."""
    folder = tmp_path_factory.mktemp("stores")
    whole = synthetic_store.make(n_stator=2)
    ring = synthetic_store.make(n_stator=3)
    share = xr.DataArray([0.0, 1.0, 0.5], dims="stator")  # the first never touches
    ring["peak_contact_force"] = (ring["peak_contact_force"] * share).assign_attrs(units="N")
    rest = {"clearance": [1], "friction": [1], "stator_youngs_modulus": [0]}
    made = {
        "whole": whole,
        "ring": ring,
        "line": whole.isel(rest),
        "single": whole.isel(speed_ratio=[1], **rest),
        "scalars": synthetic_store.make(keep=()),
        "empty": synthetic_store.make(keep=()),
    }
    made["empty"]["status"][...] = MISSING
    made["scalars"]["period"][...] = 0
    made["scalars"]["settled"][{"friction": 1}] = 0
    for name, dataset in made.items():
        synthetic_store.write(folder / f"{name}.zarr", dataset)
    return {name: folder / f"{name}.zarr" for name in made}


@pytest.fixture(scope="session")
def pages(stores: dict[str, Path]) -> dict[str, str]:
    """Addresses of their reports; that of `cut` has been kept so small that cases were left out."""
    addresses = {}
    for name, store in stores.items():
        write_report(open_store(store), store.with_suffix(".html"), 20e6)
        addresses[name] = store.with_suffix(".html").as_uri()
    cut = stores["whole"].with_name("cut.html")
    write_report(
        open_store(stores["whole"]), cut, least_size(ReportPage(open_store(stores["whole"]))) + 30_000
    )
    return addresses | {"cut": cut.as_uri()}
