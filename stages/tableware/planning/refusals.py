"""What of a seen table is planned for. What is not sure, not known, outside, or not to be lifted is refused with a
reason, left alone and kept clear of: never a silent wrong plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.schemas.errors import BadInput
from scenewright.schemas.tableware_plan import RefusedItem
from scenewright.schemas.tableware_scene import MOST_ITEMS
from scenewright.stages.tableware.planning.rules import Rules, can_hold, letters
from scenewright.stages.tableware.world.footprints import Footprint, footprint
from scenewright.stages.tableware.world.items import Item, Table
from scenewright.stages.tableware.world.setting import Setting

EDGE = 0.005
"""What stands on the table may be seen to hang over its edge by this [m]; what lies on a dish goes with the dish."""
SIZE = 0.005
"""Dishes whose estimated rim radius or height differs from their kind's by more [m] are not planned for."""


@dataclass(frozen=True)
class Doubt:
    """How sure is what was seen of an item."""

    confidence: float
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Unknown:
    """Something that is no tableware of known size: place and radius of the circle around it [m]."""

    name: str
    x: float
    y: float
    radius: float


@dataclass(frozen=True)
class Accepted:
    """What is planned for, and what is not."""

    table: Table
    refused: tuple[RefusedItem, ...]


def accept(
    table: Table, doubts: Mapping[str, Doubt], unknown: tuple[Unknown, ...], least: float, rules: Rules
) -> Accepted:
    """Return what of a table is planned for: items with a confidence of at least `least`, inside the workspace, in
    piles of which no part is refused. Raises BadInput for more items than a plan takes."""
    if len(table.items) > MOST_ITEMS:
        raise BadInput(
            f"{len(table.items)} items on the table, a plan takes at most {MOST_ITEMS}", hint="clear a part of it first"
        )
    refused = [
        RefusedItem(
            name=unknown_thing.name,
            position=(unknown_thing.x, unknown_thing.y, 0.0),
            radius=unknown_thing.radius,
            reason="unknown_object",
            message=f"{unknown_thing.name}: no tableware of known size, {1e3 * unknown_thing.radius:.0f} mm around",
        )
        for unknown_thing in unknown
    ]
    accepted: list[Item] = []
    for pile in table.stacks:
        wrong = [
            refusal
            for item in pile
            if (refusal := _wrong(item, doubts.get(item.name), least, rules.setting)) is not None
        ]
        if not wrong and not can_hold(letters(pile[-1:]), rules):
            wrong = [_refusal(pile[-1], "too_tall_to_lift", "the jaws do not hold it")]
        if not wrong:
            accepted.extend(pile)
            continue
        names = {refusal.name for refusal in wrong}
        refused.extend(wrong)
        refused.extend(
            _refusal(item, "in_a_refused_pile", f"stands in a pile with {wrong[0].name}")
            for item in pile
            if item.name not in names
        )
    circles = tuple((refusal.position[0], refusal.position[1], refusal.radius) for refusal in refused)
    order = {item.name: number for number, item in enumerate(table.items)}
    return Accepted(Table(tuple(sorted(accepted, key=lambda item: order[item.name])), circles), tuple(refused))


def _wrong(item: Item, doubt: Doubt | None, least: float, setting: Setting) -> RefusedItem | None:
    standing = footprint(item)
    if item.on is None and not Footprint(standing.start, standing.end, standing.radius - EDGE).on_table:
        where = f"at ({item.position[0]:.3f}, {item.position[1]:.3f}) m"
        return _refusal(item, "outside_workspace", f"{where}, hangs over the edge of the workspace")
    usual, size = setting.sizes[item.kind], item.measures
    unlike_usual = abs(size.rim_radius - usual.rim_radius) > SIZE or abs(size.height - usual.height) > SIZE
    if setting.alike is None and unlike_usual:
        return _refusal(item, "other_size", f"not of the size that a {item.kind} has here: it may not fit the jaws")
    if doubt is not None and doubt.confidence < least:
        why = f" ({', '.join(doubt.reasons)})" if doubt.reasons else ""
        return _refusal(item, "unsure", f"seen with a confidence of {doubt.confidence:.2f}, below {least:.2f}{why}")
    return None


def _refusal(item: Item, reason: str, message: str) -> RefusedItem:
    size = item.measures.rim_radius if item.is_dish else item.measures.length / 2
    return RefusedItem(
        name=item.name,
        position=item.position,
        radius=size,
        reason=reason,  # type: ignore[arg-type]
        message=f"{item.name}: {message}",
    )


def statement(accepted: Accepted, notes: tuple[str, ...] = ()) -> str:
    """Return in one line what is planned for and what is not; `notes`: what vision did not handle."""
    count = len(accepted.table.items)
    text = f"{count} item{'s' * (count != 1)} to clear" if count else "nothing to clear"
    if not accepted.refused and not notes:
        return text if count else "the table is empty: nothing to clear"
    return f"{text}; not handled: " + "; ".join([*(refusal.message for refusal in accepted.refused), *notes])
