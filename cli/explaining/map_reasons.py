"""Why an entity of a panoptic map has its surface and its name, and why a plane bounds the room or does not."""

from __future__ import annotations

from collections.abc import Iterator

from scenewright.cli.explaining.reason import (
    Reason,
    Reasons,
    counted,
    edit_reasons,
    length,
    listed,
    merged,
    numbered,
    percent,
)
from scenewright.schemas.panoptic_map import (
    Because,
    BecauseFile,
    EntitiesFile,
    Entity,
    LayoutFile,
    LayoutPlane,
    Opening,
    PanopticMap,
)
from scenewright.schemas.vocabulary import UNNAMED

FAINT = 0.005
"""Least score or posterior that is said: it would be said as 0.00 else."""
PLANE_REASONS: dict[tuple[str, str], tuple[str, str]] = {
    ("", "area"): ("it is large", "it is small"),
    ("", "free space behind"): ("cameras saw hardly any free space behind it", "cameras saw free space behind it"),
    ("", "surface behind"): ("hardly any surface lies behind it", "surface lies behind it"),
    ("", "masks"): (
        "masks call it a bound of the room more often than the rest of the map",
        "masks call it a bound of the room less often than the rest of the map",
    ),
    ("", "height of the cameras"): (
        "the cameras were 0.9 to 2.6 m over it",
        "the cameras were not 0.9 to 2.6 m over it",
    ),
    ("", "cameras"): ("the cameras were on its front", "most cameras were on its back"),
    ("", "wall over it"): ("nothing goes on over its top", "a surface that faces the same way goes on over its top"),
    ("wall", "height"): ("it goes up to the highest surface", "it ends too low for a wall"),
    ("ceiling", "height"): ("it is over 2 m above the floor", "it is less than 2 m above the floor"),
}
"""(Kind of the plane or any, reason) -> what it means where its log odds are over and under 0."""


def map_reasons(panoptic_map: PanopticMap) -> Reasons:
    """Return the reasons of entities, of planes (`plane_1`, ...) and of what is no entity (`dropped`)."""
    because, layout = panoptic_map.because, panoptic_map.layout
    return merged(
        [
            entity_reasons(panoptic_map.info, because, layout),
            {} if layout is None else plane_reasons(layout),
            {} if because is None or not because.dropped else {"dropped": [_dropped(because)]},
            edit_reasons(panoptic_map.edits),
        ]
    )


def entity_reasons(info: EntitiesFile, because: BecauseFile | None, layout: LayoutFile | None) -> Reasons:
    """Return by name why entities are there and what they are called."""
    told = {} if because is None else {row.instance: row for row in because.entities}
    return {
        f"{entity.class_name}_{entity.instance}": [
            *(_because(entity, told[entity.instance]) if entity.instance in told else _unrecorded(because)),
            _votes(entity),
            *(() if layout is None else _bounds(entity, layout)),
        ]
        for entity in info.entities
    }


def plane_reasons(layout: LayoutFile) -> Reasons:
    """Return by `plane_<row of layout.json, from 1>` why planes bound the room, or why not."""
    return {f"plane_{number}": [_plane(plane)] for number, plane in enumerate(layout.planes, 1)}


def _because(entity: Entity, row: Because) -> Iterator[Reason]:
    yield Reason(
        f"Its surface comes from {row.shape}. {counted(round(row.looks), 'frame')} saw it.",
        {"shape": row.shape, "looks": row.looks},
    )
    heard = {name: score for name, score in row.said.items() if score >= FAINT}
    next_names = {name: share for name, share in row.runners_up.items() if share >= FAINT}
    said = f"Mean scores of masks, 0 to 1 a frame: {numbered(heard)}." if heard else "Masks said next to nothing of it."
    yield Reason(said, {"said": row.said})
    if not row.name:
        yield Reason("It is no thing: names of things were not weighed.", {"class_name": entity.class_name})
        return
    is_unnamed = entity.class_name == UNNAMED
    of = "that it has no name" if is_unnamed else "of the name"
    share = "" if row.posterior is None else f" The posterior {of} is {row.posterior:.2f}."
    verb = "It stays an" if is_unnamed else "It is called"
    yield Reason(
        f"{verb} {entity.class_name}: {row.name}.{share}",
        {"class_name": entity.class_name, "name": row.name, "posterior": row.posterior},
    )
    if next_names:
        yield Reason(f"The next names: {numbered(next_names)}.", {"runners_up": row.runners_up})


def _unrecorded(because: BecauseFile | None) -> Iterator[Reason]:
    what = "no because.json" if because is None else "no row of it in because.json"
    yield Reason(f"The map has {what}: how its surface and its name were found is not recorded.")


def _votes(entity: Entity) -> Reason:
    facts = {"observations": entity.observations, "confidence": entity.confidence}
    if entity.observations == 0:
        return Reason("No frame voted for it: its surface is not one that masks outlined.", facts)
    votes = f"{counted(entity.observations, 'frame')} voted for it"
    return Reason(f"{votes}; {percent(entity.confidence)} of the votes agree with its class and number.", facts)


def _bounds(entity: Entity, layout: LayoutFile) -> Iterator[Reason]:
    planes = [
        f"plane_{k}" for k, plane in enumerate(layout.planes, 1) if plane.bounds and plane.kind == entity.class_name
    ]
    if planes:
        says = f"The planes that bound the room as {entity.class_name}: {listed(planes)}. Ask for one to read why."
        yield Reason(says, {"planes": planes})


def _plane(plane: LayoutPlane) -> Reason:
    verdict = "It bounds the room as" if plane.bounds else "It does not bound the room as"
    for_it = {name: odds for name, odds in plane.reasons.items() if odds > 0}
    against = {name: odds for name, odds in plane.reasons.items() if odds < 0}
    lines = [f"{verdict} {plane.kind}: its log odds are {plane.log_odds:+.2f}, and 0 is the limit."]
    lines.append(f"It has {plane.area:.2f} m² from ({_place(plane.start)}) to ({_place(plane.end)}) m.")
    for label, odds in (("For it", for_it), ("Against it", against)):
        if odds:
            order = sorted(odds, key=lambda name: (-abs(odds[name]), name))
            lines.append(f"{label}: {'; '.join(f'{_meaning(plane, name)} ({odds[name]:+.1f})' for name in order)}.")
    lines += [_opening(opening) for opening in plane.openings]
    return Reason(" ".join(lines), plane.model_dump(mode="json"))


def _meaning(plane: LayoutPlane, reason: str) -> str:
    words = PLANE_REASONS.get((plane.kind, reason)) or PLANE_REASONS.get(("", reason)) or (reason, reason)
    return words[0] if plane.reasons[reason] > 0 else words[1]


def _opening(opening: Opening) -> str:
    what = "A door" if opening.sill == 0 else f"An opening {length(opening.sill)} over the floor"
    return f"{what} in it is {length(opening.width)} wide and goes up to {length(opening.head)}."


def _place(point: tuple[float, float, float]) -> str:
    return ", ".join(f"{value:.2f}" for value in point)


def _dropped(because: BecauseFile) -> Reason:
    count = counted(len(because.dropped), "thing")
    return Reason(f"{count} of masks became no entities: {'; '.join(because.dropped)}.", {"dropped": because.dropped})
