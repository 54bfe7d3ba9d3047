"""Every robot description of a folder: whether it loads, how fast, and whether its tips reach."""
