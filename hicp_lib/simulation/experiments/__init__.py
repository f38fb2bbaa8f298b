"""The study's experiments as scenes: a robot's laboratory, a person who sits, a person who moves."""
