"""Branches of periodic motions: followed through folds, with the events on them."""
