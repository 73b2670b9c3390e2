"""A network in ONNX, evaluated by onnxruntime on one thread of the processor."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from msgs_config.arrays import SingleArray
from msgs_config.errors import ConfigurationError
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.runtime.extras import require_extra

SUFFIX = ".onnx"
STEP_INPUT = "time_step"
"""The input that counts decisions, of networks that have their motion in them."""
_OBSERVATIONS = ("obs", "observation", "observations", "input", "actor_obs")
_ACTIONS = ("actions", "action", "output", "mean_actions")
_QUIET = 4  # onnxruntime's level of severity: fatal errors alone; all others are raised
_MAX_BYTES = 500_000_000


class Network:
    """A network of a file. It remembers nothing: what it has to, it is given, and gives back."""

    def __init__(self, path: Path) -> None:
        """Read a file.

        Raises:
            ConfigurationError: onnxruntime or the file is missing, or it is no network that goes
                from one observation to actions.
        """
        require_extra("onnx", "a policy in ONNX")
        refuse_other_kind(path, "a policy in ONNX", (SUFFIX,), ConfigurationError)
        try:
            if path.stat().st_size > _MAX_BYTES:
                raise ConfigurationError(f"{path}: larger than {_MAX_BYTES >> 20} MiB")
            content = path.read_bytes()
        except (OSError, ValueError) as error:  # ValueError: a NUL in the path
            reason = error.strerror if isinstance(error, OSError) else "not the path of a file"
            raise ConfigurationError(f"{path}: {reason}") from error
        self._open(path, content)

    def _open(self, path: Path, content: bytes) -> None:
        self.path, self._content = path, content
        self._session = _make_session(path, content)
        self.metadata: dict[str, str] = dict(self._session.get_modelmeta().custom_metadata_map)
        """Texts that its exporter has left in the file."""
        self.inputs: dict[str, list[Any]] = {i.name: i.shape for i in self._session.get_inputs()}
        """Shapes of the inputs, by name; a size that is free is a text, or None."""
        self.outputs = [output.name for output in self._session.get_outputs()]
        self.observation = _found(path, "input", list(self.inputs), _OBSERVATIONS)
        """Name of the input that the observation goes to."""
        self.actions = _found(path, "output", self.outputs, _ACTIONS)

    def __reduce__(self) -> tuple[object, ...]:
        """For a copy: it opens the same content again."""
        return _opened, (self.path, self._content)

    def evaluate(
        self, observation: SingleArray, others: Mapping[str, SingleArray]
    ) -> tuple[SingleArray, dict[str, SingleArray]]:
        """The action (m,) of an observation (o,) and other inputs; and all outputs, by name.

        Raises:
            ConfigurationError: the shapes are not those of the network.
        """
        given = {self.observation: observation[np.newaxis], **others}
        try:
            found = self._session.run(None, given)
        except Exception as error:  # onnxruntime's errors have no base of their own
            raise ConfigurationError(f"{self.path}: {_first_line(error)}") from error
        outputs = dict(zip(self.outputs, found, strict=True))
        return outputs[self.actions].reshape(-1), outputs


def _opened(path: Path, content: bytes) -> Network:
    network = Network.__new__(Network)
    network._open(path, content)
    return network


def _make_session(path: Path, content: bytes) -> Any:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.use_deterministic_compute = True
    options.log_severity_level = _QUIET
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # likewise
        raise ConfigurationError(f"{path} is no network in ONNX: {_first_line(error)}") from error


def _first_line(error: Exception) -> str:
    return str(error).strip().split("\n")[0][:300]


def _found(path: Path, kind: str, names: list[str], usual: tuple[str, ...]) -> str:
    """The input or output of a usual name, or the only one."""
    found = next((name for name in usual if name in names), None)
    if found is not None or len(names) == 1:
        return found or names[0]
    raise ConfigurationError(
        f"{path}: none of its {kind}s {', '.join(names)} has one of the names {', '.join(usual)}"
    )
