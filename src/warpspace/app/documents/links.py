"""Links: a state as one word in the page's address.

It consists of letters and digits only, since viser's client writes the address anew when it starts
(which drops what stands behind a #, and would unpack an encoded value).
"""

import base64
import binascii

from warpspace.exceptions import OptionError

MAX_WORD = 8_000
"""Characters of a packed link: servers take request lines of 8 kB."""


def pack(link: str) -> str:
    """Spell a query string as one word that needs no escaping in an address."""
    return base64.urlsafe_b64encode(link.encode()).decode().rstrip("=")


def unpack(word: str) -> str:
    """Read what `pack` has written.

    Raises
    ------
    OptionError
        If it is something else, or longer than a link can be.
    """
    if len(word) > MAX_WORD:
        raise OptionError(
            f"the link is {len(word):,} characters long; expected at most {MAX_WORD:,}"
        )
    try:
        return base64.urlsafe_b64decode(word + "=" * (-len(word) % 4)).decode()
    except (binascii.Error, ValueError):
        raise OptionError("the link cannot be read; was it cut?") from None
