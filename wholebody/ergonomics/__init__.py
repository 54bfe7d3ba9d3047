"""Ergonomics of postures: RULA, REBA, OWAS, the NIOSH lifting equation, torques against strength, the field of view."""
