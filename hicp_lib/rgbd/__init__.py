"""Recordings of colour and depth: reading and checking them, keypoints in space, motion capture."""
