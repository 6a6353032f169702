"""Writers that are killed at any moment: the old file or the new one, never a piece, no litter."""

import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from reliability.outcome import Outcome, run_module

SCENES = ("dvf5000_first", "dvf5000_second")
LONGEST_S = 0.2


def _writers() -> dict[str, Callable[[int, Path], None]]:
    import numpy as np

    from warpspace.outputs.exports.fields import write_rows
    from warpspace.outputs.exports.formats import write_export
    from warpspace.outputs.file_output import write_atomically
    from warpspace.picture.model import evaluate_picture
    from warpspace.scene.library import load_scene
    from warpspace.scene.scene_writer import scene_to_toml

    scenes = [load_scene(name) for name in SCENES]
    pictures = [evaluate_picture(scene, grid=9) for scene in scenes]
    texts = [scene_to_toml(scene) for scene in scenes]

    def toml(number: int, path: Path) -> None:
        with write_atomically(path) as temporary:
            temporary.write_text(texts[number], encoding="utf-8")

    def parquet(number: int, path: Path) -> None:
        with write_rows(path, {"machine": "integer", "error_um": "number"}) as append:
            for block in range(20):
                machine = np.arange(1000) + 1000 * block
                append({"machine": machine, "error_um": machine * (1.0 + number)})

    def export(number: int, path: Path) -> None:
        write_export(pictures[number], path)

    return {"x.toml": toml, "x.parquet": parquet, "x.csv": export, "x.vts": export, "x.glb": export}


def run(count: int) -> Outcome:
    with tempfile.TemporaryDirectory() as folder:
        last, faults = run_module("kills", str(count), folder)
        if not last:
            return Outcome(0, "", faults)
        left = [path.name for path in Path(folder).iterdir() if path.name.startswith(".")]
        faults += [f"left behind: {name}" for name in left]
        done, caught = (int(word) for word in last.split()[1:])
        return Outcome(
            done,
            f"each file old or new; {caught} were hit with a temporary file beside it, which the"
            " next run removed",
            faults,
        )


def _serve(count: int, folder: Path) -> None:
    writers = _writers()
    chance = random.Random(14)
    allowed: dict[str, list[bytes]] = {}
    for name, write in writers.items():
        contents: list[bytes] = []
        for number in range(2):
            write(number, folder / name)
            contents.append((folder / name).read_bytes())
        allowed[name] = contents
    caught = 0
    for kill in range(count):
        name = chance.choice(list(writers))
        before = (folder / name).read_bytes()
        child = os.fork()
        if child == 0:
            with suppress(BaseException):
                for number in range(10**9):
                    writers[name](number % 2, folder / name)
            os._exit(1)
        time.sleep(chance.uniform(0.0, LONGEST_S))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        caught += any(path.name.startswith(".warpspace-") for path in folder.iterdir())
        if before not in allowed[name] or (folder / name).read_bytes() not in allowed[name]:
            print(f"fault {name} is in pieces after kill {kill}", flush=True)
        if kill % 5 == 4 or kill == count - 1:
            writers["x.toml"](0, folder / "x.toml")
            left = [path.name for path in folder.iterdir() if path.name.startswith(".")]
            if left:
                print(f"fault the next run left {left} after kill {kill}", flush=True)
    print(f"done {count} {caught}", flush=True)


if __name__ == "__main__":
    _serve(int(sys.argv[1]), Path(sys.argv[2]))
