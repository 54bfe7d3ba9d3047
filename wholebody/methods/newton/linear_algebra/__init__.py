"""Linear systems of Newton steps: one interface, several factorisations.

Every one solves, for the displacement d and the multipliers y,

    D d - J' y = -g,        J d + M y = -c                                            (eqs. 8 to 10 of the paper)

with a positive diagonal D, the sparse Jacobian J and a diagonal M >= 0, which is zero for equations that must hold.
"""
