"""Problems as files: a figure, what is around it and what it should do, written by hand in TOML."""

from wholebody.taskfile.result import Result, read_result, write_result
from wholebody.taskfile.task import Task, read_task
from wholebody.taskfile.writing import write_task

__all__ = ["Result", "Task", "read_result", "read_task", "write_result", "write_task"]
