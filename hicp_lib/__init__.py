"""HiCP: human keypoint detection at close range, a reproducible study and the tool to repeat it."""

__version__ = "0.1.0"
