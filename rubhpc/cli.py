"""The commands: each reads arguments, calls one library function, prints, and returns an exit code.

Nothing heavy is imported before a command needs it: `rubhpc --help` names all commands without loading any.
"""

from __future__ import annotations

import atexit
import difflib
import logging
import os
import sys
import time
import warnings
from importlib import import_module

import click

from postproc.catalogue import figures
from rubhpc import __version__
from rubhpc.children import SAFE_PATH
from rubhpc.errors import RubError, StoppedEarly, StoreError, printable
from rubhpc.running.launch import FIRST_SPEAKS, launch, leave
from rubhpc.streams import lasting_streams
from rubhpc.threads import VARIABLES

# Words of click, and plain ones.
_PLAIN = {
    "a valid integer range": "a whole number",
    "a valid integer": "a whole number",
    "a valid float range": "a number",
    "a valid float": "a number",
}
# name -> (module and function in `rubhpc.commands`, what it does).
# The figure commands come from `postproc.catalogue`.
COMMANDS = {
    "run": ("run:run", "Run or resume a study; the word run may be omitted."),
    "plan": ("run:plan", "Cases, bytes, files, core-hours; done, failed and missing cases."),
    "compile": ("run:compile_kernels", "Compile the kernels of a study, before a large job."),
    "status": ("run:status", "Progress and failures, also during a run."),
    "verify": ("run:verify", "Check every stored case against its checksum."),
    "modes": ("modes:modes", "Natural frequencies, damping ratios and whirl of a rig; Campbell diagram."),
    "whirl": ("whirl:whirl", "Dry whirl and whip that can exist in the bores of a rig, from receptances."),
    "knock": ("knock:knock", "The least knock that leads to sustained rub, over the speed."),
    "reduce": ("reduce:reduce", "Mean, envelope, quantiles or histogram over many cases."),
    "report": ("report:report", "One HTML page: maps, and every case behind them."),
    "view": ("report:view", "The same for a large store, served to this machine only."),
    "export": ("export:export", "Cases as one file: HDF5, CSV or Parquet."),
    "dataset": ("dataset:dataset", "Labelled windows through sensors, for machine learning."),
    "identify": ("identify:identify", "The rub behind a measured vibration, as a posterior."),
    "calibrate": ("calibrate:calibrate", "Whether identification is right as often as it says."),
    "claims": ("claims:claims", "The paper's claims against the stores of jobs/paper."),
}


class _Commands(click.Group):
    """A group whose commands are imported when called; a word that is no command is a study to be run."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*COMMANDS, *figures()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if figure := figures().get(cmd_name):
            from rubhpc.commands.figures import figure_command

            return figure_command(figure)
        if cmd_name not in COMMANDS:
            return None
        module, _, name = COMMANDS[cmd_name][0].partition(":")
        command: click.Command = getattr(import_module(f"rubhpc.commands.{module}"), name)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])
        with formatter.section("Figures"):
            formatter.write_dl([(name, figure.summary) for name, figure in figures().items()])

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args:
            raise click.UsageError("nothing to do; give a STUDY.toml or a command, see rubhpc --help")
        commands = self.list_commands(ctx)
        if args[0] not in (*commands, "--help", "-h", "--version"):
            _check_word(args[0], commands)
            args = ["run", *args]
        return super().parse_args(ctx, args)


def _check_word(word: str, commands: list[str]) -> None:
    """Raise UsageError for a mistyped command, which is neither a file nor the name of one."""
    if word.startswith("-") or "." in word or "/" in word or os.path.exists(word):
        return
    near = difflib.get_close_matches(word, commands, n=1)
    hint = f"did you mean {near[0]}?" if near else "see rubhpc --help"
    raise click.UsageError(f"{word}: no such command or study; {hint}")


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    options_metavar="",
    subcommand_metavar="STUDY.toml | COMMAND [ARGS]...",
)
@click.version_option(__version__, prog_name="rubhpc", message="%(prog)s %(version)s")
def commands() -> None:
    """Run parameter studies of rotor-stator rub, and draw their results.

    `mpirun -n N rubhpc STUDY.toml` runs a study on N ranks; the same command continues it after a stop.

    Exit codes: 0 complete; 1 finished, some cases failed; 2 bad input or output; 3 store cannot be used;
    70 an internal error; 71 complete, but a rank was lost; 75 stopped early, run the same command again.
    """


def main(args: list[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    for name in (*VARIABLES, SAFE_PATH):
        os.environ[name] = "1"
    given = sys.argv[1:] if args is None else args
    with lasting_streams() as problem:
        code = _code_of(given)
        if problem():
            code = _report(
                f"standard output: {problem()}; what was printed is incomplete, write it to another place",
                code or (2 if _prints_results(given) else 0),
            )
        if code:  # Python would report each read that the error has cut short
            logging.getLogger("asyncio").setLevel(logging.CRITICAL)
            atexit.register(_end_quietly)
        leave(code)


def _end_quietly() -> None:
    warnings.simplefilter("ignore")
    sys.unraisablehook = lambda _: None


def _code_of(args: list[str]) -> int:
    """Run the command line and report its error; returns the exit code."""
    try:
        return commands.main(args, prog_name="rubhpc", standalone_mode=False) or 0
    except RubError as error:
        return _report(str(error), error.exit_code)
    except click.ClickException as error:
        return _report(_one_line(error), 2)
    except (KeyboardInterrupt, click.Abort):
        return _report("interrupted; run the same command again", StoppedEarly.exit_code)
    except BaseException as error:  # SystemExit of a user's code included: the command has not ended
        from rubhpc.running.ending import crash

        crashed = crash(error)
        if isinstance(error, Exception) and _evaluates_store(args):
            return _report(f"{crashed}, unless rubhpc verify finds damage", StoreError.exit_code)
        return _report(str(crashed), crashed.exit_code)


def _evaluates_store(args: list[str]) -> bool:
    """Whether a command draws or writes what a store says, which may come from anybody and say anything."""
    return not {"reduce", "report", "view", "export", "dataset", *figures()}.isdisjoint(args[:1])


def _prints_results(args: list[str]) -> bool:
    """Whether what a command prints is its result; a run and a search for knocks have it in files."""
    printing = {"--help", "-h", "--version", *COMMANDS, *figures()} - {"run", "knock"}
    return not printing.isdisjoint(args[:1])


def _report(text: str, code: int) -> int:
    """Print an error in one line, on the first rank only; the others wait for it."""
    if launch().rank == 0:
        print(f"rubhpc: {printable(' '.join(text.split()))}", file=sys.stderr)
    else:
        time.sleep(FIRST_SPEAKS)
    return code


def _one_line(error: click.ClickException) -> str:
    text = error.format_message()
    for words, plain in _PLAIN.items():
        text = text.replace(words, plain)
    if isinstance(error, click.UsageError) and error.ctx is not None:
        text = f"{text.rstrip('.')}; see {error.ctx.command_path} --help"
    return text
