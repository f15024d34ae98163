"""Updating the networks for every size: losses, optimiser, and how long an update takes."""
