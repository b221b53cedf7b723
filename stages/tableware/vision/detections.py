"""What vision says of an overhead image: items with a confidence, and why it is unsure."""

from __future__ import annotations

from dataclasses import dataclass

from scenewright.stages.tableware.world.items import STANDARD, DishSizes, Item, Kind, Measures, Table


@dataclass(frozen=True)
class Detection:
    """One item that was seen, or that the height of a stack says must be there. World frame [m, rad]."""

    kind: Kind | None
    """None for something that is no tableware of known size."""
    position: tuple[float, float, float]
    """Foot centre of a dish, middle of the underside of a utensil."""
    yaw: float = 0.0
    """Of a utensil, from the handle's end to the head, -pi to pi."""
    lip: float = 0.0
    """Height of the upper edge above the table."""
    on: int | None = None
    """Index of the detection that carries it, None for the table."""
    hidden: bool = False
    """Whether it was inferred from the height of the stack alone."""
    grasp: tuple[float, float, float] | None = None
    """Of a utensil: the highest point along its axis."""
    extent: float = 0.0
    """Of an unknown thing: radius of the circle around it."""
    size: Measures | None = None
    """Where it was estimated; else the size is that of the kind."""
    confidence: float = 1.0
    unsure: tuple[str, ...] = ()
    """Reasons for doubt; empty when there is none."""


def as_table(detections: tuple[Detection, ...], sizes: DishSizes = STANDARD) -> Table:
    """Return the table that detections describe, of `sizes` where none was estimated; things that are no
    tableware are left out."""
    names = {
        index: f"{detection.kind}_{index + 1}"
        for index, detection in enumerate(detections)
        if detection.kind is not None
    }
    return Table(
        tuple(
            Item(
                names[index],
                detection.kind,
                detection.position,
                detection.yaw,
                None if detection.on is None else names[detection.on],
                detection.size or sizes[detection.kind],
            )
            for index, detection in enumerate(detections)
            if detection.kind is not None
        )
    )


def statement(detections: tuple[Detection, ...]) -> str:
    """Return in one line what is on the table and what is in doubt; an empty table is a statement too."""
    count = sum(detection.kind is not None for detection in detections)
    unknown = len(detections) - count
    doubts = sorted({reason for detection in detections for reason in detection.unsure})
    if not detections:
        return "the table is empty: there is nothing to clear"
    text = f"{count} item{'s' * (count != 1)} of tableware"
    text += f", {unknown} thing{'s' * (unknown != 1)} of unknown kind" if unknown else ""
    return text + (f"; unsure: {', '.join(doubts)}" if doubts else "")
