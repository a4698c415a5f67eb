"""The command `graspdb simulate`."""

import json

import pytest
import typer
from typer.testing import CliRunner

from graspdb.commands.simulate import simulate
from graspdb.simulate import load_truth
from graspdb_schemas.errors import ParameterError

APP = typer.Typer()
APP.command()(simulate)


def test_it_writes_what_its_options_ask_for(tmp_path):
    folder = tmp_path / "session"
    options = "--subjects 1 --trials 1 --seed 5 --experiment force_panels --noise-mm 1.5 --skin-mm 0"
    options += " --occlusion 0.1 --swaps 2 --rate 30 --json"
    result = CliRunner().invoke(APP, [str(folder), *options.split()], catch_exceptions=False)
    assert result.exit_code == 0
    written = json.loads(result.stdout)
    truth = load_truth(folder)
    assert written == {"session": str(folder), "trials": list(truth.trials)}
    assert (truth.seed, truth.rate, truth.experiment) == (5, 30.0, "force_panels")
    assert truth.noise.marker_sd == pytest.approx(0.0015)
    assert (truth.noise.skin_sd, truth.noise.occlusion, truth.noise.swaps) == (0, 0.1, 2)


def test_a_folder_in_use_is_refused(tmp_path):
    (tmp_path / "old.c3d").write_text("")
    with pytest.raises(ParameterError, match="empty"):
        CliRunner().invoke(APP, [str(tmp_path)], catch_exceptions=False)
