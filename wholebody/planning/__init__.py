"""All postures that meet the goals of a problem."""
