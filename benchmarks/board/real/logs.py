"""The real logs that the project keeps at hand (../shared/data), and where a log's frames and world come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

ANNOTATIONS = Path(__file__).resolve().parents[3] / "data" / "annotations" / "real"
ANNOTATED = tuple(sorted(path.stem for path in ANNOTATIONS.glob("*.json")))
"""Names of the logs whose things and supports were annotated by eye."""
OUTLINES = ANNOTATIONS / "painted"
"""Where outlines of those things lie, for the logs in whose frames somebody painted them."""


@dataclass(frozen=True)
class Log:
    """A log as `ingest` is told to read it."""

    name: str
    path: Path
    """File or folder; of the logs below it is within the data folder."""
    every: int = 1
    """Every how many-th frame is used."""
    start: int = 0
    """The first frame that is used."""
    settings: Mapping[str, bool | float | str] = field(default_factory=dict)
    """Further options of `ingest`, as a config file has them."""

    @property
    def words(self) -> tuple[str, ...]:
        """What `ingest` is told."""
        own = ("--log", str(self.path), "--every", str(self.every), "--start", str(self.start))
        return (*own, *(_word(name, value) for name, value in self.settings.items()))

    def within(self, data: Path) -> Log:
        """The log with its path below the data folder."""
        return replace(self, path=data / self.path)

    def halves(self) -> tuple[Log, Log]:
        """The log of the even and that of the odd ones of the frames that are used."""
        even = replace(self, name=f"{self.name}_even", every=2 * self.every)
        return even, replace(even, name=f"{self.name}_odd", start=self.start + self.every)


LOGS = {
    log.name: log
    for log in (
        Log("kitchen", Path("7scenes_redkitchen"), 4),
        Log("livingroom", Path("redwood_livingroom1"), 2),
        Log(
            "diningroom",
            Path("slambook2_rgbd/diningroom"),
            settings={"fx": 518.0, "fy": 519.0, "cx": 325.5, "cy": 253.5},
        ),
        Log("office", Path("hololens_office"), 2),
    )
}
"""Kitchen (Kinect; a table with four chairs, two cups, cabinets), living room (rendered pictures; an armchair, a
chest), dining room (five frames; a long table with chairs, nothing annotated), office (head-worn; tables, plants)."""


def _word(name: str, value: bool | float | str) -> str:
    """Return the word of a command line that says an option."""
    option = name.replace("_", "-")
    if isinstance(value, bool):
        return f"--{option}" if value else f"--no-{option}"
    return f"--{option}={value}"
