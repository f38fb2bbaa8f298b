"""From limbs to people as OpenPose's released program joins them (the build for processors, version 1.7).

Its rules, followed to the letter where they look odd, too, since the program's people are wanted:

- A part without any partner in the image is a person of one part until a limb takes it up.
- A limb goes to the first person who has its first end, and overwrites who was at its second; otherwise it
  begins a person. People are never merged. (The build for graphics cards, which sorts the limbs of all
  kinds together, merges.)
- Limbs from shoulder to ear complete people and begin none; neither their scores nor their parts count.
- A person's score is the sum of its parts' and limbs' over the number of parts and limbs there could be.
- Feet do not count towards the fewest parts, and who has feet needs more than four other parts; if nobody
  is left, that is waived.

`hicp_lib.detectors.openpose.paf` joins by its own, simpler rules.
"""

from dataclasses import dataclass

import numpy as np

from hicp_lib.detectors.openpose.paf import Limb, PafOptions, PartModel, part_rows

_MOST_BESIDE_FEET = 4


@dataclass
class _Person:
    """Peaks by part, how many were counted, and the sum of parts' and limbs' scores."""

    peaks: dict[int, int]
    n_counted: int
    score: float


def join_as_released(
    peaks: list[np.ndarray], limbs: list[list[Limb]], model: PartModel, options: PafOptions
) -> tuple[np.ndarray, np.ndarray]:
    """People from the peaks of each part and the limbs of each pair.

    Parameters
    ----------
    peaks : list of array
        Of each part, shape (n, 3): x, y, value.
    limbs : list of list of tuple
        Of each pair, as `hicp_lib.detectors.openpose.paf.connect` gives them.
    model : PartModel
    options : PafOptions

    Returns
    -------
    parts : array, shape (n_people, n_parts, 3)
        x, y as in `peaks`, score; NaN, NaN, 0 if missing.
    scores : array, shape (n_people,)
    """
    people: list[_Person] = []
    for index, (a, b) in enumerate(model.pairs.tolist()):
        if not (len(peaks[a]) and len(peaks[b])):
            _begin_alone(people, a if len(peaks[a]) else b, peaks)
        elif index in model.completing:
            _complete(people, a, b, limbs[index])
        else:
            _extend(people, a, b, limbs[index], peaks)
    kept = _keep(people, model.uncounted, options) or _keep(people, frozenset(), options)
    parts = np.array([part_rows(person.peaks, peaks) for person in kept]).reshape(-1, model.n_parts, 3)
    n_terms = model.n_parts + len(model.pairs)
    return parts, np.array([person.score / n_terms for person in kept])


def _begin_alone(people: list[_Person], part: int, peaks: list[np.ndarray]) -> None:
    taken = {person.peaks.get(part) for person in people}
    people += [
        _Person({part: peak}, 1, value) for peak, value in enumerate(peaks[part][:, 2]) if peak not in taken
    ]


def _complete(people: list[_Person], a: int, b: int, limbs: list[Limb]) -> None:
    for start, end, _ in limbs:
        for person in people:
            if person.peaks.get(a) == start:
                person.peaks.setdefault(b, end)
            elif person.peaks.get(b) == end:
                person.peaks.setdefault(a, start)


def _extend(people: list[_Person], a: int, b: int, limbs: list[Limb], peaks: list[np.ndarray]) -> None:
    for start, end, score in limbs:
        person = next((person for person in people if person.peaks.get(a) == start), None)
        if person is None:
            person = _Person({a: start}, 1, peaks[a][start, 2])
            people.append(person)
        person.peaks[b] = end
        person.n_counted += 1
        person.score += peaks[b][end, 2] + score


def _keep(people: list[_Person], uncounted: frozenset[int], options: PafOptions) -> list[_Person]:
    kept = []
    for person in people:
        n_uncounted = len(person.peaks.keys() & uncounted)
        n = person.n_counted - n_uncounted
        if n_uncounted and n <= _MOST_BESIDE_FEET:
            continue
        if n >= options.min_parts and person.score / n >= options.min_score:
            kept.append(person)
    return kept
