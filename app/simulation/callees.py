"""Functions that compiled code calls are compiled for that alone, which takes two thirds of the time.

Numba makes of every function what Python can call: a wrapper that takes all fields of all tuples and arrays
from Python's objects, often longer than the function, and machine code. Of a function that only other
compiled functions call, none of it is ever run, as its code is copied into theirs. So here such a function
is compiled apart, by a dispatcher of its own, without wrappers; machine code is made when somebody asks
where it is; and what is kept of it is LLVM's bitcode, from which callers are compiled. A function that
Python calls too is compiled for each.

Numba has no hook for any of this, so some of its methods are replaced; its version is pinned.
"""

from __future__ import annotations

from typing import Any, Final

from llvmlite.binding import Linkage
from numba.core import caching, types
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.cpu import CPUContext
from numba.core.dispatcher import Dispatcher
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher

_ENVIRONMENT: Final = "_ZN08NumbaEnv"
"""How names begin of variables that refer to a function's constants."""

_WRAPPER: Final = "_ZN7cpython"
"""How names begin of functions that Python calls."""

_WITHOUT_WRAPPERS: Final = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


class _CalleeFiles(caching.CompileResultCacheImpl):
    """Names the files apart from those of the same function for Python."""

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        base = super().get_filename_base(fullname, abiflags)  # type: ignore[no-untyped-call]  # untyped in numba
        return f"callee-{base}"


class _CalleeCache(caching.FunctionCache):
    _impl_class = _CalleeFiles


class Callee(CPUDispatcher):
    """A function as other compiled functions call it. Python cannot."""

    def enable_caching(self) -> None:
        """See numba."""
        self._cache = _CalleeCache(self.py_func)  # type: ignore[no-untyped-call]  # untyped in numba

    def add_overload(self, compiled: Any) -> None:
        """Keep a version for callers, and out of the table by which Python calls."""
        self.overloads[tuple(compiled.signature.args)] = compiled


def _callee(function: Any) -> Any:
    """Return the dispatcher by which compiled code calls a function."""
    if isinstance(function, Callee):
        return function
    try:
        return function._callee
    except AttributeError:
        callee = Callee(function.py_func, function.locals, function.targetoptions | _WITHOUT_WRAPPERS)
        if not isinstance(function._cache, caching.NullCache):
            callee.enable_caching()
        function._callee = callee
        return callee


_of_any_value: Any = types.unliteral
_environment: Any = lookup_environment


def _call_template(self: Any, args: Any, kws: Any) -> Any:
    """Type a call of a compiled function in another one by the types of its arguments, not by their values.

    Numba would compile a function once more for each number or truth value that stands in a call of it.
    """
    kws = {name: _of_any_value(given) for name, given in kws.items()}
    return _template_of_call(_callee(self), tuple(map(_of_any_value, args)), kws)


def _overload(self: Any, signature: Any) -> Any:
    return _overload_of(_callee(self), signature)


def _executable(self: Any, library: Any, described: Any, environment: Any) -> Any:
    """Return what Python calls, or something else to know a function by that has no wrapper."""
    if not _defines(library, described.llvm_cpython_wrapper_name):
        return object()
    executable = _executable_of(self, library, described, environment)
    # Those of its callees had no place before there was machine code.
    for variable in library._final_module.global_variables:
        if variable.name.startswith(_ENVIRONMENT) and (of_callee := _environment(variable.name)):
            library.codegen.set_env(variable.name, of_callee)
    return executable


def _pointer(self: Any, name: str) -> Any:
    """Return where a function of a library is, 0 if it has none of that name; make its machine code first."""
    self._ensure_finalized()
    if not _defines(self, name):
        return 0
    if not self.__dict__.get("_has_machine_code"):
        self._has_machine_code = True
        _add_module(self._codegen, self._final_module)
        _finalize_specific(self)
    return _pointer_to(self, name)


def _defines(library: Any, name: str) -> bool:
    module = library._shared_module or library._final_module
    try:
        return not module.get_function(name).is_declaration
    except NameError:
        return False


def _set_environment(self: Any, name: str, environment: Any) -> None:
    """Set the environment of a function, unless no machine code refers to it."""
    if self._engine.get_global_value_address(name):
        _set_environment_of(self, name, environment)


def _serialized(self: Any) -> Any:
    """Keep machine code where there is some, else bitcode."""
    made = self._object_caching_enabled and self._compiled_object is not None
    return _serialized_object(self) if made else self.serialize_using_bitcode()


def _optimize(self: Any) -> None:
    """Tell LLVM that what is copied into a function that Python calls is called nowhere else.

    Then it makes functions with one caller a part of it, and drops arguments that are not used: here tuples
    of some dozen arrays, which are hundreds of numbers a call. Searches make twice as many moves a second.
    """
    functions = [each for each in self._final_module.functions if not each.is_declaration]
    if any(each.name.startswith(_WRAPPER) for each in functions):
        for each in functions:
            if each.linkage == Linkage.linkonce_odr:
                each.linkage = Linkage.internal
    _optimize_whole(self)


def _replaced(kind: Any, method: str, by: Any) -> Any:
    """Replace a method of a class, and return what it was."""
    before = getattr(kind, method)
    setattr(kind, method, by)
    return before


def _later(*_: Any) -> None:
    """Do nothing: machine code is made by :func:`_pointer`."""


_template_of_call = _replaced(Dispatcher, "get_call_template", _call_template)
_overload_of = _replaced(Dispatcher, "get_overload", _overload)
_executable_of = _replaced(CPUContext, "get_executable", _executable)
_pointer_to = _replaced(JITCodeLibrary, "get_pointer_to_function", _pointer)
_add_module = _replaced(JITCPUCodegen, "_add_module", _later)
_finalize_specific = _replaced(JITCodeLibrary, "_finalize_specific", _later)
_set_environment_of = _replaced(JITCPUCodegen, "set_env", _set_environment)
_optimize_whole = _replaced(JITCodeLibrary, "_optimize_final_module", _optimize)
_serialized_object = _replaced(JITCodeLibrary, "serialize_using_object_code", _serialized)
