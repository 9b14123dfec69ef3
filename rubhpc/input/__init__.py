"""Generic reading of TOML files: quantities with units, ranges, matrices, declared fields, dotted keys."""
