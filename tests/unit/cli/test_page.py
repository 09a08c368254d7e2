"""The page on one's own computer: who may ask, what is kept, what becomes of damaged and unknown files."""

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from html import unescape
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

from rotorid.cli.page import jobs
from rotorid.cli.page.shelf import INTERRUPTED, NotThere, Shelf, safe_name
from rotorid.recordings.importers.logfile import importers
from tests.browser import CHROMIUM, Browser
from tests.command_line import refusal
from tests.public_logs import public
from tests.unit.recordings.importers.test_log_formats import PARAMETERS, dataflash, flown
from tests.unit.recordings.importers.test_ros_bags import Flight, usual, written

EXAMPLE = files("rotorid.cli.examples")
PATIENCE_S = 120


class Page:
    """A running `rotorid page` and what it answers."""

    def __init__(self, process: subprocess.Popen, address: str, folder: Path) -> None:
        self.process, self.address, self.folder = process, address, folder
        self.port, self.token = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/(\S+)/", address).groups()

    def raw(self, method: str, path: str, body: bytes | None = None, headers: dict[str, str] | None = None):
        """Status, body and headers of an answer; the path is sent as it is."""
        connection = http.client.HTTPConnection("127.0.0.1", int(self.port), timeout=PATIENCE_S)
        connection.putrequest(method, path, skip_host="Host" in (headers or {}))
        for name, value in (headers or {}).items():
            connection.putheader(name, value)
        if body is not None and "Content-Length" not in (headers or {}):
            connection.putheader("Content-Length", str(len(body)))
        connection.endheaders(body)
        answer = connection.getresponse()
        out = answer.status, answer.read(), answer.headers
        connection.close()
        return out

    def ask(self, method: str, path: str, said: object = None, body: bytes | None = None) -> tuple[int, dict]:
        """Status and JSON of what the page's script would ask."""
        headers = {}
        if said is not None:
            body, headers = json.dumps(said).encode(), {"Content-Type": "application/json"}
        status, text, _ = self.raw(method, f"/{self.token}/api/{path}", body, headers)
        return status, json.loads(text) if text else {}

    def drop(self, *logs: tuple[str, bytes]) -> str:
        """The id of a set with these logs."""
        status, made = self.ask("POST", "sets")
        assert status == 201
        for name, content in logs:
            assert self.ask("PUT", f"sets/{made['id']}/logs/{quote(name, safe='')}", body=content)[0] == 201
        return made["id"]

    def wait(self, id_: str, *stages: str) -> dict:
        """The state of a set as soon as it is in one of these stages."""
        until = time.monotonic() + PATIENCE_S
        while (state := self.ask("GET", f"sets/{id_}")[1])["stage"] not in stages:
            assert time.monotonic() < until, state
            time.sleep(0.05)
        return state


@contextmanager
def running(folder: Path) -> Iterator[Page]:
    """`rotorid page` on a folder, ended as by Ctrl-C."""
    cache = {"XDG_CACHE_HOME": str(folder.parent / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, "-m", "rotorid", "page", "--no-browser", "--folder", str(folder)],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=os.environ | cache,
    )  # fmt: skip
    try:
        first = process.stdout.readline()
        assert first.startswith("The page: "), first
        yield Page(process, first.split()[-1], folder)
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            raise


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Iterator[Page]:
    with running(tmp_path_factory.mktemp("page") / "shelf") as found:
        yield found


@pytest.fixture(scope="module")
def log() -> bytes:
    return dataflash(flown(), PARAMETERS)


def test_only_the_address_with_its_token_and_its_own_host_is_answered(page: Page) -> None:
    own = f"/{page.token}/"
    status, text, headers = page.raw("GET", own)
    assert status == 200 and b"page.js" in text
    assert "script-src 'self'" in headers["Content-Security-Policy"] and headers["Referrer-Policy"] == "no-referrer"
    for path in ("/", "/api/sets", "/wrong/api/sets", f"/{page.token}x/", f"//{page.token}/"):
        assert page.raw("GET", path)[0] == 403, path
    for headers in (
        {"Host": f"rebound.example:{page.port}"}, {"Host": "127.0.0.1"}, {"Origin": "https://elsewhere.example"},
        {"Origin": "null"}, {"Sec-Fetch-Site": "cross-site"},
    ):  # fmt: skip
        status, text, _ = page.raw("POST", f"{own}api/sets", b"", headers)
        assert status == 403 and text.decode().count(".") <= 4, headers
    assert page.raw("GET", own, headers={"Host": f"localhost:{page.port}"})[0] == 200
    assert page.raw("POST", f"{own}api/sets", b"", {"Origin": f"http://127.0.0.1:{page.port}"})[0] == 201


def test_the_page_names_every_format_that_an_importer_takes(page: Page) -> None:
    text = unescape(page.raw("GET", f"/{page.token}/")[1].decode())
    assert all(importer.title.replace("`", "") in text for importer in importers().values())


def test_the_folder_of_a_bag_is_one_log(page: Page, tmp_path: Path) -> None:
    flight = Flight(True)
    bag, id_ = written(tmp_path / "flight", flight, usual(flight)).parent, page.drop()
    for path in sorted(bag.iterdir()):
        assert page.ask("PUT", f"sets/{id_}/logs/{path.name}?bag=..%2F..%2Fflight", body=path.read_bytes())[0] == 201
    state = page.ask("POST", f"sets/{id_}/look", {"like": "x500", "mass_kg": 1.5})[1]
    assert (state["stage"], state["logs"], state["look"]["format"]) == ("looked", ["flight"], "ROS 1 or 2 bag, MCAP"), (
        state
    )
    assert [run["name"] for run in state["look"]["runs"]]
    assert page.ask("PUT", f"sets/{id_}/logs/log.bin", body=b"1")[0] == 201
    said = page.ask("PUT", f"sets/{id_}/logs/a.db3?bag=log.bin", body=b"1")[1]["sentence"]
    assert "has the name of the folder" in said


def test_it_listens_on_this_computer_alone(page: Page) -> None:
    psutil = pytest.importorskip("psutil")
    heard = [x.laddr for x in psutil.Process(page.process.pid).net_connections("inet") if x.status == "LISTEN"]
    assert [(x.ip, x.port) for x in heard] == [("127.0.0.1", int(page.port))]


def test_nothing_outside_of_the_folder_is_read_written_or_deleted(page: Page, log: bytes) -> None:
    victim = page.folder.parent / "victim.txt"
    victim.write_text("kept")
    id_ = page.drop(("..", log), ("a\\b\x00c.bin", log), ("evil.bin", log), ("EVIL.bin", log))
    assert page.ask("PUT", f"sets/{id_}/logs/{quote('../../evil.bin', safe='')}", body=log)[0] == 404
    kept = sorted(p.name for p in (page.folder / id_ / "logs").iterdir())
    assert kept == ["EVIL_2.bin", "b_x00c.bin", "evil.bin", "log"]
    assert not list(page.folder.parent.glob("evil*"))
    (page.folder / id_ / "answer").mkdir()
    (page.folder / id_ / "answer" / "link.json").symlink_to(victim)
    for name in ("../state.json", "..%2Fstate.json", "%2e%2e%2fstate.json", "link.json", "..%2f..%2f..%2fvictim.txt"):
        assert page.raw("GET", f"/{page.token}/api/sets/{id_}/files/{name}")[0] == 404, name
    for wrong in ("..", "%2e%2e", "..%2f..", f"{id_}%2f..", ".", "20260101-000000000000"):
        status, _, _ = page.raw("DELETE", f"/{page.token}/api/sets/{wrong}")
        assert status in (404, 405), wrong
    assert victim.read_text() == "kept" and (page.folder / id_).is_dir()
    assert page.raw("DELETE", f"/{page.token}/api/sets/{id_}")[0] == 204
    assert not (page.folder / id_).exists() and victim.read_text() == "kept"


def test_names_of_logs_are_made_safe_and_stay_apart(tmp_path: Path) -> None:
    assert safe_name("C:\\logs\\flight.ulg") == "flight.ulg" and safe_name("...") == "log"
    assert safe_name("flug über\u202egnp.bin") == "flug über_u202egnp.bin"
    long = safe_name("ä" * 300 + ".ulg")
    assert long.endswith(".ulg") and len(long.encode()) <= 120
    shelf = Shelf(tmp_path)
    id_ = shelf.new()
    for wanted in ("flight.ulg", "flight_2.ulg", "FLIGHT_3.ulg"):
        place = shelf.place_for(id_, "Flight.ulg" if wanted.startswith("F") else "flight.ulg")
        assert place.name.casefold() == wanted.casefold()
        place.write_bytes(b"x")
    with pytest.raises(NotThere):
        shelf.path("..")


def test_a_log_is_looked_at_and_what_must_be_known_is_asked(page: Page, log: bytes) -> None:
    id_ = page.drop(("flight.bin", log))
    status, state = page.ask("POST", f"sets/{id_}/look", {})
    look = state["look"]
    assert status == 200 and state["stage"] == "looked", state
    assert look["format"] == "ArduPilot DataFlash" and len(look["rotors"]) == 4
    assert [run["name"] for run in look["runs"]] == ["flight"] and look["runs"][0]["duration_s"] > 5
    assert look["unknown_vehicle"] and look["like"] == ""  # nothing says what vehicle it is: it must be chosen
    assert any("Rotor speeds are recorded" in s for s in look["can"]) and any(
        "One run only" in s for s in look["cannot"]
    )
    _, state = page.ask("POST", f"sets/{id_}/look", {"mass_kg": 1.25, "like": "x500"})
    assert state["look"]["mass_kg"] == 1.25 and "mass_kg: 1.25" in state["look"]["vehicle"]
    own = state["look"]["vehicle"].replace("mass_kg: 1.25", "mass_kg: 1.75")
    _, state = page.ask("POST", f"sets/{id_}/look", {"mass_kg": 9.0, "like": "x500", "vehicle": own})
    assert state["look"]["mass_kg"] == 1.75  # what was written by hand is taken as it is
    listed = page.ask("GET", "sets")[1]
    assert next(s for s in listed if s["id"] == id_)["name"] == "flight.bin"


def test_unknown_and_broken_files_end_in_one_sentence_and_the_page_goes_on(page: Page, log: bytes) -> None:
    for name, content, said in (
        ("picture.png", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "not a log that rotorid knows"),
        ("cut.bin", log[:400], "cut.bin"),
        ("broken.ulg", b"ULog\x01\x12\x35" + b"\xff" * 300, "broken.ulg"),
    ):
        id_ = page.drop((name, content))
        _, state = page.ask("POST", f"sets/{id_}/look", {})
        assert state["stage"] == "failed" and said in state["sentence"], state
        assert str(page.folder) not in state["sentence"] and "Traceback" not in state["sentence"]
    id_ = page.drop(("flight.bin", log))
    for said in ({"mass_kg": -1}, {"mass_kg": "heavy"}, {"like": 3}, [1]):
        assert page.ask("POST", f"sets/{id_}/look", said)[0] == 400, said
    assert page.raw("POST", f"/{page.token}/api/sets/{id_}/look", b"{}", {"Content-Type": "text/plain"})[0] == 400
    _, state = page.ask("POST", f"sets/{id_}/look", {"like": "no-such", "mass_kg": 1.0})
    assert "no template vehicle is called 'no-such'" in state["sentence"]
    assert page.ask("POST", f"sets/{id_}/look", {})[1]["stage"] == "looked"


def test_a_log_that_is_too_large_empty_or_broken_off_leaves_nothing(page: Page) -> None:
    id_ = page.ask("POST", "sets")[1]["id"]
    path = f"/{page.token}/api/sets/{id_}/logs/large.ulg"
    status, text, _ = page.raw("PUT", path, b"", {"Content-Length": "600000000"})
    assert status == 400 and b"more than 500 MB" in text
    status, said = page.ask("PUT", f"sets/{id_}/logs/empty.ulg", body=b"")
    assert status == 400 and said["sentence"] == "empty.ulg: the file is empty"
    with socket.create_connection(("127.0.0.1", int(page.port))) as tab:  # a tab that is closed while it sends
        tab.sendall(f"PUT {path} HTTP/1.1\r\nHost: 127.0.0.1:{page.port}\r\nContent-Length: 9999\r\n\r\nhalf".encode())
        time.sleep(0.3)
    until = time.monotonic() + 10
    while list((page.folder / id_).glob(".coming*")):
        assert time.monotonic() < until
        time.sleep(0.05)
    assert page.ask("GET", f"sets/{id_}")[1]["logs"] == []
    assert "no log" in page.ask("POST", f"sets/{id_}/look", {})[1]["sentence"]


def workers(page: Page) -> list:
    psutil = pytest.importorskip("psutil")
    found = psutil.Process(page.process.pid).children()
    return [p for p in found if "verdict" in p.cmdline()]


def test_questions_queue_and_a_killed_one_says_so_and_loses_nothing(page: Page, log: bytes) -> None:
    ids = [page.drop((f"flight_{n}.bin", log)) for n in range(3)]
    for id_ in ids:
        assert page.ask("POST", f"sets/{id_}/ask", {"question": "verdict", "like": "x500", "mass_kg": 1.5})[0] == 202
    assert page.wait(ids[0], "working")["stage"] == "working"
    states = [page.ask("GET", f"sets/{id_}")[1] for id_ in ids[1:]]
    assert [(s["stage"], s["before"]) for s in states] == [("waiting", 1), ("waiting", 2)]
    status, said = page.ask("POST", f"sets/{ids[0]}/look", {})
    assert status == 400 and "worked on" in said["sentence"]
    assert page.ask("POST", f"sets/{ids[1]}/stop", {})[1]["sentence"] == jobs.STOPPED
    until = time.monotonic() + 20
    while not (found := workers(page)):
        assert time.monotonic() < until
        time.sleep(0.02)
    found[0].kill()
    assert page.wait(ids[0], "failed", "done")["sentence"] == jobs.KILLED
    assert (page.folder / ids[0] / "logs" / "flight_0.bin").read_bytes() == log
    page.wait(ids[2], "working")
    assert page.raw("DELETE", f"/{page.token}/api/sets/{ids[2]}")[0] == 204
    until = time.monotonic() + 20
    while workers(page):
        assert time.monotonic() < until
        time.sleep(0.05)


def test_a_page_that_ended_at_work_says_so_when_it_starts_again(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path)
    id_ = shelf.new()
    shelf.change(id_, stage="working", name="flight.ulg")
    (tmp_path / "not-ours").mkdir()
    again = Shelf(tmp_path).state(id_)
    assert (again["stage"], again["sentence"], again["name"]) == ("failed", INTERRUPTED, "flight.ulg")
    (tmp_path / id_ / "state.json").write_text("{")
    assert "cannot be read" in Shelf(tmp_path).states()[0]["sentence"]
    shelf.delete(id_)
    assert shelf.states() == [] and (tmp_path / "not-ours").is_dir()


def test_a_folder_has_one_page_at_a_time(page: Page) -> None:
    said = refusal("page", "--no-browser", "--folder", page.folder)
    assert "another rotorid page keeps its sets there" in said


def test_the_columns_of_a_foreign_table_are_proposed(page: Page) -> None:
    lines = ["t,gx,gy,gz,ax,ay,az,m1,m2,m3,m4"]
    lines += [f"{0.01 * k:.2f},0,0.{k % 7},0,0.1,0,-9.8{k % 9},0.5,0.5,0.51,0.5" for k in range(400)]
    id_ = page.drop(("own.csv", "\n".join(lines).encode()))
    _, state = page.ask("POST", f"sets/{id_}/look", {})
    assert state["stage"] == "looked" and "runs" not in state["look"]
    assert "gx" in state["look"]["mapping"] and state["look"]["evidence"]


@pytest.mark.slow
def test_from_a_drop_to_the_report_in_a_browser(tmp_path: Path) -> None:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine")
    logs = []
    for name in ("flight_1", "flight_2"):
        logs.append(tmp_path / f"{name}.csv.gz")
        logs[-1].write_bytes(EXAMPLE.joinpath(f"{name}.csv.gz").read_bytes())
    with running(tmp_path / "shelf") as page, Browser(tmp_path) as browser:
        browser.visit(page.address, 1280)
        browser.press("Tab")
        browser.press("Tab")
        browser.press("Tab")
        assert browser.value("document.activeElement.id") == "logs"  # the drop is reached by keys
        browser.give_files("#logs", *logs)
        browser.wait_for("document.querySelector('#mass')")
        assert browser.value("document.activeElement.id") == "current"
        assert "2 flights" in browser.value("document.querySelector('#current').innerText")
        nameless = """[...document.querySelectorAll('input, select, textarea, button, iframe, progress')].filter(
            (x) => !(x.labels && x.labels.length) && !x.textContent.trim() && !x.title && !x.ariaLabel).length"""
        assert browser.value(nameless) == 0
        for width in (400, 1280):
            browser.visit(page.address + "#x", width)
            assert browser.value("document.documentElement.scrollWidth") <= width
        # What must be known and is not said is asked for by the browser itself.
        assert browser.value("document.querySelector('form').checkValidity()") is False
        text = json.dumps(EXAMPLE.joinpath("vehicle.yaml").read_text(encoding="utf-8"))
        browser.value(f"document.querySelector('#vehicle').value = {text}, 1")
        browser.value("document.querySelector('#mass').value = 1, document.querySelector('#like').value = 'thesis', 1")
        browser.value("document.querySelector('button.first').click(), 1")
        browser.wait_for("document.querySelector('#steps li')")
        browser.wait_for("document.querySelector('iframe')", 400)
        assert "rotor drag" in browser.value("document.querySelector('.headline').innerText").lower()
        files_there = browser.value("[...document.querySelectorAll('a[download]')].map((a) => a.download)")
        assert {"report.html", "verdict.json", "improved_vehicle.yaml", "recording_set.zip"} <= set(files_there)
        assert browser.value("fetch(document.querySelector('a[download]').href).then((r) => r.status)") == 200
        assert not [text for text in browser.said if "favicon" not in text], browser.said


@pytest.mark.slow
def test_a_folder_of_logs_is_dropped_in_a_browser(tmp_path: Path) -> None:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine")
    folder = tmp_path / "monday"
    folder.mkdir()
    for name in ("flight_1.csv.gz", "flight_2.csv.gz"):
        (folder / name).write_bytes(EXAMPLE.joinpath(name).read_bytes())
    with running(tmp_path / "shelf") as page, Browser(tmp_path) as browser:
        browser.visit(page.address, 1280)
        browser.drop(folder)
        browser.wait_for("document.querySelector('#mass')")
        assert "2 flights" in browser.value("document.querySelector('#current').innerText")
        assert not [text for text in browser.said if "favicon" not in text], browser.said


@pytest.mark.slow
def test_a_real_log_is_looked_at_within_a_second_or_so(page: Page) -> None:
    id_ = page.drop(("gps_interference.ulg", public("px4-flight-review/gps_interference.ulg").read_bytes()))
    page.ask("POST", f"sets/{id_}/look", {})
    start = time.process_time(), time.monotonic()
    _, state = page.ask("POST", f"sets/{id_}/look", {})
    assert state["look"]["like"] == "x500" and time.monotonic() - start[1] < 5
    id_ = page.drop(("shortLog.BFL", public("logs/betaflight/shortLog.BFL").read_bytes()))
    _, state = page.ask("POST", f"sets/{id_}/look", {})
    assert state["look"]["like"] == "five-inch"
