"""Cyclic coordinate descent: one joint at a time, in closed form, on plain floats."""
