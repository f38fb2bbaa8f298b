"""The packages of the distribution; everything else is in pyproject.toml.

`data` lies at the top of the checkout and is installed as `hicp_lib.data`, which a list of found packages
in pyproject.toml cannot say.
"""

from setuptools import find_packages, setup

setup(
    packages=[*find_packages(include=["hicp_lib*"]), "hicp_lib.data"],
    package_dir={"hicp_lib.data": "data"},
    package_data={"hicp_lib": ["py.typed"], "hicp_lib.data": ["*", "**/*"]},
)
