"""What is freed stays with the process."""

import platform
import subprocess
import sys

import pytest

COUNT = """
import resource
import numpy as np
import rubhpc.integrate.reduced_model.table_stack

def faults(n):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(n):
        [np.ones(2**17) for _ in range(8)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

faults(10)
print(faults(40))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="it is glibc that gives memory back")
def test_arrays_of_a_megabyte_take_no_new_pages():
    done = subprocess.run([sys.executable, "-c", COUNT], check=True, capture_output=True, text=True)
    assert int(done.stdout) < 40 * 8 * 256 // 10  # of 4 kB
