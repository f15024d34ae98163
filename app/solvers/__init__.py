"""Algorithms that turn a problem into a plan, behind one protocol."""
