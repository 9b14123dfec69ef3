"""Puts this directory on the path: tests of every kind share `running` and `reference`.

Linear algebra has one thread, as under the commands: two would wait for each other on small matrices.
Examples of hypothesis have no deadline, since the first may compile a kernel, and are the same in every run.
Tests in a browser are collected where there is one.
"""

import os

from browsers import find_browser
from hypothesis import settings

for library in ("OMP", "OPENBLAS", "MKL", "BLIS"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")

collect_ignore = [] if find_browser() else ["browser"]


def pytest_report_header() -> str:
    """Tell which browser there is."""
    return f"browser: {find_browser() or 'no Chromium with playwright, tests/browser is left out'}"
