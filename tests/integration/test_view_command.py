"""``graspdb view`` and ``graspdb figure``: files that others open, and what is said where that cannot be."""

import json
import sys
from pathlib import Path

import held_can
import pytest
import worked_example
from handmade import session_tables, trial_tables
from PIL import Image
from typer.testing import CliRunner

from graspdb.cli import app
from graspdb.output import OutputError
from graspdb.store import Store
from graspdb.view.payload import json_for_script
from graspdb_schemas.errors import MissingLibraryError, ParameterError, QueryError

KINDS = {
    "grid": ["grid", "--where", "task LIKE 'lift%'"],
    "timelines": ["timelines", held_can.LIFTED],
    "contact-density": ["contact-density", held_can.CAN],
}


@pytest.fixture(scope="module")
def cans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return held_can.build(tmp_path_factory.mktemp("held") / "grasps")


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("example") / "grasps"
    worked_example.build(folder)
    return folder


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a database of two subjects whose centres of pressure were measured."""
    store = Store.create_or_open(folder := tmp_path_factory.mktemp("pressed") / "grasps")
    store.commit_session(session_tables())
    store.commit_trials([trial_tables(0), trial_tables(1, subject="ben", sites=("thumb_ip", "index_tip"))])
    return folder


def run(*arguments: str | Path) -> str:
    done = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_is_a_png_of_the_size_of_a_column_or_a_page(cans: Path, tmp_path: Path, kind: str) -> None:
    path = tmp_path / "figure.png"
    assert f"Wrote {path}" in run("figure", *KINDS[kind], "-o", path, "--db", cans)
    with Image.open(path) as image:
        assert image.width == pytest.approx(85 / 25.4 * 300, abs=2) or image.width == pytest.approx(
            178 / 25.4 * 300, abs=2
        )
        assert len(image.convert("RGB").quantize(64).getcolors()) > 10
    assert list(tmp_path.iterdir()) == [path]


def test_a_figure_of_numbers_alone_needs_no_hand(example: Path, tmp_path: Path) -> None:
    path = tmp_path / "figure.svg"
    run("figure", "synergies", "-o", path, "--db", example)
    assert path.read_text().startswith("<?xml")


def test_table_1_has_the_numbers_of_the_query(pressed: Path, tmp_path: Path) -> None:
    run("figure", "table-1", "-o", tmp_path / "table.svg", "--db", pressed)
    text = (tmp_path / "table.svg").read_text()
    report = json.loads(run("validate", "contacts", "--json", "--db", pressed))
    assert {row["subject"] for row in report} == {"anna", "ben"}
    for row in report:
        assert f"{row['all_points']['mean_mm']:.1f}" in text
        assert row["subject"] in text


def test_an_svg_keeps_names_as_text_and_a_pdf_is_one(cans: Path, tmp_path: Path) -> None:
    svg, pdf = tmp_path / "named.svg", tmp_path / "named.PDF"
    run("figure", "snapshot", held_can.NAMED, "-o", svg, "--db", cans)
    assert "made/&lt;script&gt;alert(1)&lt;/script&gt;/right/0" in svg.read_text()
    assert "<script>" not in svg.read_text()
    run("figure", "timelines", held_can.LIFTED, "-o", pdf, "--db", cans)
    assert pdf.read_bytes().startswith(b"%PDF-")


def test_the_same_figure_gives_the_same_file(cans: Path, tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.svg" for name in "ab"]
    for path in paths:
        run("figure", "timelines", held_can.LIFTED, "-o", path, "--db", cans)
    assert paths[0].read_bytes() == paths[1].read_bytes()


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        (
            ["figure", "snapshot", held_can.LIFTED, "-o", "out.gif"],
            ParameterError,
            "ends in .png, .svg, .pdf",
        ),
        (["figure", "snapshot", "nothing", "-o", "out.png"], QueryError, "no grasp 'nothing'"),
        (["figure", "timelines", held_can.NAMED, "-o", "out.png"], QueryError, "one instant, without frames"),
        (["figure", "contact-density", "cup", "-o", "out.png"], QueryError, "no grasp of an object 'cup'"),
        (["figure", "grid", "--where", "subject = 'x'", "-o", "out.png"], QueryError, "no grasp passes"),
        (["figure", "grid", "--where", "subjct = 'x'", "-o", "out.png"], QueryError, "subjct"),
        (["figure", "table-1", "-o", "out.png"], QueryError, "reference_contacts"),
        (["figure", "synergies", "-o", "out.png"], QueryError, "posture"),
        (["view", held_can.LIFTED, held_can.LIFTED, "-o", "out.html"], ParameterError, "another one"),
        (["view", "nothing", "-o", "out.html"], QueryError, "no grasp 'nothing'"),
        (["view", held_can.LIFTED, "nothing", "-o", "out.html"], QueryError, "no grasp 'nothing'"),
        (["view", held_can.LIFTED, "-o", "no/such/folder/out.html"], OutputError, "Name another file"),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, list) else None,
)
def test_what_cannot_be_drawn_is_said_and_nothing_is_left(
    cans: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    error: type[Exception],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, [*arguments, "--db", str(cans)])
    assert isinstance(done.exception, error)
    assert words in str(done.exception)
    assert not list(tmp_path.iterdir())


def test_without_matplotlib_the_extra_is_named(
    cans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    path = str(tmp_path / "out.png")
    done = CliRunner().invoke(app, ["figure", "snapshot", held_can.LIFTED, "-o", path, "--db", str(cans)])
    assert isinstance(done.exception, MissingLibraryError)
    assert "pip install 'graspdb[figures]'" in str(done.exception)


def test_a_page_needs_nothing_but_itself(cans: Path, tmp_path: Path) -> None:
    path = tmp_path / "grasp.html"
    assert f"Wrote {path}" in run("view", held_can.NAMED, "-o", path, "--db", cans)
    text = path.read_text(encoding="utf-8")
    assert "The MIT License" in text
    assert "three.js authors" in text
    assert text.count("<script") == text.count("</script>") == 3
    assert "alert(1)</script>" not in text
    assert "\u2028" not in text.partition('id="data">')[2]


@pytest.mark.parametrize("text", ["</script>", "<!--", "]]>", "\u2028\u2029", "&amp;", '"\\', "\x00"])
def test_no_text_leaves_its_script_element(text: str) -> None:
    written = json_for_script({"name": text})
    assert not set("<>&\u2028\u2029\x00") & set(written)
    assert json.loads(written) == {"name": text}
