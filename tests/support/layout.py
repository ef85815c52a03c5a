"""Checks of a package's layout: which module imports which, in what order, without circles."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path


@dataclass(frozen=True)
class Import:
    """One import statement's one name."""

    importer: str  # module, below the package
    imported: str  # module below the package, or the first part of another package's name
    own: bool  # is it a module of this package?
    in_function: bool

    def __str__(self) -> str:
        return f"{self.importer} imports {self.imported}"


class Layout:
    """The modules of a package: every import, those in functions and under TYPE_CHECKING too."""

    def __init__(self, root: Path) -> None:
        self._package = root.name
        self.files = {module_name(root, file): file for file in sorted(root.rglob("*.py"))}
        self.imports = [found for name in self.files for found in self._imports(name)]

    def room(self, module: str) -> str:
        """The top folder, or the module itself where it stands beside the rooms."""
        return module.split(".")[0]

    def against_order(self, rooms: tuple[str, ...]) -> list[str]:
        """Imports of a later room, and of rooms that the order does not name."""
        place = {name: row for row, name in enumerate(rooms)}
        wrong = []
        for found in self.imports:
            if not found.own or not found.importer:  # the package itself shows all
                continue
            here, there = self.room(found.importer), self.room(found.imported)
            if place.get(there, len(rooms)) > place.get(here, -1):
                wrong.append(str(found))
        return wrong

    def circle(self) -> list[str]:
        """The modules of one import circle; none where there is none."""
        graph: dict[str, set[str]] = {name: set() for name in self.files}
        for found in self.imports:
            if found.own and found.imported != found.importer:
                graph[found.importer].add(found.imported)
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            return list(error.args[1])
        return []

    def in_functions(self, allowed: str) -> list[str]:
        """Imports of own modules within functions, outside of one room."""
        return [
            str(found)
            for found in self.imports
            if found.own and found.in_function and self.room(found.importer) != allowed
        ]

    def outside(self, library: str, places: tuple[str, ...]) -> list[str]:
        """Modules that import a library, and lie in none of these rooms or modules."""
        return [
            found.importer
            for found in self.imports
            if not found.own
            and found.imported == library
            and not any(f"{found.importer}.".startswith(f"{place}.") for place in places)
        ]

    def crowded(self, most: int) -> list[str]:
        """Folders with more Python files than that."""
        folders = [file.parent for file in self.files.values()]
        return sorted({folder.name for folder in folders if folders.count(folder) > most})

    def _imports(self, importer: str) -> Iterator[Import]:
        tree = ast.parse(self.files[importer].read_text())
        functions = [
            n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)
        ]
        inner = {id(node) for function in functions for node in ast.walk(function)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                base = self._absolute(importer, node)
                names = [f"{base}.{alias.name}" for alias in node.names]
            else:
                continue
            for name in names:
                own = name.split(".")[0] == self._package
                imported = self._module(name) if own else name.split(".")[0]
                yield Import(importer, imported, own, id(node) in inner)

    def _absolute(self, importer: str, node: ast.ImportFrom) -> str:
        if not node.level:
            return node.module or ""
        parts = [self._package, *importer.split(".")] if importer else [self._package]
        if self.files[importer].name != "__init__.py":
            parts.pop()
        parts = parts[: len(parts) - (node.level - 1)]
        return ".".join([*parts, *([node.module] if node.module else [])])

    def _module(self, name: str) -> str:
        """The module that gives a name; compiled ones and the package itself have no file."""
        below = name.split(".")[1:]
        for end in range(len(below), 0, -1):
            if (module := ".".join(below[:end])) in self.files:
                return module
        return below[0] if below and below[0].startswith("_core") else ""


def module_name(root: Path, file: Path) -> str:
    """Dotted, below the package; "" for the package itself."""
    parts = file.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
