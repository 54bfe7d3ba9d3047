"""Overlap resolution: the penetrating link of a chain, its displacement, the loop over chains, and frames."""
