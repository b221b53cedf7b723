"""The sizes of a RAFT-Stereo network: the published ones by default, else as a checkpoint's tensors say."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.schemas.errors import BadInput

OTHER_FILE = "give one of the authors' raftstereo-*.pth, or the .safetensors made of it"
Shapes = Mapping[str, tuple[int, ...]]
LARGEST_WIDTH = 2048
"""Channels of a layer at most: a damaged file must not ask for more memory than there is."""


@dataclass(frozen=True)
class Architecture:
    """Channels and levels. Scales are named by their number: 0 is the finest."""

    widths: tuple[int, int, int] = (64, 96, 128)
    """Of the three stages of the encoders."""
    hidden: tuple[int, ...] = (128, 128, 128)
    """State of the recurrent unit of each of the three scales."""
    scales: int = 3
    """Scales whose units are used, 1 to 3 (all three exist in every checkpoint)."""
    features: int = 256
    """Of the feature map that is correlated."""
    motion: tuple[int, int] = (64, 128)
    """Inside and out of the encoder of correlation and disparity."""
    head: int = 256
    """Inside the head that updates the disparity."""
    mask: int = 256
    """Inside the head of the upsampling weights."""
    downsample: int = 2
    """The finest scale is 2 ** downsample times smaller than the picture."""
    levels: int = 4
    """Of the correlation pyramid."""
    radius: int = 4
    """Correlations are looked up at so many pixels to either side."""
    shared: bool = False
    """One encoder for context and features (the authors' real-time network)."""
    batch_norm: bool = True
    """Of the context encoder; else instance normalisation."""

    @property
    def slow_fast(self) -> bool:
        """Whether coarse units run more often than the finest. No tensor tells; the authors' network with a shared
        encoder was trained so, the others were not."""
        return self.shared


SMALL = Architecture(
    widths=(8, 24, 32), hidden=(32, 32, 8), scales=2, features=48, motion=(24, 32), head=32, mask=32, shared=True
)
"""Architecture of the network that is trained here, on our own renderings."""


def architecture_of(shapes: Shapes, where: str) -> Architecture:
    """Return the sizes of a checkpoint with tensors of these shapes. Raises BadInput for one of another network."""
    try:
        planes = shapes["update_block.encoder.convc1.weight"][1]
        factor = math.isqrt(shapes["update_block.mask.2.weight"][0] // 9)
        shared = not any(name.startswith("fnet.") for name in shapes)
        architecture = Architecture(
            widths=tuple(shapes[f"cnet.{name}.weight"][0] for name in ("conv1", "layer2.0.conv1", "layer3.0.conv1")),  # type: ignore[arg-type]
            hidden=tuple(shapes[f"update_block.gru{name}.convz.weight"][0] for name in ("08", "16", "32")),
            scales=sum(name.startswith("context_zqr_convs.") and name.endswith(".weight") for name in shapes),
            features=shapes["conv2.1.weight" if shared else "fnet.conv2.weight"][0],
            motion=(planes_out(shapes, "convc1"), planes_out(shapes, "conv") + 2),
            head=shapes["update_block.flow_head.conv1.weight"][0],
            mask=shapes["update_block.mask.0.weight"][0],
            downsample=max(0, factor.bit_length() - 1),
            radius=(planes // 4 - 1) // 2,
            shared=shared,
            batch_norm="cnet.norm1.weight" in shapes,
        )
    except (KeyError, IndexError):
        raise BadInput(f"{where}: no checkpoint of RAFT-Stereo", hint=OTHER_FILE) from None
    widths = (
        *architecture.widths,
        *architecture.hidden,
        architecture.features,
        *architecture.motion,
        architecture.head,
        architecture.mask,
    )
    if not (
        1 <= architecture.scales <= 3
        and all(1 <= width <= LARGEST_WIDTH for width in widths)
        and architecture.radius >= 1
    ):
        raise BadInput(f"{where}: its tensors are of no RAFT-Stereo network", hint=OTHER_FILE)
    return architecture


def planes_out(shapes: Shapes, name: str) -> int:
    """Return the output channels of a convolution of the motion encoder."""
    return shapes[f"update_block.encoder.{name}.weight"][0]
