"""Central difference, the scheme of the paper: a case in small steps, with its contact problems."""
