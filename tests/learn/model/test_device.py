import pytest
import torch

from echoscape.learn.model.device import autocast, fast_dtype, resolve_device

HAS_CUDA = torch.cuda.is_available()


def test_auto_is_the_gpu_where_there_is_one():
    assert resolve_device("auto").type == ("cuda" if HAS_CUDA else "cpu")
    assert resolve_device("cpu") == torch.device("cpu")


@pytest.mark.skipif(HAS_CUDA, reason="needs a machine without a GPU")
def test_a_gpu_that_is_absent_is_refused_in_one_line():
    with pytest.raises(ValueError, match=r"device must be cpu or auto here, got 'cuda'.*no CUDA") as error:
        resolve_device("cuda")
    assert "\n" not in str(error.value)


def test_an_unknown_device_is_refused_by_name():
    with pytest.raises(ValueError, match="device must be one of auto, cpu, cuda, got 'tpu'"):
        resolve_device("tpu")


def test_the_fast_format_is_one_that_the_device_computes():
    device = resolve_device("auto")
    dtype = fast_dtype(device)
    assert dtype in (torch.bfloat16, torch.float32)
    assert (
        torch.ones(2, 2, dtype=dtype, device=device) @ torch.ones(2, 2, dtype=dtype, device=device)
    ).dtype == dtype


@pytest.mark.parametrize(
    "device", [torch.device("cpu"), pytest.param(torch.device("cuda"), marks=pytest.mark.gpu)]
)
def test_autocast_follows_the_device_and_float32_switches_it_off(device: torch.device):
    if device.type == "cuda" and not HAS_CUDA:
        pytest.skip("no GPU")
    one = torch.ones(2, 2, device=device)
    with autocast(device, torch.bfloat16):
        assert (one @ one).dtype == torch.bfloat16
    with autocast(device, torch.float32):
        assert (one @ one).dtype == torch.float32
