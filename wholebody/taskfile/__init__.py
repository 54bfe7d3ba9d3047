"""Problems as files: a figure, what is around it and what it should do, written by hand in TOML."""

from wholebody.taskfile.task import Task, read_task

__all__ = ["Task", "read_task"]
