"""Names and axes in the white around a picture's subject."""

import numpy as np
import pytest
from PIL import Image

from studies.output import picture_labels


def subject():
    """A grey block in the middle of a white picture."""
    image = Image.new("RGB", (400, 300), "white")
    image.paste((120, 120, 120), (100, 80, 300, 240))
    return image


def test_names_stand_in_the_white_and_apart():
    image = subject()
    before = np.asarray(image.convert("L")) == 120
    picture_labels.annotate(image, {"S1": (120.0, 100.0), "S2": (125.0, 102.0)}, {})
    pixels = np.asarray(image.convert("L"))
    # in the block there are only the dots and the lines, each in its white
    assert 0 < (pixels[before] != 120).mean() < 0.03
    # letters, above or left of the block
    assert (pixels[:80] < 100).any() or (pixels[:, :100] < 100).any()


def test_a_second_name_keeps_off_the_first():
    taken = np.zeros((200, 300), dtype=bool)
    taken[50:150, 50:250] = True
    first = picture_labels.free_place(taken, (100.0, 60.0), (40, 20))
    taken[int(first[1]) - 10 : int(first[1]) + 11, int(first[0]) - 20 : int(first[0]) + 21] = True
    second = picture_labels.free_place(taken, (100.0, 60.0), (40, 20))
    assert abs(first[0] - second[0]) > 40 or abs(first[1] - second[1]) > 20


def test_no_room_is_no_place():
    assert picture_labels.free_place(np.ones((50, 50), dtype=bool), (25.0, 25.0), (10, 10)) is None


@pytest.mark.parametrize("axes", [{"x": (1.0, 0.0)}, {"z": (0.0, -1.0)}, {"y": (0.0, 0.0)}])
def test_axes_stand_in_a_picture_without_covering_its_subject(axes):
    image = Image.new("RGB", (800, 600), "white")
    image.paste((120, 120, 120), (200, 300, 600, 420))
    image.paste((120, 120, 120), (380, 100, 420, 420))
    before = np.asarray(image.convert("L")) == 120
    picture_labels.annotate(image, {}, axes)
    pixels = np.asarray(image.convert("L"))
    assert (pixels[before] == 120).all()
    assert (pixels < 100).any()
