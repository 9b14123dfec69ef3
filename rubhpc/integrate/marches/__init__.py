"""Integrators of a case, one a law or scheme: advance it sample by sample."""
