"""Model folders of transformers, as small as the architectures allow, with random weights."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

NAMES = {0: "chair", 1: "table-merged", 2: "wall-other-merged", 3: "cup", 4: "quark"}
SWIN: dict[str, Any] = {
    "image_size": 32,
    "patch_size": 4,
    "embed_dim": 8,
    "depths": [1, 1, 1, 1],
    "num_heads": [1, 1, 2, 2],
    "window_size": 4,
    "out_features": ["stage1", "stage2", "stage3", "stage4"],
}
SMALL = {"hidden_dim": 32, "num_queries": 6, "encoder_feedforward_dim": 16, "encoder_layers": 1}
LABELLED = {"id2label": NAMES, "label2id": {name: number for number, name in NAMES.items()}}


def mask2former(folder: Path) -> Path:
    from transformers import Mask2FormerConfig, Mask2FormerForUniversalSegmentation, SwinConfig
    from transformers.models.mask2former.image_processing_pil_mask2former import Mask2FormerImageProcessorPil

    config = Mask2FormerConfig(
        backbone_config=SwinConfig(**SWIN),
        feature_size=32,
        mask_feature_size=32,
        decoder_layers=2,
        dim_feedforward=16,
        num_attention_heads=2,
        **SMALL,
        **LABELLED,
    )
    Mask2FormerForUniversalSegmentation(config).save_pretrained(folder)
    Mask2FormerImageProcessorPil(size={"height": 32, "width": 48}, size_divisor=32).save_pretrained(folder)
    return folder


def oneformer(folder: Path) -> Path:
    from transformers import CLIPTokenizer, OneFormerConfig, OneFormerForUniversalSegmentation, SwinConfig
    from transformers.models.oneformer.image_processing_pil_oneformer import OneFormerImageProcessorPil

    config = OneFormerConfig(
        backbone_config=SwinConfig(**SWIN),
        conv_dim=32,
        mask_dim=32,
        decoder_layers=2,
        dim_feedforward=16,
        num_attention_heads=2,
        query_dec_layers=1,
        is_training=False,
        text_encoder_width=32,
        text_encoder_n_ctx=4,
        text_encoder_num_layers=1,
        text_encoder_vocab_size=200,
        text_encoder_proj_layers=1,
        **SMALL,
        **LABELLED,
    )
    OneFormerForUniversalSegmentation(config).save_pretrained(folder)
    letters = [chr(code) for code in range(33, 127)]
    tokens = [*letters, *[letter + "</w>" for letter in letters], "<|startoftext|>", "<|endoftext|>"]
    (folder / "vocab.json").write_text(json.dumps({token: number for number, token in enumerate(tokens)}))
    (folder / "merges.txt").write_text("#version: 0.2\n")
    CLIPTokenizer(str(folder / "vocab.json"), str(folder / "merges.txt")).save_pretrained(folder)
    OneFormerImageProcessorPil(size={"height": 32, "width": 48}).save_pretrained(folder)
    # Published folders name a list of classes on the hub, which nothing here may fetch.
    path = folder / "preprocessor_config.json"
    said = {**json.loads(path.read_text()), "repo_path": "somebody/lists", "class_info_file": "coco_panoptic.json"}
    path.write_text(json.dumps(said))
    return folder


def detr(folder: Path) -> Path:
    from transformers import DetrConfig, DetrForSegmentation, ResNetConfig
    from transformers.models.detr.image_processing_pil_detr import DetrImageProcessorPil

    backbone = ResNetConfig(
        embedding_size=8,
        hidden_sizes=[8, 16, 16, 16],
        depths=[1, 1, 1, 1],
        layer_type="basic",
        out_features=["stage1", "stage2", "stage3", "stage4"],
    )
    config = DetrConfig(
        use_timm_backbone=False,
        use_pretrained_backbone=False,
        backbone_config=backbone,
        backbone=None,
        d_model=32,
        num_queries=6,
        encoder_layers=1,
        decoder_layers=1,
        encoder_ffn_dim=16,
        decoder_ffn_dim=16,
        encoder_attention_heads=8,
        decoder_attention_heads=8,
        **LABELLED,
    )
    DetrForSegmentation(config).save_pretrained(folder)
    DetrImageProcessorPil(size={"height": 32, "width": 48}).save_pretrained(folder)
    return folder


def grounding_dino(folder: Path) -> Path:
    from transformers import BertConfig, BertTokenizer, GroundingDinoConfig, GroundingDinoForObjectDetection, SwinConfig
    from transformers.models.grounding_dino.image_processing_pil_grounding_dino import GroundingDinoImageProcessorPil

    words = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", ".", "cup", "blue", "table", "##s", "wall"]
    folder.mkdir()
    (folder / "vocab.txt").write_text("\n".join(words))
    config = GroundingDinoConfig(
        backbone_config=SwinConfig(**{**SWIN, "out_features": ["stage2", "stage3", "stage4"]}),
        text_config=BertConfig(
            vocab_size=len(words),
            hidden_size=16,
            num_hidden_layers=1,
            num_attention_heads=2,
            intermediate_size=16,
            max_position_embeddings=64,
        ),
        d_model=32,
        num_queries=8,
        encoder_layers=1,
        decoder_layers=2,
        encoder_ffn_dim=16,
        decoder_ffn_dim=16,
        encoder_attention_heads=2,
        decoder_attention_heads=2,
        num_feature_levels=4,
        max_text_len=32,
    )
    GroundingDinoForObjectDetection(config).save_pretrained(folder)
    BertTokenizer(vocab={word: number for number, word in enumerate(words)}).save_pretrained(folder)
    GroundingDinoImageProcessorPil(size={"height": 96, "width": 96}).save_pretrained(folder)
    return folder


def sam(folder: Path) -> Path:
    from transformers import SamConfig, SamMaskDecoderConfig, SamModel, SamPromptEncoderConfig, SamVisionConfig
    from transformers.models.sam.image_processing_pil_sam import SamImageProcessorPil

    vision = SamVisionConfig(
        hidden_size=16,
        output_channels=16,
        num_hidden_layers=1,
        num_attention_heads=2,
        image_size=32,
        patch_size=4,
        window_size=4,
        global_attn_indexes=[0],
        num_pos_feats=8,
        mlp_dim=16,
    )
    prompt = SamPromptEncoderConfig(hidden_size=16, image_size=32, patch_size=4, mask_input_channels=4)
    decoder = SamMaskDecoderConfig(
        hidden_size=16, mlp_dim=16, num_hidden_layers=1, num_attention_heads=2, iou_head_hidden_dim=16
    )
    config = SamConfig(vision_config=vision, prompt_encoder_config=prompt, mask_decoder_config=decoder)
    SamModel(config).save_pretrained(folder)
    SamImageProcessorPil(size={"longest_edge": 32}, pad_size={"height": 32, "width": 32}).save_pretrained(folder)
    return folder
