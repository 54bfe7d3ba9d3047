"""Model no more than a scene needs: the joints that take part, the pairs that can meet, pieces with few corners."""
