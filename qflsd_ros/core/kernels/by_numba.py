"""
Compilation of a kernel by numba; imported only where a kernel is missing.

A kernel that is called by another one is linked into it.  What numba needs for that is kept as
well, since many kernels call the same ones: an interrupted compilation goes on where it was, and
processes that compile at the same time use what the others have.
"""
from __future__ import annotations

from collections.abc import Callable
import pickle
from typing import Any, TYPE_CHECKING

import numba
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

if TYPE_CHECKING:
    from qflsd_ros.core.kernels.kernel import Kernel


class Compiler:
    """
    Compiles one kernel.

    Attributes
    ----------
    called
        The kernel as other kernels call it, without the function for Python.
    whole
        The kernel as Python calls it.

    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        """Take the kernel in Python, and options of numba."""
        options = {'nogil': True, 'error_model': 'numpy', '_nrt': False, 'no_cfunc_wrapper': True,
                   **options}
        self.called = numba.njit(no_cpython_wrapper=True, **options)(function)
        self.whole = numba.njit(**options)(function)

    def function_for(self, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        """Return the function of Python for the types of some arguments."""
        function: Callable[..., Any] = self.whole.compile(self._signature(arguments))
        return function

    def object_file(self, arguments: tuple[Any, ...]) -> bytes | None:
        """
        Return what was compiled as an object file.

        None if it refers to objects of Python, or to addresses of this process.
        """
        result = self.whole.overloads[self._signature(arguments)]
        environments = result._find_referenced_environments()
        if result.library.has_dynamic_globals or any(each.consts for each in environments):
            return None
        content: bytes = result.library._get_compiled_object()
        return content

    def _signature(self, arguments: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(map(self.whole.typeof_pyval, arguments))


class NumbaCache(_Cache):
    """What numba asks for the compiled code of one kernel."""

    def __init__(self, kernel: Kernel, suffix: str) -> None:
        """Take the kernel, and the suffix of its files."""
        self._kernel, self._suffix = kernel, suffix

    @property
    def cache_path(self) -> str:
        """Return the suffix, for numba's statistics: the store knows the folder."""
        return self._suffix

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """Return what was kept for a signature, or None."""
        target_context.refresh()
        content = self._kernel.read(sig, self._suffix)
        return content and CompileResult._rebuild(target_context, *pickle.loads(content))

    def save_overload(self, sig: Any, data: CompileResult) -> None:
        """Keep what was compiled for a signature."""
        self._kernel.compiled += 1
        if not data.library.has_dynamic_globals:  # pointers, which the next process has elsewhere
            self._kernel.write(sig, self._suffix, dumps(data._reduce()))

    def enable(self) -> None:
        """Do nothing: numba asks for it and never for the opposite."""

    disable = flush = enable
