"""``graspdb hand``: the hand model as a file."""

from pathlib import Path
from typing import Annotated

import typer


def hand(
    output: Annotated[Path, typer.Argument(metavar="FILE", help="MJCF file to write, such as hand.xml.")],
    hand_length: Annotated[
        float, typer.Option(help="Wrist crease to tip of the middle finger [mm].")
    ] = 187.0,
    hand_breadth: Annotated[float, typer.Option(help="Breadth over the knuckles [mm].")] = 84.0,
    left: Annotated[bool, typer.Option("--left", help="A left hand.")] = False,
) -> None:
    """Write a hand of the given size as MJCF, which any MuJoCo viewer opens."""
    from graspdb_ingest.hand import HandDimensions, build_hand
    from graspdb_schemas.manifest_reader import BUILT_IN_MARKERS
    from graspdb_schemas.vocabulary import Side

    side = Side.LEFT if left else Side.RIGHT
    model = build_hand(HandDimensions(hand_length / 1000, hand_breadth / 1000), side, BUILT_IN_MARKERS)
    model.write(output)
    typer.echo(f"{output}: {side} hand, 29 degrees of freedom, 20 sites")
