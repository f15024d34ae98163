"""Scenes with no-fly zones."""

import numpy as np


def square(x, y, side):
    """Corners of a square, from its lower left."""
    return [(x, y), (x + side, y), (x + side, y + side), (x, y + side)]


def star_scene(rng: np.random.Generator, places: int, zones: int, corners: int):
    """Places in the unit square, and zones that are stars: they overlap here and there, and touch nowhere."""
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)[:, None]
    rays = np.hstack([np.cos(angle), np.sin(angle)])
    stars = [middle + rng.uniform(0.05, 0.2, (corners, 1)) * rays for middle in rng.random((zones, 2))]
    return rng.random((places, 2)), stars
