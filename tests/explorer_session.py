"""A session with the explorer's page: its server, a page in headless Chromium, moves at random, measured times.

`python tests/explorer_session.py OUT [MOVES]` writes into the folder OUT screenshots, `session.json` with 1000 random
moves and the times from slider to picture, and the same in words, EXPLORER.md.
`python tests/explorer_session.py --array OUT` writes the picture of an array only.
`python tests/explorer_session.py --latency` measures these times only, in less than a minute, and prints them.
"""

import contextlib
import hashlib
import json
import math
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from browser import launched, opened, said, wait
from explorer_scripts import DRAG, GO, REST, SET, SETTLED

from fem.accuracy import QUICK
from fem.equilibrium import solve
from geometry.design import paper
from geometry.loads import Load
from studies.output.page_templates import rendered
from studies.output.provenance import commit

ROOT = Path(__file__).resolve().parent.parent


@contextlib.contextmanager
def server(port=0, design="paper"):
    """Start `magtip explore`; yields its process and the address of the page."""
    # a page waits for a minute at most, and both workers would compile the same functions at once
    solve(paper(), Load(depth=0.5, shear_x=0.2), QUICK)
    line = [sys.executable, "-m", "studies.cli", "explore", design, "--no-browser", "--port", str(port)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(line, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process, process.stdout.readline().strip()
        finally:
            process.terminate()


def ask(page, function, *values):
    """Call a JavaScript function with values."""
    return page.evaluate(f"{function}({', '.join(map(json.dumps, values))})")


def click(page, name):
    """Click a button of a name."""
    page.evaluate(f"document.getElementById({json.dumps(name)}).click()")


def move(page, name, value):
    """Set a control to a value by its slider or choice."""
    ask(page, SET, name, value)


def go(page, state):
    """Show the state of an address in a page, and wait for its picture."""
    page.evaluate(f"{GO}({json.dumps(state)})")
    rest(page)


def rest(page):
    """Wait until the page shows the answer to its newest request."""
    wait(page, REST)


def rest_a_while(page, seconds=20.0):
    """Wait for the picture, but go on after a while, as a hand does before a design whose solve takes minutes."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not page.evaluate(f"Boolean({REST})"):
        time.sleep(0.05)


def drawn(page, selector="figure.section[data-side=a] canvas"):
    """A digest of a canvas' pixels."""
    script = f"document.querySelector({json.dumps(selector)}).toDataURL('image/png')"
    return hashlib.sha256(page.evaluate(script).encode()).hexdigest()


def heap(page):
    """Bytes of the page's JavaScript heap after a garbage collection."""
    page.request_gc()
    return protocol(page).send("Runtime.getHeapUsage")["usedSize"]


def protocol(page):
    """Chromium's own protocol, for what Playwright has no word for."""
    return page.context.new_cdp_session(page)


def memory(process):
    """Resident memory of a process and of those that it has started, MB."""
    parents = {}
    for status in Path("/proc").glob("[0-9]*/status"):
        with contextlib.suppress(OSError):
            fields = dict(line.split(":", 1) for line in status.read_text().splitlines() if ":" in line)
            parents[int(fields["Pid"])] = (int(fields["PPid"]), int(fields.get("VmRSS", "0 kB").split()[0]))
    family = {process.pid}
    while more := {pid for pid, (parent, _) in parents.items() if parent in family and pid not in family}:
        family |= more
    return sum(parents[pid][1] for pid in family if pid in parents) / 1024


def random_moves(page, count, seed=20):
    """Make moves at random, at the pace of a quick hand: sliders, choices, plate, undo, views, a second design."""
    choose = random.Random(seed)
    fields = [field for field in page.evaluate("Explorer.fields()") if field["name"] != "friction"]
    for k in range(count):
        kind = choose.random()
        if kind < 0.6:
            field = choose.choice(fields)
            if field["kind"] in ("choice", "part"):
                move(page, field["name"], choose.choice(field["choices"]))
            elif field["kind"] == "text":
                move(page, field["name"], choose.choice(["", "0.1:1"]))
            else:
                slider = f"document.getElementById('field-{field['name']}-slider')"
                low, high = page.evaluate(f"[Number({slider}.min), Number({slider}.max)]")
                move(page, field["name"], low + (high - low) * choose.random())
        elif kind < 0.65:
            move(page, "friction", choose.choice(["none", "stick", "coefficient"]))
        elif kind < 0.8:
            page.evaluate("document.querySelector('figure.section .plate').focus()")
            page.keyboard.press(choose.choice(["ArrowDown", "ArrowUp", "ArrowLeft", "ArrowRight", "Home"]))
        elif kind < 0.9:
            button = choose.choice(["undo", "redo", "cut", "view-lines", "view-mesh"])
            click(page, button)
        elif kind < 0.93:
            click(page, "compare")
        elif kind < 0.95:
            click(page, "reset")
        else:
            field = choose.choice(["displacement", "pressure", "stretch"])
            page.evaluate(f"Explorer.look('field', {json.dumps(field)})")
        if k % 20 == 19:
            rest_a_while(page)
        else:
            time.sleep(choose.choice([0.0, 0.0, 0.02, 0.1]))


def other_value(field):
    """Another value of a control: the next choice, 15 % of the way to the slider's farther end, at least a step."""
    if "choices" in field:
        return next(one for one in field["choices"] if one != field["value"])
    if field["kind"] == "text":
        return "0.1:1"
    if field["kind"] == "logarithmic":
        return 700
    farther = max(field["slider"], key=lambda end: abs(end - field["value"]))
    way = farther - field["value"]
    return field["value"] + math.copysign(max(0.15 * abs(way), field["step"]), way)


def percentile(values, share):
    """The value below which a share of the values lies."""
    return sorted(values)[min(int(share * len(values)), len(values) - 1)]


def drag_times(page):
    """Times from slider to picture at level quick, ms, by what is dragged.

    They are the median, the 95th percentile, and means of their stages: over all moves, and over the slowest tenth.
    """
    table = {}
    for name, start, field, low, high, _ in DRAGS:
        go(page, f"#preset=paper&level=quick&{start}")
        wait(page, "Explorer.complete()")
        ask(page, DRAG, f"field-{field}-slider", low, high, 20)
        times = sorted(ask(page, DRAG, f"field-{field}-slider", low, high, 150), key=lambda one: one["total"])
        totals = [one["total"] for one in times]
        parts = {"mean_ms": times, "slowest_ms": times[-(len(times) // 10) :]}
        table[name] = {
            "steps": len(times),
            "median_ms": round(percentile(totals, 0.5), 1),
            "p95_ms": round(percentile(totals, 0.95), 1),
        } | {
            share: {stage: round(sum(one[stage] for one in some) / len(some), 1) for stage in STAGES}
            for share, some in parts.items()
        }
    return table


def latency():
    """The times from slider to picture of a new server, and of a page that is composed without OpenGL.

    Chromium does so by itself where there is no graphics card. `launched` composes whole pages by SwiftShader, an
    OpenGL in software, which occupies a processor.
    """
    with launched(*WITHOUT_OPENGL) as browser, server() as (_, address):
        page = opened(browser, address, 1400, 900)
        rest(page)
        # the first answers of an installation wait for compiled functions
        wait(page, SETTLED)
        return drag_times(page)


def main(out, moves=1000):
    """Write the evidence and the screenshots."""
    out.mkdir(parents=True, exist_ok=True)
    evidence = {"cores": os.cpu_count(), "load_average_at_start": round(os.getloadavg()[0], 1)}
    evidence["slider_to_picture"] = latency()
    with launched() as browser, server() as (process, address):
        page = opened(browser, address, 1400, 900)
        rest(page)
        # the first answers of an installation wait for compiled functions
        wait(page, SETTLED)
        memories = []
        for part in range(5):
            random_moves(page, moves // 5, seed=part)
            go(page, "#preset=paper&level=quick")
            memories.append(
                {
                    "moves": (part + 1) * moves // 5,
                    "server_MB": round(memory(process)),
                    "heap_MB": round(heap(page) / 1e6, 2),
                }
            )
        evidence["memory"] = memories
        evidence["console"] = said(page)
        for name, width, state in SCREENS:
            sheet = opened(browser, f"{address}{state}", width, 900)
            rest(sheet)
            wait(sheet, SETTLED)
            (out / f"{name}.png").write_bytes(sheet.screenshot(full_page=True))
            sheet.close()
    picture_array(out)
    (out / "session.json").write_text(json.dumps(evidence, indent=1) + "\n")
    (out / "EXPLORER.md").write_text(in_words(**evidence) + "\n")


def picture_array(out):
    """Write the picture of an array's panel, three of whose beams are pressed."""
    with tempfile.TemporaryDirectory() as folder, launched() as browser:
        file = Path(folder, "array.toml")
        file.write_text('base = "paper"\n[array]\nrows = 3\ncolumns = 3\npitch = 12.0\npolarity = "checkerboard"\n')
        with server(design=file) as (_, address):
            sheet = opened(browser, f"{address}{ARRAY}", 1300, 900)
            wait(sheet, "Explorer.answers.a.array")
            # the bar of the page would lie on it
            sheet.set_viewport_size({"width": 1300, "height": 1800})
            (out / "array.png").write_bytes(sheet.locator("#array-panel").screenshot())


def in_words(**evidence):
    """The evidence as a page of Markdown, by the template beside this file; without `memory` the latencies only."""
    goals = {name: goal or "none" for name, *_, goal in DRAGS}
    values = {"commit": commit(), "goals": goals, "stages": STAGES, "memory": None}
    return rendered(Path(__file__).with_suffix(".md.j2"), **values | evidence)


WITHOUT_OPENGL = ("--disable-gpu-compositing", "--disable-gpu-rasterization", "--disable-accelerated-2d-canvas")
"""Options of a Chromium that composes pages, but not pictures in 3D, without OpenGL."""
DRAGS = (
    ("press", "depth=0.5", "depth", 0.5, 2.5, 100),
    ("shear", "depth=1&shear=0.1", "shear", 0.1, 2.5, 300),
    ("diameter", "depth=1", "D", 7.0, 9.0, None),
)
"""Drags: name, state at the start, control, first and last value, and goal of the 95th percentile, ms."""
STAGES = {
    "before": "until the request of the picture is sent",
    "queue": "wait for the worker",
    "work": "solve and answer",
    "transport": "between page, server and worker",
    "drawing": "drawing",
}
"""Stages of the time from slider to picture, in their order."""
SCREENS = (
    ("explorer", 1400, "#preset=paper&depth=1.2&shear=1.5&frequency=100&speed=2&view.lines=yes"),
    (
        "compare",
        1400,
        "#preset=paper&depth=1.5&view.field=pressure&view.edit=b&b.preset=paper&b.depth=1.5&b.D=10&b.L=12",
    ),
    ("narrow", 390, "#preset=paper&depth=1.5&frequency=100&speed=2"),
)
"""Screenshots: name, width in pixels, state of the address."""
ARRAY = "#preset=paper&beam=5&depth=1&shear=0.6&direction=30&beam_loads=1:1.5,0.5,0%203:0.8,0.4,-120%208:1,0.5,90"
"""State of an array in its picture."""

if __name__ == "__main__":
    if sys.argv[1] == "--latency":
        print(in_words(slider_to_picture=latency()))
    elif sys.argv[1] == "--array":
        picture_array(Path(sys.argv[2]))
    else:
        main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1000)
