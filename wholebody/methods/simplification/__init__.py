"""Simplification of problems: active joints, pairs that can meet, pieces with few corners."""
