"""The viewer: a scene in Meshcat, live, as a file, as a picture or a movie."""

from wholebody.view.viewer import Viewer

__all__ = ["Viewer"]
