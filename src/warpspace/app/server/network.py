"""Which address and port the app can serve on, checked before the server starts."""

import contextlib
import errno
import io
import ipaddress
import logging
import os
import socket
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from warpspace.app.server.doors import plain_address
from warpspace.exceptions import OptionError

DEFAULT_PORT = 8080
PORTS_TRIED = 100
MAX_PORT = 65535
NOBODY = 65534
LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


def resolve_host(host: str) -> str:
    """Turn a host name into an address of this machine."""
    try:
        found = socket.getaddrinfo(host or " ", None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError, ValueError):
        raise OptionError(
            f"--host {host!r} cannot be resolved; expected an address of this machine,"
            " for instance 127.0.0.1 (this machine only) or 0.0.0.0 (all networks)"
        ) from None
    return str(found[0][4][0])


def is_local(address: str) -> bool:
    return ipaddress.ip_address(address.partition("%")[0]).is_loopback


def is_everywhere(address: str) -> bool:
    return ipaddress.ip_address(address.partition("%")[0]).is_unspecified


def served_names(host: str, address: str) -> frozenset[str]:
    """List the names and addresses under which a page may ask for the app."""
    names = {host.lower(), plain_address(address)}
    if is_local(address):
        return frozenset(names | LOOPBACK_NAMES)
    own = socket.gethostname()
    if is_everywhere(address):
        return frozenset(names | LOOPBACK_NAMES | {own.lower()})
    with contextlib.suppress(OSError, UnicodeError):
        if address in {str(found[4][0]) for found in socket.getaddrinfo(own, None)}:
            names.add(own.lower())
    return frozenset(names)


def has_other_users() -> bool:
    """Tell whether others have an account on this machine, or are logged in to it."""
    if sys.platform == "win32":
        return False
    import pwd

    first = 501 if sys.platform == "darwin" else 1000
    people = {
        entry.pw_uid
        for entry in pwd.getpwall()
        if not entry.pw_shell.endswith(("/nologin", "/false"))
    }
    with contextlib.suppress(OSError):
        people |= {int(at.name) for at in Path("/run/user").iterdir() if at.name.isdecimal()}
    return any(first <= uid != NOBODY for uid in people - {os.getuid()})


def reachable_address(address: str) -> str:
    """Give the address by which other machines most likely reach one that stands for all."""
    if not is_everywhere(address):
        return address
    family, far = (
        (socket.AF_INET6, "2001:db8::1") if ":" in address else (socket.AF_INET, "192.0.2.1")
    )
    # no packet is sent: connecting a datagram socket only chooses the way out
    with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((far, 9))
        return str(probe.getsockname()[0])
    return address


def draw_code(link: str) -> str:
    import segno

    drawn = io.StringIO()
    segno.make_qr(link).terminal(drawn, compact=True)
    return drawn.getvalue().rstrip("\n")


def free_port(address: str, port: int | None) -> int:
    if port is not None and not 1 <= port <= MAX_PORT:
        raise OptionError(f"--port {port}: expected 1 to {MAX_PORT}")
    first = DEFAULT_PORT if port is None else port
    last = first + PORTS_TRIED - 1 if port is None else first
    for candidate in range(first, last + 1):
        error = _bind_error(address, candidate)
        if error is None:
            return candidate
        if error == errno.EADDRNOTAVAIL:
            raise OptionError(f"--host {address}: not an address of this machine")
        if error == errno.EACCES:
            raise OptionError(
                f"--port {candidate} needs administrator rights; expected one above 1023"
            )
        if error != errno.EADDRINUSE:
            raise OptionError(f"--port {candidate} on {address}: {os.strerror(error)}")
    if port is None:
        raise OptionError(f"ports {first} to {last} are all in use; free one of them")
    raise OptionError(
        f"--port {port} is in use by another program; leave --port out to take the next free one"
    )


def _bind_error(address: str, port: int) -> int | None:
    with socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET) as probe:
        if os.name == "posix":
            # as the server does: a port in TIME_WAIT is free
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as error:
            return error.errno or errno.EINVAL
    return None


def page_url(address: str, port: int) -> str:
    wildcard = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(address)  # noqa: S104
    host = wildcard or (f"[{address}]" if ":" in address else address)
    return f"http://{host}:{port}"


# --- A log that a client cannot fill --------------------------------------------------------------
# Of lines of one kind the first is written, the rest counted.

EVERY_S = 60.0
MOST_KINDS = 256
LONGEST_LINE = 300
OURS = "warpspace"


class RepeatedLines(logging.Filter):
    """Lets one line of a kind pass a minute; the next one says how many were left out.

    A kind is a logger, the first line of a message before its values are put in, and the type of
    what was raised. Libraries' tracebacks become one line; those of the app are kept.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._lock = threading.Lock()
        self._known: dict[tuple[str, str, str], tuple[float, int]] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Tell whether a line is written; shorten and complete it."""
        raised = record.exc_info[0] if record.exc_info else None
        name = raised.__name__ if raised is not None else ""
        kind = (record.name, str(record.msg).partition("\n")[0], name)
        now = self._clock()
        with self._lock:
            since, left_out = self._known.get(kind, (-EVERY_S, 0))
            if now - since < EVERY_S:
                self._known[kind] = (since, left_out + 1)
                return False
            if len(self._known) >= MOST_KINDS:
                self._known.clear()
            self._known[kind] = (now, 0)
        if not record.name.startswith(OURS):
            line = record.getMessage().partition("\n")[0]
            record.msg, record.args = line[:LONGEST_LINE] + (f" ({name})" if name else ""), ()
            record.exc_info = record.exc_text = record.stack_info = None
        if left_out:
            record.msg, record.args = f"{record.getMessage()} ({left_out} more before it)", ()
        return True


def limit_log() -> None:
    """Have all that the program logs to the terminal limited."""
    limit = RepeatedLines()
    for handler in (logging.lastResort, *logging.getLogger().handlers):
        if handler is not None:
            handler.addFilter(limit)
