"""`python -m rubhpc` is `rubhpc`."""

import sys
from pathlib import Path

# Python has put the current folder before all others; a `numpy.py` there is not NumPy. A source tree that
# is not installed is found there, and nowhere else.
if not sys.flags.safe_path and Path(sys.path[0]) != Path(__file__).parents[1]:
    del sys.path[0]

from rubhpc.cli import main

if __name__ == "__main__":
    main()
