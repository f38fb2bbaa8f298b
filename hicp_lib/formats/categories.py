"""Which objects of a COCO file are people: by the name of their category, whatever its number."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hicp_lib.core.errors import InputError
from hicp_lib.formats.json_validation import Rows, shown

PERSON_CATEGORY = 1  # where a file does not name its categories
_PEOPLE = ("person", "persons", "people", "human", "humans", "pedestrian")


@dataclass(frozen=True)
class PersonCategory:
    """The category of people.

    Attributes
    ----------
    id : int
        What objects name it by.
    keypoints : list of str
        Its keypoints' names; none where the file does not give them.
    others : dict of int to str
        The file's other categories, by id.
    """

    id: int = PERSON_CATEGORY
    keypoints: tuple[str, ...] = ()
    others: tuple[tuple[int, str], ...] = ()


def person_category(path: Path, value: Any) -> PersonCategory:
    """Find the people among a file's categories.

    Parameters
    ----------
    path : Path
        The file, for messages.
    value : Any
        What it has as `categories`; None or an empty list means people only, as category 1.

    Returns
    -------
    PersonCategory

    Raises
    ------
    InputError
        If no category, or more than one, is of people, or one is malformed.
    """
    if value is None or value == []:
        return PersonCategory()
    rows = Rows.of(path, "categories", value)
    ids = rows.unique_integers("id").tolist()
    unnamed = {"default": _PEOPLE[0]} if len(ids) == 1 else {}
    names = rows.column("name", lambda name: isinstance(name, str), "a name", **unnamed)
    keypoints = rows.column("keypoints", _are_names, "a list of names", default=None)
    people = [i for i, name in enumerate(names) if name.strip().lower() in _PEOPLE]
    people = [i for i in people if keypoints[i]] or people
    if len(people) != 1:
        which = "several categories" if people else "none of its categories"
        raise InputError(
            f"{path}: {which} ({', '.join(map(repr, names))}) can be people; name the one 'person'"
        )
    others = tuple((ids[i], name) for i, name in enumerate(names) if i != people[0])
    return PersonCategory(ids[people[0]], tuple(keypoints[people[0]] or ()), others)


def _are_names(value: Any) -> bool:
    return value is None or isinstance(value, list) and all(isinstance(name, str) for name in value)


def people_of(rows: Rows, category: PersonCategory) -> tuple[Rows, str]:
    """The objects that are people, and what is left out in words (empty if nothing).

    Parameters
    ----------
    rows : Rows
        All objects of a file.
    category : PersonCategory
        Of people. Objects that name no category are theirs where there is no other.

    Returns
    -------
    people : Rows
    note : str

    Raises
    ------
    InputError
        For a category that the file does not have.
    """
    others = dict(category.others)
    default: dict = {} if others else {"default": category.id}
    chosen = []
    left: dict[str, int] = {}
    for i, of in enumerate(rows.column("category_id", **default)):
        if type(of) is not int or of != category.id and of not in others:
            known = ", ".join(map(str, (category.id, *others)))
            raise rows.error(i, f"category_id is {shown(of)}; the file's categories are {known}")
        if of == category.id:
            chosen.append(i)
        else:
            left[others[of]] = left.get(others[of], 0) + 1
    if not left:
        return rows, ""
    counts = ", ".join(f"{name!r} {n}" for name, n in left.items())
    return rows.take(chosen), f"objects of other categories left out: {counts}"
