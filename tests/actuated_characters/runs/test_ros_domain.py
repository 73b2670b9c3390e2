"""A run's ROS domain is its own: among threads of one process, processes, and nodes elsewhere."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from actuated_characters.runs.ros_domain import own_domain
from msgs_config.errors import ConfigurationError
from tests.support.ros import Processes, wait_until

# Whoever has the same process number begins to look at the same domain: a rival for certain.
RIVAL = """
import os, sys
os.getpid = lambda: int(sys.argv[1])
from actuated_characters.runs.ros_domain import own_domain
with own_domain() as domain:
    print(domain, flush=True)
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def own_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lock files of the test's own, so that nobody else on this machine is kept from a domain."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))


@contextmanager
def rival() -> Iterator[tuple[int, "subprocess.Popen[str]"]]:
    """Another process that wants this one's domain, and the domain that it has."""
    process = subprocess.Popen(
        [sys.executable, "-c", RIVAL, str(os.getpid())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        yield int(process.stdout.readline()), process
    finally:
        process.communicate()


def the_domain_now() -> int:
    """The domain that this process is given, and gives back."""
    with own_domain() as domain:
        return domain


def test_two_holders_in_one_process_or_two_have_different_domains() -> None:
    with own_domain() as first, own_domain() as second, rival() as (third, _):
        assert len({first, second, third}) == 3
    with rival() as (theirs, _), own_domain() as ours:
        assert theirs != ours


def test_a_domain_is_free_again_when_its_holder_gives_it_back_after_an_error_too() -> None:
    first = the_domain_now()

    assert the_domain_now() == first
    with rival() as (theirs, _):
        assert theirs == first
    with pytest.raises(ZeroDivisionError), own_domain():
        raise ZeroDivisionError
    assert the_domain_now() == first


def test_a_domain_is_free_again_when_its_holder_is_killed() -> None:
    with rival() as (theirs, process):
        process.send_signal(signal.SIGKILL)
        process.wait()

        assert the_domain_now() == theirs


@pytest.mark.parametrize(
    "offset", [0, 10, 12], ids=["multicast", "first participant", "second participant"]
)
def test_a_domain_whose_port_is_taken_is_avoided(offset: int) -> None:
    domain = the_domain_now()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("", 7400 + 250 * domain + offset))

        assert the_domain_now() != domain

    assert the_domain_now() == domain


def test_a_domain_with_a_node_in_it_is_avoided(
    processes: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    domain = the_domain_now()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))

    node = processes.controller()

    wait_until(lambda: the_domain_now() != domain, "another domain")
    assert node.exit_code is None


def test_there_is_an_end_to_the_domains_and_it_is_an_error_that_says_so() -> None:
    with ExitStack() as stack:
        domains: list[int] = []

        def take_all() -> None:
            while True:
                domains.append(stack.enter_context(own_domain()))

        with pytest.raises(ConfigurationError, match="ROS_DOMAIN_ID"):
            take_all()

        assert len(domains) > 50  # those of others on this machine are left out
        assert len(set(domains)) == len(domains)
        assert set(domains) <= set(range(1, 102))

    assert the_domain_now() in domains
