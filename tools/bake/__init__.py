"""Parts of `tools/bake_body.py` and `tools/bake_openpose.py`, which make files of data/."""
