"""Every figure of the report: each function returns a `Figure` with its caption and alt text."""

from hicp_lib.core.extras import needs

with needs("report"):
    from hicp_lib.study.plots.style import Figure

__all__ = ["Figure"]
