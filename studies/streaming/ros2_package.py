"""A ROS 2 package for one sensor: its files, which are templates in the folder `ros2`."""

from functools import partial
from importlib.metadata import version
from pathlib import Path

from geometry.design import Design
from studies.inputs.user_input import design_text
from studies.output import page_templates
from studies.output.atomic_files import write_text
from studies.output.bounded_files import text_of
from studies.output.result import Writer

PACKAGE = "magtip_sensor"
PLACES = {
    "package.xml": "", "setup.py": "", "setup.cfg": "", "README.md": "",
    "sensor.yaml": "config/", "sensor.launch.py": "launch/", "feed.py": f"{PACKAGE}/", "node.py": f"{PACKAGE}/",
}  # fmt: skip
"""Templates, and their folders in the package."""
MADE = {f"resource/{PACKAGE}": "", f"{PACKAGE}/__init__.py": ""}
CONFIG = ("config/design.toml", "config/calibration.json")
FILES = tuple(f"ros2/{PACKAGE}/{name}" for name in (*(p + t for t, p in PLACES.items()), *MADE, *CONFIG))


def files(design: Design, calibration: Path | None = None, *, reject_ambient: bool = False) -> dict[str, Writer]:
    """Return the writers of the package's files; with a calibration it decodes by a copy of that."""
    folder = Path(__file__).with_name("ros2")
    said = {"version": version("magtip"), "calibrated": calibration is not None, "rejects": reject_ambient}
    texts = {
        place + name: page_templates.rendered(folder / f"{name}.j2", **said) + "\n" for name, place in PLACES.items()
    }
    texts |= {**MADE, CONFIG[0]: design_text(design)}
    if calibration is not None:
        texts[CONFIG[1]] = text_of(calibration, "JSON")
    return {f"ros2/{PACKAGE}/{name}": partial(write_text, text=text) for name, text in texts.items()}
