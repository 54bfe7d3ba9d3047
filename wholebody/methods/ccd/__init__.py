"""Cyclic coordinate descent, and overlap resolution by it (Schmidl and Lin).

Reaching is coordinate descent on the sum of squared distances of the goals (Nocedal and Wright 2006, section 9.3;
Wang and Chen 1991): one joint at a time, from the tip inwards, takes its exact minimiser, in closed form and within
its limits (`sweep`, on the kinematics of `limbs`). `reaching` repeats sweeps until the goals are met or the descent
stagnates; guards project limbs back into reach cones and ranges of motion (`guards`, `ranges`). Where the posture
overlaps something, each chain moves its penetrating link nearest to the root out by the global penetration depth,
itself by coordinate descent (`chain`, `resolver`). `method` alternates both from several starts. `frames`
follows a tracked posture without overlap, from frame to frame. The descent is monotone in the goals and has no
objective beside them.
"""
