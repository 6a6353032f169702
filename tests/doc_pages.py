"""The Markdown pages of the project, and what stands in them."""

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
BUILT = ("_build", "gallery", "generated")


def pages() -> list[Path]:
    below = [path for path in DOCS.rglob("*.md") if not set(BUILT) & set(path.parts)]
    return sorted([*below, *(ROOT / name for name in ("README.md", "CONVENTIONS.md"))])


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"(?ms)^```{re.escape(language)}[^\n]*\n(.*?)^```", text)


def prose(text: str) -> str:
    return re.sub(r"^(```|:::+).*?^\1", "", text, flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", prose(page.read_text("utf-8")), re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.strip().lower()) for heading in headings)
    return {heading.replace(" ", "-") for heading in plain}


def links(page: Path) -> Iterator[tuple[str, str]]:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page.read_text("utf-8"))):
        if "://" not in target:
            file, _, anchor = target.partition("#")
            yield file, anchor


def entries(page: Path) -> Iterator[str]:
    """Give the entries of the tables of contents of a page."""
    for block in blocks(page.read_text("utf-8"), "{toctree}"):
        for line in block.splitlines():
            if line and not line.startswith(":"):
                titled = re.fullmatch(r".+ <(.+)>", line)
                yield titled.group(1) if titled else line


def section(page: Path, heading: str) -> str | None:
    text = page.read_text("utf-8")
    match = re.search(rf"(?ms)^#+ {re.escape(heading)}\n(.*?)(?=^#|\Z)", text)
    return None if match is None else match.group(1)
