"""Interrupts of a Python host (Ctrl-C, any signal handler that raises), and PythonFMU's library at an exception.

An interrupt strikes in whatever Python code is running, that of an FMU included, where it is no fault of the component:
the call is completed or, if it is a step, refused, and the interrupt strikes again in the host after the call.
It strikes where a function begins, after what has been called returns, and where a loop goes round: what follows the
last call of a function is done as a whole. One that strikes outside of the function's `try` reaches the library.

At any exception PythonFMU's library gives up its references to the instance, to its class and to its log, and once more
when the instance is freed: the host would die then. `keep` adds the references that make up for it.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable
from functools import partial, wraps
from threading import Thread, get_ident
from time import sleep
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .variables import Variables

# int f(unsigned long thread, PyObject *exception, ignored): as the callback of a weak reference it is called with that
_raise_in = ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.c_ulong, ctypes.py_object, ctypes.py_object)(
    ("PyThreadState_SetAsyncExc", ctypes.pythonapi)
)


def keep(*held: object) -> None:
    """Add a reference to each, for good."""
    for each in held:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(each))


def again(interrupt: BaseException, message: object) -> object:
    """Let the interrupt strike again in this thread when the message is gone; the result must live until then.

    The library drops messages when it has logged them, at the end of a call, and no Python code runs between that and
    the host's. (Nothing that is called here could wait for it: interrupts strike after any call.)
    """
    return weakref.ref(message, partial(_raise_in, get_ident(), type(interrupt)))


def unbroken(call: Callable[..., Any]) -> Callable[..., Any]:
    """An FMI call that is made anew if an interrupt breaks out of it; the interrupt strikes again after it.

    It may have been complete already: a call must do no harm when it is made twice.
    """

    @wraps(call)
    def whole(self: Variables, *arguments: Any) -> Any:
        try:
            return call(self, *arguments)
        except Exception:
            raise
        except BaseException as interrupt:
            self.put_off(interrupt)
            return whole(self, *arguments)

    return whole


def unbroken_function(call: Callable[..., Any]) -> Callable[..., Any]:
    """The same for a call without an instance, which has no messages: the interrupt strikes again a little later."""

    @wraps(call)
    def whole(*arguments: Any) -> Any:
        try:
            return call(*arguments)
        except Exception:
            raise
        except BaseException as interrupt:
            Thread(target=_soon, args=(get_ident(), type(interrupt)), daemon=True).start()
            return whole(*arguments)

    return whole


def _soon(thread: int, kind: type[BaseException]) -> None:
    sleep(0.01)
    _raise_in(thread, kind, None)


class Messages(list[Any]):
    """The log of an instance, which the library alone holds, and so the place where its giving up is noticed.

    An interrupt that strikes before the first instruction of a call cannot be caught there, and reaches the library.
    That lets go of the instance first, whose traceback still holds it; at the end of its life nothing holds it.
    """

    def __init__(self, owner: Variables) -> None:
        super().__init__()
        self.owner = weakref.ref(owner)

    def __del__(self) -> None:
        owner = self.owner()
        if owner is not None and owner._messages() is self and not owner.failed:
            owner.failed = True
            keep(owner, type(owner), self)
