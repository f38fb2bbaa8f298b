"""Made-up result tables that claims are judged on."""

import json

import pandas as pd
import pytest


@pytest.fixture
def write(tmp_path):
    """Write rows as a result table, with the parameters its notebook ran with; photographs by default."""

    def write_table(rows, parameters=None, notebook="02", table="loss"):
        folder = tmp_path / notebook
        folder.mkdir(exist_ok=True)
        pd.DataFrame(rows).to_parquet(folder / f"{table}.parquet")
        stamp = {"parameters": {"source": "halpe"} if parameters is None else parameters}
        (folder / "provenance.json").write_text(json.dumps(stamp))
        return tmp_path

    return write_table
