"""A kernel as Python calls it: chooses, loads or compiles the code for the types of arguments."""
from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import cache, cached_property, update_wrapper
import hashlib
import os
from pathlib import Path
from threading import RLock
from typing import Any, TYPE_CHECKING

import numpy as np
from qflsd_ros.core.kernels import machine_code
from qflsd_ros.core.kernels.store import NotKeptError, Store

if TYPE_CHECKING:
    from qflsd_ros.core.kernels.by_numba import Compiler

# Suffixes of files: for machine_code, and for numba, of what others call and of whole kernels.
SUFFIX, PART, WHOLE = '.kernel', '.part', '.whole'
# Lines of /proc/cpuinfo that say which instructions there are, on x86 and on ARM.
INSTRUCTIONS = ('vendor_id', 'cpu family', 'model', 'flags', 'CPU implementer', 'CPU architecture',
                'CPU variant', 'CPU part', 'Features')
# Bits of flags of numpy.ndarray (numpy/ndarraytypes.h).
C_ORDER, FORTRAN_ORDER, WRITEABLE = 0x1, 0x2, 0x400

# Scalars of numpy that numba takes for those of Python.
SAME: dict[type, type] = {np.float64: float, np.int64: int, np.bool_: bool}

# Compilation by one thread at a time: numba has a lock of its own, but not for its import.
_compiling = RLock()


class Kernel:
    """
    A function with a version in machine code for each combination of argument types.

    It is called with positional arguments: numbers, arrays, and tuples of them.

    Attributes
    ----------
    py_func
        The function in Python.
    module
        Name of its module.
    compiled
        How many times this process had to compile it, since the store did not have a version.
    is_kept
        Whether the store is used.

    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any],
                 store: Store) -> None:
        """Take the kernel in Python, options of numba, and where compiled ones are."""
        update_wrapper(self, function)
        self.py_func, self.module = function, function.__module__
        self.compiled, self.is_kept = 0, True
        self._options, self._store = options, store
        self._versions: dict[Hashable, Callable[..., Any]] = {}

    def __call__(self, *arguments: Any) -> Any:
        """Run the version for the types of the arguments."""
        types = tuple(map(type_of, arguments))
        version = self._versions.get(types)
        if version is None:
            with _compiling:
                version = self._versions[types] = self._version(types, arguments)
        return version(*arguments)

    @property
    def versions(self) -> int:
        """Return how many versions this process has loaded or compiled."""
        return len(self._versions)

    @property
    def _numba_type_(self) -> Any:
        """Return the type that numba gives this kernel where another one calls it."""
        from numba import types
        return types.Dispatcher(self._compiler.called)

    @cached_property
    def _compiler(self) -> Compiler:
        from qflsd_ros.core.kernels.by_numba import Compiler, NumbaCache
        compiler = Compiler(self.py_func, self._options)
        if self.is_kept:
            compiler.called._cache = NumbaCache(self, PART)
            if not machine_code.is_supported():
                compiler.whole._cache = NumbaCache(self, WHOLE)
        return compiler

    def _version(self, types: Hashable, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        """Load or compile a version."""
        if not (self.is_kept and machine_code.is_supported()):
            return self._compiler.function_for(arguments)
        if loaded := self._loaded(types):
            return loaded
        version = self._compiler.function_for(arguments)
        self.compiled += 1
        if content := self._compiler.object_file(arguments):
            self.write(types, SUFFIX, content)
        return version

    def _loaded(self, types: Hashable) -> Callable[..., Any] | None:
        """Return the version that was kept; None if there is none, or it cannot be loaded."""
        content = self.read(types, SUFFIX)
        if content is None:
            return None
        try:
            return machine_code.load(content, self.py_func.__name__)
        except ValueError as error:
            if self._store.is_final:
                raise NotKeptError(f'{self.module}.{self.py_func.__name__}') from error
            self._store.warn_unusable(error)
            return None

    def read(self, types: Hashable, suffix: str) -> bytes | None:
        """
        Return what was kept for types and this processor, None if there is nothing.

        NotKeptError instead of None if the store is final.
        """
        content = self._store.read(self._file_name(types) + suffix)
        if content is None and self._store.is_final:
            raise NotKeptError(f'{self.module}.{self.py_func.__name__}')
        return content

    def write(self, types: Hashable, suffix: str, content: bytes) -> None:
        """Keep something for types and this processor."""
        self._store.write(self._file_name(types) + suffix, content)

    def _file_name(self, types: Hashable) -> str:
        code = self.py_func.__code__
        key = repr((self.module, code.co_firstlineno, code.co_code.hex(), types, _processor()))
        return f'{self.py_func.__name__}-{hashlib.sha256(key.encode()).hexdigest()[:32]}'


def type_of(value: Any) -> Hashable:
    """Return what the code depends on: of an array its type, dimensions, order and access."""
    kind: Any = type(value)
    if kind is np.ndarray:
        flags = value.flags.num
        order = flags & C_ORDER or flags & FORTRAN_ORDER
        return value.dtype, value.ndim, order, flags & WRITEABLE
    if isinstance(value, tuple):
        return kind, *map(type_of, value)
    return SAME.get(kind, kind)


@cache
def _processor() -> str:
    """Return the instructions of this processor, and what the user tells numba about them."""
    lines = Path('/proc/cpuinfo').read_text().splitlines()
    said = sorted({line for line in lines if line.split('\t')[0] in INSTRUCTIONS})
    chosen = [os.environ.get(name, '') for name in ('NUMBA_CPU_NAME', 'NUMBA_CPU_FEATURES')]
    return hashlib.sha256('\n'.join(said + chosen).encode()).hexdigest()
