"""The motions by which two records are compared."""

MOTIONS = ("vertical", "horizontal", "torsion", "stator_axial", "stator_lateral")
