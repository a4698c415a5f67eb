"""The command line: ``graspdb COMMAND``."""

import os
import signal
import sys
from typing import Annotated, Final

import typer

from graspdb.commands.check import check
from graspdb.commands.demo import demo
from graspdb.commands.explore import explore
from graspdb.commands.export import export
from graspdb.commands.figure import figure
from graspdb.commands.hand import hand
from graspdb.commands.import_ import import_
from graspdb.commands.info import info
from graspdb.commands.ingest import ingest
from graspdb.commands.optimize import optimize
from graspdb.commands.query import query
from graspdb.commands.remove import remove
from graspdb.commands.report import report
from graspdb.commands.schema import schema
from graspdb.commands.similar import similar
from graspdb.commands.simulate import simulate
from graspdb.commands.sql import sql
from graspdb.commands.validate import validate
from graspdb.commands.verify import verify
from graspdb.commands.view import view
from graspdb_schemas.errors import GraspDBError

app = typer.Typer(
    name="graspdb",
    help="Grasp databases: built from motion capture of hand and object, asked in SQL.",
    # Help as plain text: making it with rich takes longer than all the rest of the start.
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"max_content_width": 100},
)

app.command()(demo)
app.command()(simulate)
app.command()(check)
app.command()(ingest)
app.command("import")(import_)
app.command()(info)
app.command()(schema)
app.command()(sql)
app.command()(query)
app.command()(similar)
app.command()(report)
app.command()(explore)
app.command()(view)
app.add_typer(figure)
app.command()(export)
app.command()(hand)
app.add_typer(validate)
app.command()(verify)
app.command()(optimize)
app.command()(remove)

_FAILURE: Final = 1
_INTERRUPTED: Final = 128 + signal.SIGINT


@app.callback(invoke_without_command=True)
def _graspdb(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    """Grasp databases: built from motion capture of hand and object, asked in SQL."""
    if version:
        import graspdb

        typer.echo(f"graspdb {graspdb.__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        raise typer.Exit(2)


def main() -> None:
    """Run the command line and exit: 0, 1 for a failure, 2 for wrong usage, 130 when interrupted.

    What a user can cause is said in one message on standard error, without a traceback.
    """
    status = _run()
    if status == _INTERRUPTED:
        # What was interrupted is not taken apart in order, of which libraries complain at length.
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)


def _run() -> int:
    """Run the command line and return the status to exit with."""
    try:
        app(prog_name="graspdb")
    except SystemExit as done:
        return done.code if isinstance(done.code, int) else 0
    except GraspDBError as error:
        return _fail(str(error))
    except KeyboardInterrupt:
        return _INTERRUPTED
    except BrokenPipeError:
        # Whoever read the answer has seen enough; keep Python from complaining when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _FAILURE
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _fail(f"{where}{error.strerror or error}")
    return 0


def _fail(message: str) -> int:
    """Say what went wrong and return the status of a failure."""
    print(f"graspdb: {message}", file=sys.stderr)
    return _FAILURE
