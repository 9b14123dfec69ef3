"""Study and rig files read, checked and resolved."""
