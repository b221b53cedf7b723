"""Figures and what they may come to: a figure that gets better passes."""

from __future__ import annotations

from collections.abc import Mapping


def misses(figures: Mapping[str, float], at_least: Mapping[str, float], at_most: Mapping[str, float]) -> list[str]:
    """Return the figures beyond their limits, in words. Raises KeyError for a figure that was not measured."""
    return [
        *(
            f"{name} is {figures[name]:.4g}, below {limit:.4g}"
            for name, limit in at_least.items()
            if figures[name] < limit
        ),
        *(
            f"{name} is {figures[name]:.4g}, above {limit:.4g}"
            for name, limit in at_most.items()
            if figures[name] > limit
        ),
    ]
