"""A batch in a process of its own, for tests that kill it: `python -m tests.pipeline.batch_process SPEC OUT JOBS`."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

from scenewright.stages.engine.batch.expansion import read_batch
from scenewright.stages.engine.batch.session import run_batch

from tests.unit.batch.batches import program_command


def main() -> None:
    """Run the batch with scene_program.py in place of scenewright."""

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    try:
        end = run_batch(
            read_batch(Path(sys.argv[1])),
            Path(sys.argv[2]),
            jobs=int(sys.argv[3]),
            say=lambda text: print(text, file=sys.stderr, flush=True),
            command=program_command,
        )
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(end.exit_code)


if __name__ == "__main__":
    main()
