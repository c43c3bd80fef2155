"""The explorer's server: who may use it, what it answers, what it exports, and how it ends."""

import asyncio
import csv
import html
import io
import json
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import time
import tomllib
import zipfile
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import worker_tasks
from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect
from worker_tasks import children, gone, until

from analytic import hall
from fem.accuracy import LEVELS
from fem.equilibrium import solve
from fem.scene import Scene
from geometry.design import BadInput, Design
from studies.cli import commands
from studies.fabrication import sensor_parts
from studies.inputs import user_input
from studies.mechanics import executor, path_solver, store
from studies.web import explorer_answers, explorer_server, explorer_state, explorer_workers, state_exports

PATIENCE = 60.0
SHEARED = {
    "load": {"depth": 1.0, "shear": 0.4, "direction": 90},
    "design": {"D": 9.0, "hall_noise": 0.001},
    "level": "quick",
}


class Page:
    """One page of a running server, as the browser opens it."""

    def __init__(self, running):
        self.running, self.address = running, urlsplit(running.address)
        self.number = 0

    def url(self, path, *, token=True):
        return f"http://{self.address.netloc}{path}{f'?{self.address.query}' if token else ''}"

    async def fetch(self, path, *, token=True, **options):
        return await AsyncHTTPClient().fetch(HTTPRequest(self.url(path, token=token), **options), raise_error=False)

    async def open(self, **headers):
        url = self.url("/live").replace("http", "ws", 1)
        given = {"Origin": f"http://{self.address.netloc}", **headers}
        self.socket = await websocket_connect(HTTPRequest(url, headers=given), max_message_size=10**8)
        return self

    async def ask(self, state, parts=("state",), **more):
        self.number += 1
        message = {"number": self.number, "side": "a", "state": state, "parts": list(parts), **more}
        await self.socket.write_message(json.dumps(message))
        return self.number

    async def next(self):
        text = await asyncio.wait_for(self.socket.read_message(), PATIENCE)
        assert text is not None, "the server has closed the connection"
        return json.loads(text)

    async def until(self, wanted):
        """Return the first answer that is wanted, and all answers up to it."""
        answers = []
        while True:
            answers.append(await self.next())
            if wanted(answers[-1]):
                return answers[-1], answers

    async def export(self, name, state):
        body = json.dumps({"state": state})
        return await self.fetch(f"/export/{name}", method="POST", body=body, request_timeout=PATIENCE)


@pytest.fixture(scope="module")
def loop():
    loop = asyncio.new_event_loop()
    yield loop
    loop.close()


@pytest.fixture(scope="module")
def kept_states(tmp_path_factory):
    """The file in which the server keeps states."""
    return tmp_path_factory.mktemp("server") / "solved.sqlite"


@pytest.fixture(scope="module")
def running(loop, kept_states):
    async def begin():
        return explorer_server.Server(store=kept_states)

    running = loop.run_until_complete(begin())
    yield running
    loop.run_until_complete(running.close())


@pytest.fixture
def page(running):
    return Page(running)


@pytest.fixture
def live(loop, page):
    loop.run_until_complete(page.open())
    yield page
    page.socket.close()


def state_of(number):
    """Whether an answer is the state of a request, or its refusal."""
    return lambda one: one["number"] == number and (one.get("part") == "state" or "error" in one)


def estimated(number, level):
    """Whether an answer is the state of a request with its error estimates."""

    def wanted(answer):
        data = answer.get("data", {})
        return (answer["number"], answer.get("part"), answer.get("level")) == (number, "state", level) and (
            data["estimates"]["force"] is not None and data["decoded"] is not None
        )

    return wanted


@pytest.mark.parametrize(
    ("path", "token", "headers"),
    [
        ("/", False, {}),
        ("/", False, {"Cookie": "{cookie}=guess"}),
        ("/page/explorer.js", False, {"X-Token": "guess"}),
        ("/", True, {"Host": "example.org"}),
        ("/page/fields.json", True, {"Origin": "http://example.org"}),
        ("/export/design.toml", True, {"Origin": "null"}),
    ],
)
def test_refuses_requests_that_are_not_from_its_page(loop, page, path, token, headers):
    post = {"method": "POST", "body": "{}"} if path.startswith("/export") else {}
    name = page.running.cookie
    headers = {key: value.format(cookie=name) for key, value in headers.items()}
    answer = loop.run_until_complete(page.fetch(path, token=token, headers=headers, **post))
    assert answer.code == 403


@pytest.mark.parametrize("headers", [{"Origin": "http://example.org"}, {"Origin": "null"}, {"Host": "example.org"}])
def test_refuses_connections_of_other_pages(loop, page, headers):
    with pytest.raises(HTTPClientError, match="403"):
        loop.run_until_complete(page.open(**headers))


def test_page_and_its_files_are_served_to_the_token(loop, page):
    index = loop.run_until_complete(page.fetch("/"))
    cookie = index.headers["Set-Cookie"]
    assert cookie.startswith(f"{page.running.cookie}=")
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert "http" not in index.headers["Content-Security-Policy"]
    # the cookie replaces the token
    script = loop.run_until_complete(
        page.fetch("/page/explorer.js", token=False, headers={"Cookie": cookie.partition(";")[0]})
    )
    assert (script.code, script.headers["Content-Type"]) == (200, "text/javascript; charset=utf-8")


OUTSIDE = explorer_server.PAGE.parent.parent / "README.md"
"""A file of a type that the server sends, beside its pages."""


@pytest.mark.parametrize(
    "name",
    ["../../README.md", "%2e%2e/%2e%2e/README.md", str(OUTSIDE), "none.js", "%00", "a" * 5000 + ".js", ""],
    ids=["dots", "escaped dots", "absolute", "no file", "zero byte", "long", "folder"],
)
def test_other_files_are_not_served(loop, page, name):
    assert OUTSIDE.is_file()
    assert loop.run_until_complete(page.fetch(f"/page/{name}")).code == 404


def test_bug_is_said_to_the_page_that_met_it_before_the_next_job_begins(loop, monkeypatch, capsys):
    """The jobs of this process end as an exception, another one that pickle does not know, and an exit."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setattr(explorer_workers, "warm", worker_tasks.echo)
    monkeypatch.setattr(explorer_workers, "do", worker_tasks.fails_at_depth)

    async def answers():
        worker, said = explorer_workers.PageWorker(asyncio.get_running_loop()), asyncio.Queue()
        for number in range(1, 6):
            request = explorer_state.request_of({"number": number, "state": {"load": {"depth": number / 10}}})
            job = explorer_workers.Job(request, "quick")
            worker.ask(number, explorer_workers.Asked(job, said.put_nowait))
        found = [json.loads(await asyncio.wait_for(said.get(), PATIENCE)) for _ in range(6)]
        worker.close()
        return found

    answers = loop.run_until_complete(answers())
    assert [one["number"] for one in answers] == [1, 2, 3, 4, 4, 5]
    names = ["LinAlgError", "OddError", "SystemExit", None, "exit code 7", None]
    for answer, name in zip(answers, names, strict=True):
        assert ("error" in answer) == (name is not None)
        assert name is None or (name in answer["error"] and answer["error"].count("\n") == 0)
    errors = capsys.readouterr().err
    assert "in fails_at_depth" in errors
    assert "LinAlgError: Singular matrix" in errors


def test_a_bug_leaves_nothing_that_is_kept(monkeypatch, kept):
    answers = explorer_answers.Answers(kept)
    monkeypatch.setattr(answers, "all_of", lambda *_: 1 / 0)
    answers.memory.results.get("curve", float)
    monkeypatch.setattr(explorer_workers, "_answers", lambda: answers)
    monkeypatch.setattr(explorer_workers, "_talks", [explorer_workers.Talk(multiprocessing.Pipe()[0])])
    with pytest.raises(ZeroDivisionError):
        explorer_workers.do(explorer_workers.Job(explorer_state.request_of({}), "quick"))
    assert not answers.memory.results.values


def test_processes_that_never_start_are_said_to_every_request(loop, monkeypatch, capfd):
    monkeypatch.setattr(executor, "begin", worker_tasks.ends)

    async def answers():
        process = explorer_workers.PageWorker(asyncio.get_running_loop())
        first, later = asyncio.Queue(), asyncio.Queue()

        def asked(message, queue):
            job = explorer_workers.Job(explorer_state.request_of(message), "quick")
            return explorer_workers.Asked(job, queue.put_nowait)

        process.ask("early", asked({"number": 1}, first))
        said = [await asyncio.wait_for(first.get(), PATIENCE)]
        process.ask("late", asked({"number": 2, "side": "b"}, later))
        said.append(await asyncio.wait_for(later.get(), 1))
        process.close()
        return [json.loads(text) for text in said]

    early, late = loop.run_until_complete(answers())
    assert [(one["number"], one["side"]) for one in (early, late)] == [(1, "a"), (2, "b")]
    assert early["error"] == late["error"]
    assert "exit code 5" in early["error"]


def test_state_is_the_solution_of_the_command_line(loop, live):
    async def answers():
        number = await live.ask(SHEARED, ("state", "sensor3d", "field_lines", "commands"))
        return await live.until(estimated(number, "quick"))

    answer, before = loop.run_until_complete(answers())
    state = explorer_state.state_of(SHEARED)
    solution = solve(state.design, state.load, LEVELS["quick"])
    first = next(one["data"] for one in before if one.get("part") == "state")
    for data in (first, answer["data"]):
        assert data["response"]["force"] == pytest.approx(solution.response.force, rel=1e-9, abs=1e-12)
        assert data["response"]["shift"] == pytest.approx(solution.response.shift, rel=1e-9, abs=1e-12)
        assert data["response"]["tilt_y"] == pytest.approx(math.degrees(solution.response.tilt_y), rel=1e-9)
        volts = hall.readings(state.design, solution.response).output
        assert data["readings"]["volts"] == pytest.approx(volts, rel=1e-9)
    assert answer["data"]["estimates"]["force"][2] == pytest.approx(
        solution.estimates.force * math.hypot(*solution.response.force)
    )
    assert answer["data"]["message"] == solution.message
    # S3 lies along y, in which the magnet moves
    assert answer["data"]["readings"]["half_width"][2] > 0
    assert all(noise > 0 for noise in answer["data"]["decoded"]["noise"])
    assert {one["part"] for one in before if "part" in one} == {"state", "sensor3d", "field_lines", "commands"}


def test_curve_and_stability(loop, live):
    async def answers():
        number = await live.ask({"load": {"depth": 1}, "level": "quick"}, ("curve", "stability"))
        return await live.until(
            lambda one: (one["number"], one.get("part"), one.get("level")) == (number, "stability", "quick")
        )

    answer, before = loop.run_until_complete(answers())
    (curve,) = [one["data"] for one in before if one.get("part") == "curve"]
    last = solve(Design(), explorer_state.state_of({"load": {"depth": curve["depth"][-1]}}).load, LEVELS["quick"])
    assert curve["force"][-1] == pytest.approx(last.response.force[2], rel=1e-9)
    assert curve["estimates"]["force"][-1] == pytest.approx(last.estimates.force * last.response.force[2], rel=1e-6)
    assert all(low < high for low, high in zip(curve["force"], curve["force"][1:], strict=False))
    (surrogate,) = [one["data"] for one in before if one.get("level") == "surrogate"]
    assert surrogate["first_mode_hz"] == pytest.approx(answer["data"]["first_mode_hz"], rel=0.02)
    assert answer["data"]["estimate"] > 0


@pytest.mark.parametrize(
    ("state", "field", "words"),
    [
        ({"design": {"L": 3}, "load": {"depth": 0.5}}, "L", ["--set", "L=3", "--depth", "0.5"]),
        ({"design": {"D": "wide"}, "load": {"depth": 0.5}}, "D", ["--set", "D=wide", "--depth", "0.5"]),
        ({"load": {"depth": -1}}, "depth", ["--depth=-1"]),
        ({"load": {"depth": 1, "friction": "glue"}}, "friction", ["--depth", "1", "--friction", "glue"]),
        ({"load": {"depth": 1, "plate_tilt": 80}}, "plate_tilt", ["--depth", "1", "--plate-tilt", "80"]),
        ({"load": {"depth": 7.5}}, "depth", ["--depth", "7.5"]),
    ],
)
def test_bad_input_has_the_sentence_of_the_command_line(loop, live, capsys, state, field, words):
    async def answer():
        number = await live.ask(state)
        return (await live.until(lambda one: one["number"] == number and "error" in one))[0]

    refused = loop.run_until_complete(answer())
    assert commands.run(["solve", "paper", *words]) == 2
    assert capsys.readouterr().err == f"magtip: {refused['error']}\n"
    assert refused["field"] == field


NONSENSE = {
    "{": "the request is not JSON (expecting property name",
    f'{{"number": {"9" * 5000}}}': "the request has a whole number of more than 19 digits",
    "[1]": "a request must be a table",
    "NaN": "a request must be a table",
    '{"number": "x"}': "number must be a whole number",
    '{"state": 3}': "state must be a table",
    '{"parts": ["none"]}': "parts must be a list",
    '{"state": {"load": {"depth": %s}}}' % ("9" * 400): "the request has a whole number of more than 19 digits",
    '{"state": {"design": {"D": -%s}}}' % ("9" * 19): "the request has a whole number of more than 19 digits",
}


def test_nonsense_and_endless_numbers_are_refused_in_a_sentence(loop, live):
    async def answer(text):
        await live.socket.write_message(text)
        return await live.next()

    for text, words in NONSENSE.items():
        error = loop.run_until_complete(answer(text))["error"]
        assert error.startswith(words), text[:40]
        assert error.count("\n") == 0


def test_newer_requests_replace_older_ones(loop, live):
    async def answers():
        numbers = [await live.ask({"load": {"depth": 1 + 0.01 * k}}) for k in range(30)]
        return numbers, (await live.until(estimated(numbers[-1], "standard")))[1]

    numbers, answers = loop.run_until_complete(answers())
    answered = [one["number"] for one in answers if one.get("part") == "state"]
    assert answered == sorted(answered)
    # nearly all of these requests waited when a newer one came
    assert len(set(answered)) < len(numbers) / 2
    assert {one["number"] for one in answers if one.get("level") == "standard"} == {numbers[-1]}


def test_exports_open_again(loop, page, tmp_path, kept_states):
    async def files():
        return {
            name: await page.export(name, SHEARED) for name in ("design.toml", "state.csv", "curve.csv", "fields.vtu")
        }

    answers = loop.run_until_complete(files())
    assert {name: answer.code for name, answer in answers.items()} == dict.fromkeys(answers, 200)
    for name, answer in answers.items():
        (tmp_path / name).write_bytes(answer.body)
    state = explorer_state.state_of(SHEARED)
    assert user_input.read_design(str(tmp_path / "design.toml")) == state.design
    solution = solve(state.design, state.load, LEVELS["quick"])
    (row,) = csv.DictReader(io.StringIO(answers["state.csv"].body.decode()))
    assert float(row["force_N_3"]) == pytest.approx(solution.response.force[2], rel=1e-9)
    curve = list(csv.DictReader(io.StringIO(answers["curve.csv"].body.decode())))
    assert float(curve[-1]["force_half_width_N"]) > 0
    kept = path_solver.place(Scene(state.design, (state.load,), LEVELS["quick"]))
    with store.opened(kept_states) as states:
        assert states.states(kept.content)[kept.at].answer["response"]["force"][2] == float(row["force_N_3"])
    import pyvista as pv

    grid = pv.read(tmp_path / "fields.vtu")
    assert grid.point_data["displacement_mm"].max() > 0.3


def test_mould_is_the_folder_of_the_command_line_or_its_refusal(monkeypatch):
    row = {"status": "ok"}

    def build(design, folder, progress, choices, *, command):
        (folder / "parts").mkdir(parents=True)
        (folder / "parts" / "README.md").write_text(f"{design.D:g} {choices.silicone} {command}")
        return row | {"folder": folder}

    monkeypatch.setattr(sensor_parts, "build", build)
    task = Design(D=9.0, silicone="Ecoflex 00-30"), "magtip cad"
    with zipfile.ZipFile(io.BytesIO(state_exports._mold_archive(task))) as archive:
        assert [name for name in archive.namelist() if not name.endswith("/")] == ["parts/README.md"]
        text = archive.read("parts/README.md").decode()
    assert text.startswith("9 ")
    assert "Ecoflex 00-30" in text
    assert text.endswith("magtip cad")
    row |= {"status": "no_mold", "message": "no mould"}
    with pytest.raises(BadInput, match="no mould"):
        state_exports._mold_archive(task)


def molding(running):
    """Processes of this one that make moulds: those that answer no page."""
    workers = running.workers
    return set(children(os.getpid())) - {workers.quick.pid, workers.refining.pid}


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are listed from /proc")
def test_moulds_are_made_one_at_a_time_and_end_with_their_page(loop, page):
    body = b'{"state": {}}'
    head = f"POST {page.address.path}export/mold.zip?{page.address.query} HTTP/1.1\r\nHost: {page.address.netloc}\r\n"
    request = head.encode() + b"Content-Length: %d\r\n\r\n" % len(body) + body

    async def most_at_once():
        pages = [await asyncio.open_connection(page.address.hostname, page.address.port) for _ in range(5)]
        for _, writer in pages:
            writer.write(request)
        counts = []
        for _ in range(20):
            counts.append(len(molding(page.running)))
            await asyncio.sleep(0.1)
        for _, writer in pages:
            writer.close()
        end = time.monotonic() + 10
        while molding(page.running) and time.monotonic() < end:
            await asyncio.sleep(0.1)
        return max(counts), len(molding(page.running))

    assert loop.run_until_complete(most_at_once()) == (1, 0)
    assert not page.running.molding.locked()


def test_export_of_a_bad_state_is_refused_in_a_sentence(loop, page):
    answer = loop.run_until_complete(page.export("state.csv", {"design": {"L": 3}}))
    assert (answer.code, answer.body.decode()) == (400, "L must exceed the tip radius D/2 = 4 mm; got 3 mm")


def test_a_worker_that_dies_is_said_and_replaced(loop, running, live):
    async def answers():
        # a process that is still starting would do the job after its death
        await live.until(state_of(await live.ask({"load": {"depth": 0.5}, "level": "quick"})))
        number = await live.ask({"load": {"depth": 1.0, "shear": 1.0, "friction": 0.3}, "level": "quick"})
        await asyncio.sleep(0.2)
        os.kill(running.workers.quick.pid, signal.SIGKILL)
        refused, _ = await live.until(lambda one: "error" in one)
        assert refused["number"] == number
        number = await live.ask({"load": {"depth": 1.0}, "level": "quick"})
        return refused, (await live.until(estimated(number, "quick")))[0]

    refused, answer = loop.run_until_complete(answers())
    assert "signal 9" in refused["error"]
    assert answer["data"]["status"] == "ok"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are listed from /proc")
def test_token_is_in_no_command_line_and_an_interrupt_ends_the_server_and_its_workers(tmp_path, run):
    browser, said = tmp_path / "browser", tmp_path / "said"
    browser.write_text(
        '#!/bin/sh\nfile=${1#file://}\n{ echo "$*"; stat -c %a "$(dirname "$file")"; cat "$file"; } '
        f"> {said}.new\nmv {said}.new {said}\n"
    )
    browser.chmod(0o700)
    command = [sys.executable, "-m", "studies.cli", "explore", "--set", "D=10"]
    environment = {**os.environ, "BROWSER": f"{browser} %s"}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    try:
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:")
        assert address.endswith("#preset=paper&D=10")
        assert until(said.exists, PATIENCE)
        line, mode, *content = said.read_text().splitlines()
        workers = children(process.pid)
        # a second server on this port says so
        refused = run("explore", "--no-browser", "--port", urlsplit(address).port)
    finally:
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
    assert urlsplit(address).query.startswith("token=")
    assert urlsplit(address).query not in line
    assert mode == "700"
    assert f"url={html.escape(address)}" in "\n".join(content)
    assert not Path(line.removeprefix("file://")).exists()
    assert (refused[0], refused[2].count("\n")) == (2, 1)
    assert refused[2].startswith(f"magtip: port {urlsplit(address).port} cannot be used (")
    # the browser may still be a process of it
    assert (process.returncode, len(workers) >= 2) == (0, True)
    assert "Traceback" not in errors
    assert until(lambda: all(map(gone, workers)), 5)


def test_files_of_the_page_are_in_the_wheel():
    project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text("utf-8"))
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert "studies" in wheel["packages"]
    assert not wheel.get("exclude")
    assert (explorer_server.PAGE / f"{explorer_server.INDEX}.j2").is_file()
