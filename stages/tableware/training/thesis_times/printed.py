"""What the thesis prints of clearing tables (Srinivas 2024, tables 7.1 and 7.2)."""

from __future__ import annotations

PRINTED: dict[str, dict[str, tuple[float, float, float, float, int]]] = {
    "tier0_cups": {
        "random": (78.2, 124.2, 154.8, 0.8, 0),
        "stack": (58.5, 76.5, 88.5, 2.0, 0),
        "pull": (48.8, 70.8, 85.4, 1.6, 2),
    },
    "tier0_bowls": {
        "random": (63.3, 99.3, 123.3, 1.0, 0),
        "stack": (60.2, 78.2, 90.2, 2.0, 0),
        "pull": (41.3, 61.3, 74.6, 1.8, 0),
    },
    "tier0_utensils": {
        "random": (64.1, 100.1, 124.1, 1.0, 0),
        "stack": (64.3, 84.3, 97.6, 1.8, 0),
        "pull": (55.3, 75.3, 88.7, 1.8, 1),
    },
    "tier1": {
        "random": (121.3, 193.3, 241.3, 1.0, 1),
        "stack": (111.3, 147.3, 171.3, 2.0, 2),
        "pull": (102.1, 120.3, 178.8, 1.6, 3),
    },
    "tier2": {
        "random": (93.5, 143.5, 176.9, 1.4, 0),
        "stack": (88.2, 116.2, 134.9, 2.6, 2),
        "pull": (84.2, 116.2, 137.5, 2.3, 3),
    },
}
"""Tier -> policy -> seconds at 0, 3 and 5 s delay, objects a trip, failed trials of three. Tier 1, Pull, 3 s
contradicts its own ratio (148.1 fits it)."""
