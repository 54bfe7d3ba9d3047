"""Problem sets with known answers, the tools that are compared on them, and the judge of anybody's answers."""
