"""Clips freed of collisions by each method, with each piece of equipment: measured, and put side by side."""
