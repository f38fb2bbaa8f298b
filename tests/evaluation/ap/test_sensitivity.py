"""What each choice of a definition moves."""

from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.evaluation.ap.sensitivity import sensitivity_table


def test_wholebody_sigmas_are_kinder_to_hands(scene):
    annotations, detections = scene(0)
    table = sensitivity_table(annotations, detections, "hand").set_index("changed")
    assert table.loc["default", "AP"] == evaluate(annotations, detections, "hand").AP
    assert table.loc["sigmas=wholebody", "AP"] > table.loc["default", "AP"]
    assert table.loc["sigmas=wholebody", "AP_change"] > 0 == table.loc["default", "AP_change"]
    changed = (
        "sigmas=wholebody labelled=visible area=box area=box53 unlabelled=drop absent=count others=count"
    )
    assert table.index.tolist() == ["default", *changed.split(), "score=person"]
    body = sensitivity_table(annotations, detections, "body").set_index("changed")
    assert body.loc["sigmas=wholebody", "AP_change"] == 0
