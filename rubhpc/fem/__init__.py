"""Finite element model of rotor and stators: matrices, modes, steady contact-free response."""
