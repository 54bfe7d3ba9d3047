"""How a posture is found: one module or folder a method."""
