"""Optional parts: if one is missing, one line says which extra installs it."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from hicp_lib.core.errors import InputError


class MissingPartError(InputError, ImportError):
    """A package is needed that comes with an extra of the distribution."""


@contextmanager
def needs(extra: str) -> Iterator[None]:
    """Around imports: if a package is missing, the error names the extra that installs it.

    Raises
    ------
    MissingPartError
        In place of the `ModuleNotFoundError`.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        remedy = f"in hicp's checkout run: pip install '.[{extra}]'"
        raise MissingPartError(f"{error.name} is not installed, and this needs it; {remedy}") from None


def require(extra: str, *modules: str) -> None:
    """At the top of a package: fail early, without importing `modules`.

    Raises
    ------
    MissingPartError
        If one of them is not installed.
    """
    with needs(extra):
        for module in modules:
            if find_spec(module) is None:
                raise ModuleNotFoundError(name=module)
