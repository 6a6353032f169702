"""Command `machines`: list the bundled machines."""

import click

from warpspace.cli.options import json_option, print_json
from warpspace.cli.tables import Column, print_table


@click.command()
@json_option
def machines(*, as_json: bool) -> None:
    """List the bundled machines with their pictures.

    A scene takes one by its name, machine = "scara"; machine_NAME is the scene that shows it.
    """
    from warpspace.scene.machines import load_machine, machine_names, machine_picture

    rows = [(load_machine(name), machine_picture(name)) for name in machine_names()]
    if as_json:
        print_json(
            {
                "machines": [
                    {
                        "name": machine.name,
                        "title": machine.title,
                        "chain": str(machine.chain),
                        "source": machine.source,
                        "picture": str(picture) if picture else None,
                    }
                    for machine, picture in rows
                ]
            }
        )
        return
    lines: list[tuple[str, str, str]] = []
    for machine, picture in rows:
        lines.append((machine.name, str(machine.chain), machine.title))
        lines.append(("", "", machine.source))
        if picture:
            lines.append(("", "", str(picture)))
    print_table((Column(leads=True), Column(), Column(wraps=True)), lines, indent=0)
