"""Two ranks against one, and the memory that a rank takes. Two idle cores are meant."""

import os
import subprocess
import time

import pytest
from running import command, environment, write_study

pytestmark = pytest.mark.bench

# 54 cases of 11 to 1: a revolution at r = 0.5 lasts eleven times as long as at 5.5.
UNEVEN = {
    "integrator": 'method = "central-difference"\nstep = "2 us"',
    "speed_ratio": "{ start = 0.5, stop = 5.5, num = 9 }",
    "transient": 96,  # long enough for the start of the ranks, 1 s each, to be a small part
    "revolutions": 32,
    "block": 1,
}


def run(folder, ranks):
    """Wall time (s) and the most memory (MB) that one process of the run has held.

    Nothing looks on meanwhile: whoever does takes a share of a core.
    """
    path = write_study(folder, **UNEVEN)
    began = time.perf_counter()
    process = subprocess.Popen(command(path, ranks=ranks), env=environment(), stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - began
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return seconds, usage.ru_maxrss / 1e3


def test_two_ranks_share_uneven_cases_evenly(benchmark, tmp_path):
    times, memory = {}, {}
    for ranks in (1, 2):
        folder = tmp_path / str(ranks)
        folder.mkdir()
        if ranks == 1:
            times[1], memory[1] = run(folder, 1)
        else:
            times[2], memory[2] = benchmark.pedantic(run, args=(folder, 2), rounds=1)
    benchmark.extra_info |= {"one_rank_s": times[1], "two_ranks_s": times[2], "most_memory_MB": memory[2]}
    assert max(memory.values()) < 400
    assert times[1] / times[2] >= 1.9
