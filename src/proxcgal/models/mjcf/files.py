"""The files that an MJCF is made of: found within their folders, before MuJoCo opens any."""

import xml.etree.ElementTree as ET
from pathlib import Path

from proxcgal.core.errors import ModelError
from proxcgal.models.formats.paths import MeshFolders
from proxcgal.models.formats.safe_xml import parse_xml

MAX_FILES = 200
MAX_NESTED = 16


class ModelFiles:
    """A model's own files: what it includes, and the models that it attaches.

    Every one is checked: within the folders of the description, well-formed, within the bounds of
    `parse_xml`, and free of what would read further files while MuJoCo parses.
    """

    def __init__(self, root: ET.Element, path: Path, folders: MeshFolders) -> None:
        """Of an MJCF that is parsed already.

        Raises:
            ModelError: names the file and what is wrong with it.
        """
        self._folders = folders
        self._path = path
        #: The file itself, what it includes and attaches.
        self.files = [path]
        #: Folders that relative paths of meshes start from: of the model, and of attached ones.
        self.bases = [path.parent]
        self._read(root, path, 0)

    def _read(self, root: ET.Element, path: Path, depth: int) -> None:
        if depth > MAX_NESTED:
            raise ModelError(f"{path}: files nested deeper than {MAX_NESTED} by <include>")
        for tag in ("flexcomp", "plugin"):
            if (element := root.find(f".//{tag}")) is not None:
                given = element.get("name") or element.get("plugin")
                raise ModelError(
                    f"{path}: <{tag}{f' {given}' if given else ''}> is not read; rigid bodies of "
                    "primitives and meshes are"
                )
        for element in root.iter("include"):
            self._open(element.get("file", ""), "<include>", path, depth, set())
        for element in root.findall(".//asset/model"):
            found = self._open(element.get("file", ""), "<model>", path, depth, {"mujoco"})
            self.bases += [file.parent for file in found if file.parent not in self.bases]

    def _open(self, name: str, what: str, path: Path, depth: int, roots: set[str]) -> list[Path]:
        """Read all files that MuJoCo may mean by a name: it tries more than one folder."""
        bases = dict.fromkeys([path.parent, self._path.parent, *self.bases])
        maybe = dict.fromkeys(self._folders.check(base / name, name, what) for base in bases)
        found = [file for file in maybe if file.is_file()]
        if not found:
            raise ModelError(f"{path}: no file '{name}' of {what} at {next(iter(maybe))}")
        for file in found:
            if file in self.files:
                continue
            self.files.append(file)
            if len(self.files) > MAX_FILES:
                raise ModelError(f"{self._path}: more than {MAX_FILES} files by <include>")
            self._read(parse_xml(file, roots), file, depth + 1)
        return found

    def mesh(self, name: str, folder: str, what: str) -> Path:
        """The file of a mesh, by the name and the folder that MuJoCo has for it.

        Raises:
            ModelError: none, more than one that it may be, or one outside of the folders.
        """
        bases = [base / folder for base in self.bases]
        there = {base / name for base in bases if self._folders.holds(base / name)}
        if len({file.read_bytes() for file in there}) > 1:
            raise ModelError(
                f"{self._path}: {what} may be {' or '.join(sorted(map(str, there)))}; give the "
                "files names that differ"
            )
        base = next((base for base in bases if base / name in there), bases[0])
        return self._folders.find(name, what, base)
