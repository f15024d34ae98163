"""Playing with the networks for every size: what a UAV observes, its turns, roll-outs, routes."""
