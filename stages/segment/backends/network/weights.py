"""The checkpoint of the network: numbers as safetensors, and in its metadata what is needed to read them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.schemas.places import data_file
from scenewright.schemas.vocabulary import Vocabulary
from scenewright.stages.kit.formats.network_file import put_tensors, write_network
from scenewright.stages.kit.formats.safetensors_file import read_safetensors
from scenewright.stages.segment.backends.network.features import CHANNELS, INPUT_WIDTH
from scenewright.stages.segment.backends.network.model import PanopticNetwork, Widths

FORMAT = "scenewright panoptic network"
VERSION = 1
"""Version of the layout of a checkpoint; others are refused."""
BUNDLED = data_file("networks/panoptic.safetensors")
"""The checkpoint that comes with the project."""
_OTHER = "give a checkpoint that `make train-network` wrote, or leave --weights out"


@dataclass(frozen=True)
class Checkpoint:
    """A network with what it names."""

    network: PanopticNetwork
    classes: tuple[str, ...]
    """Name of every class that it tells apart, in the order of its logits."""
    description: str


def save_checkpoint(
    path: Path, network: PanopticNetwork, classes: tuple[str, ...], widths: Widths, description: str
) -> None:
    """Write the network with its numbers as float16; counters of the batch normalisation are left out."""
    metadata = {
        "format": FORMAT,
        "version": str(VERSION),
        "classes": json.dumps(list(classes)),
        "channels": json.dumps(list(CHANNELS)),
        "input_width": str(INPUT_WIDTH),
        "widths": json.dumps(asdict(widths)),
        "description": description,
    }
    write_network(path, network, metadata)


def load_checkpoint(path: Path, vocabulary: Vocabulary) -> Checkpoint:
    """Read a checkpoint. Raises BadInput for a damaged file, another version, other inputs, an unknown class, or
    tensors that do not fit the network that the file describes."""
    tensors, metadata = read_safetensors(path)
    if metadata.get("format") != FORMAT:
        raise BadInput(f"{path}: no checkpoint of the panoptic network", hint=_OTHER)
    if metadata.get("version") != str(VERSION):
        raise BadInput(
            f"{path}: checkpoint version {metadata.get('version')!r}, this code reads {VERSION}", hint=_OTHER
        )
    if _text_list(path, metadata, "channels") != list(CHANNELS) or metadata.get("input_width") != str(INPUT_WIDTH):
        raise BadInput(f"{path}: trained for other inputs than this code makes", hint=_OTHER)
    classes = tuple(_text_list(path, metadata, "classes"))
    class_names = {entry.name for entry in vocabulary.classes}
    unknown = [name for name in classes if name not in class_names]
    if unknown or not classes or len(set(classes)) != len(classes):
        reason = (
            f"class {unknown[0]!r} is not in the vocabulary" if unknown else "its list of classes is empty or repeats"
        )
        raise BadInput(f"{path}: {reason}", hint=_OTHER)
    network = PanopticNetwork(len(CHANNELS), len(classes), _widths(path, metadata))
    put_tensors(network, tensors, str(path), _OTHER)
    return Checkpoint(network, classes, metadata.get("description", ""))


def _text_list(path: Path, metadata: dict[str, str], key: str) -> list[str]:
    try:
        value: Any = json.loads(metadata.get(key, "null"))
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
        raise BadInput(f"{path}: its metadata has no list of {key}", hint=_OTHER)
    return value


def _widths(path: Path, metadata: dict[str, str]) -> Widths:
    """Return the network's widths, of which none may be absurd: a header must not ask for more memory than there is."""
    try:
        value = json.loads(metadata.get("widths", "null"))
        widths = Widths(tuple(value["encoder"]), tuple(value["decoder"]), value["blocks"])
        numbers = (*widths.encoder, *widths.decoder, widths.blocks)
        in_range = all(type(number) is int and 1 <= number <= 1024 for number in numbers) and widths.blocks <= 8
        if len(widths.encoder) == 5 and len(widths.decoder) == 4 and in_range:
            return widths
    except (ValueError, TypeError, KeyError, RecursionError):
        pass
    raise BadInput(f"{path}: its metadata does not describe a network of this kind", hint=_OTHER)
