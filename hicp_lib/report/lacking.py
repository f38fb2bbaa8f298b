"""What a report does where the weights of a default detector are absent: the study goes on without it.

Weights that are fetched can be absent where there is no network. A notebook then runs on its other detectors;
one that is about the detector alone is left out, and its page says why. What a user asked for by name is not
dropped: its notebook fails, and says what is missing.
"""

from collections.abc import Collection
from typing import Any

from hicp_lib.detectors.registry import COMBINED
from hicp_lib.detectors.weights.default import registry


def absent_weights(detector: str) -> list[str]:
    """Names of the weight files that a detector, or a part of a combination, needs and that are not there.

    Examples
    --------
    >>> absent_weights("movenet-thunder"), absent_weights("no detector")
    ([], [])
    """
    parts = set(detector.removeprefix(COMBINED).split("+"))
    return [
        weight.name
        for weight in registry().values()
        if parts & set(weight.used_by) and not weight.path.is_file()
    ]


def without_absent(
    parameters: dict[str, Any], asked_for: Collection[str] = ()
) -> tuple[dict[str, Any], set[str], bool]:
    """A notebook's parameters without detectors whose weights are absent.

    Parameters
    ----------
    parameters : dict of str to object
    asked_for : list of str
        Names of parameters that a user set, which stay as they are.

    Returns
    -------
    parameters : dict of str to object
    dropped : set of str
        Detectors whose weights are absent.
    can_run : bool
        False where no detector is left in a list, or a single one is absent that no list offers.
    """
    kept, dropped, can_run = dict(parameters), set(), True
    for name, value in parameters.items():
        if isinstance(value, list) and name not in asked_for:
            absent = {one for one in value if isinstance(one, str) and absent_weights(one)}
            kept[name] = [one for one in value if not (isinstance(one, str) and one in absent)]
            dropped |= absent
            can_run &= bool(kept[name]) or not absent
    for name, value in parameters.items():
        if isinstance(value, str) and name not in asked_for and absent_weights(value):
            offered = [key for key, one in parameters.items() if isinstance(one, list) and value in one]
            dropped.add(value)
            can_run &= bool(offered)
            kept[name] = next((kept[key][0] for key in offered if kept[key]), value)
    return kept, dropped, can_run
