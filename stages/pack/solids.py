"""Upright blocks (a rectangle turned by a yaw, between two heights) and how deep two of them are in each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, inf, sin


@dataclass(frozen=True)
class Block:
    """An upright block: centre (x, y) [m], yaw [rad], half extents along its own axes, world z of both faces [m]."""

    x: float
    y: float
    yaw: float
    half_width: float
    half_length: float
    bottom: float
    top: float

    def moved(self, forward: float, left: float) -> tuple[float, float]:
        """Return the world (x, y) of a point of the block's own frame."""
        c, s = cos(self.yaw), sin(self.yaw)
        return self.x + c * forward - s * left, self.y + s * forward + c * left

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Axis-aligned low x, low y, high x, high y [m]."""
        c, s = abs(cos(self.yaw)), abs(sin(self.yaw))
        half_x = c * self.half_width + s * self.half_length
        half_y = s * self.half_width + c * self.half_length
        return self.x - half_x, self.y - half_y, self.x + half_x, self.y + half_y


def block_over(low: Sequence[float], high: Sequence[float], bottom: float, top: float) -> Block:
    """Return the block over an axis-aligned rectangle, corners (x, y) [m], between two world heights [m]."""
    return Block(
        (low[0] + high[0]) / 2, (low[1] + high[1]) / 2, 0.0, (high[0] - low[0]) / 2, (high[1] - low[1]) / 2, bottom, top
    )


def flat_depth(first: Block, second: Block) -> float:
    """Return how far [m] two turned rectangles overlap (smallest over the four separating axes), negative: a gap.

    Separating-axis theorem for rectangles (Gottschalk, Lin & Manocha 1996, in two dimensions). A gap is a lower bound
    of the distance.
    """
    dx, dy = second.x - first.x, second.y - first.y
    depth = inf
    cosine, sine = abs(cos(second.yaw - first.yaw)), abs(sin(second.yaw - first.yaw))
    for block, other in ((first, second), (second, first)):
        c, s = cos(block.yaw), sin(block.yaw)
        along = block.half_width + other.half_width * cosine + other.half_length * sine - abs(c * dx + s * dy)
        across = block.half_length + other.half_width * sine + other.half_length * cosine - abs(c * dy - s * dx)
        depth = min(depth, along, across)
    return depth


def overlap(first: Block, second: Block) -> float:
    """Return the penetration [m] of two blocks, zero or negative when they are apart."""
    vertical = min(first.top, second.top) - max(first.bottom, second.bottom)
    if vertical <= 0:
        return vertical
    reach = first.half_width + first.half_length + second.half_width + second.half_length
    apart = max(abs(first.x - second.x), abs(first.y - second.y)) - reach
    if apart > 0:  # no corner is farther from its centre than the sum of the half extents
        return -apart
    return min(vertical, flat_depth(first, second))
