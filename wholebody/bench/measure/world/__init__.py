"""The same drops in wholebody, MuJoCo and Rapier: penetration, energy, time."""
