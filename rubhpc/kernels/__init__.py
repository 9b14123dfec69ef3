"""Compiled kernels on bare floats and arrays: they neither print nor raise, and know no files or rigs."""
