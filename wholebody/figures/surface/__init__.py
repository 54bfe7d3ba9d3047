"""The smooth surface of a body that the viewer draws; contacts are measured with the figure's pieces."""

from wholebody.figures.surface.garments import Bone, Patch, Surface
from wholebody.figures.surface.surface import surface_of

__all__ = ["Bone", "Patch", "Surface", "surface_of"]
