"""Loading model folders with transformers: from this disk alone, safetensors alone, no code of the folder's."""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from typing import Any

from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.schemas.outside import file_json

LARGEST_CONFIG = 16 * 2**20
"""Largest configuration of a model [bytes]."""


def transformers_library() -> Any:
    """Import transformers, quiet and cut off from the network. Raises MissingDependency when it cannot be."""
    os.environ["HF_HUB_OFFLINE"] = "1"  # read when the library is imported
    os.environ.setdefault("TOKENIZERS_PARALLELISM", "false")
    try:
        library = importlib.import_module("transformers")
        library.utils.logging.set_verbosity_error()
        library.utils.logging.disable_progress_bar()
    except ImportError as error:
        raise MissingDependency(
            f"{error}", hint="pip install transformers (make extras); without torchvision"
        ) from None
    except RuntimeError as error:  # a torchvision that does not fit torch
        raise MissingDependency(
            f"transformers cannot be imported: {str(error).splitlines()[0]}", hint="pip uninstall torchvision"
        ) from None
    return library


def processor_class(model_type: str, name: str) -> Any:
    """Return an image processor that needs no torchvision. Raises MissingDependency when the library has none."""
    transformers_library()
    try:
        module = importlib.import_module(f"transformers.models.{model_type}.image_processing_pil_{model_type}")
        return getattr(module, name)
    except (ImportError, AttributeError) as error:
        raise MissingDependency(
            f"this transformers has no {name} ({error})", hint="see requirements-extras.lock"
        ) from None


def read_config(folder: Path) -> dict[str, Any]:
    """Return a model's config.json. Raises BadInput when the folder is no model's."""
    path = Path(folder) / "config.json"
    hint = "give a model folder or hub id: config.json, preprocessor_config.json, model.safetensors"
    config = file_json(path, LARGEST_CONFIG, hint=hint)
    if not isinstance(config, dict) or not isinstance(config.get("model_type"), str):
        raise BadInput(f"{path}: names no model_type", hint=hint)
    return config


def load_model(class_name: str, folder: Path, device: str) -> Any:
    """Return a model in evaluation mode, 32-bit floats, every parameter from the folder's safetensors.

    Raises BadInput when the folder has none, or its tensors are not those of the model; MissingDependency when the
    model needs another library.
    """
    name = short_name(folder)
    if not any(Path(folder).glob("*.safetensors")):
        raise BadInput(
            f"{name}: holds no .safetensors file (pickled weights are not read)",
            hint="take a revision with model.safetensors: many models have one as --revision refs/pr/N",
        )
    library = transformers_library()
    torch = importlib.import_module("torch")
    try:
        model, info = getattr(library, class_name).from_pretrained(
            str(folder),
            local_files_only=True,
            use_safetensors=True,
            dtype=torch.float32,
            output_loading_info=True,
            ignore_mismatched_sizes=True,  # judged below, in words
        )
    except ImportError as error:
        raise MissingDependency(f"{name}: {_first_line(error)}", hint="choose a model without that library") from None
    except Exception as error:  # whatever a damaged config or tensor file makes the library do
        if isinstance(error, MemoryError):
            raise
        raise BadInput(f"{name}: cannot be loaded ({_first_line(error)})", hint="fetch it again") from None
    parameters = {key for key, _ in model.named_parameters()}
    missing = sorted(set(info["missing_keys"]) & parameters)
    if missing or info["mismatched_keys"]:
        example = missing[0] if missing else str(sorted(info["mismatched_keys"])[0][0])
        raise BadInput(
            f"{name}: {len(missing) or len(info['mismatched_keys'])} parameters are missing or of another shape, "
            f"for example {example:.100}; they would be random",
            hint="fetch it again, or take the checkpoint of the whole network",
        )
    return model.to(device).eval()


def load_processor(kind: Any, folder: Path, **changes: Any) -> Any:
    """Return the image processor of a folder. Raises BadInput."""
    try:
        return kind.from_pretrained(str(folder), local_files_only=True, **changes)
    except Exception as error:  # see load_model
        raise BadInput(
            f"{short_name(folder)}: its preprocessor_config.json cannot be used ({_first_line(error)})",
            hint="fetch it again",
        ) from None


def load_tokenizer(folder: Path) -> Any:
    """Return the tokenizer of a folder. Raises BadInput."""
    try:
        return transformers_library().AutoTokenizer.from_pretrained(
            str(folder), local_files_only=True, trust_remote_code=False
        )
    except Exception as error:  # see load_model
        raise BadInput(
            f"{short_name(folder)}: its tokenizer cannot be used ({_first_line(error)})", hint="fetch it again"
        ) from None


def short_name(folder: Path) -> str:
    """Return how to call a model folder: `organisation/model@revision` in the hub's cache, else the folder's name."""
    path_parts = Path(folder).resolve().parts
    if len(path_parts) >= 3 and path_parts[-2] == "snapshots" and path_parts[-3].startswith("models--"):
        return f"{path_parts[-3].removeprefix('models--').replace('--', '/')}@{path_parts[-1][:8]}"
    return path_parts[-1]


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
