"""Posing by quadratic programs: a whole solve by a sequence of them, one step of tracking by one."""
