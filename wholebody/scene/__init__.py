"""A figure among things: contents, geometry model, moving obstacles, matter, and the data of a run."""
