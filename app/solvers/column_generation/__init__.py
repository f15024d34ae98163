"""Column generation: the best choice among all routes, where UAVs carry enough for all they visit."""
