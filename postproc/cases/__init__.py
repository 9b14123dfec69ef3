"""Analysis over many cases: maps, reduction, detection, sensitivity."""
