"""Tables as artifacts hold them."""

from __future__ import annotations

from collections.abc import Iterable

from scenewright.schemas.tableware_scene import TablewareItem
from scenewright.stages.tableware.world.items import STANDARD, DishSizes, Item, Table


def as_records(table: Table) -> tuple[TablewareItem, ...]:
    """Return the items of a table for JSON."""
    return tuple(
        TablewareItem(name=item.name, kind=item.kind, position=item.position, yaw=item.yaw, on=item.on)
        for item in table.items
    )


def as_table(records: Iterable[TablewareItem], sizes: DishSizes = STANDARD) -> Table:
    """Return the table of an artifact, whose things measure what `sizes` say of their kinds."""
    return Table(
        tuple(Item(item.name, item.kind, item.position, item.yaw, item.on, sizes[item.kind]) for item in records)
    )
