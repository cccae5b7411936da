"""One call of the command line: the parser of all commands, where a wrong call is one line with the nearest word that
is known; then run, and errors as one line on stderr and an exit code.

Exit codes: 0 done; 1 some part of a batch failed; 2 wrong input, job or call; 129, 130, 143 stopped by SIGHUP,
SIGINT (Ctrl-C), SIGTERM.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from functools import partial
from typing import Any, NoReturn

import bonecam
from bonecam.cli.command import Command, argument
from bonecam.cli.commands import COMMANDS
from bonecam.cli.stopping import arrived, tell
from bonecam.errors import BonecamError, did_you_mean
from bonecam.plugins import all_added
from bonecam.runtime.staging import placed
from bonecam.text.numbers import in_one_line

EXIT_CODES = """Exit codes: 0 done; 1 a part of a batch failed; 2 wrong input, job or call (one line on stderr);
129, 130, 143 stopped by SIGHUP, Ctrl-C, SIGTERM."""


class Parser(argparse.ArgumentParser):
    """A parser that answers a wrong call with one line and exit code 2."""

    def error(self, message: str) -> NoReturn:
        """End with one line on stderr and exit code 2."""
        self.exit(2, f"{self.prog}: {in_one_line(message)}: see {self.prog} --help\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        """argparse's printing of helps and versions, but with an OSError where standard output takes nothing."""
        if file is not sys.stdout:
            return super()._print_message(message, file)
        file.write(message)
        file.flush()

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """argparse's check of a choice, with the nearest one in the message."""
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            close = did_you_mean(str(value), known)
            raise argparse.ArgumentError(action, f"{value!r} is unknown{close}: use one of {', '.join(known)}")

    def refuse_unknown(self, arguments: Sequence[str]) -> NoReturn:
        """End with one line that names the arguments that this command does not know."""
        close = did_you_mean(arguments[0].partition("=")[0], self._option_string_actions)
        self.error(f"unrecognized arguments: {' '.join(arguments)}{close}")


def make_parser() -> Parser:
    """The parser of all commands, the core's and those of plugins; each sets `run`, which takes the options and returns
    the exit code. A command of a plugin whose name the core has is left out."""
    text = "From a bone mesh to a verified five-axis NC program."
    parser = Parser(prog="bonecam", description=text, epilog=EXIT_CODES)
    parser.add_argument("-V", "--version", action="version", version=f"bonecam {bonecam.__version__}")
    parser.set_defaults(run=None, refuse_unknown=parser.refuse_unknown)
    parsers = parser.add_subparsers(metavar="COMMAND", parser_class=Parser)
    completion = Command(
        partial(_run_completion, parser),
        "Print the completion of bonecam for a shell.",
        [argument("shell", choices=("bash", "zsh", "tcsh"), help="the shell")],
        "  bonecam completion bash > ~/.local/share/bash-completion/completions/bonecam",
    )
    core = {**COMMANDS, "completion": completion}
    added = all_added("commands", Command, taken=core)
    for name, command in {**COMMANDS, **added, "completion": completion}.items():
        known: Parser = parsers.add_parser(
            name,
            help=command.help,
            description=command.help,
            epilog="examples:\n" + command.examples.strip("\n"),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        known.set_defaults(run=command.run, refuse_unknown=known.refuse_unknown)
        known.set_defaults(stopped=command.stopped, stopped_late=command.stopped_late)
        known.set_defaults(quiet=False, verbose=False, machine=None, controller=None)
        for names, settings in command.arguments:
            known.add_argument(*names, **settings)
    return parser


def _run_completion(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """`bonecam completion`: the script that a shell reads."""
    import shtab

    print(shtab.complete(parser, shell=options.shell), end="")
    return 0


STOPPED = 130
"""Exit code after Ctrl-C: 128 and the number of the signal, as shells have it."""


def call(arguments: Sequence[str]) -> int:
    """Run the command with these arguments; its exit code. `help COMMAND` is `COMMAND --help`."""
    try:
        return _run(arguments)
    except BrokenPipeError:  # the reader of the output has closed it, as `head` does
        _mute()
        return 0
    except OSError:
        try:
            print(flush=True)  # which fails where standard output takes nothing: a full disk for instance
        except OSError as error:
            trouble = error.strerror or str(error)
        else:
            raise
        _mute()
        print(f"bonecam: standard output: {trouble}: write it elsewhere", file=sys.stderr)
        return 2


def _run(arguments: Sequence[str]) -> int:
    """Parse and run; OSError where standard output takes nothing."""
    parser = make_parser()
    if arguments and arguments[0] == "help":
        arguments = [*arguments[1:], "--help"]
    options, unknown = parser.parse_known_args(arguments)
    if unknown:
        options.refuse_unknown(unknown)
    if options.run is None:
        parser.print_help()
        return 0
    before = len(placed)
    try:
        code = int(options.run(options))
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, KeyboardInterrupt) or arrived:
            tell(options.stopped if len(placed) == before else options.stopped_late)
            return STOPPED
        if not isinstance(error, BonecamError):
            raise
        print(f"bonecam: {in_one_line(str(error))}", file=sys.stderr)
        return 2
    if arrived:
        tell(options.stopped_late)
    return code


def _mute() -> None:
    """What is printed from now on, and what waits to be, goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
