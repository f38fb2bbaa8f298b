"""Inspect files and images before evaluation."""
