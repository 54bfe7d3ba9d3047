"""Simplification of problems before they are solved: a presolve, as linear programming has it.

Joints that move no goal, and that no equality needs, are fixed at their start (`active_joints`): the variables of the
smaller problem are the others, and terms of the whole figure are embedded (`embedding`). Pairs of pieces that cannot
come near each other in any allowed posture are redundant constraints and are dropped (`reach`). What is left out is
named, with a bound on its effect: exact, or how much the measures may be higher. An answer is taken back to the whole
figure and assessed there (`simplify`; Nocedal and Wright 2006, section 13.7).
"""
