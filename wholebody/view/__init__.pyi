from wholebody.view.viewer import Viewer as Viewer
