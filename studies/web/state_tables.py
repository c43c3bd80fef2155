"""What the page shows of an answer: tables of rows with words, units and half widths, notes below them, and figures.

A table has `columns` (names of the values and of what stands beside them, "" for nothing), `rows` (see `number`) and
a `message`. A figure has its `chart` in `page/charts.json`, the `title` of its values and its `rows`. What depends on
the level of the formulas stands by the names of all levels: the page shows the chosen one.
"""

from __future__ import annotations

from typing import Any

from analytic import beam

Data = dict[str, Any]
PENDING = "± …"
"""In place of a half width that follows."""
AXES = ("force along x", "force along y", "normal force")
ROOM = 1.05
"""End of the axis of the readings over the rail."""


def number(name: str, unit: str, value: float | None, half_width: Any = None, beside: Any = None) -> Data:
    """Return a row: a value, None where it is unknown, its half width or a text, and what stands beside them."""
    return {"name": name, "unit": unit, "value": value, "half_width": half_width, "beside": beside}


def of_state(data: Data) -> Data:
    """Return the tables of the part `state` by their names."""
    return {"response": _response(data), "readings": _readings(data), "decoded": _decoded(data)}


def _response(data: Data) -> Data:
    response, widths, formulas = data["response"], data["estimates"], data["formulas"]
    is_known = widths["force"] is not None

    def row(name: str, unit: str, quantity: str, k: int | None = None) -> Data:
        def at(values: Any) -> Any:
            return values if values is None or k is None else values[k]

        beside = {level: at(one.get(quantity)) for level, one in formulas.items()}
        if quantity.startswith("tilt") and beside["paper"] is None and formulas["paper"]["force"]:
            beside["paper"] = "no formula"
        half = widths["tilt" if quantity == "tilt_y" else quantity]
        pending = None if quantity == "contact_radius" else PENDING
        return number(name, unit, at(response[quantity]), at(half) if is_known else pending, beside)

    rows = [row(name, "N", "force", k) for k, name in zip((2, 0, 1), (AXES[2], *AXES[:2]), strict=True)]
    rows += [row(f"shift along {axis}", "mm", "shift", k) for k, axis in enumerate("xyz")]
    rows += [row("tilt towards x", "deg", "tilt"), row("tilt towards y", "deg", "tilt_y")]
    notes = {
        level: " ".join(filter(None, [data["calibration"], one["message"] and f"Formula {level}: {one['message']}"]))
        for level, one in formulas.items()
    }
    return {
        "columns": ["finite elements", {level: f"formula {level}" for level in formulas}],
        "rows": [*rows, row("contact radius", "mm", "contact_radius")],
        "message": notes,
    }


def _readings(data: Data) -> Data:
    read = data["readings"]
    if read is None or "volts" not in read:
        return {"rows": [], "message": read["message"] if read else "This sensor has no magnet to read."}
    half = read["half_width"] or [PENDING] * len(read["volts"])
    rows = [
        number(f"{name} (at its rail)" if saturated else name, unit, volts, width, volts - rest)
        for name, unit, volts, rest, width, saturated in zip(
            read["elements"], read["units"], read["volts"], read["rest"], half, read["saturated"], strict=True
        )
    ]
    return {"columns": ["under this load", "change"], "rows": rows, "message": ""}


def _decoded(data: Data) -> Data:
    found, read = data["decoded"], data["readings"]
    if read is None or "volts" not in read:
        return {"rows": [], "message": "There are no readings to decode."}
    force, half, noise = ((found and found[key]) or [None] * 3 for key in ("force", "half_width", "noise"))
    rows = [number(*row) for row in zip(AXES, "NNN", force, half, noise, strict=True)]
    return {"columns": ["from the readings", "noise (rms)"], "rows": rows, "message": found and _decoding(data)}


def _decoding(data: Data) -> str:
    """Return what the decoded load rests on; half widths of formulas are those of their fit to the readings."""
    found, status = data["decoded"], data["decoded"]["status"].replace("_", " ")
    if found["level"] == "calibration":
        return f"By the calibration, status {status}: 90 % intervals, with noise."
    text = f"By the formulas of level {found['level']}, status {status}."
    if found["force"]:
        off = [abs(own - fem) for own, fem in zip(found["force"], data["response"]["force"], strict=True)]
        where = f"here the {AXES[off.index(max(off))]} is {max(off):.4g} N off the finite elements"
        text += f" Half widths do not cover the error of the formulas: {where}."
    return text + ("" if found["noise"] else " Give the Hall elements a noise to see its effect on the forces.")


def readings_figure(data: Data) -> Data | None:
    """Return the readings as bars, with those at rest; the axis ends beyond the rails. None without readings."""
    read = data["readings"]
    if read is None or "volts" not in read:
        return None
    half, ends = read["half_width"] or [0.0] * len(read["volts"]), [ROOM * end for end in read["high"]]
    if min(read["volts"]) < 0:
        ends[0] = -ends[0]
    columns = {"value": read["volts"], "rest": read["rest"], "end": ends}
    rows = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    for name, row, width in zip(read["elements"], rows, half, strict=True):
        # of several chips, whose names would overlap, the number and the axis
        short = name.removeprefix("chip") if name.startswith("chip") and name[4:5].isdigit() else name
        row |= {"element": short, "low": row["value"] - width, "high": row["value"] + width}
    return {"chart": "readings", "title": f"reading ({read['units'][0]})", "rows": rows}


CURVES = {"force": ("normal force (N)", 1.0), "shift": ("shift downwards (mm)", -1.0)}


def curve_figures(data: Data) -> Data:
    """Return force and shift over the depth by finite elements and by the formulas of all levels."""
    figures = {}
    for quantity, (title, sign) in CURVES.items():
        lines = {"finite elements": (data[quantity], data["estimates"][quantity])}
        for level in beam.LEVELS:
            name = "paper's formula" if level == "paper" else f"formula {level}"
            lines[name] = data["formulas"][level][quantity], [None] * len(data["depth"])
        rows = [
            {"depth": depth, "value": sign * value, "model": model}
            | ({} if half is None else {"low": sign * value - half, "high": sign * value + half})
            for model, (values, widths) in lines.items()
            for depth, value, half in zip(data["depth"], values, widths, strict=True)
            if value is not None
        ]
        figures[quantity] = {"chart": "curve", "title": title, "rows": rows}
    return figures
