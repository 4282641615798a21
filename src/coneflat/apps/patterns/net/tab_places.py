"""Tabs beside each other without collisions: greedily, with exchanges."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....base import FloatArray

# By how much tabs are shrunk in tests for collisions, relative to their size: they may touch.
TOUCHING = 1e-6


class PlacedTabs:
    """Tabs that were placed.

    Attributes:
        items: the side and the polygon of each part with a tab.
    """

    def __init__(self, shapely: Any) -> None:
        self.shapely = shapely
        self.items: dict[int, tuple[int, FloatArray]] = {}
        self.shapes: dict[int, Any] = {}
        self.boxes: dict[int, FloatArray] = {}

    def put(self, number: int, choices: list[FloatArray]) -> bool:
        """Place the largest tab of a part that collides with no other; return whether there is one."""
        ranked = sorted(
            ((side, polygon) for side in (0, 1) for polygon in choices[side]),
            key=lambda choice: -round(float(areas_of(choice[1][None])[0]), 9),
        )
        for side, polygon in ranked:
            if not self._blockers(polygon):
                self._set(number, side, polygon)
                return True
        return False

    def exchange(self, number: int, choices: Mapping[int, list[FloatArray]]) -> bool:
        """Place a tab where a single other one is in the way, which fits elsewhere; return whether that is possible."""
        for side in (0, 1):
            for polygon in choices[number][side]:
                blockers = self._blockers(polygon)
                if len(blockers) != 1:
                    continue
                blocker = blockers[0]
                before = self.items[blocker]
                self._remove(blocker)
                self._set(number, side, polygon)
                if self.put(blocker, choices[blocker]):
                    return True
                self._remove(number)
                self._set(blocker, *before)
        return False

    def _set(self, number: int, side: int, polygon: FloatArray) -> None:
        self.items[number] = side, polygon
        self.shapes[number] = self.shapely.polygons(shrunk(polygon[None])[0])
        self.boxes[number] = np.concatenate([polygon.min(axis=0), -polygon.max(axis=0)])

    def _remove(self, number: int) -> None:
        del self.items[number], self.shapes[number], self.boxes[number]

    def _blockers(self, polygon: FloatArray) -> list[int]:
        """Return the parts whose tabs collide with a polygon."""
        if not self.boxes:
            return []
        numbers = list(self.boxes)
        boxes = np.array(list(self.boxes.values()))
        low, high = polygon.min(axis=0), polygon.max(axis=0)
        is_close = (boxes[:, :2] < high).all(axis=1) & (-boxes[:, 2:] > low).all(axis=1)
        shape = self.shapely.polygons(shrunk(polygon[None])[0])
        return [
            numbers[i] for i in np.flatnonzero(is_close).tolist() if self.shapes[numbers[i]].intersects(shape)
        ]


def shrunk(polygons: FloatArray) -> FloatArray:
    """Return polygons (k, 4, 2) that are a little smaller."""
    centres = polygons.mean(axis=1, keepdims=True)
    return centres + (1 - TOUCHING) * (polygons - centres)


def areas_of(polygons: FloatArray) -> FloatArray:
    """Return (k,) the areas of polygons (k, 4, 2)."""
    x, y = polygons[..., 0], polygons[..., 1]
    return np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)) / 2


def largest_area(polygons: FloatArray) -> float:
    """Return the area of the first of polygons (k, 4, 2), 0 if there is none."""
    return float(areas_of(polygons)[0]) if len(polygons) else 0.0
