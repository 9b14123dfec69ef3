"""One case: a rig at a speed integrated and measured."""
