"""The door between scripts and the package: one message for a user's mistake, a traceback in the log for anything else."""

import logging

import pytest

from limo.door import logged
from limo.errors import ResultError


@pytest.fixture(autouse=True)
def _keep_root_handlers():
    """``logged`` takes over the root logger."""
    before = logging.getLogger().handlers[:]
    yield
    for handler in set(logging.getLogger().handlers) - set(before):
        handler.close()
    logging.getLogger().handlers[:] = before


def test_mistake_of_the_user_ends_with_its_message_alone(tmp_path):
    with pytest.raises(SystemExit, match=r"mesh\.vtu: not a device mesh"), logged(str(tmp_path / "new/rule.log")):
        raise ResultError("mesh.vtu: not a device mesh")
    log = (tmp_path / "new/rule.log").read_text()
    assert "mesh.vtu: not a device mesh" in log
    assert "Traceback" not in log


def test_anything_else_leaves_its_traceback_in_the_log(tmp_path):
    with pytest.raises(KeyError), logged(str(tmp_path / "rule.log")):
        raise KeyError("forgotten")
    log = (tmp_path / "rule.log").read_text()
    assert "forgotten" in log
    assert "Traceback" in log
