"""What JupyterLab writes when a notebook of the study is saved: its cells as edited, nothing of a run.

The outputs stay in the browser; what they say lies in `results/`.
"""

from pathlib import Path
from typing import Any

PROFILES_FILE = "profiles.toml"
_KERNEL = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}
_LEFT_BY_RUNS = {"collapsed", "execution", "jupyter", "scrolled", "trusted"}


def strip_study_notebook(model: dict[str, Any], path: str, contents_manager: Any, **_: Any) -> None:
    """Jupyter's pre-save hook: of a notebook beside a `profiles.toml`, drop what running and looking leave.

    Text, tags and all other metadata are saved as they are, and so is every other file.

    Parameters
    ----------
    model : dict
        What is to be saved, as Jupyter's contents API describes it; its `content` is changed in place.
    path : str
        Of the file, from the server's root.
    contents_manager : object
        Jupyter's ContentsManager; its `root_dir` is the server's root.
    """
    folder = Path(contents_manager.root_dir, path.strip("/")).parent
    if model["type"] != "notebook" or not (folder / PROFILES_FILE).is_file():
        return
    notebook = model["content"]
    notebook["metadata"] |= _KERNEL  # the browser adds the kernel's version
    for cell in notebook["cells"]:
        kept = {key: value for key, value in cell["metadata"].items() if key not in _LEFT_BY_RUNS}
        cell["metadata"] = kept
        if cell["cell_type"] == "code":
            cell |= {"outputs": [], "execution_count": None}


c.ContentsManager.pre_save_hook = strip_study_notebook  # noqa: F821
