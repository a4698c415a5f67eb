"""What a notebook shows of a grasp and of an answer."""

import base64
import io
import pickle
import re
from pathlib import Path

import held_can
import numpy as np
import pyarrow as pa
import pytest
from PIL import Image

import graspdb
from graspdb_queries.result import SHOWN_ROWS, Result


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return held_can.build(tmp_path_factory.mktemp("held") / "grasps")


def test_a_grasp_shows_a_picture_and_its_names_as_text(database: Path) -> None:
    with graspdb.open(database) as db:
        shown = db.grasp(held_can.NAMED)._repr_html_()
    (encoded,) = re.findall(r'src="data:image/png;base64,([^"]+)"', shown)
    with Image.open(io.BytesIO(base64.b64decode(encoded))) as image:
        assert len(np.unique(np.asarray(image).reshape(-1, 4), axis=0)) > 200
    assert "made/&lt;script&gt;alert(1)&lt;/script&gt;/right/0" in shown
    assert "&lt;img src=x onerror=" in shown
    assert "<script" not in shown
    assert shown.count("<img") == 1


def test_a_grasp_without_its_database_shows_facts_alone(database: Path) -> None:
    with graspdb.open(database) as db:
        grasp = db.grasp(held_can.LIFTED)
        copy = pickle.loads(pickle.dumps(grasp))
    assert copy.database is None
    assert copy.id == grasp.id
    shown = copy._repr_html_()
    assert "<img" not in shown
    assert "right hand" in shown


def test_an_answer_shows_its_first_rows_as_text() -> None:
    rows = SHOWN_ROWS + 5
    table = pa.table({"<b>name</b>": ["<i>x</i>"] * rows, "value": [1 / 3] * rows, "none": [None] * rows})
    shown = Result(table)._repr_html_()
    assert "<th>&lt;b&gt;name&lt;/b&gt;</th>" in shown
    assert shown.count("&lt;i&gt;x&lt;/i&gt;") == SHOWN_ROWS
    assert "0.333333" in shown
    assert f"{rows} rows, the first {SHOWN_ROWS} are shown" in shown
    assert "1 row<" in Result(table.slice(0, 1))._repr_html_()


def test_similar_grasps_show_themselves_as_their_table(database: Path) -> None:
    with graspdb.open(database) as db:
        found = db.similar(held_can.LIFTED, by="posture")
    assert found._repr_html_() == found.table()._repr_html_()
