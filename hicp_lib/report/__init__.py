"""The report: notebooks run under a profile, and the book built from them."""

from hicp_lib.core.extras import require

require("report", "jinja2", "jupyter_book", "nbformat", "papermill", "plotly", "psutil")
