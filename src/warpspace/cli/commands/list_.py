"""Command `list`: the bundled scenes and machines."""

from typing import Literal

import click

from warpspace.analysis.blocks import Column
from warpspace.cli.options import json_option, print_json
from warpspace.cli.tables import print_table, print_text

Kind = Literal["scenes", "machines"]


@click.command("list")
@click.argument("kind", type=click.Choice(("scenes", "machines")), required=False)
@json_option
def list_(kind: Kind | None, *, as_json: bool) -> None:
    """List the bundled scenes and machines, or one of both.

    A scene takes a machine by its name, machine = "scara"; machine_NAME is the scene that shows it.
    """
    found = {one: _found(one) for one in ("scenes", "machines") if kind in (None, one)}
    if as_json:
        print_json(found)
        return
    for one, rows in found.items():
        if kind is None:
            print_text(one)
        lines = [line for row in rows for line in _lines(row)]
        print_table((Column(leads=True), Column(), Column(wraps=True)), lines, indent=0)


def _found(kind: Kind) -> list[dict[str, str | None]]:
    from warpspace.scene.library import load_scene, scene_names
    from warpspace.scene.machines import load_machine, machine_names, machine_picture

    if kind == "scenes":
        return [{"name": name, "title": load_scene(name).title} for name in scene_names()]
    pictures = {name: machine_picture(name) for name in machine_names()}
    return [
        {
            "name": machine.name,
            "title": machine.title,
            "chain": str(machine.chain),
            "source": machine.source,
            "picture": str(picture) if picture else None,
        }
        for machine, picture in ((load_machine(name), at) for name, at in pictures.items())
    ]


def _lines(row: dict[str, str | None]) -> list[tuple[str, str, str]]:
    first = (row["name"] or "", row.get("chain") or "", row["title"] or "")
    more = [text for text in (row.get("source"), row.get("picture")) if text]
    return [first, *(("", "", text) for text in more)]
