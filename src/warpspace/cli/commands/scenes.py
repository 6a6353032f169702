"""Command `scenes`: list the bundled scenes."""

import click

from warpspace.cli.options import json_option, print_json
from warpspace.cli.tables import Column, print_table


@click.command()
@json_option
def scenes(*, as_json: bool) -> None:
    """List the bundled scenes."""
    from warpspace.scene.library import load_scene, scene_names

    titles = {name: load_scene(name).title for name in scene_names()}
    if as_json:
        rows = [{"name": name, "title": title} for name, title in titles.items()]
        print_json({"scenes": rows})
        return
    print_table((Column(leads=True), Column(wraps=True)), list(titles.items()), indent=0)
