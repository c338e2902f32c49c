"""What pyproject.toml cannot say: where numpy has the headers that `enumsol.arithmetic._balls` is compiled with."""

import numpy as np
from setuptools import setup
from setuptools.command.build_ext import build_ext


class WithNumpy(build_ext):
    """Compile with numpy's headers as well."""

    def finalize_options(self) -> None:
        """Add them to the directories."""
        super().finalize_options()
        self.include_dirs.append(np.get_include())


setup(cmdclass={"build_ext": WithNumpy})
