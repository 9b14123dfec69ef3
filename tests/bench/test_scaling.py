"""Two ranks against one, and the memory that a rank takes. Two idle cores are meant."""

import subprocess
import time
from contextlib import suppress

import psutil
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


def run(folder, ranks, **changes):
    """Wall time (s) and the most memory (MB) that one process of the run has held.

    Its processes are looked for once: to ask for all there are twenty times a second takes a tenth of a core.
    """
    folder.mkdir()
    path = write_study(folder, **(UNEVEN | changes))
    began = time.perf_counter()
    with subprocess.Popen(
        command(path, ranks=ranks), env=environment(), stdout=subprocess.DEVNULL
    ) as launched:
        time.sleep(5.0)
        processes = psutil.Process(launched.pid).children(recursive=True)
        most = 0
        while launched.poll() is None:
            for process in processes:
                with suppress(psutil.NoSuchProcess):  # it has just ended
                    most = max(most, process.memory_info().rss)
            time.sleep(0.05)
        seconds = time.perf_counter() - began
    assert launched.returncode == 0
    return seconds, most / 1e6


def test_two_ranks_share_uneven_cases_evenly(benchmark, tmp_path):
    times, memory = {}, {}
    run(tmp_path / "first", 1, transient=1, revolutions=1)  # compiles
    for ranks in (1, 2):
        folder = tmp_path / str(ranks)
        if ranks == 1:
            times[1], memory[1] = run(folder, 1)
        else:
            times[2], memory[2] = benchmark.pedantic(run, args=(folder, 2), rounds=1)
    benchmark.extra_info |= {"one_rank_s": times[1], "two_ranks_s": times[2], "most_memory_MB": memory[2]}
    print(f"\none rank {times[1]:.1f} s, two {times[2]:.1f} s: {times[1] / times[2]:.3f} times")
    assert 0 < max(memory.values()) < 400
    assert times[1] / times[2] >= 1.9
