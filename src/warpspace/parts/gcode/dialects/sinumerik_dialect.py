"""SINUMERIK."""

from warpspace.parts.gcode.codes import ignore, modal
from warpspace.parts.gcode.control import MM_PER_INCH
from warpspace.parts.gcode.cycles import CYCLES, Cycles
from warpspace.parts.gcode.dialects.dialect import Dialect, read_table

FRAMES = "TRANS", "ATRANS", "ROT", "AROT", "MIRROR", "AMIRROR"
SINUMERIK = Dialect(
    "sinumerik",
    r"^%_N_|(?<![A-Z])(?:A?(?:TRANS|ROT|MIRROR|SCALE)|SUPA|M?CALL|CYCLE\d+"
    r"|TRAORI|TRAFOOF|STOPRE|MSG)(?![A-Z])|G500|G6(?:0[123]|4[1-5])(?!\d)|=\s*[AID]C(?![A-Z])|(?:CR|RND|CH[RF])\s*="
    r"|T\s*=\s*\"",
    read_table(
        """
        G60 G500 G601 G602 G603 G621 G641 G642 G643 G644 G645 G450 G451 BRISK SOFT DRIVE:
        G25 G26: S!
        FFWON FFWOF CFC CFTCP CFIN STOPRE COMPOF DYNNORM DYNPOS DYNROUGH DYNSEMIFIN DYNFINISH:
        FNORM KONT NORM FIFOCTRL STARTFIFO STOPFIFO MSG WORKPIECE SETAL:
        """
    ),
    {
        **dict.fromkeys(FRAMES, Cycles.program_frame),
        **dict.fromkeys(("TRAORI", "TRAFOOF"), Cycles.transform),
        "CYCLE800": Cycles.swivel_cycle,
        **dict.fromkeys(("SUPA", "G153"), ignore),
        **dict.fromkeys(("G70", "G700"), modal("unit_mm", MM_PER_INCH)),
        **dict.fromkeys(("G71", "G710"), modal("unit_mm", 1.0)),
        **dict.fromkeys(("G58", "G59", "G10", "G52", "G68", "G92", "G92.1", "G43", *CYCLES)),
        **dict.fromkeys(
            ("G43.4", "G50.1", "G51.1", "G53.1", "G54.1", "G68.2", "M97", "M98", "M99")
        ),
    },
    once={**{code: code for code in (*FRAMES, "CYCLE800")}, "SUPA": "G53", "G153": "G53"},
    comment=r"^;\$PATH",
)
