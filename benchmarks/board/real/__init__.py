"""Real logs on the board: annotated ones, halves of any log that must agree, logs with a truth that others bring."""

from benchmarks.board.real.logs import ANNOTATED, ANNOTATIONS, LOGS

__all__ = ["ANNOTATED", "ANNOTATIONS", "LOGS"]
