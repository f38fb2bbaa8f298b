"""Every figure of the report: each function returns a `Figure` with its caption and alt text."""

from hicp_lib.extras import needs

with needs("report"):
    from hicp_lib.plots.style import Figure

__all__ = ["Figure"]
