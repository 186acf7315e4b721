"""``python -m rollouts COMMAND``: the same as ``robot-layouts COMMAND``."""

from robots.common.cli import Command, Program
from robots.common.commands import start
from rollouts import commands
from rollouts.dataset.certify_command import certify
from rollouts.evaluate_command import evaluate
from rollouts.receipts.verify_command import verify
from rollouts.recording.record_command import record
from rollouts.suite import command as suite

_OWN = (
    *(commands.demo, record, commands.teleop, commands.replay, certify, commands.convert),
    *(commands.export, commands.report, commands.view, evaluate, verify),
)
_SUITE = (suite.show, suite.run, suite.report, suite.verify)
COMMANDS = {one.__name__: Command(one) for one in _OWN} | {
    f"suite {one.__name__}": Command(one) for one in _SUITE
}
main = Program("robot-layouts", COMMANDS).main

if __name__ == "__main__":
    start(main)
