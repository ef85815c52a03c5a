"""Expands a xacro and writes down what it read. Runs as a script of its own.

`formats.child.run_limited` starts it: a xacro is a program, and xacro keeps state between files.
It imports nothing of this package.
"""

import glob
import json
import os
import xml.etree.ElementTree as ET
from pathlib import Path

import xacro  # type: ignore[import-untyped]
from xacro import substitution_args

_MOST_UP = 4  # folders up to the package of a file
# What decides where `$(find ...)` looks, where no folder of the caller's holds the package.
_SEARCH = ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH", "ROS_ROOT")


class Arguments(dict[str, str]):
    """xacro arguments that know which were asked for."""

    def __init__(self, given: dict[str, str]) -> None:
        """Of those that are given."""
        super().__init__(given)
        self.given = set(given)
        self.asked: set[str] = set()

    def __contains__(self, name: object) -> bool:
        """Whether it is known."""
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        """Its value."""
        self.asked.add(name)
        return str(super().__getitem__(name))


def main() -> None:
    """Reads request.json, writes reply.json."""
    request = json.loads(Path("request.json").read_text())
    path, packages = request["path"], request["packages"]
    environment: dict[str, str | None] = {}
    patterns: dict[str, list[str]] = {}
    arguments = Arguments(request["arguments"])

    def variable(name: str) -> str | None:
        environment[name] = os.environ.get(name)
        return environment[name]

    def env(name: str) -> str:
        if (value := variable(name)) is None:
            raise substitution_args.SubstitutionException(
                f"environment variable '{name}' is not set"
            )
        return value

    def optenv(name: str, default: str = "") -> str:
        return default if (value := variable(name)) is None else value

    def find(package: str) -> str:
        here = xacro.filestack[-1] if xacro.filestack else path
        for file in dict.fromkeys([here or path, path]):
            if own := own_package(Path(file).absolute().parent, package):
                return own
        if package in packages:
            return str(packages[package])
        for name in _SEARCH:
            variable(name)
        from xacrodoc import packages as installed

        try:
            return str(installed.get_path(package))
        except Exception:
            raise substitution_args.SubstitutionException(
                f"package '{package}' is not found; package_dirs names the folders that packages "
                "lie in"
            ) from None

    real_includes = xacro.get_include_files

    def get_include_files(spec: str, symbols: object) -> object:
        pattern = xacro.abs_filename_spec(spec)
        patterns[pattern] = sorted(glob.glob(pattern))  # noqa: PTH207  as xacro itself does
        return real_includes(spec, symbols)

    substitution_args._eval_env, substitution_args._eval_optenv = env, optenv
    substitution_args._eval_find = find
    substitution_args._eval_dict.update(env=env, optenv=optenv, find=find)
    xacro.get_include_files = get_include_files
    try:
        document = xacro.process_file(path, mappings=arguments)
        reply = {"text": document.toxml()}
        if unknown := sorted(arguments.given - arguments.asked):
            names = sorted(arguments.asked - set(unknown))
            reply = {"error": f"xacro: there is no argument {listed(unknown)}; there are "
                              f"{listed(names)}"}  # fmt: skip
    except Exception as error:  # xacro raises what the expressions in it raise
        reply = {"error": f"xacro: {said(error)}{_place(path)}"}
    reply |= {"files": [str(Path(f).absolute()) for f in xacro.all_includes],
              "environment": environment, "patterns": patterns}  # fmt: skip
    Path("reply.json").write_text(json.dumps(reply))


def said(error: BaseException) -> str:
    """An error in words, and how to give an argument that is missing."""
    inner: BaseException | None = error
    while inner is not None:
        if isinstance(inner, substitution_args.ArgException):
            name = inner.args[0]
            return (
                f"argument '{name}' has no default and is not given: xacro_args={{'{name}': ...}}, "
                f"or --xacro-arg {name}=..."
            )
        if isinstance(inner, substitution_args.SubstitutionException):
            return str(inner)
        inner = getattr(inner, "exc", None)
    if isinstance(error, FileNotFoundError):
        return f"no file '{error.filename}'"
    return " ".join((str(error) or repr(error)).split())[:500]


def _place(path: str) -> str:
    """The included file that the error is in."""
    stack = [file for file in xacro.filestack or [] if file]
    return f" (in {stack[-1]})" if stack and stack[-1] != path else ""


def own_package(folder: Path, name: str) -> str | None:
    """The folder of the package `name` that a folder lies in, if it does."""
    for place in [folder, *folder.parents][:_MOST_UP]:
        manifest = place / "package.xml"
        if manifest.is_file():
            try:
                found = (ET.parse(manifest).getroot().findtext("name") or "").strip()
            except ET.ParseError:
                found = place.name
            return str(place) if name in (found, place.name) else None
        if place.name == name:
            return str(place)
    return None


def listed(names: list[str]) -> str:
    """Names as they stand in messages."""
    return ", ".join(f"'{name}'" for name in names) or "none"


if __name__ == "__main__":
    main()
