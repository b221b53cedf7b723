"""Colours that stay the same in every figure: one per instance, one per relation."""

from __future__ import annotations

import colorsys

RELATION_COLORS = {
    "supports": "#2f6fb3",
    "contains": "#c2571a",
    "carries_on_wall": "#7a4fb0",
    "hangs_from": "#2c8f6f",
    "unknown": "#c9a227",
    "also_supports": "#2f6fb3",
    "leans_on": "#b0487a",
    "proximal": "#8c8c8c",
}
UNLABELLED = (0.46, 0.45, 0.44)
"""Colour of what has no class (sRGB, 0 to 1)."""
UNEXPLAINED_COLOR = (0.90, 0.29, 0.10)
"""Colour of mapped surface that nothing in a scene lies near to."""
LAYOUT_COLORS = {"floor": (0.80, 0.755, 0.69), "wall": (0.715, 0.755, 0.785), "ceiling": (0.84, 0.84, 0.82)}
"""Calm colours for what is large and behind everything."""
GOLDEN_RATIO = 0.6180339887498949
"""Share of the colour circle between two instances: the golden ratio, which keeps neighbours apart."""


def instance_color(instance: int) -> tuple[float, float, float]:
    """Return the colour (r, g, b) in [0, 1] of an instance label; grey for 0.

    Hues advance by the golden ratio, so that neighbours in number differ; lightness takes three turns.
    """
    if instance <= 0:
        return UNLABELLED
    hue = (0.08 + instance * GOLDEN_RATIO) % 1.0
    lightness = (0.52, 0.64, 0.44)[instance % 3]
    saturation = (0.62, 0.55, 0.72)[(instance // 3) % 3]
    return colorsys.hls_to_rgb(hue, lightness, saturation)


def entity_color(number: int, class_name: str | None) -> tuple[float, float, float]:
    """Return the colour of an entity: calm for floor, wall and ceiling, else by `number` (instance or class id)."""
    return LAYOUT_COLORS.get(class_name or "", instance_color(number))


def hex_color(color: tuple[float, float, float]) -> str:
    """Return `#rrggbb` of (r, g, b) in [0, 1]."""
    return "#" + "".join(f"{round(255 * min(max(c, 0.0), 1.0)):02x}" for c in color)
