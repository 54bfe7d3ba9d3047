"""JSON files of an export, read with one sentence for whatever is wrong with them, and written the same each time."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from wholebody.base.errors import FileFormatError, InputError
from wholebody.base.files import LARGEST, is_folder, read_text

VERSION = "1.0"
INDEX = "index.json"


def read_json(path: Path, kind: str) -> dict[str, Any]:
    """Read a JSON object of an export whose "format" is "wholebody KIND".

    Raises:
        FileFormatError: there is no such file, it is no JSON, or no such object of this version.
    """
    found = loaded(path, f"{kind} file")
    if not isinstance(found, dict) or found.get("format") != f"wholebody {kind}":
        raise FileFormatError(f'{path}: its "format" is not "wholebody {kind}"; export the problems again')
    if found.get("version") != VERSION:
        raise FileFormatError(f"{path}: its version is {found.get('version')!r}; this judge reads {VERSION}")
    return found


def loaded(path: Path, kind: str) -> Any:
    """Read a JSON file; NaN and infinities are refused.

    Raises:
        FileFormatError: there is no such file, or it is no JSON.
    """
    text = read_text(path, kind, LARGEST)
    try:
        return json.loads(text, parse_constant=_refused)
    except json.JSONDecodeError as error:
        raise FileFormatError(
            f"{path}, line {error.lineno}: is no JSON ({error.msg}); write it with a library"
        ) from None
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: is no JSON ({error}); write it with a library") from None


def _refused(name: str) -> None:
    raise ValueError(f"it has the number {name}, and JSON has finite numbers only")


def dumped(content: Mapping[str, Any]) -> str:
    """JSON text with a line for each entry, and for each object or list in a list of them."""
    lines = []
    for key, value in content.items():
        text = json.dumps(value, allow_nan=False)
        if isinstance(value, list) and value and isinstance(value[0], (dict, list)):
            text = "[\n  " + ",\n  ".join(json.dumps(item, allow_nan=False) for item in value) + "\n ]"
        elif isinstance(value, dict) and value and all(isinstance(item, dict) for item in value.values()):
            inner = ",\n  ".join(
                f"{json.dumps(name)}: {json.dumps(item, allow_nan=False)}" for name, item in value.items()
            )
            text = "{\n  " + inner + "\n }"
        lines.append(f" {json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


@lru_cache(maxsize=2)
def read_index(folder: Path) -> dict[str, Any]:
    """Read the index of an export.

    Raises:
        InputError: there is no such folder.
        FileFormatError: it is no export.
    """
    if not is_folder(folder):
        raise InputError(f"{folder}: there is no such folder; make one with `wholebody bench export {folder}`")
    if not (folder / INDEX).is_file():
        raise FileFormatError(f"{folder}: has no {INDEX}; make it with `wholebody bench export {folder}`")
    return read_json(folder / INDEX, "index")
