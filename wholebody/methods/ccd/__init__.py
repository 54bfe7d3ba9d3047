"""Cyclic coordinate descent, and overlap resolution by it (Schmidl and Lin): docs/theory/ccd.md.

`sweep` sets joints of `limbs` to their best values, `guards` keep cones and ranges, `reaching` repeats sweeps, `chain`
and `resolver` remove overlap, `method` alternates both from several starts, `frames` follows a tracked posture.
"""
