"""Where the light comes from: nominal and true directions of the lamps, and the points that a lamp consists of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from setup_records import Rig, Setup

LED_POINTS = 4
SEGMENT_POINTS = (6, 3)
"""Points of a ring segment: along azimuth and elevation."""
GOLDEN_ANGLE = 2.399963
"""Spreads any number of points evenly over a disc."""


def lamp_directions(setup: Setup) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nominal and true unit vectors (lamps, 3) from the surface to the middles of the lamps."""
    rig = setup.rig
    azimuth, elevation = (
        np.deg2rad(rig.azimuth_deg + np.arange(rig.count) * 360.0 / rig.count),
        np.deg2rad(rig.elevation_deg),
    )
    level, up = np.cos(elevation), np.full(rig.count, np.sin(elevation))
    nominal = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), up], -1)
    error_deg = np.full(rig.count, rig.error_deg)
    if rig.one_off:
        error_deg[rig.one_off[0]] = rig.one_off[1]
    first = np.cross(nominal, [0, 0, 1.0])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(nominal, first)
    way = np.random.default_rng([setup.seed, 41]).uniform(0, 2 * np.pi, rig.count)[:, None]
    error = np.deg2rad(error_deg)[:, None]
    true = np.cos(error) * nominal + np.sin(error) * (np.cos(way) * first + np.sin(way) * second)
    return nominal, true


def lamp_points(rig: Rig, middle: NDArray[np.float64], lamp: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors (points, 3) to the points of a lamp, and their shares of its light, which sum to 1."""
    if rig.segment_deg:
        return _segment_points(rig.segment_deg, middle)
    index = np.arange(LED_POINTS)
    first = np.cross(middle, [0, 0, 1.0])
    first /= np.linalg.norm(first)
    second = np.cross(middle, first)
    radius = np.tan(np.deg2rad(rig.lamp_deg / 2)) * np.sqrt((index + 0.5) / LED_POINTS)
    angle = GOLDEN_ANGLE * index + lamp
    points = middle + radius[:, None] * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second)
    return points / np.linalg.norm(points, axis=1, keepdims=True), np.full(LED_POINTS, 1.0 / LED_POINTS)


def _segment_points(
    extent_deg: tuple[float, float], middle: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A segment behind a diffuser, brighter in its middle."""
    azimuth, elevation = np.arctan2(middle[1], middle[0]), np.arcsin(middle[2])
    points, shares = [], []
    for along in (np.arange(SEGMENT_POINTS[0]) + 0.5) / SEGMENT_POINTS[0] - 0.5:
        for up in (np.arange(SEGMENT_POINTS[1]) + 0.5) / SEGMENT_POINTS[1] - 0.5:
            x, y = azimuth + np.deg2rad(extent_deg[0]) * along, elevation + np.deg2rad(extent_deg[1]) * up
            points.append([np.cos(y) * np.cos(x), np.cos(y) * np.sin(x), np.sin(y)])
            shares.append(np.cos(np.pi * along * 0.7) * np.cos(np.pi * up * 0.7))
    total = np.array(shares)
    return np.array(points), total / total.sum()


def lamp_centroids(setup: Setup, true: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors (lamps, 3) to where the light of each lamp comes from on the whole: the truth of a method."""
    means = []
    for lamp, middle in enumerate(true):
        points, shares = lamp_points(setup.rig, middle, lamp)
        mean = (points * np.asarray(shares)[:, None]).sum(0)
        means.append(mean / np.linalg.norm(mean))
    return np.array(means)
