"""Figures of steady vibrations (verb response) and of loading cycles (verb cycle)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array
from studies.output.figures import LOG, Figure, escaped, markers, numbers, panels, rule, styles, texts

if TYPE_CHECKING:
    import pandas as pd

BAND = 600.0
"""Frequency up to which the paper used its sensor, Hz."""
LAWS = {"prony": "linear overstresses"}
"""Names of the laws of a loading cycle, by the texts of their column."""
HIGHEST = 2.0
"""Top of the axis of oscillators over the largest damped gain: an undamped one has no largest gain."""


def response(table: pd.DataFrame) -> list[Figure]:
    """Return gain and phase of the readings over the frequency, a panel for each motion of the plate."""
    import altair as alt

    per_N = [name for name in table.columns if name.endswith("_per_N")]
    forced = any(numbers(table, name).notna().any() for name in per_N)
    unit = "N" if forced else "mm"
    gains = [name for name in per_N if forced] or [
        name for name in table.columns if name.endswith("_per_mm") and not name.startswith(("force", "shift", "tilt"))
    ]
    names = [name.rsplit("_", 3)[0] for name in gains]
    phases = [f"{name}{'_per_N' if forced else ''}_phase_deg" for name in names]
    lowest = numbers(table, "frequency_Hz").min()
    first = f"over that at {lowest:.4g} Hz" if np.isfinite(lowest) else "over that at the lowest frequency"
    shaken = "" if forced else " The base is shaken."
    driver = "force" if forced else "motion of the base"
    idle = _idle(table, gains, names)
    x, gain, phase = "frequency (Hz)", f"gain per {unit} {first}", f"phase to the {driver} (degrees)"
    band, looks = rule("x", BAND, f"{BAND:.0f} Hz"), styles(names, "color", "strokeDash")
    gained = _curves(table, gains, names, gain, relative=True)
    turned = _curves(table, phases, names, phase, relative=False)
    lines = alt.Chart().encode(x=alt.X(x, **LOG), **looks)
    of_gain = lines.mark_line(point=markers(gained)).encode(y=alt.Y(escaped(gain), type="quantitative", **LOG))
    of_phase = lines.mark_line(point=markers(turned)).encode(y=phase)
    return [
        Figure(
            f"Readings per {unit} over the frequency",
            f"Gain of each element {first}; 0.707 is a loss of 3 dB.{shaken}{idle}",
            panels(alt.layer(*band, *rule("y", 2**-0.5, "-3 dB", left=True), of_gain), gained),
            gained,
        ),
        Figure(
            f"Phase of the readings per {unit}",
            f"Phase of each reading to the {driver}; below 0 the reading lags behind. Half a turn is taken off where "
            f"an element reads in the opposite sense.{shaken}{idle}",
            panels(alt.layer(*band, of_phase), turned),
            turned,
        ),
    ]


def _idle(table: pd.DataFrame, columns: list[str], names: list[str]) -> str:
    sentences = ""
    for motion, rows in table.groupby(texts(table, "motion"), sort=False):
        silent = [
            name for column, name in zip(columns, names, strict=True) if not numbers(rows, column).notna().any()
        ]
        if silent:
            verb = "reads" if len(silent) == 1 else "read"
            sentences += f" {', '.join(silent)} {verb} nothing of a motion along {motion}."
    return sentences


def _curves(table: pd.DataFrame, columns: list[str], names: list[str], y: str, *, relative: bool) -> pd.DataFrame:
    """Return gains over their values at the lowest frequency, or phases near 0 there, for each motion."""
    import pandas as pd

    parts = []
    for motion, rows in table.groupby(texts(table, "motion"), sort=False):
        for column, name in zip(columns, names, strict=True):
            values = numbers(rows, column)
            first = values.iloc[0]
            if np.isfinite(first) and (first or not relative):
                change = values / first if relative else values - 180 * np.round(first / 180)
                part = {"frequency (Hz)": numbers(rows, "frequency_Hz"), y: change}
                parts.append(pd.DataFrame(part).assign(panel=f"motion along {motion}", series=name))
    empty = pd.DataFrame({"frequency (Hz)": [], y: [], "panel": [], "series": []})
    return pd.concat(parts, ignore_index=True).dropna(ignore_index=True) if parts else empty


def oscillators(frequency: Array, gains: Mapping[str, Array], undamped: Sequence[str]) -> Figure:
    """Return the gain of the magnet's shift per N beside that of oscillators, over its value at the first frequency.

    Parameters
    ----------
    frequency : Hz, shape (f,).
    gains : of each model by its name, shape (f,).
    undamped : oscillators whose gain has no largest value.
    """
    import altair as alt
    import pandas as pd

    relative = {name: gain / gain[0] for name, gain in gains.items()}
    label = f"shift per N over that at {frequency[0]:.4g} Hz"
    top = HIGHEST * max(float(gain.max()) for name, gain in relative.items() if name not in undamped)
    parts = [pd.DataFrame({"frequency (Hz)": frequency, label: gain, "series": n}) for n, gain in relative.items()]
    data = pd.concat(parts, ignore_index=True)
    data = data[data[label] <= top]
    caption = "Motion of the magnet per N by finite elements and by oscillators of one and two masses."
    chart = alt.Chart(data).mark_line(point=markers(data)).encode(
        x=alt.X("frequency (Hz)", **LOG), y=alt.Y(escaped(label), type="quantitative", **LOG),
        **styles(gains, "color", "strokeDash")
    )  # fmt: skip
    return Figure("Motion of the magnet beside oscillators", caption, chart, data)


def cycle(table: pd.DataFrame) -> list[Figure]:
    """Return the loops of force over motion, a panel for each law, and the force over time."""
    import altair as alt
    import pandas as pd

    sheared = bool((numbers(table, "shear_mm").abs() > 0).any())
    ways = ("the way to +x", "the way back") if sheared else ("loading", "unloading")
    way, force = ("shear_mm", "force_x_N") if sheared else ("depth_mm", "force_z_N")
    x, y = ("shear (mm)", "force along the shear (N)") if sheared else ("depth (mm)", "press force (N)")
    frame = table.assign(
        **{x: numbers(table, way), y: numbers(table, force), "time (s)": numbers(table, "time_s")},
        decoded=numbers(table, "decoded_force_N"),
        panel=texts(table, "law").map(lambda law: LAWS.get(law, law)),
        series=[f"cycle {number}" if number != "0" else "press" for number in texts(table, "cycle")],
    )
    data = frame.assign(model="of the plate")
    if frame["decoded"].notna().any():
        decoded = frame.assign(**{y: frame["decoded"]}, model="decoded from the readings")
        data = pd.concat([data, decoded], ignore_index=True)
    caption = (
        f"Each cycle has a colour; the upper line of its loop is {ways[0]}, the lower one {ways[1]}. Dashed: the "
        "force that is decoded from the readings as that of slow loading. The table loops.csv has gap, area and "
        "dissipated energy of each loop."
    )
    over_time = data.assign(series=data["model"])[["time (s)", y, "panel", "series"]].dropna(ignore_index=True)
    data = data[[x, y, "panel", "series", "model"]].dropna(ignore_index=True)
    loops = alt.Chart().mark_line(point="transparent").encode(
        x=x, y=y, order="order:Q", **styles(data["series"], "color"),
        **styles(data["model"], "strokeDash", column="model")
    )  # fmt: skip
    times = alt.Chart().mark_line(point="transparent").encode(
        x=alt.X("time (s)").scale(nice=False), y=y, **styles(data["model"], "color", "strokeDash")
    )  # fmt: skip
    return [
        Figure(
            "Loops of the force over the motion",
            caption,
            panels(loops, data.assign(order=np.arange(len(data)))),
            data,
        ),
        Figure(
            "Force over time",
            "The force of the plate and the force that is decoded from the readings as if it were loaded slowly.",
            panels(times, over_time, columns=1),
            over_time,
        ),
    ]
