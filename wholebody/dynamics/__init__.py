"""Rigid bodies that move by themselves: motion, impacts, resting contact.

A frame of `RigidBodies` is made in steps. Each step:

1. finds near pairs and their contact points (`pieces`), and the rows of contacts and joints (`rows_kernel`);
2. resolves the impacts of points that touch, the fastest first (`impact_kernel`), and ends at the next impact;
3. adds gravity to the velocities and solves one program for the impulses of all points (`solve_kernel`): projected
   Gauss-Seidel sweeps with conjugate directions, island by island, from the impulses of the step before;
4. takes away the energy that the tolerance of this program added (`energy_kernel`): the velocities of an island are
   scaled towards rest, or towards the motion of the whole as one body, which keeps its momentum;
5. moves the bodies (`motion_kernel`), the free ones with constant energy and angular momentum;
6. tests whether pieces are, or were on the way, in each other (`passing`): directions that part two pieces at both
   ends of the step part them between. If pieces are in each other at its end, the step is repeated with the points
   there; if that does not help, or a pair fails on the way, it is halved;
7. closes joints in velocities (`joints`), and lets slow islands sleep at the end of the frame (`sleeping`).

The loops take records: `Bodies`, `Rows`, `JointPoints`, `Laws`, `Limits`, `SweptPoints`, `Way`.
"""

from __future__ import annotations

from wholebody.base.imports import exported

__getattr__, __dir__, __all__ = exported(__name__, __file__)
