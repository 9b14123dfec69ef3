"""Time from the shell: to the help text, and to the first case of a study."""

import resource
import subprocess
import sys

import pytest
from running import command, environment, write_study

pytestmark = pytest.mark.bench


def run(*arguments):
    return subprocess.run(command(*arguments), env=environment(), check=True, capture_output=True, text=True)


def test_help_comes_within_a_third_of_a_second(benchmark):
    shown = benchmark.pedantic(run, args=("--help",), rounds=10, warmup_rounds=1)
    assert "Usage" in shown.stdout
    assert benchmark.stats.stats.min < 0.3


def test_first_case_is_done_within_three_seconds(benchmark, tmp_path):
    """A whole study of one short case, with kernels compiled before: they lie in numba's cache."""
    rounds = iter(range(100))

    def study():
        folder = tmp_path / str(next(rounds))
        folder.mkdir()
        only = {"speed_ratio": [0.9], "transient": 0, "revolutions": 1, "block": 1}
        path = write_study(folder, **only)
        path.write_text(path.read_text().replace("[0.7, 0.85]", "[0.7]").replace("[0.1, 0.3, 0.5]", "[0.3]"))
        return (path,), {}

    benchmark.pedantic(run, setup=study, rounds=4, warmup_rounds=1)
    assert benchmark.stats.stats.min < 3.0


def test_kernels_of_the_first_case_are_compiled_within_forty_seconds(tmp_path):
    """In processor time, with an empty cache."""
    case = "speed_ratio=0.75, clearance_ratio=0.7, transient=1, revolutions=2, samples_per_revolution=32"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-c", f"import rubhpc; rubhpc.simulate('mokhtar2017', {case})"],
        env=environment(NUMBA_CACHE_DIR=str(tmp_path)),
        check=True,
        capture_output=True,
        text=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    taken = after.ru_utime - before.ru_utime
    print(f"\n{taken:.1f} s of processor time")
    assert done.stderr.startswith("rubhpc: compiling kernels, once after an installation: about 10 s")
    assert taken < 40
