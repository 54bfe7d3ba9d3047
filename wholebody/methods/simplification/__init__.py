"""Simplification of problems before they are solved: a presolve (Nocedal and Wright 2006, section 13.7).

Pairs of pieces that cannot come near each other in any allowed posture are redundant constraints (`reach`). They are
dropped, with the things that no remaining pair has and the joints that are frozen (`simplify`).
"""
