"""Laws from uniaxial tests: known laws are found again, ranking, stability, and the design that comes of it."""

import csv
import dataclasses

import numpy as np
import pytest

from fem.material import cofactor, kinematics, law, strain
from geometry.design import LAWS, BadInput
from studies import fit as work
from studies.inputs import read_design
from studies.specimen import Specimen

CASES = {
    "neo-hookean": (),
    "mooney-rivlin": (0.3,),
    "yeoh": (-0.04, 0.004),
    "ogden": (4.0, -2.5, 0.3),
}
STRETCH = np.linspace(0.7, 2.5, 40)


def synthetic(name, E=1.2, noise=0.0, seed=0):
    stress = E / (2 * 1.4998) * work.nominal_stress(name, CASES[name], STRETCH)
    return Specimen(STRETCH, stress + noise * np.random.default_rng(seed).normal(size=STRETCH.shape))


def table(tmp_path, data):
    file = tmp_path / "test.csv"
    lines = [f"{x!r},{y!r}" for x, y in zip(data.stretch.tolist(), data.stress.tolist(), strict=True)]
    file.write_text("\n".join(["stretch,nominal_stress_MPa", *lines, ""]))
    return file


@pytest.mark.parametrize("name", CASES)
def test_closed_form_is_the_law_of_the_finite_elements(name):
    for s in (0.4, 1.0, 1.7, 3.5):
        k = kinematics(strain(np.diag([s, s**-0.5, s**-0.5]) - np.eye(3)))
        P, cof = law(name, CASES[name])(k, 1.0)[1], cofactor(k)
        want = (P - P[2, 2] / cof[2, 2] * cof)[0, 0]
        assert work.nominal_stress(name, CASES[name], np.array(s)) == pytest.approx(want, rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("alpha", [1e-9, 1e-6])
def test_ogden_term_near_exponent_zero(alpha):
    want = 3 * np.log(STRETCH) / STRETCH
    np.testing.assert_allclose(work._ogden_term(alpha, STRETCH), want, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_a_known_law_is_found_again(name):
    found = work.fit(synthetic(name))
    best = found[0]
    assert best.law == name
    assert pytest.approx(1.2, rel=1e-6) == best.E
    assert tuple(best.numbers.values()) == pytest.approx(CASES[name], rel=1e-6, abs=1e-6)
    assert best.share < 1e-9
    assert sorted(other.law for other in found) == sorted(LAWS)
    order = [(bool(other.bounded), other.aicc) for other in found]
    assert order == sorted(order)


@pytest.mark.parametrize("seed", range(3))
def test_the_smallest_law_is_preferred_for_noisy_neo_hookean_data(seed):
    noise = 0.01
    best, *others = work.fit(synthetic("neo-hookean", noise=noise, seed=seed))
    assert best.law == "neo-hookean"
    assert pytest.approx(1.2, rel=0.02) == best.E
    assert best.rms == pytest.approx(noise, rel=0.3)
    # a law that holds the neo-Hookean one fits no worse
    assert all(other.rms < best.rms * (1 + 1e-9) for other in others)


def test_the_fit_scales_with_the_stress():
    data = synthetic("yeoh", noise=0.01)
    one, other = (work.fit(dataclasses.replace(data, stress=factor * data.stress)) for factor in (1.0, 1e-3))
    for a, b in zip(one, other, strict=True):
        assert a.law == b.law
        assert pytest.approx(1e-3 * a.E, rel=1e-5) == b.E


def test_five_points_leave_no_room_for_ogden():
    data = synthetic("mooney-rivlin")
    found = work.fit(Specimen(data.stretch[::8], data.stress[::8]))
    assert found[-1].law == "ogden"
    assert np.isinf(found[-1].aicc)


@pytest.mark.parametrize("name", ["neo-hookean", "mooney-rivlin"])
def test_laws_that_are_stable_everywhere(name):
    numbers = {"neo-hookean": (), "mooney-rivlin": (0.7,)}[name]
    assert set(work.stable_ranges(name, numbers).values()) == {(0.3, 4.0)}


def test_stability_ends_where_the_nominal_stress_of_a_softening_law_is_largest():
    numbers = (-0.08, 0.0)
    stretch = np.linspace(1, 4, 30001)
    peak = stretch[np.argmax(work.nominal_stress("yeoh", numbers, stretch))]
    low, high = work.stable_ranges("yeoh", numbers)["uniaxial"]
    assert 0.98 * peak < high <= peak
    assert 0.3 < low < 1


def test_data_beyond_the_stable_range_warn_and_are_not_chosen(tmp_path):
    stretch = np.linspace(1, 3, 30)
    data = Specimen(stretch, work.nominal_stress("yeoh", (-0.08, 0.0), stretch))
    first, *_ = work.run(str(table(tmp_path, data)), 0.4998, None)
    assert first["law"] == "yeoh"
    assert "the data leave the stable range of yeoh" in first["warning"]
    assert not first["chosen"]


def test_a_number_at_a_bound_is_no_optimum():
    """A stress that jumps asks for an exponent beyond 30."""
    stretch = np.linspace(1, 1.3, 40)
    fits = work.fit(Specimen(stretch, stretch - 1 + 1e-3 * stretch**60))
    ogden = next(found for found in fits if found.law == "ogden")
    assert "ogden_alpha1" in ogden.bounded
    assert "ogden_alpha1 = 30" in ogden.warning
    assert "at a bound of the search" in ogden.warning
    order = [bool(found.bounded) for found in fits]
    assert order == sorted(order)


def test_an_impossible_E_keeps_the_fits_and_names_the_column(run, tmp_path, strict):
    data = synthetic("neo-hookean", E=5e4)
    file = table(tmp_path, data)
    status, out, err = run("fit", file, "--out", "made", "--json")
    assert (status, len(strict(out))) == (3, 4)
    assert "check that the column nominal_stress_MPa is in MPa" in err
    assert sorted(path.name for path in (tmp_path / "made").iterdir()) == ["fit.csv", "fit.png"]


def test_what_cannot_be_fitted():
    data = synthetic("neo-hookean")
    with pytest.raises(BadInput, match="tension must be positive"):
        work.fit(Specimen(data.stretch, -data.stress))
    for nu in (0.3, 0.51, np.nan):
        with pytest.raises(BadInput, match=r"--nu must lie between 0\.49 and 0\.5"):
            work.fit(data, nu)


def test_command_writes_a_design_that_reads_back(run, strict, tmp_path):
    file = table(tmp_path, synthetic("ogden", noise=0.002))
    status, out, err = run("fit", file, "--out", "made", "--nu", 0.4999, "--json")
    records = strict(out)
    assert status == 0
    assert all(line.startswith("Warning: ") for line in err.splitlines())
    assert [record["rank"] for record in records] == [1, 2, 3, 4]
    (chosen,) = [record for record in records if record["chosen"]]
    design = read_design(str(tmp_path / "made" / "design.toml"))
    assert (design.E, design.nu, design.law) == (chosen["E_MPa"], 0.4999, chosen["law"])
    assert design.law_numbers == tuple(chosen["numbers"].values())
    assert sorted(path.name for path in (tmp_path / "made").iterdir()) == ["design.toml", "fit.csv", "fit.png"]
    with open(tmp_path / "made" / "fit.csv", newline="", encoding="utf-8") as lines:
        assert [row["law"] for row in csv.DictReader(lines)] == [record["law"] for record in records]
    assert (tmp_path / "made" / "fit.png").stat().st_size > 10_000


def test_command_tells_bad_input_in_one_sentence(run, tmp_path):
    status, out, err = run("fit", tmp_path / "none.csv")
    assert (status, out) == (2, "")
    assert "there is no file" in err
    assert len(err.splitlines()) == 1


def test_command_as_a_table(run, tmp_path):
    status, out, _ = run("fit", table(tmp_path, synthetic("mooney-rivlin")))
    assert status == 0
    assert "mooney_share=0.3" in out
    assert "0.3 to 4" in out
