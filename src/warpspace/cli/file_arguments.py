"""Files that commands read and write: no output replaces an input or another output."""

from collections.abc import Callable, Iterable, Iterator, MutableMapping
from contextlib import suppress
from copy import copy
from functools import cache, wraps
from pathlib import Path
from typing import Any, cast

import click
from click.shell_completion import CompletionItem

from warpspace.exceptions import OptionError, OutputError, SceneError
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.resources import assets_dir, check_address_space, find_data
from warpspace.scene.text_files import parse_number, parse_toml, read_text

LEAST_MB = 800  # address space below which imported libraries abort
NUMBERS = (click.types.IntParamType, click.types.FloatParamType)


class InputFile(click.Path):
    """A file that a command reads."""

    def files(self, value: str | Path) -> Iterable[Path]:
        return (Path(value),)


class DataFile(InputFile):
    """A file of readings, or the name of a bundled one."""

    def files(self, value: str | Path) -> Iterable[Path]:
        return (find_data(str(value)),)


class SceneName(click.ParamType[str]):
    """Name of a bundled scene or machine, or a path; the shell completes both."""

    name = "scene"

    def shell_complete(
        self,
        ctx: click.Context,  # noqa: ARG002 - signature of click
        param: click.Parameter,  # noqa: ARG002
        incomplete: str,
    ) -> list[CompletionItem]:
        from warpspace.scene.library import scene_names

        names = [name for name in scene_names() if name.startswith(incomplete)]
        return [CompletionItem(name) for name in names] or [CompletionItem(incomplete, type="file")]

    def files(self, value: str | Path) -> Iterable[Path]:
        """Find the files of a scene, or of those in a folder: machine, CSV files and meshes."""
        from warpspace.scene.library import scene_path
        from warpspace.scene.machine_library import machine_names

        machine: object = str(value)
        with suppress(OSError, SceneError):
            for inside in Path(value).glob("*.toml"):
                yield from self.files(inside)
            path = scene_path(value)
            yield path
            raw = parse_toml(read_text(path, MAX_SCENE_BYTES), str(path))
            yield from (path.parent / name for name in _named_files(raw))
            machine = raw.get("machine")
        if machine in machine_names():
            yield from (assets_dir() / "machines" / str(machine)).iterdir()


class OutputFile(click.Path):
    """A file that a command writes, with one of some endings, or any.

    `added` returns further endings, since plug-ins may add some.
    """

    def __init__(self, *endings: str, added: Callable[[], Iterable[str]] = tuple) -> None:
        super().__init__(readable=False)
        self._endings, self._added = endings, added

    @property
    def endings(self) -> tuple[str, ...]:
        return (*self._endings, *self._added())


def guarded(command: click.Command) -> click.Command:
    """Check the files of a command before it runs, and parse its numbers strictly."""
    command.context_settings.setdefault("help_option_names", ["-h", "--help"])
    for param in command.params:
        if isinstance(param.type, NUMBERS):
            param.type = _strict(param.type)
    run = command.callback
    if run is not None:

        @wraps(run)
        def check_and_run(**values: Any) -> Any:
            check_address_space(LEAST_MB, "warpspace")
            check_files(click.get_current_context())
            try:
                return run(**values)
            except (OptionError, SceneError) as error:
                raise OptionError(error.with_names(flag_of)) from None

        command.callback = check_and_run
    return command


def flag_of(name: str) -> str:
    """Return the flag of an option of the running command."""
    flags = {param.name: param.opts[0] for param in click.get_current_context().command.params}
    flags |= {flag.lstrip("-").replace("-", "_"): flag for flag in flags.values()}
    return flags.get(name, name)


class Commands(MutableMapping[str, click.Command]):
    """Commands by name, each built and guarded when it is first used.

    A command therefore does not pay for the imports of the others.
    """

    def __init__(
        self, names: Callable[[], Iterable[str]], build: Callable[[str], click.Command]
    ) -> None:
        self._names, self._build = names, cache(lambda name: guarded(build(name)))
        self._added: dict[str, click.Command] = {}

    def __getitem__(self, name: str) -> click.Command:
        """Return a command, built on first use; `KeyError` if there is none."""
        return self._added.get(name) or self._build(name)

    def __setitem__(self, name: str, command: click.Command) -> None:
        self._added[name] = guarded(command)

    def __delitem__(self, name: str) -> None:
        del self._added[name]

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys((*self._names(), *self._added)))

    def __len__(self) -> int:
        return sum(1 for _ in self)


def _strict(kind: "click.ParamType[Any]") -> "click.ParamType[Any]":
    strict, convert = copy(kind), kind.convert

    def convert_number(
        value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> object:
        if isinstance(value, str):
            try:
                parse_number(value)
            except ValueError:
                kind.fail(f"{value!r} is not a valid {kind.name}.", param, ctx)
        return convert(value, param, ctx)

    strict.convert = convert_number
    return strict


def check_files(context: click.Context, companions: Iterable[Path] = ()) -> None:
    """Raise an error if an output of a command must not be written."""
    values = [
        (param, value)
        for param in context.command.params
        for value in _each(context.params.get(param.name or ""))
    ]
    outputs = [
        (param.opts[0], Path(value), param.type.endings)
        for param, value in values
        if isinstance(param.type, OutputFile)
    ]
    outputs += [("a companion file", path, ()) for path in companions]
    force = bool(context.params.get("force"))
    for index, (option, path, endings) in enumerate(outputs):
        from warpspace.outputs.file_output import check_target

        inputs = (
            file
            for param, value in values
            if isinstance(param.type, (InputFile, SceneName))
            for file in param.type.files(value)
        )
        check_target(path, endings, overwrite=force, inputs=inputs)
        for earlier_option, earlier_path, _ in outputs[:index]:
            if _is_same_file(path, earlier_path):
                raise OutputError(
                    f"{path}: {earlier_option} and {option} name the same file; expected"
                    " different names"
                )


def _each(value: object) -> tuple[Any, ...]:
    if isinstance(value, tuple):
        return cast("tuple[Any, ...]", value)
    return () if value is None else (value,)


def _is_same_file(first: Path, second: Path) -> bool:
    if str(first.resolve()).casefold() == str(second.resolve()).casefold():
        return True
    return first.exists() and second.exists() and first.samefile(second)


def _named_files(value: object, key: str = "", table: str = "") -> Iterator[str]:
    if isinstance(value, dict):
        for name, part in cast("dict[str, object]", value).items():
            yield from _named_files(part, name, key)
    elif isinstance(value, list):
        for part in cast("list[object]", value):
            yield from _named_files(part, key, table)
    elif isinstance(value, str) and (
        key in {"csv", "file", "covariance", "matrix"} or table in {"bodies", "part"}
    ):
        yield value
