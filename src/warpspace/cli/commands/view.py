"""Command `view`: the app in the browser."""

import os
import sys

import click

from warpspace.cli.options import scene_argument
from warpspace.cli.tables import echo


@click.command()
@scene_argument(default="dvf5000_first")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address to serve on. Anything but this machine's own is open to the network; the link"
    " that is printed then carries a token, which the app asks for.",
)
@click.option("--port", type=int, help="Port to serve on.  [the next free one from 8080]")
@click.option(
    "--shared",
    is_flag=True,
    help="One review for all: every tab shows the same state and may change it.",
)
@click.option(
    "--allow-host",
    "allow_hosts",
    multiple=True,
    metavar="NAME",
    help="A further name the page is reached by, for instance that of a proxy. May be repeated.",
)
@click.option(
    "--token",
    help="Ask for this token: 12 or more letters, digits and . _ ~ -"
    "  [a random one, with a --host that other machines reach]",
)
@click.option(
    "--no-token",
    is_flag=True,
    help="Ask nobody for a token: whoever reaches --host sees the scenes and can use the app.",
)
@click.option("--no-browser", is_flag=True, help="Only print the address of the page.")
def view(
    scene: str,
    host: str,
    port: int | None,
    allow_hosts: tuple[str, ...],
    token: str | None,
    *,
    shared: bool,
    no_token: bool,
    no_browser: bool,
) -> None:
    """Open SCENE in the browser, with a slider per error.

    SCENE is dvf5000_first where it is left out.
    """
    # Before numpy is loaded: a slider move is one short product, and threads of OpenBLAS that spin
    # for it beside a browser that draws in software make it thirty times slower.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from warpspace.app.server.doors import Access
    from warpspace.app.server.run import run_viewer
    from warpspace.bodies.own_meshes import check_meshes
    from warpspace.cli.services import build_services
    from warpspace.scene.library import load_scene, scene_names

    shown = load_scene(scene)
    check_meshes(shown.machine)
    bundled = {name: shown if name == scene else load_scene(name) for name in scene_names()}
    run_viewer(
        shown,
        {loaded.title: loaded for loaded in bundled.values()},
        host=host,
        port=port,
        shared=shared,
        services=build_services(),
        access=Access(allow_hosts, token, no_token=no_token),
        code=sys.stdout.isatty(),
        browser=not no_browser,
        say=echo,
        warn=lambda text: echo(text, err=True, fg="yellow"),
    )
