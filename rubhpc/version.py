"""The version of the program, where every layer can read it; the wheel's is in pyproject.toml."""

__version__ = "0.1.0"
