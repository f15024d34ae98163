"""Swarm heuristics over random keys, for comparison; see README.md."""
