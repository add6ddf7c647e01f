"""Sweeps: every task once, whatever is killed meanwhile; refusals in one line."""

import json
import os
import re
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import kerfpath
import sweep_tasks
from conftest import ROOT
from kerfpath import sweep
from kerfpath.effort import current_effort
from kerfpath.errors import InputError
from kerfpath.progress import stopped_by
from kerfpath.sweep import store as store_module
from kerfpath.sweep import workers as cluster
from kerfpath.sweep.task import Task, attempt

HERE = ROOT / "tests"


def numbers(count):
    return [{"x": x} for x in range(count)]


def query(store, sql):
    with closing(sqlite3.connect(store)) as base:
        return base.execute(sql).fetchall()


def script(tmp_path, tasks, text):
    """Return a command that runs a sweep over `tasks` in a process of its own."""
    path = tmp_path / "script.py"
    path.write_text(
        f"""import signal
import sys
sys.path.insert(0, {str(HERE)!r})
import sweep_tasks
from kerfpath import sweep
from kerfpath.errors import InputError
TASKS = {tasks!r}
STORE = {str(tmp_path / "store.sqlite")!r}
{text}
"""
    )
    return [sys.executable, str(path)]


RUN = """
if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored below a shell's "&"
    sweep.run(sweep_tasks.marked, TASKS, store=STORE, processes=2)
"""

REFUSED = """
try:
    sweep.run(sweep_tasks.square, TASKS, store=STORE, processes=1)
except InputError as error:
    sys.exit("refused: " + str(error))
"""


def children(pid):
    """Return the processes below one, at any depth."""
    tree = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        tree.setdefault(int(fields[1]), []).append(int(stat.parent.name))
    found, todo = [], [pid]
    while todo:
        below = tree.get(todo.pop(), [])
        found += below
        todo += below
    return found


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def gone(pids, seconds=5.0):
    end = time.monotonic() + seconds
    while any(alive(pid) for pid in pids):
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def test_results_come_in_the_order_of_the_tasks_and_equal_tasks_are_done_once(tmp_path):
    tasks = [{"x": int(x)} for x in np.random.default_rng(0).integers(0, 60, 150)]
    done = sweep.run(sweep_tasks.square, tasks, store=tmp_path / "s", processes=2)
    assert [r.parameters for r in done] == tasks
    assert [r.value for r in done] == [{"square": t["x"] ** 2} for t in tasks]
    assert all(r.failure is None and r.seconds > 0 for r in done)
    assert query(tmp_path / "s", "SELECT count(*) FROM result") == [(len({*map(str, tasks)}),)]


def test_tasks_may_be_handed_in_as_results_come(tmp_path):
    told = []

    def squared():
        with sweep.Sweep(
            sweep_tasks.square,
            store=tmp_path / "store.sqlite",
            processes=2,
            progress=lambda *state: told.append(state),
            total=4,
        ) as tasks:
            first, second = tasks.submit(x=2), tasks.submit(x=3)
            found = [tasks.result(second), tasks.result(first)]
            third = tasks.submit(x=found[1].value["square"])  # the workers were idle meanwhile
            assert tasks.submit(x=3) == second
            found.append(tasks.result(third))
            found.append(tasks.result(tasks.submit(x=found[2].value["square"])))
        return [result.value["square"] for result in found]

    assert squared() == [9, 4, 16, 256]
    assert told[:: len(told) - 1] == [("tasks", 0, 4), ("tasks", 4, 4)]
    told.clear()
    assert squared() == [9, 4, 16, 256]
    assert told == [("tasks", 2, 4)], "nothing was done again, so that no result was waited for"


def test_a_second_call_does_only_what_is_new(tmp_path):
    tasks = [{"x": x, "folder": str(tmp_path)} for x in range(12)]
    first = sweep.run(sweep_tasks.marked, tasks[:7], store=tmp_path / "s", processes=1)
    told = []
    both = sweep.run(
        sweep_tasks.marked,
        tasks,
        store=tmp_path / "s",
        processes=1,
        progress=lambda *state: told.append(state),
    )
    assert both[:7] == first
    assert all((tmp_path / str(t["x"])).read_text() == "x" for t in tasks)
    assert told[0] == ("tasks", 7, 12)
    assert told[-1] == ("tasks", 12, 12)
    assert [done for _, done, _ in told] == sorted({done for _, done, _ in told})
    assert sweep.run(sweep_tasks.marked, tasks, store=tmp_path / "s") == both


def test_a_failing_task_is_kept_with_its_reason_and_does_not_stop_the_rest(tmp_path):
    expected = {
        "a": None,
        "path": ("NoFeasiblePath", "layer 3 is empty"),
        "input": ("InputError", "speed: expected more than 0"),
        "exit": ("SystemExit", "enough"),
        "stubborn": ("Stubborn", "needs more"),
        "infinite": ("ValueError", "Out of range float values are not JSON compliant"),
        "object": ("TypeError", "Object of type object is not JSON serializable"),
        "surrogate": ("ValueError", "?"),
        "killed": ("WorkerDied", "the task killed its process"),
        "b": None,
    }
    tasks = [{"what": what} for what in expected]
    done = sweep.run(sweep_tasks.troubled, tasks, store=tmp_path / "s", processes=2)
    found = [r.failure and (r.failure.kind, r.failure.message) for r in done]
    assert found == list(expected.values())
    assert [r.value for r in done] == [None if e else w for w, e in expected.items()]
    assert sweep.run(sweep_tasks.troubled, tasks, store=tmp_path / "s") == done


def test_a_worker_that_is_not_fit_for_a_task_ends_the_sweep_and_nothing_is_kept_of_it(tmp_path):
    store = tmp_path / "store.sqlite"
    with pytest.raises(InputError, match="the drawing is not here"):
        sweep.run(sweep_tasks.troubled, [{"what": "unfit"}], store=store, processes=1)
    assert query(store, "SELECT count(*) FROM result") == [(0,)]


def test_a_process_has_one_thread(tmp_path):
    (done,) = sweep.run(sweep_tasks.threads, [{}], store=tmp_path / "s")
    assert done.value == ["1", "1"]


@pytest.mark.slow
def test_every_task_once_though_the_sweep_is_killed_again_and_again(tmp_path):
    marks = tmp_path / "marks"
    marks.mkdir()
    tasks = [{"x": x, "folder": str(marks), "seconds": 0.01} for x in range(400)]
    command = script(tmp_path, tasks, RUN)
    rng = np.random.default_rng(3)
    orphans = []
    # Before the store is there (a start takes about 0.5 s), while it is made, and in the middle.
    for more in [0, 0, 0, *rng.integers(1, 60, 5)]:
        before = len(list(marks.iterdir()))
        running = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        while len(list(marks.iterdir())) < before + more:
            time.sleep(0.002)
        time.sleep(rng.uniform(0, 0.02 if more else 1.0))
        orphans += children(running.pid)
        running.send_signal(signal.SIGKILL)
        assert running.wait() == -signal.SIGKILL
    assert gone(orphans)
    assert subprocess.run(command, check=False).returncode == 0
    rows = query(tmp_path / "store.sqlite", "SELECT parameters, value FROM result")
    assert sorted(json.loads(p)["x"] for p, _ in rows) == list(range(400))
    assert all(json.loads(p)["x"] == json.loads(v)[0] for p, v in rows)
    assert query(tmp_path / "store.sqlite", "PRAGMA integrity_check") == [("ok",)]
    calls = [len((marks / str(t["x"])).read_text()) for t in tasks]
    # A kill costs at most what was handed out: eight tasks for each of two processes.
    assert sum(calls) - 400 <= 8 * 16


def test_after_ctrl_c_the_processes_leave_and_the_results_stay(tmp_path):
    tasks = [{"x": x, "folder": str(tmp_path), "seconds": 0.02} for x in range(1000)]
    running = subprocess.Popen(
        script(tmp_path, tasks, RUN), stderr=subprocess.PIPE, start_new_session=True, text=True
    )
    while not (tmp_path / "20").exists():
        time.sleep(0.02)
    below = children(running.pid)
    os.killpg(running.pid, signal.SIGINT)
    _, said = running.communicate(timeout=5)
    assert running.returncode != 0
    assert said.strip().endswith("KeyboardInterrupt")
    assert gone(below)
    ((count,),) = query(tmp_path / "store.sqlite", "SELECT count(*) FROM result")
    assert 4 <= count < 1000


def test_a_second_sweep_on_a_store_is_refused(tmp_path):
    said = "store.sqlite: another sweep uses this store"
    store, other = tmp_path / "store.sqlite", script(tmp_path, numbers(1), REFUSED)
    lines = []

    def again(what, done, total):
        with pytest.raises(InputError, match=said) as refused:
            sweep.run(sweep_tasks.square, numbers(1), store=store)
        lines.append(str(refused.value))
        ran = subprocess.run(other, capture_output=True, text=True, check=False)
        lines.append(ran.stderr.strip())

    sweep.run(sweep_tasks.square, numbers(1), store=store, progress=again)
    assert len(lines) == 4
    assert all(said in line and "\n" not in line for line in lines)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ("PRAGMA user_version = 0", "expected a store of schema 1, got schema 0"),
        ("UPDATE package SET version = '0.0.9'", r"a store of kerfpath .*, got one of 0\.0\.9"),
        ("PRAGMA application_id = 7", "not the store of a sweep"),
    ],
)
def test_a_store_of_another_kind_is_refused_and_left_alone(tmp_path, edit, said):
    sweep.run(sweep_tasks.square, numbers(1), store=tmp_path / "s")
    with closing(sqlite3.connect(tmp_path / "s")) as base:
        base.execute(edit)
        base.commit()
    before = (tmp_path / "s").read_bytes()
    with pytest.raises(InputError, match=said):
        sweep.run(sweep_tasks.square, numbers(2), store=tmp_path / "s")
    assert (tmp_path / "s").read_bytes() == before


@pytest.mark.parametrize("suffix", ["", "-wal", "-journal"])
def test_a_store_is_a_regular_file_and_what_else_is_there_stays(tmp_path, suffix):
    precious, path = tmp_path / "precious", tmp_path / f"store{suffix}"
    precious.touch()
    for put in (os.mkfifo, lambda path: path.symlink_to(precious), os.mkdir):
        put(path)
        with pytest.raises(InputError, match=f"store{suffix}: cannot be the store of a sweep"):
            store_module.Store(tmp_path / "store")
        assert {each.name for each in tmp_path.iterdir()} == {"precious", path.name}
        path.rmdir() if path.is_dir() else path.unlink()
    assert precious.stat().st_size == 0


def test_a_file_that_is_no_store_is_refused(tmp_path):
    (tmp_path / "plan.json").write_text("{}" * 1000)
    with pytest.raises(InputError, match=r"plan\.json: this file is not the store of a sweep"):
        sweep.run(sweep_tasks.square, numbers(1), store=tmp_path / "plan.json")
    with pytest.raises(InputError, match="check that its folder exists"):
        sweep.run(sweep_tasks.square, numbers(1), store=tmp_path / "none" / "s")


def test_a_full_disk_ends_in_one_line_and_what_was_kept_stays(tmp_path, monkeypatch):
    class Small(sqlite3.Connection):
        def executemany(self, *given):
            self.execute("PRAGMA max_page_count = 20")
            return super().executemany(*given)

    connect = sqlite3.connect
    with monkeypatch.context() as patch:
        patch.setattr(
            store_module.sqlite3, "connect", lambda *a, **given: connect(*a, factory=Small, **given)
        )
        with pytest.raises(InputError, match="s: the disk is full; the results so far are stored"):
            sweep.run(sweep_tasks.square, numbers(2000), store=tmp_path / "s", processes=1)
    assert query(tmp_path / "s", "PRAGMA integrity_check") == [("ok",)]
    ((count,),) = query(tmp_path / "s", "SELECT count(*) FROM result")
    assert 0 < count < 2000
    done = sweep.run(sweep_tasks.square, numbers(2000), store=tmp_path / "s", processes=1)
    assert [r.value["square"] for r in done] == [x * x for x in range(2000)]


def test_parameters_and_functions_that_cannot_travel_are_refused_before_anything_runs(tmp_path):
    def local(x):
        return x

    def refused(function, tasks, **given):
        with pytest.raises(InputError) as caught:
            sweep.run(function, tasks, store=tmp_path / "s", **given)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    assert "top level of a module" in refused(local, numbers(1))
    assert "top level of a module" in refused(lambda x: x, numbers(1))
    assert "parameters[1]" in refused(sweep_tasks.square, [{"x": 1}, {"x": np.zeros(2)}])
    assert "parameters[0]" in refused(sweep_tasks.square, [{"x": float("nan")}])
    assert "missing a required argument: 'x'" in refused(sweep_tasks.square, [{}])
    assert "unexpected keyword argument 'y'" in refused(sweep_tasks.square, [{"x": 1, "y": 2}])
    assert "with a scheduler, got 0" in refused(sweep_tasks.square, numbers(1), processes=0)
    assert "none with" in refused(sweep_tasks.square, [], processes=1, scheduler="tcp://a:1")
    assert not (tmp_path / "s").exists()


def test_a_script_without_its_guard_is_told_so(tmp_path):
    ran = subprocess.run(
        script(tmp_path, numbers(3), REFUSED), capture_output=True, text=True, check=False
    )
    assert "if __name__ == '__main__'" in ran.stderr.splitlines()[-1]
    assert query(tmp_path / "store.sqlite", "SELECT count(*) FROM result") == [(0,)]


@pytest.mark.slow
def test_the_example_of_the_docs_runs(tmp_path):
    text = (HERE.parent / "docs" / "sweeps.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (tmp_path / "example.py").write_text(code)
    ran = subprocess.run(
        [sys.executable, tmp_path / "example.py"],
        env={**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    low, high, far = ran.stdout.splitlines()
    assert low.startswith("-0.2 {'speed_m_s': ")
    assert high.startswith("0.2 {'speed_m_s': ")
    assert far.startswith("3.0 Failure(kind='NoFeasiblePath'")
    assert ran.stderr == ""


def groups(scheduler):
    """Return the names of the groups of tasks that a scheduler knows or has known."""
    import distributed

    with distributed.Client(scheduler) as client:
        return set(client.run_on_scheduler(lambda dask_scheduler: [*dask_scheduler.task_prefixes]))


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_in_the_middle_loses_nothing(workers, scheduler, tmp_path):
    first, second = workers(2)
    tasks = [{"x": x, "folder": str(tmp_path), "seconds": 0.01} for x in range(300)]

    def kill(what, done, total):
        if done >= 60:
            first.kill()

    done = sweep.run(
        sweep_tasks.marked, tasks, store=tmp_path / "s", scheduler=scheduler, progress=kill
    )
    assert first.wait() == -signal.SIGKILL
    assert [r.value[0] for r in done] == list(range(300))
    assert {r.value[1] for r in done} == {first.pid, second.pid}
    assert query(tmp_path / "s", "SELECT count(*), count(value) FROM result") == [(300, 300)]
    (failed,) = sweep.run(
        sweep_tasks.troubled, [{"what": "path"}], store=tmp_path / "s", scheduler=scheduler
    )
    assert failed.failure == sweep.Failure(kind="NoFeasiblePath", message="layer 3 is empty")
    # Tasks of one kind to Dask: it queues them, and its memory does not grow with their number.
    assert groups(scheduler) <= {"task", "attempt"}


def test_workers_of_another_version_are_refused_and_named(workers, scheduler, tmp_path):
    (tmp_path / "kerfpath-0.0.9.dist-info").mkdir()
    (tmp_path / "kerfpath-0.0.9.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: kerfpath\nVersion: 0.0.9\n"
    )
    workers(1, path=str(tmp_path))
    said = r"every worker needs kerfpath [\d.]+, but tcp://127\.0\.0\.1:\d+ has 0\.0\.9"
    with pytest.raises(InputError, match=said):
        sweep.run(sweep_tasks.square, numbers(3), store=tmp_path / "s", scheduler=scheduler)


def test_a_cluster_that_is_not_there_is_refused_in_one_line(scheduler, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)

    def refused(address):
        with pytest.raises(InputError) as caught:
            sweep.run(sweep_tasks.square, numbers(1), store=tmp_path / "s", scheduler=address)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    assert refused("tcp://127.0.0.1:9").startswith("scheduler tcp://127.0.0.1:9: no answer within")
    assert "no answer within" in refused("smoke://signals")
    assert f"{scheduler}: no worker within 0.5 s" in refused(scheduler)


def test_without_dask_a_scheduler_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'kerfpath\[cluster\]'"):
        sweep.run(sweep_tasks.square, numbers(1), store=tmp_path / "s", scheduler="tcp://a:1")


def test_a_worker_of_another_version_that_joins_later_does_nothing():
    with pytest.raises(InputError, match=r"a worker has kerfpath .*, this sweep needs 0\.0\.9"):
        attempt("0.0.9", b"", current_effort(), Task("key", "{}"))


def test_a_worker_that_cannot_import_the_function_is_told():
    with pytest.raises(InputError, match="cannot import the function of the sweep"):
        attempt(kerfpath.__version__, b"cnowhere\nsquare\n.", current_effort(), Task("key", "{}"))


def test_a_wait_for_tasks_is_left_at_once_and_their_processes_end(tmp_path):
    begun, asked = time.monotonic(), []

    def check():
        asked.append(time.monotonic())
        if asked[-1] - asked[0] > 0.3:
            raise TimeoutError

    tasks = [{"x": 1, "folder": str(tmp_path), "seconds": 60.0}]
    with pytest.raises(TimeoutError), stopped_by(check):
        sweep.run(sweep_tasks.marked, tasks, store=tmp_path / "s.sqlite", processes=1)
    assert time.monotonic() - begun < 30
    assert not (tmp_path / "1").exists()
