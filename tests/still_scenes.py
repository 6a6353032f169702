"""Scenes of machines with fewer than two moving linear axes: their volume is a line or a point."""

from warpspace.scene.library import parse_scene
from warpspace.scene.model import Scene

_LINE = "[errors]\nEXX = { ramp = 10 }\nEZX = { ramp = 20 }\nEBX = 12.0\n"
_TABLE = "[errors]\nEXC = { harmonics = [[1, 10.0, 0.0]] }\nEX0C = 20.0\nEA0C = 10.0\n"
_BOX = '[machine]\nchain = "wCFXYZt"\n[workspace]\n'
TEXTS = {
    "wFXt": f'[machine]\nchain = "wFXt"\n{_LINE}',
    "wXFt": f'[machine]\nchain = "wXFt"\n{_LINE}',
    "wFZt": '[machine]\nchain = "wFZt"\n[errors]\nEXZ = { ramp = 10 }\nEAZ = 4.0\n',
    "wCFt": f'[machine]\nchain = "wCFt"\n{_TABLE}',
    "wCFt, traces": (
        f'[machine]\nchain = "wCFt"\n{_TABLE}'
        "[points_mm]\nworkpiece = [0, 100, 0]\ntraces = [[200, 0, 50], [0, 100, 0]]\n"
    ),
    "wFt, one still axis": '[machine]\nchain = "wFXt"\n[workspace]\nX = 20\n[errors]\nEXX = 5.0\n',
    "only X moves": f"{_BOX}X = [-275, 275]\nY = 0\nZ = -100\n{_LINE}",
    "only Y moves": f"{_BOX}X = 40\nY = [-100, 200]\nZ = -100\n[errors]\nEZY = {{ ramp = 9 }}\n",
    "only X stands still": f"{_BOX}X = 40\nY = [-100, 200]\nZ = [-300, -100]\n{_LINE}",
    "nothing moves": f"{_BOX}X = 20\nY = 0\nZ = -100\n{_LINE}",
    "nothing moves, no errors": f"{_BOX}X = 20\nY = 0\nZ = -100\n",
}


def still_scene(name: str) -> Scene:
    return parse_scene(f'title = "{name}"\n{TEXTS[name]}', name)
