"""Progress of work whose number of parts is only estimated."""

from kerfpath.progress import counted, may_stop, shown_by


def shown(about, places, remain_at=None):
    """The (done, total) shown for work of so many places, with an estimate of the rest at one."""
    said = []
    with shown_by(lambda done, total: said.append((done, total))), counted(about) as remain:
        for k in range(places):
            if remain_at is not None and k == remain_at[0]:
                remain(remain_at[1])
            may_stop()
    return said


def test_work_as_long_as_estimated_counts_to_its_end():
    assert shown(5, 4) == [(1, 5), (2, 5), (3, 5), (4, 5)]


def test_an_estimate_that_was_too_low_is_raised_rather_than_shown_as_all_but_done():
    said = shown(10, 400)
    assert all(done < total for done, total in said)
    late = [done / total for done, total in said if done > 20]
    assert max(late) < 1
    # Raised by a quarter, so that on average a tenth is said to be left.
    assert sum(late) / len(late) < 0.92


def test_the_work_may_know_better():
    said = shown(10, 8, remain_at=(5, 20))
    assert said[4] == (5, 10)
    assert said[5] == (6, 25)
