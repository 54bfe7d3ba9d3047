"""What the package costs: steps, solves, clips, worlds and drags, with tables and charts."""
