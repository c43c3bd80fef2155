"""What is drawn of the assembled sensor: the section, and elements with their names."""

import dataclasses

import numpy as np
import pytest

from geometry.design import paper
from geometry.fabrication import hall_elements
from studies.fabrication import assembly_picture, sensor_solids


def test_an_element_behind_the_section_is_named_beside_the_beam_and_drawn_without_leads():
    design = paper()
    parts = sensor_solids.coloured_parts(sensor_solids.make_solids(design, sensor_solids.FabricationChoices()))
    drawn = dict(zip(parts, assembly_picture.faceted(parts, hall_elements.places(design)), strict=True))
    assert [name for name, part in drawn.items() if part.label] == ["S1", "S2", "S3"]
    bounds = {name: assembly_picture.shown(part).bounds for name, part in drawn.items()}
    assert bounds["S3"][4] == pytest.approx(bounds["base"][4], abs=1e-6)
    assert bounds["S2"][4] < bounds["base"][4] - 1
    x, y, z = drawn["S3"].label[1]
    assert bounds["S3"][0] < x < bounds["S3"][1]
    assert z == pytest.approx(bounds["S3"][5])
    # across the view, from the beam's axis
    across = np.array([-assembly_picture.VIEW[1], assembly_picture.VIEW[0]]) / np.hypot(*assembly_picture.VIEW[:2])
    assert across @ [x, y] < -design.R


@pytest.mark.parametrize("fields", [{}, {"hall_layout": "tmag5273a1", "chip_x": 3.0}])
def test_all_but_the_magnet_is_cut_by_the_plane_of_the_section(fields):
    design = dataclasses.replace(paper(), **fields)
    parts = sensor_solids.coloured_parts(sensor_solids.make_solids(design, sensor_solids.FabricationChoices()))
    drawn = assembly_picture.faceted(parts, hall_elements.places(design))
    cut = {name: assembly_picture.shown(part) for name, part in zip(parts, drawn, strict=True)}
    for name, (solid, _) in parts.items():
        y = cut[name].bounds[2:4]
        low = solid.bounding_box().min.Y
        assert y[0] == pytest.approx(low if name == "magnet" else max(0.0, low), abs=1e-3)
        assert cut[name].n_open_edges == 0
