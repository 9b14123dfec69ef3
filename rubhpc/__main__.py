"""`python -m rubhpc` is `rubhpc`."""

from rubhpc.cli import main

if __name__ == "__main__":
    main()
