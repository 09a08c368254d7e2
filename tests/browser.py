"""Chromium without a window, driven through its own pipe: any width, keys, colour scheme, what the console says."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import time
from pathlib import Path
from types import TracebackType
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PATIENCE_S = 120


class Browser:
    """One page; `said` holds every console message and uncaught error."""

    def __init__(self, folder: Path) -> None:
        assert CHROMIUM is not None
        down, self._write = os.pipe()
        self._read, up = os.pipe()
        # Chromium reads commands from descriptor 3 and answers on 4, each message ended by a zero byte.
        command = f'exec "$0" "$@" 3<&{down} 4>&{up}'
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--remote-debugging-pipe"]
        options.append(f"--user-data-dir={folder / 'chromium'}")
        self._process = subprocess.Popen(
            ["bash", "-c", command, CHROMIUM, *options], pass_fds=(down, up), stderr=subprocess.DEVNULL
        )
        os.close(down)
        os.close(up)
        self._left, self._number, self._session = b"", 0, None
        self.said: list[str] = []
        self._events: list[str] = []
        target = self.do("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.do("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.do(f"{domain}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._process.terminate()
        self._process.wait(PATIENCE_S)
        os.close(self._write)
        os.close(self._read)

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._left:
            part = os.read(self._read, 1 << 16)
            if not part:
                raise RuntimeError("Chromium ended")
            self._left += part
        whole, self._left = self._left.split(b"\0", 1)
        return json.loads(whole)

    def _note(self, message: dict[str, Any]) -> None:
        method, details = message.get("method"), message.get("params", {})
        self._events.append(method or "")
        if method == "Runtime.consoleAPICalled":
            self.said.append(" ".join(str(a.get("value", a.get("description"))) for a in details["args"]))
        elif method == "Runtime.exceptionThrown":
            self.said.append(json.dumps(details["exceptionDetails"]))
        elif method == "Log.entryAdded":
            self.said.append(details["entry"]["text"])

    def do(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command of the DevTools protocol and wait for its answer."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self._note(answer)

    def open(self, page: Path, width: int, height: int = 900, dark: bool = False) -> None:
        """Show a file at a width in CSS pixels."""
        self.visit(page.resolve().as_uri(), width, height, dark)

    def visit(self, address: str, width: int, height: int = 900, dark: bool = False) -> None:
        """Show an address at a width in CSS pixels."""
        self.do("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.do("Emulation.setEmulatedMedia", features=[scheme])
        self._events.clear()
        loads = "loaderId" in self.do("Page.navigate", url=address)  # not where only the part behind '#' is another
        while loads and "Page.loadEventFired" not in self._events:
            self._note(self._message())

    def value(self, script: str) -> Any:
        """What an expression is worth in the page; promises are waited for."""
        answer = self.do("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"]["exception"].get("description", "error in the page"))
        return answer["result"].get("value")

    def wait_for(self, script: str, patience_s: float = PATIENCE_S) -> None:
        """Wait until an expression is true in the page; TimeoutError with what is to be read there."""
        until = time.monotonic() + patience_s
        while not self.value(f"Boolean({script})"):
            if time.monotonic() > until:
                raise TimeoutError(f"{script}: {self.value('document.body.innerText')[:2000]}")
            time.sleep(0.05)

    def drop(self, *paths: Path) -> None:
        """Files and folders let go of in the middle of the page."""
        data = {"items": [], "files": [str(p) for p in paths], "dragOperationsMask": 1}
        for kind in ("dragEnter", "dragOver", "drop"):
            self.do("Input.dispatchDragEvent", type=kind, x=200, y=200, data=data)

    def give_files(self, selector: str, *paths: Path) -> None:
        """Choose files in an input for files, as a person does in its dialogue."""
        root = self.do("DOM.getDocument")["root"]["nodeId"]
        node = self.do("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.do("DOM.setFileInputFiles", nodeId=node, files=[str(path) for path in paths])

    def press(self, key: str) -> None:
        """A key, as `Tab`, `ArrowLeft` or `+`."""
        printed = {"text": "\r" if key == "Enter" else key} if len(key) == 1 or key == "Enter" else {}
        code = {"Tab": 9, "Enter": 13, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, " ": 32}.get(
            key, 0
        )
        for kind in ("keyDown", "keyUp"):
            self.do("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, **printed)

    def picture(self, path: Path) -> None:
        """The whole page as PNG."""
        answer = self.do("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(answer["data"]))
