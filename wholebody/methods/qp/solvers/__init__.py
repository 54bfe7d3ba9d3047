"""QP solvers by name, behind one call: a program and a guess go in, an exact answer comes out."""
