"""Parts that are installed by choice: where one is missing, one line says which extra brings it."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from hicp_lib.core.errors import InputError


class MissingPartError(InputError, ImportError):
    """A package is needed that comes with an extra of the distribution."""


@contextmanager
def needs(extra: str) -> Iterator[None]:
    """Around imports: a package that is not installed is told with the extra that brings it.

    Raises
    ------
    MissingPartError
        In place of the `ModuleNotFoundError`.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise _missing(str(error.name), extra) from None


def require(extra: str, *modules: str) -> None:
    """At the head of a package: refuse early, without the time that importing `modules` takes.

    Raises
    ------
    MissingPartError
        If one of them is not installed.
    """
    for module in modules:
        if find_spec(module) is None:
            raise _missing(module, extra)


def _missing(module: str, extra: str) -> MissingPartError:
    return MissingPartError(
        f"{module} is not installed, and this needs it; in hicp's checkout run: pip install '.[{extra}]'"
    )
