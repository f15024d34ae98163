"""Local search over plans with incremental evaluation: a move costs what it touches, not the whole plan."""
