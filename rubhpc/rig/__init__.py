"""What a rig consists of, and how it is read."""
