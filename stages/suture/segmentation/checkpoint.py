"""The network's checkpoint: numbers as safetensors with what is needed to read them; nothing in it is executed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch

from schemas.errors import BadInput
from stages.kit.formats.safetensors_file import read_safetensors, write_safetensors
from stages.suture.segmentation.model import CLASSES, SutureNetwork

FORMAT = "scenewright suture segmentation"
VERSION = "1"
BUNDLED = Path(__file__).resolve().parents[3] / "data" / "stitch" / "segmentation.safetensors"
_OTHER = "give a checkpoint that `make stitch-train` wrote"


def save_network(path: Path, network: SutureNetwork, description: str) -> None:
    """Write the network, its numbers as float16; counters of the batch normalisation are left out."""
    tensors = {
        name: tensor.detach().to(torch.float16).contiguous().numpy()
        for name, tensor in network.state_dict().items()
        if tensor.is_floating_point()
    }
    metadata = {
        "format": FORMAT,
        "version": VERSION,
        "classes": json.dumps(list(CLASSES)),
        "widths": json.dumps(list(network.widths)),
        "description": description,
    }
    write_safetensors(path, tensors, metadata)


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
    state = network.state_dict()
    wanted = {name: tuple(tensor.shape) for name, tensor in state.items() if tensor.is_floating_point()}
    for name in sorted(wanted.keys() | tensors.keys()):
        there = tensors[name].shape if name in tensors else None
        if there != wanted.get(name):
            raise BadInput(
                f"{path}: tensor {name!r} has shape {there}, the network needs {wanted.get(name)}", hint=_OTHER
            )
        if not np.isfinite(tensors[name]).all():
            raise BadInput(f"{path}: tensor {name!r} holds numbers that are not finite", hint=_OTHER)
        state[name] = torch.from_numpy(tensors[name].astype(np.float32))
    network.load_state_dict(state)
    return network.eval(), metadata.get("description", "")


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
