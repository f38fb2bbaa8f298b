"""Detectors that run on the user's own weights, in ONNX files."""
