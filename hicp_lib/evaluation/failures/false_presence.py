"""Parts of people that are outside the picture, and that a detector gives inside it all the same."""

import numpy as np
import pandas as pd

from hicp_lib.core.keypoints import COCO_17
from hicp_lib.datasets.crops import with_outside
from hicp_lib.evaluation.ap.extended_oks import PRESENCE_CUT
from hicp_lib.evaluation.cases import Found, Truth, labelled
from hicp_lib.evaluation.failures.false_confidence import SURE
from hicp_lib.evaluation.failures.placed_keypoints import landed, placed_keypoints
from hicp_lib.evaluation.failures.presence import PART_OF, Presence, declared
from hicp_lib.evaluation.statistics.proportions import proportions
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import Annotations, source_images

# What counts as given: the paper's threshold on scores as they come, or on what they are worth.
DECISIONS = (f"score of at least {SURE}", f"calibrated score of at least {PRESENCE_CUT}")
_FIRST_OF_PAIRS = 5  # the keypoints before are the head's


def false_presence(
    truth: Truth, found: Found, placed: pd.DataFrame, source: Annotations, draws: Draws = Draws()
) -> pd.DataFrame:
    """How often parts of people that are outside the picture are given inside it.

    A head is outside when no keypoint of it is in the picture and one is known to be outside, and it is given
    when one of its keypoints is. All other parts are one keypoint each, on either side.

    Parameters
    ----------
    truth : Truth
        Of crops, by subset.
    found : Found
        By image id, of every subset and detector.
    placed : DataFrame
        `placed_keypoints.placed_keypoints` of them.
    source : Annotations
        What the crops were made from.
    draws : Draws, optional
        Of the bootstrap; its seed draws the halves too.

    Returns
    -------
    DataFrame
        Columns `subset, detector, part` (of `PARTS`), `decision` (of `DECISIONS`), `value` (share of the
        parts outside), `low, high` (95 %, over source images), `n` (parts outside), `n_images, n_found`
        (those of people whom a detection fits; of the others none is given).
    """
    calibrated = declared(truth, found, Presence.fit(placed, draws.seed))
    kinds = {SURE: placed, PRESENCE_CUT: placed_keypoints(truth, calibrated, source)}
    missing = {subset: _missing(with_outside(people, source)) for subset, people in truth.items()}
    keys = ["subset", "detector", "image_id", "unit"]
    rows = []
    for decision, (cut, table) in zip(DECISIONS, kinds.items(), strict=True):
        is_given = (table["score"] >= cut) & (landed(table) != "outside")
        table = table.assign(unit=np.maximum(table["keypoint"] - _FIRST_OF_PAIRS + 1, 0), given=is_given)
        given = table.groupby(keys)["given"].any().reset_index()
        for subset, detector in found:
            labels = {"subset": subset, "detector": detector, "decision": decision}
            rows.append(labelled(missing[subset], **labels).merge(given, how="left", on=keys))
    parts = pd.concat(rows).assign(found=lambda t: t["given"].notna())
    parts["given"] = parts["given"].eq(True)
    by = ["subset", "detector", "part", "decision"]
    n_found = parts.groupby(by)["found"].sum().rename("n_found").reset_index()
    return proportions(parts, by, "given", draws).merge(n_found, on=by)


def _missing(people: Annotations) -> pd.DataFrame:
    """The parts that are outside the picture: columns `image_id, source_image, part, unit`."""
    people = people.take(~people.is_crowd)
    flags, sources = people.visibility[:, COCO_17], source_images(people)
    seen, gone = (
        np.column_stack([of[:, :_FIRST_OF_PAIRS].any(axis=1), of[:, _FIRST_OF_PAIRS:]])
        for of in (flags > 0, flags < 0)
    )
    who, unit = np.nonzero(gone & ~seen)
    image_ids = people.image_ids[who].tolist()
    of_image = {"image_id": image_ids, "source_image": [sources[i] for i in image_ids]}
    return pd.DataFrame(of_image | {"part": PART_OF[_FIRST_OF_PAIRS - 1 :][unit], "unit": unit})
