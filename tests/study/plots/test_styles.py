"""The looks of what is named in figures: one for every name that can occur."""

from hicp_lib.evaluation.failures.error_kinds import KINDS
from hicp_lib.evaluation.failures.placed_keypoints import STATES
from hicp_lib.lifting.robust import METHODS
from hicp_lib.study.claims.verdicts import VERDICTS
from hicp_lib.study.photographs import PHOTOGRAPHED, RENDERED
from hicp_lib.study.plots.palette import STYLES


def test_every_name_has_its_look_in_the_order_of_drawing():
    names = {
        "verdicts": VERDICTS,
        "error_kinds": KINDS,
        "states": STATES[:3],
        "places": (RENDERED, PHOTOGRAPHED),
    }
    for what, expected in names.items():
        assert tuple(STYLES[what]) == tuple(expected)
    assert set(STYLES["liftings"]) == set(METHODS)
    for looks in STYLES.values():
        assert len({str(look) for look in looks.values()}) == len(looks)
