import base64
import io

from PIL import Image

from studies.web import page_pictures
from studies.web.folder_contents import Contents


def contents(tmp_path, *names):
    for name in names:
        Image.new("RGB", (3000, 1000), "white").save(tmp_path / name)
    return Contents(tmp_path, "", pictures=list(names))


def test_large_picture_gets_smaller(tmp_path):
    source = page_pictures.sources(contents(tmp_path, "a.png"), set(), page_pictures.Budget(10**6), [])["a.png"]
    head, _, data = source.partition(",")
    assert head == "data:image/png;base64"
    assert Image.open(io.BytesIO(base64.b64decode(data))).size == (page_pictures.WIDTH, 367)


def test_picture_that_a_figure_replaces_is_left_out(tmp_path):
    assert page_pictures.sources(contents(tmp_path, "a.png"), {"a.png"}, page_pictures.Budget(10**6), []) == {}


def test_picture_without_room_is_named(tmp_path):
    remarks = []
    assert page_pictures.sources(contents(tmp_path, "a.png"), set(), page_pictures.Budget(10), remarks) == {}
    assert remarks == ["a.png is not shown: the page would become too large."]


def test_file_that_is_no_picture_is_named(tmp_path):
    (tmp_path / "a.png").write_text("no")
    remarks = []
    assert (
        page_pictures.sources(Contents(tmp_path, "", pictures=["a.png"]), set(), page_pictures.Budget(99), remarks)
        == {}
    )
    assert remarks[0].startswith("a.png was not read: it is no picture")
