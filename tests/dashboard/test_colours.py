"""Colours of UAVs are told apart by everybody: on both maps, also with each kind of colour blindness."""

import itertools
import re

import numpy as np
import pytest
from page_modules import MODULES

STYLE = (MODULES.parent / "style.css").read_text("utf-8")
LIGHT, DARK = STYLE.split("prefers-color-scheme: dark", 1)
# Machado, Oliveira and Fernandes (2009), severity 1.0, of linear RGB.
VISION = {
    "all cones": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]]
    ),
}
CONES = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
OPPONENTS = np.array(
    [
        [0.2104542553, 0.793617785, -0.0040720468],
        [1.9779984951, -2.428592205, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
LEAST_DISTANCE = 0.1
"""In OKLab; two greys that are just told apart side by side differ by about 0.02."""
LEAST_CONTRAST = 3.0
"""Of graphics against what is beside them, WCAG 1.4.11."""


def linear(colour):
    value = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def oklab(rgb):
    return OPPONENTS @ np.cbrt(CONES @ np.clip(rgb, 0, 1))


def colours(style):
    found = dict(re.findall(r"(--uav-\d|--map): (#[0-9a-f]{6})", style))
    return [linear(found[f"--uav-{n}"]) for n in range(8)], linear(found["--map"])


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("style", [LIGHT, DARK], ids=["light", "dark"])
def test_each_two_of_the_eight_differ(style, vision):
    seen = [oklab(VISION[vision] @ colour) for colour in colours(style)[0]]
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)) >= LEAST_DISTANCE


@pytest.mark.parametrize("style", [LIGHT, DARK], ids=["light", "dark"])
def test_each_stands_out_from_the_map(style):
    light = np.array([0.2126, 0.7152, 0.0722])
    own, ground = colours(style)
    for colour in own:
        low, high = sorted([light @ colour, light @ ground])
        assert (high + 0.05) / (low + 0.05) >= LEAST_CONTRAST
