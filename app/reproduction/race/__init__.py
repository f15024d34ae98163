"""The race: the algorithms for comparison beside the paper's and the service's; see README.md."""
