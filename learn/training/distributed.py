"""The processes of a training run: those that torchrun started, which average their gradients.

Source: torchrun's environment (WORLD_SIZE, RANK, LOCAL_RANK and the address), as torch.distributed reads it.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch import distributed


@dataclass(frozen=True, kw_only=True)
class Process:
    """One process of a training run.

    Attributes:
        rank: Its number, from 0.
        world: How many there are.
        device: Where it computes.
    """

    rank: int
    world: int
    device: torch.device


@contextmanager
def joined_processes(device: torch.device) -> Iterator[Process]:
    """Join the processes that torchrun started, for as long as the context lasts.

    Args:
        device: Kind of device to compute on; with several GPUs each process takes that of its LOCAL_RANK.

    Yields:
        This process; outside torchrun the only one.
    """
    world = int(os.environ.get("WORLD_SIZE", "1"))
    if world == 1:
        yield Process(rank=0, world=1, device=device)
        return
    if device.type != "cpu":
        device = torch.device(device.type, int(os.environ.get("LOCAL_RANK", "0")))
        torch.accelerator.set_device_index(device)
    distributed.init_process_group(distributed.get_default_backend_for_device(device))
    try:
        yield Process(rank=distributed.get_rank(), world=world, device=device)
    finally:
        distributed.destroy_process_group()
