"""Running a study: which process computes which case, resumption, plan, and when a run stops."""
