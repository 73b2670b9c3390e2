"""The process of a node: its threads, its signals, its end, one clear line for an error.

Imports neither numpy nor rclpy at the top: the limit on threads must come before numpy loads.
"""

import itertools
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import NoReturn, Protocol

from msgs_config.errors import ActuatedCharactersError, ConfigurationError
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.runtime.exit_watchdog import exit_after
from msgs_config.runtime.extras import require_extra
from msgs_config.runtime.ros_environment import (
    DISCOVERY_RANGE,
    LOCALHOST,
    check_domain_id,
    is_discovery_off,
)
from msgs_config.runtime.shadowing import shadowed_packages
from msgs_config.runtime.shared_memory import remove_orphans

EXIT_ERROR = 1
LEAVE_TIME = 2  # s that leaving the ROS graph may take
_FAST_DDS = "rmw_fastrtps"
_ANYWHERE_PROFILE, _LOCALHOST_PROFILE = (
    Path(__file__).with_name(f"{name}.xml") for name in ("fastdds", "fastdds_localhost")
)
_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_HIDDEN_WARNING = (
    f"{DISCOVERY_RANGE} is OFF: no node of another process can find this one, nor be found by it; "
    f"{LOCALHOST} lets those of this machine"
)
_PARAMETERS_ARE_SET = (
    "parameters are set by --ros-args -p NAME:=VALUE or --params-file FILE, and listed by "
    "'actuated_characters run --parameters NODE'"
)
_USAGE = "usage: {name} [--ros-args ...]\n\n{about}" + _PARAMETERS_ARE_SET


def limit_threads() -> None:
    """Keep numpy's linear algebra on one thread: on matrices this small more only get in the way.

    To be called before numpy is imported; variables that the user has set stay.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def open_missing_streams() -> None:
    """Open those standard streams, to nowhere, that the process was started without.

    Otherwise the next file to be opened would become the standard output, or the error output.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            # It takes the lowest descriptor that is free.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


def use_batch_scheduling() -> None:
    """Let this process' threads wait until others leave a processor, rather than interrupt them.

    For processes that only listen to a control loop. To be called before there are other threads,
    which inherit it. The process' share of a busy machine stays the same.
    """
    if not hasattr(os, "SCHED_BATCH"):  # Linux alone has it
        return
    if os.sched_getscheduler(0) == os.SCHED_OTHER:  # a policy that the user has chosen stays
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


class StopSignal:
    """Becomes true at SIGINT or SIGTERM, so that a loop can end in good order."""

    def __init__(self) -> None:
        self._received = False
        self._ends_at_once = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._receive)

    def __bool__(self) -> bool:
        return self._received

    def _receive(self, number: int, frame: FrameType | None) -> None:
        del number, frame
        self._received = True
        if self._ends_at_once:
            os._exit(0)  # an exception would be swallowed by some module that is being imported

    @contextmanager
    def ending_at_once(self) -> Iterator[None]:
        """Let a signal end the process there and then: nothing is open yet."""
        self._ends_at_once = True
        try:
            yield
        finally:
            self._ends_at_once = False


class RunnableNode(Protocol):
    """A node whose work ends by itself or at a stop signal."""

    def run(self, stop: StopSignal) -> None:
        """Work until the end or until `stop`."""

    def destroy_node(self) -> object:
        """Leave the graph."""


def run_node(place: str, about: str = "", *, listens: bool = False, extra: str = "") -> NoReturn:
    """Run a node between rclpy's start and end, and end the process.

    rclpy's own signal handlers would end the context under a loop that still publishes or writes,
    so the node is handed a `StopSignal` instead. Once the node has left the graph nothing is open
    any more, and the process ends without Python's own finalization, which takes far longer.

    Args:
        place: Of its constructor, MODULE:NAME; the module is imported after rclpy's start.
        about: What `--help` says before it says how parameters are set.
        listens: Whether it only listens to a control loop, and others come first.
        extra: The extra of the package that it needs.
    """
    limit_threads()
    if listens:
        use_batch_scheduling()
    open_missing_streams()
    stop = StopSignal()
    node, code = None, EXIT_ERROR
    try:
        with stop.ending_at_once():
            for sentence in shadowed_packages():
                print(f"warning: {sentence}", file=sys.stderr, flush=True)
            _start_ros(about)
            if extra:
                require_extra(extra, "this node")
            make_node = _find(place)
        node = make_node()
        node.run(stop)
        code = 0
    except ActuatedCharactersError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
    finally:
        _leave(node, code)
    sys.stderr.flush()
    os._exit(code)


def _find(place: str) -> Callable[[], RunnableNode]:
    """The constructor at a place, MODULE:NAME."""
    module, _, name = place.partition(":")
    found: Callable[[], RunnableNode] = getattr(import_module(module), name)
    return found


def _leave(node: RunnableNode | None, code: int) -> None:
    sys.stdout.flush()
    if "rclpy" not in sys.modules:
        return
    import rclpy

    exit_after(LEAVE_TIME, code)
    if node is not None:
        node.destroy_node()
    rclpy.try_shutdown()


def _parameter_files(arguments: Sequence[str]) -> list[Path]:
    """The files that follow `--params-file` on a node's command line."""
    return [
        Path(value) for option, value in itertools.pairwise(arguments) if option == "--params-file"
    ]


def middleware_settings(environment: Mapping[str, str]) -> dict[str, str]:
    """The variables with which Fast DDS 2.14, Jazzy's, reads the settings of this package.

    Empty where the user has settings. Under LOCALHOST the file does what that range means.
    """
    given = environment.get(_PROFILES)
    if given not in (None, str(_ANYWHERE_PROFILE), str(_LOCALHOST_PROFILE)):
        return {}
    is_fast_dds = environment.get("RMW_IMPLEMENTATION", _FAST_DDS).startswith(_FAST_DDS)
    is_plain = not environment.get("ROS_STATIC_PEERS")
    is_plain &= environment.get("ROS_LOCALHOST_ONLY", "0") != "1"
    if environment.get(DISCOVERY_RANGE) == LOCALHOST and is_fast_dds and is_plain:
        return {DISCOVERY_RANGE: "SYSTEM_DEFAULT", _PROFILES: str(_LOCALHOST_PROFILE)}
    return {} if given is not None else {_PROFILES: str(_ANYWHERE_PROFILE)}


def _start_ros(about: str) -> None:
    os.environ.update(middleware_settings(os.environ))
    remove_orphans()
    require_extra("wheels", "a node")
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import remove_ros_args

    try:
        others = remove_ros_args(sys.argv)[1:]
        if {"-h", "--help"} & set(others):
            print(_USAGE.format(name=os.path.basename(sys.argv[0]), about=about))
            raise SystemExit(0)
        if others:
            raise ConfigurationError(f"unknown argument {others[0]!r}; {_PARAMETERS_ARE_SET}")
        check_domain_id(os.environ)
        for file in _parameter_files(sys.argv):  # rcl takes some files of other kinds for empty
            refuse_other_kind(file, "a file of parameters", (".yaml", ".yml"), ConfigurationError)
        if is_discovery_off(os.environ):
            print(f"warning: {_HIDDEN_WARNING}", file=sys.stderr, flush=True)
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rclpy's own, of several types: a bad file or argument
        reason = " ".join(str(error).split())
        raise ConfigurationError(f"ROS does not take the arguments: {reason}") from error
