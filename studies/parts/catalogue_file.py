"""The file format of catalogues: the arrays of tables `[[grade]]`, `[[magnet]]`, `[[hall_part]]` and `[[silicone]]`.

A number may be a text with its unit. A value that a table leaves out has its default and counts as assumed; of what
defaults to None nothing is known then.
"""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import field_validator, model_validator

from geometry.bad_input import nearest
from geometry.design import HALL_LAYOUTS, BadInput
from geometry.hall_chips import AMBIENT, CHIPS
from studies.inputs import file_models
from studies.inputs.file_models import FileTable, Names, Tables, Text, number, numbers
from studies.inputs.user_input import check_keys, toml_table

NOT_ASSUMED = ("name", "layout", "source", "loss_source", "assumed")
"""Keys that are no value of a part."""
RANGE, TYPICAL, BODY = "[low, high]", "[low, typical, high]", "[width, height, thickness]"
Pair = tuple[float, float]
Triple = tuple[float, float, float]


class Entry(FileTable):
    """A table with a name."""

    name: Text
    source: Text = "the user's file"
    """Publication or data sheet."""

    @property
    def called(self) -> str:
        """The name."""
        return self.name


class Part(Entry):
    """A table of one part."""

    assumed: Names = ()
    """Keys without a source that was read, and with them all known values that the table leaves out."""

    @field_validator("assumed")
    @classmethod
    def _keys(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        check_keys("assumed", names, cls.model_fields)
        return names

    @property
    def all_assumed(self) -> tuple[str, ...]:
        """`assumed`, and the keys that the table leaves out although they have a known value."""
        unset = [name for name in type(self).model_fields if name not in (*self.model_fields_set, *NOT_ASSUMED)]
        return (*self.assumed, *(name for name in unset if getattr(self, name) is not None))


class Grade(Entry):
    """A grade of magnets."""

    remanence: Annotated[Pair, numbers("T", 0.01, 2, RANGE)]
    remanence_drift: Annotated[float, number("1/K", -0.005, 0.005)] = -0.0012
    """Change of the remanence per K, up to the working limit."""
    largest_temperature: Annotated[float, number("C", 20, 600)] = 80.0
    """Working limit."""


class Magnet(Part):
    """A size of magnet, which is sold in one or more grades."""

    name: Text = ""
    diameter: Annotated[float, number("mm", 0.1, 200)]
    height: Annotated[float, number("mm", 0.1, 200)]
    edge_radius: Annotated[float, number("mm", 0, 100)] = 0.1
    tolerance: Annotated[float, number("mm", 0, 10)] = 0.1
    """Of diameter and height, +-."""
    density: Annotated[float, number("kg/m3", 100, 25000)] = 7500.0
    grades: Names

    @property
    def called(self) -> str:
        """The name, or else the size, such as 4x2."""
        return self.name or f"{self.diameter:g}x{self.height:g}"

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if not self.grades:
            raise BadInput("grades is empty: name one or more, such as N35")
        widest = min(self.diameter, self.height) / 2
        if not self.edge_radius <= widest:
            raise BadInput(
                f"edge_radius must not exceed half the magnet's smaller side = {widest:g} mm; got "
                f"{self.edge_radius:g} mm"
            )
        return self


class HallPart(Part):
    """A Hall part: a one-axis part, of which a sensor has three, or a 3-axis chip.

    The keys from gain to plate are those of one-axis parts (layout three), by default with the figures of the SS495A
    and the noise of the DRV5055; only chips of one's own have those from range to plate_height.
    """

    layout: Text = "three"
    """three (one axis), the layout of a shipped chip, chip (of any kind) or ambient."""
    gain: Annotated[float | None, number("V/T", 0.001, 1e6)] = None
    gain_tolerance: Annotated[float, number("1", 0, 1)] = 0.05
    """Largest relative deviation of the gain."""
    gain_drift: Annotated[float | None, number("1/K", -1, 1)] = None
    """Change of the gain per K: a rise (+) makes up for the magnet's loss, a fall (-) adds to it; of a figure of both
    signs, the fall."""
    null: Annotated[float, number("V", 0, 100)] = 2.5
    """Output in zero field."""
    null_tolerance: Annotated[float | None, number("V", 0, 100)] = None
    low: Annotated[float, number("V", 0, 100)] = 0.2
    """Lower rail."""
    high: Annotated[float, number("V", 0, 100)] = 4.8
    """Upper rail."""
    noise_density: Annotated[float, number("T/sqrt(Hz)", 0, 0.001)] = 130e-9
    """White noise of the input."""
    bandwidth: Annotated[float, number("Hz", 1, 1e7)] = 20000.0
    """-3 dB."""
    plate: Annotated[float, number("mm", 0, 10)] = 0.0
    """Side of the Hall plate."""
    range: Annotated[float | None, number("T", 1e-6, 10)] = None
    """Full scale."""
    step: Annotated[float | None, number("T", 0, 1)] = None
    """One count."""
    noise: Annotated[float | None, number("T", 0, 1)] = None
    """Rms of one value, at the rate."""
    rate: Annotated[float | None, number("Hz", 0.001, 1e7)] = None
    """Values of all axes a second."""
    offset: Annotated[float | None, number("T", 0, 10)] = None
    """Largest output in zero field."""
    plate_height: Annotated[float | None, number("mm", 0, 20)] = None
    """Height of the sensitive volume over the board; half the chip's height where unknown."""
    body: Annotated[Triple, numbers("mm", 0.1, 100, BODY)] = (4.06, 3.0, 1.57)
    """Of a chip along x, along y and over its board."""

    @model_validator(mode="after")
    def _of_layout(self) -> Self:
        layouts = (*HALL_LAYOUTS, AMBIENT)
        if self.layout not in layouts:
            raise BadInput(f"there is no layout {self.layout!r}: {nearest(self.layout, layouts)}")
        needed = ("gain",) if self.layout == "three" else () if self.layout in CHIPS else ("range", "step")
        for name in needed:
            if getattr(self, name) is None:
                raise BadInput(f"{name} is missing")
        if self.layout == "three" and not self.low < self.null < self.high:
            raise BadInput(
                f"null must lie between low = {self.low:g} V and high = {self.high:g} V; got {self.null:g} V"
            )
        high = self.body[2]
        if "range" in needed and self.plate_height is not None and not self.plate_height <= high:
            raise BadInput(
                f"plate_height must not exceed the body's height = {high:g} mm; got {self.plate_height:g} mm"
            )
        return self


class Silicone(Part):
    """A castable silicone."""

    E: Annotated[Triple, numbers("MPa", 1e-4, 1e4, TYPICAL)]
    """Young's modulus at small strain."""
    nu: Annotated[Triple, numbers("1", 0.3, 0.5, TYPICAL)] = (0.49, 0.4998, 0.4999)
    density: Annotated[float, number("kg/m3", 100, 25000)] = 1080.0
    loss_factor: Annotated[Triple | None, numbers("1", 0, 1, TYPICAL, alone=True)] = None
    """tan(delta) as measured; no sensor is rated by one that is unknown."""
    loss_frequency: Annotated[Pair, numbers("Hz", 1e-6, 1e6, RANGE)] = (0.01, 1000.0)
    """Of these tests: of other frequencies the loss factor is unknown."""
    loss_source: Text = ""
    """Of the loss factor; default: source."""
    cure_temperature: Annotated[float, number("C", 0, 400)] = 23.0
    """Of the data sheet without an oven."""
    cure_hours: Annotated[float, number("h", 0, 1000)] = 24.0
    mixed: Text = "by its data sheet"
    """Ratio of the parts; in the form 10A:1B by weight, recipes say the mass of each."""
    mixed_source: Text = ""
    """Of the ratio; default: source."""
    pot_life: Annotated[float | None, number("min", 0.1, 10000)] = None
    """Time after mixing in which it can be poured."""


class CatalogueFile(FileTable):
    """A whole file."""

    grade: Tables = ()
    magnet: Tables = ()
    hall_part: Tables = ()
    silicone: Tables = ()


MODELS: dict[str, type[Entry]] = {"grade": Grade, "magnet": Magnet, "hall_part": HallPart, "silicone": Silicone}
"""Models of the tables by the names of their arrays."""


def read(path: str) -> dict[str, dict[str, Any]]:
    """Return the tables of a file by the names of their arrays and their own, each by its model."""
    arrays = file_models.read(path, toml_table(path, "file"), CatalogueFile)
    found: dict[str, dict[str, Any]] = {array: {} for array in MODELS}
    for array, model in MODELS.items():
        for count, table in enumerate(getattr(arrays, array), 1):
            name = table.get("name")
            place = name if isinstance(name, str) and name else f"[[{array}]] number {count}"
            entry = file_models.read(f"{path}: {place}", table, model)
            if entry.called in found[array]:
                raise BadInput(f"{path}: two tables [[{array}]] have the name {entry.called!r}: rename or remove one")
            found[array][entry.called] = entry
    if not any(found.values()):
        raise BadInput(f"{path}: the catalogue is empty: add a table [[magnet]], [[hall_part]] or [[silicone]]")
    return found
