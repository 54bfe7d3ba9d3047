"""Collisions of clips removed by recursive bisection: posture prediction in the middle, interpolation beside it."""
