"""Patchlight: bakes the diffuse light of interiors by radiosity into lightmaps or vertex colours."""
