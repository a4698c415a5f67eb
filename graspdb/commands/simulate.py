"""`graspdb simulate`: recordings of grasping with known truth."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from graspdb.commands.options import Json


class ExperimentName(StrEnum):
    """Which of the paper's experiments."""

    OBJECTS = "objects"
    FORCE_PANELS = "force_panels"


def simulate(
    directory: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder to write; empty or not there yet.")
    ],
    subjects: Annotated[int, typer.Option(help="Number of people.")] = 3,
    trials: Annotated[int, typer.Option(help="Trials for each subject, object and kind of grasp.")] = 1,
    seed: Annotated[int, typer.Option(help="The same seed gives the same files, byte for byte.")] = 0,
    experiment: Annotated[
        ExperimentName, typer.Option(help="Bottle, mug and milk jug; or an inverted T with force panels.")
    ] = ExperimentName.OBJECTS,
    noise_mm: Annotated[float, typer.Option(help="White noise of each marker and axis, sd [mm].")] = 0.5,
    skin_mm: Annotated[
        float, typer.Option(help="Skin movement in each direction of the skin, sd [mm].")
    ] = 1.0,
    occlusion: Annotated[float, typer.Option(help="Share of marker positions not seen, in bursts.")] = 0.03,
    swaps: Annotated[
        float, typer.Option(help="Mean number of swapped stretches of labels in a trial.")
    ] = 0.0,
    rate: Annotated[float, typer.Option(help="Frames per second [Hz].")] = 120.0,
    gloves: Annotated[bool, typer.Option("--gloves", help="Let the hands wear data gloves.")] = False,
    proportion_sd: Annotated[
        float, typer.Option(help="Relative spread of bone lengths about the usual proportions, sd.")
    ] = 0.0,
    as_json: Json = False,
) -> None:
    """Simulate a session of reaching, grasping and lifting, with the truth in DIR/truth."""
    from graspdb.simulate import NoiseParameters, simulate_session

    noise = NoiseParameters(
        marker_sd=noise_mm / 1000, skin_sd=skin_mm / 1000, occlusion=occlusion, swaps=swaps
    )
    session = simulate_session(
        directory,
        subjects=subjects,
        trials=trials,
        seed=seed,
        experiment=experiment.value,
        noise=noise,
        rate=rate,
        gloves=gloves,
        proportion_sd=proportion_sd,
    )
    if as_json:
        import json

        typer.echo(json.dumps({"session": str(session.path), "trials": list(session.trials)}))
        return
    people = len(session.truth.subjects)
    objects = sorted({trial.object for trial in session.truth.trials.values()})
    typer.echo(
        f"{session.path}: {len(session.trials)} trials, {people} subjects, objects {', '.join(objects)}"
    )
