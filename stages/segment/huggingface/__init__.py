"""Backend `huggingface`: published panoptic and open-vocabulary models, through the transformers library."""
