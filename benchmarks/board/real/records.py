"""What is kept of a log: counts, so that logs can be pooled, and plain values, so that a line of JSON holds them."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Tally:
    """How many of the true things of one size are found."""

    true: int = 0
    found: int = 0
    """One entity of the map is the thing, in one piece."""
    named: int = 0
    """Found, and of the right class."""
    stand: int = 0
    """Found, and what stands for it in the scene is where it stood."""
    off_mm: tuple[float, ...] = ()
    """How far what stands for each found thing is off [mm], where anything does."""

    def __add__(self, other: Tally) -> Tally:
        """Pool with another room's."""
        return Tally(
            self.true + other.true,
            self.found + other.found,
            self.named + other.named,
            self.stand + other.stand,
            self.off_mm + other.off_mm,
        )


@dataclass(frozen=True)
class Edges:
    """What carries what: edges to parents, whatever the relation is called."""

    true: int = 0
    predicted: int = 0
    agreed: int = 0

    def __add__(self, other: Edges) -> Edges:
        """Pool with another room's."""
        return Edges(self.true + other.true, self.predicted + other.predicted, self.agreed + other.agreed)

    @property
    def f1(self) -> float | None:
        """F1, 0..1; None where there is no edge at all."""
        total = self.true + self.predicted
        return 2 * self.agreed / total if total else None


@dataclass(frozen=True)
class Things:
    """A map and its scene against the true things that the camera saw."""

    large: Tally = Tally()
    small: Tally = Tally()
    false: int = 0
    """Entities where the truth knows what is there, that are no true thing or a further piece of one."""

    def __add__(self, other: Things) -> Things:
        """Pool with another room's."""
        return Things(self.large + other.large, self.small + other.small, self.false + other.false)


@dataclass(frozen=True)
class Settling:
    """What became of the scene when it was let go."""

    movable: int
    stay: int
    joints: int
    blocked: int
    collisions: int
    """Pairs of bodies that lie more than 5 mm in each other."""


@dataclass(frozen=True)
class AnnotatedRecord:
    """A recorded log against what was annotated by eye."""

    log: str
    annotated: bool
    """False: nobody did; then settling and seconds alone are known."""
    things: Things = Things()
    """`off_mm` is the median distance of what was seen of a thing to the surface of what stands for it."""
    supports: Edges = Edges()
    settling: Settling | None = None
    """None where there is no scene."""
    frames: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    """Command -> processor seconds."""
    failed: str = ""
    """What stopped the chain; empty where it went through."""


@dataclass(frozen=True)
class Half:
    """One of the two scenes of a log."""

    frames: int = 0
    things: int = 0
    surface: int = 0
    """Cubes of a centimetre in which the frames show surface."""
    by_things: int = 0
    by_layout: int = 0
    """Those of them that a thing of the map explains, or floor, walls, ceiling, doors, windows and curtains."""


@dataclass(frozen=True)
class HalvesRecord:
    """The scene of a log's even frames beside that of its odd ones; which is right is not known."""

    log: str
    even: Half = Half()
    odd: Half = Half()
    matched: int = 0
    """Things of one that are a thing of the other."""
    apart_m: tuple[float, ...] = ()
    """Between the middles of each matched pair [m]."""
    same_parent: int = 0
    """Pairs with the same parent, by match (layout by class), in the same relation."""
    with_name: int = 0
    """Pairs of which at least one has a name."""
    same_class: int = 0
    """Of those."""
    with_model: int = 0
    """Pairs of which at least one has a model of the library."""
    same_model: int = 0
    """Of those."""
    seconds: dict[str, float] = field(default_factory=dict)
    """Command -> processor seconds of both."""
    failed: str = ""


@dataclass(frozen=True)
class TruthRecord:
    """A log against a truth in the form of docs/DATA.md."""

    log: str
    things: Things = Things()
    """`off_mm` lies between the middles of a thing and of what stands for it."""
    supports: Edges = Edges()
    unseen: int = 0
    """True things that the camera hardly saw; they count neither way."""
    unknown_words: tuple[str, ...] = ()
    """Words that are no class: things that cannot be named right."""
    frames: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    failed: str = ""
