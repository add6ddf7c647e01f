"""Import numba without the settings of the current folder.

Numba reads `.numba_config.yaml` there, which anyone may have put beside a job: it could name a
folder of compiled code, and so run any code. It is imported here before all others.
"""

from __future__ import annotations

import os
import sys
import warnings
from typing import Any

from kerfpath.errors import InputError


def _config() -> Any:
    """Return the configuration of numba.

    Raises
    ------
    InputError
        Numba is not to compile anything, or refuses a variable of the environment.
    """
    known = {"yaml": sys.modules["yaml"]} if "yaml" in sys.modules else {}
    if "numba" not in sys.modules:
        sys.modules["yaml"] = None  # type: ignore[assignment]  # as if it were not installed
    try:
        with warnings.catch_warnings():
            for said in ("A Numba config file is found", "Environment variable 'NUMBA_"):
                warnings.filterwarnings("ignore", said)
            import numba
    except ValueError as error:
        said = " ".join(str(error).split())
        raise InputError(f"NUMBA_NUM_THREADS or the like: {said}; correct or unset it") from None
    finally:
        if "yaml" in sys.modules and sys.modules["yaml"] is None:
            del sys.modules["yaml"]
        sys.modules.update(known)
    config: Any = numba.config
    config._config_fname = os.devnull  # it looks again before it compiles
    if config.DISABLE_JIT:
        raise InputError(
            "NUMBA_DISABLE_JIT: expected kernels that are compiled, got their Python code; unset it"
        )
    return config


config = _config()
