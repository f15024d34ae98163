"""Plans to take away: one module a format, each a pure function from a plan to text; no HTTP, no jobs."""
