"""Commands whose outputs are kept: what a change of the inside must leave as it is."""

SCENES = (
    "dvf5000_first",
    "teach_squareness",
    "machine_printer_3d",
    "machine_nutating_head",
    "machine_gantry_mill",
    "fork_head_bc",
)
TOLERANCED = "dvf5000_general"
FEW = "--samples 2000 --seed 7"
LIMIT = f"--limit 60 --probability 0.9 {FEW}"

_EACH = {
    "check": "check {scene}",
    "field-json": "field {scene} --grid 3 --json",
    "field-text": "field {scene} --grid 3",
    "field-at": "field {scene} --at X=10 --exact --json",
    "field-csv": "field {scene} --grid 2 -o {out}/field.csv",
    "gains-json": "gains {scene} --json",
    "gains-text": "gains {scene} --csv {out}/gains.csv",
    "adjust-json": "adjust {scene} --grid 3 --count 2 --json",
    "adjust-text": "adjust {scene} --grid 3 --count 2 -o {out}/repaired.toml",
    "compensate": "compensate {scene} --grid 3 --format csv -o {out}/table.csv --json",
    "vts": "export {scene} --grid 3 -o {out}/field.vts",
    "glb": "export {scene} --grid 3 -o {out}/field.glb",
    "test-diagonals": "test diagonals {scene} --json",
}
_TESTS = ("ball-plate", "circular", "cone-frustum", "r-test", "squareness", "straightness")
_ONCE = {
    "scenes": "list scenes",
    "scenes-json": "list scenes --json",
    "check-json": "check dvf5000_first --json",
    "machines-json": "list machines --json",
    "formats-json": "import --formats --json",
    "tests": "test --list",
    "thesis-json": "thesis --json",
    "template": "import --template X -o {out}/template.csv",
    "new-machine": "new-machine wCAYFXZt -o {out}/new.toml",
    "compare-json": "compare dvf5000_first dvf5000_second --grid 3 --json",
    "compare-text": "compare dvf5000_first dvf5000_second --grid 3",
    "against-json": "check --against own dvf5000_first dvf5000_second --json",
    "against-text": "check --against own dvf5000_first",
    "contributions-json": f"contributions {TOLERANCED} --json",
    "contributions-text": f"contributions {TOLERANCED}",
    "montecarlo-json": f"montecarlo {TOLERANCED} {FEW} --json",
    "montecarlo-text": f"montecarlo {TOLERANCED} {FEW}",
    "montecarlo-max": f"montecarlo {TOLERANCED} {FEW} --over max --grid 3 --json",
    "montecarlo-rows-json": f"montecarlo {TOLERANCED} {FEW} --rows --tolerance EXX=5,10 --json",
    "montecarlo-rows-text": f"montecarlo {TOLERANCED} {FEW} --rows --tolerance EXX=5,10",
    "allocate-json": f"allocate {TOLERANCED} {LIMIT} --json",
    "allocate-text": f"allocate {TOLERANCED} {LIMIT} -o {{out}}/allocated.toml",
    "concepts-json": f"concepts {TOLERANCED} dvf5000_proposed {FEW} --json",
    "concepts-text": f"concepts {TOLERANCED} dvf5000_proposed {FEW}",
    "circular-text": "test circular dvf5000_first",
    "positioning": "test positioning dvf5000_first --json",
    "rotary": "test rotary-axis dvf5000_first --json",
    "klipper": "compensate machine_printer_3d --format klipper -o {out}/skew.cfg",
    "sinumerik": "compensate dvf5000_first --format sinumerik-cec --grid 3 -o {out}/cec.spf",
    "convert": "convert dvf5000_first --to component_errors=before_motion -o {out}/converted.toml",
    "report": "report teach_squareness --grid 5 -o {out}/report.html",
    "field-points": "field dvf5000_first " + " ".join(f"--at X={x}" for x in range(25)),
    "field-relative": "field teach_tilted_c --at X=9,B=-30,C=60 --loop relative --frame workpiece",
    "adjust-limits": "adjust dvf5000_first --objective max --adjustable all --count 2 --grid 3"
    " --limit ±50 --limit ea0z=±10,EAY=20 --json",
    "adjust-none": "adjust dvf5000_nominal --grid 3",
    "allocate-fixed": f"allocate dvf5000_proposed --limit 60 --fixed EXX,eyx --fixed EZX {FEW}"
    " --cost EA0Z=20,EB0Z=20 --loop relative --json",
    **{f"test-{name}": f"test {name} dvf5000_first --json" for name in _TESTS},
    "calibrate": "calibrate fork_head_bc --data tcp_on.csv --kind sphere-tcp --next 1"
    " --csv {out}/r.csv",
    "calibrate-priors": "calibrate fork_head_bc --data tcp_on.csv --kind sphere-tcp --priors",
    "diagnose": "diagnose fork_head_bc --data tcp_on.csv --kind sphere-tcp --noise 30 --next 1",
    "template-over": "import --template Y --positions=-200,0,200 --over z=-400,-100",
    "template-positions": "import --template c --positions 1,2,4 -o {out}/u.csv",
    "gains-max": "gains dvf5000_first --max --json",
    "no-scene": "field dvf5000_frist",
    "bad-option": "adjust dvf5000_first --limit fourty",
}
CASES: dict[str, str] = {
    f"{name}-{scene}": line.replace("{scene}", scene)
    for name, line in _EACH.items()
    for scene in SCENES
} | _ONCE
DAILY = frozenset(f"{name}-dvf5000_first" for name in _EACH) | {
    "scenes", "thesis-json", "new-machine", "compare-text", "contributions-text", "montecarlo-text",
    "allocate-text", "concepts-text", "circular-text", "rotary", "klipper", "convert",
    "field-relative", "adjust-limits", "calibrate", "diagnose", "bad-option",
}  # fmt: skip
"""What `make test` runs of them."""
