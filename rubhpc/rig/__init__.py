"""The rig: what a rotor and its stators consist of, and how they are read."""
