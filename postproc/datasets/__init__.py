"""Data sets for machine learning: labelled windows of many cases, seen by sensors."""
