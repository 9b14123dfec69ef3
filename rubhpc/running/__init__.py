"""Who computes what, and when it stops."""
