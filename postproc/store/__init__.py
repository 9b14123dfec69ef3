"""Opening a store: selection, units, the rig of a case, export."""
