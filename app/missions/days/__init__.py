"""Days drawn from seeds, on which ways of replanning are measured; only benchmarks and tests import this."""
