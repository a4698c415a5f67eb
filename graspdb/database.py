"""A database, open for reading: one consistent snapshot and the questions it answers."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import pyarrow as pa

from graspdb.grasp import Grasp, read_grasp
from graspdb.holdings import Info, read_info
from graspdb.store.history import AsOf, Change, read_history
from graspdb.store.location import location
from graspdb.store.snapshot import Snapshot, take_snapshot
from graspdb_queries.named import named_query
from graspdb_queries.quoting import identifier
from graspdb_queries.result import Result
from graspdb_schemas.conform import conform
from graspdb_schemas.errors import ParameterError, nearest
from graspdb_schemas.tables import TABLES

if TYPE_CHECKING:
    from graspdb.export.run import ExportReport, Progress
    from graspdb_queries.engine import Engine, Stream
    from graspdb_queries.similar.answer import Similar
    from graspdb_queries.similar.placed import GraspsOn
    from graspdb_queries.similar.search import Search


class Database:
    """One state of a database, which no writer changes.

    Parameters
    ----------
    path : str or path
        The database's folder, or its URL in object storage: ``s3://bucket/folder``.
    as_of : int or datetime, optional
        A version that ``graspdb info --history`` names, or a time, for the state that there was then; the
        latest unless given. A time without a zone is local.

    Attributes
    ----------
    path : Path or ObjectStorage
        Where the database is.
    snapshot : Snapshot
        The pinned version of every table.

    Raises
    ------
    DatabaseError
        The folder is no database, one of a newer format, or damaged; or the earlier state is no longer kept.
    ParameterError
        There was no such state.
    """

    def __init__(self, path: str | PathLike[str], *, as_of: AsOf | None = None) -> None:
        self.path = location(path)
        self.snapshot: Snapshot = take_snapshot(self.path, as_of)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the database."""
        self.close()

    def close(self) -> None:
        """Give back what queries hold in memory; the next one takes it anew."""
        if "_engine" in self.__dict__:
            self._engine.close()
            del self._engine
            self.__dict__.pop("_search", None)

    def session(self, name: str) -> "Database":
        """Return this state of the database with the rows of one session alone, as a database of its own.

        Raises
        ------
        QueryError
            There is no such session; the message names those there are.
        """
        from graspdb.kept_trials import keep_session

        part = copy(self)
        for cached in ("_engine", "_search"):
            part.__dict__.pop(cached, None)
        part.snapshot = replace(
            self.snapshot, sources=keep_session(self._engine, self.snapshot.sources, name)
        )
        return part

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables."""
        return tuple(TABLES)

    def table(self, name: str) -> pa.Table:
        """Return all rows of a table, with unit and documentation in the metadata of its fields.

        Raises
        ------
        ParameterError
            There is no such table.
        """
        if name not in TABLES:
            raise ParameterError("table", name, ", ".join(TABLES) + nearest(name, list(TABLES)))
        return conform(self.sql(f"SELECT * FROM {identifier(name)}").table, TABLES[name], name)

    def sql(self, statement: str, /, **parameters: Any) -> Result:
        """Answer one SELECT statement of DuckDB's SQL.

        Parameters
        ----------
        statement : str
            The statement; parameters are written ``$name``.
        **parameters
            A value for each parameter.

        Raises
        ------
        QueryError
            The statement is not a SELECT, is wrong, or tries to leave the database.
        ParameterError
            A parameter is missing or unknown.
        """
        return self._engine.sql(statement, parameters)

    def stream(self, statement: str, /, **parameters: Any) -> "Stream":
        """Answer one SELECT statement batch by batch, in bounded memory; see `sql`."""
        return self._engine.stream(statement, parameters)

    def query(self, name: str, /, **parameters: Any) -> Result:
        """Answer a named query; ``graspdb query --list`` tells which there are.

        Raises
        ------
        ParameterError
            There is no such query, or a parameter is unknown, missing, of the wrong kind or out of range.
        QueryError
            What the database holds does not allow an answer.
        """
        return named_query(name).run(self._engine, parameters)

    def check_filter(self, where: str) -> None:
        """Check that a text is one boolean SQL expression over the columns of `grasps`.

        Raises
        ------
        QueryError
            It is not.
        """
        from graspdb_queries.similar.where import check_filter

        check_filter(self._engine, where)

    def grasp(self, key: str) -> Grasp:
        """Return one grasp with its arrays.

        Raises
        ------
        QueryError
            There is no such grasp; the message names those with names like it.
        """
        return replace(read_grasp(self._engine, key), database=self)

    def export(
        self,
        form: str,
        out: str | PathLike[str],
        *,
        refuse_licences: Sequence[str] = (),
        progress: "Progress | None" = None,
        **options: Any,
    ) -> "ExportReport":
        """Write what a query selects in a form that other programs read; see ``graspdb export --list``.

        Parameters
        ----------
        form : str
            Name of the form, such as ``lerobot``; duckdb is a DuckDB file of views on the tables.
        out : str or path
            The folder, empty or not there yet; of duckdb the file. A folder in which the same export was
            interrupted is gone on with.
        refuse_licences : sequence of str
            Texts such as ``NC``: trials whose licence note has one of them in it are left out.
        progress : callable, optional
            Told how many episodes or grasps are done, and how many there are.
        **options
            Fields of `ExportOptions`: where, split, seed, and those that the form heeds.

        Raises
        ------
        ParameterError
            There is no such form, an option is not allowed, a text is empty, or so is a side of the split.
        QueryError
            The filter cannot be used or selects nothing; or the file is there already, or cannot be written.
        ExportError
            The folder is not empty, or nothing of what was selected can be exported.
        MissingLibraryError
            The form's library is not installed.
        """
        from graspdb.export.options import export_options
        from graspdb.export.run import ExportReport, run_export

        sources = self.snapshot.sources
        if refuse_licences:
            from graspdb.licences import without_licences

            sources = without_licences(self._engine, sources, refuse_licences)
        asked = export_options(options)
        if form == "duckdb":
            from graspdb_queries.duckdb_file import write_duckdb

            if asked.given():
                raise ParameterError("duckdb", ", ".join(asked.given()), "none of these options")
            write_duckdb(Path(out), sources)
            return ExportReport(form, Path(out))
        from graspdb_queries.engine import Engine

        with Engine(sources) as engine:
            return run_export(self, engine, form, Path(out), asked, refuse_licences, progress)

    def similar(
        self,
        grasp: str | None = None,
        /,
        k: int = 10,
        *,
        by: str = "feature",
        mode: str = "shape",
        posture: str = "scaled",
        where: str | None = None,
        cloud: str | PathLike[str] | None = None,
        scale: float = 1.0,
    ) -> "Similar":
        """Return the grasps most like one of the database, or most like a part from outside.

        Parameters
        ----------
        grasp : str
            Key of a grasp; or None, and `cloud` instead.
        k : int
            How many, at most.
        by : {'feature', 'posture', 'contact', 'all'}
            What is compared: the graspable feature, the posture, which sites touch where, or all of it.
        mode : {'shape', 'held'}
            Features in any pose, or as they lie in the hand.
        posture : {'scaled', 'metric', 'angles'}
            Postures by their sites, with hands brought to one size or not, or by joint angles.
        where : str, optional
            A boolean SQL expression over the columns of `grasps`; only those for which it is true count.
        cloud : path, optional
            A file with a part of an object, as a cloud or a mesh.
        scale : float
            Factor from the numbers of that file to metres.

        Raises
        ------
        QueryError
            There is no such grasp, it lacks what is compared, or the filter cannot be used.
        ObjectError
            The file holds no part of an object.
        ParameterError
            An argument is none of those allowed.
        """
        if (grasp is None) == (cloud is None):
            raise ParameterError("similar", "neither or both of a grasp and a cloud", "one of them")
        _check_count(k)
        from graspdb_queries.similar.question import Respect

        respect = Respect(by, mode, posture)
        if grasp is not None:
            return self._search.similar(self._search.question(grasp), respect, k, where)
        from graspdb.similar import part_question

        return self._search.similar(part_question(Path(str(cloud)), scale), respect, k, where)

    def similar_on(
        self,
        new_object: str | PathLike[str],
        /,
        k: int = 10,
        *,
        where: str | None = None,
        scale: float = 1.0,
    ) -> "GraspsOn":
        """Return where people would grasp a new object: grasps of the database, laid onto it.

        Parameters
        ----------
        new_object : path
            A file with the whole object, as a mesh or a cloud.
        k : int
            How many grasps, at most.
        where : str, optional
            A boolean SQL expression over the columns of `grasps`; only those for which it is true count.
        scale : float
            Factor from the numbers of the file to metres.

        Raises
        ------
        ObjectError
            The file holds no object, or its size says that the unit is wrong.
        QueryError
            The database has no features to compare, or the filter cannot be used.
        ParameterError
            `k` or `scale` is out of range.
        """
        _check_count(k)
        from graspdb.similar import KIND
        from graspdb.similar import new_object as read_object
        from graspdb_queries.similar.grasps_on import feature_sizes, grasps_on

        holdings = self._search.holdings
        feature_sizes(holdings, KIND, where)
        return grasps_on(holdings, read_object(Path(new_object), scale), k, where)

    def info(self) -> Info:
        """Return what the database holds.

        Raises
        ------
        DatabaseError
            A file is missing or damaged.
        """
        return read_info(self.snapshot)

    def history(self) -> tuple[Change, ...]:
        """Return the versions of the database whose log is kept, the latest first."""
        return read_history(self.path)

    @cached_property
    def _engine(self) -> "Engine":
        from graspdb_queries.engine import Engine

        return Engine(self.snapshot.sources)

    @cached_property
    def _search(self) -> "Search":
        from graspdb_queries.similar.search import Search

        return Search(self._engine)


_MOST_HITS = 1000


def _check_count(k: int) -> None:
    """Raise ParameterError unless so many hits may be asked for."""
    if not (isinstance(k, int) and 1 <= k <= _MOST_HITS):
        raise ParameterError("k", k, f"a whole number from 1 to {_MOST_HITS}")
