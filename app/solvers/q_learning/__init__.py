"""Semi-random Q-learning, for comparison; see README.md."""
