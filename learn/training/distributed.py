"""The processes of a training run: those that torchrun started, which average their gradients.

Source: torchrun's environment (WORLD_SIZE, RANK and the address), as torch.distributed reads it.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from torch import distributed


@contextmanager
def joined_processes() -> Iterator[tuple[int, int]]:
    """Join the processes that torchrun started and give (rank, number); alone it is (0, 1)."""
    world = int(os.environ.get("WORLD_SIZE", "1"))
    if world == 1:
        yield 0, 1
        return
    distributed.init_process_group("gloo")
    try:
        yield distributed.get_rank(), world
    finally:
        distributed.destroy_process_group()
