"""Orders of key points: every one of them comes back, and what is none is named."""

import numpy as np
import pytest

from graspdb_ingest.importers.order import ORDERS, in_usual_order, key_point_names
from graspdb_schemas.errors import ParameterError
from graspdb_schemas.vocabulary import KEY_POINTS


@pytest.mark.parametrize("order", [*ORDERS, ",".join(reversed(KEY_POINTS))])
def test_each_point_goes_to_its_place(order: str) -> None:
    names = key_point_names(order)
    assert sorted(names) == sorted(KEY_POINTS)
    place = {name: np.full(3, KEY_POINTS.index(name)) for name in KEY_POINTS}
    given = np.array([[place[name] for name in names]], dtype=float)
    assert np.array_equal(in_usual_order(given, order)[0, :, 0], np.arange(21))


def test_mano_has_the_index_first_the_thumb_last_and_the_tips_behind() -> None:
    names = key_point_names("mano")
    assert names[1:4] == ("index_mcp", "index_pip", "index_dip")
    assert names[7] == "little_mcp"
    assert names[13:17] == ("thumb_cmc", "thumb_mcp", "thumb_ip", "thumb_tip")
    assert names[20] == "little_tip"


@pytest.mark.parametrize(
    ("order", "said"),
    [
        ("man0", "mano"),
        (",".join((*KEY_POINTS[:-1], "little_tipp")), "little_tip"),
        (",".join((*KEY_POINTS[:-1], "wrist")), "wrist 2 times|little_tip 0 times"),
        (",".join(KEY_POINTS[:-1]), "little_tip 0 times"),
    ],
)
def test_what_is_no_order_is_named(order: str, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        key_point_names(order)


def test_other_numbers_of_points_are_refused() -> None:
    with pytest.raises(ParameterError, match="21"):
        in_usual_order(np.zeros((2, 20, 3)), "usual")
