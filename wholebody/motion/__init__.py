"""Motion: clips, their files, and what is done with whole clips."""
