"""The effort: changed for a while, and taken over by the workers of a sweep."""

import sweep_tasks
from kerfpath import PlanOptions, sweep
from kerfpath.certificate import Certify
from kerfpath.effort import Effort, changed_effort, current_effort


def test_a_changed_effort_ends_with_its_block():
    before = current_effort()
    with changed_effort(binding_nodes=7):
        assert current_effort().binding_nodes == 7
    assert current_effort() is before


def test_plans_are_certified_by_default_if_the_effort_says_so():
    assert Effort().certified
    with changed_effort(certified=True):
        assert PlanOptions().certify == Certify()
    with changed_effort(certified=False):
        assert PlanOptions().certify is None


def test_processes_of_a_sweep_inherit_the_effort(tmp_path):
    with changed_effort(binding_nodes=7):
        (found,) = sweep.run(sweep_tasks.binding_nodes, [{}], store=tmp_path / "s", processes=1)
    assert found.value == 7


def test_workers_of_a_cluster_take_over_the_effort_of_each_sweep(workers, scheduler, tmp_path):
    workers(1)
    for nodes in (7, 9):
        with changed_effort(binding_nodes=nodes):
            (found,) = sweep.run(
                sweep_tasks.binding_nodes, [{}], store=tmp_path / f"{nodes}", scheduler=scheduler
            )
        assert found.value == nodes
