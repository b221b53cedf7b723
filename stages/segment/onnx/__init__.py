"""Backend `onnx`: instance and panoptic networks as ONNX files, run by ONNX Runtime."""
