"""Files of results that `train` and `motion reconstruct` leave."""

import os
from pathlib import Path

import pytest

from actuated_characters.commands.common.result_file import check_not_lost, result_file
from msgs_config.errors import ConfigurationError


def test_the_usual_folder_may_be_made_and_the_named_one_must_be_there(tmp_path: Path) -> None:
    usual = tmp_path / "policies" / "walk.npz"

    assert result_file(None, usual) == usual
    assert result_file(tmp_path / "mine.npz", usual) == tmp_path / "mine.npz"
    with pytest.raises(ConfigurationError, match="there is no directory"):
        result_file(usual, usual)


def test_a_folder_that_cannot_be_written_to_is_said_before_a_long_search(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    real = os.access

    def access(path: Path, mode: int) -> bool:
        """Whether one who is not root may; root may everywhere."""
        return path != tmp_path and real(path, mode)

    monkeypatch.setattr(os, "access", access)

    with pytest.raises(ConfigurationError, match=f"no permission to write to {tmp_path}"):
        result_file(None, tmp_path / "policies" / "walk.npz")


def test_what_is_there_is_gone_on_from_or_replaced_if_that_is_said(tmp_path: Path) -> None:
    file = tmp_path / "walk.npz"
    check_not_lost([file], resume=False, overwrite=False)
    file.touch()

    check_not_lost([file], resume=True, overwrite=False)
    check_not_lost([file], resume=False, overwrite=True)
    with pytest.raises(ConfigurationError, match="--resume goes on, --overwrite starts over"):
        check_not_lost([tmp_path / "other.npz", file], resume=False, overwrite=False)
