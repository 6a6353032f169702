"""A command is one file, or comes from a plug-in."""

import subprocess
import sys
from pathlib import Path

import click
import pytest

from warpspace.cli import commands, register_command
from warpspace.cli.main import cli
from warpspace.cli.registry import COMMANDS


def test_every_module_of_the_folder_is_a_command() -> None:
    folder = Path(commands.__file__).parent
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    assert {name.replace("-", "_") for name in cli.commands} >= {m.rstrip("_") for m in modules}
    assert len(COMMANDS) == len(list(COMMANDS)) >= 15
    for name, command in COMMANDS.items():
        assert command.name == name
        assert command.help


def test_every_option_is_explained() -> None:
    for name, command in COMMANDS.items():
        for option in command.params:
            if isinstance(option, click.Option):
                assert option.help, (name, option.name)


def test_a_plug_in_adds_a_command(warpspace) -> None:
    @click.command("tell-time")
    @click.argument("where")
    def tell_time(where: str) -> None:
        """Say what time it is."""
        click.echo(f"noon in {where}")

    assert warpspace("tell-time", "Ulm").status == 2
    register_command(tell_time)
    try:
        assert "Say what time it is." in warpspace("--help").out
        assert warpspace("tell-time", "Ulm").out == "noon in Ulm\n"
        with pytest.raises(ValueError, match="'tell-time'"):
            register_command(tell_time)
    finally:
        del COMMANDS["tell-time"]
    assert "tell-time" not in warpspace("--help").out


def test_a_plug_in_cannot_replace_a_command() -> None:
    with pytest.raises(ValueError, match="'field'"):
        register_command(click.Command("field"))


def test_a_misspelt_command_names_its_neighbour(warpspace) -> None:
    warpspace("gain", "dvf5000_first").refused("gain", "gains")


def test_one_command_imports_no_other_and_help_imports_no_tables() -> None:
    code = (
        "import sys; from warpspace.cli.main import cli; cli.commands['scenes'];"
        "known = [n.rpartition('.')[2] for n in sys.modules if 'cli.commands.' in n];"
        "print(known, 'rich' in sys.modules);"
        "list(cli.commands.values()); print('rich' in sys.modules, 'numpy' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.splitlines() == ["['scenes'] False", "False False"]
