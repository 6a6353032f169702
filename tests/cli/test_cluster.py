"""Monte Carlo on processes and on a real Dask cluster: the same numbers, whoever is lost."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

import warpspace as package
from dask_cluster import dask_cluster
from lost_process import square
from warpspace.analysis.plan import BLOCK
from warpspace.cli import pools
from warpspace.cli.pools import find_workers
from warpspace.exceptions import OptionError, WorkersLostError
from warpspace.outputs.processes import ProcessPool

distributed = pytest.importorskip("distributed")
RUN = (
    *("montecarlo", "dvf5000_general", "--over", "max", "--spec-um", "90", "--seed", "4", "--json"),
)


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with dask_cluster(2, tmp_path_factory.mktemp("dask")) as address:
        yield address


def test_a_cluster_gives_the_same_numbers_to_the_last_bit(
    warpspace, scheduler: str, tmp_path: Path
) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    tables = [tmp_path / "here.parquet", tmp_path / "there.parquet"]
    run = (*RUN, "--samples", str(33 * BLOCK + 5))
    here = warpspace(*run, "--workers", "1", "-o", tables[0])
    there = warpspace(*run, "--scheduler", scheduler, "-o", tables[1])
    assert here.status == there.status == 0, there.err
    assert here.out == there.out
    first, second = (pq.read_table(path) for path in tables)
    assert first.equals(second)
    assert first.num_rows == 33 * BLOCK + 5
    assert max(first["error_um"].to_pylist()) == json.loads(here.out)["max_um"]


def test_a_sweep_of_a_fleet_on_a_cluster(warpspace, scheduler: str) -> None:
    sweep = ("sweep", "dvf5000_general", "dvf5000_proposed", "--samples", "5000")
    steps = ("--tolerance", "rotation=10:30:3", "--limit-um", "40", "--json")
    here, there = warpspace(*sweep, *steps), warpspace(*sweep, *steps, "--scheduler", scheduler)
    assert there.status == 0, there.err
    assert here.out == there.out
    assert len(json.loads(there.out)["rows"]) == 6


def test_a_mistake_is_said_as_at_home(warpspace, scheduler: str) -> None:
    run = ("montecarlo", "dvf5000_nominal", "--scheduler", scheduler)
    warpspace(*run).refused("dvf5000_nominal: has no tolerances")


def test_workers_and_a_scheduler_exclude_each_other(warpspace) -> None:
    run = ("montecarlo", "dvf5000_general", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1")
    warpspace(*run).refused("exclude each other")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere", "gopher://x:1", ""])
def test_a_scheduler_that_is_none_is_refused(warpspace, monkeypatch, address: str) -> None:
    monkeypatch.setattr(pools, "CONNECT_S", 0.3)
    warpspace("montecarlo", "dvf5000_general", "--scheduler", address).refused(
        f"--scheduler {address!r}", "expected the address of a Dask scheduler"
    )


def test_without_dask_it_is_said_what_to_install(warpspace, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    run = ("montecarlo", "dvf5000_general", "--scheduler", "tcp://127.0.0.1:8786")
    warpspace(*run).refused("warpspace[cluster]")


@pytest.mark.proof
def test_a_worker_killed_half_way_changes_nothing(tmp_path: Path) -> None:
    samples = 2_500_000
    scene = package.load_scene("dvf5000_general")
    alone = package.montecarlo(scene, samples=samples, seed=4, spec_um=40.0)
    with (
        dask_cluster(3, tmp_path) as address,
        distributed.Client(address, set_as_default=False) as client,
    ):
        killed: list[int] = []

        def kill_one(done: int) -> None:
            counted.append(done)
            if not killed and sum(counted) > samples // 2:
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

        counted: list[int] = []
        found = package.montecarlo(
            scene, samples=samples, seed=4, spec_um=40.0,
            executor=client.get_executor(pure=False), workers=3, progress=kill_one,
        )  # fmt: skip
        assert killed
        assert killed[0] not in client.run(os.getpid).values()
    assert sum(counted) == samples
    assert (found.mean_um, found.rms_um, found.p99_um, found.max_um) == (
        *(alone.mean_um, alone.rms_um, alone.p99_um, alone.max_um),
    )
    assert found.probability == alone.probability
    assert found.histogram.counts.tolist() == alone.histogram.counts.tolist()


# --- processes of this machine -------------------------------------------------------------------


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_workers_that_die_again_and_again_end_the_run_with_a_message(tmp_path: Path) -> None:
    said = f"died {pools.LOSSES + 1} times .out of memory... run again with fewer --workers"

    def run() -> None:
        with find_workers(None, 2, pools.WORTH_A_POOL) as found:
            assert found.executor is not None
            found.executor.submit(square, 3, str(tmp_path), "always").result(120)

    with pytest.raises(WorkersLostError, match=said):
        run()


def test_a_large_run_gets_processes_and_a_small_one_threads() -> None:
    with find_workers(None, None, pools.WORTH_A_POOL - 1) as few:
        assert few.executor is None
    with find_workers(None, 1, 10**9) as alone:
        assert alone.executor is None
    with find_workers(None, 2, pools.WORTH_A_POOL) as many:
        assert isinstance(many.executor, ProcessPool)
        assert many.number == 2
    with pytest.raises(OptionError, match="workers: 513"), find_workers(None, 513, 1):
        pass


def test_processes_give_the_same_numbers(warpspace, monkeypatch) -> None:
    run = (*RUN, "--samples", str(20 * BLOCK))
    monkeypatch.setattr(pools, "WORTH_A_POOL", 1)
    here, there = warpspace(*run, "--workers", "1"), warpspace(*run, "--workers", "2")
    assert there.status == 0, there.err
    assert here.out == there.out


@pytest.mark.proof
@pytest.mark.skipif(sys.platform != "linux", reason="signals")
def test_a_run_that_is_interrupted_leaves_no_process_and_no_file(tmp_path: Path) -> None:
    target = tmp_path / "x.parquet"
    run = ("-m", "warpspace", "montecarlo", "dvf5000_general", "--samples", "50000000")
    process = subprocess.Popen(
        [sys.executable, *run, "--workers", "2", "-o", str(target)], stderr=subprocess.PIPE
    )
    parent = psutil.Process(process.pid)
    until = time.monotonic() + 60.0
    while not list(tmp_path.glob(".warpspace-*")) or len(parent.children()) < 3:
        assert time.monotonic() < until
        time.sleep(0.05)
    time.sleep(5.0)
    children = parent.children(recursive=True)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert process.returncode == 130
    assert said.decode().strip() == "warpspace: interrupted"
    assert psutil.wait_procs(children, 10)[1] == []
    assert list(tmp_path.iterdir()) == []
