"""Newton's method in full coordinates (Choi and Cremer 1999): docs/theory/newton.md.

`batches`, `figure_bodies`, `terms` and `assembly` make equations, `inequalities` limits and contacts; `iteration` makes
steps, whose systems `linear_algebra` solves; `measures` descends along the equations, `multistart` tries other starts.
"""
