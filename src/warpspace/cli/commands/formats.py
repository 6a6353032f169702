"""Command `formats`: list the files that can be imported or written as compensation."""

import click

from warpspace.cli.options import json_option, print_json
from warpspace.cli.tables import Column, print_table


@click.command()
@json_option
def formats(*, as_json: bool) -> None:
    """List the formats of data, and what each holds.

    `warpspace import` reads all of them; `warpspace compensate` writes those marked so.
    """
    from warpspace.formats.registry import formats as all_formats

    found = all_formats()
    if as_json:
        print_json(
            {
                "formats": [
                    {
                        "name": one.name,
                        "title": one.title,
                        "reads": True,
                        "writes": one.can_write,
                        "controller": one.tables is not None,
                        "holds": one.holds,
                        "units": one.units,
                        "grid": one.grid,
                        "limits": one.limits,
                        "points": one.points,
                        "most_points": one.most_points,
                        "orientation": one.orientation,
                        "variants": list(one.variants),
                        "endings": list(one.endings),
                        "source": one.source,
                    }
                    for one in found
                ]
            }
        )
        return
    rows: list[tuple[str, str, str]] = []
    for one in found:
        rows.append((one.name, "read, write" if one.can_write else "read", one.title))
        rows += [
            ("", "", f"{word}: {text}")
            for word, text in (
                ("holds", one.holds),
                ("units", one.units),
                ("grid", one.grid),
                ("limits", one.limits),
                ("variants", ", ".join(one.variants)),
                ("published", one.source),
            )
            if text
        ]
    print_table((Column(leads=True), Column(), Column(wraps=True)), rows, indent=0)
