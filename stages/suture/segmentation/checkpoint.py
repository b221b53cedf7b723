"""The network's checkpoint: numbers as safetensors with what is needed to read them; nothing in it is executed."""

from __future__ import annotations

import json
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.places import data_file
from scenewright.stages.kit.formats.network_file import put_tensors, write_network
from scenewright.stages.kit.formats.safetensors_file import read_safetensors
from scenewright.stages.suture.segmentation.model import CLASSES, SutureNetwork

FORMAT = "scenewright suture segmentation"
VERSION = "1"
BUNDLED = data_file("stitch/segmentation.safetensors")
_OTHER = "give a checkpoint that `make stitch-train` wrote"


def save_network(path: Path, network: SutureNetwork, description: str) -> None:
    """Write the network, its numbers as float16; counters of the batch normalisation are left out."""
    metadata = {
        "format": FORMAT,
        "version": VERSION,
        "classes": json.dumps(list(CLASSES)),
        "widths": json.dumps(list(network.widths)),
        "description": description,
    }
    write_network(path, network, metadata)


def load_network(path: Path) -> tuple[SutureNetwork, str]:
    """Return the network, ready for use, and its description. Raises BadInput for a damaged file, another version or
    other classes, and for tensors that do not fit the network that the file describes."""
    tensors, metadata = read_safetensors(path)
    if metadata.get("format") != FORMAT:
        raise BadInput(f"{path}: no checkpoint of the needle and thread network", hint=_OTHER)
    if metadata.get("version") != VERSION or metadata.get("classes") != json.dumps(list(CLASSES)):
        raise BadInput(
            f"{path}: version {metadata.get('version')!r} with the classes {metadata.get('classes')}; this code reads "
            f"version {VERSION!r} with {json.dumps(list(CLASSES))}",
            hint=_OTHER,
        )
    network = SutureNetwork(_widths(path, metadata))
    put_tensors(network, tensors, str(path), _OTHER)
    return network, metadata.get("description", "")


def _widths(path: Path, metadata: dict[str, str]) -> tuple[int, ...]:
    """Return the channels, of which none may be absurd: a header must not ask for more memory than there is."""
    try:
        widths = json.loads(metadata.get("widths", "null"))
    except (ValueError, RecursionError):
        widths = None
    fits = isinstance(widths, list) and len(widths) == 5
    if not fits or not all(type(width) is int and 1 <= width <= 512 for width in widths):
        raise BadInput(f"{path}: its metadata does not describe a network of this kind", hint=_OTHER)
    return tuple(widths)
