"""The planning domain: what a mobile arm with one hand can do with the things of a contact graph (typed STRIPS).

`carrier` things (trays, plates) are lifted with all that stands on them: `on(cup, tray)` stays true while the tray
moves. `carried_along(cup, tray)` says that the cup was put there before the tray was first lifted, so that it travels
(or has travelled) with it. `reachable`, `graspable`, `fits`, `flat` and `entrance` are affordances, read
off the geometry once; the other predicates change.
"""

from __future__ import annotations

from stages.kit.tasks.strips import Domain, Schema

START = "start"
GOAL_PREDICATES = ("on", "in", "holding", "carried_along", "open", "closed")

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
    },
    schemas=(
        Schema("drive", (("?from", "thing"), ("?to", "thing")), (("near", "?from"), ("reachable", "?to")),
               (("near", "?to"),), (("near", "?from"),)),
        Schema("pick", (("?item", "item"), ("?from", "support")),
               (("graspable", "?item"), ("near", "?item"), ("on", "?item", "?from"), ("clear", "?item"),
                ("hand_empty",)),
               (("holding", "?item"), ("clear", "?from")),
               (("on", "?item", "?from"), ("carried_along", "?item", "?from"), ("unmoved", "?item"),
                ("hand_empty",))),
        Schema("lift", (("?item", "item"), ("?from", "support")),
               (("graspable", "?item"), ("carrier", "?item"), ("near", "?item"), ("on", "?item", "?from"),
                ("hand_empty",)),
               (("holding", "?item"), ("clear", "?from")),
               (("on", "?item", "?from"), ("unmoved", "?item"), ("hand_empty",))),
        Schema("take_out", (("?item", "item"), ("?from", "container"), ("?door", "door")),
               (("graspable", "?item"), ("near", "?item"), ("in", "?item", "?from"), ("behind", "?item", "?door"),
                ("open", "?door"), ("clear", "?item"), ("hand_empty",)),
               (("holding", "?item"),),
               (("in", "?item", "?from"), ("behind", "?item", "?door"), ("hand_empty",))),
        Schema("place", (("?item", "item"), ("?on", "support")),
               (("flat", "?on"), ("fits", "?item", "?on"), ("holding", "?item"), ("near", "?on")),
               (("on", "?item", "?on"), ("hand_empty",)), (("holding", "?item"), ("clear", "?on"))),
        Schema("stack", (("?item", "item"), ("?on", "item")),
               (("carrier", "?on"), ("unmoved", "?on"), ("flat", "?on"), ("fits", "?item", "?on"), ("holding", "?item"),
                ("near", "?on")),
               (("on", "?item", "?on"), ("carried_along", "?item", "?on"), ("hand_empty",)),
               (("holding", "?item"), ("clear", "?on"))),
        Schema("put_in", (("?item", "item"), ("?in", "container"), ("?door", "door")),
               (("entrance", "?door", "?in"), ("fits", "?item", "?door"), ("holding", "?item"), ("near", "?in"),
                ("open", "?door")),
               (("in", "?item", "?in"), ("behind", "?item", "?door"), ("hand_empty",)), (("holding", "?item"),)),
        Schema("open", (("?door", "door"),), (("near", "?door"), ("hand_empty",)), (("open", "?door"),),
               (("closed", "?door"),)),
        Schema("close", (("?door", "door"),), (("near", "?door"), ("hand_empty",)), (("closed", "?door"),),
               (("open", "?door"),)),
    ),
)  # fmt: skip
"""`take_out` and `put_in` are `pick` and `place` through a door, `lift` a `pick` with a load, `stack` a `place` on
what is lifted later."""

PLAIN_NAMES = {"take_out": "pick", "lift": "pick", "put_in": "place", "stack": "place"}
"""Names of the motions of the actions that have another name."""
