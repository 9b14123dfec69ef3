"""The figures, one file a command, and what they share."""
