"""Linear algebra on one thread, whatever the environment says: `rubhpc.run` in a script is as the command."""

from __future__ import annotations

import os
import subprocess
import sys

from running import environment, stored_bytes, write_sample
from threadpoolctl import threadpool_info, threadpool_limits

import rubhpc
from rubhpc.study.study import read_study
from rubhpc.threads import VARIABLES, one_thread

SCRIPT = """
import os, sys, time, numpy, scipy.linalg
threads = set(os.listdir("/proc/self/task")) - {str(os.getpid())}
def status(thread):
    with open(f"/proc/self/task/{thread}/status") as file:
        return dict(line.split(":", 1) for line in file)
while any(status(thread)["State"].split()[0] != "S" for thread in threads):
    time.sleep(0.01)
def n_wake():
    return sum(int(status(thread)["voluntary_ctxt_switches"]) for thread in threads)
before = n_wake()
import rubhpc
rubhpc.run(sys.argv[1], quiet=True)
print(len(threads), n_wake() - before)
"""
COUNTED = """
import scipy.linalg
from threadpoolctl import threadpool_info
from rubhpc.threads import on_one_thread, one_thread
def counts():
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]
print(counts())
print(on_one_thread(counts)())
with one_thread():
    print(counts())
print(counts())
"""


def script(text, *arguments, **variables):
    """Run Python without the variables that hold libraries to one thread; its output."""
    kept = {key: value for key, value in environment().items() if key not in VARIABLES}
    return subprocess.run(
        [sys.executable, "-c", text, *map(str, arguments)],
        env=kept | variables,
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    ).stdout


def test_libraries_are_held_to_one_thread_and_let_go():
    shown = script(COUNTED, OPENBLAS_NUM_THREADS="2", MKL_NUM_THREADS="2")
    before, decorated, held, after = map(eval, shown.splitlines())
    assert before
    assert set(decorated) == set(held) == {1}
    assert after == before
    if os.cpu_count() > 1:
        assert set(before) == {2}


def test_a_script_stores_what_the_command_does_and_its_libraries_start_no_work_beside_it(tmp_path):
    """A sampled study prepares every case again, so linear algebra is most of it: hundreds of calls.

    The threads of a library sleep until it gives them work, so it is enough to count how often they wake.
    """
    study = write_sample(tmp_path)
    n_thread, n_wake = map(int, script(SCRIPT, study).split())
    assert n_thread > 0 or os.cpu_count() == 1
    assert n_wake < 5  # 9 to 22 if they are not held
    rubhpc.run(read_study(study, tmp_path / "here.zarr"), quiet=True)  # where VARIABLES hold them
    assert stored_bytes(tmp_path / "here.zarr") == stored_bytes(tmp_path / "tiny.zarr")


def test_of_two_at_once_the_last_gives_back_all_threads():
    def counts() -> list[int]:
        return [library["num_threads"] for library in threadpool_info()]

    with threadpool_limits(limits=2):
        before = counts()
        first, second = one_thread(), one_thread()
        first.__enter__()
        second.__enter__()
        assert set(counts()) == {1}
        first.__exit__(None, None, None)
        assert set(counts()) == {1}  # the other still needs it
        second.__exit__(None, None, None)
        assert counts() == before
