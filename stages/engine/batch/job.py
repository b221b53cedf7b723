"""One scene of a batch, ready to run: a value that travels to any executor as JSON."""

from __future__ import annotations

from scenewright.schemas.base import Count, Model, Seed


class Job(Model):
    """One run of the pipeline. All paths are absolute, on storage that every worker sees at the same place."""

    name: str
    """`<scene>[/<parameters>][/seed-<n>]`, also the run folder inside the batch folder."""
    scene: str
    parameters: str | None = None
    seed: Seed | None = None
    folder: str
    command: tuple[str, ...]
    """What runs the scene: argument words, no shell. Standard error goes into the scene's log."""
    steps: tuple[str, ...]
    """Names of the pipeline's steps in order, which are the artifact folders of the run."""
    fingerprint: str
    """sha256 over all that is known to decide the result before running; see fingerprints.py."""
    environment: dict[str, str] = {}
    """Set for the scene where the user's environment does not set it."""
    time_limit: float | None = None
    """Wall clock [s]."""
    memory_limit: Count | None = None
    """Resident memory of all its processes together [bytes]."""
    address_space: Count | None = None
    """RLIMIT_AS of each of its processes [bytes]."""
    storage: str | None = None
    """URL of the folder that gets its artifacts when it has ended (storage.py)."""
    storage_timeout: float = 60.0
    """[s]"""
    keep: bool = True
    """Whether its artifacts stay in `folder` too."""
    grace: float = 10.0
    """Between SIGTERM and SIGKILL [s]."""
