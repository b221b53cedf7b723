"""What a model may grow to while it is read, and how a geometry library's refusal is told.

Every bound is on what a file expands to, not on what it says: a few kilobytes name gigabytes by repeating themselves.
The bounds together keep `library add` below 2 GB, and its work linear in what it reads.
"""

from __future__ import annotations

import csv
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.plain_text import cleaned
from scenewright.stages.library.importing.source_model import Surface
from scipy.spatial import QhullError
from shapely.errors import ShapelyError

MOST_TRIANGLES = 1_000_000
"""Most triangles of a model, repeated meshes counted each time, and of a mesh file."""
MOST_VERTICES = 3 * MOST_TRIANGLES
"""Most vertices of a model: as many as triangles without shared corners have."""
MOST_SHAPES = 20_000
"""Boxes, meshes and groups of meshes of a model."""
MOST_TRIANGLES_OF_A_FILE = 5 * MOST_TRIANGLES
"""Most triangles of all models that one description holds."""
MOST_LINKS = 2_000
"""Most links (bodies) of a model; 500 of them may move."""
MOST_LINKS_OF_A_FILE = 5 * MOST_LINKS
"""Most links of all models that one description holds."""
MOST_FINDINGS = 40
"""Most findings that are kept of one model."""
LONGEST_TEXT = 300
"""Longest name or finding [characters]."""
SIMPLIFY = f"simplify it to at most {MOST_TRIANGLES} triangles and {MOST_SHAPES} shapes, or split it"
MEND = "correct that in the file, or leave it out"
REFUSALS = (*(ArithmeticError, RecursionError, ValueError, ShapelyError), *(cv2.error, csv.Error, struct.error))
"""What geometry libraries and parsers raise for numbers that they cannot take (LinAlgError and UnicodeError are
ValueErrors). IndexError, KeyError, TypeError are not among them: those are bugs of ours."""


@contextmanager
def told_refusals(where: str) -> Iterator[None]:
    """Turn what a library raises for a model into BadInput, beginning with `where`; numpy warns of nothing in it."""
    try:
        with np.errstate(all="ignore"):
            yield
    except BadInput as error:
        if error.hint:
            raise
        raise BadInput(error.message, hint=MEND) from error
    except QhullError as error:
        raise BadInput(f"{where}: a shape has no volume: it is flat, or a line", hint=MEND) from error
    except REFUSALS as error:
        reason = (str(error).strip().splitlines() or [""])[0]
        raise BadInput(
            f"{where}: its geometry cannot be used: {type(error).__name__}: {reason:.120}", hint=MEND
        ) from error


class Allowance:
    """Counts what a description expands to, and refuses what is beyond its bounds."""

    def __init__(
        self, where: str, *, triangles: int = MOST_TRIANGLES, vertices: int = MOST_VERTICES, shapes: int = MOST_SHAPES
    ) -> None:
        self._where, self._bounds = where, (triangles, vertices, shapes)
        self._remaining = list(self._bounds)

    def take(self, surfaces: Sequence[Surface]) -> None:
        """Count surfaces. Raises BadInput."""
        for surface in surfaces:
            self.take_counts(len(surface.faces), len(surface.vertices))

    def take_counts(self, triangles: int, vertices: int, shapes: int = 1) -> None:
        """Count triangles and vertices of shapes before they are made. Raises BadInput."""
        for k, count in enumerate((triangles, vertices, shapes)):
            self._remaining[k] -= count
            if self._remaining[k] < 0:
                counted = ("triangles", "vertices", "shapes")[k]
                raise BadInput(f"{self._where}: more than {self._bounds[k]} {counted} in all", hint=SIMPLIFY)


def refuse_many(where: str, things: str, count: int, most: int) -> None:
    """Raise BadInput for more things than a description may hold, before any of them is read."""
    if count > most:
        raise BadInput(f"{where}: {count} {things}, more than {most}", hint="split it, or weld what does not move")


def plain_text(text: str, longest: int = LONGEST_TEXT) -> str:
    """Return a name or a reason fit for a table and for JSON: control characters, and halves of them, written out."""
    text = text if len(text) <= longest else f"{text[:longest]}..."
    return cleaned(" ".join(text.split()))


def one_color(what: str, name: str) -> str:
    """Return the finding for a picture that a description puts on shapes, and that is not looked at."""
    return f"{what} {name!r:.60} is not read: what it covers has one colour"


def few_findings(findings: Sequence[str]) -> tuple[str, ...]:
    """Return the findings without repetitions, at most MOST_FINDINGS of them and how many more there are."""
    distinct = tuple(dict.fromkeys(findings))
    if len(distinct) <= MOST_FINDINGS:
        return distinct
    return (*distinct[:MOST_FINDINGS], f"and {len(distinct) - MOST_FINDINGS} more")
