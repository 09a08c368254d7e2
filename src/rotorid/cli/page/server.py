"""The page's server: for this computer alone, and for whoever has the address with its token.

A browser lets any site send requests to 127.0.0.1. So the token is part of every path, the Host header must be this
address (a site's name that is made to lead here has its own), and what a browser says comes from another site is
refused. Nothing is loaded from elsewhere.
"""

from __future__ import annotations

import asyncio
import errno
import json
import secrets
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route

from rotorid.cli.page.jobs import Looker, Queue
from rotorid.cli.page.looks import Wishes
from rotorid.cli.page.shelf import WORKING, NotThere, Shelf, safe_name
from rotorid.errors import InputError
from rotorid.recordings.importers.logfile import importers

LARGEST_LOG = 500_000_000
"""Bytes of a log that the page takes; larger ones are for the command line."""
_LARGEST_FORM = 2_000_000
_KINDS = {"page.html": "text/html", "page.css": "text/css", "page.js": "text/javascript"}
_HEADERS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_GONE = "There is no such thing here; it may have been deleted."
_SHOWN = ("report.html", "changes.html")
"""Files of an answer that a browser shows; their own policy lets no script run but theirs, and nothing be sent."""


class Guard:
    """Lets through what is asked of this address, with its token, by this computer's own pages."""

    def __init__(self, app: Callable, token: str, hosts: tuple[str, ...]) -> None:
        self._app, self._token, self._hosts = app, token, hosts

    async def __call__(self, scope: dict, receive: Callable, send: Callable) -> None:
        """An ASGI application."""
        if scope["type"] == "http" and (why := self._refusal(scope)):
            await PlainTextResponse(why + "\n", 403, _HEADERS)(scope, receive, send)
            return
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
            return
        await self._app(scope, receive, send)

    def _refusal(self, scope: dict) -> str:
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        if headers.get("host", "") not in self._hosts:
            return "This is another address than the one that rotorid page printed."
        first = scope["path"].removeprefix("/").partition("/")[0]
        if not secrets.compare_digest(first.encode(), self._token.encode()):
            return "The address has no token, or an old one; take it from the terminal where rotorid page runs."
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return "Another site asked for this."
        origin = headers.get("origin")
        # a sandboxed report has the origin "null", and may ask for nothing
        if origin is not None and urlsplit(origin).netloc not in self._hosts:
            return "Another site asked for this."
        return ""


def application(shelf: Shelf, token: str, hosts: tuple[str, ...], largest_log: int = LARGEST_LOG) -> Guard:
    """The page of a shelf as an ASGI application, below `/TOKEN/`; `hosts` are the Host headers that it answers."""
    looker, queue = Looker(), Queue(shelf)

    @asynccontextmanager
    async def life(app: Starlette) -> AsyncIterator[None]:
        work = asyncio.create_task(queue.work())
        first = asyncio.create_task(looker.ready())
        yield
        for task in (work, first):
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task
        await looker.stop()

    def shown(id_: str) -> dict[str, Any]:
        """The state of a set with what is only known while it is at work."""
        state = shelf.state(id_)
        if state["stage"] in WORKING:
            state |= {"before": queue.before(id_), "now": queue.lines.get(id_, {})}
        state["files"] = [{"name": name, "bytes": path.stat().st_size} for name, path in shelf.files(id_).items()]
        return state

    async def page(request: Request) -> Response:
        name = request.path_params.get("name", "page.html")
        if name not in _KINDS:
            raise NotThere(name)
        text = files("rotorid.cli.page").joinpath("files", name).read_text(encoding="utf-8")
        if name == "page.html":
            text = text.replace("{{ formats }}", escape(_formats()))
        return Response(text, media_type=_KINDS[name], headers={"Content-Security-Policy": _POLICY})

    async def listing(request: Request) -> Response:
        keys = ("id", "name", "made_s", "stage", "sentence")
        return JSONResponse([{key: state[key] for key in keys} for state in shelf.states()])

    async def new(request: Request) -> Response:
        return JSONResponse({"id": shelf.new()}, 201)

    async def one(request: Request) -> Response:
        return JSONResponse(shown(request.path_params["id"]))

    async def delete(request: Request) -> Response:
        queue.stop(request.path_params["id"])
        await asyncio.to_thread(shelf.delete, request.path_params["id"])
        return Response(status_code=204)

    async def take(request: Request) -> Response:
        """A log, byte by byte as it comes: it takes its name only when all of it is there.

        Of a ROS 2 bag that is a folder, `bag` names the folder that the file belongs to.
        """
        id_, name = request.path_params["id"], request.path_params["name"]
        _not_at_work(shelf, id_)
        said = f"{safe_name(name)}: has more than {largest_log / 1e6:.0f} MB, the most that the page takes; "
        too_large = InputError(said + "use `rotorid import` for it")
        if int(request.headers.get("content-length") or 0) > largest_log:
            raise too_large
        coming, size = shelf.path(id_) / f".coming-{secrets.token_hex(6)}", 0
        try:
            with open(coming, "xb") as file:
                async for part in request.stream():
                    size += len(part)
                    if size > largest_log:
                        raise too_large
                    file.write(part)
            if not size:
                raise InputError(f"{safe_name(name)}: the file is empty")
            place = shelf.place_for(id_, name, request.query_params.get("bag", ""))
            coming.rename(place)
        finally:
            coming.unlink(missing_ok=True)
        logs = [path.name for path in shelf.logs(id_)]
        shelf.change(id_, logs=logs, name=_name(logs))
        return JSONResponse({"name": place.name}, 201)

    async def look(request: Request) -> Response:
        id_ = request.path_params["id"]
        _not_at_work(shelf, id_)
        wishes = Wishes.of(await _form(request))
        if not shelf.logs(id_):
            raise InputError("no log of this set has come; drop it again")
        found = await looker.look(shelf, id_, wishes)
        _not_at_work(shelf, id_)  # it may have been asked meanwhile
        known = {"wishes": vars(wishes), "said": [], "exports": [], "page": ""}
        if "look" in found:
            shelf.change(id_, stage="looked", sentence="", look=found["look"], **known)
        else:
            stage = "looked" if shelf.state(id_).get("look") else "failed"
            shelf.change(id_, stage=stage, sentence=found["refused"], **known)
        return JSONResponse(shown(id_))

    async def ask(request: Request) -> Response:
        id_ = request.path_params["id"]
        _not_at_work(shelf, id_)
        said = await _form(request)
        wishes, question = Wishes.of(said), said.get("question")
        logs = [path.name for path in shelf.logs(id_)]
        asked = said.get("in_question") or (logs[-1] if logs else "")
        if question not in ("verdict", "compare"):
            raise InputError("the question is expected to be verdict or compare")
        if not logs:
            raise InputError("no log of this set has come; drop it again")
        if question == "compare" and (len(logs) < 2 or asked not in logs):
            raise InputError("a comparison takes two logs or more, one of them in question")
        shelf.change(id_, wishes=vars(wishes), logs=logs, in_question=asked)
        queue.ask(id_, question)
        return JSONResponse(shown(id_), 202)

    async def stop(request: Request) -> Response:
        queue.stop(request.path_params["id"])
        return JSONResponse(shown(request.path_params["id"]))

    async def file(request: Request) -> Response:
        name = request.path_params["name"]
        if (path := shelf.files(request.path_params["id"]).get(name)) is None:
            raise NotThere(name)
        if name in _SHOWN and "download" not in request.query_params:
            return FileResponse(path, media_type="text/html")
        return FileResponse(path, filename=name, content_disposition_type="attachment")

    here = [
        Route("/", page), Route("/{name}", page),
        Route("/api/sets", listing, methods=["GET"]), Route("/api/sets", new, methods=["POST"]),
        Route("/api/sets/{id}", one, methods=["GET"]), Route("/api/sets/{id}", delete, methods=["DELETE"]),
        Route("/api/sets/{id}/logs/{name}", take, methods=["PUT"]),
        Route("/api/sets/{id}/look", look, methods=["POST"]), Route("/api/sets/{id}/ask", ask, methods=["POST"]),
        Route("/api/sets/{id}/stop", stop, methods=["POST"]), Route("/api/sets/{id}/files/{name}", file),
    ]  # fmt: skip
    for route in here:
        route.app = _one_sentence(route.app)
    no_such = {number: _no_such for number in (404, 405)}
    app = Starlette(routes=[Mount(f"/{token}", routes=here)], lifespan=life, exception_handlers=no_such)
    return Guard(app, token, hosts)


def _formats() -> str:
    """What importers there are, the one that takes any table last."""
    known = sorted(importers().values(), key=lambda importer: importer.name == "table")
    return "; ".join(importer.title.replace("`", "") for importer in known)


async def _no_such(request: Request, error: Exception) -> Response:
    return JSONResponse({"sentence": _GONE}, getattr(error, "status_code", 404), _HEADERS)


def _not_at_work(shelf: Shelf, id_: str) -> None:
    if shelf.state(id_)["stage"] in WORKING:
        raise InputError("this set is being worked on; stop it first, or wait")


def _name(logs: list[str]) -> str:
    return logs[0] if len(logs) == 1 else f"{logs[0]} and {len(logs) - 1} more" if logs else ""


async def _form(request: Request) -> Any:
    """What the form sent, as JSON."""
    if request.headers.get("content-type", "").partition(";")[0] != "application/json":
        raise InputError("the form is expected as JSON")
    data = b""
    async for part in request.stream():
        data += part
        if len(data) > _LARGEST_FORM:
            raise InputError(f"the form has more than {_LARGEST_FORM / 1e6:.0f} MB")
    try:
        said = json.loads(data or b"{}")
    except ValueError:
        raise InputError("the form is expected as JSON") from None
    if not isinstance(said, dict):
        raise InputError("the form sent no values")
    return said


def _one_sentence(app: Callable[..., Awaitable[None]]) -> Callable[..., Awaitable[None]]:
    """The same, with a sentence for what went wrong, and the page's headers on every answer."""

    async def answered(scope: dict, receive: Callable, send: Callable) -> None:
        async def headed(message: dict) -> None:
            if message["type"] == "http.response.start":
                own = {name.lower() for name, _ in message["headers"]}
                more = [(n.encode(), v.encode()) for n, v in _HEADERS.items() if n.lower().encode() not in own]
                message = message | {"headers": [*message["headers"], *more]}
            await send(message)

        try:
            return await app(scope, receive, headed)
        except ClientDisconnect:
            return None
        except NotThere:
            status, said = 404, _GONE
        except InputError as error:
            status, said = 400, str(error)
        except OSError as error:
            full = error.errno in (errno.ENOSPC, errno.EDQUOT)
            status, said = 507 if full else 500, f"This computer could not keep it: {(error.strerror or '').lower()}."
        await JSONResponse({"sentence": said}, status)(scope, receive, headed)
        return None

    return answered


def default_folder(environment: dict[str, str]) -> Path:
    """Where the page keeps its sets if nobody says otherwise: where this system keeps the data of programs."""
    data = environment.get("LOCALAPPDATA") or environment.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(data) / "rotorid" / "page"
