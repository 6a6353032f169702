"""examples/deployment/nginx.conf with a real nginx, TLS, two servers and many visitors."""

import asyncio
import http.client
import re
import shutil
import socket as sockets
import ssl
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from http.cookies import SimpleCookie
from pathlib import Path

from page_client import App, Tab, free_port, running_app, wait_for
from reliability.doors import TOKEN, UPGRADE
from reliability.outcome import Outcome

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "deployment" / "nginx.conf"
NAME = "review.example"
WHOLE = """
daemon off; master_process off; pid {folder}/nginx.pid; error_log {folder}/error.log;
events {{}}
http {{
    access_log off; client_body_temp_path {folder}/body; proxy_temp_path {folder}/proxy;
    fastcgi_temp_path {folder}/f; uwsgi_temp_path {folder}/u; scgi_temp_path {folder}/s;
{site}
}}
"""


@dataclass(frozen=True)
class Site:
    https: int
    http: int
    trust: ssl.SSLContext
    servers: tuple[App, ...]

    @property
    def host(self) -> str:
        return f"{NAME}:{self.https}"


@dataclass(frozen=True)
class Answer:
    status: int
    cookies: SimpleCookie

    @property
    def pairs(self) -> str:
        return "; ".join(f"{name}={value.value}" for name, value in self.cookies.items())

    @property
    def server(self) -> int | None:
        """Port of the server that has answered: its cookie is named after it."""
        ports = [re.fullmatch(r"warpspace_token_(\d+)", name) for name in self.cookies]
        return next((int(found[1]) for found in ports if found), None)


@contextmanager
def site() -> Iterator[Site]:
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        https, plain = free_port(), free_port()
        servers: list[App] = []
        for number in range(2):
            (folder / str(number)).mkdir()
            options = ("--token", TOKEN, "--allow-host", f"{NAME}:{https}")
            servers.append(stack.enter_context(running_app(*options, folder=folder / str(number))))
        trust = _certificate(folder)
        text = EXAMPLE.read_text("utf-8")
        for server, port in zip(servers, ("8081", "8082"), strict=True):
            text = text.replace(f"127.0.0.1:{port} ", f"{server.url[5:]} ")
        text = re.sub(r"/etc/ssl/review\.example", f"{folder}/cert", text)
        text = text.replace("listen 443", f"listen 127.0.0.1:{https}")
        text = text.replace("listen 80", f"listen 127.0.0.1:{plain}")
        (folder / "nginx.conf").write_text(WHOLE.format(folder=folder, site=text), "utf-8")
        nginx = subprocess.Popen(
            [_nginx(), "-p", str(folder), "-c", str(folder / "nginx.conf"), "-e", "stderr"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        stack.callback(nginx.wait, 10)
        stack.callback(nginx.terminate)
        wait_for(https, nginx)
        yield Site(https, plain, trust, tuple(servers))


def nginx_is_there() -> bool:
    return bool(_nginx() and shutil.which("openssl"))


def _nginx() -> str:
    return shutil.which("nginx", path="/usr/local/bin:/usr/bin:/usr/sbin:/usr/local/sbin") or ""


def _certificate(folder: Path) -> ssl.SSLContext:
    command = "openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj"
    subprocess.run(
        [*command.split(), f"/CN={NAME}", "-addext", f"subjectAltName=DNS:{NAME}",
         "-keyout", str(folder / "cert.key"), "-out", str(folder / "cert.pem")],
        check=True, capture_output=True,
    )  # fmt: skip
    return ssl.create_default_context(cafile=str(folder / "cert.pem"))


def ask(at: Site, path: str = "/", *, tls: bool = True, **headers: str) -> Answer:
    """Ask the proxy for a page; status 0 where it closes without an answer."""
    port, trust = at.https if tls else at.http, at.trust
    name = headers.get("Host", NAME).partition(":")[0]
    if name != NAME:  # a scanner does not look at the certificate
        trust = ssl.create_default_context()
        trust.check_hostname, trust.verify_mode = False, ssl.CERT_NONE
    asking = http.client.HTTPConnection(f"{NAME}:{port}")
    try:
        plain = sockets.create_connection(("127.0.0.1", port), 20)
        asking.sock = trust.wrap_socket(plain, server_hostname=name) if tls else plain
        lines = {key.replace("_", "-"): value for key, value in headers.items()}
        asking.request("GET", path, headers={**lines, "Connection": "close"})
        found = asking.getresponse()
        found.read()
        cookies: SimpleCookie = SimpleCookie()
        for line in found.headers.get_all("Set-Cookie") or []:
            cookies.load(line)
        return Answer(found.status, cookies)
    except (http.client.HTTPException, OSError):
        return Answer(0, SimpleCookie())
    finally:
        asking.close()


async def drag(at: Site, cookies: str) -> float:
    through = App(
        f"wss://{NAME}:{at.https}", at.servers[0].process, at.servers[0].path,
        headers={"Cookie": cookies, "Origin": f"https://{at.host}"}, trust=at.trust,
        address=("127.0.0.1", at.https),
    )  # fmt: skip
    async with Tab(through) as tab:
        return await tab.answer_s(7.5)


def run(count: int) -> Outcome:
    if not nginx_is_there():
        return Outcome(0, "", ["nginx or openssl is not installed"])
    faults: list[str] = []
    with site() as at:
        _try_doors(at, faults)
        visitors: list[tuple[str, int | None]] = []
        for _ in range(count):
            first = ask(at, f"/?token={TOKEN}")
            if first.status != 200 or len(first.cookies) != 2:
                faults.append(f"the right token: {first.status}, cookies {first.pairs}")
                break
            if not all(morsel["secure"] for morsel in first.cookies.values()):
                faults.append(f"a cookie is not secure: {first.cookies.output()}")
            again = [ask(at, f"/?token={TOKEN}", Cookie=first.pairs).server for _ in range(2)]
            if set(again) != {first.server}:
                faults.append(f"a visitor was sent from {first.server} to {again}")
            visitors.append((first.pairs, first.server))
        used = {server for _, server in visitors}
        if count >= 20 and len(used) != 2:
            faults.append(f"all visitors are at {used}")
        slowest = max(asyncio.run(drag(at, pairs)) for pairs, _ in visitors[:5])
        faults += _lose_one(at, visitors)
    return Outcome(
        len(visitors),
        f"each always at one of {len(used)} servers, a slider answered in {slowest:.2f} s through"
        " TLS; foreign hosts, origins and tokens refused; a lost server moves its visitors only",
        faults[:10],
    )


def _try_doors(at: Site, faults: list[str]) -> None:
    valid = f"/?token={TOKEN}"
    expected = {
        "no token": (ask(at), 403),
        "wrong token": (ask(at, f"/?token={TOKEN[::-1]}"), 403),
        "no token for the socket": (ask(at, **UPGRADE), 403),
        "foreign origin": (ask(at, valid, Origin="https://evil.example"), 403),
        "origin without TLS": (ask(at, valid, Origin=f"http://{NAME}"), 403),
        "own origin": (ask(at, valid, Origin=f"https://{at.host}"), 200),
        "foreign host": (ask(at, valid, Host="evil.example"), 0),
        "without TLS": (ask(at, valid, tls=False), 301),
    }
    for what, (answer, status) in expected.items():
        if answer.status != status:
            faults.append(f"{what}: {answer.status} in place of {status}")


def _lose_one(at: Site, visitors: list[tuple[str, int | None]]) -> list[str]:
    at.servers[0].process.kill()
    faults: list[str] = []
    for pairs, server in visitors:
        answer = ask(at, "/", Cookie=pairs)
        if answer.status != 200:
            faults.append(f"after a loss, a visitor of {server}: {answer.status}")
        if ask(at, f"/?token={TOKEN}", Cookie=pairs).status != 200:
            faults.append("after a loss, the link does not open")
    return faults
