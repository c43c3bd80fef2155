"""The verb catalogue: tables, JSON, parts of the user."""


def test_one_kind(run, strict):
    status, out, _ = run("catalogue", "silicones", "--json")
    rows = strict(out)
    assert status == 0
    assert {row["kind"] for row in rows} == {"silicones"}
    assert ("Dragon Skin 30", 0.55, 1.02) in [(row["name"], row["E_low_MPa"], row["E_high_MPa"]) for row in rows]
    assert all(row["source"] for row in rows)


def test_all_kinds_are_tables(run):
    status, out, _ = run("catalogue")
    assert status == 0
    assert [out.index(title) for title in ("Magnets: ", "Hall parts: ", "Silicones: ")] == sorted(
        out.index(title) for title in ("Magnets: ", "Hall parts: ", "Silicones: ")
    )
    assert "4x2 N35" in out


def test_own_parts(run, strict, toml):
    path = toml('[[silicone]]\nname = "Mine"\nE = [1, 2, 3]')
    _, out, _ = run("catalogue", "silicones", "--file", path, "--json")
    assert strict(out)[-1]["name"] == "Mine"


def test_a_bad_file_is_refused(run, toml):
    status, out, err = run("catalogue", "--file", toml("[[silicone]]"))
    assert (status, out) == (2, "")
    assert err.endswith("[[silicone]] number 1: name is missing\n")


def test_published_sensors(run, strict):
    status, out, _ = run("catalogue", "published", "--json")
    assert status == 0
    assert {row["sensor"] for row in strict(out)} == {
        "Chathuranga 2016",
        "MagOne",
        "Dwivedi 2018",
        "Tomo 2016",
        "eFlesh 2025",
    }


def test_results_go_with_published_sensors_only(run):
    status, _, err = run("catalogue", "magnets", "--sized", "out")
    assert (status, err.count("\n")) == (2, 1)
    assert "--sized goes with published sensors" in err
