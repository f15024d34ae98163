"""What one job does: solve within its time, bound, explain, answer. Only workers import it."""
