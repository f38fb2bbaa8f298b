"""What a file or a folder is, and what it needs to be used."""

from dataclasses import replace
from importlib import import_module
from pathlib import Path

from hicp_lib.core.errors import InputError
from hicp_lib.inspection.facts import Facts, under_name
from hicp_lib.inspection.kinds import Kind, identify


def inspect(path: str | Path) -> Facts:
    """Say what a file or a folder is, and what it needs to be used.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Facts
        With `problem` where the kind is known and the content cannot be used.

    Raises
    ------
    InputError
        If it cannot be read, or is of no kind that is known.
    """
    kind, path = identify(Path(path))
    try:
        facts = _describe(kind, path)
    except InputError as error:
        facts = Facts(problem=str(error).removeprefix(f"{path}: "))
    needs = {} if facts.problem else {**facts.needs}
    for command, needed in {} if facts.problem else kind.needs.items():
        needs[command] = f"{needed} {facts.needs.get(command, '')}".rstrip()
    return replace(facts, path=str(path), kind=facts.kind or kind.name, needs=needs)


def _describe(kind: Kind, path: Path) -> Facts:
    module, _, name = kind.describe.partition(".")
    describe = getattr(import_module(f"hicp_lib.inspection.{module}"), name)
    if path.is_dir() or path.suffix.lower() == kind.suffix or not kind.suffix:
        return describe(path, **kind.given)
    with under_name(path, f"file{kind.suffix}") as other:
        facts = describe(other, **kind.given)
    return replace(facts, notes=[*facts.notes, f"commands take it under a name that ends in {kind.suffix}"])
