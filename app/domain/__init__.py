"""What a problem, a plan and an answer are; no algorithm, no web."""
