"""Writes the samples of every harness into the corpus: python -m tests.fuzz.make_corpus [HARNESS...].

What fuzzers found (`crash-*`) lies beside them and stays.
"""

from __future__ import annotations

import re
import sys

from tests.fuzz.harness import CORPUS
from tests.fuzz.registry import NAMES, load


def main() -> None:
    """Write the seeds."""
    for name in sys.argv[1:] or NAMES:
        folder = CORPUS / name
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("seed-*"):
            old.unlink()
        for label, data in load(name).seeds().items():
            (folder / ("seed-" + re.sub(r"[^A-Za-z0-9.]+", "-", label))).write_bytes(data)
        sizes = [path.stat().st_size for path in folder.iterdir()]
        print(f"{name:22} {len(sizes):3} files, {sum(sizes)} bytes")


if __name__ == "__main__":
    main()
