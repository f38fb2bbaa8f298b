"""Pages of the book: Markdown templates that take every number, table and figure from result files.

In a page of `book/`, between double braces:

    value("02_evaluation_2d", "data_note")            a recorded value; "not run" when it is None
    rows("02_evaluation_2d", "head_loss_table")       a saved table's rows; what is missing is None
    figure("02_evaluation_2d", "precision_recall")    a saved figure with its caption and alt text
    stamp("02_evaluation_2d")                         what a notebook was made with, its `provenance.json`
    profile                                           "quick" or "full"
    notebooks                                         names of the notebooks that were run
    data("paper.json")                                a JSON file of `data/`, for loops over its rows
    label("combined:posenet+mediapipe-hands")         a detector's name in plain words
    repetition()                                      this run beside the profile's reference run

A name that no result file has stops the build. Texts are shown as they are, whatever is in them; what is
Markdown, as texts of `data` may be, says so: `data("paper.json").why | safe`.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd
from markupsafe import Markup

from hicp_lib.core.datafiles import DATA_DIR, REFERENCE_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.escape import escaped
from hicp_lib.core.files import read_json
from hicp_lib.detectors.registry import COMBINED, DETECTORS
from hicp_lib.report import repetition

NOT_RUN = "not run"


@dataclass(frozen=True)
class Results:
    """The result files of one profile, as the pages see them.

    Attributes
    ----------
    folder : Path
        Holds a folder of results per notebook.
    profile : str
        Its name, as in the book's links to files.
    """

    folder: Path
    profile: str

    def notebooks(self) -> list[str]:
        """Names of the notebooks that were run."""
        return sorted(path.parent.name for path in self.folder.glob("*/values.json"))

    def value(self, notebook: str, name: str) -> str:
        """A recorded value as text; "not run" when the notebook recorded None.

        Raises
        ------
        InputError
            If the notebook recorded no such value.
        """
        value = self.raw(notebook, name)
        return NOT_RUN if value is None else str(value)

    def raw(self, notebook: str, name: str) -> Any:
        """A recorded value as it is, for conditions in a template."""
        return self._entry(notebook, "values.json", name)

    def rows(self, notebook: str, name: str) -> list[dict[str, Any]]:
        """The rows of a saved table, by column; what is missing is None.

        Raises
        ------
        InputError
            If the notebook saved no such table.
        """
        path = self.folder / notebook / f"{name}.parquet"
        if not path.is_file():
            raise InputError(f"{path}: a page of the book needs this table; save it in the notebook")
        return _records(pd.read_parquet(path))

    def figure(self, notebook: str, name: str) -> Markup:
        """A saved figure as HTML, with a link to the notebook that made it."""
        texts = self._entry(notebook, "captions.json", name)
        source = f"results/{self.profile}/{notebook}/{texts['file']}"
        return Markup(
            f'<figure class="hicp"><img src="{source}" alt="{escaped(texts["alt"])}">'
            f"<figcaption>{escaped(texts['caption'])} "
            f'<a href="notebooks/{notebook}.html#{name}">How it was made</a></figcaption></figure>'
        )

    def stamp(self, notebook: str) -> dict[str, Any]:
        """What a notebook was made with."""
        return read_json(self.folder / notebook / "provenance.json")

    def repetition(self) -> dict[str, Any] | None:
        """This run beside the reference run of its profile; None where there is none.

        Returns
        -------
        dict or None
            The stamp of the reference run's last notebook (`stamp`), rows of how many outputs of a notebook
            agree (`counts`) and of those outside tolerance (`outside`), and why notebooks are not compared
            (`left_out`).
        """
        reference = REFERENCE_DIR / self.profile
        stamps = sorted(reference.glob("*/provenance.json"))
        if not stamps:
            return None
        rows, left_out = repetition.compare(reference, self.folder)
        counts = pd.crosstab(rows["notebook"], rows["verdict"])
        counts = counts.reindex(columns=repetition.VERDICTS, fill_value=0)
        counts.insert(0, "outputs", counts.sum(axis=1))
        outside = rows[rows["verdict"] == "outside"].drop(columns="verdict")
        told = {"counts": _records(counts.reset_index()), "outside": _records(outside)}
        return told | {"stamp": read_json(stamps[-1]), "left_out": left_out}

    def _entry(self, notebook: str, file: str, name: str) -> Any:
        path = self.folder / notebook / file
        entries = read_json(path)
        if name not in entries:
            known = ", ".join(entries) or "none"
            raise InputError(f"{path}: a page of the book needs '{name}'; the notebook recorded {known}")
        return entries[name]


def label(detector: str) -> str:
    """A detector's name in plain words.

    Examples
    --------
    >>> label("combined:movenet-thunder+mediapipe-hands"), label("mine")
    ('MoveNet Thunder + MediaPipe Hands', 'mine')
    """
    parts = detector.removeprefix(COMBINED).split("+")
    return " + ".join(DETECTORS[part].label if part in DETECTORS else part for part in parts)


def _records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a table by column; what is missing is None."""
    return table.astype(object).where(table.notna(), None).to_dict("records")


def render_page(source: Path, results: Results, profile: str) -> str:
    """Fill one Markdown template.

    Parameters
    ----------
    source : Path
        The page, with the names of this module's list between double braces.
    results : Results
    profile : str

    Returns
    -------
    str
        The page in Markdown.

    Raises
    ------
    InputError
        If the page uses a name that does not exist, or is not a valid template.
    """
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.finalize = lambda value: escaped(value) if type(value) is str else value  # except Markup
    offered = ("value", "raw", "rows", "figure", "stamp", "repetition")
    names = {name: getattr(results, name) for name in offered}
    names |= {"data": lambda name: json.loads((DATA_DIR / name).read_text())}
    names |= {"profile": profile, "notebooks": results.notebooks(), "label": label}
    try:
        return environment.from_string(source.read_text()).render(names)
    except jinja2.TemplateError as error:
        line = f", line {error.lineno}" if isinstance(error, jinja2.TemplateSyntaxError) else ""
        raise InputError(f"{source}{line}: {error.message}; correct the page") from None
