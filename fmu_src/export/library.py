"""PythonFMU's library for Linux, cured of the fault by which it can abort a host that has done its work.

It holds Python by a static shared_ptr, which C++ destroys at exit and when dlclose unloads the library. A function with
the attribute `destructor` releases it too: in an unloading before that, and then all is well; at exit after that, and
then it finds the count of owners in memory that has been freed, writes it back one less and, if it was one, calls what
it takes for a destructor there ("corrupted double-linked list", or a segmentation fault).

Here that function returns at once. In both cases the shared_ptr's own destructor does what there is to do, once. In the
library for Windows it always was so: nothing calls the function there.
"""

from __future__ import annotations

import hashlib
import warnings

FAULTY = "4be156a552c16f30eb4395805c59855d8d4086056d0f165442565f6c5fbac0c9"  # SHA-256, as it is in PythonFMU 0.7.0
PLACE = 0x16F34  # in the file, and in memory: `jmp finalizePythonInterpreter` in `onLibraryUnload`, after its endbr64
RETURN = b"\xc3"  # ret, instead of the jump's first byte, 0xe9


def cured(library: bytes) -> bytes:
    """The library without the fault; one that is not known is left as it is, with a warning."""
    if hashlib.sha256(library).hexdigest() != FAULTY:
        warnings.warn(
            "PythonFMU's library for Linux is not the one of version 0.7.0 that is known: it is left as it is, and may "
            f"abort a host at its very end ({__name__} says why)",
            stacklevel=2,
        )
        return library
    return library[:PLACE] + RETURN + library[PLACE + 1 :]
