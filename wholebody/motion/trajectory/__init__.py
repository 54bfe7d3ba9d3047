"""All frames of a clip at once: sequential quadratic programs over the deviation from the original."""
