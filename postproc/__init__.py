"""What can be recomputed and drawn from a finished store: spectra, cascades, maps, orbits, sections."""
