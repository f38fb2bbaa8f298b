"""What a notebook says to the report: its figures, tables and numbers, and what they were made with.

    study = Study("01_dataset", source=source, n_images=n_images, seed=seed)
    study.figure("crops", plots.crops(...))
    study.table("counts", counts, "Images per subset.")
    study.value("n_basic", len(basic))
    study.finish()

A notebook opened in Jupyter writes to `results/interactive/<name>/` of the study it lies in; `hicp report`
runs it into `results/<profile>/<name>/`. The book takes every number and figure from there.
"""

from __future__ import annotations

import base64
import io
import json
import math
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from hicp_lib.core import checkout
from hicp_lib.core.escape import escaped
from hicp_lib.core.extras import needs
from hicp_lib.core.files import atomic_path, write_bytes, write_json
from hicp_lib.study.provenance import peak_memory_mb, provenance, provenance_html

with needs("report"):
    import matplotlib as mpl
    import pyarrow as pa
    import pyarrow.parquet as pq
    from IPython.display import HTML, display
    from pandas.io.formats.style import Styler

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from hicp_lib.study.plots import Figure

SCHEMA_VERSION = 1
PLOTLY_MIME = "application/vnd.plotly.v1+json"
_PLOTLY_OPTIONS = {"displaylogo": False, "showSendToCloud": False, "responsive": True}
_SVG_STYLE: dict[Any, Any] = {"svg.hashsalt": "hicp", "svg.fonttype": "none"}
_SVG_OPTIONS: dict[str, Any] = {"format": "svg", "metadata": {"Date": None}}
_DRAWING_OPTIONS: dict[str, Any] = {"format": "webp", "pil_kwargs": {"lossless": True, "method": 4}}
_PICTURE_OPTIONS: dict[str, Any] = {"format": "webp", "pil_kwargs": {"quality": 75, "method": 4}}


class Study:
    """Collects what one notebook found.

    Parameters
    ----------
    name : str
        The notebook's file name without `.ipynb`.
    **parameters : dict
        Every parameter of the notebook's `parameters` cell, by its name; `hicp report` refuses a run whose
        stamp differs from what it was given.

    Attributes
    ----------
    folder : Path
        Where this run's results are written.
    results : Path
        Where the notebooks before this one left theirs, a folder each; in Jupyter, those of the last full
        report.
    stamp : dict of str to object
        What the provenance stamp is to say beside what every notebook's says.

    Examples
    --------
    >>> study = Study("05_tiny", seed=3)
    >>> study.folder.parts[-3:]
    ('results', 'interactive', '05_tiny')
    >>> study.value("ap", float("nan"))
    Traceback (most recent call last):
        ...
    ValueError: a result is nan; record None for what was not measured
    """

    def __init__(self, name: str, /, **parameters: Any):
        profile = os.environ.get(checkout.PROFILE_VARIABLE, "interactive")
        kept = checkout.working_folder() / "results"
        results = Path(os.environ.get(checkout.RESULTS_VARIABLE) or kept / profile)
        self.name = name
        self.parameters = _plain(parameters)
        self.folder = results / name
        self.results = Path(os.environ.get(checkout.EARLIER_RESULTS_VARIABLE) or kept / "full")
        self._link = f"../results/{profile}/{name}"
        self.stamp: dict[str, Any] = {}
        self._values: dict[str, Any] = {}
        self._captions: dict[str, dict[str, str]] = {}
        self._start_s = time.perf_counter()

    def figure(self, name: str, figure: Figure) -> None:
        """Save a figure and show it with its caption, alt text and downloads.

        A drawing is saved as WebP without loss and as SVG with its numbers, a picture (without any) as WebP.
        """
        file, downloads = f"{name}.webp", ["webp"]
        content = _rendered(figure.figure, _PICTURE_OPTIONS if figure.table is None else _DRAWING_OPTIONS)
        write_bytes(self.folder / file, content)
        if figure.table is not None:
            figure.figure.set_layout_engine("none")  # what was found for the WebP holds for the SVG
            write_bytes(self.folder / f"{name}.svg", _rendered(figure.figure, _SVG_OPTIONS))
            self._save_for_download(name, figure.table)
            downloads += ["svg", "parquet", "csv"]
        within = f"data:image/webp;base64,{base64.b64encode(content).decode()}"
        image = f'<img src="{within}" alt="{escaped(figure.alt)}">'
        self._show_figure(name, image, figure.caption, downloads, file=file, alt=figure.alt)

    def scene(self, name: str, scene: go.Figure, caption: str, alt: str) -> None:
        """Save an interactive 3D scene (its data as JSON) and show it.

        JupyterLab and VS Code draw the data with the plotly.js they bring; the book's page loads it once.

        Parameters
        ----------
        name : str
        scene : plotly.graph_objects.Figure
        caption, alt : str
        """
        drawn = json.loads(scene.to_json()) | {"config": _PLOTLY_OPTIONS}
        write_json(self.folder / f"{name}.json", drawn)
        words, place = escaped(alt), self._for_explorer("scene", name, drawn)
        place += f' style="min-height: {scene.layout.height or 450}px"'
        body = f'<div class="hicp-scene" role="group" tabindex="0" aria-label="{words}" {place}>{words}</div>'
        display({PLOTLY_MIME: drawn, "text/html": body}, raw=True)
        self._show_figure(name, "", caption, ["json"], alt=alt)

    def explorer(self, name: str, title: str, data: Any, files: Mapping[str, bytes]) -> None:
        """Save what a reader explores on the book's page, which reads it when it is opened there.

        JupyterLab shows nothing: a figure beside it says the same of a part of the data.

        Parameters
        ----------
        name : str
            Of the explorer: `book/_scripts/explore_NAME.js` draws it.
        title : str
        data : any
            Plain, and finite.
        files : mapping of str to bytes
            Pictures that it shows, by file name.
        """
        for file, content in files.items():
            write_bytes(self.folder / name / file, content)
        place = f'{self._for_explorer(name, name, data)} data-title="{escaped(title)}"'
        display(HTML(f'<div class="hicp-explorer" {place}></div>'))

    def table(
        self,
        name: str,
        table: pd.DataFrame,
        caption: str,
        digits: int = 3,
        shown: pd.DataFrame | None = None,
        explore: bool = False,
    ) -> None:
        """Save a table (Parquet, CSV) and show it; NaN is shown as a dash.

        Parameters
        ----------
        name : str
        table : pd.DataFrame
        caption : str
        digits : int
            Decimals of its floats, as shown.
        shown : pd.DataFrame, optional
            What the page shows in its place: fewer columns, texts with intervals.
        explore : bool, optional
            Whether the book's readers can sort and filter its rows.
        """
        self._save_for_download(name, table)
        cells = (table if shown is None else shown).rename(columns=escaped).map(_cell)
        style = Styler(cells, uuid=name, cell_ids=False).hide(axis="index")
        style.format(lambda value: f"{value:z.{digits}f}" if isinstance(value, float) else value, na_rep="–")
        body = style.to_html(table_attributes='class="table"')
        place = ' data-explorer="table"' if explore else ""
        self._show_figure(name, f'<div class="hicp-table"{place}>{body}</div>', caption, ["parquet", "csv"])

    def save(self, name: str, table: pd.DataFrame) -> None:
        """Save a table as Parquet without showing it; its parameters travel in the file's metadata."""
        arrow = pa.Table.from_pandas(table, preserve_index=False)
        stamp = {"schema": SCHEMA_VERSION, "notebook": self.name, "parameters": self.parameters}
        metadata = (arrow.schema.metadata or {}) | {b"hicp": json.dumps(stamp).encode()}
        with atomic_path(self.folder / f"{name}.parquet") as temporary:
            pq.write_table(arrow.replace_schema_metadata(metadata), temporary)

    def note(self, sentences: list[str]) -> None:
        """Show what could not be computed, and why, as a paragraph; nothing where there is nothing to say."""
        if sentences:
            display(HTML(f'<p class="hicp-note"><em>{escaped(" ".join(sentences))}</em></p>'))

    def value(self, name: str, value: Any) -> None:
        """Record a number, text or list for the prose of the book; None means "not run".

        Raises
        ------
        ValueError
            If it is not finite: a number is honest or absent.
        """
        self._values[name] = _plain(value)

    def finish(self) -> None:
        """Write the values and the provenance stamp, and show the stamp. The last line of every notebook."""
        stamp = {"notebook": self.name, "schema": SCHEMA_VERSION} | provenance(self.parameters)
        wall_s = round(time.perf_counter() - self._start_s, 2)
        stamp |= self.stamp | {"wall_s": wall_s, "peak_memory_mb": peak_memory_mb()}
        write_json(self.folder / "values.json", self._values, indent=2)
        write_json(self.folder / "captions.json", self._captions, indent=2)
        write_json(self.folder / "provenance.json", stamp, indent=2)
        display(HTML(provenance_html(stamp)))

    def _for_explorer(self, kind: str, name: str, data: Any) -> str:
        """Write data for a script of the book; the attributes that lead it there."""
        write_bytes(self.folder / name / "data.js", as_script(data))
        return f'data-explorer="{kind}" data-folder="{self._link}/{name}"'

    def _save_for_download(self, name: str, table: pd.DataFrame) -> None:
        self.save(name, table)
        write_bytes(self.folder / f"{name}.csv", table.to_csv(index=False).encode())

    def _show_figure(self, name: str, body: str, caption: str, downloads: list[str], **said: str) -> None:
        self._captions[name] = said | {"caption": caption}
        link = f'<a href="{self._link}/{name}.{{}}" download>{{}}</a>'
        links = " ".join(link.format(kind, kind.upper()) for kind in downloads)
        caption = f'{escaped(caption)} <span class="hicp-download">{links}</span>'
        whole = f"{body}<figcaption>{caption}</figcaption>"
        display(HTML(f'<figure class="hicp mathjax_ignore" id="{name}">{whole}</figure>'))


def as_script(data: Any) -> bytes:
    """Data as a script: a page that is read from disk may load that, but no JSON.

    Parameters
    ----------
    data : any
        Plain, and finite.

    Returns
    -------
    bytes

    Examples
    --------
    >>> as_script({"x_px": np.array([1, 2])})
    b'hicpData({"x_px":[1,2]});\\n'
    """
    return f"hicpData({json.dumps(_plain(data), separators=(',', ':'))});\n".encode()


def _cell(value: Any) -> Any:
    """Numbers as they are, and all else as text without markup."""
    is_number = pd.api.types.is_scalar(value) and not isinstance(value, str | bytes)
    return value if is_number else escaped(value)


def _rendered(figure, options: dict[str, Any]) -> bytes:
    """The same bytes for the same figure: no date, fixed identifiers."""
    buffer = io.BytesIO()
    with mpl.rc_context(_SVG_STYLE):
        figure.savefig(buffer, **options)
    return buffer.getvalue()


def _plain(value: Any) -> Any:
    """`value` with NumPy's types turned into JSON's; what is not finite is refused."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [_plain(item) for item in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"a result is {value}; record None for what was not measured")
    return str(value) if isinstance(value, Path) else value
