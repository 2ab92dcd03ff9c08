"""Where tensors live and which number formats are fast there: the only module that knows devices by name."""

from contextlib import AbstractContextManager
from typing import Literal, get_args

import torch

Device = Literal["auto", "cpu", "cuda"]
"""A device as a user asks for it; "auto" is the GPU where PyTorch finds one, and the CPU elsewhere."""


def resolve_device(name: Device | str = "auto") -> torch.device:
    """Return the device that a name asks for.

    Args:
        name: "auto", "cpu" or "cuda".

    Returns:
        The device; "auto" gives CUDA where PyTorch finds a GPU, and the CPU elsewhere.

    Raises:
        ValueError: The name is none of these, or asks for CUDA where PyTorch finds no GPU.
    """
    if name not in get_args(Device):
        raise ValueError(f"device must be one of {', '.join(get_args(Device))}, got {name!r}")
    present = torch.cuda.is_available()
    if name == "cuda" and not present:
        raise ValueError("device must be cpu or auto here, got 'cuda': PyTorch finds no CUDA device")
    return torch.device("cuda" if name == "cuda" or (name == "auto" and present) else "cpu")


def fast_dtype(device: torch.device) -> torch.dtype:
    """Return the number format in which a device multiplies matrices fastest without loss of range.

    Args:
        device: Where the products are computed.

    Returns:
        bfloat16 where the device multiplies it natively (CUDA from compute capability 8.0, CPUs with AMX or
        AVX-512 BF16), float32 elsewhere.
    """
    if device.type == "cuda":
        native = torch.cuda.get_device_capability(device) >= (8, 0)
    else:
        able = torch.cpu.get_capabilities()
        native = bool(able.get("avx512_bf16") or able.get("amx_bf16"))
    return torch.bfloat16 if native else torch.float32


def autocast(device: torch.device, dtype: torch.dtype) -> AbstractContextManager[object]:
    """Return a context in which convolutions and products are computed in a number format.

    Args:
        device: Where the tensors are.
        dtype: Number format; with float32 the context changes nothing.

    Returns:
        The context manager, `torch.autocast` for the device.
    """
    return torch.autocast(device.type, dtype, enabled=dtype != torch.float32)
