"""Notes below the pictures of a sweep."""

import dataclasses

import numpy as np
import pytest

from studies.exploration import sweep_notes
from studies.exploration.sweep_views import Section, View

FORCE = Section(
    view=View(maps=False, x="loss_factor"),
    label="press force",
    unit="N",
    error=False,
    models=("FEM standard",),
    values=(np.full((1, 1, 1, 1, 3), 4.2),),
    spread=(),
    alike=(False,),
    failures=np.zeros((1, 1, 1, 1, 3)),
    colours=(0,),
)


def test_a_quantity_that_its_axis_does_not_change_is_named():
    (note,) = sweep_notes.of_picture([FORCE])
    assert note.startswith("Press force is the same for every ")


@pytest.mark.parametrize("values", [np.array([4.2, 4.2, 4.3]), np.array([4.2]), np.array([4.2, np.nan, np.nan])])
def test_other_quantities_have_no_such_note(values):
    section = dataclasses.replace(FORCE, values=(values.reshape(1, 1, 1, 1, -1),))
    assert sweep_notes.of_picture([section]) == []
