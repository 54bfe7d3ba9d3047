"""Measurements: what a step, a solve and many random reaches cost and achieve, beside other tools where installed."""
