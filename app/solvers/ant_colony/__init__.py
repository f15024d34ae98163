"""Ant colony with division of labour, for comparison; see README.md."""
