# SPDX-License-Identifier: MIT OR Apache-2.0
"""The same sweep on one machine, on a dask cluster or by MPI; Ctrl-C or a crash costs half a second of work.

python sweep_on_a_cluster.py                                       # threads of this process
python sweep_on_a_cluster.py --backend processes
python sweep_on_a_cluster.py --backend dask --address tcp://host:8786
mpiexec -n 65 python -m mpi4py.futures sweep_on_a_cluster.py --backend mpi

The workers need bearslam as well. Apart from times, the result is the same, bit by bit, wherever it is computed. Called
again, the script resumes from its checkpoint.
"""

import argparse
import sys
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import ExitStack

import numpy as np

import bearslam


def executor(backend: str, address: str | None, stack: ExitStack) -> Executor | None:
    """The executor to run on; anything with the interface of `concurrent.futures.Executor` will do."""
    if backend == "processes":
        return stack.enter_context(ProcessPoolExecutor())
    if backend == "dask":
        from distributed import Client  # pip install "dask[distributed]"

        # Without an address, this is a cluster of processes on this machine.
        return stack.enter_context(Client(address)).get_executor()
    if backend == "mpi":
        from mpi4py.futures import MPIPoolExecutor  # pip install mpi4py

        return stack.enter_context(MPIPoolExecutor())
    return None


def main() -> int:
    """Run the sweep, save and draw it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--backend", choices=("local", "processes", "dask", "mpi"), default="local")
    parser.add_argument("--address", help="address of the dask scheduler")
    parser.add_argument("--trials", type=int, default=50, help="number of scenes in each of 150 cells")
    options = parser.parse_args()

    with ExitStack() as stack:
        try:
            result = bearslam.sweep(
                ["mixed", "enclosed"],
                views=[4, 6, 8, 10, 12],
                landmarks=[7, 9, 11, 13, 15],
                noise=np.radians([0.1, 0.5, 1.0]),
                trials=options.trials,
                executor=executor(options.backend, options.address, stack),
                progress=True,
                checkpoint="sweep.checkpoint",
            )
        except bearslam.ExecutorError as error:
            print(error, file=sys.stderr)  # the cluster is gone, but its results are kept
            result = error.result
    result.save("sweep.npz")
    for start in result.start:
        total = result.total(start)
        low, high = total.failure_interval()
        print(f"{start:<10} {total.failures} of {total.trials} failed, between {100 * low:.3g} and {100 * high:.3g} %")
    return 0 if result.complete else 1


if __name__ == "__main__":
    sys.exit(main())
