"""A sweep killed at random moments: nothing that was reported is lost, little is solved again, no process is left."""

import pytest
import sweep_kills


@pytest.fixture(scope="module")
def kills(tmp_path_factory):
    """Two kills; the rows of completed sweeps are compared with those of an undisturbed one on the way."""
    axes = ("L=lin:10:16:8", "depth=0.2,0.4")
    return list(sweep_kills.kills(tmp_path_factory.mktemp("kills"), 2, axes=axes))


def test_the_state_of_each_printed_row_is_in_the_store(kills):
    assert sum(kill.rows for kill in kills) > 0
    assert [kill.lost for kill in kills] == [0] * 2


def test_no_more_solves_are_repeated_than_there_were_workers(kills):
    assert sum(kill.begun for kill in kills) > 1
    assert max(kill.unfinished for kill in kills) <= sweep_kills.WORKERS
    assert sum(kill.repeated for kill in kills) <= sum(kill.unfinished for kill in kills)


def test_no_worker_process_survives(kills):
    assert max(kill.workers for kill in kills) == sweep_kills.WORKERS
    assert [kill.survivors for kill in kills] == [0] * 2


def test_the_store_stays_intact(kills):
    assert all(kill.intact for kill in kills)
