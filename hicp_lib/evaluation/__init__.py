"""Evaluation of detections: precision, errors in the image and in space, and their causes."""
