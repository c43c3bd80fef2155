"""Uniaxial tests in files: what is read, and what is refused in one sentence."""

import numpy as np
import pytest

from geometry.design import BadInput
from studies.simulation.material_tests import read_specimen as read

GOOD = "stretch,nominal_stress_MPa\n1,0\n1.1,0.1\n1.2,0.2\n1.3,0.3\n1.4,0.4\n"


def written(tmp_path, text, encoding="utf-8"):
    file = tmp_path / "test.csv"
    file.write_text(text, encoding=encoding, newline="")
    return str(file)


def test_units_comments_other_columns_and_order(tmp_path):
    want = read(written(tmp_path, GOOD))
    assert want.stretch.tolist() == [1.0, 1.1, 1.2, 1.3, 1.4]
    text = "# a test\r\n time (s), nominal_stress_kPa ,strain_percent\r\n"
    text += "".join(f"x,{100 * k},{10 * k} # point {k}\r\n\r\n" for k in range(5))
    found = read(written(tmp_path, text, "utf-8-sig"))
    np.testing.assert_allclose(found.stretch, want.stretch, rtol=1e-14)
    np.testing.assert_allclose(found.stress, want.stress, rtol=1e-14)
    text = "strain,nominal_stress_Pa\n" + "".join(f"{k / 10},{k * 1e5}\n" for k in range(5))
    np.testing.assert_allclose(read(written(tmp_path, text)).stress, want.stress, rtol=1e-14, atol=1e-15)


def test_fractions_are_not_taken_for_percent(tmp_path, refused):
    """E would be 100 times too large, which no silicone has."""
    strain = np.linspace(0.05, 0.5, 8)
    stress = 0.6 / 3 * ((1 + strain) - (1 + strain) ** -2.0)

    def text(column, values):
        points = zip(values, stress, strict=True)
        return written(tmp_path, f"{column},nominal_stress_MPa\n" + "".join(f"{x},{s}\n" for x, s in points))

    for column, values in (("strain", strain), ("strain_percent", 100 * strain), ("stretch", 1 + strain)):
        np.testing.assert_allclose(read(text(column, values)).stretch, 1 + strain)
    with refused(
        "column strain_percent", "E would be about 4", "about 0.6 MPa if they were those of a column strain"
    ):
        read(text("strain_percent", strain))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["is empty"]),
        ("# only\n", ["is empty"]),
        (GOOD.replace("stretch", "time"), ["line 1", "a column stretch or strain", "time"]),
        (GOOD.replace("stretch", "Stretch"), ["line 1", "'Stretch'", "did you mean stretch?"]),
        (GOOD.replace("stretch", "Strain"), ["line 1", "'Strain'", "did you mean strain?"]),
        (GOOD.replace("stretch", "Strain (%)"), ["line 1", "'Strain (%)'", "did you mean strain_percent?"]),
        (GOOD.replace("_MPa", "_mpa"), ["line 1", "'nominal_stress_mpa'", "did you mean nominal_stress_MPa?"]),
        (
            GOOD.replace("_MPa", ""),
            ["nominal_stress_MPa or nominal_stress_kPa or nominal_stress_Pa", "has no unit"],
        ),
        (GOOD.replace("stretch,", "stretch,strain,"), ["line 1", "stretch and strain", "keep one"]),
        (GOOD.replace("stretch,", "stretch,stretch,"), ["line 1", "stretch and stretch", "keep one"]),
        (GOOD.replace("1.2,0.2", "1.2,nan"), ["line 4, column nominal_stress_MPa", "finite", "'nan'"]),
        (GOOD.replace("1.2,0.2", "1.2,two"), ["line 4, column nominal_stress_MPa", "finite", "'two'"]),
        (GOOD.replace("1.2,0.2", "1.2,"), ["line 4, column nominal_stress_MPa", "finite", "''"]),
        (GOOD.replace("1.2,0.2", "inf,0.2"), ["line 4, column stretch", "finite"]),
        (GOOD.replace("1.2,0.2", "1.2"), ["line 4", "1 values for 2 columns: give one value per column"]),
        (GOOD.replace("1.2,0.2", "1,2,0,2"), ["line 4", "4 values for 2 columns", "write a point"]),
        (GOOD.replace("1.2,0.2", '"1,2",0.2'), ["line 4, column stretch", "'1,2'", "write a point, no comma"]),
        (GOOD.replace(",", ";").replace(".", ","), ["line 1", "semicolons separate its columns", "with commas"]),
        (GOOD.replace(",", "\t"), ["line 1", "tabs separate its columns", "with commas"]),
        (GOOD.replace("1.2,0.2", '"1.2,0.2'), ["line 4", "not CSV"]),
        (GOOD.replace("1.2,0.2", "0,0.2"), ["line 4, column stretch", "between 0.05 and 20", "got 0"]),
        (GOOD.replace("1.2,0.2", "-1,0.2"), ["line 4, column stretch", "got -1"]),
        (GOOD.replace("stretch", "strain").replace("1.2,0.2", "-1,0.2"), ["line 4, column strain", "got 0"]),
        (GOOD.replace("1.2,0.2", "120,0.2"), ["line 4, column stretch", "unit"]),
        (GOOD.replace("1.2,0.2", "1.2,1e9"), ["line 4, column nominal_stress_MPa", "within 100000 MPa", "unit"]),
        (GOOD.replace("1.4,0.4\n", "0.8,0.4\n"), ["line 6", "stretch of 0.8", "0.4 MPa", "compression negative"]),
        ("stretch,nominal_stress_MPa\n", ["has a header but no rows", "add a row"]),
        ("strain,nominal_stress_MPa\n0,0\n0,0.1\n", ["no data at a stretch other than 1", "at least one"]),
        ("stretch,nominal_stress_MPa\n" + 6 * "1.5,0.2\n", ["column stretch", "all 6 values are equal"]),
        (
            "stretch,nominal_stress_MPa\n" + "".join(f"1.{k},0\n" for k in range(6)),
            ["column nominal_stress_MPa", "are equal"],
        ),
    ],
)
def test_bad_files(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(BadInput) as raised:
        read(path)
    said = str(raised.value)
    assert "test.csv" in said
    assert "\n" not in said
    assert all(word in said for word in words), said


def test_no_file_a_folder_and_no_text(tmp_path):
    for path, word in ((tmp_path / "none.csv", "there is no file"), (tmp_path, "is a folder")):
        with pytest.raises(BadInput, match=word):
            read(str(path))
    (tmp_path / "raw.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInput, match="UTF-8"):
        read(str(tmp_path / "raw.csv"))
