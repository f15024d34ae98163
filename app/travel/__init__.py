"""Legs: from places, zones, wind and matrices to length over ground, air length and time."""
