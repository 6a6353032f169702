"""Links: a state as one word in the page's address.

It consists of letters and digits only, since viser's client writes the address anew when it starts
(which drops what stands behind a #, and would unpack an encoded value).
"""

import base64
import binascii

from warpspace.exceptions import OptionError


def pack(link: str) -> str:
    """Spell a query string as one word that needs no escaping in an address."""
    return base64.urlsafe_b64encode(link.encode()).decode().rstrip("=")


def unpack(word: str) -> str:
    """Read what `pack` has written.

    Raises
    ------
    OptionError
        If it is something else.
    """
    try:
        return base64.urlsafe_b64decode(word + "=" * (-len(word) % 4)).decode()
    except (binascii.Error, ValueError):
        raise OptionError("the link cannot be read; was it cut?") from None
