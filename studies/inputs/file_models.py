"""What a file of a user may say, as pydantic models: keys, kinds, units and ranges; and how it is refused.

Each kind of table in a file has a model, and `read` is the only way in: the first thing that is wrong is one sentence
with file, key, value, bound and remedy. Beyond this border are the values of the domain (`Design`, `Requirements`,
parts). pydantic takes 0.2 s to import, so this module is imported where a file is read.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError, ValidationInfo, create_model

from geometry.bad_input import nearest, words
from geometry.design import BadInput
from studies.inputs.units import quantity

Model = TypeVar("Model", bound="FileTable")


class FileTable(BaseModel):
    """A table of a file: values have the kind of their key, numbers are finite, and there are no other keys."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)

    def stated(self) -> dict[str, Any]:
        """Return the values that the file states, without defaults."""
        return self.model_dump(exclude_unset=True)


def model_of(kinds: Mapping[str, Any]) -> type[FileTable]:
    """Return the model of a table whose optional keys are declared elsewhere, such as the fields of `Design`."""
    fields: dict[str, Any] = {key: (kind, None) for key, kind in kinds.items()}
    return create_model("Table", __base__=FileTable, **fields)


# Kinds of values


def number(unit: str, low: float = -math.inf, high: float = math.inf) -> BeforeValidator:
    """Return the kind of a number in a unit of `units.IN_VALUES`, or of a text with a number and its unit."""
    return BeforeValidator(lambda value, info: quantity(str(info.field_name), value, unit, low, high))


def numbers(unit: str, low: float, high: float, form: str, *, alone: bool = False) -> BeforeValidator:
    """Return the kind of a list of such numbers, which is written in a form such as [low, high], and then rises.

    alone : whether one number may stand for all of them.
    """
    count, rises = form.count(",") + 1, "low" in form

    def checked(value: object, info: ValidationInfo) -> tuple[float, ...]:
        if alone and isinstance(value, str | int | float):
            value = [value] * count
        if not isinstance(value, list) or len(value) != count:
            raise BadInput(f"{info.field_name} must be {form}; got {value!r:.60}")
        found = tuple(quantity(str(info.field_name), each, unit, low, high) for each in value)
        if rises and list(found) != sorted(found):
            got = ", ".join(f"{each:g}" for each in found)
            raise BadInput(f"{info.field_name} must be {form}, none above the next; got {got}")
        return found

    return BeforeValidator(checked)


def _text(value: object, info: ValidationInfo) -> str:
    if not isinstance(value, str) or not value.strip():
        raise BadInput(f"{info.field_name} must be a text; got {value!r:.60}")
    return words(str(info.field_name), value)


def _names(value: object, info: ValidationInfo) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise BadInput(f"{info.field_name} must be a list of names; got {value!r:.60}")
    return tuple(words(str(info.field_name), name) for name in value)


def _tables(value: object, info: ValidationInfo) -> tuple[object, ...]:
    if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
        raise BadInput(f"{info.field_name} must be an array of tables: write [[{info.field_name}]]")
    return tuple(value)


Text = Annotated[str, BeforeValidator(_text)]
"""A text on one line."""
Names = Annotated[tuple[str, ...], BeforeValidator(_names)]
"""A list of such texts."""
Tables = Annotated[tuple[dict[str, Any], ...], BeforeValidator(_tables)]
"""An array of tables [[name]]."""


# The only way in, and what it says


def read(where: str, table: Mapping[str, Any], model: type[Model]) -> Model:
    """Return the values of a table by its model; tables within it, which have models of their own, are read like it.

    where : names the file, and the table in it, in messages.

    Raises
    ------
    BadInput
        The first key that the model does not have, or else the first value that is missing or wrong.
    """
    for key in table:
        if key not in model.model_fields:
            raise BadInput(f"{where}: there is no key {key!r}: {nearest(key, model.model_fields)}")
    try:
        return model.model_validate(dict(table))
    except ValidationError as error:
        first: Any = error.errors()[0]
    if first["type"] == "value_error":  # a BadInput of one of the kinds above, or of a model
        raise BadInput(f"{where}: {first['ctx']['error']}") from None
    key = first["loc"][0]
    if first["type"] == "missing":
        raise BadInput(f"{where}: {key} is missing")
    wanted = first["ctx"]["expected"] if first["type"] == "literal_error" else WANTED.get(first["type"], first["msg"])
    raise BadInput(f"{where}: {key} must be {wanted}; got {first['input']!r:.60}")


WANTED = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a table",
    "string_type": "a string",
}
"""What a value must be, by pydantic's names of errors."""
