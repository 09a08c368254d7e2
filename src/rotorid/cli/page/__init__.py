"""`rotorid page`: a page on one's own computer. Drop a log, read what it holds, ask, read the verdict."""

from __future__ import annotations

import os
import secrets
import socket
import sys
import threading
import time
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from rotorid.cli.console import one_sentence
from rotorid.errors import InputError

ADDRESS = "127.0.0.1"


def page(
    folder: Annotated[
        Path | None, typer.Option("--folder", help="Where the page keeps logs and answers; default your data folder.")
    ] = None,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port; 0 takes a free one.")] = 0,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Print the address, open nothing.")] = False,
) -> None:
    """Open a page in the browser: drop logs, read what they hold, get the verdict or what changed.

    The page is this computer's own (127.0.0.1): nothing leaves it, and only the address that is printed opens it. Logs
    and answers stay in the folder until you delete them on the page. Stop it with Ctrl-C.

    Examples:

    `rotorid page`

    `rotorid page --no-browser --folder my-flights`
    """
    with one_sentence():
        try:
            import uvicorn

            from rotorid.cli.page.server import application, default_folder
            from rotorid.cli.page.shelf import Shelf
        except ImportError:
            raise InputError("the page needs two packages more: pip install 'rotorid[page]'") from None
        place = folder or default_folder(dict(os.environ))
        with _alone(place), socket.socket(socket.AF_INET, socket.SOCK_STREAM) as bound:
            if os.name == "posix":
                bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                bound.bind((ADDRESS, port))
            except OSError as error:
                raise InputError(
                    f"port {port} cannot be had ({(error.strerror or '').lower()}); leave --port"
                ) from None
            number, token = bound.getsockname()[1], secrets.token_urlsafe(24)
            hosts = (f"{ADDRESS}:{number}", f"localhost:{number}")
            config = uvicorn.Config(
                application(Shelf(place), token, hosts), log_level="error", access_log=False, server_header=False,
                timeout_graceful_shutdown=2, ws="none",
            )  # fmt: skip
            server = uvicorn.Server(config)
            address = f"http://{ADDRESS}:{number}/{token}/"
            threading.Thread(target=_tell, args=(server, address, place, no_browser), daemon=True).start()
            server.run(sockets=[bound])
            if not server.started:
                raise InputError("the page could not be started")


def _tell(server, address: str, place: Path, no_browser: bool) -> None:
    """Say where the page is, as soon as it answers."""
    while not server.started:
        if server.should_exit:
            return
        time.sleep(0.02)
    typer.echo(f"The page: {address}\nIt keeps its sets in {place}. Stop it with Ctrl-C.")
    sys.stdout.flush()
    if not no_browser and not webbrowser.open(address):
        typer.echo("No browser could be opened; open the address yourself.", err=True)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keep other pages out of the folder; InputError where there is one."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    with open(folder / ".page", "ab") as file:
        try:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except ImportError:  # pragma: no cover - depends on the platform
            pass
        except BlockingIOError:
            raise InputError(f"{folder}: another rotorid page keeps its sets there; use it, or give --folder") from None
        except OSError:  # a file system without locks
            pass
        yield
