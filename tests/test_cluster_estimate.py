"""The estimate for a cluster: sizes that are measured, and planning."""

import pytest

from studies.benchmarks import cluster_estimate


def test_planning_takes_time():
    assert cluster_estimate.plan_study(20)["seconds"] > 0


def test_the_estimate_follows_from_the_measured_figures(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster_estimate, "PATHS", 5)
    monkeypatch.setattr(cluster_estimate, "_dask_overhead", lambda count: None)
    figures = cluster_estimate.figures(tmp_path, {"press": 0.5}, planned=10, tasks=2)
    values = {(figure.case, figure.quantity): figure.value for figure in figures}
    case = "100000 solves (press) on 100 cores"
    each = 0.5 + values["workers", "overhead of a task"] / 1e3
    assert values[case, "time of the solves"] == pytest.approx(1e5 * each / 100 / 60)
    sizes = "sizes (press)"
    both = values[sizes, "task"] + values[sizes, "answer with 5 states"]
    assert values[case, "traffic to and from the scheduler"] == pytest.approx(1e5 * both / 1e6)
    assert values[case, "size of the store"] == pytest.approx(5e5 * values[sizes, "store for each state"] / 1e6)
