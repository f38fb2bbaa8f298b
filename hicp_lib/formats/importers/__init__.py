"""Predictions written by other tools, in their own files, read into the library's layout."""
