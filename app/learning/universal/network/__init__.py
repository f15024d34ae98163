"""The networks for every size, and their compiled double that roll-outs ask."""
