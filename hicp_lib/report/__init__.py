"""The report: notebooks run under a profile, and the book built from them."""

from hicp_lib.core.extras import require

require("report", "jinja2", "jupyter_book", "nbformat", "papermill", "plotly", "psutil")

# Set for the kernel of a run: where its results go, where those of earlier notebooks are, and the profile's
# name. Absent in Jupyter.
RESULTS_VARIABLE = "HICP_RESULTS"
EARLIER_RESULTS_VARIABLE = "HICP_EARLIER_RESULTS"
PROFILE_VARIABLE = "HICP_PROFILE"
