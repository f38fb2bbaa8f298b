"""What detections are worth: precision, errors in the image and in space, and why they happen."""
