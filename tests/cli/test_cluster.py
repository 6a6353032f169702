"""Monte Carlo on processes and on a real Dask cluster: the same numbers, whoever is lost."""

import os
import signal
import sys

import pytest

import warpspace as package
from lost_process import square
from warpspace.analysis.sampling.cases import BLOCK
from warpspace.cli import sampling_output
from warpspace.cli.sampling_output import find_workers
from warpspace.exceptions import OptionError, WorkersLostError
from warpspace.outputs.processes import ProcessPool


def dask_cluster(workers, folder):
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address=":0",
        worker_dashboard_address=None,
        memory_limit=0,
        local_directory=str(folder),
    )


distributed = pytest.importorskip("distributed")
RUN = ("montecarlo", "dvf5000_general", "--over", "max", "--limit", "90", "--seed", "4", "--json")


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    with dask_cluster(2, tmp_path_factory.mktemp("dask")) as cluster:
        yield cluster.scheduler_address


def test_a_cluster_gives_the_same_numbers_to_the_last_bit(warpspace, scheduler, tmp_path):
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
    assert max(first["error_um"].to_pylist()) == here.json["max_um"]


def test_a_sweep_of_a_fleet_on_a_cluster(warpspace, scheduler):
    sweep = ("montecarlo", "--rows", "dvf5000_general", "dvf5000_proposed", "--samples", "5000")
    steps = ("--tolerance", "rotation=10:30:3", "--limit", "40", "--json")
    here, there = warpspace(*sweep, *steps), warpspace(*sweep, *steps, "--scheduler", scheduler)
    assert there.status == 0, there.err
    assert here.out == there.out
    assert len(there.json["rows"]) == 6


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere", "gopher://x:1", ""])
def test_a_scheduler_that_is_none_is_refused(warpspace, monkeypatch, address):
    monkeypatch.setattr(sampling_output, "CONNECT_S", 0.3)
    warpspace("montecarlo", "dvf5000_general", "--scheduler", address).refused(
        f"--scheduler {address!r}", "expected the address of a Dask scheduler"
    )


def test_without_dask_it_is_said_what_to_install(warpspace, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    run = ("montecarlo", "dvf5000_general", "--scheduler", "tcp://127.0.0.1:8786")
    warpspace(*run).refused("warpspace[cluster]")


@pytest.mark.nightly
def test_a_worker_killed_half_way_changes_nothing(tmp_path):
    samples = 2_500_000
    scene = package.load_scene("dvf5000_general")
    alone = package.montecarlo(scene, samples=samples, seed=4, limit_um=40.0)
    with (
        dask_cluster(3, tmp_path) as cluster,
        distributed.Client(cluster.scheduler_address, set_as_default=False) as client,
    ):
        killed: list[int] = []

        def kill_one(done):
            counted.append(done)
            if not killed and sum(counted) > samples // 2:
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

        counted: list[int] = []
        found = package.montecarlo(
            scene, samples=samples, seed=4, limit_um=40.0,
            executor=client.get_executor(pure=False), workers=3, progress=kill_one,
        )  # fmt: skip
        assert killed
        assert killed[0] not in client.run(os.getpid).values()
    assert sum(counted) == samples
    for name in ("mean_um", "rms_um", "p99_um", "max_um", "probability"):
        assert getattr(found, name) == getattr(alone, name)
    assert found.histogram.counts.tolist() == alone.histogram.counts.tolist()


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_workers_that_die_again_and_again_end_the_run_with_a_message(tmp_path):
    said = (
        f"died {sampling_output.LOSSES + 1} times .out of memory... run again with fewer --workers"
    )

    def run():
        with find_workers(None, 2, sampling_output.WORTH_A_POOL) as found:
            found[0].submit(square, 3, str(tmp_path), "always").result(120)

    with pytest.raises(WorkersLostError, match=said):
        run()


def test_a_large_run_gets_processes_and_a_small_one_threads():
    with find_workers(None, None, sampling_output.WORTH_A_POOL - 1) as few:
        assert few[0] is None
    with find_workers(None, 1, 10**9) as alone:
        assert alone[0] is None
    with find_workers(None, 2, sampling_output.WORTH_A_POOL) as many:
        assert isinstance(many[0], ProcessPool)
        assert many[1] == 2
    with pytest.raises(OptionError, match="workers: 513"), find_workers(None, 513, 1):
        pass


@pytest.mark.nightly
def test_processes_give_the_same_numbers(warpspace, monkeypatch):
    run = (*RUN, "--samples", str(20 * BLOCK))
    monkeypatch.setattr(sampling_output, "WORTH_A_POOL", 1)
    here, there = warpspace(*run, "--workers", "1"), warpspace(*run, "--workers", "2")
    assert there.status == 0, there.err
    assert here.out == there.out
