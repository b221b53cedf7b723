"""What the words for fragments mean, by shape. Planning towards words and judging what came of it ask here.

A thing has three directions, at right angles: the long one, the wide one and the thin one. The edges of a fragment are
those of the smallest box around it, however it lies.

- slices: cut across the long direction alone, each all that there is of the thing between two planes, and at most 1.5
  times as thick along it as the thing is thin; of a flat thing (a disc, a slab: at least twice as wide as thin) no
  thicker than it is thin, as what is thicker lies there like a strip; all as thick.
- strips: never cut across the long direction (of the part of the thing that is made strips), and at least twice as long
  as wide; all as large.
- cubes: the longest edge at most 1.5 times the shortest; all as large.
- chunks: the longest edge at most 4 times the shortest; all as large.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from scenewright.schemas.cutting_demonstrations import CategoryName
from scenewright.schemas.cutting_plan import WordMet
from scenewright.stages.cutting.demonstrations.recipes import LONG, THIN, WIDE
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from
from scipy.optimize import linear_sum_assignment

NARROW = 2.0
"""Length over width that makes a strip, and width over thickness that makes a thing flat."""
CUBE, CHUNK = 1.5, 4.0
"""Most of the longest edge over the shortest. A block twice as long as thick is two cubes. Halves and quarters of foods
are demonstrated as chunks, and are up to four times as long as thick."""
SLICE = 1.5
"""Most of a slice's thickness over the thing's thin edge: that of a cube. Fifths of a long carrot are demonstrated as
slices."""
EVEN = 2.0
"""The largest fragment over the smallest, beyond which fragments of one word are not alike: it could be halved."""
ALIKE = 1.1
"""Variance along one principal axis over that along the next, below which all three are those of a ball or a cube."""
MET = 1.0 + 1e-3
"""Misfit up to which a fragment is what a word says: cuts are as exact as numbers are."""
WHOLE = 0.8
"""Share that a fragment has to hold of what the thing holds within the fragment's planes. Halved, it holds 0.5."""


@dataclass(frozen=True)
class Meaning:
    """A word."""

    across: tuple[int, ...]
    """Directions of the thing that the knife may cut across."""
    ratio: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
    """Of edges (..., 3) [m], shortest first, the length (...) along the thing's long direction, the thing's edges."""
    bound: float
    """The greatest ratio of what is meant."""
    bound_of_flat: float
    """The same of a flat thing."""
    said: str
    """What a ratio says."""
    uncut: str = ""
    """What a fragment does that is only cut across these directions."""
    by_thickness: bool = False
    """Alike is as thick, else as large."""

    def misfit(self, edges: np.ndarray, length: np.ndarray, thing: np.ndarray) -> np.ndarray:
        """Return 1 or less for what is meant (...); takes what `ratio` takes."""
        return self.ratio(edges, length, thing) / self.most(thing)

    def most(self, thing: np.ndarray) -> np.ndarray:
        """Return the greatest ratio of what is meant (...), of things with such edges (3, ...) [m]."""
        return np.where(thing[WIDE] >= NARROW * thing[THIN], self.bound_of_flat, self.bound)


def _blunt(edges: np.ndarray, length: np.ndarray, thing: np.ndarray) -> np.ndarray:
    return np.asarray(edges[..., 2] / edges[..., 0])


def _thick(edges: np.ndarray, length: np.ndarray, thing: np.ndarray) -> np.ndarray:
    return np.asarray(length / thing[THIN])


def _stout(edges: np.ndarray, length: np.ndarray, thing: np.ndarray) -> np.ndarray:
    return np.asarray(edges[..., 1] / edges[..., 2])


MEANINGS: dict[CategoryName, Meaning] = {
    "chunks": Meaning((LONG, WIDE, THIN), _blunt, CHUNK, CHUNK, "as long as thick"),
    "slices": Meaning(
        (LONG,), _thick, SLICE, 1.0, "as thick as the thing is thin", "span the whole cross section", True
    ),
    "strips": Meaning((WIDE, THIN), _stout, 1.0 / NARROW, 1.0 / NARROW, "as wide as long", "run the whole length"),
    "cubes": Meaning((LONG, WIDE, THIN), _blunt, CUBE, CUBE, "as long as thick"),
}


@dataclass(frozen=True)
class Thing:
    """What is cut, and its directions."""

    body: Body
    first_from_axes: np.ndarray
    """(4, 4), thin, wide, long along x, y, z; `first` is where the body lay when it was made."""

    @staticmethod
    def of(body: Body) -> Thing:
        """Return the thing that a body is."""
        first = body.moved(inverse(body.world_from_first))
        return Thing(first, transform_from(_directions(first), first.moments[0]))

    def bounds(self, fragment: Body) -> np.ndarray:
        """Return the low and high corner (2, 3) [m] of a fragment of this thing, along its directions."""
        first_from_world = inverse(fragment.world_from_first)
        points = apply(inverse(self.first_from_axes) @ first_from_world, fragment.vertices)
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @cached_property
    def size(self) -> np.ndarray:
        """Thickness, width and length (3,) [m]."""
        low, high = self.bounds(self.body)
        return np.asarray(high - low)

    def edges(self, fragment: Body) -> np.ndarray:
        """Return the edges of the smallest box around a fragment, shortest first, and its length along the long
        direction (4,) [m]."""
        low, high = self.bounds(fragment)
        return np.append(np.sort(trimesh.bounds.oriented_bounds(fragment.vertices)[1]), high[LONG] - low[LONG])

    def share(self, fragment: Body, across: Sequence[int], part: tuple[float, float]) -> float:
        """Return how much of what lies between the planes that bound a fragment along directions is in it; of a part of
        the thing, from one share of its length to another."""
        box = self.bounds(self.body)
        box[:, LONG] = box[0, LONG] + np.array(part) * self.size[LONG]
        box += np.array([[-1e-6], [1e-6]])
        box[:, list(across)] = self.bounds(fragment)[:, list(across)]
        return fragment.volume / max(self.body.within(self.first_from_axes, *box), 1e-15)


def _directions(body: Body) -> np.ndarray:
    """Return the thin, wide and long direction of a body in the columns (3, 3), right-handed.

    The principal axis that is most its own is one of them, and the smallest rectangle across it gives the others: a
    cone's smallest box leans, and a bar's principal axes across may lie along its diagonals.
    """
    variances, principal = np.linalg.eigh(body.moments[1])
    apart = variances[1:] / variances[:-1]
    if apart.max() < ALIKE:
        box_from_world, _ = trimesh.bounds.oriented_bounds(body.vertices)
        axes = box_from_world[:3, :3].T
    else:
        own, others = (LONG, [THIN, WIDE]) if apart[1] >= apart[0] else (THIN, [WIDE, LONG])
        rectangle_from_flat, _ = trimesh.bounds.oriented_bounds_2D(body.vertices @ principal[:, others])
        axes = np.column_stack([principal[:, others] @ rectangle_from_flat[:2, :2].T, principal[:, own]])
    axes = axes[:, np.argsort(np.ptp(body.vertices @ axes, axis=0), kind="stable")]
    if np.linalg.det(axes) < 0:
        axes[:, THIN] *= -1.0
    return np.asarray(axes)


@dataclass(frozen=True)
class Made:
    """A fragment, and the number of the thing that it was cut from."""

    body: Body
    thing: int


Parts = Mapping[CategoryName, tuple[float, float]]
"""From where to where along the length of a thing the fragments of a word lie, as shares; all along where it is not."""


def judge(
    things: Sequence[Thing],
    fragments: Sequence[Made],
    wanted: Sequence[tuple[CategoryName, float]],
    parts: Sequence[Parts],
) -> tuple[WordMet, ...]:
    """Return how well fragments are what was wanted: words with volumes [m^3], one each, in parts of each thing.

    Each fragment is taken for one that is wanted, so that as many as can be are what the word says; where several
    could be, for that of the likest volume.
    """
    edges = np.array([things[made.thing].edges(made.body) for made in fragments])
    names = list(dict.fromkeys(name for name, _ in wanted))
    misfits = {name: _misfits(things, fragments, edges, name, parts) for name in names}
    off = np.abs(np.log(np.divide.outer([made.body.volume for made in fragments], [volume for _, volume in wanted])))
    fits = np.stack([misfits[name][0] for name, _ in wanted], axis=1)
    rows, columns = linear_sum_assignment(~fits + 0.01 * np.minimum(off, 1.0))
    met = []
    for name in names:
        taken = [int(row) for row, column in zip(rows, columns, strict=True) if wanted[column][0] == name]
        number = sum(word == name for word, _ in wanted)
        met.append(_met(name, number, taken, things, fragments, edges, *misfits[name]))
    return tuple(met)


def _misfits(
    things: Sequence[Thing], fragments: Sequence[Made], edges: np.ndarray, name: CategoryName, parts: Sequence[Parts]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return whether each fragment (N,) is what a word says, its misfit, and whether it is cut as the word says."""
    meaning = MEANINGS[name]
    sizes = np.array([things[made.thing].size for made in fragments])
    misfit = meaning.misfit(edges[:, :3], edges[:, 3], sizes.T)
    whole = np.ones(len(fragments), dtype=bool)
    if len(meaning.across) < 3:
        shares = [
            things[made.thing].share(made.body, meaning.across, parts[made.thing].get(name, (0.0, 1.0)))
            for made in fragments
        ]
        whole = np.array(shares) > WHOLE
    return (misfit <= MET) & whole, misfit, whole


def _met(
    name: CategoryName,
    wanted: int,
    taken: Sequence[int],
    things: Sequence[Thing],
    fragments: Sequence[Made],
    edges: np.ndarray,
    fits: np.ndarray,
    misfit: np.ndarray,
    whole: np.ndarray,
) -> WordMet:
    meaning = MEANINGS[name]
    evenness = 1.0
    for thing in {fragments[k].thing for k in taken}:
        sizes = [
            edges[k, 3] if meaning.by_thickness else fragments[k].body.volume
            for k in taken
            if fragments[k].thing == thing
        ]
        evenness = max(evenness, max(sizes) / min(sizes))
    count = int(fits[list(taken)].sum())
    said = f"{count} of {wanted} are {name}"
    if taken and misfit[worst := max(taken, key=lambda k: misfit[k])] > MET:
        most = float(meaning.most(things[fragments[worst].thing].size))
        said += f": the worst is {misfit[worst] * most:.3g} times {meaning.said}, at most {most:g}"
    if cut_otherwise := sum(not whole[k] for k in taken):
        said += f": {cut_otherwise} do not {meaning.uncut}"
    kind = ("thickest", "thinnest") if meaning.by_thickness else ("largest", "smallest")
    said += f"; the {kind[0]} is {evenness:.2f} times the {kind[1]}"
    if evenness > EVEN:
        said += f", at most {EVEN:g} is even"
    return WordMet(name=name, wanted=wanted, made=count, evenness=float(evenness), said=said)


def is_met(words: Sequence[WordMet]) -> bool:
    """Whether every fragment is what its word says, and those of a word are alike."""
    return all(word.made == word.wanted and word.evenness <= EVEN for word in words)
