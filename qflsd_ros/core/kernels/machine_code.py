"""
Kernels from the object files that LLVM has written, without LLVM and numba.

Both together take 120 MB of memory and half a second of a start.  What remains of a compiled
kernel is an ELF file of some kilobytes: code, constants, and a table of places to fill in with
addresses (relocations).  numba compiles in the large code model, so that each of these is an
absolute address of 64 bits on x86_64.

The entry of a kernel is the function that numba makes for Python, a PyCFunctionWithKeywords.  It
converts the arguments by functions of numba's extension module ``_helperlib``, which needs no
other part of numba.

Source: System V Application Binary Interface, chapters 4 and 5, and its supplement for AMD64.
"""
from __future__ import annotations

from collections.abc import Callable
import ctypes
from functools import cache
from importlib import machinery, util
import mmap
import os
import platform
from typing import Any

import numpy as np

MACHINE = 'x86_64'      # other processors have other relocations
ENTRY, ENVIRONMENT = b'_ZN7cpython', b'_ZN08NumbaEnv'   # beginnings of names, by numba
HELPER = b'numba_'      # begins the names of functions of _helperlib
PROGBITS, SYMTAB, RELA = 1, 2, 4                        # types of sections
ALLOCATED = 2           # flag of sections that belong into the memory
UNDEFINED, ABSOLUTE, COMMON = 0, 0xfff1, 0xfff2         # sections of symbols
ADDRESS = 1             # type of relocation: R_X86_64_64
SLOT = 8                # bytes of an address
METHOD = 3              # METH_VARARGS and METH_KEYWORDS
HEADER = np.dtype({'names': ['sections', 'number'], 'formats': ['<u8', '<u2'],
                   'offsets': [0x28, 0x3c], 'itemsize': 64})
SECTION = np.dtype([('name', '<u4'), ('type', '<u4'), ('flags', '<u8'), ('address', '<u8'),
                    ('offset', '<u8'), ('size', '<u8'), ('link', '<u4'), ('info', '<u4'),
                    ('alignment', '<u8'), ('row', '<u8')])
SYMBOL = np.dtype([('name', '<u4'), ('info', 'u1'), ('other', 'u1'), ('section', '<u2'),
                   ('value', '<u8'), ('size', '<u8')])
RELOCATION = np.dtype([('offset', '<u8'), ('type', '<u4'), ('symbol', '<u4'), ('addend', '<i8')])


class _Method(ctypes.Structure):
    """PyMethodDef of CPython."""

    _fields_ = (('name', ctypes.c_char_p), ('function', ctypes.c_void_p),
                ('flags', ctypes.c_int), ('doc', ctypes.c_char_p))


# Of loaded kernels, for as long as the process lives: functions that run refer to them.
_kept: list[Any] = []


def is_supported() -> bool:
    """Return whether object files of this processor can be loaded."""
    return platform.machine() == MACHINE


def load(content: bytes, name: str) -> Callable[..., Any]:
    """Return the function of Python of an object file; ValueError if it cannot be loaded."""
    sections = _table(content, SECTION, *np.frombuffer(content, HEADER, 1)[0].tolist())
    [table] = sections[sections['type'] == SYMTAB]
    symbols = _rows(content, table, SYMBOL)
    names = [_name(content, sections[table['link']], symbol) for symbol in symbols['name']]
    places, size = _places(sections)
    common = symbols['section'] == COMMON
    memory = mmap.mmap(-1, size + SLOT * int(common.sum()))
    image = np.frombuffer(memory, np.uint8)
    values = _values(symbols, names, places + image.ctypes.data)
    slots = size + SLOT * np.arange(common.sum())
    values[common] = image.ctypes.data + slots
    for section, place in zip(sections, places):
        if _is_loaded(section):
            image[place:place + section['size']] = _table(
                content, np.dtype(np.uint8), section['offset'], section['size'])
    for section in sections[sections['type'] == RELA]:
        if _is_loaded(sections[section['info']]):
            relocations = _rows(content, section, RELOCATION)
            if (relocations['type'] != ADDRESS).any():
                raise ValueError(f'{name}: the object file has other relocations than addresses')
            _fill(image, places[section['info']] + relocations['offset'],
                  values[relocations['symbol']] + relocations['addend'].astype(np.uint64))
    _fill(image, slots, np.full(len(slots), id(_environment()), np.uint64))
    _make_executable(image)
    [entry] = [int(value) for value, text in zip(values, names) if text.startswith(ENTRY)]
    return _function(entry, name, image)


def _table(content: bytes, row: np.dtype, offset: int, number: int) -> np.ndarray:
    return np.frombuffer(content, row, int(number), int(offset))


def _rows(content: bytes, section: np.void, row: np.dtype) -> np.ndarray:
    return _table(content, row, section['offset'], section['size'] // row.itemsize)


def _name(content: bytes, strings: np.void, offset: int) -> bytes:
    begin = int(strings['offset'] + offset)
    return content[begin:content.index(b'\0', begin)]


def _is_loaded(section: np.void) -> bool:
    """Return whether a section is code or constants; tables for unwinding are not needed."""
    return section['type'] == PROGBITS and bool(int(section['flags']) & ALLOCATED)


def _places(sections: np.ndarray) -> tuple[np.ndarray, int]:
    """Return where sections begin in the memory, and where addresses follow them."""
    places, end = np.zeros(len(sections), np.uint64), 0
    for number, section in enumerate(sections):
        if _is_loaded(section):
            end = _rounded(end, int(section['alignment']))
            places[number] = end
            end += int(section['size'])
    return places, _rounded(end, SLOT)


def _rounded(number: int, unit: int) -> int:
    return -(-number // unit) * unit


def _values(symbols: np.ndarray, names: list[bytes], places: np.ndarray) -> np.ndarray:
    """Return the addresses of symbols; those of undefined ones by their names."""
    values: np.ndarray = symbols['value'].copy()
    inside = (symbols['section'] != UNDEFINED) & (symbols['section'] < ABSOLUTE)
    values[inside] += places[symbols['section'][inside]]
    for number in np.flatnonzero(symbols['section'] == UNDEFINED):
        if names[number]:
            values[number] = _outside(names[number])
    return values


@cache
def _outside(name: bytes) -> int:
    """Return the address of a function of numba's, of Python or of the C library."""
    if name.startswith(HELPER):
        return int(_extension('_helperlib').c_helpers[name[len(HELPER):].decode()])
    try:
        found = getattr(ctypes.CDLL(None), name.decode())
    except AttributeError as error:
        raise ValueError(f'there is no {name.decode()} in this process') from error
    return ctypes.cast(found, ctypes.c_void_p).value or 0


@cache
def _extension(name: str) -> Any:
    """Return an extension module of numba without importing numba."""
    numba = util.find_spec('numba')
    assert numba is not None    # its version has been read
    spec = machinery.PathFinder.find_spec(f'numba.{name}', numba.submodule_search_locations)
    assert spec is not None and spec.loader is not None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@cache
def _environment() -> Any:
    """Return the objects of Python that a kernel refers to: ours refer to none."""
    return _extension('_dynfunc').Environment({})


def _fill(image: np.ndarray, places: np.ndarray, values: np.ndarray) -> None:
    """Write addresses, which need not be aligned, to places of the memory."""
    image[places.astype(np.int64)[:, None] + np.arange(SLOT)] = \
        values.astype('<u8').view(np.uint8).reshape(-1, SLOT)


def _make_executable(image: np.ndarray) -> None:
    """Make memory executable and read-only."""
    protect = ctypes.CDLL(None, use_errno=True).mprotect
    protect.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
    if protect(image.ctypes.data, image.nbytes, mmap.PROT_READ | mmap.PROT_EXEC):
        number = ctypes.get_errno()
        raise OSError(number, f'code cannot be made executable: {os.strerror(number)}')


def _function(entry: int, name: str, image: np.ndarray) -> Callable[..., Any]:
    method = _Method(name.encode(), entry, METHOD, None)
    _kept.append((method, image))
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, [ctypes.c_void_p] * 3
    function: Callable[..., Any] = make(ctypes.addressof(method), None, None)
    return function
