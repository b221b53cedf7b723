"""Tasks that are true: goals of the true room, carried to a reconstruction, judged by the true room's end."""

from benchmarks.board.tasks.measuring import ROOMS, measure_room

__all__ = ["ROOMS", "measure_room"]
