"""Stands for `scenewright run`: behaves as the scene's log file says, and writes an artifact when it ends well.

    python scene_program.py FOLDER LOG SEED

The log file holds one word and perhaps a number: `write`, `sleep 5`, `exit 3`, `unsaid 6` (exits without a reason),
`outcome`, `signal 11`, `allocate 200` (MiB), `stubborn 30` (does not heed SIGTERM), `family 30` (a child that outlives
its parent), `noise`, `fail-once`, `loaded` (writes whether a library was there before it was asked for).
"""

import hashlib
import importlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path


def write_artifact(folder: Path, text: str, outcome: str = "ok") -> None:
    """Write a small artifact of one file, with a manifest as steps write it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "data.txt").write_text(text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    manifest = {
        "kind": "sequence",
        "schema_version": 2,
        "stage": "ingest",
        "key": "k",
        "content_digest": digest,
        "files": [{"path": "data.txt", "bytes": len(text.encode()), "sha256": digest}],
        "outcome": outcome,
        "summary": {"frames": len(text)},
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))


def main() -> None:
    """Do as the log says."""
    folder, log, seed = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
    with open(folder / "runs.txt", "a") as file:
        file.write(f"{os.environ.get('OMP_NUM_THREADS', '-')}\n")
    print("[1/1] sequence", file=sys.stderr, flush=True)
    word, _, number = log.read_text().strip().partition(" ")
    if word == "sleep":
        time.sleep(float(number))
    elif word == "exit":
        print("error: ingest: room 7: 3 of 120 frames", file=sys.stderr)
        sys.exit(int(number))
    elif word == "unsaid":
        sys.exit(int(number))
    elif word == "outcome":
        write_artifact(folder / "sequence", "nothing", "empty")
        print("error: ingest: outcome is 'empty': nothing there (--accept empty goes on)", file=sys.stderr)
        sys.exit(4)
    elif word == "signal":
        os.kill(os.getpid(), int(number))
    elif word == "allocate":
        block = bytearray(int(number) * 2**20)
        block[::4096] = b"x" * len(block[::4096])
        time.sleep(30)
    elif word == "stubborn":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        time.sleep(float(number))
    elif word == "family":
        child = subprocess.Popen([sys.executable, "-c", f"import time; time.sleep({number})"])
        (folder / "child.txt").write_text(str(child.pid))
        sys.exit(0)
    elif word == "noise":
        sys.stdout.write("standard output\n")
        sys.stderr.buffer.write(b"\xff\x00 binary \x1b[31m\n" + b"x" * 200_000 + b"\n")
        sys.exit(1)
    elif word == "loaded":
        word = f"loaded {'xml.dom.minidom' in sys.modules}"
        importlib.import_module("xml.dom.minidom")
    elif word == "fail-once" and not (folder / "once.txt").exists():
        (folder / "once.txt").write_text("")
        sys.exit(1)
    write_artifact(folder / "sequence", f"{word} {seed}")


main()
