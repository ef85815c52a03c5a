"""Arrays kept on disk between runs, found by what they were made from."""

import contextlib
import hashlib
import io
import json
import os
import threading
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proxcgal.core.files import write_bytes

Arrays = dict[str, NDArray[Any]]
_META = "meta"
# numpy reads an array's header with `ast.literal_eval`, which up to Python 3.11.4 fails with a
# SystemError now and then where several threads do it (python/cpython#106905).
_HEADERS = threading.Lock()


@dataclass(frozen=True, slots=True, eq=False)
class Stored:
    """One entry: named arrays and a JSON object."""

    arrays: Arrays
    meta: dict[str, Any]


class Cache:
    """Entries of one kind, under $XDG_CACHE_HOME/proxcgal (~/.cache/proxcgal).

    Safe to share: an entry appears whole or not at all. One that cannot be read counts as absent
    and is made again; a folder that cannot be written means that nothing is kept.
    """

    def __init__(self, kind: str) -> None:
        """Of entries of one `kind`, which get a folder of their own."""
        self.folder: Path | None
        try:
            root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
            self.folder = Path(root) / "proxcgal" / kind
        except RuntimeError:  # no home
            self.folder = None

    def get(self, key: Sequence[Any]) -> Stored | None:
        """The entry made from the same key, or None."""
        if (path := self._path(key)) is None:
            return None
        try:
            # zip carries a checksum of every array: a damaged file raises here.
            with _HEADERS, np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            meta = json.loads(arrays.pop(_META).tobytes())
            return Stored(arrays, meta) if isinstance(meta, dict) else None
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, NotImplementedError):
            return None

    def put(self, key: Sequence[Any], entry: Stored) -> None:
        """Keep an entry, replacing an older one of the same key."""
        if (path := self._path(key)) is None:
            return
        meta = np.frombuffer(json.dumps(entry.meta).encode(), dtype=np.uint8)
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            content = io.BytesIO()
            np.savez(content, **{_META: meta}, **entry.arrays)  # type: ignore[arg-type]
            write_bytes(path, content.getvalue())

    def _path(self, key: Sequence[Any]) -> Path | None:
        if self.folder is None:
            return None
        digest = hashlib.sha256(json.dumps(list(key)).encode()).hexdigest()
        return self.folder / f"{digest[:40]}.npz"


def hash_file(path: Path) -> str:
    """SHA-256 of a file's content."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def hash_mesh(vertices: NDArray[Any], triangles: NDArray[Any]) -> str:
    """SHA-256 of a mesh: float64 vertices, int32 triangles, C order."""
    digest = hashlib.sha256()
    digest.update(np.ascontiguousarray(vertices, dtype=np.float64).data)
    digest.update(np.ascontiguousarray(triangles, dtype=np.int32).data)
    return digest.hexdigest()
