"""Where the mesh files of a description lie, and that they lie where they may."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import unquote, urlsplit

from proxcgal.core.errors import ModelError

# A description may sit in such a folder of its package, with the meshes beside that folder.
_DESCRIPTION_FOLDERS = {"urdf", "xacro", "robots", "robot", "mjcf", "xml", "model", "models"}

ROBOT_SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf", ".toml")


def is_robot_file(name: str | os.PathLike[str]) -> bool:
    """Whether a robot's name is a path to its description, by the ending."""
    return Path(name).suffix.lower() in ROBOT_SUFFIXES


class MeshFolders:
    """Finds files named in a description. Nothing outside of its folders is ever opened.

    The folders are that of the description itself (its parent too where it is called `urdf` or the
    like), its package (a folder up to two above that has the package's name) and `package_dirs`.
    Paths are compared as written, `..` resolved: links that a workspace puts inside its own folders
    are followed.
    """

    def __init__(
        self,
        description: Path,
        package_dirs: Sequence[str | os.PathLike[str]] = (),
        packages: Mapping[str, Path] | None = None,
    ) -> None:
        """Of the file `description`; `packages` gives the folder of some packages by name."""
        self.description = description
        own = Path(os.path.normpath(description.absolute())).parent
        self.own = [own, own.parent] if own.name in _DESCRIPTION_FOLDERS else [own]
        self.package_dirs = [Path(os.path.normpath(Path(d).absolute())) for d in package_dirs]
        self.packages = dict(packages or {})
        for folder in self.package_dirs:
            if not folder.is_dir():
                raise ModelError(f"package folder {folder}: no such folder")

    def find(self, name: str, what: str, base: Path | None = None, kind: str = "mesh file") -> Path:
        """The file that `name` means.

        Args:
            name: package://, file:// or a path relative to `base`.
            what: the link or mesh concerned, for messages.
            base: folder of relative paths; that of the description when not given.
            kind: of file, for messages.

        Raises:
            ModelError: no such file, or it lies outside of the folders.
        """
        if name.startswith(("package://", "model://")):
            return self._in_package(name, what)
        if name.startswith("file://"):
            path = Path(unquote(urlsplit(name).path))
        elif "://" in name:
            raise ModelError(
                f"{self.description}: {what} has its mesh at '{name}'; only package://, file:// "
                "and paths are read"
            )
        else:
            path = (base or self.own[0]) / name
        path = self.check(path, name, what)
        if not path.is_file():
            raise ModelError(f"{self.description}: no {kind} '{name}' of {what} at {path}")
        return path

    def check(self, path: Path, name: str, what: str) -> Path:
        """The path, `..` resolved.

        Raises:
            ModelError: it lies outside of the folders.
        """
        path = Path(os.path.normpath(path))
        if not self._within(path):
            self._outside(name, what, path, self._all)
        return path

    def holds(self, path: Path) -> bool:
        """Whether that is a file within the folders."""
        path = Path(os.path.normpath(path))
        return self._within(path) and path.is_file()

    @property
    def _all(self) -> list[Path]:
        return [*self.own, *self.package_dirs, *self.packages.values()]

    def _within(self, path: Path) -> bool:
        return any(path.is_relative_to(folder) for folder in self._all)

    def _in_package(self, name: str, what: str) -> Path:
        package, _, rest = name.split("://", 1)[1].partition("/")
        places = [self.packages[package]] if package in self.packages else []
        for folder in self.package_dirs:
            places += [folder / package, folder]
        # The description may lie in the package itself, a folder or two down.
        places += [f for f in [self.own[0], *self.own[0].parents][:3] if f.name == package]
        tried = [place for place in places if place.is_dir()]
        for place in tried:
            path = Path(os.path.normpath(place / rest))
            if not package or package in (".", "..") or not path.is_relative_to(place):
                self._outside(name, what, path, [place])
            if path.is_file():
                return path
        raise ModelError(
            f"{self.description}: no mesh file '{name}' of {what}; looked for package "
            f"'{package}' in {', '.join(str(p) for p in tried[:4]) or 'no folder'}. "
            "package_dirs names the folders that packages lie in"
        )

    def _outside(self, name: str, what: str, path: Path, folders: Sequence[Path]) -> None:
        allowed = ", ".join(str(folder) for folder in folders)
        raise ModelError(
            f"{self.description}: {what} names '{name}', which is {path}: outside of "
            f"{allowed}. package_dirs allows more folders"
        )
