"""Spelling of numbers with their sign, and of large counts."""

from warpspace.picture.words import MINUS, THIN_SPACE


def signed(value: float, digits: int = 2) -> str:
    """Spell a number with its sign; zero has none."""
    text = f"{value:+.{digits}f}"
    if float(text) == 0.0:
        text = f"{0.0:.{digits}f}"
    return text.replace("-", MINUS)


def small(value: float) -> str:
    """Spell a signed number that may be tiny: to four decimals, below them in powers of ten."""
    if value == 0.0:
        return "0"
    return (f"{value:+.4f}" if abs(value) >= 5e-5 else f"{value:+.0e}").replace("-", MINUS)


def thousands(count: int) -> str:
    """Spell a large count with thin spaces: ``20 000``."""
    return f"{count:,}".replace(",", THIN_SPACE)
