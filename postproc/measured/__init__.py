"""Measurements as signals: files of data loggers as datasets that the figures take in place of a store."""
