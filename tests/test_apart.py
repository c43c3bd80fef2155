"""No verb writes over what it reads, be it the design, a table, states or a mesh: bad input before any work."""

import json

import pytest

POINTS = "x_mm,y_mm,z_mm\n0,0,20\n"
READINGS = "S1_V,S2_V,S3_V\n3,3,3\n"
STATE = json.dumps({"status": "ok"})
TEST = "stretch,nominal_stress_MPa\n" + "".join(f"{1 + k / 10},{k / 10}\n" for k in range(1, 8))
DESIGN = "E = 0.6\n"

CASES = {
    "field points": ("a.csv", POINTS, ("field", "paper", "--points", "a.csv", "--out", "a.csv")),
    "field design": ("a.csv", DESIGN, ("field", "a.csv", "--points", "p.csv", "--out", "a.csv")),
    "decode readings": ("a.csv", READINGS, ("decode", "paper", "--file", "a.csv", "--out", "a.csv")),
    "decode states": (
        "a.csv",
        STATE,
        ("decode", "paper", "--file", "p.csv", "--responses", "a.csv", "--out", "a.csv"),
    ),
    "table states": ("t.json", STATE, ("table", "paper", "--responses", "t.json", "--out", "t.npy")),
    "table design": ("t.npy", DESIGN, ("table", "t.npy", "--step", 1, "--out", "t.npy")),
    "mesh design": ("a.vtu", DESIGN, ("mesh", "a.vtu", "--out", "a.vtu")),
    "solve mesh": ("a.vtu", "", ("solve", "paper", "--depth", 1, "--mesh", "a.vtu", "--out", "a.vtu")),
    "solve picture": ("a.png", DESIGN, ("solve", "a.png", "--depth", 1, "--picture", "a.png")),
    "fit test": ("fit.csv", TEST, ("fit", "fit.csv", "--out", ".")),
    "sweep design": ("sweep.csv", DESIGN, ("sweep", "sweep.csv", "--axis", "depth=0.5", "--out", ".")),
    "sweep --design": (
        "sweep.csv",
        DESIGN,
        ("sweep", "--design", "sweep.csv", "--axis", "depth=0.5", "--out", "."),
    ),
    "compare design": ("press.csv", DESIGN, ("compare", "press.csv", "--out", ".")),
    "cad design": ("beam.step", DESIGN, ("cad", "beam.step", "--out", ".")),
    "layout states": ("layout.csv", STATE, ("layout", "paper", "--responses", "layout.csv", "--out", ".")),
    "stability design": (
        "stability.csv",
        DESIGN,
        ("stability", "stability.csv", "--slenderness", "2", "--out", "."),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_an_output_onto_an_input_is_bad_input(refusal, tmp_path, case):
    name, text, tokens = CASES[case]
    (tmp_path / name).write_text(text)
    (tmp_path / "p.csv").write_text(POINTS)
    err = refusal(*tokens)
    assert f"the output {name!r} is also the input {name!r}: choose another name" in err or (
        f"{name!r} was not written by magtip and would be overwritten" in err
    )
    assert (tmp_path / name).read_text() == text
    assert {file.name for file in tmp_path.glob("[!.]*")} == {name, "p.csv"}


def test_a_design_of_ones_own_is_not_replaced_by_a_fit(run, refusal, tmp_path):
    (tmp_path / "test.csv").write_text(TEST)
    (tmp_path / "design.toml").write_text(DESIGN)
    status, out, err = run("fit", "test.csv", "--out", ".")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "'design.toml' was not written by magtip and would be overwritten: choose another folder" in err
    assert (tmp_path / "design.toml").read_text() == DESIGN
    (tmp_path / "design.toml").unlink()
    assert run("fit", "test.csv", "--out", ".")[0] == 0
    assert run("fit", "test.csv", "--out", ".")[0] == 0
    fitted = (tmp_path / "design.toml").read_text()
    (tmp_path / "design.toml").write_text(fitted + "L = 20.0\n")
    assert "'design.toml' was changed after magtip had written it" in refusal("fit", "test.csv", "--out", ".")
    assert (tmp_path / "design.toml").read_text() == fitted + "L = 20.0\n"
