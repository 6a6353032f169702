"""Drilling cycles."""

from collections.abc import Sequence
from itertools import pairwise

from warpspace.machine.limits import MAX_CYCLE, MAX_CYCLE_MOVES, MIN_SPAN
from warpspace.parts.gcode.parsed import FEED, RAPID
from warpspace.parts.gcode.tilted_planes import TiltedPlanes

PECKING, TAPPING, STOPPING = {"G73", "G83"}, {"G74", "G84"}, {"G76", "G86", "G88", "G89"}
FED_BACK = TAPPING | {"G85", "G89"}  # cycles that leave the hole at the feed
CYCLES = "G81", "G82", "G85", *sorted(PECKING | TAPPING | STOPPING)


class Cycles(TiltedPlanes):
    """Drilling cycles of a control."""

    def drill(self) -> None:
        """Drill at the place of the line, K or L times: R plane, depth, pecks."""
        deep, motion = "XYZ"[self.across], self.motion
        stored = {deep, "R", "Q", "P"}
        if motion in PECKING and self.dialect == "haas":
            stored |= {*"IJK"}  # first peck, reduction, minimum
        elif motion in PECKING and "K" in self.words and "K" not in self.integers:
            expected = "repetitions without a decimal point, or the dialect haas (minimum peck)"
            self.refuse(f"K{self.words['K']:g}", f"expected {expected}")
        self.cycle |= {x: self.value(x) for x in stored & self.words.keys()}
        if deep not in self.index or not {deep, "R"} <= self.cycle.keys():
            self.refuse(motion, f"expected {deep} and R")
        index, letter = self.index[deep], "K" if self.words.keys() - stored >= {"K"} else "L"
        repeats = self.count(letter)
        self.pending -= self.letters - {deep}
        self.check_pending()
        initial = self.cycle.setdefault("initial", self.local()[index])
        clear = initial + self.cycle["R"]
        bottom = clear + self.cycle[deep]
        if self.absolute:
            clear, bottom = (self.place(deep, self.cycle[letter]) for letter in ("R", deep))
        depths = self.depths(clear - bottom)
        moves = repeats * 3 * (len(depths) + 1)
        if moves > MAX_CYCLE_MOVES:
            expected = f"at most {MAX_CYCLE_MOVES:,} moves in a line"
            self.refuse(f"{letter}{repeats}", f"{moves:,} moves; expected {expected}")
        if motion in TAPPING | STOPPING:  # the spindle is reversed, stops, or dwells
            self.uncorrectable.setdefault(self.line, motion)
        if motion in {"G73", "G76"}:
            unknown = "retraction of its pecks" if motion == "G73" else "shift at its bottom"
            self.remarks.setdefault(f"{motion} without the {unknown}", self.line)
        for _ in range(repeats):
            self.line_to({index: max(clear, self.local()[index])}, RAPID)
            self.line_to({**self.target(), index: self.local()[index]}, RAPID)
            for before, depth in pairwise([0.0, *depths]):
                if motion == "G83" or not before:
                    self.line_to({index: clear}, RAPID)
                    self.line_to({index: clear - before}, RAPID)
                self.line_to({index: max(bottom, clear - depth)}, FEED)
            if motion in FED_BACK:
                self.line_to({index: clear}, FEED)
            self.line_to({index: max(initial, clear) if self.to_initial else clear}, RAPID)

    def depths(self, depth: float) -> Sequence[float]:
        """Return the depths of the pecks of a hole below its R plane, mm."""
        if self.motion not in PECKING and depth >= 0.0:
            return [depth]
        peck, reduction, least = abs(self.cycle.get("Q", 0.0)), 0.0, 0.0
        if "I" in self.cycle and not peck:
            peck, reduction, least = (abs(self.cycle.get(letter, 0.0)) for letter in "IJK")
            least = max(least, MIN_SPAN)
        depths = [peck]
        while depths[-1] < depth and peck > 0.0 and len(depths) <= MAX_CYCLE:
            # equal pecks without the rounding of their sum
            peck = max(peck - reduction, min(peck, least))
            depths.append(depths[-1] + peck if reduction else peck * (len(depths) + 1))
        if depth < 0.0 or peck <= 0.0 or len(depths) > MAX_CYCLE:
            expected = f"a depth below R, in up to {MAX_CYCLE:,} pecks of Q above 0"
            self.refuse(self.motion, f"{depth:g} mm below R; expected {expected}")
        return depths

    def count(self, letter: str) -> int:
        """Return the number of repetitions."""
        value = self.words.get(letter, 1.0)
        if value < 0.0 or value % 1.0:
            self.refuse(f"{letter}{value:g}", "expected a whole number of repetitions")
        return int(value)
