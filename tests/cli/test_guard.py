"""One guard for all commands: no output is a file that is read, or the file of another output."""

import os
from pathlib import Path

import click
import pytest

from products import first
from warpspace.cli.file_arguments import NUMBERS, DataFile, InputFile, OutputFile, SceneName
from warpspace.cli.main import cli
from warpspace.exceptions import OutputError

MARKED = (InputFile, OutputFile, SceneName)
WORDS = ("FILE", "SCENE", "FOLDER", "PATH")
"""What the metavar of a parameter that names files says."""


def walk(command, *names):
    yield " ".join(names), command
    if isinstance(command, click.Group):
        for name in command.commands:
            yield from walk(command.commands[name], *names, name)


COMMANDS = {name: command for name, command in walk(cli) if not isinstance(command, click.Group)}
WRITERS = {
    name: command
    for name, command in COMMANDS.items()
    if any(isinstance(param.type, OutputFile) for param in command.params)
}
PAIRS = [
    pytest.param(name, written.name, read.name, id=f"{name}-{written.name}-{read.name}")
    for name, command in WRITERS.items()
    if not name.startswith("test ") or name == "test circular"  # all are made by one function
    for written in command.params
    if isinstance(written.type, OutputFile)
    for read in command.params
    if isinstance(read.type, InputFile | SceneName)
    and getattr(read.type, "file_okay", True)  # no file is a folder
]
TWICE = [
    pytest.param(name, first.name, second.name, id=f"{name}-{first.name}-{second.name}")
    for name, command in WRITERS.items()
    for first in command.params
    for second in command.params
    if isinstance(first.type, OutputFile)
    and isinstance(second.type, OutputFile)
    and first is not second
    and (
        not first.type.endings
        or not second.type.endings
        or set(first.type.endings) & set(second.type.endings)
    )
]


def run(name, given):
    command, before, after = COMMANDS[name], ["--force"], []
    for param in command.params:
        value = given.get(param.name or "")
        if value is None and param.required:
            value = "new" if isinstance(param.type, MARKED) else "1"
            value = param.type.choices[0] if isinstance(param.type, click.Choice) else value
            value += param.type.endings[0] if isinstance(param.type, OutputFile) else ""
        if value is not None and isinstance(param, click.Option):
            before += [param.opts[0], value]
        elif value is not None:
            after.append(value)
    with command.make_context(name, [*before, *after]) as context:
        command.invoke(context)


def ending(name, *params):
    kinds = [p.type for p in COMMANDS[name].params if p.name in params]
    known = [set(kind.endings) for kind in kinds if isinstance(kind, OutputFile) and kind.endings]
    return min(set.intersection(*known)) if known else ".txt"


@pytest.mark.parametrize("name", COMMANDS)
def test_every_parameter_that_names_a_file_says_whether_it_is_read_or_written(name):
    for param in COMMANDS[name].params:
        metavar = param.metavar or (param.name or "").upper()
        about = f"{metavar} {getattr(param, 'help', '') or ''}".upper()
        names_file = isinstance(param.type, click.Path | click.File) or (
            isinstance(param.type, click.types.StringParamType)
            and (any(word in metavar for word in WORDS) or "BUNDLED" in about)
        )
        assert isinstance(param.type, MARKED) or not names_file, (name, param.name, about)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_number_is_no_text_that_no_table_may_hold(name):
    for param in COMMANDS[name].params:
        if isinstance(param.type, NUMBERS):
            for text in ("1_0", "٣", "nan"):
                with pytest.raises(click.BadParameter, match=f"'{text}' is not a valid"):
                    param.type(text, param)
            assert param.type(" 1 ", param) == 1


@pytest.mark.parametrize("name", WRITERS)
def test_an_output_says_its_endings_in_its_help_and_can_be_forced(name):
    assert any(param.name == "force" for param in WRITERS[name].params)
    for param in WRITERS[name].params:
        if isinstance(param.type, OutputFile) and isinstance(param, click.Option):
            for known in param.type.endings:
                assert known in (param.help or "") or known[1:].upper() in (param.help or "")


@pytest.mark.parametrize("link", first(None, "symbolic", "hard"))
@pytest.mark.parametrize(("name", "written", "read"), PAIRS)
def test_no_output_is_an_input(name, written, read, link, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source = tmp_path / f"mine{ending(name, written)}"
    source.write_text("mine", encoding="utf-8")
    target = source if link is None else tmp_path / f"link{source.suffix}"
    if link == "symbolic":
        target.symlink_to(source)
    elif link == "hard":
        os.link(source, target)
    with pytest.raises(OutputError, match=f"{target.name}: is an input of its own output"):
        run(name, {read: str(source), written: str(target)})
    assert source.read_text(encoding="utf-8") == "mine"
    assert {path.name for path in tmp_path.iterdir()} == {source.name, target.name}


@pytest.mark.parametrize("other", ["same", "case", "path", "link"])
@pytest.mark.parametrize(("name", "first", "second"), TWICE)
def test_no_two_outputs_are_one_file(name, first, second, other, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    common = ending(name, first, second)
    target = tmp_path / f"out{common}"
    spelled = {
        "same": str(target),
        "case": str(tmp_path / f"Out{common}"),
        "path": f"./{target.name}",
        "link": f"link{common}",
    }[other]
    if other == "link":
        Path(spelled).symlink_to(target.name)
    with pytest.raises(OutputError, match="name the same file"):
        run(name, {first: str(target), second: spelled})
    assert not target.exists()


def test_there_are_pairs_of_each_kind():
    assert len(PAIRS) >= 38
    assert len(TWICE) >= 2
    assert ("calibrate", "csv_path", "data") in [tuple(pair.values) for pair in PAIRS]
    assert ("calibrate", "plot", "predict") in [tuple(pair.values) for pair in PAIRS]


def test_bundled_files_are_inputs_by_their_names():
    (data,) = DataFile().files("tcp_on.csv")
    assert data.is_file()
    files = {path.name for path in SceneName().files("dvf5000_first")}
    assert {"dvf5000_first.toml", "machine.toml"} <= files
    assert "machine.toml" in {path.name for path in SceneName().files("dvf5000")}


def test_what_scenes_name_is_an_input(tmp_path):
    folder = tmp_path / "fleet"
    folder.mkdir()
    (folder / "a.toml").write_text(
        '[errors]\nEXX = { csv = "x.csv", column = "e" }\n[bodies]\nX = "x.stl"\n'
        '[machine]\nchain = "wXYZt"\n[machine.bodies]\nY = { file = "y.stl" }\n',
        encoding="utf-8",
    )
    (folder / "b.toml").write_text("not [ TOML", encoding="utf-8")
    names = {path.name for path in SceneName().files(str(folder))}
    assert {"a.toml", "b.toml", "x.csv", "x.stl", "y.stl"} <= names


def test_tables_beside_a_table_replace_nothing_that_is_read(tmp_path, warpspace):
    scene = tmp_path / "s.toml"
    scene.write_text('title = "s"\nmachine = "dvf5000"\n[errors]\nEXX = 1\n', encoding="utf-8")
    made = tmp_path / "t.hal"
    command = ("compensate", scene, "--format", "linuxcnc-comp", "-o")
    assert warpspace(*command, made, "--json").status == 0
    beside = sorted(
        path for path in tmp_path.iterdir() if path.stem.startswith("t") and path != made
    )
    assert beside
    scene.rename(beside[0])
    text = beside[0].read_text(encoding="utf-8")
    again = ("compensate", beside[0], "--format", "linuxcnc-comp", "-o", made, "--force")
    warpspace(*again).refused(f"{beside[0].name}: is an input of its own output")
    assert beside[0].read_text(encoding="utf-8") == text
