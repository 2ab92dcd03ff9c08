"""The option --backend: loads the ray tracer, and refuses by name a backend that this machine lacks."""

from collections.abc import Sequence
from importlib import import_module

from echoscape.cli.arguments import ArgumentsError, option_value
from echoscape.sim.raytracing.backend import BACKEND_VARIABLE, Backend, BackendChoiceError, use_backend


def load_ray_tracer(backend: Backend, words: Sequence[str]) -> None:
    """Load the ray tracer on a backend.

    Args:
        backend: The backend, as parsed.
        words: The words of the command line, in which --backend may be given.

    Raises:
        ArgumentsError: This machine lacks the backend that --backend names.
        BackendChoiceError: It lacks the one that the environment variable names.
        BackendError: The ray tracer cannot run on this machine.
    """
    use_backend(backend)
    try:
        import_module("echoscape.sim.raytracing.mitsuba_backend")
    except BackendChoiceError as error:
        if option_value("--backend", words) is None:
            raise
        raise ArgumentsError(str(error).replace(BACKEND_VARIABLE, "--backend", 1)) from error
