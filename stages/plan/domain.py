"""The planning domain: what a mobile arm with one hand can do with the things of a contact graph (typed STRIPS).

`carrier` things (trays, plates) are lifted with all that stands on them: `on(cup, tray)` stays true while the tray
moves. `carried_along(cup, tray)` says that the cup was put there before the tray was first lifted, so that it travels
(or has travelled) with it. `reachable`, `graspable`, `fits`, `flat` and `entrance` are affordances, read
off the geometry once; the other predicates change. The actions are the files of `actions/`.
"""

from __future__ import annotations

from scenewright.stages.kit.tasks.strips import Domain
from scenewright.stages.plan.action import all_actions

START = "start"
"""Where the robot stands before its first drive."""

DOMAIN = Domain(
    name="mobile_manipulation",
    types={
        "thing": "",
        "support": "thing",
        "item": "support",
        "surface": "support",
        "container": "support",
        "door": "thing",
        "spot": "thing",
    },
    predicates={
        "near": ("thing",),
        "on": ("item", "support"),
        "in": ("item", "container"),
        "behind": ("item", "door"),
        "carried_along": ("item", "item"),
        "unmoved": ("item",),
        "clear": ("support",),
        "holding": ("item",),
        "hand_empty": (),
        "open": ("door",),
        "closed": ("door",),
        "reachable": ("thing",),
        "graspable": ("item",),
        "carrier": ("item",),
        "flat": ("support",),
        "fits": ("item", "thing"),
        "entrance": ("door", "container"),
    }
    | {name: kinds for action in all_actions() for name, kinds in action.predicates.items()},
    schemas=tuple(schema for action in all_actions() for schema in action.schemas),
)
"""What the robot can do, in symbols; the actions bring their schemas."""
