"""Durable jobs: the table that is the only truth, the dispatcher, and the processes that do the work."""
