"""From samples and sums to named measures: regime, period, settling, divergence."""
