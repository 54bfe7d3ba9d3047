"""Removal of overlap: the penetrating link of a chain, the way out for it, chain by chain, frame by frame."""
